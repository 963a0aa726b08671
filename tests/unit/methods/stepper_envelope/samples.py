"""Made-up runs of a stage with two motors, x and y, and a report of one: small enough to know every number."""

import math
from dataclasses import replace

import numpy as np

from detent.methods.stepper_envelope.comparison import Course, JerkComparison, Profile, StepComparison
from detent.methods.stepper_envelope.page_data import (
    Arc,
    Envelope,
    MotorPath,
    MotorRuns,
    MoveDetail,
    RotorPath,
    StagePath,
    StageReportData,
    StepTorques,
    Tile,
    TilePlan,
    ZoneSpan,
)
from detent.methods.stepper_envelope.run import MotorMove, StageMoveRecord, StageRun
from detent.methods.stepper_envelope.stage_job import StageJob, StageMove
from detent.methods.stepper_envelope.stage_results import MotionResult, StageFigures, StageMoveResult, WorstMotion
from detent.page.parts import Event, Note

STEP = 5e-6
MM = 1e-3


def motor_move(**changes: float) -> MotorMove:
    """From 0 to 1 mm in 200 steps, which end 0.1 s after power-on; nothing lost."""
    made = MotorMove(
        start=0.0, target=1 * MM, stop=1 * MM, arrived=0.1, settled=0.099, steps=200, missed=0, lost=0, rest_lag=0.05,
        peak_lag=1.0, peak_hz=2000.0, margin=4.0, overrun=False, naive=0.5,
    )  # fmt: skip
    return replace(made, **changes)


def record(number: int, label: str = "", **motors: MotorMove) -> StageMoveRecord:
    """A move of 200 ms that begins where the one before ended."""
    begin = 0.2 * (number - 1)
    moved = {
        name: replace(made, arrived=begin + made.arrived, settled=begin + made.settled) for name, made in motors.items()
    }
    return StageMoveRecord(number, label, begin, begin + 0.15, begin + 0.2, moved)


def run_of(*records: StageMoveRecord, asked: int | None = None, kind: str = "moves", **changes: object) -> StageRun:
    """Those moves of a job of `asked` moves for the motors group_a and group_b."""
    moves = tuple(StageMove(n, n, targets={"group_a": 0.0}) for n in range(1, (asked or len(records)) + 1))
    job = StageJob("list.csv", kind, moves, ("group_a", "group_b"))
    lost = {name: sum(r.motors[name].lost for r in records if name in r.motors) for name in ("group_a", "group_b")}
    run = StageRun(
        job, done=not any(lost.values()), time_end=records[-1].end if records else 0.0, moves=list(records), lost=lost
    )
    for name, value in changes.items():
        setattr(run, name, value)
    return run


# ---- a report


def motion(motor: str = "x", **changes: object) -> MotionResult:
    """1 mm up in 100 ms."""
    made = MotionResult(
        motor=motor, start=0.0, target=1 * MM, stop=1 * MM, seconds=0.1, steps=200, peak_hz=2000.0, lag=1.04,
        margin=2.5, lost=0, off=0, passed=False,
    )  # fmt: skip
    return replace(made, **changes)


def figures(**changes: object) -> StageFigures:
    found = StageFigures(
        asked=2, made=2, placed=2, seconds=0.4, rate=5.0, moving=0.2, naive=1.0, steps=600, lost={"x": 0, "y": 0},
        first_lost=None, lag=WorstMotion(1.04, 1, "x"), rest=WorstMotion(0.05, 2, "y"),
        margin=WorstMotion(2.5, 2, "x"), peak_hz=WorstMotion(2000.0, 1, "x"), peak_speed=WorstMotion(10 * MM, 1, "x"),
    )  # fmt: skip
    return replace(found, **changes)


def envelope() -> Envelope:
    """Up to 4 kHz over 40 mm both ways, at both ends a step of 400 Hz; 1 kHz from 10 to 13 mm upwards."""
    return Envelope(
        position=np.array([0.0, STEP, 10 * MM, 13 * MM, 40 * MM - STEP, 40 * MM]),
        up=np.array([400.0, 4000.0, 1000.0, 4000.0, 400.0, 0.0]),
        down=np.array([400.0, 4000.0, 4000.0, 4000.0, 400.0, 0.0]),
    )


def arc(direction: int = 1, low: float = 0.0, high: float = 30 * MM) -> Arc:
    """From rest over 2 kHz to rest."""
    places = np.array([low, low + STEP / 2, high - STEP / 2, high])
    return Arc(direction=direction, position=places[::direction], hz=np.array([0.0, 2000.0, 2000.0, 0.0]))


def motor_runs(motor: str = "x", **changes: object) -> MotorRuns:
    zones = [ZoneSpan("near", 10 * MM, 13 * MM, 1000.0, "up")]
    runs = MotorRuns(
        motor=motor, step=STEP, travel=(0.0, 40 * MM), max_hz=4000.0, zones=zones, envelope=envelope(),
        arcs=[arc(), arc(-1)], left_out=0,
    )  # fmt: skip
    return replace(runs, **changes)


def torques(**changes: object) -> StepTorques:
    """Three steps; the second has the least margin, the third needs nothing."""
    found = StepTorques(
        hz=np.array([400.0, 4000.0, 400.0]), available=np.array([40e-3, 15e-3, 40e-3]),
        needed=np.array([10e-3, 6e-3, 0.0]), margin=np.array([4.0, 2.5, np.inf]), safety=2.0,
    )  # fmt: skip
    return replace(found, **changes)


