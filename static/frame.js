// @ts-check
// The 40 bytes before every picture.

/** Bytes of the header. */
export const HEADER = 40;
/** Media type of the payload, by codec number. */
export const MEDIA = ["image/png", "image/jpeg"];

/**
 * Reads the header, or throws an Error that says what is wrong with it.
 * @param {ArrayBuffer} message @returns {import("./protocol.js").FrameHeader}
 */
export function readHeader(message) {
  if (message.byteLength <= HEADER) throw new Error(`a frame of ${message.byteLength} bytes holds no picture`);
  const view = new DataView(message);
  const version = view.getUint8(0);
  if (version !== 1) throw new Error(`header version ${version}, not 1`);
  const flags = view.getUint8(2);
  return {
    codec: view.getUint8(1),
    key: (flags & 1) !== 0,
    final: (flags & 2) !== 0,
    lossless: (flags & 4) !== 0,
    width: view.getUint16(4, true),
    height: view.getUint16(6, true),
    frame: view.getUint32(8, true),
    seq: view.getUint32(12, true),
    rev: view.getUint32(16, true),
    spp: view.getUint32(20, true),
    began: Number(view.getBigUint64(24, true)),
    render_us: view.getUint32(32, true),
    encode_us: view.getUint32(36, true),
  };
}
