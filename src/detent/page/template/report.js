/* Draws the charts that the page's data describes. Knows nothing about motors: chart.py says what there is to draw. */
(() => {
  "use strict";
  const data = JSON.parse(document.getElementById("report-data").textContent);
  const root = document.documentElement;
  const colour = (name) => getComputedStyle(root).getPropertyValue("--" + name).trim();
  const font = '12px system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif';
  const plots = new Map();

  /* ---- charts ---- */

  const eachSpan = (u, spans, draw) => {
    for (const [from, to] of spans) {
      const left = Math.max(u.valToPos(from, "x", true), u.bbox.left);
      const right = Math.min(u.valToPos(to, "x", true), u.bbox.left + u.bbox.width);
      if (right > left) draw(left, right - left);
    }
  };

  /* Bands lie under grid and curves. */
  const drawBands = (chart) => (u) => {
    for (const band of chart.bands || []) {
      u.ctx.fillStyle = colour("band-" + band.colour);
      eachSpan(u, band.spans, (left, width) => u.ctx.fillRect(left, u.bbox.top, width, u.bbox.height));
    }
  };

  /* Their names stand at the foot, where curves seldom are, and only where they fit. */
  const drawBandNames = (u, chart) => {
    const { ctx, bbox } = u;
    const scale = devicePixelRatio;
    ctx.font = font.replace("12px", 11 * scale + "px");
    ctx.fillStyle = colour("soft");
    ctx.textAlign = "center";
    ctx.textBaseline = "alphabetic";
    for (const { spans, label } of chart.bands || [])
      eachSpan(u, spans, (left, width) => {
        const foot = bbox.top + bbox.height - 5 * scale;
        if (ctx.measureText(label).width < width - 6 * scale) ctx.fillText(label, left + width / 2, foot);
      });
  };

  const verticalLine = (u, x, dash, strokeStyle) => {
    const { ctx, bbox } = u;
    const at = Math.round(u.valToPos(x, "x", true));
    if (at < bbox.left - 1 || at > bbox.left + bbox.width + 1) return null;
    ctx.strokeStyle = strokeStyle;
    ctx.lineWidth = devicePixelRatio;
    ctx.setLineDash(dash.map((d) => d * devicePixelRatio));
    ctx.beginPath();
    ctx.moveTo(at, bbox.top);
    ctx.lineTo(at, bbox.top + bbox.height);
    ctx.stroke();
    ctx.setLineDash([]);
    return at;
  };

  /* Numbered events: the same numbers stand in the table below the figure. */
  const drawEvents = (u, chart) => {
    const { ctx, bbox } = u;
    const scale = devicePixelRatio;
    const radius = 8 * scale;
    let last = -Infinity, level = 0;
    (chart.events || []).forEach((x, index) => {
      const at = verticalLine(u, x, [2, 3], colour("soft"));
      if (at === null || !chart.numbered) return;
      level = at - last < 2.2 * radius ? level + 1 : 0;
      last = at;
      const inside = Math.min(Math.max(at, bbox.left + radius), bbox.left + bbox.width - radius);
      const y = bbox.top + radius + 2 * scale + level * 2.2 * radius;
      ctx.fillStyle = colour("ink");
      ctx.beginPath();
      ctx.arc(inside, y, radius, 0, 2 * Math.PI);
      ctx.fill();
      ctx.fillStyle = colour("card");
      ctx.textAlign = "center";
      ctx.textBaseline = "middle";
      ctx.font = "bold " + font.replace("12px", 11 * scale + "px");
      ctx.fillText(String(index + 1), inside, y + scale / 2);
    });
  };

  const drawLevels = (u, chart) => {
    const { ctx, bbox } = u;
    const scale = devicePixelRatio;
    ctx.font = font.replace("12px", 11 * scale + "px");
    ctx.textBaseline = "alphabetic";
    for (const { y, label } of chart.levels || []) {
      const at = Math.round(u.valToPos(y, "y", true));
      ctx.strokeStyle = colour("soft");
      ctx.lineWidth = scale;
      ctx.setLineDash([2 * scale, 3 * scale]);
      ctx.beginPath();
      ctx.moveTo(bbox.left, at);
      ctx.lineTo(bbox.left + bbox.width, at);
      ctx.stroke();
      ctx.setLineDash([]);
      if (!label) continue;
      const right = bbox.left + bbox.width - 4 * scale;
      const width = ctx.measureText(label).width;
      ctx.fillStyle = colour("card");
      ctx.fillRect(right - width - 3 * scale, at - 16 * scale, width + 6 * scale, 14 * scale);
      ctx.fillStyle = colour("ink");
      ctx.textAlign = "right";
      ctx.fillText(label, right, at - 5 * scale);
    }
    for (const { x, label } of chart.marks || []) {
      const at = verticalLine(u, x, [6, 4], colour("bad"));
      if (at === null) continue;
      ctx.fillStyle = colour("bad");
      const fits = at + 4 * scale + ctx.measureText(label).width <= bbox.left + bbox.width;
      ctx.textAlign = x > 0 && fits ? "left" : "right";
      ctx.fillText(label, at + (x > 0 && fits ? 4 : -4) * scale, bbox.top + 12 * scale);
    }
  };

  /* As much of a text as fits into a width. */
  const fitted = (ctx, text, width) => {
    if (ctx.measureText(text).width <= width) return text;
    let part = text;
    while (part && ctx.measureText(part + "\u2026").width > width) part = part.slice(0, -1);
    return part && part + "\u2026";
  };

  /* Lanes of bars: a strong edge where each begins, its name where there is room. */
  const drawLanes = (u, chart) => {
    const { ctx, bbox } = u;
    const scale = devicePixelRatio;
    const row = bbox.height / chart.lanes.length;
    ctx.font = font.replace("12px", 11 * scale + "px");
    ctx.textAlign = "left";
    ctx.textBaseline = "middle";
    chart.lanes.forEach((lane, index) => {
      const top = bbox.top + (index + 0.12) * row;
      for (const [from, to, name] of lane.bars)
        eachSpan(u, [[from, to]], (left, width) => {
          ctx.fillStyle = colour(lane.colour);
          ctx.globalAlpha = 0.3;
          ctx.fillRect(left, top, Math.max(width, scale), 0.76 * row);
          ctx.globalAlpha = 1;
          ctx.fillRect(left, top, Math.min(width, 3 * scale), 0.76 * row);
          if (width < 14 * scale) return;
          ctx.fillStyle = colour("ink");
          ctx.fillText(fitted(ctx, name, width - 9 * scale), left + 6 * scale, top + 0.4 * row);
        });
    });
  };

  /* Curves that go to and fro, at places of their own. */
  const drawLoops = (u, chart) => {
    const { ctx } = u;
    for (const loop of chart.loops) {
      ctx.strokeStyle = colour(loop.colour);
      ctx.lineWidth = loop.width * devicePixelRatio;
      ctx.lineJoin = "round";
      ctx.beginPath();
      loop.x.forEach((x, index) => ctx.lineTo(u.valToPos(x, "x", true), u.valToPos(loop.y[index], "y", true)));
      ctx.stroke();
    }
  };

  /* What the bars under the cursor are. */
  const barsAt = (chart, x) => {
    const under = chart.lanes.flatMap((lane) => lane.bars.filter((bar) => bar[0] <= x && x < bar[1]));
    return under.map((bar) => bar[3]).join(" \u00b7 ") || "\u2013";
  };

  const drawOver = (chart) => (u) => {
    u.ctx.save();
    u.ctx.beginPath();
    u.ctx.rect(u.bbox.left - 1, u.bbox.top, u.bbox.width + 2, u.bbox.height);
    u.ctx.clip();
    if (chart.zero && u.scales.y.min < 0 && u.scales.y.max > 0) {
      const at = Math.round(u.valToPos(0, "y", true));
      u.ctx.strokeStyle = colour("muted");
      u.ctx.lineWidth = devicePixelRatio;
      u.ctx.beginPath();
      u.ctx.moveTo(u.bbox.left, at);
      u.ctx.lineTo(u.bbox.left + u.bbox.width, at);
      u.ctx.stroke();
    }
    if (chart.lanes) drawLanes(u, chart);
    if (chart.loops) drawLoops(u, chart);
    drawBandNames(u, chart);
    drawLevels(u, chart);
    drawEvents(u, chart);
    u.ctx.restore();
  };

  const seriesOf = (one, log) => {
    const stroke = colour(one.colour);
    const series = { label: one.label, stroke, width: one.width || 1.5, dash: one.dash, points: { show: false } };
    if (log) series.value = (u, value) => (value == null ? "\u2013" : written(value));
    if (one.step) series.paths = uPlot.paths.stepped({ align: 1 });
    if (one.fill) series.fill = stroke + "2b";
    if (one.bars !== undefined) {
      /* On both sides of the middle of a bin, or alone across it. */
      series.paths = uPlot.paths.bars({ size: [one.bars ? 0.46 : 0.92, 60], align: one.bars, gap: 0 });
      series.fill = stroke;
      series.width = 0;
    }
    if (one.points) {
      series.paths = () => null;
      series.points = { show: true, size: one.points, fill: colour("card"), stroke, width: 2 };
    }
    return series;
  };

  const plain = new Intl.NumberFormat("en", { maximumFractionDigits: 6 });
  const tiny = new Intl.NumberFormat("en", { notation: "scientific", maximumFractionDigits: 3 });
  const written = (value) => (value !== 0 && Math.abs(value) < 1e-5 ? tiny : plain)
    .format(value).replaceAll(",", "\u202f").replaceAll("-", "\u2212");

  const axisOf = (label, size, space) => ({
    label: label || undefined, labelSize: 20, labelFont: font, size, space, font, stroke: colour("soft"),
    values: (u, ticks) => ticks.map((tick) => (tick === null ? "" : written(tick))),
    grid: { stroke: colour("grid"), width: 1 }, ticks: { stroke: colour("grid"), width: 1, size: 4 },
  });

  /* As wide as the axis of a chart with curves and its label, so that both stand above one another. */
  const laneAxisOf = (chart) => ({
    ...axisOf(null, 74, 26),
    splits: () => chart.lanes.map((lane, index) => chart.lanes.length - index - 0.5),
    values: (u) => {
      u.ctx.font = font.replace("12px", 12 * devicePixelRatio + "px");
      return chart.lanes.map((lane) => fitted(u.ctx, lane.label, 64 * devicePixelRatio));
    },
    grid: { show: false }, ticks: { show: false },
  });

  const laneSeriesOf = (chart) => ({
    label: " ", paths: () => null, points: { show: false }, value: (u, y, series, index) => barsAt(chart, chart.x[index]),
  });

  /* Linear or logarithmic. */
  const distrOf = (chart, axis) => ((chart.log || "").includes(axis) ? 3 : 1);

  /* Phases in parts of a quarter turn. */
  const valueAxisOf = (chart) => ({
    ...axisOf(chart.yLabel, chart.log ? 64 : 54, 26),
    ...(chart.log && /\[deg\]/.test(chart.yLabel) && { incrs: [1, 5, 15, 45, 90, 180, 360, 720, 1800, 3600] }),
  });

  const optionsOf = (chart, holder) => ({
    width: holder.clientWidth, height: chart.height, padding: [10, 20, 0, 0],
    scales: {
      // A logarithmic axis reaches as far as its values, not to the next decade.
      x: { time: false, distr: distrOf(chart, "x"), ...(distrOf(chart, "x") === 3 && { range: (_, low, high) => [low, high] }) },
      y: { distr: distrOf(chart, "y"), ...(chart.yRange && { range: () => chart.yRange }) },
    },
    axes: [axisOf(chart.foot === false ? null : chart.xLabel, 28, 60), chart.lanes ? laneAxisOf(chart) : valueAxisOf(chart)],
    series: [{ label: (/\[(.*)\]/.exec(chart.xLabel) || ["", ""])[1] }].concat(chart.lanes ? laneSeriesOf(chart) : chart.series.map((one) => seriesOf(one, chart.log))),
    legend: { live: true, markers: { width: 0 } },
    cursor: {
      sync: chart.sync ? { key: chart.sync } : undefined, y: false, drag: { x: true, y: false },
      points: { size: 6, show: !chart.lanes },
    },
    hooks: {
      drawClear: [drawBands(chart)], draw: [drawOver(chart)],
      setCursor: [(u) => holder.classList.toggle("live", u.cursor.left >= 0)],
    },
  });

  /* The legend shows what the curve looks like: a line, dashes, a ring or a bar. */
  const styleMarker = (marker, one) => {
    if (!one) return;
    const kind = one.points ? "ring" : one.bars !== undefined ? "bar" : one.dash ? "dashes" : "line";
    marker.className = "u-marker " + kind;
    marker.style.color = colour(one.colour);
  };

  const drawChart = (chart) => {
    const holder = document.getElementById(chart.id);
    if (!holder) return;
    const old = plots.get(chart.id);
    if (old) old.destroy();
    holder.classList.toggle("lanes", !!chart.lanes);
    const columns = [chart.x].concat(chart.lanes ? [chart.x.map(() => 0)] : chart.series.map((one) => one.y));
    plots.set(chart.id, new uPlot(optionsOf(chart, holder), columns, holder));
    holder.querySelectorAll(".u-legend .u-marker").forEach((marker, index) => styleMarker(marker, chart.series[index - 1]));
  };
  const drawCharts = () => data.charts.forEach(drawChart);

  const fit = (holder) => {
    const plot = plots.get(holder.id);
    const width = holder.clientWidth;
    if (plot && Math.abs(plot.width - width) > 1) plot.setSize({ width, height: plot.height });
  };
  const watcher = new ResizeObserver((entries) => entries.forEach((entry) => fit(entry.target)));
  document.querySelectorAll(".chart").forEach((holder) => watcher.observe(holder));

  /* ---- theme and printer ---- */

  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawCharts);
  const forPrint = (on) => () => {
    root.toggleAttribute("data-print", on);
    drawCharts();
    if (on) plots.forEach((plot) => plot.setSize({ width: Math.min(plot.width, 660), height: plot.height }));
  };
  addEventListener("beforeprint", forPrint(true));
  addEventListener("afterprint", forPrint(false));

  drawCharts();
})();
