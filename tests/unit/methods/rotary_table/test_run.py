"""Sequences on the rotary table: the example's story, what fails and why, and one result however it is run."""

import hashlib
import json
import math
import os
import subprocess
import sys
from itertools import pairwise

import numba
import numpy as np
import pytest
from tests.places import ROOT

import detent
from detent.errors import InputError
from detent.methods.load import load_spec
from detent.methods.rotary_table.host import TableHost
from detent.methods.rotary_table.run import SEQUENCE_SIGNALS, TableObserver, describe_step, run_sequence
from detent.methods.rotary_table.sequence_file import load_sequence
from detent.methods.rotary_table.sequence_job import Go, Jog, Output, Repeat, SequenceJob, Wait
from detent.methods.rotary_table.system import TICK, RotaryTable
from detent.record.recorder import Recorder, choose_leaves

pytestmark = pytest.mark.compiled

EXAMPLE = ROOT / "src/detent/examples/index_sequence.toml"
FAST = math.radians(60)

# Positions as a conventional unit goes to them: the forms without a turn counter know no other way.
CONVENTIONAL = tuple(f"position.{number}.direction=as commanded" for number in range(5))
UNGUARDED = (
    "protection.following_time=0 s", "protection.stuck_time=0 s", "protection.reversed_time=0 s",
    "protection.overspeed=0", "protection.jump=0",
)  # fmt: skip


def table(*overrides):
    return load_spec(detent.example("rotary_table.toml"), overrides)


def run(*steps, over=(), **inputs):
    return run_sequence(table(*over), SequenceJob("job", steps, inputs))


def degrees(angle):
    return math.degrees(angle)


@pytest.fixture(scope="module")
def story():
    return run_sequence(table(), load_sequence(EXAMPLE))


# -- the example --------------------------------------------------------------------------------------------


def test_the_example_comes_to_its_end(story):
    assert (story.done, story.failure, story.warnings, story.refused) == (True, "", [], 0)
    assert len(story.steps) == story.job.count == 30
    assert [step.number for step in story.steps] == list(range(1, 31))
    assert [step.index for step in story.steps] == [index for index, _ in story.job.actions()]


def test_steps_adjoin_in_time_and_angle(story):
    assert story.steps[0].begin == story.time_ready == pytest.approx(0.3e-3)
    assert story.steps[-1].end == story.time_end
    for before, after in pairwise(story.steps):
        assert before.end == after.begin
        assert before.stop == after.start
    for step in story.steps:
        assert step.travel == step.stop - step.start
        assert step.begin <= step.end


def test_every_positioning_ends_in_position(story):
    goes = [step for step in story.steps if step.kind == "go"]
    targets = [degrees(step.target) % 360 for step in goes]
    assert targets == pytest.approx(2 * [0, 90, 180] + [350, 10], abs=1e-9)
    # The window is two counts; a count is read from its beginning to its end.
    assert 0 < story.worst_error < 3 * story.count
    assert story.in_position == 2 * story.count


def test_the_table_is_clamped_for_half_a_second_at_each_station(story):
    assert len(story.outputs) == 12
    assert [on for _, _, on in story.outputs] == 6 * [True, False]
    assert {name for _, name, _ in story.outputs} == {"clamp"}
    for (closed, _, _), (opened, _, _) in zip(story.outputs[::2], story.outputs[1::2], strict=True):
        assert opened - closed == pytest.approx(0.5, abs=1e-9)
        (station,) = [step for step in story.steps if step.end == closed and step.kind == "go"]
        assert abs(station.error) < 3 * story.count


def test_inputs_come_when_the_job_says(story):
    got = [(round(time - story.time_ready, 9), name, on) for time, name, on in story.inputs]
    stretches = [
        (time, name, on)
        for name, ((begin, end),) in story.job.inputs.items()
        for time, on in ((begin, True), (end, False))
    ]
    assert got == stretches  # in order in the file too


def test_the_jog_lasts_as_long_as_its_signal_and_goes_over_the_end_of_the_turn(story):
    jog = next(step for step in story.steps if step.kind == "jog")
    ((begin, end),) = story.job.inputs["feed"]
    assert degrees(jog.travel) == pytest.approx(60 * (end - begin), abs=1.3)  # up to the task's next pass
    assert jog.begin < begin < end < jog.end
    # 180 deg to 1020 deg: over 360 and 720; each time less than a turn remains, a rollover.
    assert (jog.crossings, jog.rollovers) == (2, 2)
    assert degrees(jog.peak_deviation) == pytest.approx(2.17, abs=0.02)  # 60/30 deg, more by the droop and the start
    assert degrees(jog.peak_speed) == pytest.approx(61.2, abs=0.1)


