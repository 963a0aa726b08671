"""An endless angle beside a conventional one, on one axis (rotary-table tests 11, 12 and 19).

A conventional unit knows the angle within a turn only: at the boundary its deviation jumps by a turn. Manual feed
without position control crosses the boundary, but does not keep its speed. The flag of the patent extends the angle,
but not in every case. Each of them runs on the axis that is compared; only its method is changed.
"""

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from itertools import groupby
from typing import Any

import numpy as np

from detent.methods.rotary_table.run import finite
from detent.page.chart import Curve, Panel, Timeline, time_charts
from detent.page.figure import Figure
from detent.page.parts import Event, Numbers
from detent.page.table import Cell, Table, TextTable, offset_cell
from detent.page.words import GAP, angle, degrees, number

USED = "turn counter"  # form of the extension that is recommended, and used unless the axis file says otherwise
COARSE = 0.01  # relative error of a mean speed that is marked
LOOKS = (("left", 1.5), ("speed", 2.5))  # colour and width of the curves, in the order of `AngleComparison.crossings`

DEG = 180.0 / math.pi


@dataclass(frozen=True, slots=True, kw_only=True)
class Crossing:
    """One way over the end of the turn."""

    name: str  # "conventional" or "endless"
    time: float  # when the end of the turn was crossed first, since the start [s]; NaN if it was not
    deviation_before: float  # and deviation_after: deviation dR at the interrupts before and after that [rad]
    deviation_after: float  # [rad]
    travel: float  # way at the end [rad]
    speed: float  # speed at the end [rad/s]
    t: Numbers  # time since the start [s]
    # angle, deviation, s4: way of the table [rad], deviation [rad], speed signal as speed of the table [rad/s]
    angle: Numbers
    deviation: Numbers
    s4: Numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class Feed:
    """Manual feed at one speed."""

    speed: float  # of the dial [rad/s]
    closed: float  # and opened: mean speed with and without position control, as a relative error
    opened: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """A jog that starts just after the boundary, with one form of the extension."""

    angle: float  # where it starts [rad]
    form: str  # a key of `comparison_runs.FORMS`
    travel: float  # and asked: way of the table, and of the command, after the same time [rad]
    asked: float  # [rad]
    thrown_back: bool  # the table has lost half a turn or more


