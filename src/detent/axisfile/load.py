"""From an axis file to a checked specification: `load_spec`, or `read_axis` where the origin of each value matters."""

import copy
import difflib
import re
import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path as FilePath
from typing import Any, cast

from pydantic import ValidationError
from pydantic.fields import FieldInfo

from detent.axisfile.catalogue import dc_motors, motor_constants
from detent.axisfile.fields import Table, example_of, is_list, leaf_fields, options_of, table_of, unit_of
from detent.axisfile.findings import Contradiction
from detent.axisfile.locate import Path
from detent.axisfile.methods import METHODS, AnySpec, Method
from detent.axisfile.problems import Reporter, dotted, field_at, key_path, nearest_key
from detent.axisfile.source import Source, read_source
from detent.errors import FileProblem, InputError

METHOD_KEY: Path = ("axis", "method")

_NUMBER = re.compile(r"[+-]?[0-9][0-9_]*(\.[0-9]+)?([eE][+-]?[0-9]+)?")


@dataclass(frozen=True, slots=True)
class AxisFile:
    """A specification and where each of its values came from.

    Attributes
    ----------
    file : str
        The file as the user named it.
    spec : AxisSpec
        The specification of its method, in SI units.
    origins : dict
        By dotted key: "line 12", "--set" or "catalogue NAME"; keys left to their default are absent.
    texts : dict
        By dotted key: the value as written, where it was written.
    """

    file: str
    spec: AnySpec
    origins: dict[str, str]
    texts: dict[str, str]


@dataclass(slots=True)
class _Layers:
    """What the file, the catalogue and the overrides say together."""

    tables: dict[str, Any]
    overrides: dict[Path, str] = field(default_factory=dict[Path, str])
    catalogue: dict[Path, str] = field(default_factory=dict[Path, str])
    problems: list[FileProblem] = field(default_factory=list[FileProblem])
    doubtful: set[Path] = field(default_factory=set[Path])


def load_spec(path: FilePath | str, overrides: Sequence[str] = ()) -> AnySpec:
    """Load an axis file.

    Parameters
    ----------
    path : Path or str
        The axis file (TOML).
    overrides : sequence of str
        Values that replace the file's, such as ``"drive.supply=34 V"`` or ``"method.span=steady"``.

    Returns
    -------
    AxisSpec
        The specification of the method the file names: all values, defaults filled, in SI units.

    Raises
    ------
    InputError
        With every problem of the file and of the overrides.
    """
    return read_axis(path, overrides).spec


def read_axis(path: FilePath | str, overrides: Sequence[str] = ()) -> AxisFile:
    """Load an axis file and keep where each value came from; parameters and errors as `load_spec`."""
    return axis_of(read_source(path), overrides)


def axis_of(source: Source, overrides: Sequence[str] = ()) -> AxisFile:
    """Check a source that has been read; parameters and errors as `load_spec`."""
    if not source.is_readable:
        raise InputError(source.problems)
    method = _method_of(source, overrides)
    model = method.spec
    layers = _Layers(copy.deepcopy(source.tables))
    _apply_overrides(layers, overrides, model)
    reporter = Reporter(source.file, source.places, layers.overrides, model)
    _apply_catalogue(layers, reporter, model)
    spec = _validated(layers, reporter, method, is_whole=source.is_whole)
    problems = [*source.problems, *layers.problems]
    if problems:
        raise InputError(problems)
    return AxisFile(source.file, spec, *_origins(source, layers, model))


def _method_of(source: Source, overrides: Sequence[str]) -> Method[Any]:
    """Method the file names; without a name, the first, so that the rest is checked all the same."""
    name: object = _as_table(source.tables.get("axis")).get("method")
    parts = [text.partition("=") for text in overrides]
    stated = [value.strip().strip("\"'") for key, _, value in parts if key.strip() == "axis.method"]
    name = stated[-1] if stated else name
    if not isinstance(name, str):
        return next(iter(METHODS.values()))
    if name in METHODS:
        return METHODS[name]
    near = difflib.get_close_matches(name.lower().replace("-", "_").replace(" ", "_"), METHODS, n=1)
    remedy = f'did you mean "{near[0]}"?' if near else f'write method = "{next(iter(METHODS))}"'
    overridden = {METHOD_KEY: f'"{name}"'} if stated else {}
    reporter = Reporter(source.file, source.places, overridden, Table)
    # Nothing else can be said: another method would have other keys.
    problem = reporter.problem(METHOD_KEY, reporter.came(METHOD_KEY, name), _all_methods(), remedy)
    raise InputError([*source.problems, problem])


