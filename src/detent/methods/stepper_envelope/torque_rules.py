"""What must hold for the torque of each motor: its constants, its friction, and a ramp that reaches its largest speed.

Sections are those of the stepper-envelope specification.
"""

import math
from collections.abc import Callable, Iterator
from functools import wraps
from itertools import pairwise

from detent.files.fields import unit_of
from detent.files.findings import Contradiction
from detent.files.nearest import BARELY, at_least, at_most, either, offer, put
from detent.files.problems import field_at
from detent.methods.stepper_envelope.build import make_step_ramp, start_hz, stepper_load, stepper_motor
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec, StepperTable
from detent.planning.step_envelope import MAX_RAMP
from detent.planning.step_ramp import LEAST_GAIN_HZ, MAX_HZ, acceleration_limit, start_frequency
from detent.units import describe_kind, format_quantity

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

SURE_REST = 0.5
"""Distance from its step, in steps, from which a resting rotor counts as a step off."""

REFINEMENTS = 20
"""Halvings in the search for a value that would do: to a millionth of the way."""


def per_motor(look: Look) -> Rule:
    """A rule of the file from one of its motors; `look` is given the specification, a motor and its keys' beginning."""

    @wraps(look)
    def rule(spec: StepperEnvelopeSpec) -> Iterator[Contradiction]:
        for _, table, key in spec.motors():
            yield from look(spec, table, key)

    return rule


def keys_of(key: str, *names: str) -> tuple[str, ...]:
    """Keys of a motor, each name once."""
    return tuple(f"{key}.{name}" for name in dict.fromkeys(names))


def missing_constants(table: StepperTable) -> list[str]:
    """Constants that the chosen way needs and nobody states."""
    return [name for name in NEEDED[table.motor.pull_out] if getattr(table.motor, name) is None]


def is_curve(table: StepperTable) -> bool:
    """True where the points of a published curve make one."""
    hz, torque = table.motor.curve_frequency, table.motor.curve_torque
    rising = all(one < following for one, following in pairwise(hz))
    return len(hz) == len(torque) >= 2 and rising and torque[0] > 0


def has_pull_out(table: StepperTable) -> bool:
    """True where the pull-out torque is known."""
    return is_curve(table) if table.motor.pull_out == "points" else not missing_constants(table)


def bare_start_hz(table: StepperTable) -> float:
    """Start frequency with load and reserve, whatever the largest one [Hz]."""
    return start_frequency(stepper_motor(table), stepper_load(table), table.drive.start_safety)


def is_drivable(table: StepperTable) -> bool:
    """True where a ramp can be worked out at all."""
    return has_pull_out(table) and 1 <= table.max_hz <= MAX_HZ and bare_start_hz(table) >= 1


# ------------------------------------------------------------------------------------------------------------ pull-out


