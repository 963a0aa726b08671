// The position table: teach, go to, edit, undo, export; and a job that visits its places. Usage: positions.mjs LINK

import { readFile } from "node:fs/promises";
import { browser, enter, status, until, view } from "./panel.mjs";

const chromium = await browser();
const page = await enter(await chromium.newContext({ viewport: { width: 900, height: 800 } }), process.argv[2]);
const row = (name) => page.getByLabel(`Position of ${name}`);
const place = async (name) => Number(await row(name).inputValue());
const told = () => page.locator("#told").textContent();

/** Do something, and wait until the page has told how it ended. */
async function doing(what) {
  await page.evaluate(() => { document.getElementById("told").textContent = ""; });
  await what();
  await page.waitForFunction(() => /: (?!under way)/.test(document.getElementById("told").textContent));
  await page.waitForTimeout(200);
  return told();
}

await page.keyboard.press("F2");
await until(page, (s) => s.state === "operation enabled");
await page.getByRole("button", { name: "Confirm" }).click();
await until(page, (s) => s.confirmed);
await view(page, "positions");
const found = { begin: (await status(page)).position };
const teach = async (name) => {
  await page.fill("#teach-name", name);
  return doing(() => page.click("#teach"));
};
found.taught = await teach("left");
await page.evaluate(() => window.panel.link.command("move_by", 0.03).then(({ ended }) => ended));
await until(page, (s) => s.rests && s.running === null);
await teach("right");
found.right = await place("right");
await page.getByLabel("Go to left").click();
await until(page, (s) => s.rests && s.running === null && Math.abs(s.position - found.begin) < 1e-4);
const edit = async (text) => doing(async () => {
  await row("right").fill(text);
  await row("right").press("Enter");
  await row("right").blur();
});
found.edited = [await edit("35 mm"), await place("right")];
found.inches = [await edit("2 in"), await place("right")];
found.wrong = [await edit("2 parsec"), await told()];
await doing(() => page.click("#undo"));
found.undone = await place("right");
const [download] = await Promise.all([page.waitForEvent("download"), page.getByText("Export as CSV").click()]);
found.file = await readFile(await download.path(), "utf8");
await view(page, "job");
await page.waitForFunction(() => document.getElementById("job-places").value.includes("right"));
await page.fill("#job-rounds", "2");
await page.fill("#job-rest", "50");
await page.click("#job-run");
await page.waitForFunction(() => document.getElementById("job-result").textContent.startsWith("Job "));
found.job = await page.locator("#job-result").textContent();
found.jobAt = (await status(page)).position;
await page.fill("#job-places", "left\n9 m");
await page.click("#job-run");
await page.waitForFunction(() => /^Job (failed|refused)/.test(document.getElementById("job-result").textContent));
found.badJob = await page.locator("#job-result").textContent();
console.log(JSON.stringify({ ...found, problems: page.problems }));
await chromium.close();
