"""What looks wrong with a cascade axis that can be built: loops that are too fast for it, and a drive that is too weak.

An unstable loop is a caution and no error: it can be simulated, and shows what it does.
"""

import math
from collections.abc import Callable, Iterator

from detent.files.findings import Caution
from detent.files.nearest import BARELY, at_least, at_most, either, put
from detent.methods.cascade.derive import Machine
from detent.methods.cascade.rules import dead_time, offered
from detent.methods.cascade.schema import MOST_SAMPLES, CascadeSpec
from detent.units import format_quantity

LEAST_GAIN_MARGIN = 1.5

LEAST_PHASE_MARGIN = math.radians(30)
"""Phase margin below which a loop rings."""

SLOWER = 2.0
"""By how much the velocity loop should be faster than the position loop around it."""

NEAR_RESONANCE = 0.5
"""Share of the anti-resonance from which on a velocity loop on the motor no longer moves the load with it."""

LARGEST_JUMP = 0.1
"""Share of the largest command by which one count may move the drive."""

MOST_COMMAND = 0.95
"""Share of what the drive can do that a move at its limits may take."""


def find_cautions(spec: CascadeSpec) -> Iterator[Caution]:
    """Look a cascade axis over."""
    machine = Machine(spec)
    for look in _LOOKS:
        yield from look(machine)


def _stability(machine: Machine) -> Iterator[Caution]:
    margin = machine.loop.gain_margin
    if margin >= LEAST_GAIN_MARGIN:
        return
    yield Caution(
        "stability of the loops",
        f"gain margin {margin:.3g}, spectral radius {machine.loop.spectral_radius:.4f}",
        f"a margin of at least {LEAST_GAIN_MARGIN:g}: below 1 the loops are unstable",
        "the axis swings, and the swing grows until the command is limited"
        if margin < 1
        else "a little more gain or less mass, and the axis swings",
        _lowered(machine, margin / LEAST_GAIN_MARGIN * (1 - 1e-3))
        if margin > 0
        else "lower all gains, those of integrals and of the position first, or shorten the dead time",
    )


def _lowered(machine: Machine, share: float) -> str:
    """Remedy: the gain of the whole loop lowered to a share of what it is."""
    method, spec = machine.spec.method, machine.spec
    if method.structure == "pid":
        return (
            f"lower method.proportional, method.integral and method.derivative to {100 * share:.3g} % of what they are"
        )
    gain = put("method.velocity_gain", at_most(share * method.velocity_gain, spec.unit("V*s/m")))
    if method.velocity_integral == 0:
        return gain
    return f"{gain} and method.velocity_integral = {at_most(share * method.velocity_integral, spec.unit('V/m'))}"


def _damping(machine: Machine) -> Iterator[Caution]:
    loop = machine.loop
    if loop.gain_margin < LEAST_GAIN_MARGIN:
        return
    for name, margin, gain in (
        ("velocity loop", loop.velocity_loop, "method.velocity_gain or method.velocity_integral"),
        ("position loop", loop.position_loop, "the outer gain or the integral"),
    ):
        if margin.crossover > 0 and margin.phase < LEAST_PHASE_MARGIN:
            yield Caution(
                f"phase margin of the {name}",
                format_quantity(margin.phase, "rad", 3),
                f"at least {format_quantity(LEAST_PHASE_MARGIN, 'rad')}",
                "it rings after every change",
                f"lower {gain}, or shorten the dead time of {format_quantity(dead_time(machine.spec), 's', 3)}",
            )


def _bandwidth(machine: Machine) -> Iterator[Caution]:
    loop, method = machine.loop, machine.spec.method
    inner, outer = loop.velocity_loop.crossover, loop.position_loop.crossover
    if 0 < inner < SLOWER * outer:
        yield Caution(
            "bandwidth of the position loop",
            format_quantity(outer, "Hz"),
            f"up to half that of the velocity loop, {format_quantity(inner / SLOWER, 'Hz')}",
            "the velocity loop is too slow for it, and a move overshoots",
            f"lower method.position_gain, {method.position_gain:.4g}, or raise method.velocity_gain",
        )
    anti = machine.anti_resonance / (2 * math.pi)
    if inner > NEAR_RESONANCE * anti > 0 and method.feedback.velocity == "motor":
        yield Caution(
            "bandwidth of the velocity loop",
            format_quantity(inner, "Hz"),
            f"up to half the anti-resonance, {format_quantity(NEAR_RESONANCE * anti, 'Hz')}",
            "it holds the motor while the load swings on its coupling, hardly damped",
            either(_lowered(machine, 0.99 / loop.velocity_level(NEAR_RESONANCE * anti)), "stiffen the coupling"),
        )


def _hunting(machine: Machine) -> Iterator[Caution]:
    coupling = machine.spec.mechanics.coupling
    on_load = machine.spec.method.feedback.position == "load"
    if coupling is not None and coupling.backlash > 0 and on_load and machine.integrates:
        yield Caution(
            "backlash in the position loop",
            format_quantity(coupling.backlash, machine.spec.unit("m")),
            "none, where the position is that of the load and there is an integral",
            "at rest the motor hunts from flank to flank",
            put("method.feedback.position", '"motor"'),
        )


