import math
import random

import numpy as np
import pytest

from detent.sensing.counted_speed import (
    FIXED,
    FLOAT,
    NONE,
    PulseCounter,
    PulseCounterParams,
    SpeedFilter,
    SpeedFilterParams,
    add_pulses,
    close_window,
    filter_speed,
)


def test_latch_then_clear():
    p, r = PulseCounterParams(half=128), PulseCounter()
    add_pulses(p, r, 5)
    add_pulses(p, r, -2)
    assert (r.count, r.word) == (3, 0)
    close_window(r)
    assert (r.count, r.word) == (0, 3)
    add_pulses(p, r, -1)
    assert r.word == 3  # stands until the next strobe
    close_window(r)
    assert (r.count, r.word) == (0, -1)


@pytest.mark.parametrize("bits", [4, 8, 12, 16])
def test_the_counter_wraps_at_its_width_in_both_directions(bits):
    half = 1 << (bits - 1)
    p, r = PulseCounterParams(half=half), PulseCounter(count=half - 1)
    add_pulses(p, r, 1)
    assert r.count == -half
    add_pulses(p, r, -1)
    assert r.count == half - 1
    for pulses in (3 * half + 7, -5 * half - 2):
        expected = (r.count + pulses + half) % (2 * half) - half
        add_pulses(p, r, pulses)
        assert r.count == expected


def filter_of(kind=FLOAT, *, scale=4, shift=2, fraction_bits=8):
    """A filter with A = 2^-shift."""
    return SpeedFilterParams(
        kind=kind, scale=scale, coefficient=2.0**-shift, shift=shift, fraction_bits=fraction_bits
    ), SpeedFilter()


def answer(p, r, counts):
    """Output after each sample."""
    found = []
    for count in counts:
        filter_speed(p, r, count)
        found.append(r.output)
    return found


@pytest.mark.parametrize("count", [0, 5, -5, 127, -128, 2047, -2048])
def test_without_filter_the_scaled_count_passes(count):
    p, r = filter_of(NONE, scale=256)
    assert answer(p, r, [count, 0, count]) == [256 * count, 0, 256 * count]
    assert r.input == 256 * count


def test_the_scale_stands_before_the_filter():
    p, r = filter_of(scale=4)
    filter_speed(p, r, 6)
    assert (r.input, r.output) == (24, 6.0)


@pytest.mark.parametrize("sign", [1, -1])
def test_an_impulse_is_spread_over_weights_that_sum_to_one(sign):
    p, r = filter_of(scale=64)
    found = np.array(answer(p, r, [sign, *[0] * 200])) / (64 * sign)
    assert found[:3].tolist() == [1 / 4, 3 / 16, 9 / 64]
    assert found.sum() == pytest.approx(1, abs=1e-12)


def test_a_step_approaches_its_height_as_the_time_constant_says():
    p, r = filter_of(scale=100)
    found = np.array(answer(p, r, [1] * 40)) / 100
    assert found[:5] == pytest.approx([0.25, 0.4375, 0.5781, 0.6836, 0.7627], abs=5e-5)
    time_constant = -5e-3 / math.log(1 - 0.25)
    assert time_constant == pytest.approx(17.38e-3, abs=5e-6)
    assert found == pytest.approx(1 - np.exp(-5e-3 * np.arange(1, 41) / time_constant), rel=1e-12)


def test_an_alternation_is_reduced_to_a_seventh():
    p, r = filter_of(scale=7)
    assert np.abs(answer(p, r, [1, -1] * 100)[-2:]) == pytest.approx([1, 1], rel=1e-9)


def test_independent_errors_of_the_count_are_reduced_to_0_378():
    dice = random.Random(63410)
    counts = [dice.choice((-1, 1)) for _ in range(20_000)]
    p, r = filter_of(scale=1)
    # Of 20 000 samples, 1 in 7 independent of the last: the deviation is known to about 1 %.
    assert np.std(answer(p, r, counts)) == pytest.approx(math.sqrt(0.25 / 1.75), rel=0.03)


@pytest.mark.parametrize("kind", [FLOAT, FIXED])
def test_a_coefficient_of_one_is_no_filter(kind):
    p, r = filter_of(kind, shift=0)
    assert answer(p, r, [5, -3, 127, -128]) == [20, -12, 508, -512]


@pytest.mark.parametrize("shift", [1, 2, 4])
@pytest.mark.parametrize("fraction_bits", [0, 1, 8, 12])
@pytest.mark.parametrize(("start", "end"), [(0, 30), (30, 0), (0, -30), (-30, 0), (-7, 9)])
def test_fixed_point_stops_no_more_than_its_rounding_below_the_input(shift, fraction_bits, start, end):
    p, r = filter_of(FIXED, shift=shift, fraction_bits=fraction_bits)
    r.accumulator = 4 * start << fraction_bits
    found = answer(p, r, [end] * 1000)
    stuck = (4 * end - found[-1]) * (1 << fraction_bits)
    assert found[-1] == found[-2]
    # The shift rounds down: from below it sticks 2^a - 1 short, from above it arrives.
    assert stuck == (2**shift - 1 if end > start else 0)


def test_fixed_point_follows_the_real_one_within_its_rounding():
    dice = random.Random(8)
    counts = [dice.randrange(-128, 128) for _ in range(2000)]
    fixed, real = answer(*filter_of(FIXED), counts), answer(*filter_of(FLOAT), counts)
    error = np.subtract(fixed, real)
    assert error.max() <= 0
    assert error.min() >= -(2**2) / 256  # each sample loses less than a last bit, and three quarters of it stay
    assert error.min() < -1 / 256


@pytest.mark.parametrize("count", [2047, -2048])
def test_the_accumulator_holds_the_largest_count_with_twelve_fraction_bits(count):
    p, r = filter_of(FIXED, scale=255, fraction_bits=12)
    found = answer(p, r, [count] * 200)
    assert found[-1] == pytest.approx(255 * count, abs=4 / 4096)
    assert np.all(np.diff(found) * np.sign(count) >= 0)


def test_the_output_is_held_between_samples():
    p, r = filter_of()
    filter_speed(p, r, 5)
    held = r.output
    p.coefficient = 0.5
    assert r.output == held
    filter_speed(p, r, 5)
    assert r.output == 0.5 * 20 + 0.5 * held
