"""The stepper envelope for every motor, load, zone map, extreme and edit.

Hypothesis looks for edge cases and shrinks what it finds; thousands of numbered cases run through the rest. Motors are
drawn inside the margin that `step_motors` states.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from tests.property.numbered_cases import asked_numbers, run_numbers
from tests.property.step_cases import (
    PEAK_LAG,
    StepCase,
    assert_feasible,
    judge_steps,
    run_case,
    speed_limits,
    tables_of,
)
from tests.property.step_motors import START, Axis, is_inside_margin, spare_acceleration
from tests.stepper_rig import A_LIN, LOAD, MAX_HZ, MOTOR, RAMP, Rig, heavier

from detent.control.step_rule import FAULT, REST
from detent.planning.step_envelope import MAX_RAMP, StepEnvelope, Zone, ZoneMap
from detent.planning.step_ramp import FirstOrderPullOut, StepperMotor, make_ramp, natural_frequency

pytestmark = pytest.mark.early

MOST = 700
"""Steps of a travel."""


@st.composite
def axes(draw: st.DrawFn) -> Axis:
    """Any size of motor: torque, inertia, current rise, friction, load."""
    torque = draw(st.floats(0.02, 2.0))
    inertia = draw(st.floats(0.3, 3.0)) * MOTOR.rotor_inertia * torque / MOTOR.holding_torque
    load = heavier(
        LOAD,
        spindle_inertia=draw(st.floats(0.0, 3.0)) * inertia,
        coupling_inertia=0.0,
        friction_torque=draw(st.floats(0.0, 0.1)) * torque,
        mass=0.0,
    )
    natural = natural_frequency(200, torque, inertia + load.inertia)
    pull_out = FirstOrderPullOut(0.75 * torque, draw(st.floats(3.1, 12.0)) * natural)
    motor = StepperMotor(200, inertia, torque, pull_out, 900.0, **load.of_motor)
    start = draw(st.floats(0.3, START)) * natural
    top = start * draw(st.floats(1.0, 12.0))
    spare = spare_acceleration(motor, top)
    assume(spare > 0)
    acceleration = motor.acceleration_limit(draw(st.floats(0.05, 1.5)) * spare)
    assume(acceleration(start) > 0)
    ramp = make_ramp(start, top, acceleration)
    assume(len(ramp) <= MAX_RAMP)
    assume(is_inside_margin(motor, ramp))
    return Axis(motor, ramp, natural, top)


@st.composite
def zone_lists(draw: st.DrawFn, steps: int, top: float) -> tuple[Zone, ...]:
    """Up to four zones, neighbours included."""
    edges = sorted(draw(st.sets(st.integers(0, steps), max_size=8)))
    places = list(zip(edges[::2], edges[1::2], strict=False))
    if draw(st.booleans()):
        places = list(pairwise(edges))[:4]
    return tuple(Zone(begin, end, max(1.0, top * draw(st.floats(0.02, 1.1)))) for begin, end in places)


@settings(max_examples=150, derandomize=True)
@given(st.data())
def test_every_table_keeps_the_limits_and_every_edit_gives_the_table_built_anew(data):
    axis = data.draw(axes())
    steps = data.draw(st.integers(1, MOST))
    zones = ZoneMap(steps, float(axis.ramp.hz[-1]), data.draw(zone_lists(steps, float(axis.ramp.hz[-1]))))
    places = st.integers(0, steps)
    table = StepEnvelope(axis.ramp, zones, data.draw(st.sampled_from((1, -1))), data.draw(places), data.draw(places))
    assert_feasible(table)
    for place, at_start in data.draw(st.lists(st.tuples(places, st.booleans()), max_size=4)):
        if at_start:
            assert table.move_start(place) <= 4 * len(axis.ramp)
        else:
            assert table.move_stop(place).written <= 2 * len(axis.ramp)
        assert_feasible(table)
        anew = StepEnvelope(axis.ramp, zones, table.direction, table.start, table.stop)
        assert table.entries.tolist() == anew.entries.tolist()


def make_rig(draw: st.DataObject, axis: Axis, steps: int, zones: tuple[Zone, ...]) -> Rig:
    """A motor at rest somewhere on the travel, with any turn above and any stop below it."""
    at = draw.draw(st.integers(0, steps), label="at")
    return Rig(
        steps,
        zones,
        turn=draw.draw(st.integers(at, steps), label="turn"),
        stop=draw.draw(st.integers(0, at), label="stop"),
        at=at,
        max_hz=float(axis.ramp.hz[-1]),
        ramp=axis.ramp,
        motor=axis.motor,
        reload=draw.draw(st.booleans(), label="reload"),
        pause=draw.draw(st.integers(int(axis.must_wait), 1), label="pause"),
    )


def edit_on_the_way(data: st.DataObject, rig: Rig) -> int:
    """Stop the run somewhere, move its stop, maybe twice; returns the position it must end on."""
    stop = rig.up.stop
    for _ in range(data.draw(st.integers(0, 2), label="edits")):
        begin = rig.position
        if begin >= stop - 1:
            break
        rig.run_to(data.draw(st.integers(begin + 1, stop - 1), label="edit at"))
        edit = rig.edit_stop(data.draw(st.integers(0, rig.zones.steps), label="new stop"))
        rig.down.move_start(edit.stop)
        assert edit.stop >= rig.position
        stop = edit.stop
    return stop


def run_once(data: st.DataObject, axis: Axis) -> None:
    """One run up, with edits, and perhaps down again: where it ends, how fast it was, what it lost."""
    steps = data.draw(st.integers(1, MOST), label="steps")
    zones = data.draw(zone_lists(steps, float(axis.ramp.hz[-1])), label="zones")
    rig = make_rig(data, axis, steps, zones)
    twice = data.draw(st.booleans(), label="turn around")
    rig.start(1, int(twice))
    stop = edit_on_the_way(data, rig)
    rig.run()
    assert rig.rule.state == REST
    assert rig.position == (min(rig.down.stop, stop) if twice else stop)
    assert rig.lost == 0
    assert rig.rotor.peak_lag < PEAK_LAG


@settings(max_examples=60, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
@given(st.data())
@pytest.mark.compiled
def test_no_step_is_lost_and_every_stop_is_on_its_place(data):
    run_once(data, data.draw(axes()))


@settings(max_examples=2000, suppress_health_check=[HealthCheck.too_slow])
@given(st.data())
@pytest.mark.long
def test_no_step_is_lost_and_every_stop_is_on_its_place_two_thousand_times(data):
    run_once(data, data.draw(axes()))


# ------------------------------------------------------------------------------------------------------ numbered cases

KINDS = (
    "FirstOrderPullOut",
    "WindingPullOut",
    "MeasuredPullOut",
    "reload",
    "overrun",
    "inwards",
    "outwards",
    "inwards braking",
    "outwards braking",
    "edit at rest",
    "start moved on the way",
    "turned about at speed",
    "let go",
)


def test_the_default_motor_lies_inside_the_margin_and_not_far_inside():
    assert is_inside_margin(MOTOR, RAMP)
    assert not is_inside_margin(replace(MOTOR, **heavier(LOAD, friction_torque=0.0061).of_motor), RAMP)
    assert not is_inside_margin(replace(MOTOR, **heavier(LOAD, spindle_inertia=1.5e-7).of_motor), RAMP)
    assert not is_inside_margin(MOTOR, make_ramp(410, MAX_HZ, MOTOR.acceleration_limit(A_LIN)))
    assert not is_inside_margin(replace(MOTOR, pull_out=FirstOrderPullOut(0.045, 800.0)), RAMP)


@pytest.mark.wide
@pytest.mark.compiled
def test_two_thousand_numbered_steppers():
    met = run_numbers(run_case, range(2000))
    assert met["legs"] > 2000
    assert {kind: met[kind] for kind in KINDS if met[kind] < 50} == {}


@pytest.mark.long
def test_as_many_numbered_steppers_as_asked_for():
    numbers = asked_numbers()
    assert run_numbers(run_case, numbers)["cases"] == len(numbers) > 0


@pytest.mark.compiled
def test_the_judge_sees_what_is_lost_four_times_as_fast():
    lost = 0
    for number in range(100):
        case = StepCase(number)
        case.rig.p.controller.instant_ticks *= 4
        try:
            case.run()
        except AssertionError as error:
            lost += "lost" in str(error) or "lagged" in str(error)
    assert lost > 40


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("field", "change", "fault"),
    [
        ("hz", lambda hz: hz * 1.001, "faster than its zone"),
        ("index", lambda index: index + 1, "at speed"),
        ("index", lambda index: 2 * index, "more than one"),
        ("position", lambda position: position + 1, "leaves the travel"),
        ("state", lambda state: np.where(state == state[0], FAULT, state), "a fault"),
    ],
)
def test_the_judge_sees_a_step_that_is_not_allowed(field, change, fault):
    rig = Rig(100, [Zone(30, 50, 700.0)]).log_steps(MAX_HZ)
    rig.start().run()
    course, tables = rig.logged(), [tables_of(rig)]
    judge_steps(rig, course, [0, 100], tables)
    with pytest.raises(AssertionError, match=fault):
        judge_steps(rig, replace(course, **{field: change(getattr(course, field))}), [0, 100], tables)


@settings(max_examples=100, derandomize=True)
@given(st.data())
@pytest.mark.compiled
def test_whatever_the_operator_does_the_limits_hold(data):
    steps = data.draw(st.integers(1, MOST))
    zones = data.draw(zone_lists(steps, MAX_HZ))
    rig = Rig(steps, zones, at=data.draw(st.integers(0, steps)), stop=0)
    limit = speed_limits(rig.zones)
    index = -1
    for _ in range(data.draw(st.integers(1, 12))):
        rig.joystick(data.draw(st.sampled_from((0.0, 300.0, 1990.0, MAX_HZ))), data.draw(st.sampled_from((1, -1))))
        course = rig.course(data.draw(st.integers(1, 200)))
        interval = np.where(course.direction > 0, course.position, course.position - 1)
        # The timer's periods are whole ns, and the ramp's words whole Hz.
        assert (course.hz <= limit[interval] * (1 + 1e-5)).all()
        path = np.concatenate([[index], course.index])
        turned = np.flatnonzero(np.diff(np.concatenate([course.direction[:1], course.direction])))
        assert (course.index[turned] == 0).all()
        assert np.abs(np.diff(path)).max(initial=0) <= 1
        index = rig.rule.index
        assert 0 <= rig.position <= steps
        assert rig.rule.state != FAULT
    rig.joystick(0)
    rig.course()
    assert rig.resting
