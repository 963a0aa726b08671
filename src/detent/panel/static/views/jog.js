// Jog: hold to move, steps, a target. Keys move the axis only while the pad has the focus, and it shows that.

import { field, h, say } from "../dom.js";
import { Hold } from "../hold.js";
import { quantity, shown, typed } from "../units.js";
import { steps } from "./steps.js";

const HINT = "It moves while you hold. Letting go, leaving the page or losing the connection stops it. "
  + "Keys, with the pad in focus: ← → hold, Shift fast, Ctrl fine.";

export function open(root, { link, act, tell }) {
  const { unit, commands, max_speed: fastest } = link.about;
  const per = `${unit}/s`;
  const hold = new Hold(link, (why) => {
    tell(`Jog ended: ${why}.`);
    ended = why;
  });
  let ended = "";
  const speed = h("input", { type: "range", min: 1, max: 100, value: 20, id: "jog-speed" });
  const said = h("output", { for: "jog-speed" });
  const velocity = (sign, scale = 1) => sign * Math.min((fastest * speed.value * scale) / 100, fastest);
  const show = () => say(said, quantity(velocity(1), per));
  speed.addEventListener("input", show);
  const minus = hold.button(h("button", { class: "jog", id: "jog-minus" }, h("span", { "aria-hidden": true }, "◀\u00a0"), "Hold: minus"),
    () => velocity(-1));
  const plus = hold.button(h("button", { class: "jog", id: "jog-plus" }, "Hold: plus", h("span", { "aria-hidden": true }, "\u00a0▶")),
    () => velocity(1));
  const pad = h("div", { class: "pad", tabindex: 0, id: "jog-pad", role: "group", "aria-label": "Jog pad: arrow keys move the axis while it has the focus" },
    minus, plus);
  pad.addEventListener("keydown", (event) => {
    const sign = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!sign) return;
    event.preventDefault();
    if (!event.repeat) hold.begin(event.key, velocity(sign, event.shiftKey ? 100 : event.ctrlKey ? 0.1 : 1), sign < 0 ? minus : plus);
  });
  pad.addEventListener("keyup", () => hold.end("released"));
  pad.addEventListener("focusout", (event) => { if (!pad.contains(event.relatedTarget)) hold.end("the pad lost the focus"); });

  const step = commands.includes("move_by") ? steps({ link, act }, () => speed.value / 100) : null;
  const target = h("input", { type: "text", inputmode: "decimal", id: "move-target", placeholder: `5 ${shown(unit).name}`, autocomplete: "off" });
  const stopped = h("p", { class: "hint", id: "last-stop" });
  const move = h("form", { class: "line" }, field(`Target (${shown(unit).name}, or with a unit: 0.2 in)`, target), h("button", {}, "Move to"));
  move.addEventListener("submit", (event) => {
    event.preventDefault();
    act("move_to", typed(target.value, unit), speed.value / 100);
  });
  root.append(h("h1", {}, "Jog"), ...(commands.includes("jog") ? [pad, h("p", { class: "hint" }, HINT)] : [h("p", {}, "This axis has no jog.")]));
  root.append(
    h("div", { class: "field" }, h("label", { for: "jog-speed" }, "Speed"), speed, said), stopped,
    step ? h("section", {}, h("h2", {}, "By a step"), step.root) : "",
    commands.includes("move_to") ? h("section", {}, h("h2", {}, "To a position"), move) : "",
  );
  show();
  return {
    status(s) {
      if (s.last_stop && ended) say(stopped, `Stopped over ${quantity(s.last_stop, unit)}: ${ended}.`);
      step?.status(s);
    },
    key(event) { step?.key(event); },
    close() { hold.close(); },
  };
}
