"""Constants of an equation of motion from runs, by least squares or by instruments, with limits for coloured residuals.

An effort that acts ``d`` later than recorded is ``F(t - d) = F - d F'`` to first order, so that `d` is a constant of
the column ``F'``; a few rounds find it exactly.

Measured positions appear on the side of the columns, with their noise; and in a closed loop the effort answers to that
noise. Least squares are then biased. The reference, where it was recorded, knows nothing of either: with columns of it
as instruments, ``theta = (Z' X)^-1 Z' y``, the bias is gone (Soderstrom, Stoica: Instrumental variable methods for
system identification (1983); Janot, Vandanjon, Gautier: A generic instrumental variable approach for industrial robot
identification. IEEE Trans. Control Systems Technology 22 (2014)). Where there is none, columns of the position by wider
windows take its place: those 2.5 times as wide hold 2.6 % of the white noise in the second derivative.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from detent.identify.fit import equations
from detent.identify.fit.equations import Run, make_motion
from detent.identify.fit.estimate import RANK, carried_degrees, coloured_covariance, column_sizes, independent_rows, rms
from detent.logs.differences import MOST_ROWS
from detent.logs.log import Values

Instruments = Literal["reference", "position", "none"]

WIDER = 2.5  # width of the windows that are instruments where there is no reference, in those of the columns
ENDS = 0.1  # share of a run that half of such a window takes at most: rows closer to the ends are lost
ROUNDS = 8  # rounds in which the delay of the effort is found, at most
SHARED = 1e-3  # part of a constant in a sum that nothing tells, from which on it is not told
UNKNOWN = 1e6  # standard error, in largest efforts, of a constant that nothing in the log excites


@dataclass(frozen=True, eq=False)
class Prepared:
    """A run with its windows, of which the columns of any model are made."""

    run: Run
    motion: equations.Motion  # of the measured position
    # what instruments are made of: the motion of the reference, as late as the axis follows it; that of the position by
    # wider windows; or `motion` itself, which is least squares
    ideal: equations.Motion
    instruments: Instruments  # which of these: "reference", "position" or "none"

    def effort(self, delay: float) -> Values:
        """Effort over the windows that acts `delay` [s] later than recorded, shape (m,)."""
        return self._undelayed[0] if delay == 0.0 else self._held(delay)

    def slope(self, delay: float) -> Values:
        """Its first derivative, likewise."""
        return self._undelayed[1] if delay == 0.0 else self._held_slope(delay)

    @cached_property
    def _undelayed(self) -> tuple[Values, Values]:
        """Both without a delay, which the search for it begins with in every model."""
        return self._held(0.0), self._held_slope(0.0)

    def _held(self, delay: float) -> Values:
        return self.motion.kernel.held(self.run.effort, self.motion.rows, delay / self.run.step)

    def _held_slope(self, delay: float) -> Values:
        return self.motion.kernel.held_slope(self.run.effort, self.motion.rows, delay / self.run.step)


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """Outcome of a regression."""

    # terms of the model that have a column; then ``delay``, that of the effort [s]; then ``stribeck`` or ``loss`` where
    # the model has one
    names: tuple[str, ...]
    values: Values  # their constants
    covariance: Values  # of these
    degrees: Values  # degrees of freedom behind the variance of each
    residual: Values  # and effort: measured less fitted effort, and the effort, window by window
    effort: Values
    model: tuple[str, ...]  # what the model was asked for
    condition: float  # condition number of the columns at unit length
    instruments: Instruments  # what they are made of: "reference", "position", or "none" for least squares
    is_settled: bool = True  # False where no delay was found at which the effort asks for no other

    @property
    def bend(self) -> float:
        """Stribeck velocity, or share lost; 1 for a model with neither."""
        return float(self.values[-1]) if equations.is_bent(self.model) else 1.0

    def error(self, name: str) -> float:
        """Standard error of a constant."""
        k = self.names.index(name)
        return float(np.sqrt(max(self.covariance[k, k], 0.0)))

    def value(self, name: str) -> float:
        """Constant of a term; 0 where the model does not have it."""
        return float(self.values[self.names.index(name)]) if name in self.names else 0.0


@dataclass(frozen=True, slots=True)
class Residuals:
    """What is left of the effort when the model has explained its part, window by window."""

    rms: float  # root mean square, in the unit of the effort
    relative: float  # the same over the root mean square of the effort
    largest: float  # largest magnitude
    # correlation of neighbours: 0 for independent ones; windows overlap, which alone makes it about 0.4; near 1 the
    # model misses something that lasts: friction that changes with position, a missing constant, a clock that is wrong
    neighbours: float
    independent: float  # independent residuals that say as much
    count: int  # windows


def residuals_of(fit: Fit) -> Residuals:
    """Look at the residuals of a fit."""
    e = fit.residual
    power, effort = float(e @ e), rms(fit.effort)
    size = float(np.sqrt(power / len(e)))
    neighbours = float(e[1:] @ e[:-1]) / power if power > 0.0 else 0.0
    relative = size / effort if effort > 0.0 else 0.0
    return Residuals(size, relative, float(np.abs(e).max()), neighbours, independent_rows(e), len(e))


def prepare(run: Run, kernel: equations.Kernel, instruments: Instruments, like: Prepared | None = None) -> Prepared:
    """Make the windows of a run; `like` is the same by other windows, of which what no window changes is taken."""
    fine, n = equations.fine_kernel(kernel), len(run.position)
    if like is None or like.instruments != instruments or equations.fine_kernel(like.motion.kernel).half != fine.half:
        like = None
    quick = like.motion.quick if like else fine.velocities(run.position)
    rows = equations.usable_rows(run, kernel, quick)
    if instruments == "position":
        wide = equations.make_kernel(max(min(round(WIDER * kernel.half), round(ENDS * n)), kernel.half), run.step)
        rows = rows[(rows > wide.half) & (rows < n - wide.half)]
        known = quick if equations.fine_kernel(wide).half == fine.half else None
        ideal = make_motion(run.position, run.effort, wide, rows, known)
        return Prepared(run, make_motion(run.position, run.effort, kernel, rows, quick), ideal, instruments)
    motion = ideal = make_motion(run.position, run.effort, kernel, rows, quick)
    if like and like.ideal is not like.motion:
        ideal = make_motion(like.ideal.places, run.effort, kernel, rows, like.ideal.quick)
    elif like is None and instruments == "reference" and run.reference is not None:
        lag = lag_of(run.reference, run)
        delayed = np.concatenate([np.full(lag, run.reference[0]), run.reference[: n - lag]])
        ideal = make_motion(delayed, run.effort, kernel, rows)
    return Prepared(run, motion, ideal, instruments)


def lag_of(reference: Values, run: Run) -> int:
    """Samples by which the position follows the reference: where their changes agree best."""
    asked, done = reference - reference[0], run.position - run.position[0]
    most = max(min(round(0.25 / run.step), len(asked) // 4), 1)
    lags, every = range(0, most, max(1, most // 100)), max(1, len(asked) // MOST_ROWS)
    miss = [float(np.abs(done[lag::every] - asked[: len(asked) - lag : every]).mean()) for lag in lags]
    return lags[int(np.argmin(miss))]


def make_columns(parts: Sequence[Prepared], names: Sequence[str], bend: float, *, ideal: bool = False) -> Values:
    """Columns of a model over all windows, shape (m, k)."""
    motions = [p.ideal if ideal else p.motion for p in parts]
    return np.concatenate([equations.model_columns(m, names, bend) for m in motions])


def make_effort(parts: Sequence[Prepared], delay: float) -> Values:
    """Effort that acts `delay` [s] later than recorded, over all windows, shape (m,)."""
    return np.concatenate([p.effort(delay) for p in parts])


class Solved(NamedTuple):
    """The equations of a model solved, and what they consist of."""

    theta: Values  # constants of the terms that have a column
    late: float  # delay of the effort [s]
    is_settled: bool  # False where no delay was found at which the effort asks for no other
    effort: Values  # over all windows, by that delay
    columns: Values  # of the terms, and what the instruments say of them
    ideal: Values
    x: Values  # the same with that of the delay
    z: Values


def solve_equations(parts: Sequence[Prepared], names: Sequence[str], bend: float = 1.0) -> Solved:
    """Constants and delay of a model at a bend; no errors of these."""
    columns = make_columns(parts, names, bend)
    ideal = make_columns(parts, names, bend, ideal=True) if parts[0].instruments != "none" else columns
    late, step, is_settled = 0.0, parts[0].run.step, False
    y = make_effort(parts, late)
    theta = solve(ideal, columns, y)
    x, z = _with_delay(parts, names, theta, late, columns, ideal)
    for _ in range(ROUNDS):
        found = solve(z, x, y)
        theta = found[:-1]
        moved = float(np.clip(found[-1], -5 * step, 5 * step))
        is_settled = abs(moved) < 5 * step
        if abs(moved) < 1e-3 * step:
            break
        late += moved
        y = make_effort(parts, late)
        x, z = _with_delay(parts, names, theta, late, columns, ideal)
    return Solved(theta, late, is_settled, y, columns, ideal, x, z)


def fit_equations(parts: Sequence[Prepared], names: Sequence[str], bend: float = 1.0) -> Fit:
    """Fit a model to runs; `bend` is the Stribeck velocity [m/s] or the share lost, where the model has one."""
    theta, late, is_settled, y, columns, _, x, z = solve_equations(parts, names, bend)
    residual = y - combine(columns, theta)
    x, z = _with_bend(parts, names, theta, bend, x, z)
    covariance, cosines = coloured_covariance(x, residual, z)
    # Constants that the columns cannot tell: absent, or one with others.
    _, singular, ways = np.linalg.svd(products(z / column_sizes(z), x / column_sizes(x)))
    unknown = np.flatnonzero((np.abs(ways[singular <= RANK * singular[0]]) > SHARED).any(axis=0))
    covariance[unknown, unknown] = (UNKNOWN * float(np.abs(y).max())) ** 2
    singular = np.linalg.svd(columns / column_sizes(columns), compute_uv=False)
    bends = ("loss" if equations.LOSS in names else "stribeck",) if equations.is_bent(names) else ()
    told, values = (*equations.terms_of(names), "delay", *bends), [*theta.tolist(), late, *([bend] if bends else [])]
    degrees, condition = carried_degrees(x, residual, z, cosines), float(singular[0] / max(singular[-1], 1e-300))
    way = parts[0].instruments
    return Fit(told, np.array(values), covariance, degrees, residual, y, tuple(names), condition, way, is_settled)


def columns_of(parts: Sequence[Prepared], fit: Fit) -> tuple[Values, Values, Values]:
    """Columns and instruments of a fit, that of the delay last, and the effort it explains."""
    names, late = fit.model, fit.value("delay")
    columns = make_columns(parts, names, fit.bend)
    ideal = make_columns(parts, names, fit.bend, ideal=True) if fit.instruments != "none" else columns
    theta = fit.values[: len(equations.terms_of(names))]
    return *_with_delay(parts, names, theta, late, columns, ideal), make_effort(parts, late)


def _with_delay(  # noqa: PLR0913 - all that a model consists of
    parts: Sequence[Prepared], names: Sequence[str], theta: Values, late: float, columns: Values, ideal: Values
) -> tuple[Values, Values]:
    """Columns and instruments with that of the delay."""
    x = np.column_stack([columns, np.concatenate([p.slope(late) for p in parts])])
    if ideal is columns:
        return x, x
    # What the instruments say of the effort's derivative, once mass and viscous friction are roughly known.
    known = dict(zip(equations.terms_of(names), theta.tolist(), strict=True))
    mass, viscous = known["mass"] or 1.0, max(known.get("viscous", known.get("viscous.positive", 0.0)), 0.0)
    motions = [p.ideal for p in parts]
    tool = np.concatenate([mass * m.jerk + viscous * m.acceleration for m in motions])
    return x, np.column_stack([ideal, tool])


def _with_bend(  # noqa: PLR0913 - all that a model consists of
    parts: Sequence[Prepared], names: Sequence[str], theta: Values, bend: float, x: Values, z: Values
) -> tuple[Values, Values]:
    """Columns and instruments with that of the bend: what is not known of it widens the limits of the others."""
    if not equations.is_bent(names):
        return x, z
    slopes: list[Values] = []  # change of the effort with the bend, by the motion and by the instruments
    for ideal in (False, z is not x):
        more, less = (combine(make_columns(parts, names, bend * f, ideal=ideal), theta) for f in (1.05, 0.95))
        slopes.append((more - less) / (0.1 * bend))
    return np.column_stack([x, slopes[0]]), np.column_stack([z, slopes[1]])


def bend_correction(parts: Sequence[Prepared], names: Sequence[str], bend: float) -> float:
    """By how much a bend misses what the instruments say of it, to first order."""
    found = solve_equations(parts, names, bend)
    x, z = _with_bend(parts, names, found.theta, bend, found.columns, found.ideal)
    return float(solve(z, x, found.effort - combine(found.columns, found.theta))[-1])


def solve(instruments: Values, columns: Values, effort: Values) -> Values:
    """Constants ``(Z' X)^-1 Z' y``, worked out with columns of unit length; least squares where Z is X."""
    size, length = column_sizes(columns), column_sizes(instruments)
    tools = instruments / length
    matrix, moments = products(tools, columns / size), products(tools, effort[:, None])[:, 0]
    found, *_ = np.linalg.lstsq(matrix, moments, rcond=RANK)
    return found / size


def products(a: Values, b: Values) -> Values:
    """``A' B``, each sum in one order on every processor, which BLAS does not promise."""
    right = np.ascontiguousarray(b.T)
    return np.array([(right * column).sum(axis=1) for column in np.ascontiguousarray(a.T)])


def combine(columns: Values, constants: Values) -> Values:
    """``X theta``, likewise."""
    return np.asarray((columns * constants).sum(axis=1), np.float64)
