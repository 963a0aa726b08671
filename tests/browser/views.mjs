// Every view: no error, no request to another host, nothing serious for axe-core, the keyboard reaches everything, and
// STOP is there without scrolling on a phone, by hand and by Esc. Usage: views.mjs LINK

import { readFile } from "node:fs/promises";
import { browser, enter, status, until, view, VIEWS } from "./panel.mjs";

const AXE = await readFile(new URL("node_modules/axe-core/axe.min.js", import.meta.url), "utf8");
const [link] = process.argv.slice(2);
const chromium = await browser();
const page = await enter(await chromium.newContext({ viewport: { width: 360, height: 640 }, hasTouch: true }), link);
await page.evaluate(AXE); // by the protocol: the page's own rules let no script in

/** What could be reached, and what the tabulator has reached. */
async function unreached() {
  await page.evaluate(() => {
    const all = [...document.querySelectorAll("a[href], button, input, select, textarea, summary, [tabindex='0']")];
    document.wanted = new Set(all.filter((one) => !one.disabled && one.checkVisibility() && !one.closest("dialog:not([open])")));
    document.body.tabIndex = -1;
    document.body.focus();
  });
  for (let k = 0; k < 160; k += 1) {
    await page.keyboard.press("Tab");
    const left = await page.evaluate(() => {
      document.wanted.delete(document.activeElement);
      return document.wanted.size;
    });
    if (!left) return [];
  }
  return page.evaluate(() => [...document.wanted].filter((one) => one.isConnected).map((one) => one.outerHTML.slice(0, 120)));
}

/** Where STOP is on the screen, and what lies there for a finger. */
const stopAt = () => page.evaluate(() => {
  scrollTo(0, 0);
  const box = document.querySelector("button.stop").getBoundingClientRect();
  const hit = document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2);
  return { top: box.top, bottom: box.bottom, height: box.height, isOnTop: Boolean(hit?.closest("button.stop")), screen: innerHeight,
    wide: document.documentElement.scrollWidth };
});

const found = {};
for (const name of VIEWS) {
  await view(page, name);
  await page.waitForTimeout(300);
  const { violations } = await page.evaluate(() => window.axe.run(document, { resultTypes: ["violations"] }));
  const stop = await stopAt();
  const { epoch } = await status(page);
  await page.keyboard.press("Escape");
  await until(page, (s) => s.epoch > epoch);
  found[name] = {
    serious: violations.filter(({ impact }) => ["serious", "critical"].includes(impact)).map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html.slice(0, 160)).join(" | ")}`),
    unreached: await unreached(), stop, escape: true,
  };
}

// a record of a fault as the axis tells it, and faults to practise with
await page.evaluate(() => {
  const { link } = window.panel;
  const request = link.request.bind(link);
  const record = { number: 1, code: "F02", text: "the encoder stands still while the drive pushes", value: 0.0012, limit: 0.001, unit: "m",
    position: "lost", causes: ["the encoder's cable", "a load that is blocked"], steps: ["look at the cable", "reset", "home"], allowed: ["reset", "home"] };
  link.about.injections = { encoder: ["stuck", "off"] };
  link.about.questions = [...link.about.questions, "faults"];
  link.request = (message) => (message.do === "faults" ? Promise.resolve({ faults: [record] }) : request(message));
  link.command = (word, value) => { window.asked = [word, value]; return Promise.reject(new Error("only looked at")); };
});
await view(page, "status");
await view(page, "faults");
await page.locator(".fault").waitFor();
const fault = { text: await page.locator(".fault").innerText(), offered: await page.locator("#inject-what option").allInnerTexts() };
await page.fill("#inject-amount", "1 mm");
await page.click("#inject");
fault.asked = await page.evaluate(() => window.asked);
console.log(JSON.stringify({ fault, views: found, problems: page.problems, strangers: page.strangers }));
await chromium.close();
