"""What an axis file of the cascade method may say: every key with its unit, bounds, default and meaning.

The keys are written for an axis that slides. Where ``axis.motion = "rotary"`` the same keys hold with rad for m, N*m
for N and kg*m^2 for kg (`axisfile.motion`): a mass is then a moment of inertia, a force a torque.
"""

import math
from typing import Literal, TypeVar

from pydantic import Field

from detent.axisfile.elementwise import least, root
from detent.axisfile.motion import unit_in
from detent.axisfile.tables import (
    AxisSpec,
    AxisTable,
    HardwareTable,
    HomeTable,
    LimitSwitchTable,
    MotionProtectionTable,
    MotorTable,
    PushTable,
    breaking_effort,
    usual_stiction,
)
from detent.errors import DetentError
from detent.files.fields import Table, begun, optional, required
from detent.files.quantities import (
    Acceleration,
    Current,
    CurrentPerVoltage,
    Force,
    ForcePerVoltage,
    Inductance,
    Jerk,
    Length,
    Mass,
    Stiffness,
    Time,
    Torque,
    Velocity,
    Viscosity,
    Voltage,
    VoltagePerLength,
    VoltagePerLengthTime,
    VoltagePerVelocity,
)
from detent.kernel.registers import Registers, single

R = TypeVar("R", bound=Registers)

MOST_SAMPLES = 63  # samples that the memory of an encoder or of the amplifier reaches back (`sensing.position_sensor`)

MOST_SLIP = 1e3  # [m]
BLOWS = 10  # times the largest effort that a blow from outside may twist a coupling by, which does not slip for that


class CascadeAxisTable(AxisTable, frozen=True):
    """Name and method of the axis."""

    method: Literal["cascade"] = required("control method", '"cascade"')
    motion: Literal["linear", "rotary"] = optional(
        "linear or rotary; a rotary axis has rad for m, N*m for N and kg*m^2 for kg in every key",
        "linear",
    )


class LimitsTable(Table, frozen=True):
    """What the axis must never exceed."""

    travel: Length = required("free travel between both ends", '"0.5 m"', turned='"360 deg"', gt=0.0, le=1e5)
    lowest: Length = optional("position of the lower end", 0.0, ge=-1e5, le=1e5)
    speed: Velocity = required("largest speed ever commanded", '"0.5 m/s"', turned='"360 deg/s"', gt=0.0, le=1e4)
    acceleration: Acceleration = required(
        "largest acceleration ever commanded", '"5 m/s^2"', turned='"3600 deg/s^2"', gt=0.0, le=1e7
    )
    jerk: Jerk | None = optional(
        "largest jerk ever commanded; none: trapezoidal velocity profile", None, gt=0.0, le=1e10
    )
    effort: Force = required(
        "largest force (rotary: torque) of the drive on the axis", '"500 N"', turned='"0.9 N*m"', ge=1e-9, le=1e7
    )


class CascadeMotorTable(MotorTable, frozen=True):
    """Constants of the DC motor, from a catalogue or stated; the winding's inductance may be neglected."""

    max_current: Current | None = optional(
        "continuous current of the motor; for a warning, and with protection.thermal_time for a fault",
        None, gt=0.0, le=10000.0,
    )  # fmt: skip
    inductance: Inductance = optional(
        "winding; 0: the current follows voltage and speed instantly", 0.0, ge=0.0, le=10.0
    )


class DriveTable(Table, frozen=True):
    """Converter and amplifier."""

    input: Literal["force", "current", "voltage"] = optional(
        "what the amplifier controls: force (rotary: torque), motor current, or motor voltage",
        "force",
        start='"current"',
    )
    effort_per_volt: ForcePerVoltage = optional("input force: force per volt of command", 1.0, ge=1e-9, le=1e9)
    current_per_volt: CurrentPerVoltage = optional(
        "input current: current per volt of command", 1.0, start='"0.4 A/V"', ge=1e-9, le=1e6
    )
    voltage_gain: float = optional("input voltage: volts at the motor per volt of command", 1.0, ge=1e-6, le=1e6)
    command_limit: Voltage = optional("largest output of the converter", 10.0, ge=1e-6, le=1e6)
    command_step: Voltage = optional("step of the converter; 0: none", 0.0, ge=0.0, le=1e3)
    delay: int = optional("samples until a command acts; 0: immediately at its sample", 0, ge=0, le=MOST_SAMPLES)
    max_current: Current | None = optional(
        "inputs current and voltage: limit of the amplifier; without it limits.effort decides", None, gt=0.0, le=1e6
    )


