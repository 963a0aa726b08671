"""Two-speed method: known lines come back with intervals that hold, and what cannot be found is refused in words."""

import numpy as np
import pytest
from tests.log_rig import EMPS, assert_covers, coloured, make_log, quantised, read_emps

from detent.errors import DetentError
from detent.identify.analyse.two_speeds import find_steady, fit_two_speeds

DT = 1e-3
MASS, TRUE = 2.0, {
    "slope.positive": 5.0, "coulomb.positive": 1.5, "slope.negative": 6.0, "coulomb.negative": 1.1,
}  # fmt: skip


def passes(speeds, seconds=0.8, ramp=0.1):
    """Velocity of passes at steady speeds with ramps between them, and its acceleration."""
    knots, level = [0.0], [0.0]
    for speed in speeds:
        knots += [knots[-1] + ramp, knots[-1] + ramp + seconds]
        level += [speed, speed]
    t = np.arange(0.0, knots[-1], DT)
    v = np.interp(t, knots, level)
    return t, v, np.gradient(v, DT)


def record(rng, speeds=(0.1, -0.1, 0.3, -0.3), noise=0.3, bend=None, **shape):
    t, v, a = passes(speeds, **shape)
    friction = np.where(v > 0, 5.0 * v + 1.5, 6.0 * v - 1.1) * (v != 0)
    force = MASS * a + friction + coloured(rng, len(t), noise, 0.9)
    if bend is not None:
        force += bend(v)
    position = quantised(np.cumsum(v) * DT, 1e-6)
    return make_log(t, position=position, force=quantised(force, 0.01))


def test_known_lines_come_back_within_their_intervals():
    found = fit_two_speeds(record(np.random.default_rng(1), noise=0.02))
    assert (found.effort, found.reason) == ("force", "")
    assert {one.name: one.value for one in found.estimates} == pytest.approx(TRUE, rel=0.03)
    assert {one.name: one.unit for one in found.estimates} == {
        name: "N*s/m" if name.startswith("slope") else "N" for name in TRUE
    }
    assert [round(stretch.speed, 3) for stretch in found.positive.stretches] == [0.1, 0.3]
    assert all(stretch.seconds == pytest.approx(0.8, abs=0.05) for stretch in found.negative.stretches)


@pytest.mark.wide
def test_intervals_hold_the_true_value_as_often_as_they_say():
    hits = {name: [] for name in TRUE}
    for seed in range(200):
        for one in fit_two_speeds(record(np.random.default_rng(seed))).estimates:
            hits[one.name].append(one.holds(TRUE[one.name]))
    for name in TRUE:
        assert len(hits[name]) == 200
        assert_covers(hits[name])


@pytest.mark.wide
def test_intervals_of_a_line_through_many_speeds_hold_as_well():
    speeds = (0.05, -0.05, 0.1, -0.1, 0.2, -0.2, 0.3, -0.3)
    hits = [
        one.holds(TRUE[one.name])
        for seed in range(150)
        for one in fit_two_speeds(record(np.random.default_rng(seed), speeds, seconds=0.5)).estimates
    ]
    assert len(hits) == 600
    assert_covers(hits)


def test_friction_that_is_no_line_widens_the_intervals_and_is_said():
    speeds = (0.05, -0.05, 0.1, -0.1, 0.2, -0.2, 0.3, -0.3)
    bent = fit_two_speeds(record(np.random.default_rng(2), speeds, 0.02, lambda v: 30 * np.maximum(v, 0) ** 2))
    assert bent.positive.between > 0.05
    assert "scatter about the line" in bent.positive.notes[-1]
    assert bent.negative.between == 0.0
    assert bent.positive.slope.error > 5 * bent.negative.slope.error