@dataclass(frozen=True, slots=True, kw_only=True)
class AngleComparison:
    """Result of `compare_angle`.

    Attributes
    ----------
    speed : float
        Speed of the crossings and of the starts [rad/s].
    following_error : float
        What the table lags by at that speed, v / Kp, more by the drive's droop [rad].
    crossings : tuple of Crossing
        Conventional, endless.
    feeds : tuple of Feed
        Manual feed, by speed.
    starts : tuple of Start
        By angle, then by form.
    """

    speed: float
    following_error: float
    crossings: tuple[Crossing, Crossing]
    feeds: tuple[Feed, ...]
    starts: tuple[Start, ...]

    @property
    def by_place(self) -> dict[float, dict[str, Start]]:
        """Starts by angle [rad], then by form."""
        places = groupby(self.starts, key=lambda start: start.angle)
        return {place: {start.form: start for start in starts} for place, starts in places}

    @property
    def table(self) -> TextTable:
        """The method beside what it betters, for the terminal."""
        conventional, endless = self.crossings
        both = (endless, conventional)
        changes = (f"{degrees(case.deviation_before)} to {degrees(case.deviation_after)} deg" for case in both)
        ways = (f"{degrees(case.travel)} deg, at {degrees(case.speed)} deg/s" for case in both)
        rows = [("deviation across the end of the turn", *changes), (f"way after {number(endless.t[-1])} s", *ways)]
        for feed in self.feeds:
            dial = f"mean speed of manual feed at {math.degrees(feed.speed):.4g} deg/s"
            rows.append((dial, _share(feed.closed), _share(feed.opened)))
        for place, starts in self.by_place.items():
            others = "; ".join(f"{form} {_start(start)}" for form, start in starts.items() if form != USED)
            rows.append((f"jog from {math.degrees(place):.3f} deg", _start(starts[USED]), others))
        title = f"Endless angle at {degrees(self.speed)} deg/s, beside its alternatives"
        heads = ("", "turn counter, position control", "raw angle; no position control; other forms")
        return TextTable(title, heads, rows)

    def figures(self) -> tuple[Figure, ...]:
        """Across the end of the turn, manual feed, and starts near the boundary."""
        return _crossing_figure(self), _feed_figure(self), _start_figure(self)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``--json``: everything but the curves; null for what is not a finite number."""
        names = ("name", "time", "deviation_before", "deviation_after", "travel", "speed")
        return {
            "speed": self.speed,
            "following_error": self.following_error,
            "crossings": [{name: finite(getattr(case, name)) for name in names} for case in self.crossings],
            "feeds": [{key: finite(value) for key, value in asdict(feed).items()} for feed in self.feeds],
            "starts": [asdict(start) for start in self.starts],
        }


# ---- on the page


def _crossing_figure(found: AngleComparison) -> Figure:
    conventional, endless = found.crossings
    caption = (
        f"Both start at 100 deg and run at {degrees(found.speed)} deg/s. The conventional unit has a target beyond the "
        "end of the turn and reads its angle as it comes; this method jogs. Look for: the lag at the mark. A unit that "
        f"believes the table a whole turn back drives it on as fast as it can: after {number(endless.t[-1])}{GAP}s it "
        f"has turned {degrees(conventional.travel)} deg, and still runs at {degrees(conventional.speed)} deg/s."
    )
    t, events = conventional.t, _events(found)
    ways, lags = _curves(found, lambda case: case.angle), _curves(found, lambda case: case.deviation)
    signals = _curves(found, lambda case: case.s4)
    return Figure(
        title="Across the end of the turn, with an endless angle and without",
        caption=caption,
        charts=time_charts(Timeline(name="cross", t=t, label="time since the start", unit="s", events=events), [
            Panel(name="cross-way", label="way [deg]", height=200, zero=True, curves=ways),
            Panel(name="cross-deviation", label="lag dR [deg]", height=160, zero=True, curves=lags),
            Panel(name="cross-speed", label="S4 [deg/s]", height=160, zero=True, curves=signals),
        ]),
        events=events,
    )  # fmt: skip


def _curves(found: AngleComparison, quantity: Callable[[Crossing], Numbers]) -> list[Curve]:
    """The same quantity [rad, rad/s] of both, at the times of the first."""
    return [
        Curve(label=case.name, colour=colour, width=width, digits=2,
              y=np.interp(found.crossings[0].t, case.t, quantity(case)) * DEG)
        for case, (colour, width) in zip(found.crossings, LOOKS, strict=True)
    ]  # fmt: skip


def _events(found: AngleComparison) -> list[Event]:
    """Moments at which the end of the turn is crossed; both at the same moment are one."""
    texts: dict[float, list[str]] = {}
    for case in found.crossings:
        if not math.isnan(case.time):
            before, after = degrees(case.deviation_before), degrees(case.deviation_after)
            change = f"stays {after}" if before == after else f"goes from {before} to {after}"
            texts.setdefault(case.time, []).append(f"the {case.name} deviation {change}{GAP}deg")
    what = f"the detected angle jumps back by 360{GAP}deg"
    return [Event(moment, f"{what}: {'; '.join(texts[moment])}") for moment in sorted(texts)]


def _feed_figure(found: AngleComparison) -> Figure:
    heads = [("dial [deg/s]", True), ("with position control, speed off by [%]", True), ("without [%]", True)]
    caption = (
        "Manual feed used to run without position control, because the end of the turn stood in its way. Then the "
        "table turns at what the drive makes of the speed signal: a droop, and steps of the speed word that are coarse "
        "at low speed. With the loop closed all the time the mean speed is that of the dial."
    )
    errors = [abs(error) for one in found.feeds for error in (one.closed, one.opened) if not math.isnan(error)]
    longest = 100 * max(errors, default=0.0) or 1.0
    rows = [
        [f"{math.degrees(feed.speed):.4g}",
         *(offset_cell(percent(off), longest, over=abs(off) > COARSE) for off in (feed.closed, feed.opened))]
        for feed in found.feeds
    ]  # fmt: skip
    return Figure(title="Manual feed: mean speed", caption=caption, table=Table(heads=heads, rows=rows))


def _start_figure(found: AngleComparison) -> Figure:
    forms = list(dict.fromkeys(start.form for start in found.starts))
    heads = [("start [deg]", True), ("in lags", True), *((f"{form}, way [deg]", True) for form in forms)]
    caption = (
        "The original form of the method remembers a crossing by one flag, and rolls over when C has gone one turn. "
        f"From a start less than the lag, {angle(found.following_error)}, beyond 0 the table has not crossed the end "
        "of the turn by then: only C goes back, and the table is thrown after it. A guarded flag, which is asked "
        "before the rollover, and a counter of turns, the default, are safe from every start."
    )
    lag = found.following_error or math.nan
    rows = [
        [f"{math.degrees(place):.3f}", f"{place / lag:.2f}", *(_start_cell(starts[form]) for form in forms)]
        for place, starts in found.by_place.items()
    ]
    title = "Jog from just beyond the end of the turn, for two turns and more"
    return Figure(title=title, caption=caption, table=Table(heads=heads, rows=rows))


def _start_cell(start: Start) -> Cell:
    thrown = "thrown back: " if start.thrown_back else ""
    return Cell(text=thrown + degrees(start.travel), over=start.thrown_back)


# ---- in the terminal


def _share(error: float) -> str:
    shown = percent(error)
    return f"{'+' if shown > 0 else ''}{number(shown, 2)} %"


def percent(share: float) -> float:
    """A relative error in percent, to a ten-thousandth: what is less is nothing.

    >>> percent(-0.05014), percent(2e-9)
    (-5.014, 0.0)
    """
    return round(100 * share, 4)


def _start(start: Start) -> str:
    return f"{degrees(start.travel)} deg{' (thrown back)' if start.thrown_back else ''}"
