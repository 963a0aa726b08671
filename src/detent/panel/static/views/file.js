// Axis file: the text that this axis was made from, and the values in effect.

import { fill, h } from "../dom.js";
import { ask } from "../link.js";

export function open(root, { link }) {
  const effective = h("div");
  const text = h("pre", { tabindex: 0, role: "region", "aria-label": "Text of the axis file" });
  root.append(h("h1", {}, "Axis file"), h("p", {}, link.about.file), h("h2", {}, "Values in effect"), effective, h("h2", {}, "Text"), text);
  ask("/api/axis").then((axis) => {
    text.textContent = axis.text;
    fill(effective, h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Table of values in effect" },
      h("table", { class: "prose" }, h("thead", {}, h("tr", {}, ["Key", "Value", "From", "Meaning"].map((one) => h("th", { scope: "col" }, one)))),
        h("tbody", {}, axis.effective.map(([key, ...cells]) => h("tr", {}, h("th", { scope: "row" }, key), cells.map((one) => h("td", {}, String(one)))))))));
  }).catch((error) => fill(effective, h("p", {}, `The file cannot be shown: ${error.message}`)));
  return {};
}
