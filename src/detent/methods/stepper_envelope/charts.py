"""The charts of a stage's page, as data for the script that draws them."""

from typing import Any

import numpy as np

from detent.methods.stepper_envelope.page_data import (
    MotorPath,
    MotorRuns,
    MoveDetail,
    RotorPath,
    StagePath,
    StepTorques,
    ZoneSpan,
)
from detent.methods.stepper_envelope.summary import PULL_OUT_LAG, stated
from detent.page.chart import Band, Chart, Curve, Panel, Timeline, line_chart, time_charts
from detent.page.loops import Loop, loop_chart
from detent.page.parts import Numbers
from detent.page.thin import thin_indices
from detent.page.words import GAP, count

PATH_SECONDS = 30.0
"""Time that the figure of the whole job shows: more than this is a grey block on any screen."""

MOST_MOTORS = 6
"""Motors that are drawn."""

POINTS = 1500
"""Rows that are chosen for one curve's sake: a page has many of them."""

HEADROOM = 1.25
"""Height of a half of the figure of frequency against position over the motor's limit."""

LONG_NUMBERS = 1e4
"""Limit from which on frequencies are written in kHz [Hz]."""

CROPPED = 0.35
"""Runs that lie within less than this part of the travel are drawn alone, not with all of it."""

MM = 1e3
MILLI = 1e3


# ---- places over time


def path_end(path: StagePath) -> float:
    """Time up to which the job is drawn [s]."""
    return min(float(path.t[-1]), PATH_SECONDS)


def path_charts(path: StagePath) -> list[Chart]:
    """Draw where each motor was, above one another."""
    part = slice(0, int(np.searchsorted(path.t, path_end(path), side="right")))
    timeline = Timeline(name="path", t=path.t[part], label="time since the job began", unit="s")
    panels = [
        Panel(name=f"path-{k}", label=f"{motor.motor} [mm]", height=170, curves=_path_curves(motor, part))
        for k, motor in enumerate(path.motors[:MOST_MOTORS])
    ]
    return time_charts(timeline, panels)


def _path_curves(motor: MotorPath, part: slice) -> list[Curve]:
    counted = motor.counted[part] * MM
    target = Curve(label="target", colour="muted", dash=(6, 4), step=True, y=motor.target[part] * MM, thin=0)
    if motor.rotor is None:
        return [target, Curve(label="counted position", colour="speed", width=2, y=counted, digits=4, thin=POINTS)]
    rotor = Curve(label="true position", colour="speed", width=2, y=motor.rotor[part] * MM, digits=4, thin=POINTS)
    if not motor.astray:
        return [target, rotor]
    return [target, Curve(label="counted position", colour="left", dash=(3, 3), y=counted, digits=4, thin=0), rotor]


# ---- frequency against position


def runs_chart(runs: MotorRuns, name: str, *, height: int = 300) -> Chart:
    """Draw the steps of a motor under its envelope, up above zero and down below it."""
    window = shown_window(runs)
    at, up, down = _cut(runs, window)
    unit, per_hz, digits = ("kHz", 1e-3, 4) if runs.max_hz >= LONG_NUMBERS else ("Hz", 1.0, 1)
    permitted = [
        Curve(label=f"permissible, {word}", colour="muted", step=True, fill=True, y=sign * hz * per_hz, digits=digits)
        for word, sign, hz in (("up", 1, up), ("down", -1, down))
        if hz.any()
    ]
    most, limit = runs.max_hz * per_hz, limit_text(runs)
    panel = Panel(
        name=name, label=f"← down   [{unit}]   up →", height=height, zero=True, span=_halves(most, up, down),
        levels=[(most, limit), (-most, "" if up.any() else limit)], curves=permitted,
    )  # fmt: skip
    loops = [
        Loop(label=f"steps made, {word}", colour=colour, x=arc.position * MM, y=arc.hz * sign * per_hz, digits=digits)
        for word, colour, sign in (("up", "right", 1), ("down", "left", -1))
        for arc in runs.arcs
        if arc.direction == sign
    ]
    chart = loop_chart(panel, at * MM, f"position of {runs.motor} [mm]", loops)
    return chart | {"bands": [_zone_band(runs, zone) for zone in shown_zones(runs)]}


