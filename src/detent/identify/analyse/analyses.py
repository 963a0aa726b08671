"""What else a log can tell, each by its own method: asked for by name, answered with limits or with what is missing."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from detent.errors import DetentError
from detent.identify.analyse.advice import advise
from detent.identify.analyse.friction_map import map_friction
from detent.identify.analyse.measure_response import FrequencyResponse, response_of
from detent.identify.analyse.resonances import fit_resonances
from detent.identify.analyse.sensors import estimate_resolution, find_dead_time
from detent.identify.analyse.step_metrics import StepMetrics, measure_steps
from detent.identify.analyse.two_speeds import fit_two_speeds
from detent.identify.analyse.winding import fit_winding
from detent.identify.fit.estimate import Estimate, estimate
from detent.logs.headings import EFFORTS
from detent.logs.log import Log
from detent.units import format_quantity

SAME = 0.01  # difference of way and time of two moves, as parts of them, up to which they are one kind
PROFILE = 10  # samples from which on a change of the reference is a profile and no step


class Found(NamedTuple):
    """What a method found: constants, why none or not to be trusted, what to know, all of it, and what it measured."""

    estimates: tuple[Estimate, ...]
    reason: str
    notes: tuple[str, ...]
    details: dict[str, Any]
    shown: FrequencyResponse | None = None


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
    advice: str = ""  # what to do with it, or what to record for one
    shown: FrequencyResponse | None = None  # what was measured, for a figure

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON, but for numbers that are not finite."""
        return {"analysis": self.name, "log": self.log, "reason": self.reason, **self.details}


def _two_speeds(log: Log, effort: str, _: float) -> Found:
    found = fit_two_speeds(log, effort)
    lines = (found.positive, found.negative)
    partly = [f"{line.direction}: {line.reason}" for line in lines if line.reason and not found.reason]
    reason = found.reason or _impossible(found.estimates)
    return Found(found.estimates, reason, (*partly, *lines[0].notes, *lines[1].notes), asdict(found))


def _impossible(estimates: Sequence[Estimate]) -> str:
    """Why friction cannot be so: of both directions together, as one alone may hold a constant force; else empty."""
    named = {one.name: one.value for one in estimates}
    advice = "the segments are few, or not as steady as they look; record more constant speeds, each for longer"
    if len(named) == 4 and named["coulomb.positive"] + named["coulomb.negative"] < 0.0:
        return f"the sum of friction in both directions is negative and would drive the axis: {advice}"
    falling = [name for name, value in named.items() if name.startswith("slope") and value < 0.0]
    return f"the effort decreases with speed ({' and '.join(falling)} below 0): {advice}" if falling else ""


def _friction_map(log: Log, effort: str, mass: float) -> Found:
    found = map_friction(log, effort, mass)
    method, columns = "mean of a bin of the speed", (found.speed, found.friction, found.error, found.windows)
    bins = tuple(
        estimate(f"at {speed:.4g} {found.speed_unit}", friction, found.unit, error, method, windows)
        for speed, friction, error, windows in zip(*(column.tolist() for column in columns), strict=True)
    )
    dips = tuple(
        f"{dip.direction}: friction drops by {dip.depth.value:.3g} {found.unit} from the lowest speed "
        f"to {dip.speed:.3g} {found.speed_unit}"
        for dip in found.dips
        if dip.is_found and dip.depth is not None
    )
    details = {name: one.tolist() if isinstance(one, np.ndarray) else one for name, one in asdict(found).items()}
    return Found(bins, found.reason, (*dips, *found.refused), details)


def _winding(log: Log, _: str, __: float) -> Found:
    found = fit_winding(log)
    return Found(found.estimates, found.reason, found.notes, asdict(found))


def _steps(log: Log, _: str, __: float) -> Found:
    found = measure_steps(log)
    kinds = _kinds(found.steps)
    named = tuple(one for kind in kinds for one in _kind_estimates(kind, found.unit))
    notes = (note for step in found.steps for note in step.notes)
    details = asdict(found) | {"moves": [_kind_data(kind, log.period) for kind in kinds]}
    return Found(named, found.reason, (*found.notes, *dict.fromkeys(notes)), details)


