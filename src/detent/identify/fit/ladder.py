"""Which friction a log can tell: models from the simplest up, each held to parts of the log it did not see.

A model that follows noise fits better the larger it is, but predicts worse. So each rung is fitted to all of the log
but one stretch and predicts that one, stretch by stretch; a rung is climbed where the prediction gets better on the
whole. It is climbed rather too often: a constant that is not needed widens the limits of the others, one that is
missing makes them wrong.

Stone: Cross-validatory choice and assessment of statistical predictions. J. Royal Statistical Society B 36 (1974).
Burman, Chow, Nolan: A cross-validatory method for dependent data. Biometrika 81 (1994), whole stretches.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from detent.identify.fit import Report, regression, untold
from detent.identify.fit.equations import LOSS, is_bent, terms_of
from detent.identify.fit.search import least_within, root_within
from detent.logs.log import Values

STRETCHES = 8  # parts of a log that are held out one after the other
CLEAR = 0.0  # mean gain of a rung in standard errors over the stretches, from which it is taken
ALIKE = 1e-8  # gain, in parts of the mean square, up to which only rounding tells two rungs apart
SLOWEST = 0.002  # least Stribeck velocity tried, in parts of the top speed
FINER = 1.6  # ratio of neighbouring Stribeck velocities tried, at most
AT_BOUND = 0.01  # a bend this near to the least or the largest tried, in parts of it, is a bound and no value
# Shares lost in a transmission that are tried.
LOSSES = np.array([0.01, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95])
ROUNDS, WIDER = 8, 1.3  # brackets of a Stribeck velocity or a loss looked at, and the ratio of their ends
_EACH = ("coulomb.positive", "coulomb.negative", "viscous.positive", "viscous.negative")
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Rung:
    """A model of the friction."""

    name: str  # what it is called
    text: str  # what it says, for people
    terms: tuple[str, ...]  # terms of `equations.TERMS`

    @property
    def is_bent(self) -> bool:
        """True where a Stribeck velocity or a loss belongs to it."""
        return is_bent(self.terms)


RUNGS = (
    Rung("coulomb", "one Coulomb friction and a constant force", ("mass", "coulomb", "offset")),
    Rung("viscous", "Coulomb and viscous friction, and a constant force", ("mass", "coulomb", "offset", "viscous")),
    Rung("per direction", "Coulomb and viscous friction, each direction its own", ("mass", *_EACH)),
    Rung(
        "stribeck",
        "Coulomb, viscous and low-speed friction, each direction its own",
        ("mass", *_EACH, "excess.positive", "excess.negative"),
    ),
)
"""Models, simplest first."""


@dataclass(frozen=True, slots=True, eq=False)
class Climb:
    """What the held-out stretches say about one rung."""

    rung: Rung
    error: float  # root mean square of the prediction of held-out segments, over that of the effort
    stretches: Values  # mean squares, stretch by stretch
    gain: float  # mean gain over the rung chosen so far, in standard errors; nan for the first
    taken: bool  # True where it was climbed
    possible: bool  # False where its friction falls towards standstill
    fit: regression.Fit  # to all of the log


def extended(rung: Rung, extra: Sequence[str]) -> Rung:
    """The rung with further terms, such as those of a weight."""
    return Rung(rung.name, rung.text, (*rung.terms, *extra))


def bends_tried(parts: Sequence[regression.Prepared], names: Sequence[str]) -> Values:
    """Shares lost, or Stribeck velocities from the slow end of a log's motion to half its top speed."""
    if LOSS in names:
        return LOSSES
    speed = np.abs(np.concatenate([p.motion.velocity for p in parts]))
    top, low = float(np.quantile(speed, 0.98)), float(np.quantile(speed, 0.02))
    least, most = min(max(low, SLOWEST * top), 0.2 * top), 0.4 * top
    return np.geomspace(least, most, 1 + math.ceil(math.log(most / least) / math.log(FINER)))


def best_bend(parts: Sequence[regression.Prepared], names: Sequence[str]) -> tuple[float, float]:
    """Stribeck velocity, or share lost: what the instruments say, and that with the smallest residual, near it."""
    # The latter alone answers to the noise in the columns: intervals around it held the truth in 86 % of the simulated
    # logs with low-speed friction, those around what the instruments say in 93 to 96 %.
    tried = bends_tried(parts, names)
    plain = [name for name in terms_of(names) if not name.startswith("excess")]
    effort = regression.make_effort(parts, regression.solve_equations(parts, plain).late)

    def miss(bend: float) -> float:
        """Sum of the squared residuals."""
        columns, ideal = (regression.make_columns(parts, names, bend, ideal=ideal) for ideal in (False, True))
        residual = effort - regression.combine(columns, regression.solve(ideal, columns, effort))
        return float(np.sum(residual**2))

    best = int(np.argmin([miss(float(bend)) for bend in tried]))
    around = tried[[max(best - 1, 0), min(best + 1, len(tried) - 1)]]
    found = least_within(miss, *around.tolist(), accuracy=1e-4 * float(around[1]))
    return _refined_bend(parts, names, found, tried), found


