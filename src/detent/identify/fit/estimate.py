"""A constant with its limits, and standard errors of a regression whose residuals are coloured and of uneven size.

The covariance of the constants needs the long-run variance of the scores, instrument times residual, row by row in
time. Each projection of the scores on one of the lowest cosines of the record is an independent look at the variance
near frequency zero; Student's distribution with as many degrees of freedom gives intervals that hold in small samples,
where those of a Newey-West sum are too short (Lazarus, Lewis, Stock, Watson: HAR inference: recommendations for
practice. Journal of Business and Economic Statistics 36 (2018); Mueller: HAC corrections for strongly autocorrelated
time series. Same journal 32 (2014)). Where the instrument of a constant is large in few rows, as a jerk is, few
residuals carry its error, and its degrees of freedom are fewer (Satterthwaite: An approximate distribution of estimates
of variance components. Biometrics Bulletin 2 (1946)).

All this needs many rows; a fit to a dozen samples, or one in which a few rows hold most of what is known, leaves a
residual that is too small. For these `known_noise_covariance` takes the noise of a longer series, made from white noise
by an autoregressive filter (Yule and Walker), and the larger of both covariances.
"""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from detent.identify.fit.chance import student_reach
from detent.logs.differences import scipy
from detent.logs.log import Values

LEVEL = 0.95  # share of intervals that hold the true value

DIGITS = 9
"""Digits of a constant; what comes after them differs from processor to processor, and a simulation that sticks and
slips would make more of it."""

RANK = 1e-10
"""Singular value, in parts of the largest, below which columns of unit length are one and the same: what rounding
leaves of them decides nothing."""

SHARE = 0.3  # cosines per independent residual, at most: beyond them the variance would be read where it has fallen
ORDER = 4  # order of the autoregressive filter, at most
ROWS_PER_ORDER = 20  # rows of the series for each order, at least
FADED = 200  # rows before the first of a fit whose noise still acts on it, at most


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
    return student_reach(0.5 * (1.0 - LEVEL), max(degrees, 1.0))


def independent_rows(residual: Values) -> float:
    """How many independent residuals are worth as much as these: ``n (1 - r) / (1 + r)`` with the correlation `r`."""
    n, r = len(residual), neighbour_correlation(residual)
    return n * (1.0 - r) / (1.0 + r)


def neighbour_correlation(residual: Values) -> float:
    """Correlation of neighbours, within 0 and 0.99, corrected for its bias of ``1 / n``."""
    power = float(np.sum(residual**2))
    correlation = float(np.sum(residual[1:] * residual[:-1])) / power + 1.0 / len(residual) if power > 0.0 else 0.0
    return min(max(correlation, 0.0), 0.99)


def fallen_density(correlation: float, rows: int, cosines: int) -> float:
    """Mean spectral density over the cosines, in parts of that at frequency zero, of a first-order process.

    Its density falls as ``1 / (1 + x^2)`` with ``x = w sqrt(r) / (1 - r)``, `w` the angle per row.

    >>> round(fallen_density(0.9, 1000, 16), 3), fallen_density(0.0, 1000, 41)
    (0.933, 1.0)
    """
    x = np.pi * cosines / rows * np.sqrt(correlation) / (1.0 - correlation)
    return float(np.arctan(x) / x) if x > 0.0 else 1.0


def count_cosines(rows: int, independent: float) -> int:
    """Cosines, and degrees of freedom: 0.41 n^(2/3), fewer where residuals are strongly coloured, at least 4.

    >>> count_cosines(1000, 1000), count_cosines(1000, 50), count_cosines(10, 10)
    (41, 15, 4)
    """
    return max(4, min(round(0.41 * rows ** (2.0 / 3.0)), round(SHARE * independent)))


def long_run_variance(scores: Values, cosines: int) -> Values:
    """Long-run covariance of rows in their order of time."""
    projected = _cosine_sums(scores, cosines)
    return projected.T @ projected / len(projected)


def _cosine_sums(rows: Values, cosines: int) -> Values:
    """The cosine transform of rows, the first without the mean, by Fourier's (Makhoul, IEEE Trans. ASSP 28 (1980))."""
    # SciPy has it; its package takes longer to load than most logs to identify.
    n = len(rows)
    spectrum = np.fft.fft(np.concatenate([rows[::2], rows[1::2][::-1]]), axis=0)[1 : cosines + 1]
    turned = spectrum * np.exp(-0.5j * np.pi / n * np.arange(1, len(spectrum) + 1))[:, None]
    return np.sqrt(2.0 / n) * turned.real


def coloured_covariance(
    columns: Values, residual: Values, instruments: Values | None = None, *, others: int = 0
) -> tuple[Values, int]:
    """Covariance of the constants of a regression with coloured residuals, to which `others` were fitted as well."""
    n, k = columns.shape[0], columns.shape[1] + others
    chosen = columns if instruments is None else instruments
    size, length = column_sizes(columns), column_sizes(chosen)
    independent = independent_rows(residual)
    degrees = count_cosines(n, independent)
    scores = chosen / length * residual[:, None]
    few = independent / max(independent - k, 2.0)
    fallen = fallen_density(neighbour_correlation(residual), n, min(degrees, n))
    inverse = np.asarray(np.linalg.pinv((chosen / length).T @ (columns / size), rcond=RANK), np.float64)
    found = [
        inverse @ (n * few * variance) @ inverse.T
        for variance in (long_run_variance(scores, min(degrees, n)) / fallen, _lagged_variance(scores, n / independent))
    ]
    least, other = (np.maximum(np.diag(v), 0.0) for v in found)
    grow = np.sqrt(np.where(least > 0.0, np.maximum(other, least) / np.where(least > 0.0, least, 1.0), 1.0))
    return found[0] * np.outer(grow, grow) / np.outer(size, size), degrees


