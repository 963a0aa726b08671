"""What looks wrong with a filtered-servo axis: limits of the method that a sound file can still come near.

A loop that does not settle is a caution and no error: it can be simulated, and the comparison of the method does so.
"""

import math
from collections.abc import Callable, Iterator

from detent.files.findings import Caution
from detent.files.nearest import BARELY, at_least, at_most, either, offer, put
from detent.methods.filtered_servo.derive import Machine, damping_of
from detent.methods.filtered_servo.rules import RATE_UNIT, TICK
from detent.methods.filtered_servo.schema import FilteredServoSpec
from detent.units import format_quantity

LEAST_GAIN_MARGIN = 1.5

LEAST_DAMPING = 0.25
"""Damping ratio from which a stop rings out within two swings; A = 1/2 of trap 1 just has it."""

WELL_COUNTED = 5
"""Pulses in a sample at limits.speed below which the speed is hardly known: the example of the patent has 5."""

LARGEST_JUMP = 8.0
"""Counts of drive by which the uncertainty of one pulse may move the drive word: twice the conventional servo's."""

SMALL_ERROR = 0.1
"""Pulses of speed word by which a fixed-point filter may stick."""

FINE_RAMP = 20
"""Units of its rate by which the command grows in a tick, from which rounding them down takes less than 5 %."""


def find_cautions(spec: FilteredServoSpec) -> Iterator[Caution]:
    """Look a filtered-servo axis over."""
    machine = Machine(spec)
    for look in _LOOKS:
        yield from look(machine)


def _stability(machine: Machine) -> Iterator[Caution]:
    margin = machine.gain_margin
    if margin >= LEAST_GAIN_MARGIN:
        return
    shorter = _steady_period(machine)
    lower = "lower drive.current_per_count, or raise mechanics.moving_mass"
    if machine.spec.drive.amplifier == "voltage":
        lower = "lower drive.supply, or raise mechanics.moving_mass"
    yield Caution(
        "stability of the loop",
        f"gain margin {margin:.3g}, spectral radius {machine.spectral_radius:.4f}",
        f"a margin of at least {LEAST_GAIN_MARGIN:g}: below 1, and a radius of 1 or more, the loop is unstable",
        "the following error swings and grows until the drive word is clipped"
        if margin < 1
        else "a little more gain, less load or a longer sample, and the following error swings and grows",
        either(put("method.sample_period", f'"{shorter} us"') if shorter else "", lower),
    )


def _steady_period(machine: Machine) -> int:
    """Sample period with the wanted gain margin [us]; 0 if there is none."""
    method = machine.spec.method
    # With an ideal drive the limit is that of K TS^2; damping only helps.
    period = method.sample_period * math.sqrt(machine.gain_margin / LEAST_GAIN_MARGIN) * 1e6
    for _ in range(12):
        micros = math.floor(period * (1 - BARELY))
        if micros < 100:
            break
        if _has_margin(machine, machine.coefficient, method.scale, micros * 1e-6):
            return micros
        period *= 0.8
    return 0


def _has_margin(machine: Machine, coefficient: float, scale: int, sample_period: float) -> bool:
    """Whether the loop still settles at the least margin; much quicker than to search the limit."""
    loop = machine.loop_with(
        coefficient=coefficient, scale=scale, sample_period=sample_period, more=LEAST_GAIN_MARGIN * (1 - 1e-6)
    )
    return loop.is_stable


def _damping(machine: Machine) -> Iterator[Caution]:
    if machine.gain_margin < 1 or machine.damping >= LEAST_DAMPING:
        return
    product = machine.coefficient * machine.spec.method.scale / machine.spec.method.position_gain
    lagging = machine.coefficient < 1 and product < 4
    yield Caution(
        "damping of the loop",
        f"{machine.damping:.3g}" + (f", with A B / K1 = {product:.3g}" if lagging else ""),
        f"at least {LEAST_DAMPING:g}" + (", A B / K1 at least 4" if lagging else ""),
        "the filter lags as long as the loop itself, and a stop rings (trap 1)"
        if lagging
        else "the speed feedback is too weak for this gain, and a stop rings",
        either(*_damped(machine)) or "lower the gain: drive.current_per_count or drive.supply",
    )


def _damped(machine: Machine) -> Iterator[str]:
    """Changes of scale, sample period and filter with which the loop is well damped."""
    method = machine.spec.method
    k2 = method.scale * method.sample_period
    for scale in _scales_above(max(method.scale, math.ceil(4 * method.position_gain / machine.coefficient) - 1)):
        micros = round(k2 / scale * 1e6)
        if machine.coefficient < 1 and micros >= 100 and _is_good(machine, machine.coefficient, scale, micros * 1e-6):
            yield f'{put("method.scale", scale)} and method.sample_period = "{micros} us", which keeps KV'
            break
    for coefficient in (0.5, 1.0):
        if coefficient > machine.coefficient and _is_good(machine, coefficient, method.scale, method.sample_period):
            yield put("method.coefficient", coefficient)
            break
    else:
        for scale in _scales_above(method.scale):
            if _is_good(machine, machine.coefficient, scale, method.sample_period):
                yield f"{put('method.scale', scale)}, which lowers KV"
                break


