"""What must hold between keys of the cascade method.

As in the other methods' rules, a rule is reported at the first of its keys that the file states, and a remedy names the
nearest value that would do.
"""

import math
from collections.abc import Callable, Iterator
from typing import TypeVar, cast

from detent.axisfile.motion import rotary_model
from detent.files.fields import Table, unit_of
from detent.files.findings import Contradiction
from detent.files.nearest import BARELY, at_least, at_most, either, offer, put
from detent.files.problems import field_at
from detent.methods.cascade.schema import MOST_SAMPLES, CascadeSpec, DirectionTable, EncoderTable
from detent.units import format_quantity

TableT = TypeVar("TableT", bound=Table)

FASTEST = 1e7
"""Fastest rate of the plant [1/s]: the tick is then 50 ns, and a simulated second takes some seconds."""

LEAST_MASS = 1e-12
"""Smallest mass [kg] or moment of inertia [kg m^2]: a thousandth of the lightest rotor of a file."""

MOST_COUNTS = 2**53
"""Counts of an encoder: beyond them a float no longer knows each."""

QUICK = 0.1
"""Bandwidth of a velocity loop that is proposed [rad] over its dead time: it keeps far from its limit."""


def offered(spec: CascadeSpec, key: str, text: object) -> str:
    """`nearest.offer`, in the units of the axis's motion."""
    return offer(rotary_model(CascadeSpec) if spec.axis.motion == "rotary" else CascadeSpec, key, text)


def _motor(spec: CascadeSpec) -> Iterator[Contradiction]:
    drive, motor = spec.drive.input, spec.motor
    if drive == "force" and motor is not None:
        yield Contradiction(
            ("drive.input", "motor.rotor_inertia", "motor.catalogue"),
            '"current" or "voltage" where there is a [motor]: a drive that imposes a force needs none',
            either(put("drive.input", '"current"'), "remove [motor]"),
        )
    if drive != "force" and motor is None:
        yield Contradiction(
            ("drive.input",),
            '"force" where there is no [motor]',
            either("add [motor] with torque_constant, resistance, rotor_inertia", put("drive.input", '"force"')),
        )


def _travel(spec: CascadeSpec) -> Iterator[Contradiction]:
    if spec.motor is not None and spec.mechanics.travel_per_revolution is None:
        yield Contradiction(
            ("mechanics.travel_per_revolution", "drive.input"),
            "a length where there is a [motor]",
            'add travel_per_revolution = "10 mm" in [mechanics] (lead of the screw, or circumference of the pulley)',
        )


def _masses(spec: CascadeSpec) -> Iterator[Contradiction]:
    mechanics, least = spec.mechanics, LEAST_MASS
    masses = {"mechanics.load_mass": (spec.mass, "all that moves")}
    if mechanics.coupling is not None:
        masses = {
            "mechanics.motor_mass": (spec.motor_mass, "what moves on the motor's side of the coupling"),
            "mechanics.load_mass": (mechanics.load_mass, "what moves on the load's side of the coupling"),
        }
    for key, (mass, what) in masses.items():
        if mass < least:
            text = f"{least:g} {spec.unit('kg')}"
            yield Contradiction(
                (key, "mechanics.coupling.stiffness"),
                f"such that {what} comes to at least {text}",
                f"state {key}" + ("" if mechanics.coupling is None else ", or leave [mechanics.coupling] out"),
            )


def _pendulum(spec: CascadeSpec) -> Iterator[Contradiction]:
    if spec.mechanics.pendulum > 0 and spec.axis.motion == "linear":
        yield Contradiction(
            ("mechanics.pendulum", "axis.motion"),
            "0 N*m where axis.motion is linear: a load hangs from an axis that turns",
            either(put("mechanics.pendulum", '"0 N*m"'), "state a weight as mechanics.weight"),
        )


def _gains(spec: CascadeSpec) -> Iterator[Contradiction]:
    method = spec.method
    needed = ("velocity_gain", "position_gain") if method.structure == "cascade" else ("proportional",)
    for name in needed:
        if getattr(method, name) == 0:
            yield Contradiction(
                (f"method.{name}", "method.structure"),
                f'above 0 where method.structure is "{method.structure}"',
                f"state {name} in [method]{_to_begin_with(spec, name)}",
            )


def _to_begin_with(spec: CascadeSpec, name: str) -> str:
    """A gain that will do for nearly every axis: a velocity loop that keeps far from its dead time, and 20 Hz."""
    if not _is_solid(spec):
        return ""
    bandwidth = min(QUICK / dead_time(spec), 2 * math.pi * 20)
    if name == "position_gain":
        return f", such as {bandwidth / 4:.2g} to begin with"
    unit, power = ("V*s/m", 1) if name == "velocity_gain" else ("V/m", 2)
    gain = bandwidth**power * spec.mass / spec.effort_per_command / 2 ** (2 * (power - 1))
    return f", such as {at_most(gain, spec.unit(unit), 2)} to begin with"


