"""Tables of the axis file that several control methods share, and what every specification has in common."""

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self, cast

from annotated_types import Ge, Le
from pydantic import Field

from detent.files.fields import Table, file_key, optional, required
from detent.files.quantities import (
    Angle,
    BackEmfConstant,
    Current,
    Force,
    Frequency,
    Inductance,
    Inertia,
    Length,
    Mass,
    Percentage,
    Resistance,
    Time,
    TorqueConstant,
    Velocity,
    Viscosity,
)


class AxisTable(Table, frozen=True):
    """Name and method of the axis; each method states the one word its `method` may be."""

    name: str = required(
        "name of the axis, shown in reports",
        '"print head"',
        allowed="text of 1 to 80 characters",
        min_length=1,
        max_length=80,
    )
    method: str
    creep: Percentage = optional(
        "live: share of the largest speed at which it creeps while its position is not known", 0.1, gt=0.0, le=1.0
    )


class HardwareTable(Table, frozen=True):
    """What stands at the other end of the wires when the axis runs live without a simulated plant."""

    id: str = required(
        "what the drive says of itself, as `detent live --drive` shows it: with another one the axis is not enabled",
        '"canopen 0x2a.0x1.0x3.0x7"',
        allowed="text of 1 to 80 characters",
        min_length=1,
        max_length=80,
    )


def _place(doc: str, example: str) -> Any:
    """Declare where a face is reached."""
    return optional(doc, "", allowed=f"text of up to 80 characters such as {example}", max_length=80)


class FacesTable(Table, frozen=True):
    """Protocols by which other people's software reaches the axis while it runs live; each is off without its key."""

    commands: bool = optional("whether they may move the axis; without it they read, and stop", default=False)
    epics: str = _place("EPICS motor record over Channel Access: name of the record", '"lab:m1"')
    pva: str = _place("the same over PV Access", '"lab:m1"')
    canopen: str = _place("CiA 402 drive: bus as python-can names it, and node", '"socketcan:can0@5"')
    modbus: str = _place("Modbus TCP: host and port", '":1502"')
    scpi: str = _place('lines in the style of SCPI: host and port, or "pty" for a terminal', '":5025"')
    grbl: str = _place("grbl 1.1: the same", '"pty"')
    gcs: str = _place("GCS 2.0 of PI: the same", '":50000"')
    zaber: str = _place("ASCII protocol of Zaber, in native units: the same", '":55550"')
    alpaca: str = _place("ASCOM Alpaca, a focuser or rotator: host and port", '":11111"')

    @property
    def wanted(self) -> dict[str, str]:
        """Address of each face that has one."""
        return {name: address for name, address in self if isinstance(address, str) and address}


class AxisSpec(Table, frozen=True):
    """What the specification of every control method has; the models of `methods.METHODS` derive from it."""

    axis: AxisTable
    faces: FacesTable | None = None

    def changed(self, **tables: Any) -> Self:
        """A copy with other values in its tables, ``changed(method={"scale": 1})``, or with other tables.

        Values are in SI units, and nothing is checked.
        """
        made = {
            name: getattr(self, name).model_copy(update=new) if isinstance(new, dict) else new
            for name, new in tables.items()
        }
        return self.model_copy(update=made)

    def varied(self, values: Mapping[str, float]) -> Self:
        """A copy with other values of keys, dotted, in SI units; nothing is checked."""
        made: Any = self
        for key, value in values.items():
            made = _put(made, key.split("."), value)
        return made

    def filled(self, **tables: dict[str, object]) -> Self:
        """The same where a value is still to be made, as its `derived` text says: NaN, a number below 0, or no list."""
        return self.changed(**{
            name: {key: value for key, value in values.items() if _is_open(getattr(getattr(self, name), key))}
            for name, values in tables.items()
        })  # fmt: skip


