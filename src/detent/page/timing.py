"""Timing diagrams: the signals of clocked logic above one another over one axis of time, as data sheets draw them.

Flags are square waves, words are lozenges with their value inside, floats are small curves with their extremes beside
them. matplotlib is loaded when a diagram is drawn, never when this module is imported.
"""

import importlib
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np

from detent.errors import DetentError
from detent.files.text import check_target, shown
from detent.page.chart import thin_indices
from detent.page.plots import COLOURS, Axes, Figure, new_figure
from detent.record.waveforms import Waveform, Waveforms

MAX_SIGNALS = 40  # more rows than these do not fit a page that can be read
WIDTH = 11.0  # width of the figure [in]
ROW = 0.30  # height of one row of a flag or a word [in]
SLOT_FLOAT = 2.0
SLOT_HEADING = 1.0  # heights of the other rows, in rows
MARK_LINE = 0.8  # height of one line of marks, in rows
LEVEL = 0.62  # height of a square wave, in rows
SLANT = 0.003  # half of a lozenge's slanted end, as a part of the window
FINEST = 1 / 900  # part of the window below which two changes cannot be separated
POINTS = 4000  # points of one curve: more than a printed page resolves
DOC_WIDTH = 36  # characters in one of the two lines of a description
VALUE_SIZE = 7.5  # size of the values inside lozenges [pt]
INK = "#17202a"
GREY = "#6b7785"
BLOCK_COLOURS = (COLOURS[0], COLOURS[2], COLOURS[1], COLOURS[3])

Segment = tuple[float, float, int | None]
"""From, to, and the value between; None where changes follow too closely to be drawn."""


@dataclass(frozen=True)
class _Row:
    """A signal's place, in rows from the top, downwards < 0: middle of its row, lowest and highest it may use."""

    signal: Waveform
    middle: float
    low: float
    high: float
    colour: str


@dataclass(frozen=True)
class _Scale:
    """From picoseconds since power-on to what the axis of time shows."""

    begin: int
    unit_ps: int
    unit: str
    span: float

    def of(self, time: Any) -> Any:
        """Times since the begin of the diagram, in its unit."""
        return (time - self.begin) / self.unit_ps


_UNITS = ((10**12, "s"), (10**9, "ms"), (10**6, "µs"), (10**3, "ns"))


def plot_timing(
    waveforms: Waveforms,
    path: str | Path | None = None,
    *,
    marks: Sequence[tuple[int, str]] = (),
    force: bool = False,
) -> Figure:
    """Draw a timing diagram; its height grows with the signals, `marks` are moments since power-on [ps]."""
    path = None if path is None else check_target(path, force=force)
    count = len(waveforms.signals)
    if not 1 <= count <= MAX_SIGNALS:
        raise DetentError(
            f"{path or 'plot'}: got {count or 'no'} signals; expected: 1 to {MAX_SIGNALS}, so that the diagram can be "
            "read; name those that matter, or look at all of them in a VCD file"
        )
    # The unit that gives the axis of time numbers from 2 to 2000.
    unit_ps, unit = _unit_of((waveforms.end - waveforms.begin) / 2)
    scale = _Scale(waveforms.begin, unit_ps, unit, (waveforms.end - waveforms.begin) / unit_ps)
    rows, headings, depth = _arrange(waveforms.signals)
    above = MARK_LINE * len(marks)
    height = (depth + above) * ROW + (1.1 if waveforms.title else 0.75)
    with new_figure(path, WIDTH, height, force=force) as figure:
        area: Axes = figure.subplots()
        if waveforms.title:
            figure.suptitle(shown(waveforms.title), x=0.01, ha="left", fontsize=11, fontweight="bold")
        area.set_xlim(0, scale.span)
        area.set_ylim(-depth, above + 0.1)
        _label_rows(area, rows, headings)
        _label_time(area, scale)
        for line, (time, text) in enumerate(marks):
            _draw_mark(area, scale.of(time), text, line, depth)
        for row in rows:
            if row.signal.is_float:
                _draw_curve(area, row, scale)
            elif row.signal.bits == 1:
                _draw_levels(area, row, _segments(row.signal, scale))
            else:
                _draw_lozenges(area, row, _segments(row.signal, scale), scale)
        # Only once everything has its place is it known how much room a value has.
        figure.get_layout_engine().execute(figure)
        per_inch = scale.span / (area.get_position().width * WIDTH)
        for row in rows:
            if not row.signal.is_float and row.signal.bits > 1:
                _write_values(area, row, _segments(row.signal, scale), per_inch)
    return figure


