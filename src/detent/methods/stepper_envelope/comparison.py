"""The stepper envelope beside other ways of moving, on an axis's own motors.

Methods A and B work every step out from the distance to the extremes (stepper-envelope specification 3.7), with one
constant acceleration; the naive drives know one frequency. The time-optimal profile of limited jerk is what a modern
motion controller plans for an axis that may start from standstill only; it is worked out by ruckig (MIT licence).
"""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from markupsafe import Markup

from detent.axisfile.motion import unit_in
from detent.control.step_comparison import BRAKING_DISTANCE, CONSTANT_FREQUENCY, PERMISSIBLE_FREQUENCY
from detent.control.step_rule import start_move
from detent.methods.stepper_envelope.build import changed, stepper_motor
from detent.methods.stepper_envelope.envelope_files import envelope_tables
from detent.methods.stepper_envelope.host import StageMotor
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec
from detent.methods.stepper_envelope.summary import speed_text, stated, time_text, units_of, way_text
from detent.page.chart import Chart, Curve, Panel, Timeline, time_charts
from detent.page.figure import Figure
from detent.page.frame import ComparisonOnScreen
from detent.page.parts import Numbers
from detent.page.table import Cell, Table, TextTable
from detent.page.words import GAP, count, number
from detent.planning.profile import MotionLimits, move_sections
from detent.planning.step_envelope import StepEnvelope
from detent.record.machine import Progress
from detent.units import format_quantity

WAYS = (100, 500, 2000, 8000)  # that are compared where the travel has room [step]; those of acceptance test 16
SETTLING = 0.05  # time that a rotor is given to come to rest before its lost steps are counted (7.2) [s]

A, B = "A: braking distance per step", "B: speed per step"
NAIVE, TOO_FAST = "start frequency", "largest frequency"

METHODS = {
    "envelope": (0, "envelope (this method)", "1 table read, 1 comparison, at most 1 increment"),
    A: (BRAKING_DISTANCE, A, "1 or 2 square roots, 1 or 2 divisions"),
    B: (PERMISSIBLE_FREQUENCY, B, "1 square root, 1 multiplication"),
    NAIVE: (CONSTANT_FREQUENCY, "constant start frequency", "nothing"),
    TOO_FAST: (CONSTANT_FREQUENCY, "constant largest frequency", "nothing"),
}
"""What is compared: its code (`control.step_comparison`), its name in full, what it works out before every step."""

POINTS = 900  # points of one curve over time


@dataclass(frozen=True, slots=True)
class Course:
    """One run over a way."""

    seconds: float  # from the start signal to the end of the last period [s]
    lost: int  # steps that the rotor is off in the end
    peak_lag: float  # largest distance of the rotor from its field [full step]