class DirectionTable(Table, frozen=True):
    """Friction in one direction of motion."""

    coulomb: Force = optional("friction while moving, at any speed", 0.0, ge=0.0, le=1e7)
    static: Force = optional("breakaway force", usual_stiction, derived="1.15 x coulomb", ge=0.0, le=2e7)
    stribeck: Velocity = optional(
        "velocity at which 1/e of the difference of both remains; 0: it ends as motion starts", 0.0, ge=0.0, le=1e3
    )
    viscous: Viscosity = optional("friction per speed", 0.0, ge=0.0, le=1e8)


class FrictionTable(Table, frozen=True):
    """Friction of one mass, each direction for itself."""

    offset: Force = optional(
        "constant force against the positive direction, independent of motion", 0.0, ge=-1e6, le=1e6
    )
    positive: DirectionTable = Field(default_factory=DirectionTable)
    negative: DirectionTable = Field(default_factory=DirectionTable)


class CouplingTable(Table, frozen=True):
    """Compliant coupling between motor and load."""

    stiffness: Stiffness = required("force per twist", '"20 N/um"', gt=0.0, le=1e12)
    damping: Viscosity = optional("force per difference of the velocities", 0.0, ge=0.0, le=1e8)
    backlash: Length = optional("free travel between both flanks", 0.0, ge=0.0, le=1e3)


class MechanicsTable(Table, frozen=True):
    """Motor, coupling and load in the coordinate of the axis."""

    travel_per_revolution: Length | None = optional(
        "travel of the axis per motor turn, such as the lead of a screw; rotary: 360 deg without a gear",
        None, derived="rotary with a motor: 360 deg; needed where a linear axis has a motor",
        start='"10 mm"', turned='"360 deg"', ge=1e-6, le=1e3,
    )  # fmt: skip
    motor_mass: Mass = optional(
        "mass on the motor side of the coupling, without [motor]'s rotor; rotary: moment of inertia",
        0.0, ge=0.0, le=1e7,
    )  # fmt: skip
    load_mass: Mass = optional(
        "mass on the load side of the coupling; rotary: moment of inertia",
        0.0,
        start='"30 kg"',
        turned='"0.001 kg*m^2"',
        ge=0.0,
        le=1e7,
    )
    weight: Force = optional("load's weight along the axis, + pulls in the negative direction", 0.0, ge=-1e7, le=1e7)
    pendulum: Torque = optional("rotary: weight of a load that hangs down at position 0, m g l", 0.0, ge=0.0, le=1e7)
    transmission_loss: float = optional(
        "share of the motor's force lost as friction of the transmission, moving or at rest", 0.0, ge=0.0, le=0.95
    )
    start_position: Length = optional(
        "axis position at power-on", math.nan, derived="0, or the nearest end of the travel",
        ge=-1e5, le=1e5,
    )  # fmt: skip
    friction: FrictionTable = Field(default_factory=FrictionTable)
    load_friction: FrictionTable = Field(default_factory=FrictionTable)
    coupling: CouplingTable | None = None


class BrakeTable(Table, frozen=True):
    """Holding brake on the motor's side of the coupling, closed by a spring: open while there is torque."""

    force: Force = required(
        "largest force on the axis that it holds (rotary: torque)", '"200 N"', turned='"2 N*m"', gt=0.0, le=1e7
    )
    open_time: Time = optional("time until it is open; the axis is not enabled before", 60e-3, ge=0.0, le=10.0)
    close_time: Time = optional("time until it is closed", 40e-3, ge=0.0, le=10.0)


