"""A log made ready for a fit: what moved and what moved it, on an even grid, and its equation of motion by windows.

    F = M a + sum over the terms of the friction and the weight

Each term is a constant times a function of velocity, its direction or the position. One number may bend the model, in
which it is not linear: the Stribeck velocity, or the share ``l`` of the effort that a transmission loses, with which
``F - l |F| sign(v)`` takes the place of F, so that all columns grow by ``1 / (1 - l sign(F v))``. A window holds no
sample that is missing, saturated, at standstill or turning round: there friction is whatever holds the axis.

No derivative of a measurement is taken. Both sides of ``F = M q'' + f(q')`` are multiplied with a window ``w`` and
integrated; by parts, the derivatives pass from the measured position to the window, ``int w q'' = int w'' q``, where
they are exact. A window is ``w(s) = (1 - s^2)^4`` within -1 < s < 1: three derivatives vanish at its ends, so that sums
over samples equal integrals far beyond the noise of any measurement. The effort stands between two samples; its
integral is exact. Derivatives are summed over the ways between samples, so that what stands still has none at all, and
not what rounding leaves. Sums run in one order on every processor, which those of BLAS do not.

Shinbrot: On the analysis of linear and nonlinear systems. Trans. ASME 79 (1957), the method of modulating functions.
Messenger, Bortz: Weak SINDy: Galerkin-based data-driven model selection. Multiscale Model. Simul. 19 (2021).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from detent.errors import InputError
from detent.logs.log import Kind, Log, Values

EVEN = 0.2  # distance of samples from an even grid, in its steps, up to which they are on it
GAP = 1.5  # time between two samples, in periods, from which on something is missing between them
FEWEST = 20  # samples below which nothing is said about a log
_MASS = {"N": "kg", "N*m": "kg*m^2"}
Rows = NDArray[np.intp]  # numbers of samples
_SHAPE = np.polynomial.Polynomial([1.0, 0.0, -1.0]) ** 4
FINE, FINEST = 6e-3, 4  # half of the window that tells the direction [s], and its fewest samples
BLOCK = 100_000  # samples of windows that are added up at a time
NOISES = 5.0  # velocity that is told from standstill, in standard deviations of its noise
HOPS = 2  # rows per half window
LOST = 50.0  # exponent of the low-speed friction from which on it is left as it is: nothing
BESIDE = 4  # ways before and behind a jump that tell the usual one
LOSS = "loss"  # named in a model whose transmission loses a share of the effort; it bends the terms, without a column


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """One run on an even grid."""

    name: str  # name of the log
    step: float  # time between two samples [s]
    position: Values  # as measured [m], [rad] or [count]
    effort: Values  # what drives the axis, from each sample to the next
    usable: NDArray[np.bool_]  # samples that mean something
    effort_name: str = "force"  # and effort_unit: what it is
    effort_unit: str = "N"
    position_unit: str = "m"
    reference: Values | None = None  # position asked for
    resolution: float = 0.0  # way of a count of the encoder; 0 where none shows
    noise: float = 0.0  # standard deviation of the measured position, counts included

    @property
    def t(self) -> Values:
        """Time from the first sample [s]."""
        return np.asarray(np.arange(len(self.position)) * self.step, np.float64)

    @property
    def is_rotary(self) -> bool:
        """True where the position is an angle."""
        return self.position_unit == "rad"

    def part(self, begin: int, end: int) -> "Run":
        """Samples from `begin` to before `end`."""
        cut, reference = slice(begin, end), None if self.reference is None else self.reference[begin:end]
        position, effort, usable = self.position[cut], self.effort[cut], self.usable[cut]
        return replace(self, position=position, effort=effort, usable=usable, reference=reference)

    def unit(self, name: str) -> str:
        """Unit of a constant by its name, such as ``viscous.positive``."""
        effort, way = self.effort_unit or "1", self.position_unit
        times = f"{effort}*" if effort != "1" else ""
        units = {
            "mass": _MASS.get(effort, f"{times}s^2/{way}"),
            "viscous": f"{times}s/{way}",
            "stribeck": f"{way}/s",
            "delay": "s",
            "spring": f"{effort}/{way}",
            "loss": "1",
            "hanging": "rad",
        }
        return units.get(name.partition(".")[0], effort)


def make_run(log: Log, effort: str | None = None) -> Run:
    """Put a log on an even grid and choose what drives its axis."""
    name = log.effort(effort or "")
    log.need("position")
    if len(log.t) < FEWEST:
        raise InputError.of_file(log.name, f"{len(log.t)} samples", f"{FEWEST} or more", "record a longer run")
    step = log.period
    samples = math.floor((log.t[-1] - log.t[0]) / step + 0.5) + 1
    grid: Values = np.asarray(log.t[0] + np.arange(samples) * step, np.float64)
    jumps = np.flatnonzero(log.mask(Kind.JUMPS, signals={"position"}))
    position = np.interp(grid, log.t, joined(log.signals["position"], jumps))
    reference = np.interp(grid, log.t, joined(log.signals["reference"], jumps)) if "reference" in log.signals else None
    values, resolution = log.signals[name], find_count(log.signals["position"])
    # What drives stands from each of its samples to the next.
    is_even = len(grid) == len(log.t) and float(np.abs(grid - log.t).max()) < EVEN * step
    places = np.clip(np.searchsorted(log.t, grid + EVEN * step, side="right") - 1, 0, len(log.t) - 1)
    held = (values if is_even else values[places]).astype(np.float64, copy=False)
    units, noise = (log.units[name] or "1", log.units["position"]), max(noise_of(position), 0.29 * resolution)
    usable = _usable(log, grid, name)
    return Run(log.name, step, position, held, usable, name, *units, reference, resolution, noise)


def joined(values: Values, jumps: Rows) -> Values:
    """Values whose ways to some samples are those around them: windows that are left see no jump, however wide."""
    if not len(jumps):
        return values
    ways = np.diff(values)
    for jump in jumps[jumps > 0].tolist():
        around = np.r_[ways[max(jump - 1 - BESIDE, 0) : jump - 1], ways[jump : jump + BESIDE]]
        ways[jump - 1] = float(np.median(around)) if len(around) else 0.0
    return np.concatenate([values[:1], values[0] + np.cumsum(ways)])


def _usable(log: Log, grid: Values, effort: str) -> NDArray[np.bool_]:
    """Grid samples that are not in gaps, filled in, stuck, saturated or without the drive."""
    bad = log.mask(Kind.MISSING_VALUES, Kind.STUCK, Kind.SPIKES, Kind.JUMPS) | log.mask(
        Kind.SATURATED, signals={effort, "position"}
    )
    if effort in {"voltage", "command"} and "enabled" in log.signals:
        # A winding that is switched off does not brake: another axis.
        bad |= log.signals["enabled"] < 0.5
    before = np.clip(np.searchsorted(log.t, grid, side="right") - 1, 0, len(log.t) - 1)
    after = np.clip(before + 1, 0, len(log.t) - 1)
    gap = log.t[after] - log.t[before] > GAP * log.period
    return ~(bad[before] | (gap & (np.abs(grid - log.t[before]) > EVEN * log.period)))


def find_count(position: Values) -> float:
    """Way of a count: the smallest step of a position whose steps are whole multiples of it; 0 where there is none."""
    ways = np.abs(np.diff(position))
    ways = ways[ways > 1e-12 * max(float(np.abs(position).max()), 1e-300)]
    if len(ways) < 10:
        return 0.0
    count = float(np.quantile(ways, 0.01))
    near = ways[ways < 1.5 * count]
    count = float(np.median(near)) if len(near) else count
    rest = np.abs(ways / count - np.round(ways / count))
    return count if float(np.median(rest[ways < 20 * count])) < 0.05 else 0.0


def noise_of(position: Values) -> float:
    """Standard deviation of what is not smooth in a position: its third differences, 20 times their variance apart."""
    third = np.diff(position, 3)
    return float(np.sqrt(np.mean(third**2) / 20.0)) if len(third) else 0.0


# ---- windows


@dataclass(frozen=True, slots=True, eq=False)
class Kernel:
    """Weights of the samples around a place."""

    half: int  # samples to each side; the weights have ``2 half + 1`` entries
    step: float  # time between two samples [s]
    # value, first, second, third: sums of these times a signal are the weighted mean of the signal [1], of its first
    # [1/s], second [1/s^2] and third derivative [1/s^3]
    value: Values
    first: Values
    second: Values
    third: Values

    def held(self, signal: Values, rows: Rows, late: float = 0.0) -> Values:
        """Mean of a signal held from each sample to the next, seen `late` samples later, around samples `rows`."""
        return _sums(signal, _held(self.half, late)[0], rows)

    def held_slope(self, signal: Values, rows: Rows, late: float = 0.0) -> Values:
        """Mean of the first derivative of such a signal [1/s], around samples `rows`."""
        return _sums(signal, _held(self.half, late)[1], rows) / self.step

    def mean(self, signal: Values, rows: Rows) -> Values:
        """Mean of a signal between whose samples straight lines run, around samples `rows`."""
        return _sums(signal, self.value, rows)

    def velocity(self, position: Values, rows: Rows) -> Values:
        """Mean of the first derivative around samples `rows`."""
        return _way_sums(position, self.first, rows)

    def acceleration(self, position: Values, rows: Rows) -> Values:
        """Mean of the second derivative around samples `rows`."""
        return _way_sums(position, self.second, rows)

    def jerk(self, position: Values, rows: Rows) -> Values:
        """Mean of the third derivative around samples `rows`."""
        return _way_sums(position, self.third, rows)

    def velocities(self, position: Values) -> Values:
        """Mean of the first derivative around every sample; wrong for `half` samples at both ends."""
        ways, n = np.pad(np.diff(position), self.half), len(position)
        found = np.zeros(n)
        for k, weight in enumerate(_way_weights(self.first).tolist()):
            found += weight * ways[k : k + n]
        return found


def make_kernel(half: int, step: float) -> Kernel:
    """Weights of a window of some samples."""
    s = np.arange(-half, half + 1) / half
    area = float(np.sum(_SHAPE(s)))
    slope = half * step
    value = _SHAPE(s) / area
    first = -_SHAPE.deriv(1)(s) / (area * slope)
    second = _SHAPE.deriv(2)(s) / (area * slope**2)
    third = -_SHAPE.deriv(3)(s) / (area * slope**3)
    # Sums are no integrals: these make straight lines, parabolas and cubics come out exactly; of the third derivative a
    # straight line gives 0 and a cubic 6.
    t = np.asarray(np.arange(-half, half + 1) * step, np.float64)
    second -= second.mean()
    third -= t * float(np.sum(third * t)) / float(np.sum(t * t))
    second, third = second * (2.0 / float(np.sum(second * (t * t)))), third * (6.0 / float(np.sum(third * t**3)))
    return Kernel(half, step, value, first / float(np.sum(first * t)), second, third)


@cache
def _held(half: int, late: float) -> tuple[Values, Values]:
    """Integral of the window over each sample's stretch, `late` samples after it began; and its change, per sample."""
    reach = half + 1 + int(np.ceil(abs(late)))
    edges = np.clip((np.arange(-reach, reach + 2) + late) / half, -1.0, 1.0)
    rise = _SHAPE.integ()
    weights, area = np.diff(rise(edges)), float(rise(1.0) - rise(-1.0)) * half
    return weights / weights.sum(), -np.diff(_SHAPE(edges)) / area