def test_the_slow_jog_keeps_its_speed(story):
    slow = [step for step in story.steps if step.kind == "jog"][1]
    assert degrees(slow.travel) == pytest.approx(-0.5 * 3, abs=0.011)
    assert degrees(slow.peak_speed) < 0.7


def test_the_last_station_is_reached_by_the_short_way(story):
    last = [step for step in story.steps if step.kind == "go"][-1]
    assert degrees(last.travel) == pytest.approx(20, abs=0.003)
    assert last.crossings == 1
    assert story.steps[-1].crossings == 1  # and the jog after it leads back again


def test_totals(story):
    assert story.travel == pytest.approx(sum(abs(step.travel) for step in story.steps))
    net = degrees(story.steps[-1].stop - story.steps[0].start)
    assert net == pytest.approx(1070 - 10, abs=0.5)
    assert story.turns == 2
    assert story.position == pytest.approx(degrees(story.steps[-1].stop) / 360 * 368640, abs=1)
    assert story.crossings == sum(step.crossings for step in story.steps) == 8
    assert story.rollovers == 2
    assert story.peak_deviation == max(step.peak_deviation for step in story.steps)


def test_the_loop_in_the_file_tells_what_each_step_is(story):
    texts = [step.text for step in story.steps]
    assert texts[:4] == ["go to position 0 (0 deg, shortest)", 'set "clamp"', "wait 500 ms", 'clear "clamp"']
    assert texts[8] == "go to position 2 (180 deg, positive)"
    assert texts[24:27] == ['jog + at 60 deg/s while "feed"', 'jog - at 0.5 deg/s while "inch"', 'wait for "ready"']
    assert texts[-1] == "jog - at 10 deg/s for 2 s"


def test_it_is_plain_data(story):
    found = json.loads(json.dumps(story.to_dict()))
    assert (found["job"], found["kind"], found["done"]) == ("index_sequence.toml", "sequence", True)
    assert found["steps"][0]["error"] == story.steps[0].error
    assert math.isnan(found["steps"][1]["target"])  # an output
    assert found["outputs"][0] == {"time": story.outputs[0][0], "name": "clamp", "on": True}
    assert len(found["inputs"]) == 6


# -- the records --------------------------------------------------------------------------------------------


def test_texts_of_the_other_steps():
    spec = table()
    assert describe_step(spec, Wait(signal="a", level=False)) == 'wait for the end of "a"'
    assert describe_step(spec, Jog(1, duration=0.25)) == "jog + at 60 deg/s for 250 ms"
    coarse = table("method.fraction_bits=4")
    assert describe_step(coarse, Jog(1, math.radians(0.1), duration=1.0)) == "jog + at 0.09155 deg/s for 1 s"
    flag = table("method.form=flag", *CONVENTIONAL)
    assert describe_step(flag, Go(2)) == "go to position 2 (180 deg, as commanded)"


def test_angles_go_on_over_turns_either_way():
    found = run(Jog(-1, duration=20.0), Go(0), Jog(1, duration=40.0), Go(0))
    stops = [degrees(step.stop) for step in found.steps]
    assert stops == pytest.approx([10 - 1200, -1080, -1080 + 2400, 1440], abs=1.3)
    assert stops[1::2] == pytest.approx([-1080, 1440], abs=3 * degrees(found.count))
    assert found.steps[1].target == pytest.approx(-3 * 2 * math.pi)
    assert [step.kind for step in found.steps] == ["jog", "go", "jog", "go"]
    assert found.turns == int((stops[-1] - 10) / 360)
    assert found.position * 360 / 368640 == pytest.approx(stops[-1], abs=0.002)


def test_an_hour_of_jogging_loses_no_count():
    found = run(Jog(1, duration=3600.0), Go(4))
    assert found.done
    assert found.turns == 600
    assert degrees(found.steps[0].travel) == pytest.approx(216_000, abs=1.3)
    assert abs(found.steps[1].error) < 3 * found.count
    # The judge fires in the pass after each whole turn of the command; the last turn ends with the release.
    assert (found.rollovers, found.crossings) == (599, 600)


