"""Microsteps: finer pulses of the same motor, at the same speeds and with the same torque; friction takes them away."""

import math

import pytest
from tests.remedies import check_caution

from detent.methods.stepper_envelope.build import build_stepper, make_tables, start_hz, stepper_motor
from detent.methods.stepper_envelope.checks import find_cautions
from detent.methods.stepper_envelope.derive import MotorFigures, derive
from detent.methods.stepper_envelope.run import run_stage
from detent.methods.stepper_envelope.stage_job import StageJob, StageMove

A = "stepper.group_a"
SIXTEEN = (f"{A}.drive.microsteps=16", f"{A}.limits.speed=15 mm/s", "controller.timer=12 MHz")
WHOLE = (f"{A}.limits.speed=15 mm/s", "controller.timer=12 MHz")


@pytest.fixture
def both(load_text, good_text):
    """The motor on full steps and on sixteenths."""
    return tuple(load_text(good_text, *overrides).spec for overrides in (WHOLE, SIXTEEN))


def run(spec, place):
    return run_stage(
        spec, StageJob("a move", "moves", (StageMove(1, 0, targets={"group_a": place}),), ("group_a",), ())
    )


def test_a_pulse_is_a_sixteenth_of_a_step_at_the_same_speeds(both):
    whole, fine = (spec.stepper["group_a"] for spec in both)
    assert fine.step == whole.step / 16
    assert fine.steps == 16 * whole.steps
    assert fine.max_hz == pytest.approx(16 * whole.max_hz)
    assert start_hz(fine) * fine.step == pytest.approx(start_hz(whole) * whole.step)


def test_torque_and_swing_are_those_of_the_motor(both):
    whole, fine = (stepper_motor(spec.stepper["group_a"]) for spec in both)
    for hz in (0.0, 500.0, 2500.0):
        assert fine.pull_out(16 * hz) == whole.pull_out(hz)
    assert (fine.natural_hz, fine.inertia) == (whole.natural_hz, whole.inertia)
    torques = [fine.acceleration_limit(math.inf)(16 * 1000.0), whole.acceleration_limit(math.inf)(1000.0)]
    assert torques[0] == pytest.approx(16 * torques[1])


def test_a_microstep_has_the_torque_of_its_angle(both):
    whole, fine = (MotorFigures(spec, "group_a") for spec in both)
    assert fine.motor.incremental_torque == pytest.approx(0.06 * math.sin(math.radians(90 / 16)))
    assert whole.motor.incremental_torque == pytest.approx(0.06)
    names = [{figure.name for figure in derive(spec)} for spec in both]
    assert names[1] - names[0] == {"group_a: incremental torque of a microstep"}


@pytest.mark.compiled
def test_places_between_full_steps_are_reached_more_smoothly(both):
    place = 0.01 + 7 * 5e-6 / 16
    whole, fine = (run(spec, place) for spec in both)
    assert whole.done
    assert fine.done
    stops = [one.moves[0].motors["group_a"].stop for one in (whole, fine)]
    assert stops[1] == pytest.approx(place, abs=1e-12)
    assert abs(stops[0] - place) > 1e-6
    lags = [one.moves[0].motors["group_a"].peak_lag for one in (whole, fine)]  # both in full steps
    assert lags[1] < 0.7 * lags[0]
    assert fine.moves[0].ready == pytest.approx(whole.moves[0].ready, rel=0.05)


@pytest.mark.compiled
def test_what_is_lost_is_lost_by_whole_teeth(load_text, good_text):
    weak = (
        "drive.microsteps=8",
        "motor.pull_out_torque=60 mN*m",
        "drive.torque_safety=1",
        "limits.acceleration=4 m/s^2",
        "limits.speed=30 mm/s",
    )
    done = run(load_text(good_text, "controller.timer=12 MHz", *(f"{A}.{one}" for one in weak)).spec, 0.04)
    assert not done.done
    assert done.lost["group_a"] != 0
    assert done.lost["group_a"] % (4 * 8) == 0


def test_friction_above_a_microstep_is_warned_about_with_what_would_do(load_text, good_text):
    finest = (*SIXTEEN[1:], f"{A}.drive.microsteps=64", f"{A}.limits.speed=4 mm/s", f"{A}.zone.near.speed=4 mm/s")
    finest += (f"{A}.zone.far.speed=4 mm/s",)
    name = "group_a: drive.microsteps"

    def found(*more):
        return {caution.name: caution for caution in find_cautions(load_text(good_text, *more).spec)}

    caution = found(*finest)[name]
    check_caution(found, finest, name, caution)
    assert caution.remedy == f"set {A}.drive.microsteps = 15"
    assert 0.06 * math.sin(math.pi / 2 / 15) >= 0.006 > 0.06 * math.sin(math.pi / 2 / 16)


def test_times_of_the_rotor_stay_those_of_full_steps(both):
    params = [build_stepper(spec, "group_a", make_tables(spec.stepper["group_a"])) for spec in both]
    assert params[1].plant.rotor.teeth == params[0].plant.rotor.teeth
    assert params[1].plant.rotor.step_angle == params[0].plant.rotor.step_angle / 16
    assert params[1].plant.tolerance == 16 * params[0].plant.tolerance
    assert params[1].controller.pause == 16 * params[0].controller.pause


@pytest.mark.parametrize("table", ["motor", "mechanics", "limits"])
@pytest.mark.parametrize(("word", "says"), [("microsteps", "move it to"), ("micro_steps", 'did you mean "microsteps"')])
def test_microsteps_in_the_wrong_table_are_told_where_they_belong(load_text, good_text, table, word, says):
    header = f"[{A}.{table}]"
    text = good_text.replace(header, f"{header}\n{word} = 16")
    with pytest.raises(Exception, match=word) as refused:
        load_text(text)
    (problem,) = refused.value.problems
    assert says in problem.remedy
    assert f"[{A}.drive]" in problem.remedy
