"""Homing: find the place that is the reference of an axis, always from the same side, slowly.

Search at speed until the reference is seen, come to rest, back off, approach at creep speed, and take the position at
which it is seen again: at the edge of a switch, or at the first index mark behind that edge, or where a hard stop
holds the axis. At its end it backs off once more, into its travel. An axis that begins on its switch backs off first.
A contact is a commanded point that runs ahead of an axis that stands; a switch that is never seen ends there, too.

The step tells what drives the axis what to do: it knows neither that nor the sensors. The position found is a shift of
all positions, which the method makes, and which nothing moves.
"""

from detent.kernel.registers import Registers, f8, i8, register, u1, u2
from detent.kernel.step import step

CONTACT, SWITCH, INDEX = range(3)  # what gives the reference
ON, RUN, HALT, GIVE_WAY, FOUND, FAILED = range(6)  # what is to be done
IDLE, CLEAR, SEARCH, SEEN, BACK, READY, APPROACH, LEAVE, MARK, END, RETREAT, LAST = range(12)  # phases
NONE_FOUND, NOT_CLEARED, ACTIVE, INDEX_FAR = 341, 342, 343, 344  # why it failed, `errors.REFUSAL_TEXT`


class HomingParams(Registers):
    """What gives the reference, and how it is looked for."""

    way: u1 = register("0 contact, 1 switch, 2 index mark behind the edge of a switch", unit="code")
    side: f8 = register("direction of the search, 1 or -1", unit="1")
    place: f8 = register("position of the axis at the reference", unit="m")
    speed: f8 = register("of the search", unit="m/s")
    creep: f8 = register("of the approach", unit="m/s")
    back: f8 = register("way of backing off", unit="m")
    longest: f8 = register("longest way of a search", unit="m")
    pitch: f8 = register("longest way from the edge of the switch to the mark", unit="m")
    lag: f8 = register("how far the commanded point may run ahead of an axis that stands", unit="m")
    grain: f8 = register("way that is no motion", unit="m")
    slack: f8 = register("the same as time at the velocity demanded: what runs into its stop swings there", unit="s")
    still: i8 = register("looks without motion that make a contact", unit="count")


class Homing(Registers):
    """What has been found."""

    phase: u1 = register("0 idle; what is being done", unit="code")
    code: u2 = register("why it failed, 0 it did not", unit="code")
    velocity: f8 = register("demanded", unit="m/s")
    begin: f8 = register("where the present way began", unit="m")
    place: f8 = register("where the axis was when it last moved", unit="m")
    still: i8 = register("looks since then, with the commanded point ahead", unit="count")
    marks: i8 = register("index marks passed when the edge was left", unit="count")
    latched: f8 = register("where the reference was seen last", unit="m")


class Seen(Registers):
    """What a look sees."""

    position: f8 = register("of the axis", unit="m")
    ahead: f8 = register("commanded point less position", unit="m")
    rests: u1 = register("1 while the commanded point rests")
    switch: u1 = register("1 on the home switch")
    marks: i8 = register("index marks passed", unit="count")
    mark: f8 = register("position of the last one", unit="m")


@step
def go(r: Homing, s: Seen, phase: int, velocity: float) -> int:
    """Begin a way."""
    r.phase, r.velocity, r.begin = phase, velocity, s.position
    r.place, r.still = s.position, 0
    return RUN


@step
def fail(r: Homing, code: int) -> int:
    """Give up; the axis comes to rest."""
    r.phase, r.code = IDLE, code
    return FAILED


@step
def begin(p: HomingParams, r: Homing, s: Seen) -> int:
    """Set out: towards the reference, or off its switch."""
    r.code = 0
    if p.way != CONTACT and s.switch:
        return go(r, s, CLEAR, -p.side * p.speed)
    return go(r, s, SEARCH, p.side * p.speed)


@step
def is_held(p: HomingParams, r: Homing, s: Seen) -> bool:
    """A hard stop: the commanded point runs ahead, and the axis stands."""
    swing = max(p.grain, p.slack * abs(r.velocity))
    if abs(s.position - r.place) > swing or abs(s.ahead) <= p.lag:
        r.place, r.still = s.position, 0
    else:
        r.still += 1
    return r.still >= p.still


@step
def is_under_way(r: Homing) -> bool:
    """True while the axis shall move, and not come to rest."""
    return r.phase in (CLEAR, SEARCH, BACK, APPROACH, MARK, RETREAT)


@step
def is_pressed(r: Homing, s: Seen) -> bool:
    """True of a search that has ended against something: the commanded point has run ahead into it."""
    return r.still > 0 and s.ahead * r.velocity > 0.0


@step
def look_for(p: HomingParams, r: Homing, s: Seen) -> int:
    """On the way to the reference, fast or slowly."""
    held = is_held(p, r, s)
    if (p.way == CONTACT and held) or (p.way != CONTACT and s.switch):
        r.latched = s.position
        if r.phase == SEARCH:
            r.phase = SEEN
        else:
            r.phase = LEAVE if p.way == INDEX else END
        return GIVE_WAY if p.way == CONTACT else HALT
    longest = p.longest if r.phase == SEARCH else 2.0 * (abs(r.begin - r.latched) + p.back)
    if held or abs(s.position - r.begin) > longest:
        return fail(r, NONE_FOUND)
    return ON


@step
def back_off(p: HomingParams, r: Homing, s: Seen) -> int:
    """On the way back, from where the reference was seen or off a switch on which it began."""
    on = p.way != CONTACT and s.switch
    if r.phase == CLEAR and on:
        if abs(s.position - r.begin) > p.longest or is_held(p, r, s):
            return fail(r, ACTIVE)
        return ON
    if r.phase == CLEAR:
        r.latched = s.position
        return go(r, s, BACK, r.velocity)
    if (r.latched - s.position) * p.side < p.back:
        return ON
    if on:
        return fail(r, NOT_CLEARED)
    r.phase = READY if r.phase == BACK else LAST
    return HALT


@step
def look_for_mark(p: HomingParams, r: Homing, s: Seen) -> int:
    """The first mark behind the edge of the switch."""
    if s.switch:
        r.marks, r.begin = s.marks, s.position
    elif s.marks != r.marks:
        r.latched, r.phase = s.mark, END
        return HALT
    elif abs(s.position - r.begin) > p.pitch:
        return fail(r, INDEX_FAR)
    if is_held(p, r, s):
        return fail(r, NOT_CLEARED)
    return ON


@step
def seek(p: HomingParams, r: Homing, s: Seen) -> int:
    """One look; gives what is to be done."""
    if r.phase in (SEARCH, APPROACH):
        return look_for(p, r, s)
    if r.phase in (CLEAR, BACK, RETREAT):
        return back_off(p, r, s)
    if r.phase == MARK:
        return look_for_mark(p, r, s)
    if s.rests == 0 or r.phase == IDLE:
        return ON
    if r.phase == SEEN:
        return go(r, s, BACK, -p.side * p.speed)
    if r.phase == READY:
        return go(r, s, APPROACH, p.side * p.creep)
    if r.phase == LEAVE:
        r.marks = s.marks
        return go(r, s, MARK, -p.side * p.creep)
    if r.phase == END:
        return go(r, s, RETREAT, -p.side * p.speed)
    r.phase = IDLE
    return FOUND
