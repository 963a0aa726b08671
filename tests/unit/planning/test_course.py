"""The course of a live axis, on the compiled steps and on the same steps as plain Python.

These tests are also what mutants of the two modules meet (live specification, test 15), so each takes milliseconds.
"""

import math
import random
from itertools import pairwise
from math import cbrt, inf, nan, sqrt
from pathlib import Path
from types import SimpleNamespace

import pytest
import ruckig
from tests.course_rig import (
    at_rest,
    checked,
    duration,
    excursions,
    follow,
    limits,
    moving,
    shortest_stop,
    state,
    turns,
    until,
)
from tests.mutants import load, source_of

from detent.errors import COURSE_REFUSAL_TEXT
from detent.planning import course, speed_ramp

V, A, J = 0.5, 5.0, 100.0
T = 4e-3
SOURCES = (Path(speed_ramp.__file__), Path(course.__file__))


@pytest.fixture(scope="module", params=["compiled", "plain"])
def m(request):
    """Both modules as one."""
    plain = request.param == "plain"
    return load(source_of(*SOURCES)) if plain else SimpleNamespace(**{**vars(speed_ramp), **vars(course)})


def near(found, wanted, rel=1e-12):
    return math.isclose(found, wanted, rel_tol=rel, abs_tol=1e-13)


def ways(m):
    """Upwards and downwards."""
    return [(sign, limits(m, V, A, J)) for sign in (1.0, -1.0)]


# ---- moves from rest


def test_a_long_move_takes_the_time_of_its_seven_stretches(m):
    for sign, p in ways(m):
        c = at_rest(m, 0.25)
        assert m.go_to(p, c, 0.25 + sign * 0.2) == m.TAKEN
        assert c.stretches == m.STRETCHES == 7
        assert near(duration(c), 0.2 / V + V / A + A / J)
        states = follow(m, p, c, T)
        assert len(states) == 1 + math.ceil(duration(c) / T - 1e-9)
        assert state(c) == (0.25 + sign * 0.2, 0.0, 0.0)
        assert near(max(sign * v for _, v, _ in states), V)
        assert near(max(sign * a for _, _, a in states), A, 1e-9)
        assert all(sign * (new[0] - old[0]) >= 0.0 for old, new in pairwise(states))


def test_shorter_moves_have_fewer_stretches(m):
    for way, stretches, seconds in [
        (0.04, 6, A / J + sqrt((A / J) ** 2 + 4 * 0.04 / A)),
        (0.002, 4, 4 * cbrt(0.002 / (2 * J))),
        (1e-9, 4, 4 * cbrt(1e-9 / (2 * J))),
    ]:
        for sign, p in ways(m):
            c = at_rest(m)
            m.go_to(p, c, sign * way)
            assert near(duration(c), seconds)
            assert c.stretches <= stretches
            follow(m, p, c, seconds / 7)
            assert state(c) == (sign * way, 0.0, 0.0)


def test_without_a_jerk_limit_the_speed_is_a_trapezoid(m):
    p = limits(m, V, A, 0.0)
    for way, stretches, seconds in [(0.2, 3, 0.2 / V + V / A), (0.04, 2, 2 * sqrt(0.04 / A))]:
        for sign in (1.0, -1.0):
            c = at_rest(m)
            m.go_to(p, c, sign * way)
            assert c.stretches == stretches
            assert near(duration(c), seconds)
            states = follow(m, p, c, T)
            assert {sign * a for _, _, a in states} <= {0.0, A, -A}
            assert state(c) == (sign * way, 0.0, 0.0)


def test_downwards_is_upwards_mirrored_to_the_bit(m):
    p = limits(m, V, A, J)
    up, down = at_rest(m), at_rest(m)
    m.go_to(p, up, 0.03)
    m.go_to(p, down, -0.03)
    mirrored = [(-x, -v, -a) for x, v, a in follow(m, p, down, T)]
    assert follow(m, p, up, T) == mirrored


def test_a_move_of_no_way_is_over_at_once(m):
    p, c = limits(m), at_rest(m, 0.3)
    assert m.go_to(p, c, 0.3) == m.TAKEN
    assert m.is_at_rest(c)
    for sign in (1.0, -1.0):  # outside the soft limits too
        assert m.go_to(limits(m, lowest=-0.4, highest=0.4), at_rest(m, sign * 0.5), sign * 0.5) == m.TAKEN


def test_a_way_below_the_rounding_of_a_place_is_one_sample(m):
    p, c = limits(m), at_rest(m)
    m.go_to(p, c, 0.3)
    follow(m, p, c, T)
    target = math.nextafter(0.3, 1.0)
    m.go_to(p, c, target)
    assert (c.position, m.is_at_rest(c)) == (0.3, False)
    m.advance(p, c, T)
    assert (state(c), m.is_at_rest(c)) == ((target, 0.0, 0.0), True)


