"""The table ``[tolerance]``: between which values a key of the axis file lies, from one machine to the next.

    [tolerance]
    "mechanics.load_mass" = "10 %"                                   of the value, both sides
    "mechanics.friction.positive.coulomb" = ["10 N", "18 N"]         from, to
    "mechanics.coupling.stiffness" = { interval = ["51 N/um", "69 N/um"], distribution = "normal" }
    "drive.delay" = [1, 2]                                           whole numbers, each equally likely
    "mechanics.motor_mass" = "not trusted"                           an interval is to be stated, or found

Values are spread evenly, or, where the distribution is normal, so that 95 % of them lie in the interval. An entry with
``correlation = { "mechanics.load_mass" = 0.4 }`` is drawn jointly with another, by a Gaussian copula.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from pydantic.fields import FieldInfo

from detent.errors import FileProblem
from detent.files.fields import BOUNDS, Table, bounds_of, held_leaves, is_list, leaf_fields, type_of, unit_of
from detent.files.locate import Path
from detent.files.problems import Reporter, describe_allowed, dotted
from detent.files.text import did_you_mean
from detent.units import QuantityError, describe_kind, format_quantity, parse_quantity

TABLE = "tolerance"
DISTRIBUTIONS = "uniform", "normal"
LEVEL = NormalDist().inv_cdf(0.975)  # standard deviations from the middle to an end of 95 %
EDGE = 2.0**-53  # nearest to 0 and 1 that a share comes
UNTRUSTED = "not trusted"  # instead of an interval: what a recording was to tell, and did not

Shares = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Tolerance:
    """What is not known of one key."""

    key: str  # dotted
    low: float  # and high: ends of the interval, in the SI unit of the key; of a normal distribution those of 95 %
    high: float
    normal: bool = False
    whole: bool = False  # the values are whole numbers
    unit: str = ""  # SI unit of the key
    correlation: tuple[tuple[str, float], ...] = ()  # with other keys, of the normal numbers that both are drawn by
    trusted: bool = True  # False where nobody can say the interval

    @property
    def path(self) -> Path:
        """The key as a path."""
        return tuple(self.key.split("."))

    def at(self, share: float) -> float:
        """The value below which such a share of all lie, above 0 and below 1: the inverse distribution.

        >>> Tolerance("drive.delay", 1, 2, whole=True).at(0.4), Tolerance("a", 0.0, 1.0, normal=True).at(0.5)
        (1, 0.5)
        """
        if self.whole:
            return int(self.low) + min(int(share * (self.high - self.low + 1)), round(self.high - self.low))
        if self.normal:
            middle, half = 0.5 * (self.low + self.high), 0.5 * (self.high - self.low)
            return middle + half / LEVEL * NormalDist().inv_cdf(share)
        return self.low + share * (self.high - self.low)

    def __str__(self) -> str:
        """Between what, for people."""
        low, high = (f"{end:g}" if self.whole or not self.unit else format_quantity(end, self.unit, 4)
                     for end in (self.low, self.high))  # fmt: skip
        return f"{low} to {high}{', 95 % of all' if self.normal else ''}"


def value_of(spec: Any, key: str) -> float:
    """Value of a dotted key."""
    at: Any = spec
    for part in key.split("."):
        at = cast("Any", at)[part] if isinstance(at, dict) else getattr(at, part)
    return float(at)


def read_tolerances(
    table: object, spec: Table, model: type[Table], reporter: Reporter
) -> tuple[dict[str, Tolerance], list[FileProblem]]:
    """What the table says of a specification, by key, and all that is wrong with it."""
    if not isinstance(table, dict):
        return {}, [reporter.problem((TABLE,), reporter.got((TABLE,), table), "a table", f"write [{TABLE}]")]
    fields = dict(leaf_fields(model))
    held = {path: (field, value) for path, field, value in held_leaves(spec)}
    found, places, problems = dict[str, Tolerance](), dict[str, Path](), list[FileProblem]()
    for place, path, entry in _entries(cast("dict[str, Any]", table), (TABLE,), ()):
        one = _Entry(place, path, reporter, fields, held)
        try:
            found[dotted(path)] = one.read(entry)
            places[dotted(path)] = place
        except _WrongError as wrong:
            problems.append(
                reporter.problem(place, wrong.got or reporter.got(place, entry), wrong.allowed, wrong.remedy)
            )
    for key, one in found.items() if not problems else ():
        try:
            _check_partners(one, found)
        except _WrongError as wrong:
            problems.append(reporter.problem(places[key], wrong.got, wrong.allowed, wrong.remedy))
    return found, problems


# ---- keys that are drawn jointly


def _check_partners(one: Tolerance, found: Mapping[str, Tolerance]) -> None:
    """Refuse correlations with what is drawn by itself, and such as no numbers have."""
    for key, number in one.correlation:
        other = found.get(key)
        if other is None or other.whole or not other.trusted or other is one:
            names = [name for name, each in found.items() if each.trusted and not each.whole and each is not one]
            remedy = did_you_mean(key, names, "state its interval")
            raise _WrongError("another key of this table with an interval", remedy, f"a correlation with {key}")
        if dict(other.correlation).get(one.key, number) != number:
            raise _WrongError("the same correlation at both keys", "write it once", f"two correlations with {key}")
    if one.correlation and cholesky(correlations(found)[1]) is None:
        allowed = "correlations that numbers can have together: a positive definite matrix"
        raise _WrongError(allowed, "bring them nearer to 0", f"correlations of {one.key}")


def correlations(found: Mapping[str, Tolerance]) -> tuple[list[str], list[list[float]]]:
    """The keys that are drawn jointly, in their order, and the matrix of their correlations."""
    pairs = {frozenset((key, other)): r for key, one in found.items() for other, r in one.correlation}
    names = [key for key in found if any(key in pair for pair in pairs)]
    return names, [[1.0 if a == b else pairs.get(frozenset((a, b)), 0.0) for b in names] for a in names]


def cholesky(matrix: Sequence[Sequence[float]]) -> list[list[float]] | None:
    """The lower factor of a symmetric matrix, the same on every processor; None where it is not positive definite.

    >>> cholesky([[1.0, 0.6], [0.6, 1.0]])
    [[1.0, 0.0], [0.6, 0.8]]
    """
    made = [[0.0] * len(matrix) for _ in matrix]
    for i, row in enumerate(matrix):
        for j in range(i + 1):
            left = row[j] - sum(made[i][k] * made[j][k] for k in range(j))
            if i == j and left <= 0.0:
                return None
            made[i][j] = math.sqrt(left) if i == j else left / made[j][j]
    return made


def joint(found: Mapping[str, Tolerance], shares: Mapping[str, Shares]) -> dict[str, Shares]:
    """Shares of each key, shape (n,), that go together as the table says, from independent ones.

    A Gaussian copula: the normal numbers of the shares are mixed by the lower factor of the correlations, in the order
    of the table, so that a key does not depend on those behind it; shares of other keys stay to the bit.
    """
    names, matrix = correlations(found)
    if not names:
        return dict(shares)
    from scipy.special import ndtr, ndtri

    factor = cholesky(matrix) or []  # the reading has refused those that have none
    normal = [ndtri(shares[name]) for name in names]
    mixed = dict(shares)
    for k, (name, row) in enumerate(zip(names, factor, strict=True)):
        if row[k] != 1.0:
            total = np.zeros_like(normal[0])
            for weight, one in zip(row, normal, strict=True):
                total = total + weight * one if weight else total
            mixed[name] = np.clip(ndtr(total), EDGE, 1.0 - EDGE)
    return mixed


# ---- one entry


def _entries(table: Mapping[str, Any], place: Path, path: Path) -> Iterator[tuple[Path, Path, Any]]:
    """Each entry with its place in the file and the key it is about, quoted or in tables of its own."""
    for key, value in table.items():
        at, about = (*place, key), (*path, *key.split("."))
        if isinstance(value, dict) and "interval" not in value and "distribution" not in value:
            yield from _entries(cast("dict[str, Any]", value), at, about)
        else:
            yield at, about, value


class _WrongError(Exception):
    def __init__(self, allowed: str, remedy: str, got: str = "") -> None:
        super().__init__(allowed)
        self.allowed, self.remedy, self.got = allowed, remedy, got


@dataclass(frozen=True)
class _Entry:
    """One entry that is being read."""

    place: Path
    path: Path
    reporter: Reporter
    fields: Mapping[Path, FieldInfo]
    held: Mapping[Path, tuple[FieldInfo, object]]

    def read(self, entry: object) -> Tolerance:
        """What it says; a `_WrongError` where that makes no sense."""
        field, value = self._subject()
        unit, whole = unit_of(field), type_of(field) is int
        if entry == UNTRUSTED:
            return Tolerance(dotted(self.path), value, value, whole=whole, unit=unit, trusted=False)
        normal, correlation = False, tuple[tuple[str, float], ...]()
        if isinstance(entry, dict):
            said = cast("dict[str, Any]", entry)
            distribution = said.get("distribution", "uniform")
            known = set(said) <= {"interval", "distribution", "correlation"}
            if not known or "interval" not in said or distribution not in DISTRIBUTIONS:
                allowed = '{ interval = [FROM, TO], distribution = "uniform" or "normal" }'
                raise _WrongError(allowed, "write it so")
            entry, normal = said["interval"], distribution == "normal"
            correlation = _correlation(said.get("correlation", {}))
        low, high = self._interval(entry, field, value)
        made = Tolerance(dotted(self.path), low, high, normal, whole, unit, correlation)
        if whole and (normal or correlation):
            allowed = "a uniform distribution of whole numbers, each drawn by itself"
            raise _WrongError(allowed, "leave distribution and correlation out")
        if not low <= value <= high or low == high:
            held = format_quantity(value, unit, 6) if unit else f"{value:g}"
            raise _WrongError(f"an interval that holds the value of {made.key}, {held}", "widen it, or mend the value")
        for kind, bound in bounds_of(field):
            for end in (low, high):
                if not BOUNDS[kind][1](end, bound):
                    raise _WrongError(describe_allowed(field), "keep the interval within what the key may be")
        return made

    def _subject(self) -> tuple[FieldInfo, float]:
        """The key it is about, and its value."""
        if self.path not in self.held:
            if self.path in self.fields:
                remedy = f"state {dotted(self.path)} first"
                raise _WrongError("a key that has a value in this file", remedy, f"{dotted(self.path)}, which has none")
            names = [dotted(path) for path, (_, value) in self.held.items() if isinstance(value, int | float)]
            remedy = did_you_mean(dotted(self.path), names, "name a key of this file, as `detent keys` lists them")
            raise _WrongError("a key of the axis file with its table", remedy, f'the unknown key "{dotted(self.path)}"')
        field, value = self.held[self.path]
        is_number = isinstance(value, int | float) and not isinstance(value, bool) and not is_list(field)
        if not is_number or not math.isfinite(cast("float", value)):
            raise _WrongError("a key that is a number", "take it out", f"{dotted(self.path)}, which is none")
        return field, cast("float", value)

    def _interval(self, entry: object, field: FieldInfo, value: float) -> tuple[float, float]:
        """Ends of an interval as written."""
        unit, whole = unit_of(field), type_of(field) is int
        example = describe_kind(unit)[1] if unit else "1" if whole else "0.5"
        example = f'"{example}"' if unit else example
        allowed = f"[FROM, TO] such as [{example}, {example}]" + ("" if whole else ', or a share such as "10 %"')
        if isinstance(entry, str) and entry.strip().endswith("%") and not whole:
            try:
                share = parse_quantity(entry, "%")
            except QuantityError:
                share = math.nan
            if not 0.0 < share < 1.0:
                raise _WrongError('a share above 0 % and below 100 %, such as "10 %"', "give a share in this range")
            return value - share * abs(value), value + share * abs(value)
        if not isinstance(entry, list) or len(cast("list[object]", entry)) != 2:
            raise _WrongError(allowed, "write two values in brackets")
        ends = [self._end(one, unit, whole=whole, allowed=allowed) for one in cast("list[object]", entry)]
        if ends[0] > ends[1]:
            raise _WrongError("the smaller value first", "exchange both")
        return ends[0], ends[1]

    def _end(self, text: object, unit: str, *, whole: bool, allowed: str) -> float:
        if unit and isinstance(text, str):
            try:
                return parse_quantity(text, unit)
            except QuantityError as error:
                raise _WrongError(error.allowed, error.remedy) from error
        kinds = (int,) if whole else (int, float)
        if unit or isinstance(text, bool) or not isinstance(text, kinds) or not math.isfinite(text):
            raise _WrongError(allowed, "write each value as the key itself is written")
        return text


def _correlation(said: object) -> tuple[tuple[str, float], ...]:
    """The correlations of an entry as written, by the dotted keys of the others."""
    allowed = 'correlation = { "KEY" = R } with R above -1 and below 1'
    if not isinstance(said, dict):
        raise _WrongError(allowed, "write it so")
    pairs = list(cast("dict[str, Any]", said).items())
    for _, number in pairs:
        if isinstance(number, bool) or not isinstance(number, int | float) or not -1.0 < number < 1.0:
            raise _WrongError(allowed, "write each as a number, its key in quotes")
    return tuple((key, float(number)) for key, number in pairs)
