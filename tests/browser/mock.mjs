// A stand-in for the server: the page, the API and synthetic pictures, for work on the page alone.
//
//   node mock.mjs [PORT]      the schema comes from TYNDALL_SCHEMA, or from `tyndall schema`
import { execFileSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";
import { fileURLToPath } from "node:url";
import { WebSocketServer } from "ws";
import { complete, mergePatch, variantOf, entrySchema } from "../../static/scene.js";
import { jpg, picture, png } from "./synth.mjs";

const ROOT = fileURLToPath(new URL("../../", import.meta.url));
const TYPES = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml", ".jpg": "image/jpeg" };
const LOOKS = {
  tendrils: ["Tendrils", "Writhing tendrils in amber light.", [0.98, 0.86, 0.62], [9, 7.5, 5.5]],
  amber: ["Amber", "Light caught in resin.", [0.98, 0.82, 0.45], [10, 7, 4]],
  "deep-sea": ["Deep sea", "A blue body lit from above.", [0.55, 0.85, 0.97], [4, 8, 10]],
  "milk-glass": ["Milk glass", "Soft light alone.", [0.99, 0.99, 0.99], [5, 5, 5]],
  microscope: ["Electron microscope", "Gray, sharp, one key light.", [0.85, 0.85, 0.85], [7, 7, 7]],
  neon: ["Neon", "It glows by itself.", [0.9, 0.4, 0.95], [9, 4, 9]],
  bone: ["Bone", "Hard sun at thirty degrees.", [0.95, 0.92, 0.85], [8, 7.6, 7]],
  storm: ["Storm", "Inside a cloud.", [0.9, 0.93, 0.99], [6, 7, 9]],
};

export function readSchema() {
  const path = process.env.TYNDALL_SCHEMA;
  if (path) return JSON.parse(readFileSync(path, "utf8"));
  return JSON.parse(execFileSync(process.env.TYNDALL_BIN ?? join(ROOT, "target/debug/tyndall"), ["schema"], { encoding: "utf8" }));
}

/** @param {string} name */
function preset(name) {
  const [title, description, albedo, irradiance] = LOOKS[name];
  return {
    about: { title, description, best_step: 240 },
    camera: { position: [1.35, 0.75, -1.75], target: [0, 0, 0], fov_y: 34 },
    volumes: { main: { source: { type: "physarum" }, medium: { sigma_t: 120, albedo, phase: { type: "hg", g: 0.5 } } } },
    light: { sky: { type: "gradient" }, sun: { direction: [-0.5, -0.55, -0.7], irradiance } },
  };
}

/** The first number out of its range, or key that no schema knows. */
function fault(schema, value, path = []) {
  const at = path.join(".");
  const inner = schema.anyOf?.find((choice) => choice.type === "number" || choice.type === "integer") ?? schema;
  if (typeof value === "number") {
    if (value > inner.maximum) return { code: "out_of_range", path: at, text: `${value} is above the maximum ${inner.maximum}` };
    if (value < inner.minimum) return { code: "out_of_range", path: at, text: `${value} is below the minimum ${inner.minimum}` };
  }
  if (typeof value !== "object" || value === null || Array.isArray(value)) return null;
  const entries = entrySchema(schema);
  const { properties } = variantOf(schema, value);
  for (const [key, item] of Object.entries(value)) {
    const child = entries ?? properties?.[key];
    if (!child) return { code: "unknown_key", path: [...path, key].join("."), text: "unknown key" };
    const found = fault(child, item, [...path, key]);
    if (found) return found;
  }
  return null;
}

/** Starts a mock server; resolves to its address. */
export async function mock({ port = 0, token = "", base = "/", detail = 1, schema = readSchema() } = {}) {
  let scene = complete(schema, preset("tendrils"));
  let rev = 1;
  let steps = 0;
  let playing = true;
  let spp = 0;
  let holder = null;
  let next = 0;
  const undo = [];
  const redo = [];
  const clients = new Set();

  const tell = (message) => {
    for (const client of clients) client.socket.send(JSON.stringify(message));
  };
  const become = (document, by, keep = true) => {
    const full = complete(schema, document);
    const found = fault(schema, full);
    if (found) return found;
    if (keep) {
      undo.push(scene);
      redo.length = 0;
    }
    const patch = difference(scene, full);
    scene = full;
    rev += 1;
    spp = 0;
    tell({ type: "patch", rev, by, patch: patch ?? {} });
    return null;
  };
  const control = (cmd) => {
    if (cmd === "play" || cmd === "pause") playing = cmd === "play";
    if (cmd === "step") { playing = false; steps += 1; spp = 0; }
    if (cmd === "reset") { steps = 0; spp = 0; }
    const [from, to] = cmd === "undo" ? [undo, redo] : [redo, undo];
    if ((cmd === "undo" || cmd === "redo") && from.length) {
      to.push(scene);
      become(from.pop(), "server", false);
    }
  };

  const server = createServer(async (request, response) => {
    const url = new URL(request.url ?? "/", "http://mock");
    const path = url.pathname.startsWith(base) ? url.pathname.slice(base.length) : "elsewhere";
    const json = (status, body) => {
      response.writeHead(status, { "content-type": status < 400 ? "application/json" : "application/problem+json" });
      response.end(JSON.stringify(body));
    };
    if (path.startsWith("api/") && token && url.searchParams.get("token") !== token) return json(401, { title: "Unauthorized", status: 401 });
    if (path === "api/v1/schema") return json(200, schema);
    if (path === "api/v1/info") return json(200, { version: "0.1.0", adapter: { name: "Mock adapter", backend: "vulkan", type: "Cpu" }, limits: {} });
    if (path === "api/v1/presets") return json(200, Object.entries(LOOKS).map(([name, [title, description]]) => ({ name, title, description, best_step: 240 })));
    if (path.startsWith("api/v1/presets/")) return json(200, preset(path.slice(15)));
    if (path === "api/v1/sessions/main/scene") {
      if (request.method === "GET") return json(200, scene);
      const chunks = [];
      for await (const part of request) chunks.push(part);
      const found = become(JSON.parse(Buffer.concat(chunks).toString()), "http");
      steps = 0;
      return found ? json(422, { title: "Refused", detail: found.text, ...found }) : json(200, scene);
    }
    if (path === "api/v1/sessions/main/frame") {
      const [w, h] = [Number(url.searchParams.get("width")), Number(url.searchParams.get("height"))];
      response.writeHead(200, { "content-type": "image/png" });
      return response.end(png(picture(scene, w, h, 64, steps), w, h));
    }
    if (path.startsWith("api/")) return json(404, { title: "Not found", status: 404 });
    try {
      const thumb = /^thumbs\/([\w-]+)\.jpg$/.exec(path);
      if (thumb) {
        if (thumb[1] === "storm" || !LOOKS[thumb[1]]) throw new Error("no such thumbnail");
        response.writeHead(200, { "content-type": "image/jpeg", "cache-control": "max-age=600" });
        const [w, h] = detail < 1 ? [48, 30] : [240, 150];
        return response.end(jpg(picture(complete(schema, preset(thumb[1])), w, h, 400, thumb[1].length * 40), w, h));
      }
      const file = normalize(join(ROOT, "static", path || "index.html"));
      const body = readFileSync(file);
      response.writeHead(200, { "content-type": TYPES[extname(file)] ?? "application/octet-stream", "content-security-policy": CSP });
      return response.end(body);
    } catch {
      return json(404, { title: "Not found", status: 404 });
    }
  });

  const sockets = new WebSocketServer({ noServer: true, handleProtocols: () => "tyndall.v1" });
  server.on("upgrade", (request, socket, head) => {
    const url = new URL(request.url ?? "/", "http://mock");
    const status = token && url.searchParams.get("token") !== token ? 401 : url.pathname === `${base}api/v1/sessions/main/ws` ? 0 : 404;
    if (status) return socket.end(`HTTP/1.1 ${status} Refused\r\nConnection: close\r\n\r\n`);
    return sockets.handleUpgrade(request, socket, head, (ws) => join_(ws));
  });
  const join_ = (socket) => {
    next += 1;
    const client = { socket, id: `c${next}`, size: [640, 360], frame: 0, acked: 0, seq: 0, shown: -1, final: false, bytes: 0 };
    socket.on("close", () => clients.delete(client));
    socket.on("error", () => {});
    socket.on("message", (data) => {
      const message = JSON.parse(String(data));
      if (message.type === "hello") {
        client.size = message.size;
        clients.add(client);
        socket.send(JSON.stringify({ type: "welcome", protocol: "tyndall.v1", session: "main", role: message.role, codec: "jpeg", rev, scene, client: client.id, playing, holder }));
      }
      if (message.type === "ack") client.acked = Math.max(client.acked, message.frame);
      if (message.type === "keyframe") { client.final = false; client.shown = -1; }
      if (message.type === "resize") { client.size = message.size; spp = 0; client.final = false; }
      if (message.type === "camera") {
        const { type, seq, ...camera } = message;
        scene = complete(schema, mergePatch(scene, { camera }));
        client.seq = seq;
        rev += 1;
        spp = 0;
        for (const other of clients) if (other !== client) other.socket.send(JSON.stringify({ type: "patch", rev, by: client.id, patch: { camera } }));
      }
      if (message.type === "patch") {
        const found = become(mergePatch(scene, message.patch), client.id, message.commit !== false);
        if (found) socket.send(JSON.stringify({ type: "error", ...found }));
      }
      if (message.type === "control") {
        if (message.cmd === "take" || message.cmd === "release") {
          holder = message.cmd === "take" ? client.id : null;
          for (const other of clients) other.socket.send(JSON.stringify({ type: "control", holder, you: other === client && holder !== null }));
        } else control(message.cmd);
      }
    });
  };

  const timer = setInterval(() => {
    if (clients.size === 0) return;
    if (playing) { steps += 1; spp = 0; }
    const target = scene.render.spp;
    const moving = spp === 0;
    spp = Math.min(target, spp === 0 ? 1 : spp * 2);
    const done = spp >= target && !playing;
    for (const client of clients) {
      if (client.frame - client.acked >= 2) continue;
      const mark = `${rev}/${steps}/${spp}/${client.size}`;
      if (client.final === mark || (client.shown === mark && !done)) continue;
      const share = Math.min(1, Math.sqrt((detail * (moving ? 40_000 : 120_000)) / (client.size[0] * client.size[1])));
      const [w, h] = client.size.map((edge) => Math.max(16, Math.round(edge * share)));
      const began = performance.now();
      const pixels = picture(scene, w, h, spp, steps);
      const rendered = performance.now();
      const payload = done ? png(pixels, w, h) : jpg(pixels, w, h);
      const head = Buffer.alloc(40);
      client.frame += 1;
      head.set([1, done ? 0 : 1, done ? 7 : 1, 0]);
      head.writeUInt16LE(w, 4);
      head.writeUInt16LE(h, 6);
      head.writeUInt32LE(client.frame, 8);
      head.writeUInt32LE(client.seq, 12);
      head.writeUInt32LE(rev, 16);
      head.writeUInt32LE(spp, 20);
      head.writeBigUInt64LE(BigInt(Math.round(began * 1000)), 24);
      head.writeUInt32LE(Math.round((rendered - began) * 1000), 32);
      head.writeUInt32LE(Math.round((performance.now() - rendered) * 1000), 36);
      client.socket.send(Buffer.concat([head, payload]));
      client.shown = mark;
      if (done) client.final = mark;
    }
  }, 80);
  const stats = setInterval(() => tell({ type: "stats", fps: 12, spp, noise: 0.1, simulate_ms: 1.2, render_ms: 9.7, encode_ms: 3.1, kbps: 4200, steps, playing }), 500);

  await new Promise((resolve) => { server.listen(port, "127.0.0.1", () => resolve(undefined)); });
  const address = /** @type {import("node:net").AddressInfo} */ (server.address());
  return {
    url: `http://127.0.0.1:${address.port}${base}`,
    port: address.port,
    /** Sends every client something that is no picture, as the next frame. */
    spoil() {
      for (const client of clients) {
        const head = Buffer.alloc(60, 0xee);
        head.set([1, 1, 0, 0]);
        client.frame += 1;
        head.writeUInt32LE(client.frame, 8);
        client.socket.send(head);
        client.socket.send(Buffer.from("short"));
      }
    },
    /** Greets every client once more, as after missed changes. */
    greet() {
      for (const { socket, id } of clients) {
        socket.send(JSON.stringify({ type: "welcome", protocol: "tyndall.v1", session: "main", role: "control", codec: "jpeg", rev, scene, client: id, playing, holder }));
      }
    },
    /** Frames sent and acknowledged, of each client. */
    credit: () => [...clients].map(({ frame, acked }) => ({ frame, acked })),
    close() {
      clearInterval(timer);
      clearInterval(stats);
      for (const { socket } of clients) socket.terminate();
      server.close();
      server.closeAllConnections();
    },
  };
}

const CSP = "default-src 'self'; img-src 'self' data: blob:; connect-src 'self' ws: wss:; object-src 'none'; base-uri 'none'; frame-ancestors 'none'";

/** Merge patch from one document to another. */
function difference(from, to) {
  if (JSON.stringify(from) === JSON.stringify(to)) return undefined;
  const plain = (value) => typeof value === "object" && value !== null && !Array.isArray(value);
  if (!plain(from) || !plain(to) || from.type !== to.type) return to;
  const patch = {};
  for (const key of Object.keys({ ...from, ...to })) {
    const change = key in to ? difference(from[key], to[key]) : null;
    if (change !== undefined) patch[key] = change;
  }
  return patch;
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const { url } = await mock({ port: Number(process.argv[2] ?? 8090), token: process.env.TYNDALL_TOKEN ?? "" });
  console.log(`The mock server listens at ${url}`);
}
