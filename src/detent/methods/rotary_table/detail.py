"""One step of a sequence with the angles that the positioner reckons with, as in figure 5 of the method's source."""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from detent.control.table_positioner import HOLD, JOG, MOVE, STOPPING
from detent.methods.rotary_table.run import SequenceRun, StepRecord
from detent.methods.rotary_table.schema import RotaryTableSpec
from detent.page.chart import Band, Curve, Panel, Timeline, spans_of, time_charts
from detent.page.figure import Figure
from detent.page.frame import Section
from detent.page.parts import Event, Numbers
from detent.page.run_page import FEWEST_ROWS, Stretch, stretch
from detent.page.words import GAP, count, degrees, number
from detent.record.trace import Trace

LEAD = 0.1  # time before and after the motion that is shown [s]
ROLLOVERS = 2  # rollovers after which a long jog is cut: one of hours does the same again and again

MOST_MOMENTS = 6  # crossings and rollovers that are marked: a table that dithers at its end crosses it again and again
UNCHANGED = math.radians(1.0)  # change of the deviation from one row to the next that is no jump [rad]

FAILED = "the step that failed"
POINTS = 1500  # rows that are chosen for one curve's sake: there are four plot areas

DEG = 180.0 / math.pi
STATE, AHEAD, TARGET = "controller.positioner.state", "controller.positioner.z", "controller.positioner.oar"
DETECTED, PRESENT = "controller.positioner.angle.dar", "controller.positioner.angle.aar"
REMAINING = "controller.positioner.interpolator.irr"
TURNS, FLAG = "controller.positioner.angle.turn", "controller.positioner.angle.flg"
DEVIATION, SIGNAL, VELOCITY = "controller.positioner.dr", "controller.positioner.s4", "plant.train.motor.velocity"

NEEDED = (STATE, AHEAD, TARGET, DETECTED, PRESENT, REMAINING, TURNS, FLAG, DEVIATION, SIGNAL, VELOCITY)
"""Signals that a step is drawn from."""

CARRIED = {
    "turn counter": "The positioner adds n turns and uses the present angle R = D + n turns.",
    "flag": "The positioner notes the jump in FLG, and adds one turn along the motion to R while that is on.",
    "raw": "A conventional unit uses this angle as it is: R is D.",
}
"""What becomes of the jump, by the form of the axis."""


@dataclass(frozen=True)
class ShownStep:
    """A step, why this one, and its rows on a clock that starts when the positioner took it."""

    spec: RotaryTableSpec
    step: StepRecord
    why: str
    rows: Stretch

    def angle(self, name: str) -> Numbers:
        """A register in counts as an angle [rad]."""
        return self.rows[name] * self.spec.count

    def fine_angle(self, name: str) -> Numbers:
        """A register in counts with fraction bits as an angle [rad]."""
        return self.rows[name] * (self.spec.count / (1 << self.spec.method.fraction_bits))

    @property
    def target(self) -> Numbers:
        """M [rad]; NaN before the step was taken."""
        return np.where(self.rows.t < 0, np.nan, self.angle(TARGET))

    @cached_property
    def crossed(self) -> list[int]:
        """First rows on the other side of the end of the turn, since the positioner took the step."""
        jump = np.diff(self.rows[DETECTED])
        return (np.flatnonzero((2 * np.abs(jump) > self.spec.period) & (self.rows.t[1:] >= 0)) + 1).tolist()

    @cached_property
    def rolled(self) -> list[int]:
        """First rows after a rollover: in a jog the remaining angle only ever grows by one."""
        jogging = self.rows[STATE] == JOG
        jump = np.diff(self.fine_angle(REMAINING))
        return (np.flatnonzero((2 * jump > math.tau) & jogging[1:] & jogging[:-1]) + 1).tolist()


def step_section(spec: RotaryTableSpec, run: SequenceRun, trace: Trace | None) -> Section:
    """The most telling step, with everything that the positioner knows of it; nothing if it was not recorded."""
    found = telling(run, float(trace.time[-1])) if trace is not None and len(trace) else None
    shown = _cut(spec, trace, *found) if trace is not None and found else None
    if shown is None:
        return Section("", [])
    events = _events(shown)
    figure = Figure(
        title=f"Step {count(shown.step.number)}: {shown.step.text}",
        caption=f"Shown is {shown.why}. {_caption(shown)}",
        charts=_charts(shown, events),
        events=events,
    )
    return Section("Beyond one turn" if shown.crossed else "One step in detail", [figure])


