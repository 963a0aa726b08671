"""Lists of places as comma-separated values: a column for each motor, a line for each place, such as a tile."""

import difflib
from collections.abc import Sequence
from dataclasses import dataclass, field

from detent.files.job_csv import Column, JobTable, Line, check_unit, read_count, split_heading
from detent.files.job_rows import EXAMPLE_UNITS, check_dwell
from detent.files.job_values import RefusedValueError, short
from detent.methods.stepper_envelope.stage_job import StageJob, StageMove
from detent.methods.stepper_envelope.stage_rows import StageRows, check_label, to_stage_job
from detent.units import QuantityError, parse_quantity

_NAME_UNITS = {"m": ("um", "mm", "cm", "m", "in"), "s": ("us", "ms", "s")}
"""Units that a name such as ``x_um`` may end in; in brackets any unit may stand."""

_PREFERRED = "nominal"
_MOST_NAMED = 12


def parse_stage_csv(file: str, text: str, motors: Sequence[str]) -> StageJob:
    """Read a list of places from comma-separated values.

    A column is the motor's ``x`` if its heading is ``x [mm]``, ``x_mm``, or ``x_mm_`` with further words. Of several
    columns of one motor that with the word "nominal" is taken: the place asked for, not what an encoder read there. An
    empty cell leaves its motor where it is. Columns ``dwell [ms]``, ``repeat``, ``label`` and ``tile`` say more; with
    ``tile`` the file is a list of tiles. Other columns are passed over. How lines are written is said in
    `detent.files.job_csv`.
    """
    rows = StageRows(file)
    table = JobTable(file, text, rows.problems)
    heading = _Header(motors)
    heading.read(table)
    for line in table.lines() if table.columns else ():
        if rows.is_over:
            break
        known = len(rows.problems)
        values = table.read_line(line, lambda column, cell: _read_cell(table, column, cell))
        label = _read_label(table, line, heading.labels)
        if heading.places and not {table.columns[index].name for index in line.stated} & set(motors):
            allowed = f"a place for at least one of {', '.join(motors)}"
            table.refuse(line, heading.places[0], RefusedValueError("an empty cell", allowed, "write a number"))
        if heading.places and len(rows.problems) == known:
            targets = {motor: values[motor] for motor in motors if motor in values}
            move = StageMove(1, line.number, targets, dwell=values.get("dwell", 0.0), label=label)
            rows.add(move, values.get("repeat", 1))
    return to_stage_job(rows, motors, kind="tiles" if heading.has_tiles else "moves", notes=heading.notes)


@dataclass(slots=True)
class _Header:
    """What the header says."""

    motors: Sequence[str]  # motors of the axis
    # columns of places that are taken; none where the header could not be read
    places: list[int] = field(default_factory=list[int])
    labels: list[int] = field(default_factory=list[int])  # columns of what a place is called
    has_tiles: bool = False  # one of these is named "tile"
    notes: tuple[str, ...] = ()  # which columns were taken and which not, where there was a choice

    def read(self, table: JobTable) -> None:
        """Read the columns, and choose one for each motor."""
        if not table.header.cells:
            return
        table.read_header(lambda cell: self._read_heading(cell, table.columns))
        for motor in self.motors:
            self._choose(table, motor)
        names = [split_heading(cell)[0] for cell in table.header.cells]
        self.labels = [index for index, name in enumerate(names) if name in {"tile", "label"}]
        self.has_tiles = "tile" in names
        if table.problems:
            return
        self.places = [index for index, column in enumerate(table.columns) if column.name in self.motors]
        if not self.places:
            usual = [f"{motor} [mm]" for motor in self.motors]
            remedy = f"begin with a header such as {table.separator.join(usual)}"
            error = RefusedValueError("", f"a column for at least one motor: {', '.join(usual)}", remedy)
            table.refuse_header(error)
        self.notes = tuple(self._tell(table))

    def _read_heading(self, cell: str, others: Sequence[Column]) -> Column:
        """Read name and unit of a column; neither of one that is passed over, or holds no numbers."""
        column = _match(cell, self.motors)
        if column is None:
            _check_near(cell, self.motors)
            return Column()
        if column.name not in self.motors and any(column.name == other.name for other in others):
            raise RefusedValueError(f'a second column "{column.name}"', "each column once", "remove one of the two")
        return column

    def _choose(self, table: JobTable, motor: str) -> None:
        """Pass over all columns of a motor but one."""
        cells = table.header.cells
        found = [index for index, column in enumerate(table.columns) if column.name == motor]
        nominal = [index for index in found if _PREFERRED in cells[index].lower()]
        if len(found) > 1 and len(nominal) != 1:
            came = f"{len(found)} columns for {motor}: {', '.join(short(cells[index]) for index in found)}"
            allowed = f'one column for each motor, or one with the word "{_PREFERRED}" among several'
            remedy = f"name the column of the places to go to {motor}_{table.columns[found[0]].unit}_{_PREFERRED}"
            table.refuse(table.header, found[1], RefusedValueError(came, allowed, remedy))
        for index in found if len(found) > 1 else ():
            if index not in nominal:
                table.columns[index] = Column()

    def _tell(self, table: JobTable) -> list[str]:
        """Say which columns were taken and which were not; nothing where all were."""
        cells = table.header.cells
        others = [index for index, column in enumerate(table.columns) if not column.name and index not in self.labels]
        passed = [short(cells[index]) or "a column without a name" for index in others]
        if not passed:
            return []
        more = f" and {len(passed) - _MOST_NAMED} more" if len(passed) > _MOST_NAMED else ""
        taken = ", ".join(short(cells[index]) for index in self.places)
        return [f"columns {taken}", f"passed over: {', '.join(passed[:_MOST_NAMED])}{more}"]


