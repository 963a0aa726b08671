"""What looks wrong with a rotary-table axis: forms of the method that fail, and limits that a sound file can come near.

Tests are those of the rotary-table specification.
"""

import math
from collections.abc import Callable, Iterator

from detent.files.findings import Caution
from detent.files.nearest import BARELY, at_least, at_most, either, offer, put
from detent.methods.rotary_table.derive import FULL_TURN, Machine, counted
from detent.methods.rotary_table.form_cautions import FORMS
from detent.methods.rotary_table.schema import RotaryTableSpec
from detent.units import format_quantity

LEAST_DAMPING = 0.4
"""Damping ratio from which a step is answered with an overshoot of a quarter at most."""

DIAL_RANGE = 600
"""Largest over smallest speed of a dial: 0.1 to 60 deg/s (7)."""

SMALL_ERROR = 0.01
"""Error of a speed by rounding that is not worth a word."""


def find_cautions(spec: RotaryTableSpec) -> Iterator[Caution]:
    """Look a rotary-table axis over."""
    machine = Machine(spec)
    for look in (*FORMS, *_LOOKS):
        yield from look(machine)


# ---------------------------------------------------------------------------------------------------------- loop


def _stability(machine: Machine) -> Iterator[Caution]:
    loop = machine.loop
    damping = loop.damping
    if damping >= LEAST_DAMPING or not machine.spec.method.position_control:
        return
    gain = at_most(loop.largest_gain(LEAST_DAMPING), "").strip('"')
    yield Caution(
        "damping of the loop",
        f"{damping:.3g}",
        f"at least {LEAST_DAMPING:g}",
        "the table overshoots and swings at each stop"
        if machine.is_stable
        else f"the loop is unstable, spectral radius {loop.spectral_radius:.4f}: the table swings more and more",
        either(offer(RotaryTableSpec, "method.position_gain", gain), "make drive.time_constant shorter"),
    )


def _word(machine: Machine) -> Iterator[Caution]:
    spec, most = machine.spec, machine.spec.largest_word
    if not (spec.method.position_control and machine.is_stable):
        return
    needed, peak = machine.word_at(machine.speed), machine.peak_word(machine.speed)
    if peak > most * (1 + BARELY):
        slower = _speed_within(machine, most)
        yield Caution(
            "speed word at limits.speed",
            f"{needed:.4g} counts, {peak:.4g} after an acceleration",
            f"up to {most}, the largest word",
            "the drive does not keep up, and the following error grows for as long as a jog lasts"
            if needed > most
            else "the word is clipped after each acceleration, and the table lags by more than the figures say",
            either(put("limits.speed", at_most(slower, "rad/s")) if slower > 0 else "", "raise drive.full_speed"),
        )


def _speed_within(machine: Machine, word: int) -> float:
    """Largest speed whose word is never above `word` [rad/s]; 0 if there is none."""
    low, high = 0.0, machine.speed
    for _ in range(14):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if machine.peak_word(middle) <= word else (low, middle)
    return low


def _excess_speed(machine: Machine) -> Iterator[Caution]:
    full, most = machine.spec.drive.full_speed, machine.spec.motor.max_speed
    if full > most * (1 + BARELY):
        yield Caution(
            "drive.full_speed",
            format_quantity(full, "rad/s"),
            f"up to motor.max_speed, {format_quantity(most, 'rad/s')}",
            "in a fault the largest word drives the motor faster than it stands",
            put("drive.full_speed", at_most(most, "rad/s")),
        )


