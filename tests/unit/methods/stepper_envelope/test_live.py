"""What a motor is made of for the live loop; what it does there is among the acceptance tests."""

import pytest
from tests.acceptance.test_golden_bits import EXAMPLES
from tests.live_axes import Stepper

from detent.control import operation as ops
from detent.control.operation import DONE, NOT_KNOWN, REFERENCED, REFUSED, Operation, OperationParams
from detent.errors import DetentError
from detent.methods.load import load_spec
from detent.methods.registry import METHODS
from detent.methods.stepper_envelope.live import end_of, live, word_of
from detent.operate.host import Host


def operation(look, window, limits, *motions):
    takes = sum(1 << kind for kind in motions)
    return OperationParams(window_looks=round(window / look), lowest=limits[0], highest=limits[1], takes=takes)


def test_each_motor_of_a_file_is_an_axis_of_its_own():
    motors = live(load_spec(EXAMPLES / "zoom.toml", ()), operation)
    assert list(motors) == ["group_a", "group_b"]
    assert [one.live.operation.highest for one in motors.values()] == pytest.approx([0.04, 0.03])
    for one in motors.values():
        takes = one.live.operation.takes
        assert takes >> ops.UPPER & 1
        assert takes >> ops.HOME & 1  # each by a switch of its own
        assert one.state.lines.disable == 1  # no current at power-on
        assert one.live.operation.window_looks == 50
    assert motors["group_a"].feed[0] is not motors["group_b"].feed[0]


def test_an_end_is_the_last_step_inside():
    q, o = live(load_spec(EXAMPLES / "zoom.toml", ()), operation)["group_a"].live, Operation(trust=REFERENCED)
    assert (end_of(q, o, 1), end_of(q, o, -1)) == (8000, 0)
    o.demand.highest, o.demand.lowest, o.demand.moved = 0.030004, 0.001001, 3
    assert (end_of(q, o, 1), end_of(q, o, -1)) == (6000, 201)
    o.trust = NOT_KNOWN
    assert (end_of(q, o, 1), end_of(q, o, -1)) == (8000, 0)


def test_a_word_is_never_faster_than_asked():
    p = live(load_spec(EXAMPLES / "zoom.toml", ()), operation)["group_a"].params.controller
    assert [word_of(p, hz) for hz in (4000.0, 3999.0, 400.0, 0.0)] == [250, 251, 2500, 1_000_000]
    p.timer.reload = 0
    assert [word_of(p, hz) for hz in (4000.0, 3999.9, 0.0)] == [4000, 3999, 1]


def test_a_stepper_is_switched_on_and_off():
    axis = Stepper()
    host = axis.host
    assert host.until_ended(host.ask(ops.MOVE_BY, 0.0)).how == DONE  # a null move is done, too
    host.ask(ops.MOVE_TO, 0.01)
    host.run(200)
    assert axis.rule.index > 0
    host.off()
    host.run(1)
    assert axis.state.lines.disable == 1
    assert axis.state.lines.period == 0
    assert host.board.operation.trust == ops.NOT_KNOWN  # the rotor rolls out, and nobody counts it
    pulses = axis.state.controller.timer.pulses
    host.run(200)
    assert axis.state.controller.timer.pulses == pulses
    assert abs(axis.state.plant.rotor.lag) > 1.0
    host.ask(ops.ENABLE)
    host.run(2)
    refused = host.until_ended(host.ask(ops.MOVE_TO, 0.01))
    assert (refused.how, refused.why) == (REFUSED, ops.UNREFERENCED)
    off = host.until_ended(host.ask(ops.OFF))
    trusted = host.until_ended(host.ask(ops.TRUST, REFERENCED))
    assert (off.how, trusted.how) == (DONE, DONE)


def test_a_stepper_in_fault_comes_down_its_ramp_and_is_reset():
    axis = Stepper()
    host = axis.host
    host.ask(ops.MOVE_TO, 0.04)
    host.run(150)
    entries = host.axis.feed[0]
    for k in range(axis.rule.position + 20, 8001):  # somebody truncates the table
        entries[k] = -1
    while host.state == "operation enabled":
        host.run(1)
    assert axis.rule.index == -1
    host.run(2)
    assert host.state == "fault"
    assert host.board.operation.fault == 241
    assert "fell by more than one ramp step" in host.axis.fault()
    assert host.until_ended(host.ask(ops.MOVE_BY, 0.001)).why == ops.IN_FAULT
    assert host.until_ended(host.ask(ops.RESET)).how == DONE
    host.run(5)
    assert host.state == "switch on disabled"
    host.ask(ops.ENABLE)
    host.run(5)
    assert host.state == "operation enabled"


def test_a_motor_of_several_is_named():
    spec = load_spec(EXAMPLES / "zoom.toml", ())
    with pytest.raises(DetentError, match="group_a, group_b"):
        Host(METHODS["stepper_envelope"], spec, wall=False)
    literal = load_spec(EXAMPLES / "zoom.toml", ("stepper.group_a.method.rule=literal",))
    with pytest.raises(DetentError, match="literal"):
        Host(METHODS["stepper_envelope"], literal, motor="group_a", wall=False)
