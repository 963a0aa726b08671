// Moves by a step: where they lead is told before.

import { choice, field, h, say } from "../dom.js";
import { number, quantity } from "../units.js";

const SIZES = { m: [1e-5, 1e-4, 1e-3, 1e-2, 5e-2], rad: [0.01, 0.1, 1, 10, 90].map((one) => (one * Math.PI) / 180) };

/** Two buttons and the size; `share()` gives the part of the largest speed. */
export function steps({ link, act }, share) {
  const { unit, limits } = link.about;
  const sizes = SIZES[unit];
  const size = choice(sizes.map((one) => [one, quantity(one, unit)]), sizes[2], { id: "step-size" });
  const step = (sign) => act("move_by", sign * Number(size.value), share());
  const ghost = h("p", { class: "hint", id: "ghost" });
  const root = h("div", {}, h("div", { class: "line" }, field("Step", size), h("button", { id: "step-minus", onclick: () => step(-1) }, "− step"),
    h("button", { id: "step-plus", onclick: () => step(1) }, "+ step")), ghost);
  return {
    root,
    status({ commanded }) {
      const [from, to] = [commanded - Number(size.value), commanded + Number(size.value)];
      const beyond = limits && (to > limits[1] || from < limits[0]) ? "; one of them lies beyond the limits" : "";
      say(ghost, `− will move to ${number(from, unit)}, + to ${quantity(to, unit)}${beyond}`);
    },
    key({ key }) {
      const way = { "[": -1, "]": 1 }[key];
      if (way) size.selectedIndex = Math.min(Math.max(size.selectedIndex + way, 0), size.length - 1);
    },
  };
}
