"""The print head under somebody's hand: its byte protocol, spoken from within the loop, and jobs printed line by line.

Enabled, the head looks for its frames and measures itself, unless it has; a move is a RUN TILL, a jog a run to the end
of the travel at its own speed, a stop the stop that ends every move, only earlier. A job comes as pieces: a line's ink
and its commands. The host lays them ready; the loop fills the line buffer and sends the bytes in the very tick in which
the supervisor of a simulation does it, so that a page comes out the same.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from detent.control.column_timer import COLUMNS
from detent.control.guard import SATURATED
from detent.control.head_commands import ACKNOWLEDGE, FASTEST, SLOWEST
from detent.control.head_computer import (
    FAULT,
    IMPLAUSIBLE,
    NO_OPERATION,
    OBSTRUCTION,
    OK,
    STATE_NAMES,
    HeadComputer,
    HeadParams,
)
from detent.control.head_sequence import halt, switch_off
from detent.control.latch import read_latch, write_latch
from detent.control.operation import (
    FEED,
    HALT,
    HOLD,
    HOME,
    JOB,
    JOG,
    MOVE_BY,
    MOVE_TO,
    NOT_KNOWN,
    REFERENCED,
    REST_OFF,
    RUN,
    SEEK,
    TRAVEL,
    UNREFERENCED,
    WORK,
    Operation,
    OperationParams,
)  # fmt: skip
from detent.errors import AxisError, describe_sb1
from detent.kernel.loop import serves
from detent.kernel.registers import Registers, block, f8, i2, i4, i4_array, i8, i8_array, register, u1, u1_array
from detent.kernel.step import hot_step, step
from detent.methods.method import Live
from detent.methods.print_head.controller import PrintHeadController, PrintHeadLines
from detent.methods.print_head.faults import places
from detent.methods.print_head.line_plan import EMITTERS_PER_COLUMN, RESERVE
from detent.methods.print_head.print_job import parse_text
from detent.methods.print_head.printed_page import PrintJob
from detent.methods.print_head.run import NOT_FIRED, Printing, PrintRun, inked, line_commands, print_head_machine
from detent.methods.print_head.schema import EMITTER, SPEED_STEP, PrintHeadSpec
from detent.methods.print_head.supervisor import MOST_OUTSTANDING
from detent.methods.print_head.system import TICK

PIECES = 4  # places of the tray
AHEAD = 2  # lines that are laid ready at most: the line buffer has two banks
HEAD = 32  # bytes of a piece before its columns: how many bytes of commands follow, and these
PIECE = HEAD + COLUMNS

MISSED = 12  # emitters that a stop may miss its target by: 11 at most (`head_commands.RUN_UP_RESERVE`)
MEASURING, MISSED_TARGET, NOT_DONE = 230, 231, 232  # reasons to refuse, `errors.REFUSAL_TEXT`
OBSTRUCTED = 250

NOTHING, MEASURED, ARRIVED, PRINTED = 0, 1, 2, 16  # what an answer tells; a piece's number on top of the last


class HeadLiveParams(Registers):
    """How it is operated."""

    operation: OperationParams = block("times and limits")
    look_ticks: i8 = register("ticks between two looks", unit="tick")
    emitter: f8 = register("travel per emitter", unit="m")
    value: f8 = register("velocity of a speed value", unit="m/s")


class HeadLive(Registers):
    """The supervisor in the loop, and what it is about."""

    script: u1_array = register("bytes of commands that are being sent", length=HEAD, unit="code")
    length: u1 = register("how many", unit="count")
    sent: u1 = register("how many of them were sent", unit="count")
    left: u1 = register("bytes of the present command still to be sent", unit="count")
    first: u1 = register("its first byte", unit="code")
    acks: u1 = register("1 until the byte sent last is acknowledged")
    tells: i4 = register("what the answer of the script's last command tells", unit="code")
    waiting: u1 = register("commands without an answer", unit="count")
    answers: i4_array = register(
        "what the answer of each tells, the oldest first", length=MOST_OUTSTANDING, unit="code"
    )
    moving: u1_array = register("1 for each that moves the head", length=MOST_OUTSTANDING)
    identified: u1 = register("1 once it has measured itself")
    measuring: u1 = register("1 while it does")
    next: u1 = register("what it is to do once it stands", unit="code")
    target: i4 = register("emitter that a move or a jog leads to", unit="emitter")
    speed: i2 = register("its speed value", unit="1/6 in/s")
    jogs: u1 = register("1 while it leads to the end of the travel")
    job: u1 = register("1 while a job is being printed")
    begun: i8 = register("pieces of it that have been begun", unit="count")
    done: i8 = register("pieces of it that are printed", unit="count")
    code: u1 = register("SB1 of what went wrong, 0 nothing", unit="code")
    bank: u1 = register("bank of the line buffer before the job")
    answered_us: i8 = register("time of the last answer", unit="us")
    began_us: i8_array = register("answer before each printed piece, by place in the tray", length=PIECES, unit="us")
    ended_us: i8_array = register("its own answer", length=PIECES, unit="us")
    tray: u1_array = register("pieces of the job", length=PIECES * PIECE, unit="code")


# ---------------------------------------------------------------------------------------------------- bytes


@hot_step
def is_sent(memory: HeadLive) -> bool:
    """All of the script has been sent and taken."""
    return memory.sent == memory.length and memory.acks == 0


@step
def note_sent(memory: HeadLive) -> None:
    """A command is sent whole: its answer is awaited."""
    k = memory.waiting
    memory.answers[k] = memory.tells if memory.sent == memory.length else NOTHING
    memory.moving[k] = is_run(memory.first)
    memory.waiting = k + 1


@hot_step
def is_run(first: int) -> int:
    """1 for the first byte of a command that moves the head to a position (`supervisor.MOTIONS`)."""
    return 1 if first in (0x8D, 0x92, 0xA2) else 0


@step
def may_begin(memory: HeadLive, first: int) -> bool:
    """Whether a command may be sent behind those without an answer."""
    motions = 0
    for k in range(memory.waiting):
        motions += memory.moving[k]
    return memory.waiting < MOST_OUTSTANDING and not (is_run(first) == 1 and motions > 1)


@step
def send_byte(p: HeadParams, c: HeadComputer, memory: HeadLive) -> None:
    """The next byte of the script, when the latch is free and the last one is acknowledged."""
    if memory.sent == memory.length or memory.acks or c.command_latch.flag:
        return
    byte = memory.script[memory.sent]
    if memory.left == 0:
        if not may_begin(memory, byte):
            return
        memory.first = byte
        memory.left = 1 + (byte & 7 if byte & 0x80 else 0)
    several = memory.first & 0x80
    write_latch(c.command_latch, byte)
    memory.sent += 1
    memory.left -= 1
    memory.acks = 1 if memory.left or (p.ack_last and several) else 0
    if memory.left == 0 and memory.acks == 0:
        note_sent(memory)


@step
def take_status(c: HeadComputer, memory: HeadLive, o: Operation) -> None:
    """One status byte: the acknowledgement of a byte, or the answer of the oldest command."""
    byte = read_latch(c.status.latch)
    if memory.acks and byte == ACKNOWLEDGE:
        memory.acks = 0
        if memory.left == 0:
            note_sent(memory)
    elif memory.waiting:
        tells = memory.answers[0]
        memory.waiting -= 1
        for k in range(memory.waiting):
            memory.answers[k], memory.moving[k] = memory.answers[k + 1], memory.moving[k + 1]
        take_answer(c, memory, o, tells, byte)
        memory.answered_us = c.now_us


@step
def take_answer(c: HeadComputer, memory: HeadLive, o: Operation, tells: int, code: int) -> None:
    """What an answer says about what was asked."""
    if tells == MEASURED:
        memory.measuring = 0
        if code in (OK, IMPLAUSIBLE):  # with implausible figures it keeps its defaults, and works with them
            memory.identified = 1
            o.trust = REFERENCED
    elif code != OK:
        memory.code = code
        o.answer.refused = NOT_DONE if c.state != FAULT else 0
    elif tells >= PRINTED:
        k = (tells - PRINTED) % PIECES
        memory.began_us[k], memory.ended_us[k] = memory.answered_us, c.now_us
        memory.done += 1
    elif tells == ARRIVED and memory.jogs == 0 and abs(c.emitter - memory.target) > MISSED:
        o.answer.refused = MISSED_TARGET


# ---------------------------------------------------------------------------------------------------- what it does


@hot_step
def put(memory: HeadLive, byte: int) -> None:
    """Append a byte to the script."""
    memory.script[memory.length] = byte
    memory.length += 1


@step
def begin_script(memory: HeadLive, tells: int) -> None:
    """A new script, whose last answer tells something."""
    memory.length = memory.sent = memory.left = memory.acks = 0
    memory.tells = tells


@step
def measure(memory: HeadLive) -> None:
    """CALCULATE PARAMETERS."""
    begin_script(memory, MEASURED)
    put(memory, 0x01)
    memory.measuring = 1
    memory.identified = 0


@step
def set_out(p: HeadParams, c: HeadComputer, memory: HeadLive) -> None:
    """RUN TILL the target, or below the speed of runs a SET SPEED and a CONTROLLED RUN."""
    begin_script(memory, ARRIVED)
    slowly = memory.speed < p.run_speed
    if slowly and memory.speed != c.maximum:
        put(memory, 0x99)
        put(memory, memory.speed)
    put(memory, 0xA2 if slowly else 0x92)
    put(memory, memory.target >> 8)
    put(memory, memory.target & 0xFF)


@step
def begin_job(p: HeadParams, c: HeadComputer, memory: HeadLive) -> None:
    """The first line finds the speed preselected that the file states, whatever a move has set since."""
    memory.job = 1
    memory.begun = memory.done = memory.code = 0
    memory.bank = c.columns.bank
    begin_script(memory, NOTHING)
    if c.maximum != p.print_speed:
        put(memory, 0x99)
        put(memory, p.print_speed)


@step
def begin_piece(c: HeadComputer, memory: HeadLive) -> None:
    """Fill the bank that is free with the next line's columns, and send its commands."""
    at = memory.begun % PIECES * PIECE
    bank = (memory.bank + memory.begun + 1) & 1
    for k in range(COLUMNS):
        c.buffer.ink[bank * COLUMNS + k] = memory.tray[at + HEAD + k]
    begin_script(memory, PRINTED + memory.begun)
    for k in range(memory.tray[at]):
        put(memory, memory.tray[at + 1 + k])
    memory.begun += 1


