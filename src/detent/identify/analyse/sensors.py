"""Resolution of an encoder, and dead time between the effort and the motion that it makes.

Positions of an encoder lie on a grid: the largest step of which the differences between positions are whole multiples,
with an allowance for rounding. Candidates are small differences and their whole fractions; each is then fitted to
larger and larger differences, so that a small error of the step cannot add up to a count.

An effort acts after the dead time of amplifier and bus, and, where it is held between samples, on average half a sample
later. `find_dead_time` looks for the shift at which the equation of a rigid axis explains the effort best where the
axis moves one way: the peak of a correlation through filters (C. H. Knapp, G. C. Carter, "The generalized correlation
method for estimation of time delay", IEEE Transactions on Acoustics, Speech, and Signal Processing 24 (1976) 320).
Where a resonance is part of the model, the phase of a frequency response tells it (`resonances`).
"""

import math
from dataclasses import asdict, dataclass
from itertools import pairwise
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from detent.errors import DetentError
from detent.identify.fit.estimate import Estimate, estimate
from detent.logs.differences import parabolas, window_rows
from detent.logs.effort import Motion, terms
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
LONGEST = 40  # samples up to which a dead time is looked for
WIDEST = 10.0  # half of the interval of a dead time, in samples, at most
EXPLAINED = 0.7  # share of the effort's variance that the motion must explain
BLOCKS = 8  # parts of the recording whose dead times are compared
_FEWEST_ROWS = 4
_PARABOLA = 0.01
_ONE_WAY = 0.999
_ENOUGH = 0.2


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
        return Resolution(np.nan, 0, 0.0, "the positions lie on no grid: they are calculated, filtered or noisy")
    exact = _AS_EXACT * min(grid.error for grid in found)
    best = max((grid for grid in found if _is_believed(position, grid, exact)), key=lambda grid: grid.step)
    return Resolution(best.step, round(span / best.step), best.share)


def _is_believed(position: Values, grid: _Grid, exact: float) -> bool:
    """False for a grid that few positions or an even travel make: nearly the same way in each sample."""
    moved = [count for count in np.rint(np.abs(np.diff(position)) / grid.step).tolist() if count > 0]
    is_varied = len(moved) >= _MANY and moved.count(median(moved)) < _VARIED * len(moved)
    return is_varied or grid.error <= max(exact, _EXACT * grid.step)


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


@dataclass(frozen=True, slots=True)
class DeadTime:
    """A dead time."""

    estimate: Estimate  # [s], with its interval
    step: float  # time between two samples [s]
    reason: str = ""  # why it is not to be trusted; empty where it is

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON: the dead time in samples too, and the nearest whole ones with what is left beside."""
        samples = self.estimate.value / self.step
        return {**asdict(self), "samples": samples, "whole": round(samples), "fraction": samples - round(samples)}


def find_dead_time(t: Values, effort: Values, position: Values, *, hold: float | None = None) -> DeadTime:
    """Find the dead time by the shift at which the motion explains the effort best."""
    least = BLOCKS * _FEWEST_ROWS * LONGEST
    if not len(t) == len(effort) == len(position) or len(t) < least:
        raise DetentError(
            f"identify: got {len(t)} times, {len(effort)} efforts, {len(position)} positions; expected: as many of "
            f"each, {least} or more for a dead time of up to {LONGEST} samples; record longer"
        )
    step = float(t[-1] - t[0]) / (len(t) - 1)
    even: Values = t[0] + step * np.arange(len(t), dtype=np.float64)
    effort, position = np.interp(even, t, effort), np.interp(even, t, position)
    rows = 2 * window_rows(position) + 1
    columns, smooth = _columns(position, step, rows), parabolas(effort, step, rows)[0, rows // 2 : -(rows // 2)]
    shift, explained = _best_shift(columns, smooth)
    cuts = np.linspace(0, len(smooth), BLOCKS + 1).astype(np.int64).tolist()
    parts = [_best_shift(columns[first:last], smooth[first:last])[0] for first, last in pairwise(cuts)]
    error = step * float(np.hypot(np.std(parts, ddof=1) / np.sqrt(BLOCKS), _PARABOLA))
    value = step * shift - 0.5 * (step if hold is None else hold)
    found = estimate("delay", value, "s", error, "shift of the effort that best explains the motion", BLOCKS - 1)
    doubt = ""
    if explained < EXPLAINED:
        advice = "record a run with more acceleration, or take the delay from a frequency response"
        doubt = f"the motion explains {explained:.0%} of the effort at best, less than {EXPLAINED:.0%}; {advice}"
    elif found.high < 0.0:
        late = f"{-1e3 * value:.3g} ms"
        advice = "the effort is time-stamped late, or the position early; record both with the same clock"
        doubt = f"the motion comes {late} before its effort, which is not causal: {advice}"
    elif found.half > WIDEST * step:
        doubt = f"{1e3 * value:.3g} +- {1e3 * found.half:.3g} ms: its parts disagree; record more changes of speed"
    elif not -0.5 < shift < LONGEST - 0.5:
        advice = "check the sign and the clock of the effort"
        doubt = f"no dead time from 0 to {LONGEST} samples explains the motion; {advice}"
    return DeadTime(found, step, doubt)


def _columns(position: Values, step: float, rows: int) -> Values:
    """What the effort is explained by: acceleration, velocity, its sign, position, one; shape (n - 2 rows + 2, 5)."""
    x, v, a = parabolas(position, step, rows)
    columns = terms(Motion(x, v, a, rows))
    # The effort is smoothed, and friction with it; where that is not 1 or -1 the axis inverted, or stood.
    friction = parabolas(columns[:, 2], step, rows)[0]
    columns = columns[rows // 2 : -(rows // 2)]
    columns[:, 2] = friction
    return columns


def _best_shift(columns: Values, effort: Values) -> tuple[float, float]:
    """Samples by which the effort comes before the motion, with a fraction, and the share of it that is explained."""
    columns = columns[LONGEST : len(effort) - LONGEST]
    moving = np.abs(columns[:, 2]) > _ONE_WAY
    moving |= np.mean(moving) < _ENOUGH
    columns = columns[moving]
    basis = np.linalg.qr(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300))[0]
    shifts = np.arange(-1, LONGEST + 1)
    shares = np.array(
        [_share(basis, effort[LONGEST - shift : len(effort) - LONGEST - shift][moving]) for shift in shifts]
    )
    top = int(np.argmax(shares))
    fraction = 0.0
    if 0 < top < len(shares) - 1:
        left, peak, right = shares[top - 1 : top + 2].tolist()
        bend = left - 2 * peak + right
        fraction = 0.5 * (left - right) / bend if bend < 0 else 0.0
    return float(shifts[top]) + fraction, float(shares[top])


def _share(basis: Values, values: Values) -> float:
    """Part of the variance of some values that a basis explains; the constant is one of its columns."""
    along = basis.T @ values
    centred = float(np.sum((values - values.mean()) ** 2))
    return 1.0 - float(values @ values - along @ along) / centred if centred > 0 else 0.0
