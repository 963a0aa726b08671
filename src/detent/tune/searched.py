"""`detent tune` of a method whose values no linear model gives: candidates simulated, the best tried on all plants."""

import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, cast

from detent.errors import DetentError
from detent.files.fields import held_leaves, unit_of
from detent.files.findings import Caution
from detent.files.patch import NewValue
from detent.files.problems import dotted, format_value
from detent.files.screen import Block, Screen
from detent.files.text import check_target, did_you_mean
from detent.methods.load import AxisFile
from detent.methods.method import untold
from detent.methods.registry import METHODS
from detent.methods.tuning import Search, Trial
from detent.tune.choice import Progress
from detent.tune.chosen import Chosen
from detent.tune.plants import Plants
from detent.tune.standstill import HUNTS, standstill

HYPERCUBE = 8  # places of the tolerances, beside the ends of each
BEST = 12  # candidates that are tried on all plants, the best first
SHOWN = 5  # reasons why candidates were refused


@dataclass(frozen=True, eq=False)
class Candidate:
    """Values, and what a simulation says of them."""

    values: Mapping[str, Any]
    trial: Trial


@dataclass(frozen=True, eq=False, repr=False)
class Searched(Chosen):
    """What `detent tune` has found by simulation.

    Attributes
    ----------
    axis_file : AxisFile
        The axis.
    values : mapping of str to float or list
        What was chosen by key, in SI units; empty where nothing will do.
    before : Trial
        What the axis does with the values of its file.
    after : Trial or None
        The same with those that were chosen.
    candidates : sequence of Candidate
        All that were simulated.
    plants : int
        On how many plants of ``[tolerance]`` the choice was tried.
    refusals : sequence of Caution
        Why there are none, or none for all plants.
    """

    axis_file: AxisFile
    search: Search
    values: Mapping[str, Any]
    before: Trial
    after: Trial | None
    candidates: Sequence[Candidate]
    plants: int
    refusals: Sequence[Caution]

    @property
    def file(self) -> AxisFile:
        """The axis with the values of its file."""
        return self.axis_file

    @property
    def done(self) -> bool:
        """True where values were chosen that will do on all plants."""
        return not self.refusals

    @property
    def sentence(self) -> str:
        """What came of it."""
        name, number = self.file.spec.axis.name, len(self.candidates)
        if self.after is None:
            return f"{name}: none of {number} candidates will do."
        where = f", on {self.plants} plants of [tolerance]" if self.plants else ""
        if self.refusals:
            return f"{name}: the best of {number} candidates, for the axis as its file states it only."
        kept = " as they are in the file" if not self._moved else ""
        return f"{name}: the best of {number} simulated candidates{kept}{where}."

    @property
    def _moved(self) -> bool:
        return any(text != before for _, before, text in self.rows[: len(self.values)])

    @property
    def reasons(self) -> list[tuple[str, int]]:
        """Why candidates were refused, by the first words of each reason, the most frequent first."""
        counted = dict[str, int]()
        for one in self.candidates:
            if one.trial.refused:
                kind = one.trial.refused.partition(" of ")[0]
                counted[kind] = counted.get(kind, 0) + 1
        return sorted(counted.items(), key=lambda pair: (-pair[1], pair[0]))

    @property
    def why(self) -> list[str]:
        """What decided, in sentences."""
        told = [f"Of those that will do, the one with the least {self.search.decides}."] if self.values else []
        refused = ", ".join(f"{kind}: {number}" for kind, number in self.reasons[:SHOWN])
        if refused:
            told.append(f"Refused: {refused}.")
        if self.before.refused:
            told.append(f"The values of the file would be refused: {self.before.refused}.")
        return told

    @property
    def rows(self) -> list[tuple[str, str, str]]:
        """Values and figures before and after."""
        fields = {dotted(path): (field, value) for path, field, value in held_leaves(self.file.spec)}
        told = [
            (key, format_value(*fields[key]), format_value(fields[key][0], value)) for key, value in self.values.items()
        ]
        before: Mapping[str, str] = self.before.figures
        after: Mapping[str, str] = self.after.figures if self.after else {}
        names = dict.fromkeys([*before, *after])
        return told + [(name, before.get(name, "-"), after.get(name, "")) for name in names]

    def new_values(self) -> list[NewValue]:
        """Values that are others than those of the file, with what is said of each in it."""
        held = {dotted(path): value for path, _, value in held_leaves(self.file.spec)}
        units = {dotted(path): unit_of(field) for path, field, _ in held_leaves(self.file.spec)}
        note = f"best of {len(self.candidates)} simulated candidates"
        return [
            NewValue(key, 0.0, units[key], note, "tuned", str(cast("list[int]", value))) if isinstance(value, list)
            else NewValue(key, value, units[key], note, "tuned")
            for key, value in self.values.items() if value != held[key]
        ]  # fmt: skip

    def report(self, path: str | Path, *, force: bool = False) -> Path:
        """Write the report, one self-contained HTML file; `force` replaces one that detent did not write."""
        from detent.page.render import write_page
        from detent.tune.search_page import searched_page

        target = check_target(path, (".html",), "a report", force=force)
        write_page(target, searched_page(self), force=force)
        return target

    def screen(self) -> Screen:
        """Values and figures before and after, and why not."""
        title = "\n".join([self.sentence, self.file.file, *map(str, self.refusals)])
        return Screen(title, [Block("", ("", "before", "after"), self.rows, 30)], ".save(FILE)  .report(FILE)")

    def to_dict(self) -> dict[str, Any]:
        """Plain data, as ``--json`` prints it."""

        def trial(one: Trial | None) -> dict[str, Any] | None:
            """What a simulation says, as data."""
            return None if one is None else {"refused": one.refused, "rank": one.rank, "figures": dict(one.figures)}

        return {
            "sentence": self.sentence, "values": dict(self.values), "before": trial(self.before),
            "after": trial(self.after), "plants": self.plants,
            "refusals": [asdict(one) for one in self.refusals],
            "candidates": [{"values": dict(one.values)} | (trial(one.trial) or {}) for one in self.candidates],
        }  # fmt: skip


