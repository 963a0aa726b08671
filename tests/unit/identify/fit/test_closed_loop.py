"""Simulation under the loops that a log shows."""

import numpy as np
import pytest
from tests.trust.plants import make_axis, make_case

from detent.identify.fit.constants import Constants
from detent.identify.fit.equations import Run
from detent.identify.fit.free_run import simulate_closed_loop

pytestmark = pytest.mark.compiled

NAMES = ("mass", "coulomb.positive", "coulomb.negative", "viscous.positive", "viscous.negative", "delay")


def recorded(number: int) -> tuple[Run, Constants]:
    """The run of a case of the trust test, and its true constants."""
    case = make_case(number)
    c = case.columns
    t, a = c["t [s]"], make_axis(np.random.default_rng([number, 20]))
    run = Run(
        "case", float(t[1] - t[0]), c["position [m]"], c["force [N]"], np.ones(len(t), np.bool_),
        reference=c["position ref [m]"], resolution=a.resolution, noise=0.4 * a.resolution,
    )  # fmt: skip
    values = np.array([case.truth[name] for name in NAMES])
    return run, Constants(NAMES, values, np.zeros((6, 6)), np.full(6, 10.0), "true")


def halves(run: Run) -> tuple[list[Run], list[Run]]:
    cut = round(0.75 * len(run.position))
    return [run.part(0, cut)], [run.part(cut, len(run.position))]


@pytest.mark.parametrize("number", [1, 6])
def test_true_constants_follow_as_the_axis_did(number: int):
    run, true = recorded(number)
    found = simulate_closed_loop(true, *halves(run))
    assert found is not None
    assert found.rms < 20 * run.resolution
    assert found.rms < 1e-3 * float(np.ptp(run.position))
    assert found.effort < 0.15
    assert found.largest >= found.rms
    assert found.loops.error < 0.05


def test_wrong_constants_show_in_the_effort():
    run, true = recorded(6)
    wrong = Constants(
        NAMES, true.values * np.array([1.0, 2.0, 2.0, 1.0, 1.0, 1.0]), true.covariance, true.degrees, "wrong"
    )
    right, off = (simulate_closed_loop(c, *halves(run)) for c in (true, wrong))
    assert right is not None
    assert off is not None
    assert off.effort > 3 * right.effort


def test_a_log_without_a_reference_has_no_loops():
    run, true = recorded(6)
    bare = Run(run.name, run.step, run.position, run.effort, run.usable, resolution=run.resolution, noise=run.noise)
    assert simulate_closed_loop(true, *halves(bare)) is None


def test_an_effort_that_no_loops_explain_is_not_simulated():
    run, true = recorded(6)
    rng = np.random.default_rng(2)
    noise = Run(
        run.name, run.step, run.position, float(np.std(run.effort)) * rng.normal(size=len(run.effort)), run.usable,
        reference=run.reference, resolution=run.resolution, noise=run.noise,
    )  # fmt: skip
    assert simulate_closed_loop(true, *halves(noise)) is None