def _put(table: Any, path: list[str], value: float) -> Any:
    """A copy of nested tables, those that the user names among them, with another value."""
    first, *rest = path
    if isinstance(table, dict):
        held = cast("dict[str, Any]", table)
        return held | {first: _put(held[first], rest, value) if rest else value}
    model = cast("type[Table]", type(table))
    name = next(name for name, field in model.model_fields.items() if file_key(name, field) == first)
    return table.model_copy(update={name: _put(getattr(table, name), rest, value) if rest else value})


def _is_open(value: float | list[Any]) -> bool:
    """True for the marks of a default that is still to be made."""
    return not value if isinstance(value, list) else not value >= 0


def _stated_torque_constant(data: dict[str, Any]) -> float:
    """Back-EMF constant [V*s/rad]: in SI units the same number as the torque constant."""
    # A value that was refused is absent here; the file is then refused as a whole.
    return float(data.get("torque_constant", math.nan))


def usual_stiction(data: dict[str, Any]) -> float:
    """Static friction [N or N.m] by default: 1.15 times Coulomb (print-head specification, 7.2)."""
    return 1.15 * float(data.get("coulomb", math.nan))


class MotorTable(Table, frozen=True):
    """Constants of the brush DC motor, from a catalogue or stated."""

    catalogue: str = optional("motor of the catalogue, for the constants not stated here", "", max_length=80)
    torque_constant: TorqueConstant = required("torque per current", '"0.241 N*m/A"', ge=1e-6, le=100.0)
    back_emf_constant: BackEmfConstant = optional(
        "voltage per speed", _stated_torque_constant, derived="motor.torque_constant", ge=1e-6, le=100.0
    )
    resistance: Resistance = required("winding and brushes", '"12 ohm"', ge=1e-3, le=1e5)
    inductance: Inductance = required("winding", '"12 mH"', ge=1e-9, le=10.0)
    rotor_inertia: Inertia = required("rotor, without load", '"260 g*cm^2"', ge=1e-12, le=0.1)
    max_current: Current | None = optional(
        "continuous current of the motor; used for a warning only", None, gt=0.0, le=10000.0
    )


class FrictionTable(Table, frozen=True):
    """Friction in one direction of motion."""

    coulomb: Force = required("friction while moving, at any speed", '"7.5 N"', ge=0.0, le=1e5)
    viscous: Viscosity = optional("friction per speed", 0.0, ge=0.0, le=1e5)
    static: Force = optional("breakaway force", usual_stiction, derived="1.15 x coulomb", ge=0.0, le=1e5)


class FrictionTables(Table, frozen=True):
    """Friction, each direction for itself: a cable or a ribbon pulls one way."""

    right: FrictionTable
    left: FrictionTable


class ScrewTable(Table, frozen=True):
    """Screw and slide."""

    travel_per_revolution: Length = required(
        "lead of the screw: slide travel per motor turn", '"5 mm"', start='"20 mm"', ge=1e-5, le=10.0
    )
    moving_mass: Mass = optional("slide with its load", 0.0, start='"110 kg"', ge=0.0, le=1e5)
    screw_inertia: Inertia = optional("screw and coupling", 0.0, ge=0.0, le=10.0)
    start_position: Length = optional(
        "slide position at power-on, from the left end", math.nan, derived="0.1 x limits.travel", ge=0.0
    )
    friction: FrictionTables

    @property
    def radius(self) -> float:
        """Travel per radian of the motor [m]."""
        return self.travel_per_revolution / (2 * math.pi)

    def mass(self, motor: MotorTable) -> float:
        """All that moves, at the slide [kg]."""
        return self.moving_mass + (motor.rotor_inertia + self.screw_inertia) / self.radius**2


class EncoderTable(Table, frozen=True):
    """Incremental encoder on the motor shaft."""

    cycles_per_revolution: int = required("full cycles (four edges each) per motor turn", "900", ge=1, le=1_000_000)
    jitter: Angle = optional(
        "rms error of an edge, in degrees of one cycle (360 deg = 4 edges)",
        0.0,
        allowed='an angle from 0 deg to 30 deg of a cycle such as "5 deg"',
        ge=0.0,
        le=0.5236,  # 30 deg read back lie a rounding error above math.radians(30)
    )
    missing_edges: float = optional("probability that an edge is not seen", 0.0, ge=0.0, le=0.5)
    seed: int = optional("start of the random sequence of jitter and missing edges", 1, ge=0, le=2**63 - 1)