def test_a_spike_of_one_interrupt_is_in_the_record():
    """Test 15: an interrupt between the halves of a rollover."""
    race = ("method.update=flag first", "method.task_phase=0.2 ms")
    found = run(Jog(1, duration=7.0), over=race)
    assert found.done
    assert degrees(found.steps[0].peak_deviation) == pytest.approx(362, abs=0.2)
    assert degrees(run(Jog(1, duration=7.0)).steps[0].peak_deviation) < 2.2


def test_backlash_and_eccentricity_are_errors_the_axis_does_not_know():
    found = run(Go(1), over=["mechanics.backlash=0.1 deg", "mechanics.eccentricity=0.5 deg"])
    assert found.done
    # The motor goes 0.075 deg too far (test 21) and takes the table along, less half the backlash; as it comes back the
    # table stays. At 90 deg the table leads by the whole eccentricity.
    assert degrees(found.steps[0].error) == pytest.approx(-(0.075 - 0.05) - 0.5, abs=0.005)


def test_a_sequence_that_ends_before_its_inputs_says_so():
    found = run(Wait(0.5), late=((1.0, 2.0),), cut=((0.1, 2.0),), fine=((0.1, 0.2),))
    assert found.done
    assert found.warnings == ['the sequence ended before all of these inputs had arrived: "late", "cut"']


def test_progress_is_told_by_steps():
    told = []
    job = SequenceJob("job", (Wait(0.01, label="a"), Repeat("a", 4)))
    run_sequence(table(), job, progress=lambda share, text: told.append((share, text)))
    assert told == [(number / 4, f"step {number + 1} of 4, 0 s") for number in range(4)]


def test_progress_is_told_in_a_long_step():
    told = []
    run_sequence(table(), SequenceJob("job", (Wait(400.0),)), progress=lambda share, text: told.append((share, text)))
    assert len(told) == 4
    assert told[0] == (0.0, "step 1 of 1, 0 s")
    assert told[2][1] == "step 1 of 1, 210 s"


def test_what_is_recorded_by_default_exists_and_shows_the_run():
    assert len(choose_leaves(RotaryTable, SEQUENCE_SIGNALS)) == len(SEQUENCE_SIGNALS)
    recorder = Recorder(RotaryTable, SEQUENCE_SIGNALS, every=20, period=TICK)
    found = run_sequence(table(), SequenceJob("job", (Go(1), Jog(-1, duration=5.0))), recorder=recorder)
    trace = recorder.trace()
    assert trace.time[-1] == pytest.approx(found.time_end, abs=21 * TICK)
    one = 2 * math.pi / 2**32
    at_first_end = int(np.searchsorted(trace.time, found.steps[0].end))
    assert trace["plant.table"][at_first_end] * one == pytest.approx(found.steps[0].stop, abs=found.count)
    deviation = np.abs(trace["controller.positioner.dr"]).max() * found.count / 65536
    assert deviation == pytest.approx(found.peak_deviation)


# -- what cannot be done, and what fails ----------------------------------------------------------------------


def test_what_the_axis_cannot_do_is_refused_before_anything_moves():
    with pytest.raises(InputError, match=r"position number 9"):
        run(Go(1), Go(9))


@pytest.mark.parametrize(
    ("start", "over"),
    [
        ("0 deg", ["method.form=flag"]),
        ("100 deg", ["method.form=raw"]),
        ("359.9 deg", ["method.form=flag", "method.judge=actual"]),
    ],
)
def test_a_literal_form_ends_with_what_happened_and_what_to_do(start, over):
    found = run(
        Jog(1, duration=14.0, row=5), Go(1), over=[*over, *CONVENTIONAL, *UNGUARDED, f"mechanics.start_angle={start}"]
    )
    assert not found.done
    assert found.failure.startswith("step 1 of 2 (line 5), jog + at 60 deg/s for 14 s: the table has ")
    assert 'set method.form = "turn counter"' in found.failure
    assert len(found.steps) == 1
    assert found.time_end < 15


def test_a_table_thrown_back_is_told_by_what_it_lost():
    """Test 12: the literal form from 0 deg; the table goes back a turn at each rollover."""
    found = run(
        Jog(1, duration=14.0), over=["method.form=flag", "mechanics.start_angle=0 deg", *CONVENTIONAL, *UNGUARDED]
    )
    assert "the table has turned 120.0" in found.failure
    assert "deg where 840 deg were asked" in found.failure
    assert not math.isnan(found.steps[0].target)  # it came to rest


