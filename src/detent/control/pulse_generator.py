"""Host side of a pulse-commanded servo: evenly spaced command pulses, with an acceleration limit on request.

Rates are whole millionths of a pulse per second: a pulse falls due when the phase accumulator has gathered 10^12
(10^6 clocks per second times 10^6), so the spacing is exact and an endless command never drifts.
"""

import math

from detent.kernel.registers import Registers, f8, i1, i8, register
from detent.kernel.step import hot_step, step

PER_PULSE = 1_000_000  # rate of one pulse per second
FULL = 1_000_000 * PER_PULSE  # phase of one pulse


class PulseGeneratorParams(Registers):
    """Acceleration of the command."""

    acceleration: f8 = register("change of rate per tick; 0 jumps to the rate at once", unit="uHz")
    ticks_per_second: f8 = register("base ticks per second", unit="1/s")


class PulseGenerator(Registers):
    """What was asked for and what has been put out."""

    goal: i8 = register(
        "command position asked for, written by the host; where the command is: stop at once", unit="count"
    )
    rate: i8 = register("rate asked for, written by the host", unit="uHz")
    command: i8 = register("command position: pulses put out so far", unit="count")
    direction: i1 = register("direction of the pulses: 1, -1, or 0 at rest")
    present: i8 = register("rate of the running tick", unit="uHz")
    phase: i8 = register("phase accumulator, 10^12 to a pulse", unit="count")


@hot_step
def keeps_rate(p: PulseGeneratorParams, r: PulseGenerator) -> bool:
    """True while the rate asked for is reached and braking is still off: ``v^2 <= 2 a s``, with `s` a pulse short."""
    ahead = (r.goal - r.command) * r.direction - 1
    limit = 2.0 * p.acceleration * p.ticks_per_second * PER_PULSE * ahead
    return r.present == r.rate and ahead >= 0 and 1.0 * r.rate * r.rate <= limit


@step
def ramp_rate(p: PulseGeneratorParams, r: PulseGenerator) -> None:
    """Rate and direction of this tick.

    With an acceleration the rate changes by no more than that, except that it never exceeds what can still be braked to
    zero at the goal: the command does not pass it. A goal behind the command is gone back to after braking.
    """
    left = r.goal - r.command
    side = (1 if left > 0 else 0) - (1 if left < 0 else 0)
    if side == 0 or p.acceleration == 0.0:
        r.direction = side
        r.present = r.rate if side else 0
        r.phase = r.phase if side else 0
        return
    if side != r.direction and r.present <= p.acceleration:
        r.direction = side
        r.present = 0
        r.phase = 0
    ahead = left * r.direction - r.phase / FULL
    # v^2 = 2 a s, with a in uHz per tick and s in pulses; the last of the way takes a pulse per second at least.
    square = max(2.0 * p.acceleration * p.ticks_per_second * PER_PULSE * ahead, 0.0)
    limit = max(math.sqrt(square), 1.0 * PER_PULSE) if left * r.direction > 0 else r.present - p.acceleration
    wanted = max(min(r.rate * 1.0, limit), r.present - p.acceleration)
    r.present = int(max(min(wanted, r.present + p.acceleration, limit), 0.0))


@hot_step
def steer_rate(p: PulseGeneratorParams, r: PulseGenerator) -> None:
    """Rate and direction of this tick, where they change."""
    moving = r.command != r.goal or r.present > 0
    if moving and not keeps_rate(p, r):
        ramp_rate(p, r)


@hot_step
def is_between_pulses(p: PulseGeneratorParams, r: PulseGenerator, clocks: int) -> bool:
    """True when so many decoder clocks do no more than add to the phase."""
    if r.command == r.goal:
        return r.present == 0
    return keeps_rate(p, r) and r.phase + r.present * clocks < FULL


@hot_step
def clock_generator(r: PulseGenerator, clocks: int) -> int:
    """So many decoder clocks; the command pulses in them, signed."""
    if r.command == r.goal:
        return 0
    r.phase += r.present * clocks
    if r.phase < FULL:
        return 0
    pulses = r.phase // FULL
    ahead = (r.goal - r.command) * r.direction
    if 0 < ahead <= pulses:
        pulses = ahead
        r.phase = (r.phase - pulses * FULL) % r.present  # the clocks after the last pulse add nothing
    else:
        r.phase -= pulses * FULL
    r.command += pulses * r.direction
    return pulses * r.direction
