"""The clock of a recording and its counters: rows twice, out of order or missing, numbers that wrap or lost a sign.

`mend_clock` and `mend_counters` work on the numbers of the file, `look_at_clock` on seconds.
"""

import math
from bisect import bisect_right
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from detent.errors import InputError
from detent.logs.log import Action, Draft, Kind, Severity, Values, tell_count

FEWEST = 10  # samples that a recording must have
COARSE = 0.05  # share of repeated stamps from which the stamps are coarse: below it, rows were written twice
LONG = 20  # rows of a stretch from which a clock that goes back has started again: single rows are out of order
FARTHEST = 50  # rows by which a row out of order is put back into its place
_HOLE = 1.4  # usual steps between two rows from which a third is missing there
JITTER = 0.05  # deviation of a step from the usual one, as its share, from which it is irregular
_ODD = 0.25  # deviation of a single step worth a note
# Change of the step along a recording, over the step, from which the clock drifts, and in the usual change from one
# step to the next: what comes unevenly is a sampler that waits, and its stamps are right. So is a solver that chooses
# its steps, which change by more.
DRIFTS, EVENLY, CHOSEN = 0.02, 10.0, 0.5
STEADY = 0.25  # share of the change between neighbouring parts, at most: turns of samplers come more suddenly
MOST_PARTS = 128  # of a recording whose mean steps are compared
WIDTHS = (16, 32)  # bits of counters that are tried where none are stated
POSITIONS = ("position", "position_load", "reference")  # signals that come from counters

# Step across the end of a counter, as a share of its range, up to which it is a wrap: with more than an eighth of the
# range from row to row the direction of a motion could hardly be told. And in steps of the rows around: a counter that
# was set to zero steps by any amount.
SMALL, USUAL = 1 / 8, 3.0
AROUND = 5  # rows to either side whose steps are the usual ones
_FREE = 8.0  # step that is believed whatever the rows around do [numbers of the file]: an axis may start right there


def mend_clock(draft: Draft) -> None:
    """Make the time strictly rising: each step works on what the ones before it have left."""
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
        got = f"{tell_count(len(draft), 'usable row')}{f' ({found})' if found else ''}"
        remedy = "name another file, or say which column is the time"
        raise InputError.of_file(draft.file, got, f"at least {FEWEST} rows with a rising time", remedy)


def _remove_twins(draft: Draft) -> None:
    """Remove rows that say in every column what an earlier row says."""
    if np.all(np.diff(draft.t) > 0):
        return
    _, group, counts = np.unique(draft.t, return_inverse=True, return_counts=True)
    alike = np.flatnonzero(counts[group] > 1)
    again = np.zeros(len(draft), dtype=np.bool_)
    if len(alike):
        # Empty cells are alike, too: NaN would differ from itself.
        columns = [np.nan_to_num(values[alike], nan=np.inf) for values in draft.values.values()]
        _, first = np.unique(np.column_stack([draft.t[alike], *columns]), axis=0, return_index=True)
        again[np.delete(alike, first)] = True
    if again.any():
        text = f"{tell_count(int(again.sum()), 'row')} identical to an earlier one, including the time stamp"
        draft.note(Kind.DUPLICATED_ROWS, "", again, text, Action.REMOVED)
        draft.keep(~again)


