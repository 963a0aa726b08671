"""Constants that change along a log are found with their size; those that do not are not."""

import numpy as np
import pytest
from tests.log_rig import make_log

from detent.identify.fit.equations import make_run
from detent.identify.fit.identification import choose_windows, identify
from detent.identify.fit.regression import fit_equations
from detent.identify.fit.steadiness import FORCE, GAIN, PAST, SIGN, SLIGHT, SPEED, Change, changes_of, widen

T = np.arange(16000) * 1e-3
NAMES = ("mass", "coulomb", "offset", "viscous")


def log(load=0.0, offset=0.0, seed=1, measured=lambda force, _: force):
    """An axis of 2 kg that carries a load from the middle on, its force with an offset that grows, as measured."""
    w = 2 * np.pi * np.array([0.23, 0.61, 1.3])
    angle, sizes = np.outer(T, w) + np.array([0.3, 1.1, 2.0]), np.array([0.06, 0.025, 0.008])
    x, v, a = np.sin(angle) @ sizes, np.cos(angle) @ (sizes * w), -np.sin(angle) @ (sizes * w**2)
    mass = 2.0 + load * (np.arange(len(T)) > len(T) // 2)
    noise = 0.02 * np.random.default_rng(seed).normal(size=len(T))
    force = mass * a + 1.6 * np.sign(v) + 6.0 * v + offset * np.linspace(-1, 1, len(T)) + noise
    return make_log(T, position=x, force=measured(force, np.linspace(-1, 1, len(T))))


def changes(made):
    parts = choose_windows([make_run(made)])
    fit = fit_equations(parts, NAMES)
    return parts, fit, {change.name: change for change in changes_of(parts, fit)[0]}


def test_constants_that_stay():
    assert [changes(log(seed=seed))[2] for seed in range(5)] == [{}] * 5


def test_a_load_put_on():
    _, _, found = changes(log(load=0.5))
    assert found["mass"].amplitude == pytest.approx(0.25, rel=0.1)
    assert found["mass"].course == "about 50% of the way along the log"
    assert found["mass"].share == pytest.approx(0.25 / 2.25, rel=0.1)


def test_an_offset_that_drifts():
    _, _, found = changes(log(offset=0.4))
    assert found["offset"].amplitude == pytest.approx(0.4, rel=0.1)
    assert found["offset"].course == "steadily along the log"
    refused = identify([log(offset=0.4)])
    assert refused.verdict == "refused"
    assert "changes along the log" in {r.subject for r in refused.refusals}


def test_a_gain_that_changes_with_time_or_sign():
    """All constants change alike: together they tell what none of them does alone."""
    for measured, course, size in (
        (lambda force, t: force * (1.0 + 0.1 * t), "steadily along the log", 0.1),
        (lambda force, t: force * np.where(t > 0.0, 1.1, 0.9), "about 50% of the way along the log", 0.1),
        (lambda force, _: np.where(force > 0.0, 1.2 * force, force), "with its sign", 0.1 / 1.1),
    ):
        made = log(measured=measured)
        _, _, found = changes(made)
        assert found[GAIN].course == course
        assert abs(found[GAIN].amplitude) == pytest.approx(size, rel=0.15)
        (refusal,) = [r for r in identify([made]).refusals if r.subject.startswith("changes")]
        assert refusal.constants == ()


def test_a_gain_that_is_another_in_the_first_tenth():
    _, _, found = changes(log(measured=lambda force, t: force * np.where(t < -0.8, 0.8, 1.0)))
    assert found[GAIN].course == "about 10% of the way along the log"
    assert abs(found[GAIN].amplitude) == pytest.approx(0.1, rel=0.05)


@pytest.mark.parametrize(("most", "large"), [(12.0, False), (7.0, True)])
def test_an_amplifier_that_gives_way(most, large):
    """The constants follow its slope, ``1 - (measured / most)^2``: from 1 at nothing to the least at the top."""
    parts, _, found = changes(log(measured=lambda force, _: most * np.tanh(force / most)))
    half = 0.5 * float(np.quantile(np.abs(parts[0].run.effort), 0.98) / most) ** 2
    assert found[GAIN].course == "with its size"
    assert found[GAIN].amplitude == pytest.approx(-half / (1.0 - half), rel=0.15)
    assert found[GAIN].is_large == large


def test_a_zero_that_creeps_after_the_effort_and_one_that_cannot_stay():
    """A strain gauge, an amplifier behind a capacitor: a part of what the effort was in the last second."""

    def creeping(force, _):
        past = np.convolve(force, np.ones(1000) / 1000.0)[: len(force)]
        return force - 0.1 * past

    made = log(measured=creeping)
    _, _, found = changes(made)
    assert found[FORCE].course == PAST
    assert found[FORCE].amplitude == pytest.approx(-0.1, abs=0.02)
    told = " ".join(r.text for r in identify([made]).refusals)
    assert "zero of the effort follows what the effort was in the last second, by " in told


def test_an_effort_that_is_ever_later():
    def later(force, along):
        rows = np.arange(len(force)) - 18.0 * (along + 1.0)
        return force[np.maximum(np.rint(rows).astype(int), 0)]

    _, _, found = changes(log(measured=later))
    assert found["delay"].course == "steadily along the log"
    assert found["delay"].amplitude == pytest.approx(-18e-3, abs=1e-3)
    assert "delay" not in changes(log(measured=lambda force, _: np.r_[force[:1].repeat(6), force[:-6]]))[2]


@pytest.mark.parametrize(("course", "late"), [
    ("with the direction", lambda place: np.gradient(place) > 0.0),
    ("from end to end of the travel", lambda place: (place - place.min()) / np.ptp(place)),
])  # fmt: skip
@pytest.mark.parametrize(("rows", "large"), [(2.0, False), (30.0, True)])
def test_an_effort_that_is_later_one_way_or_at_one_end(course, late, rows, large):
    """One wire is as late whatever the axis does: a filter of one sign, a drum of cable, a position that is late."""

    def later(force, _):
        behind = np.rint(rows * late(log().signals["position"])).astype(int)
        return force[np.maximum(np.arange(len(force)) - behind, 0)]

    made = log(measured=later)
    change = changes(made)[2]["delay"]
    assert change.course == course
    assert change.amplitude == pytest.approx(-0.5e-3 * rows, rel=0.15)
    assert change.is_large == large
    told = [r for r in identify([made]).refusals if r.subject == "changes with the motion"]
    assert [r.text.partition(",")[0] for r in told] == [f"delay changes {course}"] * large
    assert all(r.record.startswith("look for a filter or a sensor that is late") for r in told)


def test_a_large_change_is_not_hidden_by_a_slight_one_that_is_clearer():
    """A step of 2 % in the middle of the log, and 4 % with the sign, which noise hides more of."""
    made = log(measured=lambda f, t: f * (1.0 + 0.02 * np.sign(t)) * np.where(f > 0.0, 1.02, 0.94))
    _, _, found = changes(made)
    assert found[GAIN].course == SIGN
    assert found[GAIN].is_large


def test_what_a_change_with_the_motion_may_be():
    """A mass that a coarse sensor blurs holds in its mean; friction is no straight line of the speed."""
    shares = {"mass": 0.1, GAIN: 0.1, "viscous": np.inf}
    for name, most in shares.items():
        small, large = (Change(name, 1.0, share, share, SPEED) for share in (0.99 * min(most, 5.0), 1.01 * most))
        assert not small.is_large
        assert large.is_large == (most < np.inf)
        assert not Change(GAIN, 1.0, 0.99 * SLIGHT, 0.99 * SLIGHT, SIGN).is_large
        assert Change(GAIN, 1.0, 1.01 * SLIGHT, 1.01 * SLIGHT, SIGN).is_large
        assert Change(name, 1.0, 1.01 * SLIGHT, 1.01 * SLIGHT, "steadily along the log").is_large


def test_a_slight_change_widens_the_limits():
    parts, fit, found = changes(log(load=0.06))
    before = fit.error("mass")
    widen(parts, fit, [found["mass"]])
    assert fit.error("mass") == pytest.approx(np.hypot(before, found["mass"].amplitude / np.sqrt(3)))


def test_friction_that_bends_widens_both_constants_of_its_direction():
    """Chords of a parabola: their ends at standstill differ by half of the change of the slope at the top speed."""
    parts, fit, _ = changes(log())
    before = [fit.error(name) for name in fit.names]
    widen(parts, fit, [Change("viscous", 6.0, 0.6, 0.01, SPEED)])
    top = float(np.quantile(np.abs(parts[0].ideal.velocity), 0.98))
    sides = {"viscous": 0.6, "coulomb": 0.3 * top}
    for name, error in zip(fit.names, before, strict=True):
        assert fit.error(name) == pytest.approx(np.hypot(error, sides.get(name, 0.0) / np.sqrt(3)))


def test_a_mass_that_changes_with_the_speed_widens_friction():
    """The gain of the force rises with the speed: friction is read from it, and open by as much."""
    speed = np.abs(np.gradient(log().signals["position"]))
    parts, fit, found = changes(log(measured=lambda force, _: force * (1.0 + 0.06 * speed / speed.max())))
    mass = found["mass"]
    assert mass.course == SPEED
    assert not mass.is_large
    before = np.diag(fit.covariance).copy()
    widen(parts, fit, [mass])
    added = dict(zip(fit.names, np.sqrt(np.diag(fit.covariance) - before).tolist(), strict=True))
    side, top = mass.share * float(np.sqrt(np.mean(fit.effort**2))), float(np.quantile(speed, 0.98)) / 1e-3
    assert added["coulomb"] == pytest.approx(side / np.sqrt(3.0))
    assert added["viscous"] == pytest.approx(2.0 * side / top / np.sqrt(3.0), rel=0.05)
    assert added["mass"] == pytest.approx(abs(mass.amplitude) / np.sqrt(3.0))
    assert added["delay"] == 0.0
