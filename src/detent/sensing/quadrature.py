"""Quadrature decoder: four counts per encoder cycle, direction from the order of the channels."""

from detent.kernel.registers import Registers, i8, register, u1
from detent.kernel.step import hot_step


class Quadrature(Registers):
    """Count of quarter cycles and the levels it was formed from."""

    count: i8 = register("quarter cycles since power-on, right positive", unit="count")
    previous: u1 = register("last levels as a position 0..3 on the cycle", unit="code")
    illegal: i8 = register("transitions in which both channels changed at once", unit="count")


@hot_step
def cycle_position(a: int, b: int) -> int:
    """Quarter of the cycle from the two levels: A leads B moving right."""
    if a:
        return 1 if b else 0
    return 2 if b else 3


@hot_step
def count_edge(r: Quadrature, a: int, b: int) -> int:
    """Take new levels; returns the step in quarter cycles: 1, -1 or 0 (no or an illegal change)."""
    now = cycle_position(a, b)
    change = (now - r.previous) & 3
    r.previous = now
    if change == 1:
        r.count += 1
        return 1
    if change == 3:
        r.count -= 1
        return -1
    if change == 2:
        r.illegal += 1
    return 0