def _scales_above(scale: int) -> Iterator[int]:
    """Larger scales, closely enough to find the smallest that will do within a few per cent."""
    while scale < 256:
        scale = min(256, max(scale + 1, round(1.05 * scale)))
        yield scale


def _is_good(machine: Machine, coefficient: float, scale: int, sample_period: float) -> bool:
    loop = machine.loop_with(coefficient=coefficient, scale=scale, sample_period=sample_period)
    return damping_of(loop) >= LEAST_DAMPING and _has_margin(machine, coefficient, scale, sample_period)


def _resolution(machine: Machine) -> Iterator[Caution]:
    method, counted = machine.spec.method, machine.rate * machine.spec.method.sample_period
    if counted < WELL_COUNTED:
        micros = math.ceil(WELL_COUNTED / machine.rate * 1e6 * (1 - BARELY))
        yield Caution(
            "count at limits.speed",
            f"{counted:.3g} pulses in a sample",
            f"at least {WELL_COUNTED}",
            f"a count is uncertain by one, {100 / counted:.3g} % of the largest speed",
            either(offer(FilteredServoSpec, "method.sample_period", f'"{micros} us"'), "use a finer encoder"),
        )
    jump = machine.coefficient * method.scale
    if jump > LARGEST_JUMP:
        coefficient = 2.0 ** math.floor(math.log2(LARGEST_JUMP / method.scale))
        filtered = f"{put('method.coefficient', coefficient)}" + (
            ' with method.filter = "float"' if method.filter == "none" else ""
        )
        yield Caution(
            "jump of the drive word for one pulse",
            f"{jump:.4g} counts, A x B",
            f"up to {LARGEST_JUMP:g} counts",
            "the uncertainty of a count makes the force lumpy",
            either(filtered, put("method.scale", math.floor(LARGEST_JUMP / machine.coefficient))),
        )


def _command(machine: Machine) -> Iterator[Caution]:
    least = RATE_UNIT / TICK * machine.spec.pulse
    per_tick = machine.spec.method.command_acceleration / least
    if 0 < per_tick < FINE_RAMP * (1 - BARELY):
        yield Caution(
            "method.command_acceleration",
            f"{per_tick:.3g} millionths of a pulse per second in each tick",
            f"at least {FINE_RAMP} of them",
            "they are rounded down, and the command speeds up more slowly than stated",
            put("method.command_acceleration", at_least(FINE_RAMP * least, "m/s^2")),
        )


def _ramp(machine: Machine) -> Iterator[Caution]:
    spec, method = machine.spec, machine.spec.method
    if method.command_acceleration == 0 or machine.gain_margin < 1:
        return
    if machine.largest_count > spec.most_counted >= spec.counted(spec.limits.speed):
        bits = (machine.largest_count + 1).bit_length() + 1
        yield Caution(
            "count on reaching limits.speed",
            f"{machine.largest_count} pulses in a sample",
            f"up to {spec.most_counted}",
            "the slide overshoots its speed, and a speed counter about to wrap is a fault",
            either(
                offer(FilteredServoSpec, "method.counter_bits", bits),
                "lower limits.speed or the command's acceleration",
            ),
        )
    most = (1 << (method.position_bits - 1)) - 1
    if machine.largest_error > most:
        bits = math.ceil(machine.largest_error).bit_length() + 1
        yield Caution(
            "following error on reaching limits.speed",
            f"{machine.largest_error:.4g} pulses",
            f"up to {most}, the range of the position counter",
            "the following error leaves its range, which is a fault",
            either(offer(FilteredServoSpec, "method.position_bits", bits), "lower method.command_acceleration"),
        )


def _effort(machine: Machine) -> Iterator[Caution]:
    spec = machine.spec
    full = ((1 << (spec.drive.word_bits - 1)) - 1) * spec.force_per_count
    if spec.limits.effort > full * (1 + BARELY):
        yield Caution(
            "limits.effort",
            format_quantity(spec.limits.effort, "N"),
            f"up to what a full drive word gives, {format_quantity(full, 'N')}",
            "the limit never acts: the drive is weaker",
            put("limits.effort", at_most(full, "N")),
        )


