// The one chart of the panel: uPlot, with a scale per unit, an overlay and two cursors; over time, or one over another.

import { h } from "./dom.js";
import { across } from "./across.js";

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
    this.axes = null; // [x, y]: numbers of the channels that lie across; null: all over time
    this.onpick = () => {};
    this.frames = 0;
    this.size = new ResizeObserver(() => this.chart?.setSize({ width: root.clientWidth, height: HEIGHT }));
    this.size.observe(root);
    root.addEventListener("click", (event) => {
      const over = root.querySelector(".u-over")?.getBoundingClientRect();
      if (!over?.width) return;
      const nearest = this.axes ? across.nearest(this, event.clientX - over.left, event.clientY - over.top) : (event.clientX - over.left) / over.width;
      this.onpick(Math.min(Math.max(nearest, 0), 1));
    });
  }

  label(k) {
    const { name, unit } = this.series[k];
    return unit ? `${name} (${unit})` : name;
  }

  /** Choose what is drawn: [{name, unit}]; `axes`: numbers of the two that lie across, or null. */
  show(series, axes = null) {
    [this.series, this.axes] = [series, axes];
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
    const common = { width: this.root.clientWidth, height: HEIGHT, legend: { show: false }, pxAlign: 0,
      cursor: { drag: { x: false, y: false }, points: { show: false } }, hooks: { draw: [(chart) => this.marks(chart)] } };
    if (this.axes) {
      this.chart = new uPlot({ ...common, ...across.options(uPlot, this, ink, grid, colour) }, [null, [[], []], [[], []]], this.root);
      if (this.held) this.draw(...this.held);
      return;
    }
    const line = ({ unit, name }, k, faint) => ({
      label: name, scale: unit || "1", stroke: colour(`--c${k}`), width: faint ? 1 : 1.5, dash: faint ? [2, 3] : DASHES[k],
      points: { show: false }, alpha: faint ? 0.6 : 1,
    });
    this.chart = new uPlot({
      ...common,
      scales: { x: { time: false } },
      axes: [{ stroke: ink, grid, label: "time (s)", labelSize: 20 }, ...units.slice(0, 2).map((unit, k) => (
        { stroke: ink, grid: k ? { show: false } : grid, scale: unit, side: k ? 1 : 3, label: unit === "1" ? "" : unit, labelSize: 20, size: 62 }))],
      series: [{}, ...series.map((one, k) => line(one, k, false)), ...series.map((one, k) => line(one, k, true))],
    }, [[], ...series.map(() => []), ...series.map(() => [])], this.root);
    if (this.held) this.draw(...this.held);
  }

  /** Draw columns: time, then one for each channel; `reference`: the same channels of an older record. */
  draw(columns, reference, trigger) {
    this.held = [columns, reference, trigger];
    if (!this.chart || columns.length !== this.series.length + 1) return;
    if (this.axes) this.chart.setData(across.data(this));
    const older = reference?.[0]?.length === columns[0].length ? reference : this.series.map(() => null);
    if (!this.axes) this.chart.setData([...columns, ...older.map((one) => one ?? [])]);
    this.frames += 1;
  }

  redraw() { this.chart?.redraw(false); }

  /** Trigger and cursors. */
  marks(chart) {
    const time = this.held?.[0][0] ?? [];
    if (!time.length) return;
    const { ctx, bbox } = chart;
    const at = (k, stroke, dash, text) => {
      const row = Math.min(k, time.length - 1);
      const [x, y] = this.axes ? across.point(this, chart, row) : [chart.valToPos(time[row], "x", true), bbox.top + 14];
      ctx.beginPath();
      ctx.setLineDash(dash);
      ctx.strokeStyle = ctx.fillStyle = stroke;
      if (this.axes) ctx.arc(x, y, 5 * devicePixelRatio, 0, 2 * Math.PI);
      else {
        ctx.moveTo(x, bbox.top);
        ctx.lineTo(x, bbox.top + bbox.height);
      }
      ctx.stroke();
      ctx.fillText(text, x + (this.axes ? 8 * devicePixelRatio : 4), y);
    };
    ctx.save();
    ctx.lineWidth = devicePixelRatio;
    ctx.textAlign = "left";
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
