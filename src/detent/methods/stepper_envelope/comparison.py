"""The stepper envelope beside its alternatives, on an axis's own motors: methods per step, and a jerk-limited profile.

Methods A and B work every step out from the distance to the extremes (stepper-envelope specification 3.7), with one
constant acceleration; the naive drives know one frequency. The time-optimal profile of limited jerk is what a modern
motion controller plans for an axis that may start from standstill only; it is worked out by ruckig (MIT licence).
"""

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.control.step_comparison import BRAKING_DISTANCE, CONSTANT_FREQUENCY, PERMISSIBLE_FREQUENCY
from detent.control.step_rule import start_move
from detent.errors import DetentError
from detent.kernel.loop import advance
from detent.methods.stepper_envelope.build import stepper_load, stepper_motor
from detent.methods.stepper_envelope.machine import StageMotor
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec, StepperTable
from detent.methods.stepper_envelope.system import Stepper, StepperParams, alone, tables
from detent.planning.step_ramp import natural_frequency, total_inertia
from detent.record.machine import LONGEST_STRETCH, Progress
from detent.record.recorder import choose_leaves

Numbers = NDArray[np.float64]

WAYS = (100, 500, 2000, 8000)
"""Ways that are compared, as far as the travel has room for them [step]; those of acceptance test 16."""

SETTLING = 0.05
"""Time that a rotor is given to come to rest before its lost steps are counted (7.2) [s]."""

ENVELOPE = "envelope"
METHODS = {
    ENVELOPE: 0,
    "A: braking distance per step": BRAKING_DISTANCE,
    "B: speed per step": PERMISSIBLE_FREQUENCY,
    "start frequency": CONSTANT_FREQUENCY,
    "largest frequency": CONSTANT_FREQUENCY,
}
"""What is compared, and how the control unit names it."""


@dataclass(frozen=True, slots=True)
class Course:
    """One run over a way."""

    seconds: float  # from the start signal to the end of the last period [s]
    lost: int  # steps that the rotor is off in the end
    peak_lag: float  # largest distance of the rotor from its field [step]


@dataclass(frozen=True, slots=True)
class StepComparison:
    """One motor with each method over several ways, upwards from its lower end.

    Attributes
    ----------
    motor : str
        Its name.
    step : float
        Travel per step [m].
    ways : tuple of int
        Ways [step].
    methods : tuple of str
        Their names, the envelope first.
    courses : tuple of tuple of Course
        By method, then by way.
    """

    motor: str
    step: float
    ways: tuple[int, ...]
    methods: tuple[str, ...]
    courses: tuple[tuple[Course, ...], ...]

    def seconds(self, method: int) -> Numbers:
        """Time of each way with a method, shape (ways,) [s]."""
        return np.array([course.seconds for course in self.courses[method]])

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``--json``."""
        runs = {
            name: [{"seconds": c.seconds, "lost": c.lost, "peak_lag": c.peak_lag} for c in row]
            for name, row in zip(self.methods, self.courses, strict=True)
        }
        return {"motor": self.motor, "step": self.step, "ways": list(self.ways), "methods": runs}


@dataclass(frozen=True, slots=True)
class Profile:
    """Position and speed over time."""

    t: Numbers  # and position, speed: [s], [m] from the start, [m/s]
    position: Numbers
    speed: Numbers

    @property
    def seconds(self) -> float:
        """Duration [s]."""
        return float(self.t[-1])


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

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``--json``."""
        names = ("motor", "way", "speed", "acceleration", "jerk")
        times = {"envelope_seconds": self.envelope.seconds, "smooth_seconds": self.smooth.seconds}
        return {name: getattr(self, name) for name in names} | times


def compare_steps(spec: StepperEnvelopeSpec, progress: Progress | None = None) -> tuple[StepComparison, ...]:
    """Run each motor of an axis over several ways with each method, on its rotor."""
    return tuple(_compare_motor(spec, name, progress) for name in spec.stepper)


def _compare_motor(spec: StepperEnvelopeSpec, name: str, progress: Progress | None) -> StepComparison:
    table = spec.stepper[name]
    ways = tuple(way for way in WAYS if way <= table.steps) or (table.steps,)
    rows: list[tuple[Course, ...]] = []
    for done, (method, code) in enumerate(METHODS.items()):
        if progress is not None:
            progress(done / len(METHODS), f"motor {name}: {method}")
        rows.append(tuple(_course(spec, name, method, code, way) for way in ways))
    return StepComparison(name, table.step, ways, tuple(METHODS), tuple(rows))


