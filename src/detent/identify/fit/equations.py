"""The equation of motion of an axis over a run, window by window: one row per window, linear in the constants.

    F = M a + sum over the terms of the friction and the weight

Each term is a constant times a function of velocity, its direction or the position. One number may bend the model, in
which it is not linear: the Stribeck velocity, or the share ``l`` of the effort that a transmission loses, with which
``F - l |F| sign(v)`` takes the place of F, so that all columns grow by ``1 / (1 - l sign(F v))``.

A window is usable where it holds no sample that is missing, saturated, at standstill or turning round: there friction
is whatever holds the axis, and no equation says how much.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from detent.identify.fit.prepare import Run
from detent.identify.fit.weights import Kernel, Rows, make_kernel
from detent.logs.log import Values

FINE, FINEST = 6e-3, 4  # half of the window that tells the direction [s], and its fewest samples
NOISES = 5.0  # velocity that is told from standstill, in standard deviations of its noise
HOPS = 2  # rows per half window


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """What a position says, window by window, each of shape (m,) unless said otherwise."""

    position: Values  # and velocity, acceleration: means over the window around each row [m, m/s, m/s^2] or in rad
    velocity: Values
    acceleration: Values
    # right, left: shares of each window in motion to larger and to smaller positions; standstill is half of both
    right: Values
    left: Values
    quick: Values  # and places, effort: velocity, by a short window, position and effort at every sample
    places: Values
    effort: Values
    rows: Rows  # samples around which the windows lie
    kernel: Kernel  # their window


def fine_kernel(kernel: Kernel) -> Kernel:
    """The short window that tells the direction."""
    return make_kernel(min(kernel.half, max(FINEST, round(FINE / kernel.step))), kernel.step)


def make_motion(position: Values, effort: Values, kernel: Kernel, rows: Rows) -> Motion:
    """Position, velocity and acceleration by a window."""
    quick = fine_kernel(kernel).velocities(position)
    still = 0.5 * (quick == 0.0)
    return Motion(
        kernel.mean(position, rows),
        kernel.velocity(position, rows),
        kernel.acceleration(position, rows),
        kernel.mean((quick > 0.0) + still, rows),
        kernel.mean((quick < 0.0) + still, rows),
        quick,
        position,
        effort,
        rows,
        kernel,
    )


Term = Callable[[Motion, float], Values]
"""What multiplies a constant, window by window; the number is the Stribeck velocity, for terms that have one."""


def _bristle(m: Motion, stribeck: float, sense: int) -> Values:
    """Part of the low-speed friction that is left at each sample, in one direction."""
    speed = m.quick * sense
    left = np.where(speed > 0.0, np.exp(-np.minimum((speed / stribeck) ** 2, 50.0)), 0.0)
    return sense * m.kernel.mean(left, m.rows)


TERMS: Mapping[str, Term] = {
    "mass": lambda m, _: m.acceleration,
    "offset": lambda m, _: np.ones_like(m.velocity),
    "coulomb": lambda m, _: m.right - m.left,
    "coulomb.positive": lambda m, _: m.right,
    "coulomb.negative": lambda m, _: -m.left,
    "viscous": lambda m, _: m.velocity,
    "viscous.positive": lambda m, _: np.maximum(m.velocity, 0.0),
    "viscous.negative": lambda m, _: np.minimum(m.velocity, 0.0),
    "excess.positive": lambda m, s: _bristle(m, s, 1),
    "excess.negative": lambda m, s: _bristle(m, s, -1),
    "pendulum": lambda m, _: m.kernel.mean(np.sin(m.places), m.rows),
    "pendulum.across": lambda m, _: m.kernel.mean(np.cos(m.places), m.rows),
    "spring": lambda m, _: m.position,
}
"""Every term of an equation of motion; `excess` is static less Coulomb friction."""


LOSS = "loss"  # named in a model whose transmission loses a share of the effort; it bends the terms, without a column


def is_bent(names: Sequence[str]) -> bool:
    """True for a model with a Stribeck velocity or a loss."""
    return LOSS in names or any(name.startswith("excess") for name in names)


def terms_of(names: Sequence[str]) -> tuple[str, ...]:
    """Names of a model that have a column."""
    return tuple(name for name in names if name != LOSS)


def model_columns(m: Motion, names: Sequence[str], bend: float) -> Values:
    """Columns of a model over windows."""
    columns = np.column_stack([TERMS[name](m, bend) for name in terms_of(names)])
    if LOSS not in names:
        return columns
    with_motion = np.sign(m.effort) * np.sign(m.quick)
    return columns * m.kernel.mean(1.0 / (1.0 - bend * with_motion), m.rows)[:, None]


def standstill_velocity(run: Run, kernel: Kernel) -> float:
    """Velocity below which a window cannot tell motion from noise [m/s]."""
    noise = run.noise * math.sqrt(float(np.sum(kernel.first**2)))
    count = run.resolution / (2.0 * kernel.half * run.step)
    return max(NOISES * noise, 0.5 * count)


def usable_rows(run: Run, kernel: Kernel) -> Rows:
    """Samples, evenly spaced, around which the equation of motion holds for a whole window."""
    half, n = kernel.half, len(run.position)
    fine = fine_kernel(kernel)
    quick = fine.velocities(run.position)
    bad = ~run.usable | (np.abs(quick) <= standstill_velocity(run, fine))
    bad[:-1] |= quick[1:] * quick[:-1] < 0.0
    before = np.concatenate([[0], np.cumsum(bad)])
    rows = np.arange(half + 2, n - half - 2, max(half // HOPS, 1))
    return rows[before[rows + half + 1] == before[rows - half]]
