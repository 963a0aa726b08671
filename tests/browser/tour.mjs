// The first ten minutes at the panel, as docs/how-to/first-ten-minutes-at-the-panel.md tells them, with its pictures.
// Usage: tour.mjs LINK FOLDER

import { browser, enter, status, until, view } from "./panel.mjs";

const [link, folder] = process.argv.slice(2);
const chromium = await browser();
const context = await chromium.newContext({ viewport: { width: 900, height: 640 }, hasTouch: true });
const page = await enter(context, link);
const picture = async (name, width = 900, height = 640) => {
  await page.setViewportSize({ width, height });
  await page.evaluate(() => scrollTo(0, 0));
  await page.waitForTimeout(400);
  await page.screenshot({ path: `${folder}/panel-${name}.png` });
};
const press = (name) => page.getByRole("button", { name }).first().click();
const tell = (word, value) => page.evaluate(([w, v]) => window.panel.link.command(w, v).then(({ ended }) => ended), [word, value]);

await picture("begin");
await press("Enable");
await until(page, (s) => s.state === "operation enabled");
await view(page, "jog");
await picture("jog", 360, 740);
const box = await page.locator("#jog-plus").boundingBox();
await page.mouse.move(box.x + 30, box.y + 30);
await page.mouse.down();
await until(page, (s) => s.velocity > 0.01);
await page.waitForTimeout(500);
await page.mouse.up();
await until(page, (s) => s.rests);
await page.setViewportSize({ width: 900, height: 640 });
await press("Confirm: full speed");
await until(page, (s) => s.confirmed);
await tell("move_to", 0.05);
await view(page, "scope");
await page.selectOption("#scope-time", "0.5");
await page.selectOption("#trigger-channel", "velocity");
await page.fill("#trigger-level", "5");
await page.selectOption("#trigger-before", "0.25");
await page.selectOption("#trigger-kind", "edge");
await page.click("#scope-arm");
await page.waitForTimeout(800);
await page.selectOption("#step-size", "0.05");
await page.click("#step-plus");
await page.waitForFunction(() => document.getElementById("scope-state").textContent.startsWith("Triggered at"));
await picture("scope", 900, 760);
await view(page, "method");
await picture("method", 900, 760);
console.log(JSON.stringify({ status: await status(page), problems: page.problems }));
await chromium.close();
