"""What an axis file of the print-head method may say: every key with its unit, bounds, default and meaning.

The models hold SI floats; text with units is read on the way in (`fields.Unit`). Models are only made from files and
overrides, by `load`, which also fills the defaults that depend on another table.
"""

import math
from typing import Any, Literal

from pydantic import Field

from detent.axisfile.tables import (
    AxisSpec,
    AxisTable,
    EncoderTable,
    FrictionTables,
    MotorTable,
    ObstacleTable,
    PushTable,
)
from detent.files.fields import Table, optional, required
from detent.files.quantities import INCH, Length, Mass, Percentage, Resistance, Time, Velocity, Voltage

EMITTER = INCH / 300  # head travel per encoder cycle the method assumes [m] (2.1)
COLUMN = INCH / 120  # distance of two print columns [m]: the finest step of a daisy-wheel stream
SPEED_STEP = INCH / 6  # velocity of one speed value [m/s] (2.1)
FULL_DRIVE_COUNTS = 300  # drive value that gives the full supply voltage (2.1)

SPEED_RANGE: Any = {
    "allowed": "a velocity from 3 in/s to 40 in/s (76.2 mm/s to 1.016 m/s)", "ge": 3 * INCH, "le": 40 * INCH,
}  # fmt: skip
HOMING_RANGE: Any = {
    "allowed": "a velocity from 3 in/s to 10 in/s (76.2 mm/s to 254 mm/s)", "ge": 3 * INCH, "le": 10 * INCH,
}  # fmt: skip


def speed_value(velocity: float) -> int:
    """Speed value of the axis computer for a velocity: whole steps of 1/6 in/s, rounded down [1/6 in/s].

    >>> speed_value(1.016)
    240
    >>> speed_value(1.0)
    236
    """
    # A velocity on the grid may lie a rounding error below it.
    return math.floor(velocity / SPEED_STEP + 1e-9)


class PrintHeadAxisTable(AxisTable, frozen=True):
    """Name and method of the axis."""

    method: Literal["print_head"] = required("control method", '"print_head"')
    fidelity: Literal["averaged", "switch-level"] = optional(
        "bridge model: averaged over each PWM period, or every switch with its diodes", "averaged"
    )


class LimitsTable(Table, frozen=True):
    """What the axis must never exceed."""

    travel: Length = required("free travel of the head between the two side frames", '"14.5 in"', gt=0.0, le=10.0)
    speed: Velocity = required(
        "highest head speed ever commanded; rounded down to 1/6 in/s", '"40 in/s"', **SPEED_RANGE
    )
    effort: Voltage = required("largest average motor voltage", '"38 V"', gt=0.0, le=1000.0)


class DriveTable(Table, frozen=True):
    """Supply and bridge."""

    supply: Voltage = required("supply of the bridge: what 300 drive counts give", '"38 V"', gt=0.0, le=1000.0)
    bridge_resistance: Resistance = optional("two closed switches and the wiring", 0.0, ge=0.0, le=1e5)


class MechanicsTable(Table, frozen=True):
    """Pulley, belt and carriage."""

    pulley_circumference: Length = required("head travel per motor turn", '"3 in"', gt=0.0, le=10.0)
    carriage_mass: Mass = required("carriage with the head", '"1.1 kg"', gt=0.0, le=1000.0)
    belt_mass: Mass = optional("belt and pulleys, as a mass moving with the carriage", 0.0, ge=0.0, le=1000.0)
    start_position: Length = optional(
        "head position at power-on, from the left frame", math.nan, derived="0.25 x limits.travel", ge=0.0
    )
    friction: FrictionTables


