import pytest

from detent.control.clock_chain import (
    ClockChain,
    ClockParams,
    integrate_strobe,
    next_period,
    reference_period,
    sample_strobe,
)


def test_each_clock_has_half_the_oscillators_periods_and_the_first_begins():
    r = ClockChain()
    seen = []
    for _ in range(6):
        next_period(r)
        seen.append((r.divider, reference_period(r), r.ck1, r.ck2))
    assert seen == [(1, 0, 1, 0), (2, 0, 0, 1), (3, 1, 1, 0), (4, 1, 0, 1), (5, 2, 1, 0), (6, 2, 0, 1)]


@pytest.mark.parametrize(("integrate_tap", "sample_tap"), [(5, 4), (4, 5), (4, 4)])
def test_strobes_come_once_per_period_of_their_tap(integrate_tap, sample_tap):
    p = ClockParams(integrate_mask=(1 << integrate_tap) - 1, sample_mask=(1 << sample_tap) - 1)
    r = ClockChain()
    integrate, sample = [], []
    for _ in range(96):
        next_period(r)
        if integrate_strobe(p, r):
            integrate.append(r.divider)
        if sample_strobe(p, r):
            sample.append(r.divider)
    assert integrate == list(range(1 << integrate_tap, 97, 1 << integrate_tap))
    assert sample == list(range(1 << sample_tap, 97, 1 << sample_tap))
