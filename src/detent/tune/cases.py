"""The cases of a tolerance run: which question is asked, and which values case number i has.

The value of a key in case i is a function of (seed, i, key) alone: one number of Philox4x64 with the key (seed, first
8 bytes of the SHA-256 of the key) at counter i, through the inverse of its distribution. So a case does not depend on
how many there are, on chunks, on workers, nor on which other tolerances are stated. Case 0 is the file's.

Salmon, Moraes, Dror, Shaw: Parallel random numbers: as easy as 1, 2, 3. SC11.
"""

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, is_dataclass, replace
from functools import cached_property, lru_cache
from importlib import import_module
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from detent import __version__
from detent.axisfile.elementwise import is_array, nearest
from detent.axisfile.tolerance import EDGE, TABLE, Tolerance, joint, value_of
from detent.errors import DetentError
from detent.files.source import parse_source
from detent.kernel.cache import source_hash
from detent.methods.load import AxisFile, axis_of
from detent.methods.method import Method
from detent.methods.registry import METHODS

Numbers = NDArray[np.float64]

WORDS = 4  # numbers that a counter of Philox4x64 gives; the first is ours
MOST_SEED = 2**64 - 1


@dataclass(frozen=True, slots=True)
class Limit:
    """What a case must keep to pass: a quantity up to a value, or from it on where `least`."""

    quantity: str
    value: float  # in the unit of the quantity
    least: bool = False

    def kept(self, results: Mapping[str, Numbers]) -> NDArray[np.bool_]:
        """Of which cases; a quantity that a case does not have is not kept."""
        found = results[self.quantity]
        return found >= self.value if self.least else found <= self.value

    def __str__(self) -> str:
        """As it is written after ``--limit``."""
        return f"{self.quantity} {'>=' if self.least else '<='} {self.value:g}"