def shown_zones(runs: MotorRuns) -> list[ZoneSpan]:
    """Zones that reach into the part of the travel that is drawn."""
    low, high = shown_window(runs)
    return [zone for zone in runs.zones if zone.begin < high and zone.end > low]


def _halves(most: float, up: Numbers, down: Numbers) -> tuple[float, float]:
    """Ends of the vertical axis; a half in which nothing is permitted has little room."""
    top = HEADROOM * most
    return -round(top if down.any() else 0.1 * top, 3), round(top if up.any() else 0.1 * top, 3)


def limit_text(runs: MotorRuns) -> str:
    """The motor's limit, as frequency and as speed."""
    return f"limit {count(round(runs.max_hz))}{GAP}Hz, {stated(runs.max_hz * runs.step * MM)}{GAP}mm/s"


def shown_window(runs: MotorRuns) -> tuple[float, float]:
    """Part of the travel that is drawn: all of it, or the neighbourhood of the runs if these are short [m]."""
    places = np.concatenate([arc.position for arc in runs.arcs])
    low, high = float(places.min()), float(places.max())
    first, last = runs.travel
    if high - low > CROPPED * (last - first):
        return runs.travel
    room = max(0.12 * (high - low), 10 * runs.step)
    return max(low - room, first), min(high + room, last)


def _cut(runs: MotorRuns, window: tuple[float, float]) -> tuple[Numbers, Numbers, Numbers]:
    """Places and permissible frequencies inside a window, both its ends included."""
    envelope = runs.envelope
    inside = envelope.position[(envelope.position > window[0]) & (envelope.position < window[1])]
    at = np.concatenate(([window[0]], inside, [window[1]]))
    rows = np.searchsorted(envelope.position, at + 0.01 * runs.step, side="right") - 1
    rows = rows.clip(0, len(envelope.position) - 1)
    return at, envelope.up[rows], envelope.down[rows]


def _zone_band(runs: MotorRuns, zone: ZoneSpan) -> Chart:
    only = "" if zone.direction == "both" else f", {zone.direction} only"
    label = f"{zone.name}: {stated(zone.hz * runs.step * MM)} mm/s{only}"
    return {"spans": [[round(zone.begin * MM, 4), round(zone.end * MM, 4)]], "colour": "brake", "label": label}


# ---- one move


def detail_charts(detail: MoveDetail) -> list[Chart]:
    """Draw one motor in one move: frequency against position, torque of every step, and how the rotor followed."""
    charts = [runs_chart(detail.runs, "detail-runs", height=260)]
    if detail.torques:
        charts += _torque_charts(detail.torques)
    if detail.rotor:
        charts += [*_rotor_charts(detail.rotor), *rest_charts(detail)]
    return charts


