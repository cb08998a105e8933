// @ts-check
// Patches on their way to the server: at most one in 33 ms, the newest value of each parameter wins.
import { joinPatches, patchFor } from "./scene.js";

/** @typedef {import("./protocol.js").JsonObject} JsonObject */

const PERIOD = 33;

export class Edits {
  /** @type {{patch: JsonObject, gesture: string | undefined} | null} */
  #waiting = null;
  #sentAt = -Infinity;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  #timer;

  /** @param {(message: import("./protocol.js").ClientMessage) => boolean} send */
  constructor(send) {
    this.send = send;
  }

  /**
   * @param {string[]} path @param {import("./protocol.js").Json} value
   * @param {string} [gesture] joins the patches of one drag into one undo step
   * @param {boolean} [commit] ends the gesture
   */
  set(path, value, gesture, commit = true) {
    const patch = patchFor(path, value);
    if (commit) {
      this.#drop(gesture);
      this.send({ type: "patch", patch, ...(gesture ? { gesture } : {}), commit: true });
      return;
    }
    if (this.#waiting && this.#waiting.gesture !== gesture) this.#flush();
    this.#waiting = { patch: this.#waiting ? joinPatches(this.#waiting.patch, patch) : patch, gesture };
    this.#timer ??= setTimeout(() => this.#flush(), Math.max(0, this.#sentAt + PERIOD - performance.now()));
  }

  /** @param {string | undefined} gesture */
  #drop(gesture) {
    // The committed value replaces what waits of the same gesture; another gesture's goes first.
    if (this.#waiting?.gesture === gesture) this.#waiting = null;
    this.#flush();
  }

  #flush() {
    clearTimeout(this.#timer);
    this.#timer = undefined;
    if (!this.#waiting) return;
    const { patch, gesture } = this.#waiting;
    this.#waiting = null;
    this.#sentAt = performance.now();
    this.send({ type: "patch", patch, ...(gesture ? { gesture } : {}), commit: false });
  }
}
