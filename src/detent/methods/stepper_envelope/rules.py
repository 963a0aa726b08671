"""Contradictions between the keys of each motor: steps, places, torque, a ramp that fits, and zones.

Sections are those of the stepper-envelope specification.
"""

import math
from collections.abc import Callable, Iterator
from functools import wraps
from itertools import combinations, pairwise

from detent.axisfile.common_checks import home
from detent.files.fields import unit_of
from detent.files.findings import Contradiction, wrong
from detent.files.nearest import BARELY, UNITS, Remedies, put
from detent.files.problems import field_at
from detent.methods.stepper_envelope import build
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec, StepperTable
from detent.methods.stepper_envelope.stage_job import unit_in_name
from detent.planning.step_envelope import MAX_RAMP
from detent.planning.step_ramp import LEAST_GAIN_HZ, MAX_HZ
from detent.units import describe_kind
from detent.units import format_quantity as text

LEAST_TICKS = 10  # ticks of the step timer in the shortest period: fewer, and neighbours on the ramp are all alike
FASTEST_SWING = 0.1  # largest swing of the rotor about its step in a time step of its equation of motion [rad]
MOST_STEPS = 10_000_000  # longest travel in steps: both tables of a motor then take 40 MB
PLACE_DIGITS = 7  # digits of a place that a remedy names: a step of a micrometre in a travel of metres
SURE_REST = 0.5  # distance from its step, in steps, from which a resting rotor counts as a step off
STEEPEST = math.inf  # acceleration with which the torque alone limits the ramp

# What each of these depends on, as keys of a motor.
TORQUE_KEYS = (
    "drive.supply drive.current drive.bridge_resistance motor.pull_out motor.resistance motor.inductance "
    "motor.rated_current motor.pull_out_torque motor.corner_frequency motor.curve_frequency motor.curve_torque"
)
PLACE_KEYS = "limits.travel mechanics.lower_end"
START_KEYS = "motor.start_frequency drive.start_safety motor.steps_per_turn motor.holding_torque motor.rotor_inertia"


class Motor:
    """A motor of the file, and what can be said of its keys; those of [controller] may be named as well."""

    def __init__(self, spec: StepperEnvelopeSpec, name: str) -> None:
        self.spec, self.name, self.table = spec, name, spec.stepper[name]
        self.remedies, mechanics = Remedies(type(spec)), self.table.mechanics
        self.step_keys = f"mechanics.{mechanics.way_key} motor.steps_per_turn drive.microsteps"
        self.load_keys = " ".join(f"mechanics.{key}" for key in mechanics.load_keys)
        self.start_keys = f"{START_KEYS} {self.load_keys}"
        self.ramp_keys = (
            "limits.speed limits.acceleration drive.torque_safety mechanics.friction_torque "
            f"{TORQUE_KEYS} {self.start_keys}"
        )

    def keys(self, names: str) -> str:
        """Keys as the file has them, each once."""
        each = dict.fromkeys(names.split())
        return " ".join(name if name.startswith("controller.") else f"stepper.{self.name}.{name}" for name in each)

    def wrong(self, names: str, allowed: str, remedy: str) -> Contradiction:
        """Contradiction between keys."""
        return wrong(self.keys(names), allowed, remedy)

    def most(self, name: str, bound: float, otherwise: str = UNITS, digits: int = 4) -> str:
        """Remedy: the largest short value that is not above a bound."""
        return self.remedies.most(self.keys(name), bound, otherwise, digits)

    def least(self, name: str, bound: float, otherwise: str = UNITS, digits: int = 4) -> str:
        """Remedy: the smallest short value that is not below a bound."""
        return self.remedies.least(self.keys(name), bound, otherwise, digits)

    def put(self, name: str, value: object) -> str:
        """Remedy: a value as the file writes it."""
        return put(self.keys(name), value)

    # Places that are off by an error of arithmetic only are as good as the bound.

    def below(self, name: str, place: float) -> str:
        """Remedy: a place that is not above another."""
        return self.most(name, self._plain(place), digits=PLACE_DIGITS)

    def above(self, name: str, place: float) -> str:
        """Remedy: a place that is not below another."""
        return self.least(name, self._plain(place), digits=PLACE_DIGITS)

    def _plain(self, place: float) -> float:
        """A place without the error of arithmetic; that of an angle goes where it is written in degrees."""
        return place if self.table.turns else round(place, 12)


