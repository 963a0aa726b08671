"""From an axis file to a checked specification: `load_spec`, or `read_axis` where the origin of each value matters."""

import copy
import json
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path as FilePath
from typing import Any

from pydantic import ValidationError

from detent.axisfile.catalogue import Catalogue
from detent.axisfile.tables import AxisSpec
from detent.axisfile.tolerance import TABLE as TOLERANCE
from detent.axisfile.tolerance import Tolerance, read_tolerances
from detent.errors import FileProblem, InputError
from detent.files.fields import (
    AnyName,
    Table,
    example_of,
    fits,
    held_leaves,
    is_named,
    leaf_fields,
    named_as,
    table_of,
    unit_of,
)
from detent.files.findings import Contradiction
from detent.files.locate import Path, Place
from detent.files.overrides import apply_changes, apply_overrides, as_table, filled, nested, put_value
from detent.files.problems import Reporter, bad_names, dotted, field_at, key_path
from detent.files.read import told_errors
from detent.files.screen import OnScreen
from detent.files.source import Source, read_source
from detent.files.text import did_you_mean, nearest
from detent.methods.method import Method
from detent.methods.registry import METHODS
from detent.units import QuantityError, parse_quantity

DICTIONARY = "dictionary"  # where an axis that has no file comes from
METHOD_KEY: Path = ("axis", "method")


@dataclass(frozen=True, slots=True, repr=False)
class AxisFile(OnScreen):
    """A specification and where each of its values came from."""

    file: str  # the file as the user named it
    spec: AxisSpec  # the specification of its method, in SI units
    # by dotted key: "line 12", "--set", "replace" or "catalogue NAME"; keys left to their default are absent
    origins: dict[str, str]
    texts: dict[str, str]  # by dotted key: the value as written, where it was written
    # what it was made of, from which `replaced` makes another: text, values of ``--set``, values of a program
    source: Source
    overrides: tuple[str, ...] = ()
    changes: dict[str, Any] = field(default_factory=dict[str, Any])
    tolerance: Mapping[str, Tolerance] = field(default_factory=dict[str, Tolerance])  # by key, what is not known of it
    untrusted: tuple[str, ...] = ()  # keys of which not even that is known

    def replaced(self, changes: Mapping[str, Any]) -> "AxisFile":
        """The same with other values, checked as a whole."""
        return axis_of(self.source, self.overrides, nested(changes, self.changes))


@dataclass(slots=True)
class _Layers:
    """What the file, the catalogue and the overrides say together."""

    tables: dict[str, Any]
    overrides: dict[Path, str] = field(default_factory=dict[Path, str])
    changed: dict[Path, str] = field(default_factory=dict[Path, str])  # of overrides by a program, what they are called
    catalogue: dict[Path, str] = field(default_factory=dict[Path, str])
    problems: list[FileProblem] = field(default_factory=list[FileProblem])
    doubtful: set[Path] = field(default_factory=set[Path])


def load_spec(path: FilePath | str, overrides: Sequence[str] = ()) -> AxisSpec:
    """Load an axis file."""
    return read_axis(path, overrides).spec


def read_axis(path: FilePath | str, overrides: Sequence[str] = ()) -> AxisFile:
    """Load an axis file and keep where each value came from; parameters and errors as `load_spec`."""
    return axis_of(read_source(path), overrides)


def axis_of_tables(tables: Mapping[str, Any], overrides: Sequence[str] = ()) -> AxisFile:
    """Check what a file would say, given as nested dictionaries."""
    return axis_of(Source(DICTIONARY, {}, {(): Place(0, 0, "")}), overrides, nested(tables))


