// Two cursors: what stands at each, and what lies between.

import { field, fill, h, say } from "../dom.js";
import { measure } from "../capture.js";
import { duration } from "../units.js";

const short = (value) => (Number.isFinite(value) ? Number(value.toPrecision(6)).toString() : "–");

export function cursors(plot) {
  const [a, b] = ["A", "B"].map((name) => h("input", { type: "range", min: 0, max: 1, step: "any", value: name === "A" ? 0.25 : 0.75, id: `cursor-${name}` }));
  const between = h("p", { id: "between" });
  const body = h("tbody");
  const cells = new Map();
  let last = null;

  const place = (slider, record) => Math.round(slider.value * (record.length - 1));

  function show(channels, record) {
    last = [channels, record];
    const [ka, kb] = [place(a, record), place(b, record)];
    plot.cursors = [ka, kb];
    const time = record.columns[0];
    const way = time[kb] - time[ka];
    say(between, `A at ${duration(time[ka])}, B at ${duration(time[kb])}: between them ${duration(way)}${way ? `, 1/Δt ${short(1 / Math.abs(way))} Hz` : ""}`);
    if (cells.size !== channels.length || channels.some((name) => !cells.has(name))) {
      cells.clear();
      fill(body, channels.map((name, k) => {
        cells.set(name, Array.from({ length: 5 }, () => h("td")));
        return h("tr", {}, h("th", { scope: "row" }, h("span", { class: `swatch c${k}`, "aria-hidden": true }), `${plot.label(k)}`), cells.get(name));
      }));
    }
    channels.forEach((name, k) => {
      const column = record.columns[k + 1];
      const { rms, peak } = measure(column, ka, kb);
      [column[ka], column[kb], column[kb] - column[ka], rms, peak].forEach((value, n) => say(cells.get(name)[n], short(value)));
    });
  }

  for (const slider of [a, b]) {
    slider.addEventListener("input", () => {
      if (!last) return;
      show(...last);
      plot.redraw();
    });
  }
  plot.onpick = (share) => {
    const nearest = Math.abs(a.value - share) < Math.abs(b.value - share) ? a : b;
    nearest.value = share;
    nearest.dispatchEvent(new Event("input"));
  };
  const root = h("div", { class: "cursors" }, h("div", { class: "fields" }, field("Cursor A", a), field("Cursor B", b)), between,
    h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Values at the cursors" },
      h("table", {}, h("thead", {}, h("tr", {}, ["Channel", "A", "B", "B − A", "RMS", "Peak to peak"].map((one) => h("th", { scope: "col" }, one)))), body)));
  return { root, show };
}
