"""Sample period, scale and coefficient of a filtered servo: the least torque step a count that damps the loop.

The velocity-error constant K1/(B TS) stays what it is; of the sample periods that keep B a whole number, each with the
least A that keeps the bounds, the one with the least A B is chosen: a count of the speed moves the drive by A B.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from detent.methods.filtered_servo.derive import FilteredFigures
from detent.methods.filtered_servo.schema import FilteredServoSpec
from detent.methods.tuning import Bounds, Tuning, digits

LEAST_DAMPING = 0.5
CLOSE = 0.98  # of its bound, from which one decides
LEAST_MARGIN = 2.0  # factor by which the gain of the axis may grow until the loop no longer settles
PERIODS = (10.0, 5.0, 4.0, 2.5, 2.0, 1.25, 1.0, 0.5, 0.4, 0.25, 0.2, 0.125, 0.1)  # that are tried, times the file's
HALVINGS = 30
LEAST = 1e-3  # smallest coefficient that is looked at
PERIOD, SCALE, COEFFICIENT = "method.sample_period", "method.scale", "method.coefficient"


RECORDINGS = {"short ramps both ways, with the current": "moving_mass rotor_inertia torque_constant current_per_count"}
"""What would narrow an interval, and of which keys."""


class FilteredTuning(Tuning):
    """What `tune` asks."""

    keys = (PERIOD, SCALE, COEFFICIENT)
    goals = ("quiet",)
    worth_text = "calmness 1/(A B)"
    recordings: Mapping[str, str] = {key: text for text, keys in RECORDINGS.items() for key in keys.split()}

    def __init__(self, spec: FilteredServoSpec) -> None:
        method = spec.method
        self.spec = spec
        self.stated = {PERIOD: method.sample_period, SCALE: float(method.scale), COEFFICIENT: method.coefficient}

    def choose(
        self, plants: Sequence[FilteredServoSpec], bounds: Bounds, goal: str, held: Mapping[str, float]
    ) -> dict[str, float]:
        """The best of all sample periods; none where none keeps the bounds on every plant."""
        del goal
        found = [
            one for period, scale in self._periods(held) if (one := self._least(plants, bounds, period, scale, held))
        ]
        return max(found, key=lambda one: (self.worth(one), one[PERIOD]), default=dict[str, float]())

    def _periods(self, held: Mapping[str, float]) -> Iterator[tuple[float, int]]:
        """Sample periods, and the scales that keep the velocity-error constant, that the file may have."""
        from detent.methods.registry import METHODS

        method = self.spec.method
        product, rules = method.scale * method.sample_period, METHODS[self.spec.axis.method].rules
        for factor in PERIODS:
            period, scale = float(f"{method.sample_period * factor:.12g}"), method.scale / factor
            whole = round(scale)
            if whole < 1 or abs(whole * period - product) > 1e-9 * product:
                continue
            if held.get(PERIOD, period) != period or held.get(SCALE, whole) != whole:
                continue
            spec = self.spec.changed(method={"sample_period": period, "scale": whole})
            if not any(found for rule in rules for found in rule(spec)):
                yield period, whole

    def _least(
        self, plants: Sequence[Any], bounds: Bounds, period: float, scale: int, held: Mapping[str, float]
    ) -> dict[str, float]:
        """The least coefficient with which every plant keeps the bounds, with three digits; none where none does."""

        def keeps(coefficient: float) -> bool:
            values = {PERIOD: period, SCALE: scale, COEFFICIENT: coefficient}
            return max(self.worst(plants, values, bounds)) <= 1.0

        if COEFFICIENT in held:
            return {PERIOD: period, SCALE: scale, COEFFICIENT: held[COEFFICIENT]} if keeps(held[COEFFICIENT]) else {}
        tried = [k / 64 for k in range(1, 65)]
        first = next((k for k, one in enumerate(tried) if keeps(one)), None)
        if first is None:
            return {}
        low, high = (tried[first - 1] if first else LEAST), tried[first]
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if keeps(middle) else (middle, high)
        return {PERIOD: period, SCALE: scale, COEFFICIENT: min(digits(high, math.ceil), 1.0)}

    def worst(self, plants: Sequence[Any], values: Mapping[str, float], bounds: Bounds) -> list[float]:
        """By how much each plant exceeds the worst of its bounds: damping and stability margin."""
        del bounds
        method = {"sample_period": values[PERIOD], "scale": round(values[SCALE]), "coefficient": values[COEFFICIENT]}
        return [_level(FilteredFigures(plant.changed(method=method))) for plant in plants]

    def limits(self, plant: FilteredServoSpec, values: Mapping[str, float], bounds: Bounds) -> str:
        """Damping, or the stability margin."""
        del bounds
        method = {"sample_period": values[PERIOD], "scale": round(values[SCALE]), "coefficient": values[COEFFICIENT]}
        figures = FilteredFigures(plant.changed(method=method))
        damping, margin = _damping(figures), figures.gain_margin
        found = [f"the damping of its swing is {damping:.3g}"] if damping <= LEAST_DAMPING / CLOSE else []
        found += [f"its stability margin is {margin:.3g}"] if margin <= LEAST_MARGIN / CLOSE else []
        return "; ".join(found)

    def worth(self, values: Mapping[str, float]) -> float:
        """How little a count of the speed moves the drive, 1/(A B)."""
        return 1.0 / (values[COEFFICIENT] * values[SCALE])


def _level(figures: Any) -> float:
    """The worse of both bounds: 1 is at the bound, infinite where the loop does not settle."""
    if not figures.loop.is_stable:
        return math.inf
    return max(LEAST_DAMPING / max(_damping(figures), 1e-9), LEAST_MARGIN / figures.gain_margin)


def _damping(figures: Any) -> float:
    """Of the swing that decays least; 1 where nothing swings."""
    swings = [-pole.real / abs(pole) for pole in figures.loop.poles() if abs(pole.imag) > 1e-9 * abs(pole)]
    return min(swings, default=1.0)
