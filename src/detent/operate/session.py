"""A live axis in this process: its host, asked in words by several clients."""

import base64
import math
import threading
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, cast

from detent.control import operation as ops
from detent.control.move_commands import LONGEST_PERIOD
from detent.control.stream import AHEAD
from detent.errors import NO_MARK, ON_LOCAL, ON_REMOTE, DetentError
from detent.methods.method import Leg
from detent.operate.faults import injection_of, injections
from detent.operate.host import Host
from detent.operate.jobs import read_job
from detent.operate.loop import INBOX, Board
from detent.operate.places import Places
from detent.operate.scope import CHANNELS, SHOWN, Rows
from detent.operate.words import PLACES, WORDS, Ended, ended, status_of, value_of
from detent.units import format_quantity

STEP = 2e-3  # how often an ending is looked for [s]
LINES = ("stop", "disable")  # never refused
ALWAYS = *LINES, "leave"  # whatever the selector says
SELECTOR = "both", "local", "remote"  # who may command: all; panel and programs; faces. One of them at a time
MOST_ROWS = 2048  # of the ring, in one answer
LARGEST = 1 << 62  # number of a row
COUNT = 1e-6  # where a method does not say what counts the position [m]
TRIES = 8  # to read a status while nothing changes it
RESERVE = 64  # places of the mailbox that set-points leave to commands
MOST = 1e12  # what a set-point is below
NOTE = 0.5  # how often what nobody asks for is taken down [s]


