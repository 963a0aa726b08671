import numpy as np

from detent.kernel.noise import INCREMENT, MULTIPLIER, NoiseSource, bell, uniform, waiting_time


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


def waiting_times(seed: int, count: int = 10_000) -> np.ndarray:
    r = NoiseSource(state=seed)
    return np.array([waiting_time(r) for _ in range(count)])


def test_waiting_times_have_a_mean_and_a_standard_deviation_of_one():
    times = waiting_times(3)
    assert times.min() >= 0.0
    assert abs(times.mean() - 1) < 4 / np.sqrt(len(times))
    assert abs(times.var() - 1) < 4 * np.sqrt(8 / len(times))  # the fourth central moment is 9


def test_waiting_times_are_exponential():
    times = np.sort(waiting_times(4))
    law = 1 - np.exp(-times)
    steps = np.arange(len(times) + 1) / len(times)
    distance = max((steps[1:] - law).max(), (law - steps[:-1]).max())
    assert distance < 1.63 / np.sqrt(len(times))  # Kolmogorov-Smirnov, 1 %


def test_waiting_times_do_not_depend_on_the_one_before():
    times = waiting_times(5)
    after_short, after_long = times[1:][times[:-1] < np.log(2)], times[1:][times[:-1] >= np.log(2)]
    assert abs(after_short.mean() - after_long.mean()) < 4 * 2 / np.sqrt(len(times))


def test_one_seed_gives_the_same_waiting_times_to_the_byte():
    assert waiting_times(6, 1000).tobytes() == waiting_times(6, 1000).tobytes()
    assert waiting_times(6, 1000).tobytes() != waiting_times(7, 1000).tobytes()