@step
def go_on_printing(c: HeadComputer, memory: HeadLive, o: Operation) -> None:
    """The next line as soon as that before the last one is printed, unless a pause holds it; the end of the job."""
    if memory.done == o.demand.number:
        memory.job = 0
    elif o.paused == 0 and memory.begun < min(o.demand.laid, o.demand.number) and is_sent(memory):
        before = PRINTED + memory.begun - 1  # the line that may still be printed, or wait
        if memory.waiting == 0 or memory.answers[0] == before:
            begin_piece(c, memory)


@step
def drop_all(memory: HeadLive) -> None:
    """Nothing is to be sent, done next, or printed."""
    begin_script(memory, NOTHING)
    memory.waiting = memory.next = memory.job = memory.measuring = memory.jogs = 0


@step
def stop_head(p: HeadParams, c: HeadComputer, memory: HeadLive) -> None:
    """Come to rest; the answer of what the head was doing tells nothing any more."""
    halt(p, c)
    drop_all(memory)
    if c.operation != NO_OPERATION:
        memory.answers[0], memory.moving[0], memory.waiting = NOTHING, 1, 1


@hot_step
def stands(p: HeadParams, c: HeadComputer, memory: HeadLive) -> bool:
    """Nothing is being done, sent or answered, and the head has rolled out."""
    quiet = c.command_latch.flag == 0 and c.status.latch.flag == 0 and c.status.waiting == 0
    quiet = quiet and c.now_us - c.last_emitter_us >= p.zero_speed_us
    return quiet and c.operation == NO_OPERATION and c.queue.waiting == 0 and memory.waiting == 0 and is_sent(memory)


