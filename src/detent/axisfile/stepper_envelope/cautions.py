"""What looks wrong with a stepper-envelope axis: reserves that are used up, and keys that do nothing.

An open-loop motor tells nobody that it lost a step. What keeps it from that is reserve; how much is needed has been
tried on the rotor of specification 7.2, with random motors, zones and edits (tests/property/step_cases.py). Outside
these margins an axis may still work, and a simulated run shows whether it does.
"""

import math
from collections.abc import Callable, Iterator
from typing import Any

from detent.axisfile.catalogue import STEPPER_MOTORS
from detent.axisfile.fields import unit_of
from detent.axisfile.findings import Caution
from detent.axisfile.nearest import BARELY, at_least, at_most, either, offer, put
from detent.axisfile.stepper_envelope.build import pull_out, start_hz
from detent.axisfile.stepper_envelope.derive import MotorFigures
from detent.axisfile.stepper_envelope.schema import StepperEnvelopeSpec, StepperTable
from detent.axisfile.stepper_envelope.torque_rules import bare_start_hz, better, changed, ramp_fits
from detent.units import format_quantity, parse_quantity

START_RESERVE = 1.4604
"""Start frequency over the natural one up to which no step was lost; that of 7.1."""

LEAST_AT_START = 0.9
"""Torque at the start frequency, as a part of that at standstill, down to which no step was lost."""

MOST_USED = 0.45
"""Share of its torque that a ramp takes, up to which no step was lost; 0.44 with 7.1."""

MOST_FRICTION = 0.1
"""Friction over the holding torque up to which no step was lost; that of 7.1."""

LEAST_SAFETY = 2.0
"""Divisors of pull-out torque and start frequency that age, temperature and resonance call for (7.1)."""

RESONANCE = (0.8, 1.25)
"""Step frequencies over the natural one at which the steps come in time with the rotor's swing."""

MOST_ROUNDING = 2e-3
"""Largest relative error of a frequency (test 31)."""

FEWEST_ZONE_STEPS = 5

Look = Callable[[MotorFigures], Iterator[Caution]]


def find_cautions(spec: StepperEnvelopeSpec) -> Iterator[Caution]:
    """Look a stepper-envelope axis over, motor by motor."""
    for name in spec.stepper:
        figures = MotorFigures(spec, name)
        for look in _LOOKS:
            for caution in look(figures):
                yield Caution(
                    f"{name}: {caution.name}", caution.value, caution.limit, caution.consequence, caution.remedy
                )


def _key(m: MotorFigures) -> str:
    return f"stepper.{m.name}"


# ------------------------------------------------------------------------------------------------------- lost steps


def _start(m: MotorFigures) -> Iterator[Caution]:
    ratio, safety = m.start_hz / m.natural_hz, m.table.drive.start_safety
    if ratio > START_RESERVE * (1 + BARELY):
        wanted = at_least(safety * bare_start_hz(m.table) / (START_RESERVE * m.natural_hz), "").strip('"')
        yield Caution(
            "start frequency",
            f"{format_quantity(m.start_hz, 'Hz')}, {ratio:.3g} x the natural frequency of the loaded rotor",
            f"up to {START_RESERVE:.3g} x",
            "a start, a stop or a reversal may lose steps",
            either(offer(StepperEnvelopeSpec, f"{_key(m)}.drive.start_safety", wanted), "check motor.start_frequency"),
        )
    if safety < LEAST_SAFETY:
        yield Caution(
            "drive.start_safety",
            f"{safety:g}",
            f"at least {LEAST_SAFETY:g}",
            "an old or a warm motor, or a heavier load, loses steps at a start",
            put(f"{_key(m)}.drive.start_safety", LEAST_SAFETY),
        )


def _share_at_start(table: StepperTable) -> float:
    """Torque at the start frequency as a part of that at standstill."""
    curve = pull_out(table)
    return curve(start_hz(table)) / curve(0.0)


def _torque_at_start(m: MotorFigures) -> Iterator[Caution]:
    share = _share_at_start(m.table)
    if share < LEAST_AT_START * (1 - BARELY):
        slower = better(
            m.table, _key(m), "drive.start_safety", 20.0, lambda table: _share_at_start(table) >= LEAST_AT_START
        )
        yield Caution(
            "torque at the start frequency",
            f"{share:.2f} of that at standstill",
            f"at least {LEAST_AT_START:g} of it",
            "the current has no time to rise, and a start or a stop may lose steps",
            either(slower, "raise drive.supply" if m.table.motor.pull_out == "winding" else ""),
        )


def _torque_used(m: MotorFigures) -> Iterator[Caution]:
    share, hz = m.torque_used
    if share <= MOST_USED * (1 + BARELY):
        return

    def is_good(table: StepperTable) -> bool:
        spec = m.spec.model_copy(update={"stepper": {**m.spec.stepper, m.name: table}})
        return MotorFigures(spec, m.name).torque_used[0] <= MOST_USED

    now, names = m.table.limits.acceleration, ("limits.acceleration", "limits.speed")
    far = (now / 1e3, m.start_hz * m.table.step)
    yield Caution(
        "torque used on the ramp",
        f"{share:.2f} of what there is, at {format_quantity(hz, 'Hz')}",
        f"up to {MOST_USED:g} of it",
        "the rotor lags far behind its field, and little more load makes it lose steps",
        either(*(_kept(m, name, end, is_good) for name, end in zip(names, far, strict=True)))
        or "choose a stronger motor or a higher supply",
    )