def telling(run: SequenceRun, recorded: float) -> tuple[StepRecord, str] | None:
    """The most telling of the steps that began before `recorded` [s since power-on], and why this one.

    It is the one that failed, else a jog that crosses the end of the turn, else a positioning that does.
    """
    moved = [step for step in run.steps if step.kind in {"jog", "go"} and step.begin < recorded]
    if not run.done and moved and moved[-1] is run.steps[-1]:
        return moved[-1], FAILED
    jogs = [step for step in moved if step.kind == "jog"]
    over = [step for step in moved if step.kind == "go" and step.crossings]
    if any(_passed(step) for step in jogs):
        return max(jogs, key=_passed), "the jog that crosses the end of the turn most often"
    for steps, why in (
        (over, "the longest positioning that crosses the end of the turn"),
        (jogs, "the longest jog; none came as far as the end of the turn"),
        (moved, "the longest positioning; none crosses the end of a turn"),
    ):
        if steps:
            return max(steps, key=lambda step: abs(step.travel)), why
    return None


def _passed(step: StepRecord) -> int:
    return step.crossings + step.rollovers


def _cut(spec: RotaryTableSpec, trace: Trace, step: StepRecord, why: str) -> ShownStep | None:
    """The stretch of a step in which it is under way, with a little before and after; None if it was not recorded."""
    whole = stretch(trace, NEEDED, step.begin, step.end)
    if whole is None:
        return None
    busy = np.isin(whole[STATE], (JOG, STOPPING, MOVE)) & (whole.t > 0)
    under_way = trace.time[whole.rows][busy]
    if len(under_way) < FEWEST_ROWS:
        return None
    begin, end = float(under_way[0]), float(under_way[-1])

    def shown(lead: float, end: float) -> ShownStep | None:
        rows = stretch(trace, NEEDED, begin - lead, end + lead)
        return None if rows is None else ShownStep(spec, step, why, replace(rows, t=trace.time[rows.rows] - begin))

    motion = shown(0.0, end)
    if motion and len(motion.rolled) > ROLLOVERS:
        end = begin + 1.1 * float(motion.rows.t[motion.rolled[ROLLOVERS - 1]])
    return shown(LEAD, end)


def _caption(shown: ShownStep) -> str:
    form = shown.spec.method.form
    carried = f"The detector is absolute within one turn: at its end D jumps by 360 deg. {CARRIED[form]} "
    carried += "Shaded: R differs from D. " if shown.crossed and form != "raw" else ""
    if shown.step.kind == "go":
        asked = "The commanded angle C runs to the target M, and R follows. "
        look = "Check: the deviation is not affected by the end of the turn."
    else:
        asked = (
            "The target M of a jog is two turns ahead and never reached: as soon as less than one turn is left, R and "
            "C are reduced by a whole turn together (rollover), and the cycle repeats. "
        )
        look = "Check: the deviation is not affected; if only one of them changed, it would jump by 360 deg."
    return carried + asked + ("Check where the lag starts to deviate." if shown.why == FAILED else look)


# ---- charts


def degree_curve(label: str, colour: str, y: Numbers, **look: Any) -> Curve:
    """Curve of an angle [rad] or a speed [rad/s] in degrees."""
    return Curve(label=label, colour=colour, y=y * DEG, digits=2, thin=POINTS, **look)


