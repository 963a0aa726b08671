"""An axis with some gains: its margins, and what its simulation does with a job."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from detent.analysis.margins import Margins
from detent.files.findings import Caution, Derived
from detent.kernel.step import config
from detent.methods.check import check_spec
from detent.methods.load import AxisFile
from detent.methods.registry import METHODS
from detent.methods.tuning import Response
from detent.tune.standstill import HUNTS, Standstill, standstill
from detent.units import format_quantity

STARTS = 8  # at standstill, from which it is left to itself
EDGE = 1.5  # counts that an axis must swing for `check` to warn: across the edge of one any loop may go
ASSUMED = "static friction or Stribeck velocity is a default"
COMPILED = not config.DISABLE_JIT
NONE = "none: it does not settle"
MEASURES = ("Ms at", "phase margin at", "gain margin at", "delay margin at")


@dataclass(frozen=True)
class Stand:
    """An axis with some gains: its margins by the cut, what it does with the job, and what `check` says."""

    file: AxisFile
    margins: Mapping[str, Margins]
    settles: bool
    bandwidth: float | None  # of the reference to the position [Hz]
    result: Any
    summary: Sequence[tuple[str, str]]
    cautions: Sequence[Caution]
    period: float  # of its samples [s]
    stood: Standstill | None  # what it does at standstill; None where it does not settle, or nothing watches it
    figures: Mapping[str, str]  # what follows of its loops, and what it does in time, by name
    responses: Sequence[Response]  # what it does in time when it is pushed, and on a short way

    @classmethod
    def of(cls, file: AxisFile, job: Any) -> "Stand":
        """Try a job on an axis."""
        spec = file.spec
        method = METHODS[spec.axis.method]
        model, result = method.linear(spec), method.run(spec, job)
        outer = [cut for cut in model.loops if "position" in cut]
        bandwidth = model[outer[0]].closed().bandwidth if outer and model.settles else None
        summary, tuning = method.summary(spec, result), method.tuning(spec)
        stood = standstill(spec, STARTS) if method.stands and model.settles else None
        responses = tuning.responses(spec) if model.settles else ()
        figures = dict(tuning.figures(spec)) | {name: text for one in responses for name, text in one.figures.items()}
        return cls(
            file, model.margins, model.settles, bandwidth, result, summary, check_spec(file).warnings,
            next(iter(model.loops.values())).dt, stood, figures, responses,
        )  # fmt: skip

    @property
    def at_rest(self) -> str:
        """What it does at standstill, in words; empty where nothing watched it."""
        return "" if self.stood is None else at_rest(self.stood)

    @property
    def sensitivity(self) -> tuple[float, float]:
        """Largest Ms of all cuts, and its frequency [Hz]."""
        worst = max(self.margins.values(), key=lambda one: one.sensitivity)
        return worst.sensitivity, worst.peak

    @property
    def told(self) -> str:
        """The same in words; margins of loops that do not settle mean nothing."""
        level, peak = self.sensitivity
        return f"{level:.3g} at {format_quantity(peak, 'Hz', 3)}" if self.settles else NONE

    def _late(self, delay: float) -> str:
        """A delay margin, in samples too."""
        return f"{format_quantity(delay, 's', 3)}, {delay / self.period:.3g} samples" if delay < math.inf else "any"

    def rows(self) -> Iterator[tuple[str, str]]:
        """Figures to be laid beside those of other gains."""
        for cut, one in self.margins.items():
            if not self.settles:
                yield from ((f"{what} {cut}", NONE) for what in MEASURES)
                continue
            yield f"Ms at {cut}", f"{one.sensitivity:.3g} at {format_quantity(one.peak, 'Hz', 3)}"
            yield f"phase margin at {cut}", format_quantity(one.phase, "rad", 3)
            down = f", down to {one.least:.2g}" if one.least else ""
            yield f"gain margin at {cut}", (f"{one.gain:.3g}" if math.isfinite(one.gain) else "any") + down
            yield f"delay margin at {cut}", self._late(one.delay)
        if any("position" in cut for cut in self.margins):
            yield "bandwidth, -3 dB", format_quantity(self.bandwidth, "Hz", 3) if self.bandwidth else "none"
        yield from self.figures.items()
        if METHODS[self.file.spec.axis.method].stands:
            yield "standstill", self.at_rest or NONE
        yield from ((name, text.partition(", from ")[0]) for name, text in self.summary)


def at_rest(found: Standstill) -> str:
    """Its worst outcome, in a few words."""
    number = len(found.found)
    share = f"{found.outcome} from {round(found.shares[found.outcome] * number)} of {number} starts"
    return share + (f", {format_quantity(found.swing, found.ensemble.unit, 3)}" if found.hunts else "")


def look(file: AxisFile) -> tuple[Derived, list[Caution]]:
    """What `check` says of an axis at standstill: a row, and a caution where it hunts."""
    settles = METHODS[file.spec.axis.method].linear(file.spec).settles
    if not settles or not COMPILED:
        why = "steps are not compiled: it would take minutes" if settles else "the loops do not settle"
        return Derived("standstill", math.nan, "", "not watched", why), []
    found = standstill(file.spec, STARTS)
    return _standing(found), list(_hunting(file, found))


def _standing(found: Standstill) -> Derived:
    """The row, beside the rule of thumb."""
    rule, unit = found.ensemble.rule, found.ensemble.unit
    told = "simulated; rule of thumb: no stick-slip"
    if rule is not None and rule.swing > 0.0:
        period = format_quantity(rule.period, "s", 3)
        told = f"simulated; rule of thumb: {format_quantity(rule.swing, unit, 3)} every {period}"
    assumed = "" if found.ensemble.stated else f"; {ASSUMED}"
    return Derived("standstill", found.swing, unit, at_rest(found), told + assumed)


def _hunting(file: AxisFile, found: Standstill) -> Iterator[Caution]:
    """It hunts, and not only for a static friction that nobody stated: that default is pessimistic."""
    stated = found.ensemble.as_stated
    sure = found if stated is None or not found.hunts else standstill(stated, STARTS)
    if sure.swing <= EDGE * found.ensemble.grain:
        return
    from detent.tune.hunted import Hunted  # only where there is something to be told

    worst = found.kinds[0]
    motion = Hunted(file, found, None, None, None, None, ()).motion(worst)
    value = f"hunts from {round(found.shares[HUNTS] * STARTS)} of {STARTS} starts: {motion}"
    if not found.ensemble.stated:
        value += f" ({ASSUMED})"
    consequence = "it goes to and fro for ever and is never at rest on its target"
    yield Caution("standstill", value, "at rest from every start", consequence, found.ensemble.helps(worst.name))
