"""What an identification says of the tolerances of an axis: the interval of each constant, and which go together."""

import math
import re
import tomllib
from collections.abc import Collection, Iterator, Sequence
from typing import Any, cast

from annotated_types import Ge, Gt, Le, Lt

from detent.axisfile.tolerance import UNTRUSTED, cholesky
from detent.errors import DetentError
from detent.files.fields import bounds_of, leaf_fields
from detent.files.locate import locate_keys
from detent.files.patch import NewValue
from detent.files.text import lines_of
from detent.identify.fit.constants import Constants
from detent.identify.write.file_numbers import Number
from detent.methods.cascade.schema import CascadeSpec
from detent.units import format_quantity, parse_quantity

DIGITS = 9  # of the end of an interval
ROUNDED = 1e-5  # of a value, that it may be off as it is written
FAR = 2.55  # halves of a 95 % interval to where hardly one of a million is: 5 standard deviations
TOGETHER = 0.3  # correlation from which on two constants are drawn jointly
_JOINT = re.compile("mass|coulomb|viscous|static|stribeck")  # kinds of constants of which that is told
_SHRINK = 0.98  # of rounded correlations that no numbers have together


def tolerance_values(
    numbers: Sequence[Number], constants: Constants | None, text: str, held: Collection[str]
) -> list[NewValue]:
    """Entries of the table of tolerances.

    A trusted constant has its 95 % interval, normal, or uniform where a normal distribution would leave what the key
    may be. One that is not trusted is marked so: until somebody states its interval, `tune` and `tolerance` refuse. An
    entry that somebody wrote into the `text` of the axis file stays where it holds the new value; `held` are the keys
    that have a value there.
    """
    known = {one.name: one for one in numbers if one.name}
    told = [one for one in numbers if one.name and not _is_theirs(one, text)]
    entries = {one.name: entry for one in told if one.trusted and (entry := _interval(one, known))}
    together = _correlations(constants, list(entries))
    made = list[NewValue]()
    for one in told:
        key, where = f"tolerance.{one.key}", one.note.rpartition(", ")[2]
        if one.name in entries:
            ends, normal = entries[one.name]
            said = [f"interval = [{ends}]"] + ['distribution = "normal"'] * normal
            pairs = ", ".join(f'"{known[other].key}" = {r:.3g}' for other, r in together.get(one.name, {}).items())
            said += [f"correlation = {{ {pairs} }}"] if pairs else []
            made.append(NewValue(key, one.value, one.unit, f"95 %, {where}", text=f"{{ {', '.join(said)} }}"))
        elif not one.trusted and one.key in held:
            made.append(NewValue(key, one.value, one.unit, where, text=f'"{UNTRUSTED}"'))
    return made


def _interval(one: Number, known: dict[str, Number]) -> tuple[str, bool] | None:
    """Ends of an interval as a file has them, and whether it is normal; None where there is nothing to vary."""
    if one.key == "drive.delay":
        low, high = (round(end) for end in (min(one.low, one.value), max(one.high, one.value)))
        return None if low == high else (f"{max(low, 0)}, {high}", False)
    half = 0.5 * (one.high - one.low)
    coulomb = known.get(one.name.replace("static", "coulomb"))
    if one.name.startswith("static") and coulomb and one.value - FAR * half < coulomb.value + FAR * half:
        return None  # drawn by itself it would come to lie below Coulomb friction; so it follows that
    if not half > 0.0:
        return None
    low, high = one.low, one.high
    least, most = _bounds(one.key)
    normal = one.value - FAR * half > least and one.value + FAR * half < most
    if not normal:
        inside = ROUNDED * abs(one.value)
        low, high = max(low, least + inside), min(high, most - inside)
    low, high = min(low, one.value - ROUNDED * abs(one.value)), max(high, one.value + ROUNDED * abs(one.value))
    return ", ".join(_written(end, one.unit) for end in (low, high)), normal


def _bounds(key: str) -> tuple[float, float]:
    """Between what a key may be."""
    found = list(bounds_of(dict(leaf_fields(CascadeSpec))[tuple(key.split("."))]))
    least = [float(bound) for kind, bound in found if kind in {Ge, Gt}]
    most = [float(bound) for kind, bound in found if kind in {Le, Lt}]
    return max(least, default=-math.inf), min(most, default=math.inf)


def _written(value: float, unit: str) -> str:
    return f'"{format_quantity(value, unit, DIGITS)}"' if unit else f"{value:.{DIGITS}g}"


def _correlations(constants: Constants | None, names: Sequence[str]) -> dict[str, dict[str, float]]:
    """What is drawn jointly: of each constant its correlation with those before it."""
    kept = [name for name in names if _JOINT.match(name) and constants and name in constants.names]
    if constants is None or not kept:
        return {}
    at = [constants.names.index(name) for name in kept]
    table = constants.correlation
    matrix = [[1.0 if i == j else round(float(table[i, j]), 3) for j in at] for i in at]
    matrix = [[r if abs(r) > TOGETHER else 0.0 for r in row] for row in matrix]
    while cholesky(matrix) is None:  # what was left out, or rounding, made them such as no numbers have
        matrix = [[r if i == j else _SHRINK * r for j, r in enumerate(row)] for i, row in enumerate(matrix)]
    return {name: {kept[j]: matrix[i][j] for j in range(i) if matrix[i][j]} for i, name in enumerate(kept)}


def _is_theirs(one: Number, text: str) -> bool:
    """True for an entry of the file that somebody wrote, and that still holds."""
    tables: object = tomllib.loads(text).get("tolerance", {})
    for path, entry in _entries(tables, ()):
        if ".".join(path) == one.key:
            line = lines_of(text)[locate_keys(text)["tolerance", *path].line - 1]
            return _holds(entry, one, by_us="# identified" in line)
    return False


def _entries(tables: object, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any]]:
    """The table of tolerances, its keys in quotes or in tables of their own."""
    for key, value in cast("dict[str, Any]", tables).items() if isinstance(tables, dict) else ():
        if isinstance(value, dict) and "interval" not in value:
            yield from _entries(cast("object", value), (*path, key))
        else:
            yield (*path, key), value


def _holds(entry: Any, one: Number, *, by_us: bool) -> bool:
    """True where an entry holds a value; a share of it does, and is never ours."""
    interval: Any = cast("dict[str, Any]", entry).get("interval") if isinstance(entry, dict) else entry
    if isinstance(interval, str):
        return interval != UNTRUSTED
    try:
        low, high = (parse_quantity(end, one.unit) if one.unit else float(end) for end in interval)
    except (DetentError, TypeError, ValueError):
        return False
    return not by_us and (not one.trusted or low <= one.value <= high)
