"""The models are those of the equations of motion, and of their sampled solution."""

import numpy as np
import pytest
from scipy import linalg

from detent.identify.analyse.response_fit import (
    Fit,
    LoadModel,
    RigidModel,
    TwoMassModel,
    constants_of,
    laplace,
    respond_sampled,
)

M1, M2, K, D, B1, B2 = 0.4, 0.6, 5e4, 8.0, 1.5, 2.5  # per total mass
OWN = np.array([np.log(M2 / M1), 0.5 * np.log(K / M2), D, B1, B2])
GAIN, DELAY, HOLD = 0.7, 1.3e-3, 1e-3
ALL = np.r_[OWN, np.log(GAIN), DELAY]
FREQUENCY = np.array([1.0, 20.0, 45.0, 60.0, 80.0, 120.0, 300.0])

# x1, v1, x2, v2
A = np.array(
    [
        [0, 1, 0, 0],
        [-K / M1, -(D + B1) / M1, K / M1, D / M1],
        [0, 0, 0, 1],
        [K / M2, D / M2, -K / M2, -(D + B2) / M2],
    ]
)
B = np.array([0, GAIN / M1, 0, 0])


def test_the_constants_come_back():
    assert constants_of(OWN) == pytest.approx((M1, M2, K, D, B1, B2))


def test_two_masses_answer_as_their_equations_of_motion():
    found = respond_sampled(TwoMassModel(2), np.r_[OWN, np.log(GAIN), 0.0], FREQUENCY, 0.0)
    for index, s in enumerate(laplace(FREQUENCY)):
        x = np.linalg.solve(s * np.eye(4) - A, B)
        assert found[:, index] == pytest.approx(x[[0, 2]], rel=1e-9)


@pytest.mark.parametrize("delay", [0.0, 1.0, 1.3])
def test_a_held_effort_answers_as_the_sampled_solution(delay):
    """Exact discretisation, the effort changing part of the way through a sample."""
    found = respond_sampled(TwoMassModel(2), np.r_[OWN, np.log(GAIN), delay * HOLD], FREQUENCY, HOLD)
    big = np.zeros((5, 5))
    big[:4, :4], big[:4, 4] = A, B
    whole, part = int(delay), delay % 1.0
    phi = linalg.expm(big * HOLD)[:4, :4]
    late, early = (linalg.expm(big * HOLD * share) for share in (1 - part, part))
    new, old = late[:4, 4], late[:4, :4] @ early[:4, 4]
    for index, f in enumerate(FREQUENCY):
        z = np.exp(2j * np.pi * f * HOLD)
        x = np.linalg.solve(z * np.eye(4) - phi, new + old / z) * z**-whole
        # Aliases beyond the third are left out.
        assert found[:, index] == pytest.approx(x[[0, 2]], rel=1e-3)


def test_the_modes_are_the_zeros_and_poles():
    modes = TwoMassModel().tell(OWN)
    zeros = np.roots([M2, D + B2, K])
    poles = np.linalg.eigvals(A)
    pole = poles[np.argmax(poles.imag)]
    assert modes["antiresonance"] == pytest.approx(abs(zeros[0]) / (2 * np.pi))
    assert modes["antiresonance.damping"] == pytest.approx(-zeros[0].real / abs(zeros[0]))
    assert modes["resonance"] == pytest.approx(abs(pole) / (2 * np.pi))
    assert modes["resonance.damping"] == pytest.approx(-pole.real / abs(pole))


def test_no_resonance_is_left_by_much_damping():
    assert TwoMassModel().tell(np.r_[OWN[:2], 1e4, 1.0, 1.0]).keys() == {"mass_ratio", "viscous"}


def test_the_load_alone_is_the_same_by_its_poles():
    poles = np.linalg.eigvals(A)
    slow = -poles[np.argsort(np.abs(poles))[1]].real
    modes = TwoMassModel().tell(OWN)
    omega = 2 * np.pi * modes["resonance"]
    own = np.array([slow, np.log(omega), modes["resonance.damping"], D / K])
    whole = respond_sampled(TwoMassModel(2), np.r_[OWN, np.log(GAIN), 0.0], FREQUENCY, 0.0)[1]
    gain = GAIN * K / (M1 * M2 * omega**2)
    assert respond_sampled(LoadModel(), np.r_[own, np.log(gain), 0.0], FREQUENCY, 0.0)[0] == pytest.approx(whole)
    assert gain == pytest.approx(GAIN, rel=2e-3)


def test_one_mass_is_what_two_on_a_stiff_coupling_are():
    stiff = np.r_[OWN[0], np.log(1e6), 0.0, OWN[3:]]
    found = respond_sampled(TwoMassModel(2), np.r_[stiff, np.log(GAIN), DELAY], FREQUENCY, HOLD)
    rigid = respond_sampled(RigidModel(2), np.r_[B1 + B2, np.log(GAIN), DELAY], FREQUENCY, HOLD)
    assert found == pytest.approx(rigid, rel=1e-4)


@pytest.mark.parametrize("model", [RigidModel(), TwoMassModel(), TwoMassModel(2), LoadModel()])
def test_every_parameter_counts(model):
    count = model.count
    start = {1: [3.0], 4: [2.0, 6.0, 0.05, 1e-4], 5: OWN}[count]
    before = respond_sampled(model, np.r_[start, 0.0, 0.0], FREQUENCY, HOLD)
    for index in range(count + 2):
        changed = np.r_[start, 0.0, 0.0]
        changed[index] += 0.01
        assert np.abs(respond_sampled(model, changed, FREQUENCY, HOLD) / before - 1).max() > 1e-5


def test_what_the_lines_do_not_determine_is_uncertain_and_no_overflow():
    """The fit of a recording without any answer: its gain is uncertain by decades."""
    parameters, errors = np.array([1.1e7, 12.95, 9e-5]), np.array([6.4e11, 5.6e4, 5e-3])
    fit = Fit(RigidModel(1), parameters, 1.0, np.diag(errors**2), 10.0, 0.0, np.ones((1, 3)), np.ones((1, 3), complex))
    found = fit.spread(lambda p: {"viscous": float(p[0]), "gain": float(np.exp(p[1])), "delay": float(p[2])})
    gain = float(np.exp(parameters[1]))
    assert found["viscous"] == pytest.approx((parameters[0], errors[0]))
    assert found["gain"] == pytest.approx((gain, gain * errors[1]), rel=0.01)
    assert found["delay"] == pytest.approx((parameters[2], errors[2]))
