// Elements without markup in strings: what a name, a fault or a file says can never become part of the page.

const SVG = "http://www.w3.org/2000/svg";
const OF_SVG = new Set(["svg", "g", "path", "circle", "line", "rect", "text", "polyline", "title"]);

/** Make an element: `h("button", {class: "big", onclick: f}, "Go")`; in SVG, too. */
export function h(tag, props = {}, ...children) {
  const made = OF_SVG.has(tag) && props.html !== true ? document.createElementNS(SVG, tag) : document.createElement(tag);
  for (const [name, value] of Object.entries(props)) {
    if (name === "html" || value === undefined || value === null || value === false) continue;
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (name === "value" || name === "checked") made[name] = value;
    else made.setAttribute(name, value === true ? "" : String(value));
  }
  made.append(...children.flat().filter((one) => one !== undefined && one !== null && one !== false));
  return made;
}

/** Set a text only where it has changed: the page is looked at 25 times a second. */
export function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** A class that is there or not. */
export function mark(element, name, on) {
  if (element.classList.contains(name) !== Boolean(on)) element.classList.toggle(name, Boolean(on));
}

/** Replace what is inside. */
export function fill(element, ...children) {
  element.replaceChildren(...children.flat().filter((one) => one !== undefined && one !== null && one !== false));
}

/** A term and its value, for a list of values; gives the row and the place of the value. */
export function pair(term, unit = "") {
  const value = h("dd", {}, "–");
  return { row: h("div", { class: "pair" }, h("dt", {}, term, unit && h("small", {}, ` ${unit}`)), value), value };
}

/** A field with its label. */
export function field(label, input, hint = "") {
  input.id ||= `f${(field.count = (field.count ?? 0) + 1)}`;
  return h("div", { class: "field" }, h("label", { for: input.id }, label), input, hint && h("small", {}, hint));
}

/** A list to choose from: [[value, text], ...]. */
export function choice(options, chosen, props = {}) {
  return h("select", props, ...options.map(([value, text]) =>
    h("option", { value, selected: String(value) === String(chosen) }, text)));
}

/** Hand a text to the browser as a file. */
export function save(name, text, type = "text/csv") {
  const address = URL.createObjectURL(new Blob([text], { type }));
  h("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 1000);
}