@step
def speed_value(q: HeadLiveParams, p: HeadParams, o: Operation) -> int:
    """Speed value of a move or a jog: no faster than asked, but no slower than the slowest there is."""
    value = p.run_speed * o.demand.share
    if o.demand.do == RUN:
        value = min(abs(o.demand.velocity) / q.value, value)
    return min(max(int(value + 1e-9), SLOWEST), p.run_speed, FASTEST)


@step
def choose(q: HeadLiveParams, p: HeadParams, c: HeadComputer, memory: HeadLive, o: Operation) -> None:
    """A move, a jog, a homing or a job: what is to be done once the head stands."""
    d = o.demand
    if memory.measuring or memory.next == SEEK:
        o.answer.refused = MEASURING
        return
    if d.do != SEEK and c.homed == 0:
        o.answer.refused = UNREFERENCED
        return
    target, speed, jogs = 0, speed_value(q, p, o), 0
    if d.do == TRAVEL:
        target = min(max(round(d.target / q.emitter), 0), c.width)
    elif d.do == RUN:
        target = max(c.width - RESERVE, c.emitter) if d.velocity > 0.0 else min(RESERVE, c.emitter)
        jogs = 1
    if jogs and memory.jogs and memory.target == target and memory.speed == speed:
        return
    if not stands(p, c, memory):
        stop_head(p, c, memory)
    memory.target, memory.speed, memory.jogs, memory.next = target, speed, jogs, d.do