class Session:
    """Takes commands in words and tells how they end; every method may be called from any thread."""

    def __init__(self, host: Host, about: Mapping[str, Any], file: Mapping[str, Any] | None = None) -> None:
        self.host, self.about, self._file = host, dict(about), dict(file or {})
        self.unit = host.axis.unit
        self._lock, self._left, self._places = threading.Lock(), threading.Event(), Places(host)
        self._jobs = threading.Lock()
        self.selector = SELECTOR[0]
        self._signals = self._name_signals()
        if host.is_running:
            threading.Thread(target=host.supervised(self._keep_noting), name="notes", daemon=True).start()

    def _keep_noting(self) -> None:
        """Take note of faults, and of what came from outside, before the loop's memory of it has come round."""
        while not self._left.wait(NOTE):
            with self._lock:
                self.host.note()

    def describe(self) -> dict[str, Any]:
        """What does not change: name, method, unit, period, commands, what the scope can show, what can go wrong."""
        words = [word for word, (kind, *_) in WORDS.items() if self._takes(kind)]
        if self.host.keeper is not None:
            words += [word for word in ("go_to", *PLACES) if word not in words]
        can_inject = injections(self.host.axis.places)
        words += ["inject"] if can_inject and "inject" not in words else []
        words.append("selector")
        q = self.host.axis.live.operation
        limits = None if q.endless else [q.lowest, q.highest]
        period = self.host.board.loop.period * 1e-9
        sensor = self.host.sensor
        channels = [{"name": name, "unit": unit, "help": help_} for name, (_, unit, help_) in self._signals.items()]
        facts = [] if self.host.link is None else [str(fact) for fact in self.host.link.facts]
        return self.about | {
            "unit": self.unit, "period": period, "commands": words, "limits": limits, "channels": channels,
            "injections": can_inject, "prints": self.host.axis.text is not None,
            "numbers": sorted(self.host.axis.numbers or ()), "method": self.host.method,
            "max_speed": self.host.axis.speed, "acceleration": self.host.axis.acceleration,
            "count": sensor.scale if sensor else COUNT,
            "origin": sensor.origin if sensor else 0.0,
            "view": dict(self.host.axis.view), "drive": facts,
        }  # fmt: skip

    def status(self) -> dict[str, Any]:
        """The axis now."""
        keeper = self.host.keeper
        kept = {"store": keeper.told() if keeper else None, "find": self.find_position(), "selector": self.selector}
        return self._between_periods() | kept

    def _between_periods(self) -> dict[str, Any]:
        """Registers of one period: read while the loop waits for the next one, or again where it began meanwhile."""
        loop, told = self.host.board.loop, dict[str, Any]()
        for _ in range(TRIES):
            rows = loop.rows  # the row of a period is written at its end
            told = status_of(self.host, self.host.axis.fault())
            if rows == loop.rows == loop.periods:
                break
        return told

    def find_position(self) -> str:
        """The command that makes a position known: to home, or of an axis that cannot a person's word for it."""
        return "home" if self._takes(ops.HOME) else f"trust {ops.REFERENCED}"

    def ask(self, word: str, value: object = None, speed: float = 1.0, *, client: int = 1, **more: int) -> int:
        """Ask for something; gives the id under which it will end. A `DetentError` where it makes no sense."""
        if word in PLACES:
            return self.host.settle(self._places.do(word, value, client))
        if word == "selector":
            return self._select(value)
        if word not in WORDS:
            raise DetentError(f"no command {word!r}; there are {', '.join((*WORDS, *PLACES, 'selector'))}")
        if word == "job":
            return self._begin_job(value, speed, client, more)
        if word == "go_to" and (place := self._place_of(value)) is not None:
            word, value = "move_to", place
        if word == "stop":
            self.host.stop()
        if word == "disable":
            self.host.off()
        kind = WORDS[word].kind
        if word == "inject":
            kind, about = injection_of(self.host.axis.places, value)
        else:
            about = value_of(WORDS[word], value, self.unit)
        if kind in ops.STREAMS:
            self._refuse_period(about)
        with self._lock:
            self.host.note()  # of what nobody waits for, too: the loop keeps the last endings only
        try:
            return self.host.ask(kind, about, speed, client=client, **more)  # may wait for the disk
        except BlockingIOError:
            if word not in LINES:
                raise
            return self.host.settle(0)  # its line has done it

    def _refuse_period(self, time: float) -> None:
        """Set-points come in once in a period of the loop: an interpolation period is not shorter than that."""
        period = self.host.board.loop.period * 1e-9
        if not period * (1.0 - 1e-9) <= time <= LONGEST_PERIOD:
            ends = format_quantity(period, "s"), format_quantity(LONGEST_PERIOD, "s")
            got = format_quantity(time, "s") if math.isfinite(time) else str(time)
            raise DetentError(
                f"a stream with a set-point every {got}; expected: {ends[0]}, the period of the loop, to {ends[1]}; "
                "send them so often, or give the loop another period"
            )

    def points(
        self, stream: object, values: object, *, client: int = 1, in_turn: object = False, last: object = False
    ) -> int:
        """Send set-points of the stream that has this id; gives how many of them were taken.

        The newest is for now; `in_turn` they wait for one another, and the `last` of them ends the stream.
        """
        read, number = _numbers(values), whole_number("points", stream)
        with self._lock:
            self.host.note()
        s, asked = self.host.board.operation.stream, self.host.board.inbox.written - self.host.board.operation.taken
        room = AHEAD - (s.last - s.first) - asked if in_turn else INBOX - RESERVE - asked
        taken = read[: max(room, 0)]
        kinds = [ops.POINT_IN_TURN if in_turn else ops.POINT] * len(taken)
        if in_turn and last and len(taken) == len(read):
            kinds[-1:] = [ops.LAST_POINT]
        for kind, value in zip(kinds, taken, strict=True):
            self.host.ask(kind, value, id=number, client=client)
        return len(taken)

    def _select(self, value: object) -> int:
        """Turn the selector; that others still move the axis is for who knows them."""
        if value not in SELECTOR:
            raise DetentError(f"selector: got {value!r:.60}; expected one of {', '.join(SELECTOR)}")
        self.selector = str(value)
        return self.host.settle(0)

    def barred(self, word: str, value: object = None, *, remote: bool) -> int:
        """Why the selector refuses a command of somebody at the axis, or elsewhere; 0 where it does not.

        Who is at the axis turns it, always; from elsewhere it is not turned to local, nor away from there.
        """
        if word in ALWAYS or (word == "selector" and not remote):
            return 0
        if remote and "local" in (self.selector, value if word == "selector" else ""):
            return ON_LOCAL
        return ON_REMOTE if self.selector == "remote" and not remote else 0

    def _begin_job(self, value: object, speed: float, client: int, known: Mapping[str, int]) -> int:
        """Read a job and begin it; one at a time, for it has one tray."""
        with self._jobs:
            with self._lock:
                busy = self.host.works
            if busy:
                return self.host.settle(ops.BUSY)
            if not 0.0 < speed <= 1.0:
                return self.host.settle(ops.NOT_FINITE)
            job = read_job(self.host.axis, self.host.load_job, value, self._leg)
            work = self.host.prepared(job, speed)  # may take a while: whoever wants to stop must not wait for it
            with self._lock:
                return self.host.begin(work, client, **known)

    def _leg(self, line: str) -> Leg:
        """A place of a job: a name or number that the axis knows, or where it is, as "5 mm"."""
        numbers = self.host.axis.numbers
        if numbers is not None and line.isdecimal() and int(line) in numbers:
            return Leg(ops.GO, float(line))
        place = self._place_of(line) if self._places.has(line) else value_of(WORDS["move_to"], line, self.unit)
        return Leg(ops.MOVE_TO, 0.0 if place is None else place)

    def faults(self) -> list[dict[str, Any]]:
        """The last faults, the first of them first."""
        with self._lock:
            self.host.note()
            return [one.to_dict() for one in self.host.faults.records]

    def fault_trace(self, number: int) -> dict[str, list[float]]:
        """Columns of the ring from 2 s before to 2 s after a fault."""
        with self._lock:
            self.host.note()
            return self.host.faults.trace(number)

    def positions(self) -> list[dict[str, Any]]:
        """The position table: number, name, position, counts, tolerance, taught and used of each; SI units."""
        return self._places.rows()

    def edit_position(self, name: str, position: str) -> int:
        """Type a position in, as "5 mm" or "0.2 in"; gives the id under which that has ended."""
        return self.ask("edit", [name, position])

    def undo_position(self) -> int:
        """Take the last change of the position table back; gives the id under which that has ended."""
        return self.ask("undo")

    def _place_of(self, value: object) -> float | None:
        """Where a position of the table is; None where the method itself knows that number, or is to say what it is."""
        if self.host.keeper is None or isinstance(value, bool) or not isinstance(value, str | int | float):
            return None
        name = value.strip() if isinstance(value, str) else f"{value:g}"
        numbers = self.host.axis.numbers
        if numbers is not None and name.isdecimal() and (int(name) in numbers or not self._places.has(name)):
            return None
        return self._places.place(name)

    def _takes(self, kind: int) -> bool:
        return bool(self.host.axis.live.operation.takes >> kind & 1)

    def ending(self, command: int) -> Ended | None:
        """How a command has ended; None while it has not."""
        with self._lock:
            found = self.host.ending(command)
        if found is None:
            return None
        fault = self.host.axis.fault() if found.how == ops.FAILED else self.host.told(found.why)
        told = ended(found.id, found.how, found.why, found.by, fault)
        trouble = self.host.keeper.trouble if self.host.keeper and found.why == NO_MARK else ""
        return replace(told, reason=f"{told.reason} ({trouble})") if trouble else told

    def wait(self, command: int, timeout: float | None = None) -> Ended:
        """Wait until a command has ended; a `TimeoutError` where it has not in time [s]."""
        pause, waited = threading.Event(), 0.0
        while (found := self.ending(command)) is None:
            if timeout is not None and waited >= timeout:
                raise TimeoutError(f"command {command} has not ended within {timeout:g} s")
            if self.host.is_running:
                pause.wait(STEP)
            else:
                self.host.keep_job()
                self.host.run(1)
            waited += STEP
        return found

    def close(self) -> None:
        """Come to rest, take the torque away, end the loop."""
        self._left.set()
        self.host.close()

    def axis(self) -> dict[str, Any]:
        """The axis file as it was read, and what it comes to."""
        return self._file

    # ---- the scope

    def _name_signals(self) -> dict[str, tuple[str, str, str]]:
        """All that the scope can show: by its name the register, its unit and its meaning."""
        units = {"m": self.unit, "m/s": f"{self.unit}/s"}
        board = {leaf.path: leaf for leaf in Board.leaves()}
        fixed = {path.rpartition(".")[2]: board[path] for path in SHOWN}
        axis = {leaf.path: leaf for leaf in type(self.host.axis.state).leaves() if not leaf.length}
        found = {name: (leaf.path, units.get(leaf.unit, leaf.unit), leaf.doc) for name, leaf in fixed.items()}
        return found | {path: (path, leaf.unit, leaf.doc) for path, leaf in axis.items()}

    def paths(self, channels: object) -> list[str]:
        """Registers of channels, by their names; a `DetentError` where that is no list of at most eight of them."""
        names = cast("list[object]", channels) if isinstance(channels, list | tuple) else [channels]
        wrong = [name for name in names if not isinstance(name, str) or name not in self._signals]
        if wrong or len(names) > CHANNELS:
            got = f"{wrong[0]!r:.60}" if wrong else f"{len(names)} of them"
            raise DetentError(f"channels: got {got}; expected a list of at most {CHANNELS} names, which describe lists")
        return [self._signals[str(name)][0] for name in names]

    def show(self, channels: Sequence[str], client: int) -> int:
        """Let the ring hold what a client watches, by paths; gives the first row that does."""
        with self._lock:
            self.host.scope.show(channels, client)
            return max(self.host.scope.begin(channels), int(self.host.board.loop.rows))

    def forget(self, client: int) -> None:
        """A client watches no longer."""
        with self._lock:
            self.host.scope.leave(client)

    def rows(self, after: int, channels: Sequence[str]) -> Rows:
        """The newest rows of the ring from a number on, by paths."""
        rows, following, missed = self.host.scope.rows(after, channels)
        rows = rows[-MOST_ROWS:]
        first = following - len(rows)
        return Rows(first, max(missed, first - after), tuple(rows[name] for name in channels))

    def scope(self, channels: object = (), first: object = 0, rows: object = MOST_ROWS) -> dict[str, Any]:
        """Rows of the ring as they are, the oldest ones from `first` on: doubles, column by column, in base64."""
        paths = self.paths(channels)
        after, most = (whole_number(name, n) for name, n in (("first", first), ("rows", rows)))
        dark = [path for path in paths if path not in self.host.scope.row.names]
        if dark:
            raise DetentError(f"scope: nobody watches {', '.join(dark)}, so the ring does not hold it; watch it first")
        at, missed, columns = self.host.scope.columns(after, paths, min(most, MOST_ROWS))
        data = packed(columns, "<f8")
        return {"first": at, "rows": len(columns[0]) if columns else 0, "missed": missed, "data": data}


def _numbers(values: object) -> list[float]:
    """Read set-points."""
    read = cast("list[Any]", values if isinstance(values, list | tuple) else [values])
    for one in read:
        if isinstance(one, bool) or not isinstance(one, int | float) or not abs(one) < MOST:
            raise DetentError(f"points: got {one!r:.60}; expected: numbers below {MOST:g}, in SI units; correct it")
    return [float(one) for one in read]


def whole_number(name: str, value: object) -> int:
    """Read a number of rows."""
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < LARGEST:
        raise DetentError(f"{name}: got {value!r:.60}; expected a whole number, 0 or more")
    return value


def packed(columns: Sequence[Any], width: str) -> str:
    """Columns, one after the other, as little-endian floats in base64."""
    return base64.b64encode(b"".join(column.astype(width).tobytes() for column in columns)).decode()