def _format(machine: Machine) -> Iterator[Caution]:
    spec, bits = machine.spec, machine.spec.method.fraction_bits
    slow = spec.per_interrupt(machine.speed / DIAL_RANGE)
    words = {f"a dial of limits.speed / {DIAL_RANGE}": slow, "limits.acceleration": spec.acceleration_word}
    words |= {f"position.{number}.speed": spec.per_interrupt(entry.speed) for number, entry in spec.position.items()}
    name, word = min(words.items(), key=lambda entry: entry[1])
    error = 0.5 / word
    if error > SMALL_ERROR:
        more = bits + math.ceil(math.log2(error / SMALL_ERROR))
        yield Caution(
            "method.fraction_bits",
            f"{bits}: {name} is {word:.3g} parts of a count per interrupt",
            f"enough for {0.5 / SMALL_ERROR:g} of them",
            "it is rounded to nothing, and the table stays where it is (test 20)"
            if word < 0.5
            else f"it is rounded to whole ones and wrong by up to {format_quantity(error, '%')} (test 20)",
            offer(RotaryTableSpec, "method.fraction_bits", more) or "use a longer method.strobe_period",
        )


# ------------------------------------------------------------------------------------------------------------- torque


def _torque(machine: Machine) -> Iterator[Caution]:
    spec, effort = machine.spec, machine.spec.limits.effort
    if not (spec.method.position_control and machine.is_stable):
        return
    needed, steady = machine.accelerating_torque, machine.resisting_torque
    if needed > effort * (1 + BARELY):
        lower = spec.limits.acceleration * (effort - steady) / (needed - steady)
        yield Caution(
            "torque of an acceleration",
            format_quantity(needed, "N*m"),
            f"up to limits.effort, {format_quantity(effort, 'N*m')}",
            "the amplifier is at its limit, the table lags and passes its target at the end",
            either(
                offer(RotaryTableSpec, "limits.acceleration", at_most(lower, "rad/s^2")) if lower > 0 else "",
                offer(RotaryTableSpec, "limits.effort", at_least(needed, "N*m")),
            ),
        )


def _effort(machine: Machine) -> Iterator[Caution]:
    spec = machine.spec
    most = 2 * machine.stiffness * spec.drive.full_speed
    if spec.limits.effort > most * (1 + BARELY):
        yield Caution(
            "limits.effort",
            format_quantity(spec.limits.effort, "N*m"),
            f"up to what the amplifier ever asks for, {format_quantity(most, 'N*m')}, reversed from its full speed",
            "the limit never acts",
            put("limits.effort", at_most(most, "N*m")),
        )


def _load(machine: Machine) -> Iterator[Caution]:
    spec, load = machine.spec, machine.spec.disturbance.load
    if load is None:
        return
    torque = abs(load.torque) / spec.ratio
    moving = machine.accelerating_torque if spec.method.position_control and machine.is_stable else 0.0
    needed = torque + max(moving, spec.mechanics.coulomb)
    if needed > spec.limits.effort * (1 + BARELY):
        yield Caution(
            "disturbance.load.torque",
            f"{format_quantity(torque, 'N*m')} at the motor, {format_quantity(needed, 'N*m')} with an acceleration",
            f"up to limits.effort, {format_quantity(spec.limits.effort, 'N*m')}",
            "the table is driven off its place while the load acts"
            if torque > spec.limits.effort + spec.mechanics.coulomb
            else "a table that is moving against the load falls behind",
            offer(RotaryTableSpec, "limits.effort", at_least(needed, "N*m")) or "use a larger mechanics.gear_ratio",
        )


# --------------------------------------------------------------------------------------------------------------- rest


def _static(machine: Machine) -> Iterator[Caution]:
    spec = machine.spec
    if machine.breaking_word > spec.largest_word:
        most = machine.stiffness * spec.drive.full_speed
        yield Caution(
            "static friction",
            format_quantity(spec.mechanics.static, "N*m"),
            f"below the torque of the largest word, {format_quantity(most, 'N*m')}",
            "the table never breaks loose",
            "shorten drive.time_constant or lower mechanics.static",
        )


