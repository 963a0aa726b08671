// A report on a telephone that is on no network. Usage: report.mjs FILE; prints what of it is drawn, and what it asked for.

import { pathToFileURL } from "node:url";
import { browser } from "./panel.mjs";

const chromium = await browser();
const context = await chromium.newContext({ offline: true, viewport: { width: 360, height: 640 } });
const page = await context.newPage();
const problems = [], asked = [];
page.on("console", (message) => { if (message.type() === "error") problems.push(message.text()); });
page.on("pageerror", (error) => problems.push(String(error)));
page.on("request", (request) => { if (!/^(data|blob):/.test(request.url())) asked.push(new URL(request.url()).protocol); });
await page.goto(pathToFileURL(process.argv[2]).href);
// Charts are drawn as they come into sight.
const places = await page.locator(".chart").all();
for (const place of places) {
  await place.scrollIntoViewIfNeeded();
  await page.waitForFunction((chart) => chart.querySelector("canvas, svg") !== null, await place.elementHandle(), { timeout: 30000 });
}
console.log(JSON.stringify({ problems, asked, charts: places.length, heading: await page.locator("h1").first().textContent(),
  wide: await page.evaluate(() => document.documentElement.scrollWidth) }));
await chromium.close();
