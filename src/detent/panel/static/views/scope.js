// Scope: up to eight channels at the rate of the loop, with a trigger that sees what came before it.

import { Capture, Rows } from "../capture.js";
import { fill, h, mark, save, say } from "../dom.js";
import { Plot } from "../plot.js";
import { quantity, shown, typed } from "../units.js";
import { cursors } from "./cursors.js";
import { steps } from "./steps.js";
import { controls, parse } from "./scope_controls.js";

const FIRST = ["position", "commanded", "velocity", "error"]; // what is shown to whoever opens it first
const kept = { channels: null }; // between two visits of the view

export function open(root, { link, act, tell }) {
  const all = link.about.channels;
  const { period } = link.about;
  kept.channels ??= FIRST.filter((one) => all.some(({ name }) => name === one));
  const said = h("p", { id: "scope-state", role: "status" });
  const ui = controls(all, kept.channels);
  const plot = new Plot(h("div", { class: "plot", id: "plot", tabindex: 0, role: "img", "aria-label": "Scope; its values are in the table below" }));
  const reading = cursors(plot);
  const step = link.about.commands.includes("move_by") ? steps({ link, act }, () => 1) : null;
  let channels = [];
  let rows = null;
  let capture = null; // that is awaited
  let record = null; // that is shown: {first, trigger, length, columns}
  let reference = null;
  let isRunning = true;
  let frame = 0;

  const about = (name) => all.find((one) => one.name === name);

  /** Begin with these channels; a trigger brings its own along. */
  async function watch() {
    const trigger = ui.trigger();
    const wanted = [...new Set([...kept.channels, ...(trigger.name ? [trigger.name] : [])])].slice(-8);
    channels = wanted;
    rows = new Rows(wanted);
    [record, reference] = [null, null];
    lay();
    try {
      await link.watch(wanted);
      arm();
    } catch (error) {
      say(said, error.message);
    }
  }

  /** Over time, or one channel over another. */
  function lay() {
    plot.show(channels.map((name) => ({ name, unit: shown(about(name).unit).name })), ui.axes(channels));
    show();
  }

  function arm() {
    const trigger = ui.trigger();
    isRunning = true;
    capture = null;
    if (trigger.kind === "none") return say(said, "Running.");
    const channel = channels.indexOf(trigger.name);
    const unit = about(trigger.name).unit;
    const level = trigger.kind === "fault" ? 0 : parse(typed(trigger.level, unit), shown(unit));
    if (!Number.isFinite(level)) return say(said, `Level: got ${trigger.level || "nothing"}; expected: a number in ${shown(unit).name}`);
    capture = new Capture(rows, { ...trigger, channel, level }, length(), ui.before());
    return say(said, `Armed: waiting for ${trigger.kind === "fault" ? "a fault" : `${trigger.name} ${trigger.rising ? "above" : "below"} ${quantity(level, unit)}`}.`);
  }

  const length = () => Math.max(16, Math.round(ui.seconds() / period));

  function take(first, trigger, many) {
    if (!record || record.length !== many) {
      record = { length: many, columns: [new Float64Array(many), ...channels.map(() => new Float64Array(many))] };
      for (let k = 0; k < many; k += 1) record.columns[0][k] = (k - trigger) * period;
    }
    if (record.trigger !== trigger) for (let k = 0; k < many; k += 1) record.columns[0][k] = (k - trigger) * period;
    [record.first, record.trigger] = [first, trigger];
    channels.forEach((name, k) => rows.copy(k, first, record.columns[k + 1], shown(about(name).unit).factor));
  }

  function draw() {
    frame = 0;
    if (!isRunning || !rows) return;
    const many = length();
    if (capture) {
      if (!capture.look()) {
        if (capture.row < 0) return;
        return say(said, "Triggered; the record fills.");
      }
      take(capture.first, capture.before, capture.length);
      say(said, `Triggered at row ${capture.row}.`);
      if (ui.isSingle()) isRunning = false;
      else arm();
    } else {
      const have = Math.min(many, rows.next - rows.first);
      if (have < 2) return;
      take(rows.next - have, have - 1, have);
    }
    show();
  }

  function show() {
    if (!record) return;
    plot.draw(record.columns, reference, record.trigger);
    reading.show(channels, record);
    mark(root, "frozen", !isRunning);
    say(ui.run, isRunning ? "Freeze" : "Run");
  }

  function csv() {
    if (!record) return tell("The scope holds no rows yet.", "warn");
    const head = ["row", "time (s)", ...channels.map((name) => `${name} (${about(name).unit})`)].join(",");
    const lines = Array.from({ length: record.length }, (_, k) => [record.first + k, ((k - record.trigger) * period).toFixed(9),
      ...channels.map((_name, c) => rows.at(c, record.first + k))].join(","));
    return save(`${link.about.name}-scope.csv`, `${[head, ...lines].join("\n")}\n`);
  }

  function single() {
    ui.single.checked = true;
    arm();
  }

  ui.run.addEventListener("click", () => {
    if (isRunning) isRunning = false;
    else arm();
    show();
  });
  ui.arm.addEventListener("click", single);
  ui.root.addEventListener("change", (event) => {
    if (event.target.type === "search") return;
    if (ui.isView(event.target)) {
      lay(); // of the record that is there
      return;
    }
    if (event.target.name === "channel") kept.channels = ui.chosen();
    watch();
  });
  ui.overlay.addEventListener("click", () => {
    reference = reference || !record ? null : record.columns.slice(1).map((one) => one.slice());
    say(ui.overlay, reference ? "Drop the overlay" : "Keep as overlay");
    show();
  });
  ui.csv.addEventListener("click", csv);
  const onRows = () => {
    const { first, count, columns, channels: of } = link.rows;
    if (of.join() !== channels.join()) return;
    if (isRunning) rows.take(first, count, columns);
    frame ||= requestAnimationFrame(draw);
  };
  link.addEventListener("rows", onRows);
  root.append(h("h1", {}, "Scope"), said, plot.root, ui.buttons, step?.root ?? "", reading.root, ui.root);
  watch();
  return {
    get record() { return record; },
    get rows() { return rows; },
    status(s) { step?.status(s); },
    key(event) {
      if (event.key === "s" || event.key === "S") single();
      else step?.key(event);
    },
    close() {
      link.removeEventListener("rows", onRows);
      link.watch([]).catch(() => {});
      cancelAnimationFrame(frame);
      plot.close();
      fill(root);
    },
  };
}