def test_a_plan_that_ends_at_a_sample_is_over_with_it(m):
    p, c = limits(m, 0.5, 0.5, 0.0), at_rest(m)
    m.go_to(p, c, 0.5)
    states = follow(m, p, c, 0.125)
    assert [round(8 * x, 6) for x, _, _ in states[:9:4]] == [0.0, 0.5, 2.0]
    assert len(states) == 17
    assert states[8][1:] == (0.5, -0.5)


def test_the_last_stretch_is_told_from_its_end(m):
    for jerk in (J, 0.5, 0.0):
        for go in (True, False):
            p, c = limits(m, jerk=jerk), at_rest(m, 1000.0)
            m.run_at(p, c, 0.5)
            until(m, p, c, velocity=0.3)
            m.go_to(p, c, 1000.7) if go else m.come_to_rest(p, c)
            k = c.stretches - 1
            assert (c.anchor[k], c.x[k], c.v[k]) == (c.duration[k], c.end, 0.0)
            assert c.a[k] == (0.0 if jerk else -A)
            assert [c.anchor[i] for i in range(k)] == [0.0] * k


# ---- from any state, against ruckig


def random_limits(rng):
    return 10 ** rng.uniform(-2, 1), 10 ** rng.uniform(-1, 2), 10 ** rng.uniform(-1, 4)


def random_state(rng, speed, acceleration, jerk):
    """A velocity and an acceleration that do not carry the axis over the largest speed.

    Nor just to it: there ruckig takes a rounding error for too fast, and brakes before it plans.
    """
    most = min(acceleration, sqrt(2 * jerk * speed) * (1 - 1e-6))
    a = rng.choice([0.0, most, -most, rng.uniform(-most, most)])
    v = rng.uniform(-speed, speed)
    left = speed - a * a / (2 * jerk)
    return (math.copysign(rng.random() * left, a) if v * a > 0 else v), a


def ruckig_seconds(begin, target, speed, acceleration, jerk):
    asked, found = ruckig.InputParameter(1), ruckig.Trajectory(1)
    asked.current_position, asked.current_velocity, asked.current_acceleration = ([one] for one in begin)
    if target is None:
        asked.control_interface = ruckig.ControlInterface.Velocity
    else:
        asked.target_position = [target]
    asked.max_velocity, asked.max_acceleration, asked.max_jerk = [speed], [acceleration], [jerk]
    ruckig.Ruckig(1).calculate(asked, found)
    return found.duration


def compare_with_ruckig(m, rng, jerk=None):
    most = random_limits(rng)
    v, a = random_state(rng, *most)
    if jerk == 0.0:
        most, a = (*most[:2], inf), 0.0
    p = limits(m, *most[:2], 0.0 if jerk == 0.0 else most[2])
    scale = most[0] ** 2 / most[1] + (0.0 if jerk == 0.0 else most[0] * most[1] / most[2])
    begin = (rng.choice([0.0, rng.uniform(-1, 1)]), v, a)
    target = begin[0] + rng.choice([-1, 1]) * 10 ** rng.uniform(-4, 1) * scale
    c = moving(m, p, *begin)
    assert m.go_to(p, c, target) == m.TAKEN
    seconds = ruckig_seconds(begin, target, *most)
    assert near(duration(c), seconds, 1e-9), (most, begin, target)
    follow(m, p, c, min(duration(c) / 9 + 1e-12, 1.0))
    assert state(c) == (target, 0.0, 0.0)
    c = moving(m, p, *begin)
    m.come_to_rest(p, c)
    if jerk is None:
        assert near(duration(c), ruckig_seconds(begin, None, *most), 1e-9), (most, begin)


def test_from_any_state_as_quick_as_ruckig(m):
    rng = random.Random(5)
    for _ in range(20):
        compare_with_ruckig(m, rng)
    for _ in range(5):
        compare_with_ruckig(m, rng, jerk=0.0)


@pytest.mark.wide
@pytest.mark.parametrize("m", ["compiled"], indirect=True)
@pytest.mark.parametrize("seed", range(4))
def test_from_many_states_as_quick_as_ruckig(m, seed):
    rng = random.Random(seed)
    for k in range(10_000):
        compare_with_ruckig(m, rng, jerk=0.0 if k % 5 == 0 else None)


# ---- jog


def test_a_jog_keeps_its_velocity_and_rests_at_the_soft_limit(m):
    for sign, jerk in [(1.0, J), (-1.0, J), (1.0, 0.0)]:
        p = limits(m, V, A, jerk, lowest=-0.1234, highest=0.1234)
        c = at_rest(m)
        assert m.run_at(p, c, sign * 0.3) == m.TAKEN
        assert not m.is_at_rest(c)
        states = follow(m, p, c, T)
        assert state(c) == (sign * 0.1234, 0.0, 0.0)
        assert sum(v == sign * 0.3 for _, v, _ in states) > 50
        assert all(abs(x) <= 0.1234 for x, _, _ in states)
        at = bytes(c)
        assert m.run_at(p, c, sign * 0.3) == m.TAKEN  # it may be asked for again and again there
        assert m.is_at_rest(c)
        m.advance(p, c, T)
        assert bytes(c)[:24] == at[:24]


