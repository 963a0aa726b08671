"""What is checked in a print-head axis: contradictions between its keys, and cautions about what will surprise.

Sections in brackets are those of the print-head specification.
"""

import math
from collections.abc import Callable, Iterator

from detent.axisfile import common_checks as common
from detent.control.head_computer import LOWEST_FAST_PASS, SLOWEST_PASS
from detent.files.findings import Caution, Contradiction, wrong
from detent.files.nearest import Remedies
from detent.files.quantities import INCH
from detent.methods.print_head.derive import DIRECTIONS, HeadFigures
from detent.methods.print_head.schema import EMITTER, SPEED_STEP, PrintHeadSpec, speed_value
from detent.units import format_quantity as text

MAX_EMITTERS = 65535  # largest position the axis computer can hold (16 bits, 3.1)
MIN_TRAVEL = 1200 * EMITTER  # shortest way on which calibration passes at 40 in/s start, are measured and stop (3.3)
FASTEST = 1e9  # largest sum of the machine's rates [1/s]: a PWM period then takes 160 000 steps to prepare
PULLEY_TOLERANCE = 1e-3  # how far one encoder cycle may be from 1/300 in, relative
PWM_PERIOD = 40e-6  # one PWM period [s] (2.3)
ASSUMED_ACCELERATION = 600 * INCH  # acceleration the method's equations assume [m/s^2] (eq. 6)
RAMP_INTERVAL_RANGE = (350e-6, 450e-6)  # usual ramp interval [s] (3.10)
EXACT_FAST_PASS = 180  # speed value, 30 in/s, from which the identification keeps the tolerance of the specification
WINDOW_ERROR = 1.5  # speed values that both passes may miss their difference by: a whole emitter and half of one
CREEPING = 60 / SLOWEST_PASS  # speed value below which the slow pass is given up

remedy = Remedies(PrintHeadSpec)


# ---- contradictions


def _machine(spec: PrintHeadSpec) -> Iterator[Contradiction]:
    """Supply, encoder and travel are those the method's equations assume."""
    supply, drifted, travel = spec.drive.supply, spec.disturbance.supply, spec.limits.travel
    circumference, cycles = spec.mechanics.pulley_circumference, spec.encoder.cycles_per_revolution
    longest = MAX_EMITTERS * EMITTER
    if spec.limits.effort > supply:
        allowed = f"up to drive.supply, {text(supply, 'V')}"
        yield wrong("limits.effort drive.supply", allowed, "lower limits.effort or raise drive.supply")
    if abs(circumference / cycles / EMITTER - 1) > PULLEY_TOLERANCE:
        yield wrong(
            "encoder.cycles_per_revolution mechanics.pulley_circumference",
            "1/300 in of head travel per encoder cycle, within 0.1 %: the method's equations assume it "
            f"(here {text(circumference / cycles, 'm')} instead of {text(EMITTER, 'm')})",
            f"use {max(1, round(circumference / EMITTER))} cycles with this pulley, or a circumference of "
            f"{text(cycles * EMITTER, 'm', digits=6)} with this encoder",
        )
    if not MIN_TRAVEL <= travel <= longest:
        yield wrong(
            "limits.travel",
            f"a length from {text(MIN_TRAVEL, 'm')} (calibration passes at 40 in/s need it) to {text(longest, 'm')} "
            "(positions have 16 bits)",
            "correct limits.travel; this method suits carriages of that range",
        )
    if not math.isclose(drifted, supply) and not 0.5 * supply <= drifted <= 2 * supply:
        allowed = f"half to twice drive.supply: {text(0.5 * supply, 'V')} to {text(2 * supply, 'V')}"
        yield wrong(
            "disturbance.supply drive.supply",
            allowed,
            "correct disturbance.supply: it models a drift, not a different supply",
        )


def _inside_limits(spec: PrintHeadSpec) -> Iterator[Contradiction]:
    """Speeds and places are within the limits."""
    limit, travel, obstacle = spec.limits.speed, spec.limits.travel, spec.disturbance.obstacle
    speeds = {"method.max_print_speed": spec.method.max_print_speed, "homing.speed": spec.homing.speed}
    for key, speed in speeds.items():
        if speed > limit:
            allowed = f"up to limits.speed, {text(limit, 'm/s')} ({limit / INCH:.4g} in/s)"
            yield wrong(f"{key} limits.speed", allowed, f"lower {key} or raise limits.speed")
    positions = {
        "mechanics.start_position": spec.mechanics.start_position,
        "print.left_margin": spec.printing.left_margin,
        "homing.width_tolerance": spec.homing.width_tolerance,
    }
    if obstacle is not None:
        positions["disturbance.obstacle.position"] = obstacle.position
    for key, position in positions.items():
        if position >= travel:
            allowed = f"below limits.travel, {text(travel, 'm')} ({travel / INCH:.4g} in)"
            yield wrong(f"{key} limits.travel", allowed, f"lower {key} or correct limits.travel")


