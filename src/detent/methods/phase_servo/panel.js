// Phase and counters: the resolver's phase as the absolute converter reads it, and what the logic counts.

import { h, pair, say } from "/static/dom.js";
import { follow } from "/static/follow.js";

const C = "controller.";
const WORD = `${C}converters.absolute.word`;
const SHOWN = [[`${C}sequencer.state`, "Sequencer"], [`${C}sequencer.mode`, "Mode"], [`${C}sequencer.remaining`, "Distance to go (pulses)"],
  [`${C}speed.word`, "Counted speed"], [`${C}law.setpoint`, "Setpoint"], [`${C}law.integral`, "Integral"], [`${C}law.word`, "Drive word"]];
const STATES = ["acquire", "speed", "settle, busy", "settle, ready", "hold"];
const WORDS = { [`${C}sequencer.state`]: STATES, [`${C}sequencer.mode`]: ["speed", "position"] };

export function open(root, { link }) {
  const { cycle, stop } = link.about.view.data; // counts of the phase, and of the place where it stops
  const hand = h("line", { x1: 110, y1: 110, x2: 110, y2: 28, class: "now" });
  const title = h("text", { x: 110, y: 238, "text-anchor": "middle" });
  const rows = SHOWN.map(([name, text]) => [name, pair(text)]);
  const said = h("p", { role: "status" });
  const marks = Array.from({ length: 8 }, (_, k) => h("line", { x1: 110, y1: 12, x2: 110, y2: k % 2 ? 20 : 28, class: "faint", transform: `rotate(${k * 45} 110 110)` }));
  root.append(h("h1", {}, "Phase and counters"),
    h("p", { class: "hint" }, `First it counts pulses down to near its target. Then the hand takes over, the phase of the resolver within the pitch, of ${cycle} counts: it stops where the hand is at the triangle.`),
    h("div", { class: "beside" }, h("svg", { viewBox: "0 0 220 248", class: "drawing narrow", role: "img", "aria-label": "Phase of the resolver; its word stands below" },
      h("circle", { cx: 110, cy: 110, r: 98, class: "faint" }), marks,
      h("path", { d: "M110 208l-8 14h16z", class: "tip", transform: `rotate(${(stop / cycle) * 360 - 180} 110 110)` }), hand, title),
    h("dl", { class: "cards" }, rows.map(([, { row }]) => row))), said);
  const leave = follow(link, [WORD, ...SHOWN.map(([name]) => name)], (values) => {
    if (values.error) return say(said, values.error);
    hand.setAttribute("transform", `rotate(${(values[WORD] / cycle) * 360} 110 110)`);
    say(title, `word ${values[WORD]}`);
    for (const [name, { value }] of rows) say(value, WORDS[name]?.[values[name]] ?? String(values[name]));
    return undefined;
  });
  return { close: leave };
}