def test_a_jog_that_is_repeated_goes_on(m):
    p, c = limits(m, V, A, J, highest=1.0), at_rest(m)
    m.run_at(p, c, 0.3)
    for _ in range(5):
        m.advance(p, c, T)
    before = bytes(c)
    assert m.run_at(p, c, 0.3) == m.TAKEN
    assert bytes(c) == before
    p.highest = 0.5  # but not under other limits
    assert m.run_at(p, c, 0.3) == m.TAKEN
    assert c.end == 0.5
    m.run_at(p, c, 0.2)
    assert (c.run, c.mode) == (0.2, m.RUN)
    m.go_to(p, c, 0.4)
    m.run_at(p, c, 0.2)
    assert (c.end, c.mode) == (0.5, m.RUN)


def test_a_jog_without_soft_limits_is_for_ever(m):
    p, c = limits(m, V, A, J), at_rest(m)
    m.run_at(p, c, -V)
    assert c.end == -m.FARTHEST
    assert near(duration(c), m.FARTHEST / V, 1e-6)
    for _ in range(40):
        checked(m, p, c, 1.0)
    assert c.velocity == -V


def test_a_jog_may_turn_slow_down_and_end(m):
    p, c = limits(m, V, A, J, -1.0, 1.0), at_rest(m)
    m.run_at(p, c, 0.4)
    for velocity in (0.4, -0.4, -0.1, 0.25):
        m.run_at(p, c, velocity)
        for _ in range(75):
            checked(m, p, c, T)
        assert (c.velocity, c.acceleration) == (velocity, 0.0)
    for velocity in (0.0, -0.9e-9, 5e-324):
        m.run_at(p, c, 0.25)
        m.advance(p, c, T)
        assert m.run_at(p, c, velocity) == m.TAKEN
        assert c.mode == m.STOP
    follow(m, p, c, T)


# ---- stop


def test_a_stop_is_shortest_in_every_phase(m):
    """Of a move: distance in closed form, one turn at most, and that only where it cannot be helped."""
    for sign in (1.0, -1.0):
        for part in range(1, 24):
            p, c = limits(m, V, A, J), at_rest(m)
            m.go_to(p, c, sign * 0.1)
            for _ in range(part):
                m.advance(p, c, duration(c) / 24)
            x, v, a = state(c)
            way = m.stopping_distance(p, c)
            m.come_to_rest(p, c)
            assert near(c.end - x, shortest_stop(v, a, A, J), 1e-9)
            assert near(way, c.end - x)
            end, states = c.end, follow(m, p, c, T)
            assert turns(states) == (1 if v * m.level_speed(J, v, a) < 0.0 else 0)
            assert c.position == end
            assert m.stopping_distance(p, c) == 0.0


def test_what_is_left_of_a_stop(m):
    p, c = limits(m), at_rest(m)
    m.run_at(p, c, 0.5)
    for _ in range(60):
        m.advance(p, c, T)
    m.come_to_rest(p, c)
    m.advance(p, c, T)
    before = bytes(c)
    m.come_to_rest(p, c)
    assert bytes(c) == before  # one under way is not begun anew
    p.acceleration = 1.0  # a stop keeps what it began with
    assert m.stopping_distance(p, c) == c.end - c.position > 0.0
    assert near(c.end - c.position, m.way_to_rest(A, J, c.velocity, c.acceleration), 1e-9)
    m.advance(p, c, T)
    assert c.limits.acceleration == 5.0


def test_a_stop_under_limits_that_are_none_takes_those_in_force(m):
    p, c = limits(m), at_rest(m)
    m.run_at(p, c, 0.5)
    for _ in range(60):
        m.advance(p, c, T)
    p.acceleration = nan
    assert near(m.stopping_distance(p, c), 0.5**2 / 10 + 0.5 * 5 / 200)
    assert m.run_at(p, c, 0.0) == m.TAKEN
    assert near(c.end - c.position, 0.5**2 / 10 + 0.5 * 5 / 200)
    follow(m, p, c, T)


def test_an_acceleration_against_the_speed_may_carry_it_back(m):
    """a^2 / 2 j of speed is gone before the acceleration is."""
    for sign in (1.0, -1.0):
        p = limits(m)
        c = moving(m, p, 0.0, sign * 0.05, sign * -5.0)
        assert near(m.way_to_turn(J, c.velocity, c.acceleration), sign * turn_of(0.05, 5.0, J))
        low, high = excursions(m, c)
        m.come_to_rest(p, c)
        states = follow(m, p, c, 1e-4)
        assert turns(states) == 1
        assert near(low, min(x for x, _, _ in states), 1e-4)
        assert near(high, max(x for x, _, _ in states), 1e-4)
        assert (low if sign > 0.0 else high) == c.position


def turn_of(v, a, j):
    """Way until v - a t + j t^2 / 2 is 0."""
    t = (a - sqrt(a * a - 2 * j * v)) / j
    return v * t - a * t * t / 2 + j * t**3 / 6


