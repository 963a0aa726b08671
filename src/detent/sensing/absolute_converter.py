"""Absolute position inside a pitch: XOR phase detector and gated counter (phase-servo specification 3.5; block 600)."""

from detent.kernel.registers import Registers, i8, register, u1, u2
from detent.kernel.step import hot_step


class AbsoluteParams(Registers):
    """Length of the free counter."""

    mask: i8 = register("counts per cycle N, less one", unit="count")
    top: i8 = register("number of the counter's top bit", unit="count")


class AbsoluteConverter(Registers):
    """Counters and latch."""

    free: u2 = register("free counter 601", unit="count")
    msb: u1 = register("its top bit")
    gated: u2 = register(
        "gated counter 603: ticks since the last latch in which PS and the top bit differed", unit="count"
    )
    word: u2 = register("latch 604: absolute position word 600a, 0..N", unit="count")
    latched: u1 = register("1 in the tick that renewed the word")


@hot_step
def count_absolute(p: AbsoluteParams, r: AbsoluteConverter, ps: int) -> None:
    """One first clock: where the top bit rises, latch and then clear; count while PS and the top bit differ."""
    r.free = (r.free + 1) & p.mask
    before = r.msb
    r.msb = r.free >> p.top
    r.latched = r.msb & (before ^ 1)
    if r.latched:
        r.word = r.gated
        r.gated = 0
    r.gated += r.msb ^ ps


@hot_step
def absolute_error(p: AbsoluteParams, r: AbsoluteConverter) -> int:
    """Error word e in steps, target - actual: half the word from its middle; its lowest bit is 0 at 50 % duty."""
    return (r.word >> 1) - ((p.mask + 1) >> 2)
