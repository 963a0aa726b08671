// Log: who asked for what, from where, and how it ended.

import { fill, h, say } from "../dom.js";

const SHOWN = 200; // newest records

export function open(root, { link }) {
  const body = h("tbody");
  const heads = h("tr");
  let isOpen = true;
  let told = "";
  const where = h("p", { class: "hint" });
  async function load() {
    const { log } = await link.request({ do: "log" }).catch((error) => ({ log: { records: [{ error: error.message }] } }));
    const rows = log.records.slice(-SHOWN).reverse();
    if (!isOpen || JSON.stringify(rows) === told) return;
    told = JSON.stringify(rows);
    say(where, [log.file && `All of it: ${log.file}.`, log.lost && `${log.lost} records lost.`, log.trouble].filter(Boolean).join(" "));
    const keys = [...new Set(rows.flatMap((one) => Object.keys(one)))];
    fill(heads, keys.map((one) => h("th", { scope: "col" }, one)));
    fill(body, rows.map((one) => h("tr", {}, keys.map((key) => h("td", {}, String(one[key] ?? ""))))));
  }
  root.append(h("h1", {}, "Log"), where, h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Log, newest first" },
    h("table", {}, h("thead", {}, heads), body)));
  load();
  const timer = setInterval(load, 1000);
  return { close() { isOpen = false; clearInterval(timer); } };
}