def _sums(signal: Values, weights: Values, rows: Rows) -> Values:
    """Weighted sum around each of some samples; the signal keeps its end values beyond its ends."""
    half = len(weights) // 2
    if _are_inside(rows, half, len(signal)):
        return _weighted(signal, weights, rows - half)
    return _weighted(np.concatenate([np.full(half, signal[0]), signal, np.full(half, signal[-1])]), weights, rows)


def _way_sums(position: Values, weights: Values, rows: Rows) -> Values:
    """The same for weights that add up to 0, by the ways between samples."""
    half, ways = len(weights) // 2, np.diff(position)
    if _are_inside(rows, half, len(position)):
        return _weighted(ways, _way_weights(weights), rows - half)
    return _weighted(np.pad(ways, half), _way_weights(weights), rows)


def _are_inside(rows: Rows, half: int, count: int) -> bool:
    """True where a signal of so many samples need not be continued beyond its ends: that would be a copy of it."""
    return len(rows) > 0 and half <= int(rows.min()) and int(rows.max()) < count - half


def _way_weights(weights: Values) -> Values:
    """Weights of the ways between samples, added up from the nearer end: those of the first derivative are positive."""
    half = len(weights) // 2
    return np.concatenate([-np.cumsum(weights[:half]), np.cumsum(weights[:half:-1])[::-1]])


