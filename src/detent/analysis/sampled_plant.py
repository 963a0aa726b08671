"""A plant from sample to sample while what drives it is held, and its response as a fraction of polynomials.

    x' = A x + b u        x(k+1) = (1 + M) x(k) + h u(k)        y = sum(n_k d^k) / sum(p_k d^k),  d = z - 1

M and h come from Taylor's series of a short stretch that is doubled, M(2t) = 2 M + M^2, h(2t) = 2 h + M h: what hardly
changes within a sample keeps its digits. The polynomials are those of Faddeev and LeVerrier. All of it is for stacks of
plants, its sums of one order whatever stands beside a plant: nothing is left to a library of matrices.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]
Phasors = NDArray[np.complex128]

SHORT = 0.5  # largest sum of a column of A t in the series
TERMS = 15  # of it: what is left out is below 1e-18


def held(a: Numbers, b: Numbers, period: float) -> tuple[Numbers, Numbers]:
    """M and h of plants with A, shape (..., n, n), and b, shape (..., n)."""
    size = np.max(np.sum(np.abs(a), axis=-2), axis=-1) * period
    doublings = np.ceil(np.log2(np.maximum(size / SHORT, 1.0)))
    step = period * np.exp2(-doublings)
    x, one = a * step[..., None, None], np.eye(a.shape[-1])
    series = one + x / (TERMS + 1)  # sum of x^k / (k + 1)!
    for k in range(TERMS, 1, -1):
        series = one + times(x, series) / k
    moved, driven = times(x, series), times(series, b[..., None] * step[..., None, None])
    for k in range(int(np.max(doublings))):
        more = (k < doublings)[..., None, None]
        driven = np.where(more, 2.0 * driven + times(moved, driven), driven)
        moved = np.where(more, 2.0 * moved + times(moved, moved), moved)
    return moved, driven[..., 0]


def times(a: Numbers, b: Numbers) -> Numbers:
    """Product of stacks of small matrices, each sum in the order of its terms."""
    found = a[..., :, 0, None] * b[..., 0, None, :]
    for k in range(1, a.shape[-1]):
        found = found + a[..., :, k, None] * b[..., k, None, :]
    return found


class Fraction(NamedTuple):
    """Responses of the places of a plant: coefficients over d, from d^0 up."""

    above: Numbers  # shape (..., places, n)
    below: Numbers  # shape (..., n + 1); its last is 1


def fraction(moved: Numbers, driven: Numbers, out: Numbers) -> Fraction:
    """Responses of sums of the state, rows of `out`, shape (places, n), to what drives the plants.

    A column of zeros in M, a place that acts on nothing, stays a pole at d = 0 to the last bit.
    """
    size = moved.shape[-1]
    one: Numbers = np.eye(size)
    power: Numbers = np.broadcast_to(one, moved.shape)
    above, below = list[Numbers](), list[Numbers]([np.ones(moved.shape[:-2])])
    for k in range(1, size + 1):
        above.append(times(out, times(power, driven[..., None]))[..., 0])
        power = times(moved, power)
        trace: Any = sum(power[..., j, j] for j in range(size)) / k
        below.append(-trace)
        power = power - trace[..., None, None] * one
    below[-1] = np.where(np.any(np.all(moved == 0.0, axis=-2), axis=-1), 0.0, below[-1])
    return Fraction(np.stack(above[::-1], axis=-1), np.stack(below[::-1], axis=-1))


def polynomial(coefficients: Numbers, powers: list[Phasors]) -> Phasors:
    """Sum of coefficients, shape (..., m), times powers, shape (k,) or (..., k): shape (..., k)."""
    found = coefficients[..., 0, None] * powers[0]
    for k in range(1, coefficients.shape[-1]):
        found = found + coefficients[..., k, None] * powers[k]
    return found
