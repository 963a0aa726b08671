"""The charts of a cascade axis's pages, as data for the script that draws them."""

import math

import numpy as np

from detent.methods.cascade.comparison import ProfileCase, ProfileComparison
from detent.methods.cascade.page_data import CascadeDetail, CascadeReportData
from detent.methods.cascade.replay import Compared, ReplayRun
from detent.methods.cascade.report import REST_WINDOWS
from detent.methods.cascade.units import Scale, Units
from detent.page.chart import Chart, Curve, Panel, Timeline, time_charts
from detent.page.parts import Event, Numbers

POINTS = 1500
"""Rows that are chosen for one curve's sake: plot areas stand above one another."""

COMMAND_UNIT = "V"

ZOOM_SHARE, ZOOM_LEAST = 0.04, 0.4
"""Part of a recording that is shown around its largest difference, and the shortest such stretch [s]."""

WINDOW_SHARE = 0.02
"""Windows and limits narrower than this share of the curves would only blacken the line at zero."""


def error_panel(
    name: str, label: str, curve: tuple[str, str, Numbers], units: Units, levels: tuple[tuple[float, str], ...] = ()
) -> Panel:
    """Draw an error [m] in a unit that suits it, with levels on both sides that are of its size."""
    text, colour, values = curve
    peak = float(np.nanmax(np.abs(values), initial=0.0))
    scale = units.small(peak)
    shown = [(value, word) for value, word in levels if WINDOW_SHARE * peak < value < 2 * peak]
    marks = [mark for value, word in shown for mark in both_sides(value * scale.factor, word)]
    drawn = Curve(label=text, colour=colour, y=values * scale.factor, width=1.5, thin=POINTS)
    return Panel(name=name, label=f"{label} [{scale.name}]", height=170, zero=True, curves=[drawn], levels=marks)


def both_sides(value: float, word: str) -> list[tuple[float, str]]:
    """Levels at a magnitude, the upper one named."""
    return [(value, word), (-value, "")]


def command_panel(name: str, command: Numbers, limit: float) -> Panel:
    """Draw the command with its limit, where it comes near it."""
    near = float(np.abs(command).max(initial=0.0)) > 0.5 * limit
    levels, span = (both_sides(limit, "limit"), (-1.5 * limit, 1.5 * limit)) if near else ([], None)
    curve = Curve(label="command", colour="drive", step=True, y=command, thin=POINTS)
    label = f"command [{COMMAND_UNIT}]"
    return Panel(name=name, label=label, height=150, zero=True, curves=[curve], levels=levels, span=span)


def pair_panel(name: str, label: str, scale: Scale, curves: tuple[tuple[str, Numbers], tuple[str, Numbers]]) -> Panel:
    """Draw what was asked or measured, dashed over what the axis did."""
    (asked, wanted), (did, came) = curves
    return Panel(
        name=name,
        label=f"{label} [{scale.name}]",
        height=220,
        zero=True,
        curves=[
            Curve(label=did, colour="speed", width=2.5, y=came * scale.factor, thin=POINTS),
            Curve(label=asked, colour="left", width=1.5, dash=(5, 4), y=wanted * scale.factor, thin=POINTS),
        ],
    )


# ---- runs of moves


def job_charts(data: CascadeReportData) -> list[Chart]:
    """Draw the whole job: position, following error, command."""
    path = data.path
    if path is None:
        return []
    timeline = Timeline(name="job", t=path.t, label="time since the axis was ready", unit="s")
    following = ("reference less measured position", "current", path.following)
    return time_charts(timeline, [
        pair_panel("job-position", "position", data.units.place, (("reference", path.reference), ("load", path.load))),
        error_panel("job-following", "following error", following, data.units,
                    ((data.following_limit, "the drive goes off"), (data.run.tolerance, "in position"))),
        command_panel("job-command", path.command, data.run.max_command),
    ])  # fmt: skip


def detail_charts(data: CascadeReportData) -> list[Chart]:
    """Draw one move: position, velocity, following error, command; then how the load comes to rest."""
    detail = data.detail
    if detail is None:
        return []
    path, units = detail.path, data.units
    timeline = Timeline(name="move", t=path.t, label="time since the move began", events=detail.events)
    positions = (("reference", path.reference), ("load", path.load))
    speeds = (("reference", path.velocity_ref), ("load", path.velocity))
    following = ("reference less measured position", "current", path.following)
    charts = time_charts(timeline, [
        pair_panel("move-position", "position", units.place, positions),
        pair_panel("move-speed", "velocity", units.speed, speeds),
        error_panel("move-following", "following error", following, units,
                    ((data.following_limit, "the drive goes off"), (data.run.tolerance, "in position"))),
        command_panel("move-command", path.command, data.run.max_command),
    ])  # fmt: skip
    return charts + _rest_charts(data, detail)


def _rest_charts(data: CascadeReportData, detail: CascadeDetail) -> list[Chart]:
    if detail.rest is None:
        return []
    kept = (detail.path.t >= detail.rest[0]) & (detail.path.t <= detail.rest[1])
    if np.count_nonzero(kept) < 3:
        return []
    path, window = detail.path, data.run.tolerance
    off = [np.where(kept, one - detail.target, np.nan)[kept] for one in (path.load, path.reference)]
    scale = data.units.small(min(float(np.abs(off[0]).max()), 20 * window))
    reach = REST_WINDOWS * window * scale.factor
    panel = Panel(
        name="move-rest",
        label=f"off the target [{scale.name}]",
        height=220,
        zero=True,
        span=(-reach, reach),
        curves=[
            Curve(label="load", colour="speed", width=2.5, y=off[0] * scale.factor, thin=POINTS),
            Curve(label="reference", colour="left", dash=(5, 4), y=off[1] * scale.factor, thin=POINTS),
        ],
        levels=both_sides(window * scale.factor, "in position"),
    )
    events = rest_events(detail)
    label = "time since the move began"
    return time_charts(Timeline(name="rest", t=path.t[kept], label=label, events=events), [panel])


