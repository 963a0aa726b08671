// A real browser for the panel's tests: Debian's chromium, driven without downloading another one.

import { chromium } from "playwright-core";

export const VIEWS = ["status", "jog", "positions", "home", "job", "scope", "method", "faults", "loop", "file", "log"];

const ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"];

/** Start the browser. */
export function browser() {
  return chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ARGUMENTS });
}

/** A page at the panel, entered by its one-time link; errors and requests to other hosts are taken down. */
export async function enter(context, link) {
  const page = await context.newPage();
  page.problems = [];
  page.strangers = [];
  page.on("console", (message) => { if (message.type() === "error") page.problems.push(message.text()); });
  page.on("pageerror", (error) => page.problems.push(String(error)));
  const host = new URL(link).host;
  page.on("request", (request) => {
    const { protocol, host: to } = new URL(request.url());
    if (!["data:", "blob:"].includes(protocol) && to !== host) page.strangers.push(request.url());
  });
  await page.goto(link);
  await live(page);
  return page;
}

/** Wait until the page shows values that come from the axis. */
export const live = (page) => page.waitForFunction(() => Number(document.getElementById("updates")?.value) > 2, null, { timeout: 30000 });

/** Open a view and wait until it stands. */
export async function view(page, name) {
  await page.evaluate((to) => { location.hash = to; }, name);
  await page.waitForFunction((to) => document.body.dataset.view === to, name);
}

/** The axis now, as the page has heard it. */
export const status = (page) => page.evaluate(() => window.panel.link.now.status);

/** Wait until the status meets something. */
export async function until(page, test, timeout = 15000) {
  const end = Date.now() + timeout;
  for (;;) {
    const now = await status(page);
    if (test(now)) return now;
    if (Date.now() > end) throw new Error(`not met within ${timeout} ms: ${test}; status ${JSON.stringify(now)}`);
    await page.waitForTimeout(10);
  }
}
