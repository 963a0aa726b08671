// The cascade loop with a value on every wire: reference, position loop, velocity loop, command.

import { h, mark, say } from "/static/dom.js";
import { follow } from "/static/follow.js";
import { number, shown } from "/static/units.js";

const AT = "controller.";
const NAMES = ["reference.position", "reference.velocity", "law.position_error", "law.velocity_error", "law.integral",
  "law.feed_forward", "law.command", "law.limited"].map((one) => AT + one);
const BOXES = [ // x, y, what it is, the wire that leaves it
  [10, 20, "reference", "reference.position"], [150, 20, "position error", "law.position_error"],
  [290, 20, "velocity error", "law.velocity_error"], [430, 20, "command", "law.command"],
  [150, 130, "velocity wanted", "reference.velocity"], [290, 130, "integral part", "law.integral"],
  [430, 130, "feedforward", "law.feed_forward"],
];
const WIRES = ["M130 50H150", "M270 50H290", "M410 50H430", "M210 130V80M350 130V80M490 130V80", "M550 50H575V230H70V80"];

export function open(root, { link }) {
  const { unit, channels } = link.about;
  const units = Object.fromEntries(channels.map((one) => [one.name, one.unit]));
  const unitOf = (name) => (name.includes("reference.") || name.includes("position_error") || name.includes("velocity_error")
    ? (name.includes("velocity") ? `${unit}/s` : unit) : units[name]);
  const texts = {};
  const boxes = BOXES.map(([x, y, title, wire]) => {
    const name = AT + wire;
    texts[name] = h("text", { x: x + 60, y: y + 46, "text-anchor": "middle" }, "–");
    return h("g", {}, h("rect", { x, y, width: 120, height: 60, rx: 8, class: "ink" }),
      h("text", { x: x + 60, y: y + 22, "text-anchor": "middle", class: "soft" }, title), texts[name]);
  });
  const back = h("text", { x: 320, y: 222, "text-anchor": "middle" }, "–");
  const limited = h("p", { role: "status" });
  root.append(h("h1", {}, "Cascade loop"),
    h("svg", { viewBox: "0 0 585 245", class: "drawing wide", role: "img", "aria-label": "Block diagram of the cascade; its values are in the boxes" },
      WIRES.map((d) => h("path", { d, class: "faint" })), boxes, back), limited,
    h("p", { class: "hint" }, "The error of the position loop, times its gain, is the velocity that the velocity loop is asked for; what is missing of it, with its integral and the feedforward, is the command."));
  const leave = follow(link, NAMES, (values) => {
    if (values.error) return say(limited, values.error);
    for (const [name, text] of Object.entries(texts)) say(text, `${number(values[name], unitOf(name))} ${shown(unitOf(name)).name}`);
    const at = values[`${AT}law.limited`] === 1;
    mark(limited, "warn", at);
    return say(limited, at ? "▲ The command is at its limit: the loops cannot get more." : "The command is within its limit.");
  });
  return { status(s) { say(back, `measured position ${number(s.position, unit)} ${shown(unit).name}`); }, close: leave };
}
