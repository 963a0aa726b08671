"""Figures of a page as files: one PNG, SVG or PDF with the charts and tables that the page would show."""

import math
import textwrap
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from detent.files.text import check_target, lines_of, shown
from detent.page.chart import Chart
from detent.page.figure import Figure
from detent.page.plots import ABOVE, Axes, new_figure
from detent.page.table import Table
from detent.page.words import GAP

WIDTH = 10.0  # of the picture [in]
LETTERS = 125  # letters of a caption in one line
LINE = 0.19  # height of a line of text [in]
DOTS = 96.0  # dots of the page per inch

COLOURS = {
    "ink": "#17202a", "soft": "#5b6673", "grid": "#e8ebef", "good": "#0a7d55", "bad": "#b3261e", "warn": "#8a5a00",
    "right": "#0068b5", "left": "#c65102", "speed": "#0068b5", "drive": "#7a3e9d", "current": "#b3261e",
    "muted": "#8b96a3",
}  # fmt: skip
"""Those of template/report.css on white."""

BANDS = {"good": ("#0a7d55", 0.11), "brake": ("#d67814", 0.16)}

Part = tuple[float, Callable[[Any, Any], None]]  # height [in], and what draws it into a place of the picture


def draw_figures(figures: Sequence[Figure], path: str | Path, *, force: bool = False) -> None:
    """Draw figures above one another into a file; DetentError if its suffix or place will not do."""
    path = check_target(path, force=force)
    parts = [part for figure in figures if figure for part in _parts(figure)]
    heights = [height for height, _ in parts]
    with new_figure(path, WIDTH, sum(heights) + 0.3, force=force) as canvas:
        grid = canvas.add_gridspec(len(parts), 1, height_ratios=heights)
        for place, (_, draw) in zip(grid, parts, strict=True):
            draw(canvas, place)


def _parts(figure: Figure) -> list[Part]:
    """What a figure is made of, from top to bottom."""
    caption = textwrap.wrap(plain(figure.caption), LETTERS)
    parts: list[Part] = [((len(caption) + 1.2) * LINE, lambda canvas, at: _write(canvas, at, figure.title, caption))]
    groups = [figure.charts] if figure.beside and figure.charts else [[chart] for chart in figure.charts]
    for group in groups:
        heights = [chart["height"] / DOTS + (0.0 if chart.get("foot") is False else 0.2) for chart in group]
        parts.append((max(heights), partial(_draw_beside, group)))
    tables = [table for table in (figure.table, figure.event_table) if table]
    return parts + [((len(table.rows) + 2.5) * 1.4 * LINE, partial(_draw_table, table)) for table in tables]


def plain(text: str) -> str:
    """Text without markup, as it may be shown, and without narrow spaces, which few fonts have."""
    bare = text.striptags() if isinstance(text, Markup) else text
    return shown(bare.replace(GAP, " "))


def _write(canvas: Any, at: Any, title: str, caption: Sequence[str]) -> None:
    area = canvas.add_subplot(at)
    area.axis("off")
    area.set_title(plain(title), fontsize=11)
    area.text(0.0, 1.0, "\n".join(caption), transform=area.transAxes, va="top", fontsize=8.5, color=COLOURS["soft"])


def _draw_table(table: Table, canvas: Any, at: Any) -> None:
    area: Axes = canvas.add_subplot(at)
    area.axis("off")
    rows = [[cell for cell, _ in table.cells(row)] for row in table.rows]
    texts = [["\n".join(textwrap.wrap(plain(cell.text), 30)) for cell in row] for row in rows]
    heads = ["\n".join(textwrap.wrap(plain(title), 12)) for title, _ in table.heads]
    lengths = [max(len(line) for text in column for line in (lines_of(text) or [""])) + 2
               for column in zip(heads, *texts, strict=True)]  # fmt: skip
    widths = [length / sum(lengths) for length in lengths]
    drawn = area.table(texts, colLabels=heads, colWidths=widths, loc="upper center")
    drawn.auto_set_font_size(value=False)
    drawn.set_fontsize(min(9.0, 1150.0 / sum(lengths)))
    boxes: dict[tuple[int, int], Any] = drawn.get_celld()
    for (row, column), box in boxes.items():
        lines = 1 + max(text.count("\n") for text in (texts[row - 1] if row else heads))
        box.set_height((0.6 + 0.8 * lines) / (1.4 * (len(rows) + 2.5)))
        box.set_edgecolor(COLOURS["grid"])
        box.PAD = 0.3 / max(lengths[column], 1)
        box.set_text_props(ha="right" if table.heads[column][1] else "left")
        if row == 0:
            box.set_text_props(color=COLOURS["soft"])
        elif rows[row - 1][column].over:
            box.set_text_props(color=COLOURS["bad"], weight="bold")


# ---- charts


def _draw_beside(charts: Sequence[Chart], canvas: Any, at: Any) -> None:
    for place, chart in zip(at.subgridspec(1, len(charts)), charts, strict=True):
        draw_chart(canvas.add_subplot(place), chart)


