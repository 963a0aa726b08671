"""From a run of moves and its trace to what the report of a servo axis shows."""

import math
import unicodedata
from dataclasses import dataclass
from typing import Any, TypedDict, Unpack

import numpy as np

from detent.control.phase_sequencer import POSITION_MODE
from detent.methods.filtered_servo.comparison import FeedbackComparison
from detent.methods.filtered_servo.schema import FilteredServoSpec
from detent.methods.moves.page_data import (
    FilteredMove,
    JobPath,
    MovePath,
    MoveResult,
    PhaseMove,
    ServoReportData,
)
from detent.methods.moves.run import MoveRecord, MoveRun
from detent.methods.moves.summary import SOONEST, ServoSpec, arrived, count_unit, interference_text, move_figures
from detent.methods.phase_servo.hold_comparison import HoldComparison
from detent.methods.phase_servo.noise_comparison import NoiseComparison
from detent.methods.phase_servo.schema import PhaseServoSpec
from detent.methods.print_head.page_data import Marks
from detent.page.chart import spans_of
from detent.page.parts import INCH, Event, Note, Numbers
from detent.page.words import count, number
from detent.record.trace import Trace

FEWEST_ROWS = 10
"""Rows of a trace without which a move is not drawn."""

CLOSE = 5
"""The approach begins where this many tolerances are left to the target."""

PAGE_ROWS = 66
"""Lines of text on a page of paper: 11 in of 1/6 in each."""

NEEDED_PATH = ("train.position", "gauge.target")
"""Signals that the figure of the whole job is drawn from."""

NEEDED_PHASE = (
    *NEEDED_PATH, "train.velocity", "sequencer.mode", "sequencer.stop", "law.setpoint", "law.integral", "law.word",
    "speed.word",
)  # fmt: skip
NEEDED_FILTERED = (
    *NEEDED_PATH, "train.velocity", "generator.command", "deviation.deviation", "deviation.word", "speed.word",
    "filter.output", "clock.period",
)  # fmt: skip
"""Signals that one move is drawn from; a trace without them gives a report without that figure."""


class Beside(TypedDict, total=False):
    """What a report shows beside the run.

    Attributes
    ----------
    noise : NoiseComparison, optional
        Phase servo: rest point against spurious pulses, beside the purely incremental servo.
    hold : HoldComparison, optional
        Phase servo: standing still and under load.
    feedback : FeedbackComparison, optional
        Filtered servo: the filter beside its alternatives.
    settings : dict of str to str
        Small print: file, seed.
    """

    noise: NoiseComparison | None
    hold: HoldComparison | None
    feedback: FeedbackComparison | None
    settings: dict[str, str]


def servo_report(spec: ServoSpec, run: MoveRun, trace: Trace | None, **beside: Unpack[Beside]) -> ServoReportData:
    """Everything the report of a run of moves shows.

    Parameters
    ----------
    spec : PhaseServoSpec or FilteredServoSpec
        The axis.
    run : MoveRun
        Its outcome.
    trace : Trace, optional
        What was recorded; figures over time are left out where it lacks their signals.
    **beside : Beside
        Comparisons and small print.

    Returns
    -------
    ServoReportData
    """
    return ServoReportData(
        axis_name=spec.axis.name,
        job_name=run.job.name,
        kind=run.job.kind,
        done=run.done,
        failure=run.failure,
        figures=move_figures(run),
        unit=count_unit(spec),
        tolerance=run.tolerance,
        max_speed=spec.limits.speed,
        moves=[_move_result(run, move) for move in run.moves],
        marks=_marks(spec, run) if run.job.kind == "text" and isinstance(spec, PhaseServoSpec) else Marks(),
        path=_job_path(run, trace),
        detail=_detail(spec, run, trace),
        notes=_notes(run),
        **beside,
    )


def _move_result(run: MoveRun, move: MoveRecord) -> MoveResult:
    return MoveResult(
        number=move.number,
        label=move.label,
        begin=move.begin - run.time_ready,
        start=move.start,
        target=move.target,
        ready=move.ready - move.begin,
        settled=_settled(run, move),
        overshoot=move.overshoot,
        offset=-move.error,
    )


def _settled(run: MoveRun, move: MoveRecord) -> float:
    """Time from the command until within the tolerance for good [s]; NaN for a move that ended outside."""
    return move.move_time if abs(move.error) <= run.tolerance else math.nan


