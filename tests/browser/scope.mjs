// The scope: an edge of the velocity with half of the record before it; the file that it saves. Usage: scope.mjs LINK

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
console.log(JSON.stringify({ channels, rows, ring: ring.trim().split("\n").slice(1, rows.length + 1).map((one) => one.split(",").map(Number)), cursors, problems: page.problems }));
await chromium.close();
