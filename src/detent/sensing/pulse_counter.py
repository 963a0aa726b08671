"""Signed pulse counter over a fixed window: speed by counting (the M method).

Block 350 of the phase servo (specification 3.6) and block 8 of the filtered servo (specification 3.3).
"""

from detent.kernel.registers import Registers, i2, i8, register
from detent.kernel.step import hot_step


class PulseCounterParams(Registers):
    """Width of the counter."""

    half: i8 = register("half the range of the counter, 2^(bits - 1)", unit="count")


class PulseCounter(Registers):
    """Up/down counter with a latch; both wrap as a circuit of this width does."""

    count: i2 = register("pulses since the window opened, forward less backward", unit="count")
    word: i2 = register("pulses of the last closed window", unit="count")


@hot_step
def add_pulses(p: PulseCounterParams, r: PulseCounter, pulses: int) -> None:
    """Count signed pulses."""
    r.count = ((r.count + pulses + p.half) & (2 * p.half - 1)) - p.half


@hot_step
def close_window(r: PulseCounter) -> None:
    """Strobe: latch, then clear, so that no pulse is lost or counted twice."""
    r.word = r.count
    r.count = 0
