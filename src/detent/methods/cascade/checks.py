"""What is checked in a cascade axis: contradictions between its keys, and cautions about what will surprise.

An unstable loop is a caution: it can be simulated, and shows what it does.
"""

import math
from collections.abc import Iterator

from detent.axisfile import common_checks as common
from detent.axisfile.motion import rotary_model
from detent.files.findings import Caution, Contradiction, wrong
from detent.files.nearest import BARELY, Remedies, at_most, put
from detent.methods.cascade.derive import CascadeFigures, dead_time
from detent.methods.cascade.schema import MOST_SAMPLES, CascadeSpec, DirectionTable
from detent.units import format_quantity as text

FASTEST = 1e7  # fastest rate of the plant [1/s]: the tick is then 50 ns, and a simulated second takes some seconds
LEAST_MASS = 1e-12  # smallest mass [kg] or moment of inertia [kg m^2]: a thousandth of the lightest rotor of a file
MOST_COUNTS = 2**53  # counts of an encoder: beyond them a float no longer knows each
QUICK = 0.1  # bandwidth of a velocity loop that is proposed [rad] over its dead time: it keeps far from its limit

LEAST_GAIN_MARGIN, LEAST_PHASE_MARGIN = 1.5, math.radians(30)  # below them a loop rings
LARGEST_SENSITIVITY = 2.0  # Ms at the command: it leaves a gain margin of 2 and 29 degrees
LARGEST_PEAK = 1.3  # of the reference to the position, without feedforward
NEAR_RESONANCE = 0.5  # share of the anti-resonance above which a velocity loop on the motor leaves the load behind
LARGEST_JUMP = 0.1  # share of the largest command by which one count may move the drive
MOST_COMMAND = 0.95  # share of what the drive can do that a move at its limits may take


def remedy_of(spec: CascadeSpec) -> Remedies:
    """Values that would do, in the units of the axis's motion."""
    return Remedies(rotary_model(CascadeSpec) if spec.axis.motion == "rotary" else CascadeSpec)


# ---- contradictions


def _motor(spec: CascadeSpec) -> Iterator[Contradiction]:
    """Drive, motor and transmission go together."""
    drive, motor = spec.drive.input, spec.motor
    if drive == "force" and motor is not None:
        allowed = '"current" or "voltage" where there is a [motor]: a drive that imposes a force needs none'
        yield wrong("drive.input motor.rotor_inertia motor.catalogue", allowed, put("drive.input", '"current"'))
    if drive != "force" and motor is None:
        yield wrong("drive.input", '"force" where there is no [motor]', put("drive.input", '"force"'))
    if motor is not None and spec.mechanics.travel_per_revolution is None:
        lead = 'add travel_per_revolution = "10 mm" in [mechanics] (lead of the screw, or circumference of the pulley)'
        yield wrong("mechanics.travel_per_revolution drive.input", "a length where there is a [motor]", lead)


def _masses(spec: CascadeSpec) -> Iterator[Contradiction]:
    """There is something to move, on both sides of a coupling; only what turns can hang."""
    mechanics, masses, otherwise = spec.mechanics, {"load": spec.mass}, ""
    if mechanics.coupling is not None:
        masses = {"motor": spec.motor_mass, "load": mechanics.load_mass}
        otherwise = ", or leave [mechanics.coupling] out"
    for side, mass in masses.items():
        if mass < LEAST_MASS:
            key, what = f"mechanics.{side}_mass", f"the mass on the {side} side of the coupling"
            what = what if mechanics.coupling else "the total moving mass"
            allowed = f"such that {what} is at least {LEAST_MASS:g} {spec.unit('kg')}"
            yield wrong(f"{key} mechanics.coupling.stiffness", allowed, f"state {key}{otherwise}")
    if mechanics.pendulum > 0 and spec.axis.motion == "linear":
        here = "only a rotary axis can have a pendulum load; use mechanics.weight"
        allowed = f"0 N*m where axis.motion is linear: {here}"
        yield wrong("mechanics.pendulum axis.motion", allowed, put("mechanics.pendulum", '"0 N*m"'))


