// @ts-check
// The camera as this page holds it, and its messages: at most one a frame, the newest wins.

/** @typedef {import("./protocol.js").View} View */
/** @typedef {import("./protocol.js").Scene} Scene */
/** @typedef {import("./protocol.js").Vec3} Vec3 */

/** Milliseconds for which a measured latency is worth telling. */
const FRESH = 3000;

/** The shortest decimal that a 32-bit float reads back, which is how the server writes it to others. @param {number} x */
export function short(x) {
  const float = Math.fround(x);
  for (let digits = 6; digits < 9; digits += 1) {
    const decimal = Number(float.toPrecision(digits));
    if (Math.fround(decimal) === float) return decimal;
  }
  return Number(float.toPrecision(9));
}

/** @param {readonly number[]} v @returns {Vec3} */
const shortVec = (v) => [short(v[0] ?? 0), short(v[1] ?? 0), short(v[2] ?? 0)];

export class Rig {
  /** @type {View} */
  view = { position: [1.6, 0.9, -2.1], target: [0, 0, 0], up: [0, 1, 0], fov_y: 32 };
  /** Where Home goes. @type {View} */
  home = this.view;
  #seq = 0;
  #pending = 0;
  /** @type {Map<number, number>} */
  #sent = new Map();
  #latency = 0;
  #measured = -Infinity;

  /**
   * @param {(message: import("./protocol.js").ClientMessage) => boolean} send
   * @param {(view: View) => void} moved
   */
  constructor(send, moved) {
    this.send = send;
    this.moved = moved;
  }

  /** Takes over the camera of a scene from the server. @param {Scene} scene */
  adopt({ camera: { position, target, up, fov_y } }) {
    this.view = { position, target, up, fov_y };
  }

  /** Moves the camera and tells the server within this animation frame. @param {View} view */
  move({ position, target, up, fov_y }) {
    if (![...position, ...target, ...up, fov_y].every(Number.isFinite)) return;
    this.view = { position, target, up, fov_y };
    if (!this.#pending) this.#pending = requestAnimationFrame(() => this.#flush());
  }

  #flush() {
    this.#pending = 0;
    const { position, target, up, fov_y } = this.view;
    const camera = { position: shortVec(position), target: shortVec(target), up: shortVec(up), fov_y: short(fov_y) };
    this.#seq += 1;
    if (this.send({ type: "camera", seq: this.#seq, ...camera })) this.#sent.set(this.#seq, performance.now());
    this.moved(camera);
  }

  /** Milliseconds from a movement to its picture on the screen; null where the camera has long stood still. */
  get latency() {
    return performance.now() - this.#measured < FRESH ? this.#latency : null;
  }

  /** Notes that a picture with this `seq` is on the screen. @param {number} seq */
  shown(seq) {
    const sent = this.#sent.get(seq);
    if (sent === undefined) return;
    this.#measured = performance.now();
    this.#latency = this.#measured - sent;
    for (const earlier of this.#sent.keys()) if (earlier <= seq) this.#sent.delete(earlier);
  }

  /** Numbers start again with every connection. */
  restart() {
    this.#seq = 0;
    this.#sent.clear();
    this.#measured = -Infinity;
  }
}
