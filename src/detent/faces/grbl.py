"""grbl 1.1, as the senders of G-code speak it: moves, feed hold, jogging, reset, status; one to three axes X, Y, Z.

A line is answered ``ok`` once it is taken into the planner, not when it is done. Each axis makes its part of a move by
itself; the feeds are those of a straight line, but what is between the ends is not a straight line to the micrometre.
"""

import asyncio
import math
import re
from collections import deque
from collections.abc import Coroutine
from contextlib import suppress
from typing import Any, NamedTuple

from detent.errors import DetentError
from detent.faces.service import NOT_YOURS, AxisService, Desk, NotDoneError
from detent.faces.talk import Send, Talk, serve_lines

PORT = 2300
PLANNED = 15  # blocks that the planner holds
LETTERS = "XYZ"
UNSUPPORTED, BAD_NUMBER, NOT_A_SETTING, LOCKED, TRAVEL, NO_FEED, NO_LETTER, NO_HOMING = 20, 2, 3, 9, 33, 22, 1, 5
SOFT_LIMIT, ABORTED = 2, 3  # alarms
RESET, CANCEL_JOG = 0x18, 0x85
IGNORED = {"G17", "G21", "G40", "G49", "G54", "G64", "G80", "G94", "M3", "M4", "M5", "M7", "M8", "M9", "T0", "T1"}
"""Words that mean nothing to an axis, or what it does anyway."""


class GrblError(Exception):
    """A line that is not done, by the number of its error."""

    def __init__(self, code: int) -> None:
        self.code = code
        super().__init__(code)


class Block(NamedTuple):
    """A move in the planner, or a rest."""

    targets: tuple[float, ...]  # [mm]; empty: a rest
    feed: float  # [mm/min], 0: the largest
    seconds: float = 0.0


class Machine:
    """Axes and planner: one for all who talk to it, for a machine that is."""

    def __init__(self, axes: tuple[AxisService, ...]) -> None:
        self.axes = axes
        self.blocks: deque[Block] = deque()
        self.room, self.more = asyncio.Event(), asyncio.Event()
        self.held = self.jogging = False
        self.alarm, self.feed = 0, 0.0
        self.target = tuple(axis.commanded for axis in axes)
        self._now: Block | None = None
        self._go = asyncio.Event()
        self._go.set()
        self.room.set()
        self._working = asyncio.ensure_future(self._work())

    @property
    def busy(self) -> bool:
        """A move is under way, or waits."""
        return bool(self.blocks) or self._now is not None

    @property
    def state(self) -> str:
        """As the status report names it."""
        if self.alarm or any(axis.fault for axis in self.axes):
            return "Alarm"
        moving = any(axis.moving for axis in self.axes)
        if self.held:
            return "Hold:1" if moving else "Hold:0"
        return ("Jog" if self.jogging else "Run") if self.busy or moving else "Idle"

    async def plan(self, block: Block) -> None:
        """Take a block, once there is room."""
        while len(self.blocks) >= PLANNED:
            self.room.clear()
            await self.room.wait()
        self.blocks.append(block)
        self.more.set()

    async def rest(self) -> None:
        """Wait until all is done."""
        while self.busy and not self.alarm:  # noqa: ASYNC110 - either of two, which others change
            await asyncio.sleep(0.01)

    async def _work(self) -> None:
        while True:
            while not self.blocks:
                self.more.clear()
                await self.more.wait()
            self._now = self.blocks.popleft()
            self.room.set()
            await self._make(self._now)
            self._now = None
            if not self.blocks:
                self.jogging = False
                for axis in self.axes:
                    await axis.give_back()

    async def _make(self, block: Block) -> None:
        """Make a move; what a hold has stopped is made to its end afterwards."""
        await asyncio.sleep(block.seconds)
        while block.targets:
            await self._go.wait()
            ways = [target - axis.commanded for target, axis in zip(block.targets, self.axes, strict=True)]
            length = math.hypot(*ways)
            self.feed = block.feed
            # Axes that are there already are not asked for a move: a null move takes its window time.
            moves = [
                axis.move_to(target, block.feed / 60 * abs(way) / length if block.feed else 0.0)
                for axis, target, way in zip(self.axes, block.targets, ways, strict=True)
                if length and abs(way) > 1e-6
            ]
            ends = await asyncio.gather(*moves, return_exceptions=True)
            self.feed = 0.0
            failed = [end for end in ends if isinstance(end, BaseException)]
            if not failed:
                return
            if not self.held:  # what was not stopped here is a machine that does not do what it was told
                self.blocks.clear()
                self.target = tuple(axis.commanded for axis in self.axes)
                if not all(isinstance(end, NotDoneError) and end.how == "aborted" for end in failed):
                    self.alarm = SOFT_LIMIT
                return

    async def hold(self) -> None:
        """Feed hold."""
        if self.busy:
            self.held = True
            self._go.clear()
            await asyncio.gather(*(axis.stop() for axis in self.axes))

    def resume(self) -> None:
        """Cycle start."""
        self.held = False
        self._go.set()

    async def cancel(self) -> None:
        """Drop what is planned, come to rest."""
        self.blocks.clear()
        self.room.set()
        self.resume()
        await asyncio.gather(*(axis.stop() for axis in self.axes))
        self.target = tuple(axis.commanded for axis in self.axes)


