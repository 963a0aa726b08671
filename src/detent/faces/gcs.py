"""GCS 2.0 as PI's controllers speak it: the part of it that moves axes, called "1" and, of several motors, so on."""

import asyncio
from collections.abc import Awaitable, Callable, Iterable, Mapping
from importlib.metadata import version
from typing import Any

from detent.errors import ON_LOCAL, DetentError
from detent.faces.service import BEYOND, READ_ONLY, UNREFERENCED, AxisService, Desk, NotDoneError
from detent.faces.talk import Send, Talk, serve_lines

PORT = 50000
SYNTAX, UNKNOWN, UNMOVABLE, OUTSIDE, TOO_FAST, STOPPED, NO_AXIS, BY_HAND, PROTECTED = 1, 2, 5, 7, 8, 10, 15, 51, 63
"""Numbers of errors, as PI's manuals have them."""
MOTION, READY, STATUS, HALT = 5, 7, 4, 24  # characters that stand for themselves
IN_ERRORS = {
    BEYOND: OUTSIDE, UNREFERENCED: UNMOVABLE, 101: UNMOVABLE, 102: UNMOVABLE, READ_ONLY: PROTECTED, ON_LOCAL: BY_HAND,
}  # fmt: skip


class GcsError(Exception):
    """A line that is not done."""

    def __init__(self, code: int) -> None:
        self.code = code
        super().__init__(code)


class Gcs(Talk):
    """One client."""

    def __init__(self, axes: tuple[AxisService, ...], send: Send) -> None:
        super().__init__(axes, send)
        self.number = 0
        self.named = {str(k): axis for k, axis in enumerate(axes, 1)}
        self.speeds = {name: axis.speed for name, axis in self.named.items()}
        self._begun: dict[str, asyncio.Future[None]] = {}

    def stops(self, line: str) -> bool:
        """STP and HLT overtake."""
        return line.partition(" ")[0].upper() in ("STP", "HLT")

    def urgent(self, byte: int) -> bool:
        """Single characters: is it moving, is it ready, its status, stop."""
        if byte == MOTION:
            self.send(format(sum(self._moves(name) << k for k, name in enumerate(self.named)), "x"))
        elif byte == READY:
            self._send(b"\xb1\n")
        elif byte == STATUS:
            self.send(" ".join(f"0x{self.status_word(name):x}" for name in self.named))
        elif byte == HALT:
            task = asyncio.ensure_future(self.answer("STP"))
            self._stopping = task
        else:
            return False
        return True

    def _moves(self, name: str) -> bool:
        return self.named[name].moving or (name in self._begun and not self._begun[name].done())

    def status_word(self, name: str) -> int:
        """As the table of SRG? and #4 has it: limits, reference, error, servo, moving, on target."""
        axis = self.named[name]
        bits = {
            0x0001: axis.at_end == "lower", 0x0004: axis.at_end == "upper", 0x0100: axis.fault != 0,
            0x1000: axis.enabled, 0x2000: self._moves(name), 0x8000: bool(axis.status["in_window"]),
        }  # fmt: skip
        return sum(bit for bit, is_set in bits.items() if is_set)

    async def answer(self, line: str) -> None:
        """One command."""
        word, *values = line.split()
        try:
            handler = HANDLERS.get(word.upper())
            if handler is None:
                raise GcsError(UNKNOWN)  # noqa: TRY301 - one place that keeps the number
            await asyncio.gather(*(axis.refresh() for axis in self.axes))
            told = await handler(self, values)
        except GcsError as error:
            self.number = error.code
        except NotDoneError as error:
            self.number = IN_ERRORS.get(error.code, error.code if error.code > 1000 else UNMOVABLE)
        except (DetentError, ValueError):
            self.number = SYNTAX
        else:
            if told is not None:
                lines = told.split("\n")
                self.send(" \n".join(lines))

    # ---- what handlers share

    def pairs(self, values: list[str]) -> list[tuple[str, float]]:
        """Axes with the value that is given for each."""
        if not values or len(values) % 2:
            raise GcsError(SYNTAX)
        return list(zip(self.asked(values[::2]), map(float, values[1::2]), strict=True))

    def asked(self, values: list[str]) -> list[str]:
        """Axes that are named, or none, which means all of them."""
        if any(value not in self.named for value in values):
            raise GcsError(NO_AXIS)
        return values or list(self.named)

    async def begin(self, name: str, word: str, value: float | None = None) -> None:
        """Begin a motion: GCS waits for none."""
        axis = self.named[name]
        if not axis.enabled:
            raise GcsError(UNMOVABLE)
        ending = await axis.start(word, value, axis.share(self.speeds[name]))
        self._begun[name] = asyncio.ensure_future(self._end(axis, word, ending))

    async def move(self, targets: list[tuple[str, float]]) -> None:
        """Go; one that is beyond its limits keeps all of them where they are."""
        for name, target in targets:
            low, high = _limits(self.named[name])
            if not low <= target <= high:
                raise GcsError(OUTSIDE)
        for name, target in targets:
            axis = self.named[name]
            axis.target = target
            await self.begin(name, "move_to", axis.in_si(target))

    async def _end(self, axis: AxisService, word: str, ending: "asyncio.Future[dict[str, Any]]") -> None:
        try:
            await axis.ended(word, ending)
        except NotDoneError as error:
            if error.how != "aborted":
                self.number = IN_ERRORS.get(error.code, UNMOVABLE)


Handler = Callable[[Gcs, list[str]], Awaitable[str | None]]
HANDLERS: dict[str, Handler] = {}
HELP: dict[str, str] = {}


