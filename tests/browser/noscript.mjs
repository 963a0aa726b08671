// STOP without JavaScript: a form post. Usage: noscript.mjs LINK; prints what the page shows before and after.

import { browser } from "./panel.mjs";

const chromium = await browser();
const context = await chromium.newContext({ javaScriptEnabled: false, viewport: { width: 360, height: 640 } });
const page = await context.newPage();
await page.goto(process.argv[2]);
const box = await page.locator("button.stop").boundingBox();
const before = await page.locator("#state").textContent();
await page.locator("button.stop").click();
await page.waitForLoadState();
console.log(JSON.stringify({ before, after: await page.locator("#state").textContent(), band: await page.locator(".band").first().textContent(),
  stop: { top: box.y, bottom: box.y + box.height, height: box.height }, at: new URL(page.url()).pathname }));
await chromium.close();
