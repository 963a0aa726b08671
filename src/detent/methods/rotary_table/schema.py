"""What an axis file of the rotary-table method may say: every key with its unit, bounds, default and meaning.

Sections in brackets are those of the rotary-table specification. Angles, speeds and accelerations are those of the
table unless a key says that they are the motor's.
"""

import math
from typing import Literal

from pydantic import Field

from detent.axisfile.tables import (
    AxisSpec,
    AxisTable,
    HardwareTable,
    TurnProtectionTable,
    breaking_effort,
    usual_stiction,
)
from detent.files.fields import Naming, Table, named, optional, required
from detent.files.quantities import (
    Angle,
    AngularAcceleration,
    AngularVelocity,
    Frequency,
    Inertia,
    Percentage,
    Time,
    Torque,
)

POSITION_NUMBER = Naming(
    placeholder="NUMBER",
    pattern="[0-9]|[1-9][0-9]|1[01][0-9]|12[0-7]",
    allowed="a position number from 0 to 127",
    example="1",
)
LARGEST_ERROR = 100.0  # largest deviation that protection.following_error may state [rad]


class RotaryTableAxisTable(AxisTable, frozen=True):
    """Name and method of the axis."""

    method: Literal["rotary_table"] = required("control method", '"rotary_table"')


class LimitsTable(Table, frozen=True):
    """What the axis must never exceed."""

    speed: AngularVelocity = required("largest speed ever commanded", '"60 deg/s"', gt=0.0, le=100.0)
    acceleration: AngularAcceleration = required(
        "acceleration and deceleration of the command", '"300 deg/s^2"', gt=0.0, le=1e4
    )
    effort: Torque = required("largest torque of the amplifier at the motor shaft", '"2 N*m"', ge=1e-6, le=1e5)


class MotorTable(Table, frozen=True):
    """Servo motor with its tachometer."""

    rotor_inertia: Inertia = required("rotor with tachometer", '"9 kg*cm^2"', ge=1e-9, le=100.0)
    max_speed: AngularVelocity = required("maximum speed of the motor shaft", '"2000 rpm"', gt=0.0, le=2e4)


class DriveTable(Table, frozen=True):
    """Speed register, D/A converter and servo amplifier with its velocity loop."""

    word_bits: int = optional("width of the bipolar speed word", 12, ge=6, le=24)
    full_speed: AngularVelocity = optional(
        "motor speed of the largest word", math.nan, derived="motor.max_speed", gt=0.0, le=2e4
    )
    time_constant: Time = optional("of the velocity loop, a first-order lag", 20e-3, ge=1e-4, le=10.0)
    droop: Percentage = optional("share of its reference by which the speed stays behind", 0.0, ge=0.0, le=0.5)


class MechanicsTable(Table, frozen=True):
    """Gear and table."""

    gear_ratio: float = required(
        "motor turns per turn of the table (3.1)", "90", allowed="a whole number from 2 to 1000000", ge=2, le=1e6
    )
    table_inertia: Inertia = optional("table with its load", 0.0, ge=0.0, le=1e6)
    gear_inertia: Inertia = optional("gear and coupling, at the motor shaft", 0.0, ge=0.0, le=100.0)
    backlash: Angle = optional("of the gear, at the table", 0.0, ge=0.0, le=0.2)
    eccentricity: Angle = optional("largest angle by which the table leads or lags the gear", 0.0, ge=0.0, le=0.2)
    eccentricity_angle: Angle = optional("angle at which it is right and begins to lead", 0.0, ge=-6.3, le=6.3)
    coulomb: Torque = optional("Coulomb friction at the motor shaft", 0.0, ge=0.0, le=1e5)
    static: Torque = optional("breakaway torque of the motor", usual_stiction, derived="1.15 x coulomb", ge=0.0, le=1e5)
    start_angle: Angle = optional("angle of the table at power-on", 0.0, ge=-6.3, le=6.3)


class FineTable(Table, frozen=True):
    """First resolver, one electrical turn per motor turn, and its phase comparator."""

    counts: int = optional("counter clocks in an excitation period: counts per motor turn F", 4096, ge=16, le=1 << 20)
    gain_error: Percentage = optional("amplitude of the first winding over the second", 0.0, ge=-0.5, le=0.5)
    quadrature_error: Angle = optional("angle by which the windings miss 90 deg", 0.0, ge=-0.5, le=0.5)
    offset_error: Percentage = optional("offset of the comparator over the amplitude", 0.0, ge=-0.45, le=0.45)
    noise: Angle = optional(
        "largest displacement of a zero crossing, in degrees of the excitation (360 deg is a turn of the shaft)",
        0.0, ge=0.0, le=0.5,
    )  # fmt: skip
    mounting: Angle = optional("electrical angle at table angle 0, which calibration takes out", 0.0, ge=-6.3, le=6.3)


