"""The tables of a stepper edited where they are read: stops move while it runs (stepper-envelope specification 3.6).

`planning.step_envelope` works a table out on the host. Here the unit that reads it writes it, between two steps, so
that no step ever finds half of an edit. An entry depends on its own zone, on the distance to slower ones, and on the
distance to the stop: an edit costs one ramp length at the old and one at the new place, and a few comparisons per zone.
"""

from typing import Any

from detent.kernel.registers import Registers, i4, i4_array, i8, i8_array, register
from detent.kernel.step import hot_step, step

STRETCHES = 32  # of one limit each that a travel has at most: 14 zones make 29
SENTINEL = -1


class StepTableParams(Registers):
    """One direction: the travel in the order in which it is travelled, as stretches of one speed limit each."""

    direction: i4 = register("of motion: 1 or -1")
    steps: i8 = register("steps of the travel", unit="count")
    reach: i4 = register("entries of the ramp list", unit="count")
    shift: i4 = register("place of the zone number in an entry", unit="bit")
    stretches: i4 = register("stretches of the travel", unit="count")
    edge: i8_array = register(
        "first step of each stretch; behind the last the travel's end", length=STRETCHES, unit="count"
    )
    cap: i4_array = register("largest ramp index in each stretch", length=STRETCHES, unit="count")
    number: i4_array = register("number of its limit", length=STRETCHES, unit="code")


@hot_step
def along(q: StepTableParams, position: int) -> int:
    """Steps from where this direction of travel begins to a position, or the other way round."""
    return position if q.direction > 0 else q.steps - position


@step
def entry_at(q: StepTableParams, way: int, stop: int) -> int:
    """Entry of the step that leaves a place: as fast as it may be, an index a step slower towards what is slower."""
    if way in (stop, q.steps):
        return SENTINEL
    index, number = min(q.steps - 1 - way, way), 0
    for k in range(q.stretches):
        begin, end = q.edge[k], q.edge[k + 1]
        index = min(index, q.cap[k] + max(begin - way, way - end + 1, 0))
        if begin <= way < end:
            number = q.number[k]
    if way < stop:
        index = min(index, stop - 1 - way)
    return index | number << q.shift


@step
def move_stop(q: StepTableParams, entries: Any, former: int, stop: int) -> int:
    """Move the stop from one position to another; gives how many entries were written."""
    at, written = along(q, stop), 0
    for side in range(2):
        place = at if side else along(q, former)
        for way in range(max(place - q.reach + 1, 0), place + 1):
            entries[along(q, way)] = entry_at(q, way, at)
            written += 1
    return written
