// @ts-check
// The panel: groups of parameters, built from the schema of the scene.
import { parameter, readable } from "./controls.js";
import { h, iconButton } from "./dom.js";
import { complete, entrySchema, isObject, variantOf } from "./scene.js";

/** @typedef {import("./protocol.js").Json} Json */
/** @typedef {import("./protocol.js").Schema} Schema */
/** @typedef {import("./protocol.js").Control} Control */
/** @typedef {import("./protocol.js").PanelContext} PanelContext */
/** @typedef {{schema: Schema, path: string[], label: string, tab: string, framed: boolean}} Node */

/** Groups that are closed until the user opens them; they stand last. */
const CLOSED = new Set(["transform", "lamps", "boundary"]);

/** When a parameter means something, given the object that it stands in. @type {Record<string, (parent: {[key: string]: Json}) => boolean>} */
const RELEVANT = {
  "phase.g": ({ type }) => type === "hg",
  "phase.weight": ({ type }) => type === "drift",
  "medium.scatter_loss": ({ law }) => law === "threshold",
  "boundary.ior": ({ type }) => type !== "none",
  "boundary.absorption": ({ type }) => type !== "none",
  "color.map": ({ by }) => by !== "none",
  "color.window": ({ by }) => by !== "none",
  "color.alpha": ({ by }) => by !== "none",
};

/** @param {Schema} schema */
const isLeaf = (schema) => !schema.properties && !schema.oneOf && !entrySchema(schema);

export class Panel {
  /** @type {Control[]} */
  #roots = [];
  /** @type {HTMLElement[]} */
  #pages = [];

  /**
   * @param {Record<string, HTMLElement>} pages an element for each tab
   * @param {Schema} schema of the scene
   * @param {PanelContext} context
   */
  constructor(pages, schema, context) {
    this.context = context;
    this.#pages = Object.values(pages);
    for (const [want, page] of Object.entries(pages)) {
      const root = this.#build({ schema, path: [], label: "", tab: "", framed: false }, want);
      page.replaceChildren(...(root ? [root.element] : []));
      if (root) this.#roots.push(root);
    }
  }

  /** @param {import("./protocol.js").Scene} scene */
  update(scene) {
    for (const root of this.#roots) root.update(/** @type {any} */ (scene));
  }

  /** Shows a refusal beside the parameter it speaks of. @param {string} path @param {string} text @returns {boolean} */
  refuse(path, text) {
    const keys = path.split(".");
    for (; keys.length > 0; keys.pop()) {
      const selector = `[data-path="${CSS.escape(keys.join("."))}"]`;
      const row = this.#pages.map((page) => page.querySelector(selector)).find(Boolean);
      const error = row?.querySelector(".error");
      if (!row || !error) continue;
      row.classList.add("refused");
      error.textContent = text;
      return true;
    }
    return false;
  }

  /** @param {Node} node @param {string} want the tab to build for @returns {Control | null} */
  #build(node, want) {
    const { schema, path, label, tab } = node;
    if (isLeaf(schema)) return tab === want ? parameter(schema, path, label, this.context) : null;
    if (entrySchema(schema)) return this.#collection(node, want);
    if (schema.oneOf) return this.#tagged(node, want);
    return this.#object(node, want);
  }

