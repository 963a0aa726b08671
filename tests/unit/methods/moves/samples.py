"""Made-up runs of servo axes, and the reports of two of them: small enough to know every number."""

import math
from dataclasses import replace

import numpy as np

from detent.methods.filtered_servo.comparison import FeedbackCase, FeedbackComparison
from detent.methods.moves.job import Move, MoveJob
from detent.methods.moves.page_data import (
    CountUnit,
    FilteredMove,
    JobPath,
    MoveFigures,
    MovePath,
    MoveResult,
    PhaseMove,
    ServoReportData,
    Worst,
)
from detent.methods.moves.run import MoveRecord, MoveRun
from detent.methods.phase_servo.hold_comparison import HoldCase, HoldComparison
from detent.methods.phase_servo.noise_comparison import NoiseComparison
from detent.page.parts import Event, Note

STEP = 10e-6
"""A step of the made-up phase servo [m]."""
TOLERANCE = 2 * STEP


def record(number: int, start: float, target: float, **changes: float | str) -> MoveRecord:
    """A move of 100 ms: mode switch after 80, settled after 82, ready after 83; 5 µm over, 2 µm short at the end."""
    begin = 0.1 * (number - 1) + 0.5
    move = MoveRecord(
        number=number, label="", begin=begin, start=start, target=target, switched=begin + 0.08, ready=begin + 0.083,
        settled=begin + 0.082, end=begin + 0.1, overshoot=5e-6, error=2e-6, peak_speed=0.3,
    )  # fmt: skip
    return replace(move, **changes)


def run_of(*records: MoveRecord, asked: int | None = None, kind: str = "moves", **changes: object) -> MoveRun:
    """Those moves of a job of `asked` moves, done unless it asks for more."""
    moves = tuple(
        Move(number=n, row=n, target=0.01, label="x" if kind == "text" else "")
        for n in range(1, (asked or len(records)) + 1)
    )
    run = MoveRun(
        MoveJob("list.csv", kind, moves), done=len(records) == len(moves), time_ready=0.5,
        time_end=records[-1].end if records else 0.5, moves=list(records), tolerance=TOLERANCE, grid=STEP,
        peak_current=5.987, energy=7.34,
    )  # fmt: skip
    for name, value in changes.items():
        setattr(run, name, value)
    return run


def move_path(**changes: object) -> MovePath:
    """20 mm to the right in 100 ms; from 80 ms on the last 100 µm, beyond the target by 5 µm at the end."""
    t = np.arange(0, 0.1001, 1e-3)
    path = MovePath(
        number=2,
        why="the move of middle length",
        start=0.0,
        target=0.02,
        t=t,
        position=np.interp(t, [0, 0.08, 0.09, 0.1], [0, 0.0199, 0.020005, 0.020005]),
        velocity=np.interp(t, [0, 0.04, 0.08, 0.1], [0, 0.3, 0.04, 0]),
        velocity_ref=np.where(t < 0.08, 0.3, np.nan),
        drive=np.where(t < 0.04, 127, -30),
        events=[Event(0.0, "set <strobe>"), Event(0.08, "mode switch"), Event(0.083, "ready")],
        approach=(0.07, 0.095),
        settled=0.082,
    )
    return replace(path, **changes)


def phase_move(**changes: object) -> PhaseMove:
    path = move_path(**changes)
    return PhaseMove(
        path=path,
        counted_speed=np.round(path.velocity, 2),
        error_word=np.where(path.t < 0.08, np.nan, 3),
        integral=np.where(path.t < 0.09, 0, -6),
        position_mode=[(0.08, 0.1)],
    )


def filtered_move(**changes: object) -> FilteredMove:
    path = move_path(**changes)
    return FilteredMove(
        path=path,
        counted_speed=4 * np.round(path.velocity * 100),
        filtered_speed=path.velocity * 400,
        deviation=np.round(path.velocity * 450),
    )


def noise_comparison() -> NoiseComparison:
    """One step left for every + pulse if only counted; on the target with 8 pulses, a pitch short with 30."""
    pulses = (0, 8, 30)
    counted = np.array(pulses, dtype=float)
    incremental = np.stack([np.stack([-counted, -counted], 1), np.stack([counted, counted], 1)], 1)
    absolute = np.zeros((3, 2, 2))
    absolute[2] = [[-64, 64], [-64, 64]]
    return NoiseComparison(
        pulses=pulses, absolute=absolute, incremental=incremental, step=STEP, counts=64, margin=24, pitches=6
    )


