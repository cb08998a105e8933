// @ts-check
// Pointer, wheel and keys on the picture become camera movements.
import { basis, dolly, fly, orbit, pan, scale } from "./camera.js";

/** @typedef {import("./protocol.js").View} View */
/** @typedef {{left: number, top: number, width: number, height: number}} Rect */
/** @typedef {{x: number, y: number}} Point */

/** A drag over the picture's height goes half round the target. */
const TURN = Math.PI;
/** Distances to the target flown in a second. */
const SPEED = 0.6;
const FLIGHT = new Map([
  ["KeyA", [-1, 0, 0]], ["KeyD", [1, 0, 0]],
  ["KeyQ", [0, -1, 0]], ["KeyE", [0, 1, 0]],
  ["KeyS", [0, 0, -1]], ["KeyW", [0, 0, 1]],
]);
/** Arrow keys go round by five degrees. */
const ARROWS = new Map([["ArrowLeft", [-1, 0]], ["ArrowRight", [1, 0]], ["ArrowUp", [0, 1]], ["ArrowDown", [0, -1]]]);
const NUDGE = Math.PI / 36;

export class Gestures {
  /** @type {Map<number, Point>} */
  #pointers = new Map();
  #panning = false;
  /** @type {Set<string>} */
  #keys = new Set();
  #fast = false;
  #flown = 0;

  /**
   * @param {HTMLElement} element
   * @param {{rect(): Rect, view(): View, move(view: View): void}} on
   */
  constructor(element, on) {
    this.on = on;
    element.addEventListener("pointerdown", (event) => this.#down(element, event));
    element.addEventListener("pointermove", (event) => this.#move(event));
    for (const type of ["pointerup", "pointercancel", "lostpointercapture"]) {
      element.addEventListener(type, (event) => this.#pointers.delete(/** @type {PointerEvent} */ (event).pointerId));
    }
    element.addEventListener("wheel", (event) => this.#wheel(event), { passive: false });
    element.addEventListener("contextmenu", (event) => event.preventDefault());
    element.addEventListener("keydown", (event) => this.#arrow(event));
    addEventListener("keyup", (event) => this.release(event.code));
    addEventListener("blur", () => this.#keys.clear());
  }

  /** @param {HTMLElement} element @param {PointerEvent} event */
  #down(element, event) {
    if (event.button > 2) return;
    element.setPointerCapture(event.pointerId);
    element.focus({ preventScroll: true });
    this.#panning = event.button !== 0 || event.shiftKey;
    this.#pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    event.preventDefault();
  }

  /** @param {PointerEvent} event */
  #move(event) {
    const before = this.#pointers.get(event.pointerId);
    if (!before || this.#pointers.size > 2) return;
    const now = { x: event.clientX, y: event.clientY };
    const other = [...this.#pointers].find(([id]) => id !== event.pointerId)?.[1];
    this.#pointers.set(event.pointerId, now);
    if (other) this.#pinch(before, now, other);
    else if (this.#panning) this.#pan(before, now);
    else this.orbit((before.x - now.x) / this.on.rect().height, (now.y - before.y) / this.on.rect().height);
  }

  /** Goes round the target by shares of the picture's height. @param {number} across @param {number} up */
  orbit(across, up) {
    this.on.move(orbit(this.on.view(), across * TURN, up * TURN));
  }

  /** @param {Point} before @param {Point} now */
  #pan(before, now) {
    this.on.move(pan(this.on.view(), this.#place(before), this.#place(now), this.#aspect()));
  }

  /** @param {Point} before @param {Point} now @param {Point} other */
  #pinch(before, now, other) {
    /** @param {Point} a @param {Point} b */
    const middle = (a, b) => ({ x: (a.x + b.x) / 2, y: (a.y + b.y) / 2 });
    this.#pan(middle(before, other), middle(now, other));
    const spread = Math.hypot(before.x - other.x, before.y - other.y) / Math.max(1, Math.hypot(now.x - other.x, now.y - other.y));
    this.dolly(spread, middle(now, other));
  }

  /** @param {WheelEvent} event */
  #wheel(event) {
    event.preventDefault();
    const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 16 : event.deltaMode === WheelEvent.DOM_DELTA_PAGE ? 400 : 1;
    // A trackpad's pinch arrives as a wheel with Ctrl, in much smaller steps.
    const step = event.deltaY * lines * (event.ctrlKey ? 0.01 : 0.0012);
    this.dolly(Math.exp(Math.max(-1, Math.min(1, step))), { x: event.clientX, y: event.clientY });
  }

  /** Scales the distance about a point of the page, or about the middle. @param {number} factor @param {Point} [at] */
  dolly(factor, at) {
    const [x, y] = at ? this.#place(at) : [0, 0];
    this.on.move(dolly(this.on.view(), factor, x, y, this.#aspect()));
  }

  /** @param {KeyboardEvent} event */
  #arrow(event) {
    const way = ARROWS.get(event.key);
    if (way && !event.ctrlKey && !event.metaKey && !event.altKey) {
      const [x = 0, y = 0] = way;
      const view = this.on.view();
      this.on.move(event.shiftKey ? pan(view, [0, 0], [-x / 10, -y / 10], this.#aspect()) : orbit(view, x * NUDGE, y * NUDGE));
    } else if (event.key === "+" || event.key === "=") this.dolly(0.9);
    else if (event.key === "-") this.dolly(1 / 0.9);
    else return;
    event.preventDefault();
  }

  /** Starts to fly where the key is one of WASD QE. @param {KeyboardEvent} event @returns {boolean} */
  press(event) {
    if (!FLIGHT.has(event.code)) return false;
    this.#fast = event.shiftKey;
    if (this.#keys.size === 0) {
      this.#flown = performance.now();
      requestAnimationFrame((now) => this.#fly(now));
    }
    this.#keys.add(event.code);
    return true;
  }

  /** @param {string} code */
  release(code) {
    if (code.startsWith("Shift")) this.#fast = false;
    this.#keys.delete(code);
  }

  /** @param {number} now */
  #fly(now) {
    if (this.#keys.size === 0) return;
    const view = this.on.view();
    const { f, r, v, distance } = basis(view);
    // A page that was asleep must not leap.
    const seconds = Math.min(0.1, Math.max(0, now - this.#flown) / 1000);
    const step = distance * SPEED * (this.#fast ? 4 : 1) * seconds;
    this.#flown = now;
    let next = view;
    for (const code of this.#keys) {
      const [x = 0, y = 0, z = 0] = FLIGHT.get(code) ?? [];
      next = fly(next, scale(r, x * step));
      next = fly(next, scale(v, y * step));
      next = fly(next, scale(f, z * step));
    }
    this.on.move(next);
    requestAnimationFrame((then) => this.#fly(then));
  }

  #aspect() {
    const { width, height } = this.on.rect();
    return width / height;
  }

  /** Picture coordinates of a point of the page. @param {Point} point @returns {[number, number]} */
  #place({ x, y }) {
    const { left, top, width, height } = this.on.rect();
    return [(2 * (x - left)) / width - 1, 1 - (2 * (y - top)) / height];
  }
}
