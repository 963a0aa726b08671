"""`detent tune`: gains chosen on the linear model, tried on the simulation, and put into the axis file."""

import math
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from detent.axisfile.tables import AxisSpec
from detent.axisfile.tolerance import Tolerance
from detent.errors import DetentError
from detent.files.fields import held_leaves, type_of, unit_of
from detent.files.findings import Caution
from detent.files.patch import NewValue
from detent.files.problems import dotted, format_value
from detent.files.screen import Block, Screen
from detent.files.text import check_target, did_you_mean
from detent.methods.load import AxisFile
from detent.methods.method import untold
from detent.methods.registry import METHODS
from detent.methods.tuning import Bounds, Share
from detent.page.table import TextTable
from detent.tune.assumed import Assumed, as_dicts, as_table, assumed, in_words
from detent.tune.choice import FEWEST, Chooser, Guaranteed, Progress, value_of
from detent.tune.chosen import Chosen
from detent.tune.dead_band import Cure, cures
from detent.tune.plants import Plants
from detent.tune.stand import Stand, at_rest
from detent.tune.standstill import Standstill, standstill
from detent.units import format_quantity

SEED, TABLE_STARTS = 1, 6  # of the starts at standstill; so many of each friction that the file leaves open
SAME = 1e-12  # of a gain, as a share
TRADED = (1.3, 1.4, 1.5, 1.6, 1.7, 1.85, 2.0, 2.2)  # values of Ms of which a report tells what they would give
MOST_LIMITED = 0.05  # share of the job with the command at its limit
SATURATED = "reserve"  # what is refused then
GOALS = {
    "stiff": "The largest {0} with {1}.",
    "quiet": "The least noise with {1}, at the {0} of the file.",
    "quick": "Of five pairs of {0} and noise with {1}, the one that settled first.",
}
"""Why these, by what was asked for."""
RANKED = 2  # intervals of which is told what they would be worth
TOLD, WORTH_IT = 3, 1.05  # changes of the axis of which is told what they would be worth, and how much that is at least
LEAST_SPEED = 0.5  # of the bandwidth of the velocity loop that the axis of the file would have


