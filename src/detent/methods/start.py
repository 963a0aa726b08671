"""An axis file to start from: made from a method's schema, so that it knows every key that the method knows today."""

from collections.abc import Iterable, Sequence
from pathlib import Path as FilePath
from typing import Any

from detent.errors import InputError
from detent.files.keys import starting_file
from detent.files.locate import Path
from detent.files.overrides import apply_overrides, filled
from detent.files.source import parse_source
from detent.methods.load import METHOD_KEY, axis_of, value_at
from detent.methods.method import Method

HEAD = """\
# An axis of the method {name}: {title}.
#
# Keys without a # are required; their values make an axis that runs: replace them with yours. Keys behind a # without
# a space are optional, with their default, or with an example if the default is derived from other keys.
#
#   detent check {file}              shows every effective value, the derived figures, and warnings
#   detent run {file} --job JOB      runs a job: {jobs}
#   detent keys {name} --search WORD      finds keys

"""


def starting_axis(method: Method[Any], file: FilePath, overrides: Sequence[str] = ()) -> str:
    """Text of an axis file of a method with every key, those of the overrides stated; refused where it would be wrong.

    The axis gets the name of `file`, where it will be.
    """
    stated: dict[str, Any] = {}
    apply_overrides(stated, overrides, method.spec)
    keys = (key for key in filled(stated, method.motion_key) if key)
    model = method.model_of(frozenset(key for key in keys if value_at(stated, key) == "rotary"))
    tables: dict[str, Any] = {"axis": {"name": file.stem[:80], METHOD_KEY[1]: method.name}}
    texts, problems = apply_overrides(tables, overrides, model)
    if problems:
        raise InputError(problems)
    paths = [("axis", "name"), METHOD_KEY, *texts]
    text = HEAD.format(name=method.name, title=method.title, file=file.name, jobs=method.jobs)
    text += starting_file(model, {path: _at(tables, path) for path in paths}, _from_catalogue(method, tables, texts))
    axis_of(parse_source(str(file), text), overrides)
    return text


def _from_catalogue(method: Method[Any], tables: dict[str, Any], paths: Iterable[Path]) -> dict[Path, object]:
    """Constants of the motors that are named among these values: the file need not state them."""
    named = [path for path in paths if path[-2:] == ("motor", "catalogue")]
    found = [(path[:-1], method.catalogue and method.catalogue.constants(_at(tables, path))) for path in named]
    return {(*around, key): value for around, constants in found for key, value in (constants or {}).items()}


def _at(tables: Any, path: Sequence[str]) -> Any:
    """Value at a path of nested tables."""
    for part in path:
        tables = tables[part]
    return tables