Found = Iterator[Contradiction]


# ---- steps and timer


def _steps(m: Motor) -> Found:
    """A turn is whole tooth pitches, the travel has a step and not too many, and the largest frequency is a word."""
    table = m.table
    step, hz, per_turn = table.step, table.max_hz, table.motor.steps_per_turn
    if per_turn % 4:
        whole = m.put("motor.steps_per_turn", max(4, round(per_turn / 4) * 4))
        yield m.wrong("motor.steps_per_turn", "a multiple of 4: a tooth pitch has four full steps", whole)
    if table.steps < 1:
        allowed = f"at least one step, {table.text(step, 'm')}"
        yield m.wrong(f"limits.travel {m.step_keys}", allowed, m.least("limits.travel", step))
    elif table.steps > MOST_STEPS:
        allowed = f"up to {MOST_STEPS} steps of {table.text(step, 'm')}: a table has an entry for each"
        yield m.wrong(f"limits.travel {m.step_keys}", allowed, m.most("limits.travel", MOST_STEPS * step))
    if not 1 <= hz <= MAX_HZ:
        slow = build.changed(table, "limits.speed", MAX_HZ * step * (1 - BARELY))
        lower = m.most("limits.speed", MAX_HZ * step) if not _is_drivable(m, slow) or build.ramp_fits(slow) else ""
        yield m.wrong(
            f"limits.speed {m.step_keys}",
            f"from {table.text(step, 'm/s')} to {table.text(MAX_HZ * step, 'm/s')}, step frequencies of 1 Hz to "
            f"{MAX_HZ} Hz, here {hz:.5g} Hz",
            m.least("limits.speed", step) if hz < 1 else lower or "lower limits.speed to what the torque allows",
        )


def _timer(m: Motor) -> Found:
    """The clock of the step timers is whole, and fine enough for the shortest period, that of the fastest motor."""
    clock, fastest = m.spec.controller.timer, m.table.max_hz
    if m.name != max(m.spec.stepper, key=lambda name: m.spec.stepper[name].max_hz):
        return
    if abs(clock - round(clock)) > 1e-6:
        yield wrong("controller.timer", "a whole number of Hz", m.remedies.exactly("controller.timer", round(clock)))
    elif clock < LEAST_TICKS * fastest * (1 - BARELY) and fastest <= MAX_HZ:
        yield m.wrong(
            f"controller.timer limits.speed mechanics.{m.table.mechanics.way_key}",
            f"at least {LEAST_TICKS} ticks in the period of {text(fastest, 'Hz')}",
            m.least("controller.timer", LEAST_TICKS * fastest, "lower limits.speed"),
        )


# ---- places


def _is_inside(table: StepperTable, place: float) -> bool:
    """True for a place between both ends of the travel, and for the ends."""
    way, slack = place - table.mechanics.lower_end, 1e-6 * table.step
    return -slack <= way <= table.limits.travel + slack


def _has_places(table: StepperTable) -> bool:
    """True where places can be told apart: the travel has a step, and not too many."""
    return 1 <= table.steps <= MOST_STEPS


def _travel(table: StepperTable) -> str:
    lower = table.mechanics.lower_end
    return f"on the travel, from {table.text(lower, 'm')} to {table.text(lower + table.limits.travel, 'm')}"


def _inside(m: Motor, name: str, place: float) -> Found:
    """A place lies between both ends of the travel."""
    if not _is_inside(m.table, place) and _has_places(m.table):
        lower = m.table.mechanics.lower_end
        nearest = m.above(name, lower) if place < lower else m.below(name, lower + m.table.limits.travel)
        yield m.wrong(f"{name} {PLACE_KEYS}", _travel(m.table), nearest)


