"""Constants that are others by wider windows are found; those that noise moves are not."""

from dataclasses import replace

import numpy as np
import pytest
from tests.log_rig import make_log

from detent.identify.fit.constants import constants_of
from detent.identify.fit.equations import make_run
from detent.identify.fit.identification import choose_windows, identify
from detent.identify.fit.regression import fit_equations
from detent.identify.fit.verdict import look_at_fit, look_at_windows
from detent.identify.fit.windows import MOST_OUT, MOVED, Moved, moved_by_windows, odd_windows, widened, without

T = np.arange(16000) * 1e-3
TERMS = ("mass", "coulomb.positive", "coulomb.negative", "viscous.positive", "viscous.negative")


def log(wave=0.0, seed=1, pushed=()):
    """An axis of 2 kg that is pushed at some samples, and a sensor whose error goes up and down every 2 mm."""
    w = 2 * np.pi * np.array([0.23, 0.61, 1.3])
    angle, sizes = np.outer(T, w) + np.array([0.3, 1.1, 2.0]), np.array([0.06, 0.025, 0.008])
    x, v, a = np.sin(angle) @ sizes, np.cos(angle) @ (sizes * w), -np.sin(angle) @ (sizes * w**2)
    force = 2.0 * a + 1.6 * np.sign(v) + 6.0 * v + 0.02 * np.random.default_rng(seed).normal(size=len(T))
    for at in pushed:
        force[at : at + 20] += 5.0
    return make_log(T, position=x + wave * np.sin(2 * np.pi * x / 2e-3), force=force)


def moved(made, names=TERMS):
    parts = choose_windows([make_run(made)])
    return parts, moved_by_windows(parts, fit_equations(parts, TERMS), names)


def test_noise_moves_no_constant():
    assert [moved(log(seed=seed))[1] for seed in range(5)] == [[]] * 5


def test_a_sensor_that_is_not_even_moves_them():
    parts, found = moved(log(wave=3e-5))
    assert found
    assert found[0].width == pytest.approx(2 * parts[0].motion.kernel.half * 1e-3)
    assert all(one.value != one.other for one in found)
    first = found[0].name
    assert first not in {one.name for one in moved(log(wave=3e-5), [name for name in TERMS if name != first])[1]}


def test_what_they_move_is_refused_with_both_values():
    made = log(wave=3e-5)
    refused = [*look_at_windows(make_run(made), [one for one in moved(made)[1] if not one.is_slight], TERMS)]
    assert all("by wider ones" in r.text for r in refused)
    assert "mass" in {name for r in refused for name in r.constants}
    assert {r.subject for r in refused} == {"depends on the window"}
    assert identify([log(wave=2e-5)]).verdict != "trusted"
    assert identify([log()]).verdict == "trusted"
    assert MOVED < 1.0  # an interval whose end another window reaches holds nothing


def test_friction_takes_that_of_its_direction_along():
    assert Moved("coulomb.positive", 1.0, 2.0, 0.04).concerned == ("coulomb.positive", "viscous.positive", "delay")
    assert Moved("viscous.negative", 1.0, 2.0, 0.04).concerned == ("viscous.negative", "coulomb.negative", "delay")
    assert Moved("mass", 1.0, 2.0, 0.04).concerned == ("mass", "delay")


def test_a_slight_change_widens_the_interval():
    """A model that lacks next to nothing, of a log without noise: the mass is known to 0.5 %, not to 0.01 %."""
    parts = choose_windows([make_run(log())])
    constants = constants_of(fit_equations(parts, TERMS))
    mass, error = constants.value("mass"), float(constants.errors[0])
    slight = Moved("mass", mass, 1.005 * mass, 0.04)
    assert slight.is_slight
    assert not Moved("mass", mass, 1.011 * mass, 0.04).is_slight
    assert widened(constants, {slight.name: slight.other - slight.value}).errors[0] == pytest.approx(
        np.hypot(error, 5e-3 * mass)
    )
    assert widened(constants, {}).errors[0] == error


def test_what_pushes_for_a_moment_is_left_out_and_named():
    pushed = (2000, 6100, 9200)
    found, clean = identify([log(pushed=pushed)]), identify([log()])
    (told,) = [note for note in found.notes if "left out" in note]
    named = [int(one.partition("-")[0]) for one in told.partition("rows ")[2].partition(":")[0].split(", ")]
    assert len(named) == len(pushed)
    assert np.allclose(named, pushed, atol=40)
    assert not any("left out" in note for note in clean.notes)
    for one, other in zip(found.trusted, clean.trusted, strict=True):
        assert one.holds(other.value)
        assert one.half < 1.3 * other.half


@pytest.mark.parametrize(("share", "is_left_out"), [(0.8 * MOST_OUT, True), (1.2 * MOST_OUT, False)])
def test_what_is_common_is_not_left_out_but_refused(share, is_left_out):
    parts = choose_windows([make_run(log())])
    fit = fit_equations(parts, TERMS)
    rest = np.where(np.arange(len(fit.residual)) < share * len(fit.residual), 100.0, 1.0)
    other = replace(fit, residual=rest, effort=np.full(len(rest), 10.0))
    (odd,) = odd_windows(parts, other)
    assert bool(len(odd)) is is_left_out
    refused = [r for r in look_at_fit(parts, other, 0.0, []) if "eight times further off" in r.text]
    assert bool(refused) is not is_left_out
    assert all(r.constants == () for r in refused)


def test_no_window_is_left_that_holds_the_middle_of_an_odd_one():
    (part,) = choose_windows([make_run(log())])
    odd = part.motion.rows[[100, 700]]
    left = without(part, odd)
    reach = part.ideal.kernel.half if part.instruments == "position" else part.motion.kernel.half
    assert np.abs(left.motion.rows[:, None] - odd).min() > reach
    assert len(left.motion.velocity) == len(left.ideal.velocity) == len(left.motion.rows) < len(part.motion.rows)
    assert not left.run.usable[odd].any()
    assert part.run.usable[odd].all()
