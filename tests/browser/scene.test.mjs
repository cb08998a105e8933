import assert from "node:assert/strict";
import { test } from "node:test";
import { fromHex, split, toHex } from "../../static/color.js";
import { Edits } from "../../static/edits.js";
import { readHeader } from "../../static/frame.js";
import { pack, unpack } from "../../static/link.js";
import { fromSlider, sliderOf, toSlider } from "../../static/numbers.js";
import { short } from "../../static/rig.js";
import { compact, compactScene, complete, joinPatches, mergePatch, patchFor } from "../../static/scene.js";

const number = (value) => ({ type: "number", default: value });
const SCHEMA = {
  type: "object",
  properties: {
    about: { type: "object", properties: { title: { type: "string", default: "" } }, default: { title: "" } },
    focus: { anyOf: [{ type: "number" }, { type: "null" }], default: null },
    volumes: {
      type: "object",
      default: {},
      additionalProperties: {
        type: "object",
        properties: {
          source: {
            default: { type: "plain" },
            oneOf: [
              { type: "object", properties: { type: { const: "plain" } } },
              { type: "object", properties: { type: { const: "grown" }, step: number(0.6), size: { type: "array", items: { type: "integer" }, default: [8, 8, 8] } } },
            ],
          },
          sigma_t: number(40),
        },
      },
    },
  },
};

test("the examples of RFC 7396 hold, but for objects of another type", () => {
  assert.deepEqual(mergePatch({ a: "b", c: { d: 1 } }, { a: "z", c: { d: null, e: 2 } }), { a: "z", c: { e: 2 } });
  assert.deepEqual(mergePatch({ a: [{ b: 1 }] }, { a: [1] }), { a: [1] });
  assert.deepEqual(mergePatch([1, 2], { a: "b", c: null }), { a: "b" });
  assert.deepEqual(mergePatch({ phase: { type: "hg", g: 0.5 } }, { phase: { type: "drift" } }), { phase: { type: "drift" } });
});

test("a patch does not change the document that it is applied to", () => {
  const before = Object.freeze({ a: Object.freeze({ b: 1 }) });
  assert.deepEqual(mergePatch(before, { a: { b: 2 } }), { a: { b: 2 } });
});

test("what is missing has its default, in collections and behind a type", () => {
  assert.deepEqual(complete(SCHEMA, { volumes: { main: { source: { type: "grown", step: 2 } }, gone: null } }), {
    about: { title: "" },
    focus: null,
    volumes: { main: { source: { type: "grown", step: 2, size: [8, 8, 8] }, sigma_t: 40 } },
  });
});

test("a short document becomes the same scene again", () => {
  const scene = complete(SCHEMA, { focus: 2, volumes: { main: { source: { type: "grown", size: [4, 8, 8] } }, other: {} } });
  const short = compact(SCHEMA, scene);
  assert.deepEqual(short, { focus: 2, volumes: { main: { source: { type: "grown", size: [4, 8, 8] } }, other: {} } });
  assert.deepEqual(complete(SCHEMA, short), scene);
});

test("a short scene names its volumes even where there are none", () => {
  assert.deepEqual(compactScene(SCHEMA, complete(SCHEMA, {})), { volumes: {} });
});

test("a link carries a document unharmed", async () => {
  const document = { about: { title: "Tëst — ✓" }, volumes: { main: { sigma_t: 0.1 } } };
  const packed = await pack(document);
  assert.match(packed, /^[\w-]+$/);
  assert.deepEqual(await unpack(packed), document);
  await assert.rejects(unpack(packed.slice(0, 8)));
});

test("two patches joined do what both do", () => {
  const joined = joinPatches(patchFor(["a", "b"], 1), { a: { c: null }, d: 2 });
  assert.deepEqual(joined, { a: { b: 1, c: null }, d: 2 });
});

test("a drag sends the newest value at most once in 33 ms, and its end at once", async () => {
  const sent = [];
  const edits = new Edits((message) => sent.push(message) > 0);
  for (let i = 0; i < 5; i += 1) edits.set(["x"], i, "g", false);
  assert.equal(sent.length, 0);
  await new Promise((resolve) => { setTimeout(resolve, 60); });
  assert.deepEqual(sent, [{ type: "patch", patch: { x: 4 }, gesture: "g", commit: false }]);
  edits.set(["x"], 5, "g", false);
  edits.set(["x"], 6, "g", true);
  await new Promise((resolve) => { setTimeout(resolve, 60); });
  assert.deepEqual(sent.slice(1), [{ type: "patch", patch: { x: 6 }, gesture: "g", commit: true }]);
});

test("a frame's header is read as it was written", () => {
  const bytes = Buffer.alloc(44);
  bytes.set([1, 1, 5, 0]);
  bytes.writeUInt16LE(1280, 4);
  bytes.writeUInt16LE(720, 6);
  [9001, 812, 77, 64].forEach((value, i) => bytes.writeUInt32LE(value, 8 + 4 * i));
  bytes.writeBigUInt64LE(123_456_789_012n, 24);
  bytes.writeUInt32LE(11_200, 32);
  bytes.writeUInt32LE(3_100, 36);
  const message = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
  assert.deepEqual(readHeader(message), {
    codec: 1, key: true, final: false, lossless: true, width: 1280, height: 720, frame: 9001, seq: 812, rev: 77, spp: 64,
    began: 123_456_789_012, render_us: 11_200, encode_us: 3_100,
  });
  assert.throws(() => readHeader(new ArrayBuffer(12)), /12 bytes/);
  assert.throws(() => readHeader(new ArrayBuffer(64)), /version 0/);
});

test("a camera is sent in the decimals that a 32-bit float needs", () => {
  assert.equal(short(1.30208198), 1.302082);
  assert.equal(short(0.1), 0.1);
  assert.equal(short(1e-4 / 3), 3.3333334e-5);
  for (const x of [Math.PI, -1 / 3, 1.7232921, 16777217]) assert.equal(Math.fround(short(x)), Math.fround(x));
});

test("a colour field shows sRGB and gives linear light back", () => {
  assert.equal(toHex([1, 0.2159, 0]), "#ff8000");
  assert.deepEqual(fromHex("#ff8000"), [1, 0.2159, 0]);
  for (const hex of ["#000000", "#010203", "#7f80fe", "#ffffff"]) assert.equal(toHex(fromHex(hex)), hex);
  assert.deepEqual(split([0, 0, 0]), { strength: 0, hue: null });
  assert.deepEqual(split([2, 4, 1]), { strength: 4, hue: [0.5, 1, 0.25] });
});

test("a logarithmic slider reaches both ends and loses nothing between", () => {
  const slider = sliderOf({ type: "number", "x-slider": [0.1, 1000], "x-scale": "log" });
  assert.equal(fromSlider(slider, toSlider(slider, 0.1)), 0.1);
  assert.equal(fromSlider(slider, toSlider(slider, 1000)), 1000);
  assert.equal(fromSlider(slider, toSlider(slider, 40)), 40);
});
