"""Standstill after moves of an axis's own host: what `hunt` watches of a method that draws no starts of its own.

Each start is a move or a stop, from another place inside a count and at another phase of the sample clock; what it does
afterwards is recorded at every few ticks. It rests where place, command and integral are the same through the last
fifth of a stretch.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.errors import AxisError
from detent.methods.tuning import Ensemble
from detent.record.machine import Machine
from detent.record.recorder import Recorder

Numbers = NDArray[np.float64]
Block = NDArray[np.void]

STILL = 0.2  # of a stretch, through which an axis that rests does not change
SAME = 1e-9  # of its limit, by which the command of one that rests may still fade
EIGHT = 8  # starts of such an ensemble


def places(number: int, seed: int) -> tuple[float, float]:
    """Place in a count and phase of the sample clock of a start, 0 to 1: evenly spread however many there are."""
    first, second = (float(x) for x in np.random.default_rng([seed]).random(2))
    return (first + _mirrored(number, 2)) % 1.0, (second + _mirrored(number, 3)) % 1.0


def _mirrored(number: int, base: int) -> float:
    """The digits of a number behind its point (van der Corput 1935)."""
    found, share = 0.0, 1.0 / base
    while number:
        number, digit = divmod(number, base)
        found, share = found + digit * share, share / base
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Watched:
    """What is seen of an axis, by the names of its registers."""

    place: Callable[[Any], Numbers]  # of what was recorded, where the axis is [m]
    error: Callable[[Any], Numbers]  # reference less position [m]
    velocity: str
    command: str
    limit: float  # largest magnitude of the command
    integral: str = ""

    @property
    def signals(self) -> list[str]:
        """Registers that are recorded beside those of the place."""
        return [name for name in (self.velocity, self.command, self.integral) if name]


@dataclass(kw_only=True)
class HostCourse:
    """One start: an axis whose host has made its move, and that is left to itself now."""

    start: str
    machine: Machine[Any, Any]
    watched: Watched
    rest: Callable[[int], object]  # lets so many ticks pass, whatever the axis says
    failure: Callable[[], str]  # why its guard has switched it off; empty while it has not
    noisy: bool = False  # its sensors never stand still, so that no rest is proven
    proven: bool = False
    leapt: float = 0.0  # nothing is leapt over
    blocks: list[Block] = field(default_factory=list[Block])

    def __post_init__(self) -> None:
        """What was recorded of the move is not looked at."""
        if isinstance(self.machine.recorder, Recorder):
            self.machine.recorder.pass_on(self.blocks.append, 0)
        self.machine.close()
        self.blocks.clear()

    def go(self, seconds: float) -> Numbers:
        """Simulate so long: a row for each record, shape (n, columns)."""
        self.rest(round(seconds / self.machine.tick))
        if told := self.failure():
            raise AxisError(f"{self.machine.time:.3g} s after power-on, when it should stand: {told}")
        self.machine.close()
        rows = self._rows(np.concatenate(self.blocks))
        self.blocks.clear()
        last = rows[int((1.0 - STILL) * len(rows)) :]
        same = [np.ptp(last[:, k]) == 0.0 for k in (1, 2, 7)]
        faded = np.ptp(last[:, 6]) <= SAME * self.watched.limit
        self.proven = not self.noisy and bool(faded) and all(same)
        return rows

    def _rows(self, seen: Any) -> Numbers:
        """As `tuning.COLUMNS` says; between two records the axis was between their places."""
        w, place = self.watched, self.watched.place(seen)
        before = np.concatenate([place[:1], place[:-1]])
        low, high = np.minimum(place, before), np.maximum(place, before)
        command = seen[w.command].astype(np.float64)
        integral = seen[w.integral].astype(np.float64) if w.integral else np.zeros(len(place))
        held, limited = seen[w.velocity] == 0.0, np.abs(command) >= w.limit
        columns = seen["t"], low, high, low, high, w.error(seen), command, integral, held, limited
        return np.stack(columns, axis=1).astype(np.float64)


class Standing(Ensemble):
    """An axis after moves of its own host; a method says how a start is made, and what moves it."""

    usual = fewest = EIGHT
    between, single, command_unit = False, True, "count"

    def begun(self, number: int, place: float, phase: float) -> HostCourse:
        """A start after its move: the axis begins at a share of a count, its sample clock at a share of its period."""
        raise NotImplementedError

    def courses(self, starts: int, seed: int, *, on_counts: bool) -> Sequence[HostCourse]:
        """The axis after its moves; targets lie on counts."""
        del on_counts
        return list(self._begun(starts, seed))

    def _begun(self, starts: int, seed: int) -> Iterator[HostCourse]:
        for number in range(starts):
            yield self.begun(number, *places(number, seed))

    def assumed(self, ratio: float, stribeck: float) -> Any:
        """Nothing else is assumed: such friction has no Stribeck velocity."""
        raise NotImplementedError
