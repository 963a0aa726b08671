"""Rows that cannot follow one another: spikes, jumps, rows lost or twice without trace; columns that are copies.

A position moves over a row by about as much as over the rows around it. What is off by far more, and comes back within
a few rows, is a spike; what stays off is a jump: of a counter, of a coupling, or of the clock, where rows were lost. Of
an effort, which may jump, only what leaves all that it is otherwise, or falls to exactly 0, and comes back is a spike.
"""

import numpy as np
from numpy.typing import NDArray

from detent.logs.differences import MOST_ROWS, grain, median_of_nine, runs_of
from detent.logs.headings import EFFORTS
from detent.logs.log import Action, Draft, Kind, Severity, Values, tell_count

AROUND = 9  # rows whose median is the usual way of a row
# Way of a row beyond the usual one, in the 95th percentile of that in motion, from which it is a spike, or a jump.
FAR, FARTHER = 8.0, 20.0
GRAINS = 6.0  # and in what the sensor tells
BACK = 10  # rows of a spike, at most
RETURNS = 0.3  # part of a spike that may be left of it when it is over
BEYOND, SHORT = 1.0, 1  # by how much of its usual range spikes of an effort lie beyond it, and their rows, at most
MOST = 0.02  # share of rows in spikes from which they are the signal
NOISY, REPEATS = 0.02, 3  # share of rows equal to the one before below which a signal is noise, and zeros then too many
FEWEST_LEVELS = 50  # numbers of an effort from which a zero between others is none of its levels
FILLED, HEAPED, SUDDEN = 5e-3, 10.0, 8.0  # share of rows, in that of the next number; jump to it, in the usual change
CLEAR = 16.0  # usual way of a row, in grains, from which it tells whether rows are missing
QUICK = 0.1  # and in the top speed: where moves meet, a reference may rest for a row
EVEN = 0.05  # spread of the ways around, in the usual one, up to which they do
NEAR = 0.06  # distance of a way from a whole multiple of the usual one, in it
FEWEST_LOST = 3  # rows lost or twice from which the clock is wrong, and their share of the rows that can tell it
SHARE_LOST = 5e-4
COPIED = 0.51  # largest distance of a position from a reference, in counts, up to which it is a copy of it
_POSITIONS = ("position", "position_load")
Mask = NDArray[np.bool_]


def mend_jumps(draft: Draft) -> None:
    """Find rows that cannot follow one another; take spikes out."""
    if len(draft) < 10 * AROUND:
        return
    for role in ("reference", "position"):
        if role in draft.values and _find_lost_rows(draft, role):
            break
    for role in _POSITIONS:
        if role in draft.values:
            _mend_position(draft, role)
    for role in EFFORTS:
        if role in draft.values:
            _mend_effort(draft, role)


def _ways(draft: Draft, role: str) -> tuple[Values, Values]:
    """Way of each row to the next, for a usual row, and the usual one around it."""
    steps = np.diff(draft.t)
    ways = np.diff(draft.values[role]) * (float(np.median(steps)) / steps)
    return ways, median_of_nine(ways)


def _find_lost_rows(draft: Draft, role: str) -> bool:
    """Find ways that are none, or whole multiples of those around, while the clock says that no row is missing."""
    ways, usual = _ways(draft, role)
    spread = median_of_nine(np.abs(ways - usual))
    size = np.abs(usual)
    least = max(CLEAR * grain(draft.values[role]), QUICK * float(np.quantile(size, 0.98)))
    tells = (size > least) & (spread < EVEN * size)
    ratio = ways / np.where(tells, usual, 1.0)
    whole = np.rint(ratio)
    off = tells & (np.abs(ratio - whole) < NEAR) & (whole >= 0) & (whole != 1) & (whole < 20)
    # A turn, a start or a stop is slower or faster for more than a row.
    off[1:] &= ~off[:-1] | (ratio[1:] > 1.0)
    lost, twice = off & (whole > 1), off & (whole == 0)
    kinds = [(lost, "lost"), (twice, "written twice")]
    told = False
    for found, what in kinds:
        count = int(np.count_nonzero(found))
        if count >= FEWEST_LOST and count > SHARE_LOST * np.count_nonzero(tells):
            text = f"{tell_count(count, 'row')} {what} without trace in the time: the {role} moves by "
            text += "whole multiples of its usual way there" if what == "lost" else "nothing there"
            advice = "record the time of each row with the row"
            where = np.flatnonzero(found) + 1
            draft.note(Kind.DROPPED_ROWS, "time", where, text, Action.LEFT, advice, Severity.ERROR)
            told = True
    return told


def _mend_position(draft: Draft, role: str) -> None:
    """Take spikes of a position out; name its jumps."""
    values = draft.values[role]
    ways, usual = _ways(draft, role)
    off = np.abs(ways - usual)
    moving = off[(usual != 0.0) | (off > 0.0)]
    if len(moving) < AROUND:
        return
    usually, least = float(np.quantile(moving, 0.95)), max(GRAINS * grain(values), 1e-12 * float(np.abs(values).max()))
    places = np.flatnonzero(off > max(FAR * usually, least))
    if not len(places) or len(places) > MOST * len(values):
        return
    spikes, jumps = _paired(ways - usual, places)
    if spikes.any():
        draft.values[role] = _bridged(values, spikes)
        _tell_spikes(draft, role, spikes, float(off[places].max()))
    # What a motion at the top speed of the log could be is no jump: a motor that starts between two slow samples.
    jumps = [k for k in jumps if off[k] > max(FARTHER * usually, float(np.quantile(np.abs(ways), 0.98)))]
    if jumps:
        most = float(np.abs((ways - usual)[jumps]).max())
        text = f"jumps by up to {most:.3g} {draft.units[role]}, which no motion around it explains"
        advice = "look for lost counts, a coupling that slips, or rows that were lost"
        draft.note(Kind.JUMPS, role, np.array(jumps) + 1, text, Action.LEFT, advice)


