// @ts-check
// Views that the user keeps, in this browser.
import { h, icon } from "./dom.js";

/** @typedef {import("./protocol.js").View} View */
/** @typedef {{view: View, image: string}} Bookmark */

const KEY = "tyndall.views";
const MOST = 9;

export class Bookmarks {
  /** @type {Bookmark[]} */
  #list = load();

  /** @param {HTMLElement} place @param {(view: View) => void} go */
  constructor(place, go) {
    this.place = place;
    this.go = go;
    this.#show();
  }

  /** Keeps a view with a small picture of it; the tenth pushes the first out. @param {View} view @param {HTMLCanvasElement} canvas */
  add(view, canvas) {
    this.#list = [...this.#list, { view, image: miniature(canvas) }].slice(-MOST);
    this.#save();
    return this.#list.length;
  }

  /** @param {number} number from 1 @returns {boolean} */
  recall(number) {
    const bookmark = this.#list[number - 1];
    if (bookmark) this.go(bookmark.view);
    return Boolean(bookmark);
  }

  #save() {
    try {
      localStorage.setItem(KEY, JSON.stringify(this.#list));
    } catch {
      // Without storage they last until the page is reloaded.
    }
    this.#show();
  }

  #show() {
    const items = this.#list.map((bookmark, i) => {
      const image = bookmark.image.startsWith("data:image/") ? [h("img", { src: bookmark.image, alt: "", width: 96, height: 60 })] : [];
      const open = h("button", { type: "button", class: "view", title: `Shift+${i + 1}` }, ...image, h("span", {}, `View ${i + 1}`));
      open.addEventListener("click", () => this.go(bookmark.view));
      const remove = h("button", { type: "button", class: "quiet remove", "aria-label": `Forget view ${i + 1}` }, icon("close"));
      remove.addEventListener("click", () => {
        this.#list = this.#list.filter((other) => other !== bookmark);
        this.#save();
      });
      return h("li", {}, open, remove);
    });
    this.place.replaceChildren(...items);
  }
}

/** @returns {Bookmark[]} */
function load() {
  try {
    const list = JSON.parse(localStorage.getItem(KEY) ?? "[]");
    return Array.isArray(list) ? list.filter((item) => Array.isArray(item?.view?.position) && typeof item.image === "string") : [];
  } catch {
    return [];
  }
}

/** @param {HTMLCanvasElement} canvas */
function miniature(canvas) {
  const small = document.createElement("canvas");
  small.width = 96;
  small.height = 60;
  const cover = Math.max(96 / canvas.width, 60 / canvas.height);
  const width = canvas.width * cover;
  const height = canvas.height * cover;
  small.getContext("2d")?.drawImage(canvas, (96 - width) / 2, (60 - height) / 2, width, height);
  return small.toDataURL("image/jpeg", 0.8);
}