class EncoderTable(Table, frozen=True):
    """Encoder that is read once per sample."""

    resolution: Length = required(
        "travel per count; 0: the position itself", '"1 um"', turned='"0.01 deg"', ge=0.0, le=1e3
    )
    delay: int = optional("samples until a position is read", 0, ge=0, le=MOST_SAMPLES - 1)
    velocity_span: int = optional("number of samples of the velocity difference", 1, ge=1, le=MOST_SAMPLES)
    velocity_filter: Time = optional("time constant of the velocity filter; 0: none", 0.0, ge=0.0, le=10.0)
    checked: bool = optional(
        "its words come over a link with a check (CRC, status bit), so that one that is none is known", default=False
    )


# What reads the position itself, in the place of an encoder that is not there.
IDEAL_ENCODER = EncoderTable.model_validate({"resolution": "0 m"})


class FeedbackTable(Table, frozen=True):
    """Which encoder the loops use."""

    position: Literal["motor", "load"] = optional("encoder of the position loop", "motor")
    velocity: Literal["motor", "load"] = optional("encoder of the velocity loop", "motor")


class FeedModelTable(Table, frozen=True):
    """The machine as the feedforward knows it, where that is not the machine of this file."""

    mass: Mass | None = optional("all masses", None, derived="of this file", ge=0.0, le=1e7)
    viscous: Viscosity | None = optional(
        "viscous friction, back-EMF included", None, derived="of this file", ge=0.0, le=1e9
    )
    coulomb_positive: Force | None = optional(
        "Coulomb friction in the positive direction, offset included", None, derived="of this file", ge=-1e7, le=1e8
    )
    coulomb_negative: Force | None = optional(
        "the same in the negative direction", None, derived="of this file", ge=-1e7, le=1e8
    )
    weight: Force | None = optional("load's weight along the axis", None, derived="of this file", ge=-1e7, le=1e7)
    pendulum: Torque | None = optional(
        "rotary: weight of a load that hangs", None, derived="of this file", ge=0.0, le=1e7
    )
    effort_per_volt: ForcePerVoltage | None = optional(
        "force per volt of command", None, derived="of this file", gt=0.0, le=1e15
    )


class FeedForwardTable(Table, frozen=True):
    """Shares of what the reference needs by the constants of this file; 0: none, 1: all of it."""

    velocity: float = optional(
        "share of the reference's velocity in the velocity demand (PID: 1 lets the derivative act on the error)",
        0.0, start="1.0", ge=0.0, le=2.0,
    )  # fmt: skip
    acceleration: float = optional("share of the command that accelerates all masses", 0.0, start="1.0", ge=0.0, le=2.0)
    viscous: float = optional(
        "share of the command against viscous friction, back-EMF included; of both directions the mean",
        0.0, ge=0.0, le=2.0,
    )  # fmt: skip
    coulomb: float = optional("share of the command against Coulomb friction and its offset", 0.0, ge=0.0, le=2.0)
    dead_band: Velocity = optional(
        "reference speed up to which there is none against Coulomb friction", 0.0, ge=0.0, le=1e4
    )
    weight: float = optional("share of the command that holds weight and pendulum", 0.0, ge=0.0, le=2.0)
    model: FeedModelTable | None = None


