"""What an axis file of the phase-servo method may say: every key with its unit, bounds, default and meaning.

Sections in brackets are those of the phase-servo specification; a step is a pitch of the detector over N.
"""

import math
from typing import Annotated, Any, Literal

from annotated_types import Ge, Le
from pydantic import Field

from detent.axisfile.tables import (
    AxisSpec,
    AxisTable,
    DisturbanceTable,
    FrictionTables,
    InnerHomeTable,
    MotorTable,
    ProtectionTable,
    breaking_effort,
)
from detent.files.fields import Table, optional, required
from detent.files.quantities import (
    INCH,
    Acceleration,
    Angle,
    Current,
    Frequency,
    Inertia,
    Length,
    Mass,
    Percentage,
    Resistance,
    Time,
    Velocity,
    Voltage,
)

TABLE_ENTRIES = 4096  # entries of the velocity table at most (`control.phase_sequencer`)

Gain = Annotated[int, Ge(1), Le(1000)]
SPEED, POSITION = ([1, 1, 16], [1, 1, 8]), ([4, 16, 1], [3, 6, 1])
"""Gains of each mode by default, and with the literal order of clocks."""


def _gains(doc: str, gains: tuple[list[int], list[int]]) -> Any:
    """Declare the three gains of a mode."""
    derived, allowed = "{}, with the literal order {}".format(*gains), "three whole numbers from 1 to 1000"
    return optional(doc, [], derived=derived, allowed=allowed, min_length=3, max_length=3)


class PhaseServoAxisTable(AxisTable, frozen=True):
    """Name and method of the axis."""

    method: Literal["phase_servo"] = required("control method", '"phase_servo"')


class LimitsTable(Table, frozen=True):
    """What the axis must never exceed."""

    travel: Length = required(
        "free travel of the carriage between its two ends", '"14 in"', start='"300 mm"', gt=0.0, le=10.0
    )
    speed: Velocity = required(
        "largest velocity of the table, rounded down to a whole count per speed sample",
        '"0.35 m/s"',
        start='"0.25 m/s"',
        gt=0.0,
        le=10.0,
    )
    effort: Current = required("current limit of the bridge", '"6 A"', start='"3 A"', ge=1e-3, le=1000.0)


class DriveTable(Table, frozen=True):
    """Supply, bridge and PWM."""

    supply: Voltage = required("each side of the split supply, ES", '"24 V"', start='"48 V"', ge=0.1, le=1000.0)
    bridge_resistance: Resistance = optional("closed switch, sense resistor and wiring", 0.0, ge=0.0, le=1e5)
    pwm_bits: int = optional("width of drive word and sawtooth (3.9)", 8, ge=4, le=12)


class MechanicsTable(Table, frozen=True):
    """Pulley, wire and carriage."""

    pulley_circumference: Length = required(
        "carriage travel per motor turn", '"50.8 mm"', start='"40 mm"', ge=1e-4, le=10.0
    )
    carriage_mass: Mass = required("carriage with its load", '"0.6 kg"', start='"1 kg"', gt=0.0, le=1000.0)
    pulley_inertia: Inertia = optional("pulley and detector disc", 0.0, ge=0.0, le=0.1)
    start_position: Length = optional(
        "carriage position at power-on, from the left end", math.nan, derived="0.1 x limits.travel", ge=0.0
    )
    friction: FrictionTables


class DetectorTable(Table, frozen=True):
    """Resolver or Inductosyn on the motor shaft, and its comparator."""

    pitches_per_revolution: int = required("electrical turns per motor turn", "120", start="60", ge=1, le=100_000)
    counts: int = optional(
        "steps per pitch N, counts of the carrier cycle (section 2)",
        64,
        allowed="16, 32, 64, 128, 256, 512 or 1024",
        ge=16,
        le=1024,
    )
    lag_counts: int = optional(
        "lag of the position signal behind the carrier at every positioning point (3.5)", -1, derived="N/4 - 1", ge=0
    )
    gain_error: Percentage = optional("amplitude of the first winding over the second", 0.0, ge=-0.5, le=0.5)
    # The bounds are 30 deg, which reads back a rounding error above math.radians(30).
    quadrature_error: Angle = optional(
        "by how much the windings miss 90 deg", 0.0, allowed="an angle from -30 deg to 30 deg", ge=-0.5236, le=0.5236
    )
    amplitude: Percentage = optional(
        "amplitude of the secondary over its nominal: a weaker one lets offset and noise displace the edges farther",
        1.0,
        gt=0.0,
        le=10.0,
    )
    offset_error: Percentage = optional("offset of the comparator over the nominal amplitude", 0.0, ge=-0.45, le=0.45)
    jitter: Time = optional("rms displacement of an edge of the comparator by noise", 0.0, ge=0.0, le=1e-3)
    seed: int = optional("start of the random sequences of comparator and lines", 1, ge=0, le=2**62)