def test_a_table_that_runs_away_is_stopped_within_a_turn_or_so():
    """Test 11: without extension the deviation jumps by a turn and the table never stops."""
    over = ["method.form=raw", *CONVENTIONAL, *UNGUARDED, "position.3.angle=540 deg", "mechanics.start_angle=100 deg"]
    found = run(Go(3), over=over)
    assert "the table has run away: it has turned " in found.failure
    assert "and turns on at 126.7 deg/s" in found.failure  # the largest word, less the droop
    assert 440 + 360 < degrees(found.steps[0].travel) < 440 + 360 + 127 * 0.26
    jog = run(Jog(1, duration=100.0), over=over)
    assert "has run away" in jog.failure
    assert math.isnan(jog.steps[0].target)
    assert math.isnan(jog.steps[0].error)
    assert math.isnan(jog.to_dict()["steps"][0]["error"])


def test_a_table_that_runs_away_while_it_waits():
    """Test 23: beyond its target the unsigned remaining angle drives the table on."""
    over = ["method.signed_remaining=false", "method.in_position=200"]
    found = run(Go(1), Wait(60.0), over=over)
    assert not found.done
    assert "set method.signed_remaining = true" in found.failure
    assert found.time_end < 30


def test_a_detector_wrong_by_a_motor_turn_is_told():
    found = run(Go(1), over=["detector.coarse.alignment_error=2.2 deg"])
    assert "but is 4.00049 deg below it, 1.0 turns of the motor: the detected angle is wrong" in found.failure
    assert "below half a turn of the motor, 2 deg of the table" in found.failure
    assert degrees(found.steps[0].error) == pytest.approx(4, abs=0.01)
    truncated = ["detector.composition=truncated", "detector.coarse.alignment_error=-0.2 deg"]
    found = run(Go(1), over=[*truncated, "position.1.angle=88 deg"])  # the end of a turn of the motor
    assert not found.done
    assert 'set detector.composition = "rounded"' in found.failure


def test_a_weak_amplifier_does_not_get_there():
    found = run(Go(1), over=["limits.effort=0.02 N*m", *UNGUARDED])
    assert "was not in position within 8.252 s" in found.failure
    assert "limits.effort" in found.failure
    assert found.steps[0].target == pytest.approx(math.pi / 2)


def test_a_jog_that_falls_behind_is_told():
    over = ["disturbance.load.torque=-270 N*m", "disturbance.load.at=0 s", "disturbance.load.duration=100 s"]
    found = run(Jog(1, duration=20.0), over=[*over, *UNGUARDED])
    assert not found.done
    assert "check deviation and torque in the report" in found.failure


def test_a_run_ends_where_its_signal_is_over():
    found = run(Go(1), Jog(1, signal="a", row=8), a=((0.5, 1.0),))
    assert not found.done
    assert found.failure.startswith('step 2 of 2 (line 8), jog + at 60 deg/s while "a": "a" went off for good at 1 s')


# -- the true angle of table and motor, with all turns ------------------------------------------------------


def observed(*overrides):
    spec = load_spec(detent.example("rotary_table.toml"), overrides)
    host = TableHost(spec)
    host.start()
    return host, TableObserver(spec, host.machine)


@pytest.mark.parametrize("turns", [0.0, 89.999, 90.0, -0.001, -90.5, 12345.678, 9e9 + 0.25])
@pytest.mark.parametrize("slack", [0.0, 0.3, -0.3])
def test_the_angle_goes_on_beyond_a_turn(turns, slack):
    host, observer = observed("mechanics.eccentricity=0.01 rad", "mechanics.eccentricity_angle=0.5 rad")
    train = host.machine.state.plant.train
    train.motor.turns, train.motor.angle = math.floor(turns), (turns - math.floor(turns)) * 2 * math.pi
    train.gear.slack = slack
    driven = (turns * math.tau + slack) / host.spec.ratio
    assert observer.angle == pytest.approx(driven + 0.01 * math.sin(driven - 0.5), rel=1e-15, abs=1e-6)


def test_the_angle_is_as_fine_after_a_million_turns():
    host, observer = observed()
    motor = host.machine.state.plant.train.motor
    angles = []
    for turns in (0, 10**6 * host.spec.ratio):
        motor.turns, motor.angle = turns, 1.0
        angles.append(observer.angle)
    assert angles[1] - angles[0] == pytest.approx(1e6 * math.tau, rel=1e-15)


