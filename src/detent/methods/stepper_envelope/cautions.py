"""What looks wrong with a stepper-envelope axis: reserves that are used up, and keys that do nothing.

An open-loop motor tells nobody that it lost a step. What keeps it from that is reserve; how much is needed has been
tried on the rotor of specification 7.2, with random motors, zones and edits (tests/property/step_motors.py). Outside
these margins an axis may still work, and a simulated run shows whether it does.
"""

import math
from collections.abc import Callable, Iterator
from typing import Any

from detent.axisfile.catalogue import STEPPER_MOTORS
from detent.files.fields import unit_of
from detent.files.findings import Caution
from detent.files.nearest import BARELY, at_least, at_most, either, offer, put
from detent.methods.stepper_envelope.build import pull_out, start_hz
from detent.methods.stepper_envelope.derive import MotorFigures
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec, StepperTable
from detent.methods.stepper_envelope.torque_rules import bare_start_hz, better, changed, ramp_fits, slower
from detent.units import format_quantity, parse_quantity

START_RESERVE = 1.4604
"""Start frequency over the natural one up to which no step was lost; that of 7.1."""

LEAST_NEAR_START = 0.9
"""Torque up to that frequency, as a part of that at standstill, down to which no step was lost; 0.95 with 7.1."""

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
    """Look a stepper-envelope axis over: each motor, then what they share."""
    motors = [MotorFigures(spec, name) for name in spec.stepper]
    for m in motors:
        for look in _LOOKS:
            for found in look(m):
                yield Caution(f"{m.name}: {found.name}", found.value, found.limit, found.consequence, found.remedy)
    yield from _settling(max(motors, key=_settling_time))
    yield from _rounding(max(motors, key=lambda m: m.rounding(spec.controller.timer, spec.controller.words)))


def _key(m: MotorFigures) -> str:
    return f"stepper.{m.name}"


# ------------------------------------------------------------------------------------------------------- lost steps


def _safer_start(m: MotorFigures, ratio: float) -> str:
    """Remedy for a start frequency above a multiple of the natural one."""
    least = m.table.drive.start_safety * bare_start_hz(m.table) / (ratio * m.natural_hz)
    return offer(StepperEnvelopeSpec, f"{_key(m)}.drive.start_safety", at_least(least, "").strip('"'))


def _start(m: MotorFigures) -> Iterator[Caution]:
    ratio, safety = m.start_hz / m.natural_hz, m.table.drive.start_safety
    if ratio > START_RESERVE * (1 + BARELY):
        yield Caution(
            "start frequency",
            f"{format_quantity(m.start_hz, 'Hz')}, {ratio:.3g} x the natural frequency of the loaded rotor",
            f"up to {START_RESERVE:.3g} x",
            "a start, a stop or a reversal may lose steps",
            either(_safer_start(m, START_RESERVE), "check motor.start_frequency"),
        )
    if safety < LEAST_SAFETY:
        yield Caution(
            "drive.start_safety",
            f"{safety:g}",
            f"at least {LEAST_SAFETY:g}",
            "an old or a warm motor, or a heavier load, loses steps at a start",
            put(f"{_key(m)}.drive.start_safety", LEAST_SAFETY),
        )


def _torque_near_start(m: MotorFigures) -> Iterator[Caution]:
    swinging = START_RESERVE * m.natural_hz

    def share(table: StepperTable) -> float:
        curve = pull_out(table)
        return min(curve(hz) for hz in (start_hz(table), swinging)) / curve(0.0)

    if share(m.table) < LEAST_NEAR_START * (1 - BARELY):
        higher = ""
        if m.table.motor.pull_out == "winding":
            higher = better(m.table, _key(m), "drive.supply", 1000.0, lambda table: share(table) >= LEAST_NEAR_START)
        yield Caution(
            "torque near the start frequency",
            f"{share(m.table):.2g} of that at standstill, at {format_quantity(max(swinging, m.start_hz), 'Hz')}",
            f"at least {LEAST_NEAR_START:g} of it up to {START_RESERVE:.3g} x the natural frequency",
            "the current has no time to rise where the rotor swings, and a start or a stop may lose steps",
            higher or "choose a motor of less inductance, or a heavier load",
        )


def _reversal(m: MotorFigures) -> Iterator[Caution]:
    ratio = m.start_hz / m.natural_hz
    if m.table.drive.reversal_pause == 0 and ratio > START_RESERVE / 2 * (1 + BARELY):
        yield Caution(
            "drive.reversal_pause",
            f"0 with a start frequency of {ratio:.3g} x the natural one",
            f"1 or more above {START_RESERVE / 2:.2g} x",
            "single steps to and fro swing the rotor up until it loses steps",
            either(put(f"{_key(m)}.drive.reversal_pause", 1), _safer_start(m, START_RESERVE / 2)),
        )


