"""What looks wrong with a stepper-envelope axis that can be built; its contradictions are those of `rules`.

An open-loop motor tells nobody that it lost a step. What keeps it from that is reserve; how much is needed has been
tried on the rotor of specification 7.2, with random motors, zones and edits (tests/property/step_motors.py). Outside
these margins an axis may still work, and a simulated run shows whether it does.
"""

import math
from collections.abc import Iterator

from detent.axisfile.catalogue import STEPPER_MOTORS
from detent.files.fields import unit_of
from detent.files.findings import Caution
from detent.files.nearest import BARELY
from detent.methods.stepper_envelope.build import DAMPING, NEEDED, bare_start_hz
from detent.methods.stepper_envelope.derive import MotorFigures
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec
from detent.units import format_quantity as text
from detent.units import parse_quantity

START_RESERVE = 1.4604  # start frequency over the natural one up to which no step was lost; that of 7.1
LEAST_NEAR_START = 0.9  # torque up to there, over that at standstill, down to which no step was lost; 0.95 with 7.1
MOST_USED = 0.45  # share of its torque that a ramp takes, up to which no step was lost; 0.44 with 7.1
MOST_FRICTION = 0.1  # friction over the holding torque up to which no step was lost; that of 7.1
LEAST_SAFETY = 2.0  # divisors of pull-out torque and start frequency that age, temperature and resonance call for (7.1)
RESONANCE = (0.8, 1.25)  # step frequencies over the natural one at which the steps come in time with the rotor's swing
MOST_ROUNDING = 2e-3  # largest relative error of a frequency (test 31)

FEWEST_ZONE_STEPS = 5


def find_cautions(spec: StepperEnvelopeSpec) -> Iterator[Caution]:
    """Look a stepper-envelope axis over: each motor, then what they share."""
    motors = [MotorFigures(spec, name) for name in spec.stepper]
    for m in motors:
        for look in (_start, _reserves, _microsteps, _safety, _resonance, _ways, _current, _unused):
            for found in look(m):
                yield Caution(f"{m.name}: {found.name}", found.value, found.limit, found.consequence, found.remedy)
    yield from _settling(max(motors, key=_settling_time))
    yield from _rounding(max(motors, key=lambda m: m.rounding(spec.controller.timer, spec.controller.words)))


def _start(m: MotorFigures) -> Iterator[Caution]:
    """A start, a stop or a reversal loses no step."""
    swing, curve = m.motor.swinging_hz, m.motor.pull_out
    ratio, swinging = m.start_hz / swing, START_RESERVE * swing
    safety = m.table.drive.start_safety * bare_start_hz(m.table) / swing
    share = min(curve(hz) for hz in (m.start_hz, swinging)) / curve(0.0)
    if ratio > START_RESERVE * (1 + BARELY):
        yield Caution(
            "start frequency",
            f"{text(m.start_hz, 'Hz')}, {ratio:.3g} x the natural frequency of the loaded rotor",
            f"up to {START_RESERVE:.3g} x",
            "a start, a stop or a reversal may lose steps",
            m.least("drive.start_safety", safety / START_RESERVE, "check motor.start_frequency"),
        )
    if share < LEAST_NEAR_START * (1 - BARELY):
        yield Caution(
            "torque near the start frequency",
            f"{share:.2g} of that at standstill, at {text(max(swinging, m.start_hz), 'Hz')}",
            f"at least {LEAST_NEAR_START:g} of it up to {START_RESERVE:.3g} x the natural frequency",
            "the current has no time to rise where the rotor swings, and a start or a stop may lose steps",
            "raise drive.supply, choose a motor of less inductance, or a heavier load",
        )
    if m.table.drive.reversal_pause == 0 and ratio > START_RESERVE / 2 * (1 + BARELY):
        yield Caution(
            "drive.reversal_pause",
            f"0 with a start frequency of {ratio:.3g} x the natural one",
            f"1 or more above {START_RESERVE / 2:.2g} x",
            "single steps to and fro swing the rotor up until it loses steps",
            m.put("drive.reversal_pause", 1),
        )


def _reserves(m: MotorFigures) -> Iterator[Caution]:
    """The ramp and friction leave torque, and no run jumps to a speed."""
    (share, hz), friction, most = m.torque_used, m.motor.friction_torque, MOST_FRICTION * m.motor.holding_torque
    if share > MOST_USED * (1 + BARELY):
        yield Caution(
            "torque used on the ramp",
            f"{share:.2f} of what there is, at {text(hz, 'Hz')}",
            f"up to {MOST_USED:g} of it",
            "the rotor lags far behind its field, and little more load makes it lose steps",
            "lower limits.acceleration or limits.speed, or choose a stronger motor or a higher supply",
        )
    if friction > most * (1 + BARELY):
        yield Caution(
            "friction",
            f"{text(friction, 'N*m')}, {friction / m.motor.holding_torque:.3g} of the holding torque",
            f"up to {MOST_FRICTION:g} of it, {text(most, 'N*m')}",
            "the rotor rests off its step, and falls behind at speed",
            m.most("mechanics.friction_torque", most),
        )
    if m.table.method.rule == "literal":
        yield Caution(
            "method.rule",
            "literal",
            "ramp-limited",
            "a run that does not begin at a start extreme of its table jumps to the speed stated there and loses steps",
            m.put("method.rule", '"ramp-limited"'),
        )


