"""Figures of the report of an identification: the model beside the recording.

The position of a part that the fit did not see; the effort, what of it is left unexplained, and friction.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from markupsafe import Markup

from detent.identify.fit.constants import Constants
from detent.identify.fit.equations import HOPS, Run
from detent.identify.fit.estimate import quantile, rms
from detent.identify.fit.free_run import HORIZONS, Horizon, Plant, free_run, start_velocities
from detent.identify.fit.identification import HELD_OUT, Identification, prepare_all
from detent.identify.page.words import SINCE, Ways, digits_for, effort_scale, label_of, long_bar, peak_of, scaled
from detent.page import chart
from detent.page.figure import Figure
from detent.page.parts import Numbers
from detent.page.table import Table
from detent.page.words import count, duration, number, percent

RESTART = 1.0  # time after which the simulation starts again from the recording [s]
SPREAD = 0.5  # room about a measured position for a simulated one that runs away, over its range
LAGS = 60  # lags of the autocorrelation, in rows of the regression
DOTS = 1500  # windows drawn in the friction map


@dataclass(frozen=True, slots=True, eq=False)
class HeldOut:
    """A log's last part beside its simulation with constants from the first, in SI units, arrays of shape (n,)."""

    t: Numbers  # time since the log's begin [s]
    measured: Numbers  # position of the log
    restarted: Numbers  # and free: simulated position: from the recording again after each `restart`, and in one piece
    free: Numbers
    restart: float  # time between two restarts [s]

    @property
    def rms_restarted(self) -> float:
        """Root mean square of what the restarted simulation is off."""
        return rms(self.restarted - self.measured)


def hold_out(found: Identification) -> tuple[HeldOut, ...]:
    """Simulate the last part of each log with constants from the first parts, as the table of horizons does."""
    constants = found.seen
    if constants is None or not found.horizons:
        return ()
    return tuple(_simulated(constants, run, round((1.0 - HELD_OUT) * len(run.position))) for run in found.runs)


def _simulated(constants: Constants, run: Run, cut: int) -> HeldOut:
    unseen = run.part(cut, len(run.position))
    free = free_run(constants, unseen)
    begin = len(unseen.position) - len(free)
    # A second, or the longest of the usual horizons that goes twice into a shorter stretch.
    fitting = (h for h in HORIZONS if h <= RESTART and 2.0 * h <= len(free) * run.step)
    samples = max(round(max(fitting, default=min(HORIZONS)) / run.step), 2)
    plant, velocity = Plant(constants, run.step), start_velocities(unseen)
    pieces: list[Numbers] = []
    for start in range(begin, len(unseen.position), samples):
        number = min(samples, len(unseen.position) - start)
        at, speed = float(unseen.position[start]), float(velocity[start])
        pieces.append(plant.run(unseen.effort, start, number, at, speed) if number > 1 else np.array([at]))
    t = (cut + begin + np.arange(len(free))) * run.step
    return HeldOut(t, unseen.position[begin:], np.concatenate(pieces), free, samples * run.step)


def simulated_figures(found: Identification, held: Sequence[HeldOut], shown: int) -> list[Figure]:
    """The simulation of one log over time, and how far that of all can be trusted."""
    ways = Ways(found.runs[0].position_unit)
    horizons = [_horizon_figure(found.horizons, ways)] if found.horizons else []
    if not held:
        return horizons
    one, worst = held[shown], ""
    if len(held) > 1:
        worst = f"Of {count(len(held), 'recording')} the one with the largest errors, {found.logs[shown].name}. "
    caption = Markup(
        "{}The axis simulated over the last quarter of the recording, with constants from the first three quarters. It "
        "is driven by the recorded effort only, without a controller, so all errors accumulate. "
        "<b>Restarted every {}\u202fs its error is {} (rms), without restarts {}.</b> Where the curves coincide the "
        "model reproduces the axis."
    ).format(worst, f"{one.restart:.3g}", ways.error(one.rms_restarted), ways.error(rms(one.free - one.measured)))
    title = "On held-out data"
    return [Figure(title=title, caption=caption, charts=held_charts(one, ways)), *horizons]


