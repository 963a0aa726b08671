import pytest

from detent.control.step_timer import StepTimer, StepTimerParams, load_period, pulse


@pytest.mark.parametrize(("hz", "period"), [(400, 2500), (3000, 333), (3999, 250), (3, 333_333), (1_000_000, 1)])
def test_a_frequency_becomes_the_nearest_period(hz, period):
    p, r = StepTimerParams(clock_hz=1_000_000), StepTimer(expires=7)
    load_period(p, r, hz)
    assert (r.period, r.expires) == (period, 7 + period)


def test_a_reload_value_is_the_period():
    p, r = StepTimerParams(clock_hz=1_000_000, reload=1), StepTimer()
    for _ in range(3):
        load_period(p, r, 250)
    assert (r.period, r.expires) == (250, 750)


def test_pulses_move_the_coil_pattern_by_direction():
    r = StepTimer()
    phases = []
    for direction in (1, 1, 1, 1, 1, -1, -1, -1):
        pulse(r, direction)
        phases.append(r.phase)
    assert phases == [1, 2, 3, 0, 1, 0, 3, 2]
    assert r.pulses == 8
