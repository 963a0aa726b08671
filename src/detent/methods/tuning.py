"""What a method brings to have its gains chosen and to be watched at standstill: `tune` and `hunt` know no method."""

import math
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

DIGITS = 3  # of a gain that is chosen


@dataclass(frozen=True, slots=True)
class Bounds:
    """What the gains must keep."""

    sensitivity: float = 1.7  # Ms, largest magnitude of 1/(1 + L) where the loops are cut
    overshoot: float = 1.1  # largest magnitude of the reference to the position, without feedforward


@dataclass(frozen=True, slots=True)
class Share:
    """A share of feedforward that follows from how well the constant behind it is known."""

    key: str
    value: float
    why: str  # in a sentence


@dataclass(frozen=True, slots=True)
class Response:
    """What the simulation of an axis does in time, to be laid beside that with other gains and of other plants."""

    name: str  # what was done to it
    label: str  # of what is seen
    t: "NDArray[np.float64]"  # since then [s], shape (n,)
    y: "NDArray[np.float64]"  # [m] or [rad], or a share, shape (n,)
    figures: Mapping[str, str] = field(default_factory=dict[str, str])  # by name, as people read them
    share: bool = False  # whether y is a share


class Tuning(Protocol):
    """The choice of the gains of one axis over a set of plants: specifications that differ in what is not known.

    What a class derived from it leaves out has the default that stands here.
    """

    keys: tuple[str, ...]
    """Keys of the file that it chooses."""
    stated: Mapping[str, float]
    """Their values in the file."""
    goals: tuple[str, ...]
    """What may be asked for; the first is the usual one."""
    worth_text: str
    """What is made as large as the bounds allow, in words."""
    recordings: Mapping[str, str]
    """What would narrow the interval of a key, by the last part of the key."""

    def choose(self, plants: Sequence[Any], bounds: Bounds, goal: str, held: Mapping[str, float]) -> "dict[str, float]":
        """Values of the keys; empty where none keeps the bounds on every plant."""
        ...

    def worst(self, plants: Sequence[Any], values: Mapping[str, float], bounds: Bounds) -> list[float]:
        """By how much the worst of the bounds is exceeded on each plant: 1 is at the bound."""
        ...

    def worth(self, values: Mapping[str, float]) -> float:
        """What is made as large as the bounds allow."""
        ...

    def front(self, plants: Sequence[Any], bounds: Bounds, held: Mapping[str, float]) -> "list[dict[str, float]]":
        """Values from the stiffest to quieter ones, of which the goal "quick" tries each; none without that goal."""
        del plants, bounds, held
        return []

    def settling(self, result: Any) -> float:
        """How long the slowest move of a run took to settle [s]; infinite where one did not."""
        del result
        return math.inf

    def shares(self, stated: Container[str], known: Mapping[str, float]) -> Sequence[Share]:
        """Shares of feedforward, by the keys that are stated and the relative uncertainty of those that have one."""
        del stated, known
        return ()

    def limits(self, plant: Any, values: Mapping[str, float], bounds: Bounds) -> str:
        """Which bound the values are at on a plant, and where, as the end of a sentence; empty where it is not known.

        Of several that are alike close, all.
        """
        del plant, values, bounds
        return ""

    def easier(self, plant: Any) -> Sequence[tuple[str, Any]]:
        """Plants that cost something to have and may allow more: what is changed, in words, and the specification."""
        del plant
        return ()

    def figures(self, plant: Any) -> Mapping[str, str]:
        """What follows of its loops with the gains that it has, by name, as people read it."""
        del plant
        return {}

    def responses(self, plant: Any) -> Sequence[Response]:
        """What the simulation does when it is pushed, and on a short way; always as many."""
        del plant
        return ()

    def followed(self, plant: Any, job: Any) -> Response | None:
        """How far the simulation is off its reference during a job; None where that is no figure of the method."""
        del plant, job


@dataclass(frozen=True, slots=True)
class Trial:
    """What a simulation says of some values."""

    refused: str  # why they will not do, in a few words; empty where they will
    rank: tuple[float, ...] = ()  # of two that will do the smaller is the better
    figures: Mapping[str, str] = field(default_factory=dict[str, str])  # by name, as people read them


class Search(Protocol):
    """The choice of values that no linear model gives: each candidate is simulated.

    What a class derived from it leaves out has the default that stands here.
    """

    keys: tuple[str, ...]
    """Keys of the file that it chooses."""
    decides: str
    """What the best of those that will do has least of, in words."""
    measure: str
    """The first of what ranks them, as the label of an axis."""
    sides: tuple[str, str]
    """The two things in which candidates differ."""

    @property
    def job(self) -> Any:
        """What candidates are tried with unless told otherwise; None for the trial job of the method."""
        return None

    def candidates(self, held: Sequence[str]) -> Sequence[Mapping[str, Any]]:
        """Values that are tried; keys that are held have that of the file."""
        ...

    def place(self, values: Mapping[str, Any]) -> tuple[float, float]:
        """Of the two things in which candidates differ."""
        ...

    def tried(self, spec: Any, job: Any) -> Trial:
        """What an axis with such values does, with the moves of a job or those of the method."""
        ...


