// @ts-check
// Numbers in fields and on sliders.

/** @typedef {import("./protocol.js").Schema} Schema */

/** The schema of the numbers behind an array, a nullable value or a plain number. @param {Schema} schema @returns {Schema} */
export function numeric(schema) {
  const inner = schema.items ?? schema.anyOf?.find((choice) => choice.type === "number" || choice.type === "integer");
  return inner ? { ...inner, ...pick(schema) } : schema;
}

/** @param {Schema} schema @returns {Schema} */
function pick(schema) {
  /** @type {Schema} */
  const facts = {};
  for (const key of /** @type {const} */ (["title", "description", "unit", "x-slider", "x-scale", "x-kind"])) {
    if (schema[key] !== undefined) Object.assign(facts, { [key]: schema[key] });
  }
  return facts;
}

/**
 * How a slider runs, or null where the number has no useful range.
 * @param {Schema} schema
 */
export function sliderOf(schema) {
  const [low, high] = schema["x-slider"] ?? [schema.minimum, schema.maximum];
  if (low === undefined || high === undefined) return null;
  if (!schema["x-slider"] && high - low > 4096) return null;
  return { low, high, log: schema["x-scale"] === "log" && low > 0, whole: schema.type === "integer" };
}

/** @typedef {NonNullable<ReturnType<typeof sliderOf>>} Slider */

/** Positions of a logarithmic slider. */
export const NOTCHES = 400;

/** Position of a value on the slider. @param {Slider} slider @param {number} value */
export function toSlider({ low, high, log }, value) {
  return log ? (NOTCHES * Math.log(Math.max(value, low) / low)) / Math.log(high / low) : value;
}

/** Value of a slider's position, without digits that nobody could aim at. @param {Slider} slider @param {number} position */
export function fromSlider(slider, position) {
  const { low, high, log, whole } = slider;
  const value = log ? Number((low * (high / low) ** (position / NOTCHES)).toPrecision(3)) : Number(position.toPrecision(6));
  const inside = Math.min(high, Math.max(low, value));
  return whole ? Math.round(inside) : inside;
}

/** Step of a linear slider: two hundred or so over its range, in round numbers. @param {Slider} slider */
export function stepOf({ low, high, whole }) {
  if (whole) return Math.max(1, 10 ** Math.floor(Math.log10((high - low) / 200)));
  return Number((10 ** Math.round(Math.log10((high - low) / 200))).toPrecision(1));
}

/** Step of the spin buttons of a field without a slider. @param {Schema} schema */
export function spinOf(schema) {
  if (schema.type === "integer") return 1;
  const slider = sliderOf(schema);
  return slider && !slider.log ? stepOf(slider) : 0.01;
}
