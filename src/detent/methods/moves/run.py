"""A list of moves on a simulated servo axis, from power-on: its host, and what an observer beside the carriage sees.

The host does what a controller above the axis does to make one move; it sees what the lines show, no more. The place
the axis stands at after power-on is known to it (a home sensor tells it in a machine).
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any, ClassVar

from detent.errors import MOST_PROBLEMS, AxisError, FileProblem, InputError
from detent.methods.changes import lay_changes
from detent.methods.moves.job import Move, MoveJob
from detent.record.machine import Machine, Progress
from detent.record.run import Evidence, RunRecord
from detent.sensing.gauge import set_gauge
from detent.units import format_quantity

FAULTS = {"inserted": "inserted", "removed": "removed", "lost samples": "lost", "corrupted": "corrupted"}
"""What interference does to the pulse lines, and the register that counts it."""

SOONEST = 1e-6  # an axis that says so by less than this before it is within the tolerance says so in time [s]

Wrong = Iterator[tuple[str, str, str, str]]  # problems of a move: key, what it got, what it expected and what to try


@dataclass(frozen=True, slots=True)
class Destination:
    """A move as the host commands it."""

    move: Move
    position: float  # where the axis shall stand [m], on its grid
    counts: int  # the same in counts of the axis from where it stood at power-on


class Host(ABC):
    """What each servo brings; the frame makes the moves of a job with it. What it leaves out has the default here."""

    forgets: ClassVar[Callable[..., Any] | None] = None
    """Action of its controller: a stretch begins that is to be judged for itself."""

    own_pace: ClassVar[str] = "this axis has one of its own"  # why a move can bring neither speed nor sample period

    def __init__(  # noqa: PLR0913 - an axis, and what is measured of it
        self, spec: Any, machine: Machine[Any, Any], *, grid: float, tolerance: float, home: float, look: float = 0.0
    ) -> None:
        self.spec, self.machine, self.controller = spec, machine, machine.state.controller
        self.grid = grid  # distance of two places at which it can stand [m]
        self.tolerance = tolerance  # error that counts as arrived [m]
        self.home = home  # where it stands at power-on [m]
        # What its guard saw, which looks every `look` [s]; 0: it has none.
        self.evidence = Evidence(
            self.controller.guard if look else None, look, self.count, tolerance,
            forget=self.forgets and partial(self.act, self.forgets),
        )  # fmt: skip

    def act(self, action: Callable[..., Any], *args: Any) -> Any:
        """Do something to the controller."""
        return self.machine.act(action, self.controller, *args)

    @property
    def count(self) -> float:
        """Way per count of its sensor [m]."""
        return self.grid

    def start(self) -> None:
        """Wait until the axis takes commands."""
        self.machine.pass_ticks(1)

    def place(self, move: Move, position: float) -> Destination:
        """Where a move to `position` [m] ends."""
        counts = round((position - self.home) / self.grid)
        return Destination(move, self.home + counts * self.grid, counts)

    def problems(self, to: Destination, asked: float) -> Wrong:
        """What this axis cannot do of a move to `asked` [m], beside leaving its travel: here a speed or a period."""
        del asked
        for word, value in (("speed", to.move.speed), ("sample_period", to.move.sample_period)):
            if value is not None:
                yield word, str(value), f"no {word}: {self.own_pace}", "leave it out, or change the axis file"

    @abstractmethod
    def command(self, to: Destination) -> None:
        """Begin the move."""

    @abstractmethod
    def time_limit(self, to: Destination) -> float:
        """Time after which a move that has not arrived has failed [s]."""

    def wait(self, seconds: float) -> bool:
        """Wait until it has arrived, which is the event of its controller; False when it has not within `seconds`."""
        self.machine.pass_time(seconds)
        arrived, self.controller.event = bool(self.controller.event), 0
        return arrived

    def stands(self, ticks: int) -> None:
        """Let the axis stand."""
        self.machine.pass_ticks(ticks)

    def in_counts(self, error: float) -> str:
        """An error [m] in the unit of the axis."""
        return f"{abs(error) / self.grid:.1f} pulses"

    @property
    def is_noisy(self) -> bool:
        """Whether noise may have moved a stop: interference has put in, taken away or spoilt something."""
        lines = getattr(self.machine.state.plant, "interference", None)
        return lines is not None and any(getattr(lines, register) for register in FAULTS.values())

    @property
    def failure(self) -> str:
        """Why the axis has given up; empty while it has not."""
        return ""

    @property
    def switched(self) -> float:
        """When position mode was entered [s]; NaN for an axis of one mode."""
        return math.nan


def check_job(host: Host, job: MoveJob) -> list[Destination]:
    """Destinations of a whole job, before anything moves."""
    problems: list[FileProblem] = []
    found: list[Destination] = []
    position, travel = host.home, host.spec.limits.travel
    allowed = f"a position from 0 to limits.travel, {format_quantity(travel, 'm', 5)}"
    for move in job.moves:
        position = position + move.by if move.by is not None else float(move.target or 0.0)
        to = host.place(move, position)
        wrong = list(host.problems(to, position))
        if not 0.0 <= position <= travel:
            got = format_quantity(position, "m", 6)
            wrong.insert(0, (move.place_key, got, allowed, "keep the move between the two ends"))
        told = (FileProblem(job.name, move.row, 1 if move.row else 0, *what) for what in wrong)
        problems += [problem for problem in told if len(problems) < MOST_PROBLEMS]
        position = to.position
        found.append(to)
    if problems:
        raise InputError(problems)
    return found


def time_to_settle(since: float, outside: float, *, rested: bool) -> float:
    """Time from `since` until an axis stays within its tolerance for good [s], NaN where it does not.

    It was `outside` for the last time then, and `rested` within it. From the command it is the settling of a move, from
    where its reference has ended the final approach: what those words mean of every method.
    """
    return max(outside - since, 0.0) if rested else math.nan


@dataclass(frozen=True, slots=True)
class MoveRecord:
    """How one move went; lengths in metres, times in seconds since power-on."""

    number: int  #: from 1
    label: str  #: the character, in a text
    begin: float  #: when it was commanded
    start: float  #: where the axis stood
    target: float  #: where it had to go
    switched: float  #: when position mode was entered; NaN for an axis of one mode
    ready: float  #: when the axis said that it had arrived
    settled: float  #: when it was outside the tolerance for the last time; NaN if it stayed outside
    end: float  #: end of the dwell
    overshoot: float  #: how far it went beyond the target, 0 if it did not
    error: float  #: target less position at the end of the dwell
    peak_speed: float  #: largest speed [m/s]

    @property
    def settling(self) -> float:
        """From the command until within tolerance for good [s]; NaN for a move that ended outside."""
        return time_to_settle(self.begin, self.settled, rested=not math.isnan(self.settled))

    @property
    def approach(self) -> float:
        """The same from the mode switch [s]; NaN for an axis of one mode too."""
        return time_to_settle(self.switched, self.settled, rested=not math.isnan(self.settled + self.switched))

    @property
    def early(self) -> float:
        """By how much the axis signalled arrival before it had settled [s]; NaN if it did not say so."""
        return self.settled - self.ready

    def arrived_within(self, tolerance: float) -> bool:
        """Whether it ended within the tolerance [m], and the axis said so."""
        return not math.isnan(self.ready) and abs(self.error) <= tolerance


@dataclass(repr=False)
class MoveRun(RunRecord[MoveJob]):
    """Outcome of a list of moves. Times [s], lengths [m], current [A], energy [J].

    Also `done`: every move arrived and stood within the tolerance; `failure`: why not, and what to do, empty if `done`;
    `time_ready` and `time_end`: first readiness and end of the job, since power-on.
    """

    moves: list[MoveRecord] = field(default_factory=list[MoveRecord])  #: moves made, in order
    tolerance: float = 0.0  #: distance that counts as arrived
    grid: float = 0.0  #: step of the positions the axis can be sent to
    peak_current: float = 0.0
    energy: float = 0.0
    #: pulses inserted and taken away, samples lost and corrupted by interference
    faults: dict[str, int] = field(default_factory=dict[str, int])

    told: ClassVar[tuple[str, ...]] = (
        "tolerance", "grid", "peak_current", "energy", "faults", "worst_error", "worst_overshoot", "moves_per_second",
    )  # fmt: skip
    measured: ClassVar[Mapping[str, str]] = {"peak_current": "A", "energy": "J", "time_end": "s"}
    measured_moves: ClassVar[Mapping[str, str]] = {
        "error": "m", "settling": "s", "approach": "s", "overshoot": "m", "early": "s", "peak_speed": "m/s",
    }  # fmt: skip

    @property
    def worst_error(self) -> float:
        """Largest magnitude of the error at the end of a dwell."""
        return max((abs(move.error) for move in self.moves), default=0.0)

    @property
    def worst_overshoot(self) -> float:
        """Largest overshoot."""
        return max((move.overshoot for move in self.moves), default=0.0)

    @property
    def moves_per_second(self) -> float:
        """Moves, dwells included, per second after the first readiness."""
        span = self.time_end - self.time_ready
        return len(self.moves) / span if span > 0 else 0.0

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``--json``."""
        return super().to_dict() | {"moves": [asdict(move) for move in self.moves]}


