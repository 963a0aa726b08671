"""The line protocol in the style of SCPI: common commands of IEEE 488.2, a tree of its own, a queue of errors.

Motions are overlapped commands: the next line is taken while they go on, ``*OPC?`` answers once all have ended. Headers
have a long and a short form, ``POSition?``; several commands in a line have ``;`` between them.
"""

import asyncio
import re
from collections import deque
from collections.abc import Awaitable, Callable
from importlib.metadata import version
from typing import Any

from detent.errors import DetentError
from detent.faces.service import BEYOND, READ_ONLY, AxisService, Desk, NotDoneError
from detent.faces.talk import Send, Talk, serve_lines

PORT = 5025
MOST_ERRORS = 30
POWER_ON, COMMAND, EXECUTION, DEVICE, COMPLETE = 128, 32, 16, 8, 1  # bits of the event status
QUEUE, EVENTS = 4, 32  # bits of the status byte
TEXTS = {
    0: "No error", -108: "Parameter not allowed", -109: "Missing parameter", -113: "Undefined header",
    -104: "Data type error", -200: "Execution error", -203: "Command protected", -222: "Data out of range",
    -350: "Queue overflow",
}  # fmt: skip


class ScpiError(Exception):
    """A command that is no such, by its number."""

    def __init__(self, code: int, more: str = "") -> None:
        self.code, self.more = code, more
        super().__init__(code)


Handler = Callable[["Scpi", list[str]], Awaitable[str | None]]
COMMANDS: dict[str, tuple[Handler, int, int, str]] = {}
"""By its header: what does it, least and most parameters, and what it is for."""


def command(header: str, about: str, least: int = 0, most: int | None = None) -> Callable[[Handler], Handler]:
    """Declare a command."""

    def declare(handler: Handler) -> Handler:
        COMMANDS[header] = (handler, least, least if most is None else most, about)
        return handler

    return declare


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
        for pattern, (handler, least, most, _about) in PATTERNS:
            if pattern.fullmatch(header):
                values = [one.strip() for one in said.split(",")] if said.strip() else []
                if not least <= len(values) <= most:
                    raise ScpiError(-109 if len(values) < least else -108, header)
                return await handler(self, values)
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

    async def rest(self) -> None:
        """Wait until all that was begun has ended."""
        while self._pending:
            await asyncio.wait(self._pending)

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
    return {READ_ONLY: -203, BEYOND: -222}.get(error.code, -200)


# ---- IEEE 488.2


@command("*IDN?", "maker, name of the axis, its method, version")
async def _(talk: Scpi, _values: list[str]) -> str:
    return f"detent,{talk.axis.about['name'].replace(',', ' ')},{talk.axis.about['method']},{version('detent')}"


@command("*CLS", "forget errors and events")
async def _(talk: Scpi, _values: list[str]) -> None:
    talk.clear()


@command("*ESR?", "event status: 128 power on, 32 command, 16 execution, 8 device error, 1 complete")
async def _(talk: Scpi, _values: list[str]) -> str:
    return str(talk.events())


@command("*ESE", "events that show in the status byte", 1)
async def _(talk: Scpi, values: list[str]) -> None:
    talk.mask(values[0], "enabled_events")


@command("*ESE?", "which these are")
async def _(talk: Scpi, _values: list[str]) -> str:
    return str(talk.enabled_events)


@command("*SRE", "bits of the status byte that ask for service; nobody is asked", 1)
async def _(talk: Scpi, values: list[str]) -> None:
    talk.mask(values[0], "service")


@command("*SRE?", "which these are")
async def _(talk: Scpi, _values: list[str]) -> str:
    return str(talk.service)


@command("*STB?", "status byte: 4 errors wait, 32 an enabled event has come")
async def _(talk: Scpi, _values: list[str]) -> str:
    return str(talk.status_byte())


@command("*OPC", "set the bit of completion once all motions have ended")
async def _(talk: Scpi, _values: list[str]) -> None:
    talk.complete_later()


@command("*OPC?", "1, once all motions have ended")
async def _(talk: Scpi, _values: list[str]) -> str:
    await talk.rest()
    return "1"


@command("*WAI", "take the next command once all motions have ended")
async def _(talk: Scpi, _values: list[str]) -> None:
    await talk.rest()


@command("*RST", "stop; errors and settings of the client are those at its beginning")
async def _(talk: Scpi, _values: list[str]) -> None:
    talk.clear()
    talk.axis = talk.axes[0]
    await talk.stop()


@command("*TST?", "0 where no fault stands, else its number")
async def _(talk: Scpi, _values: list[str]) -> str:
    return str(talk.axis.fault)


# ---- the axis


@command("ENABle", "take torque; the first motion of a simulated axis is confirmed with it")
async def _(talk: Scpi, _values: list[str]) -> None:
    await talk.axis.enable()


@command("DISable", "take the torque away")
async def _(talk: Scpi, _values: list[str]) -> None:
    await talk.axis.do("disable")


@command("CONFirm", "the first motion went as expected: full speed")
async def _(talk: Scpi, _values: list[str]) -> None:
    await talk.axis.do("confirm")


@command("STOP", "come to rest, and hold: all axes")
async def _(talk: Scpi, _values: list[str]) -> None:
    await talk.stop()