def _kinds(steps: Sequence[StepMetrics]) -> list[list[StepMetrics]]:
    """Steps of the same way in the same time, in the order in which each kind is first made."""
    kinds: list[list[StepMetrics]] = []
    for step in steps:
        way = step.target - step.start
        for kind in kinds:
            first = kind[0]
            near = abs(way - (first.target - first.start)) <= SAME * abs(way)
            if near and abs(step.duration - first.duration) <= SAME * step.duration:
                kind.append(step)
                break
        else:
            kinds.append([step])
    return kinds


def _kind_estimates(kind: Sequence[StepMetrics], unit: str) -> Iterator[Estimate]:
    """What the moves of a kind have in common: means, with the scatter from one to the next in their limits."""
    way, times = kind[0].target - kind[0].start, len(kind)
    title = f"{format_quantity(way, unit, 3)} in {format_quantity(kind[0].duration, 's', 3)}"
    title += f", {times} times" if times > 1 else ""
    for name in dict.fromkeys(one.name for step in kind for one in step.estimates):
        held = [one for step in kind for one in step.estimates if one.name == name]
        if len(held) == 1:
            yield replace(held[0], name=f"{title}: {name}")
            continue
        values, own = np.array([one.value for one in held]), np.array([one.error for one in held])
        error = float(np.hypot(values.std(ddof=1), np.sqrt(np.mean(own**2))) / np.sqrt(len(held)))
        method = f"mean of {len(held)} moves"
        yield estimate(f"{title}: {name}", float(values.mean()), held[0].unit, error, method, len(held) - 1)


def _kind_data(kind: Sequence[StepMetrics], period: float) -> dict[str, Any]:
    first = kind[0]
    overshoots = [abs(step.overshoot.value) for step in kind if step.overshoot is not None]
    return {
        "way": first.target - first.start,
        "duration": first.duration,
        "times": len(kind),
        "is_profile": first.duration > PROFILE * period,
        "overshoot": max(overshoots, default=0.0),
    }


def _frequency(log: Log, effort: str, _: float) -> Found:
    has_load = "position_load" in log.signals
    motor = response_of(log, effort) if "position" in log.signals or not has_load else None
    load = response_of(log, effort, "position_load") if has_load else None
    found = fit_resonances(motor, load, hold=log.period)
    lines = found.frequency
    notes = (f"{len(lines)} lines from {lines[0]:.3g} to {lines[-1]:.3g} Hz, encoder of {' and '.join(found.outputs)}",)
    measured = {name: response for name, response in (("motor", motor), ("load", load)) if response is not None}
    details = found.to_dict() | {"coherence": {name: one.coherence.tolist() for name, one in measured.items()}}
    return Found(tuple(found.estimates.values()), found.reason, notes, details, motor or load)


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
        try:
            dead = find_dead_time(log.t, log.signals[log.effort(effort)], log.signals["position"])
        except DetentError as error:
            return Found(tuple(told), "" if told else str(error), (*notes, f"dead time: no result: {error}"), details)
        # A dead time that is not to be trusted is none: it would be put into a file all the same.
        told += [] if dead.reason else [dead.estimate]
        notes += [f"dead time: no result: {dead.reason}"] if dead.reason else []
        details["dead_time"] = dead.to_dict()
    return Found(tuple(told), "" if told else notes[0], tuple(notes), details)


ANALYSES: dict[str, tuple[str, Callable[[Log, str, float], Found]]] = {
    "two-speeds": ("slope and friction from constant speeds", _two_speeds),
    "friction-map": ("friction versus speed", _friction_map),
    "winding": ("resistance, inductance and constants of the winding", _winding),
    "frequency": ("frequency response, resonances and two-mass model", _frequency),
    "steps": ("response to reference steps", _steps),
    "sensors": ("encoder resolution, dead time of the drive", _sensors),
}
"""Every analysis by its name: what it finds, and the function that finds it."""


def check_names(names: Sequence[str]) -> None:
    """Refuse a name that no analysis has."""
    for name in names:
        if name not in ANALYSES:
            raise DetentError(f"analysis: got {name}; expected: {', '.join(ANALYSES)}; name one of these")


def analyse(log: Log, name: str, effort: str = "", mass: float = 0.0) -> Analysis:
    """Ask a log for one thing."""
    check_names([name])
    title, method = ANALYSES[name]
    try:
        found = method(log, effort, mass)
    except DetentError as error:
        return Analysis(name, title, log.name, (), str(error), (), {}, f"no result: {error}")
    advice = advise(name, found.estimates, found.reason, found.details)
    return Analysis(
        name, title, log.name, found.estimates, found.reason, found.notes, found.details, advice, found.shown
    )