@dataclass(frozen=True, repr=False)
class Tuned(Chosen):
    """What `detent tune` has found.

    Attributes
    ----------
    before, after : Stand
        The axis with the gains of its file, and with those that were chosen; `after` is None where there are none.
    values : mapping of str to float
        The gains by key, in SI units; empty where there are none.
    worth : tuple of float
        What was made as large as the bounds allow: with the gains of the file, for the nominal axis alone, for all.
    guaranteed : Guaranteed
        For which plants the gains hold.
    refusals : sequence of Caution
        Why there are none, or why they hold for the nominal axis only.
    shares : sequence of Share
        Shares of feedforward, each with its reason.
    limited : str
        What keeps the gains from more, in words; empty where the method does not say.
    further : sequence of tuple
        What would allow more: in words, and how many times as much; infinite where there are no gains without it.
    cures : sequence of Cure
        What stops the hunting of these gains, that with the smaller rest error first: it is among `values`.
    hunted : Standstill or None
        How they hunt without it.
    assumed : sequence
        What the axis with these values does at standstill with other static friction, over Coulomb friction, and
        Stribeck velocity [m/s], where the file does not state them; as `Hunted.assumed`.
    """

    before: Stand
    after: Stand | None
    bounds: Bounds
    goal: str
    values: Mapping[str, float]
    worth: tuple[float, float, float]
    worth_text: str
    guaranteed: Guaranteed
    refusals: Sequence[Caution]
    shares: Sequence[Share]
    limited: str
    further: Sequence[tuple[str, float]]
    cures: Sequence[Cure]
    hunted: Standstill | None
    assumed: Assumed
    chooser: Chooser = field(compare=False)

    @property
    def file(self) -> AxisFile:
        """The axis with the gains of its file."""
        return self.before.file

    @property
    def typed(self) -> dict[str, float]:
        """The gains, whole where the key is."""
        return _typed(self.before.file.spec, self.values)

    @property
    def why(self) -> list[str]:
        """What decided, in sentences."""
        if not self.values:
            return []
        bounds = f"Ms up to {self.bounds.sensitivity:g} at every cut and an overshoot up to {self.bounds.overshoot:g}"
        told = [GOALS[self.goal].format(self.worth_text, bounds)]
        if self.done and self.before.file.tolerance:
            share = 100 * self.worth[2] / self.worth[1]
            number = len(self.guaranteed.binding) - 1
            told.append(
                f"What [tolerance] leaves open costs {100 - share:.0f} % of it; {number} other "
                f"plant{'s' if number != 1 else ''} decided, and {self.guaranteed.fresh} random ones kept the bounds."
            )
        return [*told, *self.what_limits, *(one.why for one in self.shares), *self._at_standstill()]

    @property
    def what_limits(self) -> list[str]:
        """What keeps the axis from more, and what more would take, in sentences."""
        told = [f"What limits it: {self.limited}."] if self.limited else []
        best = [(text, times) for text, times in self.further[:TOLD] if WORTH_IT <= times < math.inf]
        more = [f"{text} gives {times:.2g} times" for text, times in best]
        if more:
            told.append(f"To go further, on the axis of the file: {'; '.join(more)} the {self.worth_text}.")
        return told

    def _at_standstill(self) -> Iterator[str]:
        """How it hunts, what was done about it, and what it depends on."""
        if self.hunted is not None:
            yield self._stopped(self.hunted)
        if self.assumed:
            yield (
                "At standstill much depends on static friction and Stribeck velocity, which the file does not state "
                f"everywhere: with these values, {in_words(self.assumed)}, from {TABLE_STARTS} starts each; slow "
                "moves with reversals, recorded, tell which it is (`detent identify`)."
            )

    @property
    def table(self) -> TextTable:
        """What the axis does with other friction at standstill; no rows where the file states it."""
        unit = self.after.stood.ensemble.unit if self.after and self.after.stood else "m"
        return as_table(self.assumed, unit)

    def _stopped(self, hunted: Standstill) -> str:
        """How it hunts, and what stops it."""
        unit, stops = hunted.ensemble.unit, list[str]()
        fields = {dotted(path): field for path, field, _ in held_leaves(self.file.spec)}
        for one in self.cures:
            text = f"{one.name}, {one.key} {format_value(fields[one.key], one.value)}"
            stops.append(f"{text}, with which it rests up to {format_quantity(one.rest_error, unit, 3)} off")
        told = f"At standstill these gains would have it go to and fro for ever: it {at_rest(hunted)}."
        none = "Neither a dead band within method.in_position nor less integral stops it; see `detent hunt`."
        none = none if hunted.ensemble.band else "See `detent hunt`."
        return f"{told} What stops it: {', or '.join(stops)}; the first is chosen." if stops else f"{told} {none}"

    @cached_property
    def trade(self) -> list[tuple[float, float]]:
        """What other bounds on Ms would give on the nominal axis: Ms, and what is made large; 0 where there is none."""
        found = list[tuple[float, float]]()
        for level in TRADED:
            tried = replace(self.chooser, bounds=Bounds(level, self.bounds.overshoot))
            found.append((level, tried.worth(tried.nominal())))
        return found

    def report(self, path: str | Path, *, force: bool = False) -> Path:
        """Write the report, one self-contained HTML file.

        Parameters
        ----------
        path : path
            HTML file.
        force : bool
            Replace a file that detent did not write.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        DetentError
            The file cannot be written.
        """
        from detent.page.render import write_page
        from detent.tune.page import tuned_page

        target = check_target(path, (".html",), "a report", force=force)
        write_page(target, tuned_page(self), force=force)
        return target

    @property
    def done(self) -> bool:
        """True where gains were chosen that hold for all plants."""
        return not self.refusals

    @property
    def sentence(self) -> str:
        """What came of it."""
        file, bounds = self.before.file, self.bounds
        name = file.spec.axis.name
        if self.after is None:
            return f"{name}: no gains keep Ms {bounds.sensitivity:g}."
        told = f"Ms {self.after.told}"
        if any(one.name == SATURATED for one in self.refusals):
            return f"{name}: gains found, {told}, but the job is not done with a reserve."
        if self.refusals:
            return f"{name}: gains for the axis as its file states it only, {told}; not for all that it may be."
        seen = f", guaranteed over [tolerance] ({len(file.tolerance)} keys)" if file.tolerance else ""
        return f"{name}: gains chosen, {told}{seen}."

    def new_values(self) -> list[NewValue]:
        """The gains, with what is said of each in the file."""
        units = {dotted(path): unit_of(field) for path, field, _ in held_leaves(self.before.file.spec)}
        note = f"Ms {(self.after or self.before).told} ({self.before.told} before)"
        if self.before.file.tolerance and self.done:
            note += f", guaranteed {self.bounds.sensitivity:g} over [tolerance]"
        why = {one.key: one.why.partition(": ")[2].rstrip(".") for one in self.shares}
        if self.cures and self.hunted is not None:
            swing = format_quantity(self.hunted.swing, self.hunted.ensemble.unit, 3)
            why[self.cures[0].key] = f"stops hunting by {swing}"
        return [NewValue(key, value, units[key], why.get(key, note), "tuned") for key, value in self.values.items()]

    @property
    def rows(self) -> list[tuple[str, str, str]]:
        """Gains and figures before and after."""
        before, after = dict(self.before.rows()), dict(self.after.rows()) if self.after else {}
        fields = {dotted(path): (field, value) for path, field, value in held_leaves(self.before.file.spec)}
        told = [
            (key, format_value(*fields[key]), format_value(fields[key][0], value)) for key, value in self.values.items()
        ]
        told.append((self.worth_text, f"{self.worth[0]:.4g}", f"{self.worth[2] or self.worth[1]:.4g}"))
        return told + [(name, text, after.get(name, "")) for name, text in before.items()]

    def screen(self) -> Screen:
        """Gains and figures before and after, and why not."""
        title = "\n".join([self.sentence, self.before.file.file, *map(str, self.refusals)])
        blocks = [Block("", ("", "before", "after"), self.rows, 30)]
        blocks += [Block(*self.table)] if self.assumed else []
        return Screen(title, blocks, ".save(FILE)  .report(FILE)")

    def to_dict(self) -> dict[str, Any]:
        """Plain data, as ``--json`` prints it."""

        def stand(one: Stand | None) -> dict[str, Any] | None:
            """Figures of a set of gains, as data."""
            if one is None:
                return None
            margins = {cut: {k: v if math.isfinite(v) else None for k, v in m._asdict().items()}
                       for cut, m in one.margins.items()}  # fmt: skip
            return {
                "margins": margins, "settles": one.settles, "bandwidth": one.bandwidth, "run": one.result.to_dict(),
                "figures": dict(one.figures),
                "standstill": {"shares": dict(one.stood.shares), "swing": one.stood.swing} if one.stood else None,
                "warnings": [str(caution) for caution in one.cautions],
            }  # fmt: skip

        nominal = self.worth
        return {
            "sentence": self.sentence, "goal": self.goal, "sensitivity": self.bounds.sensitivity,
            "overshoot": self.bounds.overshoot, "values": dict(self.values),
            "worth": {"before": nominal[0], "nominal": nominal[1], "guaranteed": nominal[2]},
            "binding": [dict(one.values) for one in self.guaranteed.binding], "worst": self.guaranteed.worst,
            "fresh": self.guaranteed.fresh, "refusals": [vars_of(one) for one in self.refusals],
            "shares": {one.key: one.why for one in self.shares},
            "limited": self.limited,
            "further": {text: times if math.isfinite(times) else None for text, times in self.further},
            "cures": [vars_of(one, CURE) for one in self.cures], "assumed": as_dicts(self.assumed),
            "before": stand(self.before), "after": stand(self.after),
        }  # fmt: skip


