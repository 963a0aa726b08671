"""The control methods an axis file may name, and what each of them brings."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Generic, TypeAlias, TypeVar

from detent.axisfile.catalogue import DC_MOTORS, STEPPER_MOTORS, Catalogue
from detent.axisfile.motion import rotary_model
from detent.axisfile.tables import AxisSpec
from detent.files.findings import Caution, Contradiction, Derived
from detent.kernel.registers import Registers
from detent.methods.cascade.checks import RULES as CASCADE_RULES
from detent.methods.cascade.checks import find_cautions as find_cascade_cautions
from detent.methods.cascade.derive import derive as derive_cascade
from detent.methods.cascade.schema import CascadeSpec
from detent.methods.cascade.schema import fill_derived as fill_cascade
from detent.methods.filtered_servo.checks import RULES as FILTERED_SERVO_RULES
from detent.methods.filtered_servo.checks import find_cautions as find_filtered_servo_cautions
from detent.methods.filtered_servo.derive import derive as derive_filtered_servo
from detent.methods.filtered_servo.schema import FilteredServoSpec
from detent.methods.filtered_servo.schema import fill_derived as fill_filtered_servo
from detent.methods.phase_servo.checks import RULES as PHASE_SERVO_RULES
from detent.methods.phase_servo.checks import find_cautions as find_phase_servo_cautions
from detent.methods.phase_servo.derive import derive as derive_phase_servo
from detent.methods.phase_servo.schema import PhaseServoSpec
from detent.methods.phase_servo.schema import fill_derived as fill_phase_servo
from detent.methods.print_head.checks import RULES as PRINT_HEAD_RULES
from detent.methods.print_head.checks import find_cautions as find_print_head_cautions
from detent.methods.print_head.derive import derive as derive_print_head
from detent.methods.print_head.schema import PrintHeadSpec
from detent.methods.print_head.schema import fill_derived as fill_print_head
from detent.methods.rotary_table.checks import RULES as ROTARY_TABLE_RULES
from detent.methods.rotary_table.checks import find_cautions as find_rotary_table_cautions
from detent.methods.rotary_table.derive import derive as derive_rotary_table
from detent.methods.rotary_table.schema import RotaryTableSpec
from detent.methods.rotary_table.schema import fill_derived as fill_rotary_table
from detent.methods.stepper_envelope.checks import RULES as STEPPER_ENVELOPE_RULES
from detent.methods.stepper_envelope.checks import find_cautions as find_stepper_envelope_cautions
from detent.methods.stepper_envelope.derive import derive as derive_stepper_envelope
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec
from detent.methods.stepper_envelope.schema import fill_derived as fill_stepper_envelope

SpecT = TypeVar("SpecT", bound=AxisSpec)

AnySpec: TypeAlias = (
    PrintHeadSpec | PhaseServoSpec | FilteredServoSpec | RotaryTableSpec | StepperEnvelopeSpec | CascadeSpec
)
"""What a file is loaded to: the union of the specifications of all methods."""


@dataclass(frozen=True, slots=True)
class Method(Generic[SpecT]):
    """A control method, as far as the axis file is concerned.

    Attributes
    ----------
    name : str
        What ``axis.method`` says.
    title : str
        A few words for people.
    spec : type of AxisSpec
        Model of the whole file.
    fill : callable
        Fills the defaults that depend on another table.
    rules : tuple of callable
        What must hold between keys; each gives the contradictions it finds.
    derive : callable
        Derived figures, in the order they are read.
    cautions : callable
        What looks wrong with an axis that can be built.
    catalogue : Catalogue or None
        Motors that ``motor.catalogue`` may name.
    registers, parameters : callable
        Class of the axis's state and of its parameters. They load the compiled blocks, so they are only called where
        these are wanted.
    rotary : type of AxisSpec or None
        Model of the whole file where ``axis.motion = "rotary"``; None where the method has no such key.
    """

    name: str
    title: str
    spec: type[SpecT]
    fill: Callable[[SpecT], SpecT]
    rules: tuple[Callable[[SpecT], Iterator[Contradiction]], ...]
    derive: Callable[[SpecT], tuple[Derived, ...]]
    cautions: Callable[[SpecT], Iterator[Caution]]
    catalogue: Catalogue | None
    registers: Callable[[], type[Registers]]
    parameters: Callable[[], type[Registers]]
    rotary: type[SpecT] | None = None


def _system(module: str, name: str) -> Callable[[], type[Registers]]:
    """What loads a class of a system when it is called."""

    def load() -> type[Registers]:
        return getattr(import_module(f"detent.methods.{module}.system"), name)

    return load


PRINT_HEAD = Method(
    name="print_head",
    title="print head: DC carriage that identifies itself",
    spec=PrintHeadSpec,
    fill=fill_print_head,
    rules=PRINT_HEAD_RULES,
    derive=derive_print_head,
    cautions=find_print_head_cautions,
    catalogue=DC_MOTORS,
    registers=_system("print_head", "PrintHead"),
    parameters=_system("print_head", "PrintHeadParams"),
)


PHASE_SERVO = Method(
    name="phase_servo",
    title="phase servo: resolver phase to pulses for speed, absolute at the stop",
    spec=PhaseServoSpec,
    fill=fill_phase_servo,
    rules=PHASE_SERVO_RULES,
    derive=derive_phase_servo,
    cautions=find_phase_servo_cautions,
    catalogue=DC_MOTORS,
    registers=_system("phase_servo", "PhaseServo"),
    parameters=_system("phase_servo", "PhaseServoParams"),
)


FILTERED_SERVO = Method(
    name="filtered_servo",
    title="filtered servo: command pulses, counted speed with a low-pass",
    spec=FilteredServoSpec,
    fill=fill_filtered_servo,
    rules=FILTERED_SERVO_RULES,
    derive=derive_filtered_servo,
    cautions=find_filtered_servo_cautions,
    catalogue=DC_MOTORS,
    registers=_system("filtered_servo", "FilteredServo"),
    parameters=_system("filtered_servo", "FilteredServoParams"),
)


ROTARY_TABLE = Method(
    name="rotary_table",
    title="rotary table: absolute angle of one turn, servo-controlled jog without end",
    spec=RotaryTableSpec,
    fill=fill_rotary_table,
    rules=ROTARY_TABLE_RULES,
    derive=derive_rotary_table,
    cautions=find_rotary_table_cautions,
    catalogue=None,
    registers=_system("rotary_table", "RotaryTable"),
    parameters=_system("rotary_table", "RotaryTableParams"),
)


STEPPER_ENVELOPE = Method(
    name="stepper_envelope",
    title="stepper envelope: speed as a table of what is allowed, one motor or several",
    spec=StepperEnvelopeSpec,
    fill=fill_stepper_envelope,
    rules=STEPPER_ENVELOPE_RULES,
    derive=derive_stepper_envelope,
    cautions=find_stepper_envelope_cautions,
    catalogue=STEPPER_MOTORS,
    registers=_system("stepper_envelope", "Stepper"),
    parameters=_system("stepper_envelope", "StepperParams"),
)


CASCADE = Method(
    name="cascade",
    title="cascade: position over velocity loop, linear or rotary, as servo drives have it",
    spec=CascadeSpec,
    fill=fill_cascade,
    rules=CASCADE_RULES,
    derive=derive_cascade,
    cautions=find_cascade_cautions,
    catalogue=DC_MOTORS,
    registers=_system("cascade", "Cascade"),
    parameters=_system("cascade", "CascadeParams"),
    rotary=rotary_model(CascadeSpec),
)

METHODS: dict[str, Method[Any]] = {
    method.name: method for method in (PRINT_HEAD, PHASE_SERVO, FILTERED_SERVO, ROTARY_TABLE, STEPPER_ENVELOPE, CASCADE)
}
"""All methods by name; the first is the one a file without a method is checked against."""