def _gains(spec: CascadeSpec) -> Iterator[Contradiction]:
    """The gains of the structure are stated."""
    method = spec.method
    for name in ("velocity_gain", "position_gain") if method.structure == "cascade" else ("proportional",):
        if getattr(method, name) == 0:
            keys, allowed = f"method.{name} method.structure", f'above 0 where method.structure is "{method.structure}"'
            yield wrong(keys, allowed, f"state {name} in [method]{_to_begin_with(spec, name)}")


def _to_begin_with(spec: CascadeSpec, name: str) -> str:
    """A gain that will do for nearly every axis: a velocity loop that keeps far from its dead time, and 20 Hz."""
    if not _is_solid(spec):
        return ""
    bandwidth = min(QUICK / dead_time(spec), 2 * math.pi * 20)
    if name == "position_gain":
        return f", such as {bandwidth / 4:.2g} to start with"
    unit, power = ("V*s/m", 1) if name == "velocity_gain" else ("V/m", 2)
    gain = bandwidth**power * spec.mass / spec.effort_per_command / 2 ** (2 * (power - 1))
    return f", such as {at_most(gain, spec.unit(unit), 2)} to start with"


def _is_solid(spec: CascadeSpec) -> bool:
    """Whether everything that a rate is computed from is there."""
    return not (any(_masses(spec)) or any(_motor(spec)))


def _encoders(spec: CascadeSpec) -> Iterator[Contradiction]:
    """The loops have their encoders, with a memory and counts that can be told apart."""
    feedback, unit = spec.method.feedback, spec.unit("m")
    for loop in ("position", "velocity"):
        if getattr(feedback, loop) == "load" and spec.load_encoder is None:
            key = f"method.feedback.{loop}"
            yield wrong(key, '"motor" where there is no [load_encoder]', put(key, '"motor"'))
    both = {"encoder": spec.encoder, "load_encoder": spec.load_encoder}
    tables = {name: table for name, table in both.items() if table is not None}
    finest = 2 * max(abs(spec.limits.lowest), abs(spec.highest)) / MOST_COUNTS
    for name, table in tables.items():
        if table.delay + table.velocity_span > MOST_SAMPLES:
            allowed = f"up to {MOST_SAMPLES} samples together with {name}.delay"
            fewer = put(f"{name}.velocity_span", MOST_SAMPLES - table.delay)
            yield wrong(f"{name}.velocity_span {name}.delay", allowed, fewer)
    for name, table in tables.items():
        if 0 < table.resolution < finest:
            allowed = f"0 {unit}, or at least {text(finest, unit)}: more counts cannot be distinguished"
            coarser = remedy_of(spec).least(f"{name}.resolution", finest)
            yield wrong(f"{name}.resolution limits.travel", allowed, coarser)


def _places(spec: CascadeSpec) -> Iterator[Contradiction]:
    """Friction is plausible, and the axis starts on its way."""
    start, low, high, unit = spec.mechanics.start_position, spec.limits.lowest, spec.highest, spec.unit("m")
    yield from common.static_friction(directions(spec), spec.unit("N"))
    if not low <= start <= high:
        key = "mechanics.start_position"
        allowed = f"from {text(low, unit)} to {text(high, unit)}, the travel of the axis"
        nearest = put(key, f'"{low if start < low else high!r} {unit}"')
        yield wrong(f"{key} limits.travel limits.lowest", allowed, nearest)

    switches = spec.limit_switches
    if switches is not None and not switches.lower < start < switches.upper:
        allowed = f"such that the start of the axis, {text(start, unit)}, lies between both limit switches"
        moved = "leave lower and upper out of [limit_switches]: they then lie a little beyond the travel"
        yield wrong("limit_switches.lower limit_switches.upper mechanics.start_position", allowed, moved)


