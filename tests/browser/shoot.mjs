// Screenshots of the page at several widths, in both themes: node shoot.mjs URL [FOLDER]
import { mkdirSync } from "node:fs";
import { chromium } from "playwright-core";

const [url = "http://127.0.0.1:8090/", folder = new URL("shots", import.meta.url).pathname] = process.argv.slice(2);
mkdirSync(folder, { recursive: true });
const browser = await chromium.launch({ executablePath: "/usr/bin/chromium", args: ["--no-sandbox", "--disable-gpu", "--disable-quic"] });
for (const [width, height, colorScheme] of [[1440, 900, "dark"], [1440, 900, "light"], [820, 1180, "dark"], [390, 844, "dark"], [390, 844, "light"]]) {
  const page = await browser.newPage({ viewport: { width, height }, colorScheme, hasTouch: width < 800 });
  page.on("console", (message) => console.log(message.type(), message.text()));
  page.on("pageerror", (error) => console.log("page error", error.message));
  await page.goto(url);
  await page.waitForFunction(() => globalThis.tyndall?.frames > 5, undefined, { timeout: 15000 });
  await page.waitForTimeout(1500);
  await page.screenshot({ path: `${folder}/${width}-${colorScheme}.png` });
  for (const tab of process.env.TABS?.split(",") ?? []) {
    await page.click(`#tab-${tab}`);
    await page.screenshot({ path: `${folder}/${width}-${colorScheme}-${tab}.png`, fullPage: width < 900 });
  }
  await page.close();
}
await browser.close();
