"""Fit of a model to measured frequency responses: weighted least squares on log magnitude and phase.

The misfit of a line is ``log(G / F)``, measured over model: its real part is the relative error of the magnitude, its
imaginary part that of the phase, and both have the standard deviation of the response (R. Pintelon, J. Schoukens,
"System Identification: A Frequency Domain Approach", 2nd ed., 2012, section 9.8: the logarithmic estimator).

Real axes scatter more from line to line than between periods, as friction and backlash come back in each period
(the same book, chapter 3: stochastic nonlinear distortions). Where the misfit is more than the noise, its excess over
neighbouring lines is added to the noise, and the fit is repeated. The standard errors then come from the misfit itself:
correlations between magnitude and phase, between two encoders and between neighbouring lines are taken from it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from detent.errors import DetentError
from detent.identify.analyse.measure_response import FrequencyResponse, noise_parts
from detent.identify.analyse.two_mass_response import Complex, ResponseModel, laplace, respond_sampled
from detent.logs.differences import scipy
from detent.logs.log import Values

MOST_DEVIATION = 0.3  # standard deviation of a line from which it is left out: the response there is noise
LINES_PER_PARAMETER = 2  # lines below which a fit says nothing
_COARSE = 0.02
_NEIGHBOURS = 5
_ROUNDS = 4
_DELAYS = 33
_TRIED = 3
_FARTHEST_LINE = 10
_LEAST_FREE = 0.05


@dataclass(frozen=True, eq=False)
class Lines:
    """What is fitted."""

    frequency: Values  # [Hz], shape (n,)
    measured: Complex  # responses of the encoders, shape (outputs, n)
    deviation: Values  # their relative standard deviations, shape (outputs, n)
    used: NDArray[np.bool_]  # lines that take part, shape (outputs, n)


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted model."""

    model: ResponseModel  # what was fitted
    parameters: Values  # those of the model, then the logarithm of the gain and the dead time [s]; shape (p,)
    sign: float  # sign of the gain
    covariance: Values  # of the parameters, shape (p, p); nan where the fit ended at values that describe no axis
    freedom: float  # values less parameters
    scatter: float  # misfit beyond the noise, as a part of the response: the median over lines
    weights: Values  # reciprocal standard deviations that were used, 0 for a line left out, shape (outputs, n)
    fitted: Complex  # responses of the model at the lines, shape (outputs, n)

    @property
    def degrees(self) -> float:
        """Independent misfits behind a standard error: those of the neighbours that are taken together."""
        return min(self.freedom, 2.0 * (2 * _NEIGHBOURS + 1))

    def spread(self, tell: Callable[[Values], dict[str, float]]) -> dict[str, tuple[float, float]]:
        """Values and standard errors of functions of the parameters, by their slopes (delta method); inf for none."""
        steps = np.diag([0.01 * size or 1e-9 for size in np.sqrt(np.diag(self.covariance)).tolist()])
        sides = [(tell(self.parameters + step), tell(self.parameters - step), 2 * step.sum()) for step in steps]
        found: dict[str, tuple[float, float]] = {}
        for name, value in tell(self.parameters).items():
            slopes = np.array([(up.get(name, np.nan) - down.get(name, np.nan)) / way for up, down, way in sides])
            variance = float(slopes @ self.covariance @ slopes)
            found[name] = value, float(np.sqrt(variance)) if variance >= 0 else np.inf
        return found


def take_lines(responses: Sequence[FrequencyResponse]) -> Lines:
    """Put responses of one excitation together."""
    frequency = reduce(np.intersect1d, [one.frequency for one in responses])
    held = [(one, np.isin(one.frequency, frequency)) for one in responses]
    measured = np.array([one.response[mask] for one, mask in held])
    deviation = np.array([one.deviation[mask] for one, mask in held])
    # No recording is free of noise; without a least one, simulated ones would divide by 0.
    deviation = np.maximum(deviation, 1e-9)
    return Lines(frequency, measured, deviation, (deviation < MOST_DEVIATION) & (np.abs(measured) > 0))


