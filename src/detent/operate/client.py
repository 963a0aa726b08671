"""A live axis in Python: the words of the command line, blocking, or to be awaited.

>>> import detent
>>> with detent.live(detent.example("filtered_servo.toml"), wall=False) as axis:
...     enabled = axis.enable()
...     moved = axis.move_by("1 mm")
...     print(f"{axis.position:.4f} m, {axis.state}")
0.0210 m, operation enabled
"""

import asyncio
import threading
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple, Protocol, Self

from detent.control.stream import AHEAD
from detent.errors import DetentError
from detent.operate.words import ERRORS, Ended, describe_status, why_not_moving

LOOK = 5e-3  # how often it is looked for room for set-points [s]
KEEP = 0.05  # how often a jog is kept [s]
KEEP_JOB = 0.5  # the same of a job


class Link(Protocol):
    """The way to a live axis: in this process, or over a channel."""

    def describe(self) -> dict[str, Any]:
        """What does not change."""
        ...

    def status(self) -> dict[str, Any]:
        """The axis now."""
        ...

    def positions(self) -> list[dict[str, Any]]:
        """The position table."""
        ...

    def faults(self) -> list[dict[str, Any]]:
        """The last faults."""
        ...

    def ask(self, word: str, value: object = None, speed: float = 1.0) -> int:
        """Ask for something; gives an id."""
        ...

    def points(self, stream: int, values: Sequence[float], *, in_turn: bool = False, last: bool = False) -> int:
        """Send set-points of a stream; gives how many of them were taken."""
        ...

    def ending(self, command: int) -> Ended | None:
        """How it has ended; None while it has not."""
        ...

    def wait(self, command: int, timeout: float | None = None) -> Ended:
        """Wait until it has ended."""
        ...

    def close(self) -> None:
        """Leave."""
        ...


class Telemetry(NamedTuple):
    """The axis at a moment; SI units."""

    time: float  # since the loop began [s]
    state: str
    position: float
    velocity: float
    commanded: float
    error: float
    effort: float  # share of its limit


class Command:
    """A command that is under way: wait for it, or await it."""

    def __init__(self, link: Link, word: str, id_: int) -> None:
        self.id, self._link, self._word = id_, link, word

    @property
    def done(self) -> bool:
        """True once it has ended, well or not."""
        return self._link.ending(self.id) is not None

    def wait(self, timeout: float | None = None) -> Ended:
        """Wait until it is done; a `CommandError` where it is not."""
        return self._judge(self._link.wait(self.id, timeout))

    def __await__(self) -> Generator[Any, None, Ended]:
        """Wait without keeping other tasks waiting."""
        return asyncio.to_thread(self.wait).__await__()

    def _judge(self, ended: Ended) -> Ended:
        if ended.how != "done":
            raise ERRORS[ended.how](self._word, ended.how, ended.code, ended.reason, ended.remedy)
        return ended


