"""The clock of a recording: rows twice, out of order or with the same stamp, a clock that starts again, rows missing.

`mend_clock` works on the numbers of the file, `look_at_clock` on seconds.
"""

from bisect import bisect_right
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from detent.errors import InputError
from detent.logs.counters import unwrap_clock
from detent.logs.log import Action, Draft, Kind, Severity, Values, tell_count

FEWEST = 10  # samples that a recording must have
COARSE = 0.05  # share of repeated stamps from which the stamps are coarse: below it, rows were written twice
LONG = 20  # rows of a stretch from which a clock that goes back has started again: single rows are out of order
FARTHEST = 50  # rows by which a row out of order is put back into its place
_HOLE = 1.4  # usual steps between two rows from which a third is missing there
JITTER = 0.05  # deviation of a step from the usual one, as its share, from which it is irregular
_ODD = 0.25  # deviation of a single step worth a note


def mend_clock(draft: Draft) -> None:
    """Make the time strictly rising.

    In this order: rows without a time are removed; a clock that wraps is unwrapped; rows that are in the file twice are
    removed; of a clock that starts again the longest stretch is kept; rows out of order are put into their place or
    removed; repeated stamps are spread out if they are many, otherwise their rows are removed.
    """
    absent = np.isnan(draft.t)
    if absent.any():
        text = f"{tell_count(int(absent.sum()), 'row')} without a time"
        draft.note(Kind.MISSING_VALUES, "time", absent, text, Action.REMOVED)
        draft.keep(~absent)
    _check_length(draft)
    unwrap_clock(draft)
    _remove_twins(draft)
    _keep_longest(draft)
    _order_rows(draft)
    _spread_stamps(draft)
    _check_length(draft)


def _check_length(draft: Draft) -> None:
    if len(draft) < FEWEST:
        found = "; ".join(map(str, draft.findings))
        came = f"{tell_count(len(draft), 'usable row')}{f' ({found})' if found else ''}"
        remedy = "name another file, or say which column is the time"
        raise InputError.of_file(draft.file, came, f"at least {FEWEST} rows with a rising time", remedy)


def _remove_twins(draft: Draft) -> None:
    """Remove rows that say in every column what an earlier row says."""
    _, group, counts = np.unique(draft.t, return_inverse=True, return_counts=True)
    alike = np.flatnonzero(counts[group] > 1)
    again = np.zeros(len(draft), dtype=np.bool_)
    if len(alike):
        # Empty cells are alike, too: NaN would differ from itself.
        columns = [np.nan_to_num(values[alike], nan=np.inf) for values in draft.values.values()]
        _, first = np.unique(np.column_stack([draft.t[alike], *columns]), axis=0, return_index=True)
        again[np.delete(alike, first)] = True
    if again.any():
        text = f"{tell_count(int(again.sum()), 'row')} as an earlier one, stamp and all"
        draft.note(Kind.DUPLICATED_ROWS, "", again, text, Action.REMOVED)
        draft.keep(~again)


def _keep_longest(draft: Draft) -> None:
    """Keep the longest stretch of a clock that starts again.

    It does where it goes back and the rows behind lie before those in front, by their medians: a single row with a
    wrong stamp does not change these.
    """
    t = draft.t
    firsts = [0]
    for cut in (np.flatnonzero(np.diff(t) < 0) + 1).tolist():
        is_long = cut - firsts[-1] >= LONG and len(t) - cut >= LONG
        if is_long and np.median(t[cut : cut + LONG]) < np.median(t[cut - LONG : cut]):
            firsts.append(cut)
    if len(firsts) == 1:
        return
    bounds = [*firsts, len(t)]
    longest = int(np.argmax(np.diff(bounds)))
    away = np.ones(len(t), dtype=np.bool_)
    away[bounds[longest] : bounds[longest + 1]] = False
    begins = ", ".join(str(int(draft.rows[first])) for first in firsts[1:6])
    text = f"the clock starts again at row {begins}: {len(firsts)} recordings in one file; the longest is read"
    advice = "cut the file at these rows to read the others"
    draft.note(Kind.TIME_BACKWARDS, "time", away, text, Action.REMOVED, advice, Severity.ERROR)
    draft.keep(~away)


def _order_rows(draft: Draft) -> None:
    """Put rows out of order into their place if there is one for them nearby, otherwise remove them."""
    if not np.any(np.diff(draft.t) < 0):
        return
    rising = _longest_rising(draft.t)
    out = np.flatnonzero(~rising)
    kept = np.flatnonzero(rising)
    stamps = draft.t[kept]
    places = np.clip(np.searchsorted(stamps, draft.t[out]), 1, len(kept) - 1)
    near = np.abs(kept[places] - out) <= FARTHEST
    inside = (stamps[places - 1] < draft.t[out]) & (draft.t[out] < stamps[places])
    # A row that came late has left a hole; a wrong stamp falls between rows that lack nothing.
    hole = stamps[places] - stamps[places - 1] > _HOLE * np.median(np.diff(stamps))
    fits = near & inside & hole
    moved, lost = out[fits], out[~fits]
    if len(moved):
        text = f"{tell_count(len(moved), 'row')} written later than their neighbours"
        draft.note(Kind.TIME_BACKWARDS, "time", moved, text, Action.REORDERED)
    if len(lost):
        text = f"{tell_count(len(lost), 'row')} with a stamp that fits nowhere"
        draft.note(Kind.TIME_BACKWARDS, "time", lost, text, Action.REMOVED)
    draft.keep(np.setdiff1d(np.arange(len(draft)), lost))
    draft.keep(np.argsort(draft.t, kind="stable"))


