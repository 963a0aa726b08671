"""What looks wrong with a print-head axis: limits of the method that a sound file can still come near."""

from collections.abc import Callable, Iterator

from detent.files.findings import Caution
from detent.files.quantities import INCH
from detent.methods.print_head.derive import DIRECTIONS, Machine
from detent.methods.print_head.schema import SPEED_STEP, PrintHeadSpec
from detent.units import format_quantity

PWM_PERIOD = 40e-6
"""One PWM period [s] (2.3)."""

ASSUMED_ACCELERATION = 600 * INCH
"""Acceleration the method's equations assume [m/s^2] (eq. 6)."""

RAMP_INTERVAL_RANGE = (350e-6, 450e-6)
"""Usual ramp interval [s] (3.10)."""

LOWEST_FAST_PASS = 84
"""Speed value from which a fast calibration pass lies far enough from the slow one [1/6 in/s], 14 in/s."""

STANDSTILL_SPEED = 4
"""Speed value at which the zero-speed detector calls the head standing (4.1: 0.67 in/s)."""


def find_cautions(spec: PrintHeadSpec) -> Iterator[Caution]:
    """Look a print-head axis over."""
    machine = Machine(spec)
    for look in _LOOKS:
        yield from look(machine)


def _headroom(machine: Machine) -> Iterator[Caution]:
    ir_counts, top = machine.spec.method.ir_counts, machine.top_speed
    for direction in DIRECTIONS:
        needed = machine.steady_counts(top, direction) + ir_counts
        if needed > machine.max_counts:
            fitting = machine.open_loop_speed(machine.max_counts - ir_counts, direction) * SPEED_STEP
            yield Caution(
                f"drive at top speed, {direction}",
                f"{needed:.4g} counts",
                f"up to {machine.max_counts:.4g} counts (limits.effort)",
                f"the head accelerates more slowly above {format_quantity(fitting, 'm/s')} ({fitting / INCH:.3g} in/s)",
                "lower limits.speed to that, or raise the supply",
            )


def _electrical_time_constant(machine: Machine) -> Iterator[Caution]:
    value = machine.electrical_time_constant
    if value < PWM_PERIOD and machine.spec.axis.fidelity == "averaged":
        yield Caution(
            "electrical time constant",
            format_quantity(value, "s"),
            f"above one PWM period, {format_quantity(PWM_PERIOD, 's')}",
            "the current falls to zero within each period, which the averaged bridge does not show",
            'set axis.fidelity = "switch-level"',
        )


def _ramp_interval(machine: Machine) -> Iterator[Caution]:
    low, high = RAMP_INTERVAL_RANGE
    value = machine.ramp_interval
    if not low <= value <= high:
        cause = "weak" if value > high else "strong"
        yield Caution(
            "ramp interval at top speed",
            format_quantity(value, "s"),
            f"{format_quantity(low, 's')} to {format_quantity(high, 's')}",
            f"the motor's back-EMF is {cause} for this supply: profiles have few, coarse steps or the drive saturates",
            "choose a motor, pulley or supply that gives a slope K from 158 to 203, or method.span that suits it",
        )


def _stiction(machine: Machine) -> Iterator[Caution]:
    for direction in DIRECTIONS:
        available = machine.coulomb_counts[direction] + machine.spec.method.ir_counts
        if machine.static_counts[direction] > available:
            yield Caution(
                f"static friction, {direction}",
                f"{machine.static_counts[direction]:.4g} counts",
                f"up to friction + IR = {available:.4g} counts",
                "the drive a move starts with does not break the head loose",
                f"check mechanics.friction.{direction}.static, or raise method.ir_counts",
            )


def _identification(machine: Machine) -> Iterator[Caution]:
    method = machine.spec.method
    figures = {
        "slope K": (machine.slope, method.slope_min, method.slope_max, "/256"),
        "friction": (machine.coulomb_counts, 0, method.friction_max_counts, " counts"),
    }
    for name, (values, low, high, unit) in figures.items():
        for direction in DIRECTIONS:
            if not low <= values[direction] <= high:
                yield Caution(
                    f"{name}, {direction}",
                    f"{values[direction]:.4g}{unit}",
                    f"{low} to {high}{unit}",
                    "the axis computer will call its own calibration implausible (SB1 10) and keep the defaults",
                    "choose a motor, pulley or supply that suits the method, or widen its limits in [method]",
                )