def _resolution(machine: Machine) -> Iterator[Caution]:
    spec, jump = machine.spec, machine.jump
    table, side = spec.velocity_encoder, spec.method.feedback.velocity
    name = "encoder" if side == "motor" else "load_encoder"
    most = LARGEST_JUMP * spec.largest_command
    if jump > most:
        span = math.ceil(table.velocity_span * jump / most * (1 - BARELY))
        yield Caution(
            "command of one count of velocity",
            format_quantity(jump, "V"),
            f"up to a tenth of the largest command, {format_quantity(most, 'V')}",
            "the drive is noisy even at rest",
            either(
                put(f"{name}.velocity_span", span) if span + table.delay <= MOST_SAMPLES else "",
                f"set {name}.velocity_filter, or use a finer encoder",
            ),
        )
    window, count = spec.method.in_position, spec.position_encoder.resolution
    if window < count:
        unit = spec.unit("m")
        yield Caution(
            "method.in_position",
            format_quantity(window, unit),
            f"at least a count of the encoder, {format_quantity(count, unit)}",
            "one count off, and the axis is not in position",
            put("method.in_position", at_least(count, unit)),
        )


def _effort(machine: Machine) -> Iterator[Caution]:
    spec, limits = machine.spec, machine.spec.limits
    unit, speed = spec.unit("N"), machine.speed
    loose, strongest = machine.breaking(spec.mechanics.weight) + spec.mechanics.pendulum, machine.available(0.0)
    available = machine.available(speed)
    hold = machine.needed(speed)
    if loose >= strongest:
        yield Caution(
            "friction and weight",
            format_quantity(loose, unit),
            f"below the largest force, {format_quantity(strongest, unit)}",
            "there are places where the axis never breaks loose",
            "raise limits.effort, drive.command_limit or the amplifier's limit",
        )
    elif hold >= available * MOST_COMMAND:
        yield Caution(
            "force at limits.speed",
            format_quantity(hold, unit),
            f"below what the drive has at that speed, {format_quantity(available, unit)}",
            "the following error grows without end",
            "lower limits.speed, or raise drive.command_limit or limits.effort",
        )
    elif machine.needed(speed, limits.acceleration) > available * MOST_COMMAND:
        left = (available * MOST_COMMAND - hold) / spec.mass
        yield Caution(
            "force of an acceleration",
            format_quantity(machine.needed(speed, limits.acceleration), unit),
            f"up to 95 % of what the drive has at limits.speed, {format_quantity(available * MOST_COMMAND, unit)}",
            "the command is limited and the axis falls behind as it speeds up",
            either(
                offered(spec, "limits.acceleration", at_most(left, spec.unit("m/s^2"))),
                "raise drive.command_limit or limits.effort",
            ),
        )


def _limits(machine: Machine) -> Iterator[Caution]:
    spec, unit = machine.spec, machine.spec.unit("N")
    by_drive = min(spec.drive.command_limit * machine.per_command, _by_current(spec))
    if spec.limits.effort > by_drive * (1 + 1e-6):
        yield Caution(
            "limits.effort",
            format_quantity(spec.limits.effort, unit),
            f"up to what the drive gives at standstill, {format_quantity(by_drive, unit)}",
            "the limit never acts: the drive is weaker",
            offered(spec, "limits.effort", at_most(by_drive, unit)) or "check the units of motor and drive",
        )


def _by_current(spec: CascadeSpec) -> float:
    """Force of the amplifier's largest current [N]."""
    most = spec.drive.max_current
    return math.inf if most is None or spec.drive.input == "force" else most * spec.force_constant


def _current(machine: Machine) -> Iterator[Caution]:
    spec = machine.spec
    if spec.motor is None or spec.motor.max_current is None:
        return
    held = machine.needed(machine.speed) / spec.force_constant
    if held > spec.motor.max_current:
        yield Caution(
            "current at limits.speed",
            format_quantity(held, "A"),
            f"up to motor.max_current, {format_quantity(spec.motor.max_current, 'A')}",
            "the motor gets too hot on long ways",
            "use a stronger motor, or lower friction and weight",
        )


def _following(machine: Machine) -> Iterator[Caution]:
    spec, method, unit = machine.spec, machine.spec.method, machine.spec.unit("m")
    error = machine.following_error
    if error >= method.following_error:
        yield Caution(
            "following error at limits.speed",
            format_quantity(error, unit),
            f"below method.following_error, {format_quantity(method.following_error, unit)}",
            "the drive goes off on a move at full speed",
            either(
                offered(spec, "method.following_error", at_least(1.5 * error, unit)),
                put("method.feed_forward.velocity", 1) if method.feed_forward.velocity < 1 else "",
            ),
        )
    demand = machine.velocity_demand
    if demand > method.velocity_limit:
        speed = spec.unit("m/s")
        yield Caution(
            "velocity demand at limits.speed",
            format_quantity(demand, speed),
            f"up to method.velocity_limit, {format_quantity(method.velocity_limit, speed)}",
            "without an integral friction slows the axis below its reference, and the demand cannot make up for it",
            either(offered(spec, "method.velocity_limit", at_least(demand, speed)), "state method.velocity_integral"),
        )


def _rest(machine: Machine) -> Iterator[Caution]:
    method, unit, error = machine.spec.method, machine.spec.unit("m"), machine.resting_error
    if error > method.in_position:
        integral = "method.integral" if method.structure == "pid" else "method.velocity_integral"
        yield Caution(
            "error at rest",
            format_quantity(error, unit),
            f"up to method.in_position, {format_quantity(method.in_position, unit)}",
            "friction or weight may hold the axis outside, and a move then fails",
            either(f"state {integral}", offered(machine.spec, "method.in_position", at_least(error, unit))),
        )


_LOOKS: tuple[Callable[[Machine], Iterator[Caution]], ...] = (
    _stability,
    _damping,
    _bandwidth,
    _hunting,
    _resolution,
    _effort,
    _limits,
    _current,
    _following,
    _rest,
)
"""What is looked at, in the order in which it is told."""
