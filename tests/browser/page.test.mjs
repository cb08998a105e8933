// The page against a mock server that can misbehave.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import WebSocket from "ws";
import { PATIENCE, look, openBrowser, openPage } from "./harness.mjs";
import { mock } from "./mock.mjs";

let browser;
let server;

before(async () => {
  browser = await openBrowser();
  server = await mock({ detail: 0.2 });
}, { timeout: PATIENCE });

after(async () => {
  await browser?.close();
  server?.close();
});

/** Opens a page without waiting for a picture. */
async function openBare(url) {
  const context = await browser.newContext({ viewport: { width: 640, height: 480 } });
  context.setDefaultTimeout(20_000);
  const page = await context.newPage();
  await page.goto(url);
  return page;
}

test("a broken picture is passed over, and its credit returns", async () => {
  const page = await openPage(browser, server.url);
  for (let i = 0; i < 4; i += 1) server.spoil();
  await page.waitForFunction(() => globalThis.tyndall.broken >= 8);
  const { frames } = await look(page);
  await page.waitForFunction((before) => globalThis.tyndall.frames > before + 3, frames);
  assert.ok(server.credit().every(({ frame, acked }) => frame - acked <= 2));
  assert.deepEqual(page.faults, []);
  await page.context().close();
});

test("a broken last picture is asked for again", async () => {
  const own = await mock({ detail: 0.2 });
  const page = await openPage(browser, own.url);
  await page.click("#toggle");
  await page.click("#tab-camera");
  await page.getByLabel("Samples, exact").fill("2");
  await page.getByLabel("Samples, exact").press("Enter");
  await page.waitForFunction(() => globalThis.tyndall.lastFrame.final && globalThis.tyndall.lastFrame.spp === 2);
  const { frames } = await look(page);
  own.spoil();
  await page.waitForFunction((before) => globalThis.tyndall.frames > before, frames);
  assert.equal((await look(page)).lastFrame.final, true);
  await page.context().close();
  own.close();
});

test("a second welcome loses no credit", async () => {
  const page = await openPage(browser, server.url);
  for (let i = 0; i < 20; i += 1) {
    server.greet();
    await page.waitForTimeout(37);
  }
  const { frames } = await look(page);
  await page.waitForFunction((before) => globalThis.tyndall.frames > before + 3, frames);
  await page.context().close();
});

test("under a sub-path every address stays below it", async () => {
  const below = await mock({ detail: 0.2, base: "/some/path/" });
  const page = await openPage(browser, below.url);
  await page.waitForFunction(() => document.querySelectorAll("#strip .tile").length > 3);
  await page.locator("#strip .tile").nth(1).click();
  await page.waitForFunction(() => globalThis.tyndall.scene.about.title === "Amber");
  await page.context().close();
  below.close();
});

test("a token leaves the address bar and opens the page", async () => {
  const locked = await mock({ detail: 0.2, token: "s3cret" });
  const page = await openPage(browser, `${locked.url}?token=s3cret`);
  assert.equal(page.url(), locked.url);
  await page.reload();
  await page.waitForFunction(() => globalThis.tyndall?.frames > 0);
  await page.context().close();

  const without = await openBare(locked.url);
  await without.getByRole("heading", { name: "A token is needed" }).waitFor();
  await without.getByLabel("Token").fill("s3cret");
  await without.getByRole("button", { name: "Open", exact: true }).click();
  await without.waitForFunction(() => globalThis.tyndall.frames > 0);
  assert.equal(await without.isVisible("#overlay"), false);
  await without.context().close();
  locked.close();
});

test("a session that does not exist is named", async () => {
  const page = await openBare(`${server.url}?session=nobody`);
  await page.getByText("no session named “nobody”").waitFor();
  await page.getByRole("link", { name: "Open the main session" }).click();
  await page.waitForFunction(() => globalThis.tyndall?.frames > 0);
  await page.context().close();
});

