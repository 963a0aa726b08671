"""Made-up sequences of a rotary table, and the report of one: small enough to know every number."""

import math
from dataclasses import replace

import numpy as np

from detent.methods.rotary_table.comparison import AngleComparison, Crossing, Feed, Start
from detent.methods.rotary_table.page_data import (
    SequenceFigures,
    Signal,
    StepResult,
    TablePath,
    TableReportData,
    TurnDetail,
    WorstStep,
)
from detent.methods.rotary_table.run import SequenceRun, StepRecord
from detent.methods.rotary_table.sequence_job import SequenceJob, Wait
from detent.page.parts import Event, Note

COUNT = math.radians(0.001)
"""A count of the made-up table [rad]."""


def deg(value: float) -> float:
    return math.radians(value)


def record(number: int, kind: str = "go", start: float = 0.0, stop: float = 90.0, **changes: object) -> StepRecord:
    """A step of 2 s, the first from 0.5 s on; angles in degrees; 0.5 counts beyond its target, 1 deg of deviation."""
    begin = 2.0 * (number - 1) + 0.5
    moves = kind in {"go", "jog"}
    step = StepRecord(
        number=number, index=number - 1, kind=kind, text=f"{kind} <{number}>", begin=begin, end=begin + 2.0,
        start=deg(start), stop=deg(stop), target=deg(stop) - 0.5 * COUNT if moves else math.nan,
        error=-0.5 * COUNT if moves else math.nan, travel=deg(stop - start), peak_speed=deg(60), peak_deviation=deg(1),
        crossings=0, rollovers=0,
    )  # fmt: skip
    return replace(step, **changes)


def run_of(*records: StepRecord, asked: int | None = None, **changes: object) -> SequenceRun:
    """Those steps of a sequence of `asked`, done unless it asks for more."""
    steps = tuple(Wait(duration=1.0, row=n) for n in range(1, (asked or len(records)) + 1))
    run = SequenceRun(
        SequenceJob("shop.toml", steps), done=len(records) == len(steps), time_ready=0.5,
        time_end=records[-1].end if records else 0.5, steps=list(records), count=COUNT, in_position=2 * COUNT,
        travel=sum(abs(step.travel) for step in records), crossings=sum(step.crossings for step in records),
        rollovers=sum(step.rollovers for step in records),
    )  # fmt: skip
    for name, value in changes.items():
        setattr(run, name, value)
    return run


def result(number: int, kind: str = "go", start: float = 0.0, stop: float = 90.0, **changes: object) -> StepResult:
    """A step of 2 s, the first from 0 s on; angles in degrees; 0.5 counts beyond its target."""
    step = StepResult(
        number=number, kind=kind, text=f"{kind} <{number}>", begin=2.0 * (number - 1), seconds=2.0, start=deg(start),
        stop=deg(stop), offset=0.5 * COUNT if kind in {"go", "jog"} else math.nan, peak_speed=deg(60),
        peak_deviation=deg(1), crossings=0, rollovers=0,
    )  # fmt: skip
    return replace(step, **changes)


def turn_detail(**changes: object) -> TurnDetail:
    """A jog at 60 deg/s from 300 deg: it crosses the end at 1 s, rolls over at 6 s; always 2 deg behind."""
    t = np.arange(-0.1, 8.0, 0.02)
    way = np.clip(t, 0, None) * deg(60) + deg(300)
    present = np.where(t < 6.0, way, way - math.tau)
    turns = np.where(t < 1.0, 0, np.where(t < 6.0, 1, np.where(t < 7.0, 0, 1)))
    detail = TurnDetail(
        number=5, kind="jog", text="jog + at <60> deg/s", why="the jog that crosses the end of the turn most often",
        form="turn counter", failed=False, t=t, detected=present - turns * math.tau, present=present,
        command=present + deg(2), target=np.where(t < 0, np.nan, deg(1020)),
        threshold=np.where(t < 0, np.nan, deg(660)), turns=turns, flag=turns, deviation=np.full(len(t), deg(2)),
        speed_signal=np.full(len(t), deg(63)), velocity=np.full(len(t), deg(60)), crossings=2, rollovers=1,
        events=[Event(0.0, "+ <button>"), Event(1.0, "crossed"), Event(6.0, "rollover"), Event(7.0, "crossed")],
    )  # fmt: skip
    return replace(detail, **changes)