def _notes(run: MoveRun) -> list[Note]:
    notes = [Note("warning", text) for text in run.warnings]
    early = move_figures(run).early
    if early:
        notes.append(
            Note(
                "warning",
                f"move {count(early.move)}: the axis said that it had arrived {number(early.value * 1e3)} ms before it "
                "was within the tolerance for good; what the host does in that time is done beside the target",
            )
        )
    noise = interference_text(run)
    return [*notes, Note("note", f"interference on the pulse lines: {noise}")] if noise else notes


# ---- a text


def _marks(spec: PhaseServoSpec, run: MoveRun) -> Marks:
    """Each character where the carriage stood for it, in pages of `PAGE_ROWS` lines."""
    rows = {move.number: move.row - 1 for move in run.job.moves}
    line = np.array([rows[move.number] for move in run.moves], dtype=int)
    column = np.array([move.target - spec.printing.left_margin for move in run.moves], dtype=float)
    return Marks(
        # One code point each: a letter and its accent become one, or the letter alone.
        characters=[unicodedata.normalize("NFC", move.label)[:1] for move in run.moves],
        page=line // PAGE_ROWS + 1,
        line=line + 1,
        baseline=(line % PAGE_ROWS + 1) * (INCH / 6),
        column=column,
        landed=column - np.array([move.error for move in run.moves], dtype=float),
        width=np.full(len(line), spec.printing.character_pitch),
        direction=np.ones(len(line), dtype=int),
        strikes=np.ones(len(line), dtype=int),
    )


# ---- figures over time


def _has(trace: Trace | None, names: tuple[str, ...]) -> bool:
    return trace is not None and len(trace) > 1 and all(name in trace for name in names)


def _job_path(run: MoveRun, trace: Trace | None) -> JobPath | None:
    if trace is None or not run.moves or not _has(trace, NEEDED_PATH):
        return None
    first = int(np.searchsorted(trace.time, run.time_ready, side="right"))
    if len(trace) - first < FEWEST_ROWS:
        return None
    return JobPath(
        t=trace.time[first:] - run.time_ready,
        position=trace["train.position"][first:],
        target=trace["gauge.target"][first:],
    )


@dataclass(frozen=True, slots=True)
class _Shown:
    """The move that is shown in detail."""

    run: MoveRun
    move: MoveRecord
    why: str
    part: Trace

    @property
    def t(self) -> Numbers:
        """Time of the rows since the command [s]."""
        return self.part.time - self.move.begin

    @property
    def settled(self) -> float:
        """When it was within the tolerance for good [s]; NaN if it was not."""
        return _settled(self.run, self.move)


def _detail(spec: ServoSpec, run: MoveRun, trace: Trace | None) -> PhaseMove | FilteredMove | None:
    """One move, with everything that the control knows of it."""
    needed = NEEDED_PHASE if isinstance(spec, PhaseServoSpec) else NEEDED_FILTERED
    if trace is None or not _has(trace, needed):
        return None
    move, why = _choose(run, trace)
    if move is None:
        return None
    shown = _Shown(run, move, why, trace.between(move.begin, move.end))
    return _phase_move(spec, shown) if isinstance(spec, PhaseServoSpec) else _filtered_move(spec, shown)


