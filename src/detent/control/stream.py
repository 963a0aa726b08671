"""Set-points that somebody sends again and again, and the reference between them.

A set-point is reached in a straight line, one interpolation period after it was taken: from where the reference is
then. The difference to the one before is its slope, the difference of two slopes its bend: velocity and acceleration of
a position, as a trajectory would have them. Where the next set-point is late a position goes on along its slope; after
`LATEST` periods more the stream is lost.

A set-point is for now: what came before it, and was not reached, is passed over. Or it is for its turn: it waits until
the one before it has been reached. One of these may be the last, at which the reference rests.
"""

from detent.kernel.registers import Registers, f8, f8_array, i8, register, u1
from detent.kernel.step import hot_step, step

NONE, POSITION, VELOCITY, EFFORT = range(4)  # what is streamed
LATEST = 5  # periods that a set-point may be late
AHEAD = 64  # set-points that wait for their turn at most
OPEN, CLOSING, CLOSED = range(3)  # the last one: has not come, waits or is reached for, has been reached


class Stream(Registers):
    """A stream of set-points; values are of what is streamed."""

    quantity: u1 = register("what is streamed: 0 nothing, 1 position, 2 velocity, 3 effort", unit="code")
    begun: u1 = register("1 once the first set-point has been taken")
    fresh: u1 = register("1 from then to the next look")
    closing: u1 = register("the last set-point: 0 has not come, 1 has come, 2 has been reached", unit="code")
    looks: i8 = register("looks in an interpolation period", unit="count")
    period: f8 = register("interpolation period", unit="s")
    since: i8 = register("looks since the newest set-point was taken", unit="count")
    goal: f8 = register("newest set-point", unit="m")
    start: f8 = register("reference when it was taken", unit="m")
    slope: f8 = register("its difference to the one before it, in time", unit="m/s")
    bend: f8 = register("difference of the last two slopes, in time", unit="m/s2")
    value: f8 = register("reference", unit="m")
    taken: i8 = register("set-points taken", unit="count")
    late: i8 = register("periods in which the next set-point was late", unit="count")
    dropped: i8 = register("set-points that belong to no stream, or found no room", unit="count")
    first: i8 = register("set-points that have had their turn", unit="count")
    last: i8 = register("set-points that were to wait for their turn", unit="count")
    waiting: f8_array = register("those that still do", length=AHEAD, unit="m")


@step
def open_stream(s: Stream, quantity: int, looks: int, period: float) -> None:
    """Nothing has come yet."""
    s.quantity, s.looks, s.period = quantity, looks, period
    s.begun = s.fresh = s.closing = 0
    s.since = s.taken = s.late = s.dropped = s.first = s.last = 0
    s.goal = s.start = s.slope = s.bend = s.value = 0.0


@step
def take_point(s: Stream, value: float, here: float) -> None:
    """A set-point is reached for from now on; `here` is the reference, which the first one is compared with."""
    steps, before = 1, s.slope
    if s.begun == 0:
        s.begun = s.fresh = 1
        s.goal = here
    else:  # where some of them were lost, the difference is that of more periods than one
        steps = max(1, (s.since + s.looks // 2) // s.looks)
    s.slope = (value - s.goal) / (steps * s.period)
    s.bend = (s.slope - before) / s.period if s.taken else 0.0
    s.goal, s.since = value, 0
    s.taken += 1


@step
def point_now(s: Stream, value: float, here: float) -> None:
    """A set-point for now: those that wait are passed over."""
    s.first = s.last
    take_point(s, value, here)


@step
def point_in_turn(s: Stream, value: float, here: float, is_last: int) -> bool:
    """A set-point for its turn; False where as many wait as can, or the last one has come."""
    if s.closing or s.last - s.first >= AHEAD:
        return False
    if s.begun == 0:
        take_point(s, value, here)
    else:
        s.waiting[s.last % AHEAD] = value
        s.last += 1
    s.closing = is_last
    return True


@hot_step
def is_lost(s: Stream) -> bool:
    """Nothing has come for too long."""
    return s.begun != 0 and s.closing != CLOSED and s.since >= (1 + LATEST) * s.looks


@step
def advance_stream(s: Stream, here: float) -> None:
    """The reference one look later; `here` is where the last one has led, which may be elsewhere."""
    if s.begun == 0 or s.closing == CLOSED:
        return
    if s.since >= s.looks and s.first < s.last:
        take_point(s, s.waiting[s.first % AHEAD], here)
        s.first += 1
    elif s.since >= s.looks and s.closing == CLOSING:
        s.closing = CLOSED
        return
    if s.since == 0:
        s.start = here
    s.since += 1
    if s.since > s.looks:
        s.bend = 0.0
        s.slope = s.slope if s.quantity == POSITION else 0.0
        s.late += 1 if s.since % s.looks == 1 or s.looks == 1 else 0
    s.value = reference(s)


@hot_step
def reference(s: Stream) -> float:
    """The reference of this look."""
    if s.since < s.looks:
        return s.start + (s.goal - s.start) * (s.since / s.looks)
    if s.quantity == POSITION:
        return s.goal + s.slope * (s.period * (s.since - s.looks) / s.looks)
    return s.goal
