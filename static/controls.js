// @ts-check
// One parameter, one row: native inputs for numbers, words, switches and nullable values.
import { colorField, directionField, vectorField } from "./fields.js";
import { freshId, h, icon } from "./dom.js";
import { NOTCHES, fromSlider, numeric, sliderOf, spinOf, stepOf, toSlider } from "./numbers.js";
import { equal } from "./scene.js";
import { Steady } from "./steady.js";

/** @typedef {import("./protocol.js").Json} Json */
/** @typedef {import("./protocol.js").Schema} Schema */
/** @typedef {import("./protocol.js").Control} Control */
/** @typedef {import("./protocol.js").PanelContext} PanelContext */
/**
 * The inputs inside a row.
 * @typedef {{elements: HTMLElement[], show(value: Json): void, labelled?: HTMLElement}} Field
 */
/** @typedef {{label: string, describedby: string, steady: Steady}} Place */

/** Units short enough to stand beside a name. */
const SHORT_UNIT = 7;

/** Words whose capitals cannot be guessed. @type {Record<string, string>} */
const NAMES = { beer: "Beer–Lambert", hg: "Henyey–Greenstein", agx: "AgX", aces: "ACES", sph: "SPH" };

/** Words of the documents, made readable. @param {string} word */
export function readable(word) {
  if (NAMES[word]) return NAMES[word];
  const text = word.replaceAll("_", " ");
  return text.charAt(0).toUpperCase() + text.slice(1);
}

/**
 * A row for the value at `path`, or null where there is nothing to choose.
 * @param {Schema} schema @param {string[]} path @param {string} label @param {PanelContext} context
 * @returns {Control | null}
 */
export function parameter(schema, path, label, context) {
  if (schema.enum && schema.enum.length < 2) return null;
  const id = freshId();
  /** @type {Field} */
  let field;
  const steady = new Steady(path, context, (value) => {
    field.show(value);
    reset.hidden = schema.default === undefined || equal(value, schema.default);
  });
  const describedby = `${id}-about ${id}-error`;
  field = fieldFor(schema, { label, describedby, steady }, context);

  const unit = schema.unit && schema.unit.length <= SHORT_UNIT ? h("span", { class: "unit" }, schema.unit) : "";
  const target = field.labelled;
  if (target) target.id = id;
  const name = h(target ? "label" : "span", { class: "name", ...(target ? { for: id } : { id: `${id}-name` }) }, label, unit);
  const reset = h("button", { type: "button", class: "quiet reset", "aria-label": `Reset ${label}`, title: "Back to the default" }, icon("reset"));
  reset.addEventListener("click", () => steady.commit(null));
  /** A refusal stays until the next attempt. */
  const forget = () => {
    error.textContent = "";
    element.classList.remove("refused");
  };
  const error = h("p", { class: "error", id: `${id}-error` });
  const about = [schema.description, schema.unit && unit === "" ? `In ${schema.unit}.` : ""].filter(Boolean).join(" ");
  const element = h(
    "div", { class: "row", "data-path": path.join("."), "data-hint": about },
    name, h("div", { class: "field" }, ...field.elements), reset,
    h("span", { hidden: true, id: `${id}-about` }, about), error,
  );
  for (const type of ["input", "change", "click"]) element.addEventListener(type, forget);
  if (!target) {
    element.setAttribute("role", "group");
    element.setAttribute("aria-labelledby", `${id}-name`);
  }
  return { element, update: (value) => steady.update(value) };
}

/** @param {Schema} schema @param {Place} place @param {PanelContext} context @returns {Field} */
function fieldFor(schema, place, context) {
  const constant = schema.anyOf?.find((choice) => choice.type === "null" || "const" in choice);
  const other = schema.anyOf?.find((choice) => choice !== constant);
  if (constant && other) return optionalField(schema, constant, other, place, context);
  if (schema.enum) return selectField(schema.enum, place);
  if (schema.type === "boolean") return switchField(place);
  if (schema.type === "string") return textField(place);
  if (schema.type === "array") {
    if (schema["x-kind"] === "color") return colorField(numeric(schema), place);
    if (schema["x-kind"] === "direction") return directionField(numeric(schema), place);
    return vectorField(numeric(schema), schema.minItems ?? 3, place);
  }
  return numberField(numeric(schema), place);
}