def _keep_longest(draft: Draft) -> None:
    """Keep the longest stretch of a clock that starts again."""
    # It goes back, and the rows behind lie before those in front by their medians, which no single wrong stamp changes.
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
    if float(np.min(t[firsts[1:]] - t[0])) > 0.5 * float(np.min(t[np.array(firsts[1:]) - 1] - t[0])):
        back = float(np.max(t[np.array(firsts[1:]) - 1] - t[firsts[1:]]))
        text = f"the clock is set back at row {begins}, by up to {back:.3g}: how fast it runs is not known"
        advice = "record the time by a clock that nobody sets, or identify parts alone"
        draft.note(Kind.DRIFTING_CLOCK, "time", firsts[1:], text, Action.LEFT, advice, Severity.ERROR)
    text = f"the clock restarts at row {begins}: {len(firsts)} recordings in one file; the longest is read"
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
    usual = np.median(np.diff(stamps)) if len(stamps) > 1 else np.inf  # of a clock that only falls one row is left
    hole = stamps[places] - stamps[places - 1] > _HOLE * usual
    fits = near & inside & hole
    moved, lost = out[fits], out[~fits]
    if len(moved):
        text = f"{tell_count(len(moved), 'row')} written out of order"
        draft.note(Kind.TIME_BACKWARDS, "time", moved, text, Action.REORDERED)
    if len(lost):
        text = f"{tell_count(len(lost), 'row')} with an inconsistent time stamp"
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
        text = f"{tell_count(int(again.sum()), 'row')} with the time stamp of the previous row but different numbers"
        draft.note(Kind.REPEATED_STAMPS, "time", again, text, Action.REMOVED)
        draft.keep(~again)
        return
    text = (
        f"time stamps are coarser than the rows: {share:.0%} repeat the previous one; rows are spread evenly between "
        "them"
    )
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
    """Find rows that are missing, and a clock that runs unevenly: `JITTER` of its steps deviate by more than that."""
    ratio, is_uneven = in_usual_steps(draft.t)
    usual, deviation = float(np.median(np.diff(draft.t))), np.abs(ratio - np.maximum(1.0, np.rint(ratio)))
    gaps = np.flatnonzero(is_gap(ratio, is_uneven=is_uneven))
    if is_uneven:
        low, high = np.percentile(ratio, [1, 99])
        step = f"the usual {usual * 1e3:.4g} ms"
        text = f"steps from {low:.2f} to {high:.2f} of {step} (1 in 100 outside); time stamps are used"
        draft.note(Kind.IRREGULAR_TIME, "time", [], text, Action.LEFT, "", Severity.NOTE)
    else:
        odd = np.flatnonzero((deviation > _ODD) & (ratio < 1.5))
        if len(odd):
            text = f"{tell_count(len(odd), 'step')} other than the usual {usual * 1e3:.4g} ms"
            draft.note(Kind.IRREGULAR_TIME, "time", odd + 1, text, Action.LEFT, "", Severity.NOTE)
    if drift := _drift(np.diff(draft.t)[~is_gap(ratio, is_uneven=is_uneven)]):
        least, most = drift
        span = f"{least * 1e3:.4g} and {most * 1e3:.4g} ms"
        text = f"steps go evenly between {span}: sampler and clock do not run together"
        advice = "record time and rows by one clock, or identify parts alone"
        draft.note(Kind.DRIFTING_CLOCK, "time", [], text, Action.LEFT, advice, Severity.ERROR)
    if len(gaps):
        lost = [round(one) - 1 for one in ratio[gaps].tolist()]  # a stamp far off makes more of them than 64 bits hold
        text = f"about {tell_count(sum(lost), 'row')} missing before these, at most {max(lost)} at once"
        draft.note(Kind.DROPPED_ROWS, "", gaps + 1, text, Action.LEFT)


def in_usual_steps(t: Values) -> tuple[Values, bool]:
    """Steps of a clock in the usual one, the median, and whether they are uneven."""
    steps = np.diff(t)
    ratio = steps / np.median(steps)
    return ratio, float(np.mean(np.abs(ratio - np.maximum(1.0, np.rint(ratio))) > JITTER)) > JITTER


def is_gap(ratio: Values, *, is_uneven: bool) -> NDArray[np.bool_]:
    """True for each step, in the usual one, across which rows are missing."""
    # Of an even recording, that is a step of 1.5 usual ones; of an irregular one, of 2.5, as a late row does not yet
    # mean a lost one.
    return ratio >= (2.5 if is_uneven else 1.5)


