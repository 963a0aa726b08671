"""The line protocol in the style of SCPI: common commands of IEEE 488.2, a tree of its own, a queue of errors.

Motions are overlapped commands: the next line is taken while they go on, ``*OPC?`` answers once all have ended. Headers
have a long and a short form, ``POSition?``; several commands in a line have ``;`` between them.
"""

import asyncio
import re
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from inspect import isawaitable
from typing import Any

from detent.errors import ON_LOCAL, DetentError
from detent.faces.service import BEYOND, READ_ONLY, AxisService, Desk, NotDoneError
from detent.faces.talk import Send, Talk, serve_lines

PORT = 5025
MOST_ERRORS = 30
NO_NUMBER = 9.91e37  # as SCPI writes it
POWER_ON, COMMAND, EXECUTION, DEVICE, COMPLETE = 128, 32, 16, 8, 1  # bits of the event status
QUEUE, EVENTS = 4, 32  # bits of the status byte
TEXTS = {
    0: "No error", -108: "Parameter not allowed", -109: "Missing parameter", -113: "Undefined header",
    -104: "Data type error", -200: "Execution error", -201: "Invalid while in local",
    -203: "Command protected", -222: "Data out of range",
    -350: "Queue overflow",
}  # fmt: skip


class ScpiError(Exception):
    """A command that is no such, by its number."""

    def __init__(self, code: int, more: str = "") -> None:
        self.code, self.more = code, more
        super().__init__(code)


def pattern_of(header: str) -> re.Pattern[str]:
    """Both forms of every word of a header.

    >>> bool(pattern_of("MOVE:ABSolute").fullmatch("move:abs")), bool(pattern_of("MOVE:ABSolute").fullmatch("mov:abs"))
    (True, False)
    """
    words: list[str] = []
    for word in header.rstrip("?").split(":"):
        short = "".join(c for c in word if not c.islower())
        rest = re.escape(word[len(short) :])
        words.append(re.escape(short) + (f"(?:{rest})?" if rest else ""))
    return re.compile(":?" + ":".join(words) + (r"\?" if header.endswith("?") else ""), re.IGNORECASE)


