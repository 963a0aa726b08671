"""Figure of the report of an identification: friction over the speed, by the model and window by window."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from detent.identify.fit.constants import Constants
from detent.identify.fit.estimate import quantile
from detent.identify.page.effort import Windows
from detent.identify.page.words import Ways, digits_for, effort_scale, label_of, peak_of, scaled
from detent.page.chart import Chart, Curve, Panel, line_chart
from detent.page.figure import Figure
from detent.page.parts import Numbers

DOTS = 1500  # windows drawn in the friction map


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
