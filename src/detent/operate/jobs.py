"""Jobs of a live axis: what a file, a page or a program says, as moves that are laid ready for the operation."""

import math
import struct
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, cast

from detent.control import operation as ops
from detent.control.program import PLACES
from detent.errors import DetentError
from detent.files.text import short
from detent.methods.method import Leg, Live
from detent.units import format_place

MOST_MOVES = 100_000
LONGEST_REST = 1e5  # [s]
KEYS = {"moves": "places, each a text", "rounds": "how often", "rest": "seconds at rest after each", "text": "to print"}


class Moves:
    """A job whose moves the operation makes."""

    shown: Mapping[str, Any] = MappingProxyType({})

    def __init__(self, job: Any, axis: Live, board: Any, share: float) -> None:
        legs = cast("Sequence[Leg]", job) if isinstance(job, list) else _legs_of(axis, job)
        self._legs, self._board, self._share = legs, board, share
        self._look, self._fastest = axis.live.look_ticks * axis.tick, axis.speed
        self._laid, self._begun = 0, int(board.program.job)
        self.name, self.pieces = f"{len(legs)} moves" if isinstance(job, list) else str(job.name), len(legs)
        _refuse_beyond(legs, axis)

    @property
    def done(self) -> int:
        """Moves that have ended."""
        return int(self._board.program.done) if self._is_begun else 0

    @property
    def _is_begun(self) -> bool:
        return int(self._board.program.job) != self._begun

    def piece(self) -> bytes | None:
        """The next move, once its place of the tray is free."""
        begun = int(self._board.program.begun) if self._is_begun else 0
        if self._laid >= min(begun + PLACES, self.pieces):
            return None
        leg = self._legs[self._laid]
        self._laid += 1
        share = 1.0 if leg.speed is None or math.isnan(self._fastest) else min(leg.speed / self._fastest, 1.0)
        return struct.pack("<4d", leg.kind, leg.value, share * self._share, round(leg.seconds / self._look))


def read_job(axis: Live, load: Callable[[Path], Any], value: object, leg: Callable[[str], Leg]) -> Any:
    """What a command says of a job: a file that `load` reads, a text to print, or places, which `leg` reads.

    Gives a job of the method, or legs. A `DetentError` where it is none of them.
    """
    if isinstance(value, str) and value:
        return load(Path(value))
    said = cast("Mapping[str, Any]", value if isinstance(value, Mapping) else {})
    wrong = [name for name in said if name not in KEYS]
    if not said or wrong or ("moves" in said) == ("text" in said):
        got = f"{wrong[0]!r:.60}" if wrong else f"{value!r:.60}"
        raise DetentError(
            f'job: got {got}; expected: a file, {{"moves": [...]}} or {{"text": "..."}}; give one of them'
        )
    if "text" in said:
        if axis.text is None:
            raise DetentError('job: got a text; expected: {"moves": [...]}, for this axis prints none; give its places')
        if not isinstance(said["text"], str) or not said["text"].strip():
            raise DetentError(f"job: got text {said['text']!r:.60}; expected: characters to print; write some")
        return axis.text(said["text"])
    if axis.legs is None:
        raise DetentError('job: got moves; expected: {"text": "..."}, for this axis prints; give it a text')
    return _places(said, leg)


def _places(said: Mapping[str, Any], leg: Callable[[str], Leg]) -> list[Leg]:
    """Places one after another, so many times."""
    rounds, rest, lines = said.get("rounds", 1), said.get("rest", 0.0), said["moves"]
    if not isinstance(lines, list) or not lines or not all(isinstance(one, str) for one in cast("list[Any]", lines)):
        raise DetentError(f'job: got moves {lines!r:.60}; expected: a list of places, such as ["5 mm", "load"]')
    lines = cast("list[str]", lines)
    if isinstance(rounds, bool) or not isinstance(rounds, int) or not 1 <= rounds <= MOST_MOVES // len(lines):
        most = MOST_MOVES // len(lines)
        raise DetentError(f"job: got rounds {rounds!r:.60}; expected: a whole number from 1 to {most}; correct it")
    if isinstance(rest, bool) or not isinstance(rest, int | float) or not 0 <= rest <= LONGEST_REST:
        raise DetentError(f"job: got rest {rest!r:.60}; expected: seconds from 0 to {LONGEST_REST:g}; correct it")
    made: list[Leg] = []
    for number, line in enumerate(lines, 1):
        try:
            made.append(leg(line)._replace(seconds=float(rest)))
        except DetentError as error:
            raise DetentError(f"job, line {number} ({short(line)}): {error}") from error
    return made * rounds


def _legs_of(axis: Live, job: Any) -> Sequence[Leg]:
    if axis.legs is None:
        raise DetentError("got a job; expected: commands without one, for this axis does none live; ask for moves")
    return axis.legs(job)


def _refuse_beyond(legs: Sequence[Leg], axis: Live) -> None:
    """Refuse a job of which a move leaves the limits, before anything of it moves."""
    q: Any = axis.live
    lowest, highest = (-math.inf, math.inf) if q.operation.endless else (q.operation.lowest, q.operation.highest)
    for number, leg in enumerate(legs, 1):
        if leg.kind == ops.MOVE_TO and not lowest <= leg.value <= highest:
            got, *ends = (format_place(one, axis.unit) for one in (leg.value, lowest, highest))
            raise DetentError(
                f"job, move {number}: got {got}; expected: a place from {ends[0]} to {ends[1]}; correct it"
            )
