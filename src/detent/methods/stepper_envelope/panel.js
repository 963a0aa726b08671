// The envelope: how fast the motor may be anywhere on its travel, and where on it the motor is now.

import { h, pair, say } from "/static/dom.js";
import { follow } from "/static/follow.js";
import { quantity } from "/static/units.js";

const R = "controller.rule.";
const STATES = ["rest", "accelerate", "cruise", "decelerate", "turn", "fault"];
const SHOWN = [[`${R}state`, "Control unit"], [`${R}index`, "Ramp index"], [`${R}position`, "Steps"], [`${R}direction`, "Direction"]];
const [LEFT, RIGHT, TOP, BOTTOM] = [20, 560, 16, 200];

export function open(root, { link }) {
  const { unit, limits, max_speed: fastest } = link.about;
  const { edges, speeds } = link.about.view.data; // where the limit changes, and what it is between
  const x = (place) => LEFT + ((RIGHT - LEFT) * (place - limits[0])) / (limits[1] - limits[0]);
  const y = (speed) => BOTTOM - ((BOTTOM - TOP) * speed) / (1.1 * fastest);
  const zones = speeds.map((speed, k) => `${k ? "L" : "M"}${x(edges[k])} ${y(speed)}H${x(edges[k + 1])}`).join("");
  const point = h("circle", { r: 7, class: "dot" });
  const trail = h("path", { d: "", class: "ref" });
  const title = h("text", { x: LEFT, y: 228 });
  const rows = SHOWN.map(([name, text]) => [name, pair(text)]);
  const said = h("p", { role: "status" });
  let points = [];
  root.append(h("h1", {}, "Envelope"),
    h("p", { class: "hint" }, "The line is the speed that is permitted at each place, the point the motor: it stays under the line, and before a narrow place or an end it comes down its ramp."),
    h("svg", { viewBox: "0 0 580 240", class: "drawing wide", role: "img", "aria-label": "Permitted speed over the travel with the moving point; both stand below" },
      h("path", { d: `M${LEFT} ${TOP}V${BOTTOM}H${RIGHT}`, class: "wire" }), h("path", { d: zones, class: "ink" }), trail, point,
      h("text", { x: LEFT + 6, y: TOP + 4, class: "soft" }, "speed"), h("text", { x: RIGHT, y: BOTTOM - 8, "text-anchor": "end", class: "soft" }, "place"), title),
    h("dl", { class: "cards" }, rows.map(([, { row }]) => row)), said);
  const leave = follow(link, SHOWN.map(([name]) => name), (values) => {
    if (values.error) return say(said, values.error);
    for (const [name, { value }] of rows) say(value, name.endsWith(".state") ? STATES[values[name]] ?? "?" : String(values[name]));
    return undefined;
  });
  return {
    status(s) {
      const [px, py] = [x(s.position), y(Math.abs(s.velocity))];
      point.setAttribute("cx", px);
      point.setAttribute("cy", py);
      points = s.rests ? points : [...points.slice(-200), `${px.toFixed(1)} ${py.toFixed(1)}`];
      trail.setAttribute("d", points.length ? `M${points.join("L")}` : "");
      say(title, `${quantity(s.position, unit)}, ${quantity(Math.abs(s.velocity), `${unit}/s`)} of at most ${quantity(fastest, `${unit}/s`)}`);
    },
    close: leave,
  };
}
