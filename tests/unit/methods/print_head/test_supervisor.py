from collections import deque
from collections.abc import Callable

import pytest
from tests.print_head_rig import TICK, Rig

from detent.control.head_computer import IDLE
from detent.control.latch import read_latch, write_latch
from detent.errors import AxisError
from detent.methods.print_head.controller import PrintHeadController
from detent.methods.print_head.supervisor import (
    MOST_OUTSTANDING,
    MOTIONS,
    Answer,
    Command,
    Supervisor,
    calculate_parameters,
    print_from,
    run_to,
    set_speed,
)

ACK = 0xFF
POSITION_HIGH = Command(b"\x40", "POSITION HIGH BYTE", returns_data=True)
POSITION_LOW = Command(b"\x41", "POSITION LOW BYTE", returns_data=True)


class Axis:
    """The axis computer as the supervisor sees it: two latches, bytes taken and answered one per tick."""

    def __init__(self, *, ack_last: bool = False) -> None:
        self.controller = PrintHeadController()
        self.head = self.controller.head
        self.ack_last = ack_last
        self.taken: list[int] = []
        self.status: deque[int] = deque()
        self.left = 0
        self.on_command: Callable[[], None] = lambda: None
        self.deaf = False

    def pass_time(self, _seconds: float) -> None:
        """One tick; time stands still while a status byte waits."""
        if self.head.status.latch.flag:
            return
        if self.head.command_latch.flag and not self.deaf:
            self.take(read_latch(self.head.command_latch))
        if self.status:
            write_latch(self.head.status.latch, self.status.popleft())

    def take(self, byte: int) -> None:
        self.taken.append(byte)
        several = self.left > 0 or bool(byte & 0x80)
        self.left = self.left - 1 if self.left else (byte & 7 if byte & 0x80 else 0)
        if self.left or (self.ack_last and several):
            self.status.append(ACK)
        if not self.left:
            self.on_command()


def connect(axis: Axis, *, ack_last: bool = False) -> tuple[Supervisor, list[Answer]]:
    answers: list[Answer] = []
    return Supervisor(axis.controller, axis.pass_time, answers.append, patience=1.0, ack_last=ack_last), answers


@pytest.mark.parametrize(
    ("command", "data", "motion"),
    [
        (calculate_parameters(), "01", False),
        (set_speed(240), "99 f0", False),
        (run_to(0x1234), "92 12 34", True),
        (print_from(0x012345, 0x0678), "8d 01 23 45 06 78", True),
    ],
    ids=lambda value: value.text if isinstance(value, Command) else "",
)
def test_commands_are_the_bytes_of_the_protocol(command: Command, data: str, motion: bool) -> None:
    assert command.data == bytes.fromhex(data)
    assert (command.data[0] in MOTIONS) is motion
    # The first byte of a longer command says how many follow.
    assert len(command.data) == 1 + (command.data[0] & 7 if command.data[0] & 0x80 else 0)


@pytest.mark.parametrize("ack_last", [False, True])
def test_every_byte_is_sent_after_the_acknowledge_of_the_one_before(ack_last: bool) -> None:
    axis = Axis(ack_last=ack_last)
    axis.on_command = lambda: axis.status.append(0)
    supervisor, answers = connect(axis, ack_last=ack_last)
    for command in (print_from(0x012345, 0x0678), POSITION_HIGH, set_speed(60)):
        supervisor.send(command)
    supervisor.finish()
    assert axis.taken == list(bytes.fromhex("8d0123450678 40 99 3c"))
    assert [answer.command.text for answer in answers] == [
        "PRINT FROM 291.27 TO 1656", "POSITION HIGH BYTE", "SET SPEED 60",
    ]  # fmt: skip
    assert [answer.byte for answer in answers] == [0, 0, 0]


def test_answers_belong_to_the_commands_in_their_order() -> None:
    axis = Axis()
    supervisor, answers = connect(axis)
    supervisor.send(run_to(100, tag=7))
    supervisor.send(set_speed(60))
    supervisor.send(run_to(200, tag=8))
    assert not answers
    axis.status.extend([0x08, 0x00, 0x20])
    supervisor.finish()
    assert [(a.command.tag, a.byte) for a in answers] == [(7, 0x08), (-1, 0x00), (8, 0x20)]
    assert not supervisor.outstanding


def test_an_answer_between_two_acknowledges_is_booked_at_once() -> None:
    axis = Axis()
    supervisor, answers = connect(axis)
    supervisor.send(run_to(100, tag=1))
    axis.pass_time(0)
    axis.status.append(0x00)  # the run ends just before the first byte of the next command is taken
    supervisor.send(run_to(200, tag=2))
    assert [(a.command.tag, a.byte) for a in answers] == [(1, 0x00)]
    assert [c.tag for c in supervisor.outstanding] == [2]


