"""The most telling motion of a stage's job, step by step: under its table, its torques, and how the rotor followed."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec, StepperTable
from detent.methods.stepper_envelope.stage_job import StageJog, StageMove
from detent.methods.stepper_envelope.stage_trace import Leg, MadeSteps, legs_of, of, runs_chart, runs_of, step_torques
from detent.methods.stepper_envelope.summary import (
    PULL_OUT_LAG,
    Motion,
    StageFigures,
    called,
    margin_text,
    speed_text,
    stated,
    units_of,
    way_text,
)
from detent.page.chart import Band, Chart, Curve, Panel, Timeline, line_chart, thin_indices, time_charts
from detent.page.figure import Figure
from detent.page.frame import Section
from detent.page.parts import Event, Numbers
from detent.page.run_page import Stretch, stretch
from detent.page.words import GAP, count, number
from detent.record.trace import Trace

ARC_POINTS = 600  # points of one run in the figure of frequency against position
POINTS = 1500  # rows that are chosen for one curve's sake: a page has many of them

NEEDED_ROTOR = ("controller.timer.period", "controller.rule.direction", "plant.rotor.velocity", "plant.rotor.lag")
"""Registers that the rotor is drawn from."""

MILLI = 1e3


@dataclass(frozen=True, slots=True)
class ShownMotion:
    """The motion that is shown in detail, why this one, what was asked for, and its steps, run by run."""

    spec: StepperEnvelopeSpec
    motion: Motion
    why: str
    asked: StageMove | StageJog
    legs: Sequence[Leg]

    @property
    def table(self) -> StepperTable:
        """Table of its motor."""
        return self.spec.stepper[self.motion.name]


def detail_section(figures: StageFigures, trace: Trace | None, made: Mapping[str, MadeSteps]) -> Section:
    """One motion in detail, of nothing if no motion was recorded whole."""
    shown = telling(figures, trace, made) if trace is not None else None
    if shown is None:
        return Section("Step by step", [])
    move, kind = shown.motion.move, figures.run.job.kind
    name = called(move, kind)
    if move.label and kind != "tiles":
        name += f" “{move.label}”"
    drawn = [_table_figure(shown), _torque_figure(shown), *_rotor_figures(shown, trace)]
    return Section(f"{name[0].upper()}{name[1:]}, step by step", [figure for figure in drawn if figure])


def telling(figures: StageFigures, trace: Trace, made: Mapping[str, MadeSteps]) -> ShownMotion | None:
    """The most telling of the motions that were recorded whole; None if no motion was.

    It is the one that lost steps or missed its place first, else the one that had to pass a stop, else the one with the
    least torque margin, of several such the longest.
    """
    row = float(trace.time[1] - trace.time[0])
    whole = [
        motion
        for motion in figures.motions
        if motion.name in made and motion.move.ready <= trace.time[-1] + row
        and len(made[motion.name].between(motion.move.begin, motion.motor.arrived).t)
    ]  # fmt: skip
    if not whole:
        return None
    motion, why = _choose(figures, whole)
    asked = next(asked for asked in figures.run.job.moves if asked.number == motion.move.number)
    legs = legs_of(made[motion.name], figures.spec.stepper[motion.name], motion.move, motion.motor)
    return ShownMotion(figures.spec, motion, why, asked, legs)


def _choose(figures: StageFigures, whole: Sequence[Motion]) -> tuple[Motion, str]:
    reasons: tuple[tuple[str, Callable[[Motion], bool]], ...] = (
        ("the motion that lost steps first", lambda motion: motion.motor.lost != 0),
        ("the motion that did not end in its place", figures.astray),
        ("the motion that had to pass its stop", lambda motion: motion.motor.overrun),
    )
    for why, applies in reasons:
        for motion in filter(applies, whole):
            return motion, why
    # In three digits: what is equal to a reader is equal.
    margins = [float(f"{motion.motor.margin:.3g}") for motion in whole]
    tied = [motion for motion, margin in zip(whole, margins, strict=True) if margin == min(margins)]
    why = "the motion with the least torque margin" + (", the longest of several" if len(tied) > 1 else "")
    return max(tied, key=lambda motion: motion.motor.steps), why


def _table_figure(shown: ShownMotion) -> Figure:
    motion, table, legs = shown.motion, shown.table, shown.legs
    way = motion.motor.stop - motion.motor.start
    turned = f", with {count(len(legs) - 1, 'turn')} on the way" if len(legs) > 1 else ""
    caption = (
        f"Shown is {shown.why}: motor {motion.name}, {way_text(table, abs(way))} {'up' if way > 0 else 'down'}"
        f"{turned}. The grey ground is now the table of this very move, which ends at its extremes: every step was "
        "looked up in it. Look for: the line on the edge of the grey."
    )
    # The extremes of a manual run are the ends of the travel.
    runs = runs_of(motion.name, table, legs, ARC_POINTS, () if isinstance(shown.asked, StageJog) else legs)
    title = "Frequency against position, under the table of the move"
    return Figure(title=title, caption=caption, charts=[runs_chart(runs, "detail-runs", height=260)])


def _torque_figure(shown: ShownMotion) -> Figure | None:
    torques, safety = step_torques(shown.table, shown.legs), shown.table.drive.torque_safety
    if torques is None:
        return None
    caption = (
        "Above: the torque that the motor can give at the frequency of each step, and what the step asks for: friction "
        "and acceleration; friction helps to brake. Below: their ratio, cut off where it is far above the least. Under "
        f"1 the rotor cannot follow; the ramp is planned with a reserve of {stated(safety)}. Look for: the "
        f"least margin, ×{GAP}{margin_text(shown.motion)}, and where it is."
    )
    _, available, needed = torques
    charts = torque_charts(available * MILLI, needed * MILLI, safety)
    return Figure(title="Margin of torque at every step", caption=caption, charts=charts)


def torque_charts(available: Numbers, needed: Numbers, safety: float) -> list[Chart]:
    """Torque of every step [mN m], and its margin."""
    margin = np.divide(available, needed, out=np.full(len(needed), np.nan), where=needed > 0)
    kept = np.unique(np.concatenate([thin_indices(y, POINTS) for y in (margin, available, needed)]))
    lines = (available[kept] / safety, np.full(len(kept), safety))
    label = f"planned with a reserve of {stated(safety)}"
    planned = [[Curve(label=label, colour="left", dash=(6, 4), y=y)] if safety > 1 else [] for y in lines]
    torque = Panel(
        name="detail-torque", label="torque [mN·m]", height=200, zero=True, span=(0.0, _top(available)),
        curves=[
            Curve(label="pull-out torque", colour="muted", width=2, fill=True, y=available[kept]),
            *planned[0],
            Curve(label="torque needed", colour="speed", width=2, step=True, y=needed[kept]),
        ],
    )  # fmt: skip
    # A margin far from 1 says nothing more than that it is far.
    finite = margin[np.isfinite(margin)]
    top = _top(finite.clip(0, max(2.5 * float(finite.min(initial=np.inf)), 3 * safety)))
    ratio = Panel(
        name="detail-margin", label="margin", height=220, span=(0.0, top), levels=[(1.0, "1: falls behind below")],
        curves=[
            *planned[1],
            Curve(label="pull-out torque / torque needed", colour="drive", width=2, step=True, y=margin[kept]),
        ],
    )  # fmt: skip
    label, sync = "step of the move, counted from its start [step]", {"sync": "torque"}
    above, below = (line_chart(panel, kept + 1.0, label) | sync for panel in (torque, ratio))
    return [above | {"foot": False}, below]


def _top(values: Numbers) -> float:
    """Upper end of an axis from 0, with room for a name above the curve."""
    return round(1.15 * float(values.max(initial=1e-3)), 3)


def _rotor_figures(shown: ShownMotion, trace: Trace | None) -> list[Figure]:
    motion, tolerance = shown.motion, shown.spec.controller.tolerance
    rows = stretch(trace, of(motion.name, NEEDED_ROTOR), motion.move.begin, motion.move.ready)
    if rows is None:
        return []
    events = motion_events(shown)
    followed = (
        "Nothing measures the rotor of a stepper; the simulation does. It swings after the field, which jumps by a "
        f"step at every pulse. Look for: a lag well below {number(PULL_OUT_LAG)} steps, from where on the field pulls "
        "the rotor the wrong way and steps are lost four at a time."
    )
    rest = (
        "The end of the same move, magnified. Green is the time that the host waits for the swing to die away. Look "
        f"for: the line within ±{tolerance:g} steps (dashed) long before that time is over."
    )
    charts = _rotor_charts(shown, rows, events)
    return [
        Figure(title="How the rotor followed", caption=followed, charts=charts, events=events),
        Figure(title="Coming to rest", caption=rest, charts=_rest_charts(shown, rows, tolerance)),
    ]


def _rotor_charts(shown: ShownMotion, rows: Stretch, events: Sequence[Event]) -> list[Chart]:
    table = shown.table
    period, direction, velocity, rotor_lag = (rows[name] for name in of(shown.motion.name, NEEDED_ROTOR))
    rotor_lag = rotor_lag / shown.table.drive.microsteps
    # A step per period, 0 at rest.
    hz = np.divide(shown.spec.controller.timer, period, out=np.zeros(len(period)), where=period > 0)
    speed = units_of(table).speed
    field = table.step * hz * direction * speed.factor
    rotor = velocity * table.mechanics.per_turn / (2 * math.pi) * speed.factor
    unit = "ms" if rows.t[-1] < 1 else "s"
    timeline = Timeline(name="detail", t=rows.t, label="time since the start signal", unit=unit, events=events)
    reach = max(float(np.abs(rotor_lag).max()), PULL_OUT_LAG)
    wrong = "from here on the field pulls the wrong way"
    out_of_step = reach > 5 * PULL_OUT_LAG  # on this scale the bounds are one line
    lag = Curve(label="field less rotor", colour="drive", width=2 if out_of_step else 1, y=rotor_lag, thin=POINTS)
    return time_charts(timeline, [
        Panel(name="detail-speed", label=f"speed [{speed.name}]", height=200, zero=True, curves=[
            Curve(label="rotor", colour="muted", width=1, y=rotor, thin=POINTS),
            Curve(label="field: what is commanded", colour="speed", width=2, step=True, y=field, thin=POINTS),
        ]),
        Panel(name="detail-lag", label="lag [step]", height=220, zero=True, span=(-1.3 * reach, 1.3 * reach),
              levels=[] if out_of_step else [(PULL_OUT_LAG, wrong), (-PULL_OUT_LAG, "")], curves=[lag]),
    ])  # fmt: skip


def _rest_charts(shown: ShownMotion, rows: Stretch, limit: float) -> list[Chart]:
    """How the rotor comes to rest after the last step; one that lost steps comes to none of its own."""
    motion, end = shown.motion, float(rows.t[-1])
    begin = max(motion.seconds - 0.4 * max(end - motion.seconds, 0.01), 0.0)
    part = slice(int(np.searchsorted(rows.t, begin)), None)
    lag = rows[f"{motion.name}.plant.rotor.lag"][part] / shown.table.drive.microsteps
    if motion.motor.lost or len(lag) < 2:
        return []
    reach = max(float(np.abs(lag).max()), limit)
    after = Band(label="last step over: time to settle", colour="good", spans=[(motion.seconds, end)])
    panel = Panel(
        name="rest-lag", label="lag [step]", height=220, zero=True, span=(-1.3 * reach, 1.3 * reach),
        levels=[(limit, f"+{limit:g} steps"), (-limit, f"−{limit:g} steps")],
        curves=[Curve(label="field less rotor", colour="drive", width=2, y=lag, thin=POINTS)],
    )  # fmt: skip
    timeline = Timeline(name="rest", t=rows.t[part], label="time since the start signal", bands=[after])
    return time_charts(timeline, [panel])


def motion_events(shown: ShownMotion) -> list[Event]:
    """What happened in the move, in order of time since the start signal."""
    asked, motion, legs = shown.asked, shown.motion, shown.legs
    begin, events = motion.move.begin, [Event(motion.seconds, "the last step is over")]
    if isinstance(asked, StageJog):
        events.append(Event(0.0, f"the joystick asks for {speed_text(shown.table, asked.speed)}"))
        events.append(Event(asked.duration, "the joystick is let go"))
    else:
        others = ", ".join(other for other in asked.motors if other != motion.name)
        events.append(Event(0.0, "start signal" + (f", at the same time for {others}" if others else "")))
        if change := asked.change:
            made, way = legs[0].made, legs[0].direction
            at, to = (way_text(shown.table, place) for place in (change.at, change.to))
            text = f"at {at} the stop is changed to {to}"
            passed = np.flatnonzero((made.position - shown.table.step_at(change.at)) * way >= 0)
            events += [Event(float(made.t[first]) - begin, text) for first in passed[:1]]
    for leg in legs[1:]:
        text = f"turns, {'up' if leg.direction > 0 else 'down'} from here"
        events.append(Event(float(leg.made.t[0]) - begin, text))
    settled, tolerance = motion.motor.settled, shown.spec.controller.tolerance
    if abs(motion.motor.rest_lag) <= tolerance and settled > begin:
        events.append(Event(settled - begin, f"the rotor is within ±{stated(tolerance)} steps of its place for good"))
    done = "the time to settle is over: the host takes the move for done"
    return sorted([*events, Event(motion.move.ready - begin, done)], key=lambda event: event.t)