def run_moves(host: Host, job: MoveJob, *, progress: Progress | None = None) -> MoveRun:
    """Make a list of moves on an axis, from power-on."""
    result = MoveRun(job, tolerance=host.tolerance, grid=host.grid)
    destinations = check_job(host, job)
    lay_changes({"": host.machine}, job)
    try:
        host.start()
        result.time_ready = host.machine.time
        for done, to in enumerate(destinations):
            result.failure = _make_move(host, to, result)
            if result.failure:
                break
            if progress is not None:
                progress((done + 1) / len(destinations), f"move {done + 1} of {len(destinations)}")
    except AxisError as error:
        result.failure = str(error)
    finally:
        host.machine.close()
    plant = host.machine.state.plant
    result.time_end = host.machine.time
    result.peak_current, result.energy = float(plant.train.peak_current), float(plant.train.energy)
    if lines := getattr(plant, "interference", None):
        result.faults = {name: getattr(lines, register) for name, register in FAULTS.items()}
    result.done = not result.failure and len(result.moves) == len(result.job.moves)
    result.warnings, result.limited_share = [*_early(result), *host.evidence.warnings()], host.evidence.limited_share
    return result


def _early(run: MoveRun) -> Iterator[str]:
    """The axis said that it had arrived, and was not there for good."""
    early = [move for move in run.moves if move.arrived_within(run.tolerance) and move.early > SOONEST]
    if early:
        worst = max(early, key=lambda move: move.early)
        yield (
            f"in {len(early)} of {len(run.moves)} moves the axis signalled arrival before it had "
            f"settled, in move {worst.number} by {format_quantity(worst.early, 's', 3)}; what the host does in that "
            "time happens off target; widen the tolerance, or lower the gains until it settles without ringing"
        )


