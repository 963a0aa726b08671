import math

import pytest

from detent.kernel.turn_table import FRACTION, POINTS, TURN, TurnTable, at_phase, fill_table


def test_entries_are_met_and_between_them_it_is_linear():
    p = TurnTable()
    fill_table(p, lambda turns: 0.01 * math.sin(2 * math.pi * turns))
    assert p.used == 1
    for k in range(POINTS):
        assert at_phase(p, k * TURN // POINTS) == p.value[k]
        middle = at_phase(p, k * TURN // POINTS + TURN // POINTS // 2)
        assert middle == (p.value[k] + p.value[k + 1]) // 2
    # A chord of 1/256 turn misses its sine by (2 pi / 256)^2 / 8 at most.
    for phase in range(0, TURN, TURN // 997):
        wanted = 0.01 * TURN * math.sin(2 * math.pi * phase / TURN)
        assert at_phase(p, phase) == pytest.approx(wanted, abs=0.01 * TURN * 7.6e-5)


def test_the_table_closes():
    p = TurnTable()
    fill_table(p, lambda turns: 0.25 - turns / 8)
    assert p.value[POINTS] == p.value[0] == TURN // 4
    assert at_phase(p, FRACTION) == pytest.approx(p.value[0], abs=TURN // POINTS // 8)


def test_a_table_of_zeros_is_not_used():
    p = TurnTable()
    fill_table(p, lambda _: 0.0)
    assert (p.used, at_phase(p, 12345)) == (0, 0)
