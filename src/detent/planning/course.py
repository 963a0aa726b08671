"""Course of a live axis: what is commanded, sample by sample, and how that changes at any sample.

A move, a jog and a stop are the same thing: drive towards a speed for a while, then make the shortest stop. A stop
drives for no time at all; a jog drives until the stop must begin that ends at the soft limit; a move drives until the
stop must begin that ends at its target. The later the stop begins, the farther away it ends, so that moment is found
by halving; driving with all that speed, acceleration and jerk allow, and stopping likewise, is the quickest way there.
Every plan starts from what is commanded now, so nothing steps, and ends at rest: a host that dies leaves a stop behind.

Haschke, Weitnauer, Ritter: On-line planning of time-optimal, jerk-limited trajectories. IROS 2008.
"""

import math

from detent.kernel.registers import Registers, block, f8, f8_array, i1, i8, register, u1
from detent.kernel.step import hot_step, step
from detent.planning.speed_ramp import level_speed, passed, ramp, reach, way_to_rest, way_with_stop

REST, GO, RUN, STOP, LED = 0, 1, 2, 3, 4  # modes
# What a command gives back; the texts stand in `errors.COURSE_REFUSAL_TEXT`.
TAKEN, OUT_OF_RANGE, BEYOND_LIMIT, TOO_FAST, UNUSABLE_LIMITS = 0, 1, 2, 3, 4

FARTHEST = 1e9  # no place is farther from 0 [m]
LEAST, LARGEST = 1e-9, 1e12  # what a speed, an acceleration, a jerk may be limited to [m/s, m/s^2, m/s^3]
LONGEST_PERIOD = 1.0  # of a sample [s]
STRETCHES = 7  # of constant jerk: three of driving, one at speed, three of the stop
SOON = 4  # samples that an axis without its loops is looked ahead
HALVINGS = 100  # of the time in which the stop must begin
ROUNDING = 1e-13  # what two ways to reckon a place may differ by, of the lengths that take part


class CourseLimits(Registers):
    """What the axis may do; a host may change it at any sample."""

    speed: f8 = register("largest speed", unit="m/s")
    acceleration: f8 = register("largest acceleration", unit="m/s^2")
    jerk: f8 = register("largest jerk; 0: any, the speed is a trapezoid", unit="m/s^3")
    lowest: f8 = register("lower soft limit; may be infinite", unit="m")
    highest: f8 = register("upper soft limit; may be infinite", unit="m")


class Course(Registers):
    """The commanded point and the plan that it follows."""

    position: f8 = register("commanded position", unit="m")
    velocity: f8 = register("commanded velocity", unit="m/s")
    acceleration: f8 = register("commanded acceleration", unit="m/s^2")
    mode: u1 = register("0 at rest, 1 goes to a target, 2 runs at a velocity, 3 stops, 4 is led", unit="code")
    target: f8 = register("target, of mode 1", unit="m")
    run: f8 = register("velocity asked for, of mode 2", unit="m/s")
    end: f8 = register("place where the plan ends, at rest", unit="m")
    bottom: f8 = register("lowest place of the plan as far as it is bounded", unit="m")
    top: f8 = register("highest place of the plan as far as it is bounded", unit="m")
    limits: CourseLimits = block("limits in force")
    asked: CourseLimits = block("limits as they were last looked at")
    waiting: u1 = register("1: a gentler acceleration or jerk is asked for than is in force")
    due: u1 = register("1: plan anew at the next sample")
    period: f8 = register("time between two samples", unit="s")
    samples: i8 = register("samples since the first one in the present stretch", unit="count")
    since: f8 = register("time of that sample in its stretch", unit="s")
    stretch: i1 = register("present stretch", unit="count")
    stretches: i1 = register("stretches of the plan", unit="count")
    duration: f8_array = register("duration of a stretch", unit="s", length=STRETCHES + 1)
    anchor: f8_array = register("moment of a stretch that its state is given for", unit="s", length=STRETCHES + 1)
    x: f8_array = register("position at that moment", unit="m", length=STRETCHES + 1)
    v: f8_array = register("velocity then", unit="m/s", length=STRETCHES + 1)
    a: f8_array = register("acceleration then", unit="m/s^2", length=STRETCHES + 1)
    j: f8_array = register("jerk", unit="m/s^3", length=STRETCHES + 1)


