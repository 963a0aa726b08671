"""How much further limits reach where what a model leaves is unlike noise.

Limits are worked out for noise: of one size whatever the axis does, and of a mean of nothing in the long run. What a
model or a sensor lacks is neither. It lasts, and it is louder where the axis turns, accelerates or is slow; of it the
sums over a log show how it scatters, and not how far it leans to one side. Where residuals look like that, limits reach
further, by four things:

- how much larger the error of a constant is than independent residuals of that size would make it, beyond what windows
  that overlap share (Durbin, Watson: Testing for serial correlation in least squares regression. Biometrika 37 (1950));
- by how much the size of residuals changes with what the axis does, or along the log (Glejser: A new test for
  heteroskedasticity. J. American Statistical Association 64 (1969));
- how clearly a constant changes, though by less than its interval;
- whether it comes from least squares, which noise in their columns biases.

How far is a convention, as no log tells it: so that limits of good logs hold as they should, and those of logs with
faults of every kind as often as can be (tests/trust).
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from detent.identify.fit import regression, steadiness
from detent.identify.fit.estimate import coloured_covariance, lasting
from detent.logs.log import Values

SHARED = 1.7  # errors in those of independent residuals, up to which windows that overlap explain them
USUAL = 0.1  # change of the size of residuals to each side of its mean, up to which noise has it
DOUBT = 2.5  # standard errors of such a change that are left out of it
CHANCE = 0.9  # clearness of the clearest change, of which 1 is the end of chance, up to which it is
LEAST_SQUARES = 1.5  # times that limits reach further where noise in the columns may bias the constants
MOST = 3.0  # how many times further limits reach, at most


@dataclass(frozen=True, slots=True)
class Doubt:
    """What of the residuals is unlike noise."""

    lasting: dict[str, float]  # error of each term in that by independent residuals
    uneven: float  # largest change of the size of residuals to each side of its mean
    clearest: float  # change of a constant, in the largest that is chance
    is_biased: bool  # True for least squares

    @property
    def times(self) -> dict[str, float]:
        """How many times further the limits of each term reach."""
        unlike = 2.0 * max(self.uneven - USUAL, 0.0) + 4.0 * max(self.clearest - CHANCE, 0.0)
        by = math.exp(min(unlike, MOST)) * (LEAST_SQUARES if self.is_biased else 1.0)
        return {name: min(by * max(long / SHARED, 1.0) ** 2, MOST) for name, long in self.lasting.items()}

    @property
    def usual(self) -> float:
        """The median of these."""
        return float(np.median(list(self.times.values())))

    def __str__(self) -> str:
        long = float(np.median(list(self.lasting.values())))
        return (
            f"what the model leaves is unlike noise: errors are {long:.1f} times those by independent residuals, whose "
            f"size changes by {self.uneven:.0%} with the motion or along the log; limits reach {self.usual:.1f} times "
            "as far"
        )


def doubt_of(parts: Sequence[regression.Prepared], fit: regression.Fit, clearest: float) -> Doubt:
    """How far the residuals of a fitted model are from noise; how clear its clearest change is, is known."""
    x, z, effort = regression.columns_of(parts, fit)
    rest = effort - regression.combine(x, regression.solve(z, x, effort))
    sizes = np.abs(rest) / max(float(np.mean(np.abs(rest))), 1e-300)
    uneven = max(_change(sizes, course) for course in _courses(parts, effort - rest))
    long = dict(zip(fit.names, lasting(x, rest, z).tolist(), strict=False))
    return Doubt(long, uneven, clearest, fit.instruments == "none")


def _courses(parts: Sequence[regression.Prepared], told: Values) -> Iterator[Values]:
    """What the size of residuals may go with, from -1 to 1."""
    yield steadiness.level(told)
    yield np.sign(told)
    yield steadiness.level(np.concatenate([p.ideal.jerk for p in parts]))
    for courses in (steadiness.over_motion, steadiness.over_time, steadiness.over_place):
        for _, course in courses(parts):
            yield course


def _change(sizes: Values, course: Values) -> float:
    """By how much sizes of a mean of 1 change to each side along a course; 0 where that may be chance."""
    column = (course - course.mean())[:, None]
    if not (power := float(np.sum(column**2))):
        return 0.0
    change = float(column[:, 0] @ sizes) / power
    covariance, _ = coloured_covariance(column, sizes - sizes.mean() - change * column[:, 0], others=1)
    return max(abs(change) - DOUBT * math.sqrt(max(float(covariance[0, 0]), 0.0)), 0.0)
