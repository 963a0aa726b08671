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
