"""Streams of set-points, whatever comes and whenever: what is between them, and where the limits hold."""

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from detent.control.stream import LATEST, POSITION, Stream, advance_stream, is_lost, open_stream, point_now
from detent.planning.course import Course, CourseLimits, advance, begin_at, come_to_rest, follow, is_at_rest
from detent.planning.speed_ramp import way_to_rest

POINTS = st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=30)
TINY = 1e-9
PERIOD = 1e-3


def streamed(points: list[float], looks: int, gaps: list[int]) -> tuple[Any, list[float]]:
    """References of a stream whose set-points come so many looks later than they should."""
    s: Any = Stream()
    open_stream(s, POSITION, looks, looks * PERIOD)
    found = []
    for k, point in enumerate(points):
        point_now(s, point, 0.0)
        for _ in range(looks + gaps[k % len(gaps)]):
            advance_stream(s, s.value if found else 0.0)
            found.append(s.value)
    return s, found


@given(POINTS, st.integers(1, 7))
def test_in_time_every_set_point_is_the_reference_and_between_them_lies_a_straight_line(points, looks):
    _, found = streamed(points, looks, [0])
    assert found[looks - 1 :: looks] == points
    before = 0.0
    for k, point in enumerate(points):
        for i, value in enumerate(found[k * looks : (k + 1) * looks], 1):
            assert abs(value - (before + (point - before) * i / looks)) <= TINY
        before = point


@given(POINTS, st.integers(1, 7), st.lists(st.integers(-3, 40), min_size=1, max_size=5))
def test_late_or_early_a_set_point_is_reached_a_period_after_it_came_unless_another_did_before(points, looks, gaps):
    gaps = [max(gap, 1 - looks) for gap in gaps]
    s, found = streamed(points, looks, gaps)
    begin = 0
    for k, point in enumerate(points):
        gap = gaps[k % len(gaps)]
        if gap >= 0:
            assert found[begin + looks - 1] == point
        begin += looks + gap
    assert is_lost(s) == (s.since >= (1 + LATEST) * looks)


LIMITS = st.builds(
    lambda speed, acceleration, jerk: CourseLimits(
        speed=speed, acceleration=acceleration, jerk=jerk, lowest=-0.5, highest=0.5
    ),
    st.floats(0.05, 2.0), st.floats(0.5, 20.0), st.sampled_from([0.0, 20.0, 500.0]),
)  # fmt: skip


@given(
    LIMITS,
    st.lists(st.tuples(st.floats(-2.0, 2.0), st.integers(1, 60), st.floats(-2.0, 2.0)), min_size=1, max_size=4),
    st.data(),
)
def test_a_course_that_is_led_keeps_speed_and_ends_and_stops_inside_from_anywhere(limits, wanted, data):
    c: Any = Course()
    begin_at(c, data.draw(st.floats(-0.5, 0.5)))
    for place, samples, factor in wanted:
        for _ in range(samples):
            before = c.position
            follow(limits, c, place, (place - before) / PERIOD * factor, PERIOD)
            assert abs(c.position - before) <= limits.speed * PERIOD + TINY
            assert limits.lowest - TINY <= c.position <= limits.highest + TINY
            rest = c.position + way_to_rest(limits.acceleration, limits.jerk, c.velocity, c.acceleration)
            assert limits.lowest - TINY <= rest <= limits.highest + TINY
    come_to_rest(limits, c)
    for _ in range(100_000):
        advance(limits, c, PERIOD)
        assert limits.lowest - TINY <= c.position <= limits.highest + TINY
        if is_at_rest(c):
            break
    assert is_at_rest(c)
