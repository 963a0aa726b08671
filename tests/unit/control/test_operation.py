"""Operation of an axis that is only its answers: what is demanded, how commands end."""

import math
from typing import Any

import pytest

from detent.control import operation as ops
from detent.control.axis_states import (
    DISABLE_OPERATION,
    DISABLE_VOLTAGE,
    ENABLE_OPERATION,
    ENABLED,
    FAULT,
    FAULT_REACTION,
    HALT_QUICKLY,
    QUICK_STOP,
    READY,
    RESET_FAULT,
    SHUTDOWN,
    SWITCH_ON,
    SWITCH_ON_DISABLED,
    SWITCHED_ON,
)
from detent.control.commands import obey, sum_of
from detent.control.operation import (
    Operation,
    OperationParams,
    Request,
    fail_softly,
    judge,
    look,
    lose_torque,
    off,
    stop,
)

EVERYTHING = sum(1 << kind for kind in ops.COMMANDS)


class Desk:
    """An operation, and the answers of an axis that goes where it is told in so many looks."""

    def __init__(self, **more: Any) -> None:
        usual: dict[str, Any] = {"window_looks": 3, "lease_looks": 10, "lowest": 0.0, "highest": 1.0, "creep": 0.25}
        self.q = OperationParams(**usual | {"takes": EVERYTHING} | more)
        self.o: Any = Operation(trust=ops.REFERENCED)
        self.a = self.o.answer
        self.a.ready = self.a.rests = self.a.near = 1
        self.number = 0
        self.pass_looks()

    def ask(self, kind: int, value: float = 0.0, speed: float = 1.0, **more: int) -> int:
        self.number += 1
        usual = {"epoch": self.o.epoch, "client": 1, "id": self.number}
        obey(self.q, self.o, Request(number=self.number, kind=kind, value=value, speed=speed, **usual | more))
        return self.number

    def pass_looks(self, looks: int = 1) -> None:
        for _ in range(looks):
            look(self.o)
            judge(self.q, self.o)

    def enabled(self) -> "Desk":
        self.ask(ops.ENABLE)
        self.ask(ops.CONFIRM)
        self.pass_looks()
        assert self.o.state == ENABLED
        return self

    @property
    def endings(self) -> list[tuple[int, int, int, int]]:
        e = self.o.endings
        return [(e.id[k], e.how[k], e.why[k], e.by[k]) for k in range(e.count)]

    @property
    def last(self) -> tuple[int, int, int, int]:
        return self.endings[-1]


def test_a_move_is_done_after_the_window_at_commanded_rest():
    desk = Desk().enabled()
    move = desk.ask(ops.MOVE_TO, 0.5, 0.5)
    assert (desk.o.demand.do, desk.o.demand.fresh) == (ops.TRAVEL, 1)
    assert (desk.o.demand.target, desk.o.demand.share) == (0.5, 0.5)
    desk.a.rests = desk.a.near = 0
    desk.pass_looks(20)
    assert desk.o.demand.fresh == 0
    desk.a.rests = 1
    desk.pass_looks(5)
    desk.a.near = 1
    desk.pass_looks(2)
    assert desk.o.running == move
    desk.a.near = 0
    desk.pass_looks()
    desk.a.near = 1
    desk.pass_looks(3)
    assert (desk.last, desk.o.running) == ((move, ops.DONE, 0, 0), 0)


def test_a_stop_raises_the_epoch_and_ends_what_runs():
    desk = Desk().enabled()
    move, epoch = desk.ask(ops.MOVE_BY, 0.2), desk.o.epoch
    desk.pass_looks()
    desk.a.rests, desk.a.commanded = 0, 0.3
    stopped = desk.ask(ops.STOP)
    assert (desk.last, desk.o.epoch, desk.o.demand.do) == ((move, ops.ABORTED, 0, stopped), epoch + 1, ops.HALT)
    stale = desk.ask(ops.MOVE_BY, 0.1, epoch=epoch)
    assert desk.last == (stale, ops.REFUSED, ops.STALE, 0)
    desk.pass_looks(5)
    assert desk.o.running == stopped
    desk.a.rests, desk.a.commanded = 1, 0.34
    desk.pass_looks()
    assert desk.last == (stopped, ops.DONE, 0, 0)
    assert desk.o.last_stop == pytest.approx(0.04)


