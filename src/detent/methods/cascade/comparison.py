"""One move of a cascade axis in four variants: trapezoid or jerk-limited, with and without feedforward.

A loop without feedforward moves only as far as its error tells it to: the axis lags in proportion to the speed. A
trapezoid demands a jump of the force, which makes a compliant coupling swing; a ramp of the force as long as one swing
hardly does.
"""

import math
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

import numpy as np

from detent.methods.cascade.build import motion_limits
from detent.methods.cascade.host import CascadeHost
from detent.methods.cascade.page import POINTS
from detent.methods.cascade.schema import CascadeSpec, DisturbanceTable
from detent.methods.cascade.units import milliseconds
from detent.methods.moves.run import time_to_settle
from detent.page.chart import Curve, Panel, Timeline, time_charts
from detent.page.figure import Figure
from detent.page.frame import ComparisonOnScreen
from detent.page.table import Cell, Table, TextTable
from detent.page.units import Units
from detent.page.words import GAP, number
from detent.planning.profile import MotionLimits, Numbers, plan_move
from detent.record.machine import Progress
from detent.sensing.gauge import set_gauge

WATCHED_TIME, SWINGS = 0.5, 4  # how long it is watched after the reference has ended, at least: time [s], swings
REST_TIME = 0.1  # time the axis stands before the move [s]
SHOWN_SWINGS = 10  # swings of the coupling that are shown after the end of the reference

SHAPES, FEEDS = ("trapezoid", "jerk-limited"), ("no feedforward", "feedforward")

COLOURS = dict(zip(SHAPES, ("left", "speed"), strict=True))
DASHES = dict(zip(FEEDS, ((5, 4), None), strict=True))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ProfileCase:
    """The move made in one way; lengths [m] or angles [rad]."""

    shape: str  #: one of `SHAPES`
    feed: str  #: one of `FEEDS`
    duration: float  #: of the reference [s]
    peak_following: float  #: largest magnitude of the following error
    approach: float  #: from the end of the reference until the load stayed within the window [s]; NaN if it did not
    twist_after: float  #: twist of the coupling after that end, peak to peak; NaN for a rigid axis
    peak_command: float  #: largest magnitude of the command [V]
    t: Numbers  #: time since the begin of the move, at every sample [s], shape (n,)
    speed: Numbers  #: of the reference [m/s], shape (n,)
    following: Numbers  #: following error, shape (n,)
    twist: Numbers  #: how far the motor is ahead of the load, shape (n,)

    @property
    def name(self) -> str:
        """Both in one."""
        return f"{self.shape}, {self.feed}"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True, repr=False)