def _calibration_passes(machine: Machine) -> Iterator[Caution]:
    method = machine.spec.method
    top = machine.top_speed
    drives = {speed: (method.default_slope * speed >> 8) + method.default_friction_counts for speed in (top, 60)}
    if top < LOWEST_FAST_PASS:
        yield Caution(
            "identification",
            f"fast pass at {top / 6:.3g} in/s beside the slow one at 10 in/s",
            f"limits.speed of {LOWEST_FAST_PASS / 6:.3g} in/s or more",
            "two passes so close cannot tell slope from friction, and the power-on values stay in use",
            "raise limits.speed",
        )
    for direction in DIRECTIONS:
        slow = machine.open_loop_speed(drives[60], direction)
        if slow <= STANDSTILL_SPEED:
            yield Caution(
                f"slow calibration pass, {direction}",
                f"{slow / 6:.2g} in/s at {drives[60]} counts",
                f"above {STANDSTILL_SPEED / 6:.2g} in/s",
                "friction holds the head, and the calibration fails",
                f"lower mechanics.friction.{direction}, or raise method.default_friction_counts",
            )
        fast = machine.open_loop_speed(drives[top], direction)
        if fast > 1.1 * machine.top_speed:
            yield Caution(
                f"fast calibration pass, {direction}",
                f"{fast / 6:.3g} in/s at {drives[top]} counts",
                f"up to limits.speed, {machine.top_speed / 6:.3g} in/s",
                "the first pass after power-on runs faster than the axis may",
                "choose a motor with a larger constant or a smaller pulley, or lower method.default_slope",
            )


def _homing(machine: Machine) -> Iterator[Caution]:
    limit = machine.spec.homing.drive_limit_counts
    speed = int(machine.spec.homing.speed / SPEED_STEP)
    for direction in DIRECTIONS:
        needed = machine.steady_counts(speed, direction)
        if needed > limit:
            yield Caution(
                f"homing drive, {direction}",
                f"{needed:.4g} counts",
                f"up to homing.drive_limit_counts, {limit}",
                "the head is slower than homing.speed or stands, which looks like a frame",
                "lower homing.speed or raise homing.drive_limit_counts",
            )


def _acceleration(machine: Machine) -> Iterator[Caution]:
    ratio = machine.acceleration / ASSUMED_ACCELERATION
    if not 0.85 <= ratio <= 1.15:
        fitting = machine.spec.method.ir_counts / ratio
        yield Caution(
            "acceleration from the IR counts",
            f"{machine.acceleration / INCH:.4g} in/s^2",
            "600 in/s^2 within 15 %",
            f"stops are {'shorter' if ratio > 1 else 'longer'} than the method predicts",
            f"set method.ir_counts = {fitting:.0f}, or change the moving mass ({format_quantity(machine.mass, 'kg')})",
        )


def _motor_current(machine: Machine) -> Iterator[Caution]:
    limit = machine.spec.motor.max_current
    if limit is None:
        return
    start = max(machine.coulomb_counts.values()) + machine.spec.method.ir_counts
    currents = {
        "current while accelerating": (machine.current(start), "lower method.ir_counts"),
        "stall current while homing": (
            machine.current(machine.spec.homing.drive_limit_counts),
            "lower homing.drive_limit_counts",
        ),
    }
    for name, (current, remedy) in currents.items():
        if current > limit:
            yield Caution(
                name,
                format_quantity(current, "A"),
                f"up to motor.max_current, {format_quantity(limit, 'A')}",
                "the motor overheats if this lasts",
                f"choose a larger motor or {remedy}",
            )


_LOOKS: tuple[Callable[[Machine], Iterator[Caution]], ...] = (
    _headroom,
    _identification,
    _calibration_passes,
    _ramp_interval,
    _acceleration,
    _stiction,
    _homing,
    _electrical_time_constant,
    _motor_current,
)