@pytest.mark.parametrize("pull", [stop, off])
def test_a_line_needs_no_command(pull):
    desk = Desk().enabled()
    move = desk.ask(ops.MOVE_BY, 0.2)
    pull(desk.o, 0)
    assert desk.last == (move, ops.ABORTED, 0, 0)
    assert desk.o.demand.do == (ops.HALT if pull is stop else ops.REST_OFF)
    assert desk.o.state == (ENABLED if pull is stop else SWITCH_ON_DISABLED)


def test_a_jog_lives_by_its_lease_and_can_change_its_speed():
    desk = Desk().enabled()
    jog = desk.ask(ops.JOG, 0.1)
    desk.a.rests = 0
    for _ in range(4):
        desk.pass_looks(9)
        desk.ask(ops.KEEP)
    desk.ask(ops.JOG, 0.2, id=jog)
    assert (desk.o.running, desk.o.demand.velocity) == (jog, 0.2)
    desk.pass_looks(10)
    assert desk.last == (jog, ops.FAILED, ops.LEASE_LOST, 0)
    assert desk.o.demand.do == ops.HALT


def test_a_released_jog_is_done_at_rest():
    desk = Desk().enabled()
    jog = desk.ask(ops.JOG, 0.1)
    desk.pass_looks()
    desk.ask(ops.JOG, 0.0, id=jog)
    desk.pass_looks(4)
    assert desk.last == (jog, ops.DONE, 0, 0)


@pytest.mark.parametrize(
    ("kind", "value", "speed", "more", "why"),
    [
        (ops.MOVE_TO, 1.1, 1.0, {}, ops.BEYOND),
        (ops.MOVE_BY, -0.1, 1.0, {}, ops.BEYOND),
        (ops.MOVE_TO, math.nan, 1.0, {}, ops.NOT_FINITE),
        (ops.MOVE_TO, 0.5, math.nan, {}, ops.NOT_FINITE),
        (ops.MOVE_TO, 0.5, 0.0, {}, ops.NOT_FINITE),
        (ops.MOVE_TO, 0.5, 1.0, {"client": 2}, ops.SECOND),
        (ops.RESET, 0.0, 1.0, {}, ops.NO_FAULT),
        (ops.TRUST, 0.0, 1.0, {}, ops.MOVING),
        (99, 0.0, 1.0, {}, ops.UNKNOWN),
        (ops.MOVE_TO, 0.5, 1.0, {"id": 0}, ops.UNKNOWN),
    ],
)  # fmt: skip
def test_what_is_refused_changes_nothing(kind, value, speed, more, why):
    desk = Desk().enabled()
    before = bytes(desk.o.demand)
    desk.ask(kind, value, speed, **more)
    assert desk.last[1:] == (ops.REFUSED, why, 0)
    assert (bytes(desk.o.demand), desk.o.running, desk.o.state) == (before, 0, ENABLED)


def test_what_is_offered_and_when():
    desk = Desk(takes=EVERYTHING & ~(1 << ops.GO))
    assert desk.ask(ops.MOVE_TO, 0.5)
    assert desk.last[2] == ops.NOT_ENABLED
    desk.a.ready = 0
    assert desk.ask(ops.ENABLE)
    assert desk.last[2] == ops.UNREADY
    desk.a.ready = 1
    desk.enabled()
    assert desk.ask(ops.GO, 3)
    assert desk.last[2] == ops.NOT_OFFERED


def test_outside_its_limits_an_axis_may_come_back():
    desk = Desk().enabled()
    desk.a.commanded = 1.3
    desk.ask(ops.MOVE_TO, 1.2)
    assert desk.o.running
    desk.ask(ops.MOVE_TO, 1.4)
    assert desk.last[2] == ops.BEYOND
    desk.a.commanded = -0.3
    desk.ask(ops.MOVE_TO, -0.1)
    assert desk.last[1] == ops.ABORTED


