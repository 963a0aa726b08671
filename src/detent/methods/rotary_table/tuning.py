"""The position gain of a rotary table: the largest that keeps Ms, and passes its target by no more than the window."""

import math
from collections.abc import Mapping, Sequence

from detent.methods.rotary_table.derive import TableFigures
from detent.methods.rotary_table.schema import RotaryTableSpec
from detent.methods.tuning import Bounds, Tuning, digits

HALVINGS = 40
LEAST, MOST = 1e-4, 1.0  # gains that are looked at, times the strobe period
KEY = "method.position_gain"


RECORDINGS = {"steps of the speed word, with the speed": "droop time_constant"}
"""What would narrow an interval, and of which keys."""


class TableTuning(Tuning):
    """What `tune` asks."""

    keys = (KEY,)
    goals = ("stiff",)
    worth_text = "position gain"
    recordings: Mapping[str, str] = {key: text for text, keys in RECORDINGS.items() for key in keys.split()}

    def __init__(self, spec: RotaryTableSpec) -> None:
        self.stated = {KEY: spec.method.position_gain}

    def choose(
        self, plants: Sequence[RotaryTableSpec], bounds: Bounds, goal: str, held: Mapping[str, float]
    ) -> dict[str, float]:
        """The gain with three digits; none where none keeps the bounds on every plant."""
        del goal
        if held:
            return dict(held) if max(self.worst(plants, held, bounds)) <= 1.0 else {}
        period = plants[0].method.strobe_period
        low, high = LEAST / period, MOST / period
        if max(self.worst(plants, {KEY: low}, bounds)) > 1.0:
            return {}
        for _ in range(HALVINGS):
            middle = math.sqrt(low * high)
            low, high = (middle, high) if max(self.worst(plants, {KEY: middle}, bounds)) <= 1.0 else (low, middle)
        return {KEY: digits(low, math.floor)}

    def worst(self, plants: Sequence[RotaryTableSpec], values: Mapping[str, float], bounds: Bounds) -> list[float]:
        """By how much each plant exceeds the worst of its bounds."""
        return [self._level(plant.changed(method={"position_gain": values[KEY]}), bounds) for plant in plants]

    def _level(self, spec: RotaryTableSpec, bounds: Bounds) -> float:
        figures = TableFigures(spec)
        if figures.loop.spectral_radius >= 1.0:
            return math.inf
        level = figures.loop.open_loop().margins().sensitivity / bounds.sensitivity
        if level > 1.0:
            return level
        return max(level, figures.overshoot(figures.speed) / (max(spec.method.in_position, 1) * spec.count))

    def worth(self, values: Mapping[str, float]) -> float:
        """Kp [1/s]."""
        return values[KEY]
