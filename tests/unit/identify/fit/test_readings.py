"""Limits hold other readings of a log; those of even rows whose delay is known stay as they are."""

from dataclasses import replace

import numpy as np
import pytest
from tests.log_rig import make_log

from detent.identify.fit.constants import constants_of
from detent.identify.fit.equations import make_run
from detent.identify.fit.identification import choose_windows, identify
from detent.identify.fit.readings import read_otherwise
from detent.identify.fit.regression import fit_equations
from detent.identify.fit.verdict import look_at_readings

STEP, MASS, VISCOUS = 1e-3, 2.0, 6.0
T = np.arange(16000) * STEP
TERMS = ("mass", "coulomb", "offset", "viscous")


def log(stamps=T, late=0.0, times=T, led=()):
    """An axis by rows of some times, whatever their stamps say; its effort acts so much later than recorded."""
    w = 2 * np.pi * np.array([0.23, 0.61, 1.3])
    sizes, noise = np.array([0.06, 0.025, 0.008]), 0.02 * np.random.default_rng(1).normal(size=len(T))

    def at(t):
        angle = np.outer(t, w) + np.array([0.3, 1.1, 2.0])
        return np.sin(angle) @ sizes, np.cos(angle) @ (sizes * w), -np.sin(angle) @ (sizes * w**2)

    _, v, a = at(times + late)
    signals = dict.fromkeys(("position", *led), at(times)[0])
    return make_log(stamps, force=MASS * a + 1.6 * np.sign(v) + VISCOUS * v + noise, **signals)


def read(made):
    """The constants of a log as they are, and as other readings hold them."""
    parts = choose_windows([make_run(made)])
    fit = fit_equations(parts, TERMS)
    constants = constants_of(fit)
    found = read_otherwise([made], parts, fit, constants)
    return parts, constants, found


def half(constants, name):
    return 2.0 * float(constants.errors[constants.names.index(name)])


def test_a_log_of_even_rows_with_a_known_delay_is_left_as_it_is():
    for late in (0.0, 2.0 * STEP):
        _, constants, found = read(log(late=late))
        assert constants.value("delay") == pytest.approx(late, abs=0.6 * STEP)
        assert found.notes == ()
        assert np.array_equal(found.held_by(constants).covariance, constants.covariance)


def test_gaps_that_are_whole_rows_are_even_too():
    rows = np.delete(np.arange(len(T)), np.r_[3000:3010, 7000, 9000:9100])
    whole = log()
    made = make_log(T[rows], **{name: values[rows] for name, values in whole.signals.items()})
    assert read(made)[2].notes == ()


def test_steps_of_more_than_one_and_a_half_periods_are_no_lost_rows_of_a_clock_with_jitter():
    """Each of them was taken for a row that is missing, and none of the windows was left by such rows."""
    made = log(T + 0.26 * STEP * np.random.default_rng(5).uniform(-1.0, 1.0, len(T)))
    assert np.count_nonzero(np.diff(made.t) > 1.5 * STEP) > 5
    _, constants, found = read(made)
    assert constants.value("mass") + found.moved[1]["mass"] == pytest.approx(MASS, rel=1e-3)
    assert np.isfinite(found.held_by(constants).errors).all()


def test_stamps_by_which_hardly_a_window_is_left_have_no_other_reading():
    made = log(T + 0.4 * STEP * np.random.default_rng(5).uniform(-1.0, 1.0, len(T)))
    parts, _, found = read(made)
    assert len(parts[0].motion.rows) < 3 * len(TERMS)
    assert len(found.moved) == 1


def test_a_clock_that_is_late_in_single_rows_leaves_open_which_rows():
    """One step in ten is written 12 % too long: the mass by the stamps is wrong, that by even rows right."""
    steps = STEP * np.where(np.random.default_rng(3).random(len(T)) < 0.1, 1.12, 1.0)
    _, constants, found = read(log(np.cumsum(steps)))
    wide = found.held_by(constants)
    rows, pace = found.moved[1:]
    seconds = float(steps.mean()) / STEP
    assert constants.value("mass") + rows["mass"] == pytest.approx(MASS * seconds**2, rel=2e-3)
    assert constants.value("viscous.positive") + rows["viscous.positive"] == pytest.approx(VISCOUS * seconds, rel=5e-3)
    assert half(wide, "mass") > 2.0 * abs(rows["mass"]) > 2.0 * half(constants, "mass")
    assert pace["mass"] / constants.value("mass") == pytest.approx(2.0 * pace["delay"] / constants.value("delay"))
    assert pace["coulomb.positive"] == 0.0
    assert any("steps of the time are not even" in note for note in found.notes)
    assert found.left_open == "how even its clock is, and how late the effort"


