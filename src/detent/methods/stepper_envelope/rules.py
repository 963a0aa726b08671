"""What must hold between keys of the stepper-envelope method, for each of its motors.

As in the print head's rules, a rule is reported at the first of its keys that the file states, and a remedy names the
nearest value that would do. Sections are those of the stepper-envelope specification.
"""

import math
from collections.abc import Iterator
from itertools import combinations

from detent.files.findings import Contradiction
from detent.files.nearest import BARELY, at_least, at_most, either, offer, put
from detent.methods.stepper_envelope.build import instant, start_hz, stepper_load
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec, StepperTable, ZoneTable
from detent.methods.stepper_envelope.torque_rules import (
    LOAD_KEYS,
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
    slower,
)
from detent.planning.step_ramp import MAX_HZ, natural_frequency
from detent.units import format_quantity

MOST_STEPS = 10_000_000
"""Longest travel in steps: both tables of a motor then take 40 MB."""

LEAST_TICKS = 10
"""Ticks of the step timer in the shortest period: fewer, and neighbours on the ramp are all alike."""

FASTEST_SWING = 0.1
"""Largest swing of the rotor about its step in a time step of its equation of motion [rad]."""

PLACE_DIGITS = 7
"""Digits of a place that a remedy names: a step of a micrometre in a travel of metres."""


def _at_or_above(place: float) -> str:
    """Short text of a place, not below it but for an error of arithmetic."""
    return at_least(round(place, 12), "m", PLACE_DIGITS)


def _at_or_below(place: float) -> str:
    """Short text of a place, not above it but for an error of arithmetic."""
    return at_most(round(place, 12), "m", PLACE_DIGITS)


# -------------------------------------------------------------------------------------------------------------- places