class Grbl(Talk):
    """One sender."""

    end = b"\r\n"

    def __init__(self, axes: tuple[AxisService, ...], send: Send) -> None:
        super().__init__(axes, send)
        self.machine = Machine(axes)
        self._relative, self._inch, self._mode, self._feed = False, 1.0, "G0", 0.0
        self._tasks: set[asyncio.Future[None]] = set()

    def greet(self) -> None:
        """Say hello, as after a reset."""
        self.send("")
        self.send("Grbl 1.1h ['$' for help]")

    # ---- characters that stand for themselves

    def urgent(self, byte: int) -> bool:
        """Status, hold, resume, reset, cancel of a jog; overrides are taken and do nothing."""
        if byte == ord("?"):
            self.send(self.report())
        elif byte == ord("!"):
            self._later(self.machine.hold())
        elif byte == ord("~"):
            self.machine.resume()
        elif byte == RESET:
            self._later(self._reset())
        elif byte == CANCEL_JOG:
            if self.machine.jogging:
                self._later(self.machine.cancel())
        elif byte < 0x80:
            return False
        return True

    def _later(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.ensure_future(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _reset(self) -> None:
        machine = self.machine
        was_moving = machine.busy or any(axis.moving for axis in machine.axes)
        with suppress(DetentError):
            await machine.cancel()
        if was_moving:  # grbl counts steps: what a reset cuts off is lost
            machine.alarm = ABORTED
            self.send(f"ALARM:{ABORTED}")
        self._relative, self._inch, self._mode, self._feed = False, 1.0, "G0", 0.0
        self.greet()
        if machine.alarm:
            self.send("[MSG:'$H'|'$X' to unlock]")

    def report(self) -> str:
        """Status report: state, machine position, feed and speed."""
        machine = self.machine
        places = [axis.position for axis in machine.axes] + [0.0] * (3 - len(machine.axes))
        shown = ",".join(f"{place:.3f}" for place in places)
        speed = math.hypot(*(axis.velocity for axis in machine.axes)) * 60
        sample = "/".join(str(axis.sample) for axis in machine.axes)
        # The last field is no word of grbl's own; senders pass over those that they do not know.
        room = PLANNED - len(machine.blocks)
        known = f"<{machine.state}|MPos:{shown}|Bf:{room},128|FS:{speed:.0f},0|WCO:0.000,0.000,0.000"
        return f"{known}|Dt:{sample}>"

    # ---- lines

    async def answer(self, line: str) -> None:
        """A line of G-code, or a word for grbl itself."""
        try:
            await (self._own(line) if line.startswith("$") else self._code(line))
        except GrblError as error:
            self.send(f"error:{error.code}")
        except NotDoneError as error:
            self.send(f"error:{LOCKED if error.code in (*NOT_YOURS, 101, 102) else UNSUPPORTED}")
        except DetentError:
            self.send(f"error:{BAD_NUMBER}")
        else:
            self.send("ok")

    async def _own(self, line: str) -> None:
        word = line.upper().replace(" ", "")
        if word == "$":
            self.send("[HLP:$$ $# $G $I $X $H $J=line ~ ! ? ctrl-x]")
        elif word == "$$":
            for number, value in self.settings():
                self.send(f"${number}={value}")
        elif word == "$G":
            units, way = ("G20" if self._inch != 1.0 else "G21"), ("G91" if self._relative else "G90")
            self.send(f"[GC:{self._mode} G54 G17 {units} {way} G94 M5 M9 T0 F{self._feed:g} S0]")
        elif word == "$#":
            self.send("[G54:0.000,0.000,0.000]")
            self.send("[G92:0.000,0.000,0.000]")
        elif word == "$I":
            self.send("[VER:1.1h.detent:]")
            self.send("[OPT:,15,128]")
        elif word == "$X":
            await self._unlock()
        elif word == "$H":
            await self._home()
        elif word.startswith("$J="):
            await self._jog(word[3:])
        else:
            raise GrblError(NOT_A_SETTING)

    def settings(self) -> list[tuple[int, str]]:
        """Settings of grbl, read from the axes: steps per mm, largest rate, acceleration, travel."""
        found = [
            (10, "1"),
            (20, "1" if self.axis.limits else "0"),
            (22, str(int("home" in self.axis.about["commands"]))),
        ]
        for k, axis in enumerate(self.machine.axes):
            low, high = axis.limits or (0.0, 0.0)
            found += [
                (100 + k, f"{1 / axis.count:.3f}"), (110 + k, f"{axis.speed * 60:.3f}"),
                (120 + k, f"{axis.about['acceleration'] * axis.scale:.3f}"), (130 + k, f"{high - low:.3f}"),
            ]  # fmt: skip
        return sorted(found)

    async def _unlock(self) -> None:
        self.machine.alarm = 0
        for axis in self.machine.axes:
            if axis.fault:
                await axis.do("reset")
        self.send("[MSG:Caution: Unlocked]")

    async def _home(self) -> None:
        if any("home" not in axis.about["commands"] for axis in self.machine.axes):
            raise GrblError(NO_HOMING)
        self.machine.alarm = 0
        for axis in self.machine.axes:
            await axis.enable()
            await axis.do("home")
        self.machine.target = tuple(axis.commanded for axis in self.machine.axes)

    async def _jog(self, text: str) -> None:
        if self.machine.busy and not self.machine.jogging:
            raise GrblError(8)  # not idle
        relative = "G91" in text
        words = self._words(text.replace("G91", "").replace("G90", "").replace("G21", "").replace("G20", ""))
        feed = words.pop("F", 0.0)
        if feed <= 0.0:
            raise GrblError(NO_FEED)
        self.machine.jogging = True
        await self._move(words, feed, relative=relative)

    async def _code(self, line: str) -> None:
        """Words of a line: modes first, then the move."""
        if self.machine.alarm:
            raise GrblError(LOCKED)
        code = re.sub(r"\([^)]*\)|;.*", "", line).upper().replace(" ", "")
        words = re.findall(r"([A-Z])([-+]?(?:\d+\.?\d*|\.\d+))", code)
        if "".join(letter + number for letter, number in words) != code:
            raise GrblError(NO_LETTER if code[:1].isdigit() else BAD_NUMBER)
        values: dict[str, float] = {}
        for letter, number in words:
            name = f"{letter}{float(number):g}"
            if letter in "GM" or name in IGNORED:
                await self._mode_of(name, values)
            elif letter in (*LETTERS, "F", "P", "S", "N"):
                values[letter] = float(number)
            else:
                raise GrblError(UNSUPPORTED)
        self._feed = values.pop("F", self._feed / self._inch) * self._inch
        rest = values.pop("P", None)
        if "dwell" in values:
            await self.machine.plan(Block((), 0.0, rest or 0.0))
        elif set(values) & set(LETTERS):
            if self._mode == "G1" and self._feed <= 0.0:
                raise GrblError(NO_FEED)
            feed = self._feed if self._mode == "G1" else 0.0
            await self._move({k: v for k, v in values.items() if k in LETTERS}, feed, relative=self._relative)

    async def _mode_of(self, name: str, values: dict[str, float]) -> None:
        if name in ("G0", "G1"):
            self._mode = name
        elif name in ("G90", "G91"):
            self._relative = name == "G91"
        elif name in ("G20", "G21"):
            self._inch = 25.4 if name == "G20" else 1.0
        elif name == "G4":
            values["dwell"] = 1.0
        elif name in ("M0", "M1", "M2", "M30"):
            await self.machine.rest()
        elif name not in IGNORED:
            raise GrblError(UNSUPPORTED)

    def _words(self, text: str) -> dict[str, float]:
        found = re.findall(r"([A-Z])([-+]?(?:\d+\.?\d*|\.\d+))", text)
        if "".join(letter + number for letter, number in found) != text:
            raise GrblError(BAD_NUMBER)
        return {letter: float(number) for letter, number in found}

    async def _move(self, words: dict[str, float], feed: float, *, relative: bool) -> None:
        machine = self.machine
        if not machine.busy:
            machine.target = tuple(axis.commanded for axis in machine.axes)
        targets = list(machine.target)
        for letter, value in words.items():
            k = LETTERS.index(letter)
            if k >= len(targets):
                raise GrblError(UNSUPPORTED)
            targets[k] = value * self._inch + (targets[k] if relative else 0.0)
        for axis, target in zip(machine.axes, targets, strict=True):
            if axis.limits and not axis.limits[0] <= target <= axis.limits[1]:
                if machine.jogging:
                    machine.jogging = machine.busy
                    raise GrblError(15)  # a jog that would leave the travel is not begun
                machine.alarm = SOFT_LIMIT
                self.send(f"ALARM:{SOFT_LIMIT}")
                raise GrblError(TRAVEL)
        if not all(axis.may_command for axis in machine.axes):
            raise GrblError(LOCKED)
        for axis in machine.axes:
            await axis.enable()
        machine.target = tuple(targets)
        await machine.plan(Block(machine.target, feed))


async def serve(desk: Desk, address: str) -> list[str]:
    """Serve; gives what a client needs: where it listens, and of several axes what each is called."""
    if len(desk.channels) > len(LETTERS):
        got = f"{desk.face}: got the motors {', '.join(desk.channels)}"
        raise DetentError(f"{got}; expected: three at most, X, Y and Z; name one with --motor")
    named = [f"{letter} = {motor}" for letter, motor in zip(LETTERS, desk.channels, strict=False) if motor]
    return await serve_lines(desk, address, Grbl, PORT) + named
