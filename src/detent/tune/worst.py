"""The worst machine of each quantity: from the worst cases of a sample, one value after another to an end or middle.

It is written as an axis file that does again, to the last bit, what was found.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.axisfile.tolerance import TABLE, Tolerance
from detent.errors import DetentError
from detent.files.fields import held_leaves, unit_of
from detent.files.marks import signed
from detent.files.patch import NewValue, patch
from detent.files.problems import dotted, format_value
from detent.files.text import write_text
from detent.methods.method import untold
from detent.tune.batch import DONE, Chunk, Quantity, is_of_a_move, make_cases, quantities
from detent.tune.cases import Numbers, Question
from detent.tune.choice import Progress

STARTS = 8  # of the worst cases of a sample, from which is looked further
SWEEPS = 4  # over all values, at most


def is_sought(one: Quantity) -> bool:
    """True of what a job measures as a whole; margins and hunting are beside it."""
    return one.name != DONE and not is_of_a_move(one) and " at " not in one.name


@dataclass(frozen=True)
class Worst:
    """The worst machine found for a quantity."""

    quantity: str  # its name
    value: float  # what it does there, in the unit of the quantity
    sampled: float  # the same of the worst case of the sample; never worse than `value`
    case: int  # number of that case
    values: Mapping[str, float]  # what makes the machine, by key that is toleranced, SI units
    least: bool = False  # the smallest is the worst, not the largest
    file: Path | None = None  # its axis file


def worst(
    question: Question, chunks: Iterable[Chunk], names: Sequence[str] = (), progress: Progress = untold
) -> list[Worst]:
    """The worst machine of some quantities.

    Coordinate exchange: from each of the eight worst cases every value in turn goes to where of both ends and the
    middle of its interval the quantity is worst, or stays, until a sweep over all of them changes nothing. Cases that
    fail have no figures and are passed over.

    Without names, of every quantity of the whole job; one that no case of the sample has is left out. The smallest is
    the worst where a limit of the question says so, or the quantity its name: `least_margin`.
    """
    chunks = list(chunks)
    known = [one.name for one in quantities(question)]
    names = names or [one.name for one in quantities(question) if is_sought(one)]
    tried = _Tried(question)
    for name in names:
        if name not in known:
            raise DetentError(f"worst: got {name!r}; expected: one of {', '.join(known)}; name one of these")
    least = {limit.quantity for limit in question.limits if limit.least}
    least.update(name for name in names if name.startswith("least_"))
    values = {key: np.concatenate([one.values[key] for one in chunks]) for key in chunks[0].values}
    numbers = np.concatenate([np.arange(one.first, one.first + one.count) for one in chunks])
    found = list[Worst]()
    for k, name in enumerate(names):
        progress(k / len(names), f"worst {name}")
        search = _Search(tried, name, -1.0 if name in least else 1.0)
        found += search.run(np.concatenate([one.results[name] for one in chunks]), values, numbers)
    return found


class _Tried:
    """What machines do that were tried, for one quantity or another: most of the searches end at the same ones."""

    def __init__(self, question: Question) -> None:
        self.question = question
        self.known = dict[bytes, dict[str, float]]()

    def results(self, values: Mapping[str, Numbers], name: str) -> Numbers:
        """A quantity of each machine with such values, shape (n,)."""
        rows = np.ascontiguousarray(np.array(list(values.values())).T)
        wanted = [row.tobytes() for row in rows]
        new = {row: k for k, row in enumerate(wanted) if row not in self.known}
        if new:
            places = np.array(list(new.values()))
            made, _ = make_cases(self.question, {key: each[places] for key, each in values.items()}, len(places))
            for k, row in enumerate(new):
                self.known[row] = {one: float(each[k]) for one, each in made.items()}
        return np.array([self.known[row].get(name, np.nan) for row in wanted])


@dataclass(frozen=True)
class _Search:
    """The search for the worst of one quantity."""

    tried: _Tried
    name: str
    sign: float  # 1: the largest is the worst

    def run(self, results: Numbers, values: Mapping[str, Numbers], numbers: NDArray[Any]) -> Iterator[Worst]:
        """What is found from a sample; nothing where no case has the quantity."""
        height = self._height(results)
        order = np.lexsort((numbers, -height))[:STARTS]  # of equals the first case
        order = order[np.isfinite(height[order])]
        if not len(order):
            return
        first = order[0]
        here, at = height[order], {key: each[order].copy() for key, each in values.items()}
        for _ in range(SWEEPS):
            changed = [self._exchange(one, here, at) for one in self.tried.question.tolerance]
            if not any(changed):
                break
        best = int(np.argmax(here))
        machine = {key: float(each[best]) for key, each in at.items()}
        yield Worst(
            self.name, self.sign * float(here[best]), float(results[first]), int(numbers[first]), machine,
            self.sign < 0.0,
        )  # fmt: skip

    def _height(self, results: Numbers) -> Numbers:
        """How bad each case is; a failed one is passed over."""
        return np.where(np.isnan(results), -np.inf, self.sign * results)

    def _exchange(self, one: Tolerance, here: Numbers, at: dict[str, Numbers]) -> bool:
        """One value of all points to the worst of both ends and the middle; whether that changed any."""
        middle = (one.low + one.high) // 2 if one.whole else 0.5 * (one.low + one.high)
        places = np.array([one.low, middle, one.high], np.float64)
        count = len(here)
        tried = {key: np.repeat(each, len(places)) for key, each in at.items()}
        tried[one.key] = np.tile(places, count)
        height = self._height(self.tried.results(tried, self.name)).reshape(count, len(places))
        best = np.argmax(height, axis=1)
        better = height[np.arange(count), best] > here
        here[better] = height[np.arange(count), best][better]
        at[one.key][better] = places[best][better]
        return bool(better.any())


def worst_text(question: Question, found: Worst, job: str, name: str) -> str:
    """Text of the axis file of a worst machine; read again it makes the same machine, to the last bit.

    It is that of the file with other values, and says why, and how a person who calls it `name` and has the `job`
    file sees the figure again; without such a file it is the job that `detent tolerance` makes unless told otherwise.
    """
    unit = {one.name: one.unit for one in quantities(question)}[found.quantity]
    words = "least" if found.least else "largest"
    sets = "".join(f" --set '{key}={question.file.texts[key]}'" for key in _set_keys(question))
    again = f"run {name} --job {job}" if job else f"tolerance {name} --cases 1"
    head = f"# The machine with the {words} {found.quantity} found: {found.value!r} {unit}".rstrip()
    text = patch(_untoleranced(question, found), list(_new_values(question, found)), question.name)[0]
    return signed(f"{head}\n#   detent {again}{sets} --json\n\n{text}")


def write_worst(question: Question, found: Worst, path: str | Path, job: str = "", *, force: bool = False) -> Path:
    """Write the axis file of a worst machine; parameters as of `worst_text`, `force` replaces another's file."""
    target = Path(path)
    return write_text(target, worst_text(question, found, job, str(target)), force=force)


