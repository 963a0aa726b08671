"""Fewer points for the same picture: a screen is a few thousand points wide, a trace has millions."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def thin_indices(values: NDArray[Any], points: int) -> NDArray[np.intp]:
    """Choose rows that draw like all rows: the smallest and the largest of each of `points` / 2 equal stretches.

    >>> import numpy as np
    >>> spike = np.zeros(1000)
    >>> spike[617] = 5.0
    >>> 617 in thin_indices(spike, 20)
    True
    """
    rows = len(values)
    if rows <= points:
        return np.arange(rows, dtype=np.intp)
    bins = points // 2
    width = -(-rows // bins)
    # The last stretch is filled up with the last value, which may be chosen again: `unique` removes it.
    padded = np.pad(np.asarray(values, dtype=np.float64), (0, width * bins - rows), mode="edge").reshape(bins, width)
    first = np.arange(bins) * width
    low = first + np.where(np.isnan(padded), np.inf, padded).argmin(axis=1)
    high = first + np.where(np.isnan(padded), -np.inf, padded).argmax(axis=1)
    chosen = np.unique(np.concatenate(([0], low, high, [rows - 1])))
    return chosen[chosen < rows].astype(np.intp)
