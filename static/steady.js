// @ts-check
// Keeps a control still under the user's hand while the server's echoes of earlier values arrive.
import { equal } from "./scene.js";

/** @typedef {import("./protocol.js").Json} Json */

/** Milliseconds for which an answer to the last edit is awaited before the server's value is shown. */
const HOLD = 600;
const page = Math.random().toString(36).slice(2, 8);
let gestures = 0;

/** An id that joins the patches of one drag. */
export function freshGesture() {
  gestures += 1;
  return `${page}-${gestures}`;
}

export class Steady {
  /** The value last heard from the server. @type {Json} */
  latest = null;
  #known = false;
  /** @type {string | undefined} */
  #gesture;
  /** @type {Json | undefined} */
  #expected;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  #hold;

  /**
   * @param {string[]} path @param {import("./protocol.js").PanelContext} context
   * @param {(value: Json) => void} show
   */
  constructor(path, context, show) {
    this.path = path;
    this.context = context;
    this.show = show;
  }

  /** The value to build the next one from: what the user set, if the server has not answered yet. */
  get current() {
    return this.#expected ?? this.latest;
  }

  /** A step of a drag. @param {Json} value */
  drag(value) {
    this.#gesture ??= freshGesture();
    this.#expected = value;
    clearTimeout(this.#hold);
    this.context.edit(this.path, value, this.#gesture, false);
  }

  /** The end of a drag, or a single change. @param {Json} value */
  commit(value) {
    this.context.edit(this.path, value, this.#gesture, true);
    this.#gesture = undefined;
    this.#expected = value;
    clearTimeout(this.#hold);
    this.#hold = setTimeout(() => {
      this.#expected = undefined;
      this.show(this.latest);
    }, HOLD);
  }

  /** @param {Json} value */
  update(value) {
    if (this.#known && this.#expected === undefined && equal(this.latest, value)) return;
    this.#known = true;
    this.latest = value;
    if (this.#expected !== undefined) {
      if (this.#gesture || !equal(this.#expected, value)) return;
      clearTimeout(this.#hold);
      this.#expected = undefined;
    }
    this.show(value);
  }
}
