// The dial: where the table is on its turn, where it should be, and where the count wraps.

import { h, say, pair } from "/static/dom.js";
import { follow } from "/static/follow.js";
import { number } from "/static/units.js";

const P = "controller.positioner.";
const STATES = ["power-on", "hold", "jog", "stopping", "move"];
const SHOWN = [[`${P}state`, "Positioner"], [`${P}angle.turn`, "Turns in the count"], [`${P}angle.crossings`, "Crossings of 0"],
  [`${P}dr`, "Deviation (count/2^f)"], [`${P}s4`, "Speed word"]];
const TURN = 2 * Math.PI;

export function open(root, { link }) {
  const hand = h("g", {}, h("line", { x1: 150, y1: 150, x2: 150, y2: 40, class: "now" }), h("circle", { cx: 150, cy: 40, r: 7, class: "dot" }));
  const wanted = h("line", { x1: 150, y1: 150, x2: 150, y2: 24, class: "ref" });
  const marks = Array.from({ length: 36 }, (_, k) => h("line", { x1: 150, y1: 20, x2: 150, y2: k % 9 ? 28 : 38, class: "faint", transform: `rotate(${k * 10} 150 150)` }));
  const names = [["0", 150, 56], ["90", 252, 155], ["180", 150, 254], ["270", 48, 155]].map(([text, x, y]) => h("text", { x, y, "text-anchor": "middle" }, text));
  const angle = pair("Angle on the turn", "deg");
  const turns = pair("Whole turns");
  const rows = SHOWN.map(([name, text]) => [name, pair(text)]);
  const said = h("p", { role: "status" });
  root.append(h("h1", {}, "Dial"),
    h("p", { class: "hint" }, "Solid: where the table is. Dashed: where it is sent. The triangle is the wrap: there the sensor begins again at 0, and the count goes on."),
    h("div", { class: "beside" }, h("svg", { viewBox: "0 0 302 304", class: "drawing narrow", role: "img", "aria-label": "Dial; the angle stands beside it" },
      h("circle", { cx: 150, cy: 150, r: 130, class: "faint" }), marks, names,
      h("path", { d: "M150 20 l-8 -14 h16 z", class: "dot" }), wanted, hand),
    h("dl", { class: "cards" }, angle.row, turns.row, rows.map(([, { row }]) => row))), said);
  const turned = (value) => (((value % TURN) + TURN) % TURN);
  const leave = follow(link, SHOWN.map(([name]) => name), (values) => {
    if (values.error) return say(said, values.error);
    for (const [name, { value }] of rows) say(value, name.endsWith(".state") ? STATES[values[name]] ?? "?" : String(values[name]));
    return undefined;
  });
  return {
    status(s) {
      hand.setAttribute("transform", `rotate(${(turned(s.position) * 360) / TURN} 150 150)`);
      wanted.setAttribute("transform", `rotate(${(turned(s.commanded) * 360) / TURN} 150 150)`);
      say(angle.value, number(turned(s.position), "rad"));
      say(turns.value, String(Math.floor(s.position / TURN)));
    },
    close: leave,
  };
}