def fit_model(model: ResponseModel, lines: Lines, starts: Sequence[Values], hold: float = 0.0) -> Fit:
    """Fit a model to responses."""
    count = model.count + 2
    if int(lines.used.sum()) < LINES_PER_PARAMETER * count:
        raise DetentError(
            f"identify: came {int(lines.used.sum())} lines with a standard deviation below {MOST_DEVIATION:.0%}; "
            f"allowed: {LINES_PER_PARAMETER * count} or more for {count} parameters; record a multisine with more "
            "lines, more periods, or a larger amplitude"
        )
    coarse = np.where(lines.used, 1.0 / np.maximum(lines.deviation, _COARSE), 0.0)
    trials: list[tuple[float, Values, float]] = []
    for start in _best_starts(model, lines, starts):
        begin, sign = _complete(model, lines, start)
        # The hold is a delay of half a sample here; what it does beside that waits for the refinement.
        parameters, cost = _Problem(model, lines, sign, 0.0).solve(coarse, begin)
        trials.append((cost, parameters, sign))
    _, parameters, sign = min(trials, key=lambda trial: trial[0])
    parameters[-1] -= 0.5 * hold
    return _refine(_Problem(model, lines, sign, hold), parameters)


@dataclass(frozen=True, eq=False)
class _Problem:
    """A model, the lines that it is fitted to, the sign of its gain and the hold of the effort."""

    model: ResponseModel
    lines: Lines
    sign: float
    hold: float

    def fitted(self, parameters: Values) -> Complex:
        """Responses of the model, shape (outputs, n)."""
        # On its way a fit may try what no axis is: that is no warning, but a misfit.
        with np.errstate(all="ignore"):
            return self.sign * respond_sampled(self.model, parameters, self.lines.frequency, self.hold)

    def misfit(self, parameters: Values) -> Complex:
        """``log(G / F)``, shape (outputs, n); 0 for a line left out."""
        with np.errstate(all="ignore"):
            return np.log(np.where(self.lines.used, self.lines.measured / self.fitted(parameters), 1.0))

    def residual(self, weights: Values, parameters: Values) -> Values:
        """Weighted misfits of magnitude and phase, shape (2 outputs, n)."""
        with np.errstate(invalid="ignore"):
            misfit = weights * self.misfit(parameters)
        return np.concatenate([misfit.real, misfit.imag])

    def slopes(self, weights: Values, parameters: Values) -> Values:
        """Derivatives of the residual by the parameters, shape (n, 2 outputs, p)."""
        steps = np.diag(1e-5 * np.maximum(np.abs(parameters), 1e-3))
        columns = [
            (self.residual(weights, parameters + step) - self.residual(weights, parameters - step)).T
            / (2.0 * float(np.abs(step).sum()))
            for step in steps
        ]
        return np.stack(columns, axis=-1)

    def solve(self, weights: Values, start: Values) -> tuple[Values, float]:
        """Parameters at the least sum of squares from a start on, and that sum."""

        def residual(parameters: Values) -> Values:
            values = self.residual(weights, parameters).ravel()
            return np.where(np.isfinite(values), values, 1e6)

        found = scipy("optimize").least_squares(residual, start, x_scale="jac", max_nfev=60)
        return np.asarray(found.x, dtype=np.float64), float(found.cost)


def _refine(problem: _Problem, parameters: Values) -> Fit:
    """Repeat the fit with the noise over the model's magnitude, and with the scatter that is more than noise."""
    lines = problem.lines
    freedom = 2.0 * float(lines.used.sum()) - len(parameters)
    power = np.abs(lines.measured) ** 2
    parts = [
        noise_parts(noise, size, _NEIGHBOURS) for noise, size in zip(lines.deviation**2 * power, power, strict=True)
    ]
    noise, extra = lines.deviation, np.zeros_like(lines.deviation)
    weights = np.zeros_like(noise)
    for _ in range(_ROUNDS):
        weights = np.where(lines.used, 1.0 / np.hypot(noise, extra), 0.0)
        parameters, _ = problem.solve(weights, parameters)
        # By the magnitude of the model: noise over the measured one would prefer lines that noise made large.
        power = np.abs(problem.fitted(parameters)) ** 2
        noise = np.sqrt([level / size + slope for (level, slope), size in zip(parts, power, strict=True)])
        squares = np.where(lines.used, 0.5 * np.abs(problem.misfit(parameters)) ** 2, 0.0)
        total = float(np.sum(2.0 * squares / noise**2))
        if total > freedom * (1.0 + 4.0 * np.sqrt(2.0 / freedom)):
            excess = np.where(lines.used, squares - noise**2, 0.0)
            extra = np.sqrt(np.maximum(_local(excess.T).T, 0.0))
    return Fit(
        model=problem.model,
        parameters=parameters,
        sign=problem.sign,
        covariance=_covariance(problem.residual(weights, parameters).T, problem.slopes(weights, parameters)),
        freedom=freedom,
        scatter=float(np.median(extra[lines.used])),
        weights=weights,
        fitted=problem.fitted(parameters),
    )


