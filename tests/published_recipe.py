"""Inverse-dynamics least squares on filtered derivatives, as the EMPS benchmark's authors do it: to compare with them.

M. Gautier, "Dynamic identification of robots with power model", ICRA 1997; A. Janot, M. Gautier, M. Brunot, "Data Set
and Reference Models of EMPS", 2019 Workshop on Nonlinear System Identification Benchmarks. Standard errors are those of
independent errors of equal size, which residuals of a real axis are not.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal

CUTOFF, ORDER, DECIMATION, BORDER = 100.0, 4, 10, 49
"""Corner [Hz] and order of the position's low-pass; one of so many samples is kept; samples left out at the begin."""


@dataclass(frozen=True)
class Fit:
    """Constants in SI units, their standard errors, and the norm of the residual over that of the force."""

    values: dict[str, float]
    standard_errors: dict[str, float]
    relative_error: float


def fit_inverse_dynamics(t: NDArray, position: NDArray, force: NDArray, *, per_direction: bool = False) -> Fit:
    """Fit the constants of a rigid axis to one evenly sampled run."""
    step = float(np.diff(t).mean())
    b, a = signal.butter(ORDER, CUTOFF * 2 * step)
    smooth = signal.filtfilt(b, a, position, padlen=3 * ORDER)
    velocity = np.gradient(smooth, step)
    way = np.sign(velocity)
    columns = {"mass": np.gradient(velocity, step)}
    if per_direction:
        for name, on in (("right", 0.5 * (1.0 + way)), ("left", 0.5 * (1.0 - way))):
            columns |= {f"viscous {name}": velocity * on, f"coulomb {name}": way * on}
    else:
        columns |= {"viscous": velocity, "coulomb": way, "offset": np.ones_like(velocity)}
    matrix = np.column_stack([decimate(column[BORDER:]) for column in columns.values()])
    return _solve(list(columns), matrix, decimate(force[BORDER:]))


def decimate(values: NDArray) -> NDArray:
    """Every tenth sample behind a Chebyshev low-pass of order 8 without delay; the last sample is kept."""
    sections = signal.cheby1(8, 0.05, 0.8 / DECIMATION, output="sos")
    smooth = signal.sosfiltfilt(sections, values, padlen=24)
    return smooth[(len(values) - 1) % DECIMATION :: DECIMATION]


def _solve(names: list[str], matrix: NDArray, force: NDArray) -> Fit:
    length = np.linalg.norm(matrix, axis=0)
    scaled = matrix / length
    solution = np.linalg.lstsq(scaled, force, rcond=None)[0]
    residual = force - scaled @ solution
    errors = np.std(residual, ddof=1) * np.sqrt(np.diag(np.linalg.inv(scaled.T @ scaled))) / length
    return Fit(
        dict(zip(names, (solution / length).tolist(), strict=True)),
        dict(zip(names, errors.tolist(), strict=True)),
        float(np.linalg.norm(residual) / np.linalg.norm(force)),
    )
