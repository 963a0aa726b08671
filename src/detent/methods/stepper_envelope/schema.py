"""What an axis file of the stepper-envelope method may say: every key with its unit, bounds, default and meaning.

Sections in brackets are those of the stepper-envelope specification. One file describes one or several motors, each
with its own mechanics, tables and control unit; they share the step timer's clock and nothing else. Positions count
from `mechanics.lower_end`, upwards.

The keys are written for a motor that slides what it moves. Where its ``motion`` is "rotary" they hold with rad for m
(`axisfile.motion`), and its mechanics are those of `RotaryMechanicsTable`. In the code of this method, what is said to
be in m is then in rad.
"""

import math
from abc import abstractmethod
from typing import Annotated, Any, ClassVar, Literal

from annotated_types import Ge, Le
from pydantic import Field

from detent.axisfile.motion import MovingTable
from detent.axisfile.tables import AxisSpec, AxisTable, InnerHomeTable
from detent.files.fields import Naming, Table, named, optional, required
from detent.files.quantities import (
    Acceleration,
    Current,
    Frequency,
    Inductance,
    Inertia,
    Length,
    Mass,
    Resistance,
    Time,
    Torque,
    Velocity,
    Voltage,
)

JOB_WORDS = (
    "tick", "tile", "label", "by", "turn", "dwell", "repeat", "jog", "speed", "duration", "changed_at", "changed_to",
)  # fmt: skip
"""Words of jobs and records, which no motor may have for a name."""

MOTOR_NAME = Naming(
    placeholder="NAME",
    # Names in C are made from them, where one motor in capitals could not be told from another.
    pattern=rf"(?!(?:{'|'.join(JOB_WORDS)})$)[a-z][a-z0-9_]{{0,30}}",
    allowed=f"up to 31 small letters, digits and underscores, a letter first; not {', '.join(JOB_WORDS)}",
    example="x",
)
ZONE_NAME = Naming(
    placeholder="ZONE",
    pattern="[A-Za-z0-9_-]{1,40}",
    allowed="up to 40 letters, digits, underscores and hyphens",
    example="fine",
)
MOST_MOTORS = 16
FAR = 1e3  # farthest end of a travel [m]: a kilometre, or 159 turns


class StepperAxisTable(AxisTable, frozen=True):
    """Name and method of the axis."""

    method: Literal["stepper_envelope"] = required("control method", '"stepper_envelope"')


class ControllerTable(Table, frozen=True):
    """What all motors of the file have in common: one clock for their step timers, and how the host waits."""

    timer: Frequency = optional(
        "clock of the step timers", 1e6, allowed="a frequency from 250 kHz up to 1 GHz, in whole Hz", ge=2.5e5, le=1e9
    )
    words: Literal["reload", "frequency"] = optional(
        "what the ramp is stored as: timer periods, which cost no division, or frequencies", "reload"
    )
    settle_time: Time = optional("time a motor is given to come to rest after its last step", 50e-3, ge=0.0, le=10.0)
    tolerance: float = optional(
        "distance of the rotor from its step that counts as at rest, in full steps", 0.5, ge=0.01, le=2.0
    )


class LimitsTable(Table, frozen=True):
    """What the motor must never exceed."""

    travel: Length = required(
        "free way between its two ends", '"40 mm"', start='"200 mm"', turned='"360 deg"', gt=0.0, le=FAR
    )
    speed: Velocity = required(
        "largest speed ever commanded", '"20 mm/s"', start='"60 mm/s"', turned='"45 deg/s"', gt=0.0, le=1e3
    )
    acceleration: Acceleration = required(
        "acceleration of the linear part of the ramp (3.1)", '"0.2 m/s^2"', start='"1 m/s^2"', turned='"180 deg/s^2"',
        gt=0.0, le=1e6,
    )  # fmt: skip


