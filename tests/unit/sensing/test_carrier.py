import math

import numpy as np
import pytest
from tests.coil_currents import LARGE, coil_currents

from detent.sensing.carrier import Carrier, CarrierParams, count_carrier, reset_carrier

SLOTS = [(0, 0), (0, 1), (1, 0), (1, 1), (1, 1), (1, 0), (0, 1), (0, 0)]
"""Switches (a, b) of the first coil through a cycle."""


def params(counts: int) -> CarrierParams:
    return CarrierParams(mask=counts - 1, shift=counts.bit_length() - 4)


def switches(r: Carrier) -> tuple[tuple[int, int], tuple[int, int]]:
    """(a, b) of both coils."""
    s = r.switches
    return (s & 1, s >> 1 & 1), (s >> 2 & 1, s >> 3 & 1)


@pytest.mark.parametrize("counts", [16, 64, 1024])
def test_both_coils_run_through_the_slots_the_second_a_quarter_cycle_behind(counts):
    p, r = params(counts), Carrier()
    reset_carrier(r)
    for n in range(2 * counts):
        slot = n * 8 // counts % 8
        assert r.count == n % counts
        assert switches(r) == (SLOTS[slot], SLOTS[slot - 2])
        count_carrier(p, r)


def test_power_on_is_the_beginning_of_a_cycle_like_any_other():
    p, r = params(64), Carrier(count=37, switches=15)
    reset_carrier(r)
    after = r.copy()
    for _ in range(64):
        count_carrier(p, r)
    assert r.snapshot() == after.snapshot()


def test_the_flip_flop_is_the_top_bit_a_quarter_cycle_later():
    p, r = params(64), Carrier()
    reset_carrier(r)
    for n in range(1, 200):
        count_carrier(p, r)
        assert r.delayed_msb == (n - 16) % 64 // 32


def test_the_small_resistor_carries_three_units():
    assert LARGE == 3.0
    r = Carrier(switches=0b1101)
    assert coil_currents(r, 3.0) == (3.0, 4.0)
    assert coil_currents(r, 2.5) == (2.5, 3.5)
    r.switches = 0b0010
    assert coil_currents(r, 3.0) == (1.0, 0.0)


@pytest.mark.parametrize("large", [2.0, 1 + math.sqrt(2), 3.0, 4.0])
def test_the_fundamental_is_that_of_the_staircase(large):
    p, r = params(1024), Carrier()
    reset_carrier(r)
    levels = []
    for _ in range(1024):
        levels.append(coil_currents(r, large))
        count_carrier(p, r)
    angle = 2 * np.pi * (np.arange(1024) + 0.5) / 1024  # middle of each count
    first, second = np.array(levels).T
    amplitude = 2 / np.pi * (large - 1 + math.sqrt(2))  # steps of 1, large - 1, 1 at 45, 90, 135 degrees
    assert 2 * np.mean(first * np.cos(angle)) == pytest.approx(-amplitude, rel=1e-5)
    assert 2 * np.mean(second * np.sin(angle)) == pytest.approx(-amplitude, rel=1e-5)
    assert np.mean(first * np.sin(angle)) == pytest.approx(0.0, abs=1e-12)
    assert np.mean(second * np.cos(angle)) == pytest.approx(0.0, abs=1e-12)
    assert first.mean() == pytest.approx((large + 1) / 2, rel=1e-12)