@dataclass(frozen=True, slots=True, repr=False)
class StepComparison(ComparisonOnScreen):
    """One motor with each method over several ways, upwards from its lower end.

    Attributes
    ----------
    motor : str
        Its name.
    step : float
        Travel per step [m].
    ways : tuple of int
        Ways [step].
    courses : dict of tuple of Course by method
        One for each way; the envelope's are first.
    motion : str
        "linear", or "rotary" where the motor turns what it moves: rad for m.
    """

    motor: str
    step: float
    ways: tuple[int, ...]
    courses: dict[str, tuple[Course, ...]]
    motion: str = "linear"

    @property
    def table(self) -> TextTable:
        """Time of each way and steps lost, for the terminal."""
        step = format_quantity(self.step, unit_in(self.motion, "m"))
        title = f"Motor {self.motor}: time of a way, and steps lost ({step} a step)"
        heads = ("method", *(f"{way} steps" for way in self.ways), "worked out per step")
        rows: list[tuple[str, ...]] = []
        for method, courses in self.courses.items():
            lost = [f", {abs(one.lost)} lost" if one.lost else "" for one in courses]
            cells = [format_quantity(one.seconds, "s") + text for one, text in zip(courses, lost, strict=True)]
            _, name, cost = METHODS[method]
            rows.append((name, *cells, cost))
        return TextTable(title, heads, rows)

    def figures(self) -> tuple[Figure, ...]:
        """The same with bars, and who loses steps."""
        times = number(self.courses[NAIVE][-1].seconds / self.courses["envelope"][-1].seconds, 2)
        caption = (
            "The same motor over several ways from its lower end, with its rotor simulated. A and B reckon from the "
            "distance to the extremes how fast every step may be; the envelope looks it up, and is as quick as they "
            f"are where they lose no step. On the longest way it is {times} times as quick as the constant start "
            f"frequency. {_losers(self)}"
        )
        heads = [(f"{count(way, 'step')}, {way_text(self, way * self.step)}", True) for way in self.ways]
        longest = [max(one.seconds for one in column) for column in zip(*self.courses.values(), strict=True)]
        rows: list[list[str | Cell]] = []
        for method, courses in self.courses.items():
            cells: list[str | Cell] = []
            for course, most in zip(courses, longest, strict=True):
                text = time_text(course.seconds)
                if course.lost:
                    text = Markup("{}, <br>{} lost").format(text, count(abs(course.lost)))
                cells.append(Cell(text=text, bar=course.seconds / most, over=course.lost != 0))
            _, name, cost = METHODS[method]
            rows.append([Markup("<b>{}</b>").format(name), *cells, cost])
        table = Table(heads=[("", False), *heads, ("worked out before every step", False)], rows=rows)
        return (Figure(title=f"Motor {self.motor}: time of a way, and steps lost", caption=caption, table=table),)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``--json``."""
        runs = {name: [asdict(course) for course in courses] for name, courses in self.courses.items()}
        own = {"motor": self.motor, "motion": self.motion, "step": self.step}
        return own | {"ways": list(self.ways), "methods": runs}


def _losers(found: StepComparison) -> str:
    """Which methods lose steps, and why."""
    lost = {method for method, courses in found.courses.items() if any(course.lost for course in courses)}
    recomputed = [method[:1] for method in (A, B) if method in lost]
    text = ""
    if recomputed:
        jump = "jump" if len(recomputed) > 1 else "jumps"
        text += (
            f"{' and '.join(recomputed)} {jump} from one speed to the other where a zone begins or torque falls, which "
            "the rotor cannot follow: steps are lost. "
        )
    if TOO_FAST in lost:
        text += "The largest frequency from rest is quicker on paper only: the rotor is left behind."
    return text


def compare_steps(spec: StepperEnvelopeSpec, progress: Progress | None = None) -> tuple[StepComparison, ...]:
    """Run each motor of an axis over several ways with each method, on its rotor."""
    found: list[StepComparison] = []
    for name, table in spec.stepper.items():
        ways = tuple(way for way in WAYS if way <= table.steps) or (table.steps,)
        courses: dict[str, tuple[Course, ...]] = {}
        for done, method in enumerate(METHODS):
            if progress is not None:
                progress(done / len(METHODS), f"motor {name}: {method}")
            courses[method] = tuple(_course(spec, name, method, way) for way in ways)
        found.append(StepComparison(name, table.step, ways, courses, table.motion))
    return tuple(found)


def _course(spec: StepperEnvelopeSpec, name: str, method: str, way: int) -> Course:
    """One motor with one method over one way from its lower end, on its rotor."""
    table, (code, *_) = spec.stepper[name], METHODS[method]
    table = changed(table, "mechanics.start_position", table.mechanics.lower_end)
    motor = StageMotor(spec.model_copy(update={"stepper": spec.stepper | {name: table}}), name)
    motor.tables.up.move_start(0)
    motor.tables.up.move_stop(way)
    if code:
        start_hz = motor.table.max_hz if method == TOO_FAST else float(motor.tables.ramp.hz[0])
        motor.compare(code, range(way), start_hz)
    start_move(motor.controller.rule, 1, 0)
    motor.advance_to(1 << 60, 0, until_event=True)
    motor.advance_to(motor.r.tick + round(SETTLING / motor.p.plant.rotor.dt), 0, until_event=False)
    return Course(motor.rested, motor.lost, float(motor.r.plant.rotor.peak_lag) / table.drive.microsteps)


# ---- beside a profile of limited jerk


@dataclass(frozen=True, slots=True)
class Profile:
    """Speed over time; a jump has two rows of one moment."""

    t: Numbers  # [s] from the start
    speed: Numbers  # [m/s]

    @property
    def seconds(self) -> float:
        """Duration [s]."""
        return float(self.t[-1])

    def at(self, t: Numbers) -> Numbers:
        """Speed at any moments [m/s], shape (n,); NaN after its end."""
        # One point more than the profile has: a curve that ends at rest.
        after = np.searchsorted(t, self.seconds) + 1
        return np.where(np.arange(len(t)) < after, np.interp(t, self.t, self.speed), np.nan)


@dataclass(frozen=True, slots=True, repr=False)
class JerkComparison(ComparisonOnScreen):
    """The envelope's run of one motor beside a time-optimal profile of limited jerk with the same limits.

    Attributes
    ----------
    motor : str
        Its name.
    way : float
        Length of the run [m].
    speed, acceleration, jerk : float
        Limits of the profile: those of the axis, and a jerk that brings the acceleration up within one period of the
        rotor's natural frequency, which leaves the rotor without a swing [m/s, m/s^2, m/s^3].
    envelope : Profile
        What the table gives without the axis's zones; speed is that of each step.
    smooth : Profile
        Ruckig's.
    motion : str
        "linear", or "rotary" where the motor turns what it moves: rad for m.
    """

    motor: str
    way: float
    speed: float
    acceleration: float
    jerk: float
    envelope: Profile
    smooth: Profile
    motion: str = "linear"

    @property
    def magnified(self) -> float:
        """Time at both ends of the way in which the profiles differ [s]."""
        both = (self.envelope, self.smooth)
        risen = [float(one.t[int(np.argmax(one.speed >= 0.999 * one.speed.max()))]) for one in both]
        return min(1.3 * max(risen), 0.5 * max(one.seconds for one in both))

    @property
    def table(self) -> TextTable:
        """Times of both profiles, for the terminal."""
        limits = ((self.speed, "m/s"), (self.acceleration, "m/s^2"), (self.jerk, "m/s^3"))
        told = ", ".join(self._text(value, unit) for value, unit in limits)
        title = f"Motor {self.motor}: {self._text(self.way, 'm')} without zones, limits {told}"
        rows: list[tuple[str, ...]] = []
        for name, profile in (("envelope", self.envelope), ("time-optimal, jerk limited (ruckig)", self.smooth)):
            more = profile.seconds - self.envelope.seconds
            longer = "" if profile is self.envelope else f"{more * 1e3:+.1f} ms, {more / self.envelope.seconds:+.1%}"
            peak = self._text(float(profile.speed.max()), "m/s")
            rows.append((name, format_quantity(profile.seconds, "s"), longer, peak))
        return TextTable(title, ("profile", "time", "beside the envelope", "peak speed"), rows)

    def _text(self, value: float, linear: str) -> str:
        return format_quantity(value, unit_in(self.motion, linear))

    def figures(self) -> tuple[Figure, ...]:
        """Speed of both profiles: the whole way, and its two ends magnified."""
        last, window = max(self.envelope.seconds, self.smooth.seconds), self.magnified
        ends = f"{number(window * 1e3, 2)}{GAP}ms"
        parts = {"begin": ((0.0, window), f"The first {ends}"), "end": ((last - window, last), f"The last {ends}")}
        charts = [_chart(self, f"jerk-{name}", *part) for name, part in parts.items()]
        title = "The envelope beside a jerk-limited time-optimal profile"
        return (
            Figure(title=title, caption=_told(self), charts=[_chart(self, "jerk-whole", (0.0, last))]),
            Figure(title="The same at both ends of the way", charts=charts, beside=True),
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``--json``."""
        names = ("motor", "way", "speed", "acceleration", "jerk")
        times = {"envelope_seconds": self.envelope.seconds, "smooth_seconds": self.smooth.seconds}
        return {name: getattr(self, name) for name in names} | {"motion": self.motion} | times