def _kept(m: MotorFigures, name: str, far: float, is_good: Callable[[StepperTable], bool]) -> str:
    """Remedy that lowers one key, if a ramp is left then."""
    remedy = better(m.table, _key(m), name, far, is_good)
    if not remedy:
        return ""
    value = parse_quantity(remedy.split('"')[1], "m/s^2" if name.endswith("acceleration") else "m/s")
    return remedy if ramp_fits(changed(m.table, name, value)) else ""


def _friction(m: MotorFigures) -> Iterator[Caution]:
    friction, most = m.load.friction_torque, MOST_FRICTION * m.motor.holding_torque
    if friction > most * (1 + BARELY):
        yield Caution(
            "friction",
            f"{format_quantity(friction, 'N*m')}, {friction / m.motor.holding_torque:.2g} of the holding torque",
            f"up to {MOST_FRICTION:g} of it, {format_quantity(most, 'N*m')}",
            "the rotor rests off its step, and falls behind at speed",
            either(put(f"{_key(m)}.mechanics.friction_torque", at_most(most, "N*m")), "choose a stronger motor"),
        )


def _torque_safety(m: MotorFigures) -> Iterator[Caution]:
    safety = m.table.drive.torque_safety
    if safety < LEAST_SAFETY:
        yield Caution(
            "drive.torque_safety",
            f"{safety:g}",
            f"at least {LEAST_SAFETY:g}",
            "published torques are those of a bench: resonance, a warm winding or a low supply takes the rest",
            put(f"{_key(m)}.drive.torque_safety", LEAST_SAFETY),
        )


def _rule(m: MotorFigures) -> Iterator[Caution]:
    if m.table.method.rule == "literal":
        yield Caution(
            "method.rule",
            "literal",
            "ramp-limited",
            "a run that does not begin at a start extreme of its table jumps to the speed stated there and loses steps",
            put(f"{_key(m)}.method.rule", '"ramp-limited"'),
        )


# ------------------------------------------------------------------------------------------------------------ motion


def _resonance(m: MotorFigures) -> Iterator[Caution]:
    low, high = (bound * m.natural_hz for bound in RESONANCE)
    speeds = {"limits.speed": m.table.limits.speed}
    speeds |= {f"zone.{name}.speed": zone.speed for name, zone in m.table.zone.items()}
    for name, speed in speeds.items():
        hz = m.table.hz(speed)
        if low < hz < high:
            faster = put(f"{_key(m)}.{name}", at_least(high * m.table.step, "m/s")) if high <= m.max_hz else ""
            slower = put(f"{_key(m)}.{name}", at_most(low * m.table.step, "m/s")) if low >= m.start_hz else ""
            yield Caution(
                name,
                f"{format_quantity(speed, 'm/s')}, {format_quantity(hz, 'Hz')}",
                f"below {format_quantity(low, 'Hz')} or above {format_quantity(high, 'Hz')}: the natural frequency is "
                f"{format_quantity(m.natural_hz, 'Hz')}",
                "the steps come in time with the swing of the rotor: noise, vibration, at worst lost steps",
                either(faster, slower) or "choose another lead, or change the inertia",
            )


def _settling(m: MotorFigures) -> Iterator[Caution]:
    controller, damping = m.spec.controller, m.damping
    period = 1 / (m.natural_hz * math.sqrt(1 - damping**2))
    decay = max(0.0, -math.log(controller.tolerance)) / (damping * 2 * math.pi * m.natural_hz)
    if controller.settle_time < (period + decay) * (1 - BARELY):
        yield Caution(
            "controller.settle_time",
            format_quantity(controller.settle_time, "s"),
            f"at least {format_quantity(period + decay, 's')}, a swing of the rotor and its decay to "
            f"{controller.tolerance:g} steps",
            "the rotor still swings when the motor counts as at rest",
            put("controller.settle_time", at_least(period + decay, "s")),
        )


