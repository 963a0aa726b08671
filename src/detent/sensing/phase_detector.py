"""Resolver or Inductosyn as a phase modulator, with its comparator (phase-servo specification 3.3).

The secondary's voltage is a sine whose phase leads the carrier by one turn per pitch. Phases are integers of 2^-32
turn, so that an edge falls on a tick or beside it, never on a rounding error. What a real detector does wrong (windings
of unequal gain, not at right angles, an offset of the comparator) moves the two zero crossings of a cycle by amounts
that depend on position only; a table per pitch holds them (`fill_errors`).
"""

import math

from detent.kernel.elementary import angle_of, sin
from detent.kernel.noise import NoiseSource, bell
from detent.kernel.registers import Registers, block, f8, i8, register, u1
from detent.kernel.step import hot_step, step
from detent.kernel.turn_table import FRACTION, POINTS, TURN, TurnTable, at_phase

QUARTER = TURN >> 2
HALF = TURN >> 1
JITTER_LIMIT = 0.2  # an edge is never displaced by more turns than this: the two edges of a cycle cannot meet


class DetectorParams(Registers):
    """Pitch, place and faults of the detector and its comparator."""

    turns_per_metre: f8 = register("electrical turns per travel", unit="turn/2^32/m")
    offset: i8 = register("phase at position 0", unit="turn/2^32")
    carrier_shift: i8 = register("32 - log2 N: the carrier counter as a phase", unit="count")
    rise: TurnTable = block("lead of the rising edge against position")
    fall: TurnTable = block("lead of the falling edge against position")
    jitter: f8 = register("rms displacement of an edge of the comparator", unit="turn/2^32")


class Detector(Registers):
    """What the comparator works with."""

    phase: i8 = register("phase of the secondary against the carrier", unit="turn/2^32")
    half: u1 = register("which edge the present displacement belongs to")
    shake: i8 = register("displacement of the next edge by noise", unit="turn/2^32")
    noise: NoiseSource = block("noise of the comparator")


@hot_step
def compare(p: DetectorParams, r: Detector, count: int, x: float) -> int:
    """PS at carrier count `count` with the carriage at `x` [m]: high in the second half of a turn."""
    r.phase = (math.floor(x * p.turns_per_metre + 0.5) + p.offset) & FRACTION
    if p.rise.used == 0 and p.jitter == 0.0:
        return ((r.phase + (count << p.carrier_shift)) & FRACTION) >> 31
    return compare_imperfect(p, r, count)


@step
def compare_imperfect(p: DetectorParams, r: Detector, count: int) -> int:
    """The same with displaced edges."""
    angle = (r.phase + (count << p.carrier_shift)) & FRACTION
    if p.jitter > 0.0:
        half = ((angle + QUARTER) & FRACTION) >> 31
        if half != r.half:  # halfway between two edges: what displaces the next one
            r.half = half
            limit = JITTER_LIMIT * TURN
            r.shake = int(min(max(p.jitter * bell(r.noise), -limit), limit))
    # Less than a quarter turn: the two edges of a cycle never change places.
    rise = min(max(at_phase(p.rise, r.phase) + r.shake, 1 - QUARTER), QUARTER - 1)
    fall = min(max(at_phase(p.fall, r.phase) + r.shake, 1 - QUARTER), QUARTER - 1)
    from_middle = ((angle - HALF - QUARTER + HALF) & FRACTION) - HALF
    return 1 if -QUARTER - rise <= from_middle < QUARTER - fall else 0


def fill_errors(p: DetectorParams, gain: float, quadrature: float, offset: float) -> None:
    """Fill the tables of displaced zero crossings from the faults of windings and comparator.

    With the electrical angle x the secondary carries ``(1 + gain) sin(wt) cos(x) + cos(wt + quadrature) sin(x)``,
    compared with `offset`. Written as ``a sin(wt) + b cos(wt)`` it crosses the offset where
    ``sin(wt + atan2(b, a)) = offset / sqrt(a^2 + b^2)``.
    """
    p.rise.used = p.fall.used = 1 if gain or quadrature or offset else 0
    quarter = 0.5 * math.pi
    for k in range(POINTS + 1):
        x = 2 * math.pi * k / POINTS
        a = (1 + gain) * sin(x + quarter) - sin(quadrature) * sin(x)
        b = sin(quadrature + quarter) * sin(x)
        lead = math.remainder(angle_of(b, a) - x, 2 * math.pi)
        share = max(-1.0, min(1.0, offset / math.sqrt(a * a + b * b)))
        late = angle_of(share, math.sqrt(1.0 - share * share))
        # PS is high where the voltage is below the offset: it then rises earlier and falls later.
        p.rise.value[k] = round((lead + late) / (2 * math.pi) * TURN)
        p.fall.value[k] = round((lead - late) / (2 * math.pi) * TURN)