def test_ways_of_a_stop(m):
    assert m.reach(A, J, 0.5, 0.0) == (0.0, m.way_to_rest(A, J, 0.5, 0.0))
    assert m.reach(A, J, -0.5, 0.0) == (-m.way_to_rest(A, J, 0.5, 0.0), 0.0)
    assert m.reach(A, 0.0, 0.5, -5.0) == (0.0, 0.025)
    assert m.way_to_turn(J, 0.5, 5.0) == m.way_to_turn(J, 0.5, -5.0) == m.way_to_turn(0.0, 0.1, -5.0) == 0.0
    assert m.level_speed(0.0, 0.1, 5.0) == 0.1
    assert m.level_speed(J, 0.1, -5.0) == 0.1 - 0.125


# ---- other limits under way


def test_a_lower_speed_is_come_down_to(m):
    for sign in (1.0, -1.0):
        p, c = limits(m), at_rest(m)
        m.run_at(p, c, sign * 0.5)
        for _ in range(60):
            checked(m, p, c, T)
        p.speed = 0.2
        for _ in range(30):
            checked(m, p, c, T)
        assert c.velocity == sign * 0.2
        p.speed = 0.4
        for _ in range(30):
            checked(m, p, c, T)
        assert c.velocity == sign * 0.4  # and a jog takes up again what was asked for
        m.go_to(p, c, c.position + sign * 0.2)
        p.speed = 0.1
        follow(m, p, c, T)


def test_a_lower_acceleration_is_come_down_to(m):
    """Both of speeding up and of a stop."""
    for sign in (1.0, -1.0):
        p, c = limits(m), at_rest(m)
        m.run_at(p, c, sign * 0.5)
        until(m, p, c, acceleration=sign * 5.0)
        p.acceleration = 2.0
        before = [checked(m, p, c, T) for _ in range(20)]
        assert near(min(sign * a for _, _, a in before), 2.0)
        until(m, p, c, velocity=sign * 0.5)
        p.acceleration = 5.0
        m.run_at(p, c, sign * -0.5)
        until(m, p, c, acceleration=sign * -5.0)
        p.acceleration = 2.0
        m.come_to_rest(p, c)
        assert near(min(abs(a) for _, v, a in follow(m, p, c, T)[9:12]), 2.0)


def test_a_gentler_limit_waits_while_it_would_run_over_the_soft_limit(m):
    for sign, change in [(1.0, "acceleration"), (-1.0, "acceleration"), (1.0, "jerk"), (-1.0, "jerk")]:
        p, c = limits(m, lowest=-0.2, highest=0.2), at_rest(m)
        m.run_at(p, c, sign * 0.5)
        until(m, p, c, position=sign * 0.15)
        setattr(p, change, getattr(p, change) / 10)
        near_stop = m.stopping_distance(p, c)
        m.advance(p, c, T)
        assert c.waiting == 1
        assert getattr(c.limits, change) == 10 * getattr(p, change)
        assert abs(near_stop) < 0.05
        follow(m, p, c, T)
        assert c.position == sign * 0.2
        m.run_at(p, c, sign * -0.1)
        assert getattr(c.limits, change) == getattr(p, change)
        assert c.waiting == 0


def test_a_gentler_limit_waits_while_it_would_run_over_the_target(m):
    p, c = limits(m), at_rest(m)
    m.go_to(p, c, 0.2)
    until(m, p, c, position=0.17)
    p.acceleration = 1.0
    m.advance(p, c, T)
    assert c.limits.acceleration == 5.0
    states = follow(m, p, c, T)
    assert max(x for x, _, _ in states) == c.position == 0.2


def test_a_gentler_limit_waits_while_it_would_run_over_the_speed(m):
    for sign, jerk in [(1.0, J), (-1.0, J), (1.0, 0.0)]:
        p, c = limits(m, jerk=jerk), at_rest(m)
        m.run_at(p, c, sign * 0.5)
        until(m, p, c, velocity=sign * 0.35)
        p.jerk = 20.0
        m.advance(p, c, T)
        assert (c.limits.jerk, c.waiting) == (jerk, 1)
        states = [checked(m, p, c, T) for _ in range(60)]
        assert max(sign * v for _, v, _ in states) == 0.5
        assert (c.limits.jerk, c.waiting, c.due) == (20.0, 0, 0)  # once the acceleration is gone


def test_a_gentler_limit_that_fits_is_followed_at_once(m):
    for sign in (1.0, -1.0):
        p, c = limits(m), at_rest(m)
        m.run_at(p, c, sign * 0.5)
        until(m, p, c, acceleration=sign * 3.0)
        p.jerk = 60.0
        m.advance(p, c, T)
        assert (c.limits.jerk, c.waiting) == (60.0, 0)
        for k in range(2):
            p.acceleration /= 2.0
            m.go_to(p, c, sign) if k else m.run_at(p, c, sign * 0.4)
            assert (c.limits.acceleration, c.waiting) == (p.acceleration, 0)
            assert not m.differs(p, c.asked)