class CoarseTable(FineTable, frozen=True):
    """Second resolver, one electrical turn per turn of the table, and its phase comparator."""

    counts: int = optional("counter clocks in an excitation period: counts per table turn", 4096, ge=16, le=1 << 20)
    reduction: float = optional(
        "motor turns per turn of this resolver (reduction 14)",
        math.nan,
        derived="mechanics.gear_ratio",
        allowed="a whole number from 2 to 1000000, equal to mechanics.gear_ratio",
        ge=2,
        le=1e6,
    )
    backlash: Angle = optional("of its reduction, at the resolver", 0.0, ge=0.0, le=0.5)
    eccentricity: Angle = optional(
        "largest angle by which the resolver leads or lags its reduction", 0.0, ge=0.0, le=0.5
    )
    eccentricity_angle: Angle = optional("angle at which it is right and begins to lead", 0.0, ge=-6.3, le=6.3)
    alignment_error: Angle = optional("what calibration against the fine resolver leaves", 0.0, ge=-3.2, le=3.2)


class DetectorTable(Table, frozen=True):
    """Absolute angle from both resolvers (3.1)."""

    clock: Frequency = optional("counter clock of the comparators", 20e6, ge=1e3, le=1e10)
    composition: Literal["rounded", "truncated"] = optional(
        "whole motor turns from the rounded difference of both words, or from the coarse word alone, which errs near "
        "each fine zero",
        "rounded",
    )
    fine: FineTable = Field(default_factory=FineTable)
    coarse: CoarseTable = Field(default_factory=CoarseTable)
    seed: int = optional("start of the random sequence of the noise", 1, ge=0, le=2**63 - 1)


class MethodTable(Table, frozen=True):
    """Clocks, loop and forms of the method."""

    strobe_period: Time = optional(
        "period of strobe and interrupt", 2e-3, allowed="a time from 0.2 ms up to 100 ms, in whole 0.1 ms",
        ge=2e-4, le=0.1,
    )  # fmt: skip
    interrupt_delay: Time = optional(
        "from the strobe to its interrupt", 2e-4, allowed="a time from 0.1 ms up to 100 ms, in whole 0.1 ms",
        ge=1e-4, le=0.1,
    )  # fmt: skip
    task_period: Time = optional(
        "period of the timer task", 20e-3, allowed="a time from 0.2 ms up to 1 s, in whole 0.1 ms", ge=2e-4, le=1.0
    )
    task_phase: Time = optional(
        "first pass of the timer task after power-on; at interrupt_delay each pass is interrupted",
        0.0, allowed="a time from 0 s up to 1 s, in whole 0.1 ms", ge=0.0, le=1.0,
    )  # fmt: skip
    position_gain: float = optional("Kp: speed per deviation [1/s]", 30.0, ge=0.01, le=1000.0)
    position_control: bool = optional("off: the speed signal is the commanded speed alone", default=True)
    form: Literal["turn counter", "flag", "raw"] = optional(
        "extension of the angle beyond a turn: signed turn counter (3.5), flag of the patent (3.2, 3.3), or none",
        "turn counter",
    )
    judge: Literal["theoretical", "actual"] = optional("remaining angle that triggers the rollover", "theoretical")
    inclusive: bool = optional("rollover at a remaining angle of T or less, not only below T", default=False)
    guarded: bool = optional("rollover only once the boundary has been crossed", default=False)
    update: Literal["atomic", "flag first", "remaining first"] = optional(
        "how both halves of a rollover are stored; in the last two an interrupt can come between", "atomic"
    )
    signed_remaining: bool = optional("off: the unsigned |M - R| of the flowchart", default=True)
    fraction_bits: int = optional("bits after the point of the remaining angle", 16, ge=0, le=16)
    in_position: int = optional("in-position window, in counts", 2, ge=0, le=100_000)
    in_position_time: Time = optional("time in the window until the axis is in position", 20e-3, gt=0.0, le=10.0)
    short_way: Angle = optional(
        "a target this near is taken the short way, whatever its direction", 0.0, ge=0.0, le=3.0
    )


class PositionTable(Table, frozen=True):
    """An entry of the position table PDT."""

    angle: Angle = required("where to", '"90 deg"', ge=-1e4, le=1e4)
    speed: AngularVelocity = optional("speed of the way there", math.nan, derived="limits.speed", gt=0.0, le=100.0)
    direction: Literal["shortest", "positive", "negative", "as commanded"] = optional(
        "way to it: the shorter one, always to larger or smaller angles, or counted from 0 of this turn without a wrap",
        "shortest",
    )


class TableProtectionTable(TurnProtectionTable, frozen=True):
    """What ends a motion that is not what was asked for; a time of 0 switches its watch off.

    The speed word may be at its limit: what a drive cannot follow shows in the deviation.
    """

    saturation_time: Time = optional("time the speed word may stay at its limit", 0.0, ge=0.0, le=1000.0)
    overspeed: float = optional(
        "speed that is a fault, as a share of limits.speed and what breaks the table loose; 0: any",
        1.25, ge=0.0, le=100.0,
    )  # fmt: skip
    reversed_time: Time = optional("time the table may accelerate against its effort", 0.05, ge=0.0, le=10.0)
    following_error: Angle = optional(
        "deviation dR that is a fault", math.nan, derived="twice that of limits.speed with the static friction",
        gt=0.0, le=LARGEST_ERROR,
    )  # fmt: skip
    following_time: Time = optional("time it may last", 0.06, ge=0.0, le=10.0)


