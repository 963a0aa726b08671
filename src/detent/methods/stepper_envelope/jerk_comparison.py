"""The stepper envelope beside a profile of limited jerk, on an axis's own motor.

The time-optimal profile of limited jerk is what a modern motion controller plans for an axis that may start from
standstill only; it is worked out by ruckig (MIT licence).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.methods.stepper_envelope.build import stepper_motor
from detent.methods.stepper_envelope.comparison import time_text
from detent.methods.stepper_envelope.envelope_files import envelope_tables
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec
from detent.methods.stepper_envelope.summary import stated
from detent.page.chart import Chart, Curve, Panel, Timeline, time_charts
from detent.page.figure import Figure
from detent.page.table import TextTable
from detent.page.words import GAP, number
from detent.planning.profile import MotionLimits, move_sections
from detent.planning.step_envelope import StepEnvelope
from detent.units import format_quantity

POINTS = 900  # points of one curve

MM = 1e3

Numbers = NDArray[np.float64]


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


@dataclass(frozen=True, slots=True)
class JerkComparison:
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
    """

    motor: str
    way: float
    speed: float
    acceleration: float
    jerk: float
    envelope: Profile
    smooth: Profile

    @property
    def magnified(self) -> float:
        """Time at both ends of the way in which the profiles differ [s]."""
        half = 0.5 * max(self.envelope.seconds, self.smooth.seconds)
        risen = [
            float(profile.t[int(np.argmax(profile.speed >= 0.999 * profile.speed.max()))])
            for profile in (self.envelope, self.smooth)
        ]
        return min(1.3 * max(risen), half)

    @property
    def table(self) -> TextTable:
        """Times of both profiles, for the terminal."""
        limits = ((self.speed, "m/s"), (self.acceleration, "m/s^2"), (self.jerk, "m/s^3"))
        told = ", ".join(format_quantity(value, unit) for value, unit in limits)
        title = f"Motor {self.motor}: {format_quantity(self.way, 'm')} without zones, limits {told}"
        rows: list[tuple[str, ...]] = []
        for name, profile in (("envelope", self.envelope), ("time-optimal, jerk limited (ruckig)", self.smooth)):
            more = profile.seconds - self.envelope.seconds
            longer = "" if profile is self.envelope else f"{more * 1e3:+.1f} ms, {more / self.envelope.seconds:+.1%}"
            peak = format_quantity(float(profile.speed.max()), "m/s")
            rows.append((name, format_quantity(profile.seconds, "s"), longer, peak))
        return TextTable(title, ("profile", "time", "beside the envelope", "peak speed"), rows)

    def figures(self) -> tuple[Figure, ...]:
        """Speed of both profiles: the whole way, and its two ends magnified."""
        last, window = max(self.envelope.seconds, self.smooth.seconds), self.magnified
        ends = f"{number(window * 1e3, 2)}{GAP}ms"
        return (
            Figure(
                title="The envelope beside a jerk-limited time-optimal profile",
                caption=_told(self),
                charts=[_chart(self, "jerk-whole", (0.0, last))],
            ),
            Figure(
                title="The same at both ends of the way",
                charts=[
                    _chart(self, "jerk-begin", (0.0, window), f"The first {ends}"),
                    _chart(self, "jerk-end", (last - window, last), f"The last {ends}"),
                ],
                beside=True,
            ),
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``--json``."""
        names = ("motor", "way", "speed", "acceleration", "jerk")
        times = {"envelope_seconds": self.envelope.seconds, "smooth_seconds": self.smooth.seconds}
        return {name: getattr(self, name) for name in names} | times


def _told(found: JerkComparison) -> str:
    envelope, smooth = found.envelope.seconds, found.smooth.seconds
    more = 100 * (smooth / envelope - 1)
    quicker = f"{number(abs(more), 2)}{GAP}% {'longer' if more >= 0 else 'shorter'}"
    return (
        f"{stated(found.way * MM)}{GAP}mm of motor {found.motor} without zones, with the same largest speed "
        f"({stated(found.speed * MM)}{GAP}mm/s) and acceleration ({stated(found.acceleration)}{GAP}m/s²): the "
        f"envelope takes {time_text(envelope)}, the time-optimal profile of limited jerk "
        f"({number(found.jerk)}{GAP}m/s³, by ruckig) {time_text(smooth)}, {quicker}. A stepper may begin and end at "
        "its start frequency at once; the profile begins at standstill. Near the top the envelope spares acceleration "
        "where the torque falls; of that the profile knows nothing."
    )


def _chart(found: JerkComparison, name: str, span: tuple[float, float], title: str = "") -> Chart:
    """Speed over a stretch of time, in milliseconds where it has a title of its own."""
    t = np.linspace(*span, POINTS)
    curves = [
        Curve(label="jerk limited", colour="left", width=2, dash=(6, 4), y=found.smooth.at(t) * MM),
        Curve(label="envelope", colour="speed", width=2, y=found.envelope.at(t) * MM),
    ]
    top = round(1.15 * found.speed * MM, 3)
    panel = Panel(
        name=name, label="speed [mm/s]", height=200, zero=True, span=(0.0, top), curves=curves, title=title
    )  # fmt: skip
    timeline = Timeline(name=name, t=t, label="time since the start signal", unit="ms" if title else "s")
    (chart,) = time_charts(timeline, [panel])
    return chart


def compare_jerk(spec: StepperEnvelopeSpec, name: str = "") -> JerkComparison:
    """Hold the envelope of a motor, the first one, over its whole travel upwards against a profile of limited jerk."""
    name = name or next(iter(spec.stepper))
    table = spec.stepper[name]
    swing, way = stepper_motor(table).natural_hz, table.steps * table.step
    limits = MotionLimits(table.limits.speed, table.limits.acceleration, table.limits.acceleration * swing)
    sections = move_sections(0.0, way, limits)
    t = np.linspace(0.0, float(sections.t[-1]), 2001)
    smooth, envelope = Profile(t, sections.at(t)[1]), _envelope_profile(spec, name)
    return JerkComparison(name, way, limits.speed, limits.acceleration, limits.jerk, envelope, smooth)


def _envelope_profile(spec: StepperEnvelopeSpec, name: str) -> Profile:
    """Every step of a run over the whole travel, without the zones, of which the other profile knows nothing."""
    table = spec.stepper[name].model_copy(update={"zone": {}})
    tables = envelope_tables(spec.model_copy(update={"stepper": {name: table}}), name)
    seconds = tables.periods(StepEnvelope(tables.up.ramp, tables.up.zones)) / tables.clock_hz
    # The speed of a step holds until the next one.
    t, speed = np.append(0.0, np.cumsum(seconds)), table.step / seconds
    return Profile(np.repeat(t, 2)[1:], np.append(np.repeat(speed, 2), 0.0))