def _make_move(host: Host, to: Destination, result: MoveRun) -> str:
    """One move and its dwell; what went wrong, or nothing."""
    plant, begin = host.machine.state.plant, host.machine.time
    start = float(plant.train.position)
    set_gauge(plant.gauge, host.machine.state.tick, start, to.position, host.tolerance)
    host.command(to)
    limit = host.time_limit(to)
    arrived = host.wait(limit)
    ready = host.machine.time if arrived else math.nan
    if arrived and to.move.dwell > 0:
        _stand(host, to)
    host.evidence.take()
    error = to.position - float(plant.train.position)
    outside = plant.gauge.outside * host.machine.tick if abs(error) <= host.tolerance else math.nan
    result.moves.append(MoveRecord(
        number=to.move.number, label=to.move.label, begin=begin, start=start, target=to.position,
        switched=host.switched, ready=ready, settled=outside, end=host.machine.time,
        overshoot=max(float(plant.gauge.beyond), 0.0), error=error, peak_speed=float(plant.gauge.peak_speed),
    ))  # fmt: skip
    host.evidence.take_error(f"move {to.move.number}", error)
    return _verdict(host, to, error, math.nan if arrived else limit)


def _stand(host: Host, to: Destination) -> None:
    """The dwell; in its second half the axis has had time to come to rest, and has only to stand."""
    ticks = max(1, round(to.move.dwell / host.machine.tick))
    host.stands(ticks // 2)
    host.evidence.take()
    host.stands(ticks - ticks // 2)
    host.evidence.take(f"after move {to.move.number}", rest=True)


def _verdict(host: Host, to: Destination, error: float, waited: float) -> str:
    """Why a move failed; empty if it did not. `waited` is the time that it did not arrive in, NaN if it did [s]."""
    where = f"move {to.move.number} to {format_quantity(to.position, 'm', 6)}"
    if host.failure:
        return f"{where}: {host.failure}"
    if not math.isnan(waited):
        limit = format_quantity(waited, "s")
        return (
            f"{where}: did not arrive within {limit}; it is at rest {_away(host, error)}; see the figures of the report"
        )
    if abs(error) > host.tolerance:
        return f"{where}: the axis signals arrival but rests {_away(host, error)}; {_suspect(host)}"
    return ""


def _suspect(host: Host) -> str:
    """What to look at when an axis is not where it says: what there is, and noise only where there is any."""
    noise = "pulses that noise has added or removed, or for " if host.is_noisy else ""
    beyond = float(host.machine.state.plant.gauge.beyond)
    if beyond > host.tolerance:
        swing = f"it went {format_quantity(beyond, 'm')} beyond its target, and may still swing back"
        return f"{swing}: give the loop more damping, or the move a dwell; check for {noise}a load it cannot hold"
    return f"check for {noise}a load it cannot hold"


def _away(host: Host, error: float) -> str:
    """How far from the target, in the unit of the axis too."""
    counts, more = host.in_counts(error).partition(",")[::2]
    side = "short of it to the left" if error > 0 else "to the right of it"
    return f"{format_quantity(abs(error), 'm')} ({counts}) {side}{',' + more if more else ''}"