def _match(cell: str, motors: Sequence[str]) -> Column | None:
    """Column of a heading; None if it is none that is read."""
    name, unit = split_heading(cell)
    if name == "repeat" and unit is None:
        return Column("repeat")
    # A motor x_um before a motor x, which could have such a column too.
    for key in sorted((*motors, "dwell"), key=len, reverse=True):
        si_unit = "s" if key == "dwell" else "m"
        if name == key:
            check_unit(name, unit or "", si_unit, EXAMPLE_UNITS[si_unit], short(cell))
            return Column(key, unit or "")
        token = name.removeprefix(f"{key}_").partition("_")[0]
        if unit is None and name.startswith(f"{key}_") and token in _NAME_UNITS[si_unit]:
            return Column(key, token)
    return None


def _check_near(cell: str, motors: Sequence[str]) -> None:
    """Refuse a heading that is a slip of one that is read: what it says about the motion must not be passed over."""
    name, _ = split_heading(cell)
    head = name.partition("_")[0].lower()
    # By the first letter: wells of a plate have nothing to do with a dwell.
    near = [word for word in difflib.get_close_matches(head, ("dwell", "repeat"), cutoff=0.8) if head[0] == word[0]]
    near += [motor for motor in motors if _is_column(cell.lower(), motor.lower())]
    if near:
        known = ", ".join(f"{motor} [mm]" for motor in motors)
        remedy = f'did you mean "{near[0]}"?'
        raise RefusedValueError(f'the unknown column "{short(cell)}"', f"{known}, dwell [ms], repeat", remedy)


def _is_column(cell: str, motor: str) -> bool:
    """True for a heading that is the motor's, with the right unit or not."""
    try:
        column = _match(cell, [motor])
    except RefusedValueError:
        return True
    return column is not None and column.name == motor


def _read_cell(table: JobTable, column: Column, cell: str) -> float:
    """Read one number."""
    if column.name == "repeat":
        return read_count(cell)
    try:
        value = parse_quantity(table.quantity(column, cell), "s" if column.name == "dwell" else "m")
    except QuantityError as error:
        raise RefusedValueError(error.reason, error.allowed, error.remedy) from None
    return check_dwell(value) if column.name == "dwell" else value


def _read_label(table: JobTable, line: Line, columns: Sequence[int]) -> str:
    """What a place is called: its tile, its label, or both."""
    stated = line.stated
    found: list[str] = []
    for index in columns:
        if index in stated:
            try:
                found.append(check_label(stated[index]))
            except RefusedValueError as error:
                table.refuse(line, index, error)
    return " ".join(found)
