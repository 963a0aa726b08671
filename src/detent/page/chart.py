"""Charts as data for the script of a page: what to draw, in the units people read.

A chart is one plot area. It is described completely, so that the script knows nothing about axes and motors.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isfinite
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from detent.page.parts import Event, Numbers

Chart = dict[str, Any]  # one plot area, as template/report.js reads it; its "id" is that of the element it is drawn in
POINTS = 3000  # points of one curve: three per pixel of a wide screen

LANE_HEIGHT = 26  # height of a lane [px]
FOOT_HEIGHT = 44  # height of what is above and below the lanes [px]
BINS = 40  # of values that are spread
PLACES = 600  # places at which the cursor stops besides the ends of the bars of lanes

SCALES: dict[str, tuple[float, int]] = {"ms": (1e3, 3), "s": (1.0, 5)}
"""Per unit of time: factor from seconds, and digits that a chart keeps."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """One curve of a plot area."""

    label: str  # as in the legend
    colour: str  # name of a colour of template/report.css: "speed", "drive", "current", "right", "left", "ink", "muted"
    y: Numbers  # values in the unit of the plot area, shape (n,); NaN is a gap
    digits: int = 3  # digits kept after the point
    width: float | None = None  # width of the line [px]; 1.5 unless given
    dash: tuple[int, int] | None = None  # length of dash and gap [px]; drawn through unless given
    step: bool = False  # each value holds until the next one, as the outputs of a computer do
    rings: int | None = None  # diameter [px] of rings drawn at the points, instead of a line
    # rows of a long recording that are chosen for this curve's sake; 0 if it may use those of the others
    thin: int = POINTS
    fill: bool = False  # tint the ground between the curve and zero


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """One plot area: its curves and what stands behind them."""

    name: str  # id of the element it is drawn in, one of its kind on the page
    label: str  # of the vertical axis, with unit: "speed [in/s]"
    curves: Sequence[Curve]  # all of one length; the first is drawn first
    height: int = 220  # height [px]
    zero: bool = False  # draw a line at zero where it is in sight
    # lower and upper end of the vertical axis; what the curves need unless given
    span: tuple[float, float] | None = None
    levels: Sequence[tuple[float, str]] = ()  # values marked by a dashed line, with their names
    title: str = ""  # above the plot area, where a figure has several
    about: str = ""  # what it shows, for those who cannot see it; both axes' labels unless given


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """Stretches of time with a ground of their own."""

    label: str  # written at the foot of each stretch that has room for it
    colour: Literal["good", "brake"]  # name of the ground
    spans: Sequence[tuple[float, float]]  # begin and end of each stretch [s]


@dataclass(frozen=True, slots=True, kw_only=True)
class Timeline:
    """Time below one or more plot areas, and what happens at its moments."""

    name: str  # plot areas with the same name share their cursor
    t: Numbers  # moments of the curves' values [s], rising, shape (n,)
    label: str = "time"  # what it counts from: "time since the move began"
    unit: Literal["ms", "s"] = "ms"  # unit in which the page shows it
    bands: Sequence[Band] = ()  # behind every plot area
    events: Sequence[Event] = ()  # drawn across every plot area, numbered in the first one as in `page.event_table`


@dataclass(frozen=True, slots=True, kw_only=True)
class Heap:
    """One group of a histogram."""

    label: str  # and colour: as of a curve
    colour: str
    at: Numbers  # places on the horizontal axis, in its unit, shape (n,)
    counts: Numbers  # how often each place occurs, shape (n,)


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """A curve whose places need not rise."""

    label: str  # and colour: as of a curve; loops of one label have one line in the legend
    colour: str
    x: Numbers  # and y: finite places and values in the units of the chart, shape (n,)
    y: Numbers
    width: float = 2.0  # width of the line [px]
    digits: int = 3  # digits of values kept after the point


@dataclass(frozen=True, slots=True)
class Bar:
    """A stretch of the horizontal axis."""

    begin: float  # and end: its ends, in the unit of the axis
    end: float
    short: str  # written inside where there is room
    text: str  # told below the chart while the cursor is over it


@dataclass(frozen=True, slots=True)
class Lane:
    """Bars of one kind."""

    label: str  # name of the lane; about ten characters have room beside it
    colour: str  # as of a curve
    bars: Sequence[Bar]  # in any order


def spans_of(t: Numbers, on: Numbers) -> list[tuple[float, float]]:
    """Find the stretches of time in which something holds [s].

    >>> import numpy as np
    >>> spans_of(np.arange(6.0), np.array([0, 1, 1, 0, 0, 1]))
    [(1.0, 3.0), (5.0, 5.0)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate(([0], np.asarray(on, dtype=np.int8), [0]))))
    last = len(t) - 1
    return [(float(t[a]), float(t[min(b, last)])) for a, b in edges.reshape(-1, 2).tolist()]


