// @ts-check
// Camera mathematics: pure functions from one view to the next, with neither inertia nor state.
//
// Picture coordinates run from −1 to 1, x to the right and y up; the ray through (x, y) is
// f + x·k·aspect·r + y·k·v with k = tan(fov_y/2), as the server builds it.

/** @typedef {import("./protocol.js").Vec3} Vec3 */
/** @typedef {import("./protocol.js").View} View */

/** How near an orbit comes to the pole, in radians: at the pole itself `up` would be parallel to the view. */
export const POLE = 1e-4;
const NEAREST = 1e-3;
const FARTHEST = 1e4;

/** @type {(a: Vec3, b: Vec3) => Vec3} */
export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
/** @type {(a: Vec3, b: Vec3) => Vec3} */
export const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
/** @type {(a: Vec3, s: number) => Vec3} */
export const scale = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
/** @type {(a: Vec3, b: Vec3) => number} */
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
/** @type {(a: Vec3, b: Vec3) => Vec3} */
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
/** @type {(a: Vec3) => number} */
export const length = (a) => Math.hypot(a[0], a[1], a[2]);
/** @type {(a: Vec3) => Vec3} */
export const normalize = (a) => scale(a, 1 / length(a));
/** @type {(...terms: Vec3[]) => Vec3} */
const sum = (...terms) => terms.reduce(add);

/**
 * Turns `v` about the unit vector `axis` by `angle` radians (Rodrigues).
 * @param {Vec3} v @param {Vec3} axis @param {number} angle @returns {Vec3}
 */
export function turn(v, axis, angle) {
  const c = Math.cos(angle);
  return sum(scale(v, c), scale(cross(axis, v), Math.sin(angle)), scale(axis, dot(axis, v) * (1 - c)));
}

/** @param {View} view */
export function basis(view) {
  const forward = sub(view.target, view.position);
  const distance = length(forward);
  const f = scale(forward, 1 / distance);
  const r = normalize(cross(f, view.up));
  return { f, r, v: cross(r, f), distance, k: Math.tan((view.fov_y * Math.PI) / 360) };
}

/**
 * The point seen at (x, y) on the plane through the target that faces the camera.
 * @param {View} view @param {number} x @param {number} y @param {number} aspect @returns {Vec3}
 */
export function pointAt(view, x, y, aspect) {
  const { r, v, distance, k } = basis(view);
  return sum(view.target, scale(r, x * k * aspect * distance), scale(v, y * k * distance));
}

/**
 * Where `point` is seen: [x, y, distance in front of the lens].
 * @param {View} view @param {Vec3} point @param {number} aspect @returns {Vec3}
 */
export function project(view, point, aspect) {
  const { f, r, v, k } = basis(view);
  const offset = sub(point, view.position);
  const depth = dot(offset, f);
  return [dot(offset, r) / (depth * k * aspect), dot(offset, v) / (depth * k), depth];
}

/**
 * Goes round the target: `yaw` radians about the up axis, `pitch` radians towards it.
 * @param {View} view @param {number} yaw @param {number} pitch @returns {View}
 */
export function orbit(view, yaw, pitch) {
  const up = normalize(view.up);
  const { r, distance } = basis(view);
  const height = dot(sub(view.position, view.target), up) / distance;
  const limit = Math.PI / 2 - POLE;
  const elevation = Math.max(-limit, Math.min(limit, Math.asin(Math.max(-1, Math.min(1, height))) + pitch));
  // r × up is the horizontal direction from the target to the camera, well defined even near the pole.
  const level = turn(normalize(cross(r, up)), up, yaw);
  const offset = scale(sum(scale(level, Math.cos(elevation)), scale(up, Math.sin(elevation))), distance);
  return { ...view, position: add(view.target, offset) };
}

/**
 * Moves camera and target so that what lies at the target's depth follows the pointer from one place to another.
 * @param {View} view @param {[number, number]} from @param {[number, number]} to @param {number} aspect @returns {View}
 */
