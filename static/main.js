// @ts-check
// The page: joins socket, picture, camera and panel.
import { getJson, putScene, role } from "./api.js";
import { Bookmarks } from "./bookmarks.js";
import { basis, corners, frame, lookFrom } from "./camera.js";
import { Picture } from "./canvas.js";
import { byId, download } from "./dom.js";
import { Edits } from "./edits.js";
import { acceptScenes, complain, describeServer, exportVolume, offerStills, stamp } from "./files.js";
import { Gestures } from "./gestures.js";
import { showHints } from "./hint.js";
import { listen } from "./keys.js";
import { copy, pack, unpack } from "./link.js";
import { explain, toast } from "./notices.js";
import { Panel } from "./panel.js";
import { showPresets } from "./presets.js";
import { Rig } from "./rig.js";
import { compactScene, complete, completeScene, patchScene } from "./scene.js";
import { Socket } from "./socket.js";
import { Status } from "./status.js";
import { makeTabs } from "./tabs.js";

/** @typedef {import("./protocol.js").Scene} Scene */
/** @typedef {import("./protocol.js").Schema} Schema */
/** @typedef {import("./protocol.js").Json} Json */
/** @typedef {import("./protocol.js").JsonObject} JsonObject */
/** @typedef {import("./protocol.js").Command} Command */
/** @typedef {import("./protocol.js").ServerMessage} ServerMessage */

const RESIZE_AFTER = 150;

/** @type {Scene | null} */
let scene = null;
let rev = -1;
/** @type {Schema} */
let schema = {};
/** @type {import("./protocol.js").Stats | null} */
let stats = null;
let playing = true;
/** Whether the next welcome is that of a connection made again; a welcome may also come in between. */
let returning = false;
/** The server's name for this connection, where it tells. */
let client = "";
/** Whether this page has taken control. */
let holding = false;
/** @type {Panel | null} */
let panel = null;
/** @type {Awaited<ReturnType<typeof showPresets>> | null} */
let presets = null;
let refreshing = 0;
/** The size last asked for. */
let asked = "";
let keyframeAt = -Infinity;

const canvas = byId("canvas", HTMLCanvasElement);
const status = new Status();
const socket = new Socket({
  hello() {
    const size = picture.wantedSize();
    asked = String(size);
    // Frames and camera messages are numbered anew on every connection.
    picture.restart();
    rig.restart();
    returning = scene !== null;
    return { type: "hello", codecs: ["jpeg", "png"], size, role };
  },
  message: hear,
  frame: (message) => picture.take(message),
  state(state) {
    if (state !== "open" || picture.frames > 0) explain(state, () => socket.retry());
    if (state === "open") prepare();
  },
});
const picture = new Picture(canvas, {
  ack: (frame, decode_ms) => void socket.send({ type: "ack", frame, decode_ms: Math.round(100 * decode_ms) / 100 }),
  drawn() {
    if (picture.frames === 1) explain("open", () => {});
    if (!picture.last) return;
    rev = Math.max(rev, picture.last.rev);
    rig.shown(picture.last.seq);
    status.count(picture.last);
  },
  broken(why) {
    console.warn(`A picture could not be shown: ${why}`);
    // It may have been the last one before a long rest.
    if (performance.now() - keyframeAt < 1000) return;
    keyframeAt = performance.now();
    socket.send({ type: "keyframe" });
  },
});
const rig = new Rig((message) => socket.send(message), (camera) => {
  if (scene) become({ ...scene, camera: { ...scene.camera, ...camera } });
});
const edits = new Edits((message) => {
  const sent = socket.send(message);
  if (!sent) toast("Not connected: the change was not sent.", "error");
  return sent;
});
const gestures = new Gestures(canvas, { rect: () => picture.rect(), view: () => rig.view, move: (view) => rig.move(view) });
const bookmarks = new Bookmarks(byId("views", HTMLElement), (view) => rig.move(view));

/** @param {Scene} next */
function become(next) {
  scene = next;
  refreshing ||= requestAnimationFrame(refresh);
}

function refresh() {
  refreshing = 0;
  if (!scene) return;
  panel?.update(scene);
  presets?.mark(scene.about.title);
  document.title = scene.about.title ? `${scene.about.title} · Tyndall` : "Tyndall";
  byId("stage", HTMLElement).classList.toggle("clear", scene.render.background === "transparent");
}

