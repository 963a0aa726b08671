"""Contradictions about the torque of a motor: its constants, its friction, and a ramp that reaches its largest speed.

Sections are those of the stepper-envelope specification.
"""

import math
from collections.abc import Callable, Iterator
from functools import wraps
from itertools import pairwise

from detent.files.fields import unit_of
from detent.files.findings import Contradiction, wrong
from detent.files.nearest import BARELY, Remedies
from detent.files.problems import field_at
from detent.methods.stepper_envelope.build import make_step_ramp, start_hz, stepper_load, stepper_motor
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec, StepperTable
from detent.planning.step_envelope import MAX_RAMP
from detent.planning.step_ramp import LEAST_GAIN_HZ, MAX_HZ, acceleration_limit, start_frequency
from detent.units import describe_kind
from detent.units import format_quantity as text

Rule = Callable[[StepperEnvelopeSpec], Iterator[Contradiction]]
Look = Callable[[StepperEnvelopeSpec, StepperTable, str], Iterator[Contradiction]]

NEEDED = {
    "winding": ("resistance", "inductance", "rated_current"),
    "first order": ("pull_out_torque", "corner_frequency"),
    "points": (),
}
"""Constants that each way of stating the pull-out torque needs, with those that every motor has."""

PULL_OUT = ("pull_out", *(name for names in NEEDED.values() for name in names), "curve_frequency", "curve_torque")

TORQUE_KEYS = ("drive.supply", "drive.current", "drive.bridge_resistance", *(f"motor.{name}" for name in PULL_OUT))
"""What the pull-out torque depends on."""

LOAD_KEYS = (
    "mechanics.travel_per_revolution", "mechanics.moving_mass", "mechanics.screw_inertia", "mechanics.coupling_inertia",
)  # fmt: skip
START_KEYS = (
    "motor.start_frequency", "drive.start_safety", "motor.steps_per_turn", "motor.holding_torque",
    "motor.rotor_inertia", *LOAD_KEYS,
)  # fmt: skip
"""What the start frequency depends on."""

RAMP_KEYS = (
    "limits.speed", "limits.acceleration", "drive.torque_safety", "mechanics.friction_torque",
    *TORQUE_KEYS, *START_KEYS,
)  # fmt: skip
"""What the ramp depends on."""

SURE_REST = 0.5  # distance from its step, in steps, from which a resting rotor counts as a step off
STEEPEST = 1e4  # acceleration with which the torque alone limits the ramp [m/s^2]

remedy = Remedies(StepperEnvelopeSpec)


def per_motor(look: Look) -> Rule:
    """A rule of the file from one of its motors; `look` is given the specification, a motor and its keys' beginning."""

    @wraps(look)
    def rule(spec: StepperEnvelopeSpec) -> Iterator[Contradiction]:
        for _, table, key in spec.motors():
            yield from look(spec, table, key)

    return rule


def keys_of(key: str, *names: str) -> str:
    """Keys of a motor, each name once."""
    return " ".join(f"{key}.{name}" for name in dict.fromkeys(names))


def missing_constants(table: StepperTable) -> list[str]:
    """Constants that the chosen way needs and nobody states."""
    return [name for name in NEEDED[table.motor.pull_out] if getattr(table.motor, name) is None]


def has_pull_out(table: StepperTable) -> bool:
    """True where the pull-out torque is known."""
    if table.motor.pull_out != "points":
        return not missing_constants(table)
    hz, torque = table.motor.curve_frequency, table.motor.curve_torque
    return len(hz) == len(torque) >= 2 and _rises(hz) and torque[0] > 0


def _rises(values: list[float]) -> bool:
    return all(one < following for one, following in pairwise(values))


def bare_start_hz(table: StepperTable) -> float:
    """Start frequency with load and reserve, whatever the largest one [Hz]."""
    return start_frequency(stepper_motor(table), stepper_load(table), table.drive.start_safety)


def is_drivable(table: StepperTable) -> bool:
    """True where a ramp can be worked out at all."""
    return has_pull_out(table) and 1 <= table.max_hz <= MAX_HZ and bare_start_hz(table) >= 1


def changed(table: StepperTable, name: str, value: float) -> StepperTable:
    """Copy of a motor's table with another value of one key, such as ``limits.speed``."""
    around, _, own = name.partition(".")
    return table.model_copy(update={around: getattr(table, around).model_copy(update={own: value})})


def ramp_fits(table: StepperTable) -> bool:
    """True where the ramp reaches the largest speed and has room in the control unit."""
    start, top = start_hz(table), table.max_hz
    # Not even the linear acceleration comes to the largest speed within the longest ramp.
    is_long = (top**2 - start**2) / (2 * table.limits.acceleration / table.step) > MAX_RAMP
    if is_long or _spare(table, start) <= 0:
        return False
    found = make_step_ramp(table)
    return bool(found.hz[-1] >= top) and len(found) <= MAX_RAMP


def _spare(table: StepperTable, hz: float) -> float:
    """Acceleration that torque and limit allow at a frequency [step/s^2]."""
    limit = table.limits.acceleration / table.step
    return acceleration_limit(stepper_motor(table), stepper_load(table), limit, table.drive.torque_safety)(hz)