def _told(found: JerkComparison) -> str:
    envelope, smooth = found.envelope.seconds, found.smooth.seconds
    more = 100 * (smooth / envelope - 1)
    quicker = f"{number(abs(more), 2)}{GAP}% {'longer' if more >= 0 else 'shorter'}"
    units = units_of(found)
    acceleration, jerk = (units.of(unit_in(found.motion, f"m/s^{n}")) for n in (2, 3))
    return (
        f"{way_text(found, found.way)} of motor {found.motor} without zones, with the same largest speed "
        f"({speed_text(found, found.speed)}) and acceleration "
        f"({stated(found.acceleration * acceleration.factor)}{GAP}{acceleration.name}): the "
        f"envelope takes {time_text(envelope)}, the time-optimal profile of limited jerk "
        f"({number(found.jerk * jerk.factor)}{GAP}{jerk.name}, by ruckig) {time_text(smooth)}, {quicker}. A stepper "
        "may begin and end at its start frequency at once; the profile begins at standstill. Near the top the envelope "
        "spares acceleration where the torque falls; of that the profile knows nothing."
    )


def _chart(found: JerkComparison, name: str, stretch: tuple[float, float], title: str = "") -> Chart:
    """Speed over a stretch of time, in milliseconds where it has a title of its own."""
    t, scale = np.linspace(*stretch, POINTS), units_of(found).speed
    curves = [
        Curve(label="jerk limited", colour="left", width=2, dash=(6, 4), y=found.smooth.at(t) * scale.factor),
        Curve(label="envelope", colour="speed", width=2, y=found.envelope.at(t) * scale.factor),
    ]
    span = (0.0, round(1.15 * found.speed * scale.factor, 3))
    label = f"speed [{scale.name}]"
    panel = Panel(name=name, label=label, height=200, zero=True, span=span, curves=curves, title=title)
    timeline = Timeline(name=name, t=t, label="time since the start signal", unit="ms" if title else "s")
    return time_charts(timeline, [panel])[0]


