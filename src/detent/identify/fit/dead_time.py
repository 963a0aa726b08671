"""Dead time between the effort and the motion that it makes.

An effort acts after the dead time of amplifier and bus, and, where it is held between samples, on average half a sample
later. `find_dead_time` looks for the shift at which the effort is explained best by acceleration, velocity, its sign,
position and a constant, the equation of a rigid axis, where the axis moves one way. It is the peak of a correlation
through filters (C. H. Knapp, G. C. Carter, "The generalized correlation method for estimation of time delay", IEEE
Transactions on Acoustics, Speech, and Signal Processing 24 (1976) 320); effort and motion pass the same windows, which
delay neither. Where a resonance is part of the model, the phase of a frequency response tells it (`resonances`).

Assumed: an axis that is rigid below the frequencies that the windows let pass, and stays as it is.
"""

from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from detent.errors import DetentError
from detent.identify.fit.estimate import Estimate, estimate
from detent.logs.differences import parabolas, window_rows
from detent.logs.effort import Motion, terms
from detent.logs.log import Values

LONGEST = 40  # samples up to which a dead time is looked for
EXPLAINED = 0.7  # share of the effort's variance that the motion must explain
BLOCKS = 8  # parts of the recording whose dead times are compared
_FEWEST_ROWS = 4
_PARABOLA = 0.01
_ONE_WAY = 0.999
_ENOUGH = 0.2


@dataclass(frozen=True, slots=True)
class DeadTime:
    """A dead time."""

    estimate: Estimate  # [s], with its interval
    step: float  # time between two samples [s]
    reason: str = ""  # why it is not to be trusted; empty where it is

    @property
    def samples(self) -> float:
        """Dead time in samples."""
        return self.estimate.value / self.step

    @property
    def whole(self) -> int:
        """Whole samples, the nearest."""
        return round(self.samples)

    @property
    def fraction(self) -> float:
        """What is left beside the whole samples, -0.5..0.5."""
        return self.samples - self.whole

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {**asdict(self), "samples": self.samples, "whole": self.whole, "fraction": self.fraction}


def find_dead_time(t: Values, effort: Values, position: Values, *, hold: float | None = None) -> DeadTime:
    """Find the dead time by the shift at which the motion explains the effort best."""
    least = BLOCKS * _FEWEST_ROWS * LONGEST
    if not len(t) == len(effort) == len(position) or len(t) < least:
        raise DetentError(
            f"identify: came {len(t)} times, {len(effort)} efforts, {len(position)} positions; allowed: as many of "
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
    found = estimate("delay", value, "s", error, "shift of the effort that the motion explains best", BLOCKS - 1)
    return DeadTime(found, step, _doubt(shift, explained))


def _columns(position: Values, step: float, rows: int) -> Values:
    """What the effort is explained by: acceleration, velocity, its sign, position, one; shape (n - 2 rows + 2, 5)."""
    x, v, a = parabolas(position, step, rows)
    columns = terms(Motion(x, v, a, rows))
    # The effort is smoothed, and friction with it; where that is not 1 or -1 the axis turned round, or stood.
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


def _doubt(shift: float, explained: float) -> str:
    """Why a shift is not to be trusted."""
    if explained < EXPLAINED:
        return (
            f"the motion explains {explained:.0%} of the effort at best, less than {EXPLAINED:.0%}; record a run with "
            "more acceleration, or take the delay from a frequency response"
        )
    if not -0.5 < shift < LONGEST - 0.5:
        return (
            f"no dead time from 0 to {LONGEST} samples explains the motion; check the sign and the clock of the effort"
        )
    return ""