def _microsteps(m: MotorFigures) -> Iterator[Caution]:
    """Friction does not take single microsteps away."""
    torque, friction = m.motor.incremental_torque, m.motor.friction_torque
    if m.motor.microsteps > 1 and friction > torque * (1 + BARELY):
        fine = max(1, math.floor(math.pi / 2 / math.asin(min(friction / m.motor.holding_torque, 1.0)) + BARELY))
        yield Caution(
            "drive.microsteps",
            f"{m.motor.microsteps}, {text(torque, 'N*m')} for one of them",
            f"up to {fine}: a pulse then turns the rotor against the friction of {text(friction, 'N*m')}",
            "the rotor moves only after several pulses: it runs smoothly, but stands no better than its error at rest",
            m.put("drive.microsteps", fine),
        )


def _safety(m: MotorFigures) -> Iterator[Caution]:
    """Both divisors are what age, temperature and resonance call for."""
    for name, consequence in (
        ("start_safety", "an old or a warm motor, or a heavier load, loses steps at a start"),
        ("torque_safety", "published torques are those of a bench: resonance, heat or a low supply takes the rest"),
    ):
        safety, path = getattr(m.table.drive, name), f"drive.{name}"
        if safety < LEAST_SAFETY:
            limit = f"at least {LEAST_SAFETY:g}"
            yield Caution(path, f"{safety:g}", limit, consequence, m.put(path, LEAST_SAFETY))


def _resonance(m: MotorFigures) -> Iterator[Caution]:
    """No speed is that of the rotor's swing; a field that goes on in quarters of a step or less does not excite it."""
    if m.motor.microsteps >= 4:
        return
    low, high = (bound * m.motor.swinging_hz for bound in RESONANCE)
    speeds = {f"zone.{name}.speed": zone.speed for name, zone in m.table.zone.items()}
    for name, speed in ({"limits.speed": m.table.limits.speed} | speeds).items():
        hz = m.table.hz(speed)
        if low < hz < high:
            other = f"choose another {m.table.mechanics.way_name}, or change the inertia"
            slower = m.most(name, low * m.table.step) if low >= m.start_hz else other
            yield Caution(
                name,
                f"{m.table.text(speed, 'm/s')}, {text(hz, 'Hz')}",
                f"below {text(low, 'Hz')} or above {text(high, 'Hz')}: the natural frequency is "
                f"{text(m.motor.swinging_hz, 'Hz')}",
                "the steps come in time with the swing of the rotor: noise, vibration, at worst lost steps",
                m.least(name, high * m.table.step) if high <= m.max_hz else slower,
            )