def no_bounds(file: AxisFile, given: Mapping[str, Any]) -> None:
    """Refuse bounds of a linear model where there is none."""
    wrong = [f"{name} {value}" for name, value in given.items() if value is not None]
    if wrong:
        raise DetentError(
            f"{file.file}: got {', '.join(wrong)} for an axis of the method {file.spec.axis.method}, whose values are "
            f"chosen by simulation; expected: no bounds of a linear model; leave {', '.join(given)} out"
        )


def search(file: AxisFile, *, hold: Sequence[str] = (), job: Any = None, progress: Progress | None = None) -> Searched:
    """Simulate candidates side by side, on as many threads as there are processors; parameters as of `Axis.tune`."""
    told, spec = progress or untold, file.spec
    method = METHODS[spec.axis.method]
    made = method.search(spec)
    job = job or made.job or method.trial_job(spec)
    _check_held(hold, made)
    before = made.tried(spec, job)
    wanted = [values for values in made.candidates(hold) if _is_allowed(method, spec, values)]
    found = list[Candidate]()

    def tried(values: Mapping[str, Any]) -> Trial:
        """What the axis of the file does with these values."""
        return made.tried(spec.varied(values), job)

    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        for values, trial in zip(wanted, pool.map(tried, wanted), strict=True):
            found.append(Candidate(values, trial))
            told(0.8 * len(found) / len(wanted), f"candidate {len(found)} of {len(wanted)}")
    good = sorted((one for one in found if not one.trial.refused), key=lambda one: (one.trial.rank, str(one.values)))
    plants = list(_plants(file))
    for number, one in enumerate(good[:BEST]):
        told(0.8 + 0.2 * number / BEST, f"candidate {number + 1} of the best on {1 + len(plants)} plants")
        if _holds(method, made, [spec, *plants], one, job):
            return Searched(file, made, one.values, before, one.trial, found, len(plants), [])
    best = good[0] if good else None
    refusals = list(_refusals(found, plants, best))
    return Searched(
        file, made, best.values if best else {}, before, best.trial if best else None, found, len(plants), refusals
    )


def _check_held(hold: Sequence[str], made: Search) -> None:
    for key in hold:
        if key not in made.keys:
            remedy = did_you_mean(key, made.keys, "name keys that are chosen here")
            raise DetentError(f"hold: got {key!r}; expected: {', '.join(made.keys)}; try: {remedy}")


def _is_allowed(method: Any, spec: Any, values: Mapping[str, Any]) -> bool:
    """True where a file with these values would be taken."""
    made = spec.varied(values)
    return not any(found for rule in method.rules for found in rule(made))


def _plants(file: AxisFile) -> Iterator[Any]:
    """Specifications at the ends of each tolerance, and at places between all of them."""
    plants, keys = Plants(file.spec, file.tolerance), list(file.tolerance)
    for key in keys:
        yield from (one.spec for one in plants.ends(key))
    if keys:
        yield from (one.spec for one in plants.hypercube(HYPERCUBE, keys))


def _holds(method: Any, made: Search, plants: Sequence[Any], one: Candidate, job: Any) -> bool:
    """True where a candidate will do on every plant, the nominal one first, and comes to rest there."""
    for number, plant in enumerate(plants):
        spec = plant.varied(one.values)
        if number and made.tried(spec, job).refused:
            return False
        if method.stands and standstill(spec, method.standstill(spec).fewest).shares[HUNTS] > 0.0:
            return False
    return True


def _refusals(found: Sequence[Candidate], plants: Sequence[Any], best: Candidate | None) -> Iterator[Caution]:
    """Why nothing was chosen, or not for all plants."""
    if best is None:
        first = next((one.trial.refused for one in found), "no candidate keeps the rules of the file")
        yield Caution(
            "values", "none that will do", f"one of {len(found)} candidates", first,
            "see the map of the report; change what the candidates have in common",
        )  # fmt: skip
        return
    yield Caution(
        "plant", f"each of the best {BEST} fails on one of {1 + len(plants)} plants, or does not come to rest",
        "one that will do on all", "the choice holds for the axis as its file states it only",
        "narrow [tolerance], or change what the candidates have in common",
    )  # fmt: skip
