"""Periods of an excitation, found in the data, and signals cut along them.

A periodic excitation repeats in the clock of the machine that made it. The stamps of a recording are those of another
clock as a rule, or jitter about the ticks; so both are tried, the rows as they are and the stamps, and that is taken in
which the excitation repeats best.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from detent.logs.log import Values
from detent.logs.windows import scipy

LIKENESS = 0.9  # correlation of an excitation with itself a period later, from which it is taken for periodic
INTERPOLATED = ", put on an even grid by straight lines"
FEWEST = 3  # periods that a recording must hold to be called periodic: one to settle, two to compare
_APART = 0.5
_AS_GOOD = 0.02
_EVEN = 1e-6
_BETTER = 1.05


@dataclass(frozen=True, slots=True)
class Periods:
    """Signals of a recording, cut into periods of their excitation."""

    signals: tuple[Values, ...]  # each of shape (periods, samples of a period)
    step: float  # time between two samples [s]
    # what differs between two periods of the excitation that follow one another, rms, as a part of its rms
    mismatch: float
    grid: str  # what was done to put samples on a grid, for a person

    @property
    def duration(self) -> float:
        """Duration of a period [s]."""
        return self.step * self.signals[0].shape[1]


def find_period(values: Values) -> float | None:
    """Period of a signal, by the first peak of its autocorrelation that is as high as the highest.

    The autocorrelation compares the two parts that overlap, so that noise lowers it at each lag alike. Peaks many
    periods away then give the fraction of a row.

    >>> find_period(np.sin(np.arange(1000) / 10.0)).__round__(2)
    62.83
    """
    curve = autocorrelation(values)
    apart = np.flatnonzero(curve < _APART)
    last = len(values) // FEWEST
    if not len(apart) or apart[0] + 2 > last:
        return None
    first = int(apart[0])
    inner = curve[first + 1 : last + 1]
    tops = np.flatnonzero((inner >= curve[first:last]) & (inner >= curve[first + 2 : last + 2])) + first + 1
    if not len(tops) or curve[tops].max() < LIKENESS:
        return None
    period = _summit(curve, int(tops[np.argmax(curve[tops] >= curve[tops].max() - _AS_GOOD)]))
    times = 2
    # Each peak is looked for where the one before says; so its error stays below a row.
    while times * period < 0.75 * len(values):
        about = round(times * period)
        near = np.arange(about - 2, min(about + 3, len(curve) - 1))
        period = _summit(curve, int(near[np.argmax(curve[near])])) / times
        times *= 2
    return period


def autocorrelation(values: Values) -> Values:
    """Correlation of a signal with itself, some rows later, over the part in which the two overlap."""
    centred = values - values.mean()
    products = np.asarray(scipy("signal").correlate(centred, centred, mode="full", method="fft"))[len(values) - 1 :]
    sums = np.r_[0.0, np.cumsum(centred**2)]
    early, late = sums[len(values) : 0 : -1], sums[-1] - sums[: len(values)]
    # The sums of the last rows are rounding: what is compared there says nothing.
    size = np.sqrt(np.maximum(early * late, (1e-9 * sums[-1]) ** 2))
    return products / size if sums[-1] > 0 else np.zeros(len(values))


def _summit(curve: Values, top: int) -> float:
    """Where the parabola through a peak and its neighbours is highest."""
    left, middle, right = curve[top - 1 : top + 2].tolist()
    bend = left - 2 * middle + right
    return top + (0.5 * (left - right) / bend if bend < 0 else 0.0)


def cut_periods(t: Values, excitation: Values, others: Sequence[Values] = ()) -> Periods | None:
    """Cut signals along the periods of the first of them."""
    mean = float(t[-1] - t[0]) / (len(t) - 1)
    even, said = count_samples(t)
    # By counting the samples, and by their stamps where these are uneven.
    clocks = [(even, f"{said}, taken for even"), (t, f"{said}{INTERPOLATED}")] if said else [(even, "")]
    best: Periods | None = None
    for clock, grid in clocks:
        rows = find_period(np.interp(even, clock, excitation))
        if rows is None:
            continue
        whole = round(rows)
        # The samples as they are, and between them for a period with a fraction.
        between = (mean * rows / whole, f"{rows:.4f} rows in a period, put on {whole} of them")
        for step, text in ((mean, ""), between):
            periods = int((len(clock) - 1 + 1e-6) * mean / step + 1) // whole
            if periods < 2:
                continue
            times = clock[0] + step * np.arange(periods * whole).reshape(periods, whole)
            told = ", ".join(part for part in (grid, text) if part)
            found = _cut(clock, times, [excitation, *others], told)
            if best is None or found.mismatch * _BETTER < best.mismatch:
                best = found
    return best


def count_samples(t: Values) -> tuple[Values, str]:
    """Times of samples by counting them, and by how much their stamps differ from that; empty where they do not."""
    steps = np.diff(t)
    mean = float(t[-1] - t[0]) / len(steps)
    said = f"stamps {1e3 * steps.min():.4g} to {1e3 * steps.max():.4g} ms apart"
    return t[0] + mean * np.arange(len(t)), "" if float(np.std(steps)) <= _EVEN * mean else said


def _cut(clock: Values, times: Values, signals: Sequence[Values], said: str) -> Periods:
    """Signals at some times, by straight lines between samples."""
    cut = tuple(np.interp(times, clock, values) for values in signals)
    excitation = cut[0]
    size = float(np.std(excitation)) or 1.0
    return Periods(cut, float(times[0, 1] - times[0, 0]), float(np.std(np.diff(excitation, axis=0))) / size, said)
