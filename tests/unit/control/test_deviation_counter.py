import pytest
from tests.filtered_servo_rig import Rig

from detent.control.deviation_counter import (
    DEVIATION_RANGE,
    FAULT,
    RESET,
    RUN,
    SPEED_RANGE,
    Deviation,
    DeviationParams,
    count_deviation,
    drive_word,
    round_half_away,
    watch_ranges,
)
from detent.errors import SERVO_FAULT_TEXT

P = DeviationParams(gain=1.0, range=2047, word_limit=127.0)


@pytest.mark.parametrize(
    ("commanded", "moved", "deviation"),
    [(1, 0, 1), (-1, 0, -1), (0, 1, -1), (0, -1, 1), (1, 1, 0), (-1, -1, 0), (1, -1, 2), (-1, 1, -2), (0, 0, 0)],
)
def test_pulses_of_one_clock(commanded, moved, deviation):
    r = Deviation(deviation=10, position=100)
    count_deviation(r, commanded, moved)
    assert (r.deviation, r.position) == (10 + deviation, 100 + moved)


@pytest.mark.parametrize("deviation", [2047, -2047, 0])
def test_the_whole_range_of_the_position_counter_is_used(deviation):
    r = Deviation(state=RUN, deviation=deviation)
    watch_ranges(P, r, 0, 128)
    assert (r.state, r.cause) == (RUN, 0)


@pytest.mark.parametrize("deviation", [2048, -2048, 32767, -32768])
def test_beyond_its_range_the_axis_fails(deviation):
    r = Deviation(state=RUN, deviation=deviation)
    watch_ranges(P, r, 0, 128)
    assert (r.state, r.cause) == (FAULT, DEVIATION_RANGE)


@pytest.mark.parametrize(("half", "count"), [(128, 127), (128, -128), (2048, 2047), (2048, -2048)])
def test_the_axis_fails_before_the_speed_counter_wraps(half, count):
    r = Deviation(state=RUN)
    watch_ranges(P, r, count - 1 if count > 0 else count + 1, half)
    assert r.state == RUN
    watch_ranges(P, r, count, half)
    assert (r.state, r.cause) == (FAULT, SPEED_RANGE)


def test_a_fault_lasts_when_its_cause_has_gone():
    r = Deviation(state=RUN, deviation=2048)
    watch_ranges(P, r, 0, 128)
    r.deviation = 0
    watch_ranges(P, r, 0, 128)
    assert (r.state, r.cause) == (FAULT, DEVIATION_RANGE)


def test_each_cause_has_its_text():
    assert set(SERVO_FAULT_TEXT) == {DEVIATION_RANGE, SPEED_RANGE}


@pytest.mark.parametrize(
    ("deviation", "speed", "error", "word"),
    [
        (20, 20.0, 0.0, 0.0),
        (20, 19.25, 0.75, 0.75),
        (-20, -19.25, -0.75, -0.75),
        (127, 0.0, 127.0, 127.0),
        (128, 0.0, 128.0, 127.0),
        (-128, 0.0, -128.0, -127.0),
        (0, 508.0, -508.0, -127.0),
        (0, -512.0, 512.0, 127.0),
    ],
)
def test_the_drive_word_is_the_error_within_its_limit(deviation, speed, error, word):
    r = Deviation(state=RUN, deviation=deviation)
    assert drive_word(P, r, speed) == word
    assert r.error == error


def test_the_gain_weighs_the_deviation_alone():
    r = Deviation(state=RUN, deviation=10)
    drive_word(DeviationParams(gain=2.5, word_limit=127.0), r, 20.0)
    assert r.error == 5.0


@pytest.mark.parametrize("state", [RESET, FAULT])
def test_no_drive_but_in_run(state):
    r = Deviation(state=state, deviation=50)
    assert drive_word(P, r, 20.0) == 0.0
    assert r.error == 30.0


def test_a_smaller_limit_holds_in_both_directions():
    p = DeviationParams(gain=1.0, word_limit=40.5, whole_words=0)
    for deviation, word in ((100, 40.5), (-100, -40.5), (40, 40.0)):
        r = Deviation(state=RUN, deviation=deviation)
        assert drive_word(p, r, 0.0) == word


@pytest.mark.parametrize(
    ("value", "whole"), [(0.0, 0), (0.49, 0), (0.5, 1), (1.5, 2), (2.5, 3), (126.5, 127), (0.25, 0), (3.0, 3)]
)
def test_whole_words_are_rounded_alike_in_both_directions(value, whole):
    assert round_half_away(value) == whole
    assert round_half_away(-value) == -whole
    p = DeviationParams(gain=1.0, word_limit=127.0, whole_words=1)
    for sign in (1, -1):
        r = Deviation(state=RUN, deviation=0)
        assert drive_word(p, r, -sign * value) == sign * whole
        assert r.error == sign * value


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("whole", "limit"), [("true", 67.0), ("false", 67.85)])
def test_whole_words_keep_a_limit_between_two_counts(sign, whole, limit):
    # The whole words of an axis whose effort allows 67.85 counts end at 67.
    rig = Rig(f"drive.whole_words={whole}")
    effort = 67.85 * rig.spec.force_per_count
    p = Rig(f"drive.whole_words={whole}", f"limits.effort={effort!r} N").p.controller.deviation
    r = Deviation(state=RUN, deviation=100 * sign)
    assert drive_word(p, r, 0.0) == pytest.approx(limit * sign)


def test_the_first_cause_of_a_fault_stays():
    r = Deviation(state=RUN)
    watch_ranges(P, r, 127, 128)
    r.deviation = 2048
    watch_ranges(P, r, 0, 128)
    assert (r.state, r.cause) == (FAULT, SPEED_RANGE)
