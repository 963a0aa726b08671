"""Which windows tell an axis, and whether wider ones tell the same.

A few windows whose residual is far beyond that of all others hold something that is not the axis: a spike, a coupling
that slips, a hand that touches it. They are left out and named, as what they say counts by its square.

What a model lacks shows at one length of the windows more than at another. Noise, which both average, moves a constant
by a part of its interval: on simulated logs with nothing wrong by a tenth of half of it as a rule, and by more than
three quarters of the wider half in one of a hundred. A sensor that is not even, a load put on and a filter are another
axis for each length of the window.

Huber: Robust estimation of a location parameter. Annals of Mathematical Statistics 35 (1964).
Hausman: Specification tests in econometrics. Econometrica 46 (1978), 1251: two estimates that agree where the model is
right, and not where it is wrong.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from detent.identify.fit import equations, regression
from detent.identify.fit.constants import Constants, constants_of
from detent.identify.fit.equations import Rows
from detent.identify.fit.estimate import rms

WIDER = 1.5  # width of the other windows, in those of the fit
SLIGHT = 0.01  # change over the constant up to which it matters to nobody, and widens the interval
MOVED = 0.75  # change of a constant, in half of the wider of both intervals, up to which noise explains it
FEWEST = 3  # windows for each column, at least
OUT = 8.0  # residual of a window, in the usual size of one, from which it is left out
LEAST_USUAL = 0.005  # usual size of a residual, over the effort, at least
USUAL = 1.4826  # standard deviation of normal residuals over the median of their sizes
MOST_OUT = 0.05  # share of the windows up to which they are: what is more common belongs to the log
COMPARED = ("mass", "coulomb.positive", "coulomb.negative", "viscous.positive", "viscous.negative")


class Moved(NamedTuple):
    """A constant that depends on the window."""

    name: str
    value: float  # by the windows of the fit
    other: float  # by the wider ones
    width: float  # of the windows of the fit [s]

    @property
    def concerned(self) -> tuple[str, ...]:
        """Itself, the other friction of its direction, whose errors go with its own, and the delay."""
        kind, _, way = self.name.partition(".")
        partner = (f"{'viscous' if kind == 'coulomb' else 'coulomb'}.{way}",) if way else ()
        return (self.name, *partner, "delay")

    @property
    def is_slight(self) -> bool:
        """True where the change is less than anybody needs to know the constant to."""
        return abs(self.other - self.value) <= SLIGHT * abs(self.value)


def odd_windows(parts: Sequence[regression.Prepared], fit: regression.Fit) -> list[Rows]:
    """Samples, of each run, around which the residual is far beyond the usual; none where these are many."""
    is_odd = sticks_out(fit)
    is_odd &= np.mean(is_odd) <= MOST_OUT
    ends = np.cumsum([len(p.motion.rows) for p in parts])[:-1]
    return [p.motion.rows[odd] for p, odd in zip(parts, np.split(is_odd, ends), strict=True)]


def sticks_out(fit: regression.Fit) -> NDArray[np.bool_]:
    """True for each window whose residual is far beyond the usual one."""
    # Where there is no noise the usual residual is what the model lacks, which is an error of all windows.
    sizes = np.abs(fit.residual)
    return sizes > OUT * max(USUAL * float(np.median(sizes)), LEAST_USUAL * rms(fit.effort))


def without(part: regression.Prepared, odd: Rows) -> regression.Prepared:
    """A run without the windows that share a sample with the middle of an odd one."""
    is_odd, rows = np.zeros(len(part.run.position), dtype=np.bool_), part.motion.rows
    is_odd[odd] = True
    reach = part.ideal.kernel.half if part.instruments == "position" else part.motion.kernel.half
    before = np.concatenate([[0], np.cumsum(is_odd)])
    keep = before[np.minimum(rows + reach + 1, len(is_odd))] == before[np.maximum(rows - reach, 0)]
    run = replace(part.run, usable=part.run.usable & ~is_odd)
    return replace(part, run=run, motion=part.motion.taken(keep), ideal=part.ideal.taken(keep))


def moved_by_windows(parts: Sequence[regression.Prepared], fit: regression.Fit, names: Collection[str]) -> list[Moved]:
    """Those of some constants that other windows move by more than noise does, the furthest moved first."""
    kernels = [equations.make_kernel(round(WIDER * p.motion.kernel.half), p.run.step) for p in parts]
    wider = [regression.prepare(p.run, kernel, p.instruments, p) for p, kernel in zip(parts, kernels, strict=True)]
    if sum(len(p.motion.rows) for p in wider) < FEWEST * len(fit.names):
        return []
    run, own = parts[0].run, constants_of(fit)
    other = constants_of(regression.fit_equations(wider, fit.model, fit.bend))
    by_other = {e.name: e.half for e in other.estimates(run)}
    halves = {e.name: max(e.half, by_other.get(e.name, 0.0)) for e in own.estimates(run)}
    width = 2.0 * parts[0].motion.kernel.half * run.step
    found = [
        (
            abs(other.value(name) - own.value(name)) / halves[name],
            Moved(name, own.value(name), other.value(name), width),
        )
        for name in COMPARED
        if name in names and name in own.names and halves.get(name, 0.0) > 0.0
    ]
    return [one for far, one in sorted(found, reverse=True) if far > MOVED]


def widened(constants: Constants, off: Mapping[str, float]) -> Constants:
    """Constants whose intervals carry by how much something else would move them."""
    by = np.array([off.get(name, 0.0) for name in constants.names])
    return replace(constants, covariance=constants.covariance + np.diag(by**2))
