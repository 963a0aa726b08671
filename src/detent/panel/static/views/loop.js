// Loop: how punctual it is.

import { fill, h, pair, say } from "../dom.js";
import { duration } from "../units.js";

const BIN = 1e-6; // the first bin ends here [s]; each one is twice as wide

export function open(root, { link }) {
  const { period } = link.about;
  const values = Object.fromEntries([["periods", "Periods"], ["skipped", "Skipped"], ["overruns", "Late by a period or more"],
    ["worst", "Latest"], ["mean_work", "Computing, mean"], ["longest_work", "Computing, longest"], ["uptime", "Running for"]]
    .map(([key, text]) => [key, pair(text)]));
  const body = h("tbody");
  let next = 0;
  root.append(h("h1", {}, "Loop"), h("p", {}, `A period takes ${duration(period)}. Late by ${duration(5 * period)} or more is a fault.`),
    h("dl", { class: "cards" }, Object.values(values).map(({ row }) => row)), h("h2", { id: "late-title" }, "How late periods began"),
    h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "How late periods began" }, h("table", { class: "bars", "aria-labelledby": "late-title" }, h("thead", {}, h("tr", {}, ["Below", "Periods", ""].map((one) => h("th", { scope: "col" }, one || h("span", { class: "hidden" }, "Share"))))), body)));
  return {
    status({ loop }) {
      if (performance.now() < next) return;
      next = performance.now() + 250;
      for (const key of ["periods", "skipped", "overruns"]) say(values[key].value, loop[key].toLocaleString("en"));
      for (const key of ["worst", "mean_work", "longest_work"]) say(values[key].value, duration(loop[key]));
      say(values.uptime.value, `${(loop.periods * period).toFixed(0)} s`);
      const last = loop.late.findLastIndex((one) => one > 0);
      const most = Math.max(...loop.late, 1);
      fill(body, loop.late.slice(0, last + 1).map((count, k) => h("tr", {}, h("th", { scope: "row" }, duration(BIN * 2 ** k)),
        h("td", {}, count.toLocaleString("en")), h("td", {}, h("meter", { min: 0, max: 1, value: Math.log1p(count) / Math.log1p(most), "aria-label": `${count} periods` })))));
    },
  };
}
