"""A list of moves for an axis that is live: the moves of its operation."""

from typing import Any

from detent.control.operation import MOVE_BY, MOVE_TO
from detent.errors import DetentError
from detent.methods.method import Leg
from detent.methods.moves.job import MoveJob


def legs_of(job: Any) -> list[Leg]:
    """The moves one after another; ways count from the target before, and in the beginning from where the axis is."""
    if not isinstance(job, MoveJob):
        raise DetentError(f"{job.name}: got a recording; expected, live: a list of moves; replay it with: detent run")
    legs: list[Leg] = []
    kind, place = MOVE_BY, 0.0
    for move in job.moves:
        if move.sample_period is not None:
            got = f"{job.name}, move {move.number}: got a sample period of its own"
            raise DetentError(f"{got}; expected, live: that of the axis file, which the loop keeps; leave it out")
        if move.target is not None:
            kind, place = MOVE_TO, move.target
        else:
            place += move.by or 0.0
        legs.append(Leg(kind, place, move.speed, move.dwell))
    return legs