def test_a_stop_takes_the_gentler_limits_if_they_fit(m):
    for sign in (1.0, -1.0):
        p, c = limits(m, lowest=-1.0, highest=1.0), at_rest(m)
        m.run_at(p, c, sign * 0.5)
        until(m, p, c, position=sign * 0.2)
        p.acceleration = 1.0
        assert near(m.stopping_distance(p, c), sign * (0.5**2 / 2 + 0.5 / 200))
        m.come_to_rest(p, c)
        assert near(sign * (c.end - c.position), 0.5**2 / 2 + 0.5 / 200)
        # No farther than the soft limit, though.
        c = at_rest(m)
        p.acceleration, p.jerk = 5.0, 100.0
        m.run_at(p, c, sign * 0.5)
        until(m, p, c, position=sign * 0.94)
        p.acceleration, p.jerk = 1.0, 1000.0
        way = m.stopping_distance(p, c)
        m.come_to_rest(p, c)
        assert (c.limits.acceleration, c.limits.jerk) == (5.0, 1000.0)
        assert near(c.end - c.position, way)
        follow(m, p, c, T)
        assert abs(c.position) < 1.0


def test_limits_that_are_none_are_not_followed(m):
    p, c = limits(m), at_rest(m)
    m.run_at(p, c, 0.5)
    for _ in range(10):
        checked(m, p, c, T)
    p.speed = nan
    for _ in range(50):
        checked(m, p, c, T)
    assert c.velocity == 0.5
    p.speed = 0.25
    for _ in range(50):
        checked(m, p, c, T)
    assert c.velocity == 0.25


# ---- soft limits


def test_outside_the_soft_limits_it_only_goes_inwards(m):
    for sign in (1.0, -1.0):
        p, c = limits(m, lowest=-0.1, highest=0.1), at_rest(m, sign * 0.5)
        assert m.go_to(p, c, sign * 0.6) == m.BEYOND_LIMIT
        assert m.run_at(p, c, sign * 0.3) == m.TAKEN
        assert m.is_at_rest(c)
        assert m.go_to(p, c, sign * 0.4) == m.TAKEN  # a step inwards
        follow(m, p, c, T)
        assert c.position == sign * 0.4
        m.run_at(p, c, sign * -0.3)
        for _ in range(9):
            checked(m, p, c, T)
        m.run_at(p, c, sign * 0.3)  # turned round out there: it stops
        states = follow(m, p, c, T)
        assert all(sign * (new[0] - old[0]) <= 0.0 for old, new in pairwise(states))
        assert m.go_to(p, c, 0.0) == m.TAKEN
        follow(m, p, c, T)
        assert c.position == 0.0


def test_a_soft_limit_that_comes_too_near_is_overrun_by_the_shortest_stop(m):
    for sign, jogs in [(1.0, True), (-1.0, True), (1.0, False), (-1.0, False)]:
        p, c = limits(m, lowest=-1.0, highest=1.0), at_rest(m)
        m.run_at(p, c, sign * 0.5) if jogs else m.go_to(p, c, sign * 0.9)
        until(m, p, c, position=sign * 0.3)
        rest = c.position + m.stopping_distance(p, c)
        p.highest, p.lowest = 0.31, -0.31
        p.acceleration = 3.0  # no gentler one now
        states = follow(m, p, c, T)
        assert near(c.position, rest)
        assert sign * rest > 0.31
        assert turns(states) == 0


def test_a_move_whose_target_is_cut_off_rests_at_the_soft_limit(m):
    p, c = limits(m, lowest=-1.0, highest=1.0), at_rest(m)
    m.go_to(p, c, 0.9)
    for _ in range(30):
        m.advance(p, c, T)
    p.highest = 0.5
    follow(m, p, c, T)
    assert c.position == 0.5


def test_a_target_between_here_and_the_stopping_point_is_come_back_to(m):
    for sign in (1.0, -1.0):
        p, c = limits(m, lowest=-0.2, highest=0.2), at_rest(m)
        m.run_at(p, c, sign * 0.5)
        until(m, p, c, position=sign * 0.15)
        m.go_to(p, c, sign * 0.16)
        states = follow(m, p, c, T)
        assert turns(states) == 1
        assert 0.16 < max(sign * x for x, _, _ in states) <= 0.2
        assert c.position == sign * 0.16


def test_a_move_to_where_it_is_while_it_moves_comes_back(m):
    for sign in (1.0, -1.0):
        p, c = limits(m), at_rest(m)
        m.run_at(p, c, sign * 0.5)
        until(m, p, c, position=sign * 0.1)
        target = c.position
        m.go_to(p, c, target)
        assert turns(follow(m, p, c, T)) == 1
        assert c.position == target


def test_a_stop_over_the_soft_limit_by_rounding_ends_at_it(m):
    for sign in (1.0, -1.0):
        for over, snaps in [(1e-16, True), (1e-9, False)]:
            p, c = limits(m), at_rest(m)
            m.run_at(p, c, sign * 0.5)
            until(m, p, c, position=sign * 0.1)
            rest = c.position + m.stopping_distance(p, c)
            p.highest, p.lowest = abs(rest) - over, over - abs(rest)
            m.come_to_rest(p, c)
            assert c.end == (rest - sign * over if snaps else rest)


