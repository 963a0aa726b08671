"""From a checked specification to ramp, zones and parameters of each motor: SI values to steps and timer words."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec, StepperTable
from detent.planning.step_envelope import MAX_RAMP, StepEnvelope, Zone, ZoneMap
from detent.planning.step_ramp import (
    FirstOrderPullOut,
    MeasuredPullOut,
    MicrosteppedPullOut,
    PullOut,
    StepperMotor,
    StepRamp,
    WindingPullOut,
    make_ramp,
    natural_frequency,
)

if TYPE_CHECKING:
    from detent.methods.stepper_envelope.system import StepperParams

ROTOR_STEP = 2e-6  # time step of the rotor (7.2) [s], in whole ticks of the timer, rounded down; 1 or more
LONGEST_PAUSE = 255  # periods that the waiting time of a reversal counts
DAMPING = 0.4  # damping of the rotor against its field, over sqrt(teeth T_hold J): a fifth of the critical one (7.2)
UNLOADED_STARTS = 3.0  # start frequency of a bare rotor over its natural one where nobody states it; 3.1 with 7.1


NEEDED = {
    "winding": ("resistance", "inductance", "rated_current"),
    "first order": ("pull_out_torque", "corner_frequency"),
    "points": (),
}
"""Constants that each way of stating the pull-out torque needs, with those that every motor has."""


def instant_ticks(spec: StepperEnvelopeSpec) -> int:
    """Time step of the rotors in whole ticks of the step timer."""
    return max(1, math.floor(ROTOR_STEP * spec.controller.timer + 1e-6))


def instant(spec: StepperEnvelopeSpec) -> float:
    """Time step of the rotors [s]."""
    return instant_ticks(spec) / spec.controller.timer


def stepper_motor(table: StepperTable) -> StepperMotor:
    """What the motor of a table can do with its drive, current and supply included, and its load."""
    motor, held = table.motor, table.held_torque
    start = motor.start_frequency
    if start is None:
        start = UNLOADED_STARTS * natural_frequency(motor.steps_per_turn, held, motor.rotor_inertia)
    load = table.mechanics
    return StepperMotor(
        motor.steps_per_turn, motor.rotor_inertia, held, pull_out(table), start, load.inertia, load.friction_torque,
        table.drive.microsteps,
    )  # fmt: skip


def pull_out(table: StepperTable) -> PullOut:
    """Pull-out torque of a motor against step frequency, in the way the file states it; NaN without its constants."""
    motor, drive = table.motor, table.drive
    if drive.microsteps > 1:
        whole = pull_out(changed(table, "drive.microsteps", 1))
        return MicrosteppedPullOut(whole, drive.microsteps)
    if motor.pull_out == "points":
        return MeasuredPullOut(tuple(motor.curve_frequency), tuple(motor.curve_torque))
    if motor.pull_out == "first order":
        return FirstOrderPullOut(motor.pull_out_torque or math.nan, motor.corner_frequency or math.nan)
    return WindingPullOut(
        holding_torque=motor.holding_torque,
        rated_current=motor.rated_current or math.nan,
        current=drive.current or math.nan,
        supply=drive.supply,
        resistance=(motor.resistance or math.nan) + drive.bridge_resistance,
        inductance=motor.inductance or math.nan,
        teeth=motor.steps_per_turn / 4,
    )


def bare_start_hz(table: StepperTable) -> float:
    """Start frequency with load and reserve, whatever the largest one [Hz]."""
    return stepper_motor(table).start_hz(table.drive.start_safety)


def start_hz(table: StepperTable) -> float:
    """Frequency at which the loaded motor starts and stops, reserve included [Hz]; never above the largest one."""
    return min(bare_start_hz(table), table.max_hz)


def make_step_ramp(table: StepperTable) -> StepRamp:
    """Ramp list of a motor with its load."""
    return make_ramp(start_hz(table), table.max_hz, _acceleration(table))


def _acceleration(table: StepperTable) -> Callable[[float], float]:
    """Acceleration that torque and limit allow [step/s^2], of a frequency [Hz]."""
    limit = table.limits.acceleration / table.step
    return stepper_motor(table).acceleration_limit(limit, table.drive.torque_safety)


def changed(table: StepperTable, name: str, value: float) -> StepperTable:
    """Copy of a motor's table with another value of one key, such as ``limits.speed``."""
    around, _, own = name.partition(".")
    return table.model_copy(update={around: getattr(table, around).model_copy(update={own: value})})