def _unit_of(time: float) -> tuple[int, str]:
    """The largest unit that goes into a time [ps]: its size [ps] and name."""
    return next(((size, name) for size, name in _UNITS if time >= size), (1, "ps"))


def _arrange(signals: Sequence[Waveform]) -> tuple[list[_Row], list[tuple[str, float, str]], float]:
    """Stack signals by block; returns rows, headings (text, middle, colour) and the depth of all, in rows."""
    blocks: dict[str, list[Waveform]] = {}
    for signal in signals:
        blocks.setdefault(signal.block, []).append(signal)
    rows: list[_Row] = []
    headings: list[tuple[str, float, str]] = []
    depth = 0.0
    for index, (block, members) in enumerate(blocks.items()):
        colour = BLOCK_COLOURS[index % len(BLOCK_COLOURS)]
        if block:
            headings.append((block, -depth - SLOT_HEADING / 2, colour))
            depth += SLOT_HEADING
        elif index:
            depth += SLOT_HEADING / 2
        for signal in members:
            slot = SLOT_FLOAT if signal.is_float else 1.0
            middle, half = -depth - slot / 2, (slot - 1 + LEVEL) / 2
            rows.append(_Row(signal, middle, middle - half, middle + half, colour))
            depth += slot
    return rows, headings, depth + 0.3


def _segments(signal: Waveform, scale: _Scale) -> list[Segment]:
    """Stretches of equal value; three or more in a row too short to be seen become one without value."""
    edges = np.append(scale.of(signal.times), scale.span)
    short = np.diff(edges) < FINEST * scale.span
    bounds = np.flatnonzero(np.diff(short, prepend=not short[0], append=not short[-1]))
    values: list[int] = signal.values.tolist()
    segments: list[Segment] = []
    for first, last in zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True):
        if short[first] and last - first > 2:
            segments.append((float(edges[first]), float(edges[last]), None))
        else:
            segments += [(float(edges[k]), float(edges[k + 1]), values[k]) for k in range(first, last)]
    return segments


def _draw_levels(area: Axes, row: _Row, segments: list[Segment]) -> None:
    times = [place for start, stop, _ in segments for place in (start, stop)]
    levels = np.repeat([np.nan if value is None else row.high if value else row.low for *_, value in segments], 2)
    area.plot(times, levels, color=row.colour, linewidth=1.2, solid_joinstyle="miter")
    for wanted, alpha in ((1, 0.13), (None, 0.6)):
        bars = [(start, stop - start) for start, stop, value in segments if value == wanted]
        area.broken_barh(bars, (row.low, row.high - row.low), facecolor=row.colour, alpha=alpha, linewidth=0)


def _draw_lozenges(area: Axes, row: _Row, segments: list[Segment], scale: _Scale) -> None:
    collections: Any = importlib.import_module("matplotlib.collections")
    shapes: list[list[tuple[float, float]]] = []
    for start, stop, _ in segments:
        # A value that holds beyond the window is drawn as going on.
        left = start - 0.05 * scale.span if start <= 0 else start
        right = stop + 0.05 * scale.span if stop >= scale.span else stop
        slant = min(SLANT * scale.span, (right - left) / 2)
        shapes.append(
            [
                (left, row.middle), (left + slant, row.high), (right - slant, row.high),
                (right, row.middle), (right - slant, row.low), (left + slant, row.low),
            ]
        )  # fmt: skip
    # A value is as pale as its colour with nine parts of white.
    parts = [int(row.colour[index : index + 2], 16) for index in (1, 3, 5)]
    pale = "#" + "".join(f"{round(255 - 0.1 * (255 - part)):02x}" for part in parts)
    for busy, fill in ((False, pale), (True, row.colour)):
        chosen = [shape for shape, (_, _, value) in zip(shapes, segments, strict=True) if (value is None) == busy]
        area.add_collection(
            collections.PolyCollection(chosen, facecolors=fill, edgecolors=row.colour, linewidths=0.9), autolim=False
        )


