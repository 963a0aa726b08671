"""Friction versus speed: effort less its inertia part, averaged per bin of speed and direction.

What remains of the effort of an axis when ``mass * acceleration`` is taken away is friction, whatever its law, with any
constant force. It is averaged in bins of speed, finer towards rest, where friction changes most. Without a mass only
steady stretches are used (`two_speeds`).

The residual about such an average is coloured: friction depends on the position, and filters smear noise. The recording
is therefore cut into windows much longer than its residual remembers; what one window adds to a bin counts as one
observation, and the interval of the bin comes from the scatter of the windows (ratio estimator of cluster sampling:
Cochran, Sampling Techniques, 3rd ed. 1977, 6.3). Stribeck's dip (friction that falls from its value at the lowest speed
before it rises) is told where the lowest bin lies above another by more than chance would make any of them.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from detent.errors import DetentError
from detent.identify.analyse.two_speeds import find_steady, find_velocity
from detent.identify.fit.chance import student_reach
from detent.identify.fit.estimate import LEVEL, Estimate, estimate, quantile
from detent.logs.differences import grain, products_of, smooth, window_rows
from detent.logs.log import Log, Values

FEWEST_WINDOWS = 5.0  # independent windows of a bin, at least
MEMORIES = 10  # length of a window, in memories of the residual
RANGE = 40.0  # highest over lowest speed of the map, at most
OVER_NOISE = 5.0  # lowest speed of the map, at least, in standard deviations of the noise of the velocity


@dataclass(frozen=True, slots=True)
class Dip:
    """Whether friction falls from its value at the lowest speed, in one direction."""

    direction: str  # ``"positive"`` or ``"negative"``
    is_found: bool  # True where it does, significantly
    # friction of the lowest bin less that of the smallest, as magnitudes; None where there are not two bins
    depth: Estimate | None
    speed: float  # where friction is smallest; nan without a depth


@dataclass(frozen=True, slots=True, eq=False)
class FrictionMap:
    """Friction versus speed; arrays of shape (k,), one entry per bin that was accepted, by rising velocity."""

    effort: str  # and unit, speed_unit: role and unit of what drives, unit of the speed
    unit: str
    speed_unit: str
    mass: float  # by how much the effort rises with the acceleration; 0 where only steady stretches were used
    speed: Values  # and friction: mean velocity and friction of the bins, signed
    friction: Values
    error: Values  # and low, high: standard error and 95 % interval of the friction
    low: Values
    high: Values
    windows: Values  # and samples: independent windows, and samples, behind each
    samples: Values
    dips: tuple[Dip, ...] = ()  # one for each direction
    refused: tuple[str, ...] = ()  # bins that have samples, but too few windows
    reason: str = ""  # why there is no map; empty where there is one


def map_friction(log: Log, effort: str = "", mass: float = 0.0, bins: int = 10) -> FrictionMap:
    """Average the friction of a recording per bin of speed and direction; without `mass`, of steady stretches only."""
    if not mass >= 0 or not np.isfinite(mass):
        raise DetentError(
            f"friction map: got a mass of {mass:g}; expected: 0 or above; 0 uses constant-speed segments only"
        )
    if bins < 1:
        raise DetentError(f"friction map: got {bins} bins; expected: at least 1; ten are typical")
    role = log.effort(effort)
    _, speed_unit, _ = find_velocity(log)
    moving = _driven(log, role, mass) if mass > 0 else _steady(log, role)
    none = np.empty(0)
    nothing = FrictionMap(role, log.units[role], speed_unit, mass, none, none, none, none, none, none, none)
    if not len(moving.place):
        steady = "no constant speed in this log; record passes at constant speeds, or state the mass"
        driven = "the axis does not move in this log; record back-and-forth moves at several speeds"
        return replace(nothing, reason=driven if mass > 0 else steady)
    averages = _averages(moving, bins)
    found = [one for one in averages if one.windows >= FEWEST_WINDOWS]
    refused = tuple(
        f"about {one.speed:.3g} {speed_unit}: {one.samples} samples are worth {one.windows:.1f} independent "
        f"windows, not {FEWEST_WINDOWS:.0f}; record this speed for longer or more often"
        for one in averages
        if one.windows < FEWEST_WINDOWS
    )
    if not found:
        reason = "no speed was held long enough for a confidence interval; record longer, or each speed more often"
        return replace(nothing, refused=refused, reason=reason)
    speed, friction, error, windows, samples = np.array(found, dtype=np.float64).T
    reach = error * np.array([quantile(one.windows - 1.0) for one in found])
    limits = (friction - reach, friction + reach)
    dips = tuple(_dip(name, found, nothing.unit) for name in ("positive", "negative"))
    return FrictionMap(
        role, nothing.unit, speed_unit, mass, speed, friction, error, *limits, windows, samples, dips, refused
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Moving:
    """Samples in motion: place in the log, velocity, effort less inertia, each of shape (m,); lowest speed to trust."""

    place: NDArray[np.int64]
    v: Values
    friction: Values
    lowest: float


def _steady(log: Log, role: str) -> _Moving:
    """Samples of steady stretches, each at the mean speed of its stretch."""
    velocity, _, step = find_velocity(log)
    parts = find_steady(log.t, velocity, step)
    place = [np.arange(part.start, part.stop, dtype=np.int64) for part in parts]
    speed = [np.full(part.stop - part.start, velocity[part].mean()) for part in parts]
    index = np.concatenate([np.empty(0, dtype=np.int64), *place])
    return _Moving(index, np.concatenate([np.empty(0), *speed]), log.signals[role][index], 0.0)


def _driven(log: Log, role: str, mass: float) -> _Moving:
    """Samples in motion, velocity and acceleration by a parabola through a window about each."""
    is_placed = "position" in log.signals
    base = log.signals["position" if is_placed else "velocity"]
    rows = 2 * window_rows(base) + 1
    place, (value, slope, curvature) = smooth(base, log.t, rows)
    v, a = (slope, curvature) if is_placed else (value, slope)
    f = smooth(log.signals[role], log.t, rows)[1][0]
    top = float(np.abs(v).max(initial=0.0))
    # Standard deviation of the slope (of a position) or mean (of a velocity) of a window.
    per_grain = float(np.sqrt(12.0 / rows**3)) / log.period if is_placed else 1.5 / float(np.sqrt(rows))
    noise = grain(base) * per_grain
    lowest = max(top / RANGE, OVER_NOISE * noise)
    # A window that reaches into rest or a reversal mixes the effort of two directions.
    kept = np.convolve(np.abs(v) <= 0.5 * lowest, np.ones(rows), "same") <= 0.5
    return _Moving(place[kept], v[kept], (f - mass * a)[kept], lowest)


class _Bin(NamedTuple):
    """Mean velocity and friction of a bin, standard error, independent windows, samples."""

    speed: float
    friction: float
    error: float
    windows: float
    samples: int


def _averages(moving: _Moving, bins: int) -> list[_Bin]:
    """Mean friction of each bin of speed and direction."""
    size = np.abs(moving.v)
    top = float(size.max())
    edges = np.geomspace(min(max(moving.lowest, top / RANGE), 0.9 * top), top * (1.0 + 1e-9), bins + 1)
    # Number of the bin of each sample, from 1, negative in negative direction; 0 below the lowest speed.
    member = (np.searchsorted(edges, size, side="right") * np.sign(moving.v)).astype(np.int64)
    used = member != 0
    numbers, which = np.unique(member[used], return_inverse=True)
    value = moving.friction[used]
    residual = value - (np.bincount(which, value) / np.bincount(which))[which]
    # A window is many times what the residual about the means of the bins remembers.
    window = moving.place // max(1, round(MEMORIES * memory_rows(residual, moving.place[used])))
    insides = [member == number for number in numbers.tolist()]
    return [_average(moving.v[inside], moving.friction[inside], window[inside]) for inside in insides]


def memory_rows(residual: Values, place: NDArray[np.int64]) -> float:
    """Rows that a residual remembers: ``1 + 2 sum rho_k`` up to a lag of five times itself (Sokal's window)."""
    power = float(residual @ residual)
    if not len(residual) or power <= 0.0:
        return 1.0
    first = int(place[0])
    rows = int(place[-1]) - first + 1
    series, mask = np.zeros(rows), np.zeros(rows)
    series[place - first], mask[place - first] = residual, 1.0
    products, pairs = (products_of(x, x)[rows - 1 :] for x in (series, mask))
    known = pairs > 0.5
    rho = np.where(known, products / np.maximum(pairs, 1.0), 0.0) * len(residual) / power
    memory = 2.0 * np.cumsum(rho) - 1.0
    enough = np.flatnonzero(np.arange(rows) >= 5.0 * memory)
    return max(1.0, float(memory[enough[0] if len(enough) else -1]))


def _average(v: Values, friction: Values, window: NDArray[np.int64]) -> _Bin:
    """Mean friction of a bin, its windows taken as clusters."""
    _, which = np.unique(window, return_inverse=True)
    count = np.bincount(which).astype(np.float64)
    total = float(count.sum())
    mean = float(friction.mean())
    excess = np.bincount(which, friction - mean)
    independent = total**2 / float(count @ count)
    spread = independent / (independent - 1.0) if independent > 1.0 else 1.0
    error = float(np.sqrt(spread * (excess @ excess))) / total
    return _Bin(float(v.mean()), mean, error, independent, len(v))


def _dip(direction: str, found: list[_Bin], unit: str) -> Dip:
    """Stribeck's dip of one direction: the lowest bin against the smallest, which is one of several."""
    sign = 1.0 if direction == "positive" else -1.0
    bins = sorted((one for one in found if one.speed * sign > 0), key=lambda one: abs(one.speed))
    if len(bins) < 2:
        return Dip(direction, is_found=False, depth=None, speed=np.nan)
    lowest, others = bins[0], bins[1:]
    least = min(others, key=lambda one: one.friction * sign)
    depth = (lowest.friction - least.friction) * sign
    error = float(np.hypot(lowest.error, least.error))
    degrees = min(lowest.windows, least.windows) - 1.0
    # One-sided, and as many times as there are bins to choose the smallest from (Bonferroni).
    limit = student_reach((1.0 - LEVEL) / len(others), degrees)
    name, method = f"stribeck.{direction}", f"friction map, {len(bins)} bins"
    return Dip(
        direction, depth > limit * error, estimate(name, depth, unit, error, method, degrees), float(least.speed)
    )
