"""The simulation along a log: the compiled axis moved by the constants alone."""

from dataclasses import replace

import numpy as np
import pytest
from tests.trust.plants import Axis, make_params, record

from detent.identify.fit.constants import Constants
from detent.identify.fit.equations import Run
from detent.identify.fit.free_run import HORIZONS, Plant, free_run, free_spread, simulate_horizons, start_velocities
from detent.planning.profile import profile_of_recording

pytestmark = pytest.mark.compiled

STEP, COUNT = 1e-3, 1e-6
TRUTH = {
    "mass": 2.0,
    "coulomb.positive": 1.8,
    "coulomb.negative": 1.4,
    "viscous.positive": 6.0,
    "viscous.negative": 4.5,
    "delay": 2 * STEP,
}


def constants(**changed):
    values = TRUTH | {name.replace("_", "."): value for name, value in changed.items()}
    return Constants(
        tuple(values), np.array(list(values.values())), 1e-6 * np.eye(len(values)), np.full(len(values), 20.0), "made"
    )


@pytest.fixture(scope="module")
def run():
    """A noise-free log of a controlled axis with those constants, position and command sample by sample."""
    axis = Axis(2.0, (1.6, 1.6), (6.0, 4.5), (1.6, 1.6), 0.0, 0.2, 0.3, 4.0, STEP, COUNT, 2)
    t = np.arange(6000) * STEP
    wanted = 0.06 * (1 - np.cos(2 * np.pi * 0.5 * t)) + 0.01 * np.sin(2 * np.pi * 1.3 * t) * np.minimum(t, 1.0)
    wanted = np.where(t < 0.1, 0.0, wanted - wanted[100])
    params = make_params(axis, np.random.default_rng(3))
    made = record(params, profile_of_recording(t, wanted, STEP), 0.0)
    n = min(len(made["force"]), len(t))
    return Run("made", STEP, made["position"][:n], made["force"][:n], np.ones(n, bool), resolution=COUNT)


def test_a_noise_free_log_is_simulated_to_below_a_count(run):
    made = free_run(constants(), run)
    late = len(run.position) - len(made)
    assert 0 < late < 10
    assert np.ptp(run.position) > 0.1
    assert np.abs(made - run.position[late:]).max() < COUNT


def test_wrong_constants_show(run):
    def worst(**changed):
        made = free_run(constants(**changed), run)
        return np.abs(made - run.position[-len(made) :]).max()

    for name, value in TRUTH.items():
        assert worst(**{name.replace(".", "_"): 1.02 * value}) > 5 * COUNT or name == "delay", name
    assert worst(delay=0.0) > 100 * COUNT


def test_a_stretch_starts_where_and_as_fast_as_it_is_told(run):
    plant, velocity = Plant(constants(), STEP), start_velocities(run)
    begin = 2500
    made = plant.run(run.effort, begin, 400, float(run.position[begin]), float(velocity[begin]))
    assert made[0] == run.position[begin]
    assert made == pytest.approx(run.position[begin : begin + 400], abs=20 * COUNT)
    faster = plant.run(run.effort, begin, 5, 0.5, float(velocity[begin]) + 0.1)
    assert faster[:1] == 0.5
    assert faster[1] - 0.5 == pytest.approx((velocity[begin] + 0.1) * STEP, rel=0.05)


def test_horizons_that_fit_in_order(run):
    told = []
    found = simulate_horizons(constants(), [run], told.append)
    assert [h.name for h in found] == ["0.1 s", "0.5 s", "1 s", "2 s", "one step", "free run"]
    assert [h.duration for h in found[:-1]] == pytest.approx([*HORIZONS, STEP])
    assert all(h.starts == 60 for h in found[:-1])
    assert found[-1].starts == 1
    assert all(h.largest >= h.rms for h in found)
    assert found[-1].rms < COUNT
    assert told == sorted(told)
    short = simulate_horizons(constants(), [run.part(3000, 3700)])
    assert [h.name for h in short] == ["0.1 s", "0.5 s", "one step", "free run"]


@pytest.mark.parametrize("more", range(1, 20))
def test_a_run_hardly_longer_than_a_horizon(run, more):
    names = [h.name for h in simulate_horizons(constants(), [run.part(1000, 1500 + more)])]
    assert names[0] == "0.1 s"
    assert names[-1] == "free run"