  /** The parameters of an object, without a frame. @param {Node} node @param {string} want */
  #children({ schema, path, label, tab, framed }, want) {
    /** @type {{key: string, control: Control, leaf: boolean, relevant: ((parent: any) => boolean) | undefined}[]} */
    const children = [];
    const entries = Object.entries(schema.properties ?? {});
    /** @param {[string, Schema]} entry */
    const last = ([key, child]) => CLOSED.has(key) && !isLeaf(child);
    for (const [key, child] of [...entries.filter((entry) => !last(entry)), ...entries.filter(last)]) {
      if ("const" in child) continue;
      const leaf = isLeaf(child);
      const title = key === "type" && framed ? label : (child.title ?? readable(key));
      const control = this.#build({ schema: child, path: [...path, key], label: title, tab: child["x-tab"] ?? tab, framed: framed || hasLeaf(schema) }, want);
      if (control) children.push({ key, control, leaf, relevant: RELEVANT[`${path.at(-1)}.${key}`] });
    }
    return {
      some: children.length > 0,
      leaves: children.some(({ leaf }) => leaf),
      elements: children.map(({ control }) => control.element),
      /** @param {Json} value */
      update(value) {
        const object = isObject(value) ? value : {};
        for (const { key, control, relevant } of children) {
          if (relevant) control.element.hidden = !relevant(object);
          control.update(object[key] ?? null);
        }
      },
    };
  }

  /** @param {Node} node @param {string} want @returns {Control | null} */
  #object(node, want) {
    const { update, elements, some, leaves } = this.#children(node, want);
    if (!some) return null;
    const element = leaves && !node.framed ? frame(node.label, node.path, elements) : h("div", { class: "inner" }, ...elements);
    return { element, update };
  }

  /** An object whose `type` decides on its other keys. @param {Node} node @param {string} want @returns {Control | null} */
  #tagged(node, want) {
    const { schema, path, tab, framed } = node;
    if (tab !== want) return null;
    const words = (schema.oneOf ?? []).map((variant) => String(variant.properties?.type?.const ?? ""));
    const facts = { enum: words, description: schema.description ?? "" };
    const type = parameter(facts, [...path, "type"], framed ? node.label : "Kind", this.context);
    const body = h("div", { class: "inner" });
    /** @type {Control["update"]} */
    let updateBody = () => {};
    let shown = "";
    const elements = [...(type ? [type.element] : []), body];
    return {
      element: framed ? h("div", { class: "inner" }, ...elements) : frame(node.label, path, elements),
      update: (value) => {
        const word = isObject(value) ? String(value.type) : "";
        if (word !== shown) {
          shown = word;
          const children = this.#children({ ...node, schema: variantOf(schema, value), framed: true }, want);
          body.replaceChildren(...children.elements);
          updateBody = children.update;
        }
        type?.update(word);
        updateBody(value);
      },
    };
  }

  /** Values by name. @param {Node} node @param {string} want @returns {Control | null} */
  #collection(node, want) {
    const { schema, path, tab, label } = node;
    const entries = entrySchema(schema);
    if (!entries || !mentions(entries, want, tab)) return null;
    const editable = hasLeaf(entries);
    const list = h("div", { class: "inner" });
    /** @type {Map<string, Control>} */
    let controls = new Map();
    /** @param {string} name @param {boolean} headed */
    const entry = (name, headed) => {
      const control = this.#build({ schema: entries, path: [...path, name], label: name, tab, framed: editable }, want);
      if (!control || !headed) return control;
      const remove = iconButton("close", `Remove ${name}`, () => this.context.edit([...path, name], null));
      const head = h("div", { class: "entry" }, h("h3", {}, name), ...(tab === want ? [remove] : []));
      return { ...control, element: h("div", { class: "inner" }, head, control.element) };
    };
    /** @param {Json} value */
    const update = (value) => {
      const object = isObject(value) ? value : {};
      const names = Object.keys(object);
      if (names.join() !== [...controls.keys()].join()) {
        const built = names.map((name) => /** @type {const} */ ([name, entry(name, editable || names.length > 1)]));
        controls = new Map(built.flatMap(([name, control]) => (control ? [[name, control]] : [])));
        list.replaceChildren(...[...controls.values()].map(({ element }) => element));
      }
      for (const [name, control] of controls) control.update(object[name] ?? null);
    };
    if (!editable) return { element: list, update };
    const one = (path.at(-1) ?? "").replace(/s$/, "");
    const add = h("button", { type: "button" }, `Add ${readable(one).toLowerCase()}`);
    add.addEventListener("click", () => {
      let n = controls.size + 1;
      while (controls.has(`${one}${n}`)) n += 1;
      this.context.edit([...path, `${one}${n}`], complete(entries, {}));
    });
    return { element: frame(label, path, [list, add]), update };
  }
}

/** @param {Schema} schema */
function hasLeaf(schema) {
  return Object.values(schema.properties ?? {}).some((child) => isLeaf(child) && !("const" in child));
}

/** Whether anything inside belongs to the tab. @param {Schema} schema @param {string} want @param {string} tab @returns {boolean} */
function mentions(schema, want, tab) {
  const own = schema["x-tab"] ?? tab;
  if (isLeaf(schema) || schema.oneOf) return own === want;
  return Object.values(schema.properties ?? {}).some((child) => mentions(child, want, own));
}

const KEY = "tyndall.groups";

/** @returns {Record<string, boolean>} */
function groupsLeft() {
  try {
    return JSON.parse(localStorage.getItem(KEY) ?? "{}");
  } catch {
    return {};
  }
}

/** A group that can be closed; the browser remembers which are. @param {string} title @param {string[]} path @param {HTMLElement[]} elements */
function frame(title, path, elements) {
  const key = path.at(-1) ?? "";
  const open = groupsLeft()[key] ?? !CLOSED.has(key);
  const details = h("details", { class: "group", open }, h("summary", {}, h("h2", {}, title)), h("div", { class: "rows" }, ...elements));
  details.addEventListener("toggle", () => {
    try {
      localStorage.setItem(KEY, JSON.stringify({ ...groupsLeft(), [key]: details.open }));
    } catch {
      // Without storage the groups open as they first did.
    }
  });
  return details;
}
