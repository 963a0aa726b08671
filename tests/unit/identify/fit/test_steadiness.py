"""Constants that change along a log are found with their size; those that do not are not."""

import numpy as np
import pytest
from tests.log_rig import make_log

from detent.identify.fit.equations import make_run
from detent.identify.fit.identification import choose_windows, identify
from detent.identify.fit.regression import fit_equations
from detent.identify.fit.steadiness import changes_of, widen

T = np.arange(16000) * 1e-3
NAMES = ("mass", "coulomb", "offset", "viscous")


def log(load=0.0, offset=0.0, seed=1):
    """An axis of 2 kg that carries a load from the middle on, its force with an offset that grows."""
    w = 2 * np.pi * np.array([0.23, 0.61, 1.3])
    angle, sizes = np.outer(T, w) + np.array([0.3, 1.1, 2.0]), np.array([0.06, 0.025, 0.008])
    x, v, a = np.sin(angle) @ sizes, np.cos(angle) @ (sizes * w), -np.sin(angle) @ (sizes * w**2)
    mass = 2.0 + load * (np.arange(len(T)) > len(T) // 2)
    noise = 0.02 * np.random.default_rng(seed).normal(size=len(T))
    force = mass * a + 1.6 * np.sign(v) + 6.0 * v + offset * np.linspace(-1, 1, len(T)) + noise
    return make_log(T, position=x, force=force)


def changes(made):
    parts = choose_windows([make_run(made)])
    fit = fit_equations(parts, NAMES)
    return fit, {change.name: change for change in changes_of(parts, fit)}


def test_constants_that_stay():
    assert [changes(log(seed=seed))[1] for seed in range(5)] == [{}] * 5


def test_a_load_put_on():
    _, found = changes(log(load=0.5))
    assert found["mass"].amplitude == pytest.approx(0.25, rel=0.1)
    assert found["mass"].course == "about 50% of the way"
    assert found["mass"].share == pytest.approx(0.25 / 2.25, rel=0.1)


def test_an_offset_that_drifts():
    _, found = changes(log(offset=0.4))
    assert found["offset"].amplitude == pytest.approx(0.4, rel=0.1)
    assert found["offset"].course == "steadily"
    refused = identify([log(offset=0.4)])
    assert refused.verdict == "refused"
    assert "changes along the log" in {r.subject for r in refused.refusals}


def test_a_slight_change_widens_the_limits():
    fit, found = changes(log(load=0.06))
    before = fit.error("mass")
    widen(fit, list(found.values()))
    assert fit.error("mass") == pytest.approx(np.hypot(before, found["mass"].amplitude / np.sqrt(3)))
