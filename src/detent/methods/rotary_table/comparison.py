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

from detent.errors import DetentError
from detent.methods.rotary_table.build import start_turns, ticks
from detent.methods.rotary_table.host import TableHost
from detent.methods.rotary_table.schema import DisturbanceTable, PositionTable, RotaryTableSpec
from detent.methods.rotary_table.system import TICK, RotaryTable
from detent.page.chart import Curve, Panel, Timeline, time_charts
from detent.page.figure import Figure
from detent.page.frame import ComparisonOnScreen
from detent.page.parts import Event, Numbers
from detent.page.table import Cell, Table, TextTable, offset_cell
from detent.page.words import GAP, angle, degrees, number
from detent.record.machine import Progress
from detent.record.recorder import Recorder
from detent.units import format_quantity

START = math.radians(100)  # where the crossing begins [rad]
TARGET = math.radians(540)  # target of the conventional unit [rad]: one and a half turns
WATCHED = 2 * math.tau  # way of a jog while the crossing is watched [rad]

FEED_SPEEDS = tuple(math.radians(speed) for speed in (0.1, 1.0, 60.0))  # of manual feed [rad/s], up to the axis's own
FEED_START, FEED_TIME = 2.0, 10.0  # mean speeds are taken from so long after the start on, for at least so long [s]
FEED_COUNTS, FEED_LONGEST = 1000, 1000.0  # and over at least so many counts, though no longer than this [s]
FORWARD = math.radians(840)  # way of a jog that starts near the boundary [rad]: two rollovers
LAGS = (0.0, 0.25, 0.5, 1.0, 1.5)  # where it starts, in following errors: a table that lags more than that fails
FORMS: dict[str, dict[str, object]] = {
    "flag": {"form": "flag", "guarded": False},
    "guarded flag": {"form": "flag", "guarded": True},
    "turn counter": {"form": "turn counter", "guarded": False},
}
"""Forms of the extension, all judged by the theoretical remaining angle (specification 3.2, 3.5; test 12)."""

MOST_ROWS = 400_000
LONGEST_TURN = 3600.0  # a table that takes longer for a turn is not compared: nobody would see it go round [s]

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
    form: str  # a key of `FORMS`
    travel: float  # and asked: way of the table, and of the command, after the same time [rad]
    asked: float  # [rad]
    thrown_back: bool  # the table has lost half a turn or more


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class AngleComparison(ComparisonOnScreen):
    """Result of `compare_angle`."""

    speed: float  #: of the crossings and of the starts [rad/s]
    following_error: float  #: what the table lags by at that speed, v / Kp, more by the drive's droop [rad]
    crossings: tuple[Crossing, Crossing]  #: conventional, endless
    feeds: tuple[Feed, ...]  #: manual feed, by speed
    starts: tuple[Start, ...]  #: by angle, then by form

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
            others = "; ".join(f"{form} {_start_text(start)}" for form, start in starts.items() if form != USED)
            rows.append((f"jog from {math.degrees(place):.3f} deg", _start_text(starts[USED]), others))
        title = f"Endless angle at {degrees(self.speed)} deg/s, compared with the alternatives"
        heads = ("", "turn counter, position control", "raw angle; no position control; other forms")
        return TextTable(title, heads, rows)

    def figures(self) -> tuple[Figure, ...]:
        """Across the end of the turn, manual feed, and starts near the boundary."""
        return _crossing_figure(self), _feed_figure(self), _start_figure(self)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``--json``: everything but the curves."""
        found = asdict(self)
        for case in found["crossings"]:
            for curve in ("t", "angle", "deviation", "s4"):
                del case[curve]
        return found


# ---- runs


def compare_angle(spec: RotaryTableSpec, *, progress: Progress | None = None) -> AngleComparison:
    """Take the axis over the end of its turn, feed it by hand, and start it near the boundary, in every form."""
    speed = crossing_speed(spec)
    if speed < math.tau / LONGEST_TURN:
        least = format_quantity(math.tau / LONGEST_TURN, "rad/s")
        raise DetentError(
            f"compare: got a table that turns at {format_quantity(speed, 'rad/s')}; expected: {least} or more, one "
            "turn per hour; try: raise limits.speed, or limits.acceleration where it stops the table too slowly"
        )
    speeds = sorted({min(wanted, spec.limits.speed) for wanted in FEED_SPEEDS})
    lag = speed / spec.method.position_gain / (1 - spec.drive.droop)
    places = sorted({*(share * lag for share in LAGS), spec.count, START})
    starts = [(place, form) for place in places for form in FORMS]
    runs = 2 + len(speeds) + len(starts)
    done = 0

    def told(what: str, result: Any) -> Any:
        """Say that one more run is done, and hand it on."""
        nonlocal done
        done += 1
        if progress is not None:
            progress(done / runs, what)
        return result

    return AngleComparison(
        speed=speed,
        following_error=lag,
        crossings=(
            told("conventional crossing", _cross(spec, speed, endless=False)),
            told("endless crossing", _cross(spec, speed, endless=True)),
        ),
        feeds=tuple(told("manual feed", _feed(spec, wanted)) for wanted in speeds),
        starts=tuple(told(f"start with {form}", _start(spec, speed, place, form)) for place, form in starts),
    )


def crossing_speed(spec: RotaryTableSpec) -> float:
    """Speed of the crossings [rad/s]: the axis's largest from which it stops within a quarter turn."""
    return min(spec.limits.speed, math.sqrt(2 * spec.limits.acceleration * math.tau / 4))