def line_chart(panel: Panel, x: Numbers, label: str, *, digits: int = 4, log: Literal["", "x", "xy"] = "") -> Chart:
    """Draw one plot area over any horizontal axis, every row of it; `log` names the axes that are logarithmic."""
    chart = _chart(panel, slice(None)) | {"x": rounded(x, digits), "xLabel": label}
    return chart | ({"log": log} if log else {})


def loop_chart(panel: Panel, x: Numbers, label: str, loops: Sequence[Loop], *, digits: int = 4) -> Chart:
    """Draw curves over any horizontal axis, and loops above them."""
    chart = line_chart(panel, x, label, digits=digits)
    named = {loop.label: loop for loop in loops}
    nothing = np.full(len(x), np.nan)
    legend = [Curve(label=loop.label, colour=loop.colour, width=loop.width, y=nothing) for loop in named.values()]
    chart["series"] += line_chart(Panel(name="", label="", curves=legend), x, label)["series"]
    chart["loops"] = [
        {"colour": loop.colour, "width": loop.width, "x": rounded(loop.x, digits), "y": rounded(loop.y, loop.digits)}
        for loop in loops
    ]
    return chart


def lane_chart(name: str, lanes: Sequence[Lane], span: tuple[float, float], label: str, *, sync: str = "") -> Chart:
    """Draw lanes above one another."""
    shown: list[Chart] = []
    ends: list[float] = []
    for lane in lanes:
        bars = [bar for bar in lane.bars if bar.end > span[0] and bar.begin < span[1] and bar.end > bar.begin]
        told = [[round(bar.begin, 4), round(bar.end, 4), bar.short, bar.text] for bar in bars]
        shown.append({"label": lane.label, "colour": lane.colour, "bars": told})
        ends += [place for bar in bars for place in (bar.begin, bar.end)]
    x = np.unique(np.clip(np.concatenate((np.linspace(*span, PLACES), ends)), *span))
    chart: Chart = {
        "id": name,
        "x": rounded(x, 4),
        "xLabel": label,
        "height": LANE_HEIGHT * len(lanes) + FOOT_HEIGHT + (0 if sync else 20),
        "yRange": [0, len(lanes)],
        "lanes": shown,
        "series": [],
    }
    return chart | ({"sync": sync, "foot": False} if sync else {})


def time_charts(timeline: Timeline, panels: Sequence[Panel]) -> list[Chart]:
    """Draw plot areas above one another over the same time, with as many rows as a screen can show."""
    scale, digits = SCALES[timeline.unit]
    chosen = [thin_indices(curve.y, curve.thin) for panel in panels for curve in panel.curves if curve.thin]
    kept = np.unique(np.concatenate(chosen or [thin_indices(timeline.t, POINTS)]))
    bands: list[Chart] = []
    for band in timeline.bands:
        spans = [[round(moment * scale, digits) for moment in span] for span in band.spans]
        bands.append({"spans": spans, "colour": band.colour, "label": band.label})
    shared: Chart = {
        "x": rounded(timeline.t[kept] * scale, digits),
        "xLabel": f"{timeline.label} [{timeline.unit}]",
        "sync": timeline.name,
        "bands": bands,
        "events": [round(event.t * scale, digits + 1) for event in timeline.events],
    }
    charts = [_chart(panel, kept) | shared for panel in panels]
    charts[0]["numbered"] = True
    for chart in charts[:-1]:
        chart["foot"] = False
    return charts