def _identified(spec: PrintHeadSpec) -> Iterator[Contradiction]:
    """The defaults are within what the axis computer takes for plausible."""
    method, low, high = spec.method, spec.method.slope_min, spec.method.slope_max
    friction, most = method.default_friction_counts, method.friction_max_counts
    if low >= high:
        allowed = f"below method.slope_max, {high}"
        yield wrong("method.slope_min method.slope_max", allowed, "lower method.slope_min or raise method.slope_max")
    elif not low <= method.default_slope <= high:
        yield wrong(
            "method.default_slope method.slope_min method.slope_max",
            f"from method.slope_min, {low}, to method.slope_max, {high}",
            "choose a default slope that the axis computer itself would accept as plausible",
        )
    if friction > most:
        yield wrong(
            "method.default_friction_counts method.friction_max_counts",
            f"up to method.friction_max_counts, {most}",
            remedy.most("method.default_friction_counts", most),
        )


def _homing(spec: PrintHeadSpec) -> Iterator[Contradiction]:
    """A frame is noticed: no emitter while |V| >= Vf + 20 (3.2), after the zero-speed time."""
    lowest, zero_speed = spec.method.default_friction_counts + 20, spec.method.zero_speed_timeout
    if spec.homing.drive_limit_counts < lowest:
        yield wrong(
            "homing.drive_limit_counts method.default_friction_counts",
            f"at least method.default_friction_counts + 20 = {lowest}: contact with a frame is seen above it",
            remedy.least("homing.drive_limit_counts", lowest, "lower method.default_friction_counts"),
        )
    if spec.homing.contact_timeout <= zero_speed:
        yield wrong(
            "homing.contact_timeout method.zero_speed_timeout",
            f"longer than method.zero_speed_timeout, {text(zero_speed, 's')}",
            "raise homing.contact_timeout: contact can be detected only at standstill",
        )


def _simulated(spec: PrintHeadSpec) -> Iterator[Contradiction]:
    """Motor and friction can be simulated, with their drifts."""
    m, drifts = HeadFigures(spec), spec.disturbance
    drift = (1 + drifts.motor_constant) * (1 + max(drifts.friction_right, drifts.friction_left))
    coupling = m.force_per_ampere * m.volts_per_speed / m.mass
    plant = common.Plant(m.resistance, spec.motor.inductance, coupling, m.mass / max(1.0, drift))
    yield from common.static_friction(common.sides(spec.mechanics.friction))
    yield from common.time_constants(plant, spec.mechanics.friction, FASTEST)


Rule = Callable[[PrintHeadSpec], Iterator[Contradiction]]
RULES: tuple[Rule, ...] = (_machine, _inside_limits, _identified, _homing, _simulated)
"""Contradictions are reported in this order."""


# ---- cautions


def find_cautions(spec: PrintHeadSpec) -> Iterator[Caution]:
    """Look a print-head axis over."""
    machine = HeadFigures(spec)
    for look in (_headroom, _identification, _calibration, _ramp, _breaking_loose, _motor):
        yield from look(machine)


def _headroom(m: HeadFigures) -> Iterator[Caution]:
    """The drive has counts left to accelerate with at the top speed."""
    ir_counts = m.spec.method.ir_counts
    for direction in DIRECTIONS:
        needed = m.steady_counts(m.top_speed, direction) + ir_counts
        if needed > m.max_counts:
            fitting = m.open_loop_speed(m.max_counts - ir_counts, direction) * SPEED_STEP
            yield Caution(
                f"drive at top speed, {direction}",
                f"{needed:.4g} counts",
                f"up to {m.max_counts:.4g} counts (limits.effort)",
                f"the head accelerates more slowly above {text(fitting, 'm/s')} ({fitting / INCH:.3g} in/s)",
                "lower limits.speed to that, or raise the supply",
            )


def _identification(m: HeadFigures) -> Iterator[Caution]:
    """The axis computer takes the true constants for plausible."""
    method = m.spec.method
    for name, values, low, high, unit in (
        ("slope K", m.slope, method.slope_min, method.slope_max, "/256"),
        ("friction", m.coulomb_counts, 0, method.friction_max_counts, " counts"),
    ):
        for direction in DIRECTIONS:
            if not low <= values[direction] <= high:
                yield Caution(
                    f"{name}, {direction}",
                    f"{values[direction]:.4g}{unit}",
                    f"{low} to {high}{unit}",
                    "the axis computer will call its own calibration implausible (SB1 10) and keep the defaults",
                    "choose a motor, pulley or supply that suits the method, or widen its limits in [method]",
                )