def test_a_velocity_signal_and_a_chosen_effort_are_used():
    t, v, _ = passes((0.1, 0.3))
    rng = np.random.default_rng(3)
    log = make_log(
        t, {"velocity": "rad/s"}, velocity=v + coloured(rng, len(t), 1e-3, 0.5), torque=0 * t, voltage=2 * v + 0.4
    )
    found = fit_two_speeds(log, "voltage")
    assert found.positive.slope.value == pytest.approx(2.0, rel=1e-3)
    assert found.positive.slope.unit == "V*s/rad"
    assert found.positive.coulomb.value == pytest.approx(0.4, rel=1e-3)
    assert found.negative.slope is None
    assert found.reason == ""
    assert log.effort() == "torque"


def test_one_speed_or_none_is_refused_in_words():
    rng = np.random.default_rng(4)
    one = fit_two_speeds(record(rng, (0.2, -0.2, 0.205)))
    assert "only one constant speed in the positive direction (0.205 m/s)" in one.positive.reason
    assert "two constant speeds" in one.negative.reason
    assert one.estimates == ()
    t = np.arange(0.0, 4.0, DT)
    shaken = make_log(t, position=0.01 * np.sin(20 * t), force=np.cos(20 * t))
    assert "no constant speed in the positive direction" in fit_two_speeds(shaken).reason
    rest = make_log(t, position=0 * t, force=0 * t)
    assert "no constant speed in the negative direction" in fit_two_speeds(rest).reason
    short = make_log(t[:15], position=t[:15], force=t[:15])
    assert fit_two_speeds(short).estimates == ()


def test_wrong_input_is_an_error():
    t = np.arange(0.0, 1.0, DT)
    with pytest.raises(DetentError, match="something that drives the axis, one of force"):
        fit_two_speeds(make_log(t, position=t))
    with pytest.raises(DetentError, match="expected: current that drives the axis"):
        fit_two_speeds(make_log(t, position=t, force=t), "current")
    with pytest.raises(DetentError, match="a recording with position"):
        fit_two_speeds(make_log(t, force=t))
    with pytest.raises(DetentError, match="at least 3"):
        fit_two_speeds(make_log(t[:2], position=t[:2], force=t[:2]))


def test_a_speed_that_still_settles_is_left_out_and_a_gap_ends_a_stretch():
    t = np.arange(0.0, 3.0, DT)
    v = 0.2 * (1 - np.exp(-t / 0.2)) + 1e-4 * np.random.default_rng(5).standard_normal(len(t))
    (part,) = find_steady(t, v)
    assert 0.5 < t[part.start] < 1.5
    assert part.stop > 2950
    gap = np.where(t > 2.0, t + 0.5, t)
    assert [p.stop <= 2001 or p.start >= 2000 for p in find_steady(gap, v)] == [True, True]


def test_a_coarse_encoder_needs_longer_blocks():
    """At a count in 10 samples, a block whose speed is known to 5 % takes 400 of them."""
    t = np.arange(0.0, 20.0, DT)
    v = np.gradient(quantised(0.1 * t, 1e-3), DT)
    (part,) = find_steady(t, v, step=1e-3)
    assert part.stop - part.start > 15_000
    assert float(v[part].mean()) == pytest.approx(0.1, rel=1e-3)
    assert find_steady(t[:3000], v[:3000], step=1e-3) == []


@pytest.mark.skipif(not EMPS.exists(), reason="the recordings of real machines (../shared/data) are not here")
def test_a_ball_screw_axis():
    """Its three speeds per direction, each found in every cycle; friction rises faster to the left, as published."""
    found = fit_two_speeds(read_emps())
    for line in (found.positive, found.negative):
        assert {round(abs(stretch.speed), 3) for stretch in line.stretches} == {0.042, 0.083, 0.125}
        assert len(line.stretches) == 16
    value = {one.name: one.value for one in found.estimates}
    # A fit to the whole run, starts and stops included, gives 167 and 240 N*s/m, 20.1 and 20.6 N: friction bends.
    assert value == pytest.approx(
        {"slope.positive": 149.6, "coulomb.positive": 21.9, "slope.negative": 223.9, "coulomb.negative": 22.3}, rel=0.01
    )
    assert all(one.relative_error < 0.025 for one in found.estimates)
