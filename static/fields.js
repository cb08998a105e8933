// @ts-check
// Inputs for values of three numbers: vectors, directions, colours. What is not touched is not changed.
import { fromHex, split, toHex } from "./color.js";
import { h } from "./dom.js";
import { fromSlider, spinOf } from "./numbers.js";

/** @typedef {import("./protocol.js").Json} Json */
/** @typedef {import("./protocol.js").Schema} Schema */
/** @typedef {import("./controls.js").Field} Field */
/** @typedef {import("./controls.js").Place} Place */

/** @param {Json | undefined} value @param {number} [count] @returns {number[]} */
function numbers(value, count = 3) {
  const list = Array.isArray(value) ? value.map(Number) : [];
  return Array.from({ length: count }, (_, i) => list[i] ?? 0);
}

/**
 * A number field for each component.
 * @param {Schema} schema of one component @param {number} count @param {Place} place @param {string[]} [names] @returns {Field}
 */
export function vectorField(schema, count, { label, describedby, steady }, names = count === 3 ? ["x", "y", "z"] : ["from", "to"]) {
  const { minimum, maximum } = schema;
  const inputs = Array.from({ length: count }, (_, i) => {
    const input = h("input", {
      type: "number", min: minimum, max: maximum, step: spinOf(schema),
      "aria-label": `${label}, ${names[i] ?? i + 1}`, "aria-describedby": describedby,
    });
    input.addEventListener("change", () => {
      if (!Number.isFinite(input.valueAsNumber)) return steady.show(steady.latest);
      return steady.commit(numbers(steady.current, count).with(i, input.valueAsNumber));
    });
    return input;
  });
  return {
    elements: inputs,
    show(value) {
      const list = numbers(value, count);
      inputs.forEach((input, i) => {
        // Four decimals are enough to read; the value itself keeps all of them.
        if (input !== document.activeElement || input.value === "") input.value = String(Number((list[i] ?? 0).toFixed(4)));
      });
    },
  };
}

/**
 * The height and the compass angle from which a light comes, in whole degrees, beside its vector.
 * @param {Schema} schema @param {Place} place @returns {Field}
 */
export function directionField(schema, place) {
  const { label, describedby, steady } = place;
  const vector = vectorField(schema, 3, place);
  /** @param {string} name @param {number} most */
  const angle = (name, most) => h("input", {
    type: "range", min: -most, max: most, step: 1, "aria-label": `${label}, ${name}`, "aria-describedby": describedby, "data-name": name,
  });
  const around = angle("around", 180);
  const height = angle("height", 90);
  const value = () => {
    const [a, e] = [around, height].map((input) => (input.valueAsNumber * Math.PI) / 180);
    const from = [Math.cos(e ?? 0) * Math.sin(a ?? 0), Math.sin(e ?? 0), Math.cos(e ?? 0) * Math.cos(a ?? 0)];
    return from.map((x) => Number((-x).toFixed(5)) || 0);
  };
  for (const input of [around, height]) {
    input.addEventListener("input", () => {
      tell();
      vector.show(value());
      steady.drag(value());
    });
    input.addEventListener("change", () => steady.commit(value()));
  }
  const tell = () => {
    for (const input of [around, height]) {
      input.setAttribute("aria-valuetext", `${input.value} degrees`);
      const most = Number(input.max);
      input.style.setProperty("--share", `${(50 * (input.valueAsNumber + most)) / most}%`);
    }
  };
  return {
    elements: [
      h("div", { class: "angles" }, h("span", { "aria-hidden": "true" }, "Around"), around, h("span", { "aria-hidden": "true" }, "Height"), height),
      h("div", { class: "vector" }, ...vector.elements),
    ],
    show(shown) {
      const [x = 0, y = 0, z = 0] = numbers(shown);
      const size = Math.hypot(x, y, z) || 1;
      around.value = String((Math.atan2(-x, -z) * 180) / Math.PI);
      height.value = String((Math.asin(-y / size) * 180) / Math.PI);
      tell();
      vector.show(shown);
    },
  };
}

/**
 * A swatch, and beside it the channels of a share of light or the strength of a radiance.
 * @param {Schema} schema of one channel @param {Place} place @returns {Field}
 */
export function colorField(schema, place) {
  return (schema.maximum ?? Infinity) <= 1 ? shareField(schema, place) : radianceField(schema, place);
}

/** @param {Place} place */
function swatchInput({ label, describedby }) {
  return h("input", { type: "color", "aria-label": `${label}, colour`, "aria-describedby": describedby });
}

/** @param {Schema} schema @param {Place} place @returns {Field} */
function shareField(schema, place) {
  const { steady } = place;
  const swatch = swatchInput(place);
  const vector = vectorField({ ...schema, "x-slider": [0, 1] }, 3, place, ["red", "green", "blue"]);
  swatch.addEventListener("input", () => {
    vector.show(fromHex(swatch.value));
    steady.drag(fromHex(swatch.value));
  });
  swatch.addEventListener("change", () => steady.commit(fromHex(swatch.value)));
  return {
    elements: [swatch, ...vector.elements],
    show(value) {
      swatch.value = toHex(numbers(value));
      vector.show(value);
    },
  };
}

/** @param {Schema} schema @param {Place} place @returns {Field} */
function radianceField(schema, place) {
  const { label, describedby, steady } = place;
  const [low, high] = schema["x-slider"] ?? [0, 10];
  const slider = { low, high, log: false, whole: false };
  const swatch = swatchInput(place);
  const range = h("input", { type: "range", min: low, max: high, step: (high - low) / 200, "aria-label": `${label}, strength`, "aria-describedby": describedby });
  const number = h("input", { type: "number", min: schema.minimum, max: schema.maximum, step: (high - low) / 100, "aria-label": `${label}, strength, exact`, "aria-describedby": describedby });
  // Black has no hue of its own: it keeps the last one, so that a light comes back as it went.
  /** @type {readonly number[]} */
  let hue = [1, 1, 1];
  /** @param {number} strength */
  const scaled = (strength) => {
    const color = numbers(steady.current);
    const before = Math.max(...color);
    return before > 0 ? color.map((x) => (x / before) * strength) : hue.map((x) => x * strength);
  };
  const tinted = () => {
    const next = split(fromHex(swatch.value)).hue ?? [1, 1, 1];
    hue = next;
    const strength = Math.max(...numbers(steady.current));
    return next.map((x) => Number((x * (strength > 0 ? strength : 1)).toPrecision(6)));
  };
  swatch.addEventListener("input", () => steady.drag(tinted()));
  swatch.addEventListener("change", () => steady.commit(tinted()));
  const slid = () => fromSlider(slider, range.valueAsNumber);
  range.addEventListener("input", () => {
    number.value = String(slid());
    tell();
    steady.drag(scaled(slid()));
  });
  range.addEventListener("change", () => steady.commit(scaled(slid())));
  number.addEventListener("change", () => {
    if (Number.isFinite(number.valueAsNumber)) steady.commit(scaled(number.valueAsNumber));
    else steady.show(steady.latest);
  });
  const tell = () => {
    range.setAttribute("aria-valuetext", `${number.value} ${schema.unit ?? ""}`.trim());
    range.style.setProperty("--share", `${(100 * (range.valueAsNumber - low)) / (high - low)}%`);
  };
  return {
    elements: [swatch, range, number],
    show(value) {
      const { strength, hue: shown } = split(numbers(value));
      if (shown) hue = shown;
      swatch.value = toHex(hue);
      range.value = String(strength);
      number.value = String(Number(strength.toPrecision(6)));
      tell();
    },
  };
}
