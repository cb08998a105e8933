// @ts-check
// The strip of presets, and the same names in the header.
import { address, getJson } from "./api.js";
import { h } from "./dom.js";
import { complain } from "./files.js";

/** @typedef {import("./protocol.js").Preset} Preset */

/** A hue that is always the same for a name, for tiles without a picture. @param {string} name */
function hueOf(name) {
  let hash = 7;
  for (const letter of name) hash = (hash * 31 + letter.charCodeAt(0)) % 360;
  return hash;
}

/**
 * @param {{strip: HTMLElement, select: HTMLSelectElement}} places
 * @param {(scene: import("./protocol.js").JsonObject) => Promise<unknown>} choose
 * @returns {Promise<{mark(title: string): void}>}
 */
export async function showPresets({ strip, select }, choose) {
  /** @type {Preset[]} */
  const presets = await getJson("api/v1/presets");
  /** @param {Preset} preset */
  const open = async ({ name }) => {
    try {
      await choose(await getJson(`api/v1/presets/${encodeURIComponent(name)}`));
    } catch (error) {
      complain(error);
    }
  };
  const tiles = presets.map((preset) => {
    const button = tile(preset);
    button.addEventListener("click", () => open(preset));
    return button;
  });
  strip.replaceChildren(...tiles);
  const own = h("option", { value: "", hidden: true }, "Own scene");
  select.replaceChildren(own, ...presets.map(({ name, title }) => h("option", { value: name }, title || name)));
  select.addEventListener("change", () => {
    const preset = presets.find(({ name }) => name === select.value);
    if (preset) open(preset);
  });
  return {
    mark(title) {
      const chosen = presets.find((preset) => preset.title === title && title !== "");
      select.value = chosen?.name ?? "";
      own.textContent = title || "Own scene";
      presets.forEach((preset, i) => {
        const on = String(preset === chosen);
        if (tiles[i]?.getAttribute("aria-pressed") === on) return;
        tiles[i]?.setAttribute("aria-pressed", on);
      });
    },
  };
}

/** @param {Preset} preset */
function tile({ name, title, description }) {
  const image = h("img", { src: address(`thumbs/${encodeURIComponent(name)}.jpg`).href, alt: "", loading: "lazy", width: 240, height: 150 });
  image.addEventListener("error", () => image.remove());
  const button = h("button", { type: "button", class: "tile", "aria-pressed": "false", title: description || title }, image, h("span", {}, title || name));
  button.style.setProperty("--hue", String(hueOf(name)));
  return button;
}
