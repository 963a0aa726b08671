"""Figures of the report of an identification: what drove the axis, by the model too, what is left, and friction."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from markupsafe import Markup

from detent.identify.fit.constants import Constants
from detent.identify.fit.equations import HOPS
from detent.identify.fit.estimate import quantile, rms
from detent.identify.fit.identification import Identification, prepare_all
from detent.identify.fit.prepare import Run
from detent.identify.page.words import SINCE, Ways, digits_for, effort_scale, label_of, peak_of, scaled
from detent.methods.cascade.units import percent
from detent.page.chart import (
    POINTS,
    Chart,
    Curve,
    Heap,
    Panel,
    Timeline,
    histogram_chart,
    line_chart,
    thin_indices,
    time_charts,
)
from detent.page.figure import Figure
from detent.page.parts import Numbers
from detent.page.words import number

LAGS = 60  # lags of the autocorrelation, in rows of the regression
DOTS = 1500  # windows drawn in the friction map


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
        made.append(
            Windows(
                t=rows * run.step,
                effort=fit.effort[part],
                fitted=fit.effort[part] - fit.residual[part],
                residual=fit.residual[part],
                velocity=motion.velocity,
                place=(rows - (int(rows[0]) if len(rows) else 0)) // hop,
                hop=hop * run.step,
                width=(2 * motion.kernel.half + 1) * run.step,
            )
        )
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


# ---- figures


def effort_figures(found: Identification, windows: Sequence[Windows], shown: int) -> list[Figure]:
    """Effort over time of one log, and residuals of all."""
    fit = found.fit
    if fit is None or not windows or not len(windows[shown].t):
        return []
    run, one = found.runs[shown], windows[shown]
    caption = Markup(
        "The model's effort beside the recorded one, both averaged over windows of {}\u202fms; windows with "
        "standstill, a reversal or missing samples are left out. <b>{} of the effort (rms) stays "
        "unexplained.</b> What repeats in the residual is what the model lacks: a force that depends on the "
        "position, cogging, another friction."
    ).format(number(one.width * 1e3), percent(rms(fit.residual) / rms(fit.effort)))
    told = (
        "Left: one hump around 0 is as it should be; the outermost bars hold all that is larger. Right: beyond the "
        "overlap of the windows bars within the dashed lines are noise; bars that stay outside tell of something that "
        "the model lacks. The limits of the constants count with that."
    )
    residuals = [residual_chart(windows, run.effort_unit), memory_chart(windows)]
    return [
        Figure(title="Over time", caption=caption, charts=effort_charts(one, run)),
        Figure(title="Residuals", caption=told, charts=residuals, beside=True),
    ]


def effort_charts(windows: Windows, run: Run) -> list[Chart]:
    """Draw what drove the axis, measured and by the model, and what is left."""
    gaps = np.flatnonzero(np.diff(windows.place) > 1) + 1
    series = [windows.effort, windows.fitted, windows.residual]
    # Rows that draw like all of them, with a gap in every curve before some rows: the chart's own thinning looks for
    # extremes, and would drop the gaps.
    kept = np.unique(np.concatenate([gaps, *(thin_indices(curve, POINTS) for curve in series)])).astype(np.intp)
    holes = np.searchsorted(kept, gaps)
    t = np.insert(windows.t[kept], holes, 0.5 * (windows.t[gaps - 1] + windows.t[gaps]))
    effort, fitted, residual = (np.insert(curve[kept], holes, np.nan) for curve in series)
    scale = effort_scale(run.effort_unit, peak_of(effort))
    curves = [
        scaled("by the model", "speed", fitted, scale, width=2.5, thin=len(t)),
        scaled("recorded", "left", effort, scale, dash=(5, 4), thin=len(t)),
    ]
    left = scaled("recorded less model", "current", residual, scale, thin=len(t))
    return time_charts(Timeline(name="effort", t=t, label=SINCE, unit="s"), [
        Panel(name="effort-both", label=label_of(run.effort_name, scale.name), curves=curves, zero=True),
        Panel(name="effort-left", label=label_of("residual", scale.name), curves=[left], zero=True, height=150),
    ])  # fmt: skip


def residual_chart(windows: Sequence[Windows], unit: str) -> Chart:
    """Count residuals by their size."""
    residual = np.concatenate([one.residual for one in windows])
    # A few far ones must not squeeze all others into one bar; they stand at its end.
    reach = 4.0 * rms(residual) or 1.0
    scale = effort_scale(unit, reach)
    at = np.clip(residual, -reach, reach) * scale.factor
    heap = Heap(label="windows", colour="speed", at=at, counts=np.ones(len(at)))
    labels = (label_of("recorded less model", scale.name), "windows")
    chart = histogram_chart("residual-sizes", [heap], labels, finest=1e-3 * reach * scale.factor)
    return chart | {"title": "How large residuals are"}


def memory_chart(windows: Sequence[Windows]) -> Chart:
    """Draw how much a residual resembles those before it, with the bounds of residuals that do not."""
    correlation, pairs = autocorrelation(windows)
    one = windows[0]
    lag = np.arange(len(correlation)) * one.hop * 1e3
    bound = 1.96 / math.sqrt(max(pairs[0], 1.0))
    panel = Panel(
        name="residual-memory",
        label="correlation",
        title="How much they resemble earlier ones",
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


# ---- friction over the speed, by the model and window by window


def friction_figures(
    constants: Constants | None, windows: Sequence[Windows], effort_unit: str, ways: Ways
) -> list[Figure]:
    """The friction map; nothing without a model."""
    if constants is None or not windows:
        return []
    weight = " and lifts its weight" if "pendulum" in constants.names else ""
    caption = (
        f"Each ring is a window of the recording: its effort less what accelerates the axis{weight}. The line is the "
        "friction of the model, with its 95\u202f% interval. Rings that leave the line together, at low speeds above "
        "all, tell of a friction that the model lacks."
    )
    chart = friction_chart(constants, windows, effort_unit, ways)
    return [Figure(title="Measured and by the model", caption=caption, charts=[chart])]


def friction_chart(constants: Constants, windows: Sequence[Windows], effort_unit: str, ways: Ways) -> Chart:
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
    rings = Curve(label="measured, window by window", colour="left", y=dots * scale.factor, rings=5)
    curves = [
        replace(rings, digits=digits_for(peak_of(rings.y))),
        scaled("by the model", "speed", curve, scale, width=2.0),
        scaled("95 % above", "ink", curve + half, scale, width=1.0, dash=(3, 3)),
        scaled("95 % below", "ink", curve - half, scale, width=1.0, dash=(3, 3)),
    ]
    panel = Panel(name="friction-map", label=label_of("friction", scale.name), height=320, zero=True, curves=curves)
    places = x * speed.factor
    return line_chart(panel, places, label_of("velocity", speed.name), digits=digits_for(peak_of(places)))


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
