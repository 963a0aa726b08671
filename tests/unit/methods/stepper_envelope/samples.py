"""Made-up runs of a stage with two motors, tiles and comparisons: small enough to know every number."""

from dataclasses import replace

import numpy as np

from detent.methods.stepper_envelope.comparison import METHODS, Course, JerkComparison, Profile, StepComparison
from detent.methods.stepper_envelope.run import MotorMove, StageMoveRecord, StageRun
from detent.methods.stepper_envelope.stage_job import StageJob, StageMove
from detent.methods.stepper_envelope.stage_plan import Tile, TilePlan
from detent.page.units import Units

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


# ---- tiles from above


def tile(number: int, x: float, y: float, label: str | None = None, seconds: float = 0.1, **changes: object) -> Tile:
    """A tile that was reached after so many seconds with a lag of 1.02 steps."""
    begin = 0.2 * (number - 1)
    made = motor_move(arrived=begin + seconds, settled=begin, peak_lag=1.02)
    label = str(10 + number) if label is None else label
    move = StageMoveRecord(number, label, begin, begin + 0.15, begin + 0.2, {"x": made})
    return replace(Tile(move, (x, y), (x, y), off=False), **changes)


def tile_plan(**changes: object) -> TilePlan:
    """Two rows of two tiles, 0.4 mm apart across and 0.3 mm up; the first took four times as long as the others."""
    tiles = [
        tile(1, 5 * MM, 7 * MM, seconds=0.4), tile(2, 5.4 * MM, 7 * MM), tile(3, 5.4 * MM, 7.3 * MM),
        tile(4, 5 * MM, 7.3 * MM),
    ]  # fmt: skip
    plan = {"motors": ("x", "y"), "start": (0.0, 0.0), "tiles": tiles, "unit": Units(rotary=False).place}
    return TilePlan(**(plan | changes))


# ---- comparisons


def step_comparison(motor: str = "x", *, zones_lose: int = 0) -> StepComparison:
    """Two ways; the start frequency takes 3 and 9 times as long, the largest one loses 36 and 460 steps."""
    courses = (
        (Course(0.08, 0, 1.0), Course(0.6, 0, 1.0)),
        (Course(0.08, 0, 1.0), Course(0.6, 0, 1.0)),
        (Course(0.08, 0, 1.0), Course(0.55, zones_lose, 1.0)),
        (Course(0.24, 0, 1.0), Course(5.4, 0, 1.0)),
        (Course(0.025, 36, 40.0), Course(0.5, -460, 461.0)),
    )
    return StepComparison(motor, STEP, (100, 2000), dict(zip(METHODS, courses, strict=True)))


def jerk_comparison() -> JerkComparison:
    """40 mm at 20 mm/s: the envelope begins at 2 mm/s and ends after 2.08 s, the profile takes 20 ms more."""
    steps = np.array([0.0, 0.1, 2.0, 2.08])
    smooth = np.array([0.0, 0.1, 2.0, 2.1])
    return JerkComparison(
        motor="x", way=40 * MM, speed=20 * MM, acceleration=0.2, jerk=54.8,
        envelope=Profile(np.repeat(steps, 2)[1:], np.append(np.repeat([2 * MM, 20 * MM, 2 * MM], 2), 0.0)),
        smooth=Profile(smooth, np.array([0.0, 20 * MM, 20 * MM, 0.0])),
    )  # fmt: skip
