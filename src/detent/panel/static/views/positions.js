// Positions: teach where it stands, go there, edit, undo, export.

import { field, fill, h } from "../dom.js";
import { number, shown, typed } from "../units.js";

/** A moment in the time of whoever looks, to the minute. */
const moment = (text) => text && new Date(text).toLocaleString("sv-SE").slice(0, 16);

export function open(root, { link, act, tell }) {
  const { unit, commands } = link.about;
  if (!commands.includes("teach")) {
    root.append(h("h1", {}, "Positions"), h("p", {}, "Nothing is kept of this axis, so it has no position table. Start it with a store."));
    return {};
  }
  const name = h("input", { type: "text", id: "teach-name", maxlength: 32, required: true, autocomplete: "off", placeholder: "left end" });
  const body = h("tbody");
  const empty = h("p", { class: "hint" }, "No position yet: move the axis to a place, give it a name, press Teach here.");
  const teach = h("form", { class: "line" }, field("Name or number", name), h("button", { id: "teach" }, "Teach here"));
  let shownRows = "";
  let isOpen = true;

  async function load() {
    try {
      const { positions } = await link.request({ do: "positions" });
      const told = JSON.stringify(positions);
      if (!isOpen || told === shownRows) return;
      shownRows = told;
      empty.hidden = positions.length > 0;
      fill(body, positions.map(row));
    } catch (error) {
      tell(`positions: ${error.message}`, "bad");
    }
  }
  async function change(word, value) {
    await act(word, value);
    await load();
  }
  function row(one) {
    const place = h("input", { type: "text", class: "place", value: number(one.position, unit), "aria-label": `Position of ${one.name}` });
    place.addEventListener("change", () => change("edit", [one.name, typed(place.value, unit)]));
    return h("tr", {}, h("th", { scope: "row" }, one.name), h("td", { class: "line" },
      h("button", { class: "go", onclick: () => act("go_to", one.name), "aria-label": `Go to ${one.name}` }, "Go"),
      h("button", { class: "plain", onclick: () => change("forget", one.name), "aria-label": `Delete ${one.name}` }, "Delete")),
      h("td", {}, place, ` ${shown(unit).name}`), h("td", {}, moment(one.taught)), h("td", {}, moment(one.used) || "never"));
  }
  teach.addEventListener("submit", async (event) => {
    event.preventDefault();
    await change("teach", name.value.trim());
    name.value = "";
  });
  root.append(
    h("h1", {}, "Positions"), teach,
    h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Position table" },
      h("table", {}, h("thead", {}, h("tr", {}, ["Name", "Do", "Position", "Taught", "Last used"].map((one) => h("th", { scope: "col" }, one)))), body)),
    empty,
    h("p", { class: "line" }, h("button", { id: "undo", class: "plain", onclick: () => change("undo") }, "Undo the last change"),
      h("button", { id: "redo", class: "plain", onclick: () => change("redo") }, "Redo"),
      h("a", { class: "button plain", href: "/api/positions.csv", download: "positions.csv" }, "Export as CSV")),
    h("p", { class: "hint" }, `The table takes ${number(0.0125, unit)}, 5 mm or 0.2 in.`),
  );
  load();
  const timer = setInterval(() => { if (!body.contains(document.activeElement)) load(); }, 2000);
  return { close() { isOpen = false; clearInterval(timer); } };
}