# ---------------------------------------------------------------------------------------------------------- commands


@step
def begin_at(c: Course, position: float) -> int:
    """At rest, here."""
    if not -FARTHEST <= position <= FARTHEST:
        return OUT_OF_RANGE
    rest_at(c, position)
    return TAKEN


@step
def go_to(p: CourseLimits, c: Course, target: float) -> int:
    """To rest at a target, in the least time."""
    if not is_usable(p):
        return UNUSABLE_LIMITS
    if not -FARTHEST <= target <= FARTHEST:
        return OUT_OF_RANGE
    if (target < p.lowest and target < c.position) or (target > p.highest and target > c.position):
        return BEYOND_LIMIT
    take_limits(p, c, -FARTHEST, FARTHEST)
    c.mode, c.target = GO, target
    lay(c)
    return TAKEN


@step
def run_at(p: CourseLimits, c: Course, velocity: float) -> int:
    """To a velocity, until something else is commanded or the stop must begin that ends at the soft limit.

    A velocity below `LEAST` is none: a stop, which is never refused.
    """
    if abs(velocity) < LEAST:
        come_to_rest(p, c)
        return TAKEN
    if not is_usable(p):
        return UNUSABLE_LIMITS
    if not -LARGEST <= velocity <= LARGEST:
        return OUT_OF_RANGE
    if abs(velocity) > p.speed:
        return TOO_FAST
    if c.mode != RUN or c.run != velocity or differs(p, c.asked):
        take_limits(p, c, -FARTHEST, FARTHEST)
        c.mode, c.run = RUN, velocity
        lay(c)
    return TAKEN


@step
def come_to_rest(p: CourseLimits, c: Course) -> None:
    """The shortest stop; never refused. One that is under way is not begun anew."""
    if c.mode in (REST, STOP):
        return
    if is_usable(p):
        take_limits(p, c, -FARTHEST, FARTHEST)
    c.mode = STOP
    lay(c)


@step
def is_at_rest(c: Course) -> bool:
    """True when nothing moves, and nothing will without a command."""
    return c.mode == REST


@step
def stopping_distance(p: CourseLimits, c: Course) -> float:
    """Way from here to where a stop that were commanded now would end; below 0 if that is downwards [m]."""
    most, jerk = c.limits.acceleration, c.limits.jerk
    if c.mode == REST:
        return 0.0
    if c.mode == STOP:
        return c.end - c.position
    if is_usable(p):
        most, jerk = firm_limits(p, c, -FARTHEST, FARTHEST)
    return way_to_rest(most, jerk, c.velocity, c.acceleration)


# ------------------------------------------------------------------------------------------------------------ limits


@step
def is_within(limit: float) -> bool:
    """True of a limit that can be reckoned with."""
    return LEAST <= limit <= LARGEST


@step
def is_usable(p: CourseLimits) -> bool:
    """True of limits that are numbers, in order; soft limits may be infinite."""
    if not (is_within(p.speed) and is_within(p.acceleration) and (p.jerk == 0.0 or is_within(p.jerk))):
        return False
    return p.lowest <= p.highest and p.lowest <= FARTHEST and p.highest >= -FARTHEST


@hot_step
def differs(p: CourseLimits, q: CourseLimits) -> bool:
    """True when any limit is another."""
    return (
        p.speed != q.speed
        or p.acceleration != q.acceleration
        or p.jerk != q.jerk
        or p.lowest != q.lowest
        or p.highest != q.highest
    )


@step
def copy_limits(p: CourseLimits, q: CourseLimits) -> None:
    """From `p` to `q`."""
    q.speed, q.acceleration, q.jerk, q.lowest, q.highest = p.speed, p.acceleration, p.jerk, p.lowest, p.highest


@step
def slack(c: Course, low: float, high: float) -> float:
    """Difference of two places that is due to rounding."""
    return ROUNDING * (abs(c.position) + high - low)