def test_a_position_byte_of_ff_is_no_acknowledge() -> None:
    axis = Axis()
    supervisor, answers = connect(axis)
    supervisor.send(POSITION_LOW)
    axis.on_command = lambda: axis.status.append(ACK)
    axis.pass_time(0)  # takes the byte; its answer FF waits in the latch
    axis.on_command = lambda: axis.status.append(0)
    supervisor.send(set_speed(60))
    supervisor.finish()
    assert axis.taken == [0x41, 0x99, 60]
    assert [(a.command.text, a.byte) for a in answers] == [("POSITION LOW BYTE", 0xFF), ("SET SPEED 60", 0)]


def test_a_running_motion_and_one_behind_it_are_the_most_motions() -> None:
    axis = Axis()
    supervisor, answers = connect(axis)
    supervisor.send(run_to(100, tag=1))
    supervisor.send(run_to(200, tag=2))
    axis.status.append(0)
    supervisor.send(run_to(300, tag=3))  # had to wait for the first
    assert [a.command.tag for a in answers] == [1]
    assert supervisor.waiting_motions() == 2


def test_no_more_commands_wait_than_the_axis_can_queue() -> None:
    axis = Axis()
    supervisor, answers = connect(axis)
    for _ in range(MOST_OUTSTANDING):
        supervisor.send(POSITION_HIGH)
    axis.status.extend([1, 2, 3, 4])
    supervisor.send(POSITION_HIGH)
    assert len(answers) == 1
    assert len(supervisor.outstanding) == MOST_OUTSTANDING
    supervisor.finish()
    assert [a.byte for a in answers] == [1, 2, 3, 4]


def test_an_answer_that_waits_does_not_keep_the_next_byte_from_being_taken() -> None:
    # The simulated axis stands still until its status byte is read: waiting for the latch alone would never end.
    axis = Axis()
    supervisor, answers = connect(axis)
    supervisor.send(run_to(100, tag=1))
    axis.status.append(0x00)
    axis.pass_time(0)
    supervisor.send(POSITION_HIGH)
    supervisor.send(POSITION_LOW)
    assert [a.command.tag for a in answers] == [1]
    assert axis.taken == [0x92, 0, 100, 0x40]


def test_an_axis_that_does_not_answer_has_failed() -> None:
    axis = Axis()
    axis.head.state = IDLE
    supervisor, _ = connect(axis)
    supervisor.send(run_to(100))
    with pytest.raises(
        AxisError, match=r"^RUN TILL 100: no answer within 1 s; the axis computer hangs in state 'idle'$"
    ):
        supervisor.finish()


def test_an_axis_that_takes_no_byte_has_failed() -> None:
    axis = Axis()
    axis.deaf = True
    supervisor, _ = connect(axis)
    supervisor.send(POSITION_HIGH)
    with pytest.raises(AxisError, match=r"^POSITION LOW BYTE: .* does not accept the previous byte; .* 'power on'$"):
        supervisor.send(POSITION_LOW)


def test_a_byte_out_of_place_is_said() -> None:
    axis = Axis()
    supervisor, _ = connect(axis)
    axis.status.append(0x04)
    axis.pass_time(0)
    with pytest.raises(
        AxisError, match=r"SET SPEED 60: a byte was answered the axis is not calibrated; .* expected FF"
    ):
        supervisor.send(set_speed(60))


@pytest.mark.parametrize("ack_last", ["false", "true"])
def test_the_real_axis_computer_and_the_supervisor_agree(ack_last: str) -> None:
    rig = Rig(overrides=[f"method.ack_last={ack_last}"]).pretend_identified(emitter=0x05FF)
    answers: list[Answer] = []

    def pass_time(seconds: float) -> None:
        rig.run(max(1, round(seconds / TICK)))

    supervisor = Supervisor(rig.r.controller, pass_time, answers.append, ack_last=ack_last == "true")
    for command in (POSITION_HIGH, POSITION_LOW, set_speed(120), run_to(2000, tag=1), set_speed(44)):
        supervisor.send(command)
    supervisor.send(print_from(9 << 8, 1500, tag=2))  # no room for the run-up
    supervisor.finish()
    assert [(a.command.text.partition(" ")[0], a.byte) for a in answers] == [
        ("POSITION", 0x05), ("POSITION", 0xFF), ("SET", 0), ("RUN", 0), ("SET", 0), ("PRINT", 0x02),
    ]  # fmt: skip
    assert abs(rig.head.emitter - 2000) <= 8
