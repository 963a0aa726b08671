import itertools

import pytest
from tests.phase_servo_rig import ConverterBench

from detent.sensing.tracking_converter import (
    TrackingConverter,
    TrackingParams,
    count_reference,
    emit_pulse,
    shift_samples,
)

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
