"""A list of moves that shows what a log did not: what each constant needs, within the limits of the axis.

A mass shows in ramps, viscous friction in steady speeds that differ, Coulomb friction and a constant force in both
directions, static friction in the slowest moves. The moves go to and fro between places inside the travel, at shares of
the top speed.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from detent.errors import DetentError
from detent.identify.fit.identification import Identification
from detent.identify.fit.verdict import Refusal
from detent.identify.write import render
from detent.identify.write.file_numbers import plain
from detent.identify.write.seen import Bounds, see
from detent.methods.cascade.schema import CascadeSpec
from detent.units import format_quantity

INSIDE = 0.05  # share of the travel that is left free at both ends
STEADY = 0.8  # time at a steady speed that a move is planned for [s]
SLOWER = 0.5  # share of the top speed that remains where the effort was at its limit
LEAST = 20.0  # length of a recording that is aimed at [s]
RAMP = 0.15  # time of a ramp where neither the axis nor the log tells one [s]


def bounds_of(found: Identification, spec: CascadeSpec | None) -> Bounds:
    """Limits of an axis, and a little less of its travel; without one what the axis did in its logs."""
    if spec is not None:
        limits, margin = spec.limits, INSIDE * spec.limits.travel
        low, high, start = limits.lowest + margin, spec.highest - margin, spec.mechanics.start_position
        return Bounds(low, high, limits.speed, limits.acceleration, start, spec.axis.motion == "rotary")
    seen = see(found.runs)
    if not (seen.way > 20.0 * seen.resolution and seen.speed > 0.0):
        raise DetentError(
            f"{found.runs[0].name}: came a log without motion; allowed: one that shows how far and how fast the axis "
            "may go; name the axis file whose limits the moves shall keep: --axis FILE"
        )
    return replace(seen, acceleration=max(seen.acceleration, seen.speed / 2.0))


@dataclass(frozen=True, slots=True)
class Part:
    """Moves for one thing that is to be seen."""

    text: str  # what they are for
    shares: tuple[float, ...]  # speeds, as shares of the top speed
    steady: float  # time at that speed in each move [s]; 0 for the shortest way that reaches it
    dwell: float = 0.0  # rest after each move [s]


SPEEDS = Part(
    "several steady speeds, both ways: viscous friction, Coulomb friction, a constant force",
    (0.1, 0.25, 0.5, 0.75, 1.0),
    STEADY,
)
RAMPS = Part("short ramps, one after the other: the mass", (0.6, 0.8, 1.0, 0.9, 0.7, 1.0), 0.0)
SLOW = Part("slow, both ways: friction near standstill", (0.01, 0.02, 0.04, 0.07), 1.5, 0.1)
REVERSALS = Part("both directions: friction is told from a constant force", (0.3, 0.6), STEADY, 0.1)

_BY_SUBJECT = {"model does not explain the log": (SLOW,), "friction below 0": (SPEEDS, SLOW)}
"""What a refusal asks for beside its constants and, where it concerns all of them, a log of its own."""

_BY_CONSTANT = {"mass": RAMPS, "viscous": SPEEDS, "coulomb": REVERSALS}
"""What shows a constant, by its kind; slow moves show all others."""


def missing_parts(refusals: Sequence[Refusal]) -> list[Part]:
    """Moves that refusals ask for; all of them where there are none.

    A log of which nothing is trusted is of no use, so that the next one must show everything but static friction; else
    the moves only add what is missing.

    >>> [part.text for part in missing_parts([Refusal("little acceleration", "", "", ("mass",))])]
    ['short ramps, one after the other: the mass']
    """
    wanted: list[Part] = []
    for refusal in refusals:
        wanted += _BY_SUBJECT.get(refusal.subject, ())
        wanted += [_BY_CONSTANT.get(name.partition(".")[0], SLOW) for name in refusal.constants]
        wanted += [] if refusal.constants else [SPEEDS, RAMPS]
    parts = [part for part in (REVERSALS, SPEEDS, RAMPS, SLOW) if not wanted or part in wanted]
    return [part for part in parts if part is not REVERSALS or SPEEDS not in parts]


def excitation_job(found: Identification, axis: CascadeSpec | None = None) -> str:
    """Write a list of moves that a recording needs for what is missing, as ``template/moves.toml.j2`` shows it."""
    bounds = bounds_of(found, axis)
    told = f"travel and speed of {found.runs[0].name}" if axis is None else f"limits of {axis.axis.name}"
    subjects = {refusal.subject for refusal in found.refusals}
    moves = _Moves(bounds, SLOWER * bounds.speed if "saturated" in subjects else bounds.speed)
    middle = 0.5 * (bounds.lowest + bounds.highest)
    parts = [("to the middle of the way", [moves.to(middle, 0.5 * moves.top)])]
    parts += [(part.text, moves.of(part, middle)) for part in missing_parts(found.refusals)]
    parts += [("back to the begin", [moves.to(bounds.start, 0.5 * moves.top)])]
    way = "rad" if bounds.is_rotary else "m"
    return render(
        "moves.toml.j2",
        found=found,
        told=plain(told),
        logs=", ".join(plain(log.name) for log in found.logs),
        subjects=subjects,
        slower=SLOWER,
        bounds=bounds,
        top=moves.top,
        seconds=moves.seconds,
        repeat=max(1, math.ceil(LEAST / moves.seconds)),
        parts=parts,
        plain=plain,
        quantity=format_quantity,
        way=way,
    )


Move = tuple[float, float, float]  # target, speed, and rest after it [s]


class _Moves:
    """Makes moves to and fro, and counts their time."""

    def __init__(self, bounds: Bounds, top: float) -> None:
        self.top, self.seconds = top, 0.0
        self._free, self._place = bounds.highest - bounds.lowest, bounds.start
        self._rise = bounds.acceleration if bounds.acceleration > 0.0 else top / RAMP

    def of(self, part: Part, middle: float) -> list[Move]:
        """Moves of a part, each speed there and back around the middle of the travel."""
        found: list[Move] = []
        for speed in (share * self.top for share in part.shares):
            way = min(speed * part.steady + speed**2 / self._rise, self._free)
            found += [self.to(middle + sign * 0.5 * way, speed, part.dwell) for sign in (1.0, -1.0)]
        return found

    def to(self, target: float, speed: float, dwell: float = 0.0) -> Move:
        """One move."""
        way = abs(target - self._place)
        self._place = target
        ramp = speed / self._rise
        self.seconds += dwell + (way / speed + ramp if way > speed * ramp else 2.0 * math.sqrt(way / self._rise))
        return target, speed, dwell
