"""What recorded runs show of an axis's limits: where it was, how fast it went, what drove it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from detent.errors import DetentError
from detent.identify.fit.equations import make_kernel
from detent.identify.fit.prepare import Run

WINDOW = 0.02  # half of the window of velocities and accelerations [s]
NEARLY_ALL = 0.999  # share of the samples whose speed and acceleration count: the rest may be noise


@dataclass(frozen=True, slots=True)
class Bounds:
    """Where an axis may go, or went, and how fast, in m or rad."""

    lowest: float  # and highest: positions
    highest: float
    speed: float  # and acceleration: largest magnitudes [m/s, m/s^2]
    acceleration: float  # [m/s, m/s^2]
    start: float  # where it stands, in logs at the begin of the first
    is_rotary: bool  # True for angles


@dataclass(frozen=True, slots=True)
class Seen(Bounds):
    """Extremes of some runs of one axis, and the unit of the effort."""

    effort: float  # largest magnitude
    period: float  # time between two samples [s], the longest of the runs
    resolution: float  # way of a count of the encoder, the coarsest of the runs; 0 where none shows

    @property
    def way(self) -> float:
        """Distance between the extreme positions."""
        return self.highest - self.lowest


def see(runs: Sequence[Run]) -> Seen:
    """Extremes of runs."""
    units = {run.position_unit for run in runs}
    if len(units) > 1 or not units <= {"m", "rad"}:
        came = " and ".join(sorted(units))
        raise DetentError(
            f"{runs[0].name}: came positions in {came}; allowed: m or rad, the same in all logs; state the unit of the "
            "column, such as --column 'position=COLUMN [0.3125 um]' for counts"
        )
    speeds, rises = zip(*(_speed_and_acceleration(run) for run in runs), strict=True)
    return Seen(
        lowest=min(float(run.position.min()) for run in runs),
        highest=max(float(run.position.max()) for run in runs),
        speed=max(speeds),
        acceleration=max(rises),
        effort=max(float(np.abs(run.effort).max()) for run in runs),
        start=float(runs[0].position[0]),
        period=max(run.step for run in runs),
        resolution=max(run.resolution for run in runs),
        is_rotary=runs[0].is_rotary,
    )


def _speed_and_acceleration(run: Run) -> tuple[float, float]:
    """Largest speed and acceleration of a run, by a window that noise does not pass."""
    half = min(max(5, round(WINDOW / run.step)), (len(run.position) - 1) // 2)
    kernel = make_kernel(half, run.step)
    rows = np.arange(half, len(run.position) - half)
    motion = kernel.velocity(run.position, rows), kernel.acceleration(run.position, rows)
    speed, rise = (float(np.quantile(np.abs(values), NEARLY_ALL)) for values in motion)
    return speed, rise


def outwards(value: float, *, up: bool, size: float) -> float:
    """Round a value to two digits of a size, away from what it bounds.

    >>> outwards(0.2034, up=True, size=0.4), outwards(-0.2034, up=False, size=0.4)
    (0.21, -0.21)
    """
    if not size > 0.0:
        return value
    unit = 10.0 ** (math.floor(math.log10(size)) - 1)
    return float(f"{(math.ceil if up else math.floor)(value / unit) * unit:.12g}")
