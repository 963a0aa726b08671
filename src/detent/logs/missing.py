"""Cells without a number."""

import numpy as np

from detent.logs.draft import Draft, tell_count
from detent.logs.log import Action, Kind, Severity

SLOW = frozenset({"supply", "temperature", "enabled"})
"""Signals that change slowly and are often recorded only now and then: they keep their last value."""

MOST = 0.1  # share of empty cells from which a signal is left out: with more, too many rows would go with them


def mend_missing(draft: Draft) -> None:
    """Deal with empty cells.

    A signal of `SLOW` keeps its last value. Of other signals one with more than `MOST` of its cells empty is left out;
    rows with empty cells of the rest are removed, so that what is left was measured.
    """
    absent = {role: np.isnan(values) for role, values in draft.values.items()}
    for role, gone in absent.items():
        if not gone.any():
            continue
        count = tell_count(int(gone.sum()), "cell")
        if gone.all() or (role not in SLOW and gone.mean() > MOST):
            advice = f"record {role} in every row" if not gone.all() else ""
            draft.note(Kind.MISSING_VALUES, role, gone, f"{count} of {len(draft)} empty", Action.LEFT_OUT, advice)
            del draft.values[role]
        elif role in SLOW:
            last = np.maximum.accumulate(np.where(gone, 0, np.arange(len(draft))))
            # Before the first value there is none to keep: that one it becomes.
            last[: int(np.argmin(gone))] = int(np.argmin(gone))
            draft.values[role] = draft.values[role][last]
            text = f"{count} empty, filled with the last value before"
            draft.note(Kind.MISSING_VALUES, role, gone, text, Action.INTERPOLATED, "", Severity.NOTE)
        else:
            draft.note(Kind.MISSING_VALUES, role, gone, f"{count} empty", Action.REMOVED)
    left = [absent[role] for role in draft.values if role not in SLOW]
    if left:
        draft.keep(~np.logical_or.reduce(left))
