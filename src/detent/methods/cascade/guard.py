"""What the drive of a cascade axis looks after: when to go off, and when a move is in position."""

import math

import numpy as np

from detent.methods.cascade.host import Rows, Stop, run_lengths
from detent.methods.cascade.schema import CascadeSpec
from detent.units import format_quantity

LONGEST_SATURATION = 1.0
"""Time through which the command may stay at its limit until the drive goes off [s]."""


class Guard:
    """What a drive looks after at every sample; the cause is that of the first sample in which something is wrong."""

    def __init__(self, spec: CascadeSpec, period: float) -> None:
        self._spec = spec
        self._most = math.ceil(LONGEST_SATURATION / period)
        self._limited = 0

    def __call__(self, rows: Rows) -> Stop | None:
        """Look through a stretch."""
        limits, method = self._spec.limits, self._spec.method
        place = rows["plant.machine.load.position"]
        limited = run_lengths(rows["controller.law.limited"] > 0, self._limited)
        self._limited = int(limited[-1])
        # Turned round, so that a figure that is no number is wrong too.
        lasting = (
            (~(np.abs(rows["controller.law.position_error"]) <= method.following_error), self._following),
            (~(place <= self._spec.highest + method.in_position), lambda: self._beyond("upper", self._spec.highest)),
            (~(place >= limits.lowest - method.in_position), lambda: self._beyond("lower", limits.lowest)),
            (limited >= self._most, self._saturated),
        )
        found = [(int(np.argmax(wrong)), tell) for wrong, tell in lasting if wrong.any()]
        if not found:
            return None
        first, tell = min(found, key=lambda entry: entry[0])
        return Stop(first + 1, f"{tell()}")

    def _following(self) -> str:
        limit = self._text(self._spec.method.following_error)
        return (
            f"the following error went beyond {limit}, method.following_error, and the drive is off; look for what "
            "blocks the axis, lower speed or acceleration, or correct the gains"
        )

    def _beyond(self, end: str, place: float) -> str:
        key = "limits.lowest" if end == "lower" else "limits.lowest + limits.travel"
        return (
            f"the load ran over the {end} end of its way, {self._text(place)}, {key}, and the drive is off; keep the "
            "moves farther from the ends, or damp the overshoot"
        )

    def _saturated(self) -> str:
        return (
            f"the command stayed at its limit for {format_quantity(LONGEST_SATURATION, 's')}, and the drive is off; "
            "lower the acceleration, take a stronger drive, or look for an unstable loop"
        )

    def _text(self, value: float) -> str:
        return format_quantity(value, self._spec.unit("m"))


class Arrival:
    """Ends a stretch when the axis is in position, or when the guard does."""

    def __init__(self, spec: CascadeSpec, period: float, guard: Guard) -> None:
        self._window, self._guard = spec.method.in_position, guard
        self._samples = max(1, math.ceil(spec.method.in_position_time / period - 1e-9))
        self._within = 0

    def __call__(self, rows: Rows) -> Stop | None:
        """Look through a stretch."""
        within = run_lengths(np.abs(rows["controller.law.position_error"]) <= self._window, self._within)
        self._within = int(within[-1])
        there = np.flatnonzero(within >= self._samples)
        wrong = self._guard(rows[: there[0] + 1] if there.size else rows)
        if wrong or not there.size:
            return wrong
        return Stop(int(there[0]) + 1)