REFUSAL, CURE = ("name", "value", "limit", "consequence", "remedy"), ("key", "value", "name", "rest_error")


def vars_of(one: Any, names: Sequence[str] = REFUSAL) -> dict[str, Any]:
    """A refusal, or what stops hunting, as plain data."""
    return {name: getattr(one, name) for name in names}


def tune(  # noqa: PLR0913 - what may be asked
    file: AxisFile, *, sensitivity: float = 1.7, overshoot: float = 1.1, goal: str = "", hold: Sequence[str] = (),
    job: Any = None, progress: Progress | None = None,
) -> Tuned:  # fmt: skip
    """Choose the gains of an axis; parameters as of `Axis.tune`."""
    progress = progress or untold
    spec = file.spec
    method = METHODS[spec.axis.method]
    tuning, bounds = method.tuning(spec), _bounds(sensitivity, overshoot)
    job = method.trial_job(spec) if job is None else job
    shares = tuning.shares(file.origins, {key: _unsure(spec, key, one) for key, one in file.tolerance.items()})
    others = [METHODS[spec.axis.method].standstill(spec).band] if method.stands else []
    held = _held(hold, tuning, [one.key for one in shares] + [key for key in others if key])
    fed = {one.key: one.value for one in shares if one.key not in hold and one.value != value_of(spec, one.key)}

    @cache
    def settle(values: tuple[tuple[str, float], ...]) -> float:
        return tuning.settling(method.run(spec.varied(fed | dict(values)), job))

    chooser = Chooser(
        tuning, Plants(spec, file.tolerance), bounds, _goal(goal, tuning.goals), held, progress,
        lambda values: settle(tuple(values.items())),
    )  # fmt: skip
    nominal = chooser.nominal()
    found = chooser.guaranteed() if file.tolerance and nominal.values else nominal
    worth = tuning.worth(tuning.stated), chooser.worth(nominal), chooser.worth(found)
    progress(0.8, "trying the gains of the file")
    with ThreadPoolExecutor(1) as aside:  # steps leave a processor to it
        further = aside.submit(chooser.further, nominal)
        before = Stand.of(file, job)
    further = further.result()
    refusals = [*_unknown(file), *_refusals(chooser, nominal, found, further)]
    kept = nominal if refusals else found
    chosen = dict(kept.values) | fed if kept.values else {}
    progress(0.85, "trying the new gains")
    after = Stand.of(file.replaced(_typed(spec, chosen)), job) if kept.values else None
    hunted, stops = _stopped(after, hold, lambda at, text: progress(0.85 + 0.1 * at, text))
    stops = [one for one in stops if chooser.keeps(kept, {one.key: one.value})]
    if stops:
        chosen[stops[0].key] = stops[0].value
        after = Stand.of(file.replaced(_typed(spec, chosen)), job)
    if after is not None and not refusals:
        others = (method.run(one.spec.varied(chosen), job) for one in found.binding[1:])
        refusals = list(_saturated([after.result, *others]))
    other = _assumed(after, lambda at, text: progress(0.95 + 0.05 * at, text))
    limited = chooser.limits(kept) if kept.values else ""
    told = [one for one in shares if one.key not in hold]
    return Tuned(
        before, after, bounds, chooser.goal, chosen, worth, tuning.worth_text, found, refusals, told, limited, further,
        stops, hunted, other, chooser,
    )  # fmt: skip


