"""From the run of a stepper stage and its trace to what the report shows."""

from typing import TypedDict, Unpack

import numpy as np

from detent.methods.stepper_envelope.comparison import JerkComparison, StepComparison
from detent.methods.stepper_envelope.page_data import MotorPath, MotorRuns, StagePath, StageReportData, Tile, TilePlan
from detent.methods.stepper_envelope.run import MotorMove, StageMoveRecord, StageRun
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec
from detent.methods.stepper_envelope.stage_detail import move_detail
from detent.methods.stepper_envelope.stage_job import StageJog
from detent.methods.stepper_envelope.stage_results import MotionResult, StageMoveResult
from detent.methods.stepper_envelope.stage_trace import (
    MadeSteps,
    arc_of,
    has,
    legs_of,
    made_steps,
    motor_runs,
    travel_envelope,
)
from detent.methods.stepper_envelope.summary import stage_figures, stated
from detent.page.parts import Note, Numbers
from detent.page.words import GAP, count
from detent.record.trace import Trace

FEWEST_ROWS = 10
"""Rows of a trace without which nothing is drawn over time."""

ARC_POINTS = 4000
"""Points of all runs of one motor in the figure of frequency against position."""

MOST_ARCS = 400
"""Moves of one motor in that figure: more lie on one another."""

NEEDED_PATH = ("rule.position",)
"""Registers that the place of a motor is drawn from."""


class Beside(TypedDict, total=False):
    """What a report shows beside the run."""

    steps: tuple[StepComparison, ...]  # each motor beside recomputation at every step, and beside constant frequencies
    jerk: JerkComparison | None  # one motor beside a profile of limited jerk
    settings: dict[str, str]  # small print: file, command


def stage_report(
    spec: StepperEnvelopeSpec, run: StageRun, trace: Trace | None, **beside: Unpack[Beside]
) -> StageReportData:
    """Everything the report of a job on a stage shows."""
    moves = move_results(run)
    if trace is not None and len(trace) < FEWEST_ROWS:
        trace = None
    steps = _all_steps(spec, run, trace)
    return StageReportData(
        axis_name=spec.axis.name,
        job_name=run.job.name,
        kind=run.job.kind,
        done=run.done,
        failure=run.failure,
        figures=stage_figures(spec, run),
        moves=moves,
        plan=_plan(spec, run, moves),
        path=_path(spec, run, trace),
        runs=[_runs(spec, run, name, made) for name, made in steps.items()],
        detail=move_detail(spec, run, trace, steps, moves) if trace is not None else None,
        notes=_notes(run),
        **beside,
    )


# ---- figures of every move


def move_results(run: StageRun) -> list[StageMoveResult]:
    """How each move went."""
    lost = dict.fromkeys(run.lost, 0)
    found: list[StageMoveResult] = []
    for move in run.moves:
        motions: list[MotionResult] = []
        for name, motor in move.motors.items():
            lost[name] = lost.get(name, 0) + motor.lost
            motions.append(_motion(move, name, motor, lost[name] + motor.missed))
        found.append(
            StageMoveResult(
                number=move.number, label=move.label, begin=move.begin - run.time_ready, seconds=move.seconds,
                motions=motions,
            )
        )  # fmt: skip
    return found


def _motion(move: StageMoveRecord, name: str, motor: MotorMove, off: int) -> MotionResult:
    return MotionResult(
        motor=name,
        start=motor.start,
        target=motor.target,
        stop=motor.stop,
        seconds=motor.arrived - move.begin,
        steps=motor.steps,
        peak_hz=motor.peak_hz,
        lag=motor.peak_lag,
        margin=motor.margin,
        lost=motor.lost,
        off=off,
        passed=motor.overrun,
    )


def _notes(run: StageRun) -> list[Note]:
    notes = [Note("warning", text) for text in run.warnings]
    for move, name, motor in run.made:
        if motor.overrun:
            notes.append(
                Note(
                    "warning",
                    f"move {count(move.number)}: the stop of {name} was changed to {_mm(motor.target)} when the motor "
                    "was too fast to stop there; it stopped as soon as it could and came back",
                )
            )
    if run.job.notes:
        notes.append(Note("note", f"how {run.job.name} was read: {'; '.join(run.job.notes)}"))
    return notes


def _mm(length: float) -> str:
    return f"{stated(length * 1e3)}{GAP}mm"


