import pytest

from detent.control.sawtooth_pwm import SawtoothParams, SawtoothPwm, count_sawtooth


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