def test_places_are_cut_off_where_rounding_would_carry_them_over(m):
    """What bounds a plan: soft limits, and its end where it comes from one side."""
    p, c = limits(m, lowest=-0.2, highest=0.3), at_rest(m)
    m.go_to(p, c, 0.1)
    assert (c.bottom, c.top) == (-0.2, 0.1)
    m.go_to(p, c, -0.1)
    assert (c.bottom, c.top) == (-0.1, 0.3)
    m.run_at(p, c, 0.5)
    assert (c.bottom, c.top) == (-0.2, 0.3)
    until(m, p, c, position=0.1)
    m.go_to(p, c, 0.0)
    assert (c.bottom, c.top) == (0.0, 0.3)
    m.come_to_rest(p, c)
    assert (c.bottom, c.top) == (-0.2, c.end)
    c.top = c.position
    m.advance(p, c, T)
    assert c.position == c.top
    d = at_rest(m)
    m.run_at(p, d, -0.5)
    until(m, p, d, position=-0.1)
    m.come_to_rest(p, d)
    assert (d.bottom, d.top) == (d.end, 0.3)
    c = at_rest(m, 0.4)
    m.go_to(p, c, 0.0)
    assert (c.bottom, c.top) == (0.0, inf)
    c = at_rest(m, -0.4)
    m.run_at(p, c, 0.5)
    assert (c.bottom, c.top) == (-inf, 0.3)
    for _ in range(20):
        m.advance(p, c, T)
    m.run_at(p, c, -0.5)
    c.bottom = c.position + 0.1
    m.advance(p, c, T)
    assert c.position == c.bottom


def test_rounding_does_not_carry_a_repeated_plan_over_the_soft_limit(m):
    """Stop and jog, planned anew at each sample of the way to the limit."""
    for sign in (1.0, -1.0):
        p, c = limits(m, lowest=-0.11, highest=0.11), at_rest(m, sign * 0.07)
        m.run_at(p, c, sign * 0.5)
        for k in range(200):
            if not m.is_at_rest(c):
                checked(m, p, c, T)
                assert abs(c.position) <= 0.11
                m.run_at(p, c, sign * (0.5 if k % 2 else 0.4999999))
        assert c.position == sign * 0.11
    for sign in (1.0, -1.0):
        p, c = limits(m, lowest=-0.11, highest=0.11), at_rest(m, sign * 0.07)
        m.run_at(p, c, sign * 0.5)
        for _ in range(30):
            m.advance(p, c, T)
        m.come_to_rest(p, c)
        assert near(c.end, sign * 0.11)
        follow(m, p, c, T)
        assert abs(c.position) <= 0.11


# ---- what is refused


def test_what_cannot_be_is_refused_and_changes_nothing(m):
    p, c = limits(m, lowest=-1.0, highest=1.0), at_rest(m)
    m.run_at(p, c, 0.3)
    for _ in range(7):
        m.advance(p, c, T)
    before = bytes(c)
    for value in (nan, inf, -inf, 1.1e9, -1.1e9, 1e300):
        assert m.begin_at(c, value) == m.OUT_OF_RANGE
        assert m.go_to(p, c, value) == m.OUT_OF_RANGE
    for value in (nan, inf, -inf, 1.1e12, -1.1e12):
        assert m.run_at(p, c, value) == m.OUT_OF_RANGE
    for value in (1.0000001, -1.0000001):
        assert m.go_to(p, c, value) == m.BEYOND_LIMIT
    for value in (0.5000001, -0.5000001):
        assert m.run_at(p, c, value) == m.TOO_FAST
    for name in ("speed", "acceleration", "jerk"):
        for value in (nan, inf, -1.0, 0.0, 0.9e-9, 1.1e12):
            q = limits(m)
            setattr(q, name, value)
            if (name, value) != ("jerk", 0.0):
                assert m.go_to(q, c, 0.1) == m.run_at(q, c, 0.1) == m.UNUSABLE_LIMITS
    for lowest, highest in [(nan, 1.0), (0.0, nan), (1.0, 0.9), (inf, inf), (-inf, -inf), (2e9, 3e9)]:
        q = limits(m, lowest=lowest, highest=highest)
        assert m.go_to(q, c, 0.1) == m.run_at(q, c, 0.1) == m.UNUSABLE_LIMITS
    for period in (nan, inf, 0.0, -T, 1.1):
        m.advance(p, c, period)
    assert bytes(c) == before


