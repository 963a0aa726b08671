// Status: where it is, where it should be, what limits it.

import { choice, field, h, mark, pair, say } from "../dom.js";
import { number, shown } from "../units.js";

const LAMPS = [["ready", "ready"], ["in_window", "in the window"], ["rests", "commanded rest"], ["limited", "effort at its limit"],
  ["confirmed", "first motion confirmed"]];

const SELECTOR = [["both", "panel and faces, one at a time"], ["local", "panel and programs only"], ["remote", "faces only"]];

export function open(root, { link, act }) {
  const { unit, limits } = link.about;
  const per = `${unit}/s`;
  const rows = {
    position: pair("Position", shown(unit).name), commanded: pair("Commanded", shown(unit).name),
    error: pair("Error", shown(unit).name), velocity: pair("Velocity", shown(per).name),
  };
  const below = pair("To the lower limit", shown(unit).name);
  const above = pair("To the upper limit", shown(unit).name);
  const stop = pair("Way of the last stop", shown(unit).name);
  const effort = h("meter", { min: 0, max: 1, high: 0.9, low: 0.7, optimum: 0, id: "effort" });
  const share = h("output", { for: "effort" });
  const lamps = LAMPS.map(([key, text]) => ({ key, lamp: h("li", {}, text) }));
  const selector = choice(SELECTOR, "both", {
    id: "selector", disabled: document.querySelector("meta[name=role]").content === "viewer",
    onchange: async (event) => { await act("selector", event.target.value); event.target.blur(); },
  });
  root.append(
    h("h1", {}, "Status"),
    h("dl", { class: "cards" }, Object.values(rows).map(({ row }) => row)),
    h("p", { class: "field" }, h("label", { for: "effort" }, "Effort, of its limit"), effort, share),
    h("ul", { class: "lamps" }, lamps.map(({ lamp }) => lamp)),
    h("dl", { class: "cards" }, limits ? [below.row, above.row] : [], stop.row),
    field("Commands are taken from", selector),
    h("p", { class: "hint" }, `${link.about.name}: file ${link.about.file}, `
      + `${link.about.simulated ? `simulated, time ${link.about.speed} times as fast` : "on hardware"}`),
  );
  return {
    status(s) {
      for (const [key, { value }] of Object.entries(rows)) say(value, number(s[key], key === "velocity" ? per : unit));
      if (limits) {
        say(below.value, number(s.position - limits[0], unit));
        say(above.value, number(limits[1] - s.position, unit));
      }
      if (document.activeElement !== selector) selector.value = s.selector;
      say(stop.value, number(s.last_stop, unit));
      effort.value = Math.min(Math.abs(s.effort), 1);
      say(share, `${Math.round(Math.abs(s.effort) * 100)} %${s.limited ? ", limited by the drive" : ""}`);
      for (const { key, lamp } of lamps) mark(lamp, "on", s[key]);
    },
  };
}
