"""The tracking converter for every slow motion, and its registers for every word."""

import math

from hypothesis import example, given
from hypothesis import strategies as st
from tests.phase_servo_rig import ConverterBench

from detent.sensing.counted_speed import PulseCounter, PulseCounterParams, add_pulses
from detent.sensing.phase_converters import (
    TrackingConverter,
    TrackingParams,
    absolute_error,
    count_reference,
    emit_pulse,
)

sizes = st.sampled_from([16, 64, 256])
"""Steps per pitch N."""
starts = st.floats(0, 0.999)
"""Place in the first step, where the reference counter is in lock at power-on."""
legs = st.lists(st.tuples(st.floats(-0.93, 0.93), st.integers(1, 12)), min_size=1, max_size=6)
"""Stretches of uniform motion: steps per carrier cycle (N / (N + 1) is the limit, 0.94 for N = 16), half cycles."""


def bench_at(counts: int, start: float) -> ConverterBench:
    """Converters in lock."""
    bench = ConverterBench(counts)
    bench.phase = int(start * bench.step)
    return bench


@given(counts=sizes, start=starts, legs=legs)
@example(counts=64, start=0.0, legs=[(0.0, 4), (-0.1, 1)])  # on the edge of a step, where one sample decides
@example(counts=16, start=0.984375, legs=[(0.609375, 10), (-0.875, 12), (0.921875, 7)])  # by half a sample, and quick
def test_pulses_count_the_steps_of_any_slow_motion_and_the_reference_stays_in_lock(counts, start, legs):
    bench = bench_at(counts, start)
    net = 0
    for rate, half_cycles in legs:
        for _ in range(half_cycles):
            pulse = bench.travel(rate, counts // 2)
            assert abs(pulse) <= 1  # turns of the reference counter are longer than half a cycle
            net += pulse
            # A step that was reached since the last sample is not seen yet.
            seen = bench.place - rate / counts
            assert min(abs(net - math.floor(place)) for place in (bench.place, seen)) <= 1
            # What the counter is ahead of the carrier is what has been counted: every pulse moves it, nothing else.
            assert (bench.lead - net) % counts == 0
    net += bench.travel(0.0, 2 * counts)
    assert net == math.floor(bench.place)


@given(counts=sizes, start=starts, legs=legs, direction=st.sampled_from((1, -1)))
def test_motion_one_way_gives_pulses_of_its_sign_only(counts, start, legs, direction):
    bench = bench_at(counts, start)
    for rate, half_cycles in legs:
        for _ in range(half_cycles):
            assert bench.travel(direction * abs(rate), counts // 2) in {0, direction}


@given(start=starts, legs=legs)
def test_there_and_back_the_pulses_cancel(start, legs):
    bench = bench_at(64, start)
    net = sum(bench.travel(rate, 32 * n) for rate, n in legs)
    net += sum(bench.travel(-rate, 32 * n) for rate, n in reversed(legs))
    net += bench.travel(0.0, 128)
    assert net == 0
    assert bench.lead == 0


@given(counts=sizes, start=starts, legs=legs)
def test_at_rest_the_absolute_word_says_where_the_count_has_come_to(counts, start, legs):
    bench = bench_at(counts, start)
    net = sum(bench.travel(rate, counts // 2 * n) for rate, n in legs) + bench.travel(0.0, 3 * counts)
    lead = (net + counts // 2) % counts - counts // 2
    word = bench.r.absolute.word
    assert word == 2 * abs(lead)
    assert absolute_error(bench.p.absolute, bench.r.absolute) == word // 2 - counts // 4


@given(
    reference=st.integers(0, 63),
    levels=st.lists(st.integers(0, 1), min_size=4, max_size=4),
    repaired=st.integers(0, 1),
)
def test_the_reference_counter_wraps_at_its_six_bits(reference, levels, repaired):
    p = TrackingParams(mask=63, top=5, leave_antiphase=repaired)
    r = TrackingConverter(reference=reference)
    r.ps_first, r.ps_second, r.msb_first, r.msb_second = levels
    count_reference(p, r)
    emit_pulse(p, r)
    assert r.plus & r.minus == 0
    assert r.reference == (reference + 1 + r.plus - r.minus) % 64


@given(bits=st.integers(4, 16), pulses=st.lists(st.integers(-40_000, 40_000), max_size=20))
def test_a_pulse_counter_is_the_sum_in_two_s_complement_of_its_width(bits, pulses):
    half = 1 << (bits - 1)
    p, r = PulseCounterParams(half=half), PulseCounter()
    for n, pulse in enumerate(pulses):
        add_pulses(p, r, pulse)
        assert r.count == (sum(pulses[: n + 1]) + half) % (2 * half) - half
