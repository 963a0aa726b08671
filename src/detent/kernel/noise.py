"""Reproducible noise inside steps: one seed, the same bytes."""

from detent.kernel.registers import Registers, i8, register
from detent.kernel.step import step

MULTIPLIER = 6364136223846793005
INCREMENT = 1442695040888963407


class NoiseSource(Registers):
    """64-bit linear congruential generator (Knuth's MMIX constants); the high bits are used."""

    state: i8 = register("generator state, wraps at 64 bit", unit="code")


@step
def uniform(r: NoiseSource) -> float:
    """Next number in [0, 1), 31 bits of it."""
    r.state = r.state * MULTIPLIER + INCREMENT
    return ((r.state >> 33) & 0x7FFFFFFF) * (1.0 / 2147483648.0)


@step
def bell(r: NoiseSource) -> float:
    """Next number of zero mean and unit variance: three uniforms summed, so never beyond 3."""
    return 2.0 * (uniform(r) + uniform(r) + uniform(r)) - 3.0


@step
def waiting_time(r: NoiseSource) -> float:
    """Next waiting time of events that come at random, with a mean of 1: exponential, by comparisons alone.

    Von Neumann's method: how often a run of falling numbers has an even length gives the exponential law exactly, and
    no logarithm is needed, which C libraries round differently.
    """
    whole = 0
    while True:
        first = uniform(r)
        last = first
        length = 1
        while True:
            number = uniform(r)
            length += 1
            if number >= last:
                break
            last = number
        if length & 1 == 0:
            return whole + first
        whole += 1
