"""Drives at their limit, and sensors at the end of their range."""

import numpy as np

from detent.logs.differences import runs_of
from detent.logs.draft import Draft, tell_count
from detent.logs.log import Action, Kind, Severity

LIMITED = ("command", "voltage", "current", "force", "torque")
"""Signals that a limit can cut off. Positions rest where they are told to, and a velocity has plateaus."""

SHORTEST = 3  # rows at the extreme value from which it is a plateau
FEWEST = 10  # rows at the extreme value, in plateaus, from which the signal is cut off there
FEWEST_LEVELS = 20  # different numbers below which a signal is one of levels, such as a square wave or a staircase

PILED = 3.0
"""Rows at the extreme value, in those at any one of the `NEIGHBOURS` numbers next to it, from which values are piled
up: a sine that was rounded has 1.4 times as many."""

NEIGHBOURS = 5

_FULL_SCALES = frozenset(
    {float(value) for bits in (8, 10, 12, 14, 15, 16) for value in (2**bits - 1, 2 ** (bits - 1))}
    | {1.0, 100.0, 1000.0}
)


def find_saturation(draft: Draft) -> None:
    """Find signals that stay at their largest or smallest value.

    A cut-off signal piles up at one number: it stays there for `SHORTEST` rows and more, and is there far more often
    than at any number beside it. That it is cut off, and not commanded so, is certain where the number is a full scale
    (255, 1023, 100) or both ends lie at the same distance from zero; otherwise it is noted only.
    """
    for role in LIMITED:
        if role in draft.values and len(np.unique(draft.values[role])) >= FEWEST_LEVELS:
            _find(draft, role, 1.0)
            _find(draft, role, -1.0)


def _find(draft: Draft, role: str, side: float) -> None:
    """Find a plateau at the largest value, or at the smallest for side -1."""
    values = draft.values[role]
    levels, counts = np.unique(side * values, return_counts=True)
    is_end = side * values == levels[-1]
    runs = runs_of(is_end)
    is_piled = counts[-1] >= max(FEWEST, PILED * float(counts[-1 - NEIGHBOURS : -1].max(initial=0)))
    if is_piled and (runs[:, 1] - runs[:, 0]).max() >= SHORTEST:
        end, where, factor = side * float(levels[-1]), np.flatnonzero(is_end), abs(draft.sources[role].factor)
        is_symmetric = bool(np.isclose(values.max(), -values.min(), rtol=1e-3))
        is_full = any(np.isclose(abs(end) / factor, scale, rtol=1e-9) for scale in _FULL_SCALES)
        severity = Severity.WARNING if is_symmetric or is_full else Severity.NOTE
        why = "as far as the other end" if is_symmetric else "a full scale" if is_full else "cut off, or commanded so"
        shown = f"{end:.4g} {draft.units[role]}".rstrip()
        text = f"stays at {shown} ({why}) in {tell_count(len(where), 'row')}"
        advice = "leave these rows out of a fit of the loop; a fit of the axis may keep them"
        draft.note(Kind.SATURATED, role, where, text, Action.LEFT, advice, severity)