def rest_events(detail: CascadeDetail) -> list[Event]:
    """What happens while the load comes to rest."""
    begin, end = detail.rest or (math.inf, math.inf)
    return [event for event in detail.events if begin <= event.t <= end]


# ---- comparison of profiles

LOOKS = (("left", (5, 4)), ("left", None), ("speed", (5, 4)), ("speed", None))
"""Colour and dash of the cases, in their order."""


def profile_charts(found: ProfileComparison) -> list[Chart]:
    """Draw the speed of both references, the following error of the four cases, and the twist after the end."""
    units = Units(rotary=found.rotary)
    t = found.cases[-1].t
    timeline = Timeline(name="profiles", t=t, label="time since the move began")
    speeds = [
        Curve(label=case.shape, colour=colour, width=2, y=_at(t, case, case.speed) * units.speed.factor, thin=POINTS)
        for case, colour in ((found.cases[0], "left"), (found.cases[2], "speed"))
    ]
    charts = time_charts(timeline, [
        Panel(name="profile-speed", label=f"speed [{units.speed.name}]", height=150, zero=True, curves=speeds),
        _case_panel("profile-following", "following error", t, units,
                    [(case, case.following) for case in found.cases]),
    ])  # fmt: skip
    return charts + ([] if math.isnan(found.frequency) else [_twist_chart(found, units)])


def _case_panel(name: str, label: str, t: Numbers, units: Units, curves: list[tuple[ProfileCase, Numbers]]) -> Panel:
    peak = max(float(np.abs(values).max(initial=0.0)) for _, values in curves)
    scale = units.small(peak)
    return Panel(
        name=name,
        label=f"{label} [{scale.name}]",
        height=200,
        zero=True,
        curves=[
            Curve(
                label=case.name, colour=look[0], dash=look[1], width=1.8, y=_at(t, case, y) * scale.factor, thin=POINTS
            )
            for (case, y), look in zip(curves, LOOKS, strict=True)
        ],
    )


def _twist_chart(found: ProfileComparison, units: Units) -> Chart:
    """Twist of the coupling, each case from the end of its own reference on."""
    longest = min(float(case.t[-1]) - case.duration for case in found.cases)
    shown = min(longest, 10 / found.frequency)
    t = np.linspace(0.0, shown, 1200)
    moved = [(case, np.interp(t + case.duration, case.t, case.twist)) for case in found.cases]
    peak = max(float(np.abs(values).max()) for _, values in moved)
    scale = units.small(peak)
    curves = [
        Curve(label=case.name, colour=look[0], dash=look[1], width=1.8, y=values * scale.factor, digits=4, thin=POINTS)
        for (case, values), look in zip(moved, LOOKS, strict=True)
    ]
    panel = Panel(name="profile-twist", label=f"twist [{scale.name}]", height=200, zero=True, curves=curves)
    return time_charts(Timeline(name="twist", t=t, label="time since the reference ended"), [panel])[0]


def _at(t: Numbers, case: ProfileCase, values: Numbers) -> Numbers:
    """Values of a case at other times."""
    return np.interp(t, case.t, values)


# ---- replays


def scale_of(one: Compared, units: Units) -> Scale:
    """Unit in which a signal is drawn."""
    scales = {"m": units.place, "rad": units.place, "m/s": units.speed, "rad/s": units.speed}
    if one.unit == "rad/s^2":
        return Scale(180 / math.pi, "deg/s²")
    return scales.get(one.unit) or Scale(1.0, one.unit.replace("^2", "²").replace("*", " "))


def shown_signals(run: ReplayRun) -> list[Compared]:
    """Signals that are drawn: all but the acceleration, which is noise to the eye."""
    return [one for one in run.compared if one.name != "acceleration"]


def replay_charts(run: ReplayRun, units: Units) -> list[Chart]:
    """Draw recording and simulation above one another, and the difference of the positions; whole and magnified."""
    if not run.compared:
        return []
    t = run.job.t - run.job.t[0]
    whole = _replay_part("whole", run, units, t, np.ones(len(t), dtype=bool))
    begin, end = magnified(run)
    near = (t >= begin) & (t <= end)
    if near.all() or np.count_nonzero(near) < 3:
        return whole
    return whole + _replay_part("near", run, units, t, near)


def magnified(run: ReplayRun) -> tuple[float, float]:
    """Stretch around the largest difference of the positions [s]."""
    t = run.job.t - run.job.t[0]
    half = 0.5 * max(ZOOM_LEAST, ZOOM_SHARE * float(t[-1]))
    at = float(t[int(np.argmax(np.abs(run.compared[0].difference)))])
    begin = min(max(at - half, 0.0), max(float(t[-1]) - 2 * half, 0.0))
    return begin, begin + 2 * half


def _replay_part(name: str, run: ReplayRun, units: Units, t: Numbers, kept: Numbers) -> list[Chart]:
    panels: list[Panel] = []
    for index, one in enumerate(shown_signals(run)):
        curves = (("recorded", one.measured[kept]), ("simulated", one.simulated[kept]))
        panels.append(pair_panel(f"{name}-{index}", one.name, scale_of(one, units), curves))
        if one.unit in {"m", "rad"}:
            difference = ("recorded less simulated", "current", one.difference[kept])
            panels.append(error_panel(f"{name}-{index}-off", "difference", difference, units))
    label = "time since the recording began"
    return time_charts(Timeline(name=name, t=t[kept], label=label, unit="s"), panels)