class ClockTable(Table, frozen=True):
    """Oscillator and divider."""

    oscillator: Frequency = optional("master clock; the reference clocks have half of it", 8e6, ge=1e5, le=1e8)
    order: Literal["robust", "literal"] = optional(
        "which set of taps and gains is the default: speed sample faster than the integration clock, or slower as in "
        "the patent's text (section 7)",
        "robust",
    )
    integrate_tap: int = optional(
        "integration clock: oscillator / 2^tap", -1, derived="13, with the literal order 12", ge=4, le=24
    )
    sample_tap: int = optional(
        "speed sample: oscillator / 2^tap", -1, derived="12, with the literal order 13", ge=4, le=24
    )


class MethodTable(Table, frozen=True):
    """Choices and constants of sequencer and law."""

    final: Literal["absolute", "incremental"] = optional(
        "what the stop is made by: the absolute word, or the counted pulses of the servo it is compared with",
        "absolute",
    )
    threshold: int = optional("distance at which speed mode ends, in steps (3.7)", 8, ge=1, le=1024)
    expected_spurious: int = optional(
        "pulses that noise may add or remove in one move, for the protection rule", 20, ge=0, le=1000
    )
    table_acceleration: Acceleration = optional("deceleration the velocity table is made for", 10.0, gt=0.0, le=1e4)
    speed_gains: list[Gain] = _gains("KS1, KS2, KS3: gains of setpoint, speed word and sum in speed mode (3.9)", SPEED)
    position_gains: list[Gain] = _gains(
        "KP1, KP2, KP3: gains of error, speed word and sum in position mode (3.9)", POSITION
    )
    speed_bits: int = optional("width of the speed counter", 8, ge=4, le=16)
    corrector: bool = optional("no zero while settling, dead band at stop (3.8)", default=True)
    integrator: bool = optional("integral of the error at stop (3.8)", default=True)
    dead_band: int = optional(
        "half width D of the dead band at stop, in steps; D + 1, at least 2, count as arrived", 1, ge=0, le=64
    )
    integral_limit: int = optional("largest magnitude of the integral", 127, ge=1, le=32767)
    ready_time: Time = optional("one-shot 108: from position mode to ready", 3e-3, gt=0.0, le=10.0)
    stop_time: Time = optional("one-shot 109: from position mode to stop", 20e-3, gt=0.0, le=20.0)
    stop_always_off: bool = optional("never enter the stopped phase: shows the limit cycle (test 28)", default=False)
    leave_antiphase: bool = optional("repair of the tracker's false lock at antiphase (3.4)", default=False)


class PrintTable(Table, frozen=True):
    """Where a line of text goes."""

    left_margin: Length = optional(
        "position of the first column, rounded to a pitch of the detector",
        math.nan,
        derived="1 in, at most half of limits.travel",
        ge=0.0,
    )
    character_pitch: Length = optional(
        "distance of two characters, a whole number of pitches of the detector",
        math.nan,
        derived="the whole number of pitches nearest to 1/10 in",
        gt=0.0,
        le=10.0,
    )
    hammer_time: Time = optional("time the carriage stands for a character after ready", 8e-3, ge=0.0, le=1.0)


class PhaseHomeTable(InnerHomeTable, frozen=True):
    """How a live axis finds its reference; without the table it cannot home."""

    by: Literal["index"] = required(
        "what gives the reference: the first positioning point behind the edge of a switch; the edge chooses the "
        "pitch, the detector's phase the place in it", '"index"'
    )  # fmt: skip
    edge_to_index: Length = optional(
        "way from the edge of the switch back to that positioning point", math.nan,
        derived="0.4 pitches of the detector", ge=0.0, le=1e3,
    )  # fmt: skip


