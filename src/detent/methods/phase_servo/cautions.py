"""What looks wrong with a phase-servo axis: limits of the method that a sound file can still come near."""

import math
from collections.abc import Callable, Iterator

from detent.files.findings import Caution
from detent.files.nearest import BARELY, at_least, at_most, either, offer, put
from detent.methods.phase_servo.derive import Machine
from detent.methods.phase_servo.detector import JITTER_PEAK
from detent.methods.phase_servo.schema import PhaseServoSpec
from detent.units import format_quantity

PWM_RATIO = 20
"""PWM frequency over electrical corner from which the ripple of the current is small (7)."""

OVERSHOOT = 4
"""Counts by which the speed may pass the velocity table after the acceleration (test 24)."""

CURRENT_STEP = 0.02
"""Share of the current limit by which the current may pass it before the comparator is asked again."""

LEAST_GAIN_MARGIN = 1.5

INTEGRAL_PACE = 1.5
"""Steps within 1 rad of the position loop above which the integral hunts: 1.3 with the literal clocks is quiet, 1.7
with two taps less than the default is not (7)."""

QUIET = 0.25
"""Displacement of an edge by noise with which a move counts a few pairs of pulses, of the dozens it bears [step]."""


def find_cautions(spec: PhaseServoSpec) -> Iterator[Caution]:
    """Look a phase-servo axis over."""
    machine = Machine(spec)
    for look in _LOOKS:
        yield from look(machine)


def _pwm(machine: Machine) -> Iterator[Caution]:
    ratio = machine.pwm_hz / machine.corner_hz
    if ratio <= PWM_RATIO:
        inductance = PWM_RATIO * machine.resistance / (2 * math.pi * machine.pwm_hz) * (1 + BARELY)
        yield Caution(
            "PWM frequency",
            f"{format_quantity(machine.pwm_hz, 'Hz')}, {ratio:.3g} x the electrical corner",
            f"above {PWM_RATIO} x",
            "the current ripples with the PWM and the motor runs hot",
            either(
                put("motor.inductance", at_least(inductance, "H")), "lower drive.pwm_bits, or raise clock.oscillator"
            ),
        )


def _current_step(machine: Machine) -> Iterator[Caution]:
    step, limit = machine.current_per_tick, machine.spec.limits.effort
    if step > CURRENT_STEP * limit:
        yield Caution(
            "current within a tick",
            format_quantity(step, "A"),
            f"up to {100 * CURRENT_STEP:g} % of limits.effort, {format_quantity(CURRENT_STEP * limit, 'A')}",
            "the current passes its limit by that much before the comparator is asked again",
            "raise clock.oscillator, or choose a motor of more inductance",
        )


def _current_limit(machine: Machine) -> Iterator[Caution]:
    limit, stall = machine.spec.limits.effort, machine.stall_current
    if stall < limit:
        yield Caution(
            "stall current",
            format_quantity(stall, "A"),
            f"above limits.effort, {format_quantity(limit, 'A')}",
            "the supply drives no current that the limit would stop, and the axis is slower than the limit says",
            either(put("limits.effort", at_most(stall, "A")), "raise drive.supply"),
        )
    most = machine.spec.motor.max_current
    if most is not None and min(limit, stall) > most:
        yield Caution(
            "current limit",
            format_quantity(min(limit, stall), "A"),
            f"up to motor.max_current, {format_quantity(most, 'A')}",
            "the motor overheats if this lasts",
            either(put("limits.effort", at_most(most, "A")), "choose a larger motor"),
        )


def _table_deceleration(machine: Machine) -> Iterator[Caution]:
    asked, available = machine.spec.method.table_acceleration, machine.acceleration
    if asked >= available:
        fitting = at_most(available * (1 - BARELY), "m/s^2") if available > 0 else ""
        yield Caution(
            "force at the current limit",
            f"{format_quantity(machine.force_limit, 'N')}, for {max(0.0, available):.3g} m/s^2 against friction",
            f"above a m + friction, {format_quantity(asked * machine.mass + machine.coulomb, 'N')}",
            "the carriage cannot follow the velocity table and runs past its target",
            either(put("method.table_acceleration", fitting) if fitting else "", "raise limits.effort"),
        )


