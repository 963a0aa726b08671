"""Counters that wrap, and signed numbers that were read as unsigned: found in the numbers of the file, and undone."""

import math

import numpy as np
from numpy.typing import NDArray

from detent.logs.log import Action, Draft, Kind, Values, tell_count

WIDTHS = (16, 32)  # bits of counters that are tried where none are stated
POSITIONS = ("position", "position_load", "reference")  # signals that come from counters

SMALL = 1 / 8
"""Step across the end of a counter, as a share of its range, up to which it is a wrap: an axis moves less than an
eighth of the range from row to row, or the direction of its motion could hardly be told either."""

USUAL = 3.0
"""Step across the end of a counter, in steps of the rows around, up to which it is a wrap: a counter that was set to
zero steps by any amount."""

AROUND = 5  # rows to either side whose steps are the usual ones
_FREE = 8.0  # step that is believed whatever the rows around do [numbers of the file]: an axis may start right there


def unwrap_clock(draft: Draft) -> None:
    """Undo the wraps of a clock that counts whole milliseconds or microseconds in 16 or 32 bits.

    It goes back by nearly the whole range, and the step is a usual one then.
    """
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
    """Give numbers their sign back that were written with one and read without.

    Such numbers lie near zero and near the top of 16 or 32 bits, with nothing between: none in the middle half of the
    range. With only two or less different numbers they could be a switch, and are left.
    """
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
    text = f"{tell_count(int(negative.sum()), 'number')} above {modulus / 2 - 1:.0f} are negative ones of {bits} bits"
    draft.note(Kind.UNSIGNED, role, negative, f"{text}: it goes from {low:g} to {high:g}", Action.UNWRAPPED)
