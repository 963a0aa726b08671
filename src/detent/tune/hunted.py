"""`detent hunt`: whether an axis hunts at standstill, how far and how often, what stops it, and what that costs."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.errors import DetentError
from detent.files.patch import Change, NewValue, patch
from detent.files.screen import Block, OnScreen, Screen
from detent.files.text import check_target, write_text
from detent.methods.load import AxisFile
from detent.methods.method import untold
from detent.methods.registry import METHODS
from detent.methods.tuning import Ensemble
from detent.page.table import TextTable
from detent.tune.assumed import Assumed, as_dicts, as_table, assumed, in_words
from detent.tune.choice import Progress, value_of
from detent.tune.dead_band import Band, Map, band_map, least_band
from detent.tune.standstill import FLICKERS, HUNTS, OPEN, RESTS, Kind, Standstill, standstill
from detent.units import format_quantity

Numbers = NDArray[np.float64]

TABLE_STARTS = 12  # of each friction that is tried where the file does not say
EARLIER = 2.0  # of a phase before that of rest, which does not last, that is simulated at most [s]
PLACES = 64  # errors of the return map
QUICK = 0.05  # period below which a frequency is told [s]


@dataclass(frozen=True, repr=False)
class Hunted(OnScreen):
    """What `detent hunt` has found.

    Attributes
    ----------
    file : AxisFile
        The axis.
    standing : Standstill
        What it does from its starts: `shares`, `kinds`, `swing`.
    cured : bool or None
        Whether targets on counts of the encoder would stop it; None where that was not tried.
    band : Band or None
        The least dead band that stops it; None where it was not sought.
    map : Map or None
        Verdicts over dead band and integral; None where it was not asked for.
    earlier : tuple of str and Standstill, or None
        A phase before that of rest, where the method has one: its name, and what the axis does if it never leaves it.
    assumed : sequence
        Where the file does not say how friction falls: ratio of static to Coulomb friction, Stribeck velocity [m/s],
        and what the axis does with them.
    """

    file: AxisFile
    standing: Standstill
    cured: bool | None
    band: Band | None
    map: Map | None
    earlier: tuple[str, Standstill] | None
    assumed: Assumed

    @property
    def done(self) -> bool:
        """True where it rests, or moves by less than half a count, from every start."""
        return not self.standing.hunts

    def length(self, value: float) -> str:
        """A length or an angle of the axis."""
        return format_quantity(value, self.standing.ensemble.unit, 3)

    @property
    def sentence(self) -> str:
        """The verdict."""
        found, name = self.standing, self.file.spec.axis.name
        starts = f"{len(found.found)} starts"
        if found.hunts:
            worst, share = found.kinds[0], found.shares[HUNTS]
            number = round(share * len(found.found))
            where = f"from all {starts}" if share == 1.0 else f"from {number} of {starts}, it depends on the start"
            return f"{name} hunts {where}: {self.motion(worst)}."
        told = {
            RESTS: "rests", FLICKERS: f"flickers by up to {self.length(self.flicker)}, less than half a count",
            OPEN: "is not decided within the time looked at",
        }  # fmt: skip
        return f"{name} {told[found.outcome]} from {'every one of ' if found.outcome == RESTS else ''}{starts}."

    @property
    def flicker(self) -> float:
        """Largest swing of a start that flickers [m]."""
        return max((one.swing.largest for one in self.standing.found if one.outcome == FLICKERS), default=0.0)

    def often(self, period: float) -> str:
        """How often, in words; NaN where it does not repeat."""
        if 0.0 < period < QUICK:
            return f"at {format_quantity(1.0 / period, 'Hz', 3)}"
        return "irregularly" if math.isnan(period) else f"every {format_quantity(period, 's', 3)}"

    def motion(self, kind: Kind) -> str:
        """How far and how often, in words."""
        motor, load = kind.swing("motor"), kind.swing("load")
        every = self.often(kind.period)
        what = f"the load by {self.length(load)}, the motor by {self.length(motor)}"
        if abs(motor - load) < 0.1 * max(motor, load):
            what = f"by {self.length(max(motor, load))}"
        elif load < 0.5 * self.standing.ensemble.grain:
            what = f"the motor by {self.length(motor)}, the load rests"
        return f"{kind.name}, {what} {every}"

    @property
    def told(self) -> list[str]:
        """What else there is to say, in sentences."""
        return list(self._told())

    def _told(self) -> Iterator[str]:
        for kind in self.standing.kinds:
            share = f"{len(kind.found)} of {len(self.standing.found)} starts"
            why = "; it hunts by itself" if kind.by_itself else "; a knock starts it: small starts come to rest"
            yield f"{self.motion(kind)} ({share}{'' if self.standing.ensemble.single else why})"
        yield from self._rule_told()
        yield from self._edges_told()
        if self.earlier is not None:
            when, found = self.earlier
            kinds = [*found.kinds, *found.kinds_of(FLICKERS)]
            what = f"swings as long as it lasts: {self.motion(kinds[0])}" if kinds else found.outcome
            yield f"{when}, it {what}"
        if self.standing.ensemble.single and self.standing.rest_error > 0.0:
            yield f"it rests up to {self.length(self.standing.rest_error)} off its target"
        yield from self.standing.ensemble.remarks
        if self.cured is not None:
            yield "targets on counts of the encoder " + ("stop it" if self.cured else "do not stop it")
        if self.band is not None:
            yield self._band_told(self.band)
        if self.assumed:
            yield (
                "the file does not state static and stribeck everywhere, and the verdict depends on them: "
                f"{in_words(self.assumed)}; record slow moves with reversals (`detent identify`)"
            )

    def _rule_told(self) -> Iterator[str]:
        """The rule of thumb beside what was simulated."""
        rule = self.standing.ensemble.rule
        if rule is None:
            return
        slow = [kind for kind in self.standing.kinds if kind.name == "stick-slip"]
        if rule.swing > 0.0:
            simulated = f"simulated {self.motion(slow[0]).partition(', ')[2]}" if slow else "the simulation does not"
            every = format_quantity(rule.period, "s", 3)
            yield f"rule of thumb: {self.length(rule.swing)} every {every}; {simulated}; what helps: {rule.why}"
        else:
            yield f"rule of thumb: no stick-slip, for {rule.why}"

    def _edges_told(self) -> Iterator[str]:
        """What a flicker costs, and closed forms beside the simulation."""
        flickering, unit = self.standing.kinds_of(FLICKERS), self.standing.ensemble.command_unit
        for kind in flickering:
            cost = f"its command goes to and fro by {format_quantity(kind.command, unit, 3)}"
            yield f"flicker: {self.motion(kind)} ({len(kind.found)} of {len(self.standing.found)} starts); {cost}"
        for one in self.standing.ensemble.forecasts:
            alike = [kind for kind in [*self.standing.kinds, *flickering] if kind.name == one.kind]
            simulated = f"simulated {self.motion(alike[0]).partition(', ')[2]}" if alike else "the simulation does not"
            far, command = self.length(one.swing), format_quantity(one.command, unit, 3)
            yield f"{one.kind} by {one.by}: {far} {self.often(one.period)}, the command by {command}; {simulated}"

    def _band_told(self, band: Band) -> str:
        """Width and cost of the dead band."""
        spec: Any = self.file.spec
        key = self.standing.ensemble.band
        if band.found is None:
            return f"no dead band up to {self.length(band.most)} stops it: choose other gains with `detent tune`"
        share = 100.0 * band.found.rest_error / spec.method.in_position
        return (
            f"a dead band of {self.length(band.found.width)} ({key}) stops it from every start of three seeds; it then "
            f"rests up to {self.length(band.found.rest_error)} off its target, {share:.2g} % of the in-position window"
        )

    @property
    def heads(self) -> tuple[str, ...]:
        """Heads of the rows."""
        masses = ("swing",) if self.standing.ensemble.single else ("motor", "load")
        return ("", *masses, "every", "starts")

    @property
    def rows(self) -> list[tuple[str, ...]]:
        """Kinds of hunting: what, how far the motor and the load go, how often, from how many starts."""
        kinds = [*self.standing.kinds, *self.standing.kinds_of(FLICKERS)]
        masses = ("motor",) if self.standing.ensemble.single else ("motor", "load")
        return [
            (one.name if one.worst.outcome == HUNTS else f"flicker, {one.name}",
             *(self.length(one.swing(mass)) for mass in masses),
             "-" if math.isnan(one.period) else format_quantity(one.period, "s", 3),
             f"{len(one.found)} ({', '.join(one.starts)})")
            for one in kinds
        ]  # fmt: skip

    @property
    def table(self) -> TextTable:
        """What the axis does with other friction at standstill."""
        return as_table(self.assumed, self.standing.ensemble.unit)

    @cached_property
    def slips(self) -> tuple[Numbers, Numbers] | None:
        """Return map of the slips: errors at which one begins, and those behind it [m]; None where there is none."""
        rule = self.standing.ensemble.rule
        reach = 1.5 * max(self.standing.swing, rule.swing) if rule is not None else 0.0
        if reach == 0.0:
            return None
        errors = np.linspace(-reach, reach, PLACES)
        behind = self.standing.ensemble.slips(errors)
        return None if behind is None else (errors, behind)

    @cached_property
    def changes(self) -> list[Change]:
        """What becomes of the axis file."""
        return self._patched()[1] if self.band is not None and self.band.found is not None else []

    def _patched(self) -> tuple[str, list[Change]]:
        width = self.band.width if self.band is not None else None
        if width is None or not self.file.source.content:
            raise DetentError(
                f"{self.file.file}: got {'no dead band that stops it' if width is None else 'an axis without a file'}; "
                "expected: one to be written into a file; seek one with dead_band"
            )
        ensemble = self.standing.ensemble
        note = f"stops hunting by {self.length(self.standing.swing)}"
        value = NewValue(ensemble.band, width, ensemble.unit, note, "tuned")
        return patch(self.file.source.content.decode(), [value], self.file.file)

    def save(self, path: str | Path, *, force: bool = False) -> Path:
        """Write the axis file with the dead band; all else of its text stays.

        Parameters
        ----------
        path : path
            TOML file; that of the axis itself, or a new one.
        force : bool
            Replace another file that detent did not write.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        DetentError
            No dead band was sought or found, or the file cannot be written.
        """
        own = Path(self.file.file)
        is_own = own.exists() and Path(path).exists() and own.samefile(path)
        text = self._patched()[0]
        return write_text(check_target(path, (".toml",), "an axis", force=force or is_own), text, force=force or is_own)

    def report(self, path: str | Path, *, force: bool = False) -> Path:
        """Write the report, one self-contained HTML file; `force` replaces one that detent did not write."""
        from detent.page.render import write_page
        from detent.tune.hunt_page import hunted_page

        target = check_target(path, (".html",), "a report", force=force)
        write_page(target, hunted_page(self), force=force)
        return target

    def screen(self) -> Screen:
        """Verdict and kinds."""
        blocks = [Block("", self.heads, self.rows, 30)] if self.rows else []
        return Screen("\n".join([self.sentence, self.file.file, *self.told]), blocks, ".report(FILE)")

    def to_dict(self) -> dict[str, Any]:
        """Plain data, as ``--json`` prints it."""
        rule = self.standing.ensemble.rule
        return {
            "sentence": self.sentence, "told": self.told, "outcome": self.standing.outcome,
            "seed": self.standing.seed, "on_counts": self.standing.on_counts, "shares": dict(self.standing.shares),
            "kinds": [_kind(one) for one in self.standing.kinds],
            "rule": None if rule is None else {"swing": rule.swing, "period": _finite(rule.period)},
            "forecasts": [asdict(one) for one in self.standing.ensemble.forecasts],
            "cured_on_counts": self.cured, "earlier": None if self.earlier is None else _phase(*self.earlier),
            "dead_band": None if self.band is None else _band(self.band),
            "assumed": as_dicts(self.assumed),
            "map": None if self.map is None else _map(self.map),
        }  # fmt: skip


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _kind(one: Kind) -> dict[str, Any]:
    return {
        "name": one.name, "motor": one.swing("motor"), "load": one.swing("load"), "period": _finite(one.period),
        "command": one.command,
        "largest": one.worst.swing.largest, "starts": len(one.found), "of": one.starts, "by_itself": one.by_itself,
    }  # fmt: skip


def _phase(name: str, found: Standstill) -> dict[str, Any]:
    kinds = [*found.kinds, *found.kinds_of(FLICKERS)]
    return {"name": name, "outcome": found.outcome, "kinds": [_kind(one) for one in kinds]}


def _band(band: Band) -> dict[str, Any]:
    tried = [{"width": one.width, "hunts": one.hunts, "swing": one.swing, "rest_error": one.rest_error}
             for one in band.tried]  # fmt: skip
    return {"width": band.width, "most": band.most, "tried": tried}


def _map(found: Map) -> Mapping[str, Any]:
    return {
        "widths": list(found.widths), "integrals": list(found.integrals),
        "swing": [[one.swing for one in row] for row in found.found],
        "rest_error": [[one.rest_error for one in row] for row in found.found],
    }  # fmt: skip


def _part(told: Progress, begin: float, end: float) -> Progress:
    """The progress of a part of all that is done."""
    return lambda share, text: told(begin + (end - begin) * share, text)


def _check_asked(file: AxisFile, ensemble: Ensemble, starts: int, *, on_counts: bool, banded: bool) -> None:
    """Refuse what this method has not."""
    method = file.spec.axis.method
    if starts < ensemble.fewest:
        raise DetentError(
            f"starts: got {starts}; expected: at least {ensemble.fewest}, {ensemble.draws}; try: {ensemble.usual}"
        )
    if on_counts and not ensemble.between:
        raise DetentError(
            f"{file.file}: got an axis of the method {method}, whose targets always lie on counts; expected: one whose "
            "targets may lie between them; leave on_counts out"
        )
    if banded and not ensemble.band:
        raise DetentError(
            f"{file.file}: got an axis of the method {method}, which has no dead band of its integral that may be "
            "sought; expected: a method with one, such as cascade; leave dead_band and map out"
        )


def hunt(  # noqa: PLR0913 - what may be asked
    file: AxisFile, *, starts: int | None = None, seed: int = 1, on_counts: bool = False, dead_band: bool = False,
    map_it: bool = False, progress: Progress | None = None,
) -> Hunted:  # fmt: skip
    """Watch an axis at standstill; parameters as of `Axis.hunt`."""
    told = progress or untold
    spec: Any = file.spec
    ensemble = METHODS[spec.axis.method].standstill(spec)
    starts = ensemble.usual if starts is None else starts
    _check_asked(file, ensemble, starts, on_counts=on_counts, banded=dead_band or map_it)
    found = standstill(spec, starts, seed, on_counts=on_counts, progress=_part(told, 0.0, 0.3))
    ensemble = found.ensemble
    cured = band = made = earlier = None
    if found.hunts and not on_counts and ensemble.between:
        told(0.3, "targets on counts")
        cured = not standstill(spec, starts, seed, on_counts=True).hunts
    if dead_band and found.hunts:
        band = least_band(spec, found, spec.method.in_position, _part(told, 0.3, 0.6))
    if ensemble.earlier is not None:
        name, before = ensemble.earlier
        earlier = name, standstill(before, starts, seed, longest=EARLIER, progress=_part(told, 0.3, 0.6))
    other = assumed(ensemble, seed, TABLE_STARTS, _part(told, 0.6, 0.7), on_counts=on_counts)
    if map_it:
        gain = value_of(spec, ensemble.integral)
        made = band_map(spec, found, gain, _part(told, 0.7, 0.95))
    return Hunted(file, found, cured, band, made, earlier, other)
