"""Frequency responses of known systems come back, with standard deviations that are those of many records."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal
from tests.synthetic_responses import within

from detent.errors import DetentError
from detent.identify.analyse.measure_response import (
    Periods,
    average_periods,
    average_windows,
    cut_periods,
    measure_response,
    noise_parts,
    response_of,
)
from detent.logs.log import Log, Source

T = 1e-3
B, A = signal.butter(2, 0.2)


def multisine(rows, periods, lines=range(1, 120), seed=1):
    rng = np.random.default_rng(seed)
    angle = 2 * np.pi * np.outer(np.arange(rows) / rows, list(lines)) + rng.uniform(0, 2 * np.pi, len(list(lines)))
    return np.tile(np.cos(angle).sum(axis=1), periods)


def exact(frequency):
    return signal.freqz(B, A, frequency, fs=1 / T)[1]


def record(noise=0.0, *, periods=10, seed=1, disturbance=0.0):
    rng = np.random.default_rng(seed)
    u = multisine(500, periods)
    y = signal.lfilter(B, A, u + disturbance * rng.normal(size=len(u))) + noise * rng.normal(size=len(u))
    return T * np.arange(len(u)), u, y


def test_a_multisine_gives_the_response_at_its_lines_alone():
    found = measure_response(*record())
    assert found.frequency == pytest.approx(2.0 * np.arange(1, 120))
    # The steady state of a linear system comes back exactly; what is left are transients of the first period.
    assert found.response == pytest.approx(exact(found.frequency), rel=1e-9)
    assert found.coherence.min() > 1 - 1e-12
    assert (found.averages, found.resolution) == (9, 0.0)
    assert "mean of 9 periods of 0.5 s behind 1 to settle, 119 excited lines" in found.method


@pytest.mark.parametrize("sort", ["noise", "disturbance"])
def test_deviations_of_periods_are_those_of_many_records(sort):
    scaled = []
    for seed in range(60):
        found = measure_response(*record(seed=seed, **{sort: 3.0}))
        # The deviation is a part of the measured magnitude; its error is taken in the same part.
        true = exact(found.frequency)
        scaled.append((found.response / true - 1) / (found.deviation * np.abs(found.response / true)))
    scaled = np.array(scaled)[:, :60]
    assert np.std(scaled.real) == pytest.approx(1.0, abs=0.06)
    assert np.std(scaled.imag) == pytest.approx(1.0, abs=0.06)
    assert abs(np.mean(scaled)) < 0.05


def test_coherence_is_the_part_of_the_output_that_the_input_explains():
    found = measure_response(*record(noise=3.0, periods=60))
    # Noise of variance 9 in 500 samples: power 4500 in a line; the answer has |250 G|^2 there.
    power = np.abs(250 * exact(found.frequency)) ** 2
    assert found.coherence[:80] == pytest.approx((power / (power + 4500))[:80], abs=0.05)


def test_drift_and_offset_are_taken_out():
    t, u, y = record()
    found = measure_response(t, u, y + 40.0 * t + 7.0)
    assert found.response == pytest.approx(exact(found.frequency), rel=1e-6)


def test_windows_give_the_response_and_its_deviation():
    scaled = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        u = rng.normal(size=20_000)
        found = average_windows(
            T * np.arange(len(u)), u, signal.lfilter(B, A, u) + 0.3 * rng.normal(size=len(u)), step_hz=2.0
        )
        band = within(found, 4.0, 80.0)
        scaled.append(np.log(band.response / exact(band.frequency)) / band.deviation)
    assert np.std(np.real(scaled)) == pytest.approx(1.0, abs=0.06)
    assert np.std(np.imag(scaled)) == pytest.approx(1.0, abs=0.06)
    assert abs(np.mean(scaled)) < 0.1
    assert found.averages == pytest.approx(75, abs=1)
    assert "Hann windows of 0.5 s, overlap 50%" in found.method


def test_a_single_chirp_goes_through_windows():
    t = T * np.arange(40_000)
    u = signal.chirp(t, 1.0, t[-1], 200.0)
    found = measure_response(t, u, signal.lfilter(B, A, u))
    assert "H1 by Welch" in found.method
    band = within(found, 10.0, 100.0)
    assert band.frequency[0] >= 10.0
    assert np.abs(band.response / exact(band.frequency) - 1).max() < 0.02
    assert band.coherence.min() > 0.99


def test_frequencies_without_excitation_are_left_out():
    rng = np.random.default_rng(1)
    u = signal.lfilter(*signal.butter(6, 0.1), rng.normal(size=20_000))
    found = average_windows(T * np.arange(len(u)), u, u)
    assert found.frequency[-1] < 130.0


def test_uneven_stamps_are_put_on_a_grid():
    rng = np.random.default_rng(1)
    t = T * (np.arange(20_000) + rng.uniform(-0.1, 0.1, 20_000))
    u = sum(np.cos(2 * np.pi * f * t + f) for f in rng.uniform(1, 20, 40))
    found = average_windows(t, u, 3 * u)
    assert "stamps 0.8" in found.method
    assert found.response == pytest.approx(3.0)


def test_noise_of_a_narrow_resonance_is_not_blurred():
    power = 1 + 1e4 / (1 + (np.arange(200) - 100.0) ** 2)
    rng = np.random.default_rng(2)
    scatter = (0.5 + 0.01 * power) * rng.chisquare(14, 200) / 14
    level, slope = noise_parts(scatter, power, 8)
    assert level + slope * power == pytest.approx(0.5 + 0.01 * power, rel=0.6)
    # The mean over the same neighbours is several times too much beside the peak.
    assert (level + slope * power)[106] < 5
    assert np.convolve(scatter, np.ones(17) / 17, "same")[106] > 10


def test_the_first_period_settles_and_is_left_out():
    t, u, y = record()
    cut = cut_periods(t, u, [y + 50.0 * np.exp(-t / 0.1)])
    twice = replace(cut, signals=tuple(np.vstack([values[:1], values]) for values in cut.signals))
    lines = 2.0 * np.arange(1, 120)
    settled, unsettled = (np.abs(average_periods(one).response / exact(lines) - 1).max() for one in (cut, twice))
    assert unsettled > 30 * settled


def test_an_excitation_that_does_not_come_back_is_refused():
    rng = np.random.default_rng(1)
    periods = Periods((rng.normal(size=(3, 400)), rng.normal(size=(3, 400))), T, 1.0, "")
    with pytest.raises(DetentError, match="an excitation that does not repeat"):
        average_periods(periods)


def test_too_short_recordings_are_refused():
    t, u, y = record()
    with pytest.raises(DetentError, match="got 50 times, 50 values of the input, 50 of the output"):
        measure_response(t[:50], u[:50], y[:50])
    with pytest.raises(DetentError, match="got 5000 times, 4999 values"):
        measure_response(t, u[1:], y)
    with pytest.raises(DetentError, match="an excitation that changes"):
        measure_response(t, np.ones(len(t)), y)
    with pytest.raises(DetentError, match="windows of 4000"):
        average_windows(t, u, y, step_hz=0.25)
    gaps = t + np.floor(np.arange(len(t)) / 50)
    with pytest.raises(DetentError, match="50 samples between two gaps"):
        measure_response(gaps, u, y)


def test_the_longest_stretch_without_a_gap_is_taken():
    t, u, y = record()
    t = t + np.where(np.arange(len(t)) >= 1200, 3.0, 0.0)
    u, y = u.copy(), y.copy()
    u[:1200] = 5.0
    found = measure_response(t, u, y)
    assert "mean of 6 periods" in found.method
    assert found.response == pytest.approx(exact(found.frequency), rel=1e-6)


def a_log(**signals):
    t = T * np.arange(len(next(iter(signals.values()))))
    units = {"time": "s"} | {name: {"position": "m", "force": "N"}.get(name, "V") for name in signals}
    columns = {name: Source(name, unit, 1.0) for name, unit in units.items()}
    return Log("a.csv", t, signals, units, columns, np.arange(1, len(t) + 1))


def test_of_a_log_the_most_direct_effort_is_taken():
    _, u, y = record()
    log = a_log(voltage=2 * u, force=u, position=y)
    found = response_of(log)
    assert (found.input_unit, found.output_unit) == ("N", "m")
    assert found.response == pytest.approx(exact(found.frequency), rel=1e-9)
    assert response_of(log, "voltage").response == pytest.approx(found.response / 2)


def test_a_log_without_the_signals_is_refused():
    _, u, y = record()
    with pytest.raises(DetentError, match=r"a.csv: got signals position; expected: something that drives the axis"):
        response_of(a_log(position=y))
    with pytest.raises(DetentError, match="expected: a recording with position_load"):
        response_of(a_log(position=y, force=u), position="position_load")
    with pytest.raises(DetentError, match="expected: current that drives the axis"):
        response_of(a_log(position=y, force=u), "current")


def test_windows_that_overlap_count_for_less():
    noise = np.random.default_rng(1).normal(size=1000)
    assert average_windows(T * np.arange(1000), noise, noise).averages == pytest.approx(14 / (1 + 2 * 13 / 14 / 36))


def test_a_response_as_plain_data():
    found = measure_response(*record())
    assert len(found) == len(found.frequency) == len(found.response) == 119
    assert abs(found.response[3]) == pytest.approx(abs(exact(8.0)), rel=1e-6)
    assert found.averages == 9