class BurstTable(Table, frozen=True):
    """Disturbances of the pulse lines at chosen moments: evenly spaced from `at`, or in the base ticks listed."""

    kind: Literal["+", "-", "remove", "lose sample", "corrupt"] = required(
        "a + or - pulse inserted, a pulse removed, a sample lost, or a sample of the sensor inverted", '"+"'
    )
    at: Time | None = optional(
        "time of the first one, in simulated time", None, derived="none: ticks are listed", ge=0.0, le=1e5
    )
    count: int = optional("how many", 1, ge=1, le=64)
    spacing: Time = optional("spacing", 24e-6, ge=0.0, le=100.0)
    ticks: list[Annotated[int, Ge(0), Le(2**53)]] = optional(
        "base ticks, instead of at, count and spacing",
        [],
        allowed="up to 64 whole numbers from 0, rising, such as [20000, 20096]",
        max_length=64,
    )


class InterferenceTable(Table, frozen=True):
    """Induction noise on the lines between sensor and counters, by rate; each kind at random moments."""

    inserted: Frequency = optional("pulses inserted, of either sign", 0.0, ge=0.0, le=1e5)
    removed: Frequency = optional("pulses removed", 0.0, ge=0.0, le=1e5)
    lost_samples: Frequency = optional("speed samples lost", 0.0, ge=0.0, le=1e5)
    corrupted: Frequency = optional("samples of the sensor inverted for a clock", 0.0, ge=0.0, le=1e5)
    burst: BurstTable | None = None


class ObstacleTable(Table, frozen=True):
    """Something solid in the way of the carriage."""

    position: Length = required("where the carriage is blocked, from the left end of its travel", '"7 in"', gt=0.0)


class PushTable(Table, frozen=True):
    """A force on the carriage for a while."""

    force: Force = required("force on the carriage, + to the right", '"3 N"', ge=-1e5, le=1e5)
    at: Time = required("start of the push, in simulated time", '"2 s"', ge=0.0, le=1e5)
    duration: Time = required("length of the push", '"60 ms"', gt=0.0, le=1e5)


class DisturbanceTable(Table, frozen=True):
    """What the axis does not know of."""

    push: PushTable | None = None
    lines: InterferenceTable = Field(default_factory=InterferenceTable)


FARTHEST_BACK = 1e3  # farthest way back behind a reference [m]


class HomeTable(Table, frozen=True):
    """How a live axis finds its reference; without the table it cannot home."""

    by: Literal["contact", "switch", "index"] = required(
        "what gives the reference: a hard stop, the edge of a switch, the first index mark behind that edge", '"switch"'
    )
    direction: Literal["negative", "positive"] = optional("in which direction it is looked for", "negative")
    position: Length = optional(
        "position of the axis at the reference", math.nan, derived="the end of the travel in that direction",
        ge=-1e5, le=1e5,
    )  # fmt: skip
    speed: Velocity = optional("speed of the search", math.nan, derived="limits.speed / 10", gt=0.0, le=1e3)
    creep: Velocity = optional(
        "speed at which it is approached from near", math.nan, derived="a tenth of that", gt=0.0, le=1e3
    )
    back_off: Length = optional(
        "way back before it is approached, and after it was found", math.nan, derived="limits.travel / 50",
        gt=0.0, le=FARTHEST_BACK,
    )  # fmt: skip
    edge_to_index: Length = optional(
        "index: way from the edge of the switch back to the mark", math.nan, derived="0.4 turns of the motor",
        ge=0.0, le=1e3,
    )  # fmt: skip

    @property
    def side(self) -> int:
        """Direction of the search, 1 or -1."""
        return 1 if self.direction == "positive" else -1

    def completed(self, ends: tuple[float, float], speed: float, pitch: float) -> Self:
        """The same with what was left to the ends of the travel [m], to the largest speed [m/s] and to a turn [m]."""
        search = speed / 10 if math.isnan(self.speed) else self.speed
        back = min((ends[1] - ends[0]) / 50, FARTHEST_BACK) if math.isnan(self.back_off) else self.back_off
        behind = 0.4 * pitch if math.isnan(self.edge_to_index) else self.edge_to_index
        end = ends[1] if self.side > 0 else ends[0]
        derived = {
            "position": end - self.side * self.inside(back, behind), "speed": search, "creep": search / 10,
            "back_off": back, "edge_to_index": behind,
        }  # fmt: skip
        return self.model_copy(update={key: new for key, new in derived.items() if math.isnan(getattr(self, key))})

    def inside(self, back: float, behind: float) -> float:
        """How far inside the travel a reference lies of which nobody states where [m].

        `back` is the way of backing off, `behind` that from the edge of a switch to its mark [m].
        """
        del back, behind
        return 0.0