def dead_time(spec: CascadeSpec) -> float:
    """Time from a motion until the drive acts on its velocity [s].

    Hold of a sample, delays of encoder and amplifier, half the span of the velocity and its filter.
    """
    table = spec.velocity_encoder
    samples = 0.5 + spec.drive.delay + table.delay + 0.5 * table.velocity_span
    return samples * spec.method.sample_period + table.velocity_filter


def _feedback(spec: CascadeSpec) -> Iterator[Contradiction]:
    feedback = spec.method.feedback
    for loop in ("position", "velocity"):
        if getattr(feedback, loop) == "load" and spec.load_encoder is None:
            key = f"method.feedback.{loop}"
            yield Contradiction(
                (key,),
                '"motor" where there is no [load_encoder]',
                either(put(key, '"motor"'), "add [load_encoder] with resolution"),
            )


def _encoders(spec: CascadeSpec) -> dict[str, EncoderTable]:
    """Encoders of the file, by their tables."""
    tables = {"encoder": spec.encoder, "load_encoder": spec.load_encoder}
    return {name: table for name, table in tables.items() if table is not None}


def _memory(spec: CascadeSpec) -> Iterator[Contradiction]:
    for name, table in _encoders(spec).items():
        if table.delay + table.velocity_span > MOST_SAMPLES:
            yield Contradiction(
                (f"{name}.velocity_span", f"{name}.delay"),
                f"up to {MOST_SAMPLES} samples together with {name}.delay",
                put(f"{name}.velocity_span", MOST_SAMPLES - table.delay),
            )


def _counts(spec: CascadeSpec) -> Iterator[Contradiction]:
    furthest = 2 * max(abs(spec.limits.lowest), abs(spec.highest))
    for name, table in _encoders(spec).items():
        if 0 < table.resolution < furthest / MOST_COUNTS:
            key, unit = f"{name}.resolution", spec.unit("m")
            nearest = at_least(furthest / MOST_COUNTS, unit)
            yield Contradiction(
                (key, "limits.travel"),
                f"0 {unit}, or at least {format_quantity(furthest / MOST_COUNTS, unit)}: more counts cannot be told "
                "apart",
                offered(spec, key, nearest),
            )


def _friction(spec: CascadeSpec) -> Iterator[Contradiction]:
    for key, table in directions(spec).items():
        if table.static < table.coulomb:
            unit = spec.unit("N")
            yield Contradiction(
                (f"{key}.static", f"{key}.coulomb"),
                f"at least the Coulomb friction, {format_quantity(table.coulomb, unit)}",
                either(put(f"{key}.static", at_least(table.coulomb, unit)), "leave it out: it is then 1.15 x coulomb"),
            )


def directions(spec: CascadeSpec) -> dict[str, DirectionTable]:
    """Friction of both masses in both directions, by their tables."""
    masses = {"friction": spec.mechanics.friction, "load_friction": spec.mechanics.load_friction}
    return {
        f"mechanics.{name}.{sense}": table
        for name, friction in masses.items()
        for sense, table in (("positive", friction.positive), ("negative", friction.negative))
    }


def _start(spec: CascadeSpec) -> Iterator[Contradiction]:
    start, low, high = spec.mechanics.start_position, spec.limits.lowest, spec.highest
    if not low <= start <= high:
        unit = spec.unit("m")
        nearest = low if start < low else high
        yield Contradiction(
            ("mechanics.start_position", "limits.travel", "limits.lowest"),
            f"from {format_quantity(low, unit)} to {format_quantity(high, unit)}, the way of the axis",
            either(put("mechanics.start_position", f'"{nearest!r} {unit}"'), "correct limits.travel or limits.lowest"),
        )


def _rate(spec: CascadeSpec) -> Iterator[Contradiction]:
    from detent.methods.cascade.loop import fastest_rate

    if not _is_solid(spec):
        return
    rate = fastest_rate(spec)
    if rate > FASTEST:
        key = _culprit(spec)
        yield Contradiction(
            (key, "mechanics.load_mass", "mechanics.motor_mass"),
            f"such that the fastest rate of motor, coupling and load is 1/{format_quantity(1 / FASTEST, 's')} or less, "
            f"here 1/{format_quantity(1 / rate, 's', 3)}",
            either(_slowed(spec, key), "check the units of the masses"),
        )


def _is_solid(spec: CascadeSpec) -> bool:
    """Whether everything that a rate is computed from is there."""
    return not (any(_masses(spec)) or any(_motor(spec)) or any(_travel(spec)))


def _culprit(spec: CascadeSpec) -> str:
    """Key that makes the plant too fast."""
    coupling, motor = spec.mechanics.coupling, spec.motor
    light = spec.mass if coupling is None else min(spec.motor_mass, spec.mechanics.load_mass)
    rates = {"mechanics.pendulum": math.sqrt(spec.mechanics.pendulum / light)}
    for key, table in directions(spec).items():
        mass = spec.mass if coupling is None else spec.mechanics.load_mass if "load" in key else spec.motor_mass
        rates |= {f"{key}.viscous": table.viscous / mass, f"{key}.stribeck": _fall(table) / mass}
    if coupling is not None:
        rates["mechanics.coupling.stiffness"] = math.sqrt(coupling.stiffness / light)
        rates["mechanics.coupling.damping"] = coupling.damping / light
    if motor is not None and spec.drive.input == "voltage":
        drag = spec.force_constant * spec.emf_constant / (spec.mass if coupling is None else spec.motor_mass)
        rates["motor.resistance"] = drag / motor.resistance
        if motor.inductance > 0:
            rates["motor.inductance"] = motor.resistance / motor.inductance + math.sqrt(drag / motor.inductance)
    return max(rates, key=lambda name: rates[name])


