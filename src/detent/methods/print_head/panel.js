// The print line: the head between its frames, and the paper before it with the line that it prints.

import { fill, h, pair, say } from "/static/dom.js";
import { follow } from "/static/follow.js";
import { quantity } from "/static/units.js";

const H = "controller.head.";
const SHOWN = [[`${H}state`, "Motion"], [`${H}emitter`, "Position (emitters)"], [`${H}speed`, "Speed value (1/6 in/s)"],
  [`${H}drive_cmd`, "Drive (counts)"], [`${H}columns.fired`, "Columns fired"], [`${H}columns.missed`, "Columns missed"],
  [`${H}queue.waiting`, "Bytes waiting"]];
const ACTIVE = `${H}columns.active`; // 1 while it prints
const [LEFT, RIGHT] = [20, 560];
const NEAR = 0.1; // of the paper that is drawn large [m]
const [ROW, FIRST, LINES] = [26, 98, 4]; // lines on the paper: their distance, the uppermost, how many

export function open(root, { link }) {
  const { unit, limits } = link.about;
  const { states } = link.about.view.data;
  const place = (x) => LEFT + ((RIGHT - LEFT) * (x - limits[0])) / (limits[1] - limits[0]);
  const large = (x) => (580 * x) / NEAR;
  const head = h("path", { d: "M-9 50 h18 v-14 l-9 -10 l-9 10 z", class: "dot" });
  const wanted = h("line", { x1: 0, x2: 0, y1: 20, y2: 56, class: "ref" });
  const title = h("text", { x: (LEFT + RIGHT) / 2, y: 20, "text-anchor": "middle" });
  const paper = h("g");
  const rows = SHOWN.map(([name, text]) => [name, pair(text)]);
  const said = h("p", { role: "status" });
  const lines = []; // the newest is the last: {line, direction, glyphs: [{text, from, to}], shown}
  let [at, far, active] = [0, null, 0]; // where the head is, and how far it has come in its line [m]
  root.append(h("h1", {}, "Print line"),
    h("p", { class: "hint" }, "Above: the head between its frames, dashed where it is sent. Below: the paper at the head. A glyph stands there once the head has passed it; lines are printed to and fro."),
    h("svg", { viewBox: "0 -6 580 238", class: "drawing wide paper", role: "img", "aria-label": "Head between its frames, and the paper at the head; its position is written above it" },
      h("path", { d: `M${LEFT} 20V58H${RIGHT}V20`, class: "ink" }), wanted, head, h("path", { d: "M0 70H580", class: "faint" }), paper,
      h("path", { d: "M290 194l-8 14h16z", class: "dot" }), title),
    h("dl", { class: "cards" }, rows.map(([, { row }]) => row)), said);

  /** A line that begins: the paper moves up. */
  function begin({ line, direction, ink }) {
    const glyphs = ink.map(([char, from, width]) => ({ from, to: from + width, text: h("text", { x: large(from + width / 2), "text-anchor": "middle", class: "glyph" }, char) }));
    lines.push({ line, direction, glyphs, row: h("g", {}, glyphs.map(({ text }) => text)) });
    lines.splice(0, lines.length - LINES);
    lines.forEach(({ row }, k) => row.setAttribute("transform", `translate(0 ${FIRST + ROW * (k + LINES - lines.length)})`));
    fill(paper, lines.map(({ row }) => row));
    far = null;
  }

  /** What the head has passed is printed. */
  function print(last, isOver) {
    const { direction, glyphs } = last;
    if (active) far = far === null ? at : direction > 0 ? Math.max(far, at) : Math.min(far, at);
    for (const { text, from, to } of glyphs) text.style.visibility = isOver || (far !== null && (direction > 0 ? to <= far : from >= far)) ? "visible" : "hidden";
  }

  const leave = follow(link, [...SHOWN.map(([name]) => name), ACTIVE], (values) => {
    if (values.error) return say(said, values.error);
    active = values[ACTIVE];
    for (const [name, { value }] of rows) say(value, name === `${H}state` ? states[values[name]] ?? "?" : String(values[name]));
    return undefined;
  });
  return {
    status(s) {
      at = s.position;
      head.setAttribute("transform", `translate(${place(at)} 0)`);
      wanted.setAttribute("transform", `translate(${place(s.commanded)} 0)`);
      paper.setAttribute("transform", `translate(${290 - large(at)} 0)`);
      say(title, quantity(at, unit));
      const now = s.job?.shown;
      const last = lines[lines.length - 1];
      if (last && now?.line !== last.line) print(last, true);
      if (now?.line && now.line !== last?.line) begin(now);
      if (now?.line) print(lines[lines.length - 1], false);
    },
    close: leave,
  };
}
