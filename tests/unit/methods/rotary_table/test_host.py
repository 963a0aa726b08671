"""Lines between sequence controller and positioner, and what the axis cannot do of a sequence."""

import math

import pytest

import detent
from detent.control.table_positioner import HOLD, JOG, MOVE, POWER_ON
from detent.errors import InputError
from detent.methods.load import load_spec
from detent.methods.rotary_table.host import (
    TableHost,
    check_sequence,
    describe_numbers,
    dial_of,
    dial_speed,
)
from detent.methods.rotary_table.sequence_job import Go, Jog, Repeat, SequenceJob, Wait
from detent.methods.rotary_table.system import TICK

pytestmark = pytest.mark.compiled

SPEED = math.radians(30)


def table(*overrides):
    return load_spec(detent.example("rotary_table.toml"), overrides)


@pytest.fixture
def host():
    made = TableHost(table("mechanics.start_angle=10 deg"))
    made.start()
    return made


def positioner(host):
    return host.machine.state.controller.positioner


def test_the_machine_stands_where_the_axis_file_says():
    spec = table("mechanics.start_angle=200 deg", "method.task_phase=3 ms", "detector.seed=7")
    machine = TableHost(spec).machine
    motor = machine.state.plant.train.motor
    assert (motor.turns + motor.angle / (2 * math.pi)) / spec.ratio * 360 == pytest.approx(200, abs=360 / spec.period)
    assert motor.velocity == 0.0
    assert (machine.state.controller.clocks.task, machine.tick) == (30, TICK)
    assert machine.state.plant.fine.state == 7
    assert machine.state.controller.positioner.state == POWER_ON
    machine.pass_ticks(3)
    assert machine.state.controller.positioner.state == HOLD


def test_it_is_ready_after_the_first_interrupt(host):
    assert host.machine.time == pytest.approx(0.3e-3)  # the tick of the interrupt, 0.2 ms, is over
    assert (positioner(host).state, host.is_moving, host.at_rest, host.in_position) == (HOLD, False, False, True)


def test_a_button_is_held_until_it_is_released(host):
    host.press(-1, SPEED)
    assert (positioner(host).plus, positioner(host).minus) == (0, 1)
    assert positioner(host).dial == dial_of(host.spec, SPEED)
    host.machine.pass_ticks(5000)
    assert (positioner(host).state, host.is_moving) == (JOG, True)
    assert positioner(host).angle.position < round(10 / 360 * host.spec.period)
    host.release()
    assert (positioner(host).plus, positioner(host).minus) == (0, 0)
    host.machine.pass_ticks(50_000)
    assert (host.at_rest, host.is_moving) == (True, False)
    host.acknowledge()
    assert not host.at_rest
    host.press(1, SPEED)
    assert (positioner(host).plus, positioner(host).minus) == (1, 0)


def test_a_positioning_is_taken_by_the_next_task_and_says_when_it_is_there(host):
    host.begin(1)
    assert positioner(host).start
    host.machine.pass_ticks(200)
    assert (positioner(host).start, host.refusal, positioner(host).state) == (0, "", MOVE)
    assert host.way == pytest.approx(math.radians(80), abs=2 * host.spec.count)
    host.machine.pass_ticks(100_000)
    assert (host.at_rest, host.in_position, positioner(host).refused) == (True, True, 0)
    assert host.way <= 2 * host.spec.count


@pytest.mark.parametrize(("number", "text"), [(0, "the table was still moving"), (99, "has no such entry")])
def test_a_refused_start_says_why(host, number, text):
    if number == 0:
        host.press(1, SPEED)
        host.machine.pass_ticks(1000)
    host.begin(number)
    host.machine.pass_ticks(400)
    assert not positioner(host).start
    assert text in host.refusal
    assert positioner(host).refused == 1


def test_a_refusal_is_forgotten_with_the_next_start(host):
    host.begin(99)
    host.machine.pass_ticks(400)
    host.begin(1)
    assert host.refusal == ""


def test_a_way_too_far_is_refused(host):
    host.machine.params.controller.positioner.pdt.policy[1] = 3  # as commanded
    host.machine.params.controller.positioner.pdt.angle[1] = 1 << 40
    host.begin(1)
    host.machine.pass_ticks(400)
    assert host.refusal.startswith("the distance exceeds the range of the remaining angle")