def _slowed(spec: CascadeSpec, key: str) -> str:
    """Remedy: the nearest value of a key with which the plant is slow enough; empty if there is none."""
    from detent.methods.cascade.loop import fastest_rate

    path = key.split(".")
    near = _value(spec, path)
    rises = path[-1] in {"stribeck", "resistance", "inductance"}
    far = near * 1e12 if rises else near * 1e-12
    if fastest_rate(_changed(spec, path, far)) > FASTEST:
        return ""
    while max(near, far) > min(near, far) * (1 + 1e-6):
        middle = math.sqrt(near * far)
        near, far = (near, middle) if fastest_rate(_changed(spec, path, middle)) <= FASTEST else (middle, far)
    unit = unit_of(field_at(type(spec), tuple(path)))
    return offered(spec, key, at_least(far, unit) if rises else at_most(far, unit))


def _value(table: Table, path: list[str]) -> float:
    """A number of a specification."""
    for name in path:
        table = getattr(table, name)
    return float(cast("float", table))


def _changed(table: TableT, path: list[str], value: float) -> TableT:
    """A specification with another number."""
    name, *rest = path
    return table.model_copy(update={name: _changed(getattr(table, name), rest, value) if rest else value})


def _fall(table: DirectionTable) -> float:
    """Steepest fall of a Stribeck curve [N*s/m]."""
    return (table.static - table.coulomb) / table.stribeck if table.stribeck > 0 else 0.0


def _strength(spec: CascadeSpec) -> Iterator[Contradiction]:
    if not _is_solid(spec):
        return
    light = spec.mass if spec.mechanics.coupling is None else min(spec.motor_mass, spec.mechanics.load_mass)
    moved = 0.5 * spec.limits.effort / light * spec.method.sample_period**2
    if moved > spec.limits.travel:
        unit = spec.unit("N")
        yield Contradiction(
            ("limits.effort", "mechanics.load_mass", "mechanics.motor_mass", "method.sample_period"),
            f"such that it moves the lightest mass by up to limits.travel in a sample, here "
            f"{format_quantity(moved, spec.unit('m'))}: no loop stands that",
            either(
                offered(spec, "limits.effort", at_most(spec.limits.effort * spec.limits.travel / moved, unit)),
                "check the units of the masses",
            ),
        )


def _converter(spec: CascadeSpec) -> Iterator[Contradiction]:
    step, most = spec.drive.command_step, spec.largest_command
    if _is_solid(spec) and step > most:
        yield Contradiction(
            ("drive.command_step", "drive.command_limit", "limits.effort", "drive.max_current"),
            f"up to the largest command, {format_quantity(most, 'V')}",
            put("drive.command_step", at_most(most, "V")),
        )


def _velocity_limit(spec: CascadeSpec) -> Iterator[Contradiction]:
    method, speed, unit = spec.method, spec.limits.speed, spec.unit("m/s")
    if method.structure == "cascade" and method.velocity_limit < speed:
        yield Contradiction(
            ("method.velocity_limit", "limits.speed"),
            f"at least limits.speed, {format_quantity(speed, unit)}",
            either(
                offered(spec, "method.velocity_limit", at_least(speed, unit)),
                "leave it out: it is then 1.25 x limits.speed",
            ),
        )


def _supervision(spec: CascadeSpec) -> Iterator[Contradiction]:
    method, unit = spec.method, spec.unit("m")
    if method.following_error <= method.in_position:
        yield Contradiction(
            ("method.following_error", "method.in_position", "limits.travel", "encoder.resolution"),
            f"above method.in_position, {format_quantity(method.in_position, unit)}",
            offered(spec, "method.following_error", at_least(method.in_position * (1 + 1e-3), unit)),
        )
    least = method.in_position_time + method.sample_period
    if method.timeout < least:
        yield Contradiction(
            ("method.timeout", "method.in_position_time"),
            f"longer than method.in_position_time, {format_quantity(method.in_position_time, 's')}: no move could end",
            offered(spec, "method.timeout", at_least(least * (1 + BARELY), "s")),
        )


RULES: tuple[Callable[[CascadeSpec], Iterator[Contradiction]], ...] = (
    _motor,
    _travel,
    _masses,
    _pendulum,
    _gains,
    _feedback,
    _memory,
    _counts,
    _friction,
    _start,
    _rate,
    _strength,
    _converter,
    _velocity_limit,
    _supervision,
)
"""The rules, in the order in which their contradictions are told."""