def _best_starts(model: ResponseModel, lines: Lines, starts: Sequence[Values]) -> list[Values]:
    """Starts whose magnitudes are nearest to the measured ones, whatever their gains."""
    s = laplace(lines.frequency)
    count = lines.used.sum()
    scored: list[tuple[float, int]] = []
    for index, start in enumerate(starts):
        with np.errstate(all="ignore"):
            ratio = np.where(lines.used, np.log(np.abs(lines.measured / model.respond(start, s))), 0.0)
        centred = np.where(lines.used, ratio - ratio.sum() / count, 0.0)
        scored.append((float(np.abs(centred).sum()), index))
    return [starts[index] for score, index in sorted(scored)[:_TRIED] if np.isfinite(score)]


def _complete(model: ResponseModel, lines: Lines, start: Values) -> tuple[Values, float]:
    """Give a start its gain, sign and delay."""
    ratio = lines.measured / model.respond(start, laplace(lines.frequency))
    log_gain = float(np.median(np.log(np.abs(ratio[lines.used]))))
    turned = np.where(lines.used, ratio / np.abs(ratio), 0.0).sum(axis=0)
    # A delay of half a turn at the highest line cannot be told from a turned sign and none.
    delays = np.linspace(0.0, 1.0, _DELAYS) / lines.frequency[-1]
    agreement = np.real(np.exp(2j * np.pi * np.outer(delays, lines.frequency)) @ turned)
    best = int(np.argmax(np.abs(agreement)))
    return np.r_[start, log_gain, delays[best]], float(np.copysign(1.0, agreement[best]))


def _local(values: Values) -> Values:
    """Mean over neighbouring lines, fewer at the ends; lines are the first axis."""
    sums = np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])
    index = np.arange(len(values))
    low, high = np.maximum(index - _NEIGHBOURS, 0), np.minimum(index + _NEIGHBOURS + 1, len(values))
    return (sums[high] - sums[low]) / (high - low).reshape(-1, *[1] * (values.ndim - 1))


def _covariance(misfits: Values, slopes: Values) -> Values:
    """Covariance of the parameters from slopes and misfits.

    ``B^-1 (sum over k, l of J_k' R_kl J_l) B^-1`` with ``B = sum of J_k' J_k``: R, the covariance of the weighted
    misfits, is a mean over neighbours for a line itself, and over all pairs for lines some lines apart, up to the first
    distance at which it is not significant. The misfits are those that each line would have if it were left out of the
    fit (J. G. MacKinnon, H. White, Journal of Econometrics 29 (1985) 305): a resonance rests on few lines.
    """
    if not (np.isfinite(slopes).all() and np.isfinite(misfits).all()):
        return np.full((slopes.shape[2], slopes.shape[2]), np.nan)
    scale = np.sqrt(np.sum(slopes**2, axis=(0, 1)))
    by_line = slopes / np.where(scale > 0, scale, 1.0)
    inverse = np.asarray(np.linalg.pinv(np.einsum("kap,kaq->pq", by_line, by_line)), dtype=np.float64)
    # Misfits of lines that were left out of the fit: (1 - H)^-1 r, H the part of each line in its own fit.
    hat = np.einsum("kap,pq,kbq->kab", by_line, inverse, by_line)
    size, axes = np.linalg.eigh(np.eye(hat.shape[1]) - hat)
    along = np.einsum("kab,ka->kb", axes, misfits) / np.maximum(size, _LEAST_FREE)
    free = np.einsum("kab,kb->ka", axes, along)
    middle = np.einsum("kap,kab,kbq->pq", by_line, _local(free[:, :, None] * free[:, None, :]), by_line)
    count, channels = free.shape
    for lag in range(1, min(_FARTHEST_LINE, count // 4) + 1):
        products = free[lag:].T @ free[:-lag] / count
        if abs(np.trace(products)) < 2.0 / np.sqrt(channels * count) * float(np.sum(free**2)) / count:
            break
        pair = np.einsum("kap,ab,kbq->pq", by_line[lag:], products, by_line[:-lag])
        middle += (1.0 - lag / (_FARTHEST_LINE + 1)) * (pair + pair.T)
    # A parameter that no line depends on is not known: nan.
    known = np.where(scale > 0.0, scale, np.nan)
    covariance = inverse @ middle @ inverse
    # Without the negative variances that negative correlations between lines could leave.
    size, axes = np.linalg.eigh(0.5 * (covariance + covariance.T))
    return (axes * np.maximum(size, 0.0)) @ axes.T / np.outer(known, known)