def _choose(run: MoveRun, trace: Trace) -> tuple[MoveRecord | None, str]:
    """The most telling of the moves that were recorded whole, and why this one.

    It is the one that failed, else the one that was ready by far too early, else the one of middle length.
    """
    row = float(trace.time[1] - trace.time[0])
    ends = float(trace.time[-1]) + row
    whole = [move for move in run.moves if move.end <= ends and move.end - move.begin > FEWEST_ROWS * row]
    failed = [move for move in whole if not arrived(run, move)]
    if failed:
        return failed[-1], "the move that failed"
    worst = move_figures(run).early
    early = [move for move in whole if worst and move.number == worst.move]
    if early:
        return early[0], "the move that was ready too early"
    went = sorted((move for move in whole if _way(move) > run.tolerance), key=_way)
    return (went[(len(went) - 1) // 2], "the move of middle length") if went else (None, "")


def _way(move: MoveRecord) -> float:
    return abs(move.target - move.start)


def _phase_move(spec: PhaseServoSpec, shown: _Shown) -> PhaseMove:
    part, per_sample = shown.part, spec.step / spec.sample_period
    positioning = part["sequencer.mode"] == POSITION_MODE
    return PhaseMove(
        path=_move_path(
            shown,
            velocity_ref=np.where(positioning, np.nan, part["law.setpoint"] * per_sample),
            drive=part["law.word"],
            events=_events(shown, _phase_texts(spec, shown)),
        ),
        counted_speed=part["speed.word"] * per_sample,
        error_word=np.where(positioning, part["law.setpoint"], np.nan),
        integral=part["law.integral"],
        position_mode=spans_of(shown.t, positioning),
    )


def _phase_texts(spec: PhaseServoSpec, shown: _Shown) -> dict[str, float]:
    move, stopped = shown.move, np.flatnonzero(shown.part["sequencer.stop"])
    ruler = "the absolute word rules" if spec.method.final == "absolute" else "the counted pulses rule"
    within = number(shown.run.tolerance / spec.step)
    return {
        "set strobe: the host gives direction and distance": 0.0,
        f"{count(spec.method.threshold, 'step')} to go: position mode, {ruler}": move.switched - move.begin,
        f"within ±{within} steps of the target for good": shown.settled,
        "ready: the host may act": move.ready - move.begin,
        "stop: dead band and integrator take over": float(shown.t[stopped[0]]) if stopped.size else math.nan,
    }


def _filtered_move(spec: FilteredServoSpec, shown: _Shown) -> FilteredMove:
    part = shown.part
    speed = _command_speed(shown.t, part["generator.command"], part["clock.period"] * 1e-6)
    return FilteredMove(
        path=_move_path(
            shown,
            velocity_ref=speed * spec.pulse,
            drive=part["deviation.word"],
            events=_events(shown, _filtered_texts(spec, shown)),
        ),
        counted_speed=part["speed.word"] * spec.method.scale,
        filtered_speed=part["filter.output"],
        deviation=part["deviation.deviation"],
    )


def _filtered_texts(spec: FilteredServoSpec, shown: _Shown) -> dict[str, float]:
    move, method = shown.move, spec.method
    goal = round((move.target - spec.mechanics.start_position) / spec.pulse)
    at_goal = np.flatnonzero(shown.part["generator.command"] == goal)
    window = f"within ±{count(method.in_position, 'pulse')} for {number(method.in_position_time * 1e3)} ms"
    within = number(shown.run.tolerance / spec.pulse)
    return {
        "the host asks for the move": 0.0,
        "last command pulse": float(shown.t[at_goal[0]]) if at_goal.size else math.nan,
        f"within ±{within} pulses of the target for good": shown.settled,
        f"in position: {window}": move.ready - move.begin,
    }


def _command_speed(t: Numbers, command: Numbers, window: Numbers) -> Numbers:
    """Rate of the command pulses [1/s]: mean over a sample period, between pulses in proportion to time.

    What comes after the last row is unknown, and so is the mean shortly before it: NaN.
    """
    changes = np.concatenate(([0], np.flatnonzero(np.diff(command)) + 1))
    places = command[changes].astype(float)
    half = window / 2
    gained: Any = np.interp(t + half, t[changes], places) - np.interp(t - half, t[changes], places)
    return np.where(t + half <= t[-1], gained / window, np.nan)


def _events(shown: _Shown, texts: dict[str, float]) -> list[Event]:
    """Those that happened, in order of time."""
    run, move = shown.run, shown.move
    lasted = move.end - move.begin
    happened = [Event(t, text) for text, t in texts.items() if 0.0 <= t <= lasted + SOONEST]
    if not arrived(run, move):
        happened.append(Event(lasted, "the run ends here"))
    return sorted(happened, key=lambda event: event.t)


def _move_path(shown: _Shown, *, velocity_ref: Numbers, drive: Numbers, events: list[Event]) -> MovePath:
    move, t, position = shown.move, shown.t, shown.part["train.position"]
    away = np.abs(position - move.target)
    return MovePath(
        number=move.number,
        why=shown.why,
        start=move.start,
        target=move.target,
        t=t,
        position=position,
        velocity=shown.part["train.velocity"],
        velocity_ref=velocity_ref,
        drive=drive,
        events=events,
        # An axis that has given up on its way comes to no rest.
        approach=None if math.isnan(move.ready) else _approach(t, away, shown.run.tolerance, events[-1].t),
        settled=shown.settled,
    )


def _approach(t: Numbers, away: Numbers, tolerance: float, last_event: float) -> tuple[float, float]:
    """Stretch that shows the axis come to rest [s].

    It begins where `CLOSE` tolerances are left, or more if the move ended farther away, and ends shortly after the last
    event.
    """
    close = np.flatnonzero(away <= max(CLOSE * tolerance, 1.5 * float(away[-1])))
    begin = float(t[close[0]])
    return begin, min(last_event + 0.15 * (last_event - begin), float(t[-1]))
