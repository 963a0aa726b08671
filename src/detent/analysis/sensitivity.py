"""What of a random sample its inputs explain: shares of variance and rank correlations, from the sample as it is.

No scheme of its own runs is needed: the same cases that say how many are good say what makes the others bad.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]

GROUPS = 100  # of cases, that a resample takes with replacement
RESAMPLES = 400
SEED = 1
TWO_SIDED = 1.959963984540054  # standard deviations of 95 %
FEWEST = 20  # cases that say anything


@dataclass(frozen=True, slots=True)
class Index:
    """A figure of a sample, with its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """What each input does to one quantity.

    Attributes
    ----------
    share : mapping of str to Index
        First-order index S1 by input: the share of the variance that the input explains alone, 0 to 1.
    rank : mapping of str to Index
        Spearman's rank correlation by input, -1 to 1.
    together : Index
        1 less the sum of all S1: what inputs do together only, and what no input explains.
    cases : int
        Cases that have a value.
    """

    share: Mapping[str, Index]
    rank: Mapping[str, Index]
    together: Index
    cases: int

    @property
    def order(self) -> list[str]:
        """The inputs, the one that explains most first; of equal ones as they were given."""
        return sorted(self.share, key=lambda key: (-self.share[key].value, -abs(self.rank[key].value)))