class MethodTable(Table, frozen=True):
    """Choices and constants of the axis computer's program."""

    span: Literal["emf", "steady"] = optional("basis of the ramp interval (3.10)", "emf")
    intercept: Literal["measured", "literal"] = optional(
        "low speed used for the friction value: as measured, or the nominal 10 in/s (3.3)", "measured"
    )
    ack_last: bool = optional("answer FF to the last byte of a command as well (3.1)", default=False)
    transition: bool = optional(
        "regenerative braking at the start of a stop; off: the head coasts (3.12)", default=True
    )
    friction_jump: bool = optional("step of the drive at a turn-around, as friction changes sign (3.13)", default=True)
    trim: bool = optional("slow correction of the steady drive, one count per 16 ms (3.7, 3.11)", default=True)
    overspeed_test: bool = optional("halved drive at low speed while too fast (3.8)", default=True)
    memory: bool = optional("reuse of the last trimmed drive value (3.5)", default=True)
    default_slope: int = optional("slope at power-on, 1/256 count per 1/6 in/s (3.3)", 152, ge=1, le=1023)
    default_friction_counts: int = optional("friction at power-on, drive counts (3.3)", 32, ge=0, le=200)
    ir_counts: int = optional("drive counts added to accelerate, subtracted to brake (2.5)", 96, ge=1, le=250)
    slope_min: int = optional("smallest plausible slope, 1/256 count per 1/6 in/s (3.3)", 100, ge=1, le=1023)
    slope_max: int = optional("largest plausible slope, 1/256 count per 1/6 in/s (3.3)", 255, ge=1, le=1023)
    friction_max_counts: int = optional("largest plausible friction, drive counts (3.3)", 80, ge=0, le=250)
    zero_speed_timeout: Time = optional(
        "time without an emitter that counts as standstill (4.1)", 5e-3, ge=1.2e-3, le=0.1
    )
    max_print_speed: Velocity = optional(
        "speed preselected for printing; rounded down to 1/6 in/s", math.nan, derived="limits.speed", **SPEED_RANGE
    )


class HomingTable(Table, frozen=True):
    """Search for the two side frames."""

    speed: Velocity = optional("speed of both passes", 0.127, **HOMING_RANGE)
    drive_limit_counts: int = optional("largest drive value while homing (3.2)", 110, ge=1, le=FULL_DRIVE_COUNTS)
    contact_timeout: Time = optional("time without an emitter that counts as contact (3.2)", 50e-3, ge=5e-3, le=1.0)
    width_tolerance: Length = optional(
        "how much narrower than limits.travel the measured width may be", 0.00127, ge=0.0
    )


class PrintTable(Table, frozen=True):
    """The printed line."""

    left_margin: Length = optional("head position of column 0, from the left frame", 0.0381, ge=0.0)
    flight_time: Time = optional("from the trigger to the print on the paper", 350e-6, ge=0.0, le=0.01)


class DisturbanceTable(Table, frozen=True):
    """How the true machine differs from the tables above; the axis computer does not know."""

    motor_constant: Percentage = optional("drift of torque and back-EMF constant", 0.0, ge=-0.9, le=2.0)
    friction_right: Percentage = optional("drift of the friction drive Vf to the right", 0.0, ge=-1.0, le=5.0)
    friction_left: Percentage = optional("drift of the friction drive Vf to the left", 0.0, ge=-1.0, le=5.0)
    supply: Voltage = optional("true supply voltage", math.nan, derived="drive.supply", gt=0.0, le=1000.0)
    obstacle: ObstacleTable | None = None
    push: PushTable | None = None


class PrintHeadSpec(AxisSpec, frozen=True):
    """A print-head axis as its file describes it, in SI units."""

    axis: PrintHeadAxisTable
    limits: LimitsTable
    motor: MotorTable
    drive: DriveTable
    mechanics: MechanicsTable
    encoder: EncoderTable
    method: MethodTable = Field(default_factory=MethodTable)
    homing: HomingTable = Field(default_factory=HomingTable)
    printing: PrintTable = Field(default_factory=PrintTable, alias="print")
    disturbance: DisturbanceTable = Field(default_factory=DisturbanceTable)


def fill_derived(spec: PrintHeadSpec) -> PrintHeadSpec:
    """Fill the defaults that depend on another table, as their `derived` texts say."""
    return spec.filled(
        mechanics={"start_position": 0.25 * spec.limits.travel},
        method={"max_print_speed": spec.limits.speed},
        disturbance={"supply": spec.drive.supply},
    )
