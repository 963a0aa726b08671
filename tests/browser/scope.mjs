// The scope: an edge of the velocity with half of the record before it; the file that it saves. Usage: scope.mjs LINK [PICTURE]

import { readFile } from "node:fs/promises";
import { browser, enter, until, view } from "./panel.mjs";

const chromium = await browser();
const page = await enter(await chromium.newContext({ viewport: { width: 1000, height: 900 } }), process.argv[2]);
await page.keyboard.press("F2");
await until(page, (s) => s.state === "operation enabled");
await view(page, "scope");
await page.selectOption("#scope-time", "0.2");
await page.selectOption("#trigger-channel", "velocity");
await page.fill("#trigger-level", "5");
await page.selectOption("#trigger-before", "0.5");
await page.selectOption("#trigger-kind", "edge");
await page.click("#scope-arm");
await page.waitForFunction(() => document.getElementById("scope-state").textContent.startsWith("Armed"));
await page.waitForTimeout(400); // the past that the record begins with
await page.evaluate(() => window.panel.link.command("move_by", 0.004));
await page.waitForFunction(() => document.getElementById("scope-state").textContent.startsWith("Triggered at"));
const [download] = await Promise.all([page.waitForEvent("download"), page.click("#scope-csv")]);
const [head, ...lines] = (await readFile(await download.path(), "utf8")).trim().split("\n");
const channels = head.split(",").slice(2).map((one) => one.replace(/ \(.*/, ""));
const rows = lines.map((one) => one.split(",").map(Number));
const ring = await page.evaluate(async ([names, first]) => (await fetch(`/api/scope.csv?channels=${names}&first=${first}`)).text(), [channels.join(), rows[0][0]]);
const cursors = await page.locator("#between").textContent();
// the velocity over the position: one cursor is put where the move ended, by a click on the curve there
await page.selectOption("#scope-view", "xy");
await page.selectOption("#scope-x", "position");
await page.selectOption("#scope-y", "velocity");
const corner = await page.locator("#plot .u-over").boundingBox();
await page.mouse.click(corner.x + 0.97 * corner.width, corner.y + 0.94 * corner.height);
const xy = await page.evaluate(() => ({ label: [...document.querySelectorAll("#scope-x option")].map((one) => one.value),
  cursors: ["A", "B"].map((name) => Number(document.getElementById(`cursor-${name}`).value)), drawn: document.querySelectorAll("#plot canvas").length }));
if (process.argv[3]) for (const width of [1280, 360]) {
  await page.setViewportSize({ width, height: 900 });
  await page.waitForTimeout(300);
  await page.evaluate(() => document.getElementById("plot").scrollIntoView({ block: "center" }));
  await page.screenshot({ path: `${process.argv[3]}-${width}.png` });
}
console.log(JSON.stringify({ channels, rows, ring: ring.trim().split("\n").slice(1, rows.length + 1).map((one) => one.split(",").map(Number)), cursors, xy, problems: page.problems }));
await chromium.close();