@per_motor
def _constants(spec: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """The chosen way of stating the pull-out torque has its constants."""
    way = table.motor.pull_out
    for name in missing_constants(table):
        path = f"{key}.motor.{name}"
        example = describe_kind(unit_of(field_at(type(spec), tuple(path.split(".")))))[1]
        yield Contradiction(
            (path, f"{key}.motor.pull_out"),
            f'stated, as pull_out = "{way}" needs it',
            f'add {name} = "{example}" in [{key}.motor], '
            + ("or name a motor of the catalogue that has it, " if way == "winding" else "")
            + "or choose another pull_out",
        )


@per_motor
def _curve(_: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """Points of a published curve: as many torques as frequencies, which rise."""
    hz, torque = table.motor.curve_frequency, table.motor.curve_torque
    if table.motor.pull_out != "points":
        return
    frequencies, torques, way = keys_of(key, "motor.curve_frequency", "motor.curve_torque", "motor.pull_out")
    if len(hz) < 2:
        example = 'curve_frequency = ["500 Hz", "2 kHz"] and curve_torque = ["45 mN*m", "20 mN*m"]'
        allowed = f'two or more frequencies, as pull_out = "points" needs them, here {len(hz)}'
        yield Contradiction((frequencies, way), allowed, f"state the points of the curve, as {example}")
    elif len(torque) != len(hz):
        allowed = f"as many as curve_frequency has, {len(hz)}, here {len(torque)}"
        yield Contradiction((torques, frequencies), allowed, "state one torque for each frequency")
    elif not all(one < following for one, following in pairwise(hz)):
        yield Contradiction((frequencies,), "frequencies that rise, each once", _in_order(table, frequencies, torques))
    elif torque[0] <= 0:
        allowed = "above 0 N*m at the first frequency: it holds from standstill up to there"
        yield Contradiction((torques,), allowed, "state the pull-out torque at standstill as the first one")


def _in_order(table: StepperTable, frequencies: str, torques: str) -> str:
    """The points in the order of their frequencies, if that is all that is wrong."""
    points = sorted(zip(table.motor.curve_frequency, table.motor.curve_torque, strict=True))
    if any(one[0] == following[0] for one, following in pairwise(points)):
        return "remove what stands there twice, with its torque"
    columns = zip(*points, strict=True)
    hz, torque = (
        ", ".join(f'"{format_quantity(value, unit, 12)}"' for value in column)
        for column, unit in zip(columns, ("Hz", "N*m"), strict=True)
    )
    return f"{put(frequencies, f'[{hz}]')} and {torques} = [{torque}]"


@per_motor
def _standstill(_: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """No pull-out torque is above the holding torque."""
    motor, held = table.motor, table.held_torque
    if motor.pull_out == "winding" or not has_pull_out(table):
        return
    name, pull_out = "pull_out_torque", motor.pull_out_torque or 0.0
    if motor.pull_out == "points":
        name, pull_out = "curve_torque", max(motor.curve_torque)
    if pull_out > held * (1 + BARELY):
        stated = f"{key}.motor.holding_torque"
        larger = offer(StepperEnvelopeSpec, stated, at_least(motor.holding_torque * pull_out / held, "N*m"))
        smaller = ""
        if name == "pull_out_torque" and is_drivable(table) and ramp_fits(changed(table, f"motor.{name}", held)):
            smaller = put(f"{key}.motor.{name}", at_most(held, "N*m"))
        yield Contradiction(
            (f"{key}.motor.{name}", stated, f"{key}.drive.current", f"{key}.motor.rated_current"),
            f"up to the holding torque at the current of the drive, {format_quantity(held, 'N*m')}",
            either(smaller, larger) or "check the units of both torques",
        )


# ------------------------------------------------------------------------------------------------------------ friction


@per_motor
def _friction_at_rest(spec: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """Friction does not hold a resting rotor outside the tolerance."""
    tolerance, held, friction = spec.controller.tolerance, table.held_torque, table.mechanics.friction_torque
    most = held * math.sin(math.pi / 2 * min(tolerance, SURE_REST))
    if friction <= most * (1 + BARELY) or (is_drivable(table) and _spare(table, start_hz(table)) <= 0):
        return
    steps = math.asin(min(friction / held, 1.0)) * 2 / math.pi
    wider = put("controller.tolerance", at_least(steps, "").strip('"')) if steps < SURE_REST else ""
    yield Contradiction(
        (f"{key}.mechanics.friction_torque", f"{key}.motor.holding_torque", "controller.tolerance"),
        f"up to {format_quantity(most, 'N*m')}: against more the field of a resting motor does not bring the rotor "
        f"within {min(tolerance, SURE_REST):g} steps",
        either(put(f"{key}.mechanics.friction_torque", at_most(most, "N*m")), wider),
    )


# ---------------------------------------------------------------------------------------------------------------- ramp


def ramp_fits(table: StepperTable) -> bool:
    """True where the ramp reaches the largest speed and has room in the control unit."""
    start, top = start_hz(table), table.max_hz
    if _is_long(table) or _spare(table, start) <= 0:
        return False
    found = make_step_ramp(table)
    return bool(found.hz[-1] >= top) and len(found) <= MAX_RAMP


def _is_long(table: StepperTable) -> bool:
    """True where not even the linear acceleration comes to the largest speed within the longest ramp."""
    steps = (table.max_hz**2 - start_hz(table) ** 2) / (2 * table.limits.acceleration / table.step)
    return steps > MAX_RAMP


def _spare(table: StepperTable, hz: float) -> float:
    """Acceleration that torque and limit allow at a frequency [step/s^2]."""
    limit = table.limits.acceleration / table.step
    return acceleration_limit(stepper_motor(table), stepper_load(table), limit, table.drive.torque_safety)(hz)


def changed(table: StepperTable, name: str, value: float) -> StepperTable:
    """Copy of a motor's table with another value of one key, such as ``limits.speed``."""
    around, _, own = name.partition(".")
    return table.model_copy(update={around: getattr(table, around).model_copy(update={own: value})})


def nearest_good(is_good: Callable[[float], bool], bad: float, far: float) -> float | None:
    """Find the value nearest to a bad one that is good, on the way to a far one; None if not even that one is."""
    if not is_good(far):
        return None
    for _ in range(REFINEMENTS):
        middle = math.sqrt(bad * far) if bad * far > 0 else (bad + far) / 2
        if is_good(middle):
            far = middle
        else:
            bad = middle
    return far


def better(
    table: StepperTable, key: str, name: str, far: float, is_good: Callable[[StepperTable], bool] = ramp_fits
) -> str:
    """Remedy that changes one key of a motor towards `far`, as little as makes it good; empty if nothing does."""
    around, _, own = name.partition(".")
    now = float(getattr(getattr(table, around), own))
    found = nearest_good(lambda value: is_good(changed(table, name, value)), now, far) if far != now else None
    if found is None:
        return ""
    path = f"{key}.{name}"
    unit = unit_of(field_at(StepperEnvelopeSpec, tuple(path.split("."))))
    text = (at_most if far < now else at_least)(found, unit)
    return offer(StepperEnvelopeSpec, path, text if unit else text.strip('"'))


def slower(table: StepperTable, key: str, is_good: Callable[[StepperTable], bool] = ramp_fits) -> str:
    """Remedy that lowers limits.speed, but not below the speed of a zone, or that of the start frequency."""
    least = max(start_hz(table) * table.step, *(zone.speed for zone in table.zone.values()), 0.0)
    return better(table, key, "limits.speed", least, is_good) if least < table.limits.speed else ""


@per_motor
def _acceleration_at_start(_: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """At the start frequency there is torque left to accelerate with."""
    if not is_drivable(table) or _spare(table, start_hz(table)) > 0:
        return
    start = start_hz(table)
    torque = stepper_motor(table).pull_out(start)
    left = torque / table.drive.torque_safety
    names = ("mechanics.friction_torque", "drive.torque_safety", "limits.speed", *TORQUE_KEYS, *START_KEYS)
    yield Contradiction(
        keys_of(key, *names),
        f"below {format_quantity(left, 'N*m')}: the pull-out torque at the start frequency, "
        f"{format_quantity(torque, 'N*m')} at {format_quantity(start, 'Hz')}, over torque_safety; nothing is left to "
        "accelerate with",
        either(
            better(table, key, "mechanics.friction_torque", 0.0),
            better(table, key, "drive.torque_safety", 1.0),
        )
        or "choose a stronger motor, or less load",
    )


@per_motor
def _ramp(_: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """The ramp reaches the largest speed, and its entries have room."""
    if not is_drivable(table) or _spare(table, start_hz(table)) <= 0 or ramp_fits(table):
        return
    steeper, lower = better(table, key, "limits.acceleration", 1e4), slower(table, key)
    if steeper:
        yield Contradiction(
            keys_of(key, "limits.acceleration", *RAMP_KEYS),
            f"such that the ramp up to limits.speed has {MAX_RAMP} entries or fewer, each {LEAST_GAIN_HZ:g} Hz above "
            f"the last; here {_entries(table)}",
            either(steeper, lower),
        )
        return
    safety = better(table, key, "drive.torque_safety", 1.0)
    supply = better(table, key, "drive.supply", 1000.0) if table.motor.pull_out == "winding" else ""
    yield Contradiction(
        keys_of(key, "limits.speed", *RAMP_KEYS),
        f"such that the pull-out torque over torque_safety is enough for friction and for {MAX_RAMP} steps of ramp up "
        f"to it; here {_entries(table)}",
        either(lower, safety, supply) or "choose a stronger motor, or less load",
    )


def _entries(table: StepperTable) -> str:
    """What is wrong with a ramp."""
    found = make_step_ramp(table)
    end = float(found.hz[-1])
    speed = f"{format_quantity(end * table.step, 'm/s')}, {format_quantity(end, 'Hz')}"
    return f"it has {len(found)} entries" if end >= table.max_hz else f"it ends with entry {len(found)} at {speed}"


TORQUE_RULES: tuple[Rule, ...] = (
    _constants,
    _curve,
    _standstill,
    _friction_at_rest,
    _acceleration_at_start,
    _ramp,
)
"""The rules about torque, in the order in which their contradictions are told."""
