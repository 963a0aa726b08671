"""What is checked in a stepper-envelope axis: contradictions between the keys of each motor, and cautions.

An open-loop motor tells nobody that it lost a step. What keeps it from that is reserve; how much is needed has been
tried on the rotor of specification 7.2, with random motors, zones and edits (tests/property/step_motors.py). Outside
these margins an axis may still work, and a simulated run shows whether it does.
"""

import math
from collections.abc import Iterator

from detent.axisfile.catalogue import STEPPER_MOTORS
from detent.files.fields import unit_of
from detent.files.findings import Caution, Contradiction, wrong
from detent.files.nearest import BARELY, put
from detent.methods.stepper_envelope.build import DAMPING, instant, pull_out, stepper_load
from detent.methods.stepper_envelope.derive import MotorFigures
from detent.methods.stepper_envelope.place_checks import MOST_STEPS, PLACE_RULES, ZONE_RULES
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec, StepperTable
from detent.methods.stepper_envelope.torque_checks import (
    LOAD_KEYS,
    NEEDED,
    START_KEYS,
    TORQUE_RULES,
    Rule,
    bare_start_hz,
    changed,
    has_pull_out,
    is_drivable,
    keys_of,
    per_motor,
    ramp_fits,
    remedy,
)
from detent.planning.step_ramp import MAX_HZ, natural_frequency
from detent.units import format_quantity as text
from detent.units import parse_quantity

LEAST_TICKS = 10  # ticks of the step timer in the shortest period: fewer, and neighbours on the ramp are all alike
FASTEST_SWING = 0.1  # largest swing of the rotor about its step in a time step of its equation of motion [rad]
START_RESERVE = 1.4604  # start frequency over the natural one up to which no step was lost; that of 7.1

LEAST_NEAR_START = 0.9
"""Torque up to that frequency, as a part of that at standstill, down to which no step was lost; 0.95 with 7.1."""

MOST_USED = 0.45  # share of its torque that a ramp takes, up to which no step was lost; 0.44 with 7.1
MOST_FRICTION = 0.1  # friction over the holding torque up to which no step was lost; that of 7.1
LEAST_SAFETY = 2.0  # divisors of pull-out torque and start frequency that age, temperature and resonance call for (7.1)
RESONANCE = (0.8, 1.25)  # step frequencies over the natural one at which the steps come in time with the rotor's swing
MOST_ROUNDING = 2e-3  # largest relative error of a frequency (test 31)

FEWEST_ZONE_STEPS = 5


# --------------------------------------------------------------------------------------------------- contradictions