def _torque_used(m: MotorFigures) -> Iterator[Caution]:
    share, hz = m.torque_used
    if share <= MOST_USED * (1 + BARELY):
        return

    def is_good(table: StepperTable) -> bool:
        spec = m.spec.model_copy(update={"stepper": {**m.spec.stepper, m.name: table}})
        return MotorFigures(spec, m.name).torque_used[0] <= MOST_USED

    gentler = better(m.table, _key(m), "limits.acceleration", m.table.limits.acceleration / 1e3, is_good)
    yield Caution(
        "torque used on the ramp",
        f"{share:.2f} of what there is, at {format_quantity(hz, 'Hz')}",
        f"up to {MOST_USED:g} of it",
        "the rotor lags far behind its field, and little more load makes it lose steps",
        either(gentler if _leaves_ramp(m, gentler) else "", slower(m.table, _key(m), is_good))
        or "choose a stronger motor or a higher supply",
    )


def _leaves_ramp(m: MotorFigures, gentler: str) -> bool:
    """True where a remedy's acceleration still leads to the largest speed."""
    return bool(gentler) and ramp_fits(
        changed(m.table, "limits.acceleration", parse_quantity(gentler.split('"')[1], "m/s^2"))
    )


def _friction(m: MotorFigures) -> Iterator[Caution]:
    friction, most = m.load.friction_torque, MOST_FRICTION * m.motor.holding_torque
    if friction > most * (1 + BARELY):
        yield Caution(
            "friction",
            f"{format_quantity(friction, 'N*m')}, {friction / m.motor.holding_torque:.3g} of the holding torque",
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


def _extremes(m: MotorFigures) -> Iterator[Caution]:
    extremes, table = m.table.extremes, m.table
    fastest_zone = max((zone.speed for zone in table.zone.values()), default=0.0)
    for end, name in {extremes.stop: "stop", extremes.start: "start"}.items():
        way = table.step_inside(extremes.turn) - table.step_inside(end)
        if way < m.shortest_way:
            peak = float(m.ramp.hz[(way - 1) // 2])
            speed = peak * table.step
            lower = put(f"{_key(m)}.limits.speed", at_most(speed, "m/s")) if fastest_zone < speed * (1 - 1e-3) else ""
            yield Caution(
                f"way between extremes.{name} and extremes.turn",
                f"{way} steps",
                f"{m.shortest_way} or more, {format_quantity(m.shortest_way * table.step, 'm')}: two ramps",
                f"the run reaches {format_quantity(speed, 'm/s')}, {format_quantity(peak, 'Hz')}, never limits.speed",
                either(lower, "move the extremes farther apart"),
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


# ------------------------------------------------------------------------------------------- what the motors share


def _settling_time(m: MotorFigures) -> float:
    """Time of a swing of the rotor, and of the decay of a swing of one step to the tolerance [s]."""
    decay = max(0.0, -math.log(m.spec.controller.tolerance)) / (m.damping * 2 * math.pi * m.natural_hz)
    return 1 / (m.natural_hz * math.sqrt(1 - m.damping**2)) + decay


def _settling(m: MotorFigures) -> Iterator[Caution]:
    controller, needed = m.spec.controller, _settling_time(m)
    if controller.settle_time < needed * (1 - BARELY):
        yield Caution(
            f"controller.settle_time, {m.name}",
            format_quantity(controller.settle_time, "s"),
            f"at least {format_quantity(needed, 's')}, a swing of the rotor and its decay to {controller.tolerance:g} "
            "steps",
            "the rotor still swings when the motor counts as at rest",
            put("controller.settle_time", at_least(needed, "s")),
        )


def _rounding(m: MotorFigures) -> Iterator[Caution]:
    clock, words = m.spec.controller.timer, m.spec.controller.words
    error = m.rounding(clock, words)
    if error <= MOST_ROUNDING:
        return
    finer = max(clock, 0.5 / MOST_ROUNDING * m.max_hz)
    remedies = ((finer, words, put("controller.timer", at_least(finer, "Hz"))),)
    remedies += ((clock, "reload", put("controller.words", '"reload"')),)
    good = [text for ticks, stored, text in remedies if m.rounding(ticks, stored) <= MOST_ROUNDING]
    yield Caution(
        f"rounding of the frequencies, {m.name}",
        f"up to {format_quantity(error, '%')}, as {words} words at {format_quantity(clock, 'Hz')}",
        f"up to {format_quantity(MOST_ROUNDING, '%')}",
        "steps of the ramp become unequal, and take more torque than planned",
        either(*good) or put("controller.timer", at_least(finer, "Hz")) + ' and controller.words = "reload"',
    )


_LOOKS: tuple[Look, ...] = (
    _start,
    _torque_near_start,
    _reversal,
    _torque_used,
    _friction,
    _torque_safety,
    _rule,
    _resonance,
    _extremes,
    _zones,
    _current,
    _unused,
)
