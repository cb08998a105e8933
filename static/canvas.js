// @ts-check
// The picture: frames from the socket through the decoder onto the canvas.
import { readHeader } from "./frame.js";

/** @typedef {import("./protocol.js").FrameHeader} FrameHeader */
/** @typedef {{header: FrameHeader, bytes: number, bitmap: ImageBitmap | null, decode_ms: number}} Job */

/** Pixels asked for unless the user chooses otherwise: those of 1280×720. */
const AREA = 1280 * 720;

export class Picture {
  /** Pictures drawn since the page was opened. */
  frames = 0;
  /** Pictures that could not be read. */
  broken = 0;
  /** @type {(FrameHeader & {bytes: number, decode_ms: number, at: number}) | null} */
  last = null;
  /** @type {"auto" | number} share of the screen's own pixels, or auto */
  resolution = "auto";

  #context;
  #worker = new Worker(new URL("decoder.js", import.meta.url), { type: "module" });
  /** @type {Map<number, Job>} */
  #decoding = new Map();
  /** @type {Job[]} */
  #decoded = [];
  #ticket = 0;
  #redraw = 0;

  /**
   * @param {HTMLCanvasElement} canvas
   * @param {{ack(frame: number, decode_ms: number): void, drawn(): void, broken(why: string): void}} on
   */
  constructor(canvas, on) {
    this.canvas = canvas;
    this.on = on;
    const context = canvas.getContext("2d");
    if (!context) throw new Error("this browser offers no 2D canvas");
    this.#context = context;
    this.#worker.addEventListener("message", ({ data }) => this.#receive(data));
    this.#worker.addEventListener("error", () => on.broken("the decoder could not be loaded"));
  }

  /** Takes a binary message from the socket. @param {ArrayBuffer} message */
  take(message) {
    /** @type {FrameHeader} */
    let header;
    try {
      header = readHeader(message);
    } catch (error) {
      this.broken += 1;
      this.on.broken(String(error));
      return;
    }
    const ticket = ++this.#ticket;
    this.#decoding.set(ticket, { header, bytes: message.byteLength, bitmap: null, decode_ms: 0 });
    this.#worker.postMessage({ ticket, message, codec: header.codec }, [message]);
  }

  /** Forgets what is under way: frame numbers start again with the next connection. */
  restart() {
    this.#decoding.clear();
    for (const job of this.#decoded.splice(0)) job.bitmap?.close();
  }

  /** @param {{ticket: number, bitmap?: ImageBitmap, error?: string, decode_ms: number}} result */
  #receive({ ticket, bitmap, error, decode_ms }) {
    const job = this.#decoding.get(ticket);
    this.#decoding.delete(ticket);
    if (!job) {
      bitmap?.close();
      return;
    }
    if (!bitmap) {
      this.broken += 1;
      this.on.broken(error ?? "");
      // Its credit must return, or the server would wait for ever.
      this.on.ack(job.header.frame, decode_ms);
      return;
    }
    this.#decoded.push({ ...job, bitmap, decode_ms });
    if (!this.#redraw) this.#redraw = requestAnimationFrame(() => this.#draw());
  }

  #draw() {
    this.#redraw = 0;
    const jobs = this.#decoded.splice(0).sort((a, b) => a.header.frame - b.header.frame);
    const newest = jobs.at(-1);
    if (!newest?.bitmap) return;
    const { canvas } = this;
    const { bitmap, header } = newest;
    if (canvas.width !== bitmap.width || canvas.height !== bitmap.height) {
      canvas.width = bitmap.width;
      canvas.height = bitmap.height;
      this.fit();
    } else {
      this.#context.clearRect(0, 0, canvas.width, canvas.height);
    }
    this.#context.drawImage(bitmap, 0, 0);
    this.frames += 1;
    this.last = { ...header, bytes: newest.bytes, decode_ms: newest.decode_ms, at: performance.now() };
    for (const job of jobs) {
      job.bitmap?.close();
      this.on.ack(job.header.frame, job.decode_ms);
    }
    this.on.drawn();
  }

  /** Size to ask the server for, in pixels. @returns {[number, number]} */
  wantedSize() {
    const { width, height } = this.canvas.getBoundingClientRect();
    const dense = [width, height].map((edge) => Math.max(1, edge) * devicePixelRatio);
    const [w = 1, h = 1] = dense;
    const share = this.resolution === "auto" ? Math.min(1, Math.sqrt(AREA / (w * h))) : this.resolution;
    /** @param {number} edge */
    const clamp = (edge) => Math.min(8192, Math.max(16, 2 * Math.round((edge * share) / 2)));
    return [clamp(w), clamp(h)];
  }

  /** Where the picture itself is inside the page: the canvas less the bars beside it. */
  rect() {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    if (this.#fills(width, height)) return { left, top, width, height };
    const scale = Math.min(width / this.canvas.width, height / this.canvas.height);
    const [w, h] = [this.canvas.width * scale, this.canvas.height * scale];
    return { left: left + (width - w) / 2, top: top + (height - h) / 2, width: w, height: h };
  }

  /** Whether the picture has the box's shape but for whole pixels. @param {number} width @param {number} height */
  #fills(width, height) {
    const ratio = (this.canvas.width * height) / (this.canvas.height * width);
    return Math.abs(ratio - 1) < 0.02;
  }

  /** Stretches a picture of nearly the box's shape over the box; any other keeps its own shape. */
  fit() {
    const { width, height } = this.canvas.getBoundingClientRect();
    this.canvas.style.objectFit = this.#fills(width, height) ? "fill" : "contain";
  }

  /** The picture as a PNG. @returns {Promise<Blob>} */
  blob() {
    return new Promise((resolve, reject) => {
      this.canvas.toBlob((blob) => (blob ? resolve(blob) : reject(new Error("the picture could not be encoded"))));
    });
  }
}
