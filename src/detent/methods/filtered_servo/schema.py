"""What an axis file of the filtered-servo method may say: every key with its unit, bounds, default and meaning.

Sections in brackets are those of the filtered-servo specification; a pulse is a quarter of an encoder cycle.
"""

import math
from typing import Literal

from pydantic import Field

from detent.axisfile.tables import (
    AxisSpec,
    AxisTable,
    DisturbanceTable,
    EncoderTable,
    InnerHomeTable,
    MotionProtectionTable,
    MotorTable,
    ScrewTable,
    breaking_effort,
)
from detent.files.fields import Table, optional, required
from detent.files.quantities import (
    Acceleration,
    Current,
    Force,
    Frequency,
    Inductance,
    Length,
    Resistance,
    Time,
    Velocity,
    Voltage,
)


class FilteredServoAxisTable(AxisTable, frozen=True):
    """Name and method of the axis."""

    method: Literal["filtered_servo"] = required("control method", '"filtered_servo"')


class LimitsTable(Table, frozen=True):
    """What the axis must never exceed."""

    travel: Length = required("free travel of the slide between its two ends", '"0.5 m"', gt=0.0, le=100.0)
    speed: Velocity = required("largest speed ever commanded", '"125 mm/s"', start='"100 mm/s"', gt=0.0, le=100.0)
    effort: Force = required("largest force of the motor on the slide at standstill", '"280 N"', ge=1e-3, le=1e6)


class ServoMotorTable(MotorTable, frozen=True):
    """Constants of the DC motor, from a catalogue or stated; the winding's inductance may be neglected."""

    inductance: Inductance = optional(
        "winding; 0 lets the current follow voltage and speed at once", 0.0, ge=0.0, le=10.0
    )


class DriveTable(Table, frozen=True):
    """PWM and power amplifier."""

    amplifier: Literal["current", "voltage"] = optional(
        "what the amplifier imposes on the motor: a current (ideal plant), or a voltage (plant with back-EMF)",
        "current",
    )
    current_per_count: Current = optional(
        "current amplifier: current per count of the drive word", 0.0352, ge=1e-9, le=100.0
    )
    supply: Voltage = optional("voltage amplifier: voltage of a full drive word", 12.0, ge=0.1, le=1000.0)
    bridge_resistance: Resistance = optional("closed switches and wiring", 0.0, ge=0.0, le=1e5)
    word_bits: int = optional("width of the drive word; it saturates", 8, ge=4, le=16)
    whole_words: bool = optional(
        "round the drive word to whole counts; off: it keeps the filter's fraction", default=False
    )
    pwm_frequency: Frequency = optional(
        "how often the PWM takes over the drive word",
        20e3,
        allowed="100 kHz divided by a whole number",
        ge=100.0,
        le=1e5,
    )


class MethodTable(Table, frozen=True):
    """Choices and constants of the control."""

    filter: Literal["float", "fixed", "none"] = optional(
        "filter of the counted speed: floating point, fixed point, or none as in the conventional servo", "float"
    )
    coefficient: float = optional(
        "A = TS/Tf: share of a new sample in the filter's output (3.4)",
        0.25,
        start="0.5",
        allowed="a number from 1/4096 up to 1; 1 means no filter, above it the output swings",
        ge=2.0**-12,
        le=1.0,
    )
    fraction_bits: int = optional("fixed point: bits after the point", 8, ge=0, le=16)
    scale: int = optional("B: multiplier of the counted speed", 4, ge=1, le=256)
    sample_period: Time = optional(
        "TS: period of the one sample clock (2, block 10)",
        5e-3,
        allowed="a time from 100 us up to 100 ms, in whole microseconds",
        ge=1e-4,
        le=0.1,
    )
    counter_bits: int = optional("width of the speed counter: two or three 4-bit counters", 8, ge=8, le=12)
    position_gain: float = optional("K1: drive counts per pulse of following error", 1.0, ge=1e-3, le=100.0)
    position_bits: int = optional("width of the position counter; beyond it the drive trips", 12, ge=8, le=16)
    command_acceleration: Acceleration = optional(
        "acceleration of the commanded speed; 0 jumps to it", 0.0, start='"0.5 m/s^2"', ge=0.0, le=1e4
    )
    in_position: int = optional("following in-position window, in pulses", 2, start="4", ge=0, le=1000)
    in_position_time: Time = optional("time in the window until the axis is in position", 50e-3, gt=0.0, le=10.0)
    timeout: Time = optional(
        "time from the end of the command until a move that is not in position has failed", 2.0, gt=0.0, le=1000.0
    )


