// What the browser tests share: a server to look at, a browser, and ways to look at the page.
import { spawn } from "node:child_process";
import { existsSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

/** Milliseconds that a picture may take: a software adapter on a shared machine is slow. */
export const PATIENCE = 90_000;
const BROWSERS = ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome", process.env.CHROME_PATH ?? ""];
const FLAGS = [
  "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
  "--disable-component-update", "--disable-sync", "--disable-renderer-backgrounding", "--disable-backgrounding-occluded-windows",
];

export const SHOTS = fileURLToPath(new URL("shots/", import.meta.url));
export const BINARY = process.env.TYNDALL_BIN ?? fileURLToPath(new URL("../../target/debug/tyndall", import.meta.url));

/** A scene that a software adapter can show quickly. */
export const SMALL_SCENE = {
  about: { title: "Small" },
  camera: { position: [1.35, 0.75, -1.75], target: [0, 0, 0], fov_y: 34 },
  volumes: { main: { source: { type: "physarum", size: [48, 48, 48], agents: 8000 }, medium: { sigma_t: 60, albedo: [0.9, 0.8, 0.6] } } },
  light: { sky: { type: "constant", radiance: [0.4, 0.45, 0.5] } },
  render: { spp: 8, max_bounces: 8 },
};

export async function openBrowser() {
  const executablePath = BROWSERS.find((path) => path && existsSync(path));
  if (!executablePath) throw new Error("no Chromium is installed");
  return chromium.launch({ executablePath, args: FLAGS });
}

/** Starts the server on a free port, or uses the one at TYNDALL_URL. */
export async function openServer() {
  if (process.env.TYNDALL_URL) return { url: process.env.TYNDALL_URL, close() {} };
  const folder = mkdtempSync(join(tmpdir(), "tyndall-"));
  const scene = join(folder, "small.json");
  writeFileSync(scene, JSON.stringify(SMALL_SCENE));
  const server = spawn(BINARY, ["serve", "--listen", "127.0.0.1:0", "--data", folder, "--scene", scene], { stdio: ["ignore", "pipe", "inherit"] });
  const close = () => {
    server.kill("SIGTERM");
    rmSync(folder, { recursive: true, force: true });
  };
  const url = await new Promise((resolve, reject) => {
    let said = "";
    server.stdout.setEncoding("utf8");
    server.stdout.on("data", (text) => {
      said += text;
      const address = /https?:\/\/[\w.:-]+\/\S*/.exec(said)?.[0];
      if (address) resolve(address);
    });
    server.on("error", reject);
    server.on("exit", (code) => reject(new Error(`the server ended with ${code}: ${said}`)));
  });
  return { url, close };
}

/** Opens the page and waits for its first picture. */
export async function openPage(browser, url, options = {}) {
  const context = await browser.newContext({ viewport: { width: 640, height: 480 }, permissions: ["clipboard-read", "clipboard-write"], ...options });
  context.setDefaultTimeout(PATIENCE);
  const page = await context.newPage();
  page.faults = [];
  page.on("pageerror", (error) => page.faults.push(error.message));
  await page.goto(url);
  await page.waitForFunction(() => globalThis.tyndall?.frames > 0 && document.querySelector("#page-look .row"));
  return page;
}

/** What the test hook of the page says. */
export function look(page) {
  return page.evaluate(() => {
    const { frames, broken, lastFrame, scene, stats, state, playing } = globalThis.tyndall;
    return { frames, broken, lastFrame, scene, stats, state, playing };
  });
}

/** Waits for a final picture that shows at least this revision. */
export async function finalPicture(page, atLeast = 0) {
  await page.waitForFunction((rev) => globalThis.tyndall.lastFrame?.final && globalThis.tyndall.lastFrame.rev >= rev, atLeast);
  return (await look(page)).lastFrame;
}

/** The canvas in 32×24 values of luminance, 0 to 255. */
export function thumbnail(page) {
  return page.evaluate(() => {
    const small = new OffscreenCanvas(32, 24);
    const context = small.getContext("2d");
    context.imageSmoothingQuality = "high";
    context.drawImage(document.querySelector("#canvas"), 0, 0, 32, 24);
    const { data } = context.getImageData(0, 0, 32, 24);
    return Array.from({ length: 32 * 24 }, (_, i) => 0.2126 * data[4 * i] + 0.7152 * data[4 * i + 1] + 0.0722 * data[4 * i + 2]);
  });
}

/** @param {number[]} values */
export const mean = (values) => values.reduce((sum, x) => sum + x, 0) / values.length;

/** Mean difference between two thumbnails. */
export const difference = (a, b) => mean(a.map((x, i) => Math.abs(x - b[i])));
