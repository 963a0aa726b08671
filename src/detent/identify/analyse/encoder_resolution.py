"""Resolution of an encoder, from the positions that it gave.

Positions of an encoder lie on a grid, however many counts lie between two of them. The grid is the largest step of
which the differences between positions are whole multiples: their greatest common divisor, with an allowance for
rounding. Candidates are small differences and their whole fractions; each is then fitted to larger and larger
differences, so that a small error of the step cannot add up to a count.
"""

import math
from dataclasses import dataclass
from statistics import median
from typing import NamedTuple

import numpy as np

from detent.logs.log import Values

FEWEST = 10  # different positions below which a grid would be a guess
OFF_GRID = 0.15  # distance from the grid, in steps, that rounding of the file may make
SHARE = 0.95  # share of the positions that must lie on the grid: some rows may be interpolated
_MOST_PARTS = 12
_MOST_DIFFERENCES = 2000
_ROUNDING = 1e-9
_NEAR = 40.0
_COARSEST = 0.02
_QUANTILES = (0.0, 0.01, 0.05, 0.2)
_AS_EXACT = 3.0
_EXACT = 1e-3
_VARIED = 0.8
_MANY = 50
_SAME = 1e-3


class _Grid(NamedTuple):
    """A step, the share of the positions on its grid, and their rms distance from it."""

    step: float
    share: float
    error: float


@dataclass(frozen=True, slots=True)
class Resolution:
    """Resolution of an encoder."""

    step: float  # smallest difference between two positions, in their unit; nan where there is none
    counts: int  # counts between the lowest and the highest position; 0 where no step was found
    share: float  # share of the positions on the grid
    reason: str = ""  # why there is none; empty where a step was found


def estimate_resolution(position: Values) -> Resolution:
    """Find the step of an encoder in its positions.

    >>> found = estimate_resolution(0.25e-3 * np.array([0, 3, 8, 13, 11, 22, 20, 29, 24, 35]))
    >>> round(found.step, 9), found.counts
    (0.00025, 35)
    """
    distinct = np.unique(position)
    span = float(np.ptp(position)) if len(position) else 0.0
    if len(distinct) < FEWEST or not span > 0:
        return Resolution(np.nan, 0, 0.0, f"{len(distinct)} different positions, {FEWEST} or more are needed")
    steps = np.abs(np.diff(position))
    # Between samples that follow one another, between neighbours in size, and over the whole travel.
    ways = [_thin(steps[steps > _ROUNDING * span]), _thin(np.diff(distinct)), _thin(distinct - distinct[0])]
    differences = np.sort(np.concatenate(ways))
    differences = differences[differences > _ROUNDING * span]
    grids = [_grid(position, _fit(differences, start)) for start in _candidates(differences)]
    found = [grid for grid in grids if grid.share >= SHARE]
    if not found:
        return Resolution(np.nan, 0, 0.0, "the positions lie on no grid: they are computed, filtered or noisy")
    exact = _AS_EXACT * min(grid.error for grid in found)
    best = max((grid for grid in found if _is_believed(position, grid, exact)), key=lambda grid: grid.step)
    return Resolution(best.step, round(span / best.step), best.share)


def _is_believed(position: Values, grid: _Grid, exact: float) -> bool:
    """False for a grid that few positions or an even travel make: nearly the same way in each sample."""
    if grid.error <= max(exact, _EXACT * grid.step):
        return True
    counts = np.rint(np.abs(np.diff(position)) / grid.step).tolist()
    moved = [count for count in counts if count > 0]
    return len(moved) >= _MANY and moved.count(median(moved)) < _VARIED * len(moved)


def _grid(position: Values, step: float) -> _Grid:
    """How well positions lie on a grid, wherever its zero is."""
    phase = np.asarray((_thin(position) - position[0]) / step, dtype=np.float64)
    turn = complex(np.mean(np.exp(2j * np.pi * phase)))
    phase -= math.atan2(turn.imag, turn.real) / (2 * np.pi)
    off = np.abs(phase - np.rint(phase))
    on_grid = off < OFF_GRID
    error = step * float(np.sqrt(np.mean(off[on_grid] ** 2))) if on_grid.any() else np.inf
    return _Grid(step, float(np.mean(on_grid)), error)


def _thin(values: Values) -> Values:
    """Some thousand of many values, evenly taken."""
    if len(values) <= _MOST_DIFFERENCES:
        return values
    return values[np.linspace(0, len(values) - 1, _MOST_DIFFERENCES).astype(np.int64)]


def _candidates(differences: Values) -> list[float]:
    """Steps to try: small differences, what lies between two differences, and whole fractions of both."""
    between = np.diff(differences)
    between = np.sort(between[between > _COARSEST * differences[0]])
    # Rounding scatters a difference; the mean of those like it is nearer to the count.
    bases = [
        float(np.mean(values[np.abs(values - base) < 0.2 * base]))
        for values in (differences, between)
        if len(values)
        for base in np.quantile(values, _QUANTILES, method="lower").tolist()
    ]
    steps = np.sort([base / part for base in bases for part in range(1, _MOST_PARTS + 1)])
    return steps[np.r_[True, np.diff(steps) > _SAME * steps[1:]]].tolist()


def _fit(differences: Values, start: float) -> float:
    """Step by least squares, first on small differences, then on ever larger ones."""
    step, reach = start, _NEAR * start
    while True:
        chosen = differences[differences <= reach]
        counts = np.rint(chosen / step)
        inside = (counts > 0) & (np.abs(chosen / step - counts) < 2 * OFF_GRID)
        if inside.any():
            step = float(chosen[inside] @ counts[inside] / (counts[inside] @ counts[inside]))
        if reach >= differences[-1]:
            return step
        reach *= 10.0