def _torque_charts(torques: StepTorques) -> list[Chart]:
    margin = np.where(np.isfinite(torques.margin), torques.margin, np.nan)
    kept = np.unique(np.concatenate([thin_indices(y, POINTS) for y in (margin, torques.available, torques.needed)]))
    available, needed = torques.available[kept] * MILLI, torques.needed[kept] * MILLI
    planned: list[list[Curve]] = [[], []]
    if torques.safety > 1:
        look: dict[str, Any] = {
            "label": f"planned with a reserve of {stated(torques.safety)}",
            "colour": "left",
            "dash": (6, 4),
        }
        planned = [[Curve(y=available / torques.safety, **look)], [Curve(y=np.full(len(kept), torques.safety), **look)]]
    torque = Panel(
        name="detail-torque", label="torque [mN·m]", height=200, zero=True, span=(0.0, _top(torques.available * MILLI)),
        curves=[
            Curve(label="pull-out torque", colour="muted", width=2, fill=True, y=available),
            *planned[0],
            Curve(label="torque needed", colour="speed", width=2, step=True, y=needed),
        ],
    )  # fmt: skip
    # A margin far from 1 says nothing more than that it is far.
    finite = torques.margin[np.isfinite(torques.margin)]
    top = _top(finite.clip(0, max(2.5 * float(finite.min(initial=np.inf)), 3 * torques.safety)))
    ratio = Panel(
        name="detail-margin", label="margin", height=220, span=(0.0, top), levels=[(1.0, "1: falls behind below")],
        curves=[
            *planned[1],
            Curve(label="pull-out torque / torque needed", colour="drive", width=2, step=True, y=margin[kept]),
        ],
    )  # fmt: skip
    sync = {"sync": "torque"}
    label = "step of the move, counted from its start [step]"
    return [
        line_chart(torque, kept + 1.0, label) | sync | {"foot": False},
        line_chart(ratio, kept + 1.0, label) | sync,
    ]


def _top(values: Numbers) -> float:
    """Upper end of an axis from 0, with room for a name above the curve."""
    return round(1.15 * float(values.max(initial=1e-3)), 3)


def _rotor_charts(rotor: RotorPath) -> list[Chart]:
    unit = "ms" if rotor.t[-1] < 1 else "s"
    timeline = Timeline(name="detail", t=rotor.t, label="time since the start signal", unit=unit, events=rotor.events)
    reach = max(float(np.abs(rotor.lag).max()), PULL_OUT_LAG)
    wrong = "from here on the field pulls the wrong way"
    out_of_step = reach > 5 * PULL_OUT_LAG  # on this scale the bounds are one line
    lag = Curve(label="field less rotor", colour="drive", width=2 if out_of_step else 1, y=rotor.lag, thin=POINTS)
    return time_charts(timeline, [
        Panel(name="detail-speed", label="speed [mm/s]", height=200, zero=True, curves=[
            Curve(label="rotor", colour="muted", width=1, y=rotor.velocity * MM, thin=POINTS),
            Curve(label="field: what is commanded", colour="speed", width=2, step=True, y=rotor.velocity_ref * MM,
                  thin=POINTS),
        ]),
        Panel(name="detail-lag", label="lag [step]", height=220, zero=True, span=(-1.3 * reach, 1.3 * reach),
              levels=[] if out_of_step else [(PULL_OUT_LAG, wrong), (-PULL_OUT_LAG, "")], curves=[lag]),
    ])  # fmt: skip


def rest_charts(detail: MoveDetail) -> list[Chart]:
    """Draw how the rotor comes to rest after the last step."""
    rotor = detail.rotor
    if rotor is None or detail.motion.lost:
        return []
    end = float(rotor.t[-1])
    begin = max(detail.motion.seconds - 0.4 * max(end - detail.motion.seconds, 0.01), 0.0)
    part = slice(int(np.searchsorted(rotor.t, begin)), None)
    lag, limit = rotor.lag[part], rotor.tolerance
    if len(lag) < 2:
        return []
    reach = max(float(np.abs(lag).max()), limit)
    after = Band(label="last step over: time to settle", colour="good", spans=[(detail.motion.seconds, end)])
    panel = Panel(
        name="rest-lag", label="lag [step]", height=220, zero=True, span=(-1.3 * reach, 1.3 * reach),
        levels=[(limit, f"+{limit:g} steps"), (-limit, f"−{limit:g} steps")],
        curves=[Curve(label="field less rotor", colour="drive", width=2, y=lag, thin=POINTS)],
    )  # fmt: skip
    return time_charts(
        Timeline(name="rest", t=rotor.t[part], label="time since the start signal", bands=[after]), [panel]
    )
