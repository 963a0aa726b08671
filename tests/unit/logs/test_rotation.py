"""Cells that stand beside their headings: whole files, parts of files, lines broken in the wrong places."""

import numpy as np
import pytest

from detent.logs.log import Action, Kind
from detent.logs.raw_table import BrokenRow, RawTable
from detent.logs.rotation import mend_rotation

N = 200
RNG = np.random.default_rng(7)
NAMES = ["t", "x", "u", "y"]
MATRIX = np.column_stack(
    [100.0 * np.arange(1, N + 1), np.cumsum(RNG.integers(-9, 10, N)), RNG.integers(-255, 256, N), RNG.normal(size=N)]
)


def table_of(matrix, names=NAMES, rows=None, broken=()):
    columns = {name: matrix[:, index].copy() for index, name in enumerate(names)}
    rows = np.arange(1, len(matrix) + 1) if rows is None else np.asarray(rows)
    return RawTable("log.csv", columns, rows, dict.fromkeys(names, ""), broken=list(broken))


def mended(*args, time="t", is_stated=False, is_accepted=False, **kwargs):
    table = table_of(*args, **kwargs)
    mend_rotation(table, time, is_stated=is_stated, is_accepted=is_accepted)
    return table, np.column_stack(list(table.columns.values()))


def test_a_good_table_is_left_alone():
    table, matrix = mended(MATRIX)
    assert (matrix == MATRIX).all()
    assert table.findings == []


@pytest.mark.parametrize("shift", [1, 2, 3])
def test_all_rows_rotated(shift):
    table, matrix = mended(np.roll(MATRIX, shift, axis=1))
    assert (matrix == MATRIX).all()
    (finding,) = table.findings
    assert (finding.kind, finding.action, finding.rows) == (Kind.ROTATED_COLUMNS, Action.REORDERED, ((1, N),))
    assert f'the clock runs in "{NAMES[shift]}", not in "t": cells are shifted {shift} column' in finding.text
    assert 'now "t" 100 to 2e+04, "x" ' in finding.text
    assert finding.advice == f"if that is not so, state the columns, as in time={NAMES[shift]}"


def test_stated_columns_stay_where_they_are():
    rotated = np.roll(MATRIX, 1, axis=1)
    table, matrix = mended(rotated, is_stated=True)
    assert (matrix == rotated).all()
    (finding,) = table.findings
    assert finding.action is Action.LEFT
    assert finding.advice == "state time=x, or that the cells are rotated: rotated=yes"
    table, matrix = mended(rotated, is_stated=True, is_accepted=True)
    assert (matrix == MATRIX).all()
    assert (table.findings[0].action, table.findings[0].advice) == (Action.REORDERED, "")


@pytest.mark.parametrize(("first", "last"), [(50, 120), (0, 15), (180, 200), (110, 200)])
@pytest.mark.parametrize("is_stated", [False, True])
def test_some_rows_rotated(first, last, is_stated):
    broken = MATRIX.copy()
    broken[first:last] = np.roll(broken[first:last], 1, axis=1)
    table, matrix = mended(broken, is_stated=is_stated)
    (finding,) = table.findings
    assert (finding.rows, finding.action) == (((first + 1, last),), Action.REMOVED)
    assert "rotated=yes" in finding.advice
    assert (matrix == np.delete(MATRIX, slice(first, last), axis=0)).all()
    assert table.rows.tolist() == [*range(1, first + 1), *range(last + 1, N + 1)]
    table, matrix = mended(broken, is_stated=is_stated, is_accepted=True)
    assert (matrix == MATRIX).all()
    assert table.findings[0].rows == ((first + 1, last),)