def _end_of_move(machine: Machine) -> Iterator[Caution]:
    method, available = machine.spec.method, machine.acceleration
    if machine.switch_deceleration >= available > 0:
        yield Caution(
            "deceleration from the change of mode",
            f"{format_quantity(machine.switch_deceleration, 'm/s^2')} from "
            f"{format_quantity(machine.switch_speed, 'm/s')} within {format_quantity(machine.switch_distance, 'm')}",
            f"below what the current limit gives against friction, {format_quantity(available, 'm/s^2')}",
            "the carriage runs past its target, and with it past the positioning point if it is fast",
            "raise method.threshold, or lower method.table_acceleration",
        )
    if method.ready_time < machine.switch_time:
        yield Caution(
            "method.ready_time",
            format_quantity(method.ready_time, "s"),
            f"at least the time of an even stop from the change of mode, {format_quantity(machine.switch_time, 's')}",
            "the axis says that it is ready before it stands",
            put("method.ready_time", at_least(machine.switch_time, "s")),
        )


def _top_speed(machine: Machine) -> Iterator[Caution]:
    top, peak = machine.top_speed, machine.peak_speed
    if top < peak:
        yield Caution(
            "supply",
            f"enough for {format_quantity(max(0.0, top), 'm/s')}",
            f"enough for the peak of the velocity table, {format_quantity(peak, 'm/s')}",
            "back-EMF and friction leave no voltage for more: the carriage never gets to the table's speed",
            either(put("limits.speed", at_most(top, "m/s")) if top > 0 else "", "raise drive.supply"),
        )


def _overshoot(machine: Machine) -> Iterator[Caution]:
    spec = machine.spec
    reached = spec.peak_count + OVERSHOOT
    limits = {
        "slew limit of the tracker": (
            machine.slew_backward / machine.speed_per_count,
            "pulses are lost and the move ends early or late",
            "raise clock.oscillator",
        ),
        "range of the speed word": (
            (1 << (spec.method.speed_bits - 1)) - 1,
            "the speed word runs over and drives the wrong way",
            "raise method.speed_bits",
        ),
    }
    for name, (most, consequence, remedy) in limits.items():
        if reached > most:
            slower = math.floor(most) - OVERSHOOT + 1
            fitting = at_most(slower * machine.speed_per_count * (1 - BARELY), "m/s") if slower >= 2 else ""
            yield Caution(
                f"speed above the table, {name}",
                f"up to {spec.peak_count} + {OVERSHOOT} counts per sample",
                f"up to {most:.4g} counts",
                consequence,
                either(put("limits.speed", fitting) if fitting else "", remedy),
            )


def _settling(machine: Machine) -> Iterator[Caution]:
    method = machine.spec.method
    k1, k2, k3 = method.position_gains
    if machine.gain_margin < LEAST_GAIN_MARGIN:
        yield Caution(
            "gain margin of the position loop",
            f"{machine.gain_margin:.3g}",
            f"at least {LEAST_GAIN_MARGIN:g}",
            "the carriage oscillates about its target, or barely comes to rest",
            "lower KP1, KP2 or KP3 of method.position_gains, or shorten the speed sample (clock.sample_tap)",
        )
    rest = machine.breakaway_counts / (k1 * k3)
    if rest > 2:
        yield Caution(
            "drive that breaks the carriage loose",
            f"{machine.breakaway_counts:.3g} counts, {rest:.3g} steps of error",
            f"up to 2 steps, {2 * k1 * k3} counts",
            "friction holds the carriage off its target until the integral moves it",
            f"set method.position_gains = {[math.ceil(machine.breakaway_counts / (2 * k3)), k2, k3]} or lower friction",
        )


def _integral(machine: Machine) -> Iterator[Caution]:
    method = machine.spec.method
    if not method.integrator or method.stop_always_off:
        return
    if machine.integral_rate > INTEGRAL_PACE:
        slower = math.ceil(math.log2(machine.integral_rate / INTEGRAL_PACE))
        tap = machine.spec.clock.integrate_tap + slower
        yield Caution(
            "pace of the integral",
            f"{machine.integral_rate:.3g} steps within 1 rad of the position loop",
            f"up to {INTEGRAL_PACE:g}",
            "under load the integral hunts for ever",
            either(offer(PhaseServoSpec, "clock.integrate_tap", tap), "raise KP1 of method.position_gains"),
        )
    if method.dead_band == 0:
        yield Caution(
            "method.dead_band",
            "0 with the integrator in use",
            "at least 1 step",
            "the integral never rests: the carriage hunts across the boundary",
            put("method.dead_band", 1),
        )


