// The first ten minutes at the panel, as docs/how-to/first-ten-minutes-at-the-panel.md tells them, with its pictures.
// Usage: tour.mjs LINK FOLDER; prints what it has seen on the way.

import { browser, enter, status, until, view } from "./panel.mjs";

const [link, folder] = process.argv.slice(2);
const PHONE = [360, 740];
const chromium = await browser();
const context = await chromium.newContext({ viewport: { width: 900, height: 640 }, hasTouch: true });
const page = await enter(context, link);
const seen = {};
const size = ([width, height]) => page.setViewportSize({ width, height });
const picture = async (name, wanted = [900, 640], top = "body") => {
  await size(wanted);
  await page.evaluate((to) => scrollTo(0, to === "body" ? 0 : document.querySelector(to).getBoundingClientRect().top + scrollY - 190), top);
  await page.waitForTimeout(400);
  await page.screenshot({ path: `${folder}/panel-${name}.png` });
};
const press = (name) => page.getByRole("button", { name, exact: true }).first().click();
const rests = () => until(page, (s) => s.rests && s.in_window && s.running === null);
const told = () => page.locator("#told").textContent();
const move = async (to) => {
  await page.fill("#move-target", to);
  await press("Move to");
  await until(page, (s) => Math.abs(s.commanded - Number.parseFloat(to) / 1e3) < 1e-6);
  await rests();
};

// 1 and 2: look, enable, hold to move, on a telephone
await picture("begin");
await press("Enable");
await until(page, (s) => s.state === "operation enabled");
await view(page, "jog");
await size(PHONE);
const box = await page.locator("#jog-plus").boundingBox();
await page.mouse.move(box.x + 30, box.y + 30);
await page.mouse.down();
await until(page, (s) => s.velocity > 0.01);
await picture("jog", PHONE);
await page.mouse.up();
await rests();
seen.stopped = await page.locator("#last-stop").textContent();
await press("Confirm: full speed");
await until(page, (s) => s.confirmed);

// 3: a move on the scope
await size([900, 640]);
await page.fill("#jog-speed", "100");
await move("50 mm");
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
await picture("scope", [900, 760]);
await rests();

// 4: two places, and a job that visits them
for (const [name, to] of [["left", "60 mm"], ["right", "260 mm"]]) {
  await view(page, "jog");
  await page.fill("#jog-speed", "100");
  await move(to);
  await view(page, "positions");
  await page.fill("#teach-name", name);
  await press("Teach here");
  await page.waitForFunction((one) => [...document.querySelectorAll("tbody th")].some((cell) => cell.textContent === one), name);
}
await picture("positions");
await view(page, "job");
await page.waitForFunction(() => document.getElementById("job-places").value.includes("right"));
await press("Run job");
await until(page, (s) => s.job?.done >= 2 && !s.rests);
await picture("job", [900, 760]);

// 5: its own view, while the job goes on
await view(page, "method");
await until(page, (s) => Math.abs(s.velocity) > 0.1);
await picture("method", [900, 640]);
await view(page, "job");
await page.waitForFunction(() => document.getElementById("job-result").textContent.startsWith("Job") || !window.panel.link.now.status.running, null, { timeout: 60000 });
seen.job = (await status(page)).commanded;

// 6: the plug is pulled; one sentence, and the way back
await view(page, "faults");
await page.selectOption("#inject-what", "encoder stuck");
await press("Inject");
await page.waitForFunction(() => document.getElementById("told").textContent.startsWith("inject: done"));
await view(page, "jog");
await page.fill("#move-target", "100 mm");
await press("Move to");
await until(page, (s) => s.fault !== null && s.state === "fault");
await view(page, "faults");
await page.locator(".fault").first().waitFor();
seen.fault = await page.locator(".fault").first().innerText();
await picture("fault", PHONE, "#view");
await size([900, 640]);
await press("Mend it");
await press("Reset");
await until(page, (s) => s.fault === null);
seen.reset = (await status(page)).state;
await page.keyboard.press("F2");
await until(page, (s) => s.state === "operation enabled");
seen.trust = (await status(page)).trust;
await view(page, "home");
await page.click("#home");
await until(page, (s) => s.trust === "referenced" && s.running === null, 60000);
await press("Confirm: full speed");
await until(page, (s) => s.confirmed);
await view(page, "positions");
await page.getByRole("button", { name: "Go to left" }).click();
await until(page, (s) => Math.abs(s.commanded - 0.06) < 1e-6);
await rests();
await view(page, "status");
await picture("again", PHONE);
seen.position = (await status(page)).position;
console.log(JSON.stringify({ ...seen, told: await told(), problems: [...page.problems, ...page.strangers] }));
await chromium.close();
