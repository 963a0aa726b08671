"""The host of a servo axis: what a controller above it does to make one move. It sees what the lines show, no more.

The place the axis stands at after power-on is known to the host (a home sensor tells it in a machine).
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from detent.errors import MOST_PROBLEMS, FileProblem, InputError
from detent.methods.moves.job import Move, MoveJob
from detent.record.machine import Machine
from detent.sensing.interference import Interference
from detent.units import format_quantity

Wrong = Iterator[tuple[str, str, str, str]]
"""Problems of a move: key, what came, what is allowed and what to do."""


@dataclass(frozen=True, slots=True)
class Destination:
    """A move as the host commands it."""

    move: Move
    position: float  # where the axis shall stand [m], on its grid
    counts: int  # the same in counts of the axis from where it stood at power-on


class Host(ABC):
    """What each servo brings; the frame makes the moves of a job with it. What it leaves out has the default here."""

    def __init__(self, spec: Any, machine: Machine[Any, Any], *, grid: float, tolerance: float, home: float) -> None:
        self.spec, self.machine, self.controller = spec, machine, machine.state.controller
        self.grid = grid  # distance of two places at which it can stand [m]
        self.tolerance = tolerance  # error that counts as arrived [m]
        self.home = home  # where it stands at power-on [m]

    def start(self) -> None:
        """Wait until the axis takes commands."""
        self.machine.pass_ticks(1)

    def place(self, move: Move, position: float) -> Destination:
        """Where a move to `position` [m] ends."""
        counts = round((position - self.home) / self.grid)
        return Destination(move, self.home + counts * self.grid, counts)

    def problems(self, to: Destination, asked: float) -> Wrong:
        """What this axis cannot do of a move to `asked` [m], beside leaving its travel."""
        del asked
        return refused_words(to.move, "this axis has one of its own")

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

    def stands(self, dwell: float) -> None:
        """Let the axis stand [s]."""
        self.machine.pass_time(dwell)

    def in_counts(self, error: float) -> str:
        """An error [m] in the unit of the axis."""
        return f"{abs(error) / self.grid:.1f} pulses"

    @property
    def failure(self) -> str:
        """Why the axis has given up; empty while it has not."""
        return ""

    @property
    def switched(self) -> float:
        """When position mode was entered [s]; NaN for an axis of one mode."""
        return math.nan


def line_faults(lines: Interference) -> dict[str, int]:
    """Pulses put in and taken away, samples lost and corrupted."""
    names = ("inserted", "removed", "lost", "corrupted")
    return {{"lost": "lost samples"}.get(name, name): getattr(lines, name) for name in names}


def refused_words(move: Move, why: str) -> Wrong:
    """Problems of a move with a speed or a sample period, on an axis that takes neither."""
    for word, value in (("speed", move.speed), ("sample_period", move.sample_period)):
        if value is not None:
            yield word, str(value), f"no {word}: {why}", "leave it out, or change the axis file"


def check_job(host: Host, job: MoveJob) -> list[Destination]:
    """Destinations of a whole job, before anything moves."""
    problems: list[FileProblem] = []
    found: list[Destination] = []
    position = host.home
    for move in job.moves:
        position = position + move.by if move.by is not None else float(move.target or 0.0)
        to = host.place(move, position)
        told = (FileProblem(job.name, move.row, 1 if move.row else 0, *what) for what in _problems(host, to, position))
        problems += [problem for problem in told if len(problems) < MOST_PROBLEMS]
        position = to.position
        found.append(to)
    if problems:
        raise InputError(problems)
    return found


def _problems(host: Host, to: Destination, asked: float) -> Wrong:
    """What is wrong with one move."""
    travel = host.spec.limits.travel
    if not 0.0 <= asked <= travel:
        allowed = f"a position from 0 to limits.travel, {format_quantity(travel, 'm', 5)}"
        yield to.move.place_key, format_quantity(asked, "m", 6), allowed, "keep the move between the two ends"
    yield from host.problems(to, asked)
