"""How many of the cases are good: limits as a person writes them, yields with their intervals, why the others fail."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from detent.analysis.sensitivity import clopper_pearson
from detent.errors import DetentError
from detent.files.text import did_you_mean
from detent.tune.batch import DONE, Chunk, Limit, Quantity, is_of_a_move
from detent.units import QuantityError, describe_kind, format_quantity, parse_quantity

ALL = "all limits"
PASSED = "passed"  # the quantity that is 1 where all limits are kept
SHOWN_CASES = 3  # of each kind of failure
MOST_CASES = 10**9  # that are asked for to halve an interval
_LIMIT = re.compile(r"\s*(.+?)\s*(<=|>=)\s*(.+?)\s*")


def parse_limit(text: str, known: Sequence[Quantity]) -> Limit:
    """A limit as it is written after ``--limit``: a quantity, ``<=`` or ``>=``, a value with its unit."""
    match = _LIMIT.fullmatch(text)
    names = {_plain(one.name): one for one in known}
    if match is None:
        example = next((one for one in known if one.unit), known[0])
        value = describe_kind(example.unit)[1] if example.unit else "1"
        raise DetentError(
            f'--limit: got {text!r}; expected: QUANTITY <= VALUE or QUANTITY >= VALUE, such as "{example.name} <= '
            f'{value}"; write it so'
        )
    name, sign, value = match.groups()
    if _plain(name) not in names:
        whole = [one.name for one in known if not is_of_a_move(one)]
        remedy = did_you_mean(name, [one.name for one in known], f"name one of {', '.join(whole)}")
        raise DetentError(
            f"--limit: got the unknown quantity {name!r}; expected: what is measured of this job; {remedy}"
        )
    found = names[_plain(name)]
    try:
        number = parse_quantity(value, found.unit) if found.unit else float(value)
    except QuantityError as error:
        raise DetentError(
            f"--limit: {found.name}: got {error.reason}; expected: {error.allowed}; {error.remedy}"
        ) from None
    except ValueError:
        raise DetentError(
            f"--limit: {found.name}: got {value!r}; expected: a number, as it has no unit; write one"
        ) from None
    return Limit(found.name, number, least=sign == ">=")


def _plain(name: str) -> str:
    """A name however its words are put together."""
    return " ".join(name.lower().replace("_", " ").split())


def limit_text(limit: Limit, units: Mapping[str, str]) -> str:
    """A limit in the unit that people read."""
    if limit.quantity == DONE:
        return DONE
    return f"{limit.quantity} {'>=' if limit.least else '<='} {format_quantity(limit.value, units[limit.quantity])}"


@dataclass(frozen=True, slots=True)
class Yield:
    """Of how many cases how many are good."""

    name: str
    good: int
    of: int

    @property
    def share(self) -> float:
        """The yield."""
        return self.good / self.of

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval of Clopper and Pearson."""
        return clopper_pearson(self.good, self.of)

    @property
    def more(self) -> int:
        """How many cases more, as many of them good, halve the interval."""
        low, high = self.interval
        least, most = self.of, 2 * self.of
        while most < MOST_CASES and _width(self.share, most) > 0.5 * (high - low):
            least, most = most, 2 * most
        while most - least > 1:
            middle = (least + most) // 2
            least, most = (least, middle) if _width(self.share, middle) <= 0.5 * (high - low) else (middle, most)
        return most - self.of

    def __str__(self) -> str:
        """With its interval."""
        low, high = self.interval
        return f"{100 * self.share:.4g} % ({100 * low:.4g} to {100 * high:.4g} %)"


def _width(share: float, cases: int) -> float:
    low, high = clopper_pearson(round(share * cases), cases)
    return high - low


class Failure(NamedTuple):
    """A kind of failing: how many cases fail so, and the first of them."""

    kind: str
    number: int
    cases: tuple[int, ...]


class Figure(NamedTuple):
    """How a quantity spreads over the cases that have it."""

    nominal: float
    mean: float
    deviation: float
    low: float  # and high: 5 and 95 % of all cases lie below
    high: float
    least: float
    most: float


