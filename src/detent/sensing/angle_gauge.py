"""A gauge beside the rotary table: how the present step went, for whoever watches. No part of the control."""

from detent.kernel.registers import Registers, f8, i8, register
from detent.kernel.step import step


class AngleGauge(Registers):
    """Readings of the present step."""

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
