"""A rotary table beside its alternatives: a part of its page, a figure as a file, a table for the terminal."""

import math
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from detent.methods.rotary_table.comparison import AngleComparison, Crossing, Feed, Start
from detent.methods.rotary_table.summary import angle, degrees, percent
from detent.page.chart import Chart, Curve, Panel, Timeline, time_charts
from detent.page.page import ZOOM_HINT, chart_slot, event_table, figure, section
from detent.page.parts import Event, Numbers
from detent.page.plot_looks import ABOVE, BLUE, GREY, INK, ORANGE, POINTS
from detent.page.plots import check_figure_path, new_figure
from detent.page.thin import thin_indices
from detent.page.words import GAP, number, offset_cell, table

# matplotlib's stubs leave every **kwargs untyped, so that strict checking would refuse each call.
Axes = Any

USED = "turn counter"
"""Form of the extension that is recommended, and used unless the axis file says otherwise."""

PLOTTED = ((ORANGE, "angle as it is read"), (BLUE, "turns added"))
"""Colour and how the angle is taken, in the order of `AngleComparison.crossings`."""

COARSE = 0.01
"""Relative error of a mean speed that is marked."""

DEG = 180.0 / math.pi

LOOKS: tuple[tuple[str, str, float], ...] = (("conventional", "left", 1.5), ("endless", "speed", 2.5))
"""Legend, colour and width of the curves, in the order of `AngleComparison.crossings`."""


# ---- on the page


def comparison_charts(found: AngleComparison | None) -> list[Chart]:
    """Draw the crossing of the end of the turn, conventional and endless."""
    if not found:
        return []
    t = found.crossings[0].t
    timeline = Timeline(name="cross", t=t, label="time since the start", unit="s", events=crossing_events(found))
    ways = [(case.t, case.angle) for case in found.crossings]
    deviations = [(case.t, case.deviation) for case in found.crossings]
    signals = [(case.t, case.s4) for case in found.crossings]
    return time_charts(timeline, [
        Panel(name="cross-way", label="way [deg]", height=200, zero=True, curves=_curves(t, ways)),
        Panel(name="cross-deviation", label="lag dR [deg]", height=160, zero=True, curves=_curves(t, deviations)),
        Panel(name="cross-speed", label="S4 [deg/s]", height=160, zero=True, curves=_curves(t, signals)),
    ])  # fmt: skip


def _curves(t: Numbers, cases: list[tuple[Numbers, Numbers]]) -> list[Curve]:
    """The same quantity [rad, rad/s] of both, at the times of the first."""
    return [
        Curve(label=label, colour=colour, width=width, digits=2, y=np.interp(t, times, values) * DEG)
        for (label, colour, width), (times, values) in zip(LOOKS, cases, strict=True)
    ]


def crossing_events(found: AngleComparison) -> list[Event]:
    """Moments at which the end of the turn is crossed."""
    texts: dict[float, list[str]] = {}
    for case in found.crossings:
        if not math.isnan(case.time):
            texts.setdefault(case.time, []).append(_crossing_text(case))
    what = f"the detected angle jumps back by 360{GAP}deg"
    return [Event(moment, f"{what}: {'; '.join(texts[moment])}") for moment in sorted(texts)]


def _crossing_text(case: Crossing) -> str:
    before, after = degrees(case.deviation_before), degrees(case.deviation_after)
    what = f"stays {after}" if before == after else f"goes from {before} to {after}"
    return f"the {case.name} deviation {what}{GAP}deg"


def comparison_section(found: AngleComparison | None) -> str:
    """Figures of the comparison under their title."""
    if not found:
        return ""
    return section(
        "What the method is worth on this axis", _crossing_figure(found), _feed_figure(found), _start_figure(found)
    )


def _crossing_figure(found: AngleComparison) -> str:
    conventional, endless = found.crossings
    caption = (
        f"Both start at 100 deg and run at {degrees(found.speed)} deg/s. The conventional unit has a target beyond the "
        "end of the turn and reads its angle as it comes; this method jogs. Look for: the lag at the mark. A unit that "
        f"believes the table a whole turn back drives it on as fast as it can: after {number(endless.t[-1])}{GAP}s it "
        f"has turned {degrees(conventional.travel)} deg, and still runs at {degrees(conventional.speed)} deg/s."
    )
    content = (
        chart_slot("cross-way", "Way of the table over time, conventional and endless")
        + chart_slot("cross-deviation", "Deviation over time, conventional and endless")
        + chart_slot("cross-speed", "Speed signal over time, conventional and endless")
    )
    after = ZOOM_HINT + event_table(crossing_events(found), "s")
    return figure("Across the end of the turn, with an endless angle and without", caption, content, after)


