"""What a motor is made of for the live loop; what it does there is among the acceptance tests."""

import pytest
from tests.acceptance.test_golden_bits import EXAMPLES

from detent.control import operation as ops
from detent.control.operation import NOT_KNOWN, REFERENCED, Operation, OperationParams
from detent.methods.load import load_spec
from detent.methods.stepper_envelope.live import end_of, live, word_of


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
        assert not takes >> ops.HOME & 1  # it has no sensor to find a place with
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
