"""Files of moves as comma-separated values: the header names the columns with their units, each line is a move."""

import difflib
from collections.abc import Mapping, Sequence

from detent.files.job_csv import Column, JobTable, Line, check_unit, read_count, split_heading
from detent.files.job_rows import EXAMPLE_UNITS, JobRows
from detent.files.job_values import RefusedValueError, short
from detent.methods.moves.job import Move, MoveJob
from detent.methods.moves.move_rows import ONE_WAY, UNITS, add_move, read_quantity, to_job


def parse_move_csv(file: str, text: str, units: Mapping[str, str] = UNITS) -> MoveJob:
    """Read a file of moves from comma-separated values.

    The header names the columns, in any order: ``target [mm]`` or ``by [mm]`` or both, and where wanted ``dwell [ms]``,
    ``repeat``, ``speed [mm/s]``, ``sample_period [ms]``. How lines are written is said in `detent.files.job_csv`.
    """
    rows = JobRows[Move](file)
    table = JobTable(file, text, rows.problems)
    is_whole = _read_header(table, units)
    for line in table.lines() if table.columns else ():
        if rows.is_over:
            break
        known = len(rows.problems)
        values = table.read_line(line, lambda column, cell: _read_cell(table, column, cell, units))
        _check_way(table, line, is_whole=is_whole)
        if values and is_whole and len(rows.problems) == known:
            add_move(rows, line.number, values)
    return to_job(rows)


def _names(units: Mapping[str, str]) -> str:
    """Columns that there are, for messages."""
    return ", ".join(f"{name} [{EXAMPLE_UNITS[unit]}]" if unit else name for name, unit in units.items())


def _read_header(table: JobTable, units: Mapping[str, str]) -> bool:
    """Read the columns, if the line is a header; True if each has a meaning, and one of them says where to."""
    header, unit = table.header, EXAMPLE_UNITS[units["target"]]
    if not header.number or table.problems:
        return False
    if not any(cell.partition("[")[0].strip().lower() in units for cell in header.cells):
        remedy = f"begin with a header such as target [{unit}]{table.separator}dwell [ms]"
        table.refuse_header(RefusedValueError("", f"names of columns: {_names(units)}", remedy))
        return False
    table.read_header(lambda cell: _read_heading(cell, table.columns, units))
    names = {column.name for column in table.columns}
    if "" not in names and not {"target", "by"} & names:
        table.refuse_header(
            RefusedValueError("", "a column target or by", f"add a column target [{unit}] or by [{unit}]")
        )
    return not table.problems


def _read_heading(cell: str, others: Sequence[Column], units: Mapping[str, str]) -> Column:
    """Read name and unit of a column."""
    name, unit = split_heading(cell)
    if name not in units:
        near = difflib.get_close_matches(name.lower(), units, n=1, cutoff=0.6)
        remedy = f'did you mean "{near[0]}"?' if near else "remove the column"
        raise RefusedValueError(f'the unknown column "{short(cell)}"', _names(units), remedy)
    if any(name == other.name for other in others):
        raise RefusedValueError(f'a second column "{name}"', "each column once", "remove one of the two")
    if not units[name] and unit is not None:
        raise RefusedValueError(f'"{short(cell)}"', "a count, without a unit", f"write {name}")
    if units[name]:
        check_unit(name, unit or "", units[name], EXAMPLE_UNITS[units[name]], short(cell))
    return Column(name, unit or "")


def _read_cell(table: JobTable, column: Column, cell: str, units: Mapping[str, str]) -> float:
    """Read one number."""
    if column.name == "repeat":
        return read_count(cell)
    return read_quantity(column.name, table.quantity(column, cell), units)


def _check_way(table: JobTable, line: Line, *, is_whole: bool) -> None:
    """Refuse a line with both a place and a way, or with neither."""
    stated = {table.columns[index].name for index in line.stated}
    ways = [index for index, column in enumerate(table.columns) if column.name in {"target", "by"}]
    if {"target", "by"} <= stated:
        error = RefusedValueError("target and by", ONE_WAY, "leave one of the two cells empty")
        table.refuse(line, ways[-1], error)
    elif is_whole and not {"target", "by"} & stated:
        table.refuse(line, ways[0], RefusedValueError("an empty cell", ONE_WAY, "write a number"))
