// @ts-check
// The line under the picture: how fast, how far, how much.
import { byId } from "./dom.js";

/** @typedef {import("./protocol.js").Stats} Stats */
/** @typedef {import("./canvas.js").Picture} Picture */

/** Seconds over which the page counts what arrives. */
const WINDOW = 2;

/** @param {number} x */
const brief = (x) => (x >= 100 ? x.toFixed(0) : x >= 10 ? x.toFixed(1) : x.toFixed(2));

export class Status {
  /** @type {{at: number, bytes: number}[]} */
  #seen = [];
  #parts = {
    samples: byId("samples", HTMLElement),
    speed: byId("speed", HTMLElement),
    time: byId("time", HTMLElement),
    rate: byId("rate", HTMLElement),
    size: byId("size", HTMLElement),
    steps: byId("steps", HTMLElement),
    adapter: byId("adapter", HTMLElement),
  };
  #bar = byId("progress", HTMLElement);

  /** @param {import("./protocol.js").Info} info */
  about({ adapter }) {
    this.#parts.adapter.textContent = adapter?.name ? `${adapter.name}${adapter.backend ? ` · ${adapter.backend}` : ""}` : "";
    this.#parts.adapter.title = this.#parts.adapter.textContent;
  }

  /** Counts a picture that was drawn. @param {{bytes: number, at: number}} frame */
  count({ bytes, at }) {
    this.#seen.push({ bytes, at });
  }

  /**
   * @param {{picture: Picture, stats: Stats | null, target: number, latency: number | null}} now
   */
  show({ picture, stats, target, latency }) {
    const { last } = picture;
    if (!last) return;
    const since = performance.now() - WINDOW * 1000;
    this.#seen = this.#seen.filter(({ at }) => at > since);
    const bits = 8 * this.#seen.reduce((sum, { bytes }) => sum + bytes, 0);
    const share = Math.min(1, last.spp / Math.max(1, target));
    const parts = this.#parts;
    write(parts.samples, `${last.spp.toLocaleString("en")} / ${target.toLocaleString("en")} spp${last.final ? " · done" : ""}`);
    write(parts.speed, last.final ? "" : `${(this.#seen.length / WINDOW).toFixed(0)} fps`);
    const server = stats ? stats.simulate_ms + stats.render_ms : last.render_us / 1000;
    write(parts.time, `${brief(server)} ms${latency === null ? "" : ` · ${latency.toFixed(0)} ms to screen`}`);
    write(parts.rate, last.final ? "" : `${brief(bits / WINDOW / 1e6)} Mbit/s`);
    write(parts.size, `${last.width}×${last.height}${last.lossless ? " lossless" : ""}`);
    write(parts.steps, stats ? `step ${stats.steps.toLocaleString("en")}` : "");
    this.#bar.style.setProperty("--share", String(last.final ? 1 : share));
    this.#bar.setAttribute("aria-valuenow", String(Math.round(100 * (last.final ? 1 : share))));
    this.#bar.classList.toggle("done", last.final);
  }
}

/** @param {HTMLElement} element @param {string} text */
function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