test("a lost server is named, and its return brings picture and scene back", async () => {
  const first = await mock({ detail: 0.2 });
  const page = await openPage(browser, first.url);
  await page.getByLabel("Exposure, exact").fill("-1");
  await page.getByLabel("Exposure, exact").press("Enter");
  await page.waitForFunction(() => globalThis.tyndall.scene.display.exposure === -1);
  first.close();
  await page.getByRole("heading", { name: "The server is gone" }).waitFor();
  const { frames } = await look(page);
  const second = await mock({ detail: 0.2, port: first.port });
  await page.waitForFunction((before) => globalThis.tyndall.frames > before, frames);
  assert.equal(await page.isVisible("#overlay"), false);
  await page.waitForFunction(() => globalThis.tyndall.scene.display.exposure === -1 && globalThis.tyndall.scene.about.title);
  assert.deepEqual(page.faults, []);
  await page.context().close();
  second.close();
});

test("another's control is shown, and can be taken", async () => {
  const page = await openPage(browser, server.url);
  const other = new WebSocket(`${server.url.replace("http", "ws")}api/v1/sessions/main/ws`, "tyndall.v1");
  other.on("open", () => {
    other.send(JSON.stringify({ type: "hello", codecs: ["jpeg"], size: [64, 36], role: "control" }));
    other.send(JSON.stringify({ type: "control", cmd: "take" }));
  });
  await page.getByText("Someone else holds control.").waitFor();
  await page.getByRole("button", { name: "Take control" }).click();
  await page.getByText("Someone else holds control.").waitFor({ state: "hidden" });
  other.close();
  await page.context().close();
});

test("another's camera moves this page's", async () => {
  const page = await openPage(browser, server.url);
  const other = new WebSocket(`${server.url.replace("http", "ws")}api/v1/sessions/main/ws`, "tyndall.v1");
  other.on("open", () => {
    other.send(JSON.stringify({ type: "hello", codecs: ["jpeg"], size: [64, 36], role: "control" }));
    other.send(JSON.stringify({ type: "camera", seq: 1, position: [0, 0, 4] }));
  });
  await page.waitForFunction(() => globalThis.tyndall.scene.camera.position[2] === 4);
  await page.locator("#canvas").press("ArrowRight");
  await page.waitForFunction(() => Math.abs(globalThis.tyndall.scene.camera.position[0]) > 0.1);
  const { position } = (await look(page)).scene.camera;
  assert.ok(Math.abs(Math.hypot(...position) - 4) < 1e-6, "the page goes on from there");
  other.close();
  await page.context().close();
});

test("keys drive the page, but not while a field is edited", async () => {
  const page = await openPage(browser, server.url);
  const position = async () => (await look(page)).scene.camera.position;
  await page.locator("#canvas").focus();
  await page.keyboard.press("1");
  await page.waitForFunction(() => Math.abs(globalThis.tyndall.scene.camera.position[0]) < 1e-9);
  await page.keyboard.press("Space");
  await page.waitForFunction(() => !globalThis.tyndall.playing);
  await page.keyboard.press("b");
  await page.keyboard.press("3");
  await page.waitForFunction(() => Math.abs(globalThis.tyndall.scene.camera.position[2]) < 1e-9);
  await page.keyboard.press("Shift+Digit1");
  await page.waitForFunction(() => Math.abs(globalThis.tyndall.scene.camera.position[0]) < 1e-9);
  await page.keyboard.press("Home");
  await page.waitForFunction(() => Math.abs(globalThis.tyndall.scene.camera.position[0]) > 0.1);
  const home = await position();
  await page.keyboard.down("w");
  await page.waitForFunction((z) => Math.abs(globalThis.tyndall.scene.camera.position[2] - z) > 0.02, home[2]);
  await page.keyboard.up("w");
  await page.waitForTimeout(100);
  const flown = await position();
  await page.getByLabel("Exposure, exact").focus();
  await page.keyboard.type("1");
  await page.waitForTimeout(200);
  assert.deepEqual(await position(), flown);
  await page.keyboard.press("Tab");
  await page.locator("#canvas").focus();
  await page.keyboard.press("?");
  await page.getByRole("heading", { name: "Keys and gestures" }).waitFor();
  await page.keyboard.press("Escape");
  await page.context().close();
});