class MotorTable(Table, frozen=True):
    """Constants of the stepper, from a catalogue or stated."""

    catalogue: str = optional("motor of the catalogue that gives the constants not stated here", "", max_length=80)
    steps_per_turn: int = required(
        "full steps per turn", "200", allowed="a multiple of 4 from 4 to 10000", ge=4, le=10000
    )
    holding_torque: Torque = required(
        "holding torque, both phases at the rated current", '"60 mN*m"', start='"270 mN*m"', ge=1e-5, le=1e3
    )
    rotor_inertia: Inertia = required("rotor, without load", '"9 g*cm^2"', start='"35 g*cm^2"', ge=1e-10, le=1.0)
    resistance: Resistance | None = optional("winding, per phase", None, start='"5.3 ohm"', ge=1e-3, le=1e4)
    inductance: Inductance | None = optional("winding, per phase", None, start='"6.6 mH"', ge=1e-6, le=10.0)
    rated_current: Current | None = optional("per phase", None, start='"1 A"', ge=1e-3, le=1e3)
    start_frequency: Frequency | None = optional(
        "frequency at which the bare rotor starts without losing steps",
        None,
        derived="3 x the natural frequency of rotor and field",
        ge=1.0,
        le=65535.0,
    )
    pull_out: Literal["winding", "first order", "points"] = optional(
        "torque against frequency: from the winding's constants and the supply; falling from pull_out_torque with "
        "corner_frequency (3.1); or from points of a published curve",
        "winding",
    )
    pull_out_torque: Torque | None = optional(
        "first order: pull-out torque at standstill, with this drive and its current", None, ge=1e-6, le=1e3
    )
    corner_frequency: Frequency | None = optional(
        "first order: step frequency at which it has fallen to 1/sqrt 2", None, ge=1.0, le=1e6
    )
    curve_frequency: list[Annotated[Frequency, Ge(0.0), Le(1e6)]] = optional(
        "points: step frequencies, rising",
        [],
        allowed='a list of frequencies up to 1 MHz, such as ["500 Hz", "2 kHz"], up to 64 of them',
        max_length=64,
    )
    curve_torque: list[Annotated[Torque, Ge(0.0), Le(1e3)]] = optional(
        "points: pull-out torque at each, with this drive and its current",
        [],
        allowed='a list of torques up to 1 kN*m, such as ["45 mN*m", "20 mN*m"], as many as curve_frequency',
        max_length=64,
    )


class DriveTable(Table, frozen=True):
    """Chopper drive of the motor."""

    supply: Voltage = optional("voltage that drives the current", 24.0, ge=0.5, le=1000.0)
    current: Current | None = optional(
        "current per phase that the drive is set to", None, derived="motor.rated_current", ge=1e-3, le=1e3
    )
    bridge_resistance: Resistance = optional("switches and wiring, per phase", 0.0, ge=0.0, le=1e4)
    microsteps: int = optional(
        "pulses that the drive makes a full step of; steps and step frequencies of tables and traces are then "
        "microsteps, those of the motor stay full steps",
        1, ge=1, le=256,
    )  # fmt: skip
    torque_safety: float = optional("SF: the pull-out torque is divided by it (3.1)", 2.0, ge=1.0, le=20.0)
    start_safety: float = optional("the start frequency is divided by it: age and temperature", 2.1, ge=1.0, le=20.0)
    reversal_pause: int = optional(
        "waiting time of a reversal, in periods of the start frequency, of full steps", 1, ge=0, le=255
    )


class ShaftTable(Table, frozen=True):
    """What is at every shaft, whatever it moves."""

    coupling_inertia: Inertia = optional("coupling", 0.0, ge=0.0, le=10.0)
    friction_torque: Torque = optional("Coulomb friction at the shaft", 0.0, ge=0.0, le=1e3)
    lower_end: Length = optional("position of the lower end of the travel", 0.0, ge=-FAR, le=FAR)
    start_position: Length = optional(
        "where the motor stands at power-on", math.nan, derived="mechanics.lower_end", ge=-FAR, le=2 * FAR
    )

    way_key: ClassVar[str]  # key that the way per motor turn is made of
    way_name: ClassVar[str]  # what it is called, and how the way follows from it
    way_formula: ClassVar[str]
    load_keys: ClassVar[tuple[str, ...]]  # keys that the inertia is made of
    inertia_formula: ClassVar[str]

    @property
    @abstractmethod
    def per_turn(self) -> float:
        """Way of the axis per motor turn [m]."""

    @property
    @abstractmethod
    def inertia(self) -> float:
        """All that turns with the rotor [kg m^2]."""