def axis_of(source: Source, overrides: Sequence[str] = (), changes: dict[str, Any] | None = None) -> AxisFile:
    """Check a source that has been read, with values of a program over it; parameters and errors as `load_spec`."""
    if not source.is_readable:
        raise InputError(source.problems)
    changes = changes or {}
    method = _method_of(source, overrides, changes)
    model = method.spec
    tables = copy.deepcopy(source.tables)
    texts, problems = apply_overrides(tables, overrides, model)
    written = apply_changes(tables, changes, model)
    named = dict.fromkeys(written, DICTIONARY if source.file == DICTIONARY else "replace")
    layers = _Layers(tables, texts | written, named, problems=problems)
    reporter = Reporter(source.file, source.places, layers.overrides, model, named)
    _apply_catalogue(layers, reporter, method)
    stated = layers.tables.pop(TOLERANCE, {})  # what the axis is does not depend on what is not known of it
    layers.problems += [reporter.wrong_name(path, field) for path, field in bad_names(model, layers.tables)]
    spec = _validated(layers, reporter, method, is_whole=source.is_whole)
    problems = [*source.problems, *layers.problems]
    tolerance, wrong = read_tolerances(stated, spec, model, reporter) if not problems else ({}, [])
    if problems or wrong:
        raise InputError([*problems, *wrong])
    origins, known = _origins(source, layers, spec), {key: one for key, one in tolerance.items() if one.trusted}
    untrusted = tuple(key for key in tolerance if key not in known)
    return AxisFile(source.file, spec, *origins, source, tuple(overrides), changes, known, untrusted)


def _method_of(source: Source, overrides: Sequence[str], changes: dict[str, Any]) -> Method[Any]:
    """Method the file names, for its motions; without one nothing else can be said: each has its own keys."""
    name, stated = _stated(source, overrides, changes, METHOD_KEY)
    if name is None and not source.is_whole:  # it may stand in a line that was left out
        raise InputError(source.problems)
    if name is None:
        reporter = Reporter(source.file, source.places, {}, AxisSpec)
        header = source.tables.get(METHOD_KEY[0], {})
        if not isinstance(header, dict):
            error = {"type": "model_type", "loc": METHOD_KEY[:1], "input": header}
            raise InputError([reporter.from_errors([error])])
        remedy = "add one of these in [axis]; `detent new METHOD` writes a file to start from"
        raise InputError([reporter.problem(METHOD_KEY, "nothing", _all_methods(), remedy)])
    if isinstance(name, str) and name in METHODS:
        method = METHODS[name]
        pattern = method.motion_key
        given = (tuple(text.partition("=")[0].strip().split(".")) for text in overrides)
        keys = {*filled(source.tables, pattern), *filled(changes, pattern)} | {k for k in given if fits(pattern, k)}
        turning = (key for key in keys if key and _stated(source, overrides, changes, key)[0] == "rotary")
        return method.turned(frozenset(turning))
    remedy = did_you_mean(str(name).replace("-", "_").replace(" ", "_"), METHODS, "write one of these")
    overridden = {METHOD_KEY: f'"{name}"'} if stated else {}
    reporter = Reporter(source.file, source.places, overridden, Table, {METHOD_KEY: stated})
    problem = reporter.problem(METHOD_KEY, reporter.got(METHOD_KEY, name), _all_methods(), remedy)
    raise InputError([*source.problems, problem])


def _stated(source: Source, overrides: Sequence[str], changes: dict[str, Any], path: Path) -> tuple[object, str]:
    """Value of a key that decides how the others are read, and what overrides the file with it; empty where it does."""
    changed = value_at(changes, path)
    if changed is not None:
        return changed, DICTIONARY if source.file == DICTIONARY else "replace"
    parts = [text.partition("=") for text in overrides]
    values = [value.strip().strip("\"'") for key, _, value in parts if key.strip() == dotted(path)]
    return (values[-1], "--set") if values else (value_at(source.tables, path), "")


def _all_methods() -> str:
    """Every word that ``axis.method`` may be."""
    return " or ".join(f'"{known}"' for known in METHODS)


def _apply_catalogue(layers: _Layers, reporter: Reporter, method: Method[Any]) -> None:
    """Put a catalogue motor's constants under the stated ones, for every motor of the file that names one."""
    if method.catalogue is None:
        return
    known = dict(leaf_fields(method.spec))
    pattern = next(path for path in known if path[-2:] == ("motor", "catalogue"))
    keys = {path[-1]: field.is_required() for path, field in known.items() if path[:-1] == pattern[:-1]}
    for path in list(filled(layers.tables, pattern)):
        _apply_motor(layers, reporter, method.catalogue, path, keys)


