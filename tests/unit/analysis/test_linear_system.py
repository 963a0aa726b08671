"""Margins of loops cut open, against closed forms and against python-control."""

import math
import sys
import warnings

import control
import numpy as np
import pytest
import scipy.signal

from detent.analysis.linear_system import LinearSystem
from detent.errors import DetentError

DT = 1e-3


def late_integrator(gain: float, late: int) -> LinearSystem:
    """Gain [1/s] times a sampled integrator, some samples late: x is the integral, then what is on its way."""
    size = 1 + late
    a, b, c = np.zeros((size, size)), np.zeros((size, 1)), np.zeros((1, size))
    a[0, 0] = c[0, 0] = 1.0
    if late:
        a[0, size - 1] = gain * DT
        a[2:, 1:-1] = np.eye(late - 1)
        b[1, 0] = 1.0
    else:
        b[0, 0] = gain * DT
    return LinearSystem(a=a, b=b, c=c, d=np.zeros((1, 1)), dt=DT, name="late integrator")


@pytest.mark.parametrize("late", [0, 1, 5])
def test_margins_of_a_late_integrator_are_those_of_the_closed_form(late: int) -> None:
    gain = 100.0
    m = late_integrator(gain, late).margins()
    # |z - 1| = 2 sin(w/2), and the phase of 1/(z - 1) is -90 deg - w/2.
    angle = 2.0 * math.asin(0.5 * gain * DT)
    assert m.crossover == pytest.approx(angle / (2 * math.pi * DT), rel=1e-7)
    assert m.phase == pytest.approx(math.pi / 2 - angle * (0.5 + late), abs=1e-6)
    assert m.delay == pytest.approx(m.phase / angle * DT, rel=1e-6)
    turn = math.pi / (1 + 2 * late)  # where the phase is -180 deg
    assert m.gain == pytest.approx(2.0 * math.sin(turn / 2) / (gain * DT), rel=1e-6)
    assert 1.0 < m.sensitivity < 1.0 / (1.0 - 1.0 / m.gain) + 1.0
    assert m.phase >= 2.0 * math.asin(0.5 / m.sensitivity)
    assert m.gain >= m.sensitivity / (m.sensitivity - 1.0) - 1e-6


def test_margins_of_random_loops_are_those_of_python_control() -> None:
    rng = np.random.default_rng(12)
    for _ in range(20):
        poles = np.exp(-rng.uniform(0.02, 1.0, 3))
        loop = LinearSystem(
            a=np.diag(poles), b=rng.normal(size=(3, 1)), c=rng.normal(size=(1, 3)), d=np.zeros((1, 1)), dt=DT, name="r"
        )
        system, m = loop.to_control(), loop.margins()
        w = 2 * np.pi * loop.frequencies()[::40]
        assert loop.response(w / (2 * np.pi)) == pytest.approx(system(np.exp(1j * w * DT)), rel=1e-9)
        closed = control.feedback(system, 1)
        assert sorted(abs(closed.poles())) == pytest.approx(sorted(abs(np.linalg.eigvals(loop.closed().a))), rel=1e-6)
        fine = np.linspace(1e-6, 1, 200_001)[:-1] * math.pi / DT
        fraction = control.ss2tf(system)  # of two polynomials: a state-space system is solved anew at each frequency
        assert m.sensitivity == pytest.approx(max(abs(1 / (1 + fraction(np.exp(1j * fine * DT))))), rel=1e-4)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            _, phase, _, _, crossover, _ = control.stability_margins(system)
        if m.crossover and abs(m.phase) > 0.01 and loop.closed().spectral_radius < 1.0:
            assert math.degrees(m.phase) == pytest.approx(phase, abs=0.01)
            assert np.isfinite(crossover)


def test_a_loop_that_never_reaches_one_has_nothing_to_lose() -> None:
    one = np.eye(1)
    m = LinearSystem(a=0.5 * one, b=0.1 * one, c=one, d=0 * one, dt=DT, name="weak").margins()
    assert (m.crossover, m.phase, m.delay) == (0.0, math.pi, math.inf)
    assert m.gain == pytest.approx(15.0)  # 0.1 k / (-1 - 0.5) = -1


def test_a_resonance_between_two_points_of_the_grid_is_seen() -> None:
    mode = np.exp(complex(-1e-5, 0.7))
    a = np.array([[mode.real, mode.imag], [-mode.imag, mode.real]])
    loop = LinearSystem(a=a, b=np.array([[0.0], [1e-5]]), c=np.array([[1.0, 0.0]]), d=np.zeros((1, 1)), dt=DT, name="m")
    fine = 0.7 / (2 * np.pi * DT) * np.linspace(1 - 1e-4, 1 + 1e-4, 20_001)
    highest = abs(loop.response(fine)).max()
    assert abs(loop.response(loop.frequencies())).max() == pytest.approx(highest, rel=0.02)


def test_scipy_and_control_take_it(monkeypatch: pytest.MonkeyPatch) -> None:
    loop = late_integrator(100.0, 2)
    _, out, _ = scipy.signal.dlsim(loop.closed().to_scipy(), np.ones(200))
    _, answer = control.step_response(control.feedback(loop.to_control(), 1), np.arange(200) * DT)
    assert out[:, 0] == pytest.approx(answer, abs=1e-9)
    assert out[-1, 0] == pytest.approx(1.0, abs=1e-6)
    assert loop.to_scipy().dt == loop.to_control().dt == DT
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(
        DetentError, match=r'needs python-control, which is not installed; try: pip install "detent\[con'
    ):
        loop.to_control()
