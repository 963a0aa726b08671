"""What stops hunting: the least dead band, or less of an integral; and what more of both would do."""

import math
from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from detent.axisfile.tolerance import value_of
from detent.methods.method import untold
from detent.methods.tuning import digits
from detent.tune.standstill import Standstill, standstill

SEEDS = 3  # of ensembles none of whose starts may hunt
FINEST = 0.1  # of the swing, to which the width is sought
WIDTHS = np.linspace(0.0, 1.5, 8)  # of the map, in swings
INTEGRALS = (0.0, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0)  # of the map, times that of the file
MAP_STARTS = 12
HALVES = 6  # of an integral that are tried, before none
CLOSER = 1.1  # to which factor of the largest that does

Progress = Callable[[float, str], None]


@dataclass(frozen=True, slots=True)
class Tried:
    """A dead band that was tried."""

    width: float  # [m]
    hunts: float  # share of the starts
    swing: float  # largest [m]
    rest_error: float  # largest of those that rest [m]


@dataclass(frozen=True, slots=True)
class Band:
    """The least dead band that stops an axis from every start of three seeds."""

    width: float | None  # [m]; None where none does that is narrow enough
    most: float  # widest that was tried [m]
    tried: Sequence[Tried]

    @property
    def found(self) -> Tried | None:
        """What the axis does with it."""
        return next((one for one in self.tried if one.width == self.width), None)


def least_band(spec: Any, found: Standstill, most: float, progress: Progress = untold) -> Band:
    """Halve the interval between 0 and the swing, or the widest band allowed, until it is a tenth of the swing."""
    key, starts = found.ensemble.band, len(found.found)
    tried = list[Tried]()
    low, high = 0.0, min(digits(found.swing + 0.5 * found.ensemble.grain, math.ceil), most)

    def stops(width: float) -> bool:
        """No start of any seed hunts with a band so wide."""
        progress(min(0.1 + 0.15 * len(tried), 0.95), f"dead band {len(tried) + 1}")
        seen = list[Standstill]()
        for seed in range(found.seed, found.seed + SEEDS):
            seen.append(standstill(spec.varied({key: width}), starts, seed, on_counts=found.on_counts))
            if seen[-1].hunts:
                break
        tried.append(
            Tried(width, max(one.shares["hunts"] for one in seen), max(one.swing for one in seen),
                  max(one.rest_error for one in seen))
        )  # fmt: skip
        return not seen[-1].hunts

    if not stops(high):
        return Band(None, high, tried)
    while high - low > FINEST * found.swing:
        middle = digits(0.5 * (low + high), math.ceil)
        low, high = (low, middle) if stops(middle) else (middle, high)
    return Band(high, high, sorted(tried, key=lambda one: one.width))


@dataclass(frozen=True, slots=True)
class Cure:
    """What stops an axis from hunting, and what it costs."""

    key: str
    value: float
    name: str  # in words
    rest_error: float  # largest error at which the axis then rests [m]


def cures(spec: Any, found: Standstill, held: Container[str] = (), progress: Progress = untold) -> list[Cure]:
    """The least dead band that stops it, and the largest integral that hunts no more, the smaller rest error first.

    Keys that are held stay as they are; none where neither stops it.
    """
    made, ensemble = list[Cure](), found.ensemble
    if ensemble.band and ensemble.band not in held:
        band = least_band(spec, found, spec.method.in_position, lambda at, text: progress(0.5 * at, text)).found
        if band is not None:
            made.append(Cure(ensemble.band, band.width, "a dead band", band.rest_error))
    if ensemble.band and ensemble.integral and ensemble.integral not in held:
        progress(0.5, "less integral")
        integral = _largest_integral(spec, found)
        made += [integral] if integral is not None else []
    return sorted(made, key=lambda one: one.rest_error)


def _largest_integral(spec: Any, found: Standstill) -> Cure | None:
    """Of shares of the integral, and none, the largest from which no start of three seeds hunts."""
    key, gain = found.ensemble.integral, value_of(spec, found.ensemble.integral)

    def rests(share: float) -> tuple[float, float] | None:
        """The integral and the largest error at rest; None where a start hunts."""
        value, error = digits(share * gain) if share else 0.0, 0.0
        for seed in range(found.seed, found.seed + SEEDS):
            tried = standstill(spec.varied({key: value}), len(found.found), seed, on_counts=found.on_counts)
            if tried.hunts:
                return None
            error = max(error, tried.rest_error)
        return value, error

    low, high, made = 0.0, 1.0, None
    for share in (0.5**k for k in range(1, HALVES)):
        if (made := rests(share)) is not None:
            low = share
            break
        high = share
    if made is None:
        made = rests(0.0)
        return None if made is None else Cure(key, made[0], "no integral", made[1])
    while high > CLOSER * low:
        middle = math.sqrt(low * high)
        low, high, made = (middle, high, better) if (better := rests(middle)) else (low, middle, made)
    return Cure(key, made[0], "less integral", made[1])


@dataclass(frozen=True, slots=True)
class Map:
    """Verdicts over dead band and integral gain, rows of `found` by the integral."""

    widths: Sequence[float]  # [m]
    integrals: Sequence[float]  # times that of the file
    found: Sequence[Sequence[Standstill]]


def band_map(spec: Any, found: Standstill, integral: float, progress: Progress = untold) -> Map:
    """Try every pair of dead band and integral from a few starts."""
    keys, rule = found.ensemble, found.ensemble.rule
    swing = found.swing or (rule.swing if rule is not None else 0.0) or 4.0 * keys.grain
    widths, rows = [float(share * swing) for share in WIDTHS], list[list[Standstill]]()
    for share in INTEGRALS:
        row = list[Standstill]()
        for width in widths:
            progress((len(rows) + len(row) / len(widths)) / len(INTEGRALS), f"map, {share:g} times the integral")
            made = spec.varied({keys.band: width, keys.integral: share * integral})
            row.append(standstill(made, MAP_STARTS, found.seed, on_counts=found.on_counts))
        rows.append(row)
    return Map(widths, INTEGRALS, rows)
