"""One reader of declared fields for every file of tables: validate it, and tell all that is wrong at once."""

from collections.abc import Iterable, Iterator, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import replace
from itertools import islice
from typing import Any, ClassVar, NoReturn, TypeVar, cast

from pydantic import ValidationError

from detent.errors import MOST_PROBLEMS, DetentError, FileProblem, InputError
from detent.files.fields import IN_SI, Table, example_of, is_rows, keys_of, table_of, unit_of
from detent.files.locate import Index, Path
from detent.files.problems import Reporter, key_path, nearest_key
from detent.files.source import Source
from detent.units import describe_kind

AnyTable = TypeVar("AnyTable", bound=Table)


class Row(Table, frozen=True):
    """One of many: a table of a list in TOML, or a line of comma-separated values."""

    one_of: ClassVar[tuple[str, ...]] = ()
    """Keys of which every row states exactly one."""

    @classmethod
    def known(cls) -> tuple[str, ...]:
        """Keys that a row may have."""
        return tuple(keys_of(cls))

    @classmethod
    def faults(cls, stated: Mapping[str, Any], *, is_whole: bool) -> Iterator[FileProblem]:
        """What is wrong with its keys together, whatever their values; nothing lacks where the row is not whole."""
        found = [key for key in cls.one_of if key in stated]
        allowed = f"exactly one of {' and '.join(cls.one_of)}"
        if len(found) > 1:
            yield FileProblem.of_key(found[1], " and ".join(found), allowed, "remove one of the two")
        elif cls.one_of and not found and is_whole:
            key = cls.one_of[0]
            got = f"neither {' nor '.join(cls.one_of)}"
            yield FileProblem.of_key(key, got, allowed, f"add {key} = {example_value(cls, key)}")


def example_value(model: type[Table], key: str) -> str:
    """A value that a key may have, as TOML text."""
    field = keys_of(model)[key]
    return example_of(field) or f'"{describe_kind(unit_of(field))[1]}"'


def read_tables(source: Source, model: type[AnyTable]) -> AnyTable:
    """What a file says, as its model; every problem of the file at once, the first `MOST_PROBLEMS` in its order."""
    if not source.is_readable:
        raise InputError(source.problems)
    reporter = Reporter(source.file, source.places, {}, model)
    problems = [*source.problems]
    try:
        found = model.model_validate(source.tables)
    except ValidationError as error:
        told = told_errors(error, reporter, model, is_whole=source.is_whole)
        problems += (problem for _, problem, _ in islice(told, MOST_PROBLEMS))
        found = None
    problems += islice(_row_faults(source, model, reporter), MOST_PROBLEMS)
    if found is None or problems:
        refuse(problems)
    return found


def refuse(problems: Iterable[FileProblem]) -> NoReturn:
    """Raise the first problems of a file."""
    raise InputError(InputError(problems).problems[:MOST_PROBLEMS])


def told_errors(
    found: ValidationError | Iterable[dict[str, Any]],
    reporter: Reporter,
    model: type[Table],
    *,
    is_whole: bool = True,
    doubtful: AbstractSet[Path] = frozenset(),
) -> Iterator[tuple[Path, FileProblem, dict[str, Any]]]:
    """Problems of one validation, each with its path and its error, without those that only follow from others.

    Nothing lacks inside `doubtful` tables, nor anywhere where lines were left out.
    """
    by_key: dict[Path, list[dict[str, Any]]] = {}
    errors = found.errors(include_url=False) if isinstance(found, ValidationError) else found
    for entry in map(dict[str, Any], errors):
        by_key.setdefault(key_path(entry["loc"]), []).append(entry)
    unknown = [path for path, entries in by_key.items() if entries[0]["type"] == "extra_forbidden"]
    misspelt = {(*path[:-1], nearest_key(model, path)) for path in unknown}
    for path, entries in by_key.items():
        kind = entries[0]["type"]
        follows = path[:-1] in doubtful or path in misspelt or not is_whole
        # A default that is made from another key cannot be made when that key is wrong.
        if kind != "default_factory_not_called" and not (kind == "missing" and follows):
            yield path, reporter.from_errors(entries), entries[0]


def check_values(model: type[Row], where: str, values: Mapping[str, object]) -> None:
    """Refuse, with a `DetentError`, what a program gives and no file could: values in SI units by the model's keys.

    Keys without a value (None, an empty text) count as absent.
    """
    stated = {key: _plain(value) for key, value in values.items() if value is not None and value != ""}
    problems = list(model.faults(stated, is_whole=True))
    try:
        model.model_validate(stated, context=IN_SI)
    except ValidationError as error:
        reporter = Reporter("", {}, {}, model)
        told = [problem for _, problem, _ in told_errors(error, reporter, model)]
        units = {key: f" {unit_of(field)}".rstrip() for key, field in keys_of(model).items()}
        problems = [replace(one, got=f"{one.key} {one.got}{units.get(one.key, '')}") for one in told] + problems
    for problem in problems[:1]:
        raise DetentError(f"{where}: got {problem.got}; expected: {problem.allowed}; try: {problem.remedy}")


def _plain(value: object) -> object:
    """A number of numpy's as one of Python's."""
    item = getattr(value, "item", None)
    return item() if callable(item) else value


def _row_faults(source: Source, model: type[Table], reporter: Reporter) -> Iterator[FileProblem]:
    """What is wrong with the keys of each row together."""
    for key, field in keys_of(model).items():
        row, tables = table_of(field), source.tables.get(key)
        if not is_rows(field) or row is None or not issubclass(row, Row) or not isinstance(tables, list):
            continue
        known = set(row.known())
        for number, table in enumerate(cast("list[object]", tables)):
            if isinstance(table, dict):
                stated = cast("dict[str, Any]", table)
                is_whole = source.is_whole and known.issuperset(stated)
                for fault in row.faults(stated, is_whole=is_whole):
                    yield reporter.placed((key, Index(number)), fault)
