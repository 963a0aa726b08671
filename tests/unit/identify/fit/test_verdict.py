"""The rules of the verdict, one by one: what is refused, in which words, and what to record instead."""

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.identify_rig import Recorder, make_log

from detent.identify.fit.constants import Constants
from detent.identify.fit.equations import make_kernel, make_run
from detent.identify.fit.free_run import Horizon
from detent.identify.fit.ladder import RUNGS, Climb
from detent.identify.fit.regression import prepare
from detent.identify.fit.verdict import (
    Refusal,
    compare_methods,
    look_at_constants,
    look_at_motion,
    look_at_prediction,
)

RUN = Recorder(seconds=6.0).run()


def prepared(run):
    return prepare(run, make_kernel(10, run.step), "none" if run.reference is None else "reference")


PARTS = [prepared(RUN)]
EFFORT = float(np.sqrt(np.mean(RUN.effort**2)))
TOP = float(np.quantile(np.abs(PARTS[0].motion.velocity), 0.95))


def told(refusals):
    return [(r.subject, r.constants) for r in refusals]


# -- the motion -----------------------------------------------------------------------------------------------


def test_motion_both_ways_is_enough():
    assert [*look_at_motion([RUN], PARTS)] == []


def test_less_than_a_second_of_motion_is_too_short():
    run = RUN.part(0, 300)
    (found,) = look_at_motion([run], [prepared(run)])
    assert (found.subject, found.constants) == ("too short", ())
    assert found.text.startswith("in 0.598 s the axis moves clearly for 0.")
    assert found.record == "record 10 s or more of back-and-forth moves"
    # Several short runs are as good as a long one.
    runs = [RUN.part(k, k + 600) for k in range(0, 2400, 600)]
    assert [*look_at_motion(runs, [prepared(run) for run in runs])] == []


@pytest.mark.parametrize(("sign", "way"), [(1, "larger"), (-1, "smaller")])
def test_motion_one_way_is_refused(sign, way):
    t = np.arange(2000) * 2e-3
    log = make_log(t, {"position": sign * (0.1 * t + 0.02 * np.sin(3 * t)), "force": np.cos(t)})
    run = make_run(log)
    (found,) = look_at_motion([run], [prepared(run)])
    assert (found.subject, found.constants) == ("no reversal", ())
    assert f"towards {way} positions in 100% of the time" in found.text
    assert "friction and a constant force cannot be separated" in found.text
    assert found.record == "record moves in both directions, at two speeds or more"


# -- the constants --------------------------------------------------------------------------------------------

GOOD = {
    "mass": (2.0, 0.01),
    "coulomb.positive": (1.6, 0.01),
    "coulomb.negative": (1.2, 0.01),
    "viscous.positive": (6.0, 0.05),
    "viscous.negative": (4.5, 0.05),
    "delay": (0.004, 1e-4),
}


def constants_with(**changed):
    values = GOOD | {name.replace("_", "."): pair for name, pair in changed.items()}
    errors = np.array([error for _, error in values.values()])
    return Constants(
        tuple(values), np.array([v for v, _ in values.values()]), np.diag(errors**2), np.full(len(errors), 1e6), ""
    )


def look_at(**changed):
    return look_at_constants(RUN, constants_with(**changed), PARTS)


def test_constants_with_narrow_limits_are_trusted():
    assert look_at() == []


def test_a_delay_with_limits_of_more_than_ten_samples_is_refused_alone():
    edge = 10 * RUN.step / 1.96
    assert look_at(delay=(0.004, 0.97 * edge)) == []
    (found,) = look_at(delay=(0.004, 1.03 * edge))
    assert (found.subject, found.constants) == ("not determined by the data", ("delay",))
    assert found.text == "delay 4 +- 21 ms"
    assert found.record == "record moves with short ramps, sampled faster"


@pytest.mark.parametrize("name", ["mass", "coulomb.positive", "viscous.negative", "delay", "loss"])
def test_a_constant_at_an_end_of_the_search_has_no_limits_and_is_refused_once(name):
    """However narrow the residuals make it: 1e-6 of its scale, which no other rule would refuse."""
    found = replace(constants_with(loss=(0.6, 1e-6)), bounded=(name,))
    by_name = {one.name: one for one in found.estimates(RUN)}
    assert math.isinf(by_name[name].half)
    assert all(math.isfinite(one.half) for other, one in by_name.items() if other != name)
    (refusal,) = look_at_constants(RUN, found, PARTS)
    assert (refusal.subject, refusal.constants) == ("at a bound", (name,))
    assert refusal.text.startswith(f"{name} {by_name[name].value:.4g}")


def test_a_negative_mass_refuses_everything():
    found = look_at(mass=(-2.0, 0.01))
    assert ("wrong sign", ()) in told(found)
    first = found[0]
    assert first.text == "the mass is -2 kg: effort and motion have opposite signs"
    assert first.record == "invert the effort or the position in the mapping"