def _extremes(m: MotorFigures) -> Iterator[Caution]:
    extremes, table = m.table.extremes, m.table
    for name, end in (("start", extremes.start), ("stop", extremes.stop)):
        way = table.step_inside(extremes.turn) - table.step_inside(end)
        if way < m.shortest_way:
            peak = float(m.ramp.hz[(way - 1) // 2])
            speed = format_quantity(peak * table.step, "m/s")
            yield Caution(
                f"way between extremes.{name} and extremes.turn",
                f"{way} steps",
                f"{m.shortest_way} or more, {format_quantity(m.shortest_way * table.step, 'm')}: two ramps",
                f"the run reaches {speed} ({format_quantity(peak, 'Hz')}) and never limits.speed",
                either(
                    put(f"{_key(m)}.limits.speed", at_most(peak * table.step, "m/s")), "move the extremes farther apart"
                ),
            )


def _zones(m: MotorFigures) -> Iterator[Caution]:
    for name, zone in m.table.zone.items():
        steps = (zone.end - zone.begin) / m.table.step
        if steps < FEWEST_ZONE_STEPS * (1 - BARELY):
            yield Caution(
                f"zone.{name}",
                f"{steps:.3g} steps long",
                f"at least {FEWEST_ZONE_STEPS} steps, {format_quantity(FEWEST_ZONE_STEPS * m.table.step, 'm')}",
                "it holds for every step that it touches, so that its bounds are off by up to a step",
                "make it longer, or its motor's steps finer",
            )


# --------------------------------------------------------------------------------------------------------- electronics


def _words(m: MotorFigures) -> Iterator[Caution]:
    clock, words = m.spec.controller.timer, m.spec.controller.words
    error = m.rounding(clock, words)
    if error <= MOST_ROUNDING:
        return
    finer = max(clock, 0.5 / MOST_ROUNDING * m.max_hz)
    remedies = ((finer, words, put("controller.timer", at_least(finer, "Hz"))),)
    remedies += ((clock, "reload", put("controller.words", '"reload"')),)
    good = [text for ticks, stored, text in remedies if m.rounding(ticks, stored) <= MOST_ROUNDING]
    yield Caution(
        "rounding of the frequencies",
        f"up to {format_quantity(error, '%')}, as {words} words at {format_quantity(clock, 'Hz')}",
        f"up to {format_quantity(MOST_ROUNDING, '%')}",
        "steps of the ramp become unequal, and take more torque than planned",
        either(*good) or put("controller.timer", at_least(finer, "Hz")) + ' and controller.words = "reload"',
    )


def _current(m: MotorFigures) -> Iterator[Caution]:
    rated, drive = m.table.motor.rated_current, m.table.drive
    if rated is None or drive.current is None:
        return
    if drive.current > rated * (1 + BARELY):
        yield Caution(
            "drive.current",
            format_quantity(drive.current, "A"),
            f"up to motor.rated_current, {format_quantity(rated, 'A')}",
            "the motor overheats",
            put(f"{_key(m)}.drive.current", at_most(rated, "A")),
        )
    needed = drive.current * (m.resistance or 0.0)
    if m.table.motor.pull_out == "winding" and drive.supply < needed * (1 - BARELY):
        yield Caution(
            "drive.supply",
            format_quantity(drive.supply, "V"),
            f"at least current x resistance, {format_quantity(needed, 'V')}",
            "the drive never reaches its current, not even at rest",
            offer(StepperEnvelopeSpec, f"{_key(m)}.drive.supply", at_least(needed, "V"))
            or put(f"{_key(m)}.drive.current", at_most(drive.supply / (m.resistance or 1.0), "A")),
        )


def _unused(m: MotorFigures) -> Iterator[Caution]:
    way = m.table.motor.pull_out
    others = {"pull_out_torque", "corner_frequency", "curve_frequency", "curve_torque", "resistance", "inductance"}
    own: dict[str, set[str]] = {
        "winding": {"resistance", "inductance"},
        "first order": {"pull_out_torque", "corner_frequency"},
        "points": {"curve_frequency", "curve_torque"},
    }
    idle = [f"motor.{name}" for name in sorted(others - own[way]) if _is_stated(m, name)]
    if way != "winding":
        fields: Any = type(m.table.drive).model_fields
        names = ("supply", "bridge_resistance")
        idle += [f"drive.{name}" for name in names if getattr(m.table.drive, name) != fields[name].default]
    if idle:
        yield Caution(
            "keys without effect",
            ", ".join(idle),
            f'those of pull_out = "{way}"',
            f"the pull-out torque is taken from {' and '.join(sorted(own[way]))} alone",
            "remove them, or choose the pull_out that uses them",
        )
    if m.table.drive.current is not None and m.table.motor.rated_current is None:
        yield Caution(
            "drive.current",
            format_quantity(m.table.drive.current, "A"),
            "stated with motor.rated_current",
            "without it nobody knows what part of the torque the current gives: the whole is assumed",
            f"add rated_current in [{_key(m)}.motor], or remove drive.current",
        )


def _is_stated(m: MotorFigures, name: str) -> bool:
    """True where the file states a constant of the motor, other than its catalogue motor has it."""
    motor = m.table.motor
    value = getattr(motor, name)
    constant = (STEPPER_MOTORS.constants(motor.catalogue) or {}).get(name)
    if constant is None:
        return value not in (None, [])
    return value != parse_quantity(str(constant), unit_of(type(motor).model_fields[name]))


_LOOKS: tuple[Look, ...] = (
    _start,
    _torque_at_start,
    _torque_used,
    _friction,
    _torque_safety,
    _rule,
    _resonance,
    _settling,
    _extremes,
    _zones,
    _words,
    _current,
    _unused,
)
