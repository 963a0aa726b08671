// What may be set on the scope.

import { choice, field, fill, h } from "../dom.js";

const MOST = 8;
const FOUND = 30; // registers that a search shows
const TIMES = [0.1, 0.2, 0.5, 1, 2, 5, 10];

/** A level such as "20 mm/s" in SI units: its unit is the one that is shown, or the bare SI one. */
export function parse(text, { name, factor }) {
  const [, number, unit] = /^(\S+)\s*(.*)$/.exec(text) ?? [];
  return unit === name ? Number(number) / factor : NaN;
}

/** Check boxes: what is chosen, what every axis has, and the registers that the search finds. */
function picker(all, chosen) {
  const names = new Set(chosen);
  const boxes = h("div", { class: "boxes" });
  const find = h("input", { type: "search", id: "channel-find", autocomplete: "off", placeholder: "position" });
  const draw = () => {
    const wanted = find.value.trim().toLowerCase();
    const found = wanted ? all.filter(({ name, help }) => `${name} ${help}`.toLowerCase().includes(wanted)).slice(0, FOUND) : all.filter(({ name }) => !name.includes("."));
    const shown = [...all.filter(({ name }) => names.has(name) && !found.some((one) => one.name === name)), ...found];
    fill(boxes, shown.map(({ name, unit, help }) => h("label", { class: "box", title: help },
      h("input", { type: "checkbox", name: "channel", value: name, checked: names.has(name), disabled: !names.has(name) && names.size >= MOST }),
      ` ${name}`, h("small", {}, unit && ` ${unit}`))));
  };
  boxes.addEventListener("change", ({ target }) => {
    if (target.checked) names.add(target.value);
    else names.delete(target.value);
    for (const { firstChild: one } of boxes.children) one.disabled = !one.checked && names.size >= MOST;
  });
  find.addEventListener("input", draw);
  draw();
  return { boxes, find, names };
}

export function controls(all, chosen) {
  const { boxes, find, names } = picker(all, chosen);
  const kind = choice([["none", "free run"], ["edge", "edge"], ["level", "level"], ["fault", "fault"]], "none", { id: "trigger-kind" });
  const source = choice(all.filter(({ name }) => !name.includes(".") || names.has(name)).map(({ name }) => [name, name]), "velocity", { id: "trigger-channel" });
  const rising = choice([["1", "rising, above"], ["0", "falling, below"]], "1", { id: "trigger-slope" });
  const level = h("input", { type: "text", id: "trigger-level", inputmode: "decimal", value: "1", autocomplete: "off" });
  const before = choice([[0, "0 %"], [0.1, "10 %"], [0.25, "25 %"], [0.5, "50 %"], [0.75, "75 %"], [0.9, "90 %"]], 0.5, { id: "trigger-before" });
  const seconds = choice(TIMES.map((one) => [one, `${one} s`]), 2, { id: "scope-time" });
  const across = choice([["", "over time"], ["xy", "one over another (XY)"]], "", { id: "scope-view" });
  const [x, y] = ["x", "y"].map((name) => h("select", { id: `scope-${name}` }));
  const lie = h("div", { class: "fields", hidden: true }, field("Across", x), field("Up", y));
  const single = h("input", { type: "checkbox", id: "scope-single" });
  const button = (id, text) => h("button", { id, type: "button", class: "plain" }, text);
  const [run, arm, overlay, csv] = [button("scope-run", "Freeze"), button("scope-arm", "Single"), button("scope-overlay", "Keep as overlay"), button("scope-csv", "CSV")];
  const root = h("div", { class: "scope-controls" },
    h("div", { class: "fields" }, field("Drawn", across), lie, field("Time", seconds), field("Trigger", kind), field("Channel", source), field("Slope or side", rising), field("Level", level),
      field("Before the trigger", before), h("label", { class: "box" }, single, " one record, then freeze")),
    h("details", { open: true }, h("summary", {}, `Channels, ${MOST} at most`), field("Find a register of the axis", find), boxes));
  return {
    root, buttons: h("div", { class: "line" }, run, arm, overlay, csv), run, arm, overlay, csv, single, chosen: () => [...names],
    isView: (one) => [across, x, y].includes(one),
    /** Numbers of the channels that lie across and up; null: over time. What is not watched any more gives way. */
    axes: (channels) => {
      [[x, channels[0]], [y, channels[channels.length - 1]]].forEach(([list, first]) => {
        const held = channels.includes(list.value) ? list.value : first;
        fill(list, channels.map((name) => h("option", { value: name, selected: name === held }, name)));
      });
      lie.hidden = !across.value;
      return across.value && channels.length ? [channels.indexOf(x.value), channels.indexOf(y.value)] : null;
    },
    isSingle: () => single.checked,
    seconds: () => Number(seconds.value),
    before: () => Number(before.value),
    trigger: () => (kind.value === "none" ? { kind: "none" } : {
      kind: kind.value, name: kind.value === "fault" ? "fault" : source.value, rising: rising.value === "1", level: level.value,
    }),
  };
}
