"""From the run of a sequence and its trace to what the report of a rotary table shows."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from detent.control.table_positioner import HOLD, JOG, MOVE, STOPPING
from detent.methods.rotary_table.comparison import AngleComparison
from detent.methods.rotary_table.page_data import Signal, StepResult, TablePath, TableReportData, TurnDetail
from detent.methods.rotary_table.run import SequenceRun, StepRecord
from detent.methods.rotary_table.schema import RotaryTableSpec
from detent.methods.rotary_table.summary import degrees, sequence_figures
from detent.page.parts import Event, Note, Numbers
from detent.page.words import GAP, number
from detent.record.trace import Trace

FEWEST_ROWS = 10
"""Rows of a trace without which nothing is drawn."""

LEAD = 0.1
"""Time before and after the motion that the detail shows [s]."""

ROLLOVERS = 2
"""Rollovers after which the detail of a long jog ends."""

MOST_MOMENTS = 6
"""Crossings and rollovers that are marked: a table that dithers at the end of its turn crosses it again and again."""

UNCHANGED = math.radians(1.0)
"""Change of the deviation from one row to the next that is no jump [rad]."""

FAILED = "the step that failed"

PHASE_TURN = float(1 << 32)
"""Register of the true angle per turn."""

NEEDED_PATH = ("table", "positioner.angle.dar", "machine.motor.velocity", "positioner.interpolator.speed",
               "positioner.z")  # fmt: skip
"""Signals that the figure of the whole sequence is drawn from."""

NEEDED_DETAIL = (
    "positioner.state", "positioner.z", "positioner.angle.aar", "positioner.angle.dar", "positioner.angle.flg",
    "positioner.angle.turn", "positioner.oar", "positioner.interpolator.irr", "positioner.dr", "positioner.s4",
    "machine.motor.velocity",
)  # fmt: skip
"""Signals that one step is drawn from; a trace without them gives a report without that figure."""


def sequence_report(
    spec: RotaryTableSpec,
    run: SequenceRun,
    trace: Trace | None,
    *,
    comparison: AngleComparison | None = None,
    settings: dict[str, str] | None = None,
) -> TableReportData:
    """Everything the report of a sequence shows."""
    return TableReportData(
        axis_name=spec.axis.name,
        job_name=run.job.name,
        done=run.done,
        failure=run.failure,
        figures=sequence_figures(run),
        count=spec.count,
        in_position=run.in_position,
        max_speed=spec.limits.speed,
        steps=[_step_result(run, step) for step in run.steps],
        outputs=_signals(run, run.outputs),
        inputs=_signals(run, run.inputs),
        path=_path(spec, run, trace),
        detail=_detail(spec, run, trace),
        comparison=comparison,
        notes=[Note("warning", text) for text in run.warnings],
        settings=settings or {},
    )


def _step_result(run: SequenceRun, step: StepRecord) -> StepResult:
    # A jog that broke off is held on no place of its own.
    broken = not run.done and step is run.steps[-1] and step.kind == "jog"
    return StepResult(
        number=step.number,
        kind=step.kind,
        text=step.text,
        begin=step.begin - run.time_ready,
        seconds=step.end - step.begin,
        start=step.start,
        stop=step.stop,
        offset=math.nan if broken else -step.error,
        peak_speed=step.peak_speed,
        peak_deviation=step.peak_deviation,
        crossings=step.crossings,
        rollovers=step.rollovers,
    )


def _signals(run: SequenceRun, changes: Sequence[tuple[float, str, bool]]) -> list[Signal]:
    """Stretches in which each signal was on; what is still on at the end is on up to there."""
    spans: dict[str, list[tuple[float, float]]] = {}
    since: dict[str, float] = {}
    for moment, name, on in changes:
        found = spans.setdefault(name, [])
        if on:
            since.setdefault(name, moment - run.time_ready)
        elif name in since:
            found.append((since.pop(name), moment - run.time_ready))
    for name, begin in since.items():
        spans[name].append((begin, run.time_end - run.time_ready))
    return [Signal(name, found) for name, found in spans.items()]


# ---- the whole sequence


def _has(trace: Trace | None, names: tuple[str, ...]) -> bool:
    return trace is not None and len(trace) > 1 and all(name in trace for name in names)


def _path(spec: RotaryTableSpec, run: SequenceRun, trace: Trace | None) -> TablePath | None:
    if trace is None or not run.steps or not _has(trace, NEEDED_PATH):
        return None
    first = int(np.searchsorted(trace.time, run.time_ready, side="right"))
    if len(trace) - first < FEWEST_ROWS:
        return None
    t = trace.time[first:]
    per_interrupt = spec.per_interrupt(1.0)
    return TablePath(
        t=t - run.time_ready,
        angle=_endless(trace["table"][first:], run.steps[0].start),
        target=_targets(run, t),
        detected=trace["positioner.angle.dar"][first:] * spec.count,
        velocity=trace["machine.motor.velocity"][first:] / spec.ratio,
        velocity_ref=trace["positioner.z"][first:] * trace["positioner.interpolator.speed"][first:] / per_interrupt,
    )


def _endless(phase: Numbers, start: float) -> Numbers:
    """True angle with all its turns [rad], from the register of one turn; it begins within half a turn of `start`."""
    turns: Any = np.unwrap(phase / PHASE_TURN, period=1.0)
    return (turns + round(start / math.tau - float(turns[0]))) * math.tau


def _targets(run: SequenceRun, t: Numbers) -> Numbers:
    """Target of the positioning that is under way at each time since power-on [s]; NaN in other steps."""
    found = np.full(len(t), np.nan)
    for step in run.steps:
        if step.kind == "go":
            found[slice(*np.searchsorted(t, (step.begin, step.end)))] = step.target
    return found


# ---- one step


@dataclass(frozen=True, slots=True)
class _Shown:
    """The step that is shown in detail."""

    spec: RotaryTableSpec
    step: StepRecord
    why: str
    part: Trace
    zero: float

    @property
    def t(self) -> Numbers:
        """Time of the rows since the positioner took the step [s]."""
        return self.part.time - self.zero

    @property
    def crossed(self) -> Numbers:
        """First rows on the other side of the end of the turn, since the positioner took the step."""
        jump = np.diff(self.part["positioner.angle.dar"])
        return np.flatnonzero((2 * np.abs(jump) > self.spec.period) & (self.t[1:] >= 0)) + 1

    @property
    def rolled(self) -> Numbers:
        """First rows after a rollover: in a jog the remaining angle only ever grows by one."""
        jogging = self.part["positioner.state"] == JOG
        period = self.spec.period << self.spec.method.fraction_bits
        jump = np.diff(self.part["positioner.interpolator.irr"])
        return np.flatnonzero((2 * jump > period) & jogging[1:] & jogging[:-1]) + 1


def _detail(spec: RotaryTableSpec, run: SequenceRun, trace: Trace | None) -> TurnDetail | None:
    """One step, with everything that the positioner knows of it."""
    if trace is None or not _has(trace, NEEDED_DETAIL):
        return None
    step, why = _choose(run, float(trace.time[-1]))
    if step is None:
        return None
    shown = _cut(spec, step, why, trace)
    return _turn_detail(shown) if shown else None


def _choose(run: SequenceRun, recorded: float) -> tuple[StepRecord | None, str]:
    """The most telling of the steps whose begin was recorded, and why this one.

    It is the one that failed, else a jog that crosses the end of the turn, else a positioning that does.
    """
    moved = [step for step in run.steps if step.kind in {"jog", "go"} and step.begin < recorded]
    if not run.done and moved and moved[-1] is run.steps[-1]:
        return moved[-1], FAILED
    jogs = [step for step in moved if step.kind == "jog"]
    over = [step for step in moved if step.kind == "go" and step.crossings]
    if jogs and max(step.crossings + step.rollovers for step in jogs):
        return max(
            jogs, key=lambda step: step.crossings + step.rollovers
        ), "the jog that crosses the end of the turn most often"
    if over:
        return max(over, key=lambda step: abs(step.travel)), "the longest positioning that crosses the end of the turn"
    if jogs:
        return max(jogs, key=lambda step: abs(step.travel)), "the longest jog; none came as far as the end of the turn"
    if moved:
        return max(moved, key=lambda step: abs(step.travel)), "the longest positioning; none crosses the end of a turn"
    return None, ""


def _cut(spec: RotaryTableSpec, step: StepRecord, why: str, trace: Trace) -> _Shown | None:
    """The stretch of a step in which it is under way, with a little before and after; None if it was not recorded."""
    state = trace["positioner.state"]
    busy = np.isin(state, (JOG, STOPPING, MOVE)) & (trace.time > step.begin) & (trace.time <= step.end)
    rows = np.flatnonzero(busy)
    if len(rows) < FEWEST_ROWS:
        return None
    first, last = int(rows[0]), int(rows[-1])
    begin, end = float(trace.time[first]), float(trace.time[last])
    shown = _Shown(spec, step, why, trace.between(begin, end), begin)
    rolled = shown.rolled
    if len(rolled) > ROLLOVERS:
        # A jog of hours does the same again and again.
        end = begin + 1.1 * float(shown.t[rolled[ROLLOVERS - 1]])
    return _Shown(spec, step, why, trace.between(begin - LEAD, end + LEAD), begin)


def _turn_detail(shown: _Shown) -> TurnDetail:
    spec, part, count = shown.spec, shown.part, shown.spec.count
    fraction = 1 << spec.method.fraction_bits
    z, oar = part["positioner.z"].astype(np.int64), part["positioner.oar"]
    target = np.where(shown.t < 0, np.nan, oar * count)
    return TurnDetail(
        number=shown.step.number,
        kind=shown.step.kind,
        text=shown.step.text,
        why=shown.why,
        form=spec.method.form,
        failed=shown.why == FAILED,
        t=shown.t,
        detected=part["positioner.angle.dar"] * count,
        present=part["positioner.angle.aar"] * count,
        command=(oar - z * (part["positioner.interpolator.irr"] / fraction)) * count,
        target=target,
        threshold=np.where(part["positioner.state"] == JOG, target - z * math.tau, np.nan),
        turns=part["positioner.angle.turn"],
        flag=part["positioner.angle.flg"],
        deviation=part["positioner.dr"] / fraction * count,
        speed_signal=part["positioner.s4"] * spec.speed_per_word,
        velocity=part["machine.motor.velocity"] / spec.ratio,
        crossings=len(shown.crossed),
        rollovers=len(shown.rolled),
        events=_events(shown),
    )


def _events(shown: _Shown) -> list[Event]:
    """What happens in the step, in order of time."""
    t, state = shown.t, shown.part["positioner.state"]
    events = [Event(0.0, _start_text(shown))]
    events += [Event(float(t[row]), _crossing_text(shown, row)) for row in shown.crossed[:MOST_MOMENTS].tolist()]
    events += [Event(float(t[row]), _rollover_text(shown, row)) for row in shown.rolled[:MOST_MOMENTS].tolist()]
    after = t > 0
    for now, text in ((STOPPING, "button released: M comes to where the table can stop"), (HOLD, _rest_text(shown))):
        rows = np.flatnonzero(after & (state == now))
        if rows.size:
            events.append(Event(float(t[rows[0]]), text))
    return sorted(events, key=lambda event: event.t)


def _start_text(shown: _Shown) -> str:
    row = int(np.searchsorted(shown.t, 0.0))
    target = _angle_text(shown.part["positioner.oar"][row] * shown.spec.count)
    if shown.step.kind == "jog":
        button = "+" if shown.part["positioner.z"][row] > 0 else "\u2212"
        return f"{button} button: the target M is set two turns ahead of D, at {target}; n = 0"
    return f"the position is taken: the target M is set at {target}"


def _crossing_text(shown: _Shown, row: int) -> str:
    down = shown.part["positioner.angle.dar"][row] < shown.part["positioner.angle.dar"][row - 1]
    ends = ("360", "0") if down else ("0", "360")
    turns = int(shown.part["positioner.angle.turn"][row])
    carried = {"turn counter": f"; n = {number(turns)}", "flag": "; FLG on", "raw": ""}[shown.spec.method.form]
    return f"the table crosses the end of its turn: D jumps from {ends[0]} to {ends[1]}{GAP}deg{carried}"


def _rollover_text(shown: _Shown, row: int) -> str:
    fraction = 1 << shown.spec.method.fraction_bits
    before, after = (shown.part["positioner.dr"][k] / fraction * shown.spec.count for k in (row - 1, row))
    stays = abs(after - before) < UNCHANGED
    deviation = f"stays {_angle_text(after)}" if stays else f"jumps from {_angle_text(before)} to {_angle_text(after)}"
    return f"less than one turn remains to M: rollover, R and C go back by one turn; the deviation {deviation}"


def _rest_text(shown: _Shown) -> str:
    if shown.spec.method.form == "turn counter":
        return "at rest: M, R and C come back to within one turn, where the table is held"
    return "at rest: the table is held"


def _angle_text(value: float) -> str:
    return f"{degrees(value, 4)}{GAP}deg"
