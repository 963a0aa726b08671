"""The choice of gains that hold for every plant: choose, look for the plant that breaks them most, add it, again.

As robust tuners do (Apkarian, Gahinet, Buhr 2014: "Multi-model, multi-objective tuning of fixed-structure
controllers"), with a look at plants that the choice has not seen at the end.
"""

import math
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any

from detent.axisfile.tolerance import value_of
from detent.methods.method import untold
from detent.methods.tuning import Bounds, Tuning
from detent.tune.plants import CORNERS, HYPERCUBE, Plants, Variant

MOST_ROUNDS = 12
BEYOND = 1.002  # of its bound, that a plant of the set may reach
BEYOND_FRESH = 1.005  # the same of plants that the choice has not seen
FRESH = 2000  # of those
MOVES = 1e-6  # by how much a key must move the worst bound to count
FEWEST = 0.1  # of what the nominal plant would get, below which the plant is not known well enough
NARROWER = 0.25  # of an interval, of which is told what it would be worth
LOOSER = 2.0  # Ms of which is told what it would be worth: above it a loop rings

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class Guaranteed:
    """Gains, and for what they hold."""

    values: Mapping[str, float]  # by key; empty where none keeps the bounds
    binding: Sequence[Variant] = field(default_factory=list[Variant])  # plants that decided, the nominal one first
    worst: float = 0.0  # by how much the worst bound is exceeded over all plants looked at: 1 is at the bound
    fresh: int = 0  # how many of them the choice had not seen


