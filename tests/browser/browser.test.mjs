// The page against the real server.
import assert from "node:assert/strict";
import { mkdirSync, readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { after, before, test } from "node:test";
import { PATIENCE, SHOTS, difference, finalPicture, look, mean, openBrowser, openPage, openServer, thumbnail } from "./harness.mjs";

const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"];

let server;
let browser;
let page;

before(async () => {
  mkdirSync(SHOTS, { recursive: true });
  server = await openServer();
  browser = await openBrowser();
  page = await openPage(browser, server.url);
}, { timeout: PATIENCE });

after(async () => {
  await browser?.close();
  server?.close();
});

/** Sends a patch as the panel does, through the fields themselves. */
async function type(field, value) {
  await field.fill(String(value));
  await field.press("Enter");
}

/** What axe-core finds against WCAG 2.2 AA and good practice. */
function violations(at) {
  return at.evaluate(async (values) => {
    const { violations: found } = await globalThis.axe.run(document, { runOnly: { type: "tag", values } });
    return found.flatMap(({ id, nodes }) => nodes.map(({ target, failureSummary }) => `${id} ${target} ${failureSummary}`));
  }, RULES);
}

test("pictures arrive and are not black", async () => {
  await page.waitForFunction(() => globalThis.tyndall.frames > 2);
  const { lastFrame, broken, state } = await look(page);
  assert.equal(state, "open");
  assert.equal(broken, 0);
  assert.ok(lastFrame.width >= 16 && lastFrame.height >= 16 && lastFrame.spp >= 1, JSON.stringify(lastFrame));
  assert.ok(mean(await thumbnail(page)) > 4);
  assert.equal(await page.isVisible("#overlay"), false);
});

test("paused and left alone, it reaches a final lossless picture and then rests", async () => {
  if ((await look(page)).playing) await page.click("#toggle");
  await page.waitForFunction(() => !globalThis.tyndall.playing);
  await page.click("#tab-camera");
  await type(page.getByLabel("Samples, exact"), 8);
  await page.waitForFunction(() => globalThis.tyndall.scene.render.spp === 8);
  const { lossless, spp, codec } = await finalPicture(page);
  assert.deepEqual({ lossless, spp, codec }, { lossless: true, spp: 8, codec: 0 });
  await page.waitForTimeout(1500);
  const { frames } = await look(page);
  await page.waitForTimeout(1500);
  assert.equal((await look(page)).frames, frames, "nothing more comes until something changes");
});

test("a drag turns the camera and changes the picture", async () => {
  const before = await look(page);
  const shown = await thumbnail(page);
  const box = await page.locator("#canvas").boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width / 2 + 120, box.y + box.height / 2 + 40, { steps: 6 });
  await page.mouse.up();
  const { lastFrame, scene } = await look(page).then(async () => {
    await page.waitForFunction(({ seq, rev }) => globalThis.tyndall.lastFrame.seq > seq && globalThis.tyndall.lastFrame.rev > rev, before.lastFrame);
    await finalPicture(page, before.lastFrame.rev + 1);
    return look(page);
  });
  assert.notDeepEqual(scene.camera.position, before.scene.camera.position);
  assert.deepEqual(scene.camera.target, before.scene.camera.target);
  assert.ok(lastFrame.seq > before.lastFrame.seq);
  const distance = ({ position }) => Math.hypot(...position);
  assert.ok(Math.abs(distance(scene.camera) - distance(before.scene.camera)) < 1e-4, "an orbit keeps the distance");
  assert.ok(difference(shown, await thumbnail(page)) > 0.5);
});

test("a slider changes the scene and restarts the samples", async () => {
  await page.click("#tab-look");
  const { lastFrame, scene } = await look(page);
  assert.ok(lastFrame.final);
  await page.evaluate(() => {
    globalThis.seen = [];
    const note = () => {
      const { rev, spp } = globalThis.tyndall.lastFrame;
      const last = globalThis.seen.at(-1);
      if (last?.rev !== rev || last?.spp !== spp) globalThis.seen.push({ rev, spp });
      requestAnimationFrame(note);
    };
    note();
  });
  const slider = page.getByLabel("Extinction", { exact: true });
  await slider.focus();
  for (let i = 0; i < 12; i += 1) await slider.press("ArrowRight");
  await page.waitForFunction((before) => globalThis.tyndall.scene.volumes.main.medium.sigma_t > before, scene.volumes.main.medium.sigma_t);
  await finalPicture(page, lastFrame.rev + 1);
  const seen = await page.evaluate(() => globalThis.seen);
  assert.ok(seen.some(({ rev, spp }) => rev > lastFrame.rev && spp < 8), JSON.stringify(seen));
});

