"""Contradictions about places and zones of a motor: all on its travel, in their order, at speeds it can have."""

from collections.abc import Iterator
from itertools import combinations

from detent.files.findings import Contradiction, wrong
from detent.files.nearest import BARELY
from detent.methods.stepper_envelope.build import start_hz
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec, StepperTable
from detent.methods.stepper_envelope.torque_checks import START_KEYS, Rule, is_drivable, keys_of, per_motor, remedy
from detent.units import format_quantity as text

MOST_STEPS = 10_000_000  # longest travel in steps: both tables of a motor then take 40 MB
PLACE_DIGITS = 7  # digits of a place that a remedy names: a step of a micrometre in a travel of metres


def _is_inside(table: StepperTable, place: float) -> bool:
    """True for a place between both ends of the travel, and for the ends."""
    way, slack = place - table.mechanics.lower_end, 1e-6 * table.step
    return -slack <= way <= table.limits.travel + slack


def _has_places(table: StepperTable) -> bool:
    """True where places can be told apart: the travel has a step, and not too many."""
    return 1 <= table.steps <= MOST_STEPS


def _travel(table: StepperTable) -> str:
    lower = table.mechanics.lower_end
    return f"on the travel, from {text(lower, 'm')} to {text(lower + table.limits.travel, 'm')}"


def _at_or_above(key: str, place: float) -> str:
    """Remedy: a place that is not below another but for an error of arithmetic."""
    return remedy.least(key, round(place, 12), digits=PLACE_DIGITS)


def _at_or_below(key: str, place: float) -> str:
    """Remedy: a place that is not above another but for an error of arithmetic."""
    return remedy.most(key, round(place, 12), digits=PLACE_DIGITS)


def _inside(table: StepperTable, key: str, name: str, place: float) -> Iterator[Contradiction]:
    """A place lies between both ends of the travel."""
    if not _is_inside(table, place) and _has_places(table):
        path, lower = f"{key}.{name}", table.mechanics.lower_end
        nearest = _at_or_above(path, lower) if place < lower else _at_or_below(path, lower + table.limits.travel)
        yield wrong(keys_of(key, name, "limits.travel", "mechanics.lower_end"), _travel(table), nearest)


@per_motor
def _places(_: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """Start position and extremes lie on the travel; the turn lies above start and stop, a step at least."""
    extremes = table.extremes
    yield from _inside(table, key, "mechanics.start_position", table.mechanics.start_position)
    for name in ("start", "turn", "stop"):
        yield from _inside(table, key, f"extremes.{name}", getattr(extremes, name))
    places = {name: table.step_inside(getattr(extremes, name)) for name in ("start", "stop")}
    turn, name = table.step_inside(extremes.turn), max(places, key=lambda name: places[name])
    inside = all(_is_inside(table, place) for place in (extremes.start, extremes.turn, extremes.stop))
    if inside and places[name] >= turn and _has_places(table):
        higher = _at_or_above(f"{key}.extremes.turn", table.position_of(places[name] + 1))
        yield wrong(
            keys_of(key, "extremes.turn", f"extremes.{name}", "limits.travel", "mechanics.lower_end"),
            f"above extremes.{name}, {text(getattr(extremes, name), 'm')}, by a step of {text(table.step, 'm')} or "
            "more: there the run upwards ends and the run downwards begins",
            higher if places[name] < table.steps else "move both apart",
        )


@per_motor
def _zone_places(_: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """Each zone has a begin below its end, and both lie on the travel."""
    lower = table.mechanics.lower_end
    for name, zone in table.zone.items() if _has_places(table) else ():
        begin, end = f"zone.{name}.begin", f"zone.{name}.end"
        if zone.begin >= zone.end:
            keys = keys_of(key, end, begin, "limits.travel", "mechanics.lower_end")
            after = zone.begin + table.step
            fits = _is_inside(table, zone.begin) and _is_inside(table, after)
            longer = _at_or_above(f"{key}.{end}", after) if fits else "correct begin and end"
            yield wrong(keys, f"above the zone's begin, {text(zone.begin, 'm')}", longer)
        elif zone.end <= lower or zone.begin >= lower + table.limits.travel:
            yield wrong(
                keys_of(key, begin, end, "limits.travel", "mechanics.lower_end"),
                f"{_travel(table)}; here the whole zone is not",
                "remove the zone, or correct limits.travel or mechanics.lower_end",
            )
        else:
            yield from _inside(table, key, begin, zone.begin)
            yield from _inside(table, key, end, zone.end)


@per_motor
def _zone_overlap(_: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """No two zones of one direction overlap."""
    zones = sorted(table.zone.items(), key=lambda item: item[1].begin) if _has_places(table) else []
    for (name, zone), (other, following) in combinations(zones, 2):
        both = zone.direction == following.direction or "both" in {zone.direction, following.direction}
        if not both or min(zone.end, following.end) - following.begin <= 1e-6 * table.step:
            continue
        first, second = f"zone.{name}", f"zone.{other}"
        apart = f"remove zone {other} or zone {name}"
        if zone.end < following.end:
            apart = _at_or_above(f"{key}.{second}.begin", zone.end)
        elif zone.begin < following.begin:
            apart = _at_or_below(f"{key}.{first}.end", following.begin)
        yield wrong(
            keys_of(key, f"{second}.begin", f"{first}.end", f"{second}.end", f"{first}.begin")
            + " "
            + keys_of(key, f"{second}.direction", f"{first}.direction"),
            f"at or above the end of zone {name}, {text(zone.end, 'm')}: a step has one limit in each direction",
            apart,
        )


@per_motor
def _zone_speed(_: StepperEnvelopeSpec, table: StepperTable, key: str) -> Iterator[Contradiction]:
    """A zone is not slower than the start frequency, and not faster than the motor."""
    if not is_drivable(table):
        return
    start, fastest = start_hz(table), table.limits.speed
    slowest = start * table.step
    # Between two bounds that are as good as one there is no short number.
    digits = 15 if slowest * (1 + 1e-3) > fastest else 4
    for name, zone in table.zone.items():
        path = f"{key}.zone.{name}.speed"
        if zone.speed > fastest * (1 + BARELY):
            allowed = f"up to limits.speed, {text(fastest, 'm/s')}: a faster zone has no effect"
            yield wrong(f"{path} {key}.limits.speed", allowed, remedy.most(path, fastest, digits=digits))
        elif table.hz(zone.speed) < start * (1 - BARELY):
            yield wrong(
                f"{path} {keys_of(key, *START_KEYS)}",
                f"at least the speed of the start frequency, {text(slowest, 'm/s')} at {text(start, 'Hz')}: no ramp "
                "leads below it",
                remedy.least(path, slowest, digits=digits),
            )


PLACE_RULES: tuple[Rule, ...] = (_places,)
ZONE_RULES: tuple[Rule, ...] = (_zone_places, _zone_overlap, _zone_speed)
"""Contradictions about zones are told in this order."""
