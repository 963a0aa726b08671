// Job: places one after the other, again and again. The page asks for each move when the one before it has ended; when
// the page goes, the axis finishes nothing: what was under way is stopped.

import { field, h, say } from "../dom.js";
import { typed } from "../units.js";

const pause = (ms) => new Promise((done) => setTimeout(done, ms));

export function open(root, { link, tell }) {
  const { unit, commands } = link.about;
  const places = h("textarea", { id: "job-places", rows: 5, spellcheck: false });
  const rounds = h("input", { type: "number", min: 1, max: 10000, value: 3, id: "job-rounds" });
  const rest = h("input", { type: "number", min: 0, max: 60000, step: 100, value: 500, id: "job-rest" });
  const speed = h("input", { type: "number", min: 1, max: 100, value: 50, id: "job-speed" });
  const progress = h("progress", { max: 1, value: 0, "aria-label": "Progress of the job" });
  const result = h("p", { id: "job-result", role: "status" }, "No job runs.");
  const run = h("button", { id: "job-run" }, "Run job");
  const hold = h("button", { id: "job-pause", class: "plain", disabled: true }, "Pause after this move");
  let job = null;

  const lines = () => places.value.split("\n").map((one) => one.trim()).filter(Boolean);

  /** A line is a name or number of the position table, or a place such as "20 mm". */
  const request = (line, named) => (named.includes(line) ? ["go_to", line] : ["move_to", typed(line, unit)]);

  async function names() {
    if (!link.about.commands.includes("teach")) return [];
    return (await link.request({ do: "positions" })).positions.map((one) => one.name);
  }

  async function perform(mine) {
    const named = await names();
    const todo = Array.from({ length: Number(rounds.value) }, () => lines()).flat();
    for (const [k, line] of todo.entries()) {
      while (mine.paused && job === mine) await pause(50);
      if (job !== mine) return "ended by the page";
      say(result, `Move ${k + 1} of ${todo.length}: ${line}`);
      const { ended } = await link.command(...request(line, named), Number(speed.value) / 100);
      const how = await ended;
      if (how.how !== "done") return `ended in move ${k + 1} (${line}), ${how.how}: ${how.reason}${how.remedy ? `; ${how.remedy}` : ""}`;
      progress.value = (k + 1) / todo.length;
      await pause(Number(rest.value));
    }
    return `done: ${todo.length} moves, every one inside its window`;
  }

  run.addEventListener("click", async () => {
    if (job || !lines().length) return tell(job ? "A job runs already." : "The job has no line: write a place on each.", "warn");
    const mine = job = { paused: false };
    [run.disabled, hold.disabled, progress.value] = [true, false, 0];
    say(result, `Job ${await perform(mine).catch((error) => `refused: ${error.message}`)}.`);
    job = null;
    [run.disabled, hold.disabled] = [false, true];
    say(hold, "Pause after this move");
  });
  hold.addEventListener("click", () => {
    job.paused = !job.paused;
    say(hold, job.paused ? "Resume" : "Pause after this move");
  });
  names().then((named) => { places.value ||= named.join("\n"); }).catch(() => {});
  root.append(h("h1", {}, "Job"),
    commands.includes("move_to") || commands.includes("go_to") ? h("div", {},
      field("Places, one a line: a taught position, or a value such as 20 mm", places),
      h("div", { class: "fields" }, field("Rounds", rounds), field("Rest between two moves (ms)", rest), field("Speed (% of the largest)", speed)),
      h("p", { class: "line" }, run, hold), progress, result,
      h("p", { class: "hint" }, "STOP ends the job. So does leaving this view, for the moves are asked for by this page."))
      : h("p", {}, "This axis takes no moves; its jobs are files: detent run FILE --job JOB."));
  return { close() { if (job) link.stop(); job = null; } };
}