@step
def begin_next(p: HeadParams, c: HeadComputer, memory: HeadLive) -> None:
    """The head stands: do what was chosen."""
    do, memory.next = memory.next, 0
    if do == SEEK:
        measure(memory)
    elif do == WORK:
        begin_job(p, c, memory)
    else:
        set_out(p, c, memory)


@step
def obey_demand(q: HeadLiveParams, p: HeadParams, c: HeadComputer, memory: HeadLive, o: Operation) -> None:
    """What is freshly demanded."""
    d = o.demand
    if d.do == REST_OFF:
        switch_off(p, c)
        drop_all(memory)
    elif d.do == HOLD:
        if memory.identified == 0 or c.homed == 0:
            memory.next = SEEK
    elif d.do == HALT or (d.do == RUN and d.velocity == 0.0):
        stop_head(p, c, memory)
    else:
        choose(q, p, c, memory, o)


@step
def tell_how(q: HeadLiveParams, p: HeadParams, c: HeadComputer, memory: HeadLive, o: Operation) -> None:
    """How the head is: at rest nothing holds it but friction, and so it stands where it is commanded to."""
    a = o.answer
    a.position = a.commanded = c.emitter * q.emitter
    since = c.now_us - c.last_emitter_us
    moves = c.interval_us > 0 and since < p.zero_speed_us
    a.velocity = c.last_step * q.emitter * 1e6 / max(c.interval_us, since) if moves else 0.0
    a.commanded_velocity = a.velocity
    a.effort = c.drive_cmd / p.drive_limit
    a.limited = 1 if abs(c.drive_cmd) >= p.drive_limit else 0
    a.rests = 1 if memory.next == 0 and memory.job == 0 and stands(p, c, memory) else 0
    a.near = a.ready = 1
    a.fault = OBSTRUCTED if c.state == FAULT and memory.measuring == 0 and o.demand.do != REST_OFF else 0
    if c.homed == 0:
        o.trust = NOT_KNOWN


@serves(HeadLiveParams)
@step
def serve(
    q: HeadLiveParams, p: HeadParams, controller: PrintHeadController, _lines: PrintHeadLines, memory: HeadLive,
    o: Operation,
) -> None:  # fmt: skip
    """One look."""
    c = controller.head
    o.answer.refused = 0
    if c.status.latch.flag:
        take_status(c, memory, o)
    if o.demand.fresh:
        obey_demand(q, p, c, memory, o)
    if memory.job and memory.code:  # a line that the head does not take ends the job
        stop_head(p, c, memory)
    if memory.next and stands(p, c, memory):
        begin_next(p, c, memory)
    if memory.job:
        go_on_printing(c, memory, o)
    send_byte(p, c, memory)
    tell_how(q, p, c, memory, o)


# ---------------------------------------------------------------------------------------------------- the host's side