def _write_values(area: Axes, row: _Row, segments: list[Segment], per_inch: float) -> None:
    """Write each value that fits inside its lozenge; `per_inch` is the time that one inch shows."""
    for start, stop, value in segments:
        if value is None:
            continue
        text = _minus(str(value))
        # A figure of matplotlib's font is 0.64 of its size wide.
        if 0.64 * len(text) * VALUE_SIZE / 72 * per_inch <= 0.92 * (stop - start):
            middle = (start + stop) / 2
            area.text(middle, row.middle, text, ha="center", va="center_baseline", fontsize=VALUE_SIZE, color=INK)


def _draw_curve(area: Axes, row: _Row, scale: _Scale) -> None:
    """Draw a float, which holds its value as any register does, between its extremes."""
    kept = thin_indices(row.signal.values, POINTS)
    times = np.append(scale.of(row.signal.times[kept]), scale.span)
    values = np.append(row.signal.values[kept], row.signal.values[-1])
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (np.nan, np.nan)
    for level in (row.low, row.high):
        area.axhline(level, color=GREY, linewidth=0.5, linestyle=(0, (1, 3)))
    if low < high:
        drawn = row.low + (values - low) / (high - low) * (row.high - row.low)
        _beside(area, row.high, high)
        _beside(area, row.low, low)
    else:
        drawn = np.where(np.isfinite(values), row.middle, np.nan)
        _beside(area, row.middle, low)
    drawn[~np.isfinite(values)] = np.nan
    area.plot(times, drawn, color=row.colour, linewidth=1.2, drawstyle="steps-post")


def _beside(area: Axes, y: float, value: float) -> None:
    """Write a value to the right of the diagram."""
    text = _minus(f"{value:.4g}") if np.isfinite(value) else "\u2013"
    area.text(1.008, y, text, transform=area.get_yaxis_transform(), ha="left", va="center", fontsize=7.5, color=INK)


def _minus(text: str) -> str:
    return text.replace("-", "\u2212")


def _label_rows(area: Axes, rows: list[_Row], headings: list[tuple[str, float, str]]) -> None:
    """Write names to the left, descriptions to the right."""
    places = [row.middle for row in rows] + [middle for _, middle, _ in headings]
    # Names inside the block, with the unit; that a word counts something its description says.
    units = ["" if row.signal.unit in {"", "count", "code"} else f" [{row.signal.unit}]" for row in rows]
    names = [row.signal.name.rpartition(".")[2] + unit for row, unit in zip(rows, units, strict=True)]
    area.set_yticks(places, names + [text for text, _, _ in headings])
    for label, (_, _, colour) in zip(area.get_yticklabels()[len(rows) :], headings, strict=True):
        label.set(fontweight="bold", color=colour)
    for _, middle, _ in headings:
        area.axhline(middle + SLOT_HEADING / 2 - 0.1, color="#d5dae0", linewidth=0.8)
    area.tick_params(axis="y", length=0, pad=4, labelsize=9)
    side = 1.055 if any(row.signal.is_float for row in rows) else 1.008
    for row in rows:
        doc = textwrap.shorten(row.signal.doc, 2 * DOC_WIDTH, placeholder=" …")
        area.text(
            side, row.middle, textwrap.fill(doc, DOC_WIDTH), transform=area.get_yaxis_transform(), ha="left",
            va="center", fontsize=7, color=GREY, linespacing=1.0,
        )  # fmt: skip


def _label_time(area: Axes, scale: _Scale) -> None:
    area.grid(visible=False, axis="y")
    area.spines["left"].set_visible(False)
    if scale.begin:
        unit_ps, unit = _unit_of(scale.begin)
        begin = f"{(Decimal(scale.begin) / unit_ps).normalize():f}"
        area.set_xlabel(f"t = {begin} {unit} + … [{scale.unit}]")
    else:
        area.set_xlabel(f"t, time since power-on [{scale.unit}]")


def _draw_mark(area: Axes, at: float, text: str, line: int, depth: float) -> None:
    """Write the text of a mark above the diagram, each in a line of its own."""
    top = 0.1 + MARK_LINE * line
    area.plot(
        [at, at], [-depth, top], color=COLOURS[1], linewidth=1.0, linestyle=(0, (4, 2)), zorder=0.9, clip_on=False
    )
    # The white ground keeps the lines of other marks out of the text.
    ground = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
    area.text(at, top + 0.1, text, ha="center", va="bottom", fontsize=8, color=COLOURS[1], bbox=ground)