def _stopped(after: Stand | None, hold: Sequence[str], progress: Progress) -> tuple[Standstill | None, list[Cure]]:
    """How the axis hunts with its new gains, from as many starts as `hunt` takes, and what stops it."""
    if after is None or after.stood is None or not after.stood.hunts:
        return None, []
    spec = after.file.spec
    found = standstill(spec, after.stood.ensemble.usual)
    return found, cures(spec, found, hold, progress)


def _assumed(after: Stand | None, progress: Progress) -> Assumed:
    """What the axis with its new gains does with friction that its file does not state."""
    if after is None or after.stood is None:
        return ()
    return assumed(after.stood.ensemble, SEED, TABLE_STARTS, progress)


def _unsure(spec: AxisSpec, key: str, one: Tolerance) -> float:
    """Half of what is left open of a key, as a share of its value."""
    return 0.5 * (one.high - one.low) / max(abs(value_of(spec, key)), 1e-300)


def _saturated(results: Sequence[Any]) -> Iterator[Caution]:
    """The job leaves no reserve, on the axis of the file or on a plant that decides."""
    number, worst = max(enumerate(results, 1), key=lambda pair: (not pair[1].done, pair[1].limited_share))
    whose = "the axis of the file" if number == 1 else f"plant {number} that decides"
    remedy = "lower limits.acceleration, or give a gentler --job"
    if not worst.done:
        yield Caution(SATURATED, f"the job fails on {whose}", "a job that is done", worst.failure, remedy)
    elif worst.limited_share > MOST_LIMITED:
        value = f"the command is at its limit for {100 * worst.limited_share:.2g} % of the job on {whose}"
        consequence = "there the loops are open, and no margin holds"
        yield Caution(SATURATED, value, f"up to {100 * MOST_LIMITED:g} %", consequence, remedy)