@command("INSTrument:CATalog?", "names of the axes, of a file with several motors")
async def _(talk: Scpi, _values: list[str]) -> str:
    return ",".join(f'"{axis.motor}"' for axis in talk.axes)


@command("INSTrument:SELect", "the axis that what follows is about: its name, quoted or not", 1)
async def _(talk: Scpi, values: list[str]) -> None:
    name = values[0].strip("\"'")
    named = [axis for axis in talk.axes if axis.motor == name]
    if not named:
        raise ScpiError(-222, f"{name:.20}: {', '.join(axis.motor for axis in talk.axes)}")
    talk.axis = named[0]


@command("INSTrument:SELect?", "which that is")
async def _(talk: Scpi, _values: list[str]) -> str:
    return f'"{talk.axis.motor}"'


@command("RESet", "leave a fault")
async def _(talk: Scpi, _values: list[str]) -> None:
    await talk.axis.do("reset")


@command("TAKE", "take over the command")
async def _(talk: Scpi, _values: list[str]) -> None:
    await talk.axis.do("take")


@command("LEAVE", "give it back")
async def _(talk: Scpi, _values: list[str]) -> None:
    await talk.axis.do("leave")


@command("HOME", "find the reference")
async def _(talk: Scpi, _values: list[str]) -> None:
    await talk.overlap("home")


@command("MOVE:ABSolute", "go to a position, at a speed [unit/s]", 1, 2)
async def _(talk: Scpi, values: list[str]) -> None:
    await talk.overlap("move_to", talk.value(values[0]), talk.share(values))


@command("MOVE:RELative", "go by a way, at a speed [unit/s]", 1, 2)
async def _(talk: Scpi, values: list[str]) -> None:
    await talk.overlap("move_by", talk.value(values[0]), talk.share(values))


@command("JOG", "move at a velocity [unit/s] until STOP, or until the connection ends", 1)
async def _(talk: Scpi, values: list[str]) -> None:
    await talk.overlap("jog", talk.value(values[0], "per second"))
    talk.axis.keep()


@command("TRUSt", "0 position unknown, 1 restored, 2 referenced", 1)
async def _(talk: Scpi, values: list[str]) -> None:
    if values[0] not in ("0", "1", "2"):
        raise ScpiError(-222, f"{values[0]}: 0, 1 or 2")
    await talk.axis.do("trust", int(values[0]))


@command("POSition?", "position")
async def _(talk: Scpi, _values: list[str]) -> str:
    await talk.axis.refresh()
    return shown(talk.axis.position)


@command("VELocity?", "velocity [unit/s]")
async def _(talk: Scpi, _values: list[str]) -> str:
    await talk.axis.refresh()
    return shown(talk.axis.velocity)


@command("STATe?", "state, as CiA 402 names it")
async def _(talk: Scpi, _values: list[str]) -> str:
    await talk.axis.refresh()
    return f'"{talk.axis.status["state"]}"'


@command("MOVing?", "1 until what is under way is done")
async def _(talk: Scpi, _values: list[str]) -> str:
    await talk.axis.refresh()
    return str(int(talk.axis.moving))


@command("TRUSt?", "trust in the position: unknown, restored, referenced")
async def _(talk: Scpi, _values: list[str]) -> str:
    return f'"{talk.axis.status["trust"]}"'


@command("FAULt?", "number and sentence of the fault")
async def _(talk: Scpi, _values: list[str]) -> str:
    await talk.axis.refresh()
    text = talk.axis.fault_text.replace('"', "'")
    return f'{talk.axis.fault},"{text}"'


@command("SAMPle?", "number of a period, and in it state, position, trust and fault, as all faces show them")
async def _(talk: Scpi, _values: list[str]) -> str:
    return str(talk.axis.sample)


@command("LIMits?", "soft limits; two numbers that are none where there are none")
async def _(talk: Scpi, _values: list[str]) -> str:
    low, high = talk.axis.limits or (9.91e37, 9.91e37)  # not a number, as SCPI writes it
    return f"{shown(low)},{shown(high)}"


@command("SPEed:MAXimum?", "largest speed [unit/s]")
async def _(talk: Scpi, _values: list[str]) -> str:
    return shown(talk.axis.speed)


@command("UNIT?", "unit of positions")
async def _(talk: Scpi, _values: list[str]) -> str:
    return talk.axis.unit.upper()


@command("SYSTem:ERRor?", "the oldest error, which leaves the queue")
async def _(talk: Scpi, _values: list[str]) -> str:
    return talk.error()


@command("SYSTem:VERSion?", "year of the SCPI that headers follow")
async def _(_talk: Scpi, _values: list[str]) -> str:
    return "1999.0"


@command("HELP?", "all headers")
async def _(_talk: Scpi, _values: list[str]) -> str:
    return ",".join(COMMANDS)


PATTERNS = [(pattern_of(header), done) for header, done in COMMANDS.items()]


def shown(value: float) -> str:
    """A number of the axis, without what its unit has left behind the twelfth digit."""
    return f"{value:.12g}"


async def serve(desk: Desk, address: str) -> list[str]:
    """Serve; gives what a client needs."""
    (place,) = await serve_lines(desk, address, Scpi, PORT)
    if address == "pty":
        return [f"ASRL{place}::INSTR", place]
    host, _, port = place.rpartition(":")
    return [f"TCPIP0::{host}::{port}::SOCKET", place]