def _rest(machine: Machine) -> Iterator[Caution]:
    spec, window = machine.spec, machine.spec.method.in_position
    if not spec.method.position_control or machine.breaking_word > spec.largest_word:
        return
    error, noise = machine.resting_error, machine.noise
    if error > window:
        friction = spec.mechanics.static > 0
        yield Caution(
            "deviation at rest",
            f"up to {counted(error)}, {format_quantity(error * spec.count, 'rad')}",
            f"up to method.in_position, {window}",
            f"{'friction' if friction else 'a word that is rounded to 0'} holds the table off its place, and a "
            "positioning does not end",
            either(
                offer(RotaryTableSpec, "method.in_position", error),
                "raise method.position_gain" + (" or lower mechanics.static" if friction else " or drive.word_bits"),
            ),
        )
    elif error + noise > window:
        yield Caution(
            "noise in position",
            f"up to {counted(noise)}, with {error} at rest",
            f"together up to method.in_position, {window}",
            "readings leave the window again and again, and a positioning takes long to end or does not",
            offer(RotaryTableSpec, "method.in_position", error + noise) or "lower detector.fine.noise",
        )


def _stick(machine: Machine) -> Iterator[Caution]:
    spec, mechanics = machine.spec, machine.spec.mechanics
    step = machine.deviation(mechanics.static - mechanics.coulomb) / spec.count
    moves = spec.method.position_control and machine.breaking_word <= spec.largest_word
    if moves and step > max(1, spec.method.in_position):
        lower = (spec.method.in_position or 1) * spec.count * machine.gain * spec.ratio * machine.stiffness
        yield Caution(
            "stick-slip",
            f"{step:.4g} counts of deviation more to break loose than to move on",
            f"up to {max(1, spec.method.in_position)}",
            "at a slow jog the table stands, breaks loose and stands again",
            either(put("mechanics.static", at_most(mechanics.coulomb + lower, "N*m")), "raise method.position_gain"),
        )


def _way_round(machine: Machine) -> Iterator[Caution]:
    spec = machine.spec
    numbers = [number for number, entry in spec.position.items() if entry.direction in {"positive", "negative"}]
    counts = spec.method.in_position + machine.noise
    if numbers and spec.method.form == "turn counter" and round(spec.method.short_way / spec.count) < counts:
        yield Caution(
            "method.short_way",
            format_quantity(spec.method.short_way, "rad"),
            f"at least {counted(counts)}, {format_quantity(counts * spec.count, 'rad')}, what is in position, where a "
            f"position has a direction: {', '.join(numbers)}",
            "a table that stands beyond its target by a count goes round a whole turn when it is sent there again",
            offer(RotaryTableSpec, "method.short_way", at_least(counts * spec.count, "rad")) or "lower in_position",
        )


# ----------------------------------------------------------------------------------------------------------- detector


def _composition(machine: Machine) -> Iterator[Caution]:
    spec = machine.spec
    turn = format_quantity(FULL_TURN / spec.ratio, "rad")
    if spec.detector.composition == "truncated":
        yield Caution(
            "detector.composition",
            '"truncated"',
            '"rounded"',
            f"near each zero of the fine word the angle is wrong by a motor turn, {turn} (3.1, test 2)",
            put("detector.composition", '"rounded"'),
        )
    errors, allowed = machine.coarse_errors, machine.allowed_coarse_error
    total = sum(errors.values())
    if total > allowed:
        parts = ", ".join(f"{name} {format_quantity(error, 'rad')}" for name, error in errors.items())
        yield Caution(
            "coarse error",
            f"up to {format_quantity(total, 'rad')}: {parts}",
            f"up to {format_quantity(allowed, 'rad')}, half a motor turn less a count",
            f"at some angles the table reads a motor turn too much or too little, {turn}, and jumps (3.1, trap 7)",
            f"improve the largest, {max(errors, key=lambda name: errors[name])}, or choose a smaller "
            "mechanics.gear_ratio",
        )


_LOOKS: tuple[Callable[[Machine], Iterator[Caution]], ...] = (
    _stability,
    _word,
    _excess_speed,
    _format,
    _torque,
    _effort,
    _load,
    _static,
    _rest,
    _stick,
    _way_round,
    _composition,
)
