"""Choice of speed: strict inequality, halving, floor, and the commanded maximum."""

import pytest

from detent.control.speed_selection import FLOOR, HIGH_SPEED, fits, select_speed, slower


def test_equality_does_not_fit():
    # 5 x 120^2 = 288 x 250
    assert not fits(250, 120)
    assert fits(251, 120)


@pytest.mark.parametrize(
    ("s", "maximum", "expected"),
    [(240, 240, 120), (61, 240, 30), (62, 240, 31), (60, 240, 30), (31, 31, 30), (20, 20, 20), (18, 18, 18)],
)
def test_next_trial_is_half_but_not_below_the_floor_nor_above_the_maximum(s, maximum, expected):
    assert slower(s, maximum) == expected


@pytest.mark.parametrize(
    ("distance", "expected"), [(1001, 240), (1000, 120), (251, 120), (250, 60), (63, 60), (62, 30), (1, 30), (0, 30)]
)
def test_run_table(distance, expected):
    assert select_speed(distance, 240) == expected


def test_a_maximum_below_the_floor_is_never_raised():
    for maximum in range(18, FLOOR + 1):
        assert {select_speed(d, maximum) for d in (0, 1, 5, 100, 4000)} == {maximum}


def test_the_selected_speed_is_the_maximum_halved_some_times_or_the_floor():
    for maximum in range(18, 241):
        chain = {maximum >> n for n in range(5)} | {min(FLOOR, maximum)}
        for distance in (1, 30, 62, 63, 100, 250, 251, 600, 1000, 1001, 4350):
            s = select_speed(distance, maximum)
            assert s in chain
            higher = [one for one in chain if s < one <= maximum and one > FLOOR]
            assert not any(fits(distance, one) for one in higher)


def test_ten_inches_per_second_is_a_speed_value_of_60():
    assert HIGH_SPEED == 10 * 6
    assert FLOOR == 5 * 6
