"""Made-up sequences of the example's rotary table, and comparisons: small enough to know every number."""

import math
from dataclasses import replace
from functools import cache

import numpy as np

import detent
from detent.methods.load import load_spec
from detent.methods.rotary_table.comparison import AngleComparison, Crossing, Feed, Start
from detent.methods.rotary_table.detail import AHEAD, DETECTED, VELOCITY
from detent.methods.rotary_table.page import COMMANDED, PHASE
from detent.methods.rotary_table.run import SequenceRun, StepRecord
from detent.methods.rotary_table.schema import RotaryTableSpec
from detent.methods.rotary_table.sequence_job import SequenceJob, Wait
from detent.record.trace import Trace

COUNT = math.tau / (90 * 4096)
"""A count of the example's table [rad]."""


@cache
def axis() -> RotaryTableSpec:
    """The example."""
    spec = load_spec(detent.example("rotary_table.toml"))
    assert isinstance(spec, RotaryTableSpec)
    return spec


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


def shop_run(**changes: object) -> SequenceRun:
    """Five steps in 10 s, all done: a positioning, a wait in a clamp, a jog over the end of the turn on a signal."""
    still = {"peak_speed": 0.0, "peak_deviation": 0.0}
    return run_of(
        record(1, text="go to position 1 (90 deg, <shortest>)"),
        record(2, "output", 90, 90, begin=2.5, end=2.5, text='set "clamp"', **still),
        record(3, "wait", 90, 90, begin=2.5, end=6.5, text="wait 4 s", **still),
        record(4, "output", 90, 90, begin=6.5, end=6.5, text='clear "clamp"', **still),
        record(5, "jog", 90, 450, begin=6.5, end=10.5, text='jog + at 60 deg/s while "feed"', error=1.2 * COUNT,
               peak_speed=deg(61.2), peak_deviation=deg(2.17), crossings=1, rollovers=1),
        outputs=[(2.5, "clamp", True), (6.5, "clamp", False)],
        inputs=[(8.5, "feed", True), (10.0, "feed", False)],
        **changes,
    )  # fmt: skip


def shop_trace(seconds: float = 10.0) -> Trace:
    """What was recorded of it, every 10 ms: 90 deg in 2 s, 4 s in the clamp, two more, and a turn in the last 2 s."""
    t = np.arange(0.0, seconds, 0.01)
    turn = np.interp(t, [0, 2, 8, 10], [0.0, 0.25, 0.25, 1.25]) % 1.0
    speed = np.where(t < 2, deg(45), np.where(t < 8, 0.0, deg(180)))
    demanded = np.where(t < 2, round(axis().per_interrupt(deg(45))), 0)
    columns = {PHASE: turn * 2**32, VELOCITY: speed * axis().ratio, DETECTED: np.floor(turn * axis().period),
               AHEAD: np.ones(len(t), dtype=np.int8), COMMANDED: demanded}  # fmt: skip
    return Trace(columns={"t": t + 0.5} | columns)


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
