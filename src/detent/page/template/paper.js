/* Draws the printed page: every character where it landed. print_charts.py says what was printed. */
(() => {
  "use strict";
  const paper = JSON.parse(document.getElementById("paper-data").textContent);

  const svgElement = (name, attributes, text) => {
    const element = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
    if (text !== undefined) element.textContent = text;
    return element;
  };

  /* One unit is 1/120 in. A space has no ink and is left out, so that leading spaces cannot collapse. */
  const drawLine = (svg, line, y, factor, limit) => {
    const bold = new Set(line.bold);
    const groups = { "": [], bold: [], off: [] };
    [...line.text].forEach((letter, index) => {
      if (letter.trim() === "") return;
      const kind = Math.abs(line.off[index]) > limit ? "off" : bold.has(index) ? "bold" : "";
      groups[kind].push([letter, (line.x[index] + (line.off[index] / 25400) * 120 * factor).toFixed(2)]);
    });
    for (const [kind, letters] of Object.entries(groups)) {
      if (!letters.length) continue;
      const x = letters.map((pair) => pair[1]).join(" ");
      const size = Math.min(line.w / 0.6, 19);
      svg.append(svgElement("text", { x, y, class: kind, "font-size": size }, letters.map((pair) => pair[0]).join("")));
    }
    const right = line.d > 0;
    const label = right ? line.n + " \u2192" : "\u2190 " + line.n;
    svg.append(svgElement("text", { x: -10, y, class: "gutter " + (right ? "right" : "left"), "text-anchor": "end" }, label));
  };

  const drawPaper = (state) => {
    const { pages, limit, columns, magnify } = paper;
    const page = pages[state.page];
    const factor = state.magnified ? magnify : 1;
    const ys = page.lines.map((line) => line.y * 2.5);
    const top = Math.min(...ys) - 30, bottom = Math.max(...ys) + 20;
    const width = Math.max(columns, 600) + 100;
    const svg = svgElement("svg", { viewBox: `-75 ${top} ${width} ${bottom - top}`, role: "img", "aria-label": "the printed page" });
    if (state.magnified)
      for (let x = 0; x <= columns; x += 12) svg.append(svgElement("line", { x1: x, x2: x, y1: top, y2: bottom, class: "grid" }));
    page.lines.forEach((line, index) => drawLine(svg, line, ys[index], factor, limit));
    state.holder.replaceChildren(svg);
    if (state.label) state.label.textContent = `page ${page.number} of ${pages.length + paper.leftOut}`;
  };

  const setUpPaper = () => {
    const holder = document.getElementById("paper");
    if (!holder) return;
    const find = (id) => document.getElementById(id);
    const state = { holder, page: 0, magnified: false, label: find("page-label") };
    const press = (button, magnified) => button && button.addEventListener("click", () => {
      state.magnified = magnified;
      find("true-size").setAttribute("aria-pressed", String(!magnified));
      find("magnified").setAttribute("aria-pressed", String(magnified));
      drawPaper(state);
    });
    press(find("true-size"), false);
    press(find("magnified"), true);
    const turn = (step) => () => {
      state.page = Math.min(Math.max(state.page + step, 0), paper.pages.length - 1);
      find("page-back").disabled = state.page === 0;
      find("page-next").disabled = state.page === paper.pages.length - 1;
      drawPaper(state);
    };
    if (find("page-next")) {
      find("page-next").addEventListener("click", turn(1));
      find("page-back").addEventListener("click", turn(-1));
    }
    drawPaper(state);
  };

  setUpPaper();
})();