def test_a_mass_that_may_be_none_is_not_known_rather_than_of_the_wrong_sign():
    """Steady speeds tell friction, but the mass not even by its sign: the friction is trusted all the same."""
    assert told(look_at(mass=(-0.01, 0.03))) == [("little acceleration", ("mass",))]


@pytest.mark.parametrize(("error", "refused"), [(0.19, False), (0.22, True)])
def test_a_mass_with_wide_limits_is_refused_alone(error, refused):
    found = look_at(mass=(2.0, error))
    assert told(found) == ([("little acceleration", ("mass",))] if refused else [])
    if refused:
        assert found[0].text == "mass 2 +- 0.43 kg, because there is hardly any acceleration"
        assert found[0].record == "record moves with short ramps"
        assert str(found[0]).startswith("refused: mass: little acceleration")


@pytest.mark.parametrize("name", ["coulomb_positive", "coulomb_negative", "static_positive", "static_negative"])
def test_forces_with_wide_limits_beside_the_effort_are_refused(name):
    edge = 0.15 * EFFORT / 1.96
    assert look_at(**{name: (1.6, 0.97 * edge)}) == []
    (found,) = look_at(**{name: (1.6, 1.03 * edge)})
    dotted = name.replace("_", ".")
    assert (found.subject, found.constants) == ("not determined by the data", (dotted,))
    assert found.text.startswith(f"{dotted} 1.6 +- ")
    assert found.text.endswith(" N")
    assert found.record == "record slow moves in both directions"


@pytest.mark.parametrize("name", ["viscous_positive", "viscous_negative"])
def test_viscous_friction_counts_at_the_top_speed(name):
    edge = 0.15 * EFFORT / 1.96 / TOP
    assert look_at(**{name: (6.0, 0.97 * edge)}) == []
    (found,) = look_at(**{name: (6.0, 1.03 * edge)})
    assert (found.subject, found.constants) == ("not determined by the data", (name.replace("_", "."),))
    assert found.record == "record steady moves at several speeds"


def test_a_constant_of_which_nothing_is_known_has_no_figures():
    (found,) = look_at(coulomb_positive=(1.6, 1e6))
    assert found.text == "coulomb.positive not determined at all"


def test_without_instruments_there_is_no_delay_to_look_at():
    names = [name for name in GOOD if name != "delay"]
    values, errors = np.array([GOOD[n] for n in names]).T
    found = Constants(tuple(names), values, np.diag(errors**2), np.full(len(errors), 1e6), "")
    assert look_at_constants(RUN, found, PARTS) == []


def test_coulomb_friction_of_one_speed_holds_the_viscous_one():
    """A log of one speed gave 3.77 +- 0.05 N by a model without viscous friction, where 2.85 N and 21.5 N s/m act."""
    velocity = np.sign(np.sin(np.linspace(0.0, 40.0, len(PARTS[0].motion.velocity)))) * 0.04
    parts = [replace(PARTS[0], motion=replace(PARTS[0].motion, velocity=velocity))]
    names = ("mass", "coulomb.positive", "coulomb.negative")
    values, errors = np.array([GOOD[n] for n in names]).T
    plain = Constants(names, values, np.diag(errors**2), np.full(len(errors), 1e6), "")
    found = [(r.subject, r.constants) for r in look_at_constants(RUN, plain, parts)]
    assert found == [("one speed", ("coulomb.positive",)), ("one speed", ("coulomb.negative",))]
    assert look_at_constants(RUN, plain, PARTS) == []


def test_an_error_that_nobody_knows_is_no_narrow_one():
    assert told(look_at(mass=(2.0, np.nan))) == [("little acceleration", ("mass",))]
    assert told(look_at(coulomb_positive=(1.6, np.nan))) == [("not determined by the data", ("coulomb.positive",))]


def test_friction_that_would_drive_the_axis_refuses_everything():
    (found,) = look_at(coulomb_positive=(0.5, 0.01), coulomb_negative=(-0.9, 0.01))
    assert (found.subject, found.constants) == ("friction below 0", ())
    assert "-0.4 N, which would drive the axis" in found.text
    assert found.record == "check the sign of the effort and the delay between the signals"
    # A weight may make one of both negative, and errors may make the sum so.
    assert look_at(coulomb_positive=(5.0, 0.01), coulomb_negative=(-3.0, 0.01)) == []
    assert look_at(coulomb_positive=(0.1, 0.05), coulomb_negative=(-0.2, 0.05)) == []


def test_friction_that_falls_with_speed_is_refused_in_its_direction():
    (found,) = look_at(viscous_negative=(-5.0, 0.05))
    assert (found.subject, found.constants) == ("friction below 0", ("viscous.negative",))
    assert found.text == "viscous.negative is -5 N*s/m: friction decreases with speed"
    assert found.record == "record several speeds; check the effort for saturation or delay"
    little = -0.04 * EFFORT / TOP
    assert look_at(viscous_negative=(little, 0.001)) == []


