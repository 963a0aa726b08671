import math

import numpy as np
import pytest
from tests.phase_servo_rig import ConverterBench

from detent.sensing.absolute_converter import AbsoluteConverter, AbsoluteParams, absolute_error, count_absolute


def word_at(bench: ConverterBench, steps: float) -> int:
    """Word after enough cycles at rest."""
    for _ in range(3 * bench.counts):
        bench.clock(steps)
    return bench.r.absolute.word


@pytest.mark.parametrize("counts", [16, 64, 128])
def test_the_word_is_a_triangle_of_two_counts_per_step(counts):
    half = counts // 2
    for steps in np.arange(-half, half, 0.25 if counts == 16 else 1.75):
        bench = ConverterBench(counts)
        assert word_at(bench, steps) == (2 * math.floor(steps) if steps >= 0 else 2 * math.ceil(-steps))


def test_the_whole_range_of_the_widest_counter_fits():
    bench = ConverterBench(1024)
    assert word_at(bench, 512) == 1024
    assert absolute_error(bench.p.absolute, bench.r.absolute) == 256


@pytest.mark.parametrize("counts", [16, 64])
def test_the_error_falls_by_one_per_step_through_the_positioning_point(counts):
    quarter = counts // 4
    bench = ConverterBench(counts, lag=quarter - 1)
    for displacement in np.arange(-quarter, quarter, 0.5):
        word_at(bench, displacement)
        error = absolute_error(bench.p.absolute, bench.r.absolute)
        assert error == -1 - math.floor(displacement)


def test_the_error_over_two_pitches_is_a_triangle_right_in_sign_to_half_a_pitch():
    bench = ConverterBench(64, lag=15)
    errors = {}
    for displacement in range(-64, 64):
        word_at(bench, displacement + 0.5)
        errors[displacement] = absolute_error(bench.p.absolute, bench.r.absolute)
    assert errors == {d: 16 - abs((d + 17 + 32) % 64 - 32) for d in errors}
    assert all(errors[d] < 0 for d in range(31))
    assert all(errors[d] > 0 for d in range(-32, -1))
    assert errors[40] > 0  # towards the next positioning point


def test_the_latch_comes_in_the_tick_in_which_the_top_bit_rises_and_the_clear_after_it():
    p, r = AbsoluteParams(mask=15, top=3), AbsoluteConverter(free=6, gated=9, word=3)
    count_absolute(p, r, 0)
    assert (r.free, r.latched, r.word, r.gated) == (7, 0, 3, 9)
    count_absolute(p, r, 0)
    assert (r.free, r.latched, r.word, r.gated) == (8, 1, 9, 1)  # this tick is the first of the new cycle
    count_absolute(p, r, 1)
    assert (r.latched, r.word, r.gated) == (0, 9, 1)


def test_the_free_counter_wraps_without_a_latch():
    p, r = AbsoluteParams(mask=15, top=3), AbsoluteConverter(free=15, msb=1, gated=4)
    count_absolute(p, r, 1)
    assert (r.free, r.msb, r.latched, r.gated) == (0, 0, 0, 5)


@pytest.mark.parametrize(("word", "error"), [(0, -16), (1, -16), (31, -1), (32, 0), (33, 0), (64, 16)])
def test_the_lowest_bit_of_the_word_is_dropped(word, error):
    assert absolute_error(AbsoluteParams(mask=63, top=5), AbsoluteConverter(word=word)) == error
