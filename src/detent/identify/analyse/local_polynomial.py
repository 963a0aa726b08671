"""A polynomial fitted to a few samples about a place: peaks and crossings between samples, with their errors."""

from dataclasses import dataclass

import numpy as np

from detent.identify.fit.stationary import known_noise_covariance
from detent.logs.log import Values

DEGREES = ((16, 4), (9, 3), (6, 2))  # samples, at least, and the degree of the polynomial fitted to as many


@dataclass(frozen=True, slots=True, eq=False)
class LocalPolynomial:
    """A polynomial in time from its place."""

    width: float  # half the time that it was fitted over [s]; coefficients are for ``time / width``
    coefficients: Values  # by rising powers
    covariance: Values  # of the coefficients
    degrees: int  # degrees of freedom behind it
    low: float  # and high: first and last time that it was fitted over, from its place [s]
    high: float  # [s]

    def at(self, time: float, order: int = 0) -> float:
        """Value or derivative at a time from its place."""
        return float(self._powers(time, order) @ self.coefficients)

    def error_at(self, time: float, order: int = 0) -> float:
        """Standard error of `at`."""
        powers = self._powers(time, order)
        return float(np.sqrt(powers @ self.covariance @ powers))

    def summit(self) -> float:
        """Time of the largest value in the range that it was fitted over."""
        curve = np.polynomial.Polynomial(self.coefficients)
        inner = self._inside(curve.deriv())
        return max([self.low, self.high, *inner], key=self.at)

    def solve(self, level: float) -> float:
        """Time nearest to its place at which it has a value; that of the nearest value where it does not reach it."""
        curve = np.polynomial.Polynomial(self.coefficients) - level
        times = self._inside(curve)
        if times:
            return min(times, key=abs)
        return min((self.low, 0.0, self.high), key=lambda time: abs(self.at(time) - level))

    def _inside(self, curve: np.polynomial.Polynomial) -> list[float]:
        """Roots of a polynomial within the range."""
        roots: list[complex] = np.asarray(curve.roots(), np.complex128).tolist()
        times = [self.width * root.real for root in roots if abs(root.imag) < 1e-9]
        return [time for time in times if self.low <= time <= self.high]

    def _powers(self, time: float, order: int) -> Values:
        count = len(self.coefficients)
        columns = [np.polynomial.Polynomial.basis(k).deriv(order)(time / self.width) for k in range(count)]
        return np.array(columns, dtype=np.float64) / self.width**order


def fit_local_polynomial(
    t: Values, y: Values, place: float, noise: Values, floor: float = 0.0
) -> LocalPolynomial | None:
    """Fit a polynomial about a place; None with fewer samples than the lowest degree wants."""
    degree = next((degree for least, degree in DEGREES if len(t) >= least), 0)
    if not degree:
        return None
    width = 0.5 * float(t[-1] - t[0])
    columns = np.vander((t - place) / width, degree + 1, increasing=True)
    coefficients = np.asarray(np.linalg.lstsq(columns, y, rcond=None)[0], float)
    covariance, degrees = known_noise_covariance(columns, y - columns @ coefficients, noise, floor=floor)
    return LocalPolynomial(width, coefficients, covariance, degrees, float(t[0]) - place, float(t[-1]) - place)
