"""Constants and delay come back; the reference takes the bias away that noise puts into a closed loop."""

from dataclasses import replace

import numpy as np
import pytest
from tests.identify_rig import TRUTH, Recorder

from detent.identify.fit.equations import LOSS, Run, make_kernel
from detent.identify.fit.ladder import best_bend
from detent.identify.fit.regression import WIDER, fit_equations, lag_of, make_columns, prepare, solve

NAMES = tuple(TRUTH)
HALF = 10


WAYS = ("none", "position", "reference")
"""What instruments are made of."""


def parts_of(*runs, half=HALF, way="reference"):
    return [prepare(run, make_kernel(half, run.step), way) for run in runs]


def fit_by(way, *runs, names=NAMES, half=HALF):
    return fit_equations(parts_of(*runs, half=half, way=way), names)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("delay", [0.0, 0.0037, -0.001])
def test_constants_and_delay_come_back(way, delay):
    run = Recorder(delay=delay, force_noise=0.0).run()
    fit = fit_by(way, run)
    assert dict(zip(NAMES, fit.values.tolist(), strict=False)) == pytest.approx(TRUTH, rel=1e-4)
    assert fit.value("delay") == pytest.approx(delay, abs=5e-6)
    assert fit.value("mass") == fit.values[0]
    assert fit.value("spring") == 0.0
    assert fit.instruments == way


def test_several_runs_are_one_fit():
    runs = [Recorder(seconds=5, seed=seed, force_noise=0.2).run() for seed in (1, 2, 3)]
    alone = fit_equations(parts_of(runs[0]), NAMES)
    together = fit_equations(parts_of(*runs), NAMES)
    assert len(together.residual) == 3 * len(alone.residual)
    assert together.covariance[0, 0] < 0.6 * alone.covariance[0, 0]


@pytest.mark.parametrize("way", WAYS)
def test_errors_scatter_as_the_covariance_says(way):
    fits = [fit_by(way, Recorder(seed=seed, force_noise=0.3).run()) for seed in range(40)]
    count = len(NAMES) + (way == "reference")  # the delay by references only
    scatter = np.std([fit.values[:count] for fit in fits], axis=0, ddof=1)
    said = np.median([np.sqrt(np.diag(fit.covariance))[:count] for fit in fits], axis=0)
    assert said == pytest.approx(scatter, rel=0.45)


def closed_loop(seed, noise=2e-4, step=2e-3, seconds=12.0):
    """A mass with viscous friction under a loop that acts on what a noisy sensor says: force stands between samples."""
    mass, viscous, gain, damping = 2.0, 5.0, 3000.0, 120.0
    rng = np.random.default_rng(seed)
    n = round(seconds / step)
    t = np.arange(n) * step
    wanted = 0.02 * np.sin(2 * np.pi * 1.1 * t) + 0.006 * np.sin(2 * np.pi * 3.3 * t + 1)
    fade = np.exp(-viscous / mass * step)
    q = v = before = 0.0
    measured, force = np.empty(n), np.empty(n)
    read = noise * rng.standard_normal(n)
    for k in range(n):
        measured[k] = q + read[k]
        force[k] = gain * (wanted[k] - measured[k]) - damping * (measured[k] - before) / step
        before = measured[k]
        end = force[k] / viscous
        q += end * step + (v - end) * (1 - fade) * mass / viscous
        v = end + (v - end) * fade
    return Run("loop", step, measured, force, np.ones(n, bool), reference=wanted, noise=noise)