class MethodTable(Table, frozen=True):
    """Structure, gains and supervision."""

    structure: Literal["cascade", "pid"] = optional("position P over velocity P or PI, or a position PID", "cascade")
    sample_period: Time = optional("period of the loops", 1e-3, ge=1e-6, le=0.1)
    position_gain: float = optional(
        "cascade: velocity demand per position error [1/s]; needed", 0.0, start="40.0", ge=0.0, le=1e6
    )
    velocity_gain: VoltagePerVelocity = optional(
        "cascade: command per velocity error; needed", 0.0, start='"130 V*s/m"', turned='"2 V*s/rad"', ge=0.0, le=1e9
    )
    velocity_integral: VoltagePerLength = optional(
        "cascade: command per velocity error and time; 0: P",
        0.0,
        start='"2 kV/m"',
        turned='"30 V/rad"',
        ge=0.0,
        le=1e12,
    )
    velocity_limit: Velocity = optional(
        "cascade: largest velocity demand", math.nan, derived="1.25 x limits.speed", gt=0.0, le=1e5
    )
    proportional: VoltagePerLength = optional("PID: command per position error; needed", 0.0, ge=0.0, le=1e12)
    integral: VoltagePerLengthTime = optional("PID: command per position error and time", 0.0, ge=0.0, le=1e15)
    derivative: VoltagePerVelocity = optional("PID: command per velocity error", 0.0, ge=0.0, le=1e9)
    derivative_filter: Time = optional("PID: time constant of the filter of that error; 0: none", 0.0, ge=0.0, le=10.0)
    in_position: Length = optional(
        "in-position window", math.nan,
        derived="1e-4 x limits.travel, but at least 2 encoder counts", gt=0.0, le=1e5,
    )  # fmt: skip
    in_position_time: Time = optional("time in the window until the axis is in position", 50e-3, gt=0.0, le=10.0)
    dead_band: Length = optional(
        "position error up to which the integral holds still while the axis stands, against hunting; 0: none",
        0.0, ge=0.0, le=1e5,
    )  # fmt: skip
    timeout: Time = optional(
        "time allowed after the end of the reference until in position; then the move has failed",
        2.0,
        gt=0.0,
        le=1000.0,
    )
    following_error: Length = optional(
        "position error beyond which the drive switches off", math.nan, derived="0.1 x limits.travel", gt=0.0, le=1e6
    )
    feedback: FeedbackTable = Field(default_factory=FeedbackTable)
    feed_forward: FeedForwardTable = Field(default_factory=FeedForwardTable)


class ControllerTable(Table, frozen=True):
    """What the controller computes in."""

    arithmetic: Literal["double", "single"] = optional(
        "precision of the loops and of what watches them; positions are double in both", "double"
    )


class CascadeProtectionTable(MotionProtectionTable, frozen=True):
    """What ends a motion that is not what was asked for; a time or a length of 0 switches its watch off."""

    slip: Length = optional(
        "difference between the encoders of motor and load", math.nan,
        derived="backlash, 10 x twist of the coupling at the largest effort, 4 counts, what their delays make of it",
        ge=0.0, le=MOST_SLIP,
    )  # fmt: skip
    oscillation: Length = optional(
        "position error to one side and the other in turn, ten times, each within 100 ms", math.nan,
        derived="4 x method.in_position", ge=0.0, le=1e3,
    )  # fmt: skip
    thermal_time: Time = optional(
        "time constant of the motor's heat; needs motor.max_current, which it bears for ever", 0.0, ge=0.0, le=1e5
    )


class LoadPushTable(PushTable, frozen=True):
    """A force on the load for a while."""

    force: Force = required("force on the load, + in the positive direction", '"30 N"', ge=-1e7, le=1e7)


class DisturbanceTable(Table, frozen=True):
    """What the axis does not know of."""

    push: LoadPushTable | None = None


