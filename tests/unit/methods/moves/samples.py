"""Made-up runs of moves, a method that shows little of itself, and a trace: small enough to know every number."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from detent.methods.moves.job import Move, MoveJob
from detent.methods.moves.page import POSITION, TARGET, VELOCITY, ShownMove, true_speed
from detent.methods.moves.run import MoveRecord, MoveRun
from detent.page.chart import Band, Curve, Panel
from detent.page.figure import Figure
from detent.page.run_page import Stretch
from detent.page.words import CountUnit
from detent.record.trace import Trace

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


class View:
    """A method with one word, which speaks when it is asked to."""

    plant = ""
    spec = SimpleNamespace(axis=SimpleNamespace(name="wire & pulley"))
    unit = CountUnit(STEP, "step")
    max_speed = 0.35
    signals = ("word",)
    captions = ("Look at the whole.", "Look at its end.")

    def panels(self, shown: ShownMove) -> list[Panel]:
        return [Panel(name="move-speed", label="speed [mm/s]", curves=[true_speed(shown)])]

    def bands(self, shown: ShownMove) -> list[Band]:
        return [Band(label="late", colour="good", spans=[(0.08, float(shown.rows.t[-1]))])]

    def words(self, rows: Stretch) -> list[Curve]:
        return [Curve(label="word", colour="drive", y=rows["word"])]

    def events(self, shown: ShownMove) -> dict[str, float]:
        ready = shown.move.ready - shown.move.begin
        return {"ready": ready, "set <strobe>": 0.0, "mode switch": 0.08, "never": float("nan")}

    def text_figure(self, run: MoveRun) -> Figure | None:
        return Figure(title="The text", paper={"pages": [{}], "of": [move.label for move in run.moves]})


def six_moves(**changes: object) -> MoveRun:
    """To and fro between 0 and 10 mm; errors of 2 µm, alternating, + first."""
    ends = [0.01 * (n % 2) for n in range(1, 7)]
    records = [record(n, 0.01 - end, end, error=-((-1) ** n) * 2e-6) for n, end in enumerate(ends, 1)]
    return run_of(*records, **changes)


def trace_of(run: MoveRun, *, until: float | None = None) -> Trace:
    """Rows of 1 ms: each move arrives within 80 ms and stands where its record says."""
    t = np.arange(run.time_ready, until or run.time_end, 1e-3)
    position, target = np.zeros(len(t)), np.zeros(len(t))
    for move in run.moves:
        now = (t >= move.begin - 1e-9) & (t < move.end - 1e-9)
        ends = [move.begin, move.begin + 0.07, move.begin + 0.08]
        places = [move.start, move.target - 0.01 * (move.target - move.start), move.target - move.error]
        position[now], target[now] = np.interp(t[now], ends, places), move.target
    velocity = np.gradient(position, t)
    return Trace(columns={"t": t, POSITION: position, VELOCITY: velocity, TARGET: target, "word": np.round(velocity)})