def _apply_motor(layers: _Layers, reporter: Reporter, catalogue: Catalogue, path: Path, keys: dict[str, bool]) -> None:
    """One motor: `path` is that of its key ``catalogue``, `keys` are those of its table: whether each is needed."""
    name = value_at(layers.tables, path)
    if not name:
        return
    around = path[:-1]
    if not isinstance(name, str):
        # Validation refuses it; without the motor it names, missing constants are no news.
        layers.doubtful.add(around)
        return
    constants = catalogue.constants(name)
    if constants is None:
        names = list(catalogue.entries())
        needed = ", ".join(key for key, is_needed in keys.items() if is_needed)
        remedy = _motor_meant(name, names, f"state its constants in [{dotted(around)}]: {needed}")
        layers.problems.append(
            reporter.problem(path, reporter.got(path), f"a motor of the catalogue: {', '.join(names)}", remedy)
        )
        layers.doubtful.add(around)
        return
    motor = as_table(value_at(layers.tables, around))
    for key, value in constants.items():
        if key not in motor and key in keys:
            motor[key] = value
            layers.catalogue[(*around, key)] = name


def _motor_meant(name: str, names: Sequence[str], otherwise: str) -> str:
    """What to do about a motor that the catalogue lacks: one of another size or winding is never the one meant."""
    own = "".join(_words(name))
    meant = [known for known in names if any(char.isdigit() for char in own) and own in _runs(_words(known))]
    if meant:
        each = " or ".join(json.dumps(known) for known in meant[:4])
        return f"did you mean {each}? Or {otherwise}"
    near = nearest(name, names, 0.6)
    return f"choose one of these, or {otherwise}" + (f' (the nearest name, "{near}", is another motor)' if near else "")


def _words(name: str) -> list[str]:
    """Letters and digits of a name, all small, parted where something else stands between them."""
    return re.findall(r"[a-z0-9]+", name.lower())


def _runs(words: list[str]) -> set[str]:
    """Words that stand one behind the other, put together."""
    ends = range(1, len(words) + 1)
    return {"".join(words[begin:end]) for end in ends for begin in range(end)}


def _validated(layers: _Layers, reporter: Reporter, method: Method[Any], *, is_whole: bool) -> AxisSpec:
    """Validate all layers together; what is wrong joins ``layers.problems``."""
    tables = layers.tables
    # Rules between keys need a whole specification: keys with problems are replaced by ones that are allowed, and the
    # rules that look at them are skipped. Each round can uncover keys below a table that was replaced.
    for round_number in range(8):
        try:
            spec = method.fill(method.spec.model_validate(tables))
        except ValidationError as error:
            found: list[dict[str, Any]] = [dict(entry) for entry in error.errors(include_url=False)]
            if round_number == 0:
                layers.problems += _tell(found, layers, reporter, method, is_whole=is_whole)
            layers.doubtful |= {key_path(entry["loc"]) for entry in found}
            tables = _patched(tables, found, method.spec)
        else:
            found_together = (contradiction for rule in method.rules for contradiction in rule(spec))
            layers.problems += _contradictions(found_together, layers, reporter)
            return spec
    raise InputError(layers.problems)


def _tell(
    found: list[dict[str, Any]], layers: _Layers, reporter: Reporter, method: Method[Any], *, is_whole: bool
) -> Iterator[FileProblem]:
    """Problems of one validation, without those that only follow from others."""
    told = told_errors(found, reporter, method.spec, is_whole=is_whole, doubtful=layers.doubtful)
    for path, problem, error in told:
        if error["type"] in {"quantity", "extra_forbidden"}:
            yield replace(problem, remedy=problem.remedy + _other_motion(method, path, error))
        else:
            # The model knows the one method it was made for; a file may name any.
            yield replace(problem, allowed=_all_methods()) if path == METHOD_KEY else problem