def _heat(spec: CascadeSpec) -> Iterator[Contradiction]:
    """A model of the motor's heat goes by its current."""
    bears = spec.motor is not None and spec.motor.max_current is not None
    if spec.protection.thermal_time > 0.0 and not (bears and spec.drive.input == "current"):
        allowed = '"0 s" without motor.max_current, or where drive.input is not "current"'
        remedy = put("protection.thermal_time", '"0 s"')
        yield wrong("protection.thermal_time motor.max_current drive.input", allowed, remedy)


def directions(spec: CascadeSpec) -> dict[str, DirectionTable]:
    """Friction of both masses in both directions, by their tables."""
    masses = {"friction": spec.mechanics.friction, "load_friction": spec.mechanics.load_friction}
    return {
        f"mechanics.{name}.{sense}": table
        for name, friction in masses.items()
        for sense, table in (("positive", friction.positive), ("negative", friction.negative))
    }


def _rate(spec: CascadeSpec) -> Iterator[Contradiction]:
    """The plant is slow enough to be simulated."""
    from detent.methods.cascade.loop import machine_of
    from detent.plant.linear_two_mass import fastest_rate

    if not _is_solid(spec):
        return
    rate = fastest_rate(machine_of(spec))
    if rate > FASTEST:
        key = _culprit(spec)
        change = "raise" if key.endswith(("stribeck", "resistance", "inductance")) else "lower"
        limit = f"1/{text(1 / FASTEST, 's')} or less, here 1/{text(1 / rate, 's', 3)}"
        allowed = f"such that the fastest rate of motor, coupling and load is {limit}"
        remedy = f"{change} {key}, or check its unit and those of the masses"
        yield wrong(f"{key} mechanics.load_mass mechanics.motor_mass", allowed, remedy)


def ends(spec: CascadeSpec) -> tuple[float, float]:
    """What moves at the motor and at the load [kg]; all of it at both where the axis is rigid."""
    coupled = spec.mechanics.coupling is not None
    return (spec.motor_mass, spec.mechanics.load_mass) if coupled else (spec.mass, spec.mass)


def _culprit(spec: CascadeSpec) -> str:
    """Key that makes the plant too fast."""
    coupling, motor, (at_motor, at_load) = spec.mechanics.coupling, spec.motor, ends(spec)
    light = min(at_motor, at_load)
    rates = {"mechanics.pendulum": math.sqrt(spec.mechanics.pendulum / light)}
    for key, table in directions(spec).items():
        mass = at_load if "load" in key else at_motor
        fall = (table.static - table.coulomb) / table.stribeck if table.stribeck > 0 else 0.0
        rates |= {f"{key}.viscous": table.viscous / mass, f"{key}.stribeck": fall / mass}
    if coupling is not None:
        rates["mechanics.coupling.stiffness"] = math.sqrt(coupling.stiffness / light)
        rates["mechanics.coupling.damping"] = coupling.damping / light
    if motor is not None and spec.drive.input == "voltage":
        drag = spec.force_constant * spec.emf_constant / at_motor
        rates["motor.resistance"] = drag / motor.resistance
        if motor.inductance > 0:
            rates["motor.inductance"] = motor.resistance / motor.inductance + math.sqrt(drag / motor.inductance)
    return max(rates, key=lambda name: rates[name])


def _drive(spec: CascadeSpec) -> Iterator[Contradiction]:
    """The drive does not throw the axis away, and its converter has a step."""
    if not _is_solid(spec):
        return
    limits, largest, remedy = spec.limits, spec.largest_command, remedy_of(spec)
    moved = 0.5 * limits.effort / min(ends(spec)) * spec.method.sample_period**2
    if moved > limits.travel:
        here = f"here {text(moved, spec.unit('m'))}: no loop tolerates that"
        keys = "limits.effort mechanics.load_mass mechanics.motor_mass method.sample_period"
        allowed = f"such that it moves the lightest mass by up to limits.travel in a sample, {here}"
        yield wrong(keys, allowed, remedy.most("limits.effort", limits.effort * limits.travel / moved))
    if spec.drive.command_step > largest:
        keys = "drive.command_step drive.command_limit limits.effort drive.max_current"
        allowed = f"up to the largest command, {text(largest, 'V')}"
        yield wrong(keys, allowed, remedy.most("drive.command_step", largest))