export function pan(view, from, to, aspect) {
  const { r, v, distance, k } = basis(view);
  return fly(view, sum(scale(r, (from[0] - to[0]) * k * aspect * distance), scale(v, (from[1] - to[1]) * k * distance)));
}

/**
 * Scales the distance by `factor` and keeps the point under (x, y) at the target's depth where it is in the picture.
 * @param {View} view @param {number} factor @param {number} x @param {number} y @param {number} aspect @returns {View}
 */
export function dolly(view, factor, x, y, aspect) {
  const { distance } = basis(view);
  const s = Math.max(NEAREST, Math.min(FARTHEST, distance * factor)) / distance;
  const fixed = pointAt(view, x, y, aspect);
  /** @param {Vec3} point */
  const towards = (point) => add(fixed, scale(sub(point, fixed), s));
  return { ...view, position: towards(view.position), target: towards(view.target) };
}

/** @param {View} view @param {Vec3} by @returns {View} */
export function fly(view, by) {
  return { ...view, position: add(view.position, by), target: add(view.target, by) };
}

/**
 * Looks at the target from `side`, y up, at the same distance; from above, −z is up in the picture.
 * @param {View} view @param {Vec3} side @returns {View}
 */
export function lookFrom(view, side) {
  const level = /** @type {Vec3} */ ([side[0], 0, side[1] === 0 ? side[2] : 1]);
  const elevation = Math.sign(side[1]) * (Math.PI / 2 - POLE);
  const way = side[1] === 0 ? normalize(level) : /** @type {Vec3} */ ([0, Math.sin(elevation), Math.cos(elevation)]);
  const position = add(view.target, scale(way, basis(view).distance));
  return { ...view, position, up: [0, 1, 0] };
}

/**
 * Keeps the direction and fits all `points` into the picture, as near as they allow.
 * @param {View} view @param {Vec3[]} points @param {number} aspect @returns {View}
 */
export function frame(view, points, aspect) {
  if (points.length === 0) return view;
  const target = /** @type {Vec3} */ ([0, 1, 2].map((i) => {
    const along = points.map((point) => point[i] ?? 0);
    return (Math.min(...along) + Math.max(...along)) / 2;
  }));
  const { f, r, v, k } = basis(view);
  const distance = Math.max(NEAREST, ...points.map((point) => {
    const offset = sub(point, target);
    return Math.max(Math.abs(dot(offset, r)) / (k * aspect), Math.abs(dot(offset, v)) / k) - dot(offset, f);
  }));
  return { ...view, target, position: sub(target, scale(f, distance)) };
}

/**
 * The corners of a volume's box in the world: T·Rz·Ry·Rx·S·p, the longest edge of the grid being 1.
 * @param {import("./protocol.js").Volume} volume @returns {Vec3[]}
 */
export function corners(volume) {
  const { translate, rotate, scale: stretch } = volume.transform;
  const size = volume.source.size;
  const grid = Array.isArray(size) && size.length === 3 ? size.map(Number) : [1, 1, 1];
  const longest = Math.max(...grid);
  const half = grid.map((n, i) => ((n / longest) * (stretch[i] ?? 1)) / 2);
  const [rx, ry, rz] = rotate.map((degrees) => (degrees * Math.PI) / 180);
  /** @param {number} corner @param {number} axis */
  const along = (corner, axis) => ((corner >> axis) & 1 ? 1 : -1) * (half[axis] ?? 0.5);
  return [0, 1, 2, 3, 4, 5, 6, 7].map((corner) => {
    const local = /** @type {Vec3} */ ([along(corner, 0), along(corner, 1), along(corner, 2)]);
    const turned = turn(turn(turn(local, [1, 0, 0], rx ?? 0), [0, 1, 0], ry ?? 0), [0, 0, 1], rz ?? 0);
    return add(turned, translate);
  });
}