def _places(m: Motor) -> Found:
    """Start position and extremes lie on the travel; the turn lies above start and stop, a step at least."""
    table, extremes = m.table, m.table.extremes
    yield from _inside(m, "mechanics.start_position", table.mechanics.start_position)
    for name in ("start", "turn", "stop"):
        yield from _inside(m, f"extremes.{name}", getattr(extremes, name))
    places = {name: table.step_inside(getattr(extremes, name)) for name in ("start", "stop")}
    turn, name = table.step_inside(extremes.turn), max(places, key=lambda name: places[name])
    inside = all(_is_inside(table, place) for place in (extremes.start, extremes.turn, extremes.stop))
    if inside and places[name] >= turn and _has_places(table):
        higher = m.above("extremes.turn", table.position_of(places[name] + 1))
        yield m.wrong(
            f"extremes.turn extremes.{name} {PLACE_KEYS}",
            f"above extremes.{name}, {table.text(getattr(extremes, name), 'm')}, by a step of "
            f"{table.text(table.step, 'm')} or more: there the run upwards ends and the run downwards begins",
            higher if places[name] < table.steps else "move both apart",
        )


def _home(m: Motor) -> Found:
    """Its reference can be found."""
    table, unit = m.table, "rad" if m.table.turns else "m"
    ends = table.mechanics.lower_end, table.upper_end
    yield from home(m.remedies, table.home, ends, table.limits.speed, unit=unit, at=f"stepper.{m.name}.")


# ---- torque


def _constants(m: Motor) -> Found:
    """The chosen way of stating the pull-out torque has its constants."""
    way = m.table.motor.pull_out
    for name in (name for name in build.NEEDED[way] if getattr(m.table.motor, name) is None):
        path = m.keys(f"motor.{name}")
        example = describe_kind(unit_of(field_at(type(m.spec), tuple(path.split(".")))))[1]
        other = "or name a motor of the catalogue that has it, " if way == "winding" else ""
        yield m.wrong(
            f"motor.{name} motor.pull_out",
            f'stated, as pull_out = "{way}" needs it',
            f'add {name} = "{example}" in [{m.keys("motor")}], {other}or choose another pull_out',
        )


def _curve(m: Motor) -> Found:
    """Points of a published curve: as many torques as frequencies, which rise."""
    hz, torque = m.table.motor.curve_frequency, m.table.motor.curve_torque
    if m.table.motor.pull_out != "points":
        return
    if len(hz) < 2:
        example = 'curve_frequency = ["500 Hz", "2 kHz"] and curve_torque = ["45 mN*m", "20 mN*m"]'
        allowed = f'two or more frequencies, as pull_out = "points" needs them, here {len(hz)}'
        remedy = f"state the points of the curve, as {example}"
        yield m.wrong("motor.curve_frequency motor.pull_out", allowed, remedy)
    elif len(torque) != len(hz):
        allowed = f"as many as curve_frequency has, {len(hz)}, here {len(torque)}"
        yield m.wrong("motor.curve_torque motor.curve_frequency", allowed, "state one torque for each frequency")
    elif not all(one < following for one, following in pairwise(hz)):
        order = "order the points by frequency, torques with them, and remove what stands there twice"
        yield m.wrong("motor.curve_frequency", "frequencies that rise, each once", order)
    elif torque[0] <= 0:
        allowed = "above 0 N*m at the first frequency: it holds from standstill up to there"
        yield m.wrong("motor.curve_torque", allowed, "state the pull-out torque at standstill as the first one")


def _has_pull_out(m: Motor) -> bool:
    """True where the pull-out torque is known."""
    return not any(_constants(m)) and not any(_curve(m))


def _is_drivable(m: Motor, table: StepperTable) -> bool:
    """True where a ramp can be worked out at all, with a table of the motor that may have another speed."""
    return _has_pull_out(m) and 1 <= table.max_hz <= MAX_HZ and build.bare_start_hz(table) >= 1


def _torques(m: Motor) -> Found:
    """No pull-out torque is above the holding torque; friction does not hold a resting rotor off its step."""
    table, motor, held = m.table, m.table.motor, m.table.held_torque
    name, pull_out = "pull_out_torque", motor.pull_out_torque or 0.0
    if motor.pull_out == "points":
        name, pull_out = "curve_torque", max(motor.curve_torque, default=0.0)
    if motor.pull_out != "winding" and _has_pull_out(m) and pull_out > held * (1 + BARELY):
        yield m.wrong(
            f"motor.{name} motor.holding_torque drive.current motor.rated_current",
            f"up to the holding torque at the current of the drive, {text(held, 'N*m')}",
            m.least("motor.holding_torque", motor.holding_torque * pull_out / held, "check the units of both torques"),
        )
    tolerance = min(m.spec.controller.tolerance, SURE_REST)
    friction, most = table.mechanics.friction_torque, held * math.sin(math.pi / 2 * tolerance)
    if friction > most * (1 + BARELY) and (not _is_drivable(m, table) or build.starts(table)):
        yield m.wrong(
            "mechanics.friction_torque motor.holding_torque controller.tolerance",
            f"up to {text(most, 'N*m')}: against more the field of a resting motor does not bring the rotor within "
            f"{tolerance:g} steps",
            m.most("mechanics.friction_torque", most),
        )


