"""Interpolator: the theoretical remaining angle runs to zero in a trapezoid of speed (rotary-table specification 3.3).

The remaining angle IR has fraction bits, 32.16 by default, and speed and acceleration per interrupt have as many:
at a slow jog an interrupt moves less than one count.
"""

import math

from detent.kernel.registers import Registers, i8, register
from detent.kernel.step import step


class InterpolatorParams(Registers):
    """Format and acceleration; f is the number of fraction bits."""

    fraction: i8 = register("fraction bits f of remaining angle, speed and acceleration, at most 16", unit="count")
    acceleration: i8 = register("change of speed per interrupt, above 0", unit="count/2^f")
    max_speed: i8 = register("largest speed, whatever dial or table say", unit="count/2^f")


class Interpolator(Registers):
    """Remaining angle and speed."""

    irr: i8 = register("IRR: theoretical remaining angle IR", unit="count/2^f")
    speed: i8 = register("v: what IR loses per interrupt", unit="count/2^f")


@step
def interpolate(p: InterpolatorParams, r: Interpolator, limit: int) -> None:
    """Step 222: one interrupt; `limit` is the speed of dial or table.

    ``v <= sqrt(2 a IR)`` lets it end at rest. A dial turned down takes the speed back no faster than the acceleration.
    """
    allowed = max(min(limit, p.max_speed), r.speed - p.acceleration)
    braking = math.floor(math.sqrt(2.0 * p.acceleration * r.irr))
    r.speed = min(r.speed + p.acceleration, allowed, braking)
    r.irr -= min(r.speed, r.irr)
    if r.irr == 0:
        r.speed = 0


@step
def braking_path(p: InterpolatorParams, r: Interpolator) -> int:
    """Path from the present speed to rest, v^2 / 2a [count/2^f]."""
    return r.speed * r.speed // (2 * p.acceleration)