# -- the prediction -------------------------------------------------------------------------------------------


def climb(error, *, taken=True):
    return Climb(RUNGS[1], error, np.full(8, error**2), 1.0, taken, possible=True, fit=None)


def horizon(name, rms, naive, moved=10.0):
    return Horizon(0.5, name, 60, rms, 2 * rms, moved, naive)


def test_a_simulation_far_off_its_travel_is_refused():
    near = [horizon("0.5 s", 0.1, 1.0, 1.0), horizon("2 s", 0.2, 1.0, 1.0), horizon("free run", 0.7, 1.0, 1.0)]
    assert [*look_at_prediction([climb(0.1)], near, [])] == []
    for far in (
        [*near[:2], horizon("free run", 0.82, 1.0, 1.0)],
        [near[0], *(horizon(name, 0.5, 1.0, 1.0) for name in ("1 s", "2 s"))],
        # One length alone may be off by 438 % where the others, and their median, are not.
        [near[0], horizon("1 s", 0.1, 1.0, 1.0), horizon("2 s", 4.38, 1.0, 1.0), near[2]],
    ):
        (found,) = look_at_prediction([climb(0.1)], far, [])
        assert (found.subject, found.constants) == ("simulation is far off", ())
        assert "output-error" in found.record


def constants(coulomb, error):
    return Constants(("coulomb.positive",), np.array([coulomb]), np.array([[error**2]]), np.array([np.inf]), "made")


def test_two_ways_that_disagree():
    """The better predictor is believed, and said; where neither is better the constants are refused."""
    ways = (constants(1.0, 0.1), constants(2.0, 0.1))
    worse, better = [horizon("0.5 s", 0.5, 1.0, 1.0)], [horizon("0.5 s", 0.1, 1.0, 1.0)]
    run = RUN
    said, refused = compare_methods(run, ways, (worse, better))
    assert refused == []
    assert "coulomb.positive 1 +- 0.2 and 2 +- 0.2 N" in said
    assert said.endswith("use it")
    said, (refusal,) = compare_methods(run, ways, (better, worse))
    assert (said, refusal.subject, refusal.constants) == ("", "two ways disagree", ("coulomb.positive",))
    assert compare_methods(run, (ways[0], ways[0]), (better, worse)) == ("", [])


def test_a_model_that_predicts_and_simulates_well_is_trusted():
    assert [*look_at_prediction([climb(0.3)], [horizon("0.1 s", 0.6, 1.0), horizon("0.5 s", 0.1, 1.0)], [])] == []
    assert [*look_at_prediction([climb(0.3)], (), [])] == []


def test_a_model_that_does_not_predict_is_refused():
    (found,) = look_at_prediction([climb(0.1), climb(0.4), climb(0.2, taken=False)], (), [])
    assert (found.subject, found.constants) == ("model does not explain the log", ())
    assert found.text == "the effort on held-out segments is predicted with an error of 40%"
    assert "its sign, unit and delay" in found.record
    assert told([*look_at_prediction([climb(np.nan)], (), [])]) == [("model does not explain the log", ())]


def test_a_model_that_simulates_no_better_than_none_is_refused():
    tested = [horizon("0.1 s", 0.8, 1.0), horizon("0.5 s", 0.9, 1.0)]
    (found,) = look_at_prediction([climb(0.1)], tested, [])
    assert (found.subject, found.constants) == ("model does not explain the log", ())
    assert found.text == "simulated over 0.5 s its error is 0.9, constant velocity gives 1"
    assert found.record == "record with more acceleration, or check the units"
    # One good horizon is enough, and others than the short ones do not count.
    assert [*look_at_prediction([climb(0.1)], [horizon("0.1 s", 0.6, 1.0), horizon("0.5 s", 0.9, 1.0)], [])] == []
    assert [*look_at_prediction([climb(0.1)], [horizon("2 s", 0.9, 1.0), horizon("free run", 2.0, 1.0)], [])] == []
    # Without a mass that is known there is nothing to simulate; without a delay there is.
    unknown = [Refusal("little acceleration", "", "", ("mass",))]
    assert [*look_at_prediction([climb(0.1)], tested, unknown)] == []
    assert told([*look_at_prediction([climb(0.4)], tested, unknown)]) == [("model does not explain the log", ())]
    assert [*look_at_prediction([climb(0.1)], tested, [Refusal("x", "", "", ("delay",))])] == [found]


def test_a_refusal_as_data():
    refusal = Refusal("too short", "why", "what to do", ("mass", "delay"))
    assert refusal.to_dict() == {
        "subject": "too short",
        "text": "why",
        "record": "what to do",
        "constants": ("mass", "delay"),
    }
    assert str(refusal) == "refused: mass, delay: too short: why; try: what to do"
