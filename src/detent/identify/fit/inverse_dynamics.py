"""Constants of an axis from its motion and its force: inverse-dynamics least squares on filtered derivatives.

The force of a rigid axis is linear in its constants, ``F = M a + Fv v + Fc sign(v) + offset``; so position and force of
one run give them by linear least squares. Velocity and acceleration come from the position by a low-pass without delay
and central differences; the force and every column then pass the same decimation filter, which takes the noise above
the motion away and leaves samples that are nearly independent (M. Gautier, "Dynamic identification of robots with
power model", ICRA 1997; A. Janot, M. Gautier, M. Brunot, "Data Set and Reference Models of EMPS", 2019 Workshop on
Nonlinear System Identification Benchmarks, whose recipe is the default here).

The standard errors are those of independent errors of equal size. Residuals of a real axis are neither; these figures
compare with published ones, and are no confidence limits.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.errors import DetentError

Numbers = NDArray[np.float64]

RIPPLE = 0.05
"""Pass-band ripple of the decimation filter [dB], Chebyshev of order 8 (the decimation of the benchmark's authors)."""

PASS_BAND = 0.8
"""Its edge, as a part of the new Nyquist frequency."""

EVEN = 0.1
"""Largest deviation of a time step from their mean, as a part of it, with which filters still mean what they say."""

FEWEST = 10
"""Decimated samples per constant below which a fit says nothing."""


@dataclass(frozen=True, slots=True)
class Recipe:
    """How derivatives and samples are made."""

    cutoff_hz: float = 100.0  # corner of the low-pass of the position, run forward and backward [Hz]
    order: int = 4  # order of that filter (Butterworth)
    decimation: int = 10  # every so many samples one is kept
    border: int = 49  # samples left out at the beginning, where filter and differences still settle


@dataclass(frozen=True, slots=True)
class Motion:
    """Position of a run with its derivatives, each of shape (n,)."""

    position: Numbers  # and velocity, acceleration: after the low-pass [m, m/s, m/s^2] or [rad, rad/s, rad/s^2]
    velocity: Numbers  # [m, m/s, m/s^2] or [rad, rad/s, rad/s^2]
    acceleration: Numbers  # [m, m/s, m/s^2] or [rad, rad/s, rad/s^2]


Column = Callable[[Motion], Numbers]
"""What multiplies a constant in the force, one value per sample."""


def _right(motion: Motion) -> Numbers:
    """1 in motion to larger positions, 0 in the other direction, 1/2 at rest."""
    return 0.5 * (1.0 + np.sign(motion.velocity))


def _left(motion: Motion) -> Numbers:
    return 0.5 * (1.0 - np.sign(motion.velocity))


FOUR_CONSTANTS: Mapping[str, Column] = {
    "mass": lambda m: m.acceleration,
    "viscous": lambda m: m.velocity,
    "coulomb": lambda m: np.sign(m.velocity),
    "offset": lambda m: np.ones_like(m.velocity),
}
"""Mass, viscous and Coulomb friction of both directions alike, and a constant force."""

PER_DIRECTION: Mapping[str, Column] = {
    "mass": lambda m: m.acceleration,
    "viscous right": lambda m: m.velocity * _right(m),
    "coulomb right": lambda m: np.sign(m.velocity) * _right(m),
    "viscous left": lambda m: m.velocity * _left(m),
    "coulomb left": lambda m: np.sign(m.velocity) * _left(m),
}
"""Mass, and friction of each direction for itself; a constant force is then part of both Coulomb constants."""


@dataclass(frozen=True, slots=True)
class Regression:
    """Outcome of a linear fit of the force."""

    # values, standard_errors: constants in SI units, and their standard errors for independent errors of equal size
    values: dict[str, float]
    standard_errors: dict[str, float]
    correlation: Numbers  # of the constants, in their order
    residual: Numbers  # measured less fitted force of the decimated samples [N]
    relative_error: float  # norm of the residual over that of the force
    # condition number of the regressor with columns of unit length: what the data cannot tell apart makes it large
    condition: float


def fit_inverse_dynamics(
    t: Numbers,  # evenly spaced times [s]
    position: Numbers,
    force: Numbers,
    columns: Mapping[str, Column] = FOUR_CONSTANTS,
    recipe: Recipe | None = None,
) -> Regression:
    """Fit the constants of a rigid axis to one run."""
    recipe = recipe or Recipe()
    step = _checked_step(t, position, force, recipe, len(columns))
    motion = differentiate(position, step, recipe)
    sample = slice(recipe.border, None)
    made = {name: decimate(column(motion)[sample], recipe.decimation) for name, column in columns.items()}
    return _solve(made, decimate(force[sample], recipe.decimation))


def differentiate(position: Numbers, step: float, recipe: Recipe) -> Motion:
    """Low-pass the position forward and backward, and take central differences twice."""
    signal = _signal()
    b, a = signal.butter(recipe.order, recipe.cutoff_hz * 2 * step)
    smooth = np.asarray(signal.filtfilt(b, a, position, padlen=3 * recipe.order), float)
    velocity = central_differences(smooth, step)
    return Motion(smooth, velocity, central_differences(velocity, step))


def central_differences(values: Numbers, step: float) -> Numbers:
    """Central differences, one-sided at both ends, shape as `values`."""
    return np.gradient(values, step)


def decimate(values: Numbers, factor: int) -> Numbers:
    """Every `factor`-th sample behind a low-pass without delay; the last sample is kept."""
    if factor == 1:
        return values
    signal, order = _signal(), 8
    sections = signal.cheby1(order, RIPPLE, PASS_BAND / factor, output="sos")
    smooth = np.asarray(signal.sosfiltfilt(sections, values, padlen=3 * order), float)
    return smooth[(len(values) - 1) % factor :: factor]


def _signal() -> Any:
    """Scipy's filters, loaded where they are used; they state no types."""
    return import_module("scipy.signal")


def _checked_step(t: Numbers, position: Numbers, force: Numbers, recipe: Recipe, constants: int) -> float:
    """Time step of a run that can be filtered [s]."""
    if not len(t) == len(position) == len(force):
        raise DetentError(
            f"identify: came {len(t)} times, {len(position)} positions, {len(force)} forces; allowed: as many of each; "
            "take them from one log"
        )
    least = recipe.border + FEWEST * constants * recipe.decimation
    if len(t) < least:
        raise DetentError(
            f"identify: came {len(t)} samples; allowed: at least {least} for {constants} constants and a decimation by "
            f"{recipe.decimation}; record longer, or decimate less"
        )
    steps = np.diff(t)
    mean = float(steps.mean())
    if not mean > 0 or float(np.abs(steps - mean).max()) > EVEN * mean:
        raise DetentError(
            f"identify: came time steps from {steps.min():g} to {steps.max():g} s; allowed: even ones, within "
            f"{EVEN:.0%} of their mean; put the log on an even grid first"
        )
    if not recipe.cutoff_hz * 2 * mean < 1:
        raise DetentError(
            f"identify: came a low-pass at {recipe.cutoff_hz:g} Hz; allowed: below half the sample rate, "
            f"{0.5 / mean:g} Hz; lower its corner"
        )
    return mean


def _solve(columns: Mapping[str, Numbers], force: Numbers) -> Regression:
    """Least squares with columns scaled to unit length: constants of any unit are then alike."""
    names = list(columns)
    matrix: Numbers = np.column_stack([columns[name] for name in names])
    length: Numbers = np.asarray(np.linalg.norm(matrix, axis=0), float)
    absent = [name for name, size in zip(names, length.tolist(), strict=True) if size == 0.0]
    if absent:
        raise DetentError(
            f"identify: nothing in this log excites {', '.join(absent)}; allowed: motion in which each constant acts; "
            "record a run with acceleration and both directions"
        )
    scaled: Numbers = matrix / length
    singular = np.asarray(np.linalg.svd(scaled, compute_uv=False), float)
    if singular[-1] < len(force) * np.finfo(float).eps * singular[0]:
        raise DetentError(
            f"identify: this log cannot tell {', '.join(names)} apart; allowed: motion in which they act differently; "
            "record a run with several speeds and a reversal"
        )
    solution: Numbers = np.asarray(np.linalg.lstsq(scaled, force, rcond=None)[0], float)
    residual = force - scaled @ solution
    inverse: Numbers = np.asarray(np.linalg.inv(scaled.T @ scaled), float)
    spread: Numbers = np.sqrt(np.diag(inverse))
    errors: Numbers = float(np.std(residual, ddof=1)) * spread / length
    return Regression(
        values=dict(zip(names, (solution / length).tolist(), strict=True)),
        standard_errors=dict(zip(names, errors.tolist(), strict=True)),
        correlation=inverse / np.outer(spread, spread),
        residual=residual,
        relative_error=float(np.linalg.norm(residual) / np.linalg.norm(force)),
        condition=float(singular[0] / singular[-1]),
    )
