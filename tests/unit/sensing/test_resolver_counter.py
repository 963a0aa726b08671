import math

import numpy as np
import pytest

from detent.kernel.noise import NoiseSource
from detent.sensing.resolver_counter import ResolverParams, count_phase, fill_resolver

COUNTS = 4096


def words(p: ResolverParams, phases, seed: int = 1) -> list[int]:
    noise = NoiseSource(state=seed)
    return [count_phase(p, noise, int(phase)) for phase in phases]


@pytest.mark.parametrize("counts", [4096, 1000, 4093, 1 << 20])
def test_any_number_of_counts_divides_the_turn(counts):
    p = ResolverParams(counts=counts)
    phases = [k * 2**32 // 97 for k in range(97)]
    assert words(p, phases) == [phase * counts // 2**32 for phase in phases]
    assert words(p, [2**32 - 1]) == [counts - 1]


def test_the_mounting_shifts_the_word():
    p = ResolverParams(counts=COUNTS, offset=3 << 30)
    assert words(p, [0, 1 << 30, 1 << 31]) == [3072, 0, 1024]


def test_noise_displaces_by_no_more_than_its_limit_and_repeats_with_its_seed():
    p = ResolverParams(counts=COUNTS, noise=3 * 2**32 / COUNTS)
    middle = (1000 << 20) + (1 << 19)
    found = words(p, [middle] * 2000)
    assert set(found) == set(range(997, 1004))
    assert np.mean(found) == pytest.approx(1000, abs=0.2)
    assert words(p, [middle] * 2000) == found
    assert words(p, [middle] * 2000, seed=2) != found
    assert set(words(p, [1 << 19] * 2000)) == {4093, 4094, 4095, 0, 1, 2, 3}  # across the end of the turn


def test_windings_of_unequal_gain_give_two_waves_per_turn():
    p = ResolverParams(counts=COUNTS)
    fill_resolver(p, 0.02, 0.0, 0.0)
    phases = np.arange(0, 2**32, 2**32 // COUNTS)
    error = (np.array(words(p, phases)) - np.arange(COUNTS) + COUNTS // 2) % COUNTS - COUNTS // 2
    # tan(y) = tan(x) / (1 + g): y - x = -g/2 sin 2x to first order.
    wave = -0.01 * np.sin(4 * math.pi * np.arange(COUNTS) / COUNTS) * COUNTS / (2 * math.pi)
    assert np.abs(error - wave).max() < 1.1
    assert p.errors.used == 1


def test_a_perfect_resolver_has_no_error_table():
    p = ResolverParams(counts=COUNTS)
    fill_resolver(p, 0.0, 0.0, 0.0)
    assert p.errors.used == 0