class LeadTable(Table, frozen=True):
    """Keys of a motor that slides what it moves."""

    travel_per_revolution: Length = required(
        "lead of the spindle: travel per motor turn", '"1 mm"', start='"8 mm"', ge=1e-6, le=10.0
    )
    moving_mass: Mass = optional("stage, lens group or other mass that is moved", 0.0, start='"500 g"', ge=0.0, le=1e4)
    screw_inertia: Inertia = optional("spindle", 0.0, ge=0.0, le=10.0)


class GearTable(Table, frozen=True):
    """Keys of a motor that turns what it moves."""

    gear_ratio: float = optional(
        "rotary: motor turns per turn of the axis; 1: what turns sits on the motor's shaft",
        1.0,
        start="10",
        ge=1e-3,
        le=1e6,
    )
    load_inertia: Inertia = optional(
        "rotary: table, dial, valve or other load, behind the gear", 0.0, start='"0.002 kg*m^2"', ge=0.0, le=1e4
    )
    gear_inertia: Inertia = optional("rotary: gear, at the motor shaft", 0.0, ge=0.0, le=10.0)


class RotaryMechanicsTable(ShaftTable, GearTable, frozen=True):
    """Gear and what it turns."""

    way_key, way_name, way_formula = "gear_ratio", "gear ratio", "1 turn / gear ratio"
    load_keys = ("gear_ratio", "load_inertia", "gear_inertia", "coupling_inertia")
    inertia_formula = "rotor + gear + coupling + load / gear ratio^2"

    @property
    def per_turn(self) -> float:
        """Angle of the axis per motor turn [rad]."""
        return 2 * math.pi / self.gear_ratio

    @property
    def inertia(self) -> float:
        """All that turns with the rotor, the load as J / gear_ratio^2 [kg m^2]."""
        load = self.load_inertia * (self.per_turn / (2 * math.pi)) ** 2
        return self.gear_inertia + self.coupling_inertia + load


class MechanicsTable(ShaftTable, LeadTable, frozen=True):
    """Spindle and what it moves."""

    turned: ClassVar[type[Table]] = RotaryMechanicsTable

    way_key, way_name, way_formula = "travel_per_revolution", "lead", "travel per revolution"
    load_keys = ("travel_per_revolution", "moving_mass", "screw_inertia", "coupling_inertia")
    inertia_formula = "rotor + screw + coupling + mass x (lead / 2 pi)^2"

    @property
    def per_turn(self) -> float:
        """Travel of the axis per motor turn [m]."""
        return self.travel_per_revolution

    @property
    def inertia(self) -> float:
        """All that turns with the rotor, the mass as m (lead / 2 pi)^2 [kg m^2]."""
        mass = self.moving_mass * (self.travel_per_revolution / (2 * math.pi)) ** 2
        return self.screw_inertia + self.coupling_inertia + mass


def _extreme(description: str, derived: str = "mechanics.lower_end") -> Any:
    return optional(description, math.nan, derived=derived, ge=-FAR, le=2 * FAR)


class ExtremesTable(Table, frozen=True):
    """Extremes of the envelope as it is at power-on (2.1): start, turn and stop; moves set their own."""

    start: Length = _extreme("where the run upwards begins")
    turn: Length = _extreme("where it ends and the run downwards begins", "upper end")
    stop: Length = _extreme("where the run downwards ends")


class ZoneTable(Table, frozen=True):
    """A stretch of the travel with its own speed limit."""

    begin: Length = required("lower end of the zone", '"10 mm"', turned='"80 deg"', ge=-FAR, le=2 * FAR)
    end: Length = required("upper end of the zone", '"13 mm"', turned='"100 deg"', ge=-FAR, le=2 * FAR)
    speed: Velocity = required("largest speed inside it", '"5 mm/s"', turned='"20 deg/s"', gt=0.0, le=1e3)
    direction: Literal["both", "up", "down"] = optional("direction of motion that it holds for", "both")


class StepperHomeTable(InnerHomeTable, frozen=True):
    """How a live motor finds its reference; without the table it cannot home."""

    by: Literal["switch"] = required(
        "what gives the reference: the edge of a switch, for a motor without a sensor feels neither stop nor mark",
        '"switch"',
    )


