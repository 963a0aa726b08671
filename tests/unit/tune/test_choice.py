"""The choice between gains, by a tuning that is made up."""

import math
from types import SimpleNamespace
from typing import Any

from detent.methods.tuning import Bounds, Tuning
from detent.tune.choice import Chooser


class MadeUp(Tuning):
    """Gains that the class itself knows."""

    keys = ("a",)
    goals = ("stiff", "quick")

    def choose(self, plants: Any, bounds: Any, goal: str, held: Any) -> dict[str, float]:
        return {"a": 1.0}

    def worth(self, values: Any) -> float:
        return values["a"]

    def front(self, plants: Any, bounds: Any, held: Any) -> list[dict[str, float]]:
        return [{"a": 3.0}, {"a": 2.0}, {"a": 1.0}]


def chosen(times: dict[float, float]) -> float:
    plants: Any = SimpleNamespace(nominal=SimpleNamespace(spec=None))
    chooser = Chooser(MadeUp(), plants, Bounds(), "quick", settle=lambda values: times[values["a"]])
    return chooser.nominal().values["a"]


def test_the_quickest_is_what_the_simulation_says_and_of_two_the_stiffer():
    assert chosen({3.0: 0.5, 2.0: 0.4, 1.0: 0.6}) == 2.0
    assert chosen({3.0: 0.4, 2.0: 0.4, 1.0: 0.6}) == 3.0
    assert chosen({3.0: math.inf, 2.0: math.inf, 1.0: 0.6}) == 1.0


def test_what_a_tuning_leaves_out():
    class Bare(Tuning):
        """A method with one goal and no feedforward."""

    bare: Any = Bare()
    assert (bare.front([], Bounds(), {}), bare.shares(set(), {})) == ([], ())
    assert bare.settling(None) == math.inf
