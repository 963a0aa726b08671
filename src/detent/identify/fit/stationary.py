"""Standard errors where the colour of the noise is known from elsewhere, or too few samples tell it.

`coloured` takes whatever residual there is, but needs many rows; a fit to a dozen samples, or one in
which a few rows hold most of what is known, leaves a residual that is too small. Here the noise is that of a longer
series, made from white noise by an autoregressive filter (Yule and Walker). The covariance of the constants follows
from it, and the larger of both is taken.
"""

import numpy as np

from detent.identify.fit.coloured import coloured_covariance, independent_rows
from detent.logs.log import Values
from detent.logs.windows import scipy

ORDER = 4  # order of the autoregressive filter, at most
ROWS_PER_ORDER = 20  # rows of the series for each order, at least
FADED = 200  # rows before the first of a fit whose noise still acts on it, at most


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
