"""First-order low-pass on the counted speed, in floating or fixed point (filtered-servo specification 3.4; block 9).

Clocked by the same strobe as the counter: ``y += A (B n - y)`` with the count of the window that has just closed.
"""

from detent.kernel.registers import Registers, f8, i4, register, u1
from detent.kernel.step import step

NONE, FLOAT, FIXED = 0, 1, 2


class SpeedFilterParams(Registers):
    """Scale, coefficient and arithmetic of the filter."""

    kind: u1 = register("0 no filter, 1 floating point, 2 fixed point", unit="code")
    scale: i4 = register("B: multiplier of the count, before the filter")
    coefficient: f8 = register("A: share of the new value, above 0 and at most 1")
    shift: u1 = register("fixed point: the filter takes 2^-shift of a new sample, A", unit="bit")
    fraction_bits: u1 = register("fixed point: bits after the point", unit="bit")


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
