"""Constants by simulation: those with which the axis, moved by the recorded effort alone, stays closest to the log.

The log is cut into stretches; each starts where the log says the axis was, and is simulated by the compiled blocks, so
that standstill, breaking loose and every other corner of the friction count, which no regression sees. What a start is
wrong by in position and velocity is fitted along with each stretch. Stretches are nearly independent: the covariance is
that of their scores (K.-Y. Liang, S. L. Zeger, "Longitudinal data analysis using generalized linear models", Biometrika
73 (1986)), with Student's distribution of as many degrees as there are stretches beyond the constants.

Ljung: System Identification, 2nd ed. (1999), section 7.2 (output-error structure).
Bock: Recent advances in parameter identification for ordinary differential equations (1983), multiple shooting.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from detent.errors import DetentError
from detent.identify.fit import Report, untold
from detent.identify.fit.constants import Constants
from detent.identify.fit.equations import Run
from detent.identify.fit.free_run import Plant, start_velocities
from detent.logs.differences import scipy
from detent.logs.log import Values

STRETCH = 2.0  # length of a simulated stretch [s]
MOST_ROUNDS = 40  # rounds of the search, at most
AT_BOUND = 1e-3  # distance from an end of the search, in parts of its scale, at which a constant is no value
NUDGE = 1e-4  # change of a constant for its sensitivity, in parts of its scale
MEANT = 0.98  # share of a stretch's samples that must mean something
SLOWEST = 0.1  # least Stribeck velocity in parts of that of the start: towards 0 the plant's rate has no bound
_FREE = frozenset({"offset", "pendulum", "pendulum.across"})  # searched constants that may be below 0
_FORCES = frozenset({"coulomb", "offset", "static", "pendulum"})
MOST_LOST = 0.95  # share of the effort that a transmission may lose, at most


@dataclass(frozen=True, slots=True)
class Stretch:
    """Part of a run that is simulated without restarts: first sample, samples, and the velocity at its begin."""

    run: Run
    begin: int
    samples: int
    velocity: float


def cut_stretches(runs: Sequence[Run], duration: float = STRETCH) -> list[Stretch]:
    """Stretches of a duration, without samples that mean nothing."""
    found: list[Stretch] = []
    for run in runs:
        velocity = start_velocities(run)
        border = max(4, round(0.006 / run.step))
        n = len(run.position) - 2 * border
        if n < 8:
            continue
        samples = min(max(round(duration / run.step), 8), n)
        begins = np.linspace(0, n - samples, max(round(n / samples), 1)).astype(np.int64) + border
        found += [
            Stretch(run, begin, samples, float(velocity[begin]))
            for begin in begins.tolist()
            if float(run.usable[begin : begin + samples].mean()) > MEANT
        ]
    return found


def fit_output_error(
    runs: Sequence[Run], start: Constants, duration: float = STRETCH, report: Report = untold
) -> Constants:
    """Fit constants by simulation."""
    names = tuple(name for name in start.names if name != "delay")
    stretches = cut_stretches(runs, duration)
    if len(stretches) < 4 or sum(s.samples for s in stretches) < 20 * len(names):
        raise DetentError(
            f"identify: got {len(stretches)} stretches of {duration:g} s; expected: 4 or more; "
            "record longer, or shorten the stretches"
        )
    search = _Search(names, start, stretches)
    rough = search.minimise(search.begin, lambda share: report(0.5 * share))
    # What an error of a start does depends on the constants: once more with those found.
    search.look_at_starts(rough.x)
    found = search.minimise(rough.x, lambda share: report(0.5 + 0.5 * share))
    return search.constants_at(found.x, found.jac, found.fun)


class _Search:
    """Residuals and their minimum, with constants in parts of their scales."""

    # Of both Coulomb frictions the mean is searched, which is not below 0, and half their difference, a constant force.

    def __init__(self, names: tuple[str, ...], start: Constants, stretches: Sequence[Stretch]) -> None:
        self.names, self._start, self._stretches = names, start, stretches
        self._searched, self._back = _searched_constants(names)
        known = np.array([start.value(name) for name in names], np.float64)
        values = np.asarray(np.linalg.pinv(self._back) @ known, np.float64)
        self._scale = _scales(self._searched, values)
        self.begin = values / self._scale
        self._removers: list[Values] = []
        self.look_at_starts(self.begin)

    def look_at_starts(self, x: Values) -> None:
        """Work out what an error of each start does to its stretch: position and velocity, orthonormal columns."""
        self._removers = []
        for s in self._stretches:
            plant = Plant(self._constants(x), s.run.step)
            q = float(s.run.position[s.begin])
            nudge = 1e-3 * max(abs(s.velocity), float(np.abs(np.diff(s.run.position)).max()) / s.run.step)
            a, b = (plant.run(s.run.effort, s.begin, s.samples, q, s.velocity + d) for d in (0.0, nudge))
            ways = np.column_stack([np.ones(s.samples), b - a])
            ways = ways / np.maximum(np.linalg.norm(ways, axis=0), 1e-300)
            self._removers.append(np.linalg.qr(ways)[0])

    def _constants(self, x: Values) -> Constants:
        values = np.append(self._back @ (x * self._scale), self._start.value("delay"))
        k = len(values)
        return Constants((*self.names, "delay"), values, np.zeros((k, k)), np.ones(k), "output error")

    def residual(self, x: Values) -> Values:
        """Simulated less measured position of all stretches, without what the starts explain."""
        constants = self._constants(x)
        plants: dict[float, Plant] = {}
        made: list[Values] = []
        for s, ways in zip(self._stretches, self._removers, strict=True):
            plant = plants.setdefault(s.run.step, Plant(constants, s.run.step))
            q = s.run.position[s.begin : s.begin + s.samples]
            miss = plant.run(s.run.effort, s.begin, s.samples, float(q[0]), s.velocity) - q
            made.append(miss - ways @ (ways.T @ miss))
        return np.concatenate(made)

    def minimise(self, x: Values, report: Report) -> Any:
        """Least squares within what is possible."""
        rounds = 0

        def jacobian(at: Values) -> Values:
            """Change of the residuals with each constant, by differences."""
            nonlocal rounds
            rounds += 1
            report(min(rounds / MOST_ROUNDS, 1.0))
            middle = self.residual(at)
            columns = [(self.residual(at + NUDGE * unit) - middle) / NUDGE for unit in np.eye(len(at))]
            return np.column_stack(columns)

        low, high = self._limits()
        start = np.clip(x, low + 1e-6, high - 1e-6)
        accuracy = {"max_nfev": MOST_ROUNDS, "xtol": 1e-6, "ftol": 1e-8}
        found = scipy("optimize").least_squares(self.residual, start, jac=jacobian, bounds=(low, high), **accuracy)
        report(1.0)
        return found

    def constants_at(self, x: Values, jacobian: Values, residual: Values) -> Constants:
        """Constants with the covariance of the stretches' scores."""
        edges = np.cumsum([0, *(s.samples for s in self._stretches)])
        scores = np.array([jacobian[a:b].T @ residual[a:b] for a, b in pairwise(edges.tolist())])
        inverse = np.linalg.pinv(jacobian.T @ jacobian)
        count = len(scores)
        degrees = max(count - len(self.names), 1)
        covariance = inverse @ (scores.T @ scores) @ inverse * (count / degrees)
        covariance = self._back @ (covariance * np.outer(self._scale, self._scale)) @ self._back.T
        covariance = np.pad(covariance, ((0, 1), (0, 1)))
        covariance[-1, -1] = self._start.errors[self._start.names.index("delay")] ** 2
        freedom = np.full(len(covariance), float(degrees))
        told, bounded = self._start.delay_is_told, (*self._at_bounds(x), *self._start.bounded)
        found = self._constants(x)
        return replace(found, covariance=covariance, degrees=freedom, delay_is_told=told, bounded=bounded)

    def _limits(self) -> tuple[Values, Values]:
        """Least and largest value of each searched constant, in parts of its scale."""
        low, high = np.zeros(len(self._searched)), np.full(len(self._searched), np.inf)
        for k, name in enumerate(self._searched):
            if name in _FREE:
                low[k] = -np.inf
            if name in {"mass", "stribeck"}:
                low[k] = SLOWEST * abs(self.begin[k])
            if name == "loss":
                high[k] = MOST_LOST / self._scale[k]
        return low, high

    def _at_bounds(self, x: Values) -> tuple[str, ...]:
        """Constants that lie at an end of what was searched: nothing in the log holds them there."""
        low, high = self._limits()
        ended = (x - low < AT_BOUND) | (high - x < AT_BOUND)
        held = np.abs(self._back[:, ended]).sum(axis=1) > 0.0
        return tuple(name for name, is_held in zip(self.names, held.tolist(), strict=True) if is_held)


