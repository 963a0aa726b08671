import pytest

from detent.control.clocks import (
    ClockChain,
    ClockParams,
    SampleClock,
    SawtoothParams,
    SawtoothPwm,
    count_clock,
    count_sawtooth,
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


def period(p: SawtoothParams, r: SawtoothPwm, word: int) -> list[int]:
    """Requests of one sawtooth."""
    return [count_sawtooth(p, r, word) for _ in range(2 * p.half)]


@pytest.mark.parametrize("half", [8, 128, 2048])
def test_the_sawtooth_runs_through_its_range_and_begins_again(half):
    p, r = SawtoothParams(half=half), SawtoothPwm(sawtooth=half - 2)
    seen = []
    for _ in range(2 * half + 1):
        count_sawtooth(p, r, 0)
        seen.append(r.sawtooth)
    assert seen == [half - 1, *range(-half, half)]


@pytest.mark.parametrize("half", [8, 128])
def test_requests_of_every_word(half):
    p, r = SawtoothParams(half=half), SawtoothPwm()
    for word in range(-half, half):
        requests = period(p, r, word)
        assert requests.count(1) == word + half
        assert requests.count(-1) == half - 1 - word
        assert requests.count(0) == 1  # where they are equal
        assert sum(requests) == 2 * word + 1  # mean voltage ES (2 u + 1) / 2^M


def test_plus_before_minus_in_each_sawtooth():
    p, r = SawtoothParams(half=8), SawtoothPwm(sawtooth=7)
    assert period(p, r, -5) == [1, 1, 1, 0] + [-1] * 12


def clock_of(period):
    """A clock whose window opens now."""
    return SampleClock(demanded=period, period=period, left=period)


def strobes(r, clocks):
    """Number, from 1, of each clock that brings a strobe."""
    return [k for k in range(1, clocks + 1) if count_clock(r)]


@pytest.mark.parametrize("period", [1, 2, 7, 1000])
def test_a_strobe_comes_after_each_period(period):
    r = clock_of(period)
    assert strobes(r, 5 * period) == [period * k for k in range(1, 6)]
    assert r.left == period


def test_no_clock_is_lost_at_a_strobe():
    r = clock_of(10)
    assert strobes(r, 10) == [10]
    assert r.left == 10
    assert strobes(r, 9) == []
    assert strobes(r, 1) == [1]


@pytest.mark.parametrize("demanded", [3, 20])
def test_a_new_period_begins_with_the_next_window(demanded):
    r = clock_of(10)
    strobes(r, 4)
    r.demanded = demanded
    assert r.period == 10, "the running window keeps its period"
    assert strobes(r, 6) == [6]
    assert r.period == demanded
    assert strobes(r, 3 * demanded) == [demanded, 2 * demanded, 3 * demanded]


def test_of_several_demands_in_a_window_the_last_counts():
    r = clock_of(10)
    for demanded in (50, 1, 7):
        r.demanded = demanded
        assert strobes(r, 2) == []
    assert strobes(r, 4 + 7) == [4, 11]


def test_a_demand_written_with_the_strobe_waits_for_the_next():
    r = clock_of(10)
    assert strobes(r, 10) == [10]
    r.demanded = 4
    assert strobes(r, 18) == [10, 14, 18]


def test_clocks_that_the_axis_skips_are_clocks_all_the_same():
    counted, skipped = clock_of(5000), clock_of(5000)
    assert strobes(counted, 4990) == []
    skipped.left -= 4990
    assert counted.snapshot() == skipped.snapshot()
    assert strobes(counted, 10) == strobes(skipped, 10) == [10]


def test_a_period_of_nothing_does_not_stop_the_clock():
    r = clock_of(3)
    r.demanded = 0
    assert strobes(r, 6) == [3, 4, 5, 6]