def test_the_farthest_that_can_be_is_taken(m):
    for sign in (1.0, -1.0):
        c = m.Course()
        assert m.begin_at(c, sign * 1e9) == m.TAKEN
        assert c.position == sign * 1e9
        p = limits(m, speed=1e12, acceleration=1e12, jerk=1e12)
        assert m.go_to(p, c, sign * -1e9) == m.TAKEN
        follow(m, p, c, duration(c) / 11)
        assert c.position == sign * -1e9
        p = limits(m, speed=1e-9, acceleration=1e-9, jerk=1e-9, lowest=-2.0, highest=2.0)
        c = at_rest(m)
        for target in (sign * 2.0, 0.0):
            assert m.go_to(p, c, target) == m.TAKEN
        assert m.run_at(p, c, sign * 1e-9) == m.TAKEN
        assert c.end == sign * 2.0
    p = limits(m, speed=1e12, acceleration=1e12, jerk=1e12)
    for sign in (1.0, -1.0):
        assert m.run_at(p, c, sign * 1e12) == m.TAKEN
        assert c.end == sign * 1e9
    assert m.go_to(limits(m, lowest=1e9, highest=inf), at_rest(m), 1e9) == m.TAKEN
    assert m.go_to(limits(m, lowest=-inf, highest=-1e9), at_rest(m), -1e9) == m.TAKEN
    assert m.go_to(limits(m, lowest=0.5, highest=0.5), at_rest(m), 0.5) == m.TAKEN


def test_refusals_have_texts(m):
    codes = [m.OUT_OF_RANGE, m.BEYOND_LIMIT, m.TOO_FAST, m.UNUSABLE_LIMITS]
    assert (m.TAKEN, codes) == (0, list(COURSE_REFUSAL_TEXT))
    assert [m.REST, m.GO, m.RUN, m.STOP] == [0, 1, 2, 3]


# ---- samples


def test_the_period_may_change_between_any_two_samples(m):
    """The plan is a function of the time passed."""
    p, c, d = limits(m), at_rest(m), at_rest(m)
    m.go_to(p, c, 0.1)
    m.go_to(p, d, 0.1)
    for period in (1e-3, 1e-3, 2e-3, 2e-3, 3e-3, 0.05, 0.05, 0.06, 1e-3, 1e-3, 0.1):
        m.advance(p, c, period)
        for _ in range(round(period / 5e-4)):
            m.advance(p, d, 5e-4)
        assert all(near(found, wanted, 1e-9) for found, wanted in zip(state(c), state(d), strict=True))
    m.advance(p, c, 1.0)
    assert state(c) == (0.1, 0.0, 0.0)
    assert m.is_at_rest(c)
    before = bytes(c)
    m.advance(p, c, T)
    assert bytes(c) == before


def test_time_is_counted_not_added_up(m):
    p, c = limits(m), at_rest(m)
    m.run_at(p, c, 0.5)
    for _ in range(60):
        m.advance(p, c, 1e-3)
    m.run_at(p, c, 0.4)
    for _ in range(200):
        m.advance(p, c, 1e-3)
    begin, first, k = c.x[c.stretch], c.since, c.stretch
    m.advance(p, c, 1e-3)
    assert c.stretch == k
    assert c.position == begin + (first + c.samples * 1e-3) * 0.4
    assert c.samples > 90


def test_it_may_begin_anywhere_at_any_time(m):
    p, c = limits(m), at_rest(m)
    m.run_at(p, c, 0.5)
    for _ in range(20):
        m.advance(p, c, T)
    assert m.begin_at(c, -3.0) == m.TAKEN
    assert (state(c), m.is_at_rest(c)) == ((-3.0, 0.0, 0.0), True)
    m.come_to_rest(p, c)
    assert m.is_at_rest(c)


# ---- led from outside


def ended(m, jerk=0.0):
    return limits(m, 1.0, 2.0, jerk, 0.0, 1.0)


def test_a_course_that_is_led_goes_where_it_is_told_and_a_stop_begins_there(m):
    for sign in (1.0, -1.0):
        c, p = at_rest(m, 0.5), limits(m, 1.0, 2.0, 40.0, 0.0, 1.0)
        assert m.follow(p, c, 0.5 + sign * 5e-4, sign * 0.5, 1e-3)
        assert state(c) == (0.5 + sign * 5e-4, sign * 0.5, 0.0)
        assert (c.mode, m.is_at_rest(c)) == (m.LED, False)
        m.advance(p, c, 1e-3)  # who leads is not led
        assert c.position == 0.5 + sign * 5e-4
        assert near(m.stopping_distance(p, c), sign * (0.5**2 / 4.0 + 0.5 * 2.0 / 80.0))  # v^2/2a + v a/2j
        m.come_to_rest(p, c)
        assert near(c.end, 0.5 + sign * (5e-4 + 0.5**2 / 4.0 + 0.5 * 2.0 / 80.0))
        follow(m, p, c)
        assert near(c.position, c.end)


def test_limits_that_led_it_are_not_those_of_before(m):
    c, p = at_rest(m, 0.2), limits(m, 1.0, 20.0, 0.0, 0.0, 1.0)
    assert m.run_at(p, c, 0.5) == m.TAKEN
    m.advance(p, c, 1e-3)
    p = ended(m)
    assert m.follow(p, c, 0.201, 0.1, 1e-3)
    assert (c.limits.acceleration, c.waiting) == (2.0, 0)
    p.acceleration = 4.0
    assert m.follow(p, c, 0.2011, 0.1, 1e-3)
    assert (c.limits.acceleration, c.asked.acceleration) == (4.0, 4.0)
    assert m.go_to(p, c, 0.3) == m.TAKEN
    assert near(follow(m, p, c)[-1][0], 0.3)