/** What the page needs once from the server: schema, presets, facts. */
async function prepare() {
  if (panel) return;
  try {
    schema = await getJson("api/v1/schema");
  } catch (error) {
    complain(error);
    return;
  }
  const pages = { Look: byId("page-look", HTMLElement), Sim: byId("page-sim", HTMLElement), Camera: byId("page-camera", HTMLElement) };
  panel = new Panel(pages, schema, { edit: (...edit) => edits.set(...edit), suggest });
  refresh();
  openLink();
  getJson("api/v1/info").then((info) => {
    status.about(info);
    describeServer(info);
  }, complain);
  try {
    presets = await showPresets({ strip: byId("strip", HTMLElement), select: byId("preset", HTMLSelectElement) }, replace);
    refresh();
  } catch (error) {
    complain(error);
  }
}

/**
 * Puts a whole document in the place of the scene; Home is where it looks from.
 * @param {JsonObject} document @returns {Promise<boolean>} whether the server took it
 */
async function replace(document) {
  try {
    await putScene(document);
  } catch (error) {
    complain(error);
    return false;
  }
  rig.home = /** @type {any} */ (complete(schema.properties?.camera ?? {}, document.camera));
  // A simulation that starts anew and stands still would be an empty picture.
  if (!playing) command("play");
  return true;
}

/** Opens the scene that the address names after `#s=`. */
async function openLink() {
  const packed = /^#s=([\w-]+)$/.exec(location.hash)?.[1];
  if (!packed || role === "view") return;
  // Left there, it would undo every later change at a reload.
  history.replaceState(history.state, "", location.pathname + location.search);
  try {
    await replace(/** @type {JsonObject} */ (await unpack(packed)));
  } catch {
    toast("The link is damaged: its scene cannot be read.", "error");
  }
}

/** @param {ServerMessage} message */
function hear(message) {
  switch (message.type) {
    case "welcome": return welcome(message);
    case "patch": return patched(message);
    case "stats":
      if (stats && message.playing === undefined && stats.steps !== message.steps) showPlaying(true);
      if (message.playing !== undefined) showPlaying(message.playing);
      stats = message;
      return undefined;
    case "error":
      if (!message.path || !panel?.refuse(message.path, message.text)) return toast(message.text, "error");
      return toast(`${message.path}: ${message.text}`, "error");
    case "notice": return toast(message.text, message.level === "error" ? "error" : "info");
    case "control": {
      const mine = message.you ?? (message.holder === client || holding);
      showHolder(message.holder !== null && !mine);
      holding = message.holder !== null && mine;
      return undefined;
    }
    default: return undefined;
  }
}

/** @param {Extract<ServerMessage, {type: "welcome"}>} message */
function welcome(message) {
  const kept = scene;
  const before = rev;
  client = message.client ?? "";
  rev = message.rev;
  become(completeScene(schema, message.scene));
  rig.adopt(message.scene);
  showPlaying(message.playing ?? playing);
  showHolder(typeof message.holder === "string" && message.holder !== client);
  if (!kept) rig.home = rig.view;
  if (kept && returning && message.rev < before && role === "control") {
    // The server has started anew and forgotten; this page has not.
    replace(/** @type {any} */ (kept)).then((done) => done && toast("The server had started again: the scene is restored."));
  }
  returning = false;
}

/** Says that another holds control. @param {boolean} other */
function showHolder(other) {
  byId("holder", HTMLElement).hidden = !other || role === "view";
}

/** @param {Extract<ServerMessage, {type: "patch"}>} message */
function patched(message) {
  if (!scene) return;
  rev = Math.max(rev, message.rev);
  become(patchScene(schema, scene, message.patch));
  if ( "camera" in message.patch) rig.adopt(scene);
}

/** @param {string[]} path @param {Schema} about @returns {Json} */
function suggest(path, about) {
  const key = path.at(-1);
  if (key === "focus_distance") return Number(basis(rig.view).distance.toFixed(3));
  if (key === "freeze_at") return stats?.steps ?? 0;
  if (about.anyOf?.some(({ type }) => type === "array")) return [0, 1];
  const [low, high] = about["x-slider"] ?? [0, 1];
  if (about.anyOf?.some(({ type }) => type === "string")) return "";
  return about["x-scale"] === "log" ? Number(Math.sqrt(low * high).toPrecision(2)) : (low + high) / 2;
}

/** @param {boolean} now */
function showPlaying(now) {
  playing = now;
  const button = byId("toggle", HTMLButtonElement);
  const label = now ? "Pause" : "Play";
  button.setAttribute("aria-label", label);
  button.title = `${label} (Space)`;
  button.querySelector("use")?.setAttribute("href", now ? "#i-pause" : "#i-play");
}

/** @param {Command} cmd */
function command(cmd) {
  if (!socket.send({ type: "control", cmd })) toast("Not connected.", "error");
}

function aspect() {
  const { width, height } = picture.rect();
  return width / height;
}

