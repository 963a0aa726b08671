import math

import pytest

from detent.control.step_timer import StepTimer, StepTimerParams, load_period, pulse, word_within


@pytest.mark.parametrize(("hz", "period"), [(400, 2500), (3000, 334), (3999, 251), (3, 333_334), (1_000_000, 1)])
def test_a_frequency_becomes_the_period_that_is_not_faster(hz, period):
    p, r = StepTimerParams(clock_hz=1_000_000), StepTimer(expires=7)
    load_period(p, r, hz)
    assert (r.period, r.expires) == (period, 7 + period)


def test_a_reload_value_is_the_period():
    p, r = StepTimerParams(clock_hz=1_000_000, reload=1), StepTimer()
    for _ in range(3):
        load_period(p, r, 250)
    assert (r.period, r.expires) == (250, 750)


@pytest.mark.parametrize("reload", [False, True])
@pytest.mark.parametrize("clock_hz", [250_000, 1_000_000, 1_600_000, 100_000_000])
def test_the_word_of_a_limit_is_the_fastest_that_keeps_it(clock_hz, reload):
    """3820 Hz, 19.1 mm/s, made 3846 Hz of 250 kHz: a frequency was cut to whole Hz, and its period rounded."""
    p, r = StepTimerParams(clock_hz=clock_hz, reload=reload), StepTimer()
    for hz in (1.0, 1.5, 333.3, 400.0, 1000.0, 1999.9, 2000.0, 3820.0, 4000.0, 9999.5, 16_666.6):
        word = word_within(hz, clock_hz, reload=reload)
        made = []
        for one in (word, word - 1 if reload else word + 1):
            load_period(p, r, one)
            made.append(clock_hz / r.period if r.period else math.inf)
        assert made[0] <= hz * (1 + 1e-12), hz
        assert made[1] > hz or (not reload and word + 1 > hz), hz
    assert word_within(4000.0, 1_000_000, reload=reload) == (250 if reload else 4000)


def test_pulses_move_the_coil_pattern_by_direction():
    r = StepTimer()
    phases = []
    for direction in (1, 1, 1, 1, 1, -1, -1, -1):
        pulse(r, direction)
        phases.append(r.phase)
    assert phases == [1, 2, 3, 0, 1, 0, 3, 2]
    assert r.pulses == 8
