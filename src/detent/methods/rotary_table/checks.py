"""What is checked in a rotary-table axis: contradictions between its keys, and cautions about what will surprise.

Sections and tests in brackets are those of the rotary-table specification.

Two things are allowed that one might expect here. The task's period need not be a whole multiple of the strobe's: they
are clocks of their own, nothing in the equations needs it, and a ratio between is how the race of trap 3 comes now and
then. A conversion need not end within the interrupt's delay: the comparators run freely, one result in each period of
the excitation, and a strobe takes the last; what it does need is a new one.
"""

import math
from collections.abc import Iterator

from detent.axisfile import common_checks as common
from detent.files.findings import Caution, Contradiction, wrong
from detent.files.nearest import BARELY, UNITS, Remedies, put
from detent.methods.rotary_table.derive import TICK, TableFigures, counted, weakest_output
from detent.methods.rotary_table.form_checks import FORMS, form_caution
from detent.methods.rotary_table.schema import FineTable, RotaryTableSpec
from detent.units import format_quantity as text

LONGEST_WAY = 1 << 31  # ways are shorter: IR has 32 bits before its point [count] (`control.table_positioner`)
FASTEST_WORD = (1 << 31) - 1  # largest speed of the interpolator: its square has 64 bits (`control.table_positioner`)
HIGHEST_OFFSET = 0.95  # share of a resolver's weakest output that an offset may reach: beyond it hardly crosses at all
LEAST_DAMPING = 0.4  # damping ratio from which a step is answered with an overshoot of a quarter at most
DIAL_RANGE = 600  # largest over smallest speed of a dial: 0.1 to 60 deg/s (7)
SMALL_ERROR = 0.01  # error of a speed by rounding that is not worth a word

remedy = Remedies(RotaryTableSpec)


def _above(keys: str, most: float, allowed: str) -> Contradiction:
    """The first of the keys is above a bound."""
    return wrong(keys, allowed, remedy.most(keys.partition(" ")[0], most))


def _below(keys: str, least: float, allowed: str, otherwise: str = UNITS) -> Contradiction:
    """The first of the keys is below a bound."""
    return wrong(keys, allowed, remedy.least(keys.partition(" ")[0], least, otherwise))


def _off(keys: str, value: float, allowed: str, otherwise: str = UNITS) -> Contradiction:
    """The first of the keys has one value that will do."""
    return wrong(keys, allowed, remedy.exactly(keys.partition(" ")[0], value, otherwise))


# --------------------------------------------------------------------------------------------------- contradictions


