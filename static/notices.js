// @ts-check
// Messages: short ones that pass, and the one that stays while there is no connection.
import { remember, session } from "./api.js";
import { byId, h } from "./dom.js";

const SHOWN = 5000;

/** Says something in passing; assistive technology reads it out. @param {string} text @param {"info" | "error"} [level] */
export function toast(text, level = "info") {
  const list = byId("toasts", HTMLElement);
  const item = h("p", { class: level }, text);
  if (list.lastElementChild?.textContent === text) list.lastElementChild.remove();
  for (const old of [...list.children].slice(0, -2)) old.remove();
  list.append(item);
  setTimeout(() => item.remove(), SHOWN);
}

/** @typedef {{title: string, text: string, action?: () => HTMLElement}} Message */

/** @param {string} label @param {() => void} click */
function button(label, click) {
  const element = h("button", { type: "button", class: "primary" }, label);
  element.addEventListener("click", click);
  return element;
}

/**
 * Shows why there is no picture, or takes the message away.
 * @param {import("./protocol.js").LinkState} state @param {() => void} retry
 */
export function explain(state, retry) {
  /** @type {Record<import("./protocol.js").LinkState, Message | null>} */
  const messages = {
    open: null,
    connecting: { title: "Connecting", text: "Waiting for the first picture." },
    gone: {
      title: "The server is gone",
      text: "It does not answer. This page keeps trying; the scene is kept.",
      action: () => button("Try now", retry),
    },
    forbidden: {
      title: "No live connection",
      text: "The server answers, but the connection for pictures is refused: a proxy without WebSocket support, or an origin that the server does not know.",
      action: () => button("Try again", retry),
    },
    unauthorized: { title: "A token is needed", text: "The server printed it when it started.", action: () => tokenForm(retry) },
    "no-session": {
      title: "No such session",
      text: `The server has no session named “${session}”.`,
      action: () => h("a", { class: "button primary", href: location.pathname }, "Open the main session"),
    },
  };
  const overlay = byId("overlay", HTMLElement);
  const message = messages[state];
  overlay.hidden = !message;
  overlay.dataset.state = state;
  if (!message) return;
  overlay.replaceChildren(
    h("div", { class: "spinner", "aria-hidden": "true" }),
    h("h2", {}, message.title),
    h("p", {}, message.text),
    ...(message.action ? [message.action()] : []),
  );
}

/** @param {() => void} retry */
function tokenForm(retry) {
  const input = h("input", { type: "password", "aria-label": "Token", autocomplete: "current-password", required: true, placeholder: "Token" });
  const form = h("form", {}, input, h("button", { class: "primary" }, "Open"));
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    remember(input.value.trim());
    retry();
  });
  return form;
}