def held_charts(held: HeldOut, ways: Ways) -> list[chart.Chart]:
    """Draw the held-out part: recorded and simulated position, and both differences."""
    place, again = ways.place, f"simulated, restarted from the recording every {held.restart:.3g} s"
    curves = [
        scaled(again, "speed", held.restarted, place, width=2.5),
        scaled("simulated without restarts", "drive", held.free, place),
        scaled("recorded", "left", held.measured, place, dash=(5, 4)),
    ]
    label = label_of("position", place.name)
    # A simulation that runs away must not squeeze the rest.
    room = SPREAD * float(np.ptp(held.measured))
    low, high = float(held.measured.min()) - room, float(held.measured.max()) + room
    leaves = bool(np.any((held.free < low) | (held.free > high)))
    span = (low * place.factor, high * place.factor) if leaves else None
    return chart.time_charts(chart.Timeline(name="held", t=held.t, label=SINCE, unit="s"), [
        chart.Panel(name="held-position", label=label, curves=curves, span=span),
        _off_panel("held-restarted", again, "speed", held.measured - held.restarted, ways),
        _off_panel("held-free", "simulated without restarts", "drive", held.measured - held.free, ways),
    ])  # fmt: skip


def _off_panel(name: str, label: str, colour: str, off: Numbers, ways: Ways) -> chart.Panel:
    scale = ways.small(peak_of(off))
    curve = scaled(f"recorded minus {label}", colour, off, scale)
    return chart.Panel(name=name, label=label_of("difference", scale.name), height=150, zero=True, curves=[curve])


def _horizon_figure(horizons: Sequence[Horizon], ways: Ways) -> Figure:
    heads = [
        ("simulated for", False), ("starts", True), ("simulated, rms", True), ("largest", True),
        ("without a model, rms", True), ("simulated, relative to no model", False), ("travel of the axis, rms", True),
        ("95 % by the limits of the constants", True),
    ]  # fmt: skip
    caption = Markup(
        "Error at the end of a simulated segment that starts from the recorded state. "
        "<b>Without a model</b> it would continue at its initial velocity: a useful model is far below 100\u202f%. One "
        "step shows little more than encoder noise; the free run is a single segment, and its error is taken "
        "over all of it. <b>The limits of the constants</b> alone leave the free run this much: an error far beyond it "
        "is the model's."
    )
    rows: list[list[str]] = []
    for h in horizons:
        share = h.rms / h.naive if h.naive > 0.0 else math.nan
        name = f"free run, {duration(float(h.duration))}" if h.name == "free run" else h.name
        bar = long_bar(share / 1.5, percent(share), chosen=share < 1.0)
        errors = [ways.error(value) for value in (h.rms, h.largest, h.naive)]
        limits = ways.spread(h.spread) if h.name == "free run" else ""
        rows.append([name, count(h.starts), *errors, bar, ways.error(h.moved), limits])
    return Figure(title="Prediction error versus horizon", caption=caption, table=Table(heads=heads, rows=rows))


@dataclass(frozen=True, slots=True, eq=False)
class Windows:
    """Rows of the regression of one log, in SI units, arrays of shape (m,)."""

    t: Numbers  # middle of each window since the log's begin [s]
    effort: Numbers  # and fitted, residual: measured, by the model, and the difference
    fitted: Numbers
    residual: Numbers
    velocity: Numbers  # mean velocity
    place: Numbers  # number of each window on an even grid; where it jumps, windows in between were not usable
    hop: float  # and width: distance of two neighbouring windows, and their width [s]
    width: float