class CascadeSpec(AxisSpec, frozen=True):
    """A cascade axis as its file describes it, in SI units."""

    axis: CascadeAxisTable
    limits: LimitsTable
    motor: CascadeMotorTable | None = begun()
    drive: DriveTable = Field(default_factory=DriveTable)
    mechanics: MechanicsTable = Field(default_factory=MechanicsTable)
    brake: BrakeTable | None = None
    encoder: EncoderTable
    load_encoder: EncoderTable | None = None
    method: MethodTable = Field(default_factory=MethodTable)
    controller: ControllerTable = Field(default_factory=ControllerTable)
    protection: CascadeProtectionTable = Field(default_factory=CascadeProtectionTable)
    home: HomeTable | None = None
    limit_switches: LimitSwitchTable | None = None
    disturbance: DisturbanceTable = Field(default_factory=DisturbanceTable)
    hardware: HardwareTable | None = None

    def registers_of(self, declared: type[R]) -> type[R]:
        """A class of registers as this axis has it, in the arithmetic of its controller."""
        return single(declared) if self.controller.arithmetic == "single" else declared

    def unit(self, linear: str) -> str:
        """Unit of a quantity of this axis, by that of a linear axis: ``spec.unit("N")`` is ``"N*m"`` if it turns."""
        return unit_in(self.axis.motion, linear)

    @property
    def highest(self) -> float:
        """Position of the upper end [m]."""
        return self.limits.lowest + self.limits.travel

    @property
    def swing(self) -> float:
        """Time of one swing of the load against a motor that its loop holds [s]; 0 for a rigid axis."""
        coupling, mass = self.mechanics.coupling, self.mechanics.load_mass
        return 0.0 if coupling is None else math.tau * root(mass / coupling.stiffness)

    def friction(self, sense: int) -> DirectionTable:
        """Friction of motor and load together in the direction 1 or -1, offsets with it; its Stribeck curve apart."""
        tables = (self.mechanics.friction, self.mechanics.load_friction)
        sides = [(t.positive if sense > 0 else t.negative, sense * t.offset) for t in tables]
        return DirectionTable.model_construct(
            coulomb=sum(side.coulomb + offset for side, offset in sides),
            static=sum(side.static + offset for side, offset in sides),
            viscous=sum(side.viscous for side, _ in sides),
        )

    @property
    def viscous(self) -> float:
        """Viscous friction of motor and load together, of both directions the mean [N*s/m]."""
        tables = (self.mechanics.friction, self.mechanics.load_friction)
        return sum(0.5 * (t.positive.viscous + t.negative.viscous) for t in tables)

    @property
    def holding(self) -> float:
        """Force that holds the load against its weight, hanging loads at a quarter turn [N]."""
        return abs(self.mechanics.weight) + self.mechanics.pendulum

    @property
    def radius(self) -> float:
        """Travel per radian of the motor [m]; infinite without a motor, whose quantities then vanish."""
        per_revolution = self.mechanics.travel_per_revolution
        return math.inf if per_revolution is None else per_revolution / (2 * math.pi)

    @property
    def motor_mass(self) -> float:
        """All that moves on the motor's side of the coupling [kg]."""
        rotor = 0.0 if self.motor is None else self.motor.rotor_inertia / self.radius**2
        return self.mechanics.motor_mass + rotor

    @property
    def mass(self) -> float:
        """All that moves [kg]."""
        return self.motor_mass + self.mechanics.load_mass

    @property
    def force_constant(self) -> float:
        """Force on the axis per current of the motor [N/A]; 0 without a motor."""
        return 0.0 if self.motor is None else self.motor.torque_constant / self.radius

    @property
    def emf_constant(self) -> float:
        """Back-EMF per velocity of the axis [V*s/m]; 0 without a motor."""
        return 0.0 if self.motor is None else self.motor.back_emf_constant / self.radius

    @property
    def max_current(self) -> float:
        """Largest current of the motor: of the amplifier, or of limits.effort if that is less [A]."""
        most = self.limits.effort / self.force_constant if self.force_constant > 0 else math.inf
        return most if self.drive.max_current is None else least(most, self.drive.max_current)

    @property
    def effort_per_command(self) -> float:
        """Force at standstill per volt of command, limits aside [N/V]."""
        drive = self.drive
        if drive.input == "force" or self.motor is None:
            return drive.effort_per_volt
        if drive.input == "current":
            return drive.current_per_volt * self.force_constant
        return drive.voltage_gain * self.force_constant / self.motor.resistance

    @property
    def reckoned(self) -> dict[str, float]:
        """What the feedforward reckons with, by the keys of its model: as stated there, else that of the file."""
        stated = self.method.feed_forward.model
        own = {
            "mass": self.mass, "viscous": self.viscous + self.back_emf_drag,
            "coulomb_positive": self.friction(1).coulomb, "coulomb_negative": self.friction(-1).coulomb,
            "weight": self.mechanics.weight, "pendulum": self.mechanics.pendulum,
            "effort_per_volt": self.effort_per_command,
        }  # fmt: skip
        given = {name: getattr(stated, name) for name in own} if stated else {}
        return own | {name: value for name, value in given.items() if value is not None}

    @property
    def back_emf_drag(self) -> float:
        """Force per velocity by which back-EMF brakes [N*s/m]; 0 unless the motor is driven by a voltage."""
        if self.drive.input != "voltage" or self.motor is None:
            return 0.0
        return self.force_constant * self.emf_constant / self.motor.resistance

    @property
    def largest_command(self) -> float:
        """Largest magnitude of the command: of the converter, or what current and effort are limited to [V]."""
        limit = self.drive.command_limit
        if self.drive.input == "force":
            return least(limit, self.limits.effort / self.effort_per_command)
        return least(limit, self.max_current / self.drive.current_per_volt) if self.drive.input == "current" else limit

    @classmethod
    def of(cls, spec: AxisSpec, file: str) -> "CascadeSpec":
        """The specification of an axis of this method; that of another is refused."""
        if isinstance(spec, cls):
            return spec
        raise DetentError(
            f"{file}: got an axis of the method {spec.axis.method}; expected: cascade, whose constants are those of an "
            "identification; name an axis file of it, or leave it out"
        )

    def encoder_of(self, loop: Literal["position", "velocity"]) -> EncoderTable:
        """Encoder that a loop uses."""
        on_load = getattr(self.method.feedback, loop) == "load"
        return self.load_encoder or IDEAL_ENCODER if on_load else self.encoder

    @property
    def largest_effort(self) -> float:
        """Largest force at standstill [N]."""
        by_current = self.max_current * self.force_constant if self.force_constant > 0 else math.inf
        return least(least(self.limits.effort, self.largest_command * self.effort_per_command), by_current)