@per_motor
def _travel(_: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """The travel has a step, and not more than there is memory for."""
    step, path = table.step, f"{key}.limits.travel"
    if _is_travel(table):
        return
    allowed, nearest = f"at least one step, {format_quantity(step, 'm')}", at_least(step, "m")
    if table.steps > MOST_STEPS:
        allowed = f"up to {MOST_STEPS} steps of {format_quantity(step, 'm')}: a table has an entry for each"
        nearest = at_most(MOST_STEPS * step, "m")
    yield Contradiction(
        keys_of(key, "limits.travel", "mechanics.travel_per_revolution", "motor.steps_per_turn"),
        allowed,
        either(offer(StepperEnvelopeSpec, path, nearest), "correct the lead of the spindle"),
    )


def _is_travel(table: StepperTable) -> bool:
    """True where places can be told apart: the travel has a step, and not too many."""
    return 1 <= table.steps <= MOST_STEPS


def _ends(table: StepperTable) -> tuple[float, float]:
    """Both ends of the travel [m]."""
    return table.mechanics.lower_end, table.mechanics.lower_end + table.limits.travel


def _is_inside(table: StepperTable, place: float) -> bool:
    """True for a place between both ends of the travel, and for the ends."""
    way, slack = place - table.mechanics.lower_end, 1e-6 * table.step
    return -slack <= way <= table.limits.travel + slack


def _inside(table: StepperTable, key: str, name: str, place: float) -> Iterator[Contradiction]:
    """A place lies between both ends of the travel."""
    if _is_inside(table, place) or not _is_travel(table):
        return
    lower, upper = _ends(table)
    nearest = _at_or_above(lower) if place < lower else _at_or_below(upper)
    yield Contradiction(
        keys_of(key, name, "limits.travel", "mechanics.lower_end"),
        f"on the travel, from {format_quantity(lower, 'm')} to {format_quantity(upper, 'm')}",
        either(put(f"{key}.{name}", nearest), "correct limits.travel or mechanics.lower_end"),
    )


@per_motor
def _start_position(_: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """The motor stands on its travel at power-on."""
    yield from _inside(table, key, "mechanics.start_position", table.mechanics.start_position)


@per_motor
def _extremes_inside(_: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """The extremes lie on the travel."""
    for name in ("start", "turn", "stop"):
        yield from _inside(table, key, f"extremes.{name}", getattr(table.extremes, name))


@per_motor
def _extremes_apart(_: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """The turn lies above start and stop, a step at least."""
    extremes = table.extremes
    places = {name: table.step_inside(getattr(extremes, name)) for name in ("start", "stop")}
    turn, name = table.step_inside(extremes.turn), max(places, key=lambda name: places[name])
    inside = all(_is_inside(table, place) for place in (extremes.start, extremes.turn, extremes.stop))
    if not inside or places[name] < turn or not _is_travel(table):
        return
    upper = _at_or_above(table.position_of(places[name] + 1))
    lower = _at_or_below(table.position_of(turn - 1))
    alone = min(places.values()) < turn
    yield Contradiction(
        keys_of(key, "extremes.turn", f"extremes.{name}", "limits.travel", "mechanics.lower_end"),
        f"above extremes.{name}, {format_quantity(getattr(extremes, name), 'm')}, by a step of "
        f"{format_quantity(table.step, 'm')} or more: there the run upwards ends and the run downwards begins",
        either(
            put(f"{key}.extremes.turn", upper) if places[name] < table.steps else "",
            put(f"{key}.extremes.{name}", lower) if alone and turn > 0 else "",
        )
        or "move both apart",
    )


# --------------------------------------------------------------------------------------------------------------- zones


@per_motor
def _zone_places(_: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """Each zone has a begin below its end, and both lie on the travel."""
    lower, upper = _ends(table)
    for name, zone in table.zone.items() if _is_travel(table) else ():
        begin, end = f"zone.{name}.begin", f"zone.{name}.end"
        if zone.begin < zone.end and (zone.end <= lower or zone.begin >= upper):
            yield Contradiction(
                keys_of(key, begin, end, "limits.travel", "mechanics.lower_end"),
                f"on the travel, from {format_quantity(lower, 'm')} to {format_quantity(upper, 'm')}; here the whole "
                "zone is not",
                "remove the zone, or correct limits.travel or mechanics.lower_end",
            )
            continue
        if zone.begin < zone.end:
            yield from _inside(table, key, begin, zone.begin)
            yield from _inside(table, key, end, zone.end)
            continue
        yield Contradiction(
            keys_of(key, end, begin, "limits.travel", "mechanics.lower_end"),
            f"above the zone's begin, {format_quantity(zone.begin, 'm')}",
            either(*_turned(table, key, name, zone)) or "correct begin and end",
        )


def _turned(table: StepperTable, key: str, name: str, zone: ZoneTable) -> Iterator[str]:
    """Remedies for a zone that ends where it begins, or before."""
    begin, end = f"{key}.zone.{name}.begin", f"{key}.zone.{name}.end"
    inside = {place: _is_inside(table, place) for place in (zone.begin, zone.end)}
    if zone.end < zone.begin and all(inside.values()):
        lower, upper = (format_quantity(place, "m", 12) for place in (zone.end, zone.begin))
        first = put(begin, f'"{lower}"')
        yield f'{first} and {end} = "{upper}"'
        return
    if inside[zone.begin] and _is_inside(table, zone.begin + table.step):
        yield put(end, _at_or_above(zone.begin + table.step))
    if inside[zone.end] and _is_inside(table, zone.end - table.step):
        yield put(begin, _at_or_below(zone.end - table.step))


@per_motor
def _zone_overlap(_: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """No two zones of one direction overlap."""
    zones = sorted(table.zone.items(), key=lambda item: item[1].begin) if _is_travel(table) else []
    for (name, zone), (other, following) in combinations(zones, 2):
        both = zone.direction == following.direction or "both" in {zone.direction, following.direction}
        if not both or min(zone.end, following.end) - following.begin <= 1e-6 * table.step:
            continue
        yield Contradiction(
            keys_of(key, f"zone.{other}.begin", f"zone.{name}.end", f"zone.{other}.end", f"zone.{name}.begin")
            + keys_of(key, f"zone.{other}.direction", f"zone.{name}.direction"),
            f"at or above the end of zone {name}, {format_quantity(zone.end, 'm')}: a step has one limit in each "
            "direction",
            _apart(key, (name, zone), (other, following)) or f"remove zone {other} or zone {name}",
        )


def _apart(key: str, one: tuple[str, ZoneTable], other: tuple[str, ZoneTable]) -> str:
    """Remedies that end the first zone where the other begins, or begin that one where the first ends."""
    (name, zone), (later, following) = one, other
    begin, end = _at_or_above(zone.end), _at_or_below(following.begin)
    return either(
        put(f"{key}.zone.{later}.begin", begin) if zone.end < following.end else "",
        put(f"{key}.zone.{name}.end", end) if zone.begin < following.begin else "",
    )


@per_motor
def _zone_speed(_: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """A zone is not slower than the start frequency, and not faster than the motor."""
    if not is_drivable(table):
        return
    start, fastest, safety = start_hz(table), table.limits.speed, f"{key}.drive.start_safety"
    slowest = start * table.step
    # Between two bounds that are as good as one there is no short number.
    exact = f'"{format_quantity(fastest, "m/s", 15)}"' if slowest * (1 + 1e-3) > fastest else ""
    for name, zone in table.zone.items():
        path, hz = f"{key}.zone.{name}.speed", table.hz(zone.speed)
        if zone.speed > fastest * (1 + BARELY):
            yield Contradiction(
                (path, f"{key}.limits.speed"),
                f"up to limits.speed, {format_quantity(fastest, 'm/s')}: a faster zone has no effect",
                either(put(path, exact or at_most(fastest, "m/s")), "remove the zone"),
            )
        elif hz < start * (1 - BARELY):
            lower = at_least(table.drive.start_safety * bare_start_hz(table) / hz, "").strip('"')
            yield Contradiction(
                (path, *keys_of(key, *START_KEYS)),
                f"at least the speed of the start frequency, {format_quantity(slowest, 'm/s')} at "
                f"{format_quantity(start, 'Hz')}: no ramp leads below it",
                either(
                    put(path, exact or at_least(slowest, "m/s")),
                    offer(StepperEnvelopeSpec, safety, lower) if hz >= 1 else "",
                ),
            )


# --------------------------------------------------------------------------------------------------------- frequencies


@per_motor
def _largest_frequency(_: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """The largest step frequency fits a word of 16 bits and is no standstill."""
    hz, step, path = table.max_hz, table.step, f"{key}.limits.speed"
    if 1 <= hz <= MAX_HZ:
        return
    slowest, fastest = format_quantity(step, "m/s"), format_quantity(MAX_HZ * step, "m/s")
    yield Contradiction(
        keys_of(key, "limits.speed", "mechanics.travel_per_revolution", "motor.steps_per_turn"),
        f"from {slowest} to {fastest}, step frequencies of 1 Hz to {MAX_HZ} Hz, here {hz:.5g} Hz",
        offer(StepperEnvelopeSpec, path, at_least(step, "m/s")) if hz < 1 else _slower(table, key),
    )


def _slower(table: StepperTable, key: str) -> str:
    """Remedy for a speed that is far too large: the largest that words and torque allow."""
    bound = MAX_HZ * table.step
    slow = changed(table, "limits.speed", bound * (1 - BARELY))
    fitting = not is_drivable(slow) or ramp_fits(slow)
    found = offer(StepperEnvelopeSpec, f"{key}.limits.speed", at_most(bound, "m/s")) if fitting else slower(slow, key)
    return found or "check the units of speed and lead"


@per_motor
def _start_frequency(_: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """The start frequency is no standstill."""
    if not has_pull_out(table):
        return
    hz, safety = bare_start_hz(table), f"{key}.drive.start_safety"
    if hz < 1:
        bare, less = table.motor.start_frequency, at_most(table.drive.start_safety * hz, "").strip('"')
        yield Contradiction(
            keys_of(key, *START_KEYS),
            f"such that the start frequency with load and reserve is 1 Hz or more, here {format_quantity(hz, 'Hz')}",
            either(
                offer(StepperEnvelopeSpec, f"{key}.motor.start_frequency", at_least(bare / hz, "Hz")) if bare else "",
                offer(StepperEnvelopeSpec, safety, less),
            )
            or "check the units of torque and inertia",
        )


@per_motor
def _whole_pattern(_: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """A turn is a whole number of tooth pitches, four full steps each."""
    steps, path = table.motor.steps_per_turn, f"{key}.motor.steps_per_turn"
    if steps % 4:
        nearest = max(4, round(steps / 4) * 4)
        yield Contradiction((path,), "a multiple of 4: a tooth pitch has four full steps", put(path, nearest))


@per_motor
def _rotor_swing(spec: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """The rotor swings slowly enough for the time step of its equation of motion (7.2)."""
    inertia = table.motor.rotor_inertia + stepper_load(table).inertia
    hz = natural_frequency(table.motor.steps_per_turn, table.held_torque, inertia)
    most = FASTEST_SWING / (2 * math.pi * instant(spec))
    if hz > most:
        lead, path = inertia - table.motor.rotor_inertia, f"{key}.motor.rotor_inertia"
        nearest = at_least(inertia * (hz / most) ** 2 - lead, "kg*m^2")
        yield Contradiction(
            keys_of(key, "motor.rotor_inertia", "motor.holding_torque", "motor.steps_per_turn", *LOAD_KEYS)
            + keys_of(key, "drive.current", "motor.rated_current")
            + ("controller.timer",),
            f"such that the rotor swings about its step with {format_quantity(most, 'Hz')} or less, here "
            f"{format_quantity(hz, 'Hz')}",
            either(offer(StepperEnvelopeSpec, path, nearest), "check the units of torque and inertia"),
        )


def _timer(spec: StepperEnvelopeSpec) -> Iterator[Contradiction]:
    """The clock of the step timers is whole, and fine enough for the shortest period."""
    clock = spec.controller.timer
    if abs(clock - round(clock)) > 1e-6:
        nearest = f'"{format_quantity(round(clock), "Hz", digits=10)}"'
        yield Contradiction(("controller.timer",), "a whole number of Hz", put("controller.timer", nearest))
        return
    _, table, key = max(spec.motors(), key=lambda entry: entry[1].max_hz)
    least = LEAST_TICKS * table.max_hz
    if clock < least * (1 - BARELY) and table.max_hz <= MAX_HZ:
        yield Contradiction(
            ("controller.timer", *keys_of(key, "limits.speed", "mechanics.travel_per_revolution")),
            f"at least {LEAST_TICKS} ticks in the period of {format_quantity(table.max_hz, 'Hz')}",
            either(
                offer(StepperEnvelopeSpec, "controller.timer", at_least(least, "Hz")),
                offer(StepperEnvelopeSpec, f"{key}.limits.speed", at_most(clock / LEAST_TICKS * table.step, "m/s")),
            ),
        )


RULES: tuple[Rule, ...] = (
    _whole_pattern,
    _travel,
    _largest_frequency,
    _timer,
    _start_position,
    _extremes_inside,
    _extremes_apart,
    *TORQUE_RULES,
    _start_frequency,
    _rotor_swing,
    _zone_places,
    _zone_overlap,
    _zone_speed,
)
"""The rules, in the order in which their contradictions are told."""