def _feed_figure(found: AngleComparison) -> str:
    heads = [("dial [deg/s]", True), ("with position control, speed off by [%]", True), ("without [%]", True)]
    caption = (
        "Manual feed used to run without position control, because the end of the turn stood in its way. Then the "
        "table turns at what the drive makes of the speed signal: a droop, and steps of the speed word that are coarse "
        "at low speed. With the loop closed all the time the mean speed is that of the dial."
    )
    return figure("Manual feed: mean speed", caption, table(heads, [_feed_row(feed, found) for feed in found.feeds]))


def _feed_row(feed: Feed, found: AngleComparison) -> list[str]:
    errors = [abs(error) for one in found.feeds for error in (one.closed, one.opened) if not math.isnan(error)]
    longest = 100 * max(errors, default=0.0) or 1.0
    cells = [offset_cell(percent(error), longest, over=abs(error) > COARSE) for error in (feed.closed, feed.opened)]
    return [f"{math.degrees(feed.speed):.4g}", *cells]


def _start_figure(found: AngleComparison) -> str:
    forms = list(dict.fromkeys(start.form for start in found.starts))
    heads = [("start [deg]", True), ("in lags", True), *((f"{form}, way [deg]", True) for form in forms)]
    caption = (
        "The original form of the method remembers a crossing by one flag, and rolls over when C has gone one turn. "
        f"From a start less than the lag, {angle(found.following_error)}, beyond 0 the table has not crossed the end "
        "of the turn by then: only C goes back, and the table is thrown after it. A guarded flag, which is asked "
        "before the rollover, and a counter of turns, the default, are safe from every start."
    )
    places = list(dict.fromkeys(start.angle for start in found.starts))
    rows = [_start_row(found, place, forms) for place in places]
    return figure("Jog from just beyond the end of the turn, for two turns and more", caption, table(heads, rows))


def _start_row(found: AngleComparison, place: float, forms: list[str]) -> list[str]:
    by_form = {start.form: start for start in found.starts if start.angle == place}
    lags = place / found.following_error if found.following_error else math.nan
    return [f"{math.degrees(place):.3f}", f"{lags:.2f}", *(_start_cell(by_form[form]) for form in forms)]


def _start_cell(start: Start) -> str:
    way = escape(degrees(start.travel))
    return f'<td class="n over">thrown back: {way}</td>' if start.thrown_back else way


# ---- as a file


def plot_angle(found: AngleComparison, path: str | Path) -> None:
    """Draw the table across the end of its turn, the accuracy of manual feed, and the starts that throw it back."""
    path = check_figure_path(path)
    with new_figure(path, 10.0, 9.6) as figure:
        areas = figure.subplot_mosaic(
            [["way", "way"], ["lag", "lag"], ["feed", "starts"]], height_ratios=[1.0, 0.8, 1.0], width_ratios=[1, 1.35]
        )
        _draw_crossing(areas["way"], areas["lag"], found)
        _draw_feed(areas["feed"], found)
        _draw_starts(areas["starts"], found)


def _draw_crossing(way: Axes, lag: Axes, found: AngleComparison) -> None:
    way.sharex(lag)
    way.tick_params(labelbottom=False)
    for case, (colour, about) in zip(found.crossings, PLOTTED, strict=True):
        label = f"{case.name}, {about}: {degrees(case.travel)} deg after {number(case.t[-1])} s"
        _draw_curve(way, case.t, case.angle, colour, label)
        _draw_curve(lag, case.t, case.deviation, colour, "")
    crossed = found.crossings[0].time
    for area in (way, lag):
        if not math.isnan(crossed):
            area.axvline(crossed, color=GREY, linewidth=1.1, linestyle="--")
        area.margins(x=0)
    way.set_ylabel("way [deg]")
    way.set_title(f"Across the end of the turn at {degrees(found.speed)} deg/s", pad=24)
    way.legend(**ABOVE, ncols=2)
    changes = "; ".join(f"{case.name} {_change(case)}" for case in found.crossings)
    lag.set_ylabel("lag dR [deg]")
    lag.set_xlabel("time since the start [s]")
    lag.set_title(f"Deviation where the detected angle jumps back: {changes}", fontsize=10)


