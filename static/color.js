// @ts-check
// Linear light to and from the sRGB of a colour field.

/** @typedef {import("./protocol.js").Vec3} Vec3 */

/** @param {number} x linear, 0 to 1 */
function encode(x) {
  return x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055;
}

/** @param {number} x encoded, 0 to 1 */
function decode(x) {
  return x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4;
}

/** `#rrggbb` of a linear colour, clipped. @param {readonly number[]} linear */
export function toHex(linear) {
  const bytes = linear.slice(0, 3).map((x) => Math.round(255 * encode(Math.min(1, Math.max(0, x)))));
  return `#${bytes.map((byte) => byte.toString(16).padStart(2, "0")).join("")}`;
}

/** Linear colour of `#rrggbb`, to four digits. @param {string} hex @returns {Vec3} */
export function fromHex(hex) {
  const value = Number.parseInt(hex.slice(1), 16);
  /** @param {number} shift */
  const channel = (shift) => Math.round(1e4 * decode(((value >> shift) & 255) / 255)) / 1e4;
  return [channel(16), channel(8), channel(0)];
}

/** Its strongest channel, and the colour with that channel at 1. @param {readonly number[]} color @returns {{strength: number, hue: Vec3 | null}} */
export function split(color) {
  const [r = 0, g = 0, b = 0] = color;
  const strength = Math.max(r, g, b);
  return { strength, hue: strength > 0 ? [r / strength, g / strength, b / strength] : null };
}
