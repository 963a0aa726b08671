// How soon the page lives, and how often it is drawn with eight channels. Usage: speed.mjs LINK SECONDS

import { browser, live, status, view } from "./panel.mjs";

const [link, seconds] = process.argv.slice(2);
const chromium = await browser();
const page = await (await chromium.newContext({ viewport: { width: 1000, height: 900 } })).newPage();
await page.goto(new URL("/static/panel.css", link).href); // the browser itself is awake
const begin = Date.now();
await page.goto(link);
await page.waitForFunction(() => Number(document.getElementById("updates")?.value) > 0);
const first = (Date.now() - begin) / 1e3;
await live(page);
await view(page, "scope");
for (const name of ["effort", "state", "fault", "periods"]) await page.check(`input[name=channel][value=${name}]`);
await page.waitForTimeout(1000);
const counts = () => page.evaluate(() => ({ screens: Number(document.getElementById("updates").value), rows: window.panel.link.rows.first,
  channels: window.panel.link.rows.channels.length, at: performance.now() / 1e3 }));
const from = { ...(await counts()), loop: (await status(page)).loop };
await page.waitForTimeout(Number(seconds) * 1e3);
const to = { ...(await counts()), loop: (await status(page)).loop };
const time = to.at - from.at;
console.log(JSON.stringify({ first, screens: (to.screens - from.screens) / time, rows: (to.rows - from.rows) / time, channels: to.channels,
  skipped: to.loop.skipped - from.loop.skipped, periods: to.loop.periods - from.loop.periods }));
await chromium.close();
