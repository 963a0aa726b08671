// Counted and filtered speed: what the counter saw in each sample, and what the filter makes of it.

import { Rows } from "/static/capture.js";
import { h, pair, say } from "/static/dom.js";
import { Plot } from "/static/plot.js";

const C = "controller.";
const NAMES = [`${C}filter.input`, `${C}filter.output`];
const SHOWN = [[`${C}speed.word`, "Pulses in the last sample"], [`${C}deviation.deviation`, "Deviation (pulses)"], [`${C}deviation.error`, "Error E"],
  [`${C}generator.command`, "Command (pulses)"], [`${C}deviation.position`, "Position (pulses)"]];
const SECONDS = 2;

export function open(root, { link }) {
  const { period } = link.about;
  const names = [...NAMES, ...SHOWN.map(([name]) => name)];
  const plot = new Plot(h("div", { class: "plot", role: "img", "aria-label": "Counted and filtered speed over the last two seconds" }));
  const rows = new Rows(names);
  const many = Math.round(SECONDS / period);
  const columns = [Float64Array.from({ length: many }, (_, k) => (k - many + 1) * period), new Float64Array(many), new Float64Array(many)];
  const pairs = SHOWN.map(([, text]) => pair(text));
  const said = h("p", { role: "status" });
  let frame = 0;
  plot.show([{ name: "counted, scaled", unit: "count" }, { name: "filtered", unit: "count" }]);
  root.append(h("h1", {}, "Counted and filtered speed"),
    h("p", { class: "hint" }, "The speed is the number of pulses in a sample: ", h("span", { class: "swatch c0", "aria-hidden": true }), "as counted, in steps; ", h("span", { class: "swatch c1", "aria-hidden": true }), "behind the filter, smooth and a little late."),
    plot.root,
    h("dl", { class: "cards" }, pairs.map(({ row }) => row)), said);
  const draw = () => {
    frame = 0;
    const have = Math.min(many, rows.next - rows.first);
    if (have < 2) return;
    const newest = columns.map((one) => one.subarray(many - have)); // at first there are not two seconds of it
    NAMES.forEach((_name, k) => rows.copy(k, rows.next - have, newest[k + 1]));
    plot.draw(newest, null, have - 1);
    pairs.forEach(({ value }, k) => say(value, String(Number(rows.at(k + 2, rows.next - 1).toPrecision(6)))));
  };
  const onRows = () => {
    rows.take(link.rows.first, link.rows.count, link.rows.columns);
    frame ||= requestAnimationFrame(draw);
  };
  link.addEventListener("rows", onRows);
  link.watch(names).catch((error) => say(said, error.message));
  return {
    close() {
      link.removeEventListener("rows", onRows);
      link.watch([]).catch(() => {});
      cancelAnimationFrame(frame);
      plot.close();
    },
  };
}
