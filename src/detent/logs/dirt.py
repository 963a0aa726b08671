"""All checks of a recording, in their order: the clock, the cells, the counters, then what physics says.

Each works on what the ones before have mended. Those up to the counters need the numbers of the file, as counters wrap
and clocks tick in these; the others need SI units.
"""

import numpy as np

from detent.logs.agreement import find_disagreements
from detent.logs.counters import mend_counters
from detent.logs.draft import Draft, tell_count
from detent.logs.effort import find_wrong_effort
from detent.logs.log import Action, Kind, Severity
from detent.logs.saturation import find_saturation
from detent.logs.shifts import find_shifts
from detent.logs.stamps import look_at_clock, mend_clock
from detent.logs.stuck import find_stuck

SLOW = frozenset({"supply", "temperature", "enabled"})  # recorded only now and then: they keep their last value
MOST = 0.1  # share of empty cells from which a signal is left out: with more, too many rows would go with them


def clean(draft: Draft) -> None:
    """Find and mend what is wrong with a recording; afterwards it is in SI units."""
    mend_clock(draft)
    mend_missing(draft)
    mend_counters(draft)
    draft.convert()
    take_out_delays(draft)
    look_at_clock(draft)
    find_stuck(draft)
    find_saturation(draft)
    find_disagreements(draft)
    find_shifts(draft)
    find_wrong_effort(draft)


def take_out_delays(draft: Draft) -> None:
    """Take stated delays out, by straight lines between samples; samples without values on both sides are removed."""
    if not draft.delays:
        return
    inside = np.ones(len(draft), dtype=np.bool_)
    for role, delay in draft.delays.items():
        if role in draft.values:
            moments = draft.t + delay
            draft.values[role] = np.interp(moments, draft.t, draft.values[role])
            inside &= (moments >= draft.t[0]) & (moments <= draft.t[-1])
    draft.keep(inside)


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
