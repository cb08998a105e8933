// @ts-check
// Worker: turns compressed pictures into bitmaps, away from the thread that answers the pointer.
import { HEADER, MEDIA } from "./frame.js";

self.addEventListener("message", async ({ data: { ticket, message, codec } }) => {
  const began = performance.now();
  try {
    const type = MEDIA[codec];
    if (!type) throw new Error(`codec ${codec} is unknown`);
    const bitmap = await createImageBitmap(new Blob([new Uint8Array(message, HEADER)], { type }));
    self.postMessage({ ticket, bitmap, decode_ms: performance.now() - began }, { transfer: [bitmap] });
  } catch (error) {
    self.postMessage({ ticket, error: String(error), decode_ms: performance.now() - began });
  }
});