def command(word: str, about: str) -> Callable[[Handler], Handler]:
    """Declare a command."""

    def declare(handler: Handler) -> Handler:
        HANDLERS[word], HELP[word] = handler, about
        return handler

    return declare


def shows(word: str, about: str, value: Callable[[AxisService], object]) -> None:
    """Declare a question about axes."""

    async def show(talk: Gcs, values: list[str]) -> str:
        return answered({name: value(talk.named[name]) for name in talk.asked(values)})

    command(word, about)(show)


def answered(values: Mapping[str, object]) -> str:
    """What is answered of axes: a line of each."""
    return "\n".join(
        f"{name}={value:.7f}" if isinstance(value, float) else f"{name}={value}" for name, value in values.items()
    )


def _limits(axis: AxisService) -> tuple[float, float]:
    return axis.limits or (-1e9, 1e9)


shows("POS?", "get real position", lambda axis: axis.position)
shows("MOV?", "get target position", lambda axis: axis.target)
shows("ONT?", "get on-target state", lambda axis: int(not axis.moving and bool(axis.status["in_window"])))
shows("SVO?", "get servo mode", lambda axis: int(axis.enabled))
shows("FRF?", "get referencing result", lambda axis: int(axis.homed))
shows("TMN?", "get minimum commandable position", lambda axis: _limits(axis)[0])
shows("TMX?", "get maximum commandable position", lambda axis: _limits(axis)[1])
shows("CST?", "get stage type", lambda axis: axis.about["name"].replace(" ", "_"))
shows("PUN?", "get position unit", lambda axis: axis.unit)
shows("TRS?", "indicate reference switch", lambda axis: int("home" in axis.about["commands"]))
shows("LIM?", "indicate limit switches", lambda _axis: 0)
shows("RON?", "get reference mode", lambda _axis: 1)
shows("TCV?", "get commanded velocity", lambda axis: axis.velocity)
shows("OVF?", "get overflow state", lambda axis: int(axis.status["limited"]))


@command("*IDN?", "get device identification")
async def _(talk: Gcs, _values: list[str]) -> str:
    name = talk.axis.about["name"].replace(",", " ")
    return f"(c)detent, GCS 2.0 face of {name}, 0, {version('detent')}"


@command("VER?", "get versions")
async def _(_talk: Gcs, _values: list[str]) -> str:
    return f"detent: {version('detent')}"


@command("CSV?", "get current syntax version")
async def _(_talk: Gcs, _values: list[str]) -> str:
    return "2.0"


@command("SAI?", "get list of current axis identifiers")
async def _(talk: Gcs, _values: list[str]) -> str:
    return "\n".join(talk.named)


@command("HLP?", "get list of available commands")
async def _(_talk: Gcs, _values: list[str]) -> str:
    return "\n".join(
        ["The following commands are valid:", *(f"{word} {told}" for word, told in HELP.items()), "end of help"]
    )


@command("ERR?", "get error number")
async def _(talk: Gcs, _values: list[str]) -> str:
    error, talk.number = talk.number, 0
    return str(error)


@command("SVO", "set servo mode")
async def _(talk: Gcs, values: list[str]) -> None:
    for name, on in talk.pairs(values):
        await (talk.named[name].enable() if on else talk.named[name].do("disable"))


@command("MOV", "set target position")
async def _(talk: Gcs, values: list[str]) -> None:
    await talk.move(talk.pairs(values))


@command("MVR", "set target relative to current position")
async def _(talk: Gcs, values: list[str]) -> None:
    await talk.move([(name, talk.named[name].target + way) for name, way in talk.pairs(values)])


@command("VEL", "set closed-loop velocity")
async def _(talk: Gcs, values: list[str]) -> None:
    speeds = talk.pairs(values)
    if any(not 0.0 < speed <= talk.named[name].speed * (1 + 1e-9) for name, speed in speeds):
        raise GcsError(TOO_FAST)
    talk.speeds |= speeds


@command("VEL?", "get closed-loop velocity")
async def _(talk: Gcs, values: list[str]) -> str:
    return answered({name: talk.speeds[name] for name in talk.asked(values)})


@command("FRF", "start reference move to reference switch")
async def _(talk: Gcs, values: list[str]) -> None:
    for name in talk.asked(values):
        axis = talk.named[name]
        if "home" in axis.about["commands"]:
            await talk.begin(name, "home")
        else:  # an axis that cannot look for its reference has a person's word for it
            await axis.do("trust", 2)
        axis.target = axis.position


async def _halt(talk: Gcs, axes: Iterable[AxisService]) -> None:
    talk.number = STOPPED  # at once: who asks for it does not wait for rest
    stopped = list(axes)
    await asyncio.gather(*(axis.stop() for axis in stopped))
    for axis in stopped:
        axis.target = axis.commanded


@command("STP", "stop all axes abruptly")
async def _(talk: Gcs, _values: list[str]) -> None:
    await _halt(talk, talk.axes)


@command("HLT", "halt motion smoothly")
async def _(talk: Gcs, values: list[str]) -> None:
    await _halt(talk, [talk.named[name] for name in talk.asked(values)])


@command("SAMPLE?", "number of a period, and in it state, position, trust and fault, as all faces show them")
async def _(talk: Gcs, _values: list[str]) -> str:
    return "\n".join(str(axis.sample) for axis in talk.axes)


async def serve(desk: Desk, address: str) -> list[str]:
    """Serve; gives what a client needs."""
    return await serve_lines(desk, address, Gcs, PORT)
