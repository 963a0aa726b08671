"""Speed by counting (the M method): a signed pulse counter over a fixed window, and a first-order low-pass behind it.

Counter: block 350 of the phase servo (specification 3.6) and 8 of the filtered servo (3.3). Filter: its block 9 (3.4),
clocked by the same strobe: ``y += A (B n - y)`` with the count of the window that has just closed.
"""

from detent.kernel.registers import Registers, f8, i2, i4, i8, register, u1
from detent.kernel.step import hot_step, step


class PulseCounterParams(Registers):
    """Width of the counter."""

    half: i8 = register("half the range of the counter, 2^(bits - 1)", unit="count", range=(1, 1 << 15))


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


NONE, FLOAT, FIXED = 0, 1, 2


class SpeedFilterParams(Registers):
    """Scale, coefficient and arithmetic of the filter."""

    kind: u1 = register("0 no filter, 1 floating point, 2 fixed point", unit="code", option=True)
    scale: i4 = register("B: multiplier of the count, before the filter")
    coefficient: f8 = register("A: share of the new value, above 0 and at most 1")
    shift: u1 = register("fixed point: the filter takes 2^-shift of a new sample, A", unit="bit", range=(0, 31))
    fraction_bits: u1 = register("fixed point: bits after the point", unit="bit", range=(0, 31))


class SpeedFilter(Registers):
    """Filtered speed word."""

    input: i4 = register("scaled count x = B n", unit="count")
    accumulator: i4 = register("fixed point: output with its fraction", unit="count")
    output: f8 = register("filtered speed y, in pulses of following error", unit="count")


@step
def filter_speed(p: SpeedFilterParams, r: SpeedFilter, count: int) -> None:
    """One sample: the count of the window that has just closed."""
    r.input = p.scale * count
    if p.kind == NONE:
        r.output = r.input * 1.0
    elif p.kind == FLOAT:
        r.output = p.coefficient * r.input + (1.0 - p.coefficient) * r.output
    else:
        r.accumulator += ((r.input << p.fraction_bits) - r.accumulator) >> p.shift
        r.output = r.accumulator / (1 << p.fraction_bits)
