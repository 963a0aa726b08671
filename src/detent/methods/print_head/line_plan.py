"""The supervisor's choices: for each line a direction, a speed, and where the carriage turns around.

A line is printed in the steady state (spec print-head 3.4): the axis needs a run-up of 1.05 x Dstop(s) before the
first emitter of PRINT, and comes to rest Dstop(s) = s x s/144 beyond the last one. It keeps the preselected speed s
only if 2.5 x Dstop(s) is less than the way from the present to the new stop. Where the next line goes the other way
at the same speed, the axis turns around without stopping (3.13); so the end of each line is moved outwards until
the run-up of the next one is already there. White space at the ends of a line is never travelled for its own sake.

Names: d is +1 for a line printed to the right, -1 to the left; "along d" means that the coordinate grows in the
direction of printing, so that one set of inequalities serves both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import ceil, floor

from detent.control import feed_forward
from detent.control.feed_forward import stop_distance_up
from detent.control.head_commands import FASTEST, SLOWEST
from detent.control.speed_selection import HIGH_SPEED, select_speed
from detent.errors import FileProblem, InputError
from detent.methods.print_head.printed_page import PrintLine

EMITTERS_PER_COLUMN = 2.5  # columns of 1/120 in
RESERVE = 12  # way that stays free at each frame [emitter]
STOP_TOLERANCE = 8  # how far a stop may miss its place [emitter]; the axis does not correct it (spec, tests 38 and 45)

_ACCELERATION = 3600  # speed values per second: 600 in/s^2
_RATE = 50  # emitters per second and speed value
_ZERO_SPEED_TIMEOUT = 5e-3  # [s] the axis waits before it calls the head at rest (spec 7.2)


@dataclass(frozen=True, slots=True)
class Geometry:
    """What a line has to fit into."""

    width_emitters: int  # way between the two frames [emitter = 1/300 in]
    column0_emitters: float  # carriage position at column 0 of the paper [emitter]
    max_speed: int = FASTEST  # highest speed value to use, 18..240 [1/6 in/s]

    def emitter(self, column: float) -> float:
        """Carriage position [emitter] at a column of the paper [1/120 in]."""
        return self.column0_emitters + column * EMITTERS_PER_COLUMN


@dataclass(frozen=True, slots=True)
class LinePlan:
    """How one line is printed."""

    line: PrintLine  # what is printed
    direction: int  # +1 to the right, -1 to the left
    speed: int  # speed value s to preselect [1/6 in/s]
    # where to RUN before this line [emitter]; None where the head already stands far enough back. A CONTROLLED RUN
    # keeps to the highest speed of the geometry, as the estimate does
    run_to: int | None
    start: int  # where the head is expected at rest, or turning, before the line [emitter]
    print_from: int  # first place of PRINT [1/256 emitter], the beginning of the ink in the direction of printing
    print_to: int  # last place of PRINT [emitter], at or beyond the end of the ink
    stop: int  # where the head is expected to come to rest, or to turn [emitter]
    turn_around: bool  # the axis can turn around from the line before, without a stop
    seconds: float  # estimated time from rest to rest, with the RUN before it [s]


def run_up(s: int) -> int:
    """Way from rest to the first printed place [emitter], with room for a missed stop."""
    return feed_forward.run_up(s) + STOP_TOLERANCE


def shortest_way(s: int) -> int:
    """Shortest way from rest to rest for which the axis keeps speed s [emitter]: above 2.5 stop distances."""
    # 5 s^2 < 288 D; both ends of the way may miss their place.
    return 5 * s * s // 288 + 1 + 2 * STOP_TOLERANCE


def motion_time(distance: float, s: int) -> float:
    """Time from rest to rest over a distance [emitter] at speed s, ramps of 600 in/s^2 [s]."""
    return 2 * s / _ACCELERATION + max(0.0, distance - 2 * (s * s / 144)) / (_RATE * s)


def plan_lines(
    lines: Sequence[PrintLine],
    geometry: Geometry,
    *,
    head: int | None = None,
    bidirectional: bool = True,
    job_name: str = "job",
) -> tuple[LinePlan, ...]:
    """Choose direction, speed and turning points of every line so that the whole job takes least time.

    Each line runs at the highest speed that fits between the frames in its direction. The directions are chosen
    together, by dynamic programming over the job.
    """
    choices = [_passes(line, geometry, (1, -1) if bidirectional else (1,)) for line in lines]
    misfits = [_misfit(line, geometry, job_name) for line, passes in zip(lines, choices, strict=True) if not passes]
    if misfits:
        raise InputError(misfits)
    place = geometry.width_emitters if head is None else head
    return tuple(_plans(lines, _cheapest(choices, place, geometry.max_speed), place, geometry.max_speed))


@dataclass(frozen=True, slots=True)
class _Pass:
    """One line in one direction at its speed; places along d (`start` < `end`), as if nothing followed."""

    d: int
    s: int
    ink: float  # where the ink begins [emitter], along d
    start: int  # nearest place to begin from
    end: int  # nearest place to come to rest

    def extended(self, following: _Pass | None) -> int:
        """Where this pass ends, along d, so that a following one the other way finds its run-up."""
        if following is None or following.d == self.d:
            return self.end
        return max(self.end, -following.start)


def _passes(line: PrintLine, geometry: Geometry, directions: tuple[int, ...]) -> tuple[_Pass, ...]:
    """Give the line in each direction in which it fits, at the highest speed that does."""
    left, right = geometry.emitter(line.first_column), geometry.emitter(line.last_column)
    return tuple(found for d in directions if (found := _fastest(left, right, d, geometry)))


@lru_cache(maxsize=4096)
def _fastest(left: float, right: float, d: int, geometry: Geometry) -> _Pass | None:
    """Place the turning points of ink from `left` to `right` [emitter] at the highest speed that fits."""
    ink, ink_end = (left, right) if d > 0 else (-right, -left)
    inside = (RESERVE, geometry.width_emitters - RESERVE)
    first, last = inside if d > 0 else (-inside[1], -inside[0])
    for s in range(geometry.max_speed, SLOWEST - 1, -1):
        start, end = floor(ink) - run_up(s), ceil(ink_end) + stop_distance_up(s)
        # A short line needs a longer way for its speed: take it before the line, and after it what does not fit there.
        start = max(min(start, end - shortest_way(s)), min(start, first))
        end = max(end, start + shortest_way(s))
        if first <= start and end <= last:
            return _Pass(d, s, ink, start, end)
    return None


def _misfit(line: PrintLine, geometry: Geometry, job_name: str) -> FileProblem:
    """Say of a line that fits at no speed how wide it is and what would fit."""
    per_inch = 120 * EMITTERS_PER_COLUMN
    nearest, farthest = RESERVE + run_up(SLOWEST), geometry.width_emitters - RESERVE - stop_distance_up(SLOWEST)
    first = max(0.0, nearest - geometry.column0_emitters) / per_inch
    last = (farthest - geometry.column0_emitters) / per_inch
    return FileProblem(
        file=job_name,
        line=0,
        column=0,
        key=f"printed line {line.number}",
        got=f"ink from {line.first_column / 120:.2f} in to {line.last_column / 120:.2f} in",
        allowed=f"ink between {first:.2f} in and {last:.2f} in from column 0, with room to stop before both frames",
        remedy="shorten the line, or change limits.travel or print.left_margin of the axis",
    )


def _transition(before: _Pass | None, following: _Pass, place: int, max_speed: int) -> tuple[int, float]:
    """Where `following` starts, along its d, when the head rests at `place`, and the time to get there [s].

    It runs back first where it stands too near the line, which it never does after a turn.
    """
    turned = before is not None and before.d != following.d
    if turned or following.d * place <= following.start:
        return following.d * place, 0.0
    way = abs(following.d * following.start - place)
    return following.start, motion_time(way, select_speed(way, max_speed)) + _ZERO_SPEED_TIMEOUT


def _turns_around(before: _Pass | None, following: _Pass) -> bool:
    """Whether the axis goes from one pass into the next without stopping (spec 3.13)."""
    return before is not None and before.d != following.d and before.s == following.s >= HIGH_SPEED


def _cheapest(choices: Sequence[tuple[_Pass, ...]], head: int, max_speed: int) -> list[_Pass]:
    """Choose a pass for every line so that the sum of all times is least.

    The time of a line depends on its neighbours through its two turning points only, and linearly; so the cost of
    a sequence is a sum over pairs of neighbours, which dynamic programming minimises exactly.
    """
    costs = [0.0]
    previous: tuple[_Pass | None, ...] = (None,)
    came_from: list[list[int]] = []  # for each line and pass, the pass of the line before on the cheapest way
    for passes in choices:
        ways = [
            [cost + _pair_cost(before, this, head, max_speed) for cost, before in zip(costs, previous, strict=True)]
            for this in passes
        ]
        came_from.append([way.index(min(way)) for way in ways])
        costs = [min(way) for way in ways]
        previous = passes
    chosen: list[_Pass] = []
    index = costs.index(min(costs))
    for passes, sources in zip(reversed(choices), reversed(came_from), strict=True):
        chosen.append(passes[index])
        index = sources[index]
    return chosen[::-1]


def _pair_cost(before: _Pass | None, following: _Pass, head: int, max_speed: int) -> float:
    """Time that two neighbours cost beyond what each costs alone, and what the second costs alone [s]."""
    place, cost = head, 0.0
    if before is not None:
        end = before.extended(following)
        place = before.d * end
        cost = (end - before.end) / (_RATE * before.s)
    start, run = _transition(before, following, place, max_speed)
    cost += run + motion_time(following.end - start, following.s)
    return cost if _turns_around(before, following) else cost + _ZERO_SPEED_TIMEOUT


def _plans(lines: Sequence[PrintLine], chosen: Sequence[_Pass], head: int, max_speed: int) -> list[LinePlan]:
    """Turn the chosen passes into plans with places in emitters from the left frame."""
    plans: list[LinePlan] = []
    before: _Pass | None = None
    place = head
    for index, (line, this) in enumerate(zip(lines, chosen, strict=True)):
        following = chosen[index + 1] if index + 1 < len(chosen) else None
        start, run = _transition(before, this, place, max_speed)
        end = this.extended(following)
        pause = 0.0 if _turns_around(before, this) else _ZERO_SPEED_TIMEOUT
        plans.append(
            LinePlan(
                line=line,
                direction=this.d,
                speed=this.s,
                run_to=this.d * start if start != this.d * place else None,
                start=this.d * start,
                print_from=round(256 * this.d * this.ink),
                print_to=this.d * (end - stop_distance_up(this.s)),
                stop=this.d * end,
                turn_around=_turns_around(before, this),
                seconds=run + motion_time(end - start, this.s) + pause,
            )
        )
        before, place = this, this.d * end
    return plans
