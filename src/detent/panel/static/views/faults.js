// Faults: what happened, whether the position was kept, what to do; and faults to practise with.

import { choice, field, fill, h } from "../dom.js";
import { quantity } from "../units.js";

const list = (items) => h("ol", {}, items.map((one) => h("li", {}, one)));

function record(one, ...more) {
  const kept = one.position === "kept";
  return h("article", { class: "fault" },
    h("h2", {}, h("span", { "aria-hidden": true }, "▲ "), one.text),
    h("p", {}, h("strong", { class: kept ? "good" : "bad" }, kept ? "✓ The position was kept." : "✗ The position was lost: home before a move."), " ",
      one.value !== null && one.value !== undefined ? `It was ${quantity(one.value, one.unit)}${one.limit !== null && one.limit !== undefined ? `, the limit is ${quantity(one.limit, one.unit)}` : ""}.` : "",
      ` ${one.code}, number ${one.number}.`), ...more,
    one.causes?.length ? h("div", {}, h("h3", {}, "Likely causes, the likeliest first"), list(one.causes)) : "",
    one.steps?.length ? h("div", {}, h("h3", {}, "What to do"), list(one.steps)) : "",
    one.allowed?.length ? h("p", {}, `Allowed now: ${one.allowed.join(", ")}.`) : "");
}

export function open(root, { link, act, tell }) {
  const now = h("div", { role: "status" });
  const reset = () => h("p", { class: "line" }, h("button", { onclick: () => act("reset") }, "Reset"), h("small", {}, "Never moves the axis; enabling is a step of its own."));
  const past = h("div", { id: "faults" });
  const injections = Object.entries(link.about.injections ?? {}).flatMap(([where, kinds]) => kinds.map((kind) => `${where} ${kind}`));
  let code = -1;
  let isOpen = true;
  async function load() {
    if (!link.about.questions.includes("faults")) return;
    try {
      const { faults } = await link.request({ do: "faults" });
      if (!isOpen) return;
      const before = [...faults].reverse();
      if (code > 0 && before.length) fill(now, record(before.shift(), reset())); // the one that stands, with all that is known of it
      fill(past, before.length ? before.map((one) => record(one)) : h("p", { class: "hint" }, code > 0 ? "None before it." : "No fault since it was started."));
    } catch (error) {
      tell(`faults: ${error.message}`, "bad");
    }
  }
  root.append(h("h1", {}, "Faults"), now);
  if (injections.length) {
    const what = choice(injections.map((one) => [one, one]), injections[0], { id: "inject-what" });
    const amount = h("input", { type: "text", id: "inject-amount", autocomplete: "off", placeholder: "as it comes" });
    root.append(h("section", {}, h("h2", {}, "Practise: inject a fault into the simulated axis"), 
      h("div", { class: "fields" }, field("Fault", what), field("How much, as 1 mm or 30 N; may be empty", amount)),
      h("p", { class: "line" }, h("button", { id: "inject", class: "plain", onclick: () => act("inject", `${what.value} ${amount.value}`.trim()) }, "Inject"),
        h("button", { id: "mend", class: "plain", onclick: () => act("inject", "nothing") }, "Mend it"))));
  }
  root.append(h("h2", {}, "History"), past);
  load();
  return {
    status(s) {
      const at = s.fault?.code ?? 0;
      if (at === code) return;
      code = at;
      fill(now, s.fault ? h("div", { class: "note bad" }, h("p", {}, h("span", { "aria-hidden": true }, "▲ "), h("strong", {}, s.fault.text), ` (${s.fault.code})`), reset())
        : h("p", {}, h("span", { "aria-hidden": true }, "✓ "), "No fault now."));
      load();
    },
    close() { isOpen = false; },
  };
}
