"""All checks of a recording, in their order: the clock, the cells, the counters, then what physics says.

Each works on what the ones before have mended. Those up to the counters need the numbers of the file, as counters wrap
and clocks tick in these; the others need SI units.
"""

import numpy as np

from detent.logs.agreement import find_disagreements
from detent.logs.counters import mend_counters
from detent.logs.draft import Draft
from detent.logs.effort import find_wrong_effort
from detent.logs.missing import mend_missing
from detent.logs.saturation import find_saturation
from detent.logs.shifts import find_shifts
from detent.logs.stamps import look_at_clock, mend_clock
from detent.logs.stuck import find_stuck


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
