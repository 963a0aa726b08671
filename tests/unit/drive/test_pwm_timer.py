import pytest

from detent.drive.pwm_timer import CLOCKS_PER_PERIOD, PwmTimer, clock, trigger


def period(timer: PwmTimer, count: int, clocks: int = CLOCKS_PER_PERIOD) -> list[int]:
    """PWM line at each clock after a trigger."""
    trigger(timer, count)
    levels = []
    for _ in range(clocks):
        levels.append(timer.counter > 0)
        clock(timer)
    return levels


@pytest.mark.parametrize("count", [1, 2, 150, 299])
def test_one_pulse_per_trigger_from_its_beginning(count):
    assert period(PwmTimer(), count) == [1] * count + [0] * (CLOCKS_PER_PERIOD - count)


def test_zero_is_permanently_low_and_full_permanently_high():
    low, high = PwmTimer(), PwmTimer()
    assert period(low, 0) + period(low, 0) == [0] * 600
    assert period(high, CLOCKS_PER_PERIOD) + period(high, CLOCKS_PER_PERIOD) == [1] * 600


def test_clocks_after_the_pulse_change_nothing():
    timer = PwmTimer()
    assert period(timer, 3, 1000) == [1] * 3 + [0] * 997
    assert timer.counter == 0


def test_a_trigger_restarts_a_pulse_that_still_runs():
    timer = PwmTimer()
    assert period(timer, 200, 100) == [1] * 100
    assert period(timer, 50) == [1] * 50 + [0] * 250