def _paired(ways: Values, places: NDArray[np.intp]) -> tuple[Mask, list[int]]:
    """Rows between a way out and the way back, and ways that have none."""
    inside = np.zeros(len(ways) + 1, dtype=np.bool_)
    single: list[int] = []
    left = places.tolist()
    while left:
        first = left.pop(0)
        near = [k for k in left if k - first <= BACK]
        back = next((k for k in near if abs(ways[first : k + 1].sum()) < RETURNS * abs(ways[first])), None)
        if back is None:
            single.append(first)
            continue
        inside[first + 1 : back + 1] = True
        left = [k for k in left if k > back]
    return inside, single


def _bridged(values: Values, gone: Mask) -> Values:
    """Values with straight lines over some of them."""
    rows = np.arange(len(values), dtype=np.float64)
    return np.interp(rows, rows[~gone], values[~gone])


def _tell_spikes(draft: Draft, role: str, spikes: Mask, most: float) -> None:
    text = f"{tell_count(len(runs_of(spikes)), 'spike')} of up to {most:.3g} {draft.units[role]}".rstrip()
    draft.note(Kind.SPIKES, role, spikes, text, Action.INTERPOLATED, "check the cable and its screen")


def _mend_effort(draft: Draft, role: str) -> None:
    """Take spikes of an effort out: few rows beyond its range, few that fall to exactly 0, and what filled gaps."""
    values = draft.values[role]
    spikes = _beyond(values) | _dropped(values)
    spikes &= spikes.mean() < MOST
    if (filler := _filler(values)) is not None:
        spikes |= _short(values == filler, BACK)
    if spikes.any():
        most = float(np.abs(values[spikes] - _bridged(values, spikes)[spikes]).max())
        draft.values[role] = _bridged(values, spikes)
        _tell_spikes(draft, role, spikes, most)


def _beyond(values: Values) -> Mask:
    """Short stretches that lie beyond all that is usual by far, and as far from the rows around: no top of a course."""
    low, high = (float(q) for q in np.quantile(values, (0.01, 0.99)))
    reach = BEYOND * (high - low)
    found = _short((values < low - reach) | (values > high + reach), SHORT)
    return found & (np.abs(values - _bridged(values, found)) > reach)


def _filler(values: Values) -> float | None:
    """Number other than 0 that rows were filled with: it comes far more often than any other, and out of nothing."""
    numbers, counts = np.unique(values[:: max(len(values) // MOST_ROWS, 1)], return_counts=True)
    if len(numbers) < FEWEST_LEVELS:
        return None
    most, (next_one, often) = float(numbers[np.argmax(counts)]), np.partition(counts, -2)[-2:].tolist()
    rows = np.flatnonzero(values[1:] == most)
    if not most or often < HEAPED * next_one or len(rows) < FILLED * len(values):
        return None
    ways = np.abs(np.diff(values))
    return most if float(np.mean(ways[rows] > SUDDEN * float(np.median(ways)))) > 0.5 else None


def _dropped(values: Values) -> Mask:
    """Short stretches of exactly 0 between values of one sign that are far from it."""
    none = values == 0.0
    if not none.any() or len(np.unique(values)) < FEWEST_LEVELS:
        return np.zeros(len(values), dtype=np.bool_)
    changes = np.abs(np.diff(values))
    usual = float(np.quantile(changes[changes > 0.0], 0.9))
    outside = changes[~(none[1:] & none[:-1])]
    is_noisy = np.count_nonzero(outside) > (1.0 - NOISY) * len(outside)  # then 0 is no number that it repeats
    found = np.zeros(len(values), dtype=np.bool_)
    for first, last in runs_of(_short(none, BACK)).tolist():
        if first == 0 or last == len(values):  # a drive that is not switched on yet, or no more
            continue
        before, behind = float(values[first - 1]), float(values[last])
        is_far = before * behind > 0.0 and min(abs(before), abs(behind)) > 4.0 * usual
        found[first:last] = is_far or (is_noisy and last - first >= REPEATS)
    return found


def _short(mask: Mask, rows: int) -> Mask:
    """Only the runs of no more than so many rows."""
    found = np.zeros(len(mask), dtype=np.bool_)
    for first, last in runs_of(mask).tolist():
        found[first:last] = last - first <= rows
    return found


def find_copies(draft: Draft) -> None:
    """Find a reference that is the position, or that one in counts: one of the two was not recorded."""
    if not {"position", "reference"} <= draft.values.keys():
        return
    position, reference = draft.values["position"], draft.values["reference"]
    apart, way = np.abs(position - reference), float(np.ptp(position))
    count = grain(position)
    is_same = float(apart.max()) <= 1e-9 * way
    if way > 0.0 and (is_same or (way > 200.0 * count and float(np.quantile(apart, 0.999)) <= COPIED * count)):
        what = "in every row" if is_same else f"to half a count of {count:.3g} {draft.units['position']}"
        text = f"is the position {what}: one of the two was not recorded"
        advice = "record what the encoder says; a log without a reference is read too: reference="
        draft.note(Kind.COPIED, "reference", [], text, Action.LEFT, advice, Severity.ERROR)