def _all_methods() -> str:
    """Every word that ``axis.method`` may be."""
    return " or ".join(f'"{known}"' for known in METHODS)


def _apply_overrides(layers: _Layers, overrides: Sequence[str], model: type[Table]) -> None:
    """Put the values of ``--set`` over the file's; an unknown key is a problem at once."""
    known = dict(leaf_fields(model))
    for text in overrides:
        key, equals, value = (part.strip() for part in text.partition("="))
        path = tuple(key.split("."))
        if not equals or not value:
            layers.problems.append(
                FileProblem("--set", 0, 0, key, f'"{text}"', "KEY=VALUE", "write it as in --set 'drive.supply=34 V'")
            )
        elif path not in known:
            near = difflib.get_close_matches(key, [dotted(candidate) for candidate in known], n=1, cutoff=0.5)
            remedy = f'did you mean "{near[0]}"?' if near else "`detent check` lists the keys"
            layers.problems.append(
                FileProblem("--set", 0, 0, key, f'the unknown key "{key}"', "a key of the axis file", remedy)
            )
        else:
            _put(layers.tables, path, _override_value(known[path], value))
            layers.overrides[path] = value


def _override_value(field: FieldInfo, text: str) -> object:
    """Value of an override: what the same words mean in a file, quotes being optional."""
    if len(text) >= 2 and text[0] == text[-1] and text[0] in "\"'":
        return text[1:-1]
    if is_list(field) and text.startswith("["):
        return _list_value(text)
    if field.annotation is str or options_of(field):
        return text
    if text in {"true", "false"} and not unit_of(field):
        return text == "true"
    match = _NUMBER.fullmatch(text)
    if match is None or len(text) > 40:
        return text
    return float(text) if match.group(1) or match.group(2) else int(text)


def _list_value(text: str) -> object:
    """Value of a list in an override; what is no TOML stays text, and validation refuses it."""
    try:
        tables = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    # After a line break anything could follow.
    return tables["value"] if len(tables) == 1 else text


def _as_table(value: object) -> dict[str, Any]:
    """Give the value itself if it is a table, else an empty one."""
    return cast("dict[str, Any]", value) if isinstance(value, dict) else {}


def _put(tables: dict[str, Any], path: Path, value: object) -> None:
    """Set a value in nested tables; where a table is none, validation says so."""
    for key in path[:-1]:
        tables = _as_table(tables.setdefault(key, {}))
    tables[path[-1]] = value


def _apply_catalogue(layers: _Layers, reporter: Reporter, model: type[Table]) -> None:
    """Put a catalogue motor's constants under the stated ones, where the method knows a catalogue."""
    known = {path for path, _ in leaf_fields(model)}
    motor = _as_table(layers.tables.get("motor"))
    name: object = motor.get("catalogue")
    if not name or ("motor", "catalogue") not in known:
        return
    if not isinstance(name, str):
        # Validation refuses it; without the motor it names, missing constants are no news.
        layers.doubtful.add(("motor",))
        return
    constants = motor_constants(name)
    if constants is None:
        names = list(dc_motors())
        near = difflib.get_close_matches(name.lower(), {known.lower(): known for known in names}, n=1, cutoff=0.4)
        nearest = next((known for known in names if near and known.lower() == near[0]), None)
        remedy = f'did you mean "{nearest}"?' if nearest else "choose one of these, or state the constants in [motor]"
        path = ("motor", "catalogue")
        layers.problems.append(
            reporter.problem(path, reporter.came(path), f"a motor of the catalogue: {', '.join(names)}", remedy)
        )
        layers.doubtful.add(("motor",))
        return
    for key, value in constants.items():
        if key not in motor and ("motor", key) in known:
            motor[key] = value
            layers.catalogue["motor", key] = name


def _validated(layers: _Layers, reporter: Reporter, method: Method[Any], *, is_whole: bool) -> AnySpec:
    """Validate all layers together; what is wrong joins ``layers.problems``."""
    tables = layers.tables
    # Rules between keys need a whole specification: keys with problems are replaced by ones that are allowed, and the
    # rules that look at them are passed over. Each round can uncover keys below a table that was replaced.
    for round_number in range(8):
        try:
            spec = method.fill(method.spec.model_validate(tables))
        except ValidationError as error:
            found: list[dict[str, Any]] = [dict(entry) for entry in error.errors(include_url=False)]
            if round_number == 0:
                layers.problems += _tell(found, layers, reporter, method.spec, is_whole=is_whole)
            layers.doubtful |= {key_path(entry["loc"]) for entry in found}
            tables = _patched(tables, found, method.spec)
        else:
            found_together = (contradiction for rule in method.rules for contradiction in rule(spec))
            layers.problems += _contradictions(found_together, layers, reporter)
            return spec
    raise InputError(layers.problems)


