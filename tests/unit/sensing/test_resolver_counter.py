import math

import numpy as np
import pytest

from detent.kernel.noise import NoiseSource
from detent.sensing.resolver_counter import (
    AbsoluteAngle,
    CompositionParams,
    ResolverParams,
    compose,
    count_phase,
    fill_resolver,
)

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


# -- the absolute angle of two words


def composed(p: CompositionParams, theta: int, coarse_error: int = 0) -> tuple[int, int]:
    """Angle and turns of exact words at `theta`, as the shaft's zeros lie; the error in coarse counts."""
    r = AbsoluteAngle()
    period = p.ratio * p.fine
    compose(p, r, (theta + p.fine_zero) % p.fine, theta * p.coarse // period + p.coarse_zero + coarse_error)
    return r.theta, r.turns


@pytest.mark.parametrize(("ratio", "fine", "coarse"), [(90, 4096, 4096), (7, 100, 64), (1, 16, 16), (360, 1000, 5000)])
def test_every_angle_of_exact_words(ratio, fine, coarse):
    p = CompositionParams(ratio=ratio, fine=fine, coarse=coarse)
    for theta in range(0, ratio * fine, max(1, ratio * fine // 3001)):
        assert composed(p, theta) == (theta, theta // fine)


def test_an_error_below_half_a_motor_turn_less_one_count_does_no_harm():
    p = CompositionParams(ratio=90, fine=4096, coarse=4096)
    # A motor turn is 45.5 coarse counts.
    for theta in range(0, 90 * 4096, 101):
        assert composed(p, theta, 21)[0] == composed(p, theta, -21)[0] == theta
    assert any(composed(p, theta, 24)[0] != theta for theta in range(0, 90 * 4096, 101))


def test_zeros_are_taken_off_first():
    p = CompositionParams(ratio=90, fine=4096, coarse=4096, fine_zero=1234, coarse_zero=4000)
    for theta in (0, 1, 4095, 4096, 200_000, 90 * 4096 - 1):
        assert composed(p, theta)[0] == theta
    # Zeros that do not belong together make whole motor turns wrong (trap 7).
    p.coarse_zero = 4000 - 45
    r = AbsoluteAngle()
    compose(p, r, 1234, 4000)
    assert r.theta == 4096


def test_the_truncating_form_is_wrong_near_a_fine_zero():
    p = CompositionParams(ratio=90, fine=4096, coarse=4096, truncating=1)
    assert composed(p, 90 * 2000)[0] == 90 * 2000
    assert composed(p, 4096 * 3) == (4096 * 2, 2)  # the coarse word lags by its rounding
