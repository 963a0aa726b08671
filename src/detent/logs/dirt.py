"""All checks of a recording, in their order: the clock, the cells, the counters, then what physics says.

Each works on what the ones before have mended. Those up to the counters need the numbers of the file, as counters wrap
and clocks tick in these; the others need SI units.
"""

from detent.logs.agreement import find_disagreements
from detent.logs.counters import mend_counters
from detent.logs.delays import take_out_delays
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
