// @ts-check
// The WebSocket: connects, comes back after a loss, and says why it cannot.
import { sessionAddress } from "./api.js";

/** @typedef {import("./protocol.js").ClientMessage} ClientMessage */
/** @typedef {import("./protocol.js").ServerMessage} ServerMessage */
/** @typedef {import("./protocol.js").LinkState} LinkState */

const FIRST_WAIT = 250;
const LONGEST_WAIT = 5000;

export class Socket {
  /** @type {LinkState} */
  state = "connecting";
  /** @type {WebSocket | null} */
  #socket = null;
  #wait = FIRST_WAIT;
  #failures = 0;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  #timer;

  /**
   * @param {{
   *   hello(): ClientMessage, message(message: ServerMessage): void, frame(frame: ArrayBuffer): void,
   *   state(state: LinkState): void,
   * }} on
   */
  constructor(on) {
    this.on = on;
    addEventListener("online", () => this.retry());
  }

  connect() {
    clearTimeout(this.#timer);
    const url = sessionAddress("ws");
    url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(url, "tyndall.v1");
    socket.binaryType = "arraybuffer";
    this.#socket = socket;
    socket.addEventListener("open", () => this.send(this.on.hello()));
    socket.addEventListener("message", ({ data }) => {
      if (data instanceof ArrayBuffer) this.on.frame(data);
      else this.#hear(data);
    });
    socket.addEventListener("close", () => {
      if (socket !== this.#socket) return;
      this.#socket = null;
      this.#lost();
    });
  }

  /** Tries again at once. */
  retry() {
    if (this.#socket) return;
    this.#wait = FIRST_WAIT;
    this.connect();
  }

  /** Sends a message, or drops it where there is no connection. @param {ClientMessage} message @returns {boolean} */
  send(message) {
    if (this.#socket?.readyState !== WebSocket.OPEN) return false;
    this.#socket.send(JSON.stringify(message));
    return true;
  }

  /** @param {string} text */
  #hear(text) {
    /** @type {ServerMessage} */
    let message;
    try {
      message = JSON.parse(text);
    } catch {
      return;
    }
    if (message.type === "welcome") {
      this.#wait = FIRST_WAIT;
      this.#failures = 0;
      this.#become("open");
    }
    this.on.message(message);
  }

  async #lost() {
    if (this.state === "open") this.#become("connecting");
    const wait = this.#wait;
    this.#wait = Math.min(LONGEST_WAIT, this.#wait * 2);
    this.#timer = setTimeout(() => this.connect(), wait * (0.75 + Math.random() / 2));
    // A browser does not tell a page why an upgrade failed; the same session over HTTP does.
    const state = await this.#reason();
    if (this.#socket?.readyState !== WebSocket.OPEN) this.#become(state);
    // Only the user can put that right.
    if (state === "unauthorized") clearTimeout(this.#timer);
  }

  /** @returns {Promise<LinkState>} */
  async #reason() {
    try {
      const { status } = await fetch(sessionAddress("scene"), { cache: "no-store", signal: AbortSignal.timeout(LONGEST_WAIT) });
      if (status === 401) return "unauthorized";
      if (status === 403) return "forbidden";
      if (status === 404) return "no-session";
      if (status >= 500) return "gone";
      // It answers, and yet no socket opens: something on the way refuses upgrades.
      return ++this.#failures > 3 ? "forbidden" : "connecting";
    } catch {
      return "gone";
    }
  }

  /** @param {LinkState} state */
  #become(state) {
    if (state === this.state) return;
    this.state = state;
    this.on.state(state);
  }
}