def crossing(name: str, after: float, **changes: object) -> Crossing:
    """Ten seconds at 60 deg/s; at 5 s the deviation changes from 2 deg to `after` [deg]."""
    t = np.arange(0, 10.0, 0.01)
    case = Crossing(
        name=name, time=5.0, deviation_before=deg(2), deviation_after=deg(after), travel=deg(600), speed=deg(60), t=t,
        angle=t * deg(60), deviation=np.where(t < 5.0, deg(2), deg(after)), s4=np.full(len(t), deg(60)),
    )  # fmt: skip
    return replace(case, **changes)


def angle_comparison(**changes: object) -> AngleComparison:
    """The flag fails from 1 deg, and nothing else does; without position control 1 deg/s comes out 7 % slow."""
    starts = [
        Start(angle=deg(place), form=form, travel=deg(-30 if thrown else 830), asked=deg(834), thrown_back=thrown)
        for place in (1.0, 100.0)
        for form in ("flag", "turn counter")
        for thrown in [form == "flag" and place == 1.0]
    ]
    found = AngleComparison(
        speed=deg(60), following_error=deg(2),
        crossings=(crossing("conventional", 362, travel=deg(1200), speed=deg(127)), crossing("endless", 2)),
        feeds=(Feed(speed=deg(1), closed=1e-5, opened=-0.07), Feed(speed=deg(60), closed=2e-9, opened=-0.05)),
        starts=tuple(starts),
    )  # fmt: skip
    return replace(found, **changes)


def table_report(**changes: object) -> TableReportData:
    """Five steps in 10 s, all done, with every figure that a report can have."""
    t = np.arange(0, 10.0, 0.01)
    angle = np.interp(t, [0, 2, 8, 10], [0.0, deg(90), deg(90), deg(450)])
    report = TableReportData(
        axis_name="index & mill",
        job_name="shop.toml",
        done=True,
        figures=SequenceFigures(
            asked=5, made=5, positionings=1, jogs=1, seconds=10.0, travel=deg(450), turns=1, crossings=1, rollovers=1,
            error=WorstStep(0.5 * COUNT, 1), deviation=WorstStep(deg(2.17), 5), peak_speed=WorstStep(deg(61.2), 5),
        ),
        count=COUNT,
        in_position=2 * COUNT,
        max_speed=deg(60),
        steps=[
            result(1, text="go to position 1 (90 deg, <shortest>)"),
            result(2, "output", 90, 90, seconds=0.0, text='set "clamp"'),
            result(3, "wait", 90, 90, begin=2.0, seconds=4.0, text="wait 4 s"),
            result(4, "output", 90, 90, begin=6.0, seconds=0.0, text='clear "clamp"'),
            result(5, "jog", 90, 450, begin=6.0, seconds=4.0, text='jog + at 60 deg/s while "feed"',
                   offset=-1.2 * COUNT, peak_deviation=deg(2.17), crossings=1, rollovers=1),
        ],
        outputs=[Signal("clamp", [(2.0, 6.0)])],
        inputs=[Signal("feed", [(8.0, 9.5)])],
        path=TablePath(
            t=t, angle=angle, target=np.where(t < 2, deg(90), np.nan), detected=angle % math.tau,
            velocity=np.gradient(angle, t), velocity_ref=np.where(t < 2, deg(45), 0.0),
        ),
        detail=turn_detail(),
        comparison=angle_comparison(),
        notes=[Note("warning", "signal <late>")],
        settings={"seed": "7"},
    )  # fmt: skip
    return replace(report, **changes)
