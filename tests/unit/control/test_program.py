"""A job whose moves the operation makes, by an axis that is only its answers."""

from typing import Any

import pytest
from tests.unit.control.test_operation import Desk

from detent.control import operation as ops
from detent.control.operation import judge, look
from detent.control.program import FIELDS, PLACES, WAIT, Program, perform


class Led(Desk):
    """The same with a tray that a host has filled."""

    def __init__(self, *pieces: tuple[float, ...], laid: int | None = None, **more: Any) -> None:
        self.m: Any = Program()
        super().__init__(performs=1, job_looks=40, **more)
        self.enabled()
        self.m.tray.pieces[: FIELDS * len(pieces)] = [value for piece in pieces for value in piece]
        self.job = self.ask(ops.JOB, len(pieces))
        self.o.demand.laid = len(pieces) if laid is None else laid

    def pass_looks(self, looks: int = 1) -> None:
        for _ in range(looks):
            look(self.o)
            judge(self.q, self.o)
            perform(self.q, self.o, self.m)

    @property
    def told(self) -> tuple[int, float]:
        return self.o.demand.do, self.o.demand.target


TO = (ops.MOVE_TO, 0.5, 0.5, 0)


def test_moves_follow_one_another_each_after_its_window_and_its_rest():
    desk = Led((ops.MOVE_TO, 0.5, 0.5, 4), (ops.MOVE_BY, 0.2, 1.0, 0))
    desk.a.commanded = 0.1
    desk.pass_looks()
    assert (desk.told, desk.o.demand.share) == ((ops.TRAVEL, 0.5), 0.5)
    desk.a.rests = 0
    desk.pass_looks(9)
    assert desk.m.done == 0
    desk.a.rests = 1
    desk.pass_looks(3)  # the window
    assert (desk.m.done, desk.told) == (1, (ops.TRAVEL, 0.5))
    desk.pass_looks(3)
    assert desk.m.begun == 1
    desk.pass_looks(1)  # ways count from where the job began
    assert (desk.m.begun, desk.told) == (2, (ops.TRAVEL, pytest.approx(0.3)))
    assert desk.endings[-1][0] != desk.job
    desk.pass_looks(3)
    assert (desk.last, desk.o.running) == ((desk.job, ops.DONE, 0, 0), 0)


def test_a_job_waits_for_the_host_and_no_longer_than_its_lease():
    desk = Led(TO, TO, laid=1)
    desk.pass_looks(20)
    assert (desk.m.done, desk.m.begun, desk.o.running) == (1, 1, desk.job)
    desk.ask(ops.KEEP)
    desk.pass_looks(39)
    assert desk.o.running == desk.job
    desk.pass_looks(1)
    assert (desk.last, desk.o.demand.do) == ((desk.job, ops.FAILED, ops.LEASE_LOST, 0), ops.HALT)


def test_a_pause_holds_on_the_way_and_going_on_leads_to_the_same_target():
    desk = Led(TO)
    desk.pass_looks()
    desk.a.rests = 0
    desk.pass_looks(2)
    paused = desk.ask(ops.PAUSE, client=2)  # whoever leads it waits for its end
    assert desk.last == (paused, ops.DONE, 0, 0)
    desk.pass_looks()
    assert (desk.o.demand.do, desk.o.demand.target) == (ops.HALT, 0.5)
    desk.a.rests = 1
    desk.pass_looks(30)
    assert desk.o.running == desk.job
    desk.ask(ops.RESUME, client=2)
    desk.pass_looks()
    assert desk.told == (ops.TRAVEL, 0.5)
    desk.pass_looks(3)
    assert desk.last == (desk.job, ops.DONE, 0, 0)
    for kind in (ops.PAUSE, ops.RESUME):
        assert desk.last[:2] != (number := desk.ask(kind), ops.DONE)
        assert desk.last == (number, ops.REFUSED, ops.NO_JOB, 0)


def test_a_pause_between_two_moves_lets_no_other_begin():
    desk = Led(TO, (WAIT, 0, 1, 5), TO)
    desk.pass_looks(5)
    assert desk.m.begun == 2
    desk.ask(ops.PAUSE)
    desk.pass_looks(20)
    assert (desk.m.begun, desk.m.looks) == (2, 4)
    desk.ask(ops.RESUME)
    desk.pass_looks(4)
    assert desk.m.begun == 3


def test_a_stop_ends_it_and_nothing_of_it_comes_after():
    desk = Led(TO, TO, TO)
    desk.pass_looks(2)
    stopped = desk.ask(ops.STOP)
    assert desk.endings[-1] == (desk.job, ops.ABORTED, 0, stopped)
    desk.pass_looks(50)
    assert (desk.m.begun, desk.o.demand.do) == (1, ops.HALT)
    assert [one[0] for one in desk.endings].count(desk.job) == 1


def test_a_jog_lasts_its_time_and_a_number_is_gone_to():
    desk = Led((ops.JOG, -0.3, 1.0, 10), (ops.GO, 7, 1.0, 0))
    desk.pass_looks()
    assert (desk.o.demand.do, desk.o.demand.velocity) == (ops.RUN, -0.3)
    desk.a.rests = 0
    desk.pass_looks(9)
    assert desk.o.demand.do == ops.RUN
    desk.pass_looks(1)
    assert desk.o.demand.do == ops.HALT
    desk.a.rests = 1
    desk.pass_looks(3)
    assert (desk.o.demand.do, desk.o.demand.number) == (ops.NUMBERED, 7)
    desk.pass_looks(3)
    assert desk.last == (desk.job, ops.DONE, 0, 0)


def test_what_moved_before_comes_to_rest_first():
    desk = Desk(performs=1).enabled()
    jog = desk.ask(ops.JOG, 0.1)
    desk.a.rests = 0
    job = desk.ask(ops.JOB, 1)
    assert desk.last == (jog, ops.ABORTED, 0, job)
    assert desk.o.demand.do == ops.HALT


@pytest.mark.parametrize("refusal", [0, 203])
def test_a_move_that_cannot_be_made_fails_the_job(refusal: int):
    desk = Led((ops.MOVE_TO, 0.4 if refusal else 1.5, 1.0, 0))
    if refusal:
        desk.pass_looks(1)
        desk.a.refused = refusal
    desk.pass_looks(1)
    assert desk.last == (desk.job, ops.FAILED, refusal or ops.BEYOND, 0)


def test_places_of_the_tray_are_used_again():
    desk = Led(*[(ops.MOVE_TO, k / PLACES, 1.0, 0) for k in range(PLACES)])
    desk.m.pieces = desk.o.demand.number = desk.o.demand.laid = PLACES + 1
    for _ in range(PLACES):
        desk.ask(ops.KEEP)
        desk.pass_looks(3)
    desk.m.tray.pieces[1] = 0.77
    desk.pass_looks(3)
    assert desk.told == (ops.TRAVEL, 0.77)


def test_a_method_that_does_its_jobs_itself_is_left_alone():
    desk = Led(TO)
    desk.q.performs = 0
    desk.pass_looks(1)
    assert desk.m.begun == 0
    for _ in range(3):
        desk.pass_looks()
    assert desk.last == (desk.job, ops.DONE, 0, 0)  # when it rests in its window