class PhaseServoSpec(AxisSpec, frozen=True):
    """A phase-servo axis as its file describes it, in SI units."""

    axis: PhaseServoAxisTable
    limits: LimitsTable
    motor: MotorTable
    drive: DriveTable
    mechanics: MechanicsTable
    detector: DetectorTable
    clock: ClockTable = Field(default_factory=ClockTable)
    method: MethodTable = Field(default_factory=MethodTable)
    protection: ProtectionTable = Field(default_factory=ProtectionTable)
    printing: PrintTable = Field(default_factory=PrintTable, alias="print")
    home: PhaseHomeTable | None = None
    disturbance: DisturbanceTable = Field(default_factory=DisturbanceTable)

    @property
    def pitch(self) -> float:
        """Travel per electrical turn of the detector [m]."""
        return self.mechanics.pulley_circumference / self.detector.pitches_per_revolution

    @property
    def edge_jitter(self) -> float:
        """Rms displacement of an edge by noise at the true amplitude [s]: the slope of the crossing goes with it."""
        return self.detector.jitter / self.detector.amplitude

    @property
    def step(self) -> float:
        """Travel per count [m]."""
        return self.pitch / self.detector.counts

    @property
    def tick(self) -> float:
        """Period of the reference clocks, the base tick [s]."""
        return 2 / self.clock.oscillator

    @property
    def sample_period(self) -> float:
        """Window of the speed counter [s]."""
        return 2**self.clock.sample_tap / self.clock.oscillator

    @property
    def peak_count(self) -> int:
        """Largest entry of the velocity table [pulses per sample]."""
        return math.floor(self.limits.speed / self.step * self.sample_period + 1e-9)

    @property
    def arrived_steps(self) -> int:
        """Distance from a target that counts as arrived: two steps, or one more than the dead band leaves alone."""
        shaped = self.method.corrector and not self.method.stop_always_off
        return max(2, self.method.dead_band + 1) if shaped else 2

    def table_velocity(self, distance: int) -> int:
        """Entry of the velocity table for a distance in steps [pulses per sample] (7)."""
        v = math.sqrt(2 * self.method.table_acceleration * distance * self.step) / self.step * self.sample_period
        return min(self.peak_count, math.floor(v + 0.5))


def fill_derived(spec: PhaseServoSpec) -> PhaseServoSpec:
    """Fill the defaults that depend on another key, as their `derived` texts say."""
    literal, travel = spec.clock.order == "literal", spec.limits.travel
    static = max(spec.mechanics.friction.right.static, spec.mechanics.friction.left.static)
    # Force on the carriage at standstill with a full drive word [N].
    current = min(spec.drive.supply / (spec.motor.resistance + spec.drive.bridge_resistance), spec.limits.effort)
    stall = current * spec.motor.torque_constant * 2 * math.pi / spec.mechanics.pulley_circumference
    if spec.home is not None:
        home = spec.home.completed((0.0, travel), spec.limits.speed, spec.pitch)
        # Of a place that nobody states it takes the positioning point next to it, before which the switch still fits.
        near, most = round(home.position / spec.pitch), math.floor((travel - home.edge_to_index) / spec.pitch)
        least = math.ceil(home.edge_to_index / spec.pitch)
        own = (min(near, most) if home.side > 0 else max(near, least)) * spec.pitch
        own = spec.home.position if spec.home.position >= 0.0 else own
        spec = spec.changed(home=home.model_copy(update={"position": own}))
    character = max(1, round(INCH / 10 / spec.pitch)) * spec.pitch
    return spec.filled(
        mechanics={"start_position": 0.1 * travel},
        detector={"lag_counts": spec.detector.counts // 4 - 1},
        clock={"integrate_tap": 12 if literal else 13, "sample_tap": 13 if literal else 12},
        method={"speed_gains": SPEED[literal], "position_gains": POSITION[literal]},
        protection={"stuck_effort": breaking_effort(static, stall)},
        printing={"left_margin": min(INCH, travel / 2), "character_pitch": character},
    )