class FilteredServoSpec(AxisSpec, frozen=True):
    """A filtered-servo axis as its file describes it, in SI units."""

    axis: FilteredServoAxisTable
    limits: LimitsTable
    motor: ServoMotorTable
    drive: DriveTable = Field(default_factory=DriveTable)
    mechanics: ScrewTable
    encoder: EncoderTable
    method: MethodTable = Field(default_factory=MethodTable)
    protection: MotionProtectionTable = Field(default_factory=MotionProtectionTable)
    home: InnerHomeTable | None = None
    disturbance: DisturbanceTable = Field(default_factory=DisturbanceTable)

    @property
    def pulse(self) -> float:
        """Travel per pulse of the decoder [m]."""
        return self.mechanics.travel_per_revolution / (4 * self.encoder.cycles_per_revolution)

    @property
    def mass(self) -> float:
        """All that moves, at the slide [kg]."""
        return self.mechanics.mass(self.motor)

    @property
    def force_per_count(self) -> float:
        """Force on the slide at standstill per count of the drive word [N]."""
        current = self.drive.current_per_count
        if self.drive.amplifier == "voltage":
            full = 1 << (self.drive.word_bits - 1)
            current = self.drive.supply / full / (self.motor.resistance + self.drive.bridge_resistance)
        return current * self.motor.torque_constant / self.mechanics.radius

    @property
    def gain(self) -> float:
        """K = K3 K4: acceleration per count of the drive word [pulses/s^2]."""
        return self.force_per_count / self.mass / self.pulse

    @property
    def motor_time_constant(self) -> float:
        """tau_m of back-EMF damping [s]; infinite with a current amplifier."""
        if self.drive.amplifier == "current":
            return math.inf
        resistance = self.motor.resistance + self.drive.bridge_resistance
        damping = self.motor.torque_constant * self.motor.back_emf_constant / resistance
        return self.mass * self.mechanics.radius**2 / damping

    @property
    def word_limit(self) -> float:
        """Largest magnitude of the drive word [counts]: of its width, or of limits.effort if that is less."""
        limit = min((1 << (self.drive.word_bits - 1)) - 1.0, self.limits.effort / self.force_per_count)
        return float(math.floor(limit)) if self.drive.whole_words else limit

    def holding_word(self, speed: float) -> float:
        """Drive word that holds a speed [m/s] against back-EMF and friction [counts]; the harder direction."""
        friction = self.mechanics.friction
        force = max(table.coulomb + table.viscous * speed for table in (friction.right, friction.left))
        return speed / self.pulse / self.motor_time_constant / self.gain + force / self.force_per_count

    def following_error(self, speed: float) -> float:
        """Steady following error at a speed [m/s]: the speed word and the holding word over K1 [pulses]."""
        word = speed / self.pulse * self.method.scale * self.method.sample_period
        return (word + self.holding_word(speed)) / self.method.position_gain

    @property
    def most_counted(self) -> int:
        """Largest count of a window [pulses]: one more is about to wrap, which is a fault (4)."""
        return (1 << (self.method.counter_bits - 1)) - 2

    def counted(self, speed: float) -> int:
        """Largest count of a window at a steady speed [m/s] [pulses]."""
        return math.ceil(speed / self.pulse * self.method.sample_period * (1 - 1e-9))


def fill_derived(spec: FilteredServoSpec) -> FilteredServoSpec:
    """Fill the defaults that depend on another key, as their `derived` texts say."""
    friction = spec.mechanics.friction
    static = max(friction.right.static, friction.left.static)
    share = breaking_effort(static, spec.word_limit * spec.force_per_count)
    if spec.home is not None:
        ends = 0.0, spec.limits.travel
        turn = spec.mechanics.travel_per_revolution
        spec = spec.changed(home=spec.home.completed(ends, spec.limits.speed, turn))
    return spec.filled(mechanics={"start_position": 0.1 * spec.limits.travel}, protection={"stuck_effort": share})
