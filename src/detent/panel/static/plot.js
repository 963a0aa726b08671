// The one chart of the panel: uPlot, with a scale per unit, an overlay and two cursors.

import { h } from "./dom.js";

const HEIGHT = 320;
const DASHES = [[], [], [], [], [8, 4], [8, 4], [8, 4], [8, 4]];

let loading = null;

/** uPlot is a plain script, the one of the reports. */
function load() {
  loading ??= new Promise((done, fail) => {
    document.head.append(h("script", { src: "/static/uPlot.iife.min.js", onload: () => done(window.uPlot), onerror: () => fail(new Error("uPlot is missing")) }));
  });
  return loading;
}

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

export class Plot {
  constructor(root) {
    this.root = root;
    this.series = [];
    this.cursors = [];
    this.onpick = () => {};
    this.frames = 0;
    this.size = new ResizeObserver(() => this.chart?.setSize({ width: root.clientWidth, height: HEIGHT }));
    this.size.observe(root);
    root.addEventListener("click", (event) => {
      const over = root.querySelector(".u-over")?.getBoundingClientRect();
      if (over?.width) this.onpick(Math.min(Math.max((event.clientX - over.left) / over.width, 0), 1));
    });
  }

  label(k) {
    const { name, unit } = this.series[k];
    return unit ? `${name} (${unit})` : name;
  }

  /** Choose what is drawn: [{name, unit}]. */
  show(series) {
    this.series = series;
    this.chart?.destroy();
    this.chart = null;
    this.build();
  }

  async build() {
    const uPlot = await load();
    const { series } = this;
    if (this.chart || this.isClosed) return;
    const units = [...new Set(series.map(({ unit }) => unit || "1"))];
    const ink = colour("--ink");
    const grid = { stroke: colour("--grid"), width: 1 };
    const line = ({ unit, name }, k, faint) => ({
      label: name, scale: unit || "1", stroke: colour(`--c${k}`), width: faint ? 1 : 1.5, dash: faint ? [2, 3] : DASHES[k],
      points: { show: false }, alpha: faint ? 0.6 : 1,
    });
    this.chart = new uPlot({
      width: this.root.clientWidth, height: HEIGHT, legend: { show: false }, pxAlign: 0,
      cursor: { drag: { x: false, y: false }, points: { show: false } },
      scales: { x: { time: false } },
      axes: [{ stroke: ink, grid, label: "time (s)", labelSize: 20 }, ...units.slice(0, 2).map((unit, k) => (
        { stroke: ink, grid: k ? { show: false } : grid, scale: unit, side: k ? 1 : 3, label: unit === "1" ? "" : unit, labelSize: 20, size: 62 }))],
      series: [{}, ...series.map((one, k) => line(one, k, false)), ...series.map((one, k) => line(one, k, true))],
      hooks: { draw: [(chart) => this.marks(chart)] },
    }, [[], ...series.map(() => []), ...series.map(() => [])], this.root);
    if (this.held) this.draw(...this.held);
  }

  /** Draw columns: time, then one for each channel; `reference`: the same channels of an older record. */
  draw(columns, reference, trigger) {
    this.held = [columns, reference, trigger];
    if (!this.chart || columns.length !== this.series.length + 1) return;
    const older = reference?.[0]?.length === columns[0].length ? reference : this.series.map(() => null);
    this.chart.setData([...columns, ...older.map((one) => one ?? [])]);
    this.frames += 1;
  }

  redraw() { this.chart?.redraw(false); }

  /** Trigger and cursors. */
  marks(chart) {
    const time = chart.data[0];
    if (!time.length) return;
    const { ctx, bbox } = chart;
    const at = (k, stroke, dash, text) => {
      const x = chart.valToPos(time[Math.min(k, time.length - 1)], "x", true);
      ctx.beginPath();
      ctx.setLineDash(dash);
      ctx.strokeStyle = ctx.fillStyle = stroke;
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
      ctx.fillText(text, x + 4, bbox.top + 14);
    };
    ctx.save();
    ctx.lineWidth = devicePixelRatio;
    ctx.font = `${13 * devicePixelRatio}px sans-serif`;
    if (this.held?.[2] < time.length - 1) at(this.held[2], colour("--soft"), [2, 4], "T");
    this.cursors.forEach((k, n) => at(k, colour("--ink"), [], "AB"[n]));
    ctx.restore();
  }

  close() {
    this.isClosed = true;
    this.size.disconnect();
    this.chart?.destroy();
  }
}