def _calibration(m: HeadFigures) -> Iterator[Caution]:
    """Both calibration passes can be made, and told apart."""
    method, top = m.spec.method, m.top_speed
    drives = {speed: (method.default_slope * speed >> 8) + method.default_friction_counts for speed in (top, 60)}
    if top < LOWEST_FAST_PASS:
        yield Caution(
            "identification",
            f"fast pass at {top / 6:.3g} in/s beside the slow one at 10 in/s",
            f"limits.speed of {LOWEST_FAST_PASS / 6:.3g} in/s or more",
            "two passes so close cannot tell slope from friction, and the power-on values stay in use",
            "raise limits.speed",
        )
    elif top < EXACT_FAST_PASS:
        off = WINDOW_ERROR * max(m.slope.values()) / (top - 60)
        yield Caution(
            "tolerance of the identification",
            f"slope K within {off:.2g} of 256, measured by passes at {top / 6:.3g} and 10 in/s",
            f"within 2.5, as from limits.speed of {EXACT_FAST_PASS / 6:.3g} in/s on",
            "speeds are counted in whole emitters, and extrapolating from two close points amplifies the rounding",
            "raise limits.speed, or count on a drive that the trim has to correct by more",
        )
    for direction in DIRECTIONS:
        slow, fast = (m.open_loop_speed(drives[speed], direction) for speed in (60, top))
        if slow <= CREEPING:
            yield Caution(
                f"slow calibration pass, {direction}",
                f"{slow / 6:.2g} in/s at {drives[60]} counts",
                f"above {CREEPING / 6:.2g} in/s",
                "friction stops the head or lets it creep: the calibration fails, or the power-on values stay in use",
                f"lower mechanics.friction.{direction}, or raise method.default_friction_counts",
            )
        if fast > 1.1 * top:
            yield Caution(
                f"fast calibration pass, {direction}",
                f"{fast / 6:.3g} in/s at {drives[top]} counts",
                f"up to limits.speed, {top / 6:.3g} in/s",
                "the first pass after power-on runs faster than the axis may",
                "choose a motor with a larger constant or a smaller pulley, or lower method.default_slope",
            )


def _ramp(m: HeadFigures) -> Iterator[Caution]:
    """Ramp and acceleration are those the method assumes."""
    (low, high), interval, ratio = RAMP_INTERVAL_RANGE, m.ramp_interval, m.acceleration / ASSUMED_ACCELERATION
    if not low <= interval <= high:
        yield Caution(
            "ramp interval at top speed",
            text(interval, "s"),
            f"{text(low, 's')} to {text(high, 's')}",
            f"the motor's back-EMF is {'weak' if interval > high else 'strong'} for this supply: profiles have few, "
            "coarse steps or the drive saturates",
            "choose a motor, pulley or supply that gives a slope K from 158 to 203, or method.span that suits it",
        )
    if not 0.85 <= ratio <= 1.15:
        yield Caution(
            "acceleration from the IR counts",
            f"{m.acceleration / INCH:.4g} in/s^2",
            "600 in/s^2 within 15 %",
            f"stops are {'shorter' if ratio > 1 else 'longer'} than the method predicts",
            remedy.exactly("method.ir_counts", m.spec.method.ir_counts / ratio, "change the moving mass"),
        )


def _breaking_loose(m: HeadFigures) -> Iterator[Caution]:
    """The drive of a start and that of homing move the head."""
    method, homing = m.spec.method, m.spec.homing
    speed = speed_value(homing.speed)
    for direction in DIRECTIONS:
        available = m.coulomb_counts[direction] + method.ir_counts
        if m.static_counts[direction] > available:
            yield Caution(
                f"static friction, {direction}",
                f"{m.static_counts[direction]:.4g} counts",
                f"up to friction + IR = {available:.4g} counts",
                "the initial drive of a move does not overcome static friction",
                f"check mechanics.friction.{direction}.static, or raise method.ir_counts",
            )
    for direction in DIRECTIONS:
        needed = m.steady_counts(speed, direction)
        if needed > homing.drive_limit_counts:
            yield Caution(
                f"homing drive, {direction}",
                f"{needed:.4g} counts",
                f"up to homing.drive_limit_counts, {homing.drive_limit_counts}",
                "the head is slower than homing.speed or stalls, which looks like contact with a frame",
                "lower homing.speed or raise homing.drive_limit_counts",
            )


def _motor(m: HeadFigures) -> Iterator[Caution]:
    """The bridge model shows the current, and the motor stands it."""
    lag, most, homing = m.electrical_time_constant, m.spec.motor.max_current, m.spec.homing.drive_limit_counts
    start = max(m.coulomb_counts.values()) + m.spec.method.ir_counts
    if lag < PWM_PERIOD and m.spec.axis.fidelity == "averaged":
        yield Caution(
            "electrical time constant",
            text(lag, "s"),
            f"above one PWM period, {text(PWM_PERIOD, 's')}",
            "the current falls to zero within each period, which the averaged bridge does not show",
            'set axis.fidelity = "switch-level"',
        )
    for name, counts, key in (
        ("current while accelerating", start, "method.ir_counts"),
        ("stall current while homing", homing, "homing.drive_limit_counts"),
    ):
        yield from common.overheating(name, m.current(counts), most, f"choose a larger motor or lower {key}")
