// @ts-check
// HTTP: addresses under the page's own, the token, the API's errors.

/** @typedef {import("./protocol.js").Json} Json */

const page = new URL(location.href);

/** The session that this page shows. */
export const session = page.searchParams.get("session") || "main";
/** `control`, or `view` for a page that only looks. */
export const role = page.searchParams.get("role") === "view" ? "view" : "control";

const KEY = "tyndall.token";
let token = page.searchParams.get("token") ?? remembered();

if (page.searchParams.has("token")) {
  remember(token ?? "");
  page.searchParams.delete("token");
  // A token in the address bar would end up in histories, screenshots and shared links.
  history.replaceState(history.state, "", page);
}

function remembered() {
  try {
    return sessionStorage.getItem(KEY);
  } catch {
    return null;
  }
}

/** Keeps a token for this tab. @param {string} value */
export function remember(value) {
  token = value;
  try {
    sessionStorage.setItem(KEY, value);
  } catch {
    // Without storage the token lasts until the page is reloaded.
  }
}

/** The address of something on the server, with the token. @param {string} path relative to the page */
export function address(path) {
  const url = new URL(path, document.baseURI);
  url.hash = "";
  if (token && url.pathname.includes("/api/")) url.searchParams.set("token", token);
  return url;
}

/** The address of the session's own resource. @param {string} path */
export function sessionAddress(path) {
  return address(`api/v1/sessions/${encodeURIComponent(session)}/${path}`);
}

/** A refusal by the server (RFC 9457). */
export class Problem extends Error {
  /** @param {number} status @param {{title?: string, detail?: string, code?: string, path?: string, text?: string}} body */
  constructor(status, body) {
    super(body.detail ?? body.text ?? body.title ?? `The server answered ${status}.`);
    this.status = status;
    this.code = body.code ?? "";
    this.path = body.path ?? "";
  }
}

/** @param {URL} url @param {RequestInit} [init] @returns {Promise<Response>} */
export async function request(url, init) {
  const response = await fetch(url, init);
  if (response.ok) return response;
  const body = await response.json().catch(() => ({}));
  throw new Problem(response.status, body && typeof body === "object" ? body : {});
}

/** @param {string} path @returns {Promise<any>} */
export async function getJson(path) {
  return (await request(address(path))).json();
}

/** Replaces the session's whole scene. @param {Json} scene */
export async function putScene(scene) {
  await request(sessionAddress("scene"), {
    method: "PUT",
    headers: { "content-type": "application/json" },
    body: JSON.stringify(scene),
  });
}