@dataclass(frozen=True)
class Question:
    """What is asked of many machines of one axis file; plain data, so that other processes can take it."""

    name: str  # of the axis file as the user named it
    text: str  # of the file
    overrides: tuple[str, ...]  # values of ``--set``
    changes: tuple[tuple[str, Any], ...]  # values of a program over those of the file, by dotted key
    job: Any = field(hash=False)  # as the method reads it, which may hold tables
    tolerance: tuple[Tolerance, ...]  # what is not known, in the order of the file
    seed: int = 1  # 0 to 2**64 - 1
    limits: tuple[Limit, ...] = ()  # what passes
    margins: bool = False  # margins of the loops are quantities, too
    hunt: bool = False  # and what each machine does at standstill
    scheme: int = 0  # points of the scheme of `total`, whose machines these are; 0: they are drawn at random

    @classmethod
    def of(  # noqa: PLR0913 - what may be asked
        cls, file: AxisFile, job: Any, *, seed: int = 1, limits: Iterable[Limit] = (), margins: bool = False,
        hunt: bool = False,
    ) -> "Question":  # fmt: skip
        """What is asked of an axis file; refused where nothing of it is toleranced."""
        if not 0 <= seed <= MOST_SEED:
            raise DetentError(f"seed: got {seed}; expected: a whole number from 0 to {MOST_SEED}; give one of these")
        if file.untrusted:
            raise DetentError(
                f"{file.file}: got {', '.join(file.untrusted)} not trusted; expected: an interval of each in "
                "[tolerance]; record what `detent identify --job FILE` writes, or state the interval by hand"
            )
        if not file.tolerance:
            raise DetentError(
                f"{file.file}: got no table [tolerance]; expected: at least one key in it, such as "
                '"mechanics.load_mass" = "10 %"; state what is not known of the axis'
            )
        text, changes = file.source.content.decode("utf-8"), tuple(_leaves(file.changes))
        tolerance = tuple(file.tolerance.values())
        return cls(file.file, text, file.overrides, changes, job, tolerance, seed, tuple(limits), margins, hunt)

    @cached_property
    def file(self) -> AxisFile:
        """The axis file, read, without its tolerances: of a normal distribution some values lie outside."""
        source = parse_source(self.name, self.text)
        tables = {key: table for key, table in source.tables.items() if key != TABLE}
        return axis_of(replace(source, tables=tables), self.overrides, _nested(self.changes))

    @property
    def method(self) -> Method[Any]:
        """The control method."""
        return METHODS[self.file.spec.axis.method]

    @cached_property
    def nominal(self) -> dict[str, float]:
        """The file's value of every key that is toleranced."""
        return {one.key: value_of(self.file.spec, one.key) for one in self.tolerance}

    def to_dict(self) -> dict[str, Any]:
        """Plain data: all that the results depend on, and what computes them."""
        plain = ("text", "overrides", "changes", "seed", "margins", "hunt", "scheme")
        told = {name: getattr(self, name) for name in plain}
        told |= {name: [asdict(one) for one in getattr(self, name)] for name in ("tolerance", "limits")}
        job = asdict(self.job) if is_dataclass(self.job) and not isinstance(self.job, type) else repr(self.job)
        return told | {"job": job, "version": __version__, "steps": source_hash()}

    @cached_property
    def hash(self) -> str:
        """Hash of all this: results of questions with the same one may be put together."""
        return hashlib.sha256(json.dumps(self.to_dict(), sort_keys=True, default=str).encode()).hexdigest()

    def variant(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """What makes machines of the file: the values that a case has, or arrays of those of many, and what follows.

        Static friction follows Coulomb friction at its ratio, unless it has a tolerance of its own. What the controller
        keeps, though the machine is another than that of the file, is stated.
        """
        whole = {one.key for one in self.tolerance if one.whole}
        made = {key: nearest(value) if key in whole else value for key, value in values.items()}
        for key, value in values.items():
            static = key.removesuffix("coulomb") + "static"
            if key.endswith(".coulomb") and static not in values and self.nominal[key] > 0.0:
                made[static] = _scaled(value_of(self.file.spec, static), self.nominal[key], value)
        return self.method.kept(self.file.spec) | made

    def machine(self, values: Mapping[str, float]) -> AxisFile:
        """The axis file of a case; an `InputError` where it would be refused."""
        return self.file.replaced(self.variant({key: float(value) for key, value in values.items()}))


def _scaled(nominal: float, by: float, value: Any) -> Any:
    """A value at its ratio to another; where that is as in the file, the file's."""
    if is_array(value):
        return np.where(value == by, nominal, nominal / by * value)
    return nominal if value == by else nominal / by * value


def _leaves(tables: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in tables.items():
        if isinstance(value, Mapping) and value:
            yield from _leaves(cast("Mapping[str, Any]", value), f"{prefix}{key}.")
        else:
            yield prefix + key, tuple(cast("list[Any]", value)) if isinstance(value, list) else value


def _nested(leaves: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    from detent.files.overrides import nested

    return nested(dict(leaves))


def shares(seed: int, key: str, first: int, count: int) -> Numbers:
    """A number above 0 and below 1 of each case from `first` on, an odd multiple of 2**-54; shape (count,)."""
    own = int.from_bytes(hashlib.sha256(key.encode()).digest()[:8], "little")
    # numpy counts up before it gives the four words of a counter.
    before = (first - 1) % 2 ** (64 * WORDS)
    counter = np.array([before >> 64 * k & MOST_SEED for k in range(WORDS)], np.uint64)
    words = np.random.Philox(counter=counter, key=np.array([seed, own], np.uint64)).random_raw(WORDS * count)[::WORDS]
    return ((words >> np.uint64(11)).astype(np.float64) + 0.5) * 2.0**-53


def _at(one: Tolerance, places: Numbers) -> Numbers:
    """`Tolerance.at` for many shares at once, to the same bits."""
    if one.whole or one.normal:
        return np.array([one.at(share) for share in places.tolist()], np.float64)
    return one.low + places * (one.high - one.low)


def draw(question: Question, first: int, count: int) -> dict[str, Numbers]:
    """Values of every toleranced key in the cases from `first` on, in SI units, shape (count,); case 0 is the file's.

    Of the question seed and tolerances matter, nothing else.
    """
    found, own = dict[str, Numbers](), {one.key: one for one in question.tolerance}
    if question.scheme:
        places = exchanged(tuple(own), question.scheme, question.seed, first, count)
    else:
        places = joint(own, {key: shares(question.seed, key, first, count) for key in own})
    for one in question.tolerance:
        found[one.key] = _at(one, places[one.key])
        if first == 0 and count and not question.scheme:
            found[one.key][0] = question.nominal[one.key]
    return found


# ---- the scheme of Saltelli


@lru_cache(maxsize=2)
def _both(keys: int, points: int, seed: int) -> Numbers:
    """Shares of all keys in two samples, above 0 and below 1, shape (points, 2 keys).

    Both come from one sequence of Sobol: two scrambles of the same one are no two samples, and give indices that add
    up to too much.
    """
    qmc: Any = import_module("scipy.stats.qmc")
    return np.clip(qmc.Sobol(2 * keys, seed=seed).random(points), EDGE, 1.0 - EDGE)


def exchanged(keys: tuple[str, ...], points: int, seed: int, first: int, count: int) -> dict[str, Numbers]:
    """Shares of each key in some cases of the scheme: two samples, then the first with one column of the second.

    Saltelli et al.: Variance based sensitivity analysis of model output, Comput. Phys. Comm. 181 (2010).
    """
    both, row = _both(len(keys), points, seed), np.arange(first, first + count)
    block, point = row // points, row % points
    return {
        key: np.where((block == 1) | (block == 2 + j), both[point, len(keys) + j], both[point, j])
        for j, key in enumerate(keys)
    }
