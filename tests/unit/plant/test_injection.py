"""Seven ways in which a word does not arrive as it was sent."""

import pytest

from detent.plant.injection import (
    DELAYED,
    GARBAGE,
    INTERMITTENT,
    OFF,
    SLOW,
    STUCK,
    WRONG,
    Injection,
    begin_injection,
    spoilt,
    spoilt_effort,
)

SENT = [3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]


def received(kind: int, amount: float = 0.0, most: float = 0.0, sent: list[float] = SENT) -> list[float]:
    """What arrives of these."""
    f, found = Injection(), []
    begin_injection(f, 1, kind, amount)
    for value in sent:
        f.since += 1
        found.append(spoilt(f, 0, value, value, most))
    return found


@pytest.mark.parametrize(
    ("kind", "amount", "expected"),
    [
        (OFF, 0.0, [0.0] * 7),
        (STUCK, 0.0, [3.0] * 7),
        (WRONG, 10.0, [13.0, 14.0, 15.0, 16.0, 17.0, 18.0, 19.0]),
        (SLOW, 3.0, [3.0, 3.0, 3.0, 6.0, 6.0, 6.0, 9.0]),
        (DELAYED, 2.0, [3.0, 3.0, 3.0, 4.0, 5.0, 6.0, 7.0]),
        (INTERMITTENT, 2.0, [0.0, 0.0, 5.0, 6.0, 0.0, 0.0, 9.0]),
    ],
)
def test_a_number(kind, amount, expected):
    assert received(kind, amount) == expected


def test_levels_that_are_wrong_are_inverted():
    assert received(WRONG, most=7.0, sent=[0.0, 5.0, 7.0]) == [7.0, 2.0, 0.0]


def test_garbage_is_within_its_bounds_and_the_same_each_time():
    numbers = received(GARBAGE, 20.0, sent=SENT * 20)
    assert numbers == received(GARBAGE, 20.0, sent=SENT * 20)
    assert all(abs(one) <= 20.0 for one in numbers)
    assert min(numbers) < -10.0 < 10.0 < max(numbers)
    levels = received(GARBAGE, most=3.0, sent=SENT * 20)
    assert set(levels) == {0.0, 1.0, 2.0, 3.0}


def test_a_long_delay_goes_round_the_memory():
    sent = [float(k) for k in range(1000)]
    assert received(DELAYED, 255.0, sent=sent)[300:] == sent[45:-255]


def test_a_wrong_effort_is_turned_round_and_garbage_is_no_larger_than_the_drive_gives():
    f = Injection()
    begin_injection(f, 1, WRONG, 0.0)
    assert spoilt_effort(f, 0, 4.0, 10.0) == -4.0
    begin_injection(f, 1, GARBAGE, 0.0)
    assert all(abs(spoilt_effort(f, 0, 4.0, 10.0)) <= 10.0 for _ in range(100))
    begin_injection(f, 1, OFF, 0.0)
    f.since = 1
    assert spoilt_effort(f, 0, 4.0, 10.0) == 0.0