async function copyLink() {
  if (!scene) return;
  const url = new URL(location.href);
  url.hash = `s=${await pack(compactScene(schema, scene))}`;
  if (await copy(url.href)) return toast("The link is on the clipboard.");
  byId("link-text", HTMLTextAreaElement).value = url.href;
  byId("link-dialog", HTMLDialogElement).showModal();
  return byId("link-text", HTMLTextAreaElement).select();
}

/** @type {Record<string, () => unknown>} */
const actions = {
  toggle() {
    command(playing ? "pause" : "play");
    showPlaying(!playing);
  },
  step() {
    command("step");
    showPlaying(false);
  },
  reset: () => command("reset"),
  undo: () => command("undo"),
  redo: () => command("redo"),
  take() {
    holding = true;
    command("take");
  },
  picture: () => picture.blob().then((blob) => download(blob, `tyndall-${stamp()}.png`), complain),
  link: () => copyLink().catch(complain),
  help: () => byId("help", HTMLDialogElement).showModal(),
  front: () => rig.move(lookFrom(rig.view, [0, 0, 1])),
  side: () => rig.move(lookFrom(rig.view, [1, 0, 0])),
  top: () => rig.move(lookFrom(rig.view, [0, 1, 0])),
  frame: () => scene && rig.move(frame(rig.view, Object.values(scene.volumes).flatMap(corners), aspect())),
  home: () => rig.move(rig.home),
  left: () => gestures.orbit(-1 / 12, 0),
  right: () => gestures.orbit(1 / 12, 0),
  up: () => gestures.orbit(0, 1 / 12),
  down: () => gestures.orbit(0, -1 / 12),
  nearer: () => gestures.dolly(0.8),
  farther: () => gestures.dolly(1.25),
  bookmark: () => toast(`Kept as view ${bookmarks.add(rig.view, canvas)}.`),
  save: () => scene && download(new Blob([JSON.stringify(scene, null, 2)], { type: "application/json" }), `${scene.about.title || "scene"}.json`),
  open: () => byId("file", HTMLInputElement).click(),
  nrrd: () => exportVolume(Object.keys(scene?.volumes ?? {})[0] ?? "main", "nrrd"),
  npy: () => exportVolume(Object.keys(scene?.volumes ?? {})[0] ?? "main", "npy"),
};

document.addEventListener("click", ({ target }) => {
  const button = target instanceof Element ? target.closest("[data-do]") : null;
  if (!button) return;
  const menu = button.closest("[popover]");
  if (menu instanceof HTMLElement) menu.hidePopover();
  actions[button.getAttribute("data-do") ?? ""]?.();
});

/** @param {string} name */
const act = (name) => () => void actions[name]?.();
listen({
  axis: (number) => void actions[{ 1: "front", 3: "side", 7: "top" }[number]]?.(),
  recall: (number) => void bookmarks.recall(number),
  fly: (event) => gestures.press(event),
  frame: act("frame"), home: act("home"), bookmark: act("bookmark"), toggle: act("toggle"), step: act("step"),
  picture: act("picture"), link: act("link"), undo: act("undo"), redo: act("redo"), help: act("help"),
}, byId("single-keys", HTMLInputElement));

/** @type {ReturnType<typeof setTimeout> | undefined} */
let resizing;
function resized() {
  picture.fit();
  clearTimeout(resizing);
  resizing = setTimeout(() => {
    const size = picture.wantedSize();
    if (String(size) !== asked && socket.send({ type: "resize", size })) asked = String(size);
  }, RESIZE_AFTER);
}
new ResizeObserver(resized).observe(canvas);
byId("resolution", HTMLSelectElement).addEventListener("change", ({ target }) => {
  const { value } = /** @type {HTMLSelectElement} */ (target);
  picture.resolution = value === "auto" ? "auto" : Number(value);
  resized();
});
addEventListener("hashchange", () => void openLink());
setInterval(() => scene && status.show({ picture, stats, target: scene.render.spp, latency: rig.latency }), 250);

makeTabs(byId("tabs", HTMLElement));
showHints(byId("tabs", HTMLElement).parentElement ?? document.body);
offerStills(byId("still", HTMLFormElement));
acceptScenes(byId("file", HTMLInputElement), replace);
socket.connect();

/** What tests and curious people may look at. */
Object.assign(window, {
  tyndall: Object.freeze({
    get frames() { return picture.frames; },
    get broken() { return picture.broken; },
    get lastFrame() { return picture.last; },
    get scene() { return scene; },
    get stats() { return stats; },
    get state() { return socket.state; },
    get playing() { return playing; },
    get latency() { return rig.latency; },
  }),
});
