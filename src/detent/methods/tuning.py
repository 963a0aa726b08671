"""What a method brings to have its gains chosen: `tune` asks for the choice, and knows no method."""

import math
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

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