def _tell(
    found: list[dict[str, Any]], layers: _Layers, reporter: Reporter, model: type[Table], *, is_whole: bool
) -> list[FileProblem]:
    """Problems of one validation, without those that only follow from others."""
    by_key: dict[Path, list[dict[str, Any]]] = {}
    for entry in found:
        by_key.setdefault(key_path(entry["loc"]), []).append(entry)
    unknown = [path for path, entries in by_key.items() if entries[0]["type"] == "extra_forbidden"]
    misspelt = {(*path[:-1], nearest_key(model, path)) for path in unknown}
    problems: list[FileProblem] = []
    for path, entries in by_key.items():
        kind = entries[0]["type"]
        follows = path[:1] in layers.doubtful or path in misspelt or not is_whole
        # A default that is made from another key cannot be made when that key is wrong.
        if kind == "default_factory_not_called" or (kind == "missing" and follows):
            continue
        problem = reporter.from_errors(entries)
        # The model knows the one method it was made for; a file may name any.
        problems.append(replace(problem, allowed=_all_methods()) if path == METHOD_KEY else problem)
    return problems


def _contradictions(found: Iterable[Contradiction], layers: _Layers, reporter: Reporter) -> list[FileProblem]:
    """Problems between keys that are each right for themselves."""
    problems: list[FileProblem] = []
    for contradiction in found:
        paths = contradiction.paths
        if any(_overlap(path, doubtful) for path in paths for doubtful in layers.doubtful):
            continue
        # What the user changed last is to blame first.
        stated = [path for path in paths if path in layers.overrides] or [
            path for path in paths if reporter.is_stated(path)
        ]
        blamed = stated[0] if stated else paths[0]
        came = reporter.came(blamed) if stated else "the default"
        problems.append(
            reporter.problem(blamed, came, _allowed_at(blamed, contradiction, reporter), contradiction.remedy)
        )
    return problems


def _allowed_at(blamed: Path, contradiction: Contradiction, reporter: Reporter) -> str:
    """What is allowed; told at another key than the rule is about, it names that key and its value."""
    ruled = contradiction.paths[0]
    if blamed == ruled:
        return contradiction.allowed
    value = reporter.came(ruled) if reporter.is_stated(ruled) else "its default"
    return f"{contradiction.keys[0]} ({value}) {contradiction.allowed}"


def _overlap(one: Path, other: Path) -> bool:
    """True when one path is the other or lies inside it."""
    length = min(len(one), len(other))
    return one[:length] == other[:length]


def _patched(tables: dict[str, Any], found: list[dict[str, Any]], model: type[Table]) -> dict[str, Any]:
    """Copy of the tables in which keys with problems are left out or replaced by an allowed value."""
    patched = copy.deepcopy(tables)
    for entry in found:
        path = key_path(entry["loc"])
        if entry["type"] == "extra_forbidden" or not field_at(model, path).is_required():
            _drop(patched, path)
        elif table_of(field_at(model, path)) is not None:
            _put(patched, path, {})
        else:
            _put(patched, path, _example_value(example_of(field_at(model, path))))
    return patched


def _drop(tables: dict[str, Any], path: Path) -> None:
    """Remove a key from nested tables."""
    for key in path[:-1]:
        tables = tables[key]
    tables.pop(path[-1], None)


def _example_value(example: str) -> object:
    """Value of an example, which is TOML."""
    return tomllib.loads(f"value = {example}")["value"]


def _origins(source: Source, layers: _Layers, model: type[Table]) -> tuple[dict[str, str], dict[str, str]]:
    """Where each value came from, and how it was written there."""
    origins: dict[str, str] = {}
    texts: dict[str, str] = {}
    for path, _ in leaf_fields(model):
        key = dotted(path)
        if path in layers.overrides:
            origins[key], texts[key] = "--set", layers.overrides[path]
        elif path in source.places:
            origins[key], texts[key] = f"line {source.places[path].line}", source.places[path].text.strip("\"'")
        elif path in layers.catalogue:
            origins[key] = f"catalogue {layers.catalogue[path]}"
            texts[key] = str(layers.tables["motor"][path[-1]])
    return origins, texts
