"""Command pulses; a tick here is ten clocks of 1 us, as in the axis."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from detent.control.pulse_generator import (
    FULL,
    PER_PULSE,
    PulseGenerator,
    PulseGeneratorParams,
    clock_generator,
    keeps_rate,
    ramp_rate,
)

CLOCKS = 10
FOR_EVER = 10**15


class Generator:
    """A generator and the pulses it has put out."""

    def __init__(self, rate, goal=FOR_EVER, *, acceleration=0.0):
        self.p = PulseGeneratorParams(acceleration=acceleration * PER_PULSE, ticks_per_second=1e5)
        self.r = PulseGenerator(goal=goal, rate=round(rate * PER_PULSE))
        self.clock = 0
        self.pulses: list[tuple[int, int]] = []
        """Clock, from 1, and sign of each pulse."""
        self.rates: list[int] = []
        """Rate of each tick [uHz]."""

    def ticks(self, number):
        """So many ticks, each of ten clocks."""
        for _ in range(number):
            ramp_rate(self.p, self.r)
            self.rates.append(self.r.present)
            for _ in range(CLOCKS):
                self.clock += 1
                pulse = clock_generator(self.r, 1)
                if pulse:
                    self.pulses.append((self.clock, pulse))
        return self

    def skipping_ticks(self, number):
        """So many ticks as the axis runs them: all clocks at once, the rule of the rate only where it may change."""
        for _ in range(number):
            if not keeps_rate(self.p, self.r):
                ramp_rate(self.p, self.r)
            self.rates.append(self.r.present)
            before = self.r.copy()
            pulses = clock_generator(self.r, CLOCKS)
            if pulses:
                each = [clock_generator(before, 1) for _ in range(CLOCKS)]
                assert sum(each) == pulses
                assert before.snapshot() == self.r.snapshot()
                self.pulses += [(self.clock + k + 1, pulse) for k, pulse in enumerate(each) if pulse]
            self.clock += CLOCKS
        return self


@pytest.mark.parametrize("rate", [1000, 1037, 333.333, 25_400, 99_999.999, 500_000, 1_000_000])
@pytest.mark.parametrize("sign", [1, -1])
def test_the_spacing_is_exact(rate, sign):
    g = Generator(rate, sign * FOR_EVER).ticks(1000)
    millionths = round(rate * PER_PULSE)
    expected = [-(-k * FULL // millionths) for k in range(1, 10_000 * millionths // FULL + 1)]
    assert [clock for clock, _ in g.pulses] == expected
    assert {pulse for _, pulse in g.pulses} == {sign}
    assert g.r.command == sign * len(expected)


def test_after_many_pulses_the_spacing_is_as_exact_as_at_first():
    r, clock, rate = PulseGenerator(goal=FOR_EVER, direction=1, present=1037 * PER_PULSE), 0, 1037 * PER_PULSE
    for _ in range(20_000):
        due = (FULL - r.phase - 1) // rate
        assert clock_generator(r, due) == 0
        assert clock_generator(r, 1) == 1
        clock += due + 1
    assert clock == -(-20_000 * FULL // rate)
    assert r.phase == clock * rate % FULL


def test_a_millionth_of_a_pulse_per_second_comes_after_a_million_seconds():
    r = PulseGenerator(goal=1, direction=1, present=1)
    assert clock_generator(r, FULL - 10) == 0
    assert [clock_generator(r, 1) for _ in range(10)] == [0] * 9 + [1]


@given(
    rate=st.integers(1, FULL),
    phase=st.integers(0, FULL - 1),
    clocks=st.integers(1, 40),
    goal=st.sampled_from([-FOR_EVER, -3, -1, 0, 1, 2, 5, FOR_EVER]),
)
def test_clocks_at_once_are_clocks_one_by_one(rate, phase, clocks, goal):
    r = PulseGenerator(goal=goal, direction=1 if goal > 0 else -1, present=rate, phase=phase)
    at_once = r.copy()
    pulses = [clock_generator(r, 1) for _ in range(clocks)]
    assert clock_generator(at_once, clocks) == sum(pulses)
    assert at_once.snapshot() == r.snapshot()


def test_skipping_changes_no_pulse():
    for acceleration in (0.0, 12_345.0):
        for goal in (300, -300):
            every, few = (Generator(30_000, goal, acceleration=acceleration) for _ in range(2))
            every.ticks(4000)
            few.skipping_ticks(4000)
            assert every.pulses == few.pulses
            assert every.r.snapshot() == few.r.snapshot()
            assert every.r.command == goal


@pytest.mark.parametrize("goal", [0, 1, -1, 7, -1000])
@pytest.mark.parametrize("acceleration", [0.0, 2000.0])
def test_the_command_ends_at_the_goal(goal, acceleration):
    g = Generator(50_000, goal, acceleration=acceleration).skipping_ticks(30_000)
    assert g.r.command == goal
    assert [pulse for _, pulse in g.pulses] == [int(math.copysign(1, goal))] * abs(goal)
    assert (g.r.present, g.r.phase) == (0, 0)


def test_without_acceleration_the_rate_is_there_at_once():
    g = Generator(20_000, 100).ticks(1)
    assert g.r.present == 20_000 * PER_PULSE
    g.ticks(498)
    assert (g.r.present, g.r.command) == (20_000 * PER_PULSE, 99)
    g.ticks(2)
    assert (g.r.present, g.r.command) == (0, 100)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("speed", "acceleration", "distance"), [(20_000, 2e5, 4000), (20_000, 2e5, 500), (500, 1e4, 90)]
)
def test_speed_up_and_braking_keep_the_acceleration(sign, speed, acceleration, distance):
    per_tick = acceleration * 1e-5
    g = Generator(speed, sign * distance, acceleration=per_tick)
    while g.r.command != sign * distance:
        g.skipping_ticks(1)
    rates = np.array(g.rates) / PER_PULSE
    top = min(speed, math.sqrt(acceleration * distance))
    assert rates.max() == pytest.approx(top, rel=0.02)
    assert rates.max() <= speed
    assert rates[0] == pytest.approx(per_tick)
    changes = np.diff(rates) * 1e5
    assert changes.max() <= acceleration * (1 + 1e-9)
    # Towards the goal the square root of whole phases makes the rate fall by a little more than the acceleration
    # would: of the last pulses nothing is left to see it by.
    braking = changes[: np.flatnonzero(rates >= 0.1 * top)[-1]]
    assert braking.min() >= -acceleration * 1.1
    # Time of the trapezoid or triangle.
    expected = distance / top + top / acceleration
    assert g.clock * 1e-6 == pytest.approx(expected, rel=0.03)


def test_half_way_up_the_distance_is_that_of_constant_acceleration():
    g = Generator(50_000, 10_000, acceleration=2.0).skipping_ticks(5000)
    # a = 2e5 pulses/s^2, t = 50 ms: 10 000 pulses/s and 250 pulses
    assert g.r.present == 10_000 * PER_PULSE
    assert g.r.command == pytest.approx(250, abs=1)


def test_a_new_rate_holds_from_the_next_tick_and_keeps_the_phase():
    g = Generator(1000).ticks(150)  # half way to the second pulse
    assert (g.r.command, g.r.phase) == (1, FULL // 2)
    g.r.rate = 10_000 * PER_PULSE
    g.ticks(5)
    assert g.pulses == [(1000, 1), (1550, 1)]
    g.r.rate = 250 * PER_PULSE
    g.ticks(400)
    assert g.pulses[2:] == [(5550, 1)]


def test_a_higher_rate_is_approached_with_the_acceleration():
    g = Generator(1000, acceleration=2.0).skipping_ticks(1000)
    assert g.r.present == 1_000 * PER_PULSE
    g.r.rate = 3_000 * PER_PULSE
    g.skipping_ticks(500)
    assert g.r.present == 2_000 * PER_PULSE
    g.skipping_ticks(1000)
    assert g.r.present == 3_000 * PER_PULSE


@pytest.mark.parametrize("acceleration", [0.0, 5.0])
def test_a_goal_may_move_on_or_back(acceleration):
    g = Generator(20_000, 50, acceleration=acceleration).skipping_ticks(100)
    g.r.goal = 80
    g.skipping_ticks(3000)
    assert g.r.command == 80
    g.r.goal = -20
    g.skipping_ticks(4000)
    assert g.r.command == -20
    assert [pulse for _, pulse in g.pulses] == [1] * 80 + [-1] * 100


@given(
    moves=st.lists(
        st.tuples(st.integers(-200, 200), st.integers(1, 400_000), st.integers(1, 200)), min_size=1, max_size=5
    ),
    acceleration=st.sampled_from([0.0, 0.02, 2.0, 1000.0]),
)
def test_from_rest_the_command_goes_straight_to_its_goal_and_never_past_it(moves, acceleration):
    g = Generator(1, 0, acceleration=acceleration)
    for goal, rate, ticks in moves:
        g.r.goal, g.r.rate = goal, rate * PER_PULSE
        before, seen = g.r.command, len(g.pulses)
        g.skipping_ticks(ticks)
        assert min(before, goal) <= g.r.command <= max(before, goal)
        assert {pulse for _, pulse in g.pulses[seen:]} <= {1 if goal > before else -1}
        assert 0 <= g.r.phase < FULL
        assert g.r.present <= rate * PER_PULSE
        g.r.goal = g.r.command  # stops at once
        g.skipping_ticks(1)
        assert (g.r.present, g.r.direction) == (0, 0)
    assert g.r.command == sum(pulse for _, pulse in g.pulses)


@settings(max_examples=25)
@given(
    goals=st.lists(st.tuples(st.integers(-300, 300), st.integers(0, 50_000)), min_size=2, max_size=5),
    acceleration=st.floats(0.5, 20.0),
)
def test_while_goals_and_rates_move_the_rate_keeps_its_acceleration_but_for_the_braking_at_a_goal(goals, acceleration):
    g = Generator(1, 0, acceleration=acceleration)
    velocity = 0.0
    for goal, rate in goals:
        g.r.goal, g.r.rate = goal, rate * PER_PULSE
        for _ in range(150):
            before = g.r.command
            g.skipping_ticks(1)
            new = g.r.present * g.r.direction / PER_PULSE
            # Speeding up is always within the limit; slowing down too, unless a goal has come too near.
            assert abs(new) - abs(velocity) <= acceleration * (1 + 1e-6)
            braking_way = velocity**2 / (2 * acceleration * 1e5)
            ahead = (goal - before) * (1 if velocity > 0 else -1)
            if velocity and (ahead > braking_way + 1.5 or ahead < 0):
                # At a turn the last of the old direction and the first of the new meet in one tick.
                assert abs(new - velocity) <= 2 * acceleration * (1 + 1e-6) + 1.0
            velocity = new
    g.r.goal, g.r.rate = 0, 50_000 * PER_PULSE
    while (g.r.command, g.r.present) != (0, 0):
        g.skipping_ticks(1)
        assert g.clock < 400_000


def test_a_lowered_rate_is_braked_to():
    g = Generator(20_000, acceleration=2.0).skipping_ticks(12_000)
    g.r.rate = 1000 * PER_PULSE
    g.skipping_ticks(1)
    assert g.r.present == 19_998 * PER_PULSE
    g.skipping_ticks(10_000)
    assert g.r.present == 1000 * PER_PULSE
    g.r.rate = 0
    g.skipping_ticks(1000)
    assert g.r.present == 0


def test_a_small_acceleration_adds_up():
    g = Generator(1000, acceleration=190e-5).skipping_ticks(100_000)  # 190 pulses/s^2 for a second
    assert g.r.present / PER_PULSE == pytest.approx(190.0, rel=1e-3)


def test_a_goal_behind_is_gone_back_to_after_braking():
    g = Generator(20_000, acceleration=2.0).skipping_ticks(10_000)
    turned = g.r.command
    g.r.goal = turned - 100
    g.skipping_ticks(60_000)
    signs = [pulse for _, pulse in g.pulses]
    farthest = max(np.cumsum(signs))
    assert farthest - turned == pytest.approx(20_000**2 / (2 * 2e5), abs=3)
    assert g.r.command == turned - 100


def test_the_rule_of_the_rate_is_left_out_only_where_it_would_change_nothing():
    g = Generator(20_000, 4000, acceleration=2.0)
    left_out = 0
    while g.r.command != g.r.goal:
        before = g.r.copy()
        kept = keeps_rate(g.p, g.r)
        ramp_rate(g.p, before)
        assert not kept or before.snapshot() == g.r.snapshot()
        left_out += kept
        g.skipping_ticks(1)
    assert left_out > 5_000
    assert not keeps_rate(g.p, g.r)
