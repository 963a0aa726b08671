"""Gauges beside a carriage and a rotary table: how the present move or step went, for whoever watches.

No part of the control.
"""

from detent.kernel.registers import Registers, f8, i8, register
from detent.kernel.step import hot_step, step


class Gauge(Registers):
    """Readings of the present move."""

    target: f8 = register("where the move shall end", unit="m")
    tolerance: f8 = register("distance from the target that counts as arrived", unit="m")
    direction: f8 = register("direction of the move, 1 or -1")
    outside: i8 = register("last tick outside the tolerance", unit="tick")
    beyond: f8 = register("farthest beyond the target so far", unit="m")
    peak_speed: f8 = register("largest speed so far", unit="m/s")


@hot_step
def read_gauge(r: Gauge, tick: int, x: float, velocity: float) -> None:
    """One tick with the carriage at `x` [m]."""
    away = (x - r.target) * r.direction
    if abs(away) > r.tolerance:
        r.outside = tick
    r.beyond = max(r.beyond, away)
    r.peak_speed = max(r.peak_speed, abs(velocity))


@step
def set_gauge(r: Gauge, tick: int, start: float, target: float, tolerance: float) -> None:
    """A move begins: from `start` to `target`, arrived within `tolerance` [m]."""
    r.target, r.tolerance = target, tolerance
    r.direction = 1.0 if target >= start else -1.0
    r.outside, r.beyond, r.peak_speed = tick, -abs(target - start), 0.0


class AngleGauge(Registers):
    """Readings of the present step of a rotary table."""

    peak_speed: f8 = register("largest motor speed at an interrupt so far", unit="rad/s")
    peak_deviation: i8 = register("largest magnitude of dR so far", unit="count/2^f")


@step
def read_angle_gauge(r: AngleGauge, velocity: float, deviation: int) -> None:
    """One interrupt with the motor at `velocity` [rad/s]."""
    r.peak_speed = max(r.peak_speed, abs(velocity))
    r.peak_deviation = max(r.peak_deviation, abs(deviation))


def set_angle_gauge(r: AngleGauge) -> None:
    """A step begins."""
    r.peak_speed, r.peak_deviation = 0.0, 0
