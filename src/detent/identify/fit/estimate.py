"""A constant with its limits: what every method of identification gives."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from detent.logs.differences import scipy
from detent.logs.log import Values

LEVEL = 0.95  # share of intervals that hold the true value

DIGITS = 9
"""Digits of a constant; what comes after them differs from processor to processor, and a simulation that sticks and
slips would make more of it."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """A constant that was found in a recording.

    Attributes
    ----------
    name : str
        What it is called, such as ``coulomb.positive``.
    value : float
        In SI units.
    unit : str
        Its unit.
    error : float
        Standard error, coloured residuals taken into account.
    low, high : float
        Limits of the 95 % interval.
    method : str
        How it was found.
    """

    name: str
    value: float
    unit: str
    error: float
    low: float
    high: float
    method: str

    @property
    def relative_error(self) -> float:
        """Standard error over magnitude; infinite for a value of 0."""
        return self.error / abs(self.value) if self.value else np.inf

    @property
    def half(self) -> float:
        """Half of the interval."""
        return 0.5 * (self.high - self.low)

    def holds(self, value: float) -> bool:
        """True where a value lies within the interval."""
        return self.low <= value <= self.high

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return asdict(self)


def estimate(  # noqa: PLR0913 - the fields of an estimate
    name: str, value: float, unit: str, error: float, method: str, degrees: float = np.inf
) -> Estimate:
    """Give an estimate its interval, by Student's distribution."""
    reach = quantile(degrees) * error
    return Estimate(name, value, unit, error, value - reach, value + reach, method)


def rms(values: Values) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def significant(value: float, digits: int = DIGITS) -> float:
    """The value to so many digits."""
    return float(f"{value:.{digits}g}")


def quantile(degrees: float) -> float:
    """How many standard errors the 95 % interval reaches to each side.

    >>> round(quantile(float("inf")), 3), round(quantile(10), 3)
    (1.96, 2.228)
    """
    stats, upper = scipy("stats"), 0.5 * (1.0 + LEVEL)
    return float(stats.norm.ppf(upper) if np.isinf(degrees) else stats.t.ppf(upper, max(degrees, 1.0)))