class InnerHomeTable(HomeTable, frozen=True):
    """The same of an axis that cannot pass the ends of its travel."""

    position: Length = optional(
        "position of the axis at the reference", math.nan,
        derived="contact: the end of the travel in that direction; else its switch is home.back_off before it",
        ge=-1e5, le=1e5,
    )  # fmt: skip

    def inside(self, back: float, behind: float) -> float:
        """A switch or a mark beyond the end could never be passed [m]."""
        return 0.0 if self.by == "contact" else back + (behind if self.by == "index" else 0.0)


class LimitSwitchTable(Table, frozen=True):
    """Limit switches at both ends of the way, normally closed."""

    lower: Length = optional(
        "where the lower one opens", math.nan, derived="limits.lowest - limits.travel / 50", ge=-1e5, le=1e5
    )
    upper: Length = optional(
        "where the upper one opens", math.nan, derived="the upper end + limits.travel / 50", ge=-1e5, le=1e5
    )

    def completed(self, lowest: float, highest: float) -> Self:
        """The same with what was left to the ends of the travel [m]."""
        far = (highest - lowest) / 50
        derived = {"lower": lowest - far, "upper": highest + far}
        return self.model_copy(update={key: new for key, new in derived.items() if math.isnan(getattr(self, key))})


class ProtectionTable(Table, frozen=True):
    """What ends a motion that is not what was asked for; a time of 0 switches its watch off."""

    saturation_time: Time = optional("time the command may stay at its limit", 1.0, ge=0.0, le=1000.0)
    stuck_time: Time = optional("time without sensor motion under effort", 0.05, ge=0.0, le=10.0)
    stuck_effort: float = optional(
        "effort at which the axis must move, as a share of the largest", math.nan,
        derived="twice the static friction, from 0.3 to 1", ge=0.01, le=1.0,
    )  # fmt: skip


class TurnProtectionTable(ProtectionTable, frozen=True):
    """The same of an axis whose controller can trust what its sensor counts, from sample to sample and for good."""

    overspeed: float = optional("overspeed limit, relative to limits.speed; 0: any", 1.1, ge=0.0, le=100.0)
    jump: float = optional(
        "movement in one sample that counts as a jump of the sensor, relative to that at limits.speed; 0: any",
        1.5, ge=0.0, le=100.0,
    )  # fmt: skip
    reversed_time: Time = optional("time the axis may accelerate against its effort", 0.02, ge=0.0, le=10.0)


class MotionProtectionTable(TurnProtectionTable, frozen=True):
    """The same of an axis whose way has ends."""

    travel: bool = optional("switch off beyond an end of the travel", default=True)


def breaking_effort(static: float, effort: float) -> float:
    """Share of the largest effort [N or N.m] under which the axis must move, with this static friction."""
    return min(max(0.3, 2.0 * static / effort), 1.0) if effort > 0.0 else 1.0
