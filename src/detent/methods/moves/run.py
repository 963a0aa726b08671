"""A list of moves on a simulated servo axis, from power-on: what an observer beside the carriage sees."""

import math
from dataclasses import asdict, dataclass, field
from typing import Any, ClassVar

from detent.errors import AxisError
from detent.methods.moves.host import Destination, Host, check_job, line_faults
from detent.methods.moves.job import MoveJob
from detent.record.machine import Progress
from detent.record.run import RunRecord
from detent.sensing.gauge import set_gauge
from detent.units import format_quantity


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
    settled: float  #: when it was outside the tolerance for the last time
    end: float  #: end of the dwell
    overshoot: float  #: how far it went beyond the target, 0 if it did not
    error: float  #: target less position at the end of the dwell
    peak_speed: float  #: largest speed [m/s]

    @property
    def move_time(self) -> float:
        """From the command until the axis stayed within the tolerance [s]."""
        return max(self.settled - self.begin, 0.0)


@dataclass
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
    #: pulses put in and taken away, samples lost and corrupted by interference
    faults: dict[str, int] = field(default_factory=dict[str, int])

    told: ClassVar[tuple[str, ...]] = (
        "tolerance", "grid", "peak_current", "energy", "faults", "worst_error", "worst_overshoot", "moves_per_second",
    )  # fmt: skip

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
    _finish(host, result)
    return result


def _make_move(host: Host, to: Destination, result: MoveRun) -> str:
    """One move and its dwell; what went wrong, or nothing."""
    plant, begin = host.machine.state.plant, host.machine.time
    start = float(plant.train.position)
    set_gauge(plant.gauge, host.machine.state.tick, start, to.position, host.tolerance)
    host.command(to)
    arrived = host.wait(host.time_limit(to))
    ready = host.machine.time if arrived else math.nan
    if arrived and to.move.dwell > 0:
        host.stands(to.move.dwell)
    error = to.position - float(plant.train.position)
    result.moves.append(
        MoveRecord(
            number=to.move.number,
            label=to.move.label,
            begin=begin,
            start=start,
            target=to.position,
            switched=host.switched,
            ready=ready,
            settled=plant.gauge.outside * host.machine.tick,
            end=host.machine.time,
            overshoot=max(float(plant.gauge.beyond), 0.0),
            error=error,
            peak_speed=float(plant.gauge.peak_speed),
        )
    )
    return _verdict(host, to, error, arrived=arrived)


def _verdict(host: Host, to: Destination, error: float, *, arrived: bool) -> str:
    """Why a move failed; empty if it did not."""
    where = f"move {to.move.number} to {format_quantity(to.position, 'm', 6)}"
    if host.failure:
        return f"{where}: {host.failure}"
    if not arrived:
        limit = format_quantity(host.time_limit(to), "s")
        return f"{where}: did not arrive within {limit}; it stands {_away(host, error)}; look at the report's figures"
    if abs(error) > host.tolerance:
        return (
            f"{where}: the axis says that it has arrived and stands {_away(host, error)}; look for pulses that noise "
            "has added or removed, or for a force it cannot hold"
        )
    return ""


def _away(host: Host, error: float) -> str:
    """How far from the target, in the unit of the axis too."""
    counts, more = host.in_counts(error).partition(",")[::2]
    side = "short of it to the left" if error > 0 else "to the right of it"
    return f"{format_quantity(abs(error), 'm')} ({counts}) {side}{',' + more if more else ''}"


def _finish(host: Host, result: MoveRun) -> None:
    """Totals."""
    plant = host.machine.state.plant
    result.time_end = host.machine.time
    result.peak_current, result.energy = float(plant.train.peak_current), float(plant.train.energy)
    result.faults = line_faults(plant.interference) if hasattr(plant, "interference") else {}
    result.done = not result.failure and len(result.moves) == len(result.job.moves)