def _ramp(m: Motor) -> Found:
    """There is torque to accelerate with, the ramp reaches the largest speed, and its entries have room."""
    table = m.table
    if not _is_drivable(m, table) or build.ramp_fits(table):
        return
    start = build.start_hz(table)
    if not build.starts(table):
        torque = build.stepper_motor(table).pull_out(start)
        yield m.wrong(
            f"mechanics.friction_torque drive.torque_safety limits.speed {TORQUE_KEYS} {m.start_keys}",
            f"below {text(torque / table.drive.torque_safety, 'N*m')}: the pull-out torque at the start frequency, "
            f"{text(torque, 'N*m')} at {text(start, 'Hz')}, over torque_safety; nothing is left to accelerate with",
            "lower friction or drive.torque_safety, or choose a stronger motor",
        )
        return
    found = build.make_step_ramp(table)
    end = float(found.hz[min(len(found), MAX_RAMP) - 1])
    reached = f"it ends with entry {len(found)} at {table.text(end * table.step, 'm/s')}, {text(end, 'Hz')}"
    if found.hz[-1] >= table.max_hz:
        reached = f"it has {len(found)} entries"
    # A zone or a start above that speed would be wrong in its place.
    fastest_zone = max((zone.speed for zone in table.zone.values()), default=0.0)
    has_slower = fastest_zone <= end * table.step * (1 - 1e-3) and end > start
    slower = m.most("limits.speed", end * table.step) if has_slower else ""
    if build.ramp_fits(build.changed(table, "limits.acceleration", STEEPEST)):
        yield m.wrong(
            f"limits.acceleration {m.ramp_keys}",
            f"such that the ramp up to limits.speed has {MAX_RAMP} entries or fewer, each {LEAST_GAIN_HZ:g} Hz above "
            f"the last; here {reached}",
            slower or "raise limits.acceleration, or lower limits.speed",
        )
        return
    yield m.wrong(
        m.ramp_keys,
        f"such that the pull-out torque over torque_safety is enough for friction and for {MAX_RAMP} steps of ramp up "
        f"to it; here {reached}",
        slower or "choose a stronger motor, or less load",
    )


def _start_frequency(m: Motor) -> Found:
    """The start frequency is no standstill."""
    if _has_pull_out(m) and (hz := build.bare_start_hz(m.table)) < 1:
        safety = m.table.drive.start_safety * hz
        yield m.wrong(
            m.start_keys,
            f"such that the start frequency with load and reserve is 1 Hz or more, here {text(hz, 'Hz')}",
            m.most("drive.start_safety", safety, "check the units of torque and inertia"),
        )


def _rotor_swing(m: Motor) -> Found:
    """The rotor swings slowly enough for the time step of its equation of motion (7.2)."""
    motor = build.stepper_motor(m.table)
    hz, load = motor.natural_hz, motor.load_inertia
    most = FASTEST_SWING / (2 * math.pi * build.instant(m.spec))
    if hz > most:
        yield m.wrong(
            f"motor.rotor_inertia motor.holding_torque motor.steps_per_turn {m.load_keys} drive.current "
            "motor.rated_current controller.timer",
            f"such that the rotor swings about its step with {text(most, 'Hz')} or less, here {text(hz, 'Hz')}",
            m.least("motor.rotor_inertia", motor.inertia * (hz / most) ** 2 - load),
        )


# ---- zones