test("the wheel keeps what is under the pointer, and a right drag carries it along", async () => {
  const page = await openPage(browser, server.url);
  await page.keyboard.press("Home");
  const box = await page.locator("#canvas").boundingBox();
  const { project } = await import("../../static/camera.js");
  const { pointAt } = await import("../../static/camera.js");
  const aspect = box.width / box.height;
  const place = (x, y) => [(2 * x) / box.width - 1, 1 - (2 * y) / box.height];
  const before = (await look(page)).scene.camera;
  const grabbed = pointAt(before, ...place(200, 100), aspect);
  await page.mouse.move(box.x + 200, box.y + 100);
  await page.mouse.wheel(0, -240);
  await page.waitForFunction((z) => globalThis.tyndall.scene.camera.position[2] !== z, before.position[2]);
  await page.mouse.down({ button: "right" });
  await page.mouse.move(box.x + 260, box.y + 150, { steps: 3 });
  await page.mouse.up({ button: "right" });
  await page.waitForTimeout(200);
  const [x, y] = project((await look(page)).scene.camera, grabbed, aspect);
  const [wantX, wantY] = place(260, 150);
  assert.ok(Math.hypot(x - wantX, y - wantY) < 1e-3, `${[x, y]} is not ${[wantX, wantY]}`);
  await page.context().close();
});

test("parameters that say nothing are hidden until they do", async () => {
  const page = await openPage(browser, server.url);
  const row = (path) => page.locator(`[data-path="volumes.main.medium.${path}"]`);
  assert.equal(await row("phase.g").isVisible(), true);
  assert.equal(await row("phase.weight").isVisible(), false);
  await page.getByLabel("Phase", { exact: true }).selectOption("drift");
  await row("phase.weight").waitFor();
  assert.equal(await row("phase.g").isVisible(), false);
  await page.click("#tab-sim");
  await page.locator("#page-sim").getByLabel("Kind", { exact: true }).selectOption("cloud");
  await page.locator('[data-path="volumes.main.source.octaves"]').waitFor();
  assert.equal(await page.locator('[data-path="volumes.main.source.agents"]').count(), 0);
  await page.context().close();
});

test("a value that is not touched is not rounded", async () => {
  const page = await openPage(browser, server.url);
  const response = await fetch(`${server.url}api/v1/sessions/main/scene`, {
    method: "PUT",
    body: JSON.stringify({ volumes: { main: { medium: { albedo: [0.98765432, 0.5, 0.1234567] } } }, light: { sun: { irradiance: [9.000001, 7.5, 5.123456] } } }),
  });
  assert.equal(response.status, 200);
  await page.waitForFunction(() => globalThis.tyndall.scene.light.sun.irradiance[0] === 9.000001);
  await page.getByLabel("Albedo, green").fill("0.6");
  await page.getByLabel("Albedo, green").press("Enter");
  await page.getByLabel("Irradiance, strength, exact").fill("18.000002");
  await page.getByLabel("Irradiance, strength, exact").press("Enter");
  await page.waitForFunction(() => globalThis.tyndall.scene.light.sun.irradiance[0] > 18);
  const { scene } = await look(page);
  assert.deepEqual(scene.volumes.main.medium.albedo, [0.98765432, 0.6, 0.1234567]);
  scene.light.sun.irradiance.forEach((x, i) => assert.ok(Math.abs(x - 2 * [9.000001, 7.5, 5.123456][i]) < 1e-9));
  await page.context().close();
});

test("a drag of a slider is one gesture that ends committed", async () => {
  const page = await openPage(browser, server.url, { viewport: { width: 1000, height: 700 } });
  const sent = [];
  page.on("websocket", (socket) => socket.on("framesent", ({ payload }) => sent.push(JSON.parse(String(payload)))));
  await page.reload();
  await page.waitForFunction(() => document.querySelector("#page-look .row"));
  const box = await page.getByLabel("Extinction", { exact: true }).boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await page.mouse.down();
  for (let i = 0; i < 10; i += 1) {
    await page.mouse.move(box.x + box.width / 2 + 3 * i, box.y + box.height / 2);
    await page.waitForTimeout(15);
  }
  await page.mouse.up();
  await page.waitForTimeout(200);
  const patches = sent.filter(({ type }) => type === "patch");
  assert.ok(patches.length > 1);
  assert.equal(new Set(patches.map(({ gesture }) => gesture)).size, 1);
  assert.deepEqual(patches.map(({ commit }) => commit), [...patches.slice(1).map(() => false), true]);
  assert.equal((await look(page)).scene.volumes.main.medium.sigma_t, patches.at(-1).patch.volumes.main.medium.sigma_t);
  await page.context().close();
});