class LiveAxis:
    """A live axis. A command blocks until it is done; with ``wait=False`` it gives a `Command`."""

    def __init__(self, link: Link) -> None:
        self.link = link
        self.about = link.describe()
        self.unit: str = self.about["unit"]

    def __enter__(self) -> Self:
        """Use it in a ``with`` block, behind which it is at rest and without torque."""
        return self

    def __exit__(self, *_: object) -> None:
        """Leave it at rest."""
        self.close()

    def close(self) -> None:
        """Come to rest and leave."""
        self.link.close()

    # ---- what it is

    @property
    def status(self) -> dict[str, Any]:
        """All that is known now, as plain data."""
        return self.link.status()

    @property
    def state(self) -> str:
        """Its state, as CiA 402 names it."""
        return self.status["state"]

    @property
    def position(self) -> float:
        """Position as its sensor shows it [m] or [rad]."""
        return self.status["position"]

    @property
    def why_not_moving(self) -> list[tuple[str, str]]:
        """Every condition of a motion that is not met, and what to do about it."""
        return why_not_moving(self.status)

    @property
    def faults(self) -> list[dict[str, Any]]:
        """The last faults, each with sentence, value, limit, causes and what to do."""
        return self.link.faults()

    def telemetry(self, rate: float = 25.0) -> Iterator[Telemetry]:
        """The axis again and again, `rate` times a second, without end."""
        pause = threading.Event()
        while True:
            s, period = self.status, self.about["period"]
            yield Telemetry(
                s["loop"]["periods"] * period, s["state"], s["position"], s["velocity"], s["commanded"], s["error"],
                s["effort"],
            )  # fmt: skip
            pause.wait(1.0 / rate)

    def __repr__(self) -> str:
        """Its name and how it stands."""
        return f"<live {self.about['name']}: {describe_status(self.status, self.unit)}>"

    # ---- commands

    def do(self, word: str, value: object = None, speed: float = 1.0, *, wait: bool = True) -> Command:
        """Ask for any command by its word."""
        command = Command(self.link, word, self.link.ask(word, value, speed))
        if wait:
            command.wait()
        return command

    def enable(self, *, wait: bool = True) -> Command:
        """Take torque; the target is where the axis is."""
        return self.do("enable", wait=wait)

    def disable(self, *, wait: bool = True) -> Command:
        """Take the torque away, now."""
        return self.do("disable", wait=wait)

    def stop(self, *, wait: bool = True) -> Command:
        """Come to rest as soon as the limits let it, and hold; taken in every state, from everybody."""
        return self.do("stop", wait=wait)

    def reset(self, *, wait: bool = True) -> Command:
        """Leave a fault; never moves."""
        return self.do("reset", wait=wait)

    def inject(self, fault: str, *, wait: bool = True) -> Command:
        """A fault into a simulated machine, such as "encoder stuck"; "nothing" ends it."""
        return self.do("inject", fault, wait=wait)

    def confirm(self, *, wait: bool = True) -> Command:
        """The first motion since enabling went as expected: full speed from now on."""
        return self.do("confirm", wait=wait)

    def select(self, who: str) -> Command:
        """Turn the selector: "both" lets all command, one at a time, "local" panel and programs, "remote" faces."""
        return self.do("selector", who)

    def move_to(self, place: float | str, *, speed: float = 1.0, wait: bool = True) -> Command:
        """Go to a position, "120 mm" or a number [m]; `speed` is a share of the largest."""
        return self.do("move_to", place, speed, wait=wait)

    def move_by(self, way: float | str, *, speed: float = 1.0, wait: bool = True) -> Command:
        """Go by a way from the commanded point."""
        return self.do("move_by", way, speed, wait=wait)

    @property
    def positions(self) -> list[dict[str, Any]]:
        """The position table: number, name, position, counts, tolerance, taught and used of each; SI units."""
        return self.link.positions()

    def go_to(self, name: int | str, *, speed: float = 1.0, wait: bool = True) -> Command:
        """Go to a position of the table, by its name or number."""
        return self.do("go_to", name, speed, wait=wait)

    def teach(self, name: int | str) -> Command:
        """Make where the axis rests a position of the table."""
        return self.do("teach", name)

    def home(self, *, wait: bool = True) -> Command:
        """Find the reference."""
        return self.do("home", wait=wait)

    def run_job(
        self, job: str | Path | Sequence[str] | Mapping[str, Any], *, speed: float = 1.0, wait: bool = True
    ) -> Command:
        """Do a job: a file, a list of places such as ``["5 mm", "load"]``, or of a printer ``{"text": "..."}``.

        It lives for as long as this process keeps it: when that is gone, or silent for 2 s, the axis stops.
        """
        said = str(Path(job).absolute()) if isinstance(job, str | Path) else job
        said = {"moves": list(said)} if isinstance(said, list | tuple) else said
        command = self.do("job", said, speed, wait=False)
        left = threading.Event()

        def keep() -> None:
            """Say that this program lives, until the job has ended or is left."""
            with suppress(DetentError):  # the axis has gone, or this process has left it
                while not left.wait(KEEP_JOB) and not command.done:
                    self.link.ask("keep")

        threading.Thread(target=keep, name="job", daemon=True).start()
        if wait:
            try:
                command.wait()
            finally:
                left.set()
        return command

    def stream(self, points: Sequence[float], *, of: str = "position", period: float | str = 1e-3) -> Command:
        """Follow set-points, one in each interpolation period [s], and come to rest at the last one.

        `of` says what they are: a "position" [m] or [rad], a "velocity", or an "effort", a share of its limit. They are
        sent ahead of their time while this blocks; where they stop coming the axis stops within six of their periods.

        Examples
        --------
        >>> import detent
        >>> with detent.live(detent.example("cascade.toml"), wall=False) as axis:
        ...     enabled = axis.enable(), axis.confirm()
        ...     played = axis.stream([0.02 + 1e-7 * min(k, 100) ** 2 for k in range(120)])
        ...     print(f"{axis.position:.4f} m")
        0.0210 m
        """
        command, rest = self.do(f"stream_{of}", period, wait=False), [*points]
        while rest and not command.done:
            taken = self.link.points(command.id, rest[:AHEAD], in_turn=True, last=len(rest) <= AHEAD)
            rest = rest[taken:]
            with suppress(TimeoutError):
                self.link.wait(command.id, LOOK)
        command.wait()
        return command

    def pause(self) -> Command:
        """Hold the job that is under way: it comes to rest."""
        return self.do("pause")

    def resume(self) -> Command:
        """Go on with it."""
        return self.do("resume")

    @contextmanager
    def jog(self, velocity: float | str) -> Generator[Command]:
        """Move at a velocity inside a ``with`` block; behind it, and when this process dies, the axis stops."""
        command, left = self.do("jog", velocity, wait=False), threading.Event()

        def keep() -> None:
            while not left.wait(KEEP):
                self.link.ask("keep")

        keeper = threading.Thread(target=keep, daemon=True)
        keeper.start()
        try:
            yield command
        finally:
            left.set()
            keeper.join()
            self.stop()