def _longest_rising(t: Values) -> NDArray[np.bool_]:
    """Mask of the longest subsequence that never falls, by patience sorting."""
    tails: list[float] = []
    ends: list[int] = []
    before = np.full(len(t), -1, dtype=np.int64)
    for index, value in enumerate(t.tolist()):
        pile = bisect_right(tails, value)
        before[index] = ends[pile - 1] if pile else -1
        if pile == len(tails):
            tails.append(value)
            ends.append(index)
        else:
            tails[pile], ends[pile] = value, index
    chosen = np.zeros(len(t), dtype=np.bool_)
    index = ends[-1]
    while index >= 0:
        chosen[index] = True
        index = int(before[index])
    return chosen


def _spread_stamps(draft: Draft) -> None:
    """Make equal stamps different: spread rows evenly if there are many, keep the first of each if there are few."""
    again = np.r_[False, np.diff(draft.t) == 0]
    if not again.any():
        return
    share = again.mean()
    if share < COARSE:
        text = f"{tell_count(int(again.sum()), 'row')} with the stamp of the row before and other numbers"
        draft.note(Kind.REPEATED_STAMPS, "time", again, text, Action.REMOVED)
        draft.keep(~again)
        return
    text = f"stamps are coarser than the rows: {share:.0%} repeat the one before; rows spread out between them"
    draft.note(Kind.REPEATED_STAMPS, "time", again, text, Action.INTERPOLATED)
    firsts = np.flatnonzero(~again)
    sizes = np.diff(np.r_[firsts, len(draft)])
    widths = np.diff(draft.t[firsts])
    if not len(widths):
        draft.keep(~again)
        return
    widths = np.r_[widths, np.median(widths)]
    k = np.arange(len(draft), dtype=np.float64)
    draft.t = draft.t + (k - np.repeat(firsts, sizes)) * np.repeat(widths / sizes, sizes)
    # Stamps that lie within their resolution of a straight line are those of the line.
    slope, start = np.polyfit(k, draft.t, 1)
    line = start + slope * k
    if float(np.max(np.abs(line - draft.t))) <= float(np.median(widths)):
        draft.t = line


def look_at_clock(draft: Draft) -> None:
    """Find rows that are missing, and a clock that runs unevenly.

    Steps count in usual steps (the median). A recording is irregular if more than `JITTER` of its steps deviate from a
    whole number of usual ones by more than `JITTER`. Of an even recording, a step of 1.5 or more is rows missing; of an
    irregular one, a step of 2.5 or more, as a late row does not yet mean a lost one.
    """
    steps = np.diff(draft.t)
    usual = float(np.median(steps))
    ratio = steps / usual
    deviation = np.abs(ratio - np.maximum(1.0, np.rint(ratio)))
    is_uneven = float(np.mean(deviation > JITTER)) > JITTER
    gaps = np.flatnonzero(ratio >= (2.5 if is_uneven else 1.5))
    if is_uneven:
        low, high = np.percentile(ratio, [1, 99])
        text = (
            f"steps from {low:.2f} to {high:.2f} of the usual {usual * 1e3:.4g} ms (1 of 100 beyond); stamps are used"
        )
        draft.note(Kind.IRREGULAR_TIME, "time", [], text, Action.LEFT, "", Severity.NOTE)
    else:
        odd = np.flatnonzero((deviation > _ODD) & (ratio < 1.5))
        if len(odd):
            text = f"{tell_count(len(odd), 'step')} other than the usual {usual * 1e3:.4g} ms"
            draft.note(Kind.IRREGULAR_TIME, "time", odd + 1, text, Action.LEFT, "", Severity.NOTE)
    if len(gaps):
        lost = np.rint(ratio[gaps]).astype(np.int64) - 1
        text = f"about {tell_count(int(lost.sum()), 'row')} missing before these, at most {int(lost.max())} at once"
        draft.note(Kind.DROPPED_ROWS, "", gaps + 1, text, Action.LEFT)


def stretches(t: Values) -> list[slice]:
    """Stretches of samples without a gap: no step in them is 2.5 usual ones or more."""
    steps = np.diff(t)
    cuts = np.flatnonzero(steps >= 2.5 * np.median(steps)) + 1
    bounds = [0, *cuts.tolist(), len(t)]
    return [slice(first, last) for first, last in pairwise(bounds)]