def _charts(shown: ShownStep, events: list[Event]) -> list[dict[str, Any]]:
    rows, spec, ahead = shown.rows, shown.spec, shown.rows[AHEAD].astype(np.int64)
    # C is what remains before M; in a jog it sets off a rollover at M less one turn along the motion.
    threshold = np.where(rows[STATE] == JOG, shown.target - ahead * math.tau, np.nan)
    command = shown.angle(TARGET) - ahead * shown.fine_angle(REMAINING)
    added = Band(label="", colour="good", spans=spans_of(rows.t, rows[PRESENT] != rows[DETECTED]))
    since = "time since the button was seen" if shown.step.kind == "jog" else "time since the position was taken"
    angles = [
        degree_curve("M target", "ink", shown.target, dash=(2, 3), step=True),
        degree_curve("M \u2212 one turn: rollover", "muted", threshold, dash=(8, 4), step=True),
        degree_curve("D detected", "muted", shown.angle(DETECTED), width=2),
        degree_curve("R present", "speed", shown.angle(PRESENT), width=2.5),
        degree_curve("C commanded", "left", command, dash=(6, 4)),
    ]
    angles = [one for one in angles if not np.isnan(one.y).all()]
    counters = [
        Curve(label="turns n", colour="speed", width=2.5, step=True, y=rows[TURNS], digits=0),
        Curve(label="FLG", colour="left", dash=(6, 4), step=True, y=rows[FLAG], digits=0),
    ]
    lag = Curve(
        label="deviation dR: how far the table lags", colour="drive", width=2, y=shown.fine_angle(DEVIATION) * DEG
    )
    speeds = [
        degree_curve("speed signal S4, as told to the drive", "left", rows[SIGNAL] * spec.speed_per_word, step=True),
        degree_curve("true speed", "speed", rows[VELOCITY] / spec.ratio, width=2),
    ]
    return time_charts(Timeline(name="turn", t=rows.t, label=since, unit="s", bands=[added], events=events), [
        Panel(name="turn-angles", label="angle [deg]", height=340, zero=True, curves=angles),
        Panel(name="turn-count", label="turns added", height=110, zero=True, curves=counters),
        Panel(name="turn-deviation", label="lag dR [deg]", height=150, zero=True, curves=[lag]),
        Panel(name="turn-speed", label="speed [deg/s]", height=160, zero=True, curves=speeds),
    ])  # fmt: skip


# ---- events


def _events(shown: ShownStep) -> list[Event]:
    """What happens in the step, in order of time."""
    t, state = shown.rows.t, shown.rows[STATE]
    texts = [(int(np.searchsorted(t, 0.0)), _start_text(shown))]
    texts += [(row, _crossing_text(shown, row)) for row in shown.crossed[:MOST_MOMENTS]]
    texts += [(row, _rollover_text(shown, row)) for row in shown.rolled[:MOST_MOMENTS]]
    held = "at rest: the table is held"
    if shown.spec.method.form == "turn counter":
        held = "at rest: M, R and C are reduced to within one turn, where the table is held"
    for now, text in ((STOPPING, "button released: M moves to where the table can stop"), (HOLD, held)):
        found = np.flatnonzero((t > 0) & (state == now)).tolist()
        texts += [(row, text) for row in found[:1]]
    return [Event(float(t[row]), text) for row, text in sorted(texts, key=lambda moment: moment[0])]


def _start_text(shown: ShownStep) -> str:
    row = int(np.searchsorted(shown.rows.t, 0.0))
    target = _angle_text(shown.target[row])
    if shown.step.kind == "jog":
        button = "+" if shown.rows[AHEAD][row] > 0 else "\u2212"
        return f"{button} button: the target M is set two turns ahead of D, at {target}; n = 0"
    return f"the position is taken: the target M is set at {target}"


def _crossing_text(shown: ShownStep, row: int) -> str:
    rows = shown.rows
    down = rows[DETECTED][row] < rows[DETECTED][row - 1]
    ends = ("360", "0") if down else ("0", "360")
    turns = number(int(rows[TURNS][row]))
    carried = {"turn counter": f"; n = {turns}", "flag": "; FLG on", "raw": ""}[shown.spec.method.form]
    return f"the table crosses the end of its turn: D jumps from {ends[0]} to {ends[1]}{GAP}deg{carried}"


def _rollover_text(shown: ShownStep, row: int) -> str:
    before, after = shown.fine_angle(DEVIATION)[row - 1 : row + 1].tolist()
    stays = abs(after - before) < UNCHANGED
    deviation = f"stays {_angle_text(after)}" if stays else f"jumps from {_angle_text(before)} to {_angle_text(after)}"
    return f"less than one turn remains to M: rollover, R and C are reduced by one turn; the deviation {deviation}"


def _angle_text(value: float) -> str:
    return f"{degrees(value, 4)}{GAP}deg"