def test_without_a_reference_it_creeps_by_a_way():
    desk = Desk()
    desk.o.trust = ops.NOT_KNOWN
    desk.enabled()
    desk.ask(ops.MOVE_TO, 0.5)
    assert desk.last[2] == ops.UNREFERENCED
    desk.ask(ops.MOVE_BY, 5.0)
    assert (desk.o.demand.do, desk.o.demand.share) == (ops.TRAVEL, 0.25)


def test_the_first_motion_is_slow_until_confirmed():
    desk = Desk(careful=1)
    desk.ask(ops.ENABLE)
    desk.pass_looks()
    desk.ask(ops.MOVE_BY, 0.1)
    assert desk.o.demand.share == 0.1
    desk.ask(ops.CONFIRM)
    desk.ask(ops.MOVE_BY, 0.1)
    assert desk.o.demand.share == 1.0
    off(desk.o, 0)
    desk.ask(ops.ENABLE)
    assert desk.o.confirmed == 0


def test_a_fault_ends_the_command_and_stays_until_it_is_reset():
    desk = Desk().enabled()
    move = desk.ask(ops.MOVE_BY, 0.2)
    desk.a.fault = 12
    desk.pass_looks()
    assert desk.last == (move, ops.FAILED, 12, 0)
    assert (desk.o.state, desk.o.demand.do) == (FAULT_REACTION, ops.REST_OFF)
    desk.a.fault = 10
    desk.pass_looks(2)
    assert (desk.o.state, desk.o.fault) == (FAULT, 12)  # the first cause
    desk.ask(ops.MOVE_BY, 0.1)
    assert desk.last[2] == ops.IN_FAULT
    desk.ask(ops.ENABLE)
    assert desk.last[2] == ops.IN_FAULT
    desk.a.fault = 0
    desk.ask(ops.RESET)
    assert (desk.o.state, desk.o.fault) == (SWITCH_ON_DISABLED, 0)


@pytest.mark.parametrize(("alone", "code", "trust"), [
    (0, 10, ops.REFERENCED), (0, 221, ops.REFERENCED), (1, 10, ops.NOT_KNOWN), (1, 11, ops.NOT_KNOWN),
    (1, 221, ops.NOT_KNOWN), (1, 13, ops.REFERENCED), (1, 30, ops.REFERENCED), (0, 12, ops.NOT_KNOWN),
])  # fmt: skip
def test_where_one_sensor_alone_counts_what_it_may_have_missed_is_lost(alone, code, trust):
    desk = Desk().enabled()
    assert desk.o.trust == ops.REFERENCED
    desk.a.alone, desk.a.fault = alone, code
    desk.pass_looks()
    assert (desk.o.fault, desk.o.trust) == (code, trust)


def test_a_soft_fault_comes_to_rest_and_holds():
    desk = Desk().enabled()
    move = desk.ask(ops.MOVE_BY, 0.2)
    desk.a.rests = 0
    fail_softly(desk.o, 50)
    fail_softly(desk.o, 51)
    assert (desk.last, desk.o.demand.do) == ((move, ops.FAILED, 50, 0), ops.HALT)
    desk.pass_looks(5)
    assert desk.o.state == FAULT_REACTION
    desk.a.rests = 1
    desk.pass_looks()
    assert (desk.o.state, desk.o.fault, desk.o.demand.do) == (FAULT, 50, ops.HALT)
    disabled = Desk()
    fail_softly(disabled.o, 50)
    assert disabled.o.fault == 0


def test_somebody_else_takes_over_and_leaves():
    desk = Desk().enabled()
    move = desk.ask(ops.MOVE_BY, 0.2)
    taken = desk.ask(ops.TAKE, client=2)
    assert desk.endings[-2:] == [(move, ops.ABORTED, 0, taken), (taken, ops.DONE, 0, 0)]
    assert desk.o.client == 2
    desk.ask(ops.STOP)  # from anybody
    assert desk.o.running
    desk.ask(ops.MOVE_BY, 0.1, client=2)
    running = desk.o.running
    desk.ask(ops.LEAVE, client=2)
    assert (running, ops.ABORTED) in {ending[:2] for ending in desk.endings}
    assert desk.o.client == 0