def test_limits_of_time_are_generous_but_not_endless(host):
    took = 80 / 30 + 0.1  # of a positioning by 80 degrees
    assert took < host.move_time(math.radians(80), SPEED) < 4 * took
    assert 0.1 < host.stop_time(SPEED) < 2.0
    assert host.settling_time == pytest.approx(10 / 30)


@pytest.mark.parametrize(("degrees", "steps"), [(60, 8053064), (0.1, 13422), (1e-5, 1), (1e-6, 0)])
def test_the_dial_has_steps(degrees, steps):
    spec = table()
    speed = math.radians(degrees)
    assert dial_of(spec, speed) == steps
    assert dial_speed(spec, speed) == pytest.approx(steps * spec.count / 65536 / 2e-3)
    assert dial_speed(spec, None) == pytest.approx(math.radians(60))


# -- checks -------------------------------------------------------------------------------------------------


def refusal(steps, *overrides, inputs=None):
    with pytest.raises(InputError) as caught:
        check_sequence(table(*overrides), SequenceJob("job.toml", tuple(steps), inputs or {}))
    assert all(p.file == "job.toml" and p.allowed and p.remedy for p in caught.value.problems)
    return caught.value.problems


def test_a_sequence_that_the_axis_can_do_is_not_refused():
    fast = table().limits.speed
    check_sequence(table(), SequenceJob("job", (Go(4), Jog(1, fast, duration=0.02), Jog(-1, 1e-6, duration=1.0))))


def test_a_position_without_an_entry_is_told_with_those_that_exist():
    (problem,) = refusal([Go(4, row=3), Go(7, row=5)])
    assert (problem.line, problem.key, problem.got) == (5, "step.go", "position number 7")
    assert problem.allowed == "the position numbers of the axis: 0 to 4"
    assert problem.remedy == "name one of these, or add [position.7] to the axis file"


def test_a_jog_above_the_limit_is_told_the_speed_that_will_do():
    (problem,) = refusal([Jog(1, math.radians(61), duration=1.0, row=2)])
    assert (problem.key, problem.got) == ("step.speed", "61 deg/s")
    assert problem.allowed == "up to limits.speed, 60 deg/s"
    assert problem.remedy == 'write speed = "60 deg/s", or raise limits.speed'
    check_sequence(table(), SequenceJob("job", (Jog(1, table().limits.speed, duration=1.0),)))


def test_a_jog_below_a_step_of_the_dial_is_told_the_speed_that_will_do():
    slow = table("method.fraction_bits=0")
    (problem,) = refusal([Jog(1, math.radians(0.1), duration=1.0)], "method.fraction_bits=0")
    assert (problem.line, problem.key, problem.got) == (0, "step[1].speed", "0.1 deg/s")
    assert 'write speed = "0.4883 deg/s"' in problem.remedy  # a count per interrupt of 2 ms
    assert dial_of(slow, math.radians(0.4883)) == 1


def test_a_jog_that_the_task_could_miss_is_told():
    (problem,) = refusal([Go(1, row=1), Jog(1, duration=0.015, row=9)])
    assert (problem.line, problem.key, problem.got) == (9, "step.for", "15 ms")
    assert 'write for = "20 ms"' in problem.remedy
    (problem,) = refusal([Jog(1, duration=0.5)], "method.task_period=1 s")
    assert 'write for = "1 s"' in problem.remedy


def test_everything_is_told_at_once_what_is_wrong_with_any_axis_too():
    steps = [Go(9, row=1), Jog(1, 9.0, duration=1.0, row=2), Wait(signal="x", row=3), Repeat("y", 2, row=4)]
    problems = refusal(steps)
    assert [(p.line, p.key) for p in problems] == [
        (1, "step.go"), (2, "step.speed"), (3, "step.wait_for"), (4, "step.repeat"),
    ]  # fmt: skip
    assert len(refusal([Go(9, row=row) for row in range(1, 100)])) == 20


def test_a_job_made_without_steps():
    (problem,) = refusal([])
    assert problem.got == "no steps"


@pytest.mark.parametrize(
    ("numbers", "text"),
    [
        ([], "no number: the axis has no positions"),
        ([5], "the position numbers of the axis: 5"),
        ([1, 2, 9, 10, 11, 127], "the position numbers of the axis: 1, 2, 9 to 11, 127"),
    ],
)
def test_numbers_for_people(numbers, text):
    assert describe_numbers(numbers) == text