def _variant(spec: RotaryTableSpec, place: float, **changes: object) -> RotaryTableSpec:
    """The axis at a start angle [rad], with the recommended method (specification 3.5) but for the changes."""
    usual: dict[str, object] = {
        "form": "turn counter", "judge": "theoretical", "inclusive": False, "guarded": False, "update": "atomic",
        "signed_remaining": True, "position_control": True,
    }  # fmt: skip
    watches = ("saturation_time", "stuck_time", "overspeed", "jump", "reversed_time", "following_time")
    return spec.changed(
        mechanics={"start_angle": place}, method=usual | changes, disturbance=DisturbanceTable(),
        protection=dict.fromkeys(watches, 0.0),  # an axis that shall be seen to run away
    )  # fmt: skip


_SIGNALS = (
    "plant.train.motor.turns", "plant.train.motor.angle", "plant.train.motor.velocity", "controller.positioner.dr",
    "controller.positioner.s4", "controller.positioner.angle.crossings",
)  # fmt: skip


def _run(spec: RotaryTableSpec, seconds: float, begin: Callable[[TableHost], None]) -> dict[str, Numbers]:
    """Let the host begin something, and time pass; the table may do what it likes.

    Columns by the names of `Crossing`, one value per interrupt or less often, and the speed of the table [rad/s].
    """
    strobes = max(1, math.ceil(seconds / spec.method.strobe_period / MOST_ROWS))
    every = strobes * ticks(spec.method.strobe_period)
    recorder = Recorder(RotaryTable, _SIGNALS, every=every, period=TICK)
    host = TableHost(spec, recorder)
    host.start()
    start = host.tick
    begin(host)
    while host.tick < start + ticks(seconds):
        host.machine.pass_ticks(start + ticks(seconds) - host.tick)
        host.acknowledge()
    host.machine.close()
    trace = recorder.trace()
    turns = trace["plant.train.motor.turns"] - math.floor(start_turns(spec))
    return {
        "t": trace.time - start * TICK,
        "angle": (turns + trace["plant.train.motor.angle"] / math.tau - start_turns(spec) % 1)
        * (math.tau / spec.ratio),
        "speed": trace["plant.train.motor.velocity"] / spec.ratio,
        "deviation": trace["controller.positioner.dr"] * (spec.count / (1 << spec.method.fraction_bits)),
        "s4": trace["controller.positioner.s4"] * spec.speed_per_word,
        "crossings": trace["controller.positioner.angle.crossings"],
    }