@dataclass(frozen=True, eq=False)
class Judged:
    """Cases, and what of them passes."""

    cases: Chunk
    quantities: Sequence[Quantity]
    limits: Sequence[Limit]

    @property
    def units(self) -> dict[str, str]:
        """Unit of each quantity, by name."""
        return {one.name: one.unit for one in self.quantities}

    @cached_property
    def kept(self) -> dict[str, NDArray[np.bool_]]:
        """Which cases keep each limit, by its text."""
        return {limit_text(one, self.units): one.kept(self.cases.results) for one in self.limits}

    def outcomes(self, cases: Chunk) -> dict[str, NDArray[np.float64]]:
        """What may depend on the keys, of these or of other cases: quantities that are told, and whether they pass."""
        found = {one.name: cases.results[one.name] for one in self.told if one.name != DONE}
        kept = [one.kept(cases.results) for one in self.limits]
        passed = np.logical_and.reduce([np.ones(cases.count, np.bool_), *kept])
        return found | {PASSED: passed.astype(np.float64)}

    def table(self, keys: Mapping[str, str]) -> tuple[dict[str, NDArray[Any]], dict[str, str], dict[str, str]]:
        """Columns of all cases, their units and what they are; `keys` gives the units of the keys."""
        kinds = np.zeros(self.cases.count, np.uint16)
        for k, one in enumerate(self.failures):
            kinds[[number - self.cases.first for number in self._kinds[one.kind]]] = k + 1
        columns: dict[str, NDArray[Any]] = {"case": self.cases.first + np.arange(self.cases.count)} | self.cases.values
        units = {**keys} | {f"results.{name.replace(' ', '_')}": unit for name, unit in self.units.items()}
        columns |= {f"results.{name.replace(' ', '_')}": each for name, each in self.cases.results.items()}
        columns |= {"results.passed": self.good, "results.failure": kinds}
        told = "; ".join(f"{k}: {one.kind}" for k, one in enumerate(self.failures, 1))
        return columns, units, {"results.failure": f"0: passes; {told}" if told else "0: passes"}

    @cached_property
    def good(self) -> NDArray[np.bool_]:
        """Which cases keep all of them."""
        return np.logical_and.reduce([np.ones(self.cases.count, np.bool_), *self.kept.values()])

    @cached_property
    def yields(self) -> list[Yield]:
        """Of all limits together, then of each."""
        every: Iterable[tuple[str, NDArray[np.bool_]]] = [(ALL, self.good), *self.kept.items()]
        return [Yield(name, int(np.count_nonzero(kept)), self.cases.count) for name, kept in every]

    @cached_property
    def _kinds(self) -> dict[str, list[int]]:
        """Cases that fail, by kind."""
        kinds = dict[str, list[int]]()
        for k in np.flatnonzero(~self.good).tolist():
            lost = ", ".join(name for name, kept in self.kept.items() if not kept[k])
            kinds.setdefault(str(self.cases.reason[k]) or f"not {lost}", []).append(k + self.cases.first)
        return kinds

    @cached_property
    def failures(self) -> list[Failure]:
        """Why cases fail, the most frequent kind first."""
        found = [Failure(kind, len(cases), tuple(cases[:SHOWN_CASES])) for kind, cases in self._kinds.items()]
        return sorted(found, key=lambda one: (-one.number, one.kind))

    @cached_property
    def figures(self) -> dict[str, Figure]:
        """How each quantity spreads; of one that no case has, nothing."""
        found = dict[str, Figure]()
        for one in self.quantities:
            values = self.cases.results[one.name]
            seen = values[np.isfinite(values)]
            if len(seen):
                low, high = np.quantile(seen, [0.05, 0.95]).tolist()
                spread = float(seen.mean()), float(seen.std()), low, high
                found[one.name] = Figure(one.nominal, *spread, float(seen.min()), float(seen.max()))
        return found

    @property
    def told(self) -> list[Quantity]:
        """What is worth a row: quantities of the whole job, and those of a move that have a limit."""
        limited = {limit.quantity for limit in self.limits}
        return [
            one
            for one in self.quantities
            if one.name in self.figures and (not is_of_a_move(one) or one.name in limited)
        ]
