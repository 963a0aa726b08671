"""Slope and friction per direction from runs at two steady speeds or more.

An axis that moves at a steady speed needs no effort for its mass: what is left is friction and what grows with the
speed. Two speeds of a direction give both, the claim of the print head (US 4,775,945),

    slope = (F1 - F2) / (v1 - v2),    coulomb = direction * (F1 - slope * v1).

More speeds give the line through all stretches, each weighted by its length. What the slope is depends on the effort:
viscous friction of a force or torque; of a current, that over the torque constant; of a voltage or a duty cycle, the
back-EMF constant and the resistance's share of viscous friction. The friction of a direction holds any constant force
in it. The error of each stretch is that of its mean with coloured residuals; where more than two segments scatter
about the line by more than that, the scatter between stretches is added, and said.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from detent.errors import DetentError
from detent.identify.fit.chance import fisher_tail
from detent.identify.fit.estimate import Estimate, coloured_covariance, estimate
from detent.identify.fit.search import root_within
from detent.logs.differences import grain
from detent.logs.log import Log, Values
from detent.logs.stamps import stretches

BLOCKS = 10  # blocks, at least, of which a steady stretch is made
FEWEST_ROWS = 50  # rows of a steady stretch, at least
SHARE = 0.004  # the same as a part of the recording
TOLERANCE = 0.05  # difference of the speeds of a steady stretch, as a part of their mean
SLOWEST = 0.003  # speeds below this part of the highest are rest
DRIFT = 0.1  # difference of the mean speeds of both halves of a stretch that is none, as a part of the tolerance
STANDS_OUT = 3.0  # standard deviations by which the first or last block differs where the speed is still settling there
APART = 0.1  # difference of the highest and lowest speed, at least, as a part of the highest
ROUNDS = 3  # times that weights and line are computed in turn: the errors of the stretches depend on the slope
UNLIKELY = 0.05  # probability of the scatter about the line below which it is more than the errors of the stretches
DIRECTIONS = {"positive": 1.0, "negative": -1.0}


@dataclass(frozen=True, slots=True)
class SteadyStretch:
    """A part of a recording at one speed."""

    first: int  # and stop: first sample, and the one behind the last
    stop: int
    begin: float  # and seconds: where it lies in time and how long it is [s]
    seconds: float  # [s]
    speed: float  # and effort: means, signed, in SI units
    effort: float
    # standard error of the mean effort at this speed: what noise of the speed does to it is part of it
    effort_error: float
    degrees: float  # degrees of freedom behind it


def find_velocity(log: Log) -> tuple[Values, str, float]:
    """Velocity as measured, or by central differences of the position; its unit; the grain of that position, or 0."""
    if "velocity" in log.signals:
        return log.signals["velocity"], log.units["velocity"], 0.0
    log.need("position")
    if len(log) < 3:
        raise DetentError(f"{log.name}: got {len(log)} samples; expected: at least 3; record longer")
    position = log.signals["position"]
    return np.gradient(position, log.t), f"{log.units['position']}/s", grain(position)


def find_steady(t: Values, velocity: Values, step: float = 0.0) -> list[slice]:
    """Find the stretches of a recording in which the axis moves at a steady speed.

    A stretch is as many short blocks in a row whose mean speeds stay within the tolerance, without those at its ends
    that stand out; one whose halves differ is none. What is left is searched again with blocks twice as long, in which
    the grain of an encoder counts less; neighbours that are steady as one become one.
    """
    if len(t) < 2:
        return []
    period = float(np.median(np.diff(t)))
    block = max(1, round(max(FEWEST_ROWS, round(SHARE * len(t))) / BLOCKS))
    rest, found = stretches(t), list[slice]()
    size = block
    while size * (BLOCKS + 2) <= len(t):
        top = float(np.abs(_block_means(velocity, slice(0, len(velocity)), size)).max())
        slowest = max(SLOWEST * top, 2.0 * step / (TOLERANCE * size * period))
        new = [part for free in rest for part in _search(velocity, free, size, slowest)]
        found += new
        rest = [piece for free in rest for piece in _without(free, new)]
        size *= 2
    found.sort(key=lambda part: int(part.start))
    return _joined(velocity, found, stretches(t), block)


def measure_stretch(t: Values, velocity: Values, effort: Values, part: slice, slope: float) -> SteadyStretch:
    """Mean speed and effort of a stretch, and the error of the effort at that speed."""
    speed, drive = float(velocity[part].mean()), float(effort[part].mean())
    error, degrees = mean_error(effort[part] - slope * velocity[part])
    seconds = float(t[part.stop - 1] - t[part.start])
    return SteadyStretch(part.start, part.stop, float(t[part.start]), seconds, speed, drive, error, degrees)


def mean_error(values: Values) -> tuple[float, int]:
    """Standard error of a mean of coloured values, and the degrees of freedom behind it."""
    covariance, degrees = coloured_covariance(np.ones((len(values), 1)), values - values.mean())
    return float(np.sqrt(covariance[0, 0])), degrees


def _search(velocity: Values, free: slice, block: int, slowest: float) -> list[slice]:
    """Stretches in a part without gaps, by blocks of some rows."""
    speeds = _block_means(velocity, free, block)
    found: list[slice] = []
    first = 0
    while first + BLOCKS + 2 <= len(speeds):
        # The first block behind `first` that is not of the same speed as those before it.
        rest = speeds[first:]
        spread = np.maximum.accumulate(rest) - np.minimum.accumulate(rest)
        is_other = spread > TOLERANCE * np.abs(np.cumsum(rest)) / np.arange(1, len(rest) + 1)
        stop = first + (int(np.argmax(is_other)) if is_other.any() else len(rest))
        kept = _trimmed(speeds, first, stop) if abs(speeds[first]) > slowest else None
        if kept is None:
            first += max(1, (stop - first) // BLOCKS)
        else:
            found.append(slice(free.start + kept[0] * block, free.start + kept[1] * block))
            first = stop
    return found


def _block_means(velocity: Values, part: slice, block: int) -> Values:
    count = (part.stop - part.start) // block
    return velocity[part][: count * block].reshape(count, block).mean(axis=1)


def _trimmed(speeds: Values, first: int, stop: int) -> tuple[int, int] | None:
    """First block and block behind the last of the steady part of a run; None where nothing long enough is left."""
    while stop - first > BLOCKS and _stands_out(speeds[first], speeds[first + 1 : stop]):
        first += 1
    while stop - first > BLOCKS and _stands_out(speeds[stop - 1], speeds[first : stop - 1]):
        stop -= 1
    # Within the tolerance, the blocks at the ends may still hold the edge of a ramp with its effort of acceleration.
    first, stop = first + 1, stop - 1
    return None if stop - first < BLOCKS or _drifts(speeds[first:stop]) else (first, stop)


def _drifts(speeds: Values) -> bool:
    """True where the halves of a run differ by more than the scatter of its blocks explains."""
    half = len(speeds) // 2
    drift = abs(float(speeds[:half].mean() - speeds[-half:].mean()))
    scatter = 2.0 * float(speeds.std()) * np.sqrt(2.0 / half)
    return drift > DRIFT * TOLERANCE * abs(float(speeds.mean())) + scatter


def _joined(velocity: Values, found: list[slice], wholes: list[slice], block: int) -> list[slice]:
    """Neighbours that are steady together made one: grain may have cut one stretch in two."""
    joined: list[slice] = []
    for part in found:
        before = joined[-1] if joined else part
        both = slice(before.start, part.stop)
        is_near = part.start - before.stop < BLOCKS * block
        is_whole = any(whole.start <= both.start and both.stop <= whole.stop for whole in wholes)
        speeds = _block_means(velocity, both, (both.stop - both.start) // BLOCKS)
        is_one = float(np.ptp(speeds)) <= TOLERANCE * abs(float(speeds.mean())) and not _drifts(speeds)
        if joined and is_near and is_whole and is_one:
            joined[-1] = both
        else:
            joined.append(part)
    return joined


def _stands_out(speed: float, others: Values) -> bool:
    return abs(speed - float(others.mean())) > STANDS_OUT * float(others.std())


def _without(free: slice, taken: list[slice]) -> list[slice]:
    """What is left of a part when others are taken out of it."""
    inside = [edge for part in taken if free.start <= part.start < free.stop for edge in (part.start, part.stop)]
    edges = [free.start, *inside, free.stop]
    return [slice(first, last) for first, last in zip(edges[::2], edges[1::2], strict=True)]


@dataclass(frozen=True, slots=True)
class SpeedLine:
    """Effort against speed in one direction."""

    direction: str  # ``"positive"`` or ``"negative"``
    stretches: tuple[SteadyStretch, ...]  # what it was found from
    slope: Estimate | None = None  # effort per speed
    coulomb: Estimate | None = None  # effort of the line at speed 0, as a magnitude against the motion
    # scatter of the stretches about the line beside their own errors, standard deviation; 0 where there is none
    between: float = 0.0
    reason: str = ""  # why there is no result; empty where there is one
    notes: tuple[str, ...] = ()  # what to know about it


@dataclass(frozen=True, slots=True)
class TwoSpeeds:
    """Outcome of the method."""

    effort: str  # role of the signal that drives
    positive: SpeedLine  # and negative: one for each direction
    negative: SpeedLine

    @property
    def reason(self) -> str:
        """Why there is no result in either direction; empty where there is one."""
        if self.positive.reason and self.negative.reason:
            return f"{self.positive.reason}; {self.negative.reason}"
        return ""

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """All constants found."""
        lines = (self.positive, self.negative)
        return tuple(found for line in lines for found in (line.slope, line.coulomb) if found is not None)


def fit_two_speeds(log: Log, effort: str = "") -> TwoSpeeds:
    """Slope and friction of each direction from the steady stretches of a recording."""
    role = log.effort(effort)
    velocity, speed_unit, step = find_velocity(log)
    drive = log.signals[role]
    parts = find_steady(log.t, velocity, step)
    unit = log.units[role]
    units = (unit, f"{unit}*s/{speed_unit.removesuffix('/s')}".removeprefix("*"), speed_unit)
    lines = {
        name: _fit_direction(name, (log.t, velocity, drive), [p for p in parts if velocity[p].mean() * sign > 0], units)
        for name, sign in DIRECTIONS.items()
    }
    return TwoSpeeds(role, lines["positive"], lines["negative"])


def _fit_direction(
    name: str, series: tuple[Values, Values, Values], parts: list[slice], units: tuple[str, str, str]
) -> SpeedLine:
    """The line of one direction, or why there is none."""
    unit, unit_of_slope, speed_unit = units
    measured = tuple(measure_stretch(*series, part, 0.0) for part in parts)
    speeds = [abs(stretch.speed) for stretch in measured]
    advice = "record passes at two constant speeds that differ by half or more"
    if not measured:
        return SpeedLine(name, measured, reason=f"no constant speed in the {name} direction; {advice}")
    if max(speeds) - min(speeds) < APART * max(speeds):
        only = f"only one constant speed in the {name} direction ({max(speeds):.4g} {speed_unit}); {advice}"
        return SpeedLine(name, measured, reason=only)
    line, errors, degrees, between = _weighted_line(measured)
    for _ in range(ROUNDS):
        measured = tuple(measure_stretch(*series, part, line[0]) for part in parts)
        line, errors, degrees, between = _weighted_line(measured)
    notes = [f"holds from {min(speeds):.4g} to {max(speeds):.4g} {speed_unit}; friction at rest is not measured"]
    if between > 0:
        text = "position-dependent friction, or friction that is not linear in speed"
        notes.append(f"segments scatter about the line by {between:.3g} {unit} beyond their errors: {text}")
    method = f"two-speed method, {len(measured)} stretches"
    slope = estimate(f"slope.{name}", line[0], unit_of_slope, errors[0], method, degrees[0])
    coulomb = estimate(f"coulomb.{name}", DIRECTIONS[name] * line[1], unit, errors[1], method, degrees[1])
    return SpeedLine(name, measured, slope, coulomb, between, notes=tuple(notes))


def _weighted_line(measured: tuple[SteadyStretch, ...]) -> tuple[list[float], list[float], list[float], float]:
    """Line through the means of stretches, weighted by length: slope and height at zero, errors, degrees, scatter."""
    # Weights from the errors of the stretches, known with few degrees of freedom, would make the interval too short.
    v = np.array([stretch.speed for stretch in measured])
    f = np.array([stretch.effort for stretch in measured])
    columns = np.column_stack([v, np.ones(len(v))])
    own = np.array([stretch.effort_error**2 for stretch in measured])
    own = np.maximum(own, 1e-24 * max(float(np.max(f * f)), 1e-300))
    seconds = np.array([stretch.seconds for stretch in measured])
    degrees = np.array([stretch.degrees for stretch in measured])
    pooled = float(degrees @ (own * seconds)) / float(degrees.sum()) / seconds
    between = _scatter_between(columns, f, pooled, float(degrees.sum()))
    pull = _pull(columns, pooled + between**2)
    shares = pull**2 * own
    # Satterthwaite: degrees of a sum of variances, each known with its own.
    inner = shares.sum(axis=1) ** 2 / (shares**2 / degrees).sum(axis=1)
    if between > 0:
        inner = np.minimum(inner, len(v) - 2)
    covariance = pull * (own + between**2) @ pull.T
    return (pull @ f).tolist(), np.sqrt(np.diag(covariance)).tolist(), inner.tolist(), between


def _pull(columns: Values, size: Values) -> NDArray[np.float64]:
    """What each stretch adds to slope and height, shape (2, m): the weighted least-squares solution as a matrix."""
    weighted = columns.T / size
    return np.asarray(np.linalg.solve(weighted @ columns, weighted), float)


def _scatter_between(columns: Values, effort: Values, pooled: Values, degrees: float) -> float:
    """Standard deviation between stretches that explains their scatter about the line; 0 where none is needed."""
    # Paule and Mandel, Journal of Research of the National Bureau of Standards 87 (1982) 377.
    free = len(effort) - 2

    def excess(between: float) -> float:
        """Weighted squares of the residuals beyond what their errors explain."""
        size = pooled + between**2
        residual = effort - columns @ (_pull(columns, size) @ effort)
        return float(residual @ (residual / size)) - free

    if free < 1 or fisher_tail((excess(0.0) + free) / free, free, degrees) > UNLIKELY:
        return 0.0
    most = float(np.ptp(effort)) + float(np.sqrt(pooled.max()))
    return root_within(excess, 0.0, 10.0 * most)