def test_what_the_errors_are_compared_with(run):
    _, half, one, two, *_ = simulate_horizons(constants(), [run])
    q, v = run.position, start_velocities(run)
    samples = round(half.duration / STEP)
    starts = np.unique(np.linspace(6, len(q) - samples - 6, 60).astype(int))
    way = q[starts + samples] - q[starts]
    assert half.moved == pytest.approx(np.sqrt(np.mean(way**2)), rel=1e-6)
    assert half.naive == pytest.approx(np.sqrt(np.mean((v[starts] * half.duration - way) ** 2)), rel=1e-6)
    assert half.rms < 0.001 * half.naive
    assert two.naive > one.naive > half.naive


def test_the_spread_of_a_free_run_is_that_of_runs_with_constants_drawn_from_their_covariance(run):
    """Coulomb friction of both directions that errs together makes another spread than the same errors apart."""
    size = np.array([0.02, 0.02, 0.02, 0.06, 0.05, 0.0])
    spreads = []
    for together in (0.0, 0.95):
        correlation = np.eye(6)
        correlation[1, 2] = correlation[2, 1] = together
        covariance = correlation * np.outer(size, size)
        known = replace(constants(), covariance=covariance, degrees=np.full(6, np.inf))
        spreads.append(free_spread(known, [run]))
        rng = np.random.default_rng(4)
        drawn = rng.multivariate_normal(known.values, covariance, 200)
        apart = [free_run(replace(known, values=values), run) - free_run(known, run) for values in drawn]
        # The standard deviation of 200 draws is known to 5 %, that of a correlated course no better.
        assert spreads[-1] == pytest.approx(1.96 * np.sqrt(np.mean(np.square(apart))), rel=0.12)
    assert abs(spreads[1] / spreads[0] - 1.0) > 0.05
    (*stretches, free) = simulate_horizons(known, [run])
    assert free.spread == spreads[1]
    assert all(np.isnan(one.spread) for one in stretches)


def test_constants_of_which_nothing_is_known_leave_no_spread_to_be_told(run):
    assert np.isnan(free_spread(replace(constants(), covariance=1e6 * np.eye(6)), [run]))


def test_several_runs_count_together(run):
    parts = [run.part(0, 2500), run.part(2500, 6000)]
    found = simulate_horizons(constants(), parts)
    one = {h.name: h for h in found}["0.1 s"]
    assert one.starts == 120
    assert found[-1].starts == 2
    assert found[-1].duration == pytest.approx(3.5, abs=0.01)


def test_a_pendulum_swings_about_where_it_hangs():
    """Small swings: the period is that of the inertia and the weight, about the angle that both weights say."""
    inertia, weight, hangs = 0.5, 20.0, 0.3
    names = ("mass", "pendulum", "pendulum.across")
    values = np.array([inertia, weight * np.cos(hangs), -weight * np.sin(hangs)])
    plant = Plant(Constants(names, values, np.eye(3), np.full(3, 5.0), ""), STEP)
    period = 2 * np.pi * np.sqrt(inertia / weight)
    samples = round(3 * period / STEP) + 1
    made = plant.run(np.zeros(10), 0, samples, hangs + 0.05, 0.0)
    swing = 0.05 * np.cos(2 * np.pi * np.arange(samples) * STEP / period)
    assert made - hangs == pytest.approx(swing, abs=2e-4)


def test_friction_below_nothing_counts_as_none(run):
    made = free_run(constants(viscous_positive=-50.0, viscous_negative=-50.0), run)
    none = free_run(constants(viscous_positive=0.0, viscous_negative=0.0), run)
    assert made == pytest.approx(none)
    assert np.isfinite(made).all()


def test_static_friction_holds_until_it_breaks():
    loose = constants()
    sticks = Constants(
        (*loose.names, "static.positive", "static.negative", "stribeck"),
        np.array([*loose.values, 3.2, 3.2, 0.01]),
        np.eye(len(loose.names) + 3),
        np.full(len(loose.names) + 3, 20.0),
        "made",
    )
    push = np.full(200, 2.6)
    assert Plant(loose, STEP).run(push, 0, 200, 0.0, 0.0)[-1] > 1e-3
    assert Plant(sticks, STEP).run(push, 0, 200, 0.0, 0.0)[-1] == 0.0


def test_positions_do_not_matter_only_ways(run):
    shifted = replace(run, position=run.position + 5.0)
    assert free_run(constants(), shifted) - 5.0 == pytest.approx(free_run(constants(), run), abs=1e-9)