def histogram_chart(
    name: str, heaps: Sequence[Heap], labels: tuple[str, str], *, finest: float, limit: float = inf
) -> Chart:
    """Count values per bin, centred on zero, in one or two groups side by side."""
    seen = [float(np.abs(heap.at[heap.counts > 0]).max(initial=0.0)) for heap in heaps]
    largest = max(*seen, finest / 2)
    # Rounded up to 1, 2 or 5 times a power of ten.
    wanted, power = largest / 15, 10.0 ** np.floor(np.log10(largest / 15))
    nice = float(next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= wanted * 0.999))
    step = max(nice, finest)
    half = int(np.ceil(largest / step + 0.5))
    edges = (np.arange(-half, half + 2) - 0.5) * step
    sides = (0,) if len(heaps) == 1 else (1, -1)
    series = [
        {"label": heap.label, "colour": heap.colour, "bars": side,
         "y": np.histogram(heap.at, edges, weights=heap.counts)[0].astype(int).tolist()}
        for heap, side in zip(heaps, sides, strict=True)
    ]  # fmt: skip
    limits = [-limit, limit] if limit <= edges[-1] else []
    return {
        "id": name,
        "x": rounded((edges[:-1] + edges[1:]) / 2, 4),
        "xLabel": labels[0],
        "yLabel": labels[1],
        "height": 260,
        "zero": True,
        "marks": [{"x": round(value, 3), "label": "limit"} for value in limits],
        "series": series,
    }


def spread_chart(name: str, values: Numbers, labels: tuple[str, str], marks: Sequence[tuple[float, str]] = ()) -> Chart:
    """Count values per bin, from the least to the largest and the places that are marked."""
    ends = [float(values.min()), float(values.max()), *(place for place, _ in marks)]
    low, high = min(ends), max(ends)
    width = (high - low) / BINS or max(abs(low), 1.0) / BINS
    digits = max(0, 3 - int(np.floor(np.log10(width))))
    edges = low - 0.5 * width + width * np.arange(BINS + 2)
    counts = np.histogram(values, edges)[0].astype(int).tolist()
    return {
        "id": name,
        "x": rounded((edges[:-1] + edges[1:]) / 2, digits),
        "xLabel": labels[0],
        "yLabel": labels[1],
        "height": 220,
        "zero": True,
        "marks": [{"x": round(place, digits), "label": label} for place, label in marks],
        "series": [{"label": labels[1], "colour": "speed", "bars": 0, "y": counts}],
    }


def thin_indices(values: NDArray[Any], points: int) -> NDArray[np.intp]:
    """Choose rows that draw like all rows: the smallest and the largest of each of `points` / 2 equal stretches.

    >>> import numpy as np
    >>> spike = np.zeros(1000)
    >>> spike[617] = 5.0
    >>> 617 in thin_indices(spike, 20)
    True
    """
    rows = len(values)
    if rows <= points:
        return np.arange(rows, dtype=np.intp)
    bins = points // 2
    width = -(-rows // bins)
    # The last stretch is filled up with the last value, which may be chosen again: `unique` removes it.
    padded = np.pad(np.asarray(values, dtype=np.float64), (0, width * bins - rows), mode="edge").reshape(bins, width)
    first = np.arange(bins) * width
    low = first + np.where(np.isnan(padded), np.inf, padded).argmin(axis=1)
    high = first + np.where(np.isnan(padded), -np.inf, padded).argmax(axis=1)
    chosen = np.unique(np.concatenate(([0], low, high, [rows - 1])))
    return chosen[chosen < rows].astype(np.intp)


def rounded(values: Numbers, digits: int) -> list[float | None]:
    """Round numbers for a page; what is not finite becomes a gap.

    >>> import numpy as np
    >>> rounded(np.array([1.2345, np.nan]), 2)
    [1.23, None]
    """
    places: list[float] = np.round(np.asarray(values, dtype=np.float64), digits).tolist()
    return [value if isfinite(value) else None for value in places]


def _chart(panel: Panel, kept: Numbers | slice) -> Chart:
    chart: Chart = {"id": panel.name, "yLabel": panel.label, "height": panel.height}
    levels = [{"y": value, "label": label} for value, label in panel.levels]
    told: Chart = {"title": panel.title, "about": panel.about, "zero": panel.zero}
    told |= {"yRange": panel.span and list(panel.span), "levels": levels}
    given = {name: value for name, value in told.items() if value}
    series: list[Chart] = []
    for curve in panel.curves:
        look = {"width": curve.width, "dash": curve.dash and list(curve.dash), "points": curve.rings}
        look |= {"step": curve.step or None, "fill": curve.fill or None}
        one: Chart = {"label": curve.label, "colour": curve.colour}
        one |= {name: value for name, value in look.items() if value is not None}
        series.append(one | {"y": rounded(curve.y[kept], curve.digits)})
    return chart | given | {"series": series}
