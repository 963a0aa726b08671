"""Signals of a recording as the methods want them, and stretches of it in which the speed is steady."""

from dataclasses import dataclass

import numpy as np

from detent.errors import DetentError
from detent.identify.fit.coloured import coloured_covariance
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
        raise DetentError(f"{log.name}: came {len(log)} samples; allowed: at least 3; record longer")
    position = log.signals["position"]
    return np.gradient(position, log.t), f"{log.units['position']}/s", grain(position)


def unit_per_speed(effort: str, speed: str) -> str:
    """Unit of an effort per speed.

    >>> unit_per_speed("V", "rad/s"), unit_per_speed("N", "m/s"), unit_per_speed("", "m/s")
    ('V*s/rad', 'N*s/m', 's/m')
    """
    length = speed.removesuffix("/s")
    return f"{effort}*s/{length}" if effort else f"s/{length}"


def find_steady(t: Values, velocity: Values, step: float = 0.0) -> list[slice]:
    """Find the stretches of a recording in which the axis moves at a steady speed.

    The recording is divided into short blocks. A stretch is as many of them in a row whose mean speeds stay within the
    tolerance; blocks at its ends that stand out are left out, and one whose halves differ is no stretch. What is left
    is searched again with blocks twice as long, in which the grain of an encoder counts less; neighbours that are
    steady as one become one.
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
        stop = _reach(speeds, first)
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


def _reach(speeds: Values, first: int) -> int:
    """First block behind `first` that is not of the same speed as those before it."""
    rest = speeds[first:]
    spread = np.maximum.accumulate(rest) - np.minimum.accumulate(rest)
    is_other = spread > TOLERANCE * np.abs(np.cumsum(rest)) / np.arange(1, len(rest) + 1)
    return first + (int(np.argmax(is_other)) if is_other.any() else len(rest))


def _trimmed(speeds: Values, first: int, stop: int) -> tuple[int, int] | None:
    """First block and block behind the last of the steady part of a run; None where nothing long enough is left."""
    while stop - first > BLOCKS and _stands_out(speeds[first], speeds[first + 1 : stop]):
        first += 1
    while stop - first > BLOCKS and _stands_out(speeds[stop - 1], speeds[first : stop - 1]):
        stop -= 1
    # Within the tolerance, the blocks at the ends may still hold the edge of a ramp with its effort of acceleration.
    first, stop = first + 1, stop - 1
    if stop - first < BLOCKS or _drifts(speeds[first:stop]):
        return None
    return first, stop


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
        if joined and is_near and is_whole and _is_steady(velocity, both):
            joined[-1] = both
        else:
            joined.append(part)
    return joined


def _is_steady(velocity: Values, part: slice) -> bool:
    speeds = _block_means(velocity, part, (part.stop - part.start) // BLOCKS)
    return float(np.ptp(speeds)) <= TOLERANCE * abs(float(speeds.mean())) and not _drifts(speeds)


def _stands_out(speed: float, others: Values) -> bool:
    return abs(speed - float(others.mean())) > STANDS_OUT * float(others.std())


def _without(free: slice, taken: list[slice]) -> list[slice]:
    """What is left of a part when others are taken out of it."""
    inside = [edge for part in taken if free.start <= part.start < free.stop for edge in (part.start, part.stop)]
    edges = [free.start, *inside, free.stop]
    return [slice(first, last) for first, last in zip(edges[::2], edges[1::2], strict=True)]
