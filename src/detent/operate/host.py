"""The host of a live axis: it makes the board, runs the loop in a thread, asks, and hears how that has ended."""

import json
import math
import os
import tempfile
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial
from mmap import mmap
from pathlib import Path
from typing import Any

import numpy as np

from detent.axisfile.tables import AxisSpec
from detent.control import operation as ops
from detent.control.axis_states import STATE_NAMES
from detent.control.commands import sum_of
from detent.control.operation import ENDS, OperationParams
from detent.errors import BROKEN, NO_MARK, OTHER_HARDWARE, DetentError
from detent.methods.method import Live, Method, Work
from detent.operate.drivers.driver import Driver, Link
from detent.operate.faults import Faults
from detent.operate.jobs import Moves
from detent.operate.keeper import Keeper
from detent.operate.loop import INBOX, PULLS, Board, run_loop
from detent.operate.realtime import ask_for_time, give_back
from detent.operate.scope import Scope
from detent.operate.store import Store

PERIOD = 1e-3  # of the loop [s]
LEASE = 0.2  # time that a jog lives without being kept [s]
JOB_LEASE = 2.0  # the same of a job [s]
JOB_KEEP = 0.5  # how often who leads a job keeps it [s]
LEAST_WINDOW = 0.02  # shortest time in the window until a command is done [s]
KEPT = 2048  # endings, and in wall time requests, that memory holds
SETTLE = 2.0  # time that an axis may be outside its window at the end of a motion [s]
REST = 10.0  # time that an axis is given to come to rest before its loop ends [s]


@dataclass(frozen=True, slots=True)
class Ending:
    """How a command has ended."""

    id: int
    how: int  # `operation.DONE`, ABORTED, REFUSED or FAILED
    why: int  # reason or code, 0 where there is none
    by: int  # of one that was aborted: id of what did it, 0 for a line


@dataclass(frozen=True, slots=True)
class Asked:
    """A request, and the period in which it was taken."""

    period: int
    fields: tuple[int, int, int, int, int, float, float]


class Log:
    """All that came from outside: who repeats it, repeats the session."""

    def __init__(self, most: int | None = None) -> None:
        self.asked: deque[Asked] = deque(maxlen=most)
        self.pulled: deque[int] = deque(maxlen=most)  # periods of the stop line; negative of the off line
        self.pieces: deque[bytes] = deque(maxlen=most)  # of jobs, in the order in which requests laid them ready
        self.dropped = 0  # entries that memory holds no longer
        self.sink: Callable[[str], object] | None = None  # takes every entry as a line of JSON

    def bound(self, most: int) -> None:
        """Hold the last entries only."""
        self.asked, self.pulled = deque(self.asked, most), deque(self.pulled, most)
        self.pieces = deque(self.pieces, most)

    def add_request(self, one: Asked) -> None:
        """Note a request that was taken."""
        self._add(self.asked, one, "asked", [one.period, *one.fields])

    def add_pull(self, period: int) -> None:
        """Note a pull of a line."""
        self._add(self.pulled, period, "pulled", period)

    def add_piece(self, piece: bytes) -> None:
        """Note a piece of a job."""
        self._add(self.pieces, piece, "piece", piece.hex())

    def _add(self, held: deque[Any], one: object, kind: str, told: object) -> None:
        self.dropped += len(held) == held.maxlen
        held.append(one)
        if self.sink is not None:
            self.sink(json.dumps({kind: told}) + "\n")

    @classmethod
    def read(cls, lines: Iterable[str]) -> "Log":
        """Read what a sink has taken."""
        log = cls()
        for line in lines:
            ((kind, told),) = json.loads(line).items()
            if kind == "asked":
                log.add_request(Asked(told[0], (*told[1:6], *map(float, told[6:]))))  # pyright: ignore[reportArgumentType]
            elif kind == "pulled":
                log.add_pull(told)
            else:
                log.add_piece(bytes.fromhex(told))
        return log


