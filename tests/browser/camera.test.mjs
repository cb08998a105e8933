import assert from "node:assert/strict";
import { test } from "node:test";
import { basis, corners, dolly, dot, frame, length, lookFrom, normalize, orbit, pan, pointAt, project, sub, turn } from "../../static/camera.js";

const ASPECT = 16 / 9;
const VIEW = { position: [1.6, 0.9, -2.1], target: [0.2, -0.1, 0.3], up: [0, 1, 0], fov_y: 32 };
const TILTED = { ...VIEW, up: [0.3, 1, 0.2] };

/** @param {readonly number[]} a @param {readonly number[]} b */
function near(a, b, tolerance = 1e-9) {
  a.forEach((x, i) => assert.ok(Math.abs(x - b[i]) <= tolerance, `[${a}] is not [${b}]`));
}

/** A seeded generator, so that a failure can be repeated. */
function random(seed) {
  let state = seed;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 32 - 0.5;
  };
}

test("the basis is right-handed and orthonormal", () => {
  for (const view of [VIEW, TILTED]) {
    const { f, r, v } = basis(view);
    for (const axis of [f, r, v]) assert.ok(Math.abs(length(axis) - 1) < 1e-12);
    near([dot(f, r), dot(f, v), dot(r, v)], [0, 0, 0], 1e-12);
    near(f, normalize(sub(view.target, view.position)));
  }
});

test("a point of the target's plane is seen where it was picked", () => {
  for (const [x, y] of [[0, 0], [0.7, -0.4], [-1, 1]]) {
    near(project(TILTED, pointAt(TILTED, x, y, ASPECT), ASPECT), [x, y, basis(TILTED).distance]);
  }
});

test("an orbit keeps distance, target and horizon", () => {
  const next = random(1);
  let view = TILTED;
  const { distance } = basis(view);
  for (let i = 0; i < 500; i += 1) view = orbit(view, next(), next());
  assert.ok(Math.abs(basis(view).distance - distance) < 1e-9);
  near(view.target, TILTED.target);
  assert.ok(Math.abs(dot(basis(view).r, normalize(view.up))) < 1e-12, "the horizon is level");
});

test("an orbit and its opposite lead back", () => {
  near(orbit(orbit(VIEW, 0.7, 0.2), -0.7, -0.2).position, VIEW.position);
});

test("an orbit stops short of the pole and comes down where it went up", () => {
  const top = orbit(VIEW, 0, 10);
  const { r } = basis(top);
  assert.ok(r.every(Number.isFinite));
  near(r, basis(VIEW).r, 1e-6);
  const back = orbit(top, 0, -0.5);
  near(basis(back).r, basis(VIEW).r, 1e-6);
});

test("a drag to the right turns the scene to the right", () => {
  const view = { position: [0, 0, 3], target: [0, 0, 0], up: [0, 1, 0], fov_y: 40 };
  const point = [0, 0, 0.5];
  const [x] = project(orbit(view, -0.1, 0), point, ASPECT);
  assert.ok(x > 0);
  const [, y] = project(orbit(view, 0, 0.1), point, ASPECT);
  assert.ok(y < 0, "and a drag downwards, which raises the camera, turns it down");
});

test("what is dragged sideways stays under the pointer", () => {
  const from = [0.3, -0.2];
  const to = [-0.5, 0.6];
  const point = pointAt(TILTED, from[0], from[1], ASPECT);
  near(project(pan(TILTED, from, to, ASPECT), point, ASPECT).slice(0, 2), to);
});

test("a dolly keeps the point under the pointer and the direction", () => {
  for (const factor of [0.5, 1.7]) {
    const point = pointAt(TILTED, 0.6, -0.7, ASPECT);
    const view = dolly(TILTED, factor, 0.6, -0.7, ASPECT);
    near(project(view, point, ASPECT).slice(0, 2), [0.6, -0.7]);
    near(basis(view).f, basis(TILTED).f);
    assert.ok(Math.abs(basis(view).distance - factor * basis(TILTED).distance) < 1e-9);
  }
});

test("a dolly never reaches the target", () => {
  let view = VIEW;
  for (let i = 0; i < 200; i += 1) view = dolly(view, 0.5, 0, 0, ASPECT);
  assert.ok(basis(view).distance >= 1e-3 - 1e-12);
});

test("the axis views look along the axes", () => {
  near(basis(lookFrom(VIEW, [0, 0, 1])).f, [0, 0, -1]);
  near(basis(lookFrom(VIEW, [1, 0, 0])).f, [-1, 0, 0]);
  const top = basis(lookFrom(VIEW, [0, 1, 0]));
  near(top.f, [0, -1, 0], 2e-4);
  near(top.v, [0, 0, -1], 2e-4);
});

test("a fitted view shows every corner and touches the edge of the picture", () => {
  const volume = { source: { type: "physarum", size: [64, 128, 32] }, transform: { translate: [0.4, 0, -1], rotate: [20, 30, 40], scale: [2, 1, 1] } };
  for (const aspect of [ASPECT, 0.6]) {
    const view = frame(TILTED, corners(volume), aspect);
    const extent = corners(volume).map((corner) => Math.max(...project(view, corner, aspect).slice(0, 2).map(Math.abs)));
    assert.ok(Math.abs(Math.max(...extent) - 1) < 1e-9, `${Math.max(...extent)}`);
    near(basis(view).f, basis(TILTED).f);
  }
});

test("a volume's longest edge is 1, and it is turned about x, then y, then z", () => {
  const still = { translate: [0, 0, 0], rotate: [0, 0, 0], scale: [1, 1, 1] };
  const box = { source: { type: "physarum", size: [64, 128, 32] }, transform: still };
  near(corners(box)[7], [0.25, 0.5, 0.125]);
  const turned = corners({ ...box, transform: { ...still, rotate: [90, 0, 90] } })[7];
  near(turned, turn(turn([0.25, 0.5, 0.125], [1, 0, 0], Math.PI / 2), [0, 0, 1], Math.PI / 2));
  near(turned, [0.125, 0.25, 0.5]);
});