class ProfileComparison(ComparisonOnScreen):
    """Result of `compare_profiles`."""

    way: float  #: of the move [m] or [rad]
    speed: float  #: limit of its speed
    acceleration: float  #: limit of its acceleration
    jerk: float  #: limit of its jerk
    stated: bool  #: the jerk is that of the axis file; else the one that `smooth_jerk` proposes
    frequency: float  #: of the load against a motor that is held [Hz]; NaN for a rigid axis
    tolerance: float  #: in-position window
    rotary: bool  #: lengths are angles
    cases: tuple[ProfileCase, ...]  #: by shape, then by feedforward

    @property
    def units(self) -> Units:
        """In which its quantities are written."""
        return Units(rotary=self.rotary)

    @property
    def move(self) -> str:
        """The move in words."""
        scale = self.units.place
        way = f"{number(round(self.way * scale.factor, 6))}{GAP}{scale.name}"
        return f"A move of {way} at {self.units.speed_text(self.speed)}"

    @property
    def table(self) -> TextTable:
        """The figures of the four cases."""
        heads = ("profile", "takes", "largest following error", "final approach", "residual twist", "peak command")
        rows = [
            (
                case.name,
                milliseconds(case.duration),
                self.units.error(case.peak_following),
                "not" if math.isnan(case.approach) else milliseconds(case.approach),
                "rigid" if math.isnan(case.twist_after) else self.units.error(case.twist_after),
                f"{number(case.peak_command)} V",
            )
            for case in self.cases
        ]
        title = f"{self.move}, in four variants".replace(GAP, " ")
        return TextTable(title, heads, [tuple(cell.replace(GAP, " ") for cell in row) for row in rows])

    def figures(self) -> tuple[Figure, ...]:
        """Speed and following error, the twist of a compliant coupling, and a table."""
        swinging = () if math.isnan(self.frequency) else (_twist_figure(self),)
        return (_move_figure(self), *swinging, _table_figure(self))

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``--json``: everything but the curves."""
        cases = [{k: v for k, v in asdict(case).items() if not isinstance(v, np.ndarray)} for case in self.cases]
        return {field.name: getattr(self, field.name) for field in fields(self)} | {"cases": cases}


# ---- what is shown


def _move_figure(found: ProfileComparison) -> Figure:
    """Speed of both references, and the following error of the four cases."""
    jerk = "the jerk of the axis file" if found.stated else "a default jerk, as the axis file states none"
    caption = (
        f"{found.move} in four variants: with a trapezoidal velocity profile and with {jerk}, each without feedforward "
        "(dashed) and with it. Without feedforward the following error is proportional to speed, whatever the "
        "profile; with it an error remains where the acceleration steps."
    )
    t, scale = found.cases[-1].t, found.units.speed
    asked = {case.shape: np.interp(t, case.t, case.speed) * scale.factor for case in found.cases}
    speeds = [Curve(label=shape, colour=COLOURS[shape], width=2, y=asked[shape], thin=POINTS) for shape in SHAPES]
    speed = Panel(name="profile-speed", label=f"speed [{scale.name}]", height=150, zero=True, curves=speeds)
    following = [np.interp(t, case.t, case.following) for case in found.cases]
    lag = _case_panel(found, "profile-following", "following error", following)
    title = "Effect of profile and feedforward: the same move in four variants"
    charts = time_charts(Timeline(name="profiles", t=t, label="time since the move began"), [speed, lag])
    return Figure(title=title, caption=caption, charts=charts)


def _twist_figure(found: ProfileComparison) -> Figure:
    """Twist of the coupling, each case from the end of its own reference on."""
    caption = (
        f"Twist of the coupling after the reference has ended. With the motor held by its loop the load oscillates "
        f"at {number(found.frequency)}{GAP}Hz. Compare the oscillation left by a step in acceleration, and how a "
        "ramp about one period long reduces it. Without feedforward (dashed) the axis is still braking when its "
        "reference ends."
    )
    longest = min(float(case.t[-1]) - case.duration for case in found.cases)
    t = np.linspace(0.0, min(longest, SHOWN_SWINGS / found.frequency), 1200)
    twists = [np.interp(t + case.duration, case.t, case.twist) for case in found.cases]
    panel = _case_panel(found, "profile-twist", "twist", twists)
    charts = time_charts(Timeline(name="twist", t=t, label="time since the reference ended"), [panel])
    return Figure(title="Residual vibration", caption=caption, charts=charts)


def _case_panel(found: ProfileComparison, name: str, label: str, values: list[Numbers]) -> Panel:
    """One curve [m] for each case: colour by profile, dashes without feedforward."""
    scale = found.units.small(max(float(np.abs(one).max(initial=0.0)) for one in values))
    curves = [
        Curve(label=case.name, colour=COLOURS[case.shape], dash=DASHES[case.feed], width=1.8, y=one * scale.factor,
              digits=4, thin=POINTS)
        for case, one in zip(found.cases, values, strict=True)
    ]  # fmt: skip
    return Panel(name=name, label=f"{label} [{scale.name}]", height=200, zero=True, curves=curves)


def _table_figure(found: ProfileComparison) -> Figure:
    longest = max(case.peak_following for case in found.cases) or 1.0
    rows = [
        [Cell(text=name, nowrap=True), takes, Cell(text=error, bar=case.peak_following / longest), *rest]
        for case, (name, takes, error, *rest) in zip(found.cases, found.table.rows, strict=True)
    ]
    caption = (
        "Settling time counts from the end of the reference until the load stays within "
        f"{found.units.error(found.tolerance)} of the target. Residual twist: of the coupling after the end of "
        "the reference, peak to peak."
    )
    return Figure(title="In figures", caption=caption, table=Table(heads=found.table.on_page.heads, rows=rows))


# ---- what is compared


def compare_profiles(spec: CascadeSpec, *, progress: Progress | None = None) -> ProfileComparison:
    """Make one move in four variants on the axis of `spec`."""
    limits = motion_limits(spec)
    jerk = limits.jerk if math.isfinite(limits.jerk) else smooth_jerk(spec)
    found: list[ProfileCase] = []
    for shape, own in zip(SHAPES, (math.inf, jerk), strict=True):
        for feed in FEEDS:
            found.append(_case(spec, replace(limits, jerk=own), shape, feed))
            if progress is not None:
                progress(len(found) / 4, found[-1].name)
    return ProfileComparison(
        way=0.5 * spec.limits.travel,
        speed=limits.speed,
        acceleration=limits.acceleration,
        jerk=jerk,
        stated=math.isfinite(limits.jerk),
        frequency=1 / spec.swing if spec.swing else math.nan,
        tolerance=spec.method.in_position,
        rotary=spec.axis.motion == "rotary",
        cases=tuple(found),
    )


def smooth_jerk(spec: CascadeSpec) -> float:
    """Jerk for an axis that states none [m/s^3].

    Its ramps of the acceleration last one swing of the load, which then ends without one; those of a rigid axis last a
    quarter of the time that the axis needs to come to speed.
    """
    return spec.limits.acceleration / (spec.swing or 0.25 * spec.limits.speed / spec.limits.acceleration)


def _case(spec: CascadeSpec, limits: MotionLimits, shape: str, feed: str) -> ProfileCase:
    """The move made in one way."""
    start = spec.limits.lowest + 0.25 * spec.limits.travel
    target = start + 0.5 * spec.limits.travel
    shares: dict[str, object] = dict.fromkeys(
        ("velocity", "acceleration", "viscous", "coulomb"), float(feed == FEEDS[1])
    )
    # A weight is held in both: the axis must not drop before the move.
    method = {"feed_forward": spec.method.feed_forward.model_copy(update=shares)}
    alone = spec.changed(method=method, disturbance=DisturbanceTable())
    host = CascadeHost(alone, position=start)
    host.controller.guarded = 0
    host.pass_samples(math.ceil(REST_TIME / host.period - 1e-9))
    begin, plant = host.time, host.state.plant
    profile = plan_move(start, target, limits, host.period)
    set_gauge(plant.gauge, host.state.tick, start, target, spec.method.in_position)
    host.follow(profile)
    duration = (profile.count - 1) * host.period
    watched = duration + max(WATCHED_TIME, SWINGS * spec.swing)
    rows = host.watch(math.ceil(watched / host.period - 1e-9))
    settled = plant.gauge.outside * host.tick - begin
    resting = abs(plant.machine.load.position - target) <= spec.method.in_position
    twist = rows["plant.machine.motor.position"] - rows["plant.machine.load.position"]
    speed = np.zeros(len(rows))
    speed[: profile.count] = profile.velocity[: len(rows)]
    return ProfileCase(
        shape=shape,
        feed=feed,
        duration=duration,
        peak_following=float(np.abs(rows["controller.law.position_error"]).max()),
        approach=time_to_settle(duration, settled, rested=resting),
        twist_after=float(np.ptp(twist[profile.count - 1 :])) if spec.swing else math.nan,
        peak_command=float(np.abs(rows["controller.law.command"]).max()),
        t=np.arange(len(rows), dtype=np.float64) * host.period,
        speed=speed,
        following=rows["controller.law.position_error"],
        twist=twist,
    )
