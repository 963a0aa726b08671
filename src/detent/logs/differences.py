"""What the physics checks compare: changes of a signal over windows, derivatives, and how alike two series are."""

from dataclasses import replace
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from detent.logs.log import Log, Values
from detent.logs.stamps import stretches

QUANTA = 20.0  # times its grain by which a position should change over a window for rounding and noise not to count
FARTHEST = 200  # rows up to which a shift is looked for
MOST_ROWS = 200_000  # rows that tell what all of a longer recording does: every so manieth is looked at
STEP = 0.25  # part of its span by which a signal changes from one sample to the next where it is stepped
STRETCH = 30_000  # rows of a stretch whose products are added up by one transform, at least
FEWEST_WINDOWS = 20  # windows that a recording is divided into at least


def scipy(part: str) -> Any:
    """A part of SciPy, loaded where it is used; it states no types."""
    return import_module(f"scipy.{part}")


class Likeness(NamedTuple):
    """How alike two series are: correlation, and the factor of the first to the second."""

    correlation: float
    factor: float


def resolution(values: Values) -> float:
    """Smallest step between two different values but for rounding, a billionth of the range; 0 for a constant."""
    # Of a long recording a part that moves is enough: the values of every so manieth row, and neighbours.
    values = np.r_[values[:: len(values) // MOST_ROWS], values[:MOST_ROWS]] if len(values) > 2 * MOST_ROWS else values
    steps = np.diff(np.unique(values))
    steps = steps[steps > 1e-9 * float(np.ptp(values))]
    return float(steps.min()) if len(steps) else 0.0


def grain(values: Values) -> float:
    """Smallest difference that means something: the resolution, or the noise (standard deviation) if that is more."""
    # The noise is taken from second differences, in which a smooth motion leaves next to nothing.
    bends = np.abs(np.diff(values, 2))
    noise = 1.4826 * float(np.median(bends)) / np.sqrt(6.0) if len(bends) else 0.0
    return max(resolution(values), noise)


def window_rows(position: Values) -> int:
    """Rows of a window over which a position changes by `QUANTA` grains, as a rule."""
    wanted, rows, most = QUANTA * grain(position), 4, max(4, len(position) // FEWEST_WINDOWS)
    while rows < most and float(np.sqrt(np.mean((position[rows:] - position[:-rows]) ** 2))) < wanted:
        rows = min(2 * rows, most)
    return rows


def smooth(values: Values, t: Values, rows: int, orders: int = 3) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Samples whose window of some rows has no gap, and the first of value, slope and curvature there, (orders, m)."""
    # Uneven stamps are noise here, so the period is the mean.
    parts = [part for part in stretches(t) if part.stop - part.start > rows]
    index = [np.arange(part.start + rows // 2, part.stop - rows // 2, dtype=np.int64) for part in parts]
    periods = [float(t[part][-1] - t[part][0]) / (part.stop - part.start - 1) for part in parts]
    found = [parabolas(values[part], period, rows, orders) for part, period in zip(parts, periods, strict=True)]
    if len(parts) == 1:
        return index[0], found[0]
    return np.concatenate([np.empty(0, np.int64), *index]), np.concatenate([np.empty((orders, 0)), *found], axis=1)


def integral(values: Values, t: Values) -> Values:
    """Integral over time by trapezoids, 0 at the first sample, shape (n,)."""
    return np.r_[0.0, np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(t))]


def with_position(log: Log) -> Log:
    """The log, with the integral of its velocity for a position where it has no other; 0 at its first sample.

    An offset of the velocity becomes a steady drift of the position, its noise a random walk: neither changes what
    accelerations and speeds say, but a force that depends on the place cannot be seen.
    """
    if "position" in log.signals or "velocity" not in log.signals:
        return log
    source, unit = log.columns["velocity"], log.units["velocity"].removesuffix("/s")
    told = "position: none recorded, the integral of the velocity is taken, 0 at the first sample"
    return replace(
        log,
        signals=log.signals | {"position": integral(log.signals["velocity"], log.t)},
        units=log.units | {"position": unit},
        columns=log.columns | {"position": replace(source, column=f"integral of {source.column}")},
        guesses=(*log.guesses, told),
    )


def paired_changes(position: Values, velocity: Values, t: Values) -> tuple[Values, Values]:
    """Changes of a position over windows, measured, and by the integral of the velocity."""
    # Both see the same window, whatever its stamps: neither is delayed, and rounding counts once per window.
    rows = window_rows(position)
    path = integral(velocity, t)
    step = max(1, rows // 2)
    first = np.concatenate([np.arange(part.start, part.stop - rows, step, dtype=np.int64) for part in stretches(t)])
    return path[first + rows] - path[first], position[first + rows] - position[first]


def likeness(ours: Values, theirs: Values, *, is_centred: bool = False) -> Likeness:
    """Correlation of two series about zero, or about their means, and the factor between them."""
    if len(ours) < 2:
        return Likeness(0.0, 0.0)
    if is_centred:
        ours, theirs = ours - ours.mean(), theirs - theirs.mean()
    both, own, other = float(ours @ theirs), float(ours @ ours), float(theirs @ theirs)
    if own <= 0 or other <= 0:
        return Likeness(0.0, 0.0)
    correlation = both / np.sqrt(own * other)
    # The ratio of their sizes: a regression would make the factor smaller by the noise of the second.
    return Likeness(correlation, float(np.copysign(np.sqrt(own / other), correlation)))


def correlate(ours: Values, theirs: Values) -> Values:
    """Correlation of two series about their means by the rows from which the first is later, -most..most."""
    most = min(FARTHEST, len(ours) // 4)
    ours, theirs = ours - ours.mean(), theirs - theirs.mean()
    # Only what lies in the middle takes part, so that each shift compares as many samples.
    middle = theirs[most : len(theirs) - most]
    products = products_near(ours, middle)
    squares = np.cumsum(np.r_[0.0, ours**2])
    sizes = np.sqrt(np.maximum(squares[len(middle) :] - squares[: len(squares) - len(middle)], 1e-300))
    return products / (sizes * (float(np.sqrt(middle @ middle)) or 1.0))


def products_of(ours: Values, theirs: Values) -> Values:
    """Sums of products of two series at all shifts at which they overlap, by a transform, shape (n + m - 1,)."""
    # SciPy's signal package does the same, and takes longer to load than most logs to identify.
    count = len(ours) + len(theirs) - 1
    size = quick_length(count)
    spectrum = np.fft.rfft(ours, size)
    spectrum *= np.fft.rfft(theirs[::-1], size)
    return np.asarray(np.fft.irfft(spectrum, size)[:count], np.float64)


def products_near(ours: Values, theirs: Values) -> Values:
    """Sums of products of the second series with as many rows of the first, from each that it can begin at."""
    # The transforms of stretches add up: a long recording needs no transform of its own length.
    more = len(ours) - len(theirs)
    size = quick_length(min(STRETCH, len(theirs)) + more)
    spectrum = np.zeros(size // 2 + 1, np.complex128)
    for first in range(0, len(theirs), size - more):
        end = min(first + size - more, len(theirs))
        spectrum += np.fft.rfft(ours[first : end + more], size) * np.fft.rfft(theirs[first:end], size).conj()
    return np.asarray(np.fft.irfft(spectrum, size)[: more + 1], np.float64)


def quick_length(count: int) -> int:
    """Least length of at least so many rows whose transform is quick: a product of 2, 3 and 5.

    >>> quick_length(1025), quick_length(1000)
    (1080, 1000)
    """
    best = 1 << max(count - 1, 0).bit_length()
    fives = 1
    while fives < best:
        odd = fives
        while odd < best:
            best = min(best, odd << max(-(-count // odd) - 1, 0).bit_length())
            odd *= 3
        fives *= 5
    return best


def peaks_of(curve: Values) -> NDArray[np.intp]:
    """Indices at which a curve is no lower than at its neighbours, its ends aside."""
    inner = curve[1:-1]
    return np.flatnonzero((inner >= curve[:-2]) & (inner >= curve[2:])) + 1


def runs_of(mask: NDArray[np.bool_]) -> NDArray[np.int64]:
    """First index and index behind the last of each run of True, shape (k, 2)."""
    edges = np.flatnonzero(np.diff(np.r_[0, mask.astype(np.int8), 0]))
    return edges.reshape(-1, 2)


def stepped(values: Values, at_end: NDArray[np.bool_], span: float, *, is_part: bool = False) -> NDArray[np.bool_]:
    """Samples of runs at an end of a signal into which it is stepped, not cut off: commanded, as a square wave is.

    What is cut off comes to the end by the way that it goes from row to row, a step by a large part of the `span`. The
    first and the last sample count as steps where others follow: in a part of a recording, or beside a step.
    """
    inside = np.zeros(len(values), dtype=np.bool_)
    for first, last in runs_of(at_end).tolist():
        before = abs(values[first] - values[first - 1]) > STEP * span if first > 0 else None
        behind = abs(values[last - 1] - values[last]) > STEP * span if last < len(values) else None
        sides = [is_step for is_step in (before, behind) if is_step is not None]
        inside[first:last] = all(sides) and (bool(sides) or is_part)
    return inside


def equal_runs(values: Values, fewest: int) -> NDArray[np.int64]:
    """Runs of the same number, first index and index behind the last, at least `fewest` samples long, shape (k, 2)."""
    same = runs_of(np.diff(values) == 0)
    runs = np.column_stack([same[:, 0], same[:, 1] + 1])
    return runs[runs[:, 1] - runs[:, 0] >= fewest]


def spread(values: Values, rows: int) -> Values:
    """Largest less smallest value in the window of some rows about each sample, shape (n,)."""
    padded = np.pad(values, (rows // 2, rows - 1 - rows // 2), mode="edge")
    return _over_windows(np.maximum, padded, rows) - _over_windows(np.minimum, padded, rows)


def _over_windows(of_two: np.ufunc, values: Values, rows: int) -> Values:
    """The largest or smallest value of each window of some rows: of windows twice as wide as those before."""
    wide = 1
    while 2 * wide <= rows:
        values = of_two(values[:-wide], values[wide:])
        wide *= 2
    left = rows - wide
    return np.asarray(of_two(values[: len(values) - left], values[left:]), np.float64)


_BLOCK = 4096  # rows at a time, which a processor holds


def median_of_nine(values: Values) -> Values:
    """Median of nine samples about each, shape (n,); the signal keeps its end values beyond its ends.

    >>> float(median_of_nine(np.r_[np.zeros(6), 9.0, 9.0, np.zeros(6)]).max())
    0.0
    """
    # SciPy's image package does the same, and takes longer to load than most logs to identify.
    windows, found = np.lib.stride_tricks.sliding_window_view(np.pad(values, 4, mode="edge"), 9), np.empty(len(values))
    for first in range(0, len(values), _BLOCK):
        block = windows[first : first + _BLOCK]
        found[first : first + len(block)] = np.partition(block, 4, axis=1)[:, 4]
    return found


def fill_holes(mask: NDArray[np.bool_], rows: int) -> NDArray[np.bool_]:
    """The mask with stretches of False of up to some rows between True made True."""
    filled = mask.copy()
    for first, last in runs_of(~mask).tolist():
        if last - first <= rows and first > 0 and last < len(mask):
            filled[first:last] = True
    return filled


def parabolas(values: Values, period: float, rows: int, orders: int = 3) -> NDArray[np.float64]:
    """Value, slope and curvature, or the first of these, in the middle, of the parabola nearest to each window.

    Savitzky and Golay, Analytical Chemistry 36 (1964) 1627.

    >>> parabolas(np.arange(7.0) ** 2, 1.0, 5).round(6)
    array([[ 4.,  9., 16.],
           [ 4.,  6.,  8.],
           [ 2.,  2.,  2.]])
    """
    x = np.arange(rows) - 0.5 * (rows - 1)
    second, fourth = float(np.sum(x**2)), float(np.sum(x**4))
    spread = rows * fourth - second**2
    kernels = (
        (fourth - second * x**2) / spread,
        x / (second * period),
        2.0 * (rows * x**2 - second) / (spread * period**2),
    )
    found = np.empty((orders, max(len(values) - rows + 1, 0)))
    for row, kernel in zip(found, kernels, strict=False):
        row[:] = np.correlate(values, kernel, mode="valid")
    return found