def rotor_path(**changes: object) -> RotorPath:
    """150 ms: at 10 mm/s for 100 ms, then at rest; the lag swings by 1 step, then stays 0.05 steps."""
    t = np.arange(0, 0.15, 1e-3)
    path = RotorPath(
        t=t, velocity=np.where(t < 0.1, 9.9e-3, 0.0), velocity_ref=np.where(t < 0.1, 10e-3, 0.0),
        lag=np.where(t < 0.1, np.sin(700 * t), 0.05), tolerance=0.5,
        events=[Event(0.0, "start <signal>"), Event(0.1, "the last step is over")],
    )  # fmt: skip
    return replace(path, **changes)


def detail(**changes: object) -> MoveDetail:
    found = MoveDetail(
        number=2, label="zoom & in", why="the motion with the least torque margin", motion=motion(),
        runs=motor_runs(arcs=[arc()]), torques=torques(), rotor=rotor_path(),
    )  # fmt: skip
    return replace(found, **changes)


def stage_path(seconds: float = 0.4) -> StagePath:
    """x goes 1 mm, and the rotor of y is 4 steps behind its counted position in the end."""
    t = np.arange(0, seconds, 1e-3)
    place = np.interp(t, [0, 0.1], [0, 1 * MM])
    return StagePath(
        t=t,
        motors=[
            MotorPath(motor="x", counted=place, target=np.full(len(t), 1 * MM), rotor=place - STEP, astray=False),
            MotorPath(motor="y", counted=place, target=place + np.nan, rotor=place - 4 * STEP, astray=True),
        ],
    )


def tile(move: int, x: float, y: float, **changes: object) -> Tile:
    found = Tile(
        move=move, label=str(10 + move), target=(x, y), place=(x, y), seconds=0.1, lag=1.02, off=False
    )  # fmt: skip
    return replace(found, **changes)


def tile_plan(**changes: object) -> TilePlan:
    """Two rows of two tiles, 0.4 mm apart across and 0.3 mm up; the first took four times as long as the others."""
    tiles = [
        tile(1, 5 * MM, 7 * MM, seconds=0.4), tile(2, 5.4 * MM, 7 * MM), tile(3, 5.4 * MM, 7.3 * MM),
        tile(4, 5 * MM, 7.3 * MM),
    ]  # fmt: skip
    return replace(TilePlan(motors=("x", "y"), start=(0.0, 0.0), tiles=tiles), **changes)


METHODS = ("envelope", "A: braking distance per step", "B: speed per step", "start frequency", "largest frequency")


def step_comparison(motor: str = "x", *, zones_lose: int = 0) -> StepComparison:
    """Two ways; the start frequency takes 3 and 9 times as long, the largest one loses 36 and 460 steps."""
    courses = (
        (Course(0.08, 0, 1.0), Course(0.6, 0, 1.0)),
        (Course(0.08, 0, 1.0), Course(0.6, 0, 1.0)),
        (Course(0.08, 0, 1.0), Course(0.55, zones_lose, 1.0)),
        (Course(0.24, 0, 1.0), Course(5.4, 0, 1.0)),
        (Course(0.025, 36, 40.0), Course(0.5, -460, 461.0)),
    )
    return StepComparison(motor, STEP, (100, 2000), METHODS, courses)


def jerk_comparison() -> JerkComparison:
    """40 mm at 20 mm/s: the envelope begins at 2 mm/s and ends after 2.08 s, the profile takes 20 ms more."""
    steps = np.array([0.0, 0.1, 2.0, 2.08])
    smooth = np.array([0.0, 0.1, 2.0, 2.1])
    return JerkComparison(
        motor="x", way=40 * MM, speed=20 * MM, acceleration=0.2, jerk=54.8,
        envelope=Profile(steps, steps * 20 * MM, np.array([2 * MM, 20 * MM, 2 * MM, 0.0])),
        smooth=Profile(smooth, smooth * 20 * MM, np.array([0.0, 20 * MM, 20 * MM, 0.0])),
    )  # fmt: skip


def stage_data(**changes: object) -> StageReportData:
    moves = [
        StageMoveResult(
            number=1, label="zoom in", begin=0.0, seconds=0.1, motions=[motion(), motion("y", margin=math.inf)]
        ),
        StageMoveResult(
            number=2, label="wide", begin=0.2, seconds=0.1, motions=[motion(start=1 * MM, target=0.0, stop=0.0)]
        ),
    ]
    data = StageReportData(
        axis_name="micro & scope", job_name="list.csv", kind="moves", done=True, figures=figures(), moves=moves,
        plan=None, path=stage_path(), runs=[motor_runs(), motor_runs("y")], detail=detail(),
        steps=[step_comparison(), step_comparison("y")], jerk=jerk_comparison(),
        notes=[Note("warning", "close <to> it")],
        settings={"seed": "7"},
    )  # fmt: skip
    return replace(data, **changes)


def tiles_data(**changes: object) -> StageReportData:
    moves = [
        StageMoveResult(number=n, label=str(10 + n), begin=0.1 * n, seconds=0.1, motions=[motion()])
        for n in (1, 2, 3, 4)
    ]
    return replace(stage_data(kind="tiles", plan=tile_plan(), moves=moves), **changes)