@pytest.mark.parametrize("looks", [1, 3])
def test_who_takes_over_in_a_fault_may_reset_it(looks):
    desk = Desk().enabled()
    desk.a.fault = 12
    desk.pass_looks(looks)
    assert desk.o.state == (FAULT_REACTION if looks == 1 else FAULT)
    desk.ask(ops.RESET, client=2)
    assert desk.last[2] == ops.SECOND
    taken = desk.ask(ops.TAKE, client=2)
    assert desk.last == (taken, ops.DONE, 0, 0)
    assert (desk.o.client, desk.o.fault, desk.o.demand.do) == (2, 12, ops.REST_OFF)
    desk.a.fault = 0
    desk.pass_looks(2)
    desk.ask(ops.RESET, client=2)
    assert (desk.o.state, desk.o.fault) == (SWITCH_ON_DISABLED, 0)


def test_the_orders_of_a_control_word():
    desk = Desk()
    for order in (0, 1, 2):
        desk.ask(ops.ORDER, order)
    assert (desk.o.state, desk.o.demand.do) == (ENABLED, ops.HOLD)
    move = desk.ask(ops.MOVE_BY, 0.2)
    quick = desk.ask(ops.ORDER, 5)
    assert (move, ops.ABORTED, 0, quick) in desk.endings
    assert (desk.o.state, desk.o.demand.do) == (QUICK_STOP, ops.HALT)
    desk.ask(ops.ORDER, 4)
    assert (desk.o.state, desk.o.demand.do) == (SWITCH_ON_DISABLED, ops.REST_OFF)
    desk.a.fault = 3
    desk.pass_looks(3)
    desk.a.fault = 0
    desk.ask(ops.ORDER, 6)
    assert desk.last[2] == ops.IN_FAULT
    desk.ask(ops.RESET)
    desk.a.ready = 0
    for order in (0, 1, 2):
        desk.ask(ops.ORDER, order)
    assert desk.o.state == 3


def test_a_method_may_refuse_and_may_take_one_move_at_a_time():
    desk = Desk(one_at_a_time=1).enabled()
    move = desk.ask(ops.MOVE_BY, 0.2)
    other = desk.ask(ops.MOVE_BY, 0.1)
    assert desk.last == (other, ops.REFUSED, ops.BUSY, 0)
    desk.a.refused = 210
    desk.pass_looks()
    assert desk.last == (move, ops.REFUSED, 210, 0)
    desk.a.refused = 0
    trusted = desk.ask(ops.GO, 2)
    assert (desk.o.demand.do, desk.o.demand.number) == (ops.NUMBERED, 2)
    stop(desk.o, 0)
    desk.ask(ops.HOME)
    assert (desk.o.demand.do, trusted > 0) == (ops.SEEK, True)


def test_any_change_of_a_record_changes_its_sum():
    record: list[Any] = [7, 3, 5, 2, 1, 0.25, 0.5]
    for k, value in enumerate(record):
        for other in (value + 1, -value, value + 1e-9 if isinstance(value, float) else value ^ 64):
            changed = [*record[:k], other, *record[k + 1 :]]
            assert sum_of(*changed) != sum_of(*record)


# ---- a brake that takes its time


def opening(**more: Any) -> tuple[Desk, int]:
    """An operation that was enabled, whose brake is not open yet."""
    desk = Desk(**more)
    desk.a.closed = 1
    asked = desk.ask(ops.ENABLE)
    desk.pass_looks(5)
    return desk, asked


def test_it_is_enabled_when_its_brake_is_open():
    desk, asked = opening()
    assert (desk.o.state, desk.o.demand.do) == (SWITCHED_ON, ops.HOLD)
    assert desk.endings == []
    move = desk.ask(ops.MOVE_TO, 0.5)
    assert desk.last == (move, ops.REFUSED, ops.NOT_ENABLED, 0)
    desk.a.closed = 0
    desk.pass_looks()
    assert desk.o.state == ENABLED
    assert desk.last == (asked, ops.DONE, 0, 0)
    assert desk.o.running == 0


