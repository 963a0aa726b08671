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
  const { cycle } = link.about.view.data;
  const hand = h("line", { x1: 110, y1: 110, x2: 110, y2: 28, class: "now" });
  const title = h("text", { x: 110, y: 238, "text-anchor": "middle" });
  const rows = SHOWN.map(([name, text]) => [name, pair(text)]);
  const said = h("p", { role: "status" });
  const marks = Array.from({ length: 8 }, (_, k) => h("line", { x1: 110, y1: 12, x2: 110, y2: k % 2 ? 20 : 28, class: "faint", transform: `rotate(${k * 45} 110 110)` }));
  root.append(h("h1", {}, "Phase and counters"),
    h("svg", { viewBox: "0 0 220 248", class: "drawing narrow", role: "img", "aria-label": "Phase of the resolver; its word stands below" },
      h("circle", { cx: 110, cy: 110, r: 98, class: "faint" }), marks, hand, title),
    h("p", { class: "hint" }, `The hand is the phase of the resolver: a turn is one cycle of ${cycle} counts. By pulses the servo comes near, by this word it stops.`),
    h("dl", { class: "cards" }, rows.map(([, { row }]) => row)), said);
  const leave = follow(link, [WORD, ...SHOWN.map(([name]) => name)], (values) => {
    if (values.error) return say(said, values.error);
    hand.setAttribute("transform", `rotate(${(values[WORD] / cycle) * 360} 110 110)`);
    say(title, `word ${values[WORD]}`);
    for (const [name, { value }] of rows) say(value, WORDS[name]?.[values[name]] ?? String(values[name]));
    return undefined;
  });
  return { close: leave };
}
