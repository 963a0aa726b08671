"""Which friction a log can tell: models from the simplest up, each held to parts of the log it did not see.

A model that follows noise fits better the larger it is, but predicts worse. So each rung is fitted to all of the log
but one stretch and predicts that one, stretch by stretch; a rung is climbed where the prediction gets better on the
whole. It is climbed rather too often: a constant that is not needed widens the limits of the others, one that is
missing makes them wrong.

References
----------
Stone: Cross-validatory choice and assessment of statistical predictions. J. Royal Statistical Society B 36 (1974).
Burman, Chow, Nolan: A cross-validatory method for dependent data. Biometrika 81 (1994), whole stretches.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.identify.fit.equations import LOSS, is_bent, terms_of
from detent.identify.fit.regression import (
    Fit,
    Prepared,
    bend_correction,
    fit_equations,
    make_columns,
    make_effort,
    solve,
)

Numbers = NDArray[np.float64]

STRETCHES = 8
"""Parts of a log that are held out one after the other."""

CLEAR = 0.0
"""Mean gain of a rung in standard errors over the stretches, from which it is taken."""

SPEEDS = 8
"""Stribeck velocities tried."""

LOSSES = np.array([0.01, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
"""Shares lost in a transmission that are tried."""

ROUNDS = 12
"""Corrections of a Stribeck velocity or a loss, at most."""

Report = Callable[[float], None]


@dataclass(frozen=True, slots=True)
class Rung:
    """A model of the friction.

    Attributes
    ----------
    name : str
        What it is called.
    text : str
        What it says, for people.
    terms : tuple of str
        Terms of `equations.TERMS`.
    """

    name: str
    text: str
    terms: tuple[str, ...]

    @property
    def is_bent(self) -> bool:
        """True where a Stribeck velocity or a loss belongs to it."""
        return is_bent(self.terms)


_EACH = ("coulomb.positive", "coulomb.negative", "viscous.positive", "viscous.negative")

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
"""Models from the simplest up."""


@dataclass(frozen=True, slots=True, eq=False)
class Climb:
    """What the held-out stretches say about one rung.

    Attributes
    ----------
    rung : Rung
    error : float
        Root mean square of the prediction of stretches not seen, over that of the effort.
    stretches : float64 array, shape (STRETCHES,)
        Mean squares, stretch by stretch.
    gain : float
        Mean gain over the rung chosen so far, in standard errors; nan for the first.
    taken : bool
        True where it was climbed.
    possible : bool
        False where its friction falls towards standstill.
    """

    rung: Rung
    error: float
    stretches: Numbers
    gain: float
    taken: bool
    possible: bool


def extended(rung: Rung, extra: Sequence[str]) -> Rung:
    """The rung with further terms, such as those of a weight."""
    return Rung(rung.name, rung.text, (*rung.terms, *extra))


def stribeck_speeds(parts: Sequence[Prepared]) -> Numbers:
    """Stribeck velocities that the log could show, from the slow end of its motion to half its top speed."""
    speed = np.abs(np.concatenate([p.motion.velocity for p in parts]))
    top, low = float(np.quantile(speed, 0.98)), float(np.quantile(speed, 0.02))
    return np.geomspace(min(max(low, 0.02 * top), 0.2 * top), 0.4 * top, SPEEDS)


def best_bend(parts: Sequence[Prepared], names: Sequence[str]) -> float:
    """Stribeck velocity, or share lost: that with the smallest residual, from there on what the instruments say.

    The smallest residual alone answers to the noise in the columns: intervals around it held the truth in 86 % of the
    simulated logs with low-speed friction, those around what the instruments say in 93 to 96 %.
    """
    tried = LOSSES if LOSS in names else stribeck_speeds(parts)
    plain = [name for name in terms_of(names) if not name.startswith("excess")]
    effort = make_effort(parts, fit_equations(parts, plain).delay)

    def miss(bend: float) -> float:
        """Sum of the squared residuals."""
        columns, ideal = (make_columns(parts, names, bend, ideal=ideal) for ideal in (False, True))
        residual = effort - columns @ solve(ideal, columns, effort)
        return float(residual @ residual)

    best = int(np.argmin([miss(float(bend)) for bend in tried]))
    around = tried[[max(best - 1, 0), min(best + 1, len(tried) - 1)]]
    optimize: Any = import_module("scipy.optimize")  # it states no types
    limits = {"xatol": 1e-4 * float(around[1])}
    found = float(optimize.minimize_scalar(miss, bounds=tuple(around), method="bounded", options=limits).x)
    return _refined_bend(parts, names, found, tried)


def _refined_bend(parts: Sequence[Prepared], names: Sequence[str], start: float, tried: Numbers) -> float:
    """The bend at which the instruments ask for no other; the start where there is none within the range tried."""
    bend = start
    for _ in range(ROUNDS):
        correction = bend_correction(parts, fit_equations(parts, names, bend))
        if abs(correction) < 1e-3 * bend:
            return bend
        bend += float(np.clip(correction, -0.3 * bend, 0.3 * bend))
        if not tried[0] < bend < tried[-1]:
            break
    return start


def climb(
    parts: Sequence[Prepared],
    rungs: Sequence[Rung] = RUNGS,
    report: Report | None = None,
) -> tuple[Climb, ...]:
    """Hold every rung to stretches it did not see.

    Parameters
    ----------
    parts : sequence of Prepared
        Runs by one window.
    rungs : sequence of Rung
        From the simplest up.
    report : callable, optional
        Is told the share that is done.

    Returns
    -------
    tuple of Climb
        One per rung; the last that was taken is the choice.
    """
    climbs: list[Climb] = []
    best: Climb | None = None
    for k, rung in enumerate(rungs):
        squares, power, possible = _held_out(parts, rung)
        gain = np.nan
        if best is not None:
            better = best.stretches - squares
            gain = float(better.mean() / max(better.std(ddof=1) / np.sqrt(len(better)), 1e-300))
        taken = best is None or (possible and gain > CLEAR)
        climbs.append(Climb(rung, float(np.sqrt(squares.mean() / power)), squares, gain, taken, possible))
        best = climbs[-1] if taken else best
        if report is not None:
            report((k + 1) / len(rungs))
    return tuple(climbs)


def chosen_rung(climbs: Sequence[Climb]) -> Rung:
    """The last rung that was taken."""
    return next(c.rung for c in reversed(climbs) if c.taken)


def fit_rung(parts: Sequence[Prepared], rung: Rung) -> Fit:
    """Fit the model of a rung, its Stribeck velocity or loss included."""
    return fit_equations(parts, rung.terms, best_bend(parts, rung.terms) if rung.is_bent else 1.0)


Mask = NDArray[np.bool_]


def hold_out(parts: Sequence[Prepared], count: int = STRETCHES) -> list[tuple[Mask, Mask]]:
    """Windows of each stretch, and those that share no sample with it.

    Parameters
    ----------
    parts : sequence of Prepared
    count : int
        Stretches that each run is cut into, with as many windows in each.

    Returns
    -------
    list of (bool array, bool array), shape (m,) each
        The stretch, and what a fit may see.
    """
    masks: list[tuple[Mask, Mask]] = []
    for stretch in range(count):
        inside: list[Mask] = []
        apart: list[Mask] = []
        for p in parts:
            rows, reach = p.motion.rows, 2 * p.motion.kernel.half
            here = np.arange(len(rows)) * count // max(len(rows), 1) == stretch
            inside.append(here)
            if here.any():
                apart.append((rows < rows[here][0] - reach) | (rows > rows[here][-1] + reach))
            else:
                apart.append(~here)
        masks.append((np.concatenate(inside), np.concatenate(apart)))
    return masks


def _held_out(parts: Sequence[Prepared], rung: Rung) -> tuple[Numbers, float, bool]:
    """Mean squares of the prediction of each stretch, the mean square of the effort, and whether friction rises.

    Friction that falls towards standstill is no Stribeck friction, whatever it fits.
    """
    whole = fit_rung(parts, rung)
    columns, ideal = (make_columns(parts, rung.terms, whole.bend, ideal=ideal) for ideal in (False, True))
    squares: list[float] = []
    for inside, apart in hold_out(parts):
        theta = solve(ideal[apart], columns[apart], whole.effort[apart])
        squares.append(float(np.mean((whole.effort[inside] - columns[inside] @ theta) ** 2)))
    excess = sum(whole.value(name) for name in rung.terms if name.startswith("excess"))
    return np.array(squares), float(np.mean(whole.effort**2)), excess >= 0.0
