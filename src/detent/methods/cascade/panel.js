// The cascade loop with a value on every wire: reference, position loop, velocity loop, command.

import { h, mark, say } from "/static/dom.js";
import { follow } from "/static/follow.js";
import { number, shown } from "/static/units.js";

const C = "controller.";
const LIMITED = `${C}law.limited`;
const BOXES = [ // x, y, what it is, its register
  [10, 20, "reference", `${C}reference.position`], [150, 20, "position error", `${C}law.position_error`],
  [290, 20, "velocity error", `${C}law.velocity_error`], [430, 20, "command", `${C}law.command`],
  [150, 130, "velocity wanted", `${C}reference.velocity`], [290, 130, "integral part", `${C}law.integral`],
  [430, 130, "feedforward", `${C}law.feed_forward`],
];
const NAMES = [...BOXES.map((one) => one[3]), LIMITED];
const WIRES = ["M130 50H150", "M270 50H290", "M410 50H430", "M210 130V80M350 130V80M490 130V80", "M550 50H575V230H140V50"];

export function open(root, { link }) {
  const { unit, channels } = link.about;
  const units = Object.fromEntries(channels.map((one) => [one.name, one.unit]));
  const unitOf = (name) => (name.includes("reference.") || name.includes("position_error") || name.includes("velocity_error")
    ? (name.includes("velocity") ? `${unit}/s` : unit) : units[name]);
  const texts = {};
  const boxes = BOXES.map(([x, y, title, name]) => {
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
    const at = values[LIMITED] === 1;
    mark(limited, "warn", at);
    return say(limited, at ? "▲ The command is at its limit: the loops cannot get more." : "The command is within its limit.");
  });
  return { status(s) { say(back, `measured position ${number(s.position, unit)} ${shown(unit).name}`); }, close: leave };
}
