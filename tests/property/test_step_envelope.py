"""The stepper envelope for every motor, load, zone map, extreme and edit.

The tables and the rule hold for any ramp. That no step is lost on the rig needs what specification 7.1 states as its
reserve: a pull-out torque of 3/4 of the holding torque and a safety factor of 2 on it, friction up to a tenth of the
holding torque, and a start frequency up to 1.46 times the natural frequency of rotor and field (400 Hz with the
defaults). Motors are drawn inside that reserve.
"""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from tests.stepper_rig import A_LIN, LOAD, MAX_HZ, MOTOR, START_HZ, Rig, heavier, total_inertia

from detent.control.step_rule import FAULT, REST
from detent.planning.pull_out import FirstOrderPullOut
from detent.planning.step_envelope import MAX_RAMP, StepEnvelope, Zone, ZoneMap
from detent.planning.step_ramp import StepperLoad, StepperMotor, StepRamp, acceleration_limit, make_ramp

MOST = 700
"""Steps of a travel."""

NATURAL_HZ = math.sqrt(50 * MOTOR.holding_torque / total_inertia(MOTOR, LOAD)) / (2 * math.pi)
START_RESERVE = START_HZ / NATURAL_HZ
PEAK_LAG = 2.0
"""Steps at which the torque curve falls back: a rotor that stays inside has lost nothing."""


@dataclass(frozen=True)
class Axis:
    """A motor inside the reserve, its load and its ramp."""

    motor: StepperMotor
    load: StepperLoad
    ramp: StepRamp


@st.composite
def axes(draw: st.DrawFn) -> Axis:
    """Any size of motor: torque, inertia, current rise, friction, load."""
    torque = draw(st.floats(0.02, 2.0))
    friction = draw(st.floats(0.0, 0.1)) * torque
    inertia = draw(st.floats(0.3, 3.0)) * MOTOR.rotor_inertia * torque / MOTOR.holding_torque
    pull_out = FirstOrderPullOut(0.75 * torque, draw(st.floats(600.0, 2400.0)))
    motor = StepperMotor(200, inertia, torque, pull_out, 900.0)
    load = heavier(
        LOAD,
        spindle_inertia=draw(st.floats(0.0, 3.0)) * inertia,
        coupling_inertia=0.0,
        friction_torque=friction,
        mass=0.0,
    )
    natural = math.sqrt(50 * torque / total_inertia(motor, load)) / (2 * math.pi)
    start = draw(st.floats(0.3, START_RESERVE)) * natural
    top = start * draw(st.floats(1.0, 12.0))
    acceleration = acceleration_limit(motor, load, draw(st.floats(0.1, 1.5)) * A_LIN)
    assume(acceleration(start) > 0)
    ramp = make_ramp(start, top, acceleration)
    assume(len(ramp) <= MAX_RAMP)
    return Axis(motor, load, ramp)


@st.composite
def zone_lists(draw: st.DrawFn, steps: int, top: float) -> tuple[Zone, ...]:
    """Up to four zones, neighbours included."""
    edges = sorted(draw(st.sets(st.integers(0, steps), max_size=8)))
    places = list(zip(edges[::2], edges[1::2], strict=False))
    if draw(st.booleans()):
        places = list(pairwise(edges))[:4]
    return tuple(Zone(begin, end, max(1.0, top * draw(st.floats(0.02, 1.1)))) for begin, end in places)


def speed_limits(zones: ZoneMap) -> np.ndarray:
    """Limit of every step, shape (N,) [Hz]."""
    limit = np.full(zones.steps, zones.max_hz)
    for zone in zones.zones:
        limit[zone.begin : zone.end] = zone.max_hz
    return limit


def assert_feasible(table: StepEnvelope) -> None:
    """No entry above its limit; on the way no index rises or falls by more than one; the first and last are 0."""
    along = slice(None, None, table.direction)
    index, hz = table.indices()[along], table.permissible_hz()[along]
    limit = speed_limits(table.zones)[along]
    n = table.steps
    start = table.start if table.direction > 0 else n - table.start
    stop = table.stop if table.direction > 0 else n - table.stop
    assert (hz <= np.minimum(limit, table.ramp.hz[-1])).all()
    if start < stop:
        run = index[start:stop]
        assert run[0] == run[-1] == 0
    if stop < n:
        assert index[stop] == -1
    # Beyond the extremes too, for whoever starts there: from behind the start, and from the stop to the travel's end.
    for run in (index[:stop], index[stop + 1 :]):
        assert (run >= 0).all()
        assert np.abs(np.diff(run)).max(initial=0) <= 1
        assert run[-1:].tolist() in ([], [0])


@settings(max_examples=300, derandomize=True)
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
        load=axis.load,
        reload=draw.draw(st.booleans(), label="reload"),
        pause=draw.draw(st.integers(0, 1), label="pause"),
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
    assert rig.r.rule.state == REST
    assert rig.position == (min(rig.down.stop, stop) if twice else stop)
    assert rig.lost == 0
    assert rig.r.rotor.peak_lag < PEAK_LAG


@settings(max_examples=200, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
@given(st.data())
@pytest.mark.compiled
def test_no_step_is_lost_and_every_stop_is_on_its_place(data):
    run_once(data, data.draw(axes()))


@settings(max_examples=2000, suppress_health_check=[HealthCheck.too_slow])
@given(st.data())
@pytest.mark.long
def test_no_step_is_lost_and_every_stop_is_on_its_place_two_thousand_times(data):
    run_once(data, data.draw(axes()))


@settings(max_examples=200, derandomize=True)
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
        index = rig.r.rule.index
        assert 0 <= rig.position <= steps
        assert rig.r.rule.state != FAULT
    rig.joystick(0)
    rig.course()
    assert rig.resting