@step
def runs_over(p: CourseLimits, c: Course, bottom: float, top: float) -> bool:
    """True if acceleration and jerk of `p` would carry the axis farther than those in force, and too far.

    That is over `bottom` or `top`, or over the largest speed.
    """
    f, v, a = c.limits, c.velocity, c.acceleration
    low, high = reach(p.acceleration, p.jerk, v, a)
    low_now, high_now = reach(f.acceleration, f.jerk, v, a)
    room = slack(c, low, high)
    if (high > high_now and c.position + high > top + room) or (low < low_now and c.position + low < bottom - room):
        return True
    fast, fast_now = abs(level_speed(p.jerk, v, a)), abs(level_speed(f.jerk, v, a))
    return fast > fast_now and fast > p.speed


@step
def firm_limits(p: CourseLimits, c: Course, bottom: float, top: float) -> tuple[float, float]:
    """Acceleration and jerk as asked for; while those would run over, the firmer of what is asked for and in force."""
    most, jerk = p.acceleration, p.jerk
    if c.mode != REST and runs_over(p, c, max(bottom, p.lowest, -FARTHEST), min(top, p.highest, FARTHEST)):
        most = max(most, c.limits.acceleration)
        jerk = 0.0 if jerk == 0.0 or c.limits.jerk == 0.0 else max(jerk, c.limits.jerk)
    return most, jerk


@step
def take_limits(p: CourseLimits, c: Course, bottom: float, top: float) -> None:
    """Put limits into force; a gentler acceleration or jerk waits while it would run over."""
    most, jerk = firm_limits(p, c, bottom, top)
    copy_limits(p, c.asked)
    c.limits.speed, c.limits.acceleration, c.limits.jerk = p.speed, most, jerk
    c.limits.lowest, c.limits.highest = max(p.lowest, -FARTHEST), min(p.highest, FARTHEST)
    c.waiting = 1 if most != p.acceleration or jerk != p.jerk else 0
    c.due = 0


@step
def follow_limits(p: CourseLimits, c: Course) -> None:
    """Limits have changed under way, or could now come into force. A stop keeps those that it began with."""
    if c.mode != STOP and is_usable(p):
        take_limits(p, c, c.bottom, c.top)  # a gentler stop must not carry a move over its target either
        lay(c)


# -------------------------------------------------------------------------------------------------------------- plan


@step
def lay(c: Course) -> None:
    """Plan from the commanded point, by mode."""
    if c.mode == GO:
        lay_to(c, c.limits.speed, c.target)
    elif c.mode == RUN:
        lay_to(c, min(abs(c.run), c.limits.speed), math.copysign(FARTHEST, c.run))
    else:
        lay_to(c, 0.0, c.position)


@step
def lay_to(c: Course, speed: float, target: float) -> None:
    """Drive at `speed` towards a target, as far as the soft limit; or stop: for speed 0, or if that leads beyond it."""
    f, v, a = c.limits, c.velocity, c.acceleration
    low, high = reach(f.acceleration, f.jerk, v, a)
    room, rest = slack(c, low, high), c.position + way_to_rest(f.acceleration, f.jerk, v, a)
    inside = max(min(rest, f.highest), f.lowest)
    rest = inside if abs(inside - rest) <= room else rest
    sign = 1.0 if target > rest else -1.0
    c.end = min(target, f.highest) if sign > 0.0 else max(target, f.lowest)
    stops = abs(c.end - rest) <= room
    if not stops and (speed == 0.0 or sign * (c.end - rest) < 0.0):
        stops, c.end = True, rest
    c.stretches = c.stretch = c.samples = 0
    c.since = 0.0
    if stops:
        lay_stop(c, 0.0, v, a)
    else:
        lay_drive(c, sign * speed)
    bound(c, c.position + low + room, c.position + high - room, 0.0 if stops else sign)
    if c.stretches == 0 and c.end == c.position:
        rest_at(c, c.end)