def _force(machine: Machine) -> Iterator[Caution]:
    spec = machine.spec
    force, top = spec.word_limit * spec.force_per_count, machine.top_speed
    if machine.static >= force:
        yield Caution(
            "static friction",
            format_quantity(machine.static, "N"),
            f"below the largest force, {format_quantity(force, 'N')}",
            "the slide never breaks loose",
            "raise limits.effort or the drive, or lower mechanics.friction",
        )
    elif top < spec.limits.speed:
        yield Caution(
            "drive at limits.speed",
            f"{spec.holding_word(spec.limits.speed):.4g} counts",
            f"up to {spec.word_limit:.4g} counts",
            f"the largest force holds {format_quantity(max(0.0, top), 'm/s')}, and the following error grows without "
            "end above it",
            either(put("limits.speed", at_most(top, "m/s")) if top > 0 else "", "raise drive.supply"),
        )


def _acceleration(machine: Machine) -> Iterator[Caution]:
    spec = machine.spec
    left = (spec.word_limit - spec.holding_word(spec.limits.speed)) * spec.force_per_count / spec.mass
    if spec.method.command_acceleration > left > 0:
        yield Caution(
            "force for method.command_acceleration",
            format_quantity(spec.method.command_acceleration, "m/s^2"),
            f"up to {format_quantity(left, 'm/s^2')}, what the drive gives at limits.speed",
            "the drive is clipped and the following error grows while the command speeds up",
            either(put("method.command_acceleration", at_most(left, "m/s^2")), "lower limits.speed"),
        )


def _rest(machine: Machine) -> Iterator[Caution]:
    method, error = machine.spec.method, machine.resting_error
    if error > method.in_position:
        yield Caution(
            "following error that friction holds",
            f"up to {error} pulses",
            f"up to method.in_position, {method.in_position}",
            "the slide rests off its place, and moves end by method.timeout",
            either(offer(FilteredServoSpec, "method.in_position", error), "raise method.position_gain or the drive"),
        )


def _arithmetic(machine: Machine) -> Iterator[Caution]:
    method = machine.spec.method
    if method.filter != "fixed":
        return
    lost = 1 / method.coefficient - 1
    stuck = lost / 2**method.fraction_bits
    if stuck > SMALL_ERROR:
        bits = math.ceil(math.log2(lost / SMALL_ERROR))
        yield Caution(
            "fixed-point filter",
            f"sticks up to {stuck:.3g} pulses below its input",
            f"up to {SMALL_ERROR:g} pulses",
            "the speed word is wrong in one direction, and with it the following error",
            offer(FilteredServoSpec, "method.fraction_bits", bits) or "raise method.coefficient",
        )


def _pwm(machine: Machine) -> Iterator[Caution]:
    window, drive = machine.spec.method.sample_period, machine.spec.drive
    if 10 / drive.pwm_frequency > window * (1 + BARELY):
        ticks = max(1, math.floor(window / 10 / TICK * (1 + BARELY)))
        yield Caution(
            "PWM period",
            format_quantity(1 / drive.pwm_frequency, "s"),
            f"up to a tenth of the sample period, {format_quantity(window / 10, 's')}",
            "the drive word waits for the PWM, a delay that the figures of the loop leave out",
            put("drive.pwm_frequency", f'"{format_quantity(1e5 / ticks, "Hz", digits=9)}"'),
        )


def _current(machine: Machine) -> Iterator[Caution]:
    spec, drive, window = machine.spec, machine.spec.drive, machine.spec.method.sample_period
    resistance = spec.motor.resistance + drive.bridge_resistance
    lag = spec.motor.inductance / resistance
    if drive.amplifier == "voltage" and lag > window / 5:
        yield Caution(
            "electrical time constant",
            format_quantity(lag, "s"),
            f"up to a fifth of the sample period, {format_quantity(window / 5, 's')}",
            "the current lags behind the drive word, which the figures of the loop leave out",
            either(put("motor.inductance", at_most(resistance * window / 5, "H")), 'use drive.amplifier = "current"'),
        )
    per_count = drive.current_per_count
    if drive.amplifier == "voltage":
        per_count = drive.supply / (1 << (drive.word_bits - 1)) / resistance
    most, current = spec.motor.max_current, spec.word_limit * per_count
    if most is not None and current > most * (1 + BARELY):
        yield Caution(
            "current of the largest drive word",
            format_quantity(current, "A"),
            f"up to motor.max_current, {format_quantity(most, 'A')}",
            "the motor overheats if this lasts",
            either(
                put("limits.effort", at_most(most / per_count * spec.force_per_count, "N")), "choose a larger motor"
            ),
        )


_LOOKS: tuple[Callable[[Machine], Iterator[Caution]], ...] = (
    _stability,
    _damping,
    _resolution,
    _command,
    _ramp,
    _effort,
    _force,
    _acceleration,
    _rest,
    _arithmetic,
    _pwm,
    _current,
)
