"""What every face stands on: one client of a live axis, in the units of its users, for a program of many tasks.

A face knows no method. It enables, homes, moves, jogs, stops, sets trust and reads; how often the axis is asked for all
that does not depend on how many clients the face has, for they share the newest sample.
"""

import asyncio
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from detent.errors import ON_LOCAL, AxisError, DetentError
from detent.operate.line import PATIENCE, Line

RATE = 50.0  # samples that are shown in a second
LOOK = 2e-3  # how often it is looked whether a motion has begun [s]
KEEP = 0.05  # how often a jog is kept on behalf of who holds it [s]
MOVES = "move to", "move by", "jog", "go", "home", "job"
MOTIONS = "move_to", "move_by", "jog", "home", "stop"  # by the words that ask for them
LEASE_LOST, SECOND, BEYOND, UNREFERENCED, READ_ONLY = 41, 43, 31, 35, 120
NOT_YOURS = SECOND, READ_ONLY, ON_LOCAL  # refusals of who may not command, at all or now
OPEN = "stop", "disable"  # to everyone, also where a face may only read
USER_UNITS = {"m": ("mm", 1e3), "rad": ("deg", 180.0 / math.pi)}
"""Unit in which a face shows positions by that of the axis, and how many of it are one of that."""


class NotDoneError(AxisError):
    """A command that was refused, aborted or failed; `code` as in the table of faults and refusals, 0 where none."""

    def __init__(self, word: str, how: str, code: int = 0, reason: str = "", remedy: str = "") -> None:
        self.word, self.how, self.code, self.reason = word, how, code, reason
        told = f"{word} {how}" + (f" ({code})" if code else "")
        super().__init__("; ".join(filter(None, (f"{told}: {reason}" if reason else told, remedy))))


@dataclass(frozen=True, slots=True)
class Sample:
    """The axis in one period, as every face shows it; positions in units of the face."""

    number: int  # of the period
    state: str
    position: float
    trust: str
    fault: int  # code, 0 none

    def __str__(self) -> str:
        """In one line, for protocols that know lines only."""
        return f"{self.number},{self.state},{self.position!r},{self.trust},{self.fault}"