def ramp_fits(table: StepperTable) -> bool:
    """True where the ramp reaches the largest speed and has room in the control unit."""
    start, top = start_hz(table), table.max_hz
    # Not even the linear acceleration comes to the largest speed within the longest ramp.
    is_long = (top**2 - start**2) / (2 * table.limits.acceleration / table.step) > MAX_RAMP
    if is_long or not starts(table):
        return False
    found = make_step_ramp(table)
    return bool(found.hz[-1] >= top) and len(found) <= MAX_RAMP


def starts(table: StepperTable) -> bool:
    """True where torque is left to accelerate with at the start frequency."""
    return _acceleration(table)(start_hz(table)) > 0


# ---- zones and tables


def zone_maps(table: StepperTable) -> tuple[ZoneMap, ZoneMap]:
    """Speed limits upwards and downwards; both number their limits alike, for one control unit."""
    limits = [table.max_hz, *(table.hz(zone.speed) for zone in table.zone.values())]
    up, down = (
        ZoneMap(table.steps, table.max_hz, list(_zones(table, {"both", way})), limits) for way in ("up", "down")
    )
    return up, down


def _zones(table: StepperTable, directions: set[str]) -> Iterator[Zone]:
    """Zones of some directions in whole steps: every step that a zone touches is inside."""
    lower, step = table.mechanics.lower_end, table.step
    for zone in table.zone.values():
        if zone.direction in directions:
            begin = math.floor((zone.begin - lower) / step + 1e-6)
            end = math.ceil((zone.end - lower) / step - 1e-6)
            yield Zone(max(begin, 0), min(end, table.steps), table.hz(zone.speed))


@dataclass(slots=True)
class MotorTables:
    """Ramp and tables of one motor, as they are at power-on: between its extremes."""

    ramp: StepRamp  # frequencies of a run-up
    up: StepEnvelope  # and down: table of each direction
    down: StepEnvelope


def make_tables(table: StepperTable) -> MotorTables:
    """Ramp and tables of one motor."""
    ramp, extremes = make_step_ramp(table), table.extremes
    start, turn, stop = (table.step_inside(place) for place in (extremes.start, extremes.turn, extremes.stop))
    up, down = zone_maps(table)
    return MotorTables(ramp, StepEnvelope(ramp, up, 1, start, turn), StepEnvelope(ramp, down, -1, turn, stop))


def build_stepper(spec: StepperEnvelopeSpec, name: str, tables: MotorTables) -> "StepperParams":
    """Parameters of one motor."""
    from detent.axisfile.blocks import fill_marks
    from detent.methods.stepper_envelope.controller import load_rule
    from detent.methods.stepper_envelope.system import StepperParams
    from detent.plant.stepper_rotor import fill_curve

    p, table = StepperParams(), spec.stepper[name]
    motor = stepper_motor(table)
    reload = spec.controller.words == "reload"
    clock_hz = p.plant.clock_hz = round(spec.controller.timer)
    load_rule(p.controller, tables.ramp, tables.up.zones.limits, clock_hz, reload=reload)
    p.controller.rule.literal = table.method.rule == "literal"
    p.controller.pause = min(table.drive.reversal_pause * table.drive.microsteps, LONGEST_PAUSE)
    p.controller.instant_ticks = instant_ticks(spec)
    p.plant.tolerance = spec.controller.tolerance * table.drive.microsteps
    r, inertia = p.plant.rotor, motor.inertia
    r.dt, r.teeth, r.step_angle, r.inertia = instant(spec), motor.steps_per_turn / 4, motor.step_angle, inertia
    r.torque, r.friction = motor.holding_torque, motor.friction_torque
    r.damping = DAMPING * math.sqrt(r.teeth * motor.holding_torque * inertia)
    fill_curve(r, motor.pull_out, table.max_hz)
    p.plant.origin, p.plant.way = table.mechanics.lower_end, table.step / motor.step_angle
    if table.home is not None:
        fill_marks(p.plant.home, table.home, 0.0)
    return p
