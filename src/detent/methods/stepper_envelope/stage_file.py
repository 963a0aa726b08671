"""Jobs of stepper stages, read from files: lists of places as CSV, moves and manual runs as TOML.

In TOML each ``[[move]]`` names motors: ``x = "12 mm"`` is a place, ``by = {x = "1 mm"}`` a way from the place before.

In CSV a column is the motor's ``x`` if its heading is ``x [mm]``, ``x_mm``, or ``x_mm_`` with further words. Of several
columns of one motor that with the word "nominal" is taken: the place asked for, not what an encoder read there. Other
columns than those of `CSV_KEYS` are passed over; with ``tile`` the file is a list of tiles.
"""

import difflib
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any, cast

from detent.files.read import read_tables
from detent.files.read_csv import Column, CsvRows, split_heading
from detent.files.source import parse_source
from detent.files.text import read_text, short
from detent.methods.moves.job import MOST_MOVES, MoveFile, expand_moves
from detent.methods.stepper_envelope.stage_job import (
    Change,
    PlaceRow,
    StageJob,
    StageJog,
    StageMove,
    StageRow,
    places_of,
    stage_row,
)

CSV_KEYS = ("dwell", "repeat", "label", "tile")  # keys beside the motors that a list of places may have
_NAME_UNITS = {"m": ("um", "mm", "cm", "m", "in"), "s": ("us", "ms", "s")}  # a name such as ``x_um`` may end in them

_PREFERRED = "nominal"
_MOST_NAMED = 12


def load_stage_job(path: str | PathLike[str], motors: Sequence[str]) -> StageJob:
    """Read the job of a stepper stage with these motors; whether the axis can do it is not checked here."""
    file = Path(path)
    text = read_text(file, (".csv", ".toml"), "a list of places (.csv) or of moves (.toml)")
    repeat, kind, notes = 1, "moves", ()
    if file.suffix.lower() == ".csv":
        table = PlaceRows(str(file), text, stage_row(tuple(motors), PlaceRow))
        made = table.read(_make_move, MOST_MOVES)
        kind, notes = "tiles" if table.has_tiles else "moves", table.notes
    else:
        source = parse_source(str(file), text)
        model: Any = stage_row(tuple(motors))
        found = read_tables(source, cast("type[MoveFile[StageRow]]", MoveFile[model]))
        made = [_make_move(source.line_of("move", number), row) for number, row in enumerate(found.move)]
        repeat = found.repeat
    moves = expand_moves(str(file), made, repeat, missing=f"add a move with a place for {' or '.join(motors)}")
    named = {motor for move in moves for motor in move.motors}
    return StageJob(file.name, kind, moves, tuple(motor for motor in motors if motor in named), notes)


def _make_move(line: int, row: StageRow) -> tuple[StageMove | StageJog, int]:
    """The move of a row, and how often it is done."""
    label = " ".join(word for word in (row.tile if isinstance(row, PlaceRow) else "", row.label) if word)
    if row.jog is not None:
        return StageJog(1, line, row.jog, row.speed or 0.0, row.duration or 0.0, row.dwell, label), row.repeat
    change = None
    if row.changed_at is not None and row.changed_to is not None:
        change = Change(row.changed_at, row.changed_to)
    targets, by = places_of(row, row.motors), places_of(row.by, row.motors)
    return StageMove(1, line, targets, by, row.dwell, label, row.turn, change), row.repeat


class PlaceRows(CsvRows[StageRow]):
    """A list of places: a column for each motor, whatever else there is."""

    has_tiles = False
    notes: tuple[str, ...] = ()
    """Which columns were taken and which not, where there was a choice."""

    def read_header(self) -> None:
        """Read the columns, and choose one for each motor."""
        self.several = frozenset(self.model.motors)
        for index, cell in enumerate(self.header.cells):
            self.columns.append(self.read_heading(index, cell))
        for motor in self.model.motors:
            self._choose(motor)
        keys = [column.key for column in self.columns]
        self.has_tiles = "tile" in keys
        if self.problems:
            return
        if not set(keys) & set(self.model.motors):
            usual = [self.heading_of(motor) for motor in self.model.motors]
            allowed = f"a column for at least one motor: {', '.join(usual)}"
            self.refuse_header(allowed, f"begin with a header such as {self.separator.join(usual)}")
        cells = [short(cell) for cell in self.header.cells]
        passed = [cells[k] or "a column without a name" for k, one in enumerate(self.columns) if not one.key]
        if passed:
            more = f" and {len(passed) - _MOST_NAMED} more" if len(passed) > _MOST_NAMED else ""
            taken = ", ".join(cells[k] for k, one in enumerate(self.columns) if one.key in self.model.motors)
            self.notes = (f"columns {taken}", f"passed over: {', '.join(passed[:_MOST_NAMED])}{more}")

    def read_heading(self, index: int, cell: str) -> Column:
        """Read key and unit of a column; a slip of one that says something of the motion must not be passed over."""
        name, unit = split_heading(cell)
        key, unit = self._match(name, unit)
        if key in self.model.motors or key in CSV_KEYS:
            return self.column_of(index, key, unit)
        head = name.partition("_")[0].lower()
        # By the first letter: wells of a plate have nothing to do with a dwell.
        near = [word for word in difflib.get_close_matches(head, ("dwell", "repeat"), cutoff=0.8) if head[0] == word[0]]
        meant = self._match(name.lower(), unit)[0]  # motors have small letters
        near += [meant] if meant in self.model.motors else []
        if not near:
            return Column()
        allowed = ", ".join(map(self.heading_of, (*self.model.motors, "dwell", "repeat")))
        return self.refuse_heading(index, f'the unknown column "{short(cell)}"', allowed, f'did you mean "{near[0]}"?')

    def _match(self, name: str, unit: str | None) -> tuple[str, str | None]:
        """Key and unit of a heading whose name may end in its unit and further words."""
        # A motor x_um before a motor x, which could have such a column too.
        for key in sorted((*self.model.motors, "dwell"), key=len, reverse=True):
            usual = _NAME_UNITS["s" if key == "dwell" else "m"]
            token = name.removeprefix(f"{key}_").partition("_")[0]
            if unit is None and name.startswith(f"{key}_") and token in usual:
                return key, token
        return name, unit

    def _choose(self, motor: str) -> None:
        """Pass over all columns of a motor but one."""
        cells = self.header.cells
        found = [index for index, column in enumerate(self.columns) if column.key == motor]
        if len(found) < 2:
            return
        nominal = [index for index in found if _PREFERRED in cells[index].lower()]
        if len(nominal) != 1:
            came = f"{len(found)} columns for {motor}: {', '.join(short(cells[index]) for index in found)}"
            allowed = f'one column for each motor, or one with the word "{_PREFERRED}" among several'
            unit = self.columns[found[0]].unit
            remedy = f"name the column of the places to go to {motor}_{unit}_{_PREFERRED}"
            self.refuse_heading(found[1], came, allowed, remedy)
        for index in set(found).difference(nominal):
            self.columns[index] = Column()
