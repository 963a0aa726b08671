// The cascade loop with a value in every box: what is wanted, what is missing of it, and what the drive is told.

import { h, mark, say } from "/static/dom.js";
import { follow } from "/static/follow.js";
import { number, shown } from "/static/units.js";

const C = "controller.";
const LIMITED = `${C}law.limited`;
const VELOCITY = `${C}motor_sensor.velocity`;
const WANTED = "velocity wanted";
const CHAIN = [ // from the reference to the drive: what it is, its register
  ["reference", `${C}reference.position`], ["position error", `${C}law.position_error`], [WANTED, WANTED],
  ["velocity error", `${C}law.velocity_error`], ["command", `${C}law.command`], ["measured", ""],
];
const ADDED = [["integral", `${C}law.integral`], ["feedforward", `${C}law.feed_forward`]]; // to the command
const NAMES = [...CHAIN, ...ADDED].map(([, name]) => name).filter((name) => name.startsWith(C)).concat(VELOCITY, LIMITED);
const SIZE = [116, 56];
const LAYOUTS = { // where the boxes are, the arrows between them, what is written at those that come back
  wide: {
    size: "0 0 808 252", chain: (k) => [6 + 136 * k, 84], added: (k) => [550 - 136 * (1 - k), 6],
    arrows: ["M122 112H140", "M258 112H276", "M394 112H412", "M530 112H548", "M666 112H684", "M472 62V73H590V82", "M608 62V82"],
    back: ["M744 140V226H200V142", "M744 184H472V142"], texts: [[472, 220, "measured position"], [608, 178, "measured velocity"]],
  },
  tall: {
    size: "0 0 330 500", chain: (k) => [10, 8 + 84 * k], added: (k) => [150, 298 + 68 * k],
    arrows: [0, 1, 2, 3, 4].map((k) => `M68 ${64 + 84 * k}V${90 + 84 * k}`).concat("M150 326H138V356H128", "M150 394H138V384H128"),
    back: ["M126 456H316V120H128", "M296 456V288H128"], texts: [[222, 112, "measured position"], [212, 280, "measured velocity"]],
  },
};

/** A line that ends in an arrow head, by the direction of its last stretch. */
function arrow(d) {
  const made = h("g", {}, h("path", { d, class: "wire" }));
  const points = [...d.matchAll(/([MHV])([\d.]+)(?: ([\d.]+))?/g)].reduce((all, [, way, a, b]) => {
    const [x, y] = all[all.length - 1] ?? [0, 0];
    return [...all, way === "M" ? [Number(a), Number(b)] : way === "H" ? [Number(a), y] : [x, Number(a)]];
  }, []);
  const [[x0, y0], [x, y]] = points.slice(-2);
  made.append(h("path", { d: "M0 0l-9 -5v10z", class: "tip", transform: `translate(${x} ${y}) rotate(${(Math.atan2(y - y0, x - x0) * 180) / Math.PI})` }));
  return made;
}

export function open(root, { link }) {
  const { unit, channels } = link.about;
  const units = Object.fromEntries(channels.map((one) => [one.name, one.unit]));
  const unitOf = (name) => (/velocity/.test(name) ? `${unit}/s` : /position/.test(name) || !name ? unit : units[name]);
  const texts = {}; // of each register, one for each layout
  const box = ([title, name], [x, y]) => {
    const text = h("text", { x: x + SIZE[0] / 2, y: y + 43, "text-anchor": "middle" }, "–");
    (texts[name] ??= []).push(text);
    return h("g", {}, h("rect", { x, y, width: SIZE[0], height: SIZE[1], rx: 8, class: "ink" }),
      h("text", { x: x + SIZE[0] / 2, y: y + 21, "text-anchor": "middle", class: "soft" }, title), text);
  };
  const drawing = (name) => {
    const { size, chain, added, arrows, back, texts: written } = LAYOUTS[name];
    return h("svg", { viewBox: size, class: `drawing ${name}`, role: "img", "aria-label": "Block diagram of the cascade; its values are in the boxes" },
      [...back, ...arrows].map(arrow), written.map(([x, y, text]) => h("text", { x, y, "text-anchor": "middle", class: "soft" }, text)),
      CHAIN.map((one, k) => box(one, chain(k))), ADDED.map((one, k) => box(one, added(k))));
  };
  const put = (name, value) => texts[name].forEach((text) => say(text, `${number(value, unitOf(name))} ${shown(unitOf(name)).name}`));
  const limited = h("p", { role: "status" });
  root.append(h("h1", {}, "Cascade loop"),
    h("p", { class: "hint" }, "From left to right, or from above: what is missing of the position asks for a velocity, what is missing of that asks the drive for a command. What the sensor measures comes back."),
    h("div", { class: "both" }, drawing("wide"), drawing("tall")), limited);
  const leave = follow(link, NAMES, (values) => {
    if (values.error) return say(limited, values.error);
    for (const name of NAMES) if (texts[name]) put(name, values[name]);
    put(WANTED, values[`${C}law.velocity_error`] + values[VELOCITY]);
    const at = values[LIMITED] === 1;
    mark(limited, "warn", at);
    return say(limited, at ? "▲ The command is at its limit: the loops cannot get more." : "The command is within its limit.");
  });
  return { status(s) { put("", s.position); }, close: leave };
}