@per_motor
def _constants(spec: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """The chosen way of stating the pull-out torque has its constants."""
    way = table.motor.pull_out
    for name in missing_constants(table):
        path = f"{key}.motor.{name}"
        example = describe_kind(unit_of(field_at(type(spec), tuple(path.split(".")))))[1]
        yield wrong(
            f"{path} {key}.motor.pull_out",
            f'stated, as pull_out = "{way}" needs it',
            f'add {name} = "{example}" in [{key}.motor], '
            + ("or name a motor of the catalogue that has it, " if way == "winding" else "")
            + "or choose another pull_out",
        )


@per_motor
def _curve(_: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """Points of a published curve: as many torques as frequencies, which rise."""
    hz, torque = table.motor.curve_frequency, table.motor.curve_torque
    frequencies, torques = f"{key}.motor.curve_frequency", f"{key}.motor.curve_torque"
    if table.motor.pull_out != "points":
        return
    if len(hz) < 2:
        example = 'curve_frequency = ["500 Hz", "2 kHz"] and curve_torque = ["45 mN*m", "20 mN*m"]'
        allowed = f'two or more frequencies, as pull_out = "points" needs them, here {len(hz)}'
        yield wrong(f"{frequencies} {key}.motor.pull_out", allowed, f"state the points of the curve, as {example}")
    elif len(torque) != len(hz):
        allowed = f"as many as curve_frequency has, {len(hz)}, here {len(torque)}"
        yield wrong(f"{torques} {frequencies}", allowed, "state one torque for each frequency")
    elif not _rises(hz):
        order = "order the points by frequency, torques with them, and remove what stands there twice"
        yield wrong(frequencies, "frequencies that rise, each once", order)
    elif torque[0] <= 0:
        allowed = "above 0 N*m at the first frequency: it holds from standstill up to there"
        yield wrong(torques, allowed, "state the pull-out torque at standstill as the first one")


@per_motor
def _torques(spec: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """No pull-out torque is above the holding torque; friction does not hold a resting rotor off its step."""
    motor, held, friction = table.motor, table.held_torque, table.mechanics.friction_torque
    name, pull_out = "pull_out_torque", motor.pull_out_torque or 0.0
    if motor.pull_out == "points":
        name, pull_out = "curve_torque", max(motor.curve_torque, default=0.0)
    if motor.pull_out != "winding" and has_pull_out(table) and pull_out > held * (1 + BARELY):
        stated = f"{key}.motor.holding_torque"
        yield wrong(
            f"{key}.motor.{name} {stated} {key}.drive.current {key}.motor.rated_current",
            f"up to the holding torque at the current of the drive, {text(held, 'N*m')}",
            remedy.least(stated, motor.holding_torque * pull_out / held, "check the units of both torques"),
        )
    tolerance = min(spec.controller.tolerance, SURE_REST)
    most = held * math.sin(math.pi / 2 * tolerance)
    if friction > most * (1 + BARELY) and not (is_drivable(table) and _spare(table, start_hz(table)) <= 0):
        yield wrong(
            f"{key}.mechanics.friction_torque {key}.motor.holding_torque controller.tolerance",
            f"up to {text(most, 'N*m')}: against more the field of a resting motor does not bring the rotor within "
            f"{tolerance:g} steps",
            remedy.most(f"{key}.mechanics.friction_torque", most),
        )


@per_motor
def _ramp(_: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """There is torque to accelerate with, the ramp reaches the largest speed, and its entries have room."""
    if not is_drivable(table) or ramp_fits(table):
        return
    start, motor = start_hz(table), stepper_motor(table)
    if _spare(table, start) <= 0:
        torque = motor.pull_out(start)
        names = ("mechanics.friction_torque", "drive.torque_safety", "limits.speed", *TORQUE_KEYS, *START_KEYS)
        yield wrong(
            keys_of(key, *names),
            f"below {text(torque / table.drive.torque_safety, 'N*m')}: the pull-out torque at the start frequency, "
            f"{text(torque, 'N*m')} at {text(start, 'Hz')}, over torque_safety; nothing is left to accelerate with",
            "lower friction or drive.torque_safety, or choose a stronger motor",
        )
        return
    found = make_step_ramp(table)
    speed, end = f"{key}.limits.speed", float(found.hz[min(len(found), MAX_RAMP) - 1])
    reached = f"it ends with entry {len(found)} at {text(end * table.step, 'm/s')}, {text(end, 'Hz')}"
    if found.hz[-1] >= table.max_hz:
        reached = f"it has {len(found)} entries"
    # A zone or a start above that speed would be wrong in its place.
    fastest_zone = max((zone.speed for zone in table.zone.values()), default=0.0)
    slower = (
        remedy.most(speed, end * table.step) if fastest_zone <= end * table.step * (1 - 1e-3) and end > start else ""
    )
    if ramp_fits(changed(table, "limits.acceleration", STEEPEST)):
        yield wrong(
            keys_of(key, "limits.acceleration", *RAMP_KEYS),
            f"such that the ramp up to limits.speed has {MAX_RAMP} entries or fewer, each {LEAST_GAIN_HZ:g} Hz above "
            f"the last; here {reached}",
            slower or "raise limits.acceleration, or lower limits.speed",
        )
        return
    yield wrong(
        keys_of(key, "limits.speed", *RAMP_KEYS),
        f"such that the pull-out torque over torque_safety is enough for friction and for {MAX_RAMP} steps of ramp up "
        f"to it; here {reached}",
        slower or "choose a stronger motor, or less load",
    )


TORQUE_RULES: tuple[Rule, ...] = (_constants, _curve, _torques, _ramp)
"""Contradictions about torque are told in this order."""