def test_wider_windows_share_little_noise_with_the_narrow_ones():
    """Of white noise in the second derivative: the share that its product with the instrument keeps of its square."""
    narrow, wide = (make_kernel(half, 1e-3).second for half in (20, round(WIDER * 20)))
    inner = wide[len(wide) // 2 - 20 : len(wide) // 2 + 21]
    assert inner @ narrow / (narrow @ narrow) == pytest.approx(0.026, abs=0.001)


NOISES = {"reference": 2e-4, "position": 1e-5}
"""Noise at which the windows of these tests are used with such instruments [m]."""


@pytest.mark.parametrize("way", NOISES)
def test_instruments_take_away_the_bias_of_a_closed_loop(way):
    """Noise of the sensor goes through the controller into the force: least squares follow it, instruments do not."""
    found = {"none": [], way: []}
    for seed in range(12):
        for by, values in found.items():
            loop = closed_loop(seed, NOISES[way])
            values.append(fit_by(by, loop, names=("mass", "viscous"), half=8).values[:2])
    truth = np.array([2.0, 5.0])
    errors = {by: np.mean(values, axis=0) - truth for by, values in found.items()}
    scatter = {by: np.std(values, axis=0, ddof=1) / np.sqrt(12) for by, values in found.items()}
    assert (np.abs(errors[way]) < 4 * scatter[way]).all()
    assert abs(errors["none"][0]) > 10 * scatter["none"][0]
    assert abs(errors[way][0]) < 0.1 * abs(errors["none"][0])


@pytest.mark.parametrize("way", NOISES)
def test_limits_by_instruments_hold_in_a_closed_loop(way):
    held = []
    for seed in range(12):
        fit = fit_by(way, closed_loop(seed, NOISES[way]), names=("mass", "viscous"), half=8)
        held.append(np.abs(fit.values[:2] - [2.0, 5.0]) < 3.0 * np.sqrt(np.diag(fit.covariance)[:2]))
    assert np.mean(held) > 0.9


def test_how_late_the_axis_follows():
    run = Recorder().run()
    late = 17
    follows = np.concatenate([np.full(late, run.position[0]), run.position[:-late]])
    behind = Run("late", run.step, follows, run.effort, run.usable, reference=run.reference)
    assert lag_of(run.reference, run) == 0
    assert lag_of(run.reference, behind) == late
    # The instruments move as the axis does: the constants do not mind that it is late.
    ideal = parts_of(behind)[0].ideal
    assert ideal.velocity == pytest.approx(parts_of(behind)[0].motion.velocity, abs=1e-3)


def test_what_nothing_excites_is_unknown():
    run = Recorder().run()
    v = Recorder().motion(run.t)[1]
    turns = np.flatnonzero(v[1:] * v[:-1] < 0.0)
    first = int(turns[np.argmax(np.diff(turns) * (v[turns[:-1] + 1] > 0.0))])
    one_way = run.part(first + 1, int(turns[turns > first][0]))
    names = ("mass", "coulomb.positive", "viscous.positive", "viscous.negative")
    fit = fit_equations(parts_of(one_way), names)
    assert fit.value("viscous.negative") == 0.0
    assert np.sqrt(fit.covariance[3, 3]) > 1e5 * np.abs(fit.effort).max()
    assert fit.value("mass") == pytest.approx(2.0, rel=0.05)


def test_terms_that_say_the_same_show_in_the_condition():
    parts = parts_of(Recorder().run())
    clear = fit_equations(parts, ("mass", "coulomb", "offset"))
    alike = fit_equations(parts, ("mass", "viscous", "coulomb", "coulomb.positive", "coulomb.negative"))
    assert clear.condition < 5
    assert alike.condition > 1e6


def test_an_unknown_stribeck_velocity_widens_the_limits_of_the_others():
    run = Recorder(force_noise=0.3, excess=0.8, stribeck=0.05).run()
    names = (*NAMES, "excess.positive", "excess.negative")
    parts = parts_of(run)
    fit = fit_equations(parts, names, 0.05)
    assert fit.names == (*names, "delay", "stribeck")
    assert fit.bend == 0.05
    assert fit.covariance.shape == (9, 9)
    x = make_columns(parts, names, 0.05)
    naive = np.linalg.inv(x.T @ x) * np.var(fit.residual)
    assert fit.covariance[5, 5] > 1.5 * naive[5, 5]
    assert 0.01 < np.sqrt(fit.covariance[8, 8]) / 0.05 < 0.5


def test_a_transmission_that_loses_force():
    """Force that is lost along the motion and helps to brake is found with its share."""
    recorder = Recorder(force_noise=0.0)
    run = recorder.run()
    v = recorder.motion(run.t + 0.5 * run.step)[1]
    share = 0.25
    lossy = replace(run, effort=run.effort / (1.0 - share * np.sign(run.effort * v)))
    parts = parts_of(lossy)
    names = (*NAMES, LOSS)
    assert best_bend(parts, names)[0] == pytest.approx(share, abs=0.01)
    fit = fit_equations(parts, names, share)
    assert fit.names == (*NAMES, "delay", "loss")
    assert (fit.bend, fit.value("loss")) == (share, share)
    assert dict(zip(NAMES, fit.values.tolist(), strict=False)) == pytest.approx(TRUTH, rel=0.02)
    plain = fit_equations(parts, NAMES)
    assert np.std(plain.residual) > 5 * np.std(fit.residual)


def test_solving_does_not_mind_units():
    rng = np.random.default_rng(2)
    x, theta = rng.standard_normal((50, 3)), np.array([1.0, -2.0, 3.0])
    scale = np.array([1e-8, 1.0, 1e7])
    assert solve(x, x, x @ theta) == pytest.approx(theta)
    assert solve(x * scale, x * scale, x @ theta) == pytest.approx(theta / scale)
    z = x + rng.standard_normal((50, 3))
    assert solve(z, x, x @ theta) == pytest.approx(theta)
    x[:, 1] = 0.0
    assert solve(x, x, x @ theta) == pytest.approx([1.0, 0.0, 3.0])


@pytest.mark.parametrize("instruments", ["reference", "position", "none"])
def test_windows_like_others_are_those_made_anew(instruments):
    run = Recorder(position_noise=1e-6).run()
    narrow, wide = (make_kernel(half, run.step) for half in (20, 30))
    anew, like = prepare(run, wide, instruments), prepare(run, wide, instruments, prepare(run, narrow, instruments))
    for one, other in ((anew.motion, like.motion), (anew.ideal, like.ideal)):
        assert (one.rows == other.rows).all()
        for name in ("position", "velocity", "acceleration", "right", "left", "quick", "places"):
            assert (getattr(one, name) == getattr(other, name)).all(), name
