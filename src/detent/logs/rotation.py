"""Columns that are rotated against the header: found by the column in which the clock really runs.

They are put right where the file cannot be read otherwise, and where a person says so; never what a person has stated.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from detent.files.text import short
from detent.logs.differences import fill_holes, runs_of
from detent.logs.headings import words_of
from detent.logs.log import Action, Finding, Kind, Values, row_ranges, tell_count
from detent.logs.raw_table import BrokenRow, RawTable

SHORTEST = 10
"""Rows in which a column must run like a clock to be taken for one: a signal that happens to rise as evenly as a clock
for so long, while the clock does not, is not met by chance."""

_HOLE = 3  # rows in which a clock may stumble (a row dropped, a row doubled) without ending the stretch
_EVEN = 0.5  # a clock's step is within this share of the usual one
_ROUNDING = 0.02
_MOSTLY, _HALF, _MANY, _FEW = 0.9, 0.5, 0.1, 0.02
_WHOLE = 0.95
_COUNTERS = frozenset({"sample", "index", "row", "number", "line"})


Rotation = tuple[int, NDArray[np.bool_]]  # by how many columns cells stand right of their headings, in which rows


def is_clock(values: Values) -> bool:
    """Whether a column rises, and hardly ever goes back: it may be coarse, and stumble."""
    steps = np.diff(values[np.isfinite(values)])
    return bool(np.any(steps > 0)) and float(np.mean(steps < 0)) <= _FEW


def mend_rotation(table: RawTable, time: str, *, is_stated: bool = False, is_accepted: bool = False) -> None:
    """Find rows whose cells are rotated against the header; `is_accepted`: a person says that they are.

    Where the column called time does not run at all or jumps about, and another runs like a clock for `SHORTEST` rows,
    the cells are rotated by the distance of the two. If the first row lacks as many cells as the others have too many
    in front, the lines of the file are broken in the wrong places: the first cells of a line belong to the row before.

    Rows that are rotated where others are not are left out, and the columns of a file of which any `is_stated` stay
    where they are; a file in which no clock runs is put right, and what then stands where is told.
    """
    if len(table.rows) < SHORTEST:
        return
    names = list(table.columns)
    series = [table.columns[name] for name in names]
    # A clock that runs in most rows tells the step that it has in the others. One that does not is asked elsewhere.
    ours = series[names.index(time)]
    own = _usual_step(ours)
    runs, back = np.mean(np.abs(np.diff(ours) - own) <= _EVEN * own), np.mean(np.diff(ours) < 0)
    found = _best_rotation(series, names, names.index(time), own) if runs > _HALF else None
    if found is None and (runs <= _HALF or back > _MANY):
        found = _best_rotation(series, names, names.index(time), None)
    if found is None:
        return
    matrix = np.column_stack(series)
    shift, where = found
    is_whole = runs <= _HALF or where.mean() > _WHOLE
    head = _head(table, matrix, names.index(time), shift) if where.mean() > _WHOLE else None
    column, unit = names[(names.index(time) + shift) % len(names)], tell_count(shift, "column")
    text = f'the clock runs in "{short(column)}", not in "{short(time)}": cells are shifted {unit} to the right'
    told, advice = row_ranges(table.rows[where]), ""
    if head is not None:
        matrix = _reflow(table, matrix, shift, head)
        told, text, action = row_ranges(table.rows), f"{text}; line breaks are misplaced", Action.REORDERED
    elif is_accepted or (is_whole and not is_stated):
        matrix[where] = np.roll(matrix[where], -shift, axis=1)
        text, action = f"{text}; now {_ranges(matrix[where], names)}", Action.REORDERED
        advice = "" if is_accepted else f"if that is not so, state the columns, as in time={short(column)}"
    elif is_whole:
        action, advice = Action.LEFT, f"state time={short(column)}, or that the cells are rotated: rotated=yes"
    else:
        matrix, table.rows = matrix[~where], table.rows[~where]
        action, advice = Action.REMOVED, "state rotated=yes to put their cells back"
    table.columns = {name: matrix[:, index] for index, name in enumerate(names)}
    table.findings.append(Finding(Kind.ROTATED_COLUMNS, "", told, text, action, advice))


def _ranges(matrix: Values, names: list[str]) -> str:
    """What each column holds, lowest to highest."""
    low, high = np.nanmin(matrix, axis=0), np.nanmax(matrix, axis=0)
    return ", ".join(f'"{short(name)}" {low[k]:.4g} to {high[k]:.4g}' for k, name in enumerate(names))


def _best_rotation(series: Sequence[Values], names: list[str], clock: int, step: float | None) -> Rotation | None:
    """The rotation that the most rows have, of those that bring a clock into its place: of a step, or of its own."""
    # A motion may run like a clock, too, in as many rows, but not as exactly by its step.
    best: Rotation | None = None
    most = 0.0
    for shift in range(1, len(names)):
        column = (clock + shift) % len(names)
        if not _COUNTERS & set(words_of(names[column])):
            theirs = series[column]
            usual = _usual_step(theirs) if step is None else step
            where = _rotated_rows(series[clock], theirs, usual, is_partial=step is not None)
            steps = _missed(np.diff(theirs), usual)[where[1:] & where[:-1]] if where.any() else np.ones(1)
            if (score := float(np.sum(1.0 - steps))) > most:
                best, most = (shift, where), score
    return best


def _usual_step(values: Values) -> float:
    """Median of the steps upwards."""
    steps = np.diff(values)
    return float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0


def _rotated_rows(clock: Values, column: Values, step: float, *, is_partial: bool) -> NDArray[np.bool_]:
    """Rows in which a column runs like a clock while the clock does not."""
    where = np.zeros(len(clock), dtype=np.bool_)
    if not step:
        return where
    own, theirs, usual = np.diff(clock), np.diff(column), _usual_step(clock)
    with np.errstate(invalid="ignore"):
        runs = np.abs(theirs - step) <= _EVEN * step
        own_runs = (np.abs(own - usual) <= _EVEN * usual) | (np.abs(own - step) <= _EVEN * step)
        if is_partial:  # where the clock runs in most rows, it is known how evenly
            away = np.abs(own[own_runs] - usual)
            own_runs &= np.abs(own - usual) <= max(_ROUNDING * usual, 3 * float(np.percentile(away, 75)))
    stretches = runs_of(fill_holes(runs, _HOLE))
    for begin, end in stretches[stretches[:, 1] - stretches[:, 0] >= SHORTEST].tolist():
        first, last = _edges(_missed(theirs[begin:end], step), _missed(own[begin:end], step))
        first, last = begin + first, begin + last
        steps = own[first:last]
        back, is_even = np.sum(steps < 0) / max(len(steps), 1), np.sum(own_runs[first:last]) >= _HALF * len(steps)
        is_clock = last - first >= SHORTEST and runs[first:last].mean() >= _MOSTLY
        # A clock that is merely slow or coarse stands still at times, but hardly ever goes back.
        if is_clock and (back > (_MANY if is_even else _FEW) or not np.any(steps)):
            where[first : last + 1] = True
    return where


def _edges(theirs: Values, ours: Values) -> tuple[int, int]:
    """First step of a stretch that is rotated, and the one behind its last."""
    # A column may run evenly by chance where the clock is in its place. So both ends are cut where the least is missed:
    # by the column within, by the clock outside, and by both in the step into a rotated row and in the one out of it.
    n, cut = len(theirs), 1.0 - np.minimum(theirs, ours)
    inside, outside = np.r_[0.0, np.cumsum(theirs)], np.r_[0.0, np.cumsum(ours), float(ours.sum())]
    # Both together: rows before the first that the column misses by little each would hide an end chosen alone.
    before = np.r_[0.0, outside[:n] + cut] - inside
    behind = inside + np.r_[cut, 0.0] + outside[n] - outside[1:]
    last = n - int(np.argmin((np.minimum.accumulate(before) + behind)[::-1]))
    return int(np.argmin(before[: last + 1])), last


def _missed(steps: Values, step: float) -> Values:
    """By what share of a clock's step each of its steps misses it, 1 at most."""
    return np.nan_to_num(np.minimum(np.abs(steps - step) / step, 1.0), nan=1.0)