def sensitivity(inputs: Mapping[str, Values], outcome: Values) -> Sensitivity | None:
    """What each input of a random sample does to an outcome.

    S1 = Var(E(y|x)) / Var(y), with the conditional mean over round(2 N^(1/3)) bins of equally many cases, less what the
    noise of these means adds to their variance; an input of few whole values has a bin for each. Intervals are 1.96
    standard deviations of 400 resamples of groups of cases.

    Parameters
    ----------
    inputs : mapping of str to ndarray
        Values of each input, independent of one another, shape (n,).
    outcome : ndarray
        Value of the quantity, shape (n,); NaN where a case has none, which is left out.

    Returns
    -------
    Sensitivity or None
        None where fewer than 20 cases have a value, or all have the same.

    References
    ----------
    Plischke: An effective algorithm for computing global sensitivity indices, Rel. Eng. Syst. Safety 95 (2010).

    Examples
    --------
    >>> import numpy as np
    >>> x, z = np.random.default_rng(1).random((2, 5000))
    >>> found = sensitivity({"x": x, "z": z}, 2.0 * x - z)
    >>> [round(found.share[key].value, 1) for key in ("x", "z")]
    [0.8, 0.2]
    """
    kept = np.isfinite(outcome)
    y = np.asarray(outcome, dtype=np.float64)[kept]
    if len(y) < FEWEST or y.min() == y.max():
        return None
    y = (y - y.mean()) / y.std()
    size = -(-len(y) // min(GROUPS, len(y)))
    group = np.arange(len(y)) // size
    taken = np.random.Generator(np.random.Philox(key=SEED)).integers(0, group[-1] + 1, (RESAMPLES, group[-1] + 1))
    shares = {key: _resampled_shares(np.asarray(x)[kept], y, group, taken) for key, x in inputs.items()}
    ranks = {key: _resampled_ranks(np.asarray(x)[kept], y, group, taken) for key, x in inputs.items()}
    rest = 1.0 - np.sum(list(shares.values()), axis=0) if shares else np.ones(RESAMPLES + 1)
    return Sensitivity(
        {key: interval_of(found, 0.0, 1.0) for key, found in shares.items()},
        {key: interval_of(found, -1.0, 1.0) for key, found in ranks.items()},
        interval_of(rest, 0.0, 1.0),
        len(y),
    )


def ranks_of(values: Values) -> Values:
    """Places in the order of size, equal values sharing theirs, shape (n,).

    >>> ranks_of(np.array([3.0, 1.0, 3.0])).tolist()
    [1.5, 0.0, 1.5]
    """
    _, back, times = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(times)
    return (last - 0.5 * (times + 1))[back]


def interval_of(found: Values, least: float, most: float) -> Index:
    """The figure of a sample, the first of all, and its 95 % interval from the spread of the others, its resamples."""
    value, half = float(found[0]), TWO_SIDED * float(found[1:].std())
    return Index(*(min(max(one, least), most) for one in (value, value - half, value + half)))


def _sums(weights: Values, cell: NDArray[np.intp], cells: int, group: NDArray[np.intp]) -> Values:
    """Sums by group and cell, shape (groups, cells)."""
    groups = int(group[-1]) + 1
    return np.bincount(group * cells + cell, weights, groups * cells).reshape(groups, cells).astype(np.float64)


def _taken(sums: Values, taken: NDArray[np.int64]) -> Values:
    """Sums over all groups, then over those of each resample, added in order; shape (resamples + 1, cells)."""
    return np.concatenate([sums.sum(axis=0)[None], *(sums[row].sum(axis=0)[None] for row in taken)])


def _resampled_shares(x: Values, y: Values, group: NDArray[np.intp], taken: NDArray[np.int64]) -> Values:
    """S1 of the sample and of each resample, shape (resamples + 1,)."""
    wanted = round(2.0 * len(y) ** (1.0 / 3.0))
    known, back = np.unique(x, return_inverse=True)
    if len(known) <= wanted:
        cell, cells = back, len(known)
    else:
        order, cells = np.argsort(x, kind="stable"), wanted
        cell = np.empty(len(y), dtype=np.intp)
        cell[order] = np.arange(len(y)) * cells // len(y)
    n, s, q = (_taken(_sums(w, cell, cells, group), taken) for w in (np.ones(len(y)), y, y * y))
    total = n.sum(axis=1)
    mean = s.sum(axis=1) / total
    variance = q.sum(axis=1) / total - mean**2
    full = np.maximum(n, 1.0)
    within = np.maximum(q - s * s / full, 0.0) / np.maximum(n - 1.0, 1.0)
    between = (n * (s / full - mean[:, None]) ** 2).sum(axis=1) / total
    noise = (within * (1.0 - n / total[:, None]) * (n > 0.0)).sum(axis=1) / total
    return (between - noise) / np.where(variance > 0.0, variance, 1.0)


def _resampled_ranks(x: Values, y: Values, group: NDArray[np.intp], taken: NDArray[np.int64]) -> Values:
    """Spearman's correlation of the sample and of each resample, shape (resamples + 1,)."""
    a, b = (ranks_of(one) / len(y) - 0.5 for one in (x, y))
    nowhere = np.zeros(len(y), dtype=np.intp)
    weights = (np.ones(len(y)), a, b, a * a, b * b, a * b)
    n, sa, sb, aa, bb, ab = (_taken(_sums(one, nowhere, 1, group), taken)[:, 0] for one in weights)
    spread = (aa - sa * sa / n) * (bb - sb * sb / n)
    return np.where(spread > 0.0, (ab - sa * sb / n) / np.sqrt(np.where(spread > 0.0, spread, 1.0)), 0.0)


def clopper_pearson(good: int, of: int, level: float = 0.95) -> tuple[float, float]:
    """Interval of a share, of which so many of so many were seen.

    Its ends are quantiles of the beta distribution: no share outside of it would give what was seen, or what is farther
    off, with more than half of 1 less the level.

    Parameters
    ----------
    good, of : int
        How many were, of how many.
    level : float
        Share of all such intervals that hold the true share, at least.

    Returns
    -------
    tuple of float
        Lower and upper end, 0 to 1; both where nothing was seen.

    References
    ----------
    Clopper, Pearson: The use of confidence or fiducial limits, Biometrika 26 (1934).

    Examples
    --------
    >>> [round(end, 6) for end in clopper_pearson(99_900, 100_000)]
    [0.998784, 0.999186]
    """
    from scipy.special import betaincinv

    tail = 0.5 * (1.0 - level)
    low = float(betaincinv(good, of - good + 1, tail)) if good > 0 else 0.0
    high = float(betaincinv(good + 1, of - good, 1.0 - tail)) if good < of else 1.0
    return low, high