def _cross(spec: RotaryTableSpec, speed: float, *, endless: bool) -> Crossing:
    """Over the end of the turn: by a jog, or conventionally by a positioning beyond it."""
    target = PositionTable.model_construct(angle=TARGET, speed=speed, direction="as commanded")
    axis = _variant(spec, START, form="turn counter" if endless else "raw").model_copy(
        update={"position": {"0": target}}
    )
    seconds = WATCHED / speed + speed / spec.limits.acceleration
    seen = _run(axis, seconds, lambda host: host.press(1, speed) if endless else host.begin(0))
    t, deviation = seen["t"], seen["deviation"]
    after = int(np.argmax(seen["crossings"] > 0))
    crossed = bool(seen["crossings"][after]) and after > 0
    return Crossing(
        name="endless" if endless else "conventional",
        time=float(t[after]) if crossed else math.nan,
        deviation_before=float(deviation[after - 1]) if crossed else math.nan,
        deviation_after=float(deviation[after]) if crossed else math.nan,
        travel=float(seen["angle"][-1]),
        speed=float(seen["speed"][-1]),
        **{name: seen[name] for name in ("t", "angle", "deviation", "s4")},
    )


def _feed(spec: RotaryTableSpec, speed: float) -> Feed:
    """Mean speed of a jog with and without position control."""
    span = min(max(FEED_TIME, FEED_COUNTS * spec.count / speed), FEED_LONGEST)
    begin = FEED_START + speed / spec.limits.acceleration
    errors: list[float] = []
    for closed in (True, False):
        seen = _run(_variant(spec, START, position_control=closed), begin + span, lambda host: host.press(1, speed))
        late = seen["t"] >= begin
        errors.append(float(np.polyfit(seen["t"][late], seen["angle"][late], 1)[0]) / speed - 1)
    return Feed(speed=speed, closed=errors[0], opened=errors[1])


def _start(spec: RotaryTableSpec, speed: float, place: float, form: str) -> Start:
    """A jog to larger angles from a place, with one form."""
    ramp = speed / spec.limits.acceleration
    seen = _run(_variant(spec, place, **FORMS[form]), FORWARD / speed, lambda host: host.press(1, speed))
    asked = FORWARD - speed * ramp / 2
    travel = float(seen["angle"][-1])
    return Start(angle=place, form=form, travel=travel, asked=asked, thrown_back=asked - travel > math.tau / 2)


# ---- on the page


def _crossing_figure(found: AngleComparison) -> Figure:
    conventional, endless = found.crossings
    caption = (
        f"Both start at 100 deg and run at {degrees(found.speed)} deg/s. The conventional unit has a target beyond the "
        "end of the turn and uses its angle as it is; this method jogs. Check the lag at the mark. The "
        "conventional unit believes that the table is a whole turn behind and drives it on at full speed: after "
        f"{number(endless.t[-1])}{GAP}s "
        f"it has turned {degrees(conventional.travel)} deg, and is still running at {degrees(conventional.speed)} "
        "deg/s."
    )
    t, events = conventional.t, _events(found)
    ways, lags = _curves(found, lambda case: case.angle), _curves(found, lambda case: case.deviation)
    signals = _curves(found, lambda case: case.s4)
    return Figure(
        title="Across the end of the turn, with and without an endless angle",
        caption=caption,
        charts=time_charts(Timeline(name="cross", t=t, label="time since the start", unit="s", events=events), [
            Panel(name="cross-way", label="distance [deg]", height=200, zero=True, curves=ways),
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
        "Conventional manual feed runs without position control, because of the end of the turn. The table then turns "
        "at whatever speed the drive produces from the speed signal: with droop, and with the coarse steps of "
        "the speed word at low speed. With the loop always closed the mean speed is that of the dial."
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
    heads = [("start [deg]", True), ("in lags", True), *((f"{form}, distance [deg]", True) for form in forms)]
    caption = (
        "The original form of the method stores a crossing in one flag, and rolls over when C has gone one turn. "
        f"From a start less than the lag, {angle(found.following_error)}, beyond 0 the table has not crossed the end "
        "of the turn by then: only C goes back, and the table is thrown after it. A guarded flag, which is asked "
        "before the rollover, and a counter of turns, the default, are safe from every start."
    )
    lag = found.following_error or math.nan
    rows = [
        [f"{math.degrees(place):.3f}", f"{place / lag:.2f}", *(_start_cell(starts[form]) for form in forms)]
        for place, starts in found.by_place.items()
    ]
    title = "Jog from just beyond the end of the turn, for more than two turns"
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


def _start_text(start: Start) -> str:
    return f"{degrees(start.travel)} deg{' (thrown back)' if start.thrown_back else ''}"