def _ways(m: MotorFigures) -> Iterator[Caution]:
    """Runs are long enough for two ramps, and zones for their bounds."""
    extremes, table = m.table.extremes, m.table
    fastest_zone = max((zone.speed for zone in table.zone.values()), default=0.0)
    for end, name in {extremes.stop: "stop", extremes.start: "start"}.items():
        way = table.step_inside(extremes.turn) - table.step_inside(end)
        if way < m.shortest_way:
            peak = float(m.ramp.hz[(way - 1) // 2])
            speed, apart = peak * table.step, "move the extremes farther apart"
            yield Caution(
                f"way between extremes.{name} and extremes.turn",
                f"{way} steps",
                f"{m.shortest_way} or more, {table.text(m.shortest_way * table.step, 'm')}: two ramps",
                f"the run reaches {table.text(speed, 'm/s')}, {text(peak, 'Hz')}, never limits.speed",
                m.most("limits.speed", speed) if fastest_zone < speed * (1 - 1e-3) else apart,
            )
    for name, zone in table.zone.items():
        steps = (zone.end - zone.begin) / table.step
        if steps < FEWEST_ZONE_STEPS * (1 - BARELY):
            yield Caution(
                f"zone.{name}",
                f"{steps:.3g} steps long",
                f"at least {FEWEST_ZONE_STEPS} steps, {table.text(FEWEST_ZONE_STEPS * table.step, 'm')}",
                "it holds for every step that it touches, so that its bounds are off by up to a step",
                "make it longer, or its motor's steps finer",
            )


def _current(m: MotorFigures) -> Iterator[Caution]:
    """The current is one that motor and supply stand."""
    rated, drive = m.table.motor.rated_current, m.table.drive
    if drive.current is None:
        return
    if rated is None:
        yield Caution(
            "drive.current",
            text(drive.current, "A"),
            "stated with motor.rated_current",
            "without it nobody knows what part of the torque the current gives: the whole is assumed",
            f"add rated_current in [{m.keys('motor')}], or remove drive.current",
        )
        return
    needed = drive.current * ((m.table.motor.resistance or 0.0) + drive.bridge_resistance)
    if drive.current > rated * (1 + BARELY):
        yield Caution(
            "drive.current",
            text(drive.current, "A"),
            f"up to motor.rated_current, {text(rated, 'A')}",
            "the motor overheats",
            m.most("drive.current", rated),
        )
    if m.table.motor.pull_out == "winding" and drive.supply < needed * (1 - BARELY):
        yield Caution(
            "drive.supply",
            text(drive.supply, "V"),
            f"at least current x resistance, {text(needed, 'V')}",
            "the drive never reaches its current, not even at rest",
            m.least("drive.supply", needed, "lower drive.current"),
        )


def _unused(m: MotorFigures) -> Iterator[Caution]:
    """What the file states about the torque is used."""
    way, drive = m.table.motor.pull_out, m.table.drive
    own = {"points": {"curve_frequency", "curve_torque"}, "winding": {"resistance", "inductance"}}
    own["first order"] = set(NEEDED["first order"])
    others = {name for names in own.values() for name in names} - own[way]
    idle = [f"motor.{name}" for name in sorted(others) if _is_stated(m, name)]
    if way != "winding":
        fields = type(drive).model_fields
        names = ("supply", "bridge_resistance")
        idle += [f"drive.{name}" for name in names if getattr(drive, name) != fields[name].default]
    if idle:
        yield Caution(
            "keys without effect",
            ", ".join(idle),
            f'those of pull_out = "{way}"',
            f"the pull-out torque is taken from {' and '.join(sorted(own[way]))} alone",
            "remove them, or choose the pull_out that uses them",
        )


def _is_stated(m: MotorFigures, name: str) -> bool:
    """True where the file states a constant of the motor, other than its catalogue motor has it."""
    motor = m.table.motor
    value = getattr(motor, name)
    constant = (STEPPER_MOTORS.constants(motor.catalogue) or {}).get(name)
    if constant is None:
        return value not in (None, [])
    return value != parse_quantity(str(constant), unit_of(type(motor).model_fields[name]))


def _settling_time(m: MotorFigures) -> float:
    """Time of a swing of the rotor, and of the decay of a swing of one step to the tolerance [s]."""
    damping = DAMPING / 2  # the ratio of that swing (7.2)
    decay = max(0.0, -math.log(m.spec.controller.tolerance)) / (damping * 2 * math.pi * m.natural_hz)
    return 1 / (m.natural_hz * math.sqrt(1 - damping**2)) + decay


def _settling(m: MotorFigures) -> Iterator[Caution]:
    """The rotor has come to rest when its motor counts as at rest."""
    controller, needed = m.spec.controller, _settling_time(m)
    if controller.settle_time < needed * (1 - BARELY):
        yield Caution(
            f"controller.settle_time, {m.name}",
            text(controller.settle_time, "s"),
            f"at least {text(needed, 's')}, a swing of the rotor and its decay to {controller.tolerance:g} steps",
            "the rotor still swings when the motor counts as at rest",
            m.least("controller.settle_time", needed),
        )


def _rounding(m: MotorFigures) -> Iterator[Caution]:
    """Frequencies are stored and made finely enough."""
    clock, words = m.spec.controller.timer, m.spec.controller.words
    error = m.rounding(clock, words)
    if error > MOST_ROUNDING:
        # A reload value is half a tick off at most, the period of a frequency a tick.
        by_clock = m.rounding(max(clock, m.max_hz / MOST_ROUNDING), words) <= MOST_ROUNDING
        ticks = 1.0 if words == "frequency" and by_clock else 0.5
        faster = m.least("controller.timer", max(clock, ticks * m.max_hz / MOST_ROUNDING))
        reload = m.put("controller.words", '"reload"')
        by_words = m.rounding(clock, "reload") <= MOST_ROUNDING
        yield Caution(
            f"rounding of the frequencies, {m.name}",
            f"up to {text(error, '%')}, as {words} words at {text(clock, 'Hz')}",
            f"up to {text(MOST_ROUNDING, '%')}",
            "steps of the ramp become unequal, and take more torque than planned",
            faster if by_clock else reload if by_words else f'{faster} and controller.words = "reload"',
        )