@dataclass(frozen=True)
class Chooser:
    """Chooses the gains of one axis."""

    tuning: Tuning
    plants: Plants
    bounds: Bounds
    goal: str = "stiff"
    held: Mapping[str, float] = field(default_factory=dict[str, float])
    progress: Progress = untold
    settle: Callable[[Mapping[str, float]], float] = field(default=lambda _: math.inf, compare=False)
    """How long the job takes to settle with some gains [s], for the goal "quick"."""

    def choose(self, variants: Sequence[Variant]) -> dict[str, float]:
        """The best gains for these plants; empty for none. Of two that are as quick, the stiffer."""
        plants = [one.spec for one in variants]
        if self.goal != "quick":
            return self.tuning.choose(plants, self.bounds, self.goal, self.held)
        front = self.tuning.front(plants, self.bounds, self.held)
        return min(front, key=lambda one: (self.settle(one), -self.tuning.worth(one)), default=dict[str, float]())

    def worst(self, variants: Sequence[Variant], values: Mapping[str, float]) -> list[float]:
        """By how much each plant exceeds the worst of its bounds."""
        return self.tuning.worst([one.spec for one in variants], values, self.bounds)

    def nominal(self) -> Guaranteed:
        """The gains for the plant of the file alone."""
        return Guaranteed(self.choose([self.plants.nominal]), [self.plants.nominal], 1.0)

    def guaranteed(self, keys: Sequence[str] | None = None, fresh: int = FRESH) -> Guaranteed:
        """The gains for all plants; of some of the keys only, where these are named."""
        keys = list(self.plants.tolerance) if keys is None else list(keys)
        binding = [self.plants.nominal]
        values = self.choose(binding)
        if not keys or not values:
            return Guaranteed(values, binding, 1.0)
        pool = self.pool(values, keys)
        for number in range(MOST_ROUNDS):
            self.progress(0.8 * number / MOST_ROUNDS, f"round {number + 1}: {len(binding)} plants")
            levels = self.worst(pool, values)
            most, limit, seen = max(levels), BEYOND, pool
            if most <= BEYOND and fresh:
                seen = list(self.plants.random(fresh, keys, number + 2))
                levels, limit = self.worst(seen, values), BEYOND_FRESH
                most = max(levels)
            if most <= limit:
                return Guaranteed(values, binding, most, fresh)
            binding.append(seen[levels.index(most)])
            values = self.choose(binding)
            if not values:
                return Guaranteed({}, binding)
        return Guaranteed(values, binding, max(self.worst(pool, values)))

    def pool(self, values: Mapping[str, float], keys: Sequence[str] | None = None) -> list[Variant]:
        """The plant of the file, all corners of the keys that matter most with such values, and a Latin hypercube."""
        keys = list(self.plants.tolerance) if keys is None else keys
        moving = self.ranked(keys, values)[:CORNERS]
        return [self.plants.nominal, *self.plants.corners(moving), *self.plants.hypercube(HYPERCUBE, keys)]

    def ranked(self, keys: Sequence[str], values: Mapping[str, float]) -> list[str]:
        """The keys that move a bound, the strongest first."""
        moved = dict[str, float]()
        here = self.worst([self.plants.nominal], values)[0]
        for key in keys:
            moved[key] = max(abs(level - here) for level in self.worst(self.plants.ends(key), values))
        return sorted((key for key in keys if moved[key] > MOVES), key=lambda key: -moved[key])

    def worth(self, found: Guaranteed) -> float:
        """What was made as large as the bounds allow; 0 where there are no gains."""
        return self.tuning.worth(found.values) if found.values else 0.0

    def keeps(self, found: Guaranteed, changed: Mapping[str, float]) -> bool:
        """Whether the plants that decided keep the bounds with other values of some keys, too."""
        if not set(changed) & set(found.values):
            return True
        return max(self.worst(found.binding, {**found.values, **changed})) <= BEYOND

    def limits(self, found: Guaranteed) -> str:
        """What keeps the choice from more, in words: bounds that are reached, on the plant that reaches them most."""
        levels = self.worst(found.binding, found.values)
        number = levels.index(max(levels))
        told = self.tuning.limits(found.binding[number].spec, found.values, self.bounds)
        return f"{told}, on plant {number + 1} that decides" if told and number else told

    def further(self, nominal: Guaranteed) -> list[tuple[str, float]]:
        """What would allow more on the axis of the file: in words, and how many times as much, the most first.

        Computed as the choice is, with one thing changed at a time: infinite where there are gains only so, 0 where
        there are none even so.
        """
        goal, spec = self.tuning.goals[0], self.plants.spec
        changes = [(text, made, self.bounds) for text, made in self.tuning.easier(spec)]
        if changes and self.bounds.sensitivity < LOOSER:
            phase = math.degrees(2.0 * math.asin(0.5 / LOOSER))
            text = f"Ms {LOOSER:g}, a gain margin of {LOOSER / (LOOSER - 1.0):.3g} and {phase:.0f} deg of phase,"
            changes.append((text, spec, replace(self.bounds, sensitivity=LOOSER)))
        if changes and goal != self.goal:
            changes.append(("", spec, self.bounds))

        def tried(change: tuple[str, Any, Bounds]) -> tuple[str, float]:
            """What one of them would be worth."""
            values = self.tuning.choose([change[1]], change[2], goal, self.held)
            return change[0], self.tuning.worth(values) if values else 0.0

        with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
            found = dict(pool.map(tried, changes))
        base = found.pop("", self.worth(nominal))
        shares = {text: worth / base if base else math.inf if worth else 0.0 for text, worth in found.items()}
        return sorted(shares.items(), key=lambda one: -one[1])

    def regained(self) -> list[tuple[str, float]]:
        """What each interval a quarter as wide, the others as they are, would be worth, the most first."""
        found = list[tuple[str, float]]()
        for k, (key, one) in enumerate(self.plants.tolerance.items()):
            self.progress(k / len(self.plants.tolerance), f"{key} better known")
            here = value_of(self.plants.spec, key)
            narrow = replace(one, low=here - NARROWER * (here - one.low), high=here + NARROWER * (one.high - here))
            if one.whole:
                narrow = replace(one, low=here, high=here)
            tried = replace(self, plants=Plants(self.plants.spec, self.plants.tolerance | {key: narrow}))
            found.append((key, tried.worth(tried.guaranteed(fresh=0))))
        return sorted(found, key=lambda pair: -pair[1])
