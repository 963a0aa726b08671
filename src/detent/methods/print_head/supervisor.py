"""The supervisor computer (B1): sends commands byte by byte and takes the answers in their order.

Print-head specification 3.1. It knows the axis computer only through the two latches; how time passes between two
bytes is the caller's business, so the same supervisor serves a simulation and a live axis.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from detent.control.head_commands import ACKNOWLEDGE
from detent.control.head_computer import STATE_NAMES
from detent.errors import AxisError, describe_sb1
from detent.kernel.step import Act, do
from detent.methods.print_head.controller import PrintHeadController, read_status, write_command

MOST_OUTSTANDING = 3  # unanswered commands: the running one, and a speed or a motion behind it
MOST_TRIES = 1000  # stretches of time in which the axis must take a byte; a computer that works takes it in the first


MOTIONS = (0x8D, 0x92, 0xA2)
"""First bytes of the commands that move the head to a position; only one such command may wait."""


@dataclass(frozen=True)
class Command:
    """One command as its bytes."""

    data: bytes  # first byte and data bytes
    text: str  # for messages
    tag: int = -1  # the caller's own number, returned with the answer
    returns_data: bool = False  # True if the answer is a data byte instead of SB1


@dataclass(frozen=True)
class Answer:
    """SB1 (or the data byte) of a command."""

    command: Command
    byte: int


def calculate_parameters() -> Command:
    """CALCULATE PARAMETERS: home and identify."""
    return Command(bytes([0x01]), "CALCULATE PARAMETERS")


def set_speed(s: int) -> Command:
    """SET SPEED to the speed value `s` [1/6 in/s]."""
    return Command(bytes([0x99, s]), f"SET SPEED {s}")


def run_to(emitter: int, tag: int = -1) -> Command:
    """RUN TILL a position [emitter]."""
    return Command(bytes([0x92, emitter >> 8, emitter & 0xFF]), f"RUN TILL {emitter}", tag)


def controlled_run_to(emitter: int) -> Command:
    """CONTROLLED RUN TILL a position [emitter]: no faster than the preselected speed."""
    return Command(bytes([0xA2, emitter >> 8, emitter & 0xFF]), f"CONTROLLED RUN TILL {emitter}")


def print_from(start: int, end: int, tag: int = -1) -> Command:
    """PRINT FROM `start` [1/256 emitter] TO `end` [emitter]."""
    data = bytes([0x8D, *start.to_bytes(3), *end.to_bytes(2)])
    return Command(data, f"PRINT FROM {start / 256:.2f} TO {end}", tag)


@dataclass
class Supervisor:
    """Sends commands and collects answers."""

    controller: PrintHeadController  # only its two latches are touched
    # ``pass_time(seconds) -> None`` lets at most that much time pass and returns earlier when a status byte waits
    pass_time: Callable[[float], None]
    on_answer: Callable[[Answer], None]  # called with every `Answer` the moment it is read
    ack_last: bool = False  # the axis acknowledges the last byte of a command too
    patience: float = 60.0  # longest time a byte may take [s]; an axis that is silent for longer has failed
    act: Act = do  # how it reaches the latches
    outstanding: deque[Command] = field(default_factory=deque[Command])

    def send(self, command: Command) -> None:
        """Send a command as soon as the axis may take it; answers that come meanwhile go to `on_answer`."""
        while len(self.outstanding) >= MOST_OUTSTANDING or (command.data[0] in MOTIONS and self.waiting_motions() > 1):
            self.await_answer()
        for k, byte in enumerate(command.data):
            self._await_free_latch(command)
            self.act(write_command, self.controller, byte)
            last = k == len(command.data) - 1
            if not last or (self.ack_last and len(command.data) > 1):
                self._await_acknowledge(command)
        self.outstanding.append(command)

    def waiting_motions(self) -> int:
        """Unanswered motion commands."""
        return sum(command.data[0] in MOTIONS for command in self.outstanding)

    def await_answer(self) -> None:
        """Wait for the answer of the oldest outstanding command."""
        self._book(self._next_byte(self.outstanding[0]))

    def finish(self) -> None:
        """Wait until every command is answered."""
        while self.outstanding:
            self.await_answer()

    def _await_free_latch(self, command: Command) -> None:
        """Wait until the axis has taken the last byte. Time stands still while an answer waits: it is read first."""
        for _ in range(MOST_TRIES):
            if not self.controller.head.command_latch.flag:
                return
            if self.controller.head.status.latch.flag and self.outstanding:
                self.await_answer()
            else:
                self.pass_time(0.0)
        raise AxisError(
            f"{command.text}: the axis computer does not accept the previous byte; it hangs in state "
            f"{STATE_NAMES[self.controller.head.state]!r}"
        )

    def _await_acknowledge(self, command: Command) -> None:
        while True:
            byte = self._next_byte(command)
            if byte == ACKNOWLEDGE and not (self.outstanding and self.outstanding[0].returns_data):
                return
            if not self.outstanding:
                raise AxisError(
                    f"{command.text}: a byte was answered {describe_sb1(byte)}, expected FF (byte accepted)"
                )
            self._book(byte)

    def _book(self, byte: int) -> None:
        self.on_answer(Answer(self.outstanding.popleft(), byte))

    def _next_byte(self, command: Command) -> int:
        latch = self.controller.head.status.latch
        if not latch.flag:
            self.pass_time(self.patience)
        if not latch.flag:
            raise AxisError(
                f"{command.text}: no answer within {self.patience:g} s; the axis computer hangs in state "
                f"{STATE_NAMES[self.controller.head.state]!r}"
            )
        return int(self.act(read_status, self.controller))
