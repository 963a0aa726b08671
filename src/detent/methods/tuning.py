"""What a method brings to have its gains chosen and to be watched at standstill: `tune` and `hunt` know no method."""

import math
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass
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
    """An axis at standstill, from many starts: what `hunt` asks of a method."""

    unit: str
    """Of positions."""
    grain: float
    """Travel per count of the position loop's encoder, or what stands for it [m]; half of it is called flicker."""
    rule: Rule
    stated: bool
    """True where the file states static friction and Stribeck velocity, on which the answer depends."""
    band: str
    """Key of the dead band that stops hunting; empty where there is none."""
    integral: str
    """Key of the integral gain."""

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

    def slips(self, errors: "NDArray[np.float64]") -> "NDArray[np.float64] | None":
        """Error [m] at the standstill behind a slip that begins at each of these; None where it is no map of one."""
        ...