def _gear(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    """Gear and coarse resolver turn together, and a turn has less than 2^30 counts."""
    gear, reduction, ratio = spec.mechanics.gear_ratio, spec.detector.coarse.reduction, spec.ratio
    if gear != ratio:
        allowed = "a whole number: after a turn of the table the fine resolver must stand where it began (3.1)"
        yield _off("mechanics.gear_ratio", ratio, allowed)
    if reduction not in {ratio, gear}:
        allowed = f"equal to mechanics.gear_ratio, {gear:g}: the coarse resolver turns with the table"
        otherwise = "leave it out: it is then mechanics.gear_ratio"
        yield _off("detector.coarse.reduction mechanics.gear_ratio", ratio, allowed, otherwise)
    if 2 * spec.period >= LONGEST_WAY:
        yield _above(
            "detector.fine.counts mechanics.gear_ratio",
            (LONGEST_WAY // 2 - 1) // ratio,
            f"such that T = G x fine counts, here {spec.period}, is below 2^30: a jog begins with 2 T to go, and the "
            "remaining angle has 32 bits before its point",
        )


def _detector(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    """The coarse word tells motor turns apart, conversions end in time, comparators see zero crossings."""
    detector, strobe = spec.detector, spec.method.strobe_period
    if TableFigures(spec).allowed_coarse_error <= 0:
        # 1/(2 G) > 1/C + 1/(G F), times G
        least = math.floor(spec.ratio / (0.5 - 1 / detector.fine.counts) * (1 + BARELY)) + 1
        keys = "detector.coarse.counts mechanics.gear_ratio detector.fine.counts"
        allowed = f"at least {least}: a count of the coarse word is then less than half a motor turn (3.1)"
        yield _below(keys, least, allowed, "choose a smaller mechanics.gear_ratio")
    name, counts = max((("fine", detector.fine.counts), ("coarse", detector.coarse.counts)), key=lambda entry: entry[1])
    if counts / detector.clock > strobe * (1 + BARELY):
        yield _below(
            f"detector.clock detector.{name}.counts method.strobe_period",
            counts / strobe,
            f"at least {text(counts / strobe, 'Hz')}: a conversion of {counts} clocks, here "
            f"{text(counts / detector.clock, 's')}, ends in each strobe period, {text(strobe, 's')}",
        )
    tables: dict[str, FineTable] = {"fine": detector.fine, "coarse": detector.coarse}
    for name, table in tables.items():
        most, around = HIGHEST_OFFSET * weakest_output(table), f"detector.{name}"
        if abs(table.offset_error) > most:
            keys = f"{around}.offset_error {around}.gain_error {around}.quadrature_error"
            allowed = (
                f"up to {text(most, '%')} in magnitude: where the windings give least, the comparator would see no "
                "zero crossing"
            )
            yield _below(keys, -most, allowed) if table.offset_error < 0 else _above(keys, most, allowed)


def _clocks(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    """Periods are whole ticks, in their order."""
    method = spec.method
    for name, fewest in {"strobe_period": 2, "interrupt_delay": 1, "task_period": 2, "task_phase": 0}.items():
        ticks = float(getattr(method, name)) / TICK
        if abs(ticks - round(ticks)) > 1e-6:
            nearest = max(fewest, round(ticks)) * TICK
            yield _off(f"method.{name}", nearest, "a whole number of 0.1 ms, the base tick")
    strobe, period = round(method.strobe_period / TICK), text(method.strobe_period, "s")
    if round(method.interrupt_delay / TICK) >= strobe:
        allowed = f"below method.strobe_period, {period}: each interrupt comes before the next strobe"
        yield _off("method.interrupt_delay method.strobe_period", (strobe - 1) * TICK, allowed)
    if round(method.task_period / TICK) < strobe:
        late = "two passes of the task would judge the same angle, and roll over twice"
        allowed = f"at least method.strobe_period, {period}: {late}"
        yield _off("method.task_period method.strobe_period", strobe * TICK, allowed)
    way = spec.drive.full_speed / spec.ratio * method.strobe_period
    if way >= math.pi:
        yield wrong(
            "method.strobe_period drive.full_speed motor.max_speed mechanics.gear_ratio",
            f"such that the table turns less than 180 deg in it, here {text(way, 'rad')} at the largest word: a "
            "change of more than T/2 is taken for a crossing of the boundary (3.3)",
            remedy.most("drive.full_speed", math.pi / method.strobe_period * spec.ratio * (1 - BARELY)),
        )


def _speeds(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    """Speeds are neither above the drive's nor below the interpolator's."""
    top, most, least = spec.limits.speed, spec.largest_speed, 1 / spec.per_interrupt(1.0)
    word, bits = spec.per_interrupt(top), spec.method.fraction_bits
    if top > most * (1 + BARELY):
        which = "motor.max_speed" if spec.motor.max_speed <= spec.drive.full_speed else "drive.full_speed"
        keys = "limits.speed motor.max_speed drive.full_speed mechanics.gear_ratio"
        yield _above(keys, most, f"up to {which} over the gear ratio, {text(most, 'rad/s')}")
    # A speed that was left out is that of the limit.
    speeds = {f"position.{number}.speed": entry.speed for number, entry in spec.position.items() if entry.speed != top}
    for key, speed in ({"limits.speed": top} | speeds).items():
        if speed < least * (1 - BARELY):
            keys = f"{key} method.fraction_bits method.strobe_period detector.fine.counts"
            allowed = f"at least {text(least, 'rad/s')}: the interpolator moves on by {_parts(bits)} in an interrupt"
            yield _below(keys, least, allowed, "lengthen method.strobe_period")
    if word > FASTEST_WORD:
        yield wrong(
            "method.fraction_bits limits.speed method.strobe_period detector.fine.counts",
            f"such that limits.speed, here {word:.4g} parts of a count per interrupt, is a word of 32 bits",
            remedy.most("limits.speed", top * FASTEST_WORD / word),
        )


def _parts(bits: int) -> str:
    return f"whole 2^-{bits} counts" if bits else "whole counts"


def _acceleration(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    """The acceleration is one for the interpolator, and brakes within a turn."""
    m, bits = TableFigures(spec), spec.method.fraction_bits
    speed, acceleration = spec.limits.speed, spec.limits.acceleration
    least = acceleration / spec.acceleration_word
    if acceleration < least * (1 - BARELY):
        yield _below(
            "limits.acceleration method.fraction_bits method.strobe_period detector.fine.counts",
            least,
            f"at least {text(least, 'rad/s^2')}: the interpolator's speed grows by {_parts(bits)} per interrupt from "
            "one interrupt to the next",
            "lengthen method.strobe_period",
        )
    way, reserve = speed**2 / (2 * acceleration), m.latency_way
    if spec.method.judge == "actual" or spec.method.guarded:
        reserve += m.following_error(speed)  # the actual angle lags, and so does a crossing that has to be waited for
    if way >= math.tau - reserve:
        harder = speed**2 / (2 * (math.tau - reserve)) * (1 + BARELY) if reserve < math.tau else math.inf
        yield _below(
            "limits.acceleration limits.speed method.task_period method.position_gain method.judge",
            harder,
            f"such that braking, here over {text(way, 'rad')}, takes less than a turn less the {text(reserve, 'rad')} "
            "by which a rollover comes late: a jog would brake before it",
            "lower limits.speed, or raise method.position_gain",
        )


def _positions(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    """Positions can be gone to, at speeds within the limit."""
    top, furthest, window = spec.limits.speed, LONGEST_WAY - spec.period, (spec.period - 1) // 2
    for number, entry in spec.position.items():
        if entry.speed > top * (1 + BARELY):
            yield _above(f"position.{number}.speed limits.speed", top, f"up to limits.speed, {text(top, 'rad/s')}")
    others = [number for number, entry in spec.position.items() if entry.direction != "as commanded"]
    if spec.method.form != "turn counter" and others:
        yield wrong(
            " ".join(["method.form", *(f"position.{number}.direction" for number in others)]),
            f'"turn counter" where a position has a direction or a shortest way: position {", ".join(others)}; without '
            'the counter a positioning ends at the boundary, and an angle is gone to "as commanded" (3.6)',
            put("method.form", '"turn counter"'),
        )
    for number, entry in spec.position.items():
        beyond = entry.direction == "as commanded" and abs(entry.angle) / spec.count >= furthest >= spec.period
        if beyond:
            most = (furthest - 1) * spec.count * (1 - BARELY)
            keys = f"position.{number}.angle detector.fine.counts mechanics.gear_ratio"
            allowed = (
                f"less than {text(furthest * spec.count, 'rad')} from 0: from any angle of the turn the way has fewer "
                "than 2^31 counts, which the remaining angle holds"
            )
            yield _below(keys, -most, allowed) if entry.angle < 0 else _above(keys, most, allowed)
    if spec.method.in_position > window:
        keys = "method.in_position mechanics.gear_ratio detector.fine.counts"
        yield _above(keys, window, f"below half a turn, up to {window} counts")


def _machine(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    """The motor breaks loose, and a load lasts."""
    static, load = spec.mechanics.static, spec.disturbance.load
    yield from common.static_friction({"mechanics": spec.mechanics}, "N*m")
    if spec.limits.effort <= static:
        allowed = f"above mechanics.static, {text(static, 'N*m')}: the motor never breaks away"
        keys = "limits.effort mechanics.static mechanics.coulomb"
        yield _below(keys, static * (1 + BARELY), allowed, "lower mechanics.static")
    if load is not None and load.duration < TICK * (1 - BARELY):
        yield _below("disturbance.load.duration", TICK, f"at least a base tick, {text(TICK, 's')}")


RULES = (_gear, _detector, _clocks, _speeds, _acceleration, _positions, _machine)
"""Contradictions are reported in this order."""


# --------------------------------------------------------------------------------------------------------- cautions


def find_cautions(spec: RotaryTableSpec) -> Iterator[Caution]:
    """Look a rotary-table axis over."""
    machine = TableFigures(spec)
    for look in (*FORMS, _loop, _drive, _torque, _rest, _slow, _composition):
        yield from look(machine)


def _loop(m: TableFigures) -> Iterator[Caution]:
    """The loop is damped, and its word is never clipped."""
    spec, damping, most = m.spec, m.loop.damping, m.spec.largest_word
    if not spec.method.position_control:
        return
    error = m.following_error(m.speed) + (m.overshoot(m.speed) if m.is_stable else 0.0)
    if spec.protection.following_time > 0 and error > spec.protection.following_error * (1 + BARELY):
        yield Caution(
            "following error at limits.speed",
            f"{text(error, 'rad')} after an acceleration",
            f"up to protection.following_error, {text(spec.protection.following_error, 'rad')}",
            "the drive trips when a jog reaches its speed",
            remedy.least("protection.following_error", error, "raise method.position_gain"),
        )
    if damping < LEAST_DAMPING:
        yield Caution(
            "damping of the loop",
            f"{damping:.3g}",
            f"at least {LEAST_DAMPING:g}",
            "the table overshoots and rings at each stop"
            if m.is_stable
            else f"the loop is unstable, spectral radius {m.loop.spectral_radius:.4f}: the oscillation grows",
            remedy.most("method.position_gain", m.loop.largest_gain(LEAST_DAMPING), "shorten drive.time_constant"),
        )
    if m.is_stable and m.peak_word(m.speed) > most * (1 + BARELY):
        needed = m.word_at(m.speed)
        yield Caution(
            "speed word at limits.speed",
            f"{needed:.4g} counts, {m.peak_word(m.speed):.4g} after an acceleration",
            f"up to {most}, the largest word",
            "the drive does not keep up, and the following error grows for as long as a jog lasts"
            if needed > most
            else "the word saturates after each acceleration, and the table lags by more than the derived figures say",
            "lower limits.speed, or raise drive.full_speed",
        )


def _drive(m: TableFigures) -> Iterator[Caution]:
    """The drive keeps to the motor's speed, and the interpolator's words are not rounded to nothing."""
    spec, full, most, bits = m.spec, m.spec.drive.full_speed, m.spec.motor.max_speed, m.spec.method.fraction_bits
    if full > most * (1 + BARELY):
        yield Caution(
            "drive.full_speed",
            text(full, "rad/s"),
            f"up to motor.max_speed, {text(most, 'rad/s')}",
            "in a fault the largest word drives the motor above its rated speed",
            remedy.most("drive.full_speed", most),
        )
    words = {f"a dial of limits.speed / {DIAL_RANGE}": spec.per_interrupt(m.speed / DIAL_RANGE)}
    words |= {"limits.acceleration": spec.acceleration_word}
    words |= {f"position.{number}.speed": spec.per_interrupt(entry.speed) for number, entry in spec.position.items()}
    name, word = min(words.items(), key=lambda entry: entry[1])
    error = 0.5 / word
    if error > SMALL_ERROR:
        more = bits + math.ceil(math.log2(error / SMALL_ERROR))
        yield Caution(
            "method.fraction_bits",
            f"{bits}: {name} is {word:.3g} parts of a count per interrupt",
            f"enough for {0.5 / SMALL_ERROR:g} of them",
            "it is rounded to zero, and the table does not move (test 20)"
            if word < 0.5
            else f"it is rounded to whole counts, an error of up to {text(error, '%')} (test 20)",
            remedy.least("method.fraction_bits", more, "use a longer method.strobe_period"),
        )


def _torque(m: TableFigures) -> Iterator[Caution]:
    """The amplifier has the torque that is asked of it, and its limit acts."""
    spec, effort, load = m.spec, m.spec.limits.effort, m.spec.disturbance.load
    needed, steady, moves = m.accelerating_torque, m.resisting_torque, spec.method.position_control and m.is_stable
    if moves and needed > effort * (1 + BARELY):
        lower = spec.limits.acceleration * (effort - steady) / (needed - steady)
        yield Caution(
            "acceleration torque",
            text(needed, "N*m"),
            f"up to limits.effort, {text(effort, 'N*m')}",
            "the amplifier saturates, the table lags and overshoots at the end",
            remedy.most("limits.acceleration", lower, "raise limits.effort"),
        )
    giver = "the amplifier asks for, reversed from full speed"
    yield from common.idle_effort(remedy, effort, 2 * m.spec.stiffness * spec.drive.full_speed, "N*m", giver)
    torque = abs(load.torque) / spec.ratio if load else 0.0
    together = torque + max(needed if moves else 0.0, spec.mechanics.coulomb)
    if load and together > effort * (1 + BARELY):
        yield Caution(
            "disturbance.load.torque",
            f"{text(torque, 'N*m')} at the motor, {text(together, 'N*m')} with an acceleration",
            f"up to limits.effort, {text(effort, 'N*m')}",
            "the load displaces the table while it acts"
            if torque > effort + spec.mechanics.coulomb
            else "a table moving against the load falls behind",
            remedy.least("limits.effort", together, "use a larger mechanics.gear_ratio"),
        )


def _rest(m: TableFigures) -> Iterator[Caution]:
    """At rest the table is in position, and stays so."""
    spec, window, error, noise = m.spec, m.spec.method.in_position, m.resting_error, m.noise
    if m.breaking_word > spec.largest_word:
        yield Caution(
            "static friction",
            text(spec.mechanics.static, "N*m"),
            f"below the torque of the largest word, {text(m.spec.stiffness * spec.drive.full_speed, 'N*m')}",
            "the table never breaks away",
            "shorten drive.time_constant or lower mechanics.static",
        )
    elif spec.method.position_control and error > window:
        yield Caution(
            "deviation at rest",
            f"up to {counted(error)}, {text(error * spec.count, 'rad')}",
            f"up to method.in_position, {window}",
            f"{'friction' if spec.mechanics.static > 0 else 'a word that is rounded to 0'} holds the table off its "
            "target, and positioning never finishes",
            remedy.least("method.in_position", error, "raise method.position_gain"),
        )
    elif spec.method.position_control and error + noise > window:
        yield Caution(
            "noise in position",
            f"up to {counted(noise)}, with {error} at rest",
            f"together up to method.in_position, {window}",
            "readings keep leaving the window, and positioning takes long or never finishes",
            remedy.least("method.in_position", error + noise, "lower detector.fine.noise"),
        )


def _slow(m: TableFigures) -> Iterator[Caution]:
    """A slow jog does not stick, and a short way back is not a turn."""
    spec, method, mechanics = m.spec, m.spec.method, m.spec.mechanics
    step = m.deviation(mechanics.static - mechanics.coulomb) / spec.count
    window = max(1, method.in_position)
    if method.position_control and m.breaking_word <= spec.largest_word and step > window:
        lower = window * spec.count * m.gain * spec.ratio * m.spec.stiffness
        yield Caution(
            "stick-slip",
            f"{step:.4g} counts more deviation to break away than to keep moving",
            f"up to {window}",
            "at a slow jog the table moves in stick-slip",
            remedy.most("mechanics.static", mechanics.coulomb + lower),
        )
    numbers = [number for number, entry in spec.position.items() if entry.direction in {"positive", "negative"}]
    counts = method.in_position + m.noise
    if numbers and method.form == "turn counter" and round(method.short_way / spec.count) < counts:
        yield Caution(
            "method.short_way",
            text(method.short_way, "rad"),
            f"at least {counted(counts)}, {text(counts * spec.count, 'rad')}, what is in position, where a position "
            f"has a direction: {', '.join(numbers)}",
            "a table that rests one count beyond its target makes a whole turn when it is sent there again",
            remedy.least("method.short_way", counts * spec.count, "lower method.in_position"),
        )


def _composition(m: TableFigures) -> Iterator[Caution]:
    """The two words of the detector make one angle."""
    spec, errors, allowed = m.spec, m.coarse_errors, m.allowed_coarse_error
    turn, total = text(math.tau / spec.ratio, "rad"), sum(errors.values())
    if spec.detector.composition == "truncated":
        result = f"near each zero of the fine word the angle is wrong by a motor turn, {turn} (3.1, test 2)"
        yield form_caution("detector.composition", '"truncated"', '"rounded"', result)
    if total > allowed:
        parts = ", ".join(f"{name} {text(error, 'rad')}" for name, error in errors.items())
        largest = text(max(errors.values()), "rad")
        yield Caution(
            "coarse error",
            f"up to {text(total, 'rad')}: {parts}",
            f"up to {text(allowed, 'rad')}, half a motor turn less a count",
            f"at some angles the table reads a motor turn too much or too little, {turn}, and jumps (3.1, trap 7)",
            f"improve the largest of them, {largest}, or choose a smaller mechanics.gear_ratio",
        )