/** @param {Schema} schema @param {Place} place @returns {Field} */
function numberField(schema, { label, describedby, steady }) {
  const { minimum, maximum } = schema;
  const number = h("input", { type: "number", min: minimum, max: maximum, step: spinOf(schema), "aria-describedby": describedby });
  number.addEventListener("change", () => {
    if (Number.isFinite(number.valueAsNumber)) steady.commit(number.valueAsNumber);
    else steady.show(steady.latest);
  });
  const slider = sliderOf(schema);
  if (!slider) {
    const dice = steady.path.at(-1) === "seed" ? [diceButton(steady)] : [];
    return { elements: [number, ...dice], labelled: number, show: (value) => void (number.value = String(value ?? "")) };
  }
  const range = h("input", {
    type: "range", "aria-describedby": describedby,
    ...(slider.log ? { min: 0, max: NOTCHES, step: 1 } : { min: slider.low, max: slider.high, step: stepOf(slider) }),
  });
  number.setAttribute("aria-label", `${label}, exact`);
  /** @param {(value: Json) => void} send */
  const slid = (send) => {
    const value = fromSlider(slider, range.valueAsNumber);
    number.value = String(value);
    tell(value);
    send(value);
  };
  /** @param {number} value */
  const tell = (value) => {
    range.setAttribute("aria-valuetext", `${value} ${schema.unit ?? ""}`.trim());
    const low = Number(range.min);
    range.style.setProperty("--share", `${(100 * (Number(range.value) - low)) / (Number(range.max) - low)}%`);
  };
  range.addEventListener("input", () => slid((value) => steady.drag(value)));
  range.addEventListener("change", () => slid((value) => steady.commit(value)));
  return {
    elements: [range, number],
    labelled: range,
    show(value) {
      number.value = String(value ?? "");
      range.value = String(toSlider(slider, Number(value)));
      tell(Number(value));
    },
  };
}

/** @param {Steady} steady */
function diceButton(steady) {
  const button = h("button", { type: "button", class: "quiet", "aria-label": "Another seed", title: "Another seed" }, icon("dice"));
  button.addEventListener("click", () => steady.commit(Math.floor(Math.random() * 1e6)));
  return button;
}

/** @param {string[]} words @param {Place} place @returns {Field} */
export function selectField(words, { describedby, steady }) {
  const select = h("select", { "aria-describedby": describedby }, ...words.map((word) => h("option", { value: word }, readable(word))));
  select.addEventListener("change", () => steady.commit(select.value));
  return { elements: [select], labelled: select, show: (value) => void (select.value = String(value)) };
}

/** @param {Place} place @returns {Field} */
function switchField({ describedby, steady }) {
  const box = h("input", { type: "checkbox", "aria-describedby": describedby });
  box.addEventListener("change", () => steady.commit(box.checked));
  return { elements: [box], labelled: box, show: (value) => void (box.checked = value === true) };
}

/** @param {Place} place @returns {Field} */
function textField({ describedby, steady }) {
  const text = h("input", { type: "text", "aria-describedby": describedby, spellcheck: "false", autocomplete: "off" });
  text.addEventListener("change", () => steady.commit(text.value));
  return { elements: [text], labelled: text, show: (value) => void (text.value = String(value ?? "")) };
}

/**
 * A value that may also be null or one fixed word: a switch, and behind it the value's own inputs.
 * @param {Schema} schema @param {Schema} constant @param {Schema} other @param {Place} place @param {PanelContext} context @returns {Field}
 */
function optionalField(schema, constant, other, place, context) {
  const { label, steady } = place;
  const rest = constant.const ?? null;
  const facts = { "x-slider": schema["x-slider"], "x-scale": schema["x-scale"], unit: schema.unit };
  const inner = fieldFor(/** @type {Schema} */ ({ ...other, ...facts }), place, context);
  // The row's label belongs to the switch.
  for (const element of inner.elements) if (!element.hasAttribute("aria-label")) element.setAttribute("aria-label", label);
  const box = h("input", { type: "checkbox", "aria-describedby": place.describedby });
  // Descriptions say what null stands for: "null: never."
  const meaning = /null: ([^.;]+)/.exec(schema.description ?? "")?.[1] ?? "off";
  const word = h("span", { class: "rest" }, readable(typeof rest === "string" ? rest : meaning));
  box.addEventListener("change", () => steady.commit(box.checked ? context.suggest(steady.path, schema) : rest));
  return {
    elements: [box, word, ...inner.elements],
    labelled: box,
    show(value) {
      const set = !equal(value, rest);
      box.checked = set;
      word.hidden = set;
      for (const element of inner.elements) element.hidden = !set;
      if (set) inner.show(value);
    },
  };
}
