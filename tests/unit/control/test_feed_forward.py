"""Feedforward in integers: worked numbers of the specification, rounding, limits."""

import math

import pytest

from detent.control.feed_forward import (
    TURN_AROUND_US,
    low_speed_start_emitters,
    ramp_interval_us,
    run_up,
    steady_drive,
    stop_distance_up,
    window_reference,
)

SPEEDS = range(18, 241)


@pytest.mark.parametrize(
    ("slope", "friction", "s", "drive"),
    [(152, 32, 240, 174), (152, 32, 60, 67), (170, 36, 240, 195), (170, 28, 240, 187), (170, 36, 30, 55)],
)
def test_steady_drive_of_the_worked_examples(slope, friction, s, drive):
    assert steady_drive(slope, friction, s) == drive


def test_steady_drive_truncates_to_within_one_count_of_the_line():
    for s in SPEEDS:
        exact = 170 * s / 256 + 36
        assert 0 <= exact - steady_drive(170, 36, s) < 1


@pytest.mark.parametrize(
    ("right", "left", "s", "interval"),
    [(174, 174, 240, 382), (142, 142, 240, 468), (159, 159, 240, 418), (195, 187, 240, 348), (39, 39, 60, 426)],
)
def test_ramp_interval_of_the_worked_examples(right, left, s, interval):
    assert ramp_interval_us(right, left, s) == interval


def test_ramp_interval_rounds_to_the_nearest_microsecond():
    for s in SPEEDS:
        exact = TURN_AROUND_US * s / 240 / (170 * s // 256 + 170 * s // 256)
        assert abs(ramp_interval_us(170 * s // 256, 170 * s // 256, s) - exact) <= 0.5


def test_ramp_interval_without_any_slope_is_the_longest_there_is():
    # A slope of zero would divide by zero: the ramp then creeps.
    assert ramp_interval_us(0, 0, 240) == TURN_AROUND_US


def test_stop_distance_and_run_up_round_up():
    for s in SPEEDS:
        assert stop_distance_up(s) == math.ceil(s * s / 144)
        assert run_up(s) == math.ceil(1.05 * s * s / 144 - 1e-9)
        assert run_up(s) >= stop_distance_up(s)


def test_low_speed_start_is_three_quarters_of_the_stop_distance():
    assert [low_speed_start_emitters(s) for s in (18, 24, 30, 42, 54, 59)] == [2, 3, 5, 10, 16, 19]
    for s in range(18, 60):
        assert low_speed_start_emitters(s) == math.ceil(0.75 * s * s / 144)


def test_window_reference_is_rounded_not_truncated():
    assert [window_reference(s) for s in (60, 90, 120, 180, 240)] == [48, 72, 96, 143, 191]
    assert 204 * 60 >> 8 == 47, "truncation would bias 10 in/s by -2 %"
