"""What must hold between keys of the rotary-table method.

As in the print head's rules, a rule is reported at the first of its keys that the file states, and a remedy names the
nearest value that would do. Sections are those of the rotary-table specification.

Two things are allowed that one might expect here. The task's period need not be a whole multiple of the strobe's: they
are clocks of their own, nothing in the equations needs it, and a ratio between is how the race of trap 3 comes now and
then. A conversion need not end within the interrupt's delay: the comparators run freely, one result in each period of
the excitation, and a strobe takes the last; what it does need is a new one.
"""

import math
from collections.abc import Callable, Iterator

from detent.files.findings import Contradiction
from detent.files.nearest import BARELY, at_least, at_most, either, offer, put
from detent.methods.rotary_table.derive import FULL_TURN, Machine, weakest_output
from detent.methods.rotary_table.schema import FineTable, RotaryTableSpec
from detent.units import format_quantity

TICK = 1e-4
"""Base tick [s] (`systems.rotary_table`)."""

LONGEST_WAY = 1 << 31
"""Ways are shorter: IR has 32 bits before its point [count] (`control.table_positioner`)."""

FASTEST_WORD = (1 << 31) - 1
"""Largest speed in the interpolator's format: its square is taken in 64 bits (`control.angle_interpolator`)."""

HIGHEST_OFFSET = 0.95
"""Share of a resolver's weakest output that the comparator's offset may reach: beyond it hardly crosses at all."""


def _ticks(seconds: float) -> int:
    return round(seconds / TICK)


def _time(ticks: int) -> str:
    return f'"{format_quantity(ticks * TICK, "s", digits=9)}"'


# ----------------------------------------------------------------------------------------------- gear and detector


