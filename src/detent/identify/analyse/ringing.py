"""Period and damping of a ringing: a damped oscillation fitted to the swings after a step.

``y(t) = c + exp(-sigma t) (p cos(omega t) + q sin(omega t))`` by least squares over the decay, started from the swings
themselves: half periods are the times between turning points, and the logarithmic decrement is taken from the swings
between them, which needs no rest value (friction may stop the axis off the middle of its ringing). Linear constants are
eliminated (variable projection: Golub, Pereyra, SIAM J. Numer. Anal. 10 (1973) 413); errors take the colour of residual
and noise into account.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from detent.identify.fit.estimate import Estimate, estimate, known_noise_covariance
from detent.logs.differences import scipy
from detent.logs.log import Values

FEWEST_SWINGS = 2  # swings, at least: two give one ratio
FAINT = 0.05  # part of the first swing below which the decay is not fitted
METHOD = "damped oscillation, least squares"


@dataclass(frozen=True, slots=True)
class Ringing:
    """A decaying oscillation."""

    swings: tuple[float, ...]  # way between successive turning points
    log_decrement: float  # logarithm of the ratio of two swings a whole period apart, from the first and last one
    period: Estimate  # of the damped oscillation [s]
    damping_ratio: Estimate  # ``sigma / sqrt(sigma^2 + omega^2)``


def fit_ringing(t: Values, y: Values, least: float, noise: Values, floor: float = 0.0) -> Ringing | None:
    """Fit the ringing of a record that begins at its first turning point."""
    turns = find_turns(y, least)
    swings: Values = np.asarray(np.abs(np.diff(y[turns])), float)
    if len(swings) < FEWEST_SWINGS or swings[-1] >= swings[0]:
        return None
    last_turn = int(turns[-1])
    half = float(t[last_turn] - t[0]) / (len(turns) - 1)
    decrement = 2.0 * float(np.log(swings[0] / swings[-1])) / (len(swings) - 1)
    start = np.array([0.5 * decrement / half, np.pi / half])
    faint = float(t[0]) - float(np.log(FAINT)) * 2.0 * half / decrement
    last = int(np.count_nonzero(t < faint)) + 1
    kept = slice(0, max(min(last, len(t)), last_turn + 1))
    fitted = _fit_decay(t[kept] - t[0], y[kept], start, (noise, floor))
    return Ringing(tuple(swings.tolist()), decrement, *fitted) if fitted else None


def find_turns(y: Values, least: float) -> NDArray[np.int64]:
    """Places of the turning points of a record, its first sample among them, shape (k,).

    A point is one where the record has come back from its extreme by `least`.

    >>> find_turns(np.array([0.0, 3.0, 1.0, 1.1, 0.9, 2.0, 1.9]), 0.5)
    array([0, 1, 4])
    """
    turns, extreme, upward = [0], 0, 0.0
    for k in range(1, len(y)):
        way = float(y[k] - y[extreme])
        if upward == 0.0:
            upward = float(np.sign(way)) if abs(way) >= least else 0.0
            extreme = k if upward else 0
        elif way * upward >= 0:
            extreme = k
        elif -way * upward >= least:
            turns.append(extreme)
            extreme, upward = k, -upward
    return np.array(turns, dtype=np.int64)


def _waves(t: Values, rate: Values) -> Values:
    """Columns of the linear constants, shape (n, 3)."""
    decay = np.exp(-rate[0] * t)
    return np.column_stack([np.ones(len(t)), decay * np.cos(rate[1] * t), decay * np.sin(rate[1] * t)])


def _fit_decay(t: Values, y: Values, start: Values, noise: tuple[Values, float]) -> tuple[Estimate, Estimate] | None:
    """Period and damping ratio; None where the fit leaves the neighbourhood of the swings."""

    def miss(scale: Values) -> Values:
        columns = _waves(t, start * scale)
        return y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0]

    found = scipy("optimize").least_squares(miss, np.ones(2), bounds=([0.05, 0.5], [20.0, 2.0]))
    scale: Values = np.asarray(found.x, float)
    if not found.success or np.any(np.asarray(found.active_mask) != 0) or len(t) < 8:
        return None
    sigma, omega = (start * scale).tolist()
    columns = _waves(t, start * scale)
    linear = np.asarray(np.linalg.lstsq(columns, y, rcond=None)[0], float)
    wave = columns[:, 1:] @ linear[1:]
    turned = columns[:, 1] * linear[2] - columns[:, 2] * linear[1]
    slopes = np.column_stack([-t * wave, t * turned, columns])
    covariance, degrees = known_noise_covariance(slopes, y - columns @ linear, noise[0], floor=noise[1])
    period = 2 * np.pi / omega
    size = float(np.hypot(sigma, omega))
    slope = np.array([omega**2, -sigma * omega]) / size**3
    error = float(np.sqrt(slope @ covariance[:2, :2] @ slope))
    period_error = period / omega * float(np.sqrt(covariance[1, 1]))
    damping_ratio = estimate("damping_ratio", sigma / size, "", error, METHOD, degrees)
    return estimate("ringing_period", period, "s", period_error, METHOD, degrees), damping_ratio