def hold_comparison() -> HoldComparison:
    """It swings by 0.8 steps unless stopped at 41 ms; 3 N from 30 ms on push it 2 steps, the integral pulls back."""
    t = np.arange(0.021, 0.2, 1e-4)
    swing = 0.4 * np.sign(np.sin(2 * np.pi * 100 * t))
    arriving = np.where(t < 0.023, -8.0, 0.0)

    def case(name: str, displacement: np.ndarray, integral: float = 0.0) -> HoldCase:
        return HoldCase(
            name=name, about=f"what is <special> in {name}", t=t, displacement=displacement + arriving,
            integral=np.where(t < 0.05, 0, integral).astype(np.int64), word=np.zeros(len(t), dtype=np.int64),
        )  # fmt: skip

    pushed = np.where(t < 0.03, 0.0, 2.0)
    return HoldComparison(
        still=(case("for ever", swing), case("as is", np.where(t < 0.041, swing, 0.1)), case("D = 0", swing)),
        loaded=(case("with it", np.where(t < 0.05, pushed, 0.7), -6), case("without it", pushed)),
        push=3.0,
        push_at=0.03,
        stop_at=0.041,
        step=STEP,
    )


def feedback_comparison() -> FeedbackComparison:
    """Four cases, the third unstable."""
    t = np.arange(7.8, 8.0, 1e-3)

    def case(name: str, window: float, scale: int, coefficient: float, limit: float, ripple: float) -> FeedbackCase:
        stable = limit > 4000
        return FeedbackCase(
            name=name, sample_period=window, scale=scale, coefficient=coefficient, kv=1 / (scale * window),
            std_speed=ripple, std_error=ripple, force_ripple=2 * ripple, error_range=(-ripple, 2 * ripple),
            stop_overshoot=2.0 if stable else math.nan, stable=stable, gain_limit=limit, gain_margin=limit / 4000,
            t=t, error=ripple * np.sign(np.sin(50 * t)), speed_word=20 + ripple * np.sign(np.sin(50 * t)),
        )  # fmt: skip

    return FeedbackComparison(
        cases=(
            case("<conventional>", 5e-3, 4, 1.0, 16000, 1.8),
            case("with filter", 5e-3, 4, 0.25, 10000, 0.6),
            case("long window", 20e-3, 1, 1.0, 2740, 100.0),
            case("small multiplier", 5e-3, 1, 1.0, 44000, 0.5),
        ),
        rate=1037.0,
        gain=4000.0,
        tau_m=math.inf,
    )


def result(number: int, start: float, target: float, **changes: float | str) -> MoveResult:
    move = MoveResult(
        number=number, label="", begin=0.1 * (number - 1), start=start, target=target, ready=0.083, settled=0.082,
        overshoot=5e-6, offset=-2e-6,
    )  # fmt: skip
    return replace(move, **changes)


def phase_report(**changes: object) -> ServoReportData:
    """Six moves in 0.6 s, all arrived, with every figure that a phase servo can have."""
    t = np.arange(0, 0.6, 1e-3)
    target = np.where(t < 0.3, 0.02, 0.0)
    moves = [result(n, 0.01 * (n % 2), 0.01 * ((n + 1) % 2), offset=(-1) ** n * 2e-6) for n in range(1, 7)]
    report = ServoReportData(
        axis_name="wire & pulley",
        job_name="list.csv",
        kind="moves",
        done=True,
        figures=MoveFigures(
            asked=6, arrived=6, seconds=0.6, rate=10.0, median_time=0.082, worst_time=Worst(0.09, 4),
            median_approach=0.002, worst_approach=Worst(0.01, 4), overshoot=Worst(5e-6, 3), error=Worst(2e-6, 5),
            peak_speed=Worst(0.3456, 6), early=None, early_moves=0,
        ),
        unit=CountUnit(STEP, "step"),
        tolerance=TOLERANCE,
        max_speed=0.35,
        moves=moves,
        path=JobPath(t=t, position=np.clip(target - 1e-6, 0, None), target=target),
        detail=phase_move(),
        noise=noise_comparison(),
        hold=hold_comparison(),
        notes=[Note("note", "interference <3>")],
        settings={"seed": "7"},
    )  # fmt: skip
    return replace(report, **changes)


def filtered_report(**changes: object) -> ServoReportData:
    """The same of a filtered servo."""
    report = phase_report(
        axis_name="slide", unit=CountUnit(5e-6, "pulse"), detail=filtered_move(), noise=None, hold=None,
        feedback=feedback_comparison(),
    )  # fmt: skip
    return replace(report, **changes)
