// Holds a jog and lets it go, in one of ten ways. Reads lines: "hold WAY plus LINK", "release", "end"; answers in JSON.

import { createInterface } from "node:readline";
import { browser, enter, status, until, view } from "./panel.mjs";

const chromium = await browser();
let [way, page, cut, touch] = ["", null, false, null];

const say = (told) => console.log(JSON.stringify(told));

/** A page whose wire can be cut: what is sent then goes nowhere, either way, and nothing says so. */
async function open(link) {
  cut = false;
  const context = await chromium.newContext({ viewport: { width: 900, height: 800 }, hasTouch: true });
  await context.routeWebSocket(/\/ws$/, (socket) => {
    const server = socket.connectToServer();
    socket.onMessage((message) => { if (!cut) server.send(message); });
    server.onMessage((message) => { if (!cut) socket.send(message); });
  });
  page = await enter(context, link);
  await view(page, "jog");
  if (!(await status(page)).state.includes("operation enabled")) await page.keyboard.press("F2");
  await until(page, (s) => s.state === "operation enabled");
  if (!(await status(page)).confirmed) await page.getByRole("button", { name: "Confirm" }).click();
  await until(page, (s) => s.confirmed && s.rests);
}

async function hold(sign) {
  const box = await page.locator(`#jog-${sign}`).boundingBox();
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  if (way === "touch end") {
    touch = await page.context().newCDPSession(page);
    await touch.send("Input.dispatchTouchEvent", { type: "touchStart", touchPoints: [{ x, y }] });
  } else if (way === "key up") {
    await page.locator("#jog-pad").focus();
    await page.keyboard.down(sign === "plus" ? "ArrowRight" : "ArrowLeft");
  } else {
    await page.mouse.move(x, y);
    await page.mouse.down();
  }
  await page.waitForTimeout(600); // longer than its lease: it lives of keep-alives
  const { running, velocity } = await status(page);
  return running?.command === "jog" && Math.abs(velocity) > 0.09;
}

const release = {
  "mouse up": () => page.mouse.up(),
  "touch end": () => touch.send("Input.dispatchTouchEvent", { type: "touchEnd", touchPoints: [] }),
  "key up": () => page.keyboard.up("ArrowRight"), // of any key: all of them end it
  blur: () => page.evaluate(() => { dispatchEvent(new Event("blur")); }),
  "hidden tab": () => page.evaluate(() => {
    Object.defineProperty(document, "visibilityState", { get: () => "hidden", configurable: true });
    document.dispatchEvent(new Event("visibilitychange"));
  }),
  "page closed": () => page.close(),
  "context menu": () => page.mouse.click(450, 500, { button: "right" }),
  "network cut": () => { cut = true; },
  "server killed": () => {}, // whoever reads this kills it
  "a second of lag": () => page.evaluate(() => {
    const end = performance.now() + 1000;
    while (performance.now() < end);
  }),
};

for await (const line of createInterface({ input: process.stdin })) {
  const [word, ...rest] = line.split(";");
  if (word === "hold") {
    way = rest[0];
    await open(rest[2]);
    for (let left = 5; !(await hold(rest[1])); left -= 1) { // ended early on a busy machine: that is safe, and tried again
      if (!left) throw new Error(`${way}: the jog has ended while it was held, five times`);
      await release["mouse up"]();
      await page.keyboard.up("ArrowRight");
      await until(page, (s) => s.rests);
    }
    say({ holding: way });
  } else if (word === "release") {
    await release[way]();
    say({ released: way });
  } else if (word === "look") {
    const told = page.isClosed() ? "" : await page.locator("#last-stop").textContent();
    const pressed = page.isClosed() ? "" : await page.locator(".jog[aria-pressed=true]").count();
    await page.context().close();
    say({ told, pressed });
  } else break;
}
await chromium.close();
