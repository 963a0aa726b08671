"""Figure of a stepper's envelope: the permissible step frequency along the travel, both directions in one picture."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.files.text import check_target
from detent.methods.stepper_envelope.envelope_files import EnvelopeTables
from detent.page.parts import Numbers
from detent.page.plots import COLOURS, new_figure
from detent.planning.step_envelope import StepEnvelope
from detent.units import format_quantity

# matplotlib's stubs leave every **kwargs untyped, so that strict checking would refuse each call.
Axes = Any

BLUE, ORANGE = COLOURS[:2]
GREY = "#7d8996"
INK = "#17202a"

MM = 1e-3
HEADROOM = 1.32  # height of each half over its largest limit: room for the limits and, further out, the direction
UPRIGHT, NONE = 0.07, 0.015  # parts of the travel: narrower zones have their limit written upright, or not at all
BESIDE = 0.17  # part of the travel that the name of an extreme may take, beside its point

LABEL: dict[str, Any] = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 1.5}


def plot_envelope(tables: EnvelopeTables, path: str | Path) -> None:
    """Draw the permissible frequency over the position: upwards above the axis, downwards below it.

    The run between a direction's extremes is filled; outside of them a dashed line shows what the table allows there.
    What the zones forbid is grey. Steps and Hz are at the left and below, mm and mm/s at the right and above.
    """
    path = check_target(path)
    top = HEADROOM * max(tables.up.zones.limits)
    with new_figure(path, 9.0, 5.4) as figure:
        area = figure.subplots()
        outside = False
        for table, colour in ((tables.up, BLUE), (tables.down, ORANGE)):
            _shade_zones(area, table, top)
            outside = _draw_table(area, table, colour) or outside
            way, place = ("up →", 0.968) if table.direction > 0 else ("← down", 0.032)
            area.text(
                0.008, place, way, transform=area.transAxes, color=colour, fontsize=11, fontweight="bold", va="center",
                bbox=LABEL,
            )  # fmt: skip
        if outside:
            area.plot([], [], "--", color=INK, linewidth=0.9, label="permissible outside of the run")
        area.axhline(0, color=INK, linewidth=0.9)
        _mark_extremes(area, tables)
        area.set_xlim(0, tables.steps)
        area.set_ylim(-top, top)
        area.xaxis.get_major_locator().set_params(integer=True)
        area.set_xlabel("position [step]")
        area.set_ylabel("permissible step frequency [Hz]")
        # The same in mm and mm/s.
        step, first = tables.travel_per_step / MM, tables.first_position / MM
        area.secondary_xaxis("top", functions=_line(first, step)).set_xlabel("position [mm]")
        per_step = format_quantity(tables.travel_per_step, "m", 4).replace("um", "µm")
        area.secondary_yaxis("right", functions=_line(0.0, step)).set_ylabel(f"speed [mm/s], {per_step} a step")
        area.set_title(f"How fast may every step be? Motor {tables.motor}, axis {tables.axis}", pad=12)
        figure.legend(loc="outside lower center", ncols=2, fontsize=9)


def _shade_zones(area: Axes, table: StepEnvelope, top: float) -> None:
    """Grey over the frequencies that a zone forbids, and the zone's limit in figures."""
    zones, sign = table.zones, table.direction
    hz = np.array(zones.limits)[zones.numbers]
    name = "faster than the zone allows" if sign > 0 else None
    area.stairs(sign * hz, zones.edges, baseline=sign * top, fill=True, color=GREY, alpha=0.22, linewidth=0, label=name)
    area.stairs(sign * hz, zones.edges, baseline=None, color=GREY, linewidth=0.9)
    for begin, end, limit in zip(zones.edges[:-1], zones.edges[1:], hz, strict=True):
        part = (end - begin) / zones.steps
        if part >= NONE:
            area.annotate(
                f"{limit:g} Hz", ((begin + end) / 2, sign * limit), (0, 4 * sign), textcoords="offset points",
                ha="center", va="bottom" if sign > 0 else "top", fontsize=9, color="#3d4751",
                rotation=0 if part >= UPRIGHT else 90,
            )  # fmt: skip


def _draw_table(area: Axes, table: StepEnvelope, colour: str) -> bool:
    """The steps of the run filled, all others as a thin dashed line; True if there are others."""
    hz = table.direction * table.permissible_hz()
    low, high = sorted((table.start, table.stop))
    if (table.stop - table.start) * table.direction <= 0:
        low = high = 0
    for begin, end in ((0, low), (high, table.steps)):
        if begin < end:
            values, edges = _corners(hz[begin:end], begin)
            area.stairs(values, edges, baseline=None, color=colour, linewidth=0.9, alpha=0.6, linestyle="--")
    if low < high:
        values, edges = _corners(hz[low:high], low)
        area.stairs(values, edges, fill=True, color=colour, alpha=0.16, linewidth=0)
        area.stairs(values, edges, color=colour, linewidth=1.8)
    return high - low < table.steps


def _corners(hz: Numbers, first: int) -> tuple[Numbers, NDArray[np.int64]]:
    """Values that follow one another, each once, and the places where they begin and the last one ends."""
    begins = np.concatenate(([0], np.flatnonzero(np.diff(hz)) + 1)).astype(np.int64)
    return hz[begins], np.append(begins, len(hz)) + first


def _mark_extremes(area: Axes, tables: EnvelopeTables) -> None:
    """Points on the axis where a run begins, turns and ends, each named in its own half, outside of the run.

    Names stand above or below (1, -1), and right or left of the point.
    """
    up, down = tables.up, tables.down
    marks = [("start", up.start, (1, -1)), ("stop", down.stop, (-1, -1))]
    if up.start == down.stop:
        marks = [("start and stop", up.start, (1, -1))]
    marks += [("stop", up.stop, (1, 1)), ("start", down.start, (-1, 1))]
    if up.stop == down.start:
        marks[-2:] = [("turn", up.stop, (1, 1))]
    across = area.get_yaxis_transform()
    for name, place, (vertical, outer) in marks:
        part = place / tables.steps
        side = outer if BESIDE < part < 1 - BESIDE else 1 if part < 0.5 else -1
        area.plot(part, 0, "o", color=INK, markersize=7, clip_on=False, zorder=5, transform=across)
        area.annotate(
            f"{name} {place}", (part, 0), (4 * side, 8 * vertical), xycoords=across, textcoords="offset points",
            ha="left" if side > 0 else "right", va="bottom" if vertical > 0 else "top", fontsize=9, fontweight="bold",
            bbox=LABEL, zorder=6,
        )  # fmt: skip


def _line(begin: float, slope: float) -> tuple[Callable[[Numbers], Numbers], Callable[[Numbers], Numbers]]:
    """A straight line, there and back, as matplotlib wants a second scale."""
    return lambda there: begin + slope * np.asarray(there), lambda back: (np.asarray(back) - begin) / slope