class MethodTable(Table, frozen=True):
    """Form of the run-time rule (3.3)."""

    rule: Literal["ramp-limited", "literal"] = optional(
        "the ramp-limited rule, or the literal one of the claim, which is safe on the envelope only", "ramp-limited"
    )


class StepperTable(MovingTable, frozen=True):
    """One motor of the axis, with its mechanics and its tables."""

    motion: Literal["linear", "rotary"] = optional(
        "whether the motor slides or turns what it moves; one that turns has rad for m in every key, and in its "
        "mechanics gear_ratio, load_inertia and gear_inertia",
        "linear",
    )
    limits: LimitsTable
    motor: MotorTable
    drive: DriveTable = Field(default_factory=DriveTable)
    mechanics: MechanicsTable
    extremes: ExtremesTable = Field(default_factory=ExtremesTable)
    zone: dict[str, ZoneTable] = named("a stretch with its own speed limit", ZONE_NAME, max_length=14)
    method: MethodTable = Field(default_factory=MethodTable)
    home: StepperHomeTable | None = None

    @property
    def step(self) -> float:
        """Travel per pulse, a step or a microstep [m]."""
        return self.mechanics.per_turn / (self.motor.steps_per_turn * self.drive.microsteps)

    @property
    def held_torque(self) -> float:
        """Holding torque at the current of the drive [N m]: torque is in proportion to current."""
        rated, current = self.motor.rated_current, self.drive.current
        return self.motor.holding_torque * (1.0 if rated is None or current is None else current / rated)

    @property
    def steps(self) -> int:
        """Whole steps of the travel N."""
        return math.floor(self.limits.travel / self.step + 1e-6)

    @property
    def max_hz(self) -> float:
        """Step frequency of the largest speed f_max [Hz]."""
        return self.hz(self.limits.speed)

    def hz(self, speed: float) -> float:
        """Step frequency of a speed [m/s] as [Hz]; 20 mm/s in steps of 5 um are 4000 Hz, not a rounding error less."""
        return float(f"{speed / self.step:.12g}")

    @property
    def upper_end(self) -> float:
        """Position of the last whole step of the travel [m]."""
        return self.position_of(self.steps)

    def position_of(self, step: int) -> float:
        """Position of a step boundary [m]."""
        return self.mechanics.lower_end + step * self.step

    def step_at(self, position: float) -> int:
        """Step boundary nearest to a position [m]; may lie outside 0..N."""
        return round((position - self.mechanics.lower_end) / self.step)

    def step_inside(self, position: float) -> int:
        """Step boundary of the travel nearest to a position [m]; the end of a travel that is no whole number is N."""
        return min(max(self.step_at(position), 0), self.steps)


class StepperEnvelopeSpec(AxisSpec, frozen=True):
    """An axis of one or several steppers as its file describes it, in SI units."""

    axis: StepperAxisTable
    controller: ControllerTable = Field(default_factory=ControllerTable)
    stepper: dict[str, StepperTable] = named("a motor by its name", MOTOR_NAME, min_length=1, max_length=MOST_MOTORS)

    @property
    def turning(self) -> frozenset[str]:
        """Names of the motors that turn what they move."""
        return frozenset(name for name, table in self.stepper.items() if table.turns)


def fill_derived(spec: StepperEnvelopeSpec) -> StepperEnvelopeSpec:
    """Fill the defaults that depend on another table, as their `derived` texts say."""
    return spec.model_copy(update={"stepper": {name: _filled(table) for name, table in spec.stepper.items()}})


def _filled(table: StepperTable) -> StepperTable:
    lower, drive = table.mechanics.lower_end, table.drive
    mechanics = _given(table.mechanics, start_position=lower)
    extremes = _given(table.extremes, start=lower, turn=table.upper_end, stop=lower)
    if drive.current is None:
        drive = drive.model_copy(update={"current": table.motor.rated_current})
    home, ends = table.home, (lower, table.upper_end)
    if home is not None:
        home = home.completed(ends, table.limits.speed, table.mechanics.per_turn)
    return table.model_copy(update={"mechanics": mechanics, "extremes": extremes, "drive": drive, "home": home})


def _given(table: Any, **defaults: float) -> Any:
    """Copy of a table in which open values have their defaults."""
    return table.model_copy(update={key: value for key, value in defaults.items() if math.isnan(getattr(table, key))})