def test_without_a_brake_that_is_at_once():
    desk = Desk()
    asked = desk.ask(ops.ENABLE)
    assert (desk.o.state, desk.last) == (ENABLED, (asked, ops.DONE, 0, 0))


def test_who_enables_again_takes_the_place_of_the_first_and_nothing_begins_anew():
    desk, first = opening()
    second = desk.ask(ops.ENABLE)
    assert (desk.last, desk.o.demand.fresh) == ((first, ops.ABORTED, 0, second), 0)
    desk.a.closed = 0
    desk.pass_looks()
    assert desk.last == (second, ops.DONE, 0, 0)


@pytest.mark.parametrize(("how", "state"), [(stop, READY), (off, SWITCH_ON_DISABLED)])
def test_what_ends_enabling_takes_the_torque(how, state):
    desk, asked = opening()
    how(desk.o, 0)
    assert (desk.o.state, desk.o.demand.do) == (state, ops.REST_OFF)
    assert desk.last == (asked, ops.ABORTED, 0, 0)
    desk.a.closed = 0
    desk.pass_looks(3)
    assert desk.o.state == state


@pytest.mark.parametrize("kind", [ops.TAKE, ops.LEAVE])
def test_so_does_another_one_who_commands(kind):
    desk, asked = opening()
    desk.ask(kind, client=1 if kind == ops.LEAVE else 2)
    assert desk.endings[0][:2] == (asked, ops.ABORTED)
    assert desk.o.demand.do == ops.REST_OFF


@pytest.mark.parametrize("softly", [0, 1])
def test_so_does_a_fault(softly):
    desk, asked = opening()
    if softly:
        desk.a.soft = 10
    else:
        desk.a.fault = 3
    desk.pass_looks(2)
    assert (desk.o.state, desk.o.demand.do) == (FAULT, ops.REST_OFF)
    assert desk.last == (asked, ops.FAILED, 10 if softly else 3, 0)


def test_so_does_what_leaves_nobody_to_steer():
    desk, asked = opening()
    lose_torque(desk.o, 51)
    assert (desk.o.state, desk.last) == (FAULT_REACTION, (asked, ops.FAILED, 51, 0))


@pytest.mark.parametrize(
    ("order", "state"),
    [
        (SHUTDOWN, READY), (SWITCH_ON, SWITCHED_ON), (DISABLE_OPERATION, SWITCHED_ON),
        (DISABLE_VOLTAGE, SWITCH_ON_DISABLED), (HALT_QUICKLY, SWITCH_ON_DISABLED),
    ],
)  # fmt: skip
def test_an_order_to_another_state_ends_enabling(order, state):
    desk, asked = opening()
    number = desk.ask(ops.ORDER, float(order))
    assert (desk.o.state, desk.o.demand.do) == (state, ops.REST_OFF)
    assert desk.endings[-2:] == [(asked, ops.ABORTED, 0, number), (number, ops.DONE, 0, 0)]
    desk.a.closed = 0
    desk.pass_looks(3)
    assert desk.o.state == state


def test_the_control_word_enables_in_its_steps_and_waits_for_the_brake():
    desk = Desk()
    desk.a.closed = 1
    for order in (SHUTDOWN, SWITCH_ON, ENABLE_OPERATION, ENABLE_OPERATION, RESET_FAULT):
        desk.ask(ops.ORDER, float(order))
        desk.pass_looks()
    assert (desk.o.state, desk.o.demand.do) == (SWITCHED_ON, ops.HOLD)
    desk.a.closed = 0
    desk.pass_looks()
    assert desk.o.state == ENABLED


def test_out_of_a_quick_stop_there_is_nothing_to_wait_for():
    desk = Desk().enabled()
    desk.ask(ops.ORDER, float(HALT_QUICKLY))
    desk.ask(ops.ORDER, float(ENABLE_OPERATION))
    assert (desk.o.state, desk.o.demand.do, desk.o.demand.fresh) == (ENABLED, ops.HOLD, 1)