def _zone_places(m: Motor) -> Found:
    """Each zone has a begin below its end, and both lie on the travel."""
    table, lower = m.table, m.table.mechanics.lower_end
    for name, zone in table.zone.items() if _has_places(table) else ():
        begin, end = f"zone.{name}.begin", f"zone.{name}.end"
        if zone.begin >= zone.end:
            after = zone.begin + table.step
            fits = _is_inside(table, zone.begin) and _is_inside(table, after)
            longer = m.above(end, after) if fits else "correct begin and end"
            allowed = f"above the zone's begin, {table.text(zone.begin, 'm')}"
            yield m.wrong(f"{end} {begin} {PLACE_KEYS}", allowed, longer)
        elif zone.end <= lower or zone.begin >= lower + table.limits.travel:
            allowed = f"{_travel(table)}; here the whole zone is not"
            remedy = "remove the zone, or correct limits.travel or mechanics.lower_end"
            yield m.wrong(f"{begin} {end} {PLACE_KEYS}", allowed, remedy)
        else:
            yield from _inside(m, begin, zone.begin)
            yield from _inside(m, end, zone.end)


def _zone_overlap(m: Motor) -> Found:
    """No two zones of one direction overlap."""
    zones = sorted(m.table.zone.items(), key=lambda item: item[1].begin) if _has_places(m.table) else []
    for (name, zone), (other, following) in combinations(zones, 2):
        both = zone.direction == following.direction or "both" in {zone.direction, following.direction}
        if not both or min(zone.end, following.end) - following.begin <= 1e-6 * m.table.step:
            continue
        first, second = f"zone.{name}", f"zone.{other}"
        apart = f"remove zone {other} or zone {name}"
        if zone.end < following.end:
            apart = m.above(f"{second}.begin", zone.end)
        elif zone.begin < following.begin:
            apart = m.below(f"{first}.end", following.begin)
        yield m.wrong(
            f"{second}.begin {first}.end {second}.end {first}.begin {second}.direction {first}.direction",
            f"at or above the end of zone {name}, {m.table.text(zone.end, 'm')}: a step has one limit in each "
            "direction",
            apart,
        )


def _zone_speed(m: Motor) -> Found:
    """A zone is not slower than the start frequency, and not faster than the motor."""
    table = m.table
    if not _is_drivable(m, table):
        return
    start, fastest = build.start_hz(table), table.limits.speed
    slowest = start * table.step
    # Between two bounds that are as good as one there is no short number.
    digits = 15 if slowest * (1 + 1e-3) > fastest else 4
    for name, zone in table.zone.items():
        speed = f"zone.{name}.speed"
        if zone.speed > fastest * (1 + BARELY):
            allowed = f"up to limits.speed, {table.text(fastest, 'm/s')}: a faster zone has no effect"
            yield m.wrong(f"{speed} limits.speed", allowed, m.most(speed, fastest, digits=digits))
        elif table.hz(zone.speed) < start * (1 - BARELY):
            yield m.wrong(
                f"{speed} {m.start_keys}",
                f"at least the speed of the start frequency, {table.text(slowest, 'm/s')} at {text(start, 'Hz')}: no "
                "ramp leads below it",
                m.least(speed, slowest, digits=digits),
            )


# ---- names


def _names(spec: StepperEnvelopeSpec) -> Found:
    """In a list of places the name of a motor is not a column of another one, with its unit."""
    for name in spec.stepper:
        other, unit = unit_in_name(name, spec.stepper, spec.turning)
        if unit is not None:
            whose = f"motor {other}" if other in spec.stepper else other
            allowed = f'a name that is no column of {whose} in a list of places: there "{name}" is {whose} in {unit}'
            apart = f"give motor {name} or {whose} another name" if other in spec.stepper else "give it another name"
            yield wrong(f"stepper.{name}", allowed, apart)


def _per_motor(look: Callable[[Motor], Found]) -> Callable[[StepperEnvelopeSpec], Found]:
    """A rule of the file from one of its motors."""

    @wraps(look)
    def rule(spec: StepperEnvelopeSpec) -> Found:
        for name in spec.stepper:
            yield from look(Motor(spec, name))

    return rule


RULES = (_names, *map(_per_motor, (
    _steps, _timer, _places, _constants, _curve, _torques, _ramp, _start_frequency, _rotor_swing, _zone_places,
    _zone_overlap, _zone_speed, _home,
)))  # fmt: skip
"""Contradictions are told in this order."""