def _integral_limit(machine: Machine) -> Iterator[Caution]:
    method = machine.spec.method
    if not method.integrator or method.stop_always_off:
        return
    largest = method.integral_limit * method.position_gains[2]
    if largest < machine.breakaway_counts:
        needed = math.ceil(machine.breakaway_counts / method.position_gains[2])
        yield Caution(
            "method.integral_limit",
            f"{method.integral_limit}, worth {largest} counts of drive",
            f"enough to break the carriage loose, {machine.breakaway_counts:.3g} counts",
            "the integral cannot bring a carriage that friction holds to its target",
            offer(PhaseServoSpec, "method.integral_limit", needed) or "lower friction",
        )


def _alignment(machine: Machine) -> Iterator[Caution]:
    table = machine.spec.detector
    n, lag = table.counts, table.lag_counts
    off = lag - (n // 4 - 1)
    if off == 0:
        return
    wrong_branch = not 0 < lag < n // 2
    yield Caution(
        "detector.lag_counts",
        f"{lag}, {abs(off)} steps from N/4 - 1",
        f"N/4 - 1 = {n // 4 - 1}",
        "the absolute word rises there, and the axis stops in another place of the pitch"
        if wrong_branch
        else f"the axis stops {abs(off)} steps {'right' if off > 0 else 'left'} of its positioning points",
        put("detector.lag_counts", n // 4 - 1),
    )


def _noise(machine: Machine) -> Iterator[Caution]:
    spec = machine.spec
    peak = JITTER_PEAK * spec.edge_jitter / spec.tick
    if peak > QUIET:
        yield Caution(
            "detector.jitter",
            f"up to {peak:.2g} steps on an edge",
            f"up to {QUIET:g} step",
            "noise makes pairs of opposite pulses on the way, the distance counter counts both of them down, and a "
            "long move stops at another positioning point",
            put("detector.jitter", at_most(QUIET * spec.tick / JITTER_PEAK * spec.detector.amplitude, "s")),
        )


def _burst(machine: Machine) -> Iterator[Caution]:
    spec = machine.spec
    expected, burst = spec.method.expected_spurious, spec.disturbance.lines.burst
    if burst is None or burst.kind not in {"+", "-", "remove"}:
        return
    pulses = len(burst.ticks) or burst.count
    if pulses > expected:
        protected = pulses + spec.method.threshold < spec.detector.counts // 2
        fewer = "list fewer ticks" if burst.ticks else put("disturbance.lines.burst.count", max(1, expected))
        yield Caution(
            "pulses of disturbance.lines.burst",
            f"{pulses}",
            f"up to method.expected_spurious, {expected}",
            "the protection is not said to stand so many: within one move they may lead to another pitch",
            put("method.expected_spurious", pulses) if protected else fewer,
        )


def _rates(machine: Machine) -> Iterator[Caution]:
    spec = machine.spec
    lines, expected = spec.disturbance.lines, spec.method.expected_spurious
    rate = lines.inserted + lines.removed
    longest = spec.limits.travel / machine.peak_speed + machine.peak_speed / spec.method.table_acceleration
    if rate * longest > max(1, expected):
        yield Caution(
            "pulses of disturbance.lines",
            f"{rate * longest:.3g} in the longest move, {format_quantity(longest, 's')}",
            f"up to method.expected_spurious, {expected}",
            "the protection is not said to stand so many: a long move may end in another pitch",
            f"lower disturbance.lines.inserted and removed to {at_most(max(1, expected) / longest, 'Hz')} together",
        )


_LOOKS: tuple[Callable[[Machine], Iterator[Caution]], ...] = (
    _pwm,
    _current_step,
    _current_limit,
    _table_deceleration,
    _end_of_move,
    _top_speed,
    _overshoot,
    _settling,
    _integral,
    _integral_limit,
    _alignment,
    _noise,
    _burst,
    _rates,
)