@per_motor
def _steps(_: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """A turn is whole tooth pitches, the travel has a step and not too many, and the largest frequency is a word."""
    step, hz, per_turn = table.step, table.max_hz, table.motor.steps_per_turn
    around = ("mechanics.travel_per_revolution", "motor.steps_per_turn")
    travel, speed = f"{key}.limits.travel", f"{key}.limits.speed"
    if per_turn % 4:
        path = f"{key}.motor.steps_per_turn"
        yield wrong(
            path, "a multiple of 4: a tooth pitch has four full steps", put(path, max(4, round(per_turn / 4) * 4))
        )
    if table.steps < 1:
        allowed = f"at least one step, {text(step, 'm')}"
        yield wrong(keys_of(key, "limits.travel", *around), allowed, remedy.least(travel, step))
    elif table.steps > MOST_STEPS:
        allowed = f"up to {MOST_STEPS} steps of {text(step, 'm')}: a table has an entry for each"
        yield wrong(keys_of(key, "limits.travel", *around), allowed, remedy.most(travel, MOST_STEPS * step))
    if not 1 <= hz <= MAX_HZ:
        slow = changed(table, "limits.speed", MAX_HZ * step * (1 - BARELY))
        lower = remedy.most(speed, MAX_HZ * step) if not is_drivable(slow) or ramp_fits(slow) else ""
        yield wrong(
            keys_of(key, "limits.speed", *around),
            f"from {text(step, 'm/s')} to {text(MAX_HZ * step, 'm/s')}, step frequencies of 1 Hz to {MAX_HZ} Hz, here "
            f"{hz:.5g} Hz",
            remedy.least(speed, step) if hz < 1 else lower or "lower limits.speed to what the torque allows",
        )


def _timer(spec: StepperEnvelopeSpec) -> Iterator[Contradiction]:
    """The clock of the step timers is whole, and fine enough for the shortest period."""
    clock = spec.controller.timer
    _, table, key = max(spec.motors(), key=lambda entry: entry[1].max_hz)
    least = LEAST_TICKS * table.max_hz
    if abs(clock - round(clock)) > 1e-6:
        yield wrong("controller.timer", "a whole number of Hz", remedy.exactly("controller.timer", round(clock)))
    elif clock < least * (1 - BARELY) and table.max_hz <= MAX_HZ:
        yield wrong(
            "controller.timer " + keys_of(key, "limits.speed", "mechanics.travel_per_revolution"),
            f"at least {LEAST_TICKS} ticks in the period of {text(table.max_hz, 'Hz')}",
            remedy.least("controller.timer", least, "lower limits.speed"),
        )


@per_motor
def _start_frequency(_: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """The start frequency is no standstill."""
    if not has_pull_out(table):
        return
    hz = bare_start_hz(table)
    if hz < 1:
        yield wrong(
            keys_of(key, *START_KEYS),
            f"such that the start frequency with load and reserve is 1 Hz or more, here {text(hz, 'Hz')}",
            remedy.most(
                f"{key}.drive.start_safety", table.drive.start_safety * hz, "check the units of torque and inertia"
            ),
        )


@per_motor
def _rotor_swing(spec: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """The rotor swings slowly enough for the time step of its equation of motion (7.2)."""
    inertia = table.motor.rotor_inertia + stepper_load(table).inertia
    hz = natural_frequency(table.motor.steps_per_turn, table.held_torque, inertia)
    most = FASTEST_SWING / (2 * math.pi * instant(spec))
    if hz > most:
        names = ("motor.rotor_inertia", "motor.holding_torque", "motor.steps_per_turn", *LOAD_KEYS)
        least = inertia * (hz / most) ** 2 - (inertia - table.motor.rotor_inertia)
        yield wrong(
            keys_of(key, *names, "drive.current", "motor.rated_current") + " controller.timer",
            f"such that the rotor swings about its step with {text(most, 'Hz')} or less, here {text(hz, 'Hz')}",
            remedy.least(f"{key}.motor.rotor_inertia", least),
        )


RULES: tuple[Rule, ...] = (
    _steps,
    _timer,
    *PLACE_RULES,
    *TORQUE_RULES,
    _start_frequency,
    _rotor_swing,
    *ZONE_RULES,
)
"""Contradictions are told in this order."""


# --------------------------------------------------------------------------------------------------------- cautions


def find_cautions(spec: StepperEnvelopeSpec) -> Iterator[Caution]:
    """Look a stepper-envelope axis over: each motor, then what they share."""
    motors = [MotorFigures(spec, name) for name in spec.stepper]
    for m in motors:
        for look in (_start, _reserves, _safety, _resonance, _ways, _current, _unused):
            for found in look(m, f"stepper.{m.name}"):
                yield Caution(f"{m.name}: {found.name}", found.value, found.limit, found.consequence, found.remedy)
    yield from _settling(max(motors, key=_settling_time))
    yield from _rounding(max(motors, key=lambda m: m.rounding(spec.controller.timer, spec.controller.words)))


def _start(m: MotorFigures, key: str) -> Iterator[Caution]:
    """A start, a stop or a reversal loses no step."""
    ratio, swinging, curve = m.start_hz / m.natural_hz, START_RESERVE * m.natural_hz, pull_out(m.table)
    safety = m.table.drive.start_safety * bare_start_hz(m.table) / m.natural_hz
    share = min(curve(hz) for hz in (m.start_hz, swinging)) / curve(0.0)
    if ratio > START_RESERVE * (1 + BARELY):
        yield Caution(
            "start frequency",
            f"{text(m.start_hz, 'Hz')}, {ratio:.3g} x the natural frequency of the loaded rotor",
            f"up to {START_RESERVE:.3g} x",
            "a start, a stop or a reversal may lose steps",
            remedy.least(f"{key}.drive.start_safety", safety / START_RESERVE, "check motor.start_frequency"),
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
            put(f"{key}.drive.reversal_pause", 1),
        )


def _reserves(m: MotorFigures, key: str) -> Iterator[Caution]:
    """The ramp and friction leave torque, and no run jumps to a speed."""
    (share, hz), friction, most = m.torque_used, m.load.friction_torque, MOST_FRICTION * m.motor.holding_torque
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
            remedy.most(f"{key}.mechanics.friction_torque", most),
        )
    if m.table.method.rule == "literal":
        yield Caution(
            "method.rule",
            "literal",
            "ramp-limited",
            "a run that does not begin at a start extreme of its table jumps to the speed stated there and loses steps",
            put(f"{key}.method.rule", '"ramp-limited"'),
        )


def _safety(m: MotorFigures, key: str) -> Iterator[Caution]:
    """Both divisors are what age, temperature and resonance call for."""
    for name, consequence in (
        ("start_safety", "an old or a warm motor, or a heavier load, loses steps at a start"),
        ("torque_safety", "published torques are those of a bench: resonance, heat or a low supply takes the rest"),
    ):
        safety, path = getattr(m.table.drive, name), f"drive.{name}"
        if safety < LEAST_SAFETY:
            limit = f"at least {LEAST_SAFETY:g}"
            yield Caution(path, f"{safety:g}", limit, consequence, put(f"{key}.{path}", LEAST_SAFETY))


def _resonance(m: MotorFigures, key: str) -> Iterator[Caution]:
    """No speed is that of the rotor's swing."""
    low, high = (bound * m.natural_hz for bound in RESONANCE)
    speeds = {f"zone.{name}.speed": zone.speed for name, zone in m.table.zone.items()}
    for name, speed in ({"limits.speed": m.table.limits.speed} | speeds).items():
        hz = m.table.hz(speed)
        if low < hz < high:
            other = "choose another lead, or change the inertia"
            slower = remedy.most(f"{key}.{name}", low * m.table.step) if low >= m.start_hz else other
            yield Caution(
                name,
                f"{text(speed, 'm/s')}, {text(hz, 'Hz')}",
                f"below {text(low, 'Hz')} or above {text(high, 'Hz')}: the natural frequency is "
                f"{text(m.natural_hz, 'Hz')}",
                "the steps come in time with the swing of the rotor: noise, vibration, at worst lost steps",
                remedy.least(f"{key}.{name}", high * m.table.step) if high <= m.max_hz else slower,
            )


def _ways(m: MotorFigures, key: str) -> Iterator[Caution]:
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
                f"{m.shortest_way} or more, {text(m.shortest_way * table.step, 'm')}: two ramps",
                f"the run reaches {text(speed, 'm/s')}, {text(peak, 'Hz')}, never limits.speed",
                remedy.most(f"{key}.limits.speed", speed) if fastest_zone < speed * (1 - 1e-3) else apart,
            )
    for name, zone in table.zone.items():
        steps = (zone.end - zone.begin) / table.step
        if steps < FEWEST_ZONE_STEPS * (1 - BARELY):
            yield Caution(
                f"zone.{name}",
                f"{steps:.3g} steps long",
                f"at least {FEWEST_ZONE_STEPS} steps, {text(FEWEST_ZONE_STEPS * table.step, 'm')}",
                "it holds for every step that it touches, so that its bounds are off by up to a step",
                "make it longer, or its motor's steps finer",
            )


def _current(m: MotorFigures, key: str) -> Iterator[Caution]:
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
            f"add rated_current in [{key}.motor], or remove drive.current",
        )
        return
    needed = drive.current * ((m.table.motor.resistance or 0.0) + drive.bridge_resistance)
    if drive.current > rated * (1 + BARELY):
        yield Caution(
            "drive.current",
            text(drive.current, "A"),
            f"up to motor.rated_current, {text(rated, 'A')}",
            "the motor overheats",
            remedy.most(f"{key}.drive.current", rated),
        )
    if m.table.motor.pull_out == "winding" and drive.supply < needed * (1 - BARELY):
        yield Caution(
            "drive.supply",
            text(drive.supply, "V"),
            f"at least current x resistance, {text(needed, 'V')}",
            "the drive never reaches its current, not even at rest",
            remedy.least(f"{key}.drive.supply", needed, "lower drive.current"),
        )