class HeadWork:
    """A print job, line by line, and the page that comes of it."""

    def __init__(self, spec: PrintHeadSpec, live: Live, job: PrintJob) -> None:
        params: Any = live.params
        state: Any = live.state
        if not state.controller.head.homed:
            raise AxisError("the head has not measured itself yet; wait until it rests, or home it")
        self.memory: Any = live.memory
        self.name = job.name
        self.printing = Printing(spec, job, params, state)
        self.printing.plan()
        self.printing.landed[:] = NOT_FIRED
        self._preselected, self._laid, self._booked = int(params.controller.print_speed), 0, 0
        self._column0, self._shown = params.controller.columns.column_zero / 256, dict[str, Any]()

    @property
    def pieces(self) -> int:
        """Lines of the job."""
        return len(self.printing.plans)

    @property
    def done(self) -> int:
        """Lines that are printed."""
        return min(int(self.memory.done), self._laid)

    @property
    def shown(self) -> dict[str, Any]:
        """The line under way: its number, its direction, and its glyphs, each with its left edge and width [m]."""
        if self.done >= self.pieces:
            return {}
        plan = self.printing.plans[self.done]
        if plan.line.number != self._shown.get("line"):
            wide, zero = EMITTERS_PER_COLUMN * EMITTER, self._column0 * EMITTER
            ink = [[c.char, zero + c.column * wide, c.ink_columns * wide] for c in plan.line.characters]
            self._shown = {"line": plan.line.number, "direction": plan.direction, "ink": ink}
        return self._shown

    def piece(self) -> bytes | None:
        """The next line, once its bank of the line buffer and its place in the tray are free."""
        self._book()
        if self._laid >= min(self._booked + AHEAD, self.pieces):
            return None
        plan, row = self.printing.plans[self._laid], np.zeros(PIECE, np.uint8)
        data = b"".join(one.data for one in line_commands(plan, self._preselected, self._laid))
        row[0], row[1 : 1 + len(data)] = len(data), list(data)
        for columns in inked(plan.line):
            row[HEAD + columns.start : HEAD + columns.stop] = 1
        self._preselected = plan.speed
        self._laid += 1
        return row.tobytes()

    def _book(self) -> None:
        """Read what finished lines have left on the paper."""
        memory = self.memory
        while self._booked < min(memory.done, self._laid):
            k, bank = self._booked % PIECES, (memory.bank + self._booked + 1) & 1
            # The answer was given at the end of a tick that its time is the beginning of.
            start, stop = (one[k] * 1e-6 + TICK for one in (memory.began_us, memory.ended_us))
            self.printing.book_line(self._booked, bank, start, stop)
            self.printing.landed[bank] = NOT_FIRED
            self._booked += 1

    def result(self) -> PrintRun:
        """The page as far as it has come."""
        self._book()
        if self.memory.code and not self.printing.result.failure:
            line = self.printing.plans[min(self._booked, self.pieces - 1)].line.number
            self.printing.fail(f"line {line}", self.memory.code)
        return self.printing.finish()


def live(spec: PrintHeadSpec, operation: Callable[..., OperationParams]) -> dict[str, Live]:
    """The head at power-on, to be operated; it looks in every tick, as its supervisor would."""
    machine, memory = print_head_machine(spec), HeadLive()
    head: Any = machine.state.controller.head
    q = HeadLiveParams(look_ticks=1, emitter=EMITTER, value=SPEED_STEP)
    q.operation = operation(TICK, 0.0, (0.0, spec.limits.travel), MOVE_TO, MOVE_BY, JOG, HOME, JOB, FEED)
    tray = np.ctypeslib.as_array(memory.tray).reshape(PIECES, PIECE)  # pyright: ignore[reportArgumentType, reportCallIssue]
    made: list[Live] = []

    def fault() -> str:
        return describe_sb1(OBSTRUCTION) if head.state == FAULT else ""

    def work(job: PrintJob) -> HeadWork:
        return HeadWork(spec, made[0], job)

    made.append(Live(
        machine.params, machine.state, q, memory, machine.tick, speed=spec.limits.speed,
        view={"title": "Print line", "data": {"states": STATE_NAMES}},
        fault=fault, tray=tray, work=work, text=parse_text, places=places(), fault_numbers={OBSTRUCTED: SATURATED},
    ))  # fmt: skip
    return {"": made[0]}