def test_stamps_of_a_sampler_that_waits_are_right():
    """Rows that come unevenly, and say so: by even rows the effort is not that of the motion."""
    times = np.cumsum(STEP * np.where(np.random.default_rng(3).random(len(T)) < 0.1, 1.34, 1.0))
    _, constants, found = read(log(times, times=times))
    assert constants.value("mass") == pytest.approx(MASS, rel=2e-3)
    assert len(found.moved) == 1
    assert not found.notes


def test_a_clock_that_runs_fast_and_slow_leaves_the_seconds_open():
    """Stamps of which the first half is 0.6 % fast and the second slow: masses go by the square of the seconds."""
    _, constants, found = read(log(T + 0.03 * np.sin(np.pi * T / T[-1]) ** 2))
    wide = found.held_by(constants)
    most = 0.03 * np.pi / T[-1] * np.sin(0.4 * np.pi)  # of a sine nine tenths lie within that of 0.4 half turns
    assert found.moved[2]["mass"] == pytest.approx(2.0 * most * MASS, rel=0.1)
    assert found.moved[2]["viscous.negative"] == pytest.approx(most * VISCOUS, rel=0.1)
    assert half(wide, "mass") > 4.0 * half(constants, "mass")


def test_a_delay_that_no_loop_has_may_be_that_of_one():
    _, constants, found = read(log(late=15.0 * STEP, led=["reference"]))
    assert constants.value("delay") == pytest.approx(15.0 * STEP, abs=STEP)
    assert found.notes == ("14.4 ms is no delay of a loop of 1 ms: a filter may hold it",)
    assert read(log(late=15.0 * STEP))[2].notes == ()  # where the delay is not told
    assert half(found.held_by(constants), "delay") > 14.4 * STEP


def test_limits_reach_as_far_as_the_delays_at_their_ends_bend_the_constants():
    """Of sines the mean of efforts by both ends is smaller by the cosine of the angle: constants with them."""
    made = log()
    parts, constants, _ = read(made)
    fit = fit_equations(parts, TERMS)
    errors = constants.errors.copy()
    errors[constants.names.index("delay")] = 0.02
    unknown = replace(constants, covariance=np.diag(errors**2))
    found = read_otherwise([made], parts, fit, unknown)
    bent = found.least["mass"]
    assert bent == pytest.approx(MASS * (np.cos(2 * np.pi * 1.3 * 0.04) - 1.0), rel=0.4)
    assert half(found.held_by(unknown), "mass") == pytest.approx(abs(bent), rel=0.05)
    assert found.held_by(unknown).values is unknown.values


def test_what_they_leave_open_by_too_much_is_refused():
    made = log()
    parts, constants, found = read(made)
    wide = replace(constants, covariance=constants.covariance + np.diag([1.0, *np.zeros(len(constants.names) - 1)]))
    (refused,) = look_at_readings(wide, parts, [], found.left_open)
    assert (refused.subject, refused.constants) == ("depends on the reading", ("mass",))
    assert refused.text == "mass 2.001 +- 2 kg, as the log leaves open how late the effort is"
    assert not [*look_at_readings(wide, parts, [refused], found.left_open)]
    assert not [*look_at_readings(constants, parts, [], found.left_open)]


def test_the_notes_of_an_identification_say_so():
    rows = np.random.default_rng(4).random(len(T)) < 0.1
    found = identify([log(np.cumsum(STEP * np.where(rows, 1.1, 1.0)))])
    assert any("steps of the time are not even" in note for note in found.notes)
    assert not any("steps of the time" in note for note in identify([log()]).notes)