test("undo brings the value back", async () => {
  const { scene, lastFrame } = await look(page);
  await page.click("[data-do=undo]");
  await page.waitForFunction((now) => globalThis.tyndall.scene.volumes.main.medium.sigma_t < now, scene.volumes.main.medium.sigma_t);
  await finalPicture(page, lastFrame.rev + 1);
});

test("a refused value is explained beside its field", async () => {
  await page.click("#tab-camera");
  const { scene } = await look(page);
  await type(page.getByLabel("Field of view, exact"), 500);
  const error = page.locator('[data-path="camera.fov_y"] .error');
  await error.filter({ hasText: "179" }).waitFor();
  assert.equal((await look(page)).scene.camera.fov_y, scene.camera.fov_y);
  assert.match(await page.textContent("#toasts"), /camera\.fov_y/);
});

test("a second window sees the same, and follows", async () => {
  const other = await openPage(browser, server.url);
  const { lastFrame, scene } = await look(page);
  await finalPicture(page, lastFrame.rev);
  await finalPicture(other, lastFrame.rev);
  assert.deepEqual((await look(other)).scene, scene);
  assert.ok(difference(await thumbnail(page), await thumbnail(other)) < 2);
  await page.click("#tab-look");
  await type(page.getByLabel("Exposure, exact"), 1.5);
  await other.waitForFunction(() => globalThis.tyndall.scene.display.exposure === 1.5);
  assert.equal(await other.getByLabel("Exposure, exact").inputValue(), "1.5");
  assert.deepEqual(other.faults, []);
  await other.context().close();
});

test("a link brings the whole scene back", async () => {
  await page.click("[data-do=link] >> visible=true");
  await page.getByText("The link is on the clipboard.").waitFor();
  const link = await page.evaluate(() => navigator.clipboard.readText());
  const { scene } = await look(page);
  await page.click("#tab-look");
  await type(page.getByLabel("Exposure, exact"), -2);
  await page.waitForFunction(() => globalThis.tyndall.scene.display.exposure === -2);
  const other = await openPage(browser, link);
  await other.waitForFunction(() => globalThis.tyndall.scene.display.exposure !== -2);
  assert.deepEqual((await look(other)).scene, scene);
  assert.equal(new URL(other.url()).hash, "");
  await other.context().close();
});

test("a preset replaces the scene and plays", async () => {
  const names = await page.locator("#strip .tile").allTextContents();
  assert.ok(names.length > 0);
  await page.locator("#strip .tile").first().click();
  await page.waitForFunction(() => document.querySelector("#strip .tile").getAttribute("aria-pressed") === "true");
  assert.equal((await look(page)).scene.about.title, names[0]);
  await page.waitForFunction(() => globalThis.tyndall.playing && globalThis.tyndall.stats.steps > 0);
  assert.deepEqual(page.faults, []);
});

for (const [width, height] of [[1440, 900], [820, 1180], [390, 844]]) {
  test(`nothing hinders access and nothing sticks out at ${width} px`, async () => {
    for (const colorScheme of ["dark", "light"]) {
      const at = await openPage(browser, server.url, { viewport: { width, height }, colorScheme, hasTouch: width < 900 });
      await at.waitForFunction(() => globalThis.tyndall.stats && document.querySelector("#strip .tile"));
      // A look worth a screenshot takes some steps; where they take too long, any picture will do.
      await at.waitForFunction(() => globalThis.tyndall.stats.steps > 60, undefined, { timeout: 10_000 }).catch(() => {});
      await at.screenshot({ path: `${SHOTS}${width}-${colorScheme}.png` });
      await at.evaluate(AXE);
      for (const tab of ["look", "sim", "camera", "view"]) {
        await at.click(`#tab-${tab}`);
        assert.deepEqual(await violations(at), [], `${tab}, ${colorScheme}`);
        const excess = await at.evaluate(() => document.documentElement.scrollWidth - innerWidth);
        assert.ok(excess <= 0, `the page is ${excess} px too wide`);
      }
      await at.keyboard.press("?");
      assert.deepEqual(await violations(at), [], `help, ${colorScheme}`);
      await at.context().close();
    }
  });
}