class Scpi(Talk):
    """One client."""

    def __init__(self, axes: tuple[AxisService, ...], send: Send) -> None:
        super().__init__(axes, send)
        self._errors: deque[tuple[int, str]] = deque()
        self._events, self.enabled_events, self.service = POWER_ON, 0, 0
        self._pending: set[asyncio.Future[None]] = set()
        self._tell_complete = False

    def stops(self, line: str) -> bool:
        """A stop overtakes."""
        return line.strip().lstrip(":").upper() in ("STOP", "*RST", "DISABLE", "DIS")

    def leave(self) -> None:
        """What was under way ends with the connection."""
        for task in self._pending:
            task.cancel()

    async def answer(self, line: str) -> None:
        """All commands of a line; what they answer comes in one line."""
        answers: list[str] = []
        for part in filter(None, (part.strip() for part in line.split(";"))):
            try:
                told = await self._do(part)
            except ScpiError as error:
                self._note(error.code, error.more)
            except NotDoneError as error:
                self._note(code_of(error), str(error))
            except DetentError as error:  # a value that no axis could have
                self._note(-104, str(error))
            else:
                answers += [] if told is None else [told]
        if answers:
            self.send(";".join(answers))

    async def _do(self, part: str) -> str | None:
        header, _, said = part.partition(" ")
        values = [one.strip() for one in said.split(",")] if said.strip() else []
        for pattern, command in PATTERNS:
            if pattern.fullmatch(header):
                if not command.least <= len(values) <= max(command.least, command.most):
                    raise ScpiError(-109 if len(values) < command.least else -108, header)
                if command.fresh:
                    await self.axis.refresh()
                told = command.done(self, values)
                told = await told if isawaitable(told) else told
                return None if told is None else str(told)
        raise ScpiError(-113, header[:40])

    def _note(self, code: int, more: str = "") -> None:
        self._events |= {1: COMMAND, 2: EXECUTION, 3: DEVICE}[-code // 100]
        if len(self._errors) >= MOST_ERRORS:
            self._errors[-1] = (-350, "")
        else:
            self._errors.append((code, more.replace('"', "'")))

    # ---- motions

    async def stop(self) -> None:
        """Every axis comes to rest."""
        await asyncio.gather(*(axis.stop() for axis in self.axes))

    async def overlap(self, word: str, value: object = None, speed: float = 1.0) -> None:
        """Begin what takes its time; that it was not done is found in the queue of errors."""
        axis = self.axis
        task = asyncio.ensure_future(self._end(axis, word, await axis.start(word, value, speed)))
        self._pending.add(task)
        task.add_done_callback(self._pending.discard)

    async def _end(self, axis: AxisService, word: str, ending: "asyncio.Future[dict[str, Any]]") -> None:
        try:
            await axis.ended(word, ending)
        except NotDoneError as error:
            if error.how != "aborted":  # a stop is no error
                self._note(code_of(error), str(error))
        if self._tell_complete and len(self._pending) <= 1:
            self._events |= COMPLETE
            self._tell_complete = False

    async def move(self, word: str, values: list[str]) -> None:
        """Begin a move: where to, or how far, and perhaps how fast."""
        await self.overlap(word, self.value(values[0]), self.share(values))

    async def jog(self, velocity: str) -> None:
        """Begin a jog, and keep it."""
        await self.overlap("jog", self.value(velocity, "per second"))
        self.axis.keep()

    async def trust(self, level: str) -> None:
        """Say how far the position is to be trusted."""
        if level not in ("0", "1", "2"):
            raise ScpiError(-222, f"{level}: 0, 1 or 2")
        await self.axis.do("trust", int(level))

    async def restart(self) -> None:
        """Stop, and be as at the beginning."""
        self.clear()
        self.axis = self.axes[0]
        await self.stop()

    def select(self, name: str) -> None:
        """What follows is about an axis."""
        named = {axis.motor: axis for axis in self.axes}
        if name not in named:
            raise ScpiError(-222, f"{name:.20}: {', '.join(named)}")
        self.axis = named[name]

    async def rest(self, answer: str | None = None) -> str | None:
        """Wait until all that was begun has ended."""
        while self._pending:
            await asyncio.wait(self._pending)
        return answer

    def identity(self) -> str:
        """Who this is."""
        about = self.axis.about
        return f"detent,{about['name'].replace(',', ' ')},{about['method']},{version('detent')}"

    def value(self, text: str, per_second: str = "") -> object:
        """A number in units of the face, or a quantity with a unit of its own, as the axis takes it."""
        try:
            return self.axis.in_si(float(text))
        except ValueError:
            if re.match(r"[-+.\d]", text) and " " in text:
                return text  # "5 mm": the axis reads it, and says what is wrong with it
            raise ScpiError(-104, f"{text} {per_second}".strip()) from None

    def share(self, values: list[str]) -> float:
        """Speed of a move, its second parameter [unit/s]."""
        if len(values) < 2:
            return 1.0
        try:
            speed = float(values[1])
        except ValueError:
            raise ScpiError(-104, values[1]) from None
        if not 0.0 < speed <= self.axis.speed * (1 + 1e-9):
            raise ScpiError(-222, f"speed {values[1]}: above 0 to {self.axis.speed:g} {self.axis.unit}/s")
        return self.axis.share(speed)

    def error(self) -> str:
        """The oldest error, which leaves the queue."""
        code, more = self._errors.popleft() if self._errors else (0, "")
        return f'{code},"{TEXTS[code]}{"; " + more if more else ""}"'

    def clear(self) -> None:
        """Forget errors and events."""
        self._errors.clear()
        self._events = 0
        self._tell_complete = False

    def events(self) -> int:
        """The event status, which is 0 then."""
        events, self._events = self._events, 0
        return events

    def status_byte(self) -> int:
        """The status byte: errors wait, or an event that is enabled has come."""
        return QUEUE * bool(self._errors) | EVENTS * bool(self._events & self.enabled_events)

    def complete_later(self) -> None:
        """Set the bit once all has ended."""
        if self._pending:
            self._tell_complete = True
        else:
            self._events |= COMPLETE

    def mask(self, text: str, name: str) -> None:
        """Set a mask of events or of the status byte."""
        if not (text.isascii() and text.isdigit() and int(text) < 256):
            raise ScpiError(-222, f"{text}: 0 to 255")
        setattr(self, name, int(text))


def code_of(error: NotDoneError) -> int:
    """Number of the error that a command has ended in."""
    return {READ_ONLY: -203, ON_LOCAL: -201, BEYOND: -222}.get(error.code, -200)


def shown(*values: float) -> str:
    """Numbers of the axis, without what its unit has left behind the twelfth digit."""
    return ",".join(f"{value:.12g}" for value in values)


def quoted(text: str) -> str:
    """A text as an answer."""
    return '"' + text.replace('"', "'") + '"'


@dataclass(frozen=True, slots=True)
class Command:
    """A header, what it is for, what it does and answers, and how many parameters it takes."""

    header: str
    about: str
    done: Callable[[Scpi, list[str]], Any]
    least: int = 0
    most: int = 0
    fresh: bool = False  # it shows the axis now, not as it was up to a fiftieth of a second ago


IEEE_488_2: tuple[Command, ...] = (
    Command("*IDN?", "maker, name of the axis, its method, version", lambda t, _: t.identity()),
    Command("*CLS", "forget errors and events", lambda t, _: t.clear()),
    Command("*ESR?", "event status: 128 power on, 32 command, 16 execution, 8 device error, 1 complete",
            lambda t, _: t.events()),
    Command("*ESE", "events that show in the status byte", lambda t, v: t.mask(v[0], "enabled_events"), 1),
    Command("*ESE?", "which these are", lambda t, _: t.enabled_events),
    Command("*SRE", "bits of the status byte that ask for service; nobody is asked",
            lambda t, v: t.mask(v[0], "service"), 1),
    Command("*SRE?", "which these are", lambda t, _: t.service),
    Command("*STB?", "status byte: 4 errors wait, 32 an enabled event has come", lambda t, _: t.status_byte()),
    Command("*OPC", "set the bit of completion once all motions have ended", lambda t, _: t.complete_later()),
    Command("*OPC?", "1, once all motions have ended", lambda t, _: t.rest(answer="1")),
    Command("*WAI", "take the next command once all motions have ended", lambda t, _: t.rest()),
    Command("*RST", "stop; errors and settings of the client are those at its beginning", lambda t, _: t.restart()),
    Command("*TST?", "0 where no fault stands, else its number", lambda t, _: t.axis.fault),
)  # fmt: skip
ACTIONS: tuple[Command, ...] = (
    Command("ENABle", "take torque; the first motion of a simulated axis is confirmed with it",
            lambda t, _: t.axis.enable()),
    Command("DISable", "take the torque away", lambda t, _: t.axis.do("disable")),
    Command("CONFirm", "the first motion went as expected: full speed", lambda t, _: t.axis.do("confirm")),
    Command("STOP", "come to rest, and hold: all axes", lambda t, _: t.stop()),
    Command("INSTrument:SELect", "the axis that what follows is about: its name, quoted or not",
            lambda t, v: t.select(v[0].strip("\"'")), 1),
    Command("RESet", "leave a fault", lambda t, _: t.axis.do("reset")),
    Command("TAKE", "take over the command", lambda t, _: t.axis.do("take")),
    Command("LEAVE", "give it back", lambda t, _: t.axis.do("leave")),
    Command("HOME", "find the reference", lambda t, _: t.overlap("home")),
    Command("MOVE:ABSolute", "go to a position, at a speed [unit/s]", lambda t, v: t.move("move_to", v), 1, 2),
    Command("MOVE:RELative", "go by a way, at a speed [unit/s]", lambda t, v: t.move("move_by", v), 1, 2),
    Command("JOG", "move at a velocity [unit/s] until STOP, or until the connection ends", lambda t, v: t.jog(v[0]), 1),
    Command("TRUSt", "0 position unknown, 1 restored, 2 referenced", lambda t, v: t.trust(v[0]), 1),
    Command("SYSTem:REMote", "only faces command, panel and programs do not",
            lambda t, _: t.axis.do("selector", "remote")),
    Command("SYSTem:LOCal", "they command again, too", lambda t, _: t.axis.do("selector", "both")),
)  # fmt: skip
QUESTIONS: tuple[Command, ...] = (
    Command("INSTrument:CATalog?", "names of the axes, of a file with several motors",
            lambda t, _: ",".join(quoted(axis.motor) for axis in t.axes)),
    Command("INSTrument:SELect?", "which one is selected", lambda t, _: quoted(t.axis.motor)),
    Command("POSition?", "position", lambda t, _: shown(t.axis.position), fresh=True),
    Command("VELocity?", "velocity [unit/s]", lambda t, _: shown(t.axis.velocity), fresh=True),
    Command("STATe?", "state, as CiA 402 names it", lambda t, _: quoted(t.axis.status["state"]), fresh=True),
    Command("MOVing?", "1 until what is under way is done", lambda t, _: int(t.axis.moving), fresh=True),
    Command("TRUSt?", "trust in the position: unknown, restored, referenced",
            lambda t, _: quoted(t.axis.status["trust"])),
    Command("FAULt?", "number and sentence of the fault",
            lambda t, _: f"{t.axis.fault},{quoted(t.axis.fault_text)}", fresh=True),
    Command("SAMPle?", "number of a period, and in it state, position, trust and fault, as all faces show them",
            lambda t, _: t.axis.sample),
    Command("LIMits?", "soft limits; two numbers that are none where there are none",
            lambda t, _: shown(*(t.axis.limits or (NO_NUMBER, NO_NUMBER)))),
    Command("SPEed:MAXimum?", "largest speed [unit/s]", lambda t, _: shown(t.axis.speed)),
    Command("UNIT?", "unit of positions", lambda t, _: t.axis.unit.upper()),
    Command("SYSTem:SELector?", "who may command: both, local or remote",
            lambda t, _: quoted(t.axis.status["selector"]), fresh=True),
    Command("SYSTem:ERRor?", "the oldest error, which leaves the queue", lambda t, _: t.error()),
    Command("SYSTem:VERSion?", "year of the SCPI that headers follow", lambda _, __: "1999.0"),
    Command("HELP?", "all headers", lambda _, __: ",".join(one.header for one in COMMANDS)),
)  # fmt: skip
COMMANDS: tuple[Command, ...] = (*IEEE_488_2, *ACTIONS, *QUESTIONS)
PATTERNS: list[tuple[re.Pattern[str], Command]] = [(pattern_of(one.header), one) for one in COMMANDS]


async def serve(desk: Desk, address: str) -> list[str]:
    """Serve; gives what a client needs."""
    (place,) = await serve_lines(desk, address, Scpi, PORT)
    if address == "pty":
        return [f"ASRL{place}::INSTR", place]
    host, _, port = place.rpartition(":")
    return [f"TCPIP0::{host}::{port}::SOCKET", place]
