"""Runs of a cascade axis made by hand, for the tests of its pages."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from detent.methods.cascade.comparison import FEEDS, SHAPES, ProfileCase, ProfileComparison
from detent.methods.cascade.page import COMMAND, FOLLOWING, LOAD, LOAD_SPEED, REFERENCE, REFERENCE_SPEED
from detent.methods.cascade.replay import Compared, ReplayJob, ReplayRun
from detent.methods.cascade.run import CascadeMove, CascadeRun
from detent.methods.moves.job import Move, MoveJob
from detent.record.trace import Trace

WINDOW = 50e-6


def move(number: int, **changes: Any) -> CascadeMove:
    begin = 0.05 + 1.5 * (number - 1)
    usual: dict[str, Any] = {
        "number": number, "label": "", "begin": begin, "arrived": begin + 1.0, "ready": begin + 1.1,
        "settled": begin + 1.04, "end": begin + 1.5, "start": 0.1 * (number - 1), "target": 0.1 * number,
        "position": 0.1 * number - 8e-6, "overshoot": 2e-6 * number, "peak_speed": 0.25,
        "peak_following": 40e-6 * number, "peak_command": 2.5, "limited": 0.0, "in_position": True,
    }  # fmt: skip
    return CascadeMove(**usual | changes)


def failed_move(number: int) -> CascadeMove:
    end = 0.05 + 1.5 * (number - 1) + 0.4
    return move(
        number, arrived=math.nan, ready=math.nan, settled=math.nan, end=end, position=0.15, peak_following=60e-3,
        peak_command=10.0, limited=0.2, in_position=False,
    )  # fmt: skip


def cascade_run(*moves: CascadeMove, **changes: Any) -> CascadeRun:
    found = moves or (move(1), move(2))
    job = MoveJob("shuttle.csv", "moves", tuple(Move(number=n, row=n, by=0.1) for n in range(1, len(found) + 1)))
    usual: dict[str, Any] = {
        "done": True, "time_ready": 0.05, "time_end": found[-1].end, "moves": list(found), "tolerance": WINDOW,
        "max_command": 10.0,
    }  # fmt: skip
    return CascadeRun(job, **usual | changes)


def failed_run() -> CascadeRun:
    return cascade_run(
        move(1),
        failed_move(2),
        done=False,
        failure="move 2 to <200 mm>: the drive is off",
        time_off=1.95,
        time_end=2.05,
    )


def trace_of(run: CascadeRun, *, row: float = 5e-3) -> Trace:
    """The load 1 mm behind its reference on the way, 40 µm at its end, 4 µm too far from 40 ms after that on."""
    t = np.arange(0.0, run.time_end + row, row)
    reference, off = np.zeros(len(t)), np.zeros(len(t))
    for one in run.moves:
        since = t - one.begin
        reference = np.where(since >= 0.0, np.interp(since, (0.0, 1.0), (one.start, one.target)), reference)
        off = np.select([since < 0.0, since < 1.0, since < 1.04], [off, 1e-3, 40e-6], -4e-6)
    load = reference - off
    columns = {
        "t": t, REFERENCE: reference, REFERENCE_SPEED: np.gradient(reference, t), LOAD: load,
        LOAD_SPEED: np.gradient(load, t), FOLLOWING: off, COMMAND: 2.5 * np.sin(40 * t),
    }  # fmt: skip
    return Trace(columns=columns)


def case(shape: str, feed: str, **changes: Any) -> ProfileCase:
    t = np.linspace(0.0, 1.0, 501)
    scale = 12.5e-3 if feed == FEEDS[0] else 40e-6
    usual: dict[str, Any] = {
        "shape": shape, "feed": feed, "duration": 0.6 if shape == SHAPES[0] else 0.625, "peak_following": scale,
        "approach": 0.12 if feed == FEEDS[0] else 0.0, "twist_after": 4.4e-6, "peak_command": 2.4, "t": t,
        "speed": np.sin(t), "following": scale * np.sin(9 * t), "twist": 3e-6 * np.cos(900 * t),
    }  # fmt: skip
    return ProfileCase(**usual | changes)


def comparison(**changes: Any) -> ProfileComparison:
    cases = tuple(case(shape, feed) for shape in SHAPES for feed in FEEDS)
    usual: dict[str, Any] = {
        "way": 0.25, "speed": 0.5, "acceleration": 5.0, "jerk": 200.0, "stated": True, "frequency": 225.0,
        "tolerance": WINDOW, "rotary": False, "cases": cases,
    }  # fmt: skip
    return ProfileComparison(**usual | changes)


def rigid_comparison() -> ProfileComparison:
    found = comparison(frequency=math.nan, stated=False)
    return replace(found, cases=tuple(replace(one, twist_after=math.nan, twist=0 * one.t) for one in found.cases))


def compared(name: str, unit: str, scale: float, off: float) -> Compared:
    t = np.linspace(0.0, 20.0, 2001)
    measured = scale * np.sin(t)
    return Compared(name=name, unit=unit, measured=measured, simulated=measured - off * np.exp(-((t - 12.0) ** 2)))


def replay_run(**changes: Any) -> ReplayRun:
    t = 5.0 + np.linspace(0.0, 20.0, 2001)
    job = ReplayJob(name="log <1>.csv", t=t, position=0 * t, reference=0 * t, notes=("guessed: <much>",))
    usual: dict[str, Any] = {
        "done": True, "period": 1e-3, "time_end": 20.0, "peak_following": 1e-3,
        "compared": [
            compared("position", "m", 0.1, 20e-6), compared("velocity", "m/s", 0.2, 2e-3),
            compared("acceleration", "m/s^2", 1.0, 0.1), compared("force", "N", 50.0, 5.0),
        ],
    }  # fmt: skip
    return ReplayRun(job, **usual | changes)
