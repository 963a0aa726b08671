"""The reference of a whole job in one piece: what a recording of it would show."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from detent.errors import DetentError
from detent.methods.moves.job import MoveJob
from detent.planning.profile import MotionLimits, Numbers, Profile, check_length, plan_move


@dataclass(frozen=True, slots=True)
class PlannedMove:
    """Where a move of a job lies in its profile.

    Attributes
    ----------
    number : int
        Of the move in the job, from 1.
    start, target : float
        [m].
    begin : int
        Sample at which it begins.
    end : int
        First sample at which the reference stands at the target.
    until : int
        First sample behind its dwell; here the next move begins.
    """

    number: int
    start: float
    target: float
    begin: int
    end: int
    until: int


def plan_job(
    job: MoveJob, start: float, limits: MotionLimits, period: float
) -> tuple[Profile, tuple[PlannedMove, ...]]:
    """Moves of a job one after the other, with their dwells.

    Parameters
    ----------
    job : MoveJob
        Moves to places or by ways; a speed of a move takes the place of that in `limits`.
    start : float
        Where the axis stands [m].
    limits : MotionLimits
        What the moves may do.
    period : float
        Time between two samples [s], above 0.

    Returns
    -------
    (Profile, tuple of PlannedMove)
        The whole reference, and where each move lies in it. Dwells are rounded up to whole samples, counted from the
        end of the reference's move.

    Raises
    ------
    DetentError
        A move asks for a sample period of its own, the profile is too long, or a move cannot be planned.
    """
    parts: list[Profile] = []
    planned: list[PlannedMove] = []
    place, begin = start, 0
    for move in job.moves:
        if move.sample_period is not None:
            raise DetentError(
                f"move {move.number}: got a sample period of {move.sample_period:g} s; expected: none, the loops of "
                "this axis have a fixed one; try: leave it out"
            )
        target = place + (move.by or 0.0) if move.target is None else move.target
        own = limits if move.speed is None else MotionLimits(move.speed, limits.acceleration, limits.jerk)
        part = plan_move(place, target, own, period)
        check_length(move.dwell / period)
        wait = math.ceil(move.dwell / period - 1e-9)
        end = begin + part.count - 1
        # The sample at which a move ends is the one at which the next begins.
        until = end + wait
        check_length(until)
        parts += [_without_end(part), _rest(target, wait, period)]
        planned.append(PlannedMove(move.number, place, target, begin, end, until))
        place, begin = target, until
    parts.append(_rest(place, 1, period))
    return _join(parts, period), tuple(planned)


def _rest(position: float, samples: int, period: float) -> Profile:
    return Profile(period, np.full(samples, position), np.zeros(samples), np.zeros(samples))


def _without_end(part: Profile) -> Profile:
    return Profile(part.period, part.position[:-1], part.velocity[:-1], part.acceleration[:-1])


def _join(parts: Sequence[Profile], period: float) -> Profile:
    def joined(name: str) -> Numbers:
        return np.concatenate([getattr(part, name) for part in parts])

    return Profile(period, joined("position"), joined("velocity"), joined("acceleration"))
