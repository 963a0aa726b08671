"""What the user says about a recording: a mapping file, or options such as ``position=qm [m]``.

A mapping file is TOML::

    [log]                       # file layout; each key only where the guess is wrong
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
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, PlainValidator, create_model, model_validator
from pydantic_core import PydanticCustomError

from detent.errors import FileProblem, InputError
from detent.files.fields import Table, optional, required
from detent.files.quantities import Time
from detent.files.read import read_tables
from detent.files.source import Source, parse_source
from detent.files.text import decode_utf8, did_you_mean, read_bytes, short
from detent.logs.headings import ROLES, find_conversion

MAX_BYTES = 100_000  # largest mapping file read; a real one has a few hundred bytes
# Separators by the words that name them in options.
SEPARATORS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " ", "bar": "|"}
_DECIMALS = {"point": ".", "comma": ","}
_OPTION = re.compile(r"\s*([A-Za-z_]+)\s*=\s*(.*)", re.DOTALL)
_MOST_BITS = 63


def _refused(remedy: str) -> PydanticCustomError:
    return PydanticCustomError("refused", "no value of the key", {"remedy": remedy})


def _word_of(words: dict[str, str], value: object) -> str:
    """The sign that a word stands for, or the sign itself."""
    if isinstance(value, str) and (value in words or value in words.values()):
        return words.get(value, value)
    raise _refused("write one of these words in quotes")


def _yes(value: object) -> bool:
    if value in (True, "yes", "true"):
        return True
    if value in (False, "no", "false"):
        return False
    raise _refused("write it as true or false")


def _read_column(value: object) -> str:
    if isinstance(value, str) or (type(value) is int and 0 < value < 10**6):
        return str(value)
    raise _refused('write column = "NAME"')


def _read_factor(value: object) -> float | str:
    if isinstance(value, str) and value:
        return value
    if isinstance(value, int | float) and not isinstance(value, bool) and 0 < abs(value) < 1e300:
        return float(value)
    raise _refused("write a number without quotes, or a name")


def _check_sign(sign: int) -> int:
    if abs(sign) == 1:
        return sign
    raise _refused("write sign = -1 to invert the signal")


def _check_unit(role: str, unit: str) -> str:
    """Refuse a unit that a signal cannot have."""
    wanted = ROLES[role].units
    if unit and not any(find_conversion(unit, target) for target in wanted):
        example = {"": "%", "K": "degC"}.get(wanted[0], f"m{wanted[0]}" if wanted[0] != "N*m" else "mN*m")
        remedy = f"write a unit as in [{example}]" + (", or one of counts" if "count" in "".join(wanted) else "")
        raise _refused(remedy)
    return unit


class FileOptions(Table, frozen=True):
    """How the file is laid out, whatever its kind; each key only where the guess is wrong."""

    separator: Annotated[str, PlainValidator(partial(_word_of, SEPARATORS))] = optional(
        "cell separator", "", allowed=", ".join(SEPARATORS)
    )
    decimal: Annotated[str, PlainValidator(partial(_word_of, _DECIMALS))] = optional(
        "decimal sign", "", allowed=", ".join(_DECIMALS)
    )
    header: int | None = optional("line of the header, 0 for none", None, ge=0, lt=10**6)
    table: str = optional("group, structure or list of a file that holds several", "")
    period: Time | None = optional("time between two rows of a file without a column for the time", None, gt=0)
    rotated: Annotated[bool, PlainValidator(_yes)] = optional(
        "cells that stand beside their headings are put back", default=False, allowed="true or yes, false or no"
    )
    incomplete: Annotated[bool, PlainValidator(_yes)] = optional(
        "the trace of an aborted run is taken as far as it goes", default=False, allowed="true or yes, false or no"
    )


class Choice(Table, frozen=True):
    """Where a signal comes from; in short a text: the column, its unit in brackets, a minus that turns it round."""

    column: Annotated[str, PlainValidator(_read_column)] = required(
        "name of the column, or its number from 1", '"NAME"', allowed="a text in quotes, or a number from 1"
    )
    unit: str = optional("unit of the column", "")
    factor: Annotated[float | str, PlainValidator(_read_factor)] = optional(
        "factor on the numbers", 1.0, allowed="a number other than 0, or the name of a constant"
    )
    offset: float = optional("offset added then, in the unit", 0.0)
    sign: Annotated[int, AfterValidator(_check_sign)] = optional("direction", 1, allowed="1 or -1")
    bits: int | None = optional("width of the counter, in bits", None, ge=2, le=_MOST_BITS)
    delay: Time = optional("by how much the signal was recorded too late", 0.0)

    @model_validator(mode="before")
    @classmethod
    def split(cls, value: object) -> object:
        """Read the short form, such as ``"-vir [35.15 N]"``."""
        if not isinstance(value, str):
            return value
        name = value.removeprefix("-")
        bracketed = re.fullmatch(r"(.*?)\s*\[\s*([^\[\]]*?)\s*\]", name, re.DOTALL)
        column, unit = (bracketed[1], bracketed[2]) if bracketed else (name, "")
        return {"column": column.strip(), "unit": unit, "sign": 1 if name == value else -1}


@dataclass(frozen=True)
class ColumnMapping:
    """What the user says about a recording."""

    # from a role of `roles.ROLES` to the choice of its column; one without a name is not to be read
    columns: dict[str, Choice] = field(default_factory=dict[str, Choice])
    file: FileOptions = field(default_factory=FileOptions)  # file layout
    constants: dict[str, float] = field(default_factory=dict[str, float])  # numbers by names, for `Choice.factor`

    def overridden(self, other: "ColumnMapping") -> "ColumnMapping":
        """Give the mapping with what another says in place of what it says."""
        file = self.file.model_copy(update=other.file.model_dump(exclude_unset=True))
        return ColumnMapping(self.columns | other.columns, file, self.constants | other.constants)


@cache
def mapping_model() -> type[Table]:
    """Model of a mapping file: its signals are those of `ROLES`, each with units of its own."""
    columns: dict[str, Any] = {}
    for name, role in ROLES.items():
        allowed = f"a unit of {' or '.join(target or 'a pure number' for target in role.units)}"
        unit: Any = (Annotated[str, AfterValidator(partial(_check_unit, name))], optional("unit", "", allowed=allowed))
        column: Any = create_model(f"{name}_column", __base__=Choice, unit=unit)
        columns[name] = (column | None, optional(role.meaning, None))
    tables: dict[str, Any] = {
        "log": (FileOptions, optional("file layout", FileOptions())),
        "columns": (model := create_model("Columns", __base__=Table, **columns), optional("signals", model())),
        "constants": (dict[str, float], optional("constants", {}, allowed="a number, by name")),
    }
    return create_model("Mapping", __base__=Table, **tables)


def load_mapping(path: str | Path) -> ColumnMapping:
    """Read a mapping file (TOML), as the head of this module shows; all that is wrong with it is told at once."""
    text = decode_utf8(Path(path), read_bytes(Path(path), MAX_BYTES, "a mapping file (TOML)"))
    return _to_mapping(parse_source(str(path), text))


def _to_mapping(source: Source) -> ColumnMapping:
    """What the tables of a mapping say."""
    found: Any = read_tables(source, mapping_model())
    stated = source.tables.get("columns", {})
    columns = {role: Choice.model_construct(**dict(getattr(found.columns, role))) for role in stated}
    return ColumnMapping(columns, found.log, found.constants)


def parse_options(options: Sequence[str]) -> ColumnMapping:
    """Read options: ``position=qm [m]``, ``force=-vir [35.15 N]``, ``velocity=`` (not to be read), ``decimal=comma``.

    Each is a role or a key of ``[log]``, an equals sign, and what to take; all that is wrong is told at once.

    >>> parse_options(["force=-vir [35.15 N]"]).columns["force"]
    Choice(column='vir', unit='35.15 N', factor=1.0, offset=0.0, sign=-1, bits=None, delay=0.0)
    """
    problems: list[FileProblem] = []
    mapping = ColumnMapping()
    for option in options:
        try:
            mapping = mapping.overridden(_read_option(option))
        except InputError as error:
            problems += (replace(problem, file="option", key=short(option)) for problem in error.problems)
    if problems:
        raise InputError(problems)
    return mapping


def _read_option(option: str) -> ColumnMapping:
    """Read one option."""
    match = _OPTION.fullmatch(option)
    if match is None:
        allowed = "a signal and its column, as in position=qm [m]"
        raise InputError.of_file("option", f'"{short(option)}"', allowed, "write SIGNAL=COLUMN [UNIT]")
    key, value = match[1], match[2].strip()
    if key not in ROLES and key not in FileOptions.model_fields:
        known = (*ROLES, *FileOptions.model_fields)
        remedy = did_you_mean(key, known, "remove it")
        raise InputError.of_file("option", f'the unknown key "{short(key)}"', ", ".join(known), remedy)
    is_number = key == "header" and value.isascii() and value.isdigit() and len(value) < 9
    tables = {"columns" if key in ROLES else "log": {key: int(value) if is_number else value}}
    try:
        return _to_mapping(Source("option", tables, {}))
    except InputError as error:
        told = (replace(one, line=0, column=0, got=f'"{short(value)}"') for one in error.problems)
        raise InputError(told) from None