def fill_derived(spec: CascadeSpec) -> CascadeSpec:
    """Fill the defaults that depend on another key, as their `derived` texts say."""
    limits, mechanics = spec.limits, spec.mechanics
    filled: dict[str, float] = {}
    if math.isnan(mechanics.start_position):
        filled["start_position"] = min(max(0.0, limits.lowest), spec.highest)
    if mechanics.travel_per_revolution is None and spec.motor is not None and spec.axis.motion == "rotary":
        filled["travel_per_revolution"] = 2 * math.pi
    counts = 2 * max(spec.encoder.resolution, spec.load_encoder.resolution if spec.load_encoder else 0.0)
    window, far = max(1e-4 * limits.travel, counts), 0.1 * limits.travel
    derived: dict[str, object] = {"velocity_limit": 1.25 * limits.speed, "in_position": window, "following_error": far}
    spec = spec.changed(mechanics=filled).filled(method=derived)
    if spec.home is not None:
        ends, pitch = (limits.lowest, spec.highest), spec.mechanics.travel_per_revolution or 0.0
        spec = spec.changed(home=spec.home.completed(ends, limits.speed, pitch))
    if spec.limit_switches is not None:
        spec = spec.changed(limit_switches=spec.limit_switches.completed(limits.lowest, spec.highest))
    # What breaks the axis loose takes its weight, too.
    loose = max(spec.friction(1).static, spec.friction(-1).static) + spec.holding
    return spec.filled(protection={
        "stuck_effort": breaking_effort(loose, spec.largest_effort), "slip": _usual_slip(spec),
        "oscillation": 4 * spec.method.in_position,
    })  # fmt: skip


def _usual_slip(spec: CascadeSpec) -> float:
    """What a sound machine has between both encoders at most [m]; 0 where there is one."""
    if spec.load_encoder is None:
        return 0.0
    coupling, both = spec.mechanics.coupling, (spec.encoder, spec.load_encoder)
    twist = 0.0 if coupling is None else coupling.backlash + BLOWS * spec.largest_effort / coupling.stiffness
    late = abs(both[0].delay - both[1].delay) * spec.method.sample_period
    speed = 1.1 * max(spec.limits.speed, spec.method.velocity_limit)
    return min(twist + 4 * sum(one.resolution for one in both) + late * speed, MOST_SLIP)