def _supervision(spec: CascadeSpec) -> Iterator[Contradiction]:
    """Limits of the loops let a move pass and end."""
    method, speed, remedy = spec.method, spec.limits.speed, remedy_of(spec)
    if method.structure == "cascade" and method.velocity_limit < speed:
        allowed = f"at least limits.speed, {text(speed, spec.unit('m/s'))}; its default is 1.25 x limits.speed"
        yield wrong("method.velocity_limit limits.speed", allowed, remedy.least("method.velocity_limit", speed))
    if method.following_error <= method.in_position:
        key, allowed = "method.following_error", f"above method.in_position, {text(method.in_position, spec.unit('m'))}"
        more = remedy.least(key, method.in_position * (1 + 1e-3))
        yield wrong(f"{key} method.in_position limits.travel encoder.resolution", allowed, more)
    if method.dead_band > method.in_position:
        allowed = f"up to method.in_position, {text(method.in_position, spec.unit('m'))}: it may rest anywhere inside"
        less = remedy.most("method.dead_band", method.in_position)
        yield wrong("method.dead_band method.in_position", allowed, less)
    yield from common.end_of_move(remedy, method.timeout, method.in_position_time, method.sample_period)


def _home(spec: CascadeSpec) -> Iterator[Contradiction]:
    """The reference can be found, and lies where the axis may come."""
    home, limits = spec.home, spec.limits
    if home is None:
        return
    if home.by == "index" and not spec.mechanics.travel_per_revolution:
        allowed = "an index mark where a motor turns, whose mechanics.travel_per_revolution is stated"
        yield wrong("home.by", allowed, put("home.by", '"switch"'))
    ends = limits.lowest, spec.highest
    yield from common.home(remedy_of(spec), home, ends, limits.speed, unit=spec.unit("m"))


RULES = (_motor, _masses, _gains, _encoders, _places, _heat, _rate, _drive, _supervision, _home)
"""Contradictions are reported in this order."""


# ---- cautions


def find_cautions(spec: CascadeSpec) -> Iterator[Caution]:
    """Look a cascade axis over."""
    machine = CascadeFigures(spec)
    for look in (_loops, _bandwidth, _position, _force, _current, _following, _brake):
        yield from look(machine)


def _loops(m: CascadeFigures) -> Iterator[Caution]:
    """The loops settle, and do not ring."""
    loop, margin = m.loop, m.loop.gain_margin
    if margin < LEAST_GAIN_MARGIN:
        value = f"gain margin {margin:.3g}, spectral radius {loop.spectral_radius:.4f}"
        limit = f"a margin of at least {LEAST_GAIN_MARGIN:g}: below 1 the loops are unstable"
        consequence = "the axis oscillates with growing amplitude until the command saturates"
        remedy = "lower all gains, starting with the integral and position gains, or shorten the dead time"
        if margin >= 1:
            consequence = "with slightly more gain or less mass the axis oscillates"
        if margin > 0:
            remedy = _lowered(m, margin / LEAST_GAIN_MARGIN * (1 - 1e-3))
        yield Caution("stability of the loops", value, limit, consequence, remedy)
        return
    for name, inner, gain in (
        ("velocity loop", loop.velocity_loop, "method.velocity_gain or method.velocity_integral"),
        ("position loop", loop.position_loop, "the outer gain or the integral"),
    ):
        if inner.crossover > 0 and inner.phase < LEAST_PHASE_MARGIN:
            value, limit = text(inner.phase, "rad", 3), f"at least {text(LEAST_PHASE_MARGIN, 'rad')}"
            remedy = f"lower {gain}, or shorten the dead time of {text(dead_time(m.spec), 's', 3)}"
            yield Caution(f"phase margin of the {name}", value, limit, "it rings after every setpoint change", remedy)
    level, peak = loop.sensitivity
    if level > LARGEST_SENSITIVITY:
        value, limit = f"{level:.3g} at {text(peak, 'Hz', 3)}", f"up to {LARGEST_SENSITIVITY:g}"
        consequence = "disturbances near this frequency are amplified so many times, and little gain is left"
        yield Caution("Ms at the command", value, limit, consequence, "choose gains with `detent tune`")


