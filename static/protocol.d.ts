/** What travels between the page and the server, and the types that the page's modules share. */

export type Vec3 = [number, number, number];
export type Json = null | boolean | number | string | Json[] | { [key: string]: Json };
export type JsonObject = { [key: string]: Json };

/** Where a picture is taken from; `fov_y` is the full vertical angle in degrees. */
export interface View {
  position: Vec3;
  target: Vec3;
  up: Vec3;
  fov_y: number;
}

export interface Volume extends JsonObject {
  source: JsonObject & { type: string };
  transform: JsonObject & { translate: Vec3; rotate: Vec3; scale: Vec3 };
}

/** A full scene document: every key is written out. The panel reads the rest of it through the schema. */
export interface Scene {
  about: JsonObject & { title: string; description: string };
  camera: View & { [key: string]: Json };
  volumes: { [name: string]: Volume };
  light: JsonObject;
  render: JsonObject & { spp: number; background: string };
  display: JsonObject;
}

/** The part of JSON Schema (2020-12) that the server uses, with its own annotations. */
export interface Schema {
  type?: string;
  title?: string;
  description?: string;
  default?: Json;
  const?: Json;
  enum?: string[];
  unit?: string;
  minimum?: number;
  maximum?: number;
  minItems?: number;
  maxProperties?: number;
  items?: Schema;
  properties?: { [key: string]: Schema };
  additionalProperties?: Schema | boolean;
  oneOf?: Schema[];
  anyOf?: Schema[];
  "x-slider"?: [number, number];
  "x-scale"?: "log";
  "x-kind"?: string;
  "x-tab"?: string;
}

export type Command = "play" | "pause" | "step" | "reset" | "undo" | "redo" | "take" | "release";

export type ClientMessage =
  | { type: "hello"; codecs: string[]; size: [number, number]; role: string }
  | ({ type: "camera"; seq: number } & Partial<View>)
  | { type: "patch"; patch: JsonObject; gesture?: string; commit?: boolean }
  | { type: "ack"; frame: number; decode_ms: number }
  | { type: "keyframe" }
  | { type: "resize"; size: [number, number] }
  | { type: "control"; cmd: Command; steps?: number };

export interface Stats {
  fps: number;
  spp: number;
  noise: number | null;
  simulate_ms: number;
  render_ms: number;
  encode_ms: number;
  kbps: number;
  steps: number;
  playing?: boolean;
}

export type ServerMessage =
  | { type: "welcome"; protocol: string; session: string; role: string; codec: string; rev: number; scene: Scene; client?: string; playing?: boolean; holder?: string | null }
  | { type: "patch"; rev: number; by: string | null; patch: JsonObject }
  | ({ type: "stats" } & Stats)
  | { type: "notice"; level: string; code: string; text: string }
  | { type: "error"; code: string; path: string; text: string }
  | { type: "control"; holder: string | null; you?: boolean };

/** The 40 bytes before a picture, read. Times in microseconds, `began` on the server's monotonic clock. */
export interface FrameHeader {
  codec: number;
  key: boolean;
  final: boolean;
  lossless: boolean;
  width: number;
  height: number;
  frame: number;
  seq: number;
  rev: number;
  spp: number;
  began: number;
  render_us: number;
  encode_us: number;
}

export interface Preset {
  name: string;
  title: string;
  description: string;
  best_step: number | null;
}

export interface Info {
  version: string;
  adapter: { name: string; backend: string; type: string };
  limits: JsonObject;
}

/** Why there is no connection, or that there is one. */
export type LinkState = "connecting" | "open" | "gone" | "unauthorized" | "forbidden" | "no-session";

/** A part of the panel that shows one value of the scene. */
export interface Control {
  element: HTMLElement;
  /** Shows `value` unless the user is busy with it. */
  update(value: Json): void;
}

/** What the controls of the panel may ask of the page. */
export interface PanelContext {
  /** Sends a value; `gesture` joins the steps of one drag, null as value restores the default. */
  edit(path: string[], value: Json, gesture?: string, commit?: boolean): void;
  /** A first value for a parameter that was null or automatic. */
  suggest(path: string[], schema: Schema): Json;
}
