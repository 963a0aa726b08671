// One channel over another, such as the error over the position: the same record, overlay and cursors as over time.

/** Two columns of a record; null where an overlay has another length. */
const pair = ({ axes }, columns) => axes.map((k) => columns[k]);

/** A path through all samples, in their order in time. */
function through(uPlot) {
  return (chart, number) => {
    uPlot.orient(chart, number, (series, _x, _y, scaleX, scaleY, toX, toY, left, top, wide, high) => {
      const [xs, ys] = chart.data[number];
      const { ctx, bbox } = chart;
      ctx.save();
      ctx.beginPath();
      ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
      ctx.clip();
      ctx.beginPath();
      for (let k = 0; k < xs.length; k += 1) ctx.lineTo(toX(xs[k], scaleX, wide, left), toY(ys[k], scaleY, high, top));
      ctx.strokeStyle = series.stroke();
      ctx.lineWidth = (number === 1 ? 1.5 : 1) * devicePixelRatio;
      ctx.setLineDash(number === 1 ? [] : [2 * devicePixelRatio, 3 * devicePixelRatio]);
      ctx.stroke();
      ctx.restore();
    });
    return null;
  };
}

/** Room around all values; a channel that stands still is a line in the middle. */
function range(_chart, low, high) {
  if (low === null || high === null || !Number.isFinite(high - low)) return [0, 1];
  const room = 0.05 * (high - low) || 0.05 * Math.abs(high) || 1;
  return [low - room, high + room];
}

export const across = {
  options(uPlot, plot, ink, grid, colour) {
    const [x, y] = plot.axes.map((k) => plot.label(k));
    const facets = [{ scale: "x", auto: true }, { scale: "y", auto: true }];
    const line = { facets, stroke: colour(`--c${plot.axes[1]}`), paths: through(uPlot) };
    return {
      mode: 2, scales: { x: { time: false, auto: true, range }, y: { auto: true, range } },
      axes: [{ stroke: ink, grid, label: x, labelSize: 20 }, { stroke: ink, grid, label: y, labelSize: 20, size: 62 }], series: [{}, line, line],
    };
  },

  data(plot) {
    const [columns, reference] = plot.held;
    const older = reference?.[0]?.length === columns[0].length ? pair(plot, reference) : [[], []];
    return [null, pair(plot, columns.slice(1)), older];
  },

  /** Where a sample lies on the canvas. */
  point(plot, chart, row) {
    const [x, y] = pair(plot, plot.held[0].slice(1));
    return [chart.valToPos(x[row], "x", true), chart.valToPos(y[row], "y", true)];
  },

  /** Which sample lies nearest to a place of the chart, as a share of the record. */
  nearest({ axes, held, chart }, left, top) {
    const [x, y] = axes.map((k) => held[0][k + 1]);
    let [best, least] = [0, Infinity];
    for (let k = 0; k < x.length; k += 1) {
      const far = (chart.valToPos(x[k], "x") - left) ** 2 + (chart.valToPos(y[k], "y") - top) ** 2;
      if (far < least) [best, least] = [k, far];
    }
    return best / Math.max(1, x.length - 1);
  },
};
