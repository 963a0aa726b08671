import pytest

from detent.control.sample_clock import SampleClock, count_clock


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
