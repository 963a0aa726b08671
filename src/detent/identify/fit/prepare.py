"""A log made ready for a fit: what moved and what moved it, on an even grid."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from detent.errors import InputError
from detent.logs.log import Kind, Log, Values

GAP = 1.5  # time between two samples, in periods, from which on something is missing between them
FEWEST = 20  # samples below which nothing is said about a log
_MASS = {"N": "kg", "N*m": "kg*m^2"}


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
        cut = slice(begin, end)
        return replace(
            self,
            position=self.position[cut],
            effort=self.effort[cut],
            usable=self.usable[cut],
            reference=None if self.reference is None else self.reference[cut],
        )

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
    position = np.interp(grid, log.t, log.signals["position"])
    reference = np.interp(grid, log.t, log.signals["reference"]) if "reference" in log.signals else None
    resolution = find_count(log.signals["position"])
    return Run(
        name=log.name,
        step=step,
        position=position,
        effort=_hold(grid, log.t, log.signals[name], step),
        usable=_usable(log, grid, name),
        effort_name=name,
        effort_unit=log.units[name] or "1",
        position_unit=log.units["position"],
        reference=reference,
        resolution=resolution,
        noise=max(noise_of(position), 0.29 * resolution),
    )


def _hold(grid: Values, t: Values, values: Values, step: float) -> Values:
    """A signal that stands from each of its samples to the next, on the grid."""
    if len(grid) == len(t) and float(np.abs(grid - t).max()) < 0.2 * step:
        return values.astype(np.float64)
    places = np.searchsorted(t, grid + 0.2 * step, side="right") - 1
    return values[np.clip(places, 0, len(t) - 1)].astype(np.float64)


def _usable(log: Log, grid: Values, effort: str) -> NDArray[np.bool_]:
    """Grid samples that are not in gaps, filled in, stuck, saturated or without the drive."""
    bad = log.mask(Kind.MISSING_VALUES, Kind.STUCK) | log.mask(Kind.SATURATED, signals={effort, "position"})
    if effort in {"voltage", "command"} and "enabled" in log.signals:
        # A winding that is switched off does not brake: another axis.
        bad |= log.signals["enabled"] < 0.5
    before = np.clip(np.searchsorted(log.t, grid, side="right") - 1, 0, len(log.t) - 1)
    after = np.clip(before + 1, 0, len(log.t) - 1)
    gap = log.t[after] - log.t[before] > GAP * log.period
    return ~(bad[before] | (gap & (np.abs(grid - log.t[before]) > 0.2 * log.period)))


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
