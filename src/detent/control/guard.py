"""Protection: what a controller watches of its own axis, at every sample of its own.

It knows what the controller knows: the count of its sensor, its own error and command. Each watch counts the samples in
a row in which something is wrong, and the first one that lasts too long is the fault; its code stays until the axis is
enabled anew. A watch that has no samples is off. The faults are numbered as in `errors.GUARD_TEXT`.

An axis cannot speed up against its own effort, unless the sensor counts the wrong way round or a force beyond the
effort drives it; and it cannot stand under an effort that breaks it loose, unless the sensor is stuck. A controller
that weighs its effort (`weigh_effort`) tells the first two apart. Behind a sensor that counts the wrong way round, more
effort speeds the axis up more. Against a force from outside it speeds the axis up less, and a sensor that has once
counted right does so ever after. Such a force is no fault by itself: what comes of it is, the end of the travel, a
command at its limit, a speed, a following error.
"""

from detent.kernel.registers import Registers, block, i1, i4, i8, real, register, u1
from detent.kernel.step import hot_step, step

STUCK, JUMPED, REVERSED = 2, 3, 4
FOLLOWING, SATURATED, OVERSPEED, NO_ARRIVAL = 10, 11, 12, 13
TRAVEL, NO_NUMBER = 32, 52

JUMPS = 2  # jumps of the sensor that are a fault: one alone may be a disturbance of its line
FAST = 2  # samples in a row beyond the largest speed that are a fault


class GuardParams(Registers):
    """Windows and times; a time of 0 switches its watch off."""

    speed: i8 = register("largest movement in a sample; 0: any", unit="count")
    jump: i8 = register("movement in one sample that no motion can make; 0: any", unit="count")
    following: i4 = register("samples beyond the largest following error until that is a fault", unit="count")
    travel: u1 = register("1 watches the ends of the travel")
    saturated: i4 = register("samples with the command at its limit until that is a fault", unit="count")
    stuck: i4 = register("samples at rest under effort that breaks it loose until that is a fault", unit="count")
    reversed: i4 = register("samples of such an effort in which the axis may speed up against it", unit="count")
    softly: i8 = register(
        "faults at which the drive goes on, for somebody brings the axis to rest: a bit per number", unit="code"
    )


class Conduct(Registers):
    """How the axis has behaved, for whoever judges a run: nothing in it decides. `forget_conduct` begins anew."""

    looks: i8 = register("looks of the guard", unit="count")
    limited: i8 = register("of these with the command at its limit", unit="count")
    place: i8 = register("movement over them", unit="count")
    lowest: i8 = register("lowest place among them", unit="count")
    highest: i8 = register("highest place among them", unit="count")
    heading: i1 = register("direction of the last movement: 1 or -1; 0 none yet")
    turns: i8 = register("movements against the one before", unit="count")


class Guard(Registers):
    """What is wrong, and for how many samples in a row."""

    code: u1 = register("first fault since the axis was enabled, by its number; 0 none", unit="code")
    hard: u1 = register("first of them that switches off, 0 none", unit="code")
    side: i1 = register("of a fault of the travel: the end that was passed, -1 lower, 1 upper")
    fresh: u1 = register("1 until the first sample after the axis was enabled")
    beyond: i1 = register("end of the travel that it was beyond then, and has been ever since", unit="code")
    following: i4 = register("samples with too large a following error", unit="count")
    saturated: i4 = register("samples with the command at its limit", unit="count")
    stuck: i4 = register("samples at rest under effort", unit="count")
    fast: i4 = register("samples beyond the largest speed", unit="count")
    jumps: i4 = register("jumps of the sensor since the axis was enabled", unit="count")
    pushed: i4 = register("samples of effort in one direction in the running window", unit="count")
    push: i1 = register("direction of that effort")
    began: i8 = register("movement in the first sample of the window", unit="count")
    awaited: i8 = register("ticks or samples in which the axis must still arrive; 0: none waits", unit="count")
    proven: u1 = register("1 once an effort has sped the axis up in its own direction: the sensor counts right")
    driven: u1 = register("1 while the weighed effort holds back what a force from outside drives")
    conduct: Conduct = block("how the axis has behaved")


class Weighing(Registers):
    """What the effort makes of a motion against it: of a controller that weighs its effort."""

    effort: real = register("effort since the last sample", unit="V")
    moved: i8 = register("movement up to the last sample", unit="count")
    against: i4 = register("samples of motion against the effort", unit="count")
    first: i8 = register("speed against it in the sample before them", unit="count")
    efforts: real = register("sum of the effort over them", unit="V")
    answer: real = register("sum of the effort times what the speed against it grew by", unit="V.count")


@step
def forget_conduct(g: Guard) -> None:
    """Host action: a stretch begins that is to be judged for itself."""
    seen = g.conduct
    seen.looks = seen.limited = seen.place = seen.lowest = seen.highest = seen.turns = 0
    seen.heading = 0


@step
def note_conduct(c: Conduct, limited: int, moved: int) -> None:
    """One look: whether the command has room left, and whether the axis goes to and fro."""
    c.looks += 1
    if limited:
        c.limited += 1
    c.place += moved
    c.lowest, c.highest = min(c.lowest, c.place), max(c.highest, c.place)
    if moved * c.heading < 0:
        c.turns += 1
    if moved != 0:
        c.heading = 1 if moved > 0 else -1