class LoadTable(Table, frozen=True):
    """A torque on the table for a while."""

    torque: Torque = required("torque on the table, + to larger angles", '"20 N*m"', ge=-1e6, le=1e6)
    at: Time = required("begin, in simulated time", '"2 s"', ge=0.0, le=1e5)
    duration: Time = required("length", '"0.5 s"', gt=0.0, le=1e5)


class DisturbanceTable(Table, frozen=True):
    """What the axis does not know of."""

    load: LoadTable | None = None


class RotaryTableSpec(AxisSpec, frozen=True):
    """A rotary-table axis as its file describes it, in SI units."""

    axis: RotaryTableAxisTable
    limits: LimitsTable
    motor: MotorTable
    drive: DriveTable = Field(default_factory=DriveTable)
    mechanics: MechanicsTable
    detector: DetectorTable = Field(default_factory=DetectorTable)
    method: MethodTable = Field(default_factory=MethodTable)
    position: dict[str, PositionTable] = named("a position by its number", POSITION_NUMBER, start=True, max_length=128)
    protection: TableProtectionTable = Field(default_factory=TableProtectionTable)
    disturbance: DisturbanceTable = Field(default_factory=DisturbanceTable)
    hardware: HardwareTable | None = None

    @property
    def ratio(self) -> int:
        """Motor turns per turn of the table G."""
        return round(self.mechanics.gear_ratio)

    @property
    def period(self) -> int:
        """Range of the absolute angle T [count]."""
        return self.ratio * self.detector.fine.counts

    @property
    def count(self) -> float:
        """Angle of the table per count [rad]."""
        return 2 * math.pi / self.period

    @property
    def inertia(self) -> float:
        """All that turns, at the motor shaft [kg m^2]."""
        m = self.mechanics
        return self.motor.rotor_inertia + m.gear_inertia + m.table_inertia / self.ratio**2

    @property
    def viscous(self) -> float:
        """Friction at the motor that makes the droop [N m s/rad]."""
        return self.drive.droop * self.inertia / self.drive.time_constant

    @property
    def stiffness(self) -> float:
        """Torque of the amplifier per speed error [N m s/rad]; with the viscous friction it makes the time constant."""
        return (1 - self.drive.droop) * self.inertia / self.drive.time_constant

    @property
    def breaking_speed(self) -> float:
        """Speed signal whose torque at standstill is the static friction, at the table [rad/s]."""
        return self.mechanics.static / self.stiffness / self.ratio

    @property
    def largest_word(self) -> int:
        """Largest magnitude of the speed word [count]."""
        return (1 << (self.drive.word_bits - 1)) - 1

    @property
    def speed_per_word(self) -> float:
        """Table speed per count of the speed word [rad/s]."""
        return self.drive.full_speed / self.largest_word / self.ratio

    @property
    def largest_speed(self) -> float:
        """Table speed at the motor's limit, or at that of the largest word if it is less [rad/s]."""
        return min(self.motor.max_speed, self.drive.full_speed) / self.ratio

    def per_interrupt(self, speed: float) -> float:
        """A speed of the table [rad/s] as way per interrupt, in the interpolator's format [count/2^f]."""
        return speed / self.count * self.method.strobe_period * (1 << self.method.fraction_bits)

    @property
    def acceleration_word(self) -> float:
        """Acceleration of the command, in the interpolator's format per interrupt [count/2^f]."""
        method = self.method
        change = self.limits.acceleration * method.strobe_period**2 / self.count
        return change * (1 << method.fraction_bits)


def fill_derived(spec: RotaryTableSpec) -> RotaryTableSpec:
    """Fill the defaults that depend on another table, as their `derived` texts say."""
    speed, coarse = spec.limits.speed, spec.detector.coarse
    if math.isnan(coarse.reduction):
        coarse = coarse.model_copy(update={"reduction": spec.mechanics.gear_ratio})
    position = {
        number: entry.model_copy(update={"speed": speed}) if math.isnan(entry.speed) else entry
        for number, entry in spec.position.items()
    }
    spec = spec.model_copy(update={"position": position}).changed(detector={"coarse": coarse})
    spec = spec.filled(drive={"full_speed": spec.motor.max_speed})
    error = 2 * (speed / (1 - spec.drive.droop) + spec.breaking_speed) / spec.method.position_gain
    return spec.filled(
        protection={
            "stuck_effort": breaking_effort(spec.mechanics.static, spec.stiffness * spec.drive.full_speed),
            "following_error": min(error, LARGEST_ERROR),
        }
    )