class AxisService:
    """A client of an axis; `commands` False: it reads, and stops."""

    def __init__(self, line: Line, about: dict[str, Any], motor: str = "", *, commands: bool) -> None:
        self._line, self.about, self.motor, self.commands = line, about, motor, commands
        self.unit, self.scale = USER_UNITS.get(about["unit"], (about["unit"], 1.0))
        self.count: float = about["count"] * self.scale  # of the sensor
        self.origin: float = about["origin"] * self.scale  # position of count 0
        ends = about["limits"]
        self.limits: tuple[float, float] | None = tuple(end * self.scale for end in ends) if ends else None
        speed = about["max_speed"]
        self.speed: float = speed * self.scale if isinstance(speed, float) and math.isfinite(speed) else 1.0
        self.status: dict[str, Any] = {}
        self.asked = 0  # number of the last command
        self.target = 0.0  # of the last move that was asked for here
        self._tell: list[Callable[[], object]] = []
        self._kept: asyncio.Future[None] | None = None
        self._stops: set[asyncio.Future[dict[str, Any]]] = set()  # those of them that are stops
        self._giving: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._giving.set_result(None)
        self._number, self._come = 0, asyncio.Event()  # of this client among those of the axis, once it is known
        self._open: set[asyncio.Future[dict[str, Any]]] = set()  # motions that were asked for, and have not ended
        line.watched = self._take

    @classmethod
    async def open(cls, channel: Path, who: str, motor: str = "", *, commands: bool = False) -> "AxisService":
        """Attach to an axis, under a name that its panel shows and its log keeps."""
        line = await Line.open(channel, who, remote=True)
        service = cls(line, (await line.ask({"do": "describe"}))["describe"], motor, commands=commands)
        await line.ask({"do": "watch", "rate": RATE})
        await asyncio.wait_for(service._come.wait(), PATIENCE)
        service.target = service.position
        return service

    def close(self) -> None:
        """Leave; what was under way here is stopped."""
        self.let_go()
        self._line.close()

    @property
    def gone(self) -> asyncio.Event:
        """Set once the axis has gone."""
        return self._line.gone

    # ---- reading

    def subscribe(self, tell: Callable[[], object]) -> None:
        """Call `tell` for every new sample."""
        self._tell.append(tell)

    def _take(self, message: dict[str, Any]) -> None:
        status = message["status"]
        if self.status and status["loop"]["periods"] < self.status["loop"]["periods"]:
            return  # older than what was asked for meanwhile
        self.status = status
        if "you" in message:
            self._number = message["you"]
            self._come.set()
        for tell in self._tell:
            tell()

    async def refresh(self) -> None:
        """The axis now, not as it was up to a fiftieth of a second ago."""
        self._take(await self._line.ask({"do": "status"}))

    async def show(self, channels: Sequence[str]) -> None:
        """Let the ring hold these channels of the scope; the status goes on to come."""
        await self._line.ask({"do": "watch", "rate": RATE, "channels": list(channels)})

    async def newest(self, channels: Sequence[str]) -> dict[str, Any]:
        """Their newest rows, as the channel packs them."""
        first = max(self.status["loop"]["periods"] - 1, 0)
        return (await self._line.ask({"do": "scope", "channels": list(channels), "first": first}))["scope"]

    @property
    def sample(self) -> Sample:
        """What all faces show alike."""
        s = self.status
        return Sample(s["loop"]["periods"], s["state"], self.position, s["trust"], self.fault)

    @property
    def position(self) -> float:
        """As its sensor shows it."""
        return self.in_user_units(self.status["position"])

    @property
    def commanded(self) -> float:
        """Commanded point."""
        return self.in_user_units(self.status["commanded"])

    @property
    def velocity(self) -> float:
        """As its sensor shows it, per second."""
        return self.in_user_units(self.status["velocity"])

    def in_user_units(self, value: float | None) -> float:
        """A position or velocity of the axis; what a fault has left without a number is 0."""
        return value * self.scale if value is not None else 0.0

    @property
    def counts(self) -> int:
        """Position in counts of the sensor."""
        return self.to_counts(self.position)

    def to_counts(self, position: float) -> int:
        """Count nearest to a position."""
        return round((position - self.origin) / self.count)

    def from_counts(self, counts: float) -> float:
        """Position of a count."""
        return self.origin + counts * self.count

    @property
    def fault(self) -> int:
        """Code of the fault, 0 none."""
        return self.status["fault"]["code"] if self.status["fault"] else 0

    @property
    def fault_text(self) -> str:
        """Sentence of the fault, empty where there is none."""
        return self.status["fault"]["text"] if self.status["fault"] else ""

    @property
    def enabled(self) -> bool:
        """True while it holds and moves."""
        return self.status["state"] == "operation enabled"

    @property
    def homed(self) -> bool:
        """True while its position is known."""
        return self.status["trust"] != "unknown"

    @property
    def moving(self) -> bool:
        """True from the start of a motion until it is done, whoever commands it."""
        running = self.status["running"]
        return bool(self._open or (running and running["command"] in MOVES)) or not self.status["rests"]

    @property
    def at_end(self) -> str:
        """Soft limit at which it stands: "lower", "upper" or ""."""
        return self.status["at_end"]

    @property
    def is_others(self) -> bool:
        """True while somebody else commands: what is asked here is refused."""
        return self.status["client"] not in (0, self._number)

    @property
    def may_command(self) -> bool:
        """True while what is asked here is done: nobody else commands, and the selector does not stand on local."""
        return self.commands and not self.is_others and self.status["selector"] != "local"

    def share(self, speed: float) -> float:
        """Share of the largest speed that a speed is, within what a command takes."""
        return min(max(abs(speed) / self.speed, 1e-6), 1.0) if speed else 1.0

    # ---- commanding

    async def begin(self, word: str, value: object = None, speed: float = 1.0) -> "asyncio.Future[dict[str, Any]]":
        """Ask for something; gives a future of how it ends."""
        if not self.commands and word not in OPEN:
            raise NotDoneError(
                word, "refused", READ_ONLY, "this face only reads, and stops",
                "let it command with --commands, or commands = true in [faces]",
            )  # fmt: skip
        ending: asyncio.Future[dict[str, Any]] = asyncio.get_running_loop().create_future()
        if word in MOTIONS:
            if word != "stop" and self._stops:  # what is asked behind a stop is not meant to be ended by it
                await asyncio.wait(self._stops, timeout=PATIENCE)
            for group in (self._open, self._stops) if word == "stop" else (self._open,):
                group.add(ending)
                ending.add_done_callback(group.discard)
        message = {"do": word, "speed": speed} | ({} if value is None else {"value": value})
        try:
            answer = await self._line.ask(message, lambda told: ending.done() or ending.set_result(told["ended"]))
            self.asked = answer["id"]
        except DetentError:
            self._open.discard(ending)
            self._stops.discard(ending)
            raise
        return ending

    async def start(self, word: str, value: object = None, speed: float = 1.0) -> "asyncio.Future[dict[str, Any]]":
        """Begin a motion, for protocols that wait for no end; that it is refused is raised at once."""
        ending = await self.begin(word, value, speed)
        command = self.asked
        while not ending.done():
            await self.refresh()
            running = self.status["running"]
            if running and running["id"] >= command:
                return ending
            await asyncio.sleep(LOOK)
        if ending.result()["how"] in ("refused", "failed"):
            await self.ended(word, ending)
        return ending

    async def ended(self, word: str, ending: "asyncio.Future[dict[str, Any]]") -> None:
        """Wait for an ending, and for the sample behind it; a `NotDoneError` where it is not done."""
        gone = asyncio.ensure_future(self.gone.wait())
        await asyncio.wait([ending, gone], return_when=asyncio.FIRST_COMPLETED)
        gone.cancel()
        if not ending.done():
            raise NotDoneError(word, "failed", 0, "the axis has gone", "look at the process that runs it")
        told = ending.result()
        await self.refresh()
        if told["how"] != "done":
            raise NotDoneError(word, told["how"], told["code"], told["reason"], told["remedy"])

    async def do(self, word: str, value: object = None, speed: float = 1.0) -> None:
        """Ask, and wait until it is done."""
        await self.ended(word, await self.begin(word, value, speed))

    async def enable(self) -> None:
        """Enabled; of a simulated axis the first motion, which can hurt nobody, is confirmed with it."""
        if not self.enabled or self.is_others:
            await self.do("enable")
        if self.about["simulated"] and not self.status["confirmed"]:
            await self.do("confirm")

    async def move_to(self, position: float, speed: float = 0.0) -> None:
        """Go to a position, at most at a speed (0: the largest); done at rest in the window."""
        await self.ended("move_to", await self.begin_move(position, speed))

    async def begin_move(self, position: float, speed: float = 0.0) -> "asyncio.Future[dict[str, Any]]":
        """The same without waiting; what makes no sense, or somebody else's command, is refused at once."""
        ending = await self.start("move_to", self.in_si(position), self.share(speed))
        self.target = position
        return ending

    def in_si(self, value: float) -> float:
        """A value as the axis has it."""
        return value / self.scale

    async def jog(self, velocity: float) -> "asyncio.Future[dict[str, Any]]":
        """Move at a velocity for as long as `hold` is called, at least every 200 ms, or until `let_go` is."""
        return await self.start("jog", self.in_si(velocity))

    async def hold(self) -> None:
        """Keep the jog for its lease."""
        await self.begin("keep")

    def keep(self) -> None:
        """Keep the jog by itself: for protocols whose clients hold a connection, not a button."""
        self.let_go()
        self._kept = asyncio.ensure_future(self._keep())

    async def _keep(self) -> None:
        while not self.gone.is_set():
            await asyncio.sleep(KEEP)
            await self.begin("keep")

    def let_go(self) -> None:
        """Keep it no longer."""
        if self._kept is not None:
            self._kept.cancel()
            self._kept = None

    def set_point(self, stream: int, value: float) -> None:
        """Send a set-point of a stream, as the axis has it."""
        if not self.gone.is_set():
            self._line.tell({"do": "points", "stream": stream, "values": [value]})

    async def give_back(self) -> None:
        """Let others command: of protocols that know no session, each motion is one."""
        if self.commands and self._giving.done():
            self._giving = asyncio.ensure_future(self._give_back())

    async def _give_back(self) -> None:
        while not self.gone.is_set():
            await self.refresh()
            if self._open or self.is_others:  # another motion, which will do it at its end
                return
            if not self.status["running"]:  # else it would take the place of a stop that somebody waits for
                await self.begin("leave")
                return
            await asyncio.sleep(KEEP)

    async def stop(self) -> None:
        """Come to rest; taken from everybody, in every state."""
        self.let_go()
        try:
            await self.do("stop")
        except NotDoneError as error:
            if error.how != "aborted":
                raise
            if self._stops:  # another stop has taken its place, and leads to the same rest
                await asyncio.wait(self._stops, timeout=PATIENCE)