@step
def bound(c: Course, low: float, high: float, sign: float) -> None:
    """Note what the plan does not pass: soft limits, and its own end where it comes from one side.

    `low` and `high` are the places that a stop would touch, but for rounding; `sign` is the direction of the drive, 0
    for none.
    """
    c.bottom = c.limits.lowest if low >= c.limits.lowest else -math.inf
    c.top = c.limits.highest if high <= c.limits.highest else math.inf
    if sign <= 0.0 and low >= c.end:
        c.bottom = c.end
    if sign >= 0.0 and high <= c.end:
        c.top = c.end


@step
def lay_drive(c: Course, velocity: float) -> None:
    """Change to a velocity and keep it, until the stop must begin."""
    most, jerk, way = c.limits.acceleration, c.limits.jerk, c.end - c.position
    first, hold, last, peak, j1, j3 = ramp(most, jerk, c.velocity, c.acceleration, velocity)
    x, v, a, stops = 0.0, c.velocity, c.acceleration, False
    for part in range(3):
        if not stops:
            t, j = (first, j1) if part == 0 else ((hold, 0.0) if part == 1 else (last, j3))
            if (x + way_with_stop(most, jerk, v, a, j, t) - way) * velocity > 0.0:
                stops, t = True, moment_to_stop(c, v, a, j, t, way - x)
            lay_stretch(c, t, x, v, a, j)
            dx, v = passed(v, a, j, t)
            x, a = x + dx, a + j * t if stops else peak
    if not stops:
        t = (way - x - way_to_rest(most, jerk, velocity, 0.0)) / velocity
        lay_stretch(c, t, x, velocity, 0.0, 0.0)
        x, v, a = x + t * velocity, velocity, 0.0
    lay_stop(c, x, v, a)


@step
def moment_to_stop(c: Course, v: float, a: float, j: float, longest: float, way: float) -> float:
    """Time of constant jerk after which the stop begins, so that both together make this way."""
    most, jerk = c.limits.acceleration, c.limits.jerk
    early, late = 0.0, longest
    upwards = way_with_stop(most, jerk, v, a, j, late) > way
    for _ in range(HALVINGS):
        middle = early + (late - early) / 2.0
        if (way_with_stop(most, jerk, v, a, j, middle) > way) == upwards:
            late = middle
        else:
            early = middle
    return early


@step
def lay_stop(c: Course, x: float, v: float, a: float) -> None:
    """The shortest stop; its last stretch is told from its end, so that it ends exactly there."""
    jerk = c.limits.jerk
    first, hold, last, peak, j1, j3 = ramp(c.limits.acceleration, jerk, v, a, 0.0)
    lay_stretch(c, first, x, v, a, j1)
    dx, v = passed(v, a, j1, first)
    lay_stretch(c, hold, x + dx, v, peak, 0.0)
    lay_stretch(c, last, x, v, peak, j3)
    k = c.stretches - 1
    if k >= 0:
        c.anchor[k], c.x[k], c.v[k] = c.duration[k], c.end, 0.0
        if jerk > 0.0:
            c.a[k] = 0.0
    c.duration[c.stretches] = 0.0


@step
def lay_stretch(c: Course, t: float, x: float, v: float, a: float, j: float) -> None:
    """Append a stretch of constant jerk, unless it takes no time; `x` from where the plan begins."""
    if t > 0.0:
        k = c.stretches
        c.duration[k], c.anchor[k], c.x[k] = t, 0.0, c.position + x
        c.v[k], c.a[k], c.j[k] = v, a, j
        c.stretches = k + 1


# -------------------------------------------------------------------------------------------------------- each sample


@step
def advance(p: CourseLimits, c: Course, period: float) -> None:
    """One sample; `p` may be other limits than at the last one. A period that is no time is no sample."""
    if c.mode in (REST, LED) or not 0.0 < period <= LONGEST_PERIOD:
        return
    if c.due or differs(p, c.asked):
        follow_limits(p, c)
    if period != c.period:
        c.since += c.samples * c.period
        c.samples, c.period = 0, period
    c.samples += 1
    t = c.since + c.samples * period
    if t >= c.duration[c.stretch]:
        t = pass_stretches(c, t)
        if c.stretch == c.stretches:
            rest_at(c, c.end)
            return
    k = c.stretch
    v, a, j = c.v[k], c.a[k], c.j[k]
    t -= c.anchor[k]
    x = c.x[k] + t * (v + t * (a / 2.0 + t * j / 6.0))
    # Only a rounding error is cut off here.
    c.position = max(min(x, c.top), c.bottom)
    c.velocity = v + t * (a + t * j / 2.0)
    c.acceleration = a + t * j


