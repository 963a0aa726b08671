"""Models of a frequency response, of one rigid mass or two on a compliant coupling, and their fit.

The effort drives the motor, ``m1 a1 = g u - b1 v1 - d (v1 - v2) - k (x1 - x2)``; the load follows by the coupling,
``m2 a2 = d (v1 - v2) + k (x1 - x2) - b2 v2``. So with ``N = m2 s^2 + (d + b2) s + k`` and ``Z = d s + k``

    x1 / u = g N / D        x2 / u = g Z / D        D = (m1 s^2 + (b1 + d) s + k) N - Z^2

The zeros of N are the anti-resonance, which the encoder of the motor sees; the load's has none. D has a pole at 0, one
real pole, and the pair of the resonance (G. Ellis, "Control System Design Guide", 4th ed., 2012, chapter 16;
R. Munnig Schmidt et al., "The Design of High Performance Mechatronics", 2nd ed., 2014, chapter 3). A response does not
change when masses, stiffness, dampings and g grow together: all are taken per total mass here.

A sampled axis whose effort is held between samples shows more than that: half a sample of delay, and what lies
about the multiples of the sample rate (K. J. Astrom, B. Wittenmark, "Computer-Controlled Systems", 3rd ed., 1997,
section 7.4). Both are part of the models where a hold is given.

The fit is one of weighted least squares. The misfit of a line is ``log(G / F)``, measured over model: its real part is
the relative error of the magnitude, its imaginary part that of the phase, and both have the standard deviation of the
response (R. Pintelon, J. Schoukens, "System Identification: A Frequency Domain Approach", 2nd ed., 2012, section 9.8:
the logarithmic estimator). Friction and backlash come back in each period, so that real axes scatter more from line to
line than between periods (the same book, chapter 3). Where the misfit is more than the noise, its excess over
neighbouring lines is added to the noise, and the fit is repeated; the standard errors come from the misfit itself.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from detent.errors import DetentError
from detent.identify.analyse.measure_response import FrequencyResponse, noise_parts
from detent.logs.differences import scipy
from detent.logs.log import Values

Complex = NDArray[np.complex128]

ALIASES = 3  # multiples of the sample rate, to both sides, that are counted
MOST_DEVIATION = 0.3  # standard deviation of a line from which it is left out: the response there is noise
LINES_PER_PARAMETER = 2  # lines below which a fit says nothing
_COARSE = 0.02
_NEIGHBOURS = 5
_ROUNDS = 4
_DELAYS = 33
_TRIED = 3
_FARTHEST_LINE = 10
_LEAST_FREE = 0.05


@dataclass(frozen=True, slots=True)
class RigidModel:
    """One mass with viscous friction: ``1 / (s (s + b))``."""

    outputs: int = 1  # encoders, which all see the same
    count: ClassVar[int] = 1  # viscous friction per mass [1/s]

    def respond(self, parameters: Values, s: Complex) -> Complex:
        """Responses up to the gain."""
        return np.tile(1.0 / (s * (s + parameters[0])), (self.outputs, 1))

    def tell(self, parameters: Values) -> dict[str, float]:
        """Friction alone."""
        return {"viscous": float(parameters[0])}


@dataclass(frozen=True, slots=True)
class TwoMassModel:
    """Two masses seen by the encoder of the motor, or by both."""

    outputs: int = 1  # 1 for the motor alone, 2 for motor and load
    # logarithms of m2 / m1 and of the anti-resonance [rad/s]; per total mass [1/s]: damping, viscous friction of motor
    # and load
    count: ClassVar[int] = 5

    def respond(self, parameters: Values, s: Complex) -> Complex:
        """Responses up to the gain."""
        m1, m2, k, d, b1, b2 = constants_of(parameters)
        n = (m2 * s + d + b2) * s + k
        z = d * s + k
        denominator = ((m1 * s + b1 + d) * s + k) * n - z * z
        return np.array([n, z][: self.outputs]) / denominator

    def tell(self, parameters: Values) -> dict[str, float]:
        """Anti-resonance and resonance, left out where the damping leaves none; ratio of the masses, friction.

        >>> found = TwoMassModel().tell(np.array([np.log(3.0), np.log(20.0 * np.pi), 0.0, 0.0, 0.0]))
        >>> round(found["antiresonance"], 6), round(found["resonance"], 6)
        (10.0, 20.0)
        """
        m1, m2, k, d, b1, b2 = constants_of(parameters)
        cubic = [m1 * m2, m1 * (d + b2) + m2 * (d + b1), k * (m1 + m2) + d * (b1 + b2) + b1 * b2, k * (b1 + b2)]
        roots = np.roots(cubic)
        pole = complex(roots[np.argmax(roots.imag)])
        omega = float(np.sqrt(k / m2))
        modes = {
            "antiresonance": omega / (2 * np.pi),
            "antiresonance.damping": (d + b2) / (2.0 * m2 * omega),
            "resonance": abs(pole) / (2 * np.pi),
            "resonance.damping": -pole.real / abs(pole),
        }
        ratio = {"mass_ratio": float(np.exp(parameters[0])), "viscous": float(parameters[3] + parameters[4])}
        return modes | ratio if pole.imag > 0 else ratio


@dataclass(frozen=True, slots=True)
class LoadModel:
    """Two masses seen by the encoder of the load alone: ``(1 + s d / k) / (s (s + a) (s^2 / w^2 + 2 z s / w + 1))``."""

    # Advance d / k and delay can hardly be told apart below the resonance; neither is told of this model.

    # the real pole [1/s], the logarithm of the resonance [rad/s], its damping ratio, advance [s]
    count: ClassVar[int] = 4

    def respond(self, parameters: Values, s: Complex) -> Complex:
        """Responses up to the gain."""
        pole, log_omega, ratio, advance = parameters.tolist()
        x = s / np.exp(log_omega)
        return ((1.0 + advance * s) / (s * (s + pole) * ((x + 2.0 * ratio) * x + 1.0)))[None, :]

    def tell(self, parameters: Values) -> dict[str, float]:
        """Resonance and friction."""
        pole, log_omega, ratio, _ = parameters[:4].tolist()
        return {"resonance": float(np.exp(log_omega)) / (2 * np.pi), "resonance.damping": ratio, "viscous": pole}


# Model of the answers of some outputs to one effort: `respond` gives responses up to the gain, shape (outputs, n), at
# complex frequencies [rad/s], shape (n,); `tell` what a person is told: frequencies [Hz], damping and mass ratios,
# friction per mass [1/s].
ResponseModel = RigidModel | TwoMassModel | LoadModel


def constants_of(parameters: Values) -> tuple[float, float, float, float, float, float]:
    """Masses, stiffness, damping of the coupling, and viscous friction of motor and load, per total mass."""
    ratio, omega = float(np.exp(parameters[0])), float(np.exp(parameters[1]))
    m2 = ratio / (1.0 + ratio)
    return 1.0 - m2, m2, m2 * omega**2, float(parameters[2]), float(parameters[3]), float(parameters[4])


def laplace(frequency: Values) -> Complex:
    """Frequencies [Hz] as points of the imaginary axis [rad/s], in the same shape."""
    return np.asarray(2j * np.pi * frequency, dtype=np.complex128)


def respond_sampled(model: ResponseModel, parameters: Values, frequency: Values, hold: float) -> Complex:
    """Response of a model to an effort that is held between samples."""
    *inner, log_gain, delay = parameters.tolist()
    gain, own = np.exp(log_gain), np.asarray(inner)
    s = laplace(frequency)
    if hold == 0.0:
        return gain * np.exp(-s * delay) * model.respond(own, s)
    turns = np.arange(-ALIASES, ALIASES + 1)[:, None] / hold
    all_s = laplace((frequency + turns).ravel())
    held = -np.expm1(-all_s * hold) / (all_s * hold)
    answers = held * np.exp(-all_s * delay) * model.respond(own, all_s)
    return gain * answers.reshape(len(answers), len(turns), len(s)).sum(axis=1)


# ---- the fit


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
        # A parameter that the lines do not determine may be uncertain by decades: the slope is that at its value.
        reach = np.minimum(np.sqrt(np.diag(self.covariance)), np.maximum(np.abs(self.parameters), 1.0))
        steps = np.diag([0.01 * size or 1e-9 for size in reach.tolist()])
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
            f"identify: got {int(lines.used.sum())} lines with a standard deviation below {MOST_DEVIATION:.0%}; "
            f"expected: {LINES_PER_PARAMETER * count} or more for {count} parameters; record a multisine with more "
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
    covariance = _covariance(problem.residual(weights, parameters).T, problem.slopes(weights, parameters))
    scatter, fitted = float(np.median(extra[lines.used])), problem.fitted(parameters)
    return Fit(problem.model, parameters, problem.sign, covariance, freedom, scatter, weights, fitted)


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
    misfits, is a mean over neighbours for a line itself, and over all pairs for lines apart, up to the first distance
    at which it is not significant. The misfits are those of each line if it were left out of the fit (J. G. MacKinnon,
    H. White, Journal of Econometrics 29 (1985) 305): a resonance rests on few lines.
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