def draw_chart(area: Axes, chart: Chart) -> None:
    """Draw one plot area as template/report.js does."""
    x = _floats(chart["x"])
    for band in chart.get("bands", ()):
        _draw_band(area, band)
    for series in chart["series"]:
        _draw_series(area, x, series)
    for loop in chart.get("loops", ()):
        area.plot(loop["x"], loop["y"], color=COLOURS[loop["colour"]], linewidth=0.8 * loop["width"])
    if "lanes" in chart:
        _draw_lanes(area, chart["lanes"])
    if chart.get("zero"):
        area.axhline(0.0, color=COLOURS["muted"], linewidth=0.8)
    _draw_marks(area, chart)
    if len(x) > 1 and not any("bars" in series for series in chart["series"]):
        area.set_xlim(float(x[0]), float(x[-1]))
    for axis in chart.get("log", ""):
        area.set(**{f"{axis}scale": "log"})
        getattr(area, f"{axis}axis").set_major_formatter("{x:g}")
    if "yRange" in chart:
        area.set_ylim(*chart["yRange"])
    if "title" in chart:
        area.set_title(plain(chart["title"]), fontsize=9, loc="right")
    area.set_ylabel(plain(chart.get("yLabel", "")), fontsize=9)
    area.tick_params(labelsize=8)
    if chart.get("foot") is not False:
        area.set_xlabel(plain(chart["xLabel"]), fontsize=9)
    if any(series["label"] for series in chart["series"]):
        area.legend(**ABOVE, ncols=4, fontsize=8)


def _floats(values: Sequence[float | None]) -> Any:
    return np.array([math.nan if value is None else value for value in values], dtype=np.float64)


def _draw_band(area: Axes, band: Chart) -> None:
    colour, alpha = BANDS[band["colour"]]
    for begin, end in band["spans"]:
        area.axvspan(begin, end, color=colour, alpha=alpha, linewidth=0)
    if band["spans"]:
        begin, end = max(band["spans"], key=lambda span: span[1] - span[0])
        area.text((begin + end) / 2, 0.02, plain(band["label"]), transform=area.get_xaxis_transform(), ha="center",
                  fontsize=8, color=COLOURS["soft"], clip_on=True)  # fmt: skip


def _draw_series(area: Axes, x: Any, series: Chart) -> None:
    y, colour = _floats(series["y"]), COLOURS[series["colour"]]
    label = plain(series["label"])
    if "bars" in series:
        width = (x[1] - x[0]) if len(x) > 1 else 1.0
        side = series["bars"]
        # On both sides of the middle of a bin, or alone across it.
        centres, share = (x + 0.23 * side * width, 0.46) if side else (x, 0.92)
        area.bar(centres, y, share * width, color=colour, label=label)
        return
    if "points" in series:
        area.plot(x, y, "o", color=colour, markersize=0.7 * series["points"], fillstyle="none", label=label)
        return
    look: dict[str, Any] = {"color": colour, "linewidth": 0.8 * series.get("width", 1.5), "label": label}
    if "dash" in series:
        look["dashes"] = [0.6 * length for length in series["dash"]]
    style = "steps-post" if series.get("step") else "default"
    area.plot(x, y, drawstyle=style, **look)
    if series.get("fill"):
        area.fill_between(x, y, 0.0, color=colour, alpha=0.17, linewidth=0, step="post" if series.get("step") else None)


def _draw_lanes(area: Axes, lanes: Sequence[Chart]) -> None:
    """The first lane on top; a strong edge where each bar begins."""
    middles = [len(lanes) - k - 0.5 for k in range(len(lanes))]
    for middle, lane in zip(middles, lanes, strict=True):
        colour = COLOURS[lane["colour"]]
        for begin, end, short, _ in lane["bars"]:
            area.broken_barh([(begin, end - begin)], (middle - 0.38, 0.76), color=colour, alpha=0.3)
            area.plot([begin, begin], [middle - 0.38, middle + 0.38], color=colour, linewidth=2)
            area.text(begin, middle, f" {plain(short)}", va="center", fontsize=7, clip_on=True)
    area.set_yticks(middles, [plain(lane["label"]) for lane in lanes])
    area.grid(visible=False, axis="y")


def _draw_marks(area: Axes, chart: Chart) -> None:
    """Levels, limits, and events with the numbers that they have in the table below."""
    for level in chart.get("levels", ()):
        area.axhline(level["y"], color=COLOURS["soft"], linewidth=0.8, linestyle="--")
        area.annotate(plain(level["label"]), (1.0, level["y"]), (-4, 2), xycoords=area.get_yaxis_transform(),
                      textcoords="offset points", ha="right", fontsize=8)  # fmt: skip
    for mark in chart.get("marks", ()):
        area.axvline(mark["x"], color=COLOURS["bad"], linewidth=0.8, linestyle="--")
        area.annotate(plain(mark["label"]), (mark["x"], 1.0), (3, -9), xycoords=area.get_xaxis_transform(),
                      textcoords="offset points", fontsize=8, color=COLOURS["bad"])  # fmt: skip
    close, level, before = 0.03 * (chart["x"][-1] - chart["x"][0]), 0, -math.inf
    for index, moment in enumerate(chart.get("events", ()), 1):
        area.axvline(moment, color=COLOURS["soft"], linewidth=0.8, linestyle=":")
        if not chart.get("numbered"):
            continue
        level, before = level + 1 if moment - before < close else 0, moment
        area.annotate(str(index), (moment, 1.0), (0, -7 - 14 * level), xycoords=area.get_xaxis_transform(),
                      textcoords="offset points", ha="center", va="center", fontsize=7, color="white", weight="bold",
                      bbox={"boxstyle": "circle,pad=0.25", "color": COLOURS["ink"]}, annotation_clip=True)  # fmt: skip
