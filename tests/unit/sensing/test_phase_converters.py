import itertools
import math

import numpy as np
import pytest
from tests.coil_currents import LARGE, coil_currents
from tests.phase_servo_rig import ConverterBench

from detent.sensing.phase_converters import (
    AbsoluteConverter,
    AbsoluteParams,
    Carrier,
    CarrierParams,
    TrackingConverter,
    TrackingParams,
    absolute_error,
    count_absolute,
    count_carrier,
    count_reference,
    emit_pulse,
    reset_carrier,
    shift_samples,
)

SLOTS = [(0, 0), (0, 1), (1, 0), (1, 1), (1, 1), (1, 0), (0, 1), (0, 0)]
"""Switches (a, b) of the first coil through a cycle."""


def params(counts: int) -> CarrierParams:
    return CarrierParams(mask=counts - 1, shift=counts.bit_length() - 4)


def switches(r: Carrier) -> tuple[tuple[int, int], tuple[int, int]]:
    """(a, b) of both coils."""
    s = r.switches
    return (s & 1, s >> 1 & 1), (s >> 2 & 1, s >> 3 & 1)


@pytest.mark.parametrize("counts", [16, 64, 1024])
def test_both_coils_run_through_the_slots_the_second_a_quarter_cycle_behind(counts):
    p, r = params(counts), Carrier()
    reset_carrier(r)
    for n in range(2 * counts):
        slot = n * 8 // counts % 8
        assert r.count == n % counts
        assert switches(r) == (SLOTS[slot], SLOTS[slot - 2])
        count_carrier(p, r)


def test_power_on_is_the_beginning_of_a_cycle_like_any_other():
    p, r = params(64), Carrier(count=37, switches=15)
    reset_carrier(r)
    after = r.copy()
    for _ in range(64):
        count_carrier(p, r)
    assert r.snapshot() == after.snapshot()


def test_the_flip_flop_is_the_top_bit_a_quarter_cycle_later():
    p, r = params(64), Carrier()
    reset_carrier(r)
    for n in range(1, 200):
        count_carrier(p, r)
        assert r.delayed_msb == (n - 16) % 64 // 32


def test_the_small_resistor_carries_three_units():
    assert LARGE == 3.0
    r = Carrier(switches=0b1101)
    assert coil_currents(r, 3.0) == (3.0, 4.0)
    assert coil_currents(r, 2.5) == (2.5, 3.5)
    r.switches = 0b0010
    assert coil_currents(r, 3.0) == (1.0, 0.0)


@pytest.mark.parametrize("large", [2.0, 1 + math.sqrt(2), 3.0, 4.0])
def test_the_fundamental_is_that_of_the_staircase(large):
    p, r = params(1024), Carrier()
    reset_carrier(r)
    levels = []
    for _ in range(1024):
        levels.append(coil_currents(r, large))
        count_carrier(p, r)
    angle = 2 * np.pi * (np.arange(1024) + 0.5) / 1024  # middle of each count
    first, second = np.array(levels).T
    amplitude = 2 / np.pi * (large - 1 + math.sqrt(2))  # steps of 1, large - 1, 1 at 45, 90, 135 degrees
    assert 2 * np.mean(first * np.cos(angle)) == pytest.approx(-amplitude, rel=1e-5)
    assert 2 * np.mean(second * np.sin(angle)) == pytest.approx(-amplitude, rel=1e-5)
    assert np.mean(first * np.sin(angle)) == pytest.approx(0.0, abs=1e-12)
    assert np.mean(second * np.cos(angle)) == pytest.approx(0.0, abs=1e-12)
    assert first.mean() == pytest.approx((large + 1) / 2, rel=1e-12)


PARAMS = TrackingParams(mask=63, top=5)
REPAIRED = TrackingParams(mask=63, top=5, leave_antiphase=1)


def test_the_reference_counter_counts_every_first_clock_and_wraps():
    r = TrackingConverter(reference=62)
    seen = []
    for _ in range(3):
        count_reference(PARAMS, r)
        seen.append(r.reference)
    assert seen == [63, 0, 1]


def test_both_signals_are_sampled_twice():
    r = TrackingConverter(reference=32)
    shift_samples(PARAMS, r, 1)
    assert (r.ps_first, r.ps_second, r.msb_first, r.msb_second) == (1, 0, 1, 0)
    r.reference = 0
    shift_samples(PARAMS, r, 0)
    assert (r.ps_first, r.ps_second, r.msb_first, r.msb_second) == (0, 1, 0, 1)


@pytest.mark.parametrize(("msb_first", "msb_second", "ps_first", "ps_second"), [*itertools.product((0, 1), repeat=4)])
@pytest.mark.parametrize("p", [PARAMS, REPAIRED], ids=["as built", "repaired"])
def test_truth_table_of_the_pulses(p, msb_first, msb_second, ps_first, ps_second):
    r = TrackingConverter(
        reference=40, msb_first=msb_first, msb_second=msb_second, ps_first=ps_first, ps_second=ps_second
    )
    emit_pulse(p, r)
    gate = (msb_first, msb_second) == (1, 0)
    lead = (ps_first, ps_second) in ({(1, 1), (0, 1)} if p.leave_antiphase else {(1, 1)})
    lag = (ps_first, ps_second) == (0, 0)
    assert (r.gate, r.plus, r.minus) == (gate, gate and lead, gate and lag)
    assert r.reference == 40 + r.plus - r.minus


@pytest.mark.parametrize(("reference", "ps", "expected"), [(63, 1, 0), (0, 0, 63)])
def test_a_correction_wraps_with_the_counter(reference, ps, expected):
    r = TrackingConverter(reference=reference, msb_first=1, msb_second=0, ps_first=ps, ps_second=ps)
    emit_pulse(PARAMS, r)
    assert r.reference == expected


@pytest.mark.parametrize(("counts", "spacing"), [(16, 1), (32, 1), (128, 25)])
@pytest.mark.parametrize("repaired", [False, True])
def test_acquisition_from_every_offset(counts, spacing, repaired):
    half = counts // 2
    for offset in range(half, -half, -spacing):
        bench = ConverterBench(counts, leave_antiphase=repaired)
        pulses = bench.pulses(half * (counts + 2), offset)
        if offset == half and not repaired:
            assert pulses == []  # the false lock
            continue
        sign, turn = (1, counts - 1) if offset > 0 else (-1, counts + 1)
        assert pulses == [(half + n * turn, sign) for n in range(abs(offset))]
        assert bench.lead == offset


@pytest.mark.parametrize("counts", [16, 64])
def test_the_false_lock_is_one_step_wide(counts):
    half = counts // 2
    for offset, pulses in ((half - 0.01, half - 1), (half, 0), (half + 0.99, 0), (half + 1, -half + 1)):
        bench = ConverterBench(counts)
        assert sum(sign for _, sign in bench.pulses(half * (counts + 2), offset)) == pulses


@pytest.mark.parametrize(("rate", "turn"), [(1.5, 15), (-1.5, 17)])
def test_at_most_one_pulse_per_turn_of_the_reference_counter(rate, turn):
    bench = ConverterBench(16)
    pulses = [bench.clock(rate * tick / 16) for tick in range(200)]  # faster than it can follow
    found = [tick for tick, pulse in enumerate(pulses) if pulse]
    assert {later - earlier for earlier, later in itertools.pairwise(found)} == {turn}
    assert {pulse for pulse in pulses if pulse} == {1 if rate > 0 else -1}
    assert len(found) >= 10


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
