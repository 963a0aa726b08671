// Job: places one after the other, or a text to print. The axis does it by itself for as long as this page is there: it
// keeps the job, and a page that is closed, or silent for 2 s, ends it.

import { field, h, mark, say } from "../dom.js";
import { typed } from "../units.js";

export function open(root, { link, tell }) {
  const { unit, commands, numbers, prints } = link.about;
  const places = h("textarea", { id: "job-places", rows: 5, spellcheck: false });
  const rounds = h("input", { type: "number", min: 1, max: 10000, value: 3, id: "job-rounds" });
  const rest = h("input", { type: "number", min: 0, max: 60000, step: 100, value: 500, id: "job-rest" });
  const speed = h("input", { type: "number", min: 1, max: 100, value: 50, id: "job-speed" });
  const progress = h("progress", { max: 1, value: 0, "aria-label": "Progress of the job" });
  const result = h("p", { id: "job-result", role: "status" }, "No job runs.");
  const run = h("button", { id: "job-run" }, prints ? "Print" : "Run job");
  const hold = h("button", { id: "job-pause", class: "plain", disabled: true }, "Pause");
  const what = prints ? "line" : "move";
  let now = null; // the job that is under way, as the axis tells it
  let over = false; // its end has been told: a status from before it says nothing new

  async function names() {
    if (!commands.includes("teach")) return [];
    return (await link.request({ do: "positions" })).positions.map((one) => one.name);
  }

  async function job() {
    if (prints) return { text: places.value };
    const named = [...await names(), ...numbers.map(String)]; // other lines are places, a bare number in the unit shown
    const lines = places.value.split("\n").map((one) => one.trim()).filter(Boolean);
    const moves = lines.map((line) => (named.includes(line) ? line : typed(line, unit)));
    return { moves, rounds: Number(rounds.value), rest: Number(rest.value) / 1000 };
  }

  run.addEventListener("click", async () => {
    if (!places.value.trim()) return tell(prints ? "There is nothing to print: write a text." : "The job has no line: write a place on each.", "warn");
    run.disabled = true;
    over = false;
    try {
      const { ended } = await link.command("job", await job(), prints ? undefined : Number(speed.value) / 100);
      const how = await ended;
      over = true;
      const why = [how.reason, how.remedy].filter(Boolean).join("; ");
      say(result, how.how === "done" ? `Job done: all of its ${what}s.` : `Job ${how.how}: ${why}.`);
      if (how.how === "done") progress.value = 1;
    } catch (error) {
      say(result, `Job refused: ${error.message}.`);
    }
    run.disabled = Boolean(now);
  });
  hold.addEventListener("click", () => link.command(now?.paused ? "resume" : "pause").catch((error) => tell(error.message, "bad")));
  if (!prints) names().then((named) => { places.value ||= [...named, ...numbers].join("\n"); }).catch(() => {});
  const known = numbers.length ? "a number of the axis file" : "a taught position";
  root.append(h("h1", {}, "Job"), h("div", {},
    field(prints ? "Text to print" : `Places, one a line: ${known}, or a value such as ${unit === "rad" ? "90 deg" : "20 mm"}`, places),
    !prints && h("div", { class: "fields" }, field("Rounds", rounds), field("Rest after each move (ms)", rest), field("Speed (% of the largest)", speed)),
    h("p", { class: "line" }, run, hold), progress, result,
    h("p", { class: "hint" }, "STOP ends the job; Pause holds it where it is. It goes on while you look at another view, and ends when this page is closed.")));
  return {
    status(status) {
      now = status.job;
      [run.disabled, hold.disabled] = [Boolean(now), !now];
      say(hold, now?.paused ? "Resume" : "Pause");
      mark(hold, "plain", !now?.paused);
      if (!now) over = false;
      if (!now || over) return;
      progress.value = now.of ? now.done / now.of : 0;
      say(result, `${now.name}: ${now.done} of ${now.of} ${what}s done${now.paused ? ", held by a pause" : ""}.`);
    },
  };
}
