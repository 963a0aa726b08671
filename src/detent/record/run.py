"""What every run notes, whichever axis made it, and how a run is judged by what its own controller saw."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Generic, Literal, TypeVar

from detent.control.guard import forget_conduct
from detent.files.screen import OnScreen
from detent.units import format_quantity

Level = Literal["good", "warn", "bad"]  # of a verdict: green, amber, red
COLOURS: dict[Level, str] = {"good": "green", "warn": "amber", "bad": "red"}  # as data for others names them

MOST_LIMITED = 0.5  # share of a run with the command at its limit above which the axis has nothing in hand
MOST_LIMITED_AT_REST = 0.05  # the same of the time in which it stands
SWING = 0.5  # to and fro at rest, as a share of the window on both sides of a target, that is no longer standing
LEAST_SWING = 3  # counts: below, a sensor may flicker between its counts
TURNS = 6  # turns to and fro that are no longer the settling of a move
EDGE = 0.9  # share of the window from which an error at rest is at its edge

JobT = TypeVar("JobT")


def largest(values: Sequence[float]) -> float:
    """The largest of some magnitudes; NaN where there is none, or one is NaN."""
    return math.nan if not values or any(map(math.isnan, values)) else max(values)


@dataclass(repr=False)
class RunRecord(OnScreen, Generic[JobT]):
    """Outcome of a job; each method adds what its runs have beside. Times since power-on [s]."""

    job: JobT  # what was asked; it has a name and a kind
    done: bool = False  # the axis did the whole job
    failure: str = ""  # why not, and what to do; empty if `done`
    #: what looks wrong though it was done, the worst first: what happened; what it means; what to do
    warnings: list[str] = field(default_factory=list[str])
    time_ready: float = 0.0  # the axis takes commands, and the job begins
    time_end: float = 0.0
    limited_share: float = 0.0  # of all looks of its guard, those with the command at its limit

    told: ClassVar[tuple[str, ...]] = ()
    """Names of the figures that `to_dict` gives beside these."""
    measured: ClassVar[Mapping[str, str]] = {}
    """Figures of the whole run that are numbers, and their units: what a tolerance may be asked of."""
    measured_moves: ClassVar[Mapping[str, str]] = {}
    """The same of each of its `moves`; of the run, the largest magnitude."""
    kept_by: ClassVar[Mapping[str, str]] = {}
    """Of such figures, the key of the axis file that says how large they may be."""

    @property
    def level(self) -> Level:
        """Of the verdict: green only for a run that did its job and of which nothing looks wrong."""
        if not self.done:
            return "bad"
        return "warn" if self.warnings else "good"

    @property
    def doubt(self) -> str:
        """What happened, of the first warning; empty without one."""
        return self.warnings[0].partition(";")[0].rstrip(".") if self.warnings else ""

    def figures(self) -> dict[str, float]:
        """What was measured, by name; `done` is 1 or 0, and of a run that failed there is nothing else: NaN."""
        moves: list[Any] = getattr(self, "moves", []) if self.measured_moves else []
        found = {name: [abs(float(getattr(move, name))) for move in moves] for name in self.measured_moves}
        told = {name: float(getattr(self, name)) for name in self.measured}
        told |= {name: largest(each) for name, each in found.items()}
        if len(moves) > 1:
            told |= {f"move {k} {name}": value for name, each in found.items() for k, value in enumerate(each, 1)}
        return {"done": float(self.done)} | (told if self.done else dict.fromkeys(told, math.nan))

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``--json``."""
        job: Any = self.job
        names = ("done", "failure", "warnings", "time_ready", "time_end", *self.told)
        told = {name: getattr(self, name) for name in names}
        return {"job": job.name, "kind": job.kind, "level": COLOURS[self.level]} | told


@dataclass
class Evidence:
    """What the guard of a controller saw of a whole run (`control.guard.Conduct`), and what is to be said of it."""

    guard: Any  # its registers; None for an axis without one, of which errors alone tell
    look: float  # time between two looks of it [s]
    count: float  # way of the axis per count that it sees [unit]; 0 where it sees none
    window: float  # error that counts as arrived [unit]
    unit: str = "m"  # of the axis: "m" or "rad"
    forget: Callable[[], object] | None = None  # lets the controller begin a stretch; default: by its guard itself

    looks: int = 0
    limited: int = 0
    worst: str = ""  # of the stretches at rest
    swing: float = 0.0  # to and fro in that stretch [unit]
    edge: tuple[float, str] = (0.0, "")  # largest share of the window that an error at rest took, and whose

    def take(self, whose: str = "", *, rest: bool = False) -> None:
        """A stretch is over, of `whose`; at `rest` the axis had only to stand."""
        if self.guard is None:
            return
        seen = self.guard.conduct
        self.looks, self.limited = self.looks + seen.looks, self.limited + seen.limited
        if rest and seen.looks:
            self._judge_rest(whose, seen)
        if self.forget is None:
            forget_conduct(self.guard)
        else:
            self.forget()

    def _judge_rest(self, whose: str, seen: Any) -> None:
        counts = seen.highest - seen.lowest
        swing, spent = counts * self.count, format_quantity(seen.looks * self.look, "s", 3)
        if seen.turns >= TURNS and counts >= LEAST_SWING and swing > max(SWING * 2 * self.window, self.swing):
            self.swing = swing
            self.worst = (
                f"at rest {whose} the axis oscillated over {format_quantity(swing, self.unit, 3)}, "
                f"{seen.turns} turns in {spent}"
            )
        elif seen.limited > MOST_LIMITED_AT_REST * seen.looks and not self.worst:
            limited = format_quantity(seen.limited * self.look, "s", 3)
            self.worst = f"at rest {whose} the command was at its limit for {limited} of {spent}"

    @property
    def limited_share(self) -> float:
        """Share of all looks with the command at its limit; 0 without a guard."""
        return self.limited / self.looks if self.looks else 0.0

    def take_error(self, whose: str, error: float) -> None:
        """An error at the end of a move [unit]."""
        self.edge = max(self.edge, (abs(error) / self.window, whose))

    def warnings(self) -> list[str]:
        """What is to be said of the whole run, the worst first."""
        found: list[str] = []
        if self.limited > MOST_LIMITED * self.looks:
            limited, spent = (format_quantity(looks * self.look, "s", 3) for looks in (self.limited, self.looks))
            found.append(
                f"the command was at its limit for {limited} of {spent}; there is no reserve for a load, or the loop "
                "is unstable and oscillates between the limits; lower the gains that `detent check` warns about, "
                "reduce the acceleration, or raise the effort limit"
            )
        if self.worst:
            found.append(
                f"{self.worst}; a stable loop comes to rest; lower its gains, or check for backlash and friction "
                "inside it"
            )
        share, whose = self.edge
        if EDGE < share <= 1.0:
            found.append(
                f"{whose} ended at {100 * share:.3g} % of its window from the target; another machine of this type may "
                "end outside; widen the window, or find what holds the axis off"
            )
        return found