@step
def enable_guard(g: Guard) -> None:
    """Forget the last fault and what led to it: the axis is enabled."""
    g.code = g.hard = g.side = g.push = g.pushed = 0
    g.following = g.saturated = g.stuck = g.fast = g.jumps = 0
    g.awaited = g.proven = g.driven = 0
    g.fresh, g.beyond = 1, 0


@step
def begin_weighing(w: Weighing) -> None:
    """Forget what the effort has done: the axis is enabled."""
    w.moved = w.against = 0
    w.effort = 0.0


@step
def await_arrival(g: Guard, ticks: int) -> None:
    """Host action: the axis must arrive within so many calls of `is_overdue`; 0 lifts it."""
    g.awaited = ticks
    if ticks and g.code == NO_ARRIVAL:
        g.code = 0


@hot_step
def lasting(wrong: int, before: int) -> int:
    """Samples in a row in which something is wrong."""
    return before + 1 if wrong else 0


@hot_step
def trip(p: GuardParams, g: Guard, code: int) -> None:
    """A fault: the first one stays, what follows is its consequence. A late arrival is none, and gives way to one."""
    if g.code in (0, NO_ARRIVAL):
        g.code = code
    if p.softly >> code & 1 == 0 and g.hard == 0:
        g.hard = code


@hot_step
def weigh_effort(w: Weighing, g: Guard, effort: float, moved: int) -> None:
    """Note what the effort since the last sample has made of a motion against it; from now on it is `effort` [V]."""
    if moved == 0 or moved * w.moved < 0 or moved * w.effort > 0.0:
        w.against = 0
    else:
        speed, before = abs(moved), abs(w.moved)
        if w.against == 0:
            w.first, w.efforts, w.answer = before, 0.0, 0.0
        w.against += 1
        w.efforts += abs(w.effort)
        w.answer += abs(w.effort) * (speed - before)
    w.effort, w.moved = effort, moved
    g.driven = g.proven > 0 or is_held_back(w, moved)


@step
def is_held_back(w: Weighing, moved: int) -> bool:
    """True when the effort holds the axis back: a force from outside drives it.

    With u the effort, a what the speed against it grows by in a sample, and means over the motion against it, the sum
    of (u / mean(u) - 1) a is above 0 if the axis speeds up by its effort, and below if it does so in spite of it. The
    sensor rounds a speed by up to one count, so that much is doubt.
    """
    return w.answer * w.against < w.efforts * (abs(moved) - w.first - 1)


@step
def watch_effort(p: GuardParams, g: Guard, pushing: int, moved: int) -> None:
    """Sensor stuck or the wrong way round, by what the effort makes of the movement."""
    g.stuck = lasting(pushing != 0 and moved == 0, g.stuck)
    if 0 < p.stuck <= g.stuck:
        trip(p, g, STUCK)
    if pushing == 0 or pushing != g.push or g.pushed == 0:
        g.push = pushing
        g.pushed = 1 if pushing else 0
        g.began = moved
        return
    g.pushed += 1
    if 0 < p.reversed <= g.pushed:
        gained = pushing * (moved - g.began)
        if pushing * moved < 0 and gained < -1 and not g.driven:
            trip(p, g, REVERSED)
        if pushing * moved > 0 and gained > 1:
            g.proven = 1
        g.pushed = 0


@step
def watch_speed(p: GuardParams, g: Guard, moved: int) -> None:
    """A speed that no command asks for, and a count that no motion can make."""
    fast = 0 < p.speed < abs(moved)
    g.fast = lasting(fast, g.fast)
    if g.fast >= FAST:
        trip(p, g, OVERSPEED)
    elif 0 < p.jump < abs(moved):
        g.jumps += 1
        if g.jumps >= JUMPS:
            trip(p, g, JUMPED)


@step
def watch(p: GuardParams, g: Guard, late: int, side: int, limited: int, pushing: int, moved: int) -> int:
    """One sample; returns the code of the fault that switches off, 0 while there is none.

    `late`: 1 while the following error is beyond its largest, 2 beyond twice that: it grows, and nothing steers any
    more; `side`: -1 or 1 beyond the lower or upper end of the
    travel; `limited`: 1 while the command is at its limit; `pushing`: direction of an effort that breaks the axis
    loose, else 0; `moved`: counts since the last sample.
    """
    g.following = lasting(late, g.following)
    if 0 < p.following <= g.following:
        trip(p, g, FOLLOWING)
        if late > 1 and g.hard == 0:
            g.hard = FOLLOWING
    if g.fresh:  # beyond an end from the start, it may come back from there
        g.fresh, g.beyond = 0, side if p.softly else 0
    elif side != g.beyond:
        g.beyond = 0
    if p.travel and side and side != g.beyond:
        trip(p, g, TRAVEL)
        if g.code == TRAVEL and g.side == 0:
            g.side = side
    g.saturated = lasting(limited, g.saturated)
    if 0 < p.saturated <= g.saturated:
        trip(p, g, SATURATED)
    note_conduct(g.conduct, limited, moved)
    watch_effort(p, g, pushing, moved)
    watch_speed(p, g, moved)
    return g.hard


@hot_step
def watch_number(p: GuardParams, g: Guard, value: float) -> None:
    """What is no number, or infinite, comes from a sensor or a law that has gone wrong, and steers nothing."""
    if not abs(value) < 1e300:
        trip(p, g, NO_NUMBER)


@hot_step
def is_overdue(g: Guard) -> bool:
    """Count a tick or sample down; true when the arrival is overdue. That is told, and the drive goes on holding."""
    g.awaited -= 1
    if g.awaited:
        return False
    if g.code == 0:
        g.code = NO_ARRIVAL
    return True