def _other_motion(method: Method[Any], path: Path, error: Mapping[str, Any]) -> str:
    """What to add to a remedy where a key or its quantity would do for the other motion; empty where it would not."""
    key = named_as(method.motion_key, path)
    if not key or any(isinstance(part, AnyName) for part in key):
        return ""
    other = METHODS[method.name].turned(method.turning ^ {key}).spec
    try:
        unit = unit_of(field_at(other, path))
        if error["type"] == "quantity":
            parse_quantity(str(error["input"]) if isinstance(error["input"], str) else "", unit)
    except (KeyError, QuantityError):
        return ""
    return f', or set {dotted(key)} = "{"linear" if key in method.turning else "rotary"}"'


def _contradictions(found: Iterable[Contradiction], layers: _Layers, reporter: Reporter) -> Iterator[FileProblem]:
    """Problems between keys that are each right for themselves."""
    for contradiction in found:
        paths = contradiction.paths
        # One path is the other, or lies inside it.
        if any(path[: len(other)] == other[: len(path)] for path in paths for other in layers.doubtful):
            continue
        # What the user changed last is to blame first.
        stated = [path for path in paths if path in layers.overrides] or list(filter(reporter.is_stated, paths))
        blamed = stated[0] if stated else paths[0]
        unstated = "a table of this name" if reporter.is_table(blamed) else "the default"
        got = reporter.got(blamed) if stated else unstated
        allowed = _allowed_at(blamed, contradiction, reporter)
        yield reporter.problem(blamed, got, allowed, contradiction.remedy)


def _allowed_at(blamed: Path, contradiction: Contradiction, reporter: Reporter) -> str:
    """What is allowed; told at another key than the rule is about, it names that key and its value."""
    ruled = contradiction.paths[0]
    if blamed == ruled:
        return contradiction.allowed
    value = reporter.got(ruled) if reporter.is_stated(ruled) else "its default"
    return f"{contradiction.keys[0]} ({value}) {contradiction.allowed}"


def _patched(tables: dict[str, Any], found: list[dict[str, Any]], model: type[Table]) -> dict[str, Any]:
    """Copy of the tables in which keys with problems are left out or replaced by an allowed value."""
    patched = copy.deepcopy(tables)
    for entry in found:
        path = key_path(entry["loc"])
        if entry["type"] == "extra_forbidden" or not field_at(model, path).is_required():
            _around(patched, path).pop(path[-1], None)
        elif is_named(field_at(model, path)):
            put_value(patched, path, {example_of(field_at(model, path)): {}})
        elif table_of(field_at(model, path)) is not None:
            put_value(patched, path, {})
        else:
            put_value(patched, path, tomllib.loads(f"value = {example_of(field_at(model, path))}")["value"])
    return patched


def _around(tables: dict[str, Any], path: Path) -> dict[str, Any]:
    """The nested table that a key is in; an empty one where there is none."""
    for key in path[:-1]:
        tables = as_table(tables.get(key))
    return tables


def value_at(tables: dict[str, Any], path: Path) -> object:
    """Value of a key in nested tables; None where there is none."""
    return _around(tables, path).get(path[-1])


def _origins(source: Source, layers: _Layers, spec: Table) -> tuple[dict[str, str], dict[str, str]]:
    """Where each value came from, and how it was written there."""
    origins: dict[str, str] = {}
    texts: dict[str, str] = {}
    for path, _, _ in held_leaves(spec):
        key = dotted(path)
        if path in layers.overrides:
            origins[key], texts[key] = layers.changed.get(path, "--set"), layers.overrides[path]
        elif path in source.places:
            origins[key], texts[key] = f"line {source.places[path].line}", source.places[path].text.strip("\"'")
        elif path in layers.catalogue:
            origins[key] = f"catalogue {layers.catalogue[path]}"
            texts[key] = str(value_at(layers.tables, path))
    return origins, texts