def _unused(m: MotorFigures, _: str) -> Iterator[Caution]:
    """What the file states about the torque is used."""
    way, drive = m.table.motor.pull_out, m.table.drive
    own = {"points": {"curve_frequency", "curve_torque"}, "winding": {"resistance", "inductance"}}
    own["first order"] = set(NEEDED["first order"])
    others = set[str]().union(*own.values()) - own[way]
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
            remedy.least("controller.settle_time", needed),
        )


def _rounding(m: MotorFigures) -> Iterator[Caution]:
    """Frequencies are stored and made finely enough."""
    clock, words = m.spec.controller.timer, m.spec.controller.words
    error, finer = m.rounding(clock, words), max(clock, 0.5 / MOST_ROUNDING * m.max_hz)
    if error > MOST_ROUNDING:
        faster, reload = remedy.least("controller.timer", finer), put("controller.words", '"reload"')
        by_clock = m.rounding(finer, words) <= MOST_ROUNDING
        by_words = m.rounding(clock, "reload") <= MOST_ROUNDING
        yield Caution(
            f"rounding of the frequencies, {m.name}",
            f"up to {text(error, '%')}, as {words} words at {text(clock, 'Hz')}",
            f"up to {text(MOST_ROUNDING, '%')}",
            "steps of the ramp become unequal, and take more torque than planned",
            faster if by_clock else reload if by_words else f'{faster} and controller.words = "reload"',
        )