@pytest.mark.parametrize("degrees", [0, 10, 350, -10, -350])
def test_the_angle_at_power_on_is_that_of_the_axis_file_and_so_is_the_target(degrees):
    host, observer = observed(f"mechanics.start_angle={degrees} deg")
    count = host.spec.count
    assert observer.angle == pytest.approx(math.radians(degrees), abs=count)
    assert observer.target == pytest.approx(math.radians(degrees), abs=count)
    assert observer.miss * host.spec.detector.fine.counts == pytest.approx(-0.5)  # it stands in the middle of a count
    position = host.machine.state.controller.positioner.angle.position
    assert position == round(degrees / 360 * host.spec.period) % host.spec.period


def test_angle_and_target_stay_together_over_turns_and_boundaries():
    host, observer = observed("mechanics.start_angle=-10 deg")
    for direction, seconds in ((1, 20.0), (-1, 31.0)):
        host.press(direction, math.radians(60))
        host.machine.pass_time(seconds)
        assert observer.speed == pytest.approx(direction * math.radians(60), rel=1e-3)
        host.release()
        host.machine.pass_time(1.0)
        host.acknowledge()
        host.machine.pass_time(1.0)
        assert abs(observer.miss) * host.spec.detector.fine.counts < 2.5
        assert observer.target == pytest.approx(observer.angle, abs=2.5 * host.spec.count)
    # Each jog goes on up to the task's next pass.
    assert math.degrees(observer.angle) == pytest.approx(-10 + 20 * 60 - 31 * 60, abs=2.5)
    assert host.machine.state.controller.positioner.angle.crossings > 3


def test_a_detector_that_is_wrong_by_a_motor_turn_shows_as_a_miss():
    for error, turns in (("1.8 deg", 0), ("2.2 deg", 1), ("-2.2 deg", -1)):
        _, observer = observed(f"detector.coarse.alignment_error={error}", "mechanics.start_angle=180 deg")
        assert observer.miss == pytest.approx(turns, abs=0.001)


def test_backlash_and_eccentricity_are_in_the_angle_not_in_the_miss():
    spec = load_spec(
        detent.example("rotary_table.toml"), ["mechanics.backlash=0.4 deg", "mechanics.eccentricity=1 deg"]
    )
    machine = TableHost(spec).machine
    machine.pass_ticks(3)
    observer = TableObserver(spec, machine)
    state = machine.state
    state.controller.positioner.dial, state.controller.positioner.plus = round(spec.per_interrupt(1.0)), 1
    machine.pass_time(1.5)  # in the first quarter: the table leads by up to a degree, less the half backlash
    motor = (state.plant.train.motor.turns + state.plant.train.motor.angle / 2 / math.pi) * 360 / spec.ratio
    led = math.sin(math.radians(motor)) - 0.2
    assert math.degrees(observer.angle) - motor == pytest.approx(led, abs=0.01)


# -- one result ---------------------------------------------------------------------------------------------


def run_hash() -> str:
    """Hash of what a short sequence gives, with faults of the plant: steps, signals and a recording of everything."""
    over = (
        "mechanics.start_angle=359 deg", "mechanics.backlash=0.01 deg", "mechanics.eccentricity=0.1 deg",
        "detector.fine.noise=0.2 deg", "mechanics.coulomb=5 mN*m",
    )  # fmt: skip
    spec = table(*over)
    recorder = Recorder(RotaryTable, ["all"], every=7, period=TICK)
    steps = (
        Output("x", on=True),
        Jog(1, FAST, "a"),
        Wait(0.01, label="b"),
        Repeat("b", 2),
        Go(3),
        Output("x", on=False),
    )
    found = run_sequence(spec, SequenceJob("job", steps, {"a": ((0.01, 0.15),)}), recorder=recorder)
    assert found.crossings > 0
    digest = hashlib.sha256(json.dumps(found.to_dict()).encode())
    trace = recorder.trace()
    for name in sorted(trace.columns):
        digest.update(trace[name].tobytes())
    return digest.hexdigest()


def test_the_same_seed_gives_the_same_run_to_the_last_bit():
    assert run_hash() == run_hash()


@pytest.mark.process
@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="compares with compiled code; NUMBA_DISABLE_JIT is set")
def test_a_sequence_gives_the_same_compiled_and_plain():
    program = "from tests.unit.methods.rotary_table.test_run import run_hash; print(run_hash())"
    environment = os.environ | {"PYTHONPATH": f"{ROOT / 'src'}{os.pathsep}{ROOT}", "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == run_hash()