# ---- tiles from above


def _plan(spec: StepperEnvelopeSpec, run: StageRun, moves: list[StageMoveResult]) -> TilePlan | None:
    """Tiles of a list that names two motors; the first of the axis file goes to the right, the second up."""
    motors = [name for name in spec.stepper if name in run.job.motors]
    if run.job.kind != "tiles" or len(motors) != 2 or not moves:
        return None
    across, up = motors
    start = {name: spec.stepper[name].mechanics.start_position for name in motors}
    target, off = dict(start), dict.fromkeys(motors, 0)
    tiles: list[Tile] = []
    for move in moves:
        for motion in move.motions:
            target[motion.motor], off[motion.motor] = motion.target, motion.off
        place = {name: target[name] - off[name] * spec.stepper[name].step for name in motors}
        tiles.append(
            Tile(
                move=move.number, label=move.label, target=(target[across], target[up]),
                place=(place[across], place[up]), seconds=move.seconds,
                lag=max((motion.lag for motion in move.motions), default=0.0), off=any(off.values()),
            )
        )  # fmt: skip
    return TilePlan(motors=(across, up), start=(start[across], start[up]), tiles=tiles)


# ---- places over time


def _path(spec: StepperEnvelopeSpec, run: StageRun, trace: Trace | None) -> StagePath | None:
    if trace is None:
        return None
    first = int(np.searchsorted(trace.time, run.time_ready, side="right"))
    moved = {name for _, name, _ in run.made}
    names = [name for name in spec.stepper if name in moved and has(trace, name, NEEDED_PATH)]
    if not names or len(trace) - first < FEWEST_ROWS:
        return None
    return StagePath(
        t=trace.time[first:] - run.time_ready, motors=[_motor_path(spec, run, trace, name, first) for name in names]
    )


def _motor_path(spec: StepperEnvelopeSpec, run: StageRun, trace: Trace, name: str, first: int) -> MotorPath:
    table = spec.stepper[name]
    counted = trace[f"{name}.rule.position"][first:]
    lower, step = table.mechanics.lower_end, table.step
    rotor = None
    if has(trace, name, ("rotor.lag",)):
        # The field is where the steps are counted: the rotor lags behind it.
        rotor = lower + (counted - trace[f"{name}.rotor.lag"][first:]) * step
    return MotorPath(
        motor=name,
        counted=lower + counted * step,
        target=_targets(run, name, table.mechanics.start_position, trace.time[first:]),
        rotor=rotor,
        astray=any(motor.lost for _, who, motor in run.made if who == name),
    )


def _targets(run: StageRun, name: str, start: float, t: Numbers) -> Numbers:
    """Where a motor had to go at each moment; a manual run has no target."""
    manual = {move.number for move in run.job.moves if isinstance(move, StageJog)}
    moments, targets = [-np.inf], [start]
    for move in run.moves:
        if name in move.motors:
            motor = move.motors[name]
            if move.number in manual:
                moments.append(move.begin)
                targets.append(np.nan)
            moments.append(motor.arrived if move.number in manual else move.begin)
            targets.append(motor.target)
    return np.array(targets)[np.searchsorted(moments, t, side="right") - 1]


# ---- frequency against position


def _all_steps(spec: StepperEnvelopeSpec, run: StageRun, trace: Trace | None) -> dict[str, MadeSteps]:
    """Recorded steps of each motor that made some."""
    if trace is None:
        return {}
    moved = {name for _, name, _ in run.made}
    found = {name: made_steps(trace, name, spec.controller.timer) for name in spec.stepper if name in moved}
    return {name: made for name, made in found.items() if made is not None and len(made.t)}


def _runs(spec: StepperEnvelopeSpec, run: StageRun, name: str, made: MadeSteps) -> MotorRuns:
    table = spec.stepper[name]
    motions = [(move, motor) for move, who, motor in run.made if who == name]
    whole = [(move, motor) for move, motor in motions if motor.arrived <= made.t[-1] + 1 / made.hz[-1]][:MOST_ARCS]
    points = max(ARC_POINTS // max(len(whole), 1), 12)
    legs = [leg for move, motor in whole for leg in legs_of(made, table, move, motor)]
    arcs = [arc_of(leg, table, points) for leg in legs]
    return motor_runs(name, table, travel_envelope(table), arcs, left_out=len(motions) - len(whole))
