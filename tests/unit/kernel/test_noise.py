import numpy as np

from detent.kernel.noise import INCREMENT, MULTIPLIER, NoiseSource, bell, uniform


def test_the_generator_is_the_stated_one_modulo_64_bit():
    r = NoiseSource(state=12345)
    state = 12345
    for _ in range(1000):
        state = (state * MULTIPLIER + INCREMENT) & (2**64 - 1)
        assert uniform(r) == ((state >> 33) & 0x7FFFFFFF) / 2**31
        assert r.state & (2**64 - 1) == state


def test_one_seed_one_sequence():
    first, second, other = NoiseSource(state=7), NoiseSource(state=7), NoiseSource(state=8)
    numbers = [uniform(first) for _ in range(100)]
    assert [uniform(second) for _ in range(100)] == numbers
    assert [uniform(other) for _ in range(100)] != numbers


def test_uniform_fills_the_unit_interval_evenly():
    r = NoiseSource(state=1)
    numbers = np.array([uniform(r) for _ in range(20_000)])
    assert numbers.min() >= 0.0
    assert numbers.max() < 1.0
    share = np.histogram(numbers, bins=10, range=(0, 1))[0] / len(numbers)
    assert np.abs(share - 0.1).max() < 4 * np.sqrt(0.1 * 0.9 / len(numbers))  # four standard deviations


def test_bell_has_zero_mean_unit_variance_and_stays_within_three():
    r = NoiseSource(state=2)
    numbers = np.array([bell(r) for _ in range(20_000)])
    assert abs(numbers.mean()) < 4 / np.sqrt(len(numbers))
    assert abs(numbers.var() - 1) < 0.04
    assert 2.5 < np.abs(numbers).max() <= 3.0
