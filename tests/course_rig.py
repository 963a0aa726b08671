"""A course followed sample by sample, and what must hold at each of them (invariants I1 to I4 of the live controller).

All of it takes the module that it works on: the compiled one, or the same source as plain Python.
"""

import math
from itertools import pairwise

NEAR = 1e-11  # rounding: of a speed, an acceleration or a way, in units of the largest that takes part


def limits(m, speed=0.5, acceleration=5.0, jerk=100.0, lowest=-math.inf, highest=math.inf):
    p = m.CourseLimits()
    p.speed, p.acceleration, p.jerk, p.lowest, p.highest = speed, acceleration, jerk, lowest, highest
    return p


def at_rest(m, position=0.0):
    c = m.Course()
    assert m.begin_at(c, position) == m.TAKEN
    return c


def moving(m, p, position, velocity, acceleration):
    """A course that has these limits in force and is just there."""
    c = at_rest(m, position)
    m.copy_limits(p, c.limits)
    m.copy_limits(p, c.asked)
    c.mode, c.run, c.velocity, c.acceleration = m.RUN, velocity, velocity, acceleration
    return c


def state(c):
    return c.position, c.velocity, c.acceleration


def duration(c):
    """Time that the plan takes."""
    return math.fsum(c.duration[k] for k in range(c.stretches))


def follow(m, p, c, period=1e-3, most=10_000):
    """Every state until it is at rest, each one checked against the one before."""
    found = [state(c)]
    while not m.is_at_rest(c):
        found.append(checked(m, p, c, period))
        assert len(found) < most
    return found


def checked(m, p, c, period):
    """One sample, and what must hold of it; the new state."""
    x0, v0, a0 = state(c)
    m.advance(p, c, period)
    x1, v1, a1 = state(c)
    assert all(map(math.isfinite, (x1, v1, a1)))
    f = c.limits
    most, jerk = max(f.acceleration, abs(a0)), f.jerk
    speed = max(f.speed, abs(v0), abs(m.level_speed(jerk, v0, a0)))
    assert abs(v1) <= speed * (1 + 1e-9)
    assert abs(a1) <= most * (1 + 1e-9)
    near_v, near_x = NEAR * (speed + most * period), NEAR * (abs(x0) + speed * period + most * period**2)
    if jerk == 0.0:
        assert abs(v1 - v0) <= most * period + near_v
        assert abs(x1 - x0 - (v0 + v1) / 2 * period) <= most * period**2 / 4 + near_x
    else:
        assert abs(a1 - a0) <= jerk * period * (1 + 1e-9) + NEAR * most
        assert abs(v1 - v0 - a0 * period) <= jerk * period**2 / 2 * (1 + 1e-9) + near_v
        assert abs(x1 - x0 - v0 * period - a0 * period**2 / 2) <= jerk * period**3 / 6 * (1 + 1e-9) + near_x
    if m.is_at_rest(c):
        assert (v1, a1) == (0.0, 0.0)
    return x1, v1, a1


def until(m, p, c, period=4e-3, most=1000, **reached):
    """Samples until a position, a velocity or an acceleration comes to a value, from whichever side."""
    ((name, value),) = reached.items()
    begin = getattr(c, name) - value
    for _ in range(most):
        if (getattr(c, name) - value) * begin <= 0.0:
            return
        checked(m, p, c, period)
    raise AssertionError(f"{name} {value} is not reached")


def excursions(m, c):
    """Lowest and highest place that a stop would touch now."""
    low, high = m.reach(c.limits.acceleration, c.limits.jerk, c.velocity, c.acceleration)
    return c.position + low, c.position + high


def turns(states):
    """How often the velocity changes its sign."""
    signs = [math.copysign(1, v) for _, v, _ in states if v != 0.0]
    return sum(a != b for a, b in pairwise(signs))


def stop_from_level(v, most, jerk):
    """Way of the shortest stop from a speed without acceleration; v^2 / 2 a + v a / 2 j once the largest is reached."""
    return v * v / (2 * most) + v * most / (2 * jerk) if v * jerk >= most * most else v * math.sqrt(v / jerk)


def shortest_stop(v, a, most, jerk):
    """Way of the shortest stop in closed form.

    With the motion that is left when the acceleration is taken away: an acceleration along it is taken away first; one
    against it belongs to the stop that began at the speed v + a^2 / 2 j.
    """
    level = v + a * abs(a) / (2 * jerk)
    sign = math.copysign(1.0, level)
    v, a, t = sign * v, sign * a, abs(a) / jerk
    if a >= 0.0:
        return sign * (v * t + a * t * t / 3 + stop_from_level(abs(level), most, jerk))
    begin = v + a * a / (2 * jerk)
    return sign * (stop_from_level(begin, most, jerk) - begin * t + jerk * t**3 / 6)