def _lowered(m: CascadeFigures, share: float) -> str:
    """Remedy: the gain of the whole loop lowered to a share of what it is."""
    method, unit = m.spec.method, m.spec.unit
    if method.structure == "pid":
        return f"lower proportional, integral and derivative in [method] to {100 * share:.3g} % of what they are"
    gain = put("method.velocity_gain", at_most(share * method.velocity_gain, unit("V*s/m")))
    if method.velocity_integral == 0:
        return gain
    return f"{gain} and method.velocity_integral = {at_most(share * method.velocity_integral, unit('V/m'))}"


def _bandwidth(m: CascadeFigures) -> Iterator[Caution]:
    """Each loop keeps below what it acts on."""
    loop, method = m.loop, m.spec.method
    inner = loop.velocity_loop.crossover
    near = NEAR_RESONANCE * m.anti_resonance
    peak, at = loop.open_loop("position").closed().peak if inner > 0 and loop.spectral_radius < 1.0 else (0.0, 0.0)
    if peak > LARGEST_PEAK:
        limit = f"up to {LARGEST_PEAK:g} times the reference"
        consequence = "the velocity loop is too slow for it, and moves overshoot"
        remedy = f"lower method.position_gain, {method.position_gain:.4g}, or choose gains with `detent tune`"
        value = f"{peak:.3g} times the reference at {text(at, 'Hz', 3)}"
        yield Caution("peak of the position loop", value, limit, consequence, remedy)
    if inner > near > 0 and method.feedback.velocity == "motor":
        limit = f"up to half the anti-resonance, {text(near, 'Hz')}"
        consequence = "it holds the motor while the load oscillates on its coupling with hardly any damping"
        remedy = _lowered(m, 0.99 / loop.velocity_level(near))
        yield Caution("bandwidth of the velocity loop", text(inner, "Hz"), limit, consequence, remedy)


def _position(m: CascadeFigures) -> Iterator[Caution]:
    """Position is measured where and as finely as it is held, and a count of velocity does not shake the drive."""
    spec, method, unit = m.spec, m.spec.method, m.spec.unit("m")
    count = spec.encoder_of("position").resolution
    if method.in_position < count:
        key, limit = "method.in_position", f"at least a count of the encoder, {text(count, unit)}"
        consequence, remedy = (
            "an error of one count already counts as out of position",
            remedy_of(spec).least(key, count),
        )
        yield Caution(key, text(method.in_position, unit), limit, consequence, remedy)
    table, most = spec.encoder_of("velocity"), LARGEST_JUMP * spec.largest_command
    name = "encoder" if spec.method.feedback.velocity == "motor" else "load_encoder"
    if m.jump > most:
        span = math.ceil(table.velocity_span * m.jump / most * (1 - BARELY))
        fits = span + table.delay <= MOST_SAMPLES
        limit = f"up to a tenth of the largest command, {text(most, 'V')}"
        remedy = put(f"{name}.velocity_span", span) if fits else f"state {name}.velocity_filter, or use a finer encoder"
        yield Caution(
            "command noise from velocity quantization",
            text(m.jump, "V"),
            limit,
            "the drive is noisy even at rest",
            remedy,
        )


