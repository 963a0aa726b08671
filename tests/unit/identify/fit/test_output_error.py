"""Constants by simulation."""

import numpy as np
import pytest
from tests.trust.plants import coloured

from detent.errors import DetentError
from detent.identify.fit.constants import Constants
from detent.identify.fit.equations import Run
from detent.identify.fit.free_run import Plant
from detent.identify.fit.output_error import cut_stretches, fit_output_error

pytestmark = pytest.mark.compiled

STEP = 2e-3
NAMES = ("mass", "coulomb.positive", "coulomb.negative", "viscous.positive", "viscous.negative", "delay")
TRUE = np.array([2.0, 1.5, 0.9, 3.0, 4.0, 0.0])


def constants(values: np.ndarray, names: tuple[str, ...] = NAMES) -> Constants:
    return Constants(names, values, np.diag((0.1 * np.abs(values) + 1e-9) ** 2), np.full(len(values), 10.0), "made")


def driven(seconds: float, seed: int = 1, noise: float = 2e-5, names=NAMES, true=TRUE) -> Run:
    """An axis driven open loop by a force of some sines, with standstills in between."""
    t = np.arange(round(seconds / STEP)) * STEP
    force = 4.0 * np.sin(2 * np.pi * 0.5 * t) + 3.0 * np.sin(2 * np.pi * 1.3 * t + 1.0)
    q = Plant(constants(true, names), STEP).run(force, 0, len(t), 0.0, 0.0)
    rng = np.random.default_rng(seed)
    q = q + coloured(rng, len(q), noise, 0.0)
    return Run("made", STEP, q, force, np.ones(len(q), np.bool_), noise=noise)


def test_constants_come_back_from_a_wrong_start():
    found = fit_output_error([driven(30.0)], constants(TRUE * np.array([1.3, 0.6, 1.5, 0.7, 1.2, 1.0])))
    assert found.values == pytest.approx(TRUE, rel=0.02)
    assert (np.abs(found.values - TRUE)[:-1] < 2.5 * found.errors[:-1]).all()


def test_what_it_is_told_on_the_way_ends_at_one():
    told: list[float] = []
    fit_output_error([driven(10.0)], constants(1.1 * TRUE), report=told.append)
    assert told[-1] == 1.0
    assert told == sorted(told)
    assert all(0.0 < share <= 1.0 for share in told)


def test_a_lossy_transmission_and_a_pendulum():
    names = (*NAMES[:-1], "pendulum", "loss", "delay")
    true = np.array([2.0, 0.5, 0.5, 3.0, 3.0, 4.0, 0.3, 0.0])
    run = driven(40.0, names=names, true=true)
    start = constants(true * np.array([1.2, 1.3, 0.8, 1.2, 0.8, 0.8, 0.5, 1.0]), names)
    found = fit_output_error([run], start)
    assert found.values == pytest.approx(true, rel=0.05, abs=1e-6)


def test_stretches_leave_out_what_means_nothing():
    run = driven(20.0)
    usable = run.usable.copy()
    usable[4000:6000] = False
    parts = cut_stretches([Run(run.name, STEP, run.position, run.effort, usable)], 2.0)
    assert len(parts) == 8
    assert all(usable[s.begin : s.begin + s.samples].mean() > 0.98 for s in parts)


def test_too_few_stretches_are_refused():
    with pytest.raises(DetentError, match="expected: 4 or more"):
        fit_output_error([driven(3.0)], constants(TRUE))