def _searched_constants(names: Sequence[str]) -> tuple[tuple[str, ...], Values]:
    """What is searched, and the sums of it that the constants are, shape (k, k)."""
    searched = tuple({"coulomb.positive": "coulomb", "coulomb.negative": "offset"}.get(name, name) for name in names)
    back = np.eye(len(names))
    if {"coulomb.positive", "coulomb.negative"} <= set(names):
        mean, half = searched.index("coulomb"), searched.index("offset")
        back[mean, half], back[half, mean], back[half, half] = 1.0, 1.0, -1.0
        for name, sign in (("static.positive", 1.0), ("static.negative", -1.0)):
            if name in names:
                back[names.index(name), half] = sign
    return searched, back


def _scales(names: Sequence[str], values: Values) -> Values:
    """Scale of each searched constant: its size, or a tenth of the largest of its unit where it is nearly nothing."""
    kinds = ["force" if (kind := name.partition(".")[0]) in _FORCES else kind for name in names]
    sizes = {kind: max((abs(v) for k, v in zip(kinds, values.tolist(), strict=True) if k == kind), default=0.0)
             for kind in ("force", "viscous")}  # fmt: skip
    floors = [0.1 * sizes.get(kind, 0.1) for kind in kinds]
    return np.maximum(np.maximum(np.abs(values), floors), 1e-12)
