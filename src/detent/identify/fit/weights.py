"""A smooth window that turns equations of motion into sums over samples: no derivative of a measurement is taken.

Both sides of ``F = M q'' + f(q')`` are multiplied with a window ``w`` and integrated; by parts, the derivatives pass
from the measured position to the window, ``int w q'' = int w'' q``, where they are exact. A window is

    w(s) = (1 - s^2)^4,    -1 < s < 1

and zero outside: three derivatives vanish at its ends, so that sums over samples equal integrals far beyond the noise
of any measurement. The effort stands between two samples; its integral is exact.

Derivatives are summed over the ways between samples, so that what stands still has none at all. Summed over places,
they would be what rounding leaves, of either sign: a direction. Sums run in one order on every processor, which those
of BLAS do not.

Shinbrot: On the analysis of linear and nonlinear systems. Trans. ASME 79 (1957), the method of modulating functions.
Messenger, Bortz: Weak SINDy: Galerkin-based data-driven model selection. Multiscale Model. Simul. 19 (2021).
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from detent.logs.log import Values

Rows = NDArray[np.intp]  # numbers of samples
_SHAPE = np.polynomial.Polynomial([1.0, 0.0, -1.0]) ** 4


@dataclass(frozen=True, slots=True, eq=False)
class Kernel:
    """Weights of the samples around a place."""

    half: int  # samples to each side; the weights have ``2 half + 1`` entries
    step: float  # time between two samples [s]
    # value, first, second, third: sums of these times a signal are the weighted mean of the signal [1], of its first
    # [1/s], second [1/s^2] and third derivative [1/s^3]
    value: Values
    first: Values
    second: Values
    third: Values

    def held(self, signal: Values, rows: Rows, late: float = 0.0) -> Values:
        """Mean of a signal held from each sample to the next, seen `late` samples later, around samples `rows`."""
        return _sums(signal, _held(self.half, late)[0], rows)

    def held_slope(self, signal: Values, rows: Rows, late: float = 0.0) -> Values:
        """Mean of the first derivative of such a signal [1/s], around samples `rows`."""
        return _sums(signal, _held(self.half, late)[1], rows) / self.step

    def mean(self, signal: Values, rows: Rows) -> Values:
        """Mean of a signal between whose samples straight lines run, around samples `rows`."""
        return _sums(signal, self.value, rows)

    def velocity(self, position: Values, rows: Rows) -> Values:
        """Mean of the first derivative around samples `rows`."""
        return _way_sums(position, self.first, rows)

    def acceleration(self, position: Values, rows: Rows) -> Values:
        """Mean of the second derivative around samples `rows`."""
        return _way_sums(position, self.second, rows)

    def jerk(self, position: Values, rows: Rows) -> Values:
        """Mean of the third derivative around samples `rows`."""
        return _way_sums(position, self.third, rows)

    def velocities(self, position: Values) -> Values:
        """Mean of the first derivative around every sample; wrong for `half` samples at both ends."""
        ways, n = np.pad(np.diff(position), self.half), len(position)
        found = np.zeros(n)
        for k, weight in enumerate(_way_weights(self.first).tolist()):
            found += weight * ways[k : k + n]
        return found


def make_kernel(half: int, step: float) -> Kernel:
    """Weights of a window of some samples."""
    s = np.arange(-half, half + 1) / half
    area = float(np.sum(_SHAPE(s)))
    slope = half * step
    value = _SHAPE(s) / area
    first = -_SHAPE.deriv(1)(s) / (area * slope)
    second = _SHAPE.deriv(2)(s) / (area * slope**2)
    third = -_SHAPE.deriv(3)(s) / (area * slope**3)
    # Sums are no integrals: these make straight lines, parabolas and cubics come out exactly; of the third derivative a
    # straight line gives 0 and a cubic 6.
    t = np.asarray(np.arange(-half, half + 1) * step, np.float64)
    third -= t * float(np.sum(third * t)) / float(np.sum(t * t))
    return Kernel(
        half,
        step,
        value,
        first / float(np.sum(first * t)),
        (second - second.mean()) * (2.0 / float(np.sum((second - second.mean()) * (t * t)))),
        third * (6.0 / float(np.sum(third * t**3))),
    )


@cache
def _held(half: int, late: float) -> tuple[Values, Values]:
    """Integral of the window over each sample's stretch, `late` samples after it began; and its change, per sample."""
    reach = half + 1 + int(np.ceil(abs(late)))
    edges = np.clip((np.arange(-reach, reach + 2) + late) / half, -1.0, 1.0)
    rise = _SHAPE.integ()
    weights, area = np.diff(rise(edges)), float(rise(1.0) - rise(-1.0)) * half
    return weights / weights.sum(), -np.diff(_SHAPE(edges)) / area


def _sums(signal: Values, weights: Values, rows: Rows) -> Values:
    """Weighted sum around each of some samples; the signal keeps its end values beyond its ends."""
    half = len(weights) // 2
    return _weighted(np.concatenate([np.full(half, signal[0]), signal, np.full(half, signal[-1])]), weights, rows)


def _way_sums(position: Values, weights: Values, rows: Rows) -> Values:
    """The same for weights that add up to 0, by the ways between samples."""
    return _weighted(np.pad(np.diff(position), len(weights) // 2), _way_weights(weights), rows)


def _way_weights(weights: Values) -> Values:
    """Weights of the ways between samples, added up from the nearer end: those of the first derivative are positive."""
    half = len(weights) // 2
    return np.concatenate([-np.cumsum(weights[:half]), np.cumsum(weights[:half:-1])[::-1]])


def _weighted(padded: Values, weights: Values, rows: Rows) -> Values:
    """Weighted sums of what begins at some samples."""
    taken = np.lib.stride_tricks.sliding_window_view(padded, len(weights))[rows]
    taken *= weights
    return np.asarray(taken.sum(axis=1), np.float64)
