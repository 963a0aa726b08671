// The print line: the head between its frames, the columns that it fires, what its computer is about.

import { h, pair, say } from "/static/dom.js";
import { follow } from "/static/follow.js";
import { quantity } from "/static/units.js";

const H = "controller.head.";
const SHOWN = [[`${H}state`, "Motion"], [`${H}emitter`, "Position (emitters)"], [`${H}speed`, "Speed value (1/6 in/s)"],
  [`${H}drive_cmd`, "Drive (counts)"], [`${H}columns.fired`, "Columns fired"], [`${H}columns.missed`, "Columns missed"],
  [`${H}queue.waiting`, "Bytes waiting"], [`${H}columns.active`, "Prints (1: yes)"]];
const [LEFT, RIGHT] = [20, 560];

export function open(root, { link }) {
  const { unit, limits } = link.about;
  const { states } = link.about.view.data;
  const place = (x) => LEFT + ((RIGHT - LEFT) * (x - limits[0])) / (limits[1] - limits[0]);
  const head = h("path", { d: "M-12 58 h24 v-22 l-12 -12 l-12 12 z", class: "dot" });
  const wanted = h("line", { x1: 0, x2: 0, y1: 18, y2: 70, class: "ref" });
  const ink = h("path", { d: "", class: "now" });
  const title = h("text", { x: (LEFT + RIGHT) / 2, y: 108, "text-anchor": "middle" });
  const rows = SHOWN.map(([name, text]) => [name, pair(text)]);
  const said = h("p", { role: "status" });
  let [fired, at, line] = [null, 0, ""];
  root.append(h("h1", {}, "Print line"),
    h("svg", { viewBox: "0 0 580 120", class: "drawing wide", role: "img", "aria-label": "Head between its frames; its position is written below it" },
      h("line", { x1: LEFT, x2: RIGHT, y1: 84, y2: 84, class: "ink" }), h("line", { x1: LEFT, x2: LEFT, y1: 14, y2: 90, class: "ink" }),
      h("line", { x1: RIGHT, x2: RIGHT, y1: 14, y2: 90, class: "ink" }), ink, wanted, head, title),
    h("p", { class: "hint" }, "The mark under the head is where it has fired columns in this pass; a turn begins a new line."),
    h("dl", { class: "cards" }, rows.map(([, { row }]) => row)), said);
  const leave = follow(link, SHOWN.map(([name]) => name), (values) => {
    if (values.error) return say(said, values.error);
    for (const [name, { value }] of rows) say(value, name === `${H}state` ? states[values[name]] ?? "?" : String(values[name]));
    const now = values[`${H}columns.fired`];
    if (!values[`${H}columns.active`]) line = "";
    else if (fired !== null && now > fired) line = `${line.slice(-4000)}M${at.toFixed(1)} 76V84`;
    fired = now;
    return ink.setAttribute("d", line);
  });
  return {
    status(s) {
      at = place(s.position);
      head.setAttribute("transform", `translate(${at} 0)`);
      wanted.setAttribute("transform", `translate(${place(s.commanded)} 0)`);
      say(title, quantity(s.position, unit));
    },
    close: leave,
  };
}
