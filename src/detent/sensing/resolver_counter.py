"""Resolver with a phase comparator that counts clocks (rotary-table specification 2 and 7; blocks 13, 15, 17, 18).

Fed with a two-phase excitation, the resolver's output lags by its shaft angle. The comparator counts clocks from the
zero crossing of the excitation to that of the output; one excitation period is `counts` clocks, so the word is the
shaft angle in parts of a turn. Phases are integers of 2^-32 turn.
"""

import math

from detent.kernel.noise import NoiseSource, uniform
from detent.kernel.registers import Registers, block, f8, i8, register
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