def _set_keys(question: Question) -> list[str]:
    """Keys whose values did not stand in the text of the file."""
    return [key for key, origin in question.file.origins.items() if origin in ("--set", "replace")]


def _untoleranced(question: Question, found: Worst) -> str:
    """The text; without its tolerances where a value lies outside, as some of a normal distribution do."""
    if all(one.low <= found.values[one.key] <= one.high for one in question.tolerance):
        return question.text
    import tomlkit

    document = tomlkit.parse(question.text)
    del document[TABLE]
    return document.as_string()


def _new_values(question: Question, found: Worst) -> Iterator[NewValue]:
    """What becomes of the keys: values of the machine, what follows, and what the controller keeps where it differs."""
    tolerance, file = {one.key: one for one in question.tolerance}, question.file
    made, keeps = question.variant(found.values), question.method.kept(file.spec)
    whole = question.machine(found.values).spec
    own = question.method.kept(file.replaced({k: v for k, v in made.items() if k in tolerance or k not in keeps}).spec)
    units = {dotted(path): unit_of(field) for path, field, _ in held_leaves(whole)}
    nominal = {dotted(path): (field, value) for path, field, value in held_leaves(file.spec)}
    for key, value in made.items():
        if key in tolerance:
            note = f"in {tolerance[key]}"
        elif key not in keeps:
            note = "at its ratio to Coulomb friction"
        elif own[key] != value:
            note = "the controller keeps what it was made for"
        else:
            continue
        if key in nominal and key not in file.texts:
            note = f"{format_value(*nominal[key])} by default, {note}"
        yield NewValue(key, value, units[key], note, "worst", exact=True)
