// Two browsers at one axis: who commands is seen by both, either stops, and taking over stops a jog first.
// Usage: two.mjs LINK-OF-AN-OPERATOR LINK-OF-AN-OPERATOR LINK-OF-A-VIEWER PICTURE

import { browser, enter, status, until, view } from "./panel.mjs";

const chromium = await browser();
const open = async (link) => enter(await chromium.newContext({ viewport: { width: 900, height: 800 } }), link);
const [one, other, viewer] = [await open(process.argv[2]), await open(process.argv[3]), await open(process.argv[4])];
const who = (page) => page.locator("#who").textContent();
/** What has been heard is drawn with the next picture of the page. */
const drawn = (page, mine) => page.waitForFunction((own) => document.getElementById("who").textContent.startsWith("you") === own, mine);

await one.keyboard.press("F2");
await until(one, (s) => s.state === "operation enabled");
await view(one, "jog");
const hold = async () => {
  const box = await one.locator("#jog-plus").boundingBox();
  await one.mouse.move(box.x + 20, box.y + 20);
  await one.mouse.down();
  await until(one, (s) => s.running?.command === "jog" && s.velocity > 0.005);
};
await hold();
await drawn(one, true);
await other.waitForFunction(() => document.getElementById("who").textContent.includes("engineer"));
const found = { mine: await who(one), theirs: await who(other) };
found.refused = await other.evaluate(() => window.panel.link.command("move_by", 0.001).then(({ ended }) => ended));
found.viewerMoves = await viewer.evaluate(() => window.panel.link.command("move_by", 0.001).then(() => "taken", (error) => error.message));
const { epoch } = await status(viewer);
await viewer.locator("button.stop").click();
await until(viewer, (s) => s.epoch > epoch && s.rests);
await until(one, (s) => s.epoch > epoch && !s.running); // the stop itself is done after its time in the window
found.stoppedByViewer = (await status(one)).running;
await one.mouse.up();
await hold();
await other.evaluate(() => window.panel.link.command("take").then(({ ended }) => ended));
await until(other, (s) => s.rests && s.running === null);
await drawn(other, true);
await drawn(one, false);
found.afterTaking = { mine: await who(one), theirs: await who(other), pressed: await one.locator(".jog[aria-pressed=true]").count() };
await one.mouse.up();
for (const page of [other, viewer]) await view(page, "status");
found.viewerTurns = await viewer.locator("#selector").isEnabled();
found.turned = {};
for (const place of ["local", "remote", "both"]) {
  await other.selectOption("#selector", place);
  await until(one, (s) => s.selector === place);
  await viewer.waitForFunction((to) => document.getElementById("selector").value === to, place);
  const moves = await other.evaluate(() => window.panel.link.command("move_by", 0.0).then(({ ended }) => ended));
  if (place === "remote") await other.screenshot({ path: process.argv[5] });
  found.turned[place] = { code: moves.code, who: await who(viewer), why: await other.locator("#why").textContent() };
}
console.log(JSON.stringify({ ...found, problems: [one, other, viewer].flatMap((page) => page.problems) }));
await chromium.close();
