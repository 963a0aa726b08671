"""Reduction gear with backlash and eccentricity (rotary-table specification 2; gear 11 and reduction 14).

Friction holds the output side, so it stays where it is while the driving flank crosses the backlash, and follows from
then on. Backlash is kept as the output's place relative to the motor: it never meets the end of a turn.
"""

import math

from detent.kernel.elementary import sin
from detent.kernel.registers import Registers, block, f8, i8, register
from detent.kernel.step import hot_step, step
from detent.kernel.turn_table import FRACTION, TURN, TurnTable, at_phase, fill_table

PHASE_PER_RADIAN = TURN / (2 * math.pi)


class GearParams(Registers):
    """Constants of one gear."""

    ratio: i8 = register("motor turns per output turn, below 2^30", unit="count")
    half_backlash: f8 = register("half the backlash, at the motor", unit="rad")
    eccentricity: TurnTable = block("what the output leads its place by, against its phase")


class Gear(Registers):
    """Place of the output."""

    slack: f8 = register("output less motor, at the motor; within half the backlash", unit="rad")


@hot_step
def follow(p: GearParams, r: Gear, travel: float) -> None:
    """The motor has turned by `travel` [rad]: the output stays until a flank takes it along."""
    r.slack = min(max(r.slack - travel, -p.half_backlash), p.half_backlash)


@step
def output_phase(p: GearParams, slack: float, turns: int, angle: float) -> int:
    """Phase of the output, the motor at `turns` whole turns and `angle` [rad].

    Counted from the whole output turns in `turns`: by slack and eccentricity it comes below 0 and beyond 2^32.
    """
    phase = (((turns % p.ratio) << 32) + math.floor((angle + slack) * PHASE_PER_RADIAN)) // p.ratio
    return phase + at_phase(p.eccentricity, phase & FRACTION) if p.eccentricity.used else phase


def fill_eccentricity(p: GearParams, amplitude: float, angle: float) -> None:
    """Let the output lead by ``amplitude * sin(output - angle)``, both in radians; the output is right at `angle`."""
    fill_table(p.eccentricity, lambda turns: amplitude * sin(2 * math.pi * turns - angle) / (2 * math.pi))
