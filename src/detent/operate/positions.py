"""A position table as a file that people edit: CSV or TOML, in units, with the counts beside them.

Counts are exact and units have a meaning without the machine, so that a file has both. Where both are given they must
agree: counts of an axis with another scale are other places, and are refused.
"""

import csv
import io
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

from detent.axisfile.motion import rotary_model
from detent.errors import DetentError, FileProblem, InputError
from detent.files.fields import Table, optional, required, rows
from detent.files.keys import toml_text
from detent.files.quantities import Length
from detent.files.read import Row, read_tables, refuse
from detent.files.read_csv import CsvRows
from detent.files.source import parse_source
from detent.files.text import check_target, decode_utf8, read_data, short, write_text
from detent.methods.position import PositionSensor
from detent.operate.rows import LARGEST, MOST_NAME, MOST_POSITIONS, NAME, Position, is_name
from detent.units import format_place

AnyRow = TypeVar("AnyRow", bound=Row)

KINDS = (".csv", ".toml")
_WHAT_IT_IS = "a position table (.csv or .toml)"
_ROUNDED = 2.0**-50  # share of a position that two ways of writing it may differ by


class PositionRow(Row, frozen=True):
    """An entry of a position table."""

    one_of: ClassVar[tuple[str, ...]] = ("position", "counts")
    name: str = required(
        "name or number", '"1"', allowed=f"text of 1 to {MOST_NAME} characters", min_length=1, max_length=MOST_NAME
    )
    position: Length | None = optional("where it is", None, ge=-1e6, le=1e6)
    counts: int | None = optional("the same in counts of the sensor", None, ge=-LARGEST - 1, le=LARGEST)
    tolerance: Length = optional("difference that counts as there", 0.0, ge=0.0, le=1e6)

    @classmethod
    def faults(cls, stated: Mapping[str, Any], *, is_whole: bool) -> Iterator[FileProblem]:
        """Both may be given; whether they agree is a question to the axis."""
        if not {"position", "counts"} <= set(stated):
            yield from super().faults(stated, is_whole=is_whole)


class PositionFile(Table, Generic[AnyRow], frozen=True):
    """A position table."""

    position: list[AnyRow] = rows("a position")


def load_positions(path: Path | str, sensor: PositionSensor) -> list[tuple[str, int, int]]:
    """Name, counts and tolerance [count] of each entry of a file, for `Store.take`; or all that is wrong with it."""
    file = Path(path)
    text = decode_utf8(file, read_data(file, KINDS, _WHAT_IT_IS))
    model: type[PositionRow] = rotary_model(PositionRow) if sensor.unit == "rad" else PositionRow
    if file.suffix.lower() == ".csv":
        made = CsvRows(str(file), text, model).read(_with_line, MOST_POSITIONS)
    else:
        source = parse_source(str(file), text)
        found = read_tables(source, PositionFile[model]).position
        made = [(source.line_of("position", k), row) for k, row in enumerate(found)]
    if not 0 < len(made) <= MOST_POSITIONS:
        got = f"more than {MOST_POSITIONS} positions" if made else "no positions"
        raise InputError.of_file(str(file), got, f"1 to {MOST_POSITIONS} positions", "give so many")
    if problems := list(_faults(str(file), made, sensor)):
        refuse(problems)
    return [(row.name, _counts(row, sensor), round(row.tolerance / sensor.scale)) for _, row in made]


def _with_line(line: int, row: PositionRow) -> tuple[int, PositionRow]:
    return line, row


def _counts(row: PositionRow, sensor: PositionSensor) -> int:
    return row.counts if row.counts is not None else sensor.counts(row.position or 0.0)


def _faults(file: str, made: Iterable[tuple[int, PositionRow]], sensor: PositionSensor) -> Iterator[FileProblem]:
    """Names that will not do or are given twice; places that are none, or two."""
    names: set[str] = set()
    low, high = sensor.reach or (-LARGEST - 1, LARGEST)
    for line, row in made:
        if not is_name(row.name):
            yield FileProblem(file, line, 1, "name", f'"{short(row.name)}"', NAME, "give it such a name")
        if row.name in names:
            allowed, remedy = "each name once", "remove one of them, or give it another name"
            yield FileProblem(file, line, 1, "name", f'"{short(row.name)}" again', allowed, remedy)
        names.add(row.name)
        counts, key = _counts(row, sensor), "position" if row.counts is None else "counts"
        meant = sensor.position(counts)
        if row.position is not None and abs(meant - row.position) > 0.5 * sensor.scale + _ROUNDED * abs(meant):
            yield FileProblem(
                file, line, 1, "counts", f"{counts} counts at {format_place(row.position, sensor.unit)}",
                f"{sensor.counts(row.position)} counts, as this axis has there",
                "the table is of an axis with another scale: take the counts out where the positions hold, and the "
                "positions where the counts do",
            )  # fmt: skip
        elif not low <= counts <= high:
            ends = " to ".join(format_place(sensor.position(end), sensor.unit) for end in (low, high))
            got = f"{format_place(meant, sensor.unit)} ({counts} counts)"
            yield FileProblem(file, line, 1, key, got, ends, "give a place within the travel")


def save_positions(path: Path | str, positions: Iterable[Position], sensor: PositionSensor) -> Path:
    """Write a position table, for people and for `load_positions`; the name's ending says how."""
    file, held = check_target(path, KINDS, "a position table"), list(positions)
    if not held:
        raise DetentError(f"{file}: got an empty position table; expected: one or more positions; teach one first")
    unit = sensor.unit
    if file.suffix.lower() == ".toml":
        text = "\n".join(
            f'[[position]]\nname = {toml_text(one.name)}\nposition = "{sensor.position(one.counts)!r} {unit}"\n'
            f'counts = {one.counts}\ntolerance = "{_tolerance(one, sensor)!r} {unit}"\n'
            for one in held
        )
        return write_text(file, text)
    lines = io.StringIO()
    writer = csv.writer(lines, quoting=csv.QUOTE_NONNUMERIC, lineterminator="\n")
    lines.write(f"name,position [{unit}],counts,tolerance [{unit}]\n")
    for one in held:
        writer.writerow([one.name, sensor.position(one.counts), one.counts, _tolerance(one, sensor)])
    return write_text(file, lines.getvalue())


def _tolerance(position: Position, sensor: PositionSensor) -> float:
    return sensor.position(position.tolerance) - sensor.origin
