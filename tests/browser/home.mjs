// The view Home: a homing that is stopped, one that is let end, and what the page says of each. Usage: home.mjs LINK

import { browser, enter, status, until, view } from "./panel.mjs";

const chromium = await browser();
const page = await enter(await chromium.newContext({ viewport: { width: 360, height: 740 } }), process.argv[2]);
const result = () => page.locator("#home-result").textContent();

await page.keyboard.press("F2");
await until(page, (s) => s.state === "operation enabled");
await page.getByRole("button", { name: "Confirm" }).click();
await until(page, (s) => s.confirmed);
await view(page, "home");
const found = {};
await page.click("#home");
await until(page, (s) => s.trust === "unknown" && !s.rests);
await page.keyboard.press("Escape");
await page.waitForFunction(() => document.getElementById("home-result").textContent.startsWith("Not homed"));
const stopped = await until(page, (s) => s.rests && s.running === null);
found.stopped = [stopped.trust, (await result()).split(":")[0]];
await page.click("#home");
await until(page, (s) => s.trust === "unknown" && !s.rests);
await page.waitForSelector(".steps [aria-current=step]");
found["under way"] = await page.locator(".steps [aria-current=step]").textContent();
if (process.env.PICTURE) await page.screenshot({ path: process.env.PICTURE });
await page.waitForFunction(() => document.getElementById("home-result").textContent.startsWith("Homed"), null, { timeout: 60000 });
const now = await status(page);
Object.assign(found, { told: await result(), trust: now.trust, position: now.position });
found.widest = await page.evaluate(() => document.documentElement.scrollWidth);
found.problems = [...page.problems, ...page.strangers];
console.log(JSON.stringify(found));
await chromium.close();
