"""What the user says about a recording: a mapping file, or options such as ``position=qm [m]``.

A mapping file is TOML::

    [log]                       # how the file is laid out; each key only where the guess is wrong
    separator = "semicolon"     # comma, semicolon, tab, space, bar
    decimal = "comma"           # point, comma
    header = 3                  # line of the header; 0 for none
    table = "run1"              # group, structure or list of a file that holds several
    period = "1 ms"             # of a file without a column for the time

    [columns]
    time = "t [ms]"
    position = {column = "qm", unit = "0.3125 um", sign = -1, bits = 16}
    force = {column = "vir", unit = "N", factor = "gtau"}
    velocity = ""               # there is such a column, but it is not to be read

    [constants]
    gtau = 35.15

A signal is ``(sign * factor * number + offset)`` in the unit. The unit may carry a number, for columns of counts.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, cast

from detent.errors import FileProblem, InputError
from detent.files.file_bytes import read_bytes
from detent.files.job_text import decode_utf8
from detent.files.job_toml import unknown_key
from detent.files.job_values import RefusedValueError, read_text_quantity, read_whole_number, short
from detent.files.locate import find_place
from detent.files.source import Source, parse_source
from detent.logs.csv_layout import SEPARATORS, FileOptions
from detent.logs.log_units import find_conversion
from detent.logs.roles import ROLES

MAX_BYTES = 100_000
"""Largest mapping file read; a real one has a few hundred bytes."""

_DECIMALS = {"point": ".", "comma": ","}
_OPTION = re.compile(r"\s*([A-Za-z_]+)\s*=\s*(.*)", re.DOTALL)
_MOST_BITS = 63


@dataclass(frozen=True, slots=True)
class Choice:
    """Which column a signal comes from, and how its numbers become values."""

    column: str  # name of the column, or its number from 1; empty where the signal is not to be read
    unit: str = ""  # unit of the column, with a number before it or without; empty: that of the heading, or guessed
    # what the numbers are multiplied with, or the name of a constant of the file or of the mapping
    factor: float | str = 1.0
    offset: float = 0.0  # what is added then, in `unit`
    sign: int = 1  # 1 or -1
    bits: int | None = None  # width of the counter behind the numbers, where it wraps at another than 16 or 32
    delay: float = 0.0  # by how much the signal was recorded too late [s]


@dataclass(frozen=True)
class ColumnMapping:
    """What the user says about a recording."""

    # from a role of `roles.ROLES` to the choice of its column
    columns: dict[str, Choice] = field(default_factory=dict[str, Choice])
    file: FileOptions = field(default_factory=FileOptions)  # how the file is laid out
    constants: dict[str, float] = field(default_factory=dict[str, float])  # numbers by names, for `Choice.factor`

    def overridden(self, other: "ColumnMapping") -> "ColumnMapping":
        """Give the mapping with what another says in place of what it says."""
        default = FileOptions()
        names = [entry.name for entry in fields(FileOptions)]
        stated = {name: getattr(other.file, name) for name in names}
        changed = {name: value for name, value in stated.items() if value != getattr(default, name)}
        return ColumnMapping(
            {**self.columns, **other.columns}, replace(self.file, **changed), {**self.constants, **other.constants}
        )


def load_mapping(path: str | Path) -> ColumnMapping:
    """Read a mapping file."""
    allowed = "a mapping file (TOML)"
    text = decode_utf8(Path(path), read_bytes(Path(path), MAX_BYTES, allowed))
    source = parse_source(str(path), text)
    if not source.is_readable:
        raise InputError(source.problems)
    reader = _Reader(source)
    mapping = reader.read()
    if reader.problems:
        raise InputError(reader.problems)
    return mapping


def parse_options(options: Sequence[str]) -> ColumnMapping:
    """Read options: ``position=qm [m]``, ``force=-vir [35.15 N]``, ``velocity=`` (not to be read), ``decimal=comma``.

    >>> parse_options(["force=-vir [35.15 N]"]).columns["force"]
    Choice(column='vir', unit='35.15 N', factor=1.0, offset=0.0, sign=-1, bits=None, delay=0.0)
    """
    problems: list[FileProblem] = []
    mapping = ColumnMapping()
    for option in options:
        try:
            mapping = mapping.overridden(_read_option(option))
        except RefusedValueError as error:
            came = error.came or f'"{short(option)}"'
            problems.append(FileProblem("option", 0, 0, short(option), came, error.allowed, error.remedy))
    if problems:
        raise InputError(problems)
    return mapping


def _read_option(option: str) -> ColumnMapping:
    """Read one option."""
    match = _OPTION.fullmatch(option)
    if match is None:
        raise RefusedValueError("", "a signal and its column, as in position=qm [m]", "write SIGNAL=COLUMN [UNIT]")
    key, value = match[1], match[2].strip()
    if key in ROLES:
        return ColumnMapping(columns={key: _short_choice(key, value)})
    if key in _FILE_KEYS:
        numeric = int(value) if key == "header" and value.isascii() and value.isdigit() and len(value) < 9 else value
        return ColumnMapping(file=replace(FileOptions(), **{key: _FILE_KEYS[key](key, numeric)}))
    raise unknown_key(key, (*ROLES, *_FILE_KEYS), "signals and keys of the file")


def _short_choice(role: str, value: str) -> Choice:
    """Read a column with its unit, written as a heading."""
    if not value:
        return Choice("")
    sign = -1 if value.startswith("-") else 1
    bracketed = re.fullmatch(r"(.*?)\s*\[\s*([^\[\]]*?)\s*\]", value.removeprefix("-"), re.DOTALL)
    column, unit = (bracketed[1], bracketed[2]) if bracketed else (value.removeprefix("-"), "")
    return Choice(column.strip(), _check_unit(role, unit), sign=sign)


def _check_unit(role: str, unit: str) -> str:
    """Refuse a unit that a signal cannot have."""
    wanted = ROLES[role].units
    if unit and not any(find_conversion(unit, target) for target in wanted):
        kinds = " or ".join(target or "a pure number" for target in wanted)
        example = {"": "%", "K": "degC"}.get(wanted[0], f"m{wanted[0]}" if wanted[0] != "N*m" else "mN*m")
        remedy = f"write a unit as in [{example}]" + (", or one of counts" if "count" in "".join(wanted) else "")
        raise RefusedValueError(f'the unit "{short(unit)}"', f"a unit of {kinds}", remedy)
    return unit


def _word_of(words: Mapping[str, str]) -> Callable[[str, object], str]:
    """A reader of one of some words, or of the sign it stands for."""

    def read(key: str, value: object) -> str:
        """What the word stands for."""
        if isinstance(value, str) and (value in words or value in words.values()):
            return words.get(value, value)
        allowed = ", ".join(words)
        raise RefusedValueError(f'"{short(str(value))}"', f"{key}: {allowed}", f"write {key} = one of these words")

    return read


def _read_header_line(key: str, value: object) -> int:
    number = read_whole_number(key, value)
    if not 0 <= number < 10**6:
        raise RefusedValueError(str(number), "a line from 1, or 0 for no header", "state the line of the header")
    return number


def _read_table(key: str, value: object) -> str:
    if isinstance(value, str):
        return value
    raise RefusedValueError("", "a name in quotes", f'write {key} = "NAME"')


def _read_period(key: str, value: object) -> float:
    period = read_text_quantity(key, value, "s")
    if period <= 0:
        raise RefusedValueError("", "a time above 0", f'write {key} = "1 ms"')
    return period


_FILE_KEYS: dict[str, Callable[[str, object], Any]] = {
    "separator": _word_of(SEPARATORS),
    "decimal": _word_of(_DECIMALS),
    "header": _read_header_line,
    "table": _read_table,
    "period": _read_period,
}


def _read_number(key: str, value: object) -> float:
    if isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300:
        return float(value)
    raise RefusedValueError("", "a number", f"write a number without quotes, as in {key} = 2.5")


def _read_factor(key: str, value: object) -> float | str:
    if isinstance(value, str) and value:
        return value
    number = _read_number(key, value)
    if number == 0:
        raise RefusedValueError("", "a number other than 0, or the name of a constant", "write another factor")
    return number


def _read_sign(key: str, value: object) -> int:
    sign = read_whole_number(key, value)
    if abs(sign) != 1:
        raise RefusedValueError("", "1 or -1", f"write {key} = -1 to turn the signal round")
    return sign


def _read_bits(key: str, value: object) -> int:
    bits = read_whole_number(key, value)
    if not 2 <= bits <= _MOST_BITS:
        raise RefusedValueError("", f"a whole number from 2 to {_MOST_BITS}", "state the width of the counter")
    return bits


_CHOICE_KEYS: dict[str, Callable[[str, object], Any]] = {
    "factor": _read_factor,
    "offset": _read_number,
    "sign": _read_sign,
    "bits": _read_bits,
    "delay": lambda key, value: read_text_quantity(key, value, "s", "3 ms"),
}


class _Reader:
    """Reads the tables of a mapping file, and collects what is wrong with them."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self.problems: list[FileProblem] = list(source.problems)

    def read(self) -> ColumnMapping:
        """Read all that can be read."""
        for key, value in self._source.tables.items():
            if key not in {"log", "columns", "constants"}:
                self._refuse((key,), value, unknown_key(key, ("log", "columns", "constants"), "tables"))
        file = self._values("log", _FILE_KEYS)
        columns = {role: self._read_choice(role, value) for role, value in self._table("columns").items()}
        numbers = self._table("constants")
        constants = self._values("constants", dict.fromkeys(numbers, _read_number))
        return ColumnMapping(
            {role: choice for role, choice in columns.items() if choice}, replace(FileOptions(), **file), constants
        )

    def _table(self, *path: str) -> dict[str, Any]:
        """A table; empty, and a problem, where it is none."""
        found: Any = self._source.tables
        for key in path:
            found = cast("dict[str, Any]", found).get(key, {})
        if isinstance(found, dict):
            return cast("dict[str, Any]", found)
        self._refuse(path, found, RefusedValueError("", "a table", f"write [{'.'.join(path)}] above its keys"))
        return {}

    def _values(self, name: str, readers: Mapping[str, Callable[[str, object], Any]]) -> dict[str, Any]:
        """Values of a table of plain keys."""
        found: dict[str, Any] = {}
        for key, value in self._table(name).items():
            try:
                if key not in readers:
                    raise unknown_key(key, readers, f"keys of [{name}]")
                found[key] = readers[key](key, value)
            except RefusedValueError as error:
                self._refuse((name, key), value, error)
        return found

    def _read_choice(self, role: str, value: object) -> Choice | None:
        """Read the column of one signal."""
        try:
            if role not in ROLES:
                raise unknown_key(role, ROLES, "signals")
            if isinstance(value, str):
                return _short_choice(role, value)
            table = _as_table(role, value)
        except RefusedValueError as error:
            self._refuse(("columns", role), value, error)
            return None
        return self._read_choice_table(role, table)

    def _read_choice_table(self, role: str, table: dict[str, Any]) -> Choice | None:
        """Read a choice written as a table."""
        known = len(self.problems)
        found: dict[str, Any] = {}
        for key, value in table.items():
            try:
                if key in {"column", "unit"}:
                    found[key] = _read_name(key, value)
                elif key in _CHOICE_KEYS:
                    found[key] = _CHOICE_KEYS[key](key, value)
                else:
                    raise unknown_key(key, ("column", "unit", *_CHOICE_KEYS), "keys of a column")
                if key == "unit":
                    _check_unit(role, found[key])
            except RefusedValueError as error:
                self._refuse(("columns", role, key), value, error)
        if "column" not in table:
            error = RefusedValueError(f"{role} without a column", "the key column", 'write column = "NAME"')
            self._refuse(("columns", role), table, error)
        return Choice(**found) if len(self.problems) == known else None

    def _refuse(self, path: tuple[str, ...], value: object, error: RefusedValueError) -> None:
        """Note what is wrong with a key."""
        place = find_place(self._source.places, path)
        came = error.came or short(place.text or str(value))
        file = self._source.file
        key = ".".join(short(part) for part in path)
        self.problems.append(FileProblem(file, place.line, place.column, key, came, error.allowed, error.remedy))


def _as_table(role: str, value: object) -> dict[str, Any]:
    """Take a value for the table of a column, or refuse it."""
    if isinstance(value, dict):
        return cast("dict[str, Any]", value)
    remedy = f'write {role} = "COLUMN [UNIT]"'
    raise RefusedValueError("", "a column, or a table with column, unit, factor", remedy)


def _read_name(key: str, value: object) -> str:
    """Read the name of a column, or its number, or a unit."""
    if isinstance(value, str):
        return value
    if key == "column" and isinstance(value, int) and not isinstance(value, bool) and 0 < value < 10**6:
        return str(value)
    raise RefusedValueError("", "a text in quotes", f'write {key} = "NAME"')