def digits(value: float, how: Callable[[float], float] = round) -> float:
    """A value above 0 with three digits, rounded so.

    >>> digits(59.287, math.floor), digits(5477.4)
    (59.2, 5480.0)
    """
    power = DIGITS - 1 - math.floor(math.log10(value))
    scaled = how(round(value * 10.0**power, 6))
    return float(f"{scaled:.0f}e{-power}")


# ---- standstill

COLUMNS = (
    "t", "motor_low", "motor_high", "load_low", "load_high", "error", "command", "integral", "held", "limited",
)  # fmt: skip
"""What a row says of a sample: when it ends [s], between which places both masses were in it [m], the error [m],
command and integral [V], and two bits: friction held the motor, the command was at its limit."""


@dataclass(frozen=True, slots=True)
class Rule:
    """A rule of thumb for the stick-slip of an integral against static friction."""

    swing: float  # of the position, peak to peak [m]; 0 where there is none
    period: float  # [s]; infinite without an integral
    why: str  # which constant to change, in a sentence


@dataclass(frozen=True, slots=True)
class Forecast:
    """A cycle that a closed form forecasts, to be shown beside the simulation."""

    kind: str  # as `Ensemble.kind` calls it
    by: str  # the closed form
    swing: float  # of the mass that moves farther, peak to peak [m]
    period: float  # [s]
    command: float  # peak to peak [V]


@dataclass(frozen=True, slots=True, kw_only=True)
class Swing:
    """How an axis moves that does not come to rest, from one start."""

    motor: float  # peak to peak [m]
    load: float  # the same
    period: float  # [s]; NaN where it does not repeat
    command: float  # peak to peak [V]
    held: float  # share of the time in which friction holds the motor
    limited: float  # share of the samples with the command at its limit

    @property
    def largest(self) -> float:
        """Of the mass that moves farther [m]."""
        return max(self.motor, self.load)


class Course(Protocol):
    """An axis left to itself from one start."""

    start: str
    """Kind of the start: "small", "wide" or "hard"."""

    @property
    def proven(self) -> bool:
        """True once nothing will ever change: it rests."""
        ...

    @property
    def leapt(self) -> float:
        """Time in which it stood and that was not simulated sample by sample [s]."""
        ...

    def go(self, seconds: float) -> "NDArray[np.float64]":
        """Simulate so long, or until rest is proven: a row for each sample, shape (n, columns), as `COLUMNS` says."""
        ...


class Ensemble(Protocol):
    """An axis at standstill, from many starts: what `hunt` asks of a method.

    What a class derived from it leaves out has the default that stands here.
    """

    unit: str
    """Of positions."""
    grain: float
    """Travel per count of the position loop's encoder, or what stands for it [m]; half of it is called flicker."""
    usual: int = 24
    """Starts unless told otherwise."""
    fewest: int = 12
    """Starts at least."""
    draws: str = "a third each small, wide and hard"
    """What the starts are, in words."""
    between: bool = True
    """Whether targets may lie between counts of the encoder."""
    single: bool = False
    """True where one mass moves: the load is the motor."""
    command_unit: str = "V"
    """Of the command; "count" for the word of a drive."""
    band: str = ""
    """Key of the dead band that stops hunting; empty where there is none."""
    remarks: Sequence[str] = ()
    """What else is to be said of these starts, in sentences without their full stop."""

    @property
    def integral(self) -> str:
        """Key of the integral gain; empty where there is none."""
        return ""

    @property
    def rule(self) -> Rule | None:
        """The rule of thumb; None where there is none for this law."""
        return None

    @property
    def stated(self) -> bool:
        """True where the file states static friction and Stribeck velocity, or the answer depends on neither."""
        return True

    @property
    def earlier(self) -> "tuple[str, Any] | None":
        """A phase before that of rest: its name, and the specification of an axis that never leaves it."""
        return None

    @property
    def forecasts(self) -> Sequence[Forecast]:
        """What closed forms say of cycles that need no friction."""
        return ()

    def courses(self, starts: int, seed: int, *, on_counts: bool) -> "Sequence[Course]":
        """The axis at its starts, each the same however many there are."""
        ...

    def kind(self, swing: Swing) -> str:
        """What makes it hunt so, in a few words."""
        ...

    def assumed(self, ratio: float, stribeck: float) -> Any:
        """The specification with another static friction, over Coulomb friction, and Stribeck velocity [m/s]."""
        ...

    @property
    def as_stated(self) -> Any:
        """The specification with static friction only where the file states it; None where that changes nothing."""
        return None

    def helps(self, kind: str) -> str:
        """What to try against a kind of hunting."""
        del kind
        return "choose other values with `detent tune`"

    def slips(self, errors: "NDArray[np.float64]") -> "NDArray[np.float64] | None":
        """Error [m] at the standstill behind a slip that begins at each of these; None where it is no map of one."""
        del errors
        return None