def test_a_course_that_is_led_too_fast_falls_short_of_it(m):
    for sign in (1.0, -1.0):
        for target, velocity in ((0.5 + sign * 0.1, 0.5), (0.5 + sign * 1e-3, sign * 1.01)):
            c = at_rest(m, 0.5)
            reached = m.follow(ended(m), c, target, velocity, 1e-3)
            assert near(c.position, 0.5 + sign * 1e-3)
            assert near(c.velocity, sign * 1.0)
            assert reached == (c.position == target)
        c = at_rest(m, 0.5)
        assert m.follow(ended(m), c, 0.5 + sign * 1e-3, sign * 1.0, 1e-3)  # at the limit, but for rounding
        assert (c.position, c.velocity) == (0.5 + sign * 1e-3, sign * 1.0)


def test_a_course_that_is_led_beyond_an_end_comes_to_rest_there(m):
    for sign, jerk in ((1.0, 0.0), (-1.0, 0.0), (1.0, 40.0), (-1.0, 40.0)):
        c, p, left = at_rest(m, 0.5), ended(m, jerk), []
        for _ in range(500):
            m.follow(p, c, 0.5 + sign * 1.5, 0.0, T)
            assert near(c.acceleration, 0.0)
            left.append(0.5 - sign * (c.position - 0.5) - sign * m.stopping_distance(p, c))
        assert min(left) >= -1e-12
        assert abs(c.position - (0.5 + sign * 0.5)) < 1e-6
        assert abs(c.velocity) < 1e-3
        assert m.follow(p, c, 0.5 + sign * 0.499, -sign * 0.25, T)  # and back


def test_a_target_beyond_an_end_is_none_though_it_stands_there(m):
    for sign in (1.0, -1.0):
        c = at_rest(m, 0.5 + sign * 0.5)
        assert not m.follow(ended(m), c, 0.5 + sign * 0.5004, 0.0, 1e-3)
        assert near(c.position, 0.5 + sign * 0.5)
        c = at_rest(m, 0.5 + sign * 0.6)  # it was pushed there: inwards it may
        assert m.follow(ended(m), c, 0.5 + sign * 0.5995, -sign * 0.5, 1e-3)


def test_nothing_is_led_by_limits_or_in_times_that_are_none(m):
    for p, period in ((m.CourseLimits(), 1e-3), (ended(m), 0.0), (ended(m), 1.5), (ended(m), nan)):
        c = at_rest(m, 0.5)
        assert not m.follow(p, c, 0.5001, 0.1, period)
        assert (c.position, c.mode) == (0.5, m.REST)
    assert m.follow(ended(m), c, 0.5001, 1e-4, 1.0)
    assert not m.drift(m.CourseLimits(), c, 0.5, 0.0, 1e-3)


def test_a_course_drifts_with_its_axis_as_far_as_a_stop_allows(m):
    for sign in (1.0, -1.0):
        c, p = at_rest(m, 0.5), ended(m)
        c.velocity = sign * 0.9
        assert m.drift(p, c, 0.5 + sign * 0.1, sign * 0.9, 1e-3)
        assert (state(c), c.mode) == ((0.5 + sign * 0.1, sign * 0.9, 0.0), m.LED)
        assert m.drift(p, c, 0.5, sign * 0.9, 1e-3)
        assert not m.drift(p, c, 0.5, sign * 1.1, 1e-3)
        assert c.velocity == sign * 1.0
        assert m.drift(p, c, 0.5 + sign * 0.29, sign * 0.9, 1e-3)  # slower again: 0.9 m/s takes 0.2025 m
        assert m.drift(p, c, 0.5 + sign * 0.2938, sign * 0.9, 1e-3)
        assert not m.drift(p, c, 0.5 + sign * 0.294, sign * 0.9, 1e-3)  # four samples farther, 3.6 mm, it is too late
        c.velocity = sign * 0.8
        assert not m.drift(p, c, 0.5 + sign * 0.2, sign * 0.9, 1e-3)  # on its way to 1.3 m/s
        c.velocity = -sign * 0.1
        assert m.drift(p, c, 0.5 + sign * 0.51, -sign * 0.1, 1e-3)  # beyond the end, on its way back
        before = c.position
        for nowhere in (nan, 2e9, -2e9):
            assert not m.drift(p, c, nowhere, 0.0, 1e-3)
        assert c.position == before


def test_a_course_that_slows_down_goes_on_so_where_it_may_not_drift(m):
    """It began anew at no deceleration, and led 0.4 mm beyond the end that its stop would have kept."""
    c, p = at_rest(m, 0.5), ended(m)
    c.mode, c.velocity, c.acceleration = m.STOP, 0.9, -3.0
    assert not m.drift(p, c, 0.9, 0.9, 1e-3)
    assert state(c) == (0.5, 0.9, -3.0)
