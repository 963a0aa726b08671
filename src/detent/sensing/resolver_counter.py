"""Resolvers with phase comparators that count clocks (rotary-table specification 2, 3.1 and 7; blocks 13 to 19).

Fed with a two-phase excitation, the resolver's output lags by its shaft angle. The comparator counts clocks from the
zero crossing of the excitation to that of the output; one excitation period is `counts` clocks, so the word is the
shaft angle in parts of a turn; the words of a fine and a coarse one make an absolute angle. Phases are integers of
2^-32 turn.
"""

import math

from detent.kernel.noise import NoiseSource, uniform
from detent.kernel.registers import Registers, block, f8, i8, register, u1
from detent.kernel.step import step
from detent.kernel.turn_table import FRACTION, TurnTable, at_phase
from detent.sensing.phase_detector import DetectorParams, fill_errors


class ResolverParams(Registers):
    """Resolver, its mounting and its comparator."""

    counts: i8 = register("counter clocks in an excitation period: counts per turn, at most 2^31", unit="count")
    offset: i8 = register("phase at shaft angle 0: how it is mounted", unit="turn/2^32")
    errors: TurnTable = block("lead of the output's zero crossing against phase")
    noise: f8 = register("largest displacement of a zero crossing by noise, uniform", unit="turn/2^32")


@step
def count_phase(p: ResolverParams, noise: NoiseSource, shaft: int) -> int:
    """Clocks from excitation to output, the shaft at a phase in [0, 2^32); positive rotation increases them."""
    phase = (shaft + p.offset) & FRACTION
    if p.errors.used:
        phase += at_phase(p.errors, phase)
    if p.noise > 0.0:
        phase += math.floor((2.0 * uniform(noise) - 1.0) * p.noise + 0.5)
    return ((phase & FRACTION) * p.counts) >> 32


def fill_resolver(p: ResolverParams, gain: float, quadrature: float, offset: float) -> None:
    """Fill the error table from the faults of windings and comparator, as `phase_detector.fill_errors` explains."""
    detector = DetectorParams()
    fill_errors(detector, gain, quadrature, offset)
    p.errors = detector.rise


class CompositionParams(Registers):
    """Sizes and zeros of the fine word, of a motor turn, and the coarse word, of a table turn (3.1; unit 19)."""

    ratio: i8 = register("motor turns per table turn G", unit="count")
    fine: i8 = register("fine counts per motor turn F", unit="count")
    coarse: i8 = register("coarse counts per table turn", unit="count")
    fine_zero: i8 = register("fine word at table angle 0", unit="count")
    coarse_zero: i8 = register("coarse word at table angle 0", unit="count")
    truncating: u1 = register(
        "1: motor turns from the coarse word alone, the way the method is compared with", option=True
    )


class AbsoluteAngle(Registers):
    """Output of the unit."""

    theta: i8 = register("absolute table angle S1, 0..G F - 1", unit="count")
    turns: i8 = register("whole motor turns in it", unit="count")


@step
def compose(p: CompositionParams, r: AbsoluteAngle, fine: int, coarse: int) -> None:
    """Absolute angle of two words: ``n = round(G c / C - f / F) mod G``, ``theta = n F + f``.

    The whole motor turns n are right while the coarse word errs by less than half of one, less a coarse count.
    """
    f = (fine - p.fine_zero) % p.fine
    c = (coarse - p.coarse_zero) % p.coarse
    if p.truncating:
        r.turns = p.ratio * c // p.coarse
    else:
        whole = p.coarse * p.fine
        difference = p.ratio * c * p.fine - f * p.coarse
        r.turns = (2 * difference + whole) // (2 * whole) % p.ratio
    r.theta = r.turns * p.fine + f