@pytest.mark.parametrize(("first", "last"), [(0, 150), (40, N), (30, 170)])
def test_a_column_that_goes_on_like_the_clock_by_chance_ends_where_the_clock_is_back(first, last):
    """Found by a property: three rows behind the rotated ones were rotated, too, as the reference rose like a clock."""
    true = MATRIX.copy()
    for outside in (slice(max(first - 4, 0), first), slice(last, last + 4)):
        true[outside, 1] = 5.0 + 130.0 * np.arange(len(true[outside]))
    broken = true.copy()
    broken[first:last] = np.roll(broken[first:last], 1, axis=1)
    table, matrix = mended(broken, is_accepted=True)
    assert (matrix == true).all()
    assert table.findings[0].rows == ((first + 1, last),)


def test_the_clock_need_not_be_first():
    names = ["x", "t", "u"]
    true = MATRIX[:, [1, 0, 2]]
    _, matrix = mended(np.roll(true, 2, axis=1), names)
    assert (matrix == true).all()


def broken_lines(shift, *, whole_tail=True):
    """Lines broken `shift` cells too late: the first is short, the others begin with cells of the one before."""
    cells = MATRIX.ravel()[: MATRIX.size]
    head = BrokenRow(1, tuple(cells[: 4 - shift]), "short")
    inner = cells[4 - shift : -(shift or 4)].reshape(-1, 4)
    tail = BrokenRow(N + 1, tuple(cells[len(cells) - shift :]), "short")
    return inner, [head, tail] if whole_tail else [head]


@pytest.mark.parametrize("shift", [1, 2, 3])
def test_lines_broken_in_the_wrong_places(shift):
    inner, broken = broken_lines(shift)
    table, matrix = mended(inner, rows=np.arange(2, N + 1), broken=broken)
    assert (matrix == MATRIX).all()
    assert table.rows.tolist() == list(range(1, N + 1))
    assert table.broken == []
    assert "line breaks are misplaced" in table.findings[0].text


def test_the_last_line_may_be_cut_off():
    inner, broken = broken_lines(1, whole_tail=False)
    _, matrix = mended(inner, rows=np.arange(2, N + 1), broken=broken)
    assert (matrix[:-1] == MATRIX[:-1]).all()
    assert np.isnan(matrix[-1]).tolist() == [False, False, False, True]


def test_a_row_lost_between_broken_lines_costs_only_its_cells():
    inner, broken = broken_lines(1)
    rows = np.arange(2, N + 1)
    table, matrix = mended(np.delete(inner, 50, axis=0), rows=np.delete(rows, 50), broken=broken)
    assert table.rows.tolist() == [1, *np.delete(rows, 50)]
    lost = np.flatnonzero(np.isnan(matrix).any(axis=1))
    assert len(lost) == 1
    assert np.isnan(matrix[lost[0]]).tolist() == [False, False, False, True]


def test_a_short_first_row_that_does_not_continue_is_left_broken():
    inner, broken = broken_lines(1)
    odd = BrokenRow(1, (5e6, 1.0, 2.0), "short")
    table, matrix = mended(inner, rows=np.arange(2, N + 1), broken=[odd, broken[1]])
    assert odd in table.broken
    assert (matrix[:, 0] == MATRIX[1:, 0]).all()


@pytest.mark.parametrize(
    "clock",
    [
        np.floor(np.arange(N) / 20),  # coarse stamps
        np.r_[np.arange(100.0), np.arange(100.0)],  # two recordings
        np.cumsum(RNG.uniform(0.1, 3.0, N)),  # uneven
        np.delete(np.arange(N + 40.0), RNG.choice(N, 40, replace=False)),  # rows missing
    ],
)
@pytest.mark.parametrize("ramp", ["ramp", "Sample", "index"])
def test_other_clocks_are_not_taken_for_rotated(clock, ramp):
    matrix = np.column_stack([clock, np.arange(N) * 7.0, RNG.normal(size=N)])
    table, found = mended(matrix, ["t", ramp, "x"])
    assert (found == matrix).all()
    assert table.findings == []


def test_nearly_a_clock_is_none():
    matrix = np.column_stack([np.zeros(N), np.cumsum(RNG.uniform(0.0, 2.0, N)), RNG.normal(size=N)])
    table, _ = mended(matrix, ["t", "x", "u"])
    assert table.findings == []
