"""The position gain of a rotary table: the largest that keeps Ms, and passes its target by no more than the window."""

import math
from collections.abc import Mapping, Sequence

from detent.methods.rotary_table.derive import TableFigures
from detent.methods.rotary_table.schema import RotaryTableSpec
from detent.methods.tuning import Bounds, Tuning, digits
from detent.units import format_quantity

HALVINGS = 40
LEAST, MOST = 1e-4, 1.0  # gains that are looked at, times the strobe period
MORE = 1.02  # times the gain, with which a bound is broken that decides
KEY = "method.position_gain"


RECORDINGS = {"steps of the speed word, with the speed": "droop time_constant"}
"""What would narrow an interval, and of which keys."""


def _beyond(figures: TableFigures, spec: RotaryTableSpec) -> float:
    """How far a stop from full speed passes its target, over the in-position window."""
    return figures.overshoot(figures.speed) / (max(spec.method.in_position, 1) * spec.count)


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
        return level if level > 1.0 else max(level, _beyond(figures, spec))

    def limits(self, plant: RotaryTableSpec, values: Mapping[str, float], bounds: Bounds) -> str:
        """Ms, or how far a stop passes its target: what a little more gain would break."""
        spec = plant.changed(method={"position_gain": MORE * values[KEY]})
        figures, found = TableFigures(spec), list[str]()
        m = figures.loop.open_loop().margins()
        if m.sensitivity >= bounds.sensitivity:
            found.append(f"Ms at the position is {bounds.sensitivity:.3g} at {format_quantity(m.peak, 'Hz', 3)}")
        if _beyond(figures, spec) >= 1.0:
            counts = max(spec.method.in_position, 1)
            speed = format_quantity(figures.speed, "rad/s", 3)
            found.append(
                f"with more gain a stop from {speed} passes its target by more than the window, {counts} "
                f"count{'s' if counts != 1 else ''}"
            )
        return "; ".join(found)

    def easier(self, plant: RotaryTableSpec) -> list[tuple[str, RotaryTableSpec]]:
        """A wider window, a quicker drive."""
        counts = 2 * max(plant.method.in_position, 1)
        constant = 0.5 * plant.drive.time_constant
        return [
            (f"a window of {counts} counts", plant.changed(method={"in_position": counts})),
            (f"a drive with a time constant of {format_quantity(constant, 's', 3)}",
             plant.changed(drive={"time_constant": constant})),
        ]  # fmt: skip

    def worth(self, values: Mapping[str, float]) -> float:
        """Kp [1/s]."""
        return values[KEY]
