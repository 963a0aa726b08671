"""The curves of the report of an identification as data for the script of the page."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from detent.identify.fit.constants import Constants
from detent.identify.fit.run import Run
from detent.identify.page.identify_data import HeldOut, IdentifyReportData, Windows, autocorrelation
from detent.identify.page.identify_model import friction_at, friction_limits
from detent.identify.page.identify_words import Ways, digits_for, effort_scale, label_of
from detent.methods.cascade.units import Scale
from detent.page.chart import (
    POINTS,
    Band,
    Chart,
    Curve,
    Heap,
    Panel,
    Timeline,
    histogram_chart,
    line_chart,
    spans_of,
    time_charts,
)
from detent.page.parts import Numbers
from detent.page.thin import thin_indices

MOST_BANDS = 200
"""Stretches marked in a chart; closer ones are drawn as one."""

DOTS = 1500
"""Windows drawn in the friction map."""

SPREAD = 0.5
"""Room about a measured position for a simulated one that runs away, over its range."""

SINCE = "time since the recording began"


def all_charts(data: IdentifyReportData) -> list[Chart]:
    """Every chart of the page."""
    charts = recorded_charts(data.found.runs[data.shown])
    if data.held:
        charts += held_charts(data.held[data.shown], ways_of(data))
    if data.windows:
        unit = data.found.runs[data.shown].effort_unit
        charts += effort_charts(data.windows[data.shown], data.found.runs[data.shown])
        charts += [residual_chart(data.windows, unit), memory_chart(data.windows)]
        charts += [friction_chart(data, data.found.constants)] if data.found.constants else []
    return charts


def ways_of(data: IdentifyReportData) -> Ways:
    """How positions are written."""
    return Ways(data.found.runs[0].position_unit)


# ---- over time


def recorded_charts(run: Run) -> list[Chart]:
    """Draw what was recorded: position with its reference, and effort; samples that are not used are marked."""
    place, scale = Ways(run.position_unit).place, effort_scale(run.effort_unit, _peak(run.effort))
    curves = [_curve("position", "speed", run.position, place)]
    if run.reference is not None:
        curves.append(_curve("reference", "left", run.reference, place, dash=(5, 4)))
    effort = [_curve(run.effort_name, "drive", run.effort, scale)]
    unused = _joined(spans_of(run.t, ~run.usable), float(run.t[-1]) / MOST_BANDS)
    bands = [Band(label="not used", colour="brake", spans=unused)]
    above, below = label_of("position", place.name), label_of(run.effort_name, scale.name)
    return time_charts(Timeline(name="recorded", t=run.t, label=SINCE, unit="s", bands=bands), [
        Panel(name="recorded-position", label=above, curves=curves, zero=True),
        Panel(name="recorded-effort", label=below, curves=effort, height=170, zero=True),
    ])  # fmt: skip


def held_charts(held: HeldOut, ways: Ways) -> list[Chart]:
    """Draw the held-out part: recorded and simulated position, and both differences."""
    place, again = ways.place, f"simulated, from the recording again every {held.restart:.3g} s"
    curves = [
        _curve(again, "speed", held.restarted, place, width=2.5),
        _curve("simulated in one piece", "drive", held.free, place),
        _curve("recorded", "left", held.measured, place, dash=(5, 4)),
    ]
    label = label_of("position", place.name)
    return time_charts(Timeline(name="held", t=held.t, label=SINCE, unit="s"), [
        Panel(name="held-position", label=label, curves=curves, span=_span_of(held, place)),
        _off_panel("held-restarted", again, "speed", held.measured - held.restarted, ways),
        _off_panel("held-free", "simulated in one piece", "drive", held.measured - held.free, ways),
    ])  # fmt: skip


def _span_of(held: HeldOut, place: Scale) -> tuple[float, float] | None:
    """A simulation that runs away must not squeeze the rest."""
    low, high = float(held.measured.min()), float(held.measured.max())
    room = SPREAD * (high - low)
    leaves = bool(np.any((held.free < low - room) | (held.free > high + room)))
    return ((low - room) * place.factor, (high + room) * place.factor) if leaves else None


def _off_panel(name: str, label: str, colour: str, off: Numbers, ways: Ways) -> Panel:
    scale = ways.small(_peak(off))
    curve = _curve(f"recorded less {label}", colour, off, scale)
    return Panel(name=name, label=label_of("difference", scale.name), height=150, zero=True, curves=[curve])


def effort_charts(windows: Windows, run: Run) -> list[Chart]:
    """Draw what drove the axis, measured and by the model, and what is left."""
    if not len(windows.t):
        return []
    gaps = np.flatnonzero(np.diff(windows.place) > 1) + 1
    t, (effort, fitted, residual) = _with_gaps(windows.t, gaps, [windows.effort, windows.fitted, windows.residual])
    scale = effort_scale(run.effort_unit, _peak(effort))
    curves = [
        _curve("by the model", "speed", fitted, scale, width=2.5, thin=len(t)),
        _curve("recorded", "left", effort, scale, dash=(5, 4), thin=len(t)),
    ]
    left = _curve("recorded less model", "current", residual, scale, thin=len(t))
    return time_charts(Timeline(name="effort", t=t, label=SINCE, unit="s"), [
        Panel(name="effort-both", label=label_of(run.effort_name, scale.name), curves=curves, zero=True),
        Panel(name="effort-left", label=label_of("residual", scale.name), curves=[left], zero=True, height=150),
    ])  # fmt: skip


# ---- residuals


def residual_chart(windows: Sequence[Windows], unit: str) -> Chart:
    """Count residuals by their size."""
    residual = np.concatenate([one.residual for one in windows])
    # A few far ones must not squeeze all others into one bar; they stand at its end.
    reach = 4.0 * float(np.sqrt(np.mean(residual**2))) or 1.0
    scale = effort_scale(unit, reach)
    at = np.clip(residual, -reach, reach) * scale.factor
    heap = Heap(label="windows", colour="speed", at=at, counts=np.ones(len(at)))
    labels = (label_of("recorded less model", scale.name), "windows")
    return histogram_chart("residual-sizes", [heap], labels, finest=1e-3 * reach * scale.factor)


def memory_chart(windows: Sequence[Windows]) -> Chart:
    """Draw how much a residual resembles those before it, with the bounds of residuals that do not."""
    correlation, pairs = autocorrelation(windows)
    one = windows[0]
    lag = np.arange(len(correlation)) * one.hop * 1e3
    bound = 1.96 / math.sqrt(max(pairs[0], 1.0))
    panel = Panel(
        name="residual-memory",
        label="correlation",
        height=260,
        zero=True,
        span=(min(-0.4, float(np.nanmin(correlation)) - 0.05), 1.05),
        curves=[Curve(label="with the residual so much earlier", colour="speed", y=correlation)],
        levels=[(bound, "95 % of white noise"), (-bound, "")],
    )
    chart = line_chart(panel, lag, "earlier by [ms]")
    chart["series"][0]["bars"] = 0
    overlap = {"spans": [[0.0, round(one.width * 1e3, 3)]], "colour": "brake", "label": "windows overlap"}
    return chart | {"bands": [overlap]}


# ---- friction over the speed


def friction_chart(data: IdentifyReportData, constants: Constants) -> Chart:
    """Draw friction over the velocity: windows, the model's curve and its limits."""
    velocity = np.concatenate([one.velocity for one in data.windows])
    residual = np.concatenate([one.residual for one in data.windows])
    every = max(1, -(-len(velocity) // DOTS))
    velocity, residual = velocity[::every], residual[::every]
    friction = friction_at(constants, constants.values, velocity) + residual
    x = _places(velocity)
    dots = np.full(len(x), np.nan)
    dots[np.searchsorted(x, velocity)] = friction
    # At standstill friction is whatever holds the axis: no curve.
    curve = np.where(x == 0.0, np.nan, friction_at(constants, constants.values, x))
    half = friction_limits(constants, x)
    half = np.where(half < 2.0 * _peak(friction), half, np.nan)
    scale, speed = effort_scale(data.found.runs[0].effort_unit, _peak(friction)), ways_of(data).speed
    rings = Curve(label="measured, window by window", colour="left", y=dots * scale.factor, rings=5)
    curves = [
        replace(rings, digits=digits_for(_peak(rings.y))),
        _curve("by the model", "speed", curve, scale, width=2.0),
        _curve("95 % above", "ink", curve + half, scale, width=1.0, dash=(3, 3)),
        _curve("95 % below", "ink", curve - half, scale, width=1.0, dash=(3, 3)),
    ]
    panel = Panel(name="friction-map", label=label_of("friction", scale.name), height=320, zero=True, curves=curves)
    places = x * speed.factor
    return line_chart(panel, places, label_of("velocity", speed.name), digits=digits_for(_peak(places)))


def _places(velocity: Numbers) -> Numbers:
    """Velocities of the windows, and between them as many as a smooth curve needs; 0 is one of them."""
    top, bottom = max(float(velocity.max()), 0.0), min(float(velocity.min()), 0.0)
    return np.unique(np.concatenate([velocity, np.linspace(bottom, 0.0, 200), np.linspace(0.0, top, 200)]))


# ---- helpers


def _curve(  # noqa: PLR0913 - what a curve consists of
    label: str,
    colour: str,
    values: Numbers,
    scale: Scale,
    *,
    width: float | None = None,
    dash: tuple[int, int] | None = None,
    thin: int = POINTS,
) -> Curve:
    """A curve in its unit, with as many digits as it needs."""
    y = values * scale.factor
    return Curve(label=label, colour=colour, y=y, digits=digits_for(_peak(y)), width=width, dash=dash, thin=thin)


def _peak(values: Numbers) -> float:
    return float(np.nanmax(np.abs(values), initial=0.0))


def _with_gaps(t: Numbers, before: Numbers, curves: Sequence[Numbers]) -> tuple[Numbers, list[Numbers]]:
    """Rows that draw like all of them, with a gap in every curve before some rows.

    Thinning looks for extremes, and would drop the gaps.
    """
    kept = np.unique(np.concatenate([before, *(thin_indices(curve, POINTS) for curve in curves)])).astype(np.intp)
    holes = np.searchsorted(kept, before)
    times = np.insert(t[kept], holes, 0.5 * (t[before - 1] + t[before]))
    return times, [np.insert(curve[kept], holes, np.nan) for curve in curves]


def _joined(spans: list[tuple[float, float]], least: float) -> list[tuple[float, float]]:
    """Stretches with those closer together than can be seen made one."""
    joined: list[tuple[float, float]] = []
    for begin, end in spans:
        if joined and begin - joined[-1][1] < least:
            joined[-1] = (joined[-1][0], end)
        else:
            joined.append((begin, end))
    return joined
