"""Signals that say the same as another, so that one can be held against it: a position, and its velocity integrated."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from detent.logs.differences import FARTHEST, correlation_curve, equal_runs, integral, likeness, resolution, window_rows
from detent.logs.draft import Draft
from detent.logs.log import Values

FEWEST = 10  # rows with the same number from which a sensor can be stuck
TRACKS = 0.9  # correlation from which two series are taken for the same motion
_FEWEST_WINDOWS = 20
_SMALL_WINDOW = 4


class Twin(NamedTuple):
    """Another signal that says the same as one."""

    name: str  # what it is called in a sentence
    way: Values  # the way by the other, to the scale of the one, shape (n,)
    disagreement: Values  # the way by the one less that by the other, shape (n,)
    grain: float  # resolution of the positions
    drift: float  # resolution of the velocity, by which its integral can drift per second; 0 between positions

    def way_in(self, first: int, last: int) -> float:
        """Way in some samples, by whichever of the two says more."""
        way, rest = self.way[first:last], self.disagreement[first:last]
        return max(float(np.ptp(way)), float(np.ptp(way + rest)))

    def rounding(self, t: Values, first: int, last: int) -> float:
        """Disagreement that rounding can make in some samples."""
        return 3 * self.grain + self.drift * float(t[last - 1] - t[first])


def find_twins(draft: Draft, role: str) -> Iterator[Twin]:
    """Find the signals that a position or a velocity can be held against."""
    values, t = draft.values[role], draft.t
    base = draft.unit(role).partition("/")[0]
    found: list[tuple[str, Values, Values, float]] = []
    if role == "velocity":
        if "position" in draft.values and draft.unit("position") == base:
            found = [("the position", integral(values, t), draft.values["position"], resolution(values))]
    else:
        velocity = draft.values.get("velocity")
        if velocity is not None and draft.unit("velocity").partition("/")[0] == base:
            found = [("the integral of the velocity", values, integral(velocity, t), resolution(velocity))]
        for other in ("position_load", "position", "reference"):
            if other in draft.values and other != role:
                found.append((f"the {other.replace('_', ' ')}", values, _aligned(values, draft.values[other]), 0.0))
    grain = resolution(draft.values["position"]) if "position" in draft.values else 0.0
    for name, ours, theirs, drift in found:
        scale = _scale(ours, theirs, values)
        if scale is not None:
            yield Twin(name, scale * theirs, ours - scale * theirs, grain, drift)


def _aligned(ours: Values, theirs: Values) -> Values:
    """The second series, taken from as much earlier as the first follows it.

    How much that is, is asked with the stretches bridged in which the first stays the same.
    """
    index = np.arange(len(ours), dtype=np.float64)
    free = _free(ours)
    bridged = np.interp(index, index[free], ours[free]) if free.any() else ours
    curve = correlation_curve(bridged, theirs, min(FARTHEST, len(ours) // 4))
    lag = max(0, int(np.argmax(curve)) - len(curve) // 2)
    return np.r_[np.full(lag, theirs[0]), theirs[: len(theirs) - lag]]


def _scale(ours: Values, theirs: Values, values: Values) -> float | None:
    """Factor of the changes of two series over windows; None where they are not alike.

    Where the sensor's numbers stay the same, and where they jump behind that, the changes say nothing.
    """
    free = _free(values)
    rows = min(max(window_rows(ours), window_rows(theirs)), len(ours) // 4)
    for size in (rows, _SMALL_WINDOW):
        blocked = np.r_[0, np.cumsum(~free)]
        clear = blocked[size + 1 :] == blocked[: -size - 1]
        if clear.sum() >= _FEWEST_WINDOWS:
            found = likeness((ours[size:] - ours[:-size])[clear], (theirs[size:] - theirs[:-size])[clear])
            return found.factor if found.correlation > TRACKS else None
    return None


def _free(values: Values) -> NDArray[np.bool_]:
    """Samples outside the runs of equal numbers that are looked at, and outside the jumps behind them."""
    free = np.ones(len(values), dtype=np.bool_)
    for first, last in equal_runs(values, FEWEST).tolist():
        free[first : last + 1] = False
    return free