def _bounds(sensitivity: float, overshoot: float) -> Bounds:
    for name, value, low, high in (("ms", sensitivity, 1.2, 2.5), ("overshoot", overshoot, 1.0, 2.0)):
        if not low <= value <= high:
            raise DetentError(f"{name}: got {value:g}; expected: a number from {low:g} to {high:g}; give one of these")
    return Bounds(sensitivity, overshoot)


def _goal(goal: str, goals: Sequence[str]) -> str:
    if goal and goal not in goals:
        known = " or ".join(goals)
        raise DetentError(
            f"goal: got {goal!r}; expected: {known}; try: {did_you_mean(goal, goals, 'choose one of these')}"
        )
    return goal or goals[0]


def _held(hold: Sequence[str], tuning: Any, more: Sequence[str]) -> dict[str, float]:
    """The gains that stay as they are, with their values; more keys may be held, too."""
    for key in hold:
        if key not in (known := [*tuning.keys, *more]):
            remedy = did_you_mean(key, known, "name keys that are chosen here")
            raise DetentError(f"hold: got {key!r}; expected: {', '.join(known)}; try: {remedy}")
    return {key: tuning.stated[key] for key in hold if key in tuning.stated}


def _typed(spec: AxisSpec, values: Mapping[str, float]) -> dict[str, float]:
    """Values of keys, whole where the key is."""
    whole = {dotted(path) for path, field, _ in held_leaves(spec) if type_of(field) is int}
    return {key: round(value) if key in whole else value for key, value in values.items()}


def _unknown(file: AxisFile) -> Iterator[Caution]:
    """What a recording was to tell of the plant, and did not."""
    if file.untrusted:
        yield Caution(
            "plant", f"{', '.join(file.untrusted)} not trusted", "an interval of each in [tolerance]",
            "nobody knows for which plants the gains hold",
            "record what `detent identify --job FILE` writes, or state the interval by hand",
        )  # fmt: skip


def _refusals(
    chooser: Chooser, nominal: Guaranteed, found: Guaranteed, further: Sequence[tuple[str, float]]
) -> Iterator[Caution]:
    """Why there are no gains, or none for all plants."""
    limit = f"Ms up to {chooser.bounds.sensitivity:g}, overshoot up to {chooser.bounds.overshoot:g}"
    if not nominal.values:
        consequence = "no gains keep these bounds on the axis of the file"
        ways = [text.rstrip(",") for text, times in further if times > 0.0][:TOLD]
        remedy = "shorten the dead time, stiffen the coupling, or allow a larger --ms"
        remedy = f"there are some with {', or '.join(ways)}" if ways else remedy
        yield Caution("gains", "none", limit, consequence, remedy)
        return
    share, speed = chooser.worth(found) / chooser.worth(nominal), _slower(chooser, nominal, found)
    if share >= FEWEST and speed >= LEAST_SPEED:
        return
    what, least = chooser.tuning.worth_text, FEWEST
    if share >= FEWEST:
        what, share, least = "the bandwidth of the velocity loop", speed, LEAST_SPEED
    ranking = [_worth_of(chooser, key, worth / chooser.worth(nominal)) for key, worth in chooser.regained()[:RANKED]]
    yield Caution(
        "plant", f"{what} for all plants {100 * share:.2g} % of the nominal one's", f"at least {100 * least:g} %",
        "gains that hold for all that [tolerance] allows would be useless", "; ".join(ranking),
    )  # fmt: skip


def _slower(chooser: Chooser, nominal: Guaranteed, found: Guaranteed) -> float:
    """Bandwidth of the velocity loop with the gains for all plants, over that with the nominal ones; 1 without one."""
    spec, linear = chooser.plants.spec, METHODS[chooser.plants.spec.axis.method].linear
    both = [linear(spec.varied(_typed(spec, one.values))).loops for one in (found, nominal) if one.values]
    if len(both) < 2 or "velocity" not in both[0]:
        return 1.0
    after, before = (loops["velocity"].margins().crossover for loops in both)
    return after / before if before else 1.0


def _worth_of(chooser: Chooser, key: str, share: float) -> str:
    record = chooser.tuning.recordings.get(key.rpartition(".")[2], "")
    told = f"know {key} better: a quarter of its interval gives {100 * share:.2g} %"
    return f"{told}; record {record}" if record else told
