import pytest

from detent.sensing.pulse_counter import PulseCounter, PulseCounterParams, add_pulses, close_window


def test_latch_then_clear():
    p, r = PulseCounterParams(half=128), PulseCounter()
    add_pulses(p, r, 5)
    add_pulses(p, r, -2)
    assert (r.count, r.word) == (3, 0)
    close_window(r)
    assert (r.count, r.word) == (0, 3)
    add_pulses(p, r, -1)
    assert r.word == 3  # stands until the next strobe
    close_window(r)
    assert (r.count, r.word) == (0, -1)


@pytest.mark.parametrize("bits", [4, 8, 12, 16])
def test_the_counter_wraps_at_its_width_in_both_directions(bits):
    half = 1 << (bits - 1)
    p, r = PulseCounterParams(half=half), PulseCounter(count=half - 1)
    add_pulses(p, r, 1)
    assert r.count == -half
    add_pulses(p, r, -1)
    assert r.count == half - 1
    for pulses in (3 * half + 7, -5 * half - 2):
        expected = (r.count + pulses + half) % (2 * half) - half
        add_pulses(p, r, pulses)
        assert r.count == expected