def _draw_curve(area: Axes, t: Numbers, values: Numbers, colour: str, label: str) -> None:
    kept = thin_indices(values, POINTS)
    area.plot(t[kept], np.degrees(values[kept]), color=colour, linewidth=1.6, label=label or None)


def _draw_feed(area: Axes, found: AngleComparison) -> None:
    places = np.arange(len(found.feeds))
    shown = (
        (0.2, BLUE, "with position control", [percent(feed.closed) for feed in found.feeds]),
        (-0.2, ORANGE, "without", [percent(feed.opened) for feed in found.feeds]),
    )
    for side, colour, label, values in shown:
        drawn = np.nan_to_num(np.array(values))
        bars = area.bar(places - side, drawn, 0.36, color=colour, label=label)
        texts = [f"{'+' if value > 0 else ''}{number(value, 2)}" for value in values]
        area.bar_label(bars, texts, fontsize=8, padding=2)
    area.axhline(0, color=INK, linewidth=0.8)
    area.set_xticks(places, [f"{math.degrees(feed.speed):.4g} deg/s" for feed in found.feeds])
    area.grid(visible=False, axis="x")
    area.tick_params(axis="x", length=0)
    area.margins(y=0.15)
    area.set_ylabel("mean speed off by [%]")
    area.set_title("Manual feed: does the dial's speed come out?", pad=24)
    area.legend(**ABOVE, ncols=2)


def _draw_starts(area: Axes, found: AngleComparison) -> None:
    forms = list(dict.fromkeys(start.form for start in found.starts))
    places = list(dict.fromkeys(start.angle for start in found.starts))
    looks = ((False, BLUE, "o", "goes on"), (True, ORANGE, "X", "thrown back"))
    for thrown, colour, mark, label in looks:
        chosen = [start for start in found.starts if start.thrown_back == thrown]
        x = [places.index(start.angle) for start in chosen]
        y = [forms.index(start.form) for start in chosen]
        area.plot(x, y, mark, color=colour, markersize=9, label=label)
    area.set_xticks(range(len(places)), [f"{round(math.degrees(place), 3):g}" for place in places])
    area.set_yticks(range(len(forms)), forms)
    area.set_ylim(-0.5, len(forms) - 0.5)
    area.set_xlabel(f"jog starts so far beyond the end of the turn [deg]; lag {degrees(found.following_error)} deg")
    area.set_title("Which starts throw the table back?", pad=24)
    area.legend(**ABOVE, ncols=2)


# ---- in the terminal


def angle_table(found: AngleComparison) -> tuple[str, tuple[str, ...], list[tuple[str, ...]]]:
    """The comparison as a table for the terminal."""
    conventional, endless = found.crossings
    rows = [
        ("deviation across the end of the turn", _change(endless), _change(conventional)),
        (f"way after {number(endless.t[-1])} s", _way(endless), _way(conventional)),
    ]
    rows += [
        (f"mean speed of manual feed at {math.degrees(feed.speed):.4g} deg/s", _share(feed.closed), _share(feed.opened))
        for feed in found.feeds
    ]
    for place in dict.fromkeys(start.angle for start in found.starts):
        ways = {start.form: start for start in found.starts if start.angle == place}
        others = "; ".join(f"{form} {_start(start)}" for form, start in ways.items() if form != USED)
        rows.append((f"jog from {math.degrees(place):.3f} deg", _start(ways[USED]), others))
    title = f"Endless angle at {degrees(found.speed)} deg/s, beside its alternatives"
    heads = ("", "turn counter, position control", "raw angle; no position control; other forms")
    return title, heads, [tuple(cell.replace(GAP, " ") for cell in row) for row in rows]


def _change(case: Crossing) -> str:
    return f"{degrees(case.deviation_before)} to {degrees(case.deviation_after)} deg"


def _way(case: Crossing) -> str:
    return f"{degrees(case.travel)} deg, at {degrees(case.speed)} deg/s"


def _share(error: float) -> str:
    shown = percent(error)
    return f"{'+' if shown > 0 else ''}{number(shown, 2)} %"


def _start(start: Start) -> str:
    return f"{degrees(start.travel)} deg{' (thrown back)' if start.thrown_back else ''}"