def operation_params(speed: float = 1.0, *, creep: float = 0.1, **more: Any) -> Any:
    """Give a method what it fills its `OperationParams` with; `speed` is how fast the axis's time passes.

    That is ``make(look, window, (lowest, highest), *motions)``: time between two looks and time in the window [s], the
    soft limits, and the motions that it offers.
    """

    def make(look: float, window: float, limits: tuple[float, float], *motions: int) -> OperationParams:
        """Fill it for a method that looks so often, has such limits and offers these motions."""
        takes = sum(1 << kind for kind in {*ops.MANAGED, *motions, ops.JOB, ops.FEED, ops.PAUSE, ops.RESUME})
        looks = math.ceil(max(window, LEAST_WINDOW) / look - 1e-9)
        lease, job = (math.floor(time * speed / look + 1e-9) for time in (LEASE, JOB_LEASE))  # of who asks
        return OperationParams(
            look=look, window_looks=looks, lease_looks=lease, job_looks=job,
            settle_looks=math.ceil(SETTLE / look), lowest=limits[0], highest=limits[1], takes=takes,
            performs=int(ops.JOB not in motions), creep=creep, **more
        )  # fmt: skip

    return make


class Host:
    """An axis that runs in its loop; `wall` False lets it run as fast as it can, when `run` is called.

    `store` keeps what survives; `stated`: the axis stands where its file says, which a store that is new takes.
    """

    def __init__(  # noqa: PLR0913 - an axis and its clock
        self, method: Method[Any], spec: AxisSpec, *, motor: str = "", period: float = PERIOD, speed: float = 1.0,
        wall: bool = True, careful: bool = True, channels: Sequence[str] = (), store: Store | None = None,
        stated: bool = True, memory: mmap | None = None, driver: Driver | None = None,
    ) -> None:  # fmt: skip
        make = operation_params(speed, careful=int(careful), creep=spec.axis.creep)
        self.method = method.name
        self.sensor = method.sensor(spec, motor)
        self.board: Any = Board() if memory is None else Board.from_buffer(memory)
        self.link: Link | None = None
        if driver is None:
            self.axis: Live = method.live(spec, make, motor)
        else:
            self.axis, wiring = method.wired(spec, make, motor, driver.mode)
            if not math.isclose(wiring.sample, period):
                raise DetentError(
                    f"{spec.axis.name}: got a loop of {period * 1e3:g} ms on a drive, and samples of "
                    f"{wiring.sample * 1e3:g} ms; expected: the same, for the lines change once in a period; "
                    f'try: --period "{wiring.sample * 1e3:g} ms", or samples of {period * 1e3:g} ms'
                )
            self.link = Link(driver, wiring, self.board.wires)
        loop = self.board.loop
        loop.period, loop.ticks, loop.wall = round(period * 1e9), period * speed / self.axis.tick, int(wall)
        self.board.operation.trust = ops.REFERENCED if driver is None else ops.NOT_KNOWN
        self.board.simulated = int(driver is None and bool(self.axis.places))
        self.scope = Scope(self.board, type(self.axis.state), channels)
        self.log, self.faults = Log(), Faults(self)
        self._ids = self._read = self._noted = self._pulls = 0
        self._thread: threading.Thread | None = None
        self.keeper: Keeper | None = None
        self._store, self._stated, self._asking = store, stated, threading.Lock()
        self.broken = ""  # what is known of an error in the program
        self._ended: dict[int, Ending] = {}
        self._forgotten = 0  # id of the last one that is not among them any more
        self.load_job: Callable[[Path], Any] = partial(method.load, spec)
        self.job: Work | None = None  # the last one begun
        self._of_job: dict[str, int] = {}
        self._job_id = self._laid = self._kept = 0
        tray: Any = self.board.program.tray.pieces
        self._tray = self.axis.tray if self.axis.tray is not None else np.ctypeslib.as_array(tray).view(np.uint8)

    # ---- the loop

    def run(self, periods: int) -> int:
        """Run periods in this thread, taking note before the ring has come round."""
        done = self._run(min(periods, self.scope.size // 3))
        self.note()
        while 0 < done < periods and self.board.loop.leave == 0:
            done += self._run(min(periods - done, self.scope.size // 3))
            self.note()
        if self.keeper is not None:
            self.keeper.look()
        return done

    def _run(self, periods: int) -> int:
        if self.link is not None and not self.is_running:  # no wall clock: an exchange, then a period
            self._run_loop(0)  # compiles: from the first exchange on the drive waits for a heartbeat
            for _ in range(periods):
                self.link.exchange()
                self._run_loop(1)
            return periods
        return self._run_loop(periods)

    def _run_loop(self, periods: int) -> int:
        axis = self.axis
        return run_loop(
            axis.params, axis.state, axis.live, axis.memory, self.board, self.scope.ring, self.scope.of_board,
            self.scope.of_axis, periods, *axis.feed,
        )  # fmt: skip

    @property
    def is_running(self) -> bool:
        """True while the loop runs in its thread."""
        return self._thread is not None

    def start(self) -> list[str]:
        """Run the loop in a thread of its own; gives what the system did not permit."""
        self.log.bound(KEPT)
        self._run_loop(0)  # compiles
        self.board.loop.deadline = 0
        ready, missing = threading.Event(), list[str]()

        def loop() -> None:
            """All periods, with what the system permits this thread."""
            missing.extend(ask_for_time())
            ready.set()
            self._run_loop(1 << 62)

        self._thread = threading.Thread(target=loop, name="loop", daemon=True)
        self._thread.start()
        ready.wait()
        if self.link is not None:
            self.link.start(self.supervised)
        self.run_until_ready()
        return missing

    @property
    def is_alive(self) -> bool:
        """True while the thread of the loop runs."""
        return self._thread is not None and self._thread.is_alive()

    def run_until_ready(self) -> None:
        """Let time pass until the axis could be enabled."""
        self._until(lambda: bool(self.board.operation.answer.ready))
        if self._store is not None and self.keeper is None:
            self._keep(self._store)

    def _keep(self, store: Store) -> None:
        """Keep what survives, now that the axis could be enabled."""
        keeper = Keeper(store, self.board)
        trusted = self.ask(ops.TRUST, keeper.begin(stated=self._stated))
        self._until(lambda: self.ending(trusted) is not None)
        self.keeper = keeper
        if self._thread is not None:
            keeper.start(self.supervised)

    def close(self) -> None:
        """Stop, wait for rest, take the torque away, park, and end the loop."""
        self.stop()
        self._until(lambda: bool(self.board.operation.answer.rests))
        self.off()
        pulls = self.board.loop.offs
        self._until(lambda: self.board.operation.offs == pulls)
        if self.keeper is not None:
            self._until(self.keeper.look)
            self.keeper.close()
        self.board.loop.leave = 1
        if self._thread is not None:
            self._thread.join()
            self._thread = None
            give_back()
        if self.link is not None:
            self.link.close()

    def _until(self, met: Callable[[], bool]) -> None:
        """Let time pass until something holds, but not for ever; a few periods at least, for the loop to see a line."""
        begin, period = int(self.board.loop.periods), self.board.loop.period * 1e-9
        while self.board.loop.periods < begin + 3 or (not met() and self.board.loop.periods < begin + REST / period):
            if self._thread is None:
                self.run(1)
            elif not self._thread.is_alive():
                return
            else:
                time.sleep(period)

    # ---- asking

    def ask(self, kind: int, value: float = 0.0, speed: float = 1.0, **more: int) -> int:
        """Write a request; gives the id under which it will end. `more`: id, epoch, client."""
        box = self.board.inbox
        with (
            self.keeper.marked(kind, value) if self.keeper else nullcontext(enter_result=True) as durable,
            self._asking,
        ):
            if not self._has_room():
                raise BlockingIOError("the mailbox is full")
            command = more.get("id") or self._next_id()
            epoch, client = more.get("epoch", int(self.board.operation.epoch)), more.get("client", 1)
            if durable:
                write_request(box, box.written + 1, kind, command, epoch, client, value, speed)
            else:
                self._ended[command] = Ending(command, ops.REFUSED, NO_MARK, 0)
        return command

    def settle(self, why: int) -> int:
        """An ending of what no loop needs to do: refused for a reason, or with 0 done; gives its id."""
        with self._asking:
            command = self._next_id()
        self._ended[command] = Ending(command, ops.REFUSED if why else ops.DONE, why, 0)
        return command

    def prepared(self, job: Any, speed: float = 1.0) -> Work:
        """A job as pieces, and how far it has come; `speed` is a share of the largest, of jobs that are moves."""
        return Moves(job, self.axis, self.board, speed) if self.axis.work is None else self.axis.work(job)

    @property
    def works(self) -> bool:
        """True while a job is under way, or has been asked for."""
        return self._job_id > 0 and self.ending(self._job_id) is None

    def work(self, job: Any, client: int = 1) -> int:
        """Prepare a job and begin it."""
        return self.begin(self.prepared(job), client)

    def begin(self, work: Work, client: int = 1, epoch: int | None = None) -> int:
        """Begin a job; gives the id under which it will end. Its pieces are laid ready whenever the host takes note."""
        self.job = work
        known = int(self.board.operation.epoch) if epoch is None else epoch
        self._of_job = {"epoch": known, "client": client}
        self._job_id, self._laid = self.ask(ops.JOB, work.pieces, **self._of_job), 0
        self._kept = int(self.board.loop.periods)
        return self._job_id

    def keep_job(self) -> None:
        """Without a wall clock, time passes only while somebody waits: that one keeps the job, when it is due."""
        loop, o = self.board.loop, self.board.operation
        if o.kind == ops.JOB and (loop.periods - self._kept) * loop.period * 1e-9 >= JOB_KEEP:
            self._kept = int(loop.periods)
            self.ask(ops.KEEP, client=int(o.client))

    def _feed(self) -> None:
        """Lay pieces ready, as far as the job gives them; the loop sees each when it takes the request for it."""
        while self.job is not None and self.board.operation.running == self._job_id:
            piece = self.job.piece() if self._has_room() else None
            if piece is None:
                return
            self._laid += 1
            self.lay(piece, self._laid)
            self.ask(ops.FEED, self._laid, **self._of_job)

    def lay(self, piece: bytes, number: int) -> None:
        """Put a piece of a job, the first has number 1, in its place; nobody looks there before a request says so."""
        places: Any = self._tray.reshape(-1, len(piece))
        places[(number - 1) % len(places)] = np.frombuffer(piece, np.uint8)
        self.log.add_piece(piece)

    def _has_room(self) -> bool:
        return self.board.inbox.written - self.board.operation.taken < INBOX

    def _next_id(self) -> int:
        self._ids += 1
        return self._ids

    def stop(self) -> None:
        """Pull the stop line: no mailbox, no queue."""
        self.board.loop.stops += 1

    def off(self) -> None:
        """Pull the line that takes the torque away."""
        self.board.loop.offs += 1

    # ---- hearing

    def note(self) -> None:
        """Take down what was taken and what has ended since the last time."""
        box, loop = self.board.inbox, self.board.loop
        while self._noted < self.board.operation.taken:
            k = self._noted % INBOX
            taken = (box.number[k], box.kind[k], box.id[k], box.epoch[k], box.client[k], box.value[k], box.speed[k])
            self.log.add_request(Asked(int(box.period[k]), taken))
            self._noted += 1
        while self._pulls < loop.pulls:
            self.log.add_pull(int(loop.pulled[self._pulls % PULLS]))
            self._pulls += 1
        for ending in self._new_endings():
            self._ended[ending.id] = ending
        while len(self._ended) > KEPT:
            self._forgotten = self._ended.pop(next(iter(self._ended))).id
        self.faults.note()
        self._feed()

    def _new_endings(self) -> Iterator[Ending]:
        e = self.board.operation.endings
        while self._read < e.count:
            k = self._read % ENDS
            yield Ending(int(e.id[k]), int(e.how[k]), int(e.why[k]), int(e.by[k]))
            self._read += 1

    def ending(self, command: int) -> Ending | None:
        """How a command has ended; None while it has not."""
        self.note()
        is_old = 0 < command <= self._forgotten and command != self.board.operation.running
        if is_old and command not in self._ended:
            raise DetentError(f"command {command}: it ended long ago; of the last {KEPT} it is known how")
        return self._ended.get(command)

    def until_ended(self, command: int, periods: int = 100_000) -> Ending:
        """Without a wall clock: run until a command has ended."""
        for _ in range(periods):
            found = self.ending(command)
            if found is not None:
                return found
            self.keep_job()
            self.run(1)
        raise TimeoutError(f"command {command} has not ended within {periods} periods")

    def told(self, reason: int) -> str:
        """What is known of a reason beyond its text."""
        if reason == BROKEN:
            return self.broken
        return self.link.told if self.link is not None and reason == OTHER_HARDWARE else ""

    # ---- errors in the program

    def supervised(self, work: Callable[[], None]) -> Callable[[], None]:
        """Work of a thread beside the loop: an error in it is a fault of the axis, not the silent end of a thread."""

        def run() -> None:
            """The work, and what becomes of an error in it."""
            try:
                work()
            except Exception as error:  # noqa: BLE001 - whatever it is
                self.break_down(error)

        return run

    def break_down(self, error: Exception) -> None:
        """Part of the program has failed: the axis comes to rest, lets go, and stays so; keep a report beside it."""
        self.board.loop.broken = 1
        where = Path(tempfile.gettempdir()) / f"detent-{os.getpid()}.error"
        if self._store is not None:
            where = self._store.path.with_suffix(".error")
        try:
            where.write_text("".join(traceback.format_exception(error)), encoding="utf-8")
            kept = f"keep the report, {where}"
        except OSError as trouble:
            kept = f"its report could not be kept ({trouble.strerror})"
        self.broken = (
            f"a part of the program beside the loop has ended in an error ({type(error).__name__}: {error}), and the "
            f"axis is not enabled any more; {kept}, end detent live, and start it anew"
        )

    @property
    def state(self) -> str:
        """Name of the state."""
        return STATE_NAMES[int(self.board.operation.state)]


def write_request(  # noqa: PLR0913 - a record
    box: Any, number: int, kind: int, command: int, epoch: int, client: int, value: float, speed: float
) -> None:
    """One writer's request: all of the record, then the count."""
    k = (number - 1) % INBOX
    box.number[k], box.kind[k], box.id[k], box.epoch[k], box.client[k] = number, kind, command, epoch, client
    box.value[k], box.speed[k] = value, speed
    box.check[k] = sum_of(number, kind, command, epoch, client, float(value), float(speed))
    box.written = number


def repeat(host: Host, log: Log, periods: int) -> None:
    """Do a session again: each request and each pull in the period in which it was taken."""
    if log.dropped:
        raise DetentError(f"{log.dropped} requests of the session are no longer there; record it with --record")
    asked, pulled, pieces = iter(log.asked), iter(log.pulled), iter(log.pieces)
    request, pull = next(asked, None), next(pulled, None)
    loop = host.board.loop
    while loop.periods < periods:
        upto = min([periods, *(at - 1 for at in (request and request.period, pull and abs(pull)) if at)])
        host.run(upto - loop.periods)
        while pull is not None and abs(pull) == loop.periods + 1:
            loop.stops, loop.offs = loop.stops + (pull > 0), loop.offs + (pull < 0)
            pull = next(pulled, None)
        while request is not None and request.period == loop.periods + 1:
            if request.fields[1] == ops.FEED:
                host.lay(next(pieces), round(request.fields[5]))
            write_request(host.board.inbox, *request.fields)
            request = next(asked, None)
        host.run(min(1, periods - loop.periods))