def _drift(steps: Values) -> tuple[float, float] | None:
    """Shortest and longest mean steps of a clock that drifts from the one to the other, once or often; else None."""
    if len(steps) < 8 * FEWEST:
        return None
    means = np.array([float(part.mean()) for part in np.array_split(steps, min(len(steps) // FEWEST, MOST_PARTS))])
    usual, span = float(np.median(means)), float(np.ptp(means))
    scatter = float(np.median(np.abs(np.diff(steps))))
    # A sampler that takes more turns in a part of a run does so from one row to the next.
    is_steady = float(np.abs(np.diff(means)).max()) < STEADY * span
    if not DRIFTS * usual <= span <= CHOSEN * usual or span < EVENLY * scatter or not is_steady:
        return None
    return float(means.min()), float(means.max())


def stretches(t: Values) -> list[slice]:
    """Stretches of samples without a gap: no step in them is 2.5 usual ones or more."""
    steps = np.diff(t)
    cuts = np.flatnonzero(steps >= 2.5 * np.median(steps)) + 1
    bounds = [0, *cuts.tolist(), len(t)]
    return [slice(first, last) for first, last in pairwise(bounds)]


# ---- counters that wrap, and signed numbers that were read as unsigned


def unwrap_clock(draft: Draft) -> None:
    """Undo the wraps of a clock of whole milli- or microseconds in 16 or 32 bits: back by all but a usual step."""
    steps = np.diff(draft.t)
    usual = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0
    is_count = _are_whole(draft.t) and draft.t.min() >= 0
    for modulus, bits in [(2.0**bits, bits) for bits in WIDTHS if is_count and draft.t.max() < 2.0**bits]:
        where = np.flatnonzero((steps < 0) & (steps + modulus > 0) & (steps + modulus < 10 * usual))
        if len(where):
            draft.t = draft.t + modulus * np.cumsum(np.bincount(where + 1, minlength=len(draft)))
            text = f"the clock wraps at {bits} bits, {tell_count(len(where), 'time')}"
            draft.note(Kind.WRAPPED_COUNTER, "time", where + 1, text, Action.UNWRAPPED)
            return


def mend_counters(draft: Draft) -> None:
    """Undo the wraps of counters, and the reading of signed numbers as unsigned."""
    for role in list(draft.values):
        values = draft.values[role]
        if role in POSITIONS:
            for modulus, text in _ranges(draft, role):
                where = find_wraps(values, draft.t, modulus, is_stated=role in draft.bits)
                if len(where):
                    draft.values[role] = unwrap(values, where, modulus)
                    shown = f"{text}, {tell_count(len(where), 'time')}"
                    draft.note(Kind.WRAPPED_COUNTER, role, where, shown, Action.UNWRAPPED)
                    break
        elif role not in {"enabled", "supply"}:
            _mend_unsigned(draft, role)


def _ranges(draft: Draft, role: str) -> list[tuple[float, str]]:
    """Ranges in which a position could wrap, in numbers of the file, with the words for each."""
    values = draft.values[role]
    found: list[tuple[float, str]] = []
    if role in draft.bits:
        return [(2.0 ** draft.bits[role], f"the counter wraps at {draft.bits[role]} bits")]
    if _are_whole(values):
        found = [(2.0**bits, f"the counter wraps at {bits} bits") for bits in WIDTHS]
    if draft.units[role] == "rad":
        found.append((2 * math.pi / abs(draft.sources[role].factor), "the angle wraps at a whole turn"))
    return [(modulus, text) for modulus, text in found if float(np.ptp(values)) <= modulus * (1 + 1e-6)]


def _are_whole(values: Values) -> bool:
    return bool(np.all(values == np.rint(values)))


def find_wraps(values: Values, t: Values, modulus: float, *, is_stated: bool = False) -> NDArray[np.intp]:
    """Find where a counter wraps.

    A wrap is a step of more than half the range that becomes a small one, below `SMALL` of the range and `USUAL` times
    as fast as the rows around, if the range is added or subtracted. Where the user states the range, half of it is
    enough.

    >>> counter = np.array([65500.0, 65520, 4, 24])
    >>> find_wraps(counter, np.arange(4.0), 65536)
    array([2])
    """
    steps = np.diff(values)
    large = np.flatnonzero(np.abs(steps) > modulus / 2)
    true = np.abs(steps[large] - np.copysign(modulus, steps[large]))
    if is_stated:
        return large + 1
    rates = np.abs(steps) / np.diff(t)
    rates[large] = 0.0
    moving = np.abs(steps)[(steps != 0) & (np.abs(steps) <= modulus / 2)]
    # At rest a counter may begin with any step that it usually makes.
    free = max(min(_FREE, SMALL * modulus), USUAL * float(np.median(moving)) if len(moving) else 0.0)
    believed = [rates[max(0, index - AROUND) : index + AROUND + 1].max() * (t[index + 1] - t[index]) for index in large]
    fits = (true <= SMALL * modulus) & (true <= USUAL * np.array(believed) + free)
    return large[fits] + 1


def unwrap(values: Values, where: NDArray[np.intp], modulus: float) -> Values:
    """Undo wraps."""
    turns = np.zeros(len(values))
    turns[where] = -np.sign(values[where] - values[where - 1])
    return values + modulus * np.cumsum(turns)


def _mend_unsigned(draft: Draft, role: str) -> None:
    """Give numbers their sign back that were written with one and read without."""
    # They lie near zero and near the top of 16 or 32 bits, none in the middle half; of only two it could be a switch.
    values = draft.values[role]
    widths = [draft.bits[role]] if role in draft.bits else WIDTHS
    bits = next((width for width in widths if values.max() < 2.0**width), None)
    if bits is None or not _are_whole(values) or values.min() < 0:
        return
    modulus = 2.0**bits
    negative = values >= modulus / 2
    middle = (values > modulus / 4) & (values < modulus * 3 / 4)
    if not negative.any() or negative.all() or middle.any() or len(np.unique(values)) < 3:
        return
    draft.values[role] = np.where(negative, values - modulus, values)
    low, high = draft.values[role].min(), draft.values[role].max()
    text = (
        f"{tell_count(int(negative.sum()), 'number')} above {modulus / 2 - 1:.0f} are negative numbers of {bits} bits"
    )
    draft.note(Kind.UNSIGNED, role, negative, f"{text}: it goes from {low:g} to {high:g}", Action.UNWRAPPED)