def _course(spec: StepperEnvelopeSpec, name: str, method: str, code: int, way: int) -> Course:
    """One motor with one method over one way, on its rotor."""
    motor = _motor_for(spec, name, way)
    if code:
        _take_over(motor, code, way, motor.table.max_hz if method == "largest frequency" else None)
    start_move(motor.r.rule, 1)
    motor.advance_to(1 << 60, 0, until_event=True)
    motor.advance_to(motor.r.tick + round(SETTLING / motor.p.rotor.dt), 0, until_event=False)
    return Course(motor.rested, motor.lost, float(motor.r.rotor.peak_lag))


def _motor_for(spec: StepperEnvelopeSpec, name: str, way: int) -> StageMotor:
    """The motor at its lower end, with its tables set for a run of `way` steps."""
    lower = spec.stepper[name].mechanics.lower_end
    mechanics = spec.stepper[name].mechanics.model_copy(update={"start_position": lower})
    table = spec.stepper[name].model_copy(update={"mechanics": mechanics})
    motor = StageMotor(spec.model_copy(update={"stepper": spec.stepper | {name: table}}), name)
    motor.tables.up.move_start(0)
    motor.tables.up.move_stop(way)
    return motor


def _take_over(motor: StageMotor, code: int, way: int, hz: float | None) -> None:
    """Let another method drive upwards; `hz` is the frequency of the naive drive, the start frequency if None."""
    c, zones = motor.p.comparison, motor.tables.up.zones
    c.method, c.begin, c.steps = code, 0, way
    c.start_hz = float(motor.tables.ramp.hz[0]) if hz is None else hz
    c.acceleration = motor.table.limits.acceleration / motor.table.step
    c.zones = len(zones.numbers)
    for k, number in enumerate(zones.numbers.tolist()):
        c.edge[k], c.limit[k] = int(zones.edges[k + 1]), zones.limits[number]
    _use_frequencies(motor.p)


def _use_frequencies(p: StepperParams) -> None:
    """The compared methods work a frequency out: the timer has to divide."""
    p.timer.reload = 0


def compare_jerk(spec: StepperEnvelopeSpec, name: str | None = None) -> JerkComparison:
    """Hold the envelope of one motor, over its whole travel upwards, against a profile of limited jerk."""
    name = next(iter(spec.stepper)) if name is None else name
    if name not in spec.stepper:
        raise DetentError(f"motor: came {name!r}; allowed: one of {', '.join(spec.stepper)}; name one of these")
    table = spec.stepper[name]
    motor, load = stepper_motor(table), stepper_load(table)
    swing = natural_frequency(motor.steps_per_turn, motor.holding_torque, total_inertia(motor, load))
    limits = (table.limits.speed, table.limits.acceleration, table.limits.acceleration * swing)
    envelope = _envelope_profile(spec, name)
    return JerkComparison(name, table.steps * table.step, *limits, envelope, _smooth_profile(table, limits))


def _envelope_profile(spec: StepperEnvelopeSpec, name: str) -> Profile:
    """Every step of a run over the whole travel, without the zones, of which the other profile knows nothing."""
    open_table = spec.stepper[name].model_copy(update={"zone": {}})
    spec = spec.model_copy(update={"stepper": spec.stepper | {name: open_table}})
    motor = _motor_for(spec, name, open_table.steps)
    start_move(motor.r.rule, 1)
    (period,) = choose_leaves(Stepper, ["timer.period"])
    picks = np.arange(period.offset, period.offset + period.width.size)
    rows = np.zeros((motor.table.steps + 1, len(picks)), np.uint8)
    feed = tables(motor.tables.up.entries, motor.tables.down.entries)
    made = advance(alone(motor.p), motor.r, min(motor.table.steps, LONGEST_STRETCH), rows, picks, 1, *feed)
    seconds = np.asarray(rows[1 : made + 1].view("<i8")[:, 0] / motor.p.timer.clock_hz, float)
    t: Numbers = np.concatenate([[0.0], np.cumsum(seconds)])
    position = np.linspace(0.0, made * motor.table.step, made + 1)
    return Profile(t, position, np.append(motor.table.step / seconds, 0.0))


def _smooth_profile(table: StepperTable, limits: tuple[float, float, float]) -> Profile:
    """Ruckig's profile from rest to rest over the whole travel."""
    ruckig: Any = import_module("ruckig")  # it states no types
    way = table.steps * table.step
    asked, found = ruckig.InputParameter(1), ruckig.Trajectory(1)
    asked.current_position, asked.target_position = [0.0], [way]
    asked.max_velocity, asked.max_acceleration, asked.max_jerk = ([limit] for limit in limits)
    if ruckig.Ruckig(1).calculate(asked, found) != ruckig.Result.Working:
        raise DetentError(f"no profile of limited jerk over {way:g} m; look at the limits of the axis")
    t: Numbers = np.linspace(0.0, float(found.duration), 2001)
    states = np.array([[part[0] for part in found.at_time(float(moment))] for moment in t], float)
    return Profile(t, states[:, 0], states[:, 1])
