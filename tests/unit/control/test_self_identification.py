"""Slope and friction from two measured points; what is implausible changes nothing."""

import pytest

from detent.control.self_identification import IdentifiedLine, PlausibleLimits, identify


def limits(**changes):
    return PlausibleLimits(**({"slope_min": 100, "slope_max": 255, "friction_max": 80, "rise_min": 60} | changes))


def line(fast, slow):
    return IdentifiedLine(slope=152, friction=32, speed_fast=fast, speed_slow=slow)


@pytest.mark.parametrize(("fast", "slow", "slope", "friction"), [(208, 47, 170, 36), (220, 59, 170, 28)])
def test_worked_examples(fast, slow, slope, friction):
    r = line(fast, slow)
    assert identify(r, limits(), 174, 67)
    assert (r.slope, r.friction, r.valid) == (slope, friction, 1)


def test_the_line_goes_through_both_points_to_a_count():
    for rise in range(110, 270, 7):
        for slow in range(30, 70, 3):
            r = line(slow + rise, slow)
            if identify(r, limits(), 174, 67):
                assert r.slope * (slow + rise) / 256 + r.friction == pytest.approx(174, abs=1.1)
                assert r.slope * slow / 256 + r.friction == pytest.approx(67, abs=0.51)


def test_literal_intercept_takes_the_nominal_slow_speed():
    r = line(208, 47)
    assert identify(r, limits(literal_intercept=1), 174, 67)
    assert (r.slope, r.friction) == (170, 67 - (170 * 60 >> 8)) == (170, 28)


@pytest.mark.parametrize(
    ("fast", "slow", "why"),
    [
        (47, 47, "no rise"),
        (40, 50, "slower at more drive"),
        (107, 47, "rise of 60"),
        (0, 0, "no measurement"),
        (154, 47, "slope 256"),
        (322, 47, "slope 99.6 rounds to 100 but friction 49"),
        (400, 47, "slope 78"),
        (240, 112, "friction below zero"),
    ],
)
def test_implausible_data_keep_the_old_line(fast, slow, why):
    r = line(fast, slow)
    expected = fast == 322
    r.valid = 1
    assert identify(r, limits(), 174, 67) is expected, why
    assert r.valid == int(expected)
    if not expected:
        assert (r.slope, r.friction) == (152, 32)


@pytest.mark.parametrize(
    ("changes", "plausible"),
    [
        ({}, True),
        ({"slope_min": 170, "slope_max": 170, "friction_max": 36}, True),
        ({"slope_min": 171}, False),
        ({"slope_max": 169}, False),
        ({"friction_max": 35}, False),
    ],
)
def test_the_limits_themselves_are_plausible(changes, plausible):
    assert identify(line(208, 47), limits(**changes), 174, 67) is plausible


def test_a_slower_axis_may_measure_closer_speeds():
    line = IdentifiedLine(slope=152, friction=32, speed_fast=100, speed_slow=47)
    assert not identify(line, limits(), 103, 67)
    assert identify(line, limits(rise_min=20), 103, 67)
    assert (line.slope, line.friction) == (174, 35)