def _head(table: RawTable, matrix: Values, clock: int, shift: int) -> BrokenRow | None:
    """The short row before the first, if the cells missing there are the ones that the next row has in front."""
    count = matrix.shape[1]
    step = _usual_step(matrix[:, (clock + shift) % count])
    for broken in table.broken:
        is_before = broken.row == table.rows[0] - 1 and len(broken.cells) == count - shift > clock
        if is_before and None not in broken.cells:
            gone = matrix[0, (clock + shift) % count] - (broken.cells[clock] or 0.0)
            return broken if abs(gone - step) <= _EVEN * step else None
    return None


def _reflow(table: RawTable, matrix: Values, shift: int, head: BrokenRow) -> Values:
    """Rows whose first cells go to the row before: one row more than before, unless the last lacks its last cells."""
    rows = np.r_[head.row, table.rows]
    whole = np.full((len(rows), matrix.shape[1]), np.nan)
    whole[0, :-shift] = np.array(head.cells, dtype=np.float64)
    whole[1:, :-shift] = matrix[:, shift:]
    follows = np.flatnonzero(np.diff(rows) == 1)
    whole[follows, -shift:] = matrix[follows, :shift]
    table.broken.remove(head)
    tail = next((row for row in table.broken if row.row == rows[-1] + 1), None)
    if tail is not None and len(tail.cells) == shift and None not in tail.cells:
        whole[-1, -shift:] = np.array(tail.cells, dtype=np.float64)
        table.broken.remove(tail)
    table.rows = rows
    return whole
