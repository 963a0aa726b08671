"""The charts of a rotary table's page, as data for the script that draws them."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from detent.methods.rotary_table.page_data import Signal, StepResult, TablePath, TableReportData, TurnDetail
from detent.page.chart import Band, Chart, Curve, Panel, Timeline, spans_of, time_charts
from detent.page.lanes import Bar, Lane, lane_chart
from detent.page.parts import Numbers

LINE_SECONDS = 120.0
"""Time that the time line shows: more than this is a grey block on any screen."""

MOST_SIGNALS = 12
"""Inputs and outputs that the time line shows."""

POINTS = 1500
"""Rows that are chosen for one curve's sake: the time line is drawn in four plot areas."""

KINDS = (("go", "go to", "right"), ("jog", "jog", "left"), ("wait", "wait", "muted"))
"""Kinds of steps that last, their lanes and colours; an output is switched in no time."""

LINE = "line"
"""Name of the time line: its plot areas share their cursor."""

DEG = 180.0 / math.pi


# ---- time line


def line_end(data: TableReportData) -> float:
    """Time up to which the time line is drawn [s]: no farther than what was recorded."""
    recorded = float(data.path.t[-1]) if data.path else math.inf
    return min(data.figures.seconds, recorded, LINE_SECONDS)


def left_out_signals(data: TableReportData) -> int:
    """Signals that the time line has no room for."""
    return max(len(data.outputs) + len(data.inputs) - MOST_SIGNALS, 0)


def line_charts(data: TableReportData) -> list[Chart]:
    """Draw what the sequence did when: its steps and signals as bars, angle and speed of the table below."""
    end = line_end(data)
    lanes = [*_step_lanes(data.steps), *_signal_lanes(data)]
    label = "time since the sequence began [s]"
    if not data.path:
        return [lane_chart("line-steps", lanes, (0.0, end), label)]
    begin = float(data.path.t[0])
    steps = lane_chart("line-steps", lanes, (begin, end), label, sync=LINE)
    return [steps, *_path_charts(data.path, end, label.removesuffix(" [s]"))]


def _step_lanes(steps: Sequence[StepResult]) -> list[Lane]:
    lanes = [
        Lane(label, colour, [_step_bar(step) for step in steps if step.kind == kind]) for kind, label, colour in KINDS
    ]
    return [lane for lane in lanes if lane.bars]


def _step_bar(step: StepResult) -> Bar:
    # What the name of the lane says already is left out: "go to position 2 (180 deg, positive)" -> "2".
    short = step.text.removeprefix("go to position ").removeprefix("jog ").removeprefix("wait ")
    short = short.partition(" ")[0] if step.kind == "go" else short
    return Bar(step.begin, step.end, short, f"step {step.number}: {step.text}")


def _signal_lanes(data: TableReportData) -> list[Lane]:
    signals = [("out", "good", signal) for signal in data.outputs] + [("in", "drive", signal) for signal in data.inputs]
    return [
        Lane(f"{way} {signal.name}", colour, _signal_bars(way, signal))
        for way, colour, signal in signals[:MOST_SIGNALS]
    ]


def _signal_bars(way: str, signal: Signal) -> list[Bar]:
    return [Bar(begin, end, "on", f"{way}put {signal.name} is on") for begin, end in signal.spans]


def _path_charts(path: TablePath, end: float, label: str) -> list[Chart]:
    part = slice(0, int(np.searchsorted(path.t, end, side="right")))
    timeline = Timeline(name=LINE, t=path.t[part], label=label, unit="s")
    turns = [
        Curve(label="target of a positioning", colour="left", dash=(6, 4), y=path.target[part] / math.tau, thin=0),
        Curve(label="true angle", colour="speed", width=2, y=path.angle[part] / math.tau, digits=5, thin=POINTS),
    ]
    detected = Curve(label="detected angle D", colour="ink", y=path.detected[part] * DEG, digits=2, thin=POINTS)
    speeds = [
        Curve(label="commanded", colour="left", dash=(6, 4), y=path.velocity_ref[part] * DEG, digits=2, thin=POINTS),
        Curve(label="true speed", colour="speed", width=2, y=path.velocity[part] * DEG, digits=2, thin=POINTS),
    ]
    return time_charts(timeline, [
        Panel(name="line-turns", label="table [turn]", height=200, zero=True, curves=turns),
        Panel(name="line-detected", label="D [deg]", height=150, span=(0.0, 360.0), curves=[detected]),
        Panel(name="line-speed", label="speed [deg/s]", height=180, zero=True, curves=speeds),
    ])  # fmt: skip


# ---- one step


def turn_charts(detail: TurnDetail) -> list[Chart]:
    """Draw the angles that the positioner reckons with in one step."""
    added = Band(label="", colour="good", spans=spans_of(detail.t, detail.present != detail.detected))
    timeline = Timeline(name="turn", t=detail.t, label=_since(detail), unit="s", bands=[added], events=detail.events)
    return time_charts(timeline, [
        Panel(name="turn-angles", label="angle [deg]", height=340, zero=True, curves=_angles(detail)),
        Panel(name="turn-count", label="turns added", height=110, zero=True, curves=_counters(detail)),
        Panel(name="turn-deviation", label="lag dR [deg]", height=150, zero=True, curves=[_deviation(detail)]),
        Panel(name="turn-speed", label="speed [deg/s]", height=160, zero=True, curves=_speeds(detail)),
    ])  # fmt: skip


def _since(detail: TurnDetail) -> str:
    return "time since the button was seen" if detail.kind == "jog" else "time since the position was taken"


def _angles(detail: TurnDetail) -> list[Curve]:
    def curve(label: str, colour: str, y: Numbers, **look: Any) -> Curve:
        return Curve(label=label, colour=colour, y=y * DEG, digits=2, thin=POINTS, **look)

    shown = [
        curve("M target", "ink", detail.target, dash=(2, 3), step=True),
        curve("M \u2212 one turn: rollover", "muted", detail.threshold, dash=(8, 4), step=True),
        curve("D detected", "muted", detail.detected, width=2),
        curve("R present", "speed", detail.present, width=2.5),
        curve("C commanded", "left", detail.command, dash=(6, 4)),
    ]
    return [one for one in shown if not np.isnan(one.y).all()]


def _counters(detail: TurnDetail) -> list[Curve]:
    return [
        Curve(label="turns n", colour="speed", width=2.5, step=True, y=detail.turns, digits=0),
        Curve(label="FLG", colour="left", dash=(6, 4), step=True, y=detail.flag, digits=0),
    ]


def _deviation(detail: TurnDetail) -> Curve:
    return Curve(label="deviation dR: how far the table lags", colour="drive", width=2, y=detail.deviation * DEG)


def _speeds(detail: TurnDetail) -> list[Curve]:
    return [
        Curve(
            label="speed signal S4, as told to the drive",
            colour="left",
            step=True,
            y=detail.speed_signal * DEG,
            digits=2,
            thin=POINTS,
        ),
        Curve(label="true speed", colour="speed", width=2, y=detail.velocity * DEG, digits=2, thin=POINTS),
    ]
