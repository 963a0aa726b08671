"""Constants of an axis, each direction its own, from a fitted model and from those that explain the log nearly as well.

Model selection was chosen is itself uncertain. Where another rung predicts the held-out stretches as well within their
scatter, the difference between its constants and those of the chosen one is an error that no residual shows; its mean
square adds to the variance (S. T. Buckland, K. P. Burnham, N. H. Augustin, "Model selection: an integral part of
inference", Biometrics 53 (1997)).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from detent.identify.fit.equations import Run
from detent.identify.fit.estimate import Estimate, estimate, quantile, significant
from detent.identify.fit.regression import Fit, Instruments
from detent.logs.log import Values

_SUMS: dict[str, dict[str, float]] = {
    "mass": {"mass": 1.0},
    "coulomb.positive": {"coulomb": 1.0, "offset": 1.0, "coulomb.positive": 1.0},
    "coulomb.negative": {"coulomb": 1.0, "offset": -1.0, "coulomb.negative": 1.0},
    "viscous.positive": {"viscous": 1.0, "viscous.positive": 1.0},
    "viscous.negative": {"viscous": 1.0, "viscous.negative": 1.0},
    "static.positive": {"coulomb.positive": 1.0, "excess.positive": 1.0},
    "static.negative": {"coulomb.negative": 1.0, "excess.negative": 1.0},
    **{name: {name: 1.0} for name in ("pendulum", "pendulum.across", "spring", "stribeck", "loss", "delay")},
}
"""Constants as sums of those of the terms; a force that does not turn round is part of both Coulomb constants."""


CANCELLED = 1e-9  # what is left of a sum, in parts of what was added up, at which nothing is left of it

METHODS: dict[Instruments, str] = {
    "reference": "instrumental variables",
    "position": "instrumental variables of wider windows",
    "none": "least squares",
}
"""How the constants of a fit were found, by what its instruments are made of."""


@dataclass(frozen=True, slots=True, eq=False)
class Constants:
    """Constants of an axis with all that is known about their errors."""

    names: tuple[str, ...]  # in their order; the delay of the effort comes last
    values: Values  # in SI units
    covariance: Values  # of their errors
    degrees: Values  # degrees of freedom behind the variance of each
    method: str  # how they were found
    delay_is_told: bool = True  # False where the delay is only what fits best
    bounded: tuple[str, ...] = ()  # those that the search left at an end of its range

    def value(self, name: str) -> float:
        """A constant; 0 where it was not looked for."""
        return float(self.values[self.names.index(name)]) if name in self.names else 0.0

    @property
    def errors(self) -> Values:
        """Standard errors, shape (k,)."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def correlation(self) -> Values:
        """Correlation of the errors, shape (k, k)."""
        error = np.maximum(self.errors, 1e-150)
        return np.clip(self.covariance / np.outer(error, error), -1.0, 1.0)

    def inseparable(self) -> tuple[tuple[str, str, float], ...]:
        """Pairs of constants whose errors go together, with their correlation: the data cannot tell them well apart."""
        c, n = self.correlation, len(self.names)
        pairs = [(i, j) for i in range(n) for j in range(i + 1, n) if abs(float(c[i, j])) > 0.95]
        return tuple((self.names[i], self.names[j], float(c[i, j])) for i, j in pairs)

    def estimates(self, run: Run) -> tuple[Estimate, ...]:
        """Each with its interval, in the units of a run."""
        # Without a reference the delay is none of them: in a loop it hides in the answer of the effort to the noise.
        # What a search left at an end of its range has no limits: those of the residuals say how sharp the end is.
        told = zip(self.names, self.values.tolist(), self.errors.tolist(), self.degrees.tolist(), strict=True)
        return tuple(
            estimate(name, value, run.unit(name), np.inf if name in self.bounded else error, self.method, degrees)
            for name, value, error, degrees in told
            if name != "delay" or self.delay_is_told
        )


def constants_of(fit: Fit, rivals: Sequence[Fit] = ()) -> Constants:
    """Constants of a fitted model."""
    names, values, covariance, degrees = _sums_of(fit)
    # What the rivals say otherwise; a constant that a rival does not have counts as its own value.
    squares = np.zeros(len(values))
    for rival in rivals:
        theirs, found, *_ = _sums_of(rival)
        known = dict(zip(theirs, found.tolist(), strict=True))
        squares += np.array([(known.get(n, v) - v) ** 2 for n, v in zip(names, values.tolist(), strict=True)])
    if rivals:
        covariance = covariance + np.diag(squares / len(rivals))
    is_told, bounded = fit.instruments == "reference", () if fit.is_settled else ("delay",)
    return Constants(names, values, covariance, degrees, METHODS[fit.instruments], is_told, bounded)


def _sums_of(fit: Fit) -> tuple[tuple[str, ...], Values, Values, Values]:
    """Names, values, covariance and degrees of freedom of the constants that a model has; a sum has the fewest."""
    # Static friction is more than Coulomb friction only where its own term is part of the model.
    wanted = [
        name
        for name, sums in _SUMS.items()
        if (all if name.startswith("static") else any)(term in fit.names for term in sums)
    ]
    weights = np.zeros((len(wanted), len(fit.values)))
    for row, name in enumerate(wanted):
        for term, sign in _SUMS[name].items():
            if term in fit.names:
                weights[row, fit.names.index(term)] = sign
    degrees = np.where(weights != 0.0, fit.degrees, np.inf).min(axis=1)
    values, parts = weights @ fit.values, np.abs(weights) @ np.abs(fit.values)
    # Two that cancel leave rounding, of either sign.
    values = [significant(v) if abs(v) > CANCELLED * p else 0.0 for v, p in zip(values, parts, strict=True)]
    return tuple(wanted), np.array(values), weights @ fit.covariance @ weights.T, degrees


def reaching(constants: Constants, others: Constants) -> Constants:
    """Constants whose intervals reach as far as those of another way to the same, which may lie elsewhere."""
    own = dict(zip(constants.names, constants.values.tolist(), strict=True))
    told = zip(others.names, others.values.tolist(), others.errors.tolist(), others.degrees.tolist(), strict=True)
    return at_least(
        constants, {n: abs(v - own[n]) + quantile(degrees) * error for n, v, error, degrees in told if n in own}
    )


def at_least(constants: Constants, reach: Mapping[str, float]) -> Constants:
    """Constants whose intervals reach so far at least."""
    covariance = constants.covariance.copy()
    for k, (name, degrees) in enumerate(zip(constants.names, constants.degrees.tolist(), strict=True)):
        covariance[k, k] = max(covariance[k, k], (reach.get(name, 0.0) / quantile(degrees)) ** 2)
    return replace(constants, covariance=covariance)


def further(constants: Constants, times: Mapping[str, float]) -> Constants:
    """Constants whose intervals reach so many times as far: those of the terms that they are sums of, the largest."""
    usual = float(np.median(list(times.values())))
    reach = [max((times[term] for term in _SUMS[name] if term in times), default=usual) for name in constants.names]
    return replace(constants, covariance=constants.covariance * np.outer(reach, reach))


def hanging_position(constants: Constants) -> float:
    """Position at which a pendulum hangs [rad]; 0 without one."""
    return -math.atan2(constants.value("pendulum.across"), constants.value("pendulum"))