def _force(m: CascadeFigures) -> Iterator[Caution]:
    """The drive has the force that the limits ask for."""
    spec, speed, acceleration, unit = m.spec, m.speed, m.spec.limits.acceleration, m.spec.unit("N")
    loose, strongest = m.breaking(), m.available(0.0)
    hold, needed, available = m.needed(speed), m.needed(speed, acceleration), m.available(speed)
    most = available * MOST_COMMAND
    if loose >= strongest:
        limit = f"below the largest force, {text(strongest, unit)}"
        consequence = "the axis cannot break away everywhere"
        remedy = "raise limits.effort, drive.command_limit or the amplifier's limit"
        yield Caution("friction and weight", text(loose, unit), limit, consequence, remedy)
    elif hold >= most:
        limit = f"below what the drive can deliver at that speed, {text(available, unit)}"
        remedy = "lower limits.speed, or raise drive.command_limit or limits.effort"
        yield Caution(
            "force at limits.speed", text(hold, unit), limit, "the following error grows without bound", remedy
        )
    elif needed > most:
        limit = f"up to 95 % of what the drive can deliver at limits.speed, {text(most, unit)}"
        consequence = "the command saturates and the axis falls behind while accelerating"
        remedy = remedy_of(spec).most("limits.acceleration", (most - hold) / spec.mass)
        yield Caution("acceleration force", text(needed, unit), limit, consequence, remedy)


def _current(m: CascadeFigures) -> Iterator[Caution]:
    """The limits act before the drive's own, and the motor stands the current."""
    spec, motor, unit = m.spec, m.spec.motor, m.spec.unit("N")
    has_limit = spec.drive.max_current is not None and spec.drive.input != "force"
    by_current = (spec.drive.max_current or 0.0) * spec.force_constant if has_limit else math.inf
    by_drive = min(spec.drive.command_limit * m.per_command, by_current)
    giver = "the drive gives at standstill"
    yield from common.idle_effort(remedy_of(spec), spec.limits.effort, by_drive, unit, giver)
    if motor is not None:
        held = m.needed(m.speed) / spec.force_constant
        stronger = "use a stronger motor, or lower friction and weight"
        yield from common.overheating("current at limits.speed", held, motor.max_current, stronger)


def _following(m: CascadeFigures) -> Iterator[Caution]:
    """At limits.speed the axis keeps within the limits of its loops, and at rest friction does not hold it outside."""
    method, unit, speed = m.spec.method, m.spec.unit("m"), m.spec.unit("m/s")
    error, demand, remedy = m.following_error, m.velocity_demand, remedy_of(m.spec)
    integral = "state method.integral" if method.structure == "pid" else "state method.velocity_integral"
    if error >= method.following_error:
        limit = f"below method.following_error, {text(method.following_error, unit)}"
        consequence = "the drive trips on a move at full speed"
        wider = remedy.least("method.following_error", 1.5 * error, "raise the feedforward of velocity")
        yield Caution("following error at limits.speed", text(error, unit), limit, consequence, wider)
    if demand > method.velocity_limit:
        limit = f"up to method.velocity_limit, {text(method.velocity_limit, speed)}"
        consequence = (
            "without an integral, friction slows the axis below its reference, and the velocity demand is too "
            "limited to compensate"
        )
        wider = remedy.least("method.velocity_limit", demand, integral)
        yield Caution("velocity demand at limits.speed", text(demand, speed), limit, consequence, wider)
    if m.resting_error > method.in_position:
        limit = f"up to method.in_position, {text(method.in_position, unit)}"
        consequence = "friction or weight may hold the axis outside the window, and the move then fails"
        yield Caution("error at rest", text(m.resting_error, unit), limit, consequence, integral)


def _brake(m: CascadeFigures) -> Iterator[Caution]:
    """The brake holds what pulls at the load for good, and what the file pushes it by, by itself."""
    spec, unit = m.spec, m.spec.unit("N")
    if spec.brake is None:
        return
    push, weight, pendulum = spec.disturbance.push, spec.mechanics.weight, spec.mechanics.pendulum
    pushed = abs((push.force if push else 0.0) - weight) + pendulum
    name, load = max(("weight", spec.holding), ("weight and push", pushed), key=lambda one: one[1])
    if spec.brake.force < load:
        limit = f"at least the largest force on the load, {text(load, unit)} of {name}"
        consequence = "the axis moves though its torque is off and its brake closed"
        yield Caution(
            "brake.force", text(spec.brake.force, unit), limit, consequence, remedy_of(spec).least("brake.force", load)
        )