def _whole_ratio(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    if spec.mechanics.gear_ratio != spec.ratio:
        yield Contradiction(
            ("mechanics.gear_ratio",),
            "a whole number: after a turn of the table the fine resolver must stand where it began (3.1)",
            offer(RotaryTableSpec, "mechanics.gear_ratio", spec.ratio),
        )


def _reduction(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    reduction = spec.detector.coarse.reduction
    if reduction not in {spec.ratio, spec.mechanics.gear_ratio}:
        yield Contradiction(
            ("detector.coarse.reduction", "mechanics.gear_ratio"),
            f"equal to mechanics.gear_ratio, {spec.mechanics.gear_ratio:g}: the coarse resolver turns with the table",
            either(
                offer(RotaryTableSpec, "detector.coarse.reduction", spec.ratio),
                "leave it out: it is then mechanics.gear_ratio",
            ),
        )


def _period(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    if 2 * spec.period >= LONGEST_WAY:
        yield Contradiction(
            ("detector.fine.counts", "mechanics.gear_ratio"),
            f"such that T = G x fine counts, here {spec.period}, is below 2^30: a jog begins with 2 T to go, and the "
            "remaining angle has 32 bits before its point",
            offer(RotaryTableSpec, "detector.fine.counts", (LONGEST_WAY // 2 - 1) // spec.ratio),
        )


def _coarse_counts(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    if Machine(spec).allowed_coarse_error <= 0:
        # 1/(2 G) > 1/C + 1/(G F), times G
        least = math.floor(spec.ratio / (0.5 - 1 / spec.detector.fine.counts) * (1 + BARELY)) + 1
        yield Contradiction(
            ("detector.coarse.counts", "mechanics.gear_ratio", "detector.fine.counts"),
            f"at least {least}: a count of the coarse word is then less than half a motor turn (3.1)",
            offer(RotaryTableSpec, "detector.coarse.counts", least) or "choose a smaller mechanics.gear_ratio",
        )


def _conversion(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    detector, strobe = spec.detector, spec.method.strobe_period
    name, counts = max((("fine", detector.fine.counts), ("coarse", detector.coarse.counts)), key=lambda entry: entry[1])
    if counts / detector.clock > strobe * (1 + BARELY):
        yield Contradiction(
            ("detector.clock", f"detector.{name}.counts", "method.strobe_period"),
            f"at least {format_quantity(counts / strobe, 'Hz')}: a conversion of {counts} clocks, here "
            f"{format_quantity(counts / detector.clock, 's')}, ends in each strobe period, "
            f"{format_quantity(strobe, 's')}",
            offer(RotaryTableSpec, "detector.clock", at_least(counts / strobe, "Hz")),
        )


def _comparators(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    tables: dict[str, FineTable] = {"fine": spec.detector.fine, "coarse": spec.detector.coarse}
    for name, table in tables.items():
        key, most = f"detector.{name}.offset_error", HIGHEST_OFFSET * weakest_output(table)
        if abs(table.offset_error) > most:
            nearest = at_most(most, "%")
            yield Contradiction(
                (key, f"detector.{name}.gain_error", f"detector.{name}.quadrature_error"),
                f"up to {format_quantity(most, '%')} in magnitude: where the windings give least, the comparator "
                "would see no zero crossing",
                put(key, nearest.replace('"', '"-', 1) if table.offset_error < 0 else nearest),
            )


# --------------------------------------------------------------------------------------------------------- clocks


def _whole_ticks(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    method = spec.method
    least = {"strobe_period": 2, "interrupt_delay": 1, "task_period": 2, "task_phase": 0}
    for name, fewest in least.items():
        ticks = float(getattr(method, name)) / TICK
        if abs(ticks - round(ticks)) > 1e-6:
            key = f"method.{name}"
            yield Contradiction(
                (key,),
                "a whole number of 0.1 ms, the base tick",
                offer(RotaryTableSpec, key, _time(max(fewest, round(ticks)))),
            )


def _delay(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    strobe, delay = _ticks(spec.method.strobe_period), _ticks(spec.method.interrupt_delay)
    if delay >= strobe:
        yield Contradiction(
            ("method.interrupt_delay", "method.strobe_period"),
            f"below method.strobe_period, {format_quantity(spec.method.strobe_period, 's')}: each interrupt comes "
            "before the next strobe",
            either(
                offer(RotaryTableSpec, "method.interrupt_delay", _time(strobe - 1)),
                offer(RotaryTableSpec, "method.strobe_period", _time(delay + 1)),
            ),
        )


def _task(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    strobe, task = _ticks(spec.method.strobe_period), _ticks(spec.method.task_period)
    if task < strobe:
        yield Contradiction(
            ("method.task_period", "method.strobe_period"),
            f"at least method.strobe_period, {format_quantity(spec.method.strobe_period, 's')}: two passes of the task "
            "would judge the same angle, and roll over twice",
            either(
                offer(RotaryTableSpec, "method.task_period", _time(strobe)),
                offer(RotaryTableSpec, "method.strobe_period", _time(task)),
            ),
        )


def _crossing(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    method, fastest = spec.method, spec.drive.full_speed / spec.ratio
    way = fastest * method.strobe_period
    if way >= math.pi:
        # Strictly less than half a turn, in whole ticks, and still longer than the delay.
        ticks = math.ceil(math.pi / fastest / TICK * (1 - BARELY)) - 1
        slower = math.pi / method.strobe_period * spec.ratio * (1 - BARELY)
        yield Contradiction(
            ("method.strobe_period", "drive.full_speed", "motor.max_speed", "mechanics.gear_ratio"),
            f"such that the table turns less than 180 deg in it, here {format_quantity(way, 'rad')} at the largest "
            "word: a change of more than T/2 is taken for a crossing of the boundary (3.3)",
            either(
                put("method.strobe_period", _time(ticks)) if ticks > max(1, _ticks(method.interrupt_delay)) else "",
                offer(RotaryTableSpec, "drive.full_speed", at_most(slower, "rad/s")),
            ),
        )


# ---------------------------------------------------------------------------------------------------------- speeds


def _largest_speed(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    speed, most = spec.limits.speed, spec.largest_speed
    if speed > most * (1 + BARELY):
        which = "motor.max_speed" if spec.motor.max_speed <= spec.drive.full_speed else "drive.full_speed"
        yield Contradiction(
            ("limits.speed", "motor.max_speed", "drive.full_speed", "mechanics.gear_ratio"),
            f"up to {which} over the gear ratio, {format_quantity(most, 'rad/s')}",
            either(
                offer(RotaryTableSpec, "limits.speed", at_most(most, "rad/s")),
                f"use a faster drive: {which} of {format_quantity(speed * spec.ratio, 'rad/s')}",
            ),
        )


def _parts(spec: RotaryTableSpec) -> str:
    bits = spec.method.fraction_bits
    return f"whole 2^-{bits} counts" if bits else "whole counts"


def _slow_speeds(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    top, least = spec.limits.speed, 1 / spec.per_interrupt(1.0)
    speeds = {"limits.speed": top}
    # A speed that was left out is that of the limit.
    speeds |= {f"position.{number}.speed": entry.speed for number, entry in spec.position.items() if entry.speed != top}
    for key, speed in speeds.items():
        if speed < least * (1 - BARELY):
            bits = spec.method.fraction_bits + math.ceil(math.log2(least / speed))
            yield Contradiction(
                (key, "method.fraction_bits", "method.strobe_period", "detector.fine.counts"),
                f"at least {format_quantity(least, 'rad/s')}: the interpolator moves on by {_parts(spec)} in an "
                "interrupt",
                either(
                    offer(RotaryTableSpec, key, at_least(least, "rad/s")),
                    offer(RotaryTableSpec, "method.fraction_bits", bits),
                )
                or "lengthen method.strobe_period",
            )


def _fast_words(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    word, bits = spec.per_interrupt(spec.limits.speed), spec.method.fraction_bits
    if word > FASTEST_WORD:
        fewer = bits - math.ceil(math.log2(word / FASTEST_WORD) * (1 + BARELY))
        yield Contradiction(
            ("method.fraction_bits", "limits.speed", "method.strobe_period", "detector.fine.counts"),
            f"such that limits.speed, here {word:.4g} parts of a count per interrupt, is a word of 32 bits",
            either(
                offer(RotaryTableSpec, "method.fraction_bits", fewer),
                offer(RotaryTableSpec, "limits.speed", at_most(spec.limits.speed * FASTEST_WORD / word, "rad/s")),
            ),
        )


def _acceleration(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    acceleration, least = spec.limits.acceleration, spec.limits.acceleration / spec.acceleration_word
    if acceleration < least * (1 - BARELY):
        bits = spec.method.fraction_bits + math.ceil(math.log2(least / acceleration))
        yield Contradiction(
            ("limits.acceleration", "method.fraction_bits", "method.strobe_period", "detector.fine.counts"),
            f"at least {format_quantity(least, 'rad/s^2')}: the interpolator's speed grows by {_parts(spec)} per "
            "interrupt from one interrupt to the next",
            either(
                offer(RotaryTableSpec, "limits.acceleration", at_least(least, "rad/s^2")),
                offer(RotaryTableSpec, "method.fraction_bits", bits),
            )
            or "lengthen method.strobe_period",
        )


def _braking(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    machine, speed, acceleration = Machine(spec), spec.limits.speed, spec.limits.acceleration
    way, reserve = speed**2 / (2 * acceleration), machine.jog_reserve_at(speed)
    if way >= FULL_TURN - reserve:
        harder = speed**2 / (2 * (FULL_TURN - reserve)) * (1 + BARELY) if reserve < FULL_TURN else math.inf
        slower = _braking_speed(machine)
        yield Contradiction(
            ("limits.acceleration", "limits.speed", "method.task_period", "method.position_gain", "method.judge"),
            f"such that braking, here over {format_quantity(way, 'rad')}, takes less than a turn less the "
            f"{format_quantity(reserve, 'rad')} by which a rollover comes late: a jog would brake before it",
            either(
                offer(RotaryTableSpec, "limits.acceleration", at_least(harder, "rad/s^2")) if harder < 1e9 else "",
                offer(RotaryTableSpec, "limits.speed", at_most(slower, "rad/s")) if slower > 0 else "",
            )
            or "raise method.position_gain",
        )


def _braking_speed(machine: Machine) -> float:
    """Speed from which braking and what a rollover comes late take a turn [rad/s]; negative if there is none."""
    acceleration, at_rest = machine.spec.limits.acceleration, machine.jog_reserve_at(0.0)
    late = machine.jog_reserve_at(1.0) - at_rest
    root = late**2 + 2 * (FULL_TURN - at_rest) / acceleration
    return acceleration * (math.sqrt(max(0.0, root)) - late) * (1 - BARELY)


# ------------------------------------------------------------------------------------------------------- positions


def _position_speeds(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    most = spec.limits.speed
    for number, entry in spec.position.items():
        if entry.speed > most * (1 + BARELY):
            key = f"position.{number}.speed"
            yield Contradiction(
                (key, "limits.speed"),
                f"up to limits.speed, {format_quantity(most, 'rad/s')}",
                either(put(key, at_most(most, "rad/s")), "correct limits.speed"),
            )


def _directions(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    others = [number for number, entry in spec.position.items() if entry.direction != "as commanded"]
    if spec.method.form == "turn counter" or not others:
        return
    keys = [f"position.{number}.direction" for number in others]
    each = put(keys[0], '"as commanded"') if len(others) == 1 else 'write direction = "as commanded" in each of them'
    yield Contradiction(
        ("method.form", *keys),
        f'"turn counter" where a position has a direction or a shortest way: position {", ".join(others)}; without the '
        'counter a positioning ends at the boundary, and an angle is gone to "as commanded" (3.6)',
        either(put("method.form", '"turn counter"'), each),
    )


def _ways(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    most = LONGEST_WAY - spec.period
    if most < spec.period:  # another rule's matter
        return
    for number, entry in spec.position.items():
        if entry.direction == "as commanded" and abs(entry.angle) / spec.count >= most:
            key, nearest = f"position.{number}.angle", at_most((most - 1) * spec.count * (1 - BARELY), "rad")
            yield Contradiction(
                (key, "detector.fine.counts", "mechanics.gear_ratio"),
                f"less than {format_quantity(most * spec.count, 'rad')} from 0: from any angle of the turn the way has "
                "fewer than 2^31 counts, which the remaining angle holds",
                put(key, nearest.replace('"', '"-', 1) if entry.angle < 0 else nearest),
            )


def _window(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    most = (spec.period - 1) // 2
    if spec.method.in_position > most:
        yield Contradiction(
            ("method.in_position", "mechanics.gear_ratio", "detector.fine.counts"),
            f"below half a turn, up to {most} counts",
            offer(RotaryTableSpec, "method.in_position", most),
        )


# --------------------------------------------------------------------------------------------------------- machine


def _friction(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    static, coulomb = spec.mechanics.static, spec.mechanics.coulomb
    if static < coulomb:
        yield Contradiction(
            ("mechanics.static", "mechanics.coulomb"),
            f"at least the Coulomb friction, {format_quantity(coulomb, 'N*m')}",
            either(put("mechanics.static", at_least(coulomb, "N*m")), "leave it out: it is then 1.15 x coulomb"),
        )


def _effort(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    static = spec.mechanics.static
    if spec.limits.effort <= static:
        yield Contradiction(
            ("limits.effort", "mechanics.static", "mechanics.coulomb"),
            f"above mechanics.static, {format_quantity(static, 'N*m')}: the motor never breaks loose",
            offer(RotaryTableSpec, "limits.effort", at_least(static * (1 + BARELY), "N*m")) or "lower mechanics.static",
        )


def _load(spec: RotaryTableSpec) -> Iterator[Contradiction]:
    load = spec.disturbance.load
    if load is not None and load.duration < TICK * (1 - BARELY):
        yield Contradiction(
            ("disturbance.load.duration",),
            f"at least a base tick, {format_quantity(TICK, 's')}",
            put("disturbance.load.duration", at_least(TICK, "s")),
        )


RULES: tuple[Callable[[RotaryTableSpec], Iterator[Contradiction]], ...] = (
    _whole_ratio,
    _reduction,
    _period,
    _coarse_counts,
    _conversion,
    _comparators,
    _whole_ticks,
    _delay,
    _task,
    _crossing,
    _largest_speed,
    _slow_speeds,
    _fast_words,
    _acceleration,
    _braking,
    _position_speeds,
    _directions,
    _ways,
    _window,
    _friction,
    _effort,
    _load,
)
"""The rules, in the order in which their contradictions are told."""
