"""Exact properties of the first-order digital low-pass (filtered-servo spec 3.4: A = 1/4, TS = 5 ms)."""

from math import exp, inf, isclose, sqrt

import numpy as np
import pytest

from detent.analysis.first_order_filter import (
    cutoff_hz,
    equivalent_time_constant,
    filter_step,
    impulse_weights,
    noise_gain,
    nyquist_gain,
)
from detent.errors import DetentError

COEFFICIENTS = [0.001, 0.25, 0.5, 0.8, 1.0]


def run_filter(coefficient, inputs):
    """The difference equation itself."""
    y, outputs = 0.0, []
    for x in inputs:
        y = coefficient * x + (1 - coefficient) * y
        outputs.append(y)
    return outputs


def gain_at(coefficient, omega):
    """Magnitude of the impulse weights' Fourier sum; `omega` in radians per sample."""
    weights = impulse_weights(coefficient, 20_000)
    return abs(np.sum(weights * np.exp(-1j * omega * np.arange(len(weights)))))


def test_impulse_weights_of_the_example():
    assert impulse_weights(0.25, 3).tolist() == [1 / 4, 3 / 16, 9 / 64]
    assert impulse_weights(0.25, 200).sum() == pytest.approx(1, abs=1e-15)


def test_step_of_the_example():
    assert 100 * filter_step(0.25, 5) == pytest.approx([25, 43.75, 57.81, 68.36, 76.27], abs=0.005)


@pytest.mark.parametrize("coefficient", COEFFICIENTS)
def test_impulse_and_step_are_those_of_the_difference_equation(coefficient):
    assert impulse_weights(coefficient, 30) == pytest.approx(run_filter(coefficient, [1] + 29 * [0]))
    assert filter_step(coefficient, 30) == pytest.approx(run_filter(coefficient, 30 * [1]))


def test_equivalent_time_constant_of_the_example():
    assert 1e3 * equivalent_time_constant(0.25, 5e-3) == pytest.approx(17.38, abs=0.005)  # not Tf = 20 ms


@pytest.mark.parametrize("coefficient", COEFFICIENTS[:-1])
def test_a_continuous_lag_of_that_time_constant_decays_alike(coefficient):
    tau = equivalent_time_constant(coefficient, 5e-3)
    assert exp(-5e-3 / tau) == pytest.approx(1 - coefficient)
    assert tau < 5e-3 / coefficient


def test_cutoff_of_the_example():
    assert cutoff_hz(0.25, 5e-3) == pytest.approx(9.22, abs=0.005)


@pytest.mark.parametrize("coefficient", COEFFICIENTS[:-1])
def test_gain_at_the_cutoff_is_half_the_power(coefficient):
    cutoff = cutoff_hz(coefficient, 5e-3)
    assert 0 < cutoff < 100
    assert gain_at(coefficient, 2 * np.pi * cutoff * 5e-3) == pytest.approx(sqrt(0.5), rel=1e-6)


def test_a_weak_filter_has_the_cutoff_of_its_continuous_lag():
    assert cutoff_hz(1e-6, 5e-3) == pytest.approx(1e-6 / (2 * np.pi * 5e-3), rel=1e-5)


def test_above_0_828_the_gain_never_falls_to_half_the_power():
    edge = 2 * sqrt(2) - 2
    assert cutoff_hz(edge - 1e-9, 5e-3) == pytest.approx(100, abs=0.01)
    assert cutoff_hz(edge + 1e-9, 5e-3) == inf
    assert cutoff_hz(1, 5e-3) == inf


def test_nyquist_and_noise_gain_of_the_example():
    assert isclose(nyquist_gain(0.25), 1 / 7)
    assert noise_gain(0.25) == pytest.approx(0.378, abs=5e-4)


@pytest.mark.parametrize("coefficient", COEFFICIENTS)
def test_nyquist_and_noise_gain_are_those_of_the_weights(coefficient):
    assert nyquist_gain(coefficient) == pytest.approx(gain_at(coefficient, np.pi), rel=1e-6)
    assert noise_gain(coefficient) == pytest.approx(sqrt(np.sum(impulse_weights(coefficient, 20_000) ** 2)))


def test_a_coefficient_of_1_is_no_filter():
    assert impulse_weights(1, 3).tolist() == [1, 0, 0]
    assert filter_step(1, 2).tolist() == [1, 1]
    assert noise_gain(1) == nyquist_gain(1) == 1
    assert equivalent_time_constant(1, 5e-3) == 0


@pytest.mark.parametrize("coefficient", [0.0, -0.25, 1.01, inf, float("nan")])
@pytest.mark.parametrize(
    "function",
    [
        lambda a: filter_step(a, 3),
        lambda a: impulse_weights(a, 3),
        noise_gain,
        nyquist_gain,
        lambda a: equivalent_time_constant(a, 5e-3),
        lambda a: cutoff_hz(a, 5e-3),
    ],
)
def test_a_coefficient_out_of_range_is_refused(function, coefficient):
    with pytest.raises(DetentError, match=r"^coefficient: got .*; expected: above 0, up to 1; try: state A = TS/Tf"):
        function(coefficient)


@pytest.mark.parametrize("function", [filter_step, impulse_weights])
def test_no_samples_are_refused(function):
    with pytest.raises(DetentError, match=r"^samples: got 0; expected: 1 or more; try: state how many"):
        function(0.25, 0)


@pytest.mark.parametrize("function", [equivalent_time_constant, cutoff_hz])
@pytest.mark.parametrize("period", [0.0, -1.0, inf, float("nan")])
def test_a_sample_period_out_of_range_is_refused(function, period):
    with pytest.raises(DetentError, match=r"^sample_period: got .* s; expected: above 0 and finite; try: state"):
        function(0.25, period)