def _refined_bend(parts: Sequence[regression.Prepared], names: Sequence[str], start: float, tried: Values) -> float:
    """The bend at which the instruments ask for no other; the start where there is none within the range tried."""
    # What they ask for changes sign there: a bracket around it ends at one place, wherever it began.

    @cache
    def asked(bend: float) -> float:
        """What the instruments want the bend changed by."""
        return regression.bend_correction(parts, names, bend)

    near = start
    wanted = asked(near)
    for _ in range(ROUNDS):
        far = near * (WIDER if wanted > 0.0 else 1.0 / WIDER)
        if not tried[0] < far < tried[-1]:
            return start
        other = asked(far)
        if (other > 0.0) != (wanted > 0.0):
            return root_within(asked, near, far, 1e-4 * start)
        near, wanted = far, other
    return start


def climb(
    parts: Sequence[regression.Prepared], rungs: Sequence[Rung] = RUNGS, report: Report = untold
) -> tuple[Climb, ...]:
    """Hold every rung to stretches it did not see."""
    climbs: list[Climb] = []
    best: Climb | None = None
    for k, rung in enumerate(rungs):
        fit = fit_rung(parts, rung)
        squares = _held_out(parts, fit)
        # Friction that falls towards standstill is no Stribeck friction, whatever it fits.
        possible = sum(fit.value(name) for name in rung.terms if name.startswith("excess")) >= 0.0
        gain = np.nan
        if best is not None:
            better = best.stretches - squares
            scatter = max(float(better.std(ddof=1)) / np.sqrt(len(better)), 1e-300)
            is_clear = abs(float(better.mean())) > ALIKE * float(best.stretches.mean())
            gain = float(better.mean() / scatter) if is_clear else 0.0
        taken = best is None or (possible and gain > CLEAR)
        error = float(np.sqrt(squares.mean() / np.mean(fit.effort**2)))
        climbs.append(Climb(rung, error, squares, gain, taken, possible, fit))
        best = climbs[-1] if taken else best
        report((k + 1) / len(rungs))
    return tuple(climbs)


def chosen_climb(climbs: Sequence[Climb]) -> Climb:
    """The last rung that was taken, with what the stretches say of it."""
    return next(c for c in reversed(climbs) if c.taken)


def chosen_rung(climbs: Sequence[Climb]) -> Rung:
    """The last rung that was taken."""
    return chosen_climb(climbs).rung


def fit_rung(parts: Sequence[regression.Prepared], rung: Rung) -> regression.Fit:
    """Fit the model of a rung, its Stribeck velocity or loss included."""
    # Where two ways to that number differ by more than noise, the model is to blame: their difference is an error.
    if not rung.is_bent:
        return regression.fit_equations(parts, rung.terms)
    bend, other = best_bend(parts, rung.terms)
    fit = regression.fit_equations(parts, rung.terms, bend)
    fit.covariance[-1, -1] += (bend - other) ** 2
    return fit


def hold_out(parts: Sequence[regression.Prepared]) -> Iterator[tuple[Mask, Mask]]:
    """Windows of each stretch, and those that share no sample with it."""
    for stretch in range(STRETCHES):
        inside: list[Mask] = []
        apart: list[Mask] = []
        for p in parts:
            rows, reach = p.motion.rows, 2 * p.motion.kernel.half
            here = np.arange(len(rows)) * STRETCHES // max(len(rows), 1) == stretch
            first, last = rows[here][[0, -1]].tolist() if here.any() else (len(p.run.position) + reach, -reach - 1)
            inside.append(here)
            apart.append((rows < first - reach) | (rows > last + reach))
        yield np.concatenate(inside), np.concatenate(apart)


def _held_out(parts: Sequence[regression.Prepared], fit: regression.Fit) -> Values:
    """Mean squares of the prediction of each stretch."""
    columns, ideal = (regression.make_columns(parts, fit.model, fit.bend, ideal=ideal) for ideal in (False, True))
    squares: list[float] = []
    for inside, apart in hold_out(parts):
        theta = regression.solve(ideal[apart], columns[apart], fit.effort[apart])
        squares.append(float(np.mean((fit.effort[inside] - regression.combine(columns[inside], theta)) ** 2)))
    return np.array(squares)