class Desk:
    """What the process of a face is told: where the axes are, by motor, and whether they may be commanded."""

    def __init__(  # from data
        self, channels: Mapping[str, Path], face: str, commands: bool = False,  # noqa: FBT001, FBT002
    ) -> None:  # fmt: skip
        self.channels, self.face, self.commands = channels, face, commands
        self._services: list[AxisService] = []
        self._tasks: list[asyncio.Future[Any]] = []
        self.server: Any = None  # what else must stay for as long as the face does

    async def open(self, who: str = "") -> tuple[AxisService, ...]:
        """Another client, of every axis; `who` is at the other end."""
        name = f"{self.face} face" + (f", {who}" if who else "")
        opened: list[AxisService] = []
        try:
            for motor, channel in self.channels.items():
                opened.append(await AxisService.open(channel, name, motor, commands=self.commands))
        except BaseException:
            for service in opened:
                service.close()
            raise
        if not who:  # a client that has come leaves again
            self._services += opened
        return tuple(opened)

    def close(self) -> None:
        """Leave the axis."""
        for service in self._services:
            service.close()

    def keep(self, task: "asyncio.Future[Any]") -> None:
        """Work that a face cannot do without: its end is that of the face."""
        self._tasks.append(task)

    async def ended(self) -> None:
        """Wait until the face cannot go on: an axis has gone, or its work has ended."""
        if not self._services:
            await self.open()
        ends = [*(asyncio.ensure_future(service.gone.wait()) for service in self._services), *self._tasks]
        await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)


def address_of(face: str, text: str, port: int) -> tuple[str, int]:
    """Host and port of ``:1502``, ``192.168.1.20:1502`` or ``1502``; loopback unless a host is named.

    >>> address_of("modbus", ":1502", 502), address_of("modbus", "", 502)
    (('127.0.0.1', 1502), ('127.0.0.1', 502))
    """
    host, _, digits = text.rpartition(":")
    digits = digits or (str(port) if not text or text == host + ":" else "")
    if not (digits.isascii() and digits.isdigit() and int(digits) < 65536):
        raise DetentError(f"{face}: got {text!r}; expected: [HOST]:PORT such as :{port}; choose a port up to 65535")
    return host.strip("[]") or "127.0.0.1", int(digits)
