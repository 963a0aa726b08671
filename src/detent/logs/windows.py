"""Sliding windows and correlations, by SciPy, which is loaded only where one is computed."""

from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.logs.log import Values


def scipy(part: str) -> Any:
    """A part of SciPy, loaded where it is used; it states no types."""
    return import_module(f"scipy.{part}")


def spread(values: Values, rows: int) -> Values:
    """Largest less smallest value in the window of some rows about each sample, shape (n,)."""
    images = scipy("ndimage")
    return np.asarray(images.maximum_filter1d(values, rows) - images.minimum_filter1d(values, rows), dtype=np.float64)


def fill_holes(mask: NDArray[np.bool_], rows: int) -> NDArray[np.bool_]:
    """The mask with stretches of False of up to some rows between True made True."""
    padded = np.pad(mask, rows)
    return np.asarray(scipy("ndimage").binary_closing(padded, structure=np.ones(rows + 1)), dtype=np.bool_)[rows:-rows]


def parabolas(values: Values, period: float, rows: int) -> NDArray[np.float64]:
    """Value, slope and curvature, in the middle, of the parabola nearest to each window.

    Savitzky and Golay, Analytical Chemistry 36 (1964) 1627.

    >>> parabolas(np.arange(7.0) ** 2, 1.0, 5).round(6)
    array([[ 4.,  9., 16.],
           [ 4.,  6.,  8.],
           [ 2.,  2.,  2.]])
    """
    kernels = [scipy("signal").savgol_coeffs(rows, 2, deriv=order, delta=period, use="dot") for order in (0, 1, 2)]
    return np.array([np.correlate(values, np.asarray(kernel), mode="valid") for kernel in kernels])
