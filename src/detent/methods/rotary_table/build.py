"""From a checked specification to the parameters of the rotary table: SI values to counts, words and ticks."""

import math

from detent.axisfile.blocks import fill_guard, samples
from detent.control import table_positioner as codes
from detent.kernel.turn_table import FRACTION, TURN
from detent.methods.rotary_table.controller import TableControllerParams
from detent.methods.rotary_table.schema import CoarseTable, FineTable, MechanicsTable, RotaryTableSpec
from detent.methods.rotary_table.system import TICK, RotaryTableParams
from detent.plant.gearing import GearParams, fill_eccentricity
from detent.plant.rotary_motor import fill_motor
from detent.sensing.resolver_counter import ResolverParams, fill_resolver

GUARD_PERIOD = 20e-3  # time between two looks of the guard [s]; a strobe period where that is longer
FORMS = {"turn counter": codes.TURN_COUNTER, "flag": codes.FLAG, "raw": codes.RAW}
JUDGES = {"theoretical": codes.BY_THEORETICAL, "actual": codes.BY_ACTUAL}
UPDATES = {"atomic": codes.ATOMIC, "flag first": codes.FLAG_FIRST, "remaining first": codes.REMAINING_FIRST}
DIRECTIONS = {
    "shortest": codes.SHORTEST, "positive": codes.POSITIVE, "negative": codes.NEGATIVE,
    "as commanded": codes.AS_COMMANDED,
}  # fmt: skip


def build_rotary_table(spec: RotaryTableSpec) -> RotaryTableParams:
    """Parameters of the rotary table."""
    p, method = RotaryTableParams(), spec.method
    clocks, load = p.controller.clocks, spec.disturbance.load
    clocks.strobe_ticks, clocks.delay_ticks = ticks(method.strobe_period), ticks(method.interrupt_delay)
    clocks.task_ticks = ticks(method.task_period)
    _fill_detector(p, spec)
    _fill_positioner(p, spec)
    _fill_guard(p.controller, spec)
    _fill_machine(p, spec)
    if load is not None:
        p.plant.train.load.torque = load.torque / spec.ratio
        p.plant.train.load.begin, p.plant.train.load.end = ticks(load.at), ticks(load.at) + ticks(load.duration)
    return p


def ticks(seconds: float) -> int:
    """A time in base ticks."""
    return round(seconds / TICK)


def start_turns(spec: RotaryTableSpec) -> float:
    """Motor angle at power-on [turn]: in the middle of the count that `mechanics.start_angle` lies in.

    On the border of two counts rounding alone would decide which of them is read.
    """
    counts = math.floor(spec.mechanics.start_angle / spec.count + 1e-6)
    return (counts + 0.5) / spec.detector.fine.counts


def _phase(angle: float) -> int:
    """An angle [rad] as a phase [turn/2^32]."""
    return round(angle / (2 * math.pi) * TURN) & FRACTION


def _word(angle: float, counts: int) -> int:
    """Word of a comparator at an electrical angle [rad]."""
    return (_phase(angle) * counts) >> 32


def _fill_detector(p: RotaryTableParams, spec: RotaryTableSpec) -> None:
    fine, coarse = spec.detector.fine, spec.detector.coarse
    resolvers: tuple[tuple[ResolverParams, FineTable], ...] = ((p.plant.fine, fine), (p.plant.coarse, coarse))
    for resolver, table in resolvers:
        resolver.counts, resolver.offset = table.counts, _phase(table.mounting)
        resolver.noise = table.noise / (2 * math.pi) * TURN
        if table.gain_error or table.quadrature_error or table.offset_error:
            fill_resolver(resolver, table.gain_error, table.quadrature_error, table.offset_error)
    p.plant.coarse.offset = _phase(coarse.mounting + coarse.alignment_error)
    c = p.controller.composition
    c.ratio, c.fine, c.coarse = spec.ratio, fine.counts, coarse.counts
    c.fine_zero, c.coarse_zero = _word(fine.mounting, fine.counts), _word(coarse.mounting, coarse.counts)
    c.truncating = spec.detector.composition == "truncated"


def _fill_positioner(p: RotaryTableParams, spec: RotaryTableSpec) -> None:
    q, method = p.controller.positioner, spec.method
    one = 1 << method.fraction_bits
    q.angle.period, q.angle.form = spec.period, FORMS[method.form]
    q.interpolator.fraction = method.fraction_bits
    q.interpolator.acceleration = round(spec.acceleration_word)
    q.interpolator.max_speed = round(spec.per_interrupt(spec.limits.speed))
    q.gain = method.position_gain * spec.count / one / spec.speed_per_word
    q.speed_gain = spec.count / one / method.strobe_period / spec.speed_per_word
    q.max_word = spec.largest_word
    q.window = method.in_position
    q.window_interrupts = max(1, round(method.in_position_time / method.strobe_period))
    q.judge, q.update = JUDGES[method.judge], UPDATES[method.update]
    q.inclusive, q.guarded = method.inclusive, method.guarded
    q.unsigned_remaining, q.open_loop = not method.signed_remaining, not method.position_control
    pdt = q.pdt
    for name, entry in spec.position.items():
        number = int(name)
        pdt.angle[number] = round(entry.angle / spec.count)
        pdt.speed[number] = round(spec.per_interrupt(entry.speed))
        pdt.policy[number] = DIRECTIONS[entry.direction]
        pdt.entries = max(pdt.entries, number + 1)
    pdt.tolerance = round(method.short_way / spec.count)


def _fill_guard(c: TableControllerParams, spec: RotaryTableSpec) -> None:
    protection, strobe = spec.protection, spec.method.strobe_period
    c.look_interrupts = max(1, round(GUARD_PERIOD / strobe))
    look = c.look_interrupts * strobe
    fill_guard(c.guard, protection, sample=look, speed=(spec.limits.speed + spec.breaking_speed) / spec.count)
    # Without position control the deviation says nothing.
    c.guard.following = samples(protection.following_time, look) if spec.method.position_control else 0
    c.following = round(protection.following_error / spec.count * (1 << spec.method.fraction_bits))
    c.breaking = math.ceil(protection.stuck_effort * spec.largest_word)
    noise = 2 * math.ceil(spec.detector.fine.noise / math.tau * spec.detector.fine.counts)
    c.guard.speed += noise if c.guard.speed else 0
    c.guard.jump += noise if c.guard.jump else 0


def _fill_machine(p: RotaryTableParams, spec: RotaryTableSpec) -> None:
    a, m, mechanics = p.plant.amplifier, p.plant.train.motor, spec.mechanics
    a.stiffness, a.max_torque = spec.stiffness, spec.limits.effort
    a.speed_per_count = spec.speed_per_word * spec.ratio
    m.inertia, m.viscous, m.period = spec.inertia, spec.viscous, TICK
    m.coulomb, m.static = mechanics.coulomb, mechanics.static
    fill_motor(m, a.stiffness)
    gears: tuple[tuple[GearParams, MechanicsTable | CoarseTable], ...] = (
        (p.plant.train.gear, mechanics), (p.plant.train.reduction, spec.detector.coarse)
    )  # fmt: skip
    for gear, table in gears:  # whose faults are stated at its output [rad]
        gear.ratio, gear.half_backlash = spec.ratio, 0.5 * table.backlash * spec.ratio
        if table.eccentricity:
            fill_eccentricity(gear, table.eccentricity, table.eccentricity_angle)
