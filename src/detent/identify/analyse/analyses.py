"""What else a log can tell, each by its own method: asked for by name, answered with limits or with what is missing."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from detent.errors import DetentError
from detent.identify.analyse.friction_map import map_friction
from detent.identify.analyse.measure_response import response_of
from detent.identify.analyse.resonances import fit_resonances
from detent.identify.analyse.sensors import estimate_resolution, find_dead_time
from detent.identify.analyse.step_metrics import measure_steps
from detent.identify.analyse.two_speeds import fit_two_speeds
from detent.identify.analyse.winding import fit_winding
from detent.identify.fit.estimate import Estimate, estimate
from detent.logs.headings import EFFORTS
from detent.logs.log import Log

Found = tuple[tuple[Estimate, ...], str, tuple[str, ...], dict[str, Any]]


@dataclass(frozen=True, slots=True)
class Analysis:
    """What one method says about one log."""

    name: str  # and title: the word it is asked for by, and a few words for people
    title: str
    log: str  # name of the log
    estimates: tuple[Estimate, ...]  # what was found
    reason: str  # why there is nothing, or why it is not to be trusted; empty where neither is so
    notes: tuple[str, ...]  # what to know about it
    details: dict[str, Any]  # all of it, as plain data for JSON

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON, but for numbers that are not finite."""
        return {"analysis": self.name, "log": self.log, "reason": self.reason, **self.details}


def _two_speeds(log: Log, effort: str, _: float) -> Found:
    found = fit_two_speeds(log, effort)
    lines = (found.positive, found.negative)
    partly = [f"{line.direction}: {line.reason}" for line in lines if line.reason and not found.reason]
    return found.estimates, found.reason, (*partly, *lines[0].notes, *lines[1].notes), asdict(found)


def _friction_map(log: Log, effort: str, mass: float) -> Found:
    found = map_friction(log, effort, mass)
    method, columns = "mean of a bin of the speed", (found.speed, found.friction, found.error, found.windows)
    bins = tuple(
        estimate(f"at {speed:.4g} {found.speed_unit}", friction, found.unit, error, method, windows)
        for speed, friction, error, windows in zip(*(column.tolist() for column in columns), strict=True)
    )
    dips = tuple(
        f"{dip.direction}: friction falls by {dip.depth.value:.3g} {found.unit} from the lowest speed "
        f"to {dip.speed:.3g} {found.speed_unit}"
        for dip in found.dips
        if dip.is_found and dip.depth is not None
    )
    details = {name: one.tolist() if isinstance(one, np.ndarray) else one for name, one in asdict(found).items()}
    return bins, found.reason, (*dips, *found.refused), details


def _winding(log: Log, _: str, __: float) -> Found:
    found = fit_winding(log)
    return found.estimates, found.reason, found.notes, asdict(found)


def _steps(log: Log, _: str, __: float) -> Found:
    found = measure_steps(log)
    pairs = [(number, one) for number, step in enumerate(found.steps, 1) for one in step.estimates]
    named = tuple(replace(one, name=f"step {number}, {one.name}") for number, one in pairs)
    notes = (note for step in found.steps for note in step.notes)
    return named, found.reason, (*found.notes, *notes), asdict(found)


def _frequency(log: Log, effort: str, _: float) -> Found:
    has_load = "position_load" in log.signals
    motor = response_of(log, effort) if "position" in log.signals or not has_load else None
    load = response_of(log, effort, "position_load") if has_load else None
    found = fit_resonances(motor, load, hold=log.period)
    lines = found.frequency
    notes = (f"{len(lines)} lines from {lines[0]:.3g} to {lines[-1]:.3g} Hz, encoder of {' and '.join(found.outputs)}",)
    measured = {name: response for name, response in (("motor", motor), ("load", load)) if response is not None}
    details = found.to_dict() | {"coherence": {name: one.coherence.tolist() for name, one in measured.items()}}
    return tuple(found.estimates.values()), found.reason, notes, details


def _sensors(log: Log, effort: str, _: float) -> Found:
    log.need("position")
    resolution = estimate_resolution(log.signals["position"])
    counts = f"{resolution.counts} counts, {resolution.share:.0%} of the positions on the grid"
    told: list[Estimate] = []
    notes = [resolution.reason or counts]
    details: dict[str, Any] = {"resolution": resolution.step, "counts": resolution.counts, "share": resolution.share}
    if np.isfinite(resolution.step):
        unit = log.units["position"]
        told.append(estimate("resolution", resolution.step, unit, 0.0, "step common to all positions"))
    if effort or not log.signals.keys().isdisjoint(EFFORTS):
        dead = find_dead_time(log.t, log.signals[log.effort(effort)], log.signals["position"])
        told.append(dead.estimate)
        notes += [dead.reason] if dead.reason else []
        details["dead_time"] = dead.to_dict()
    return tuple(told), "" if told else notes[0], tuple(notes), details


ANALYSES: dict[str, tuple[str, Callable[[Log, str, float], Found]]] = {
    "two-speeds": ("slope and friction from steady speeds", _two_speeds),
    "friction-map": ("friction over the speed", _friction_map),
    "winding": ("resistance, inductance and constants of the winding", _winding),
    "frequency": ("frequency response, resonances and two masses", _frequency),
    "steps": ("answers to steps of the reference", _steps),
    "sensors": ("step of the encoder, dead time of the drive", _sensors),
}
"""Every analysis by the word it is asked for by: what it finds, and what finds it."""


def check_names(names: Sequence[str]) -> None:
    """Refuse a name that no analysis has."""
    for name in names:
        if name not in ANALYSES:
            raise DetentError(f"analysis: came {name}; allowed: {', '.join(ANALYSES)}; name one of these")


def analyse(log: Log, name: str, effort: str = "", mass: float = 0.0) -> Analysis:
    """Ask a log for one thing."""
    check_names([name])
    title, method = ANALYSES[name]
    try:
        estimates, reason, notes, details = method(log, effort, mass)
    except DetentError as error:
        return Analysis(name, title, log.name, (), str(error), (), {})
    return Analysis(name, title, log.name, estimates, reason, notes, details)