def compare_jerk(spec: StepperEnvelopeSpec, name: str = "") -> JerkComparison:
    """Hold the envelope of a motor, the first one, over its whole travel upwards against a profile of limited jerk."""
    name = name or next(iter(spec.stepper))
    table = spec.stepper[name]
    swing, way = stepper_motor(table).natural_hz, table.steps * table.step
    limits = MotionLimits(table.limits.speed, table.limits.acceleration, table.limits.acceleration * swing)
    sections = move_sections(0.0, way, limits)
    t = np.linspace(0.0, float(sections.t[-1]), 2001)
    smooth, envelope = Profile(t, sections.at(t)[1]), _envelope_profile(spec, name)
    return JerkComparison(name, way, limits.speed, limits.acceleration, limits.jerk, envelope, smooth, table.motion)


def _envelope_profile(spec: StepperEnvelopeSpec, name: str) -> Profile:
    """Every step of a run over the whole travel, without the zones, of which the other profile knows nothing."""
    table = spec.stepper[name].model_copy(update={"zone": {}})
    tables = envelope_tables(spec.model_copy(update={"stepper": {name: table}}), name)
    seconds = tables.periods(StepEnvelope(tables.up.ramp, tables.up.zones)) / tables.clock_hz
    # The speed of a step holds until the next one.
    t, speed = np.append(0.0, np.cumsum(seconds)), table.step / seconds
    return Profile(np.repeat(t, 2)[1:], np.append(np.repeat(speed, 2), 0.0))
