"""Winding of a brush DC motor at a voltage, or none: then the source drives with a force.

    L di/dt = u - R i - k_e v,    F = k_t i

Without inductance the current follows at once. An amplifier's current limit holds the current there: the voltage that
would drive it further is not applied.
"""

from detent.kernel.registers import Registers, f8, register, u1
from detent.kernel.step import hot_step


class WindingParams(Registers):
    """Constants of the winding, in the coordinate of the axis."""

    used: u1 = register("1 the source puts out a voltage, 0 a force")
    resistance: f8 = register("winding, brushes and amplifier", unit="ohm")
    inductance: f8 = register("winding; 0: the current follows voltage and velocity at once", unit="H")
    force_constant: f8 = register("force per current", unit="N/A")
    emf_constant: f8 = register("back-EMF per velocity", unit="V.s/m")
    max_current: f8 = register("limit of the amplifier", unit="A")


@hot_step
def limit_current(p: WindingParams, current: float) -> float:
    """The current within the amplifier's limit [A]."""
    return min(max(current, -p.max_current), p.max_current)


@hot_step
def flowing_current(p: WindingParams, effort: float, current: float, velocity: float) -> float:
    """Current [A] at the voltage `effort` [V] and `velocity` [m/s]; with inductance, `current`."""
    if p.used == 0:
        return 0.0
    if p.inductance == 0.0:
        return limit_current(p, (effort - p.emf_constant * velocity) / p.resistance)
    return limit_current(p, current)


@hot_step
def motor_force(p: WindingParams, effort: float, current: float, velocity: float) -> float:
    """Force of the motor [N] at `effort`, a voltage [V] or without a winding the force itself."""
    if p.used == 0:
        return effort
    return p.force_constant * flowing_current(p, effort, current, velocity)


@hot_step
def current_rate(p: WindingParams, effort: float, current: float, velocity: float) -> float:
    """Rate of the current [A/s]; 0 where it is no state of its own."""
    if p.used == 0 or p.inductance == 0.0:
        return 0.0
    rate = (effort - p.resistance * current - p.emf_constant * velocity) / p.inductance
    if (current >= p.max_current and rate > 0.0) or (current <= -p.max_current and rate < 0.0):
        return 0.0
    return rate