def windows_of(found: Identification) -> tuple[Windows, ...]:
    """Rows of the regression, log by log; none without a fit."""
    fit = found.fit
    if fit is None:
        return ()
    made: list[Windows] = []
    stop = 0
    for run, prepared in zip(found.runs, prepare_all(found.runs, fit.instruments), strict=True):
        motion, rows = prepared.motion, prepared.motion.rows
        part = slice(stop, stop := stop + len(rows))
        hop = max(motion.kernel.half // HOPS, 1)
        effort, residual = fit.effort[part], fit.residual[part]
        place, width = (rows - (int(rows[0]) if len(rows) else 0)) // hop, (2 * motion.kernel.half + 1) * run.step
        series = (rows * run.step, effort, effort - residual, residual, motion.velocity, place)
        made.append(Windows(*series, hop * run.step, width))
    return tuple(made)


def autocorrelation(windows: Sequence[Windows]) -> tuple[Numbers, Numbers]:
    """Correlation of residuals with those some windows earlier; gaps do not count as neighbours."""
    most = min(LAGS, max(int(one.place[-1]) for one in windows if len(one.place)))
    products, pairs = np.zeros(most + 1), np.zeros(most + 1)
    for one in windows:
        if not len(one.place):
            continue
        size = int(one.place[-1]) + 1
        values, known = np.zeros(size), np.zeros(size)
        values[one.place], known[one.place] = one.residual, 1.0
        for lag in range(min(most, size - 1) + 1):
            products[lag] += values[lag:] @ values[: size - lag]
            pairs[lag] += known[lag:] @ known[: size - lag]
    means = np.divide(products, pairs, out=np.full(most + 1, np.nan), where=pairs > 0)
    return (means / means[0] if means[0] > 0 else np.zeros(most + 1)), pairs


def effort_figures(found: Identification, windows: Sequence[Windows], shown: int) -> list[Figure]:
    """Effort over time of one log, and residuals of all."""
    fit = found.fit
    if fit is None or not windows or not len(windows[shown].t):
        return []
    run, one = found.runs[shown], windows[shown]
    caption = Markup(
        "Modelled and recorded effort, both averaged over windows of {}\u202fms; windows with "
        "standstill, a reversal or missing samples are left out. <b>{} of the effort (rms) stays "
        "unexplained.</b> A pattern in the residual is what the model lacks: a position-dependent force, cogging, "
        "another friction."
    ).format(number(one.width * 1e3), percent(rms(fit.residual) / rms(fit.effort)))
    told = (
        "Left: expect a single peak around 0; the outermost bars collect all larger values. Right: beyond the "
        "overlap of the windows bars within the dashed lines are noise; bars outside them indicate something that the "
        "model lacks. The limits of the constants account for that."
    )
    residuals = [residual_chart(windows, run.effort_unit), memory_chart(windows)]
    return [
        Figure(title="Time plots", caption=caption, charts=effort_charts(one, run)),
        Figure(title="Residuals", caption=told, charts=residuals, beside=True),
    ]


def effort_charts(windows: Windows, run: Run) -> list[chart.Chart]:
    """Draw what drove the axis, measured and by the model, and what is left."""
    gaps = np.flatnonzero(np.diff(windows.place) > 1) + 1
    series = [windows.effort, windows.fitted, windows.residual]
    # Rows that draw like all of them, with a gap in every curve before some rows: the chart's own thinning looks for
    # extremes, and would drop the gaps.
    drawn = [chart.thin_indices(curve, chart.POINTS) for curve in series]
    kept = np.unique(np.concatenate([gaps, *drawn])).astype(np.intp)
    holes = np.searchsorted(kept, gaps)
    t = np.insert(windows.t[kept], holes, 0.5 * (windows.t[gaps - 1] + windows.t[gaps]))
    effort, fitted, residual = (np.insert(curve[kept], holes, np.nan) for curve in series)
    scale = effort_scale(run.effort_unit, peak_of(effort))
    curves = [
        scaled("by the model", "speed", fitted, scale, width=2.5, thin=len(t)),
        scaled("recorded", "left", effort, scale, dash=(5, 4), thin=len(t)),
    ]
    left = scaled("recorded minus model", "current", residual, scale, thin=len(t))
    return chart.time_charts(chart.Timeline(name="effort", t=t, label=SINCE, unit="s"), [
        chart.Panel(name="effort-both", label=label_of(run.effort_name, scale.name), curves=curves, zero=True),
        chart.Panel(name="effort-left", label=label_of("residual", scale.name), curves=[left], zero=True, height=150),
    ])  # fmt: skip


def residual_chart(windows: Sequence[Windows], unit: str) -> chart.Chart:
    """Count residuals by their size."""
    residual = np.concatenate([one.residual for one in windows])
    # A few far ones must not squeeze all others into one bar; they stand at its end.
    reach = 4.0 * rms(residual) or 1.0
    scale = effort_scale(unit, reach)
    at = np.clip(residual, -reach, reach) * scale.factor
    heap = chart.Heap(label="windows", colour="speed", at=at, counts=np.ones(len(at)))
    labels = (label_of("recorded minus model", scale.name), "windows")
    drawn = chart.histogram_chart("residual-sizes", [heap], labels, finest=1e-3 * reach * scale.factor)
    return drawn | {"title": "Distribution of the residuals"}


def memory_chart(windows: Sequence[Windows]) -> chart.Chart:
    """Draw how much a residual resembles those before it, with the bounds of residuals that do not."""
    correlation, pairs = autocorrelation(windows)
    one = windows[0]
    lag = np.arange(len(correlation)) * one.hop * 1e3
    bound = 1.96 / math.sqrt(max(pairs[0], 1.0))
    panel = chart.Panel(
        name="residual-memory", label="correlation", title="Autocorrelation of the residuals", height=260, zero=True,
        span=(min(-0.4, float(np.nanmin(correlation)) - 0.05), 1.05),
        curves=[chart.Curve(label="correlation with the residual at this lag", colour="speed", y=correlation)],
        levels=[(bound, "95 % of white noise"), (-bound, "")],
    )  # fmt: skip
    drawn = chart.line_chart(panel, lag, "lag [ms]")
    drawn["series"][0]["bars"] = 0
    overlap = {"spans": [[0.0, round(one.width * 1e3, 3)]], "colour": "brake", "label": "windows overlap"}
    return drawn | {"bands": [overlap]}


def friction_figures(
    constants: Constants | None, windows: Sequence[Windows], effort_unit: str, ways: Ways
) -> list[Figure]:
    """The friction map; nothing without a model."""
    if constants is None or not windows:
        return []
    weight = " and minus its weight" if "pendulum" in constants.names else ""
    caption = (
        f"Each ring is a window of the recording: its effort minus the acceleration force{weight}. The line is the "
        "friction of the model, with its 95\u202f% interval. Rings that deviate from the line together, especially at "
        "low speed, indicate friction that the model lacks."
    )
    charts = [friction_chart(constants, windows, effort_unit, ways)]
    return [Figure(title="Measured and modelled", caption=caption, charts=charts)]


def friction_chart(constants: Constants, windows: Sequence[Windows], effort_unit: str, ways: Ways) -> chart.Chart:
    """Draw friction over the velocity: windows, the model's curve and its limits."""
    velocity = np.concatenate([one.velocity for one in windows])
    residual = np.concatenate([one.residual for one in windows])
    every = max(1, -(-len(velocity) // DOTS))
    velocity, residual = velocity[::every], residual[::every]
    friction = friction_at(constants, constants.values, velocity) + residual
    # Velocities of the windows, and between them as many as a smooth curve needs; 0 is one of them.
    top, bottom = max(float(velocity.max()), 0.0), min(float(velocity.min()), 0.0)
    x = np.unique(np.concatenate([velocity, np.linspace(bottom, 0.0, 200), np.linspace(0.0, top, 200)]))
    dots = np.full(len(x), np.nan)
    dots[np.searchsorted(x, velocity)] = friction
    # At standstill friction is whatever holds the axis: no curve.
    curve = np.where(x == 0.0, np.nan, friction_at(constants, constants.values, x))
    half = friction_limits(constants, x)
    half = np.where(half < 2.0 * peak_of(friction), half, np.nan)
    scale, speed = effort_scale(effort_unit, peak_of(friction)), ways.speed
    rings = chart.Curve(label="measured, per window", colour="left", y=dots * scale.factor, rings=5)
    curves = [
        replace(rings, digits=digits_for(peak_of(rings.y))),
        scaled("by the model", "speed", curve, scale, width=2.0),
        scaled("95 % above", "ink", curve + half, scale, width=1.0, dash=(3, 3)),
        scaled("95 % below", "ink", curve - half, scale, width=1.0, dash=(3, 3)),
    ]
    panel = chart.Panel(
        name="friction-map", label=label_of("friction", scale.name), height=320, zero=True, curves=curves
    )
    places = x * speed.factor
    return chart.line_chart(panel, places, label_of("velocity", speed.name), digits=digits_for(peak_of(places)))


def friction_at(constants: Constants, values: Numbers, velocity: Numbers) -> Numbers:
    """Friction of the model, signed as the velocity, with any values of its constants."""
    known = dict(zip(constants.names, values.tolist(), strict=True))
    total = np.zeros(len(velocity))
    for way, sign in (("positive", 1.0), ("negative", -1.0)):
        speed = sign * velocity
        coulomb = known.get(f"coulomb.{way}", 0.0)
        excess = known.get(f"static.{way}", coulomb) - coulomb
        bristle = np.exp(-np.minimum((speed / known["stribeck"]) ** 2, 50.0)) if known.get("stribeck") else 0.0
        friction = coulomb + excess * bristle + known.get(f"viscous.{way}", 0.0) * speed
        total += np.where(speed > 0.0, sign * friction, 0.0)
    return total


def friction_limits(constants: Constants, velocity: Numbers) -> Numbers:
    """Half of the 95 % interval of the friction at some velocities, from the covariance of all its constants."""
    slopes: list[Numbers] = []
    for k, error in enumerate(constants.errors):
        step = np.zeros(len(constants.names))
        step[k] = 1e-3 * error
        more, less = (friction_at(constants, constants.values + sign * step, velocity) for sign in (1.0, -1.0))
        slopes.append((more - less) / (2e-3 * error) if error > 0.0 else np.zeros(len(velocity)))
    slope = np.array(slopes)
    variance = np.einsum("in,ij,jn->n", slope, constants.covariance, slope)
    degrees = float(constants.degrees[slope.any(axis=1)].min(initial=np.inf))
    return quantile(degrees) * np.sqrt(np.maximum(variance, 0.0))