def _weighted(padded: Values, weights: Values, rows: Rows) -> Values:
    """Weighted sums of what begins at some samples."""
    # A few windows at a time, which a processor holds; they are added up the same way as all at once.
    windows = np.lib.stride_tricks.sliding_window_view(padded, len(weights))
    found, count = np.empty(len(rows)), max(BLOCK // len(weights), 1)
    for first in range(0, len(rows), count):
        taken = windows[rows[first : first + count]]
        taken *= weights
        taken.sum(axis=1, out=found[first : first + count])
    return found


# ---- the equation of motion


@dataclass(frozen=True, eq=False)
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

    def taken(self, keep: NDArray[np.bool_]) -> "Motion":
        """Some of the windows."""
        names = ("position", "velocity", "acceleration", "right", "left", "rows")
        return replace(self, **{name: getattr(self, name)[keep] for name in names})

    # Every model that is tried asks for these, and they are the same for all.

    @cached_property
    def jerk(self) -> Values:
        """Third derivative of the position [m/s^3] or in rad."""
        return self.kernel.jerk(self.places, self.rows)

    @cached_property
    def sine(self) -> Values:
        """Mean of the sine of the position."""
        return self.kernel.mean(np.sin(self.places), self.rows)

    @cached_property
    def cosine(self) -> Values:
        """Mean of its cosine."""
        return self.kernel.mean(np.cos(self.places), self.rows)

    @cached_property
    def slowest(self) -> tuple[Values, Values]:
        """Lowest speed within each window to larger positions, and to smaller ones; infinite where there is none."""
        half, found = self.kernel.half, list[Values]()
        for speed in (self.quick, -self.quick):
            moving = np.lib.stride_tricks.sliding_window_view(np.where(speed > 0.0, speed, np.inf), 2 * half + 1)
            blocks = np.array_split(self.rows - half, 1 + len(self.rows) * (2 * half + 1) // BLOCK)
            found.append(np.concatenate([moving[block].min(axis=1) for block in blocks]))
        return found[0], found[1]

    @cached_property
    def driving(self) -> tuple[Values, Values]:
        """Shares of each window in which the effort acts along the motion, and against it."""
        with_motion = np.sign(self.effort) * np.sign(self.quick)
        along, against = (self.kernel.mean((with_motion == sign).astype(float), self.rows) for sign in (1.0, -1.0))
        return along, against


def fine_kernel(kernel: Kernel) -> Kernel:
    """The short window that tells the direction."""
    return make_kernel(min(kernel.half, max(FINEST, round(FINE / kernel.step))), kernel.step)


def make_motion(position: Values, effort: Values, kernel: Kernel, rows: Rows, quick: Values | None = None) -> Motion:
    """Position, velocity and acceleration by a window; `quick` is the velocity by `fine_kernel`, where it is known."""
    quick = fine_kernel(kernel).velocities(position) if quick is None else quick
    still = 0.5 * (quick == 0.0)
    right, left = (kernel.mean(way + still, rows) for way in (quick > 0.0, quick < 0.0))
    place, acceleration = kernel.mean(position, rows), kernel.acceleration(position, rows)
    velocity = kernel.velocity(position, rows)
    return Motion(place, velocity, acceleration, right, left, quick, position, effort, rows, kernel)


Term = Callable[[Motion, float], Values]
"""What multiplies a constant, window by window; the number is the Stribeck velocity, for terms that have one."""


def _bristle(m: Motion, stribeck: float, sense: int) -> Values:
    """Part of the low-speed friction that is left at each sample, in one direction."""
    # Most windows see nothing slow: what is left in them is `LOST`, as long as they go this way.
    way, least = (m.right, m.slowest[0]) if sense > 0 else (m.left, m.slowest[1])
    found, quickest = math.exp(-LOST) * way, 1.01 * math.sqrt(LOST) * stribeck
    seen = least < quickest
    speed = m.quick if sense > 0 else -m.quick
    slow = np.flatnonzero((speed > 0.0) & (speed < quickest))
    left = np.where(speed > 0.0, math.exp(-LOST), 0.0)
    left[slow] = np.exp(-np.minimum((speed[slow] / stribeck) ** 2, LOST))
    found[seen] = m.kernel.mean(left, m.rows[seen])
    return sense * found


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
    "pendulum": lambda m, _: m.sine,
    "pendulum.across": lambda m, _: m.cosine,
    "spring": lambda m, _: m.position,
}
"""Every term of an equation of motion; `excess` is static less Coulomb friction."""


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
    along, against = m.driving
    return columns * (1.0 + along * (bend / (1.0 - bend)) - against * (bend / (1.0 + bend)))[:, None]


def standstill_velocity(run: Run, kernel: Kernel) -> float:
    """Velocity below which a window cannot tell motion from noise [m/s]."""
    noise = run.noise * math.sqrt(float(np.sum(kernel.first**2)))
    count = run.resolution / (2.0 * kernel.half * run.step)
    return max(NOISES * noise, 0.5 * count)


def usable_rows(run: Run, kernel: Kernel, quick: Values | None = None) -> Rows:
    """Samples, evenly spaced, around which the equation of motion holds for a whole window; `quick` as of a motion."""
    half, n = kernel.half, len(run.position)
    fine = fine_kernel(kernel)
    quick = fine.velocities(run.position) if quick is None else quick
    bad = ~run.usable | (np.abs(quick) <= standstill_velocity(run, fine))
    bad[:-1] |= quick[1:] * quick[:-1] < 0.0
    before = np.concatenate([[0], np.cumsum(bad)])
    rows = np.arange(half + 2, n - half - 2, max(half // HOPS, 1))
    return rows[before[rows + half + 1] == before[rows - half]]