def lasting(columns: Values, residual: Values, instruments: Values) -> Values:
    """Errors of constants by coloured residuals, in those by independent ones of the same sizes, shape (k,)."""
    size, length = column_sizes(columns), column_sizes(instruments)
    tools = instruments / length
    weight = tools @ np.asarray(np.linalg.pinv(tools.T @ (columns / size), rcond=RANK), np.float64).T
    alone = np.sum((weight * residual[:, None]) ** 2, axis=0) / size**2
    coloured = np.diag(coloured_covariance(columns, residual, instruments)[0])
    return np.sqrt(np.where(alone > 0.0, coloured / np.where(alone > 0.0, alone, 1.0), 1.0))


def carried_degrees(columns: Values, residual: Values, instruments: Values, cosines: int) -> Values:
    """Degrees of freedom behind the variance of each constant, from 1 to the cosines."""
    # A sum of squares ``h^2 e^2`` of normal residuals has ``(sum h^2)^2 / sum h^4`` (Satterthwaite), times
    # ``(1 - r^2) / (1 + r^2)`` for a correlation `r` of neighbours, as their squares are correlated by its square.
    size, length = column_sizes(columns), column_sizes(instruments)
    tools = instruments / length
    weight = (tools @ np.asarray(np.linalg.pinv(tools.T @ (columns / size), rcond=RANK), np.float64).T) ** 2
    total, squares = weight.sum(axis=0), (weight**2).sum(axis=0)
    r = neighbour_correlation(residual) ** 2
    carried = np.where(squares > 0.0, total**2 / np.where(squares > 0.0, squares, 1.0), 1.0) * (1.0 - r) / (1.0 + r)
    return np.clip(carried, 1.0, float(cosines))


def column_sizes(columns: Values) -> Values:
    """Lengths of columns; 1 for one of zeros, whose constant then comes out as 0."""
    length = np.asarray(np.linalg.norm(columns, axis=0), np.float64)
    return np.where(length > 0.0, length, 1.0)


def _lagged_variance(scores: Values, memory: float) -> Values:
    """Long-run covariance by weighted lags, as far as residuals remember (Newey, West 1987; Stock, Watson, 15.4)."""
    # It and the projections err independently; the larger of both does not leave an interval too short by chance.
    # Weights that fall to 0 in a straight line are those of the products of moving sums: one pass for all lags.
    n = len(scores)
    lags = min(round(max(4.0, 0.75 * n ** (1.0 / 3.0), 3.0 * memory)), n - 1)
    added = np.zeros((n + 2 * lags + 1, scores.shape[1]))
    np.cumsum(scores, axis=0, out=added[lags + 1 : lags + 1 + n])
    added[lags + 1 + n :] = added[lags + n]
    moving = added[lags + 1 :] - added[: -lags - 1]
    return moving.T @ moving / (n * (lags + 1.0))


def known_noise_covariance(
    columns: Values, residual: Values, noise: Values, instruments: Values | None = None, floor: float = 0.0
) -> tuple[Values, int]:
    """Covariance of the constants of a regression, at least that of a known noise."""
    chosen = columns if instruments is None else instruments
    found, degrees = coloured_covariance(columns, residual, instruments)
    inverse: Values = np.asarray(np.linalg.pinv(chosen.T @ columns), float)
    passed = _shaped(chosen, noise - noise.mean())
    least = inverse @ (passed.T @ passed + floor**2 * chosen.T @ chosen) @ inverse.T
    own, other = np.diag(found), np.diag(least)
    if np.all(own <= other):
        return least, max(4, round(independent_rows(noise)))
    grown = np.sqrt(np.maximum(1.0, other / np.maximum(own, 1e-300)))
    return found * np.outer(grown, grown), degrees


def _shaped(columns: Values, noise: Values) -> Values:
    """Columns through the filter of the noise, backwards: their products are the covariance of the scores."""
    order = min(ORDER, len(noise) // ROWS_PER_ORDER)
    power = float(noise @ noise) / len(noise)
    padded = np.vstack([np.zeros((FADED, columns.shape[1])), columns])[::-1]
    if order < 1 or power <= 0.0:
        return np.sqrt(power) * columns
    products = np.array([noise[: len(noise) - lag] @ noise[lag:] for lag in range(order + 1)]) / len(noise)
    # A hair of white noise keeps a series without any from being foreseen for certain.
    products[0] *= 1.0 + 1e-9
    weights = np.asarray(scipy("linalg").solve_toeplitz(products[:-1], products[1:]), float)
    white = max(float(products[0] - weights @ products[1:]), 0.0)
    return np.sqrt(white) * np.asarray(scipy("signal").lfilter([1.0], np.r_[1.0, -weights], padded, axis=0), float)