@step
def follow(p: CourseLimits, c: Course, target: float, velocity: float, period: float) -> bool:
    """One sample of a course that is led: to `target`, where it has this velocity; False if it falls short of it.

    It goes no faster than allowed, and nowhere from where a stop would lead past a soft limit: near one it goes as
    fast as it still can, and rests there. A stop begins without acceleration: whoever leads limits no jerk.
    """
    if not is_usable(p) or not 0.0 < period <= LONGEST_PERIOD:
        return False
    begin_to_be_led(p, c)
    x, way, v, most = target, target - c.position, velocity, p.speed * period
    room = ROUNDING * (abs(target) + most)
    if abs(way) > most + room or abs(v) * period > most + room:
        way = min(max(way, -most), most)
        x, v = c.position + way, way / period
    if is_past(c.limits, c.position, x, v):
        v = fastest(c.limits, c.position, way / period, period)
        x = c.position + v * period
    c.position, c.velocity, c.acceleration = x, v, 0.0
    return x == target


@step
def begin_to_be_led(p: CourseLimits, c: Course) -> None:
    """No plan is under way any more that limits could run over."""
    if c.mode != LED or differs(p, c.asked):
        c.mode = REST
        take_limits(p, c, -FARTHEST, FARTHEST)
        c.mode = LED


@step
def drift(p: CourseLimits, c: Course, position: float, velocity: float, period: float) -> bool:
    """One sample of a course that is where the axis is; False where that goes too fast, or a stop would come too late.

    It is reckoned with the velocity that a few samples more would bring, for a stop does not act at once. A course that
    was planned stays where it is, and as it slows down, when it may not be left.
    """
    if not is_usable(p) or not -FARTHEST <= position <= FARTHEST:
        return False
    is_planned, x, v, a = c.mode != LED, c.position, c.velocity, c.acceleration
    begin_to_be_led(p, c)
    gain = velocity - c.velocity
    soon = velocity + SOON * gain if gain * velocity > 0.0 else velocity
    c.position, c.velocity, c.acceleration = position, min(max(velocity, -p.speed), p.speed), 0.0
    if abs(velocity) <= p.speed and not is_past(c.limits, position, position + soon * SOON * period, soon):
        return True
    if is_planned:
        c.position, c.velocity, c.acceleration = x, v, a
    return False


@step
def is_past(f: CourseLimits, here: float, x: float, v: float) -> bool:
    """True where the way to a place, or a stop from there, leads farther past a soft limit."""
    rest = x + way_to_rest(f.acceleration, f.jerk, v, 0.0)
    low, high = min(x, rest), max(x, rest)
    return (high > f.highest and high > here) or (low < f.lowest and low < here)


@step
def fastest(f: CourseLimits, here: float, wanted: float, period: float) -> float:
    """Velocity up to the one that is wanted after a sample of which a stop still ends at the soft limit."""
    low, high = 0.0, wanted
    for _ in range(HALVINGS):
        v = low + (high - low) / 2.0
        if is_past(f, here, here + v * period, v):
            high = v
        else:
            low = v
    return low


@step
def pass_stretches(c: Course, t: float) -> float:
    """Go on to the stretch of a moment; returns the time in it."""
    for _ in range(STRETCHES):
        if c.stretch < c.stretches and t >= c.duration[c.stretch]:
            t -= c.duration[c.stretch]
            c.stretch += 1
    c.since, c.samples, c.due = t, 0, c.waiting
    return t


@step
def rest_at(c: Course, position: float) -> None:
    """Nothing is left to do."""
    c.position, c.velocity, c.acceleration, c.mode = position, 0.0, 0.0, REST
