"""What is checked in a filtered-servo axis: contradictions between its keys, and cautions about what will surprise.

A loop that does not settle is a caution: it can be simulated, and the comparison of the method does so. Sections in
brackets are those of the filtered-servo specification.
"""

import math
from collections.abc import Iterator

from detent.axisfile import common_checks as common
from detent.files.findings import Caution, Contradiction, wrong
from detent.files.nearest import BARELY, Remedies
from detent.methods.filtered_servo.derive import FilteredFigures, damping_of
from detent.methods.filtered_servo.schema import FilteredServoSpec
from detent.units import format_quantity as text

TICK = 1e-5  # base tick [s] (`methods.filtered_servo.system`)
CLOCK = 1e-6  # clock of the decoder [s] (7)
RATE_UNIT = 1e-6  # rates of the command are whole multiples of this [pulses/s] (`control.pulse_generator`)
FASTEST = 1e9  # largest sum of the machine's rates [1/s]: a tick then takes 40 000 steps of the power series to prepare

LARGEST_MOVE = 1e3
"""Pulses by which one count of drive may move the slide within a sample: a thousand times what any loop stands."""

WIDEST_WORD = 2**31 - 1  # largest magnitude of the filter's accumulator (32 bits)

LEAST_GAIN_MARGIN = 1.5

LEAST_DAMPING = 0.25  # damping ratio from which a stop rings out within two swings; A = 1/2 of trap 1 just has it

WELL_COUNTED = 5
"""Pulses in a sample at limits.speed below which the speed is hardly known: the example of the patent has 5."""

LARGEST_JUMP = 8.0
"""Counts of drive by which the uncertainty of one pulse may move the drive word: twice the conventional servo's."""

SMALL_ERROR = 0.1  # pulses of speed word by which a fixed-point filter may stick

FINE_RAMP = 20
"""Units of its rate by which the command grows in a tick, from which rounding them down takes less than 5 %."""

remedy = Remedies(FilteredServoSpec)


# ---- contradictions


def _arithmetic(spec: FilteredServoSpec) -> Iterator[Contradiction]:
    """The fixed-point filter shifts, in 32 bits."""
    method = spec.method
    power = 2.0 ** round(math.log2(method.coefficient))
    largest = method.scale << (method.counter_bits - 1)
    if method.filter != "fixed":
        return
    if method.coefficient != power:
        allowed = "a power of two from 2^-12 to 1 where the filter is fixed-point: it shifts (3.4)"
        yield wrong("method.coefficient method.filter", allowed, remedy.exactly("method.coefficient", power))
    if largest << method.fraction_bits > WIDEST_WORD:
        keys = "method.fraction_bits method.scale method.counter_bits"
        allowed = f"few enough for scale x count, up to {largest}, in an accumulator of 32 bits"
        yield wrong(keys, allowed, remedy.most("method.fraction_bits", (WIDEST_WORD // largest).bit_length() - 1))


def _clocks(spec: FilteredServoSpec) -> Iterator[Contradiction]:
    """Periods are whole multiples of the clocks that make them."""
    clocks, ticks = spec.method.sample_period / CLOCK, 1 / (spec.drive.pwm_frequency * TICK)
    whole = max(1, round(ticks))
    if abs(clocks - round(clocks)) > 1e-6:
        allowed = "a whole number of microseconds, the clocks of the decoder"
        yield wrong("method.sample_period", allowed, remedy.exactly("method.sample_period", round(clocks) * CLOCK))
    if abs(ticks / whole - 1) > 1e-6:
        allowed = "100 kHz divided by a whole number: a PWM period is a whole number of 10 us"
        yield wrong("drive.pwm_frequency", allowed, remedy.exactly("drive.pwm_frequency", 1 / (whole * TICK)))


def _counters(spec: FilteredServoSpec) -> Iterator[Contradiction]:
    """The counters hold what limits.speed makes them count."""
    method, speed, most = spec.method, spec.limits.speed, spec.most_counted
    counted, fastest = spec.counted(speed), 0.5 / CLOCK * spec.pulse
    if counted > most:
        yield wrong(
            "method.sample_period limits.speed method.counter_bits",
            f"such that a sample at limits.speed counts up to {most} pulses, here {counted}: a counter of "
            f"{method.counter_bits} bits that is about to wrap is a fault (4)",
            remedy.most("limits.speed", most * spec.pulse / method.sample_period * (1 - BARELY)),
        )
    if speed > fastest:
        keys = "limits.speed encoder.cycles_per_revolution mechanics.travel_per_revolution"
        allowed = f"up to {text(fastest, 'm/s')}: the edges keep below half the decoder's clock of 1 MHz (3.1)"
        yield wrong(keys, allowed, remedy.most("limits.speed", fastest))
    error, range_ = spec.following_error(speed), (1 << (method.position_bits - 1)) - 1
    if error > range_:
        yield wrong(
            "method.position_bits limits.speed method.scale method.sample_period method.position_gain",
            f"wide enough for the following error at limits.speed, {error:.4g} pulses: {method.position_bits} bits "
            f"hold {range_}",
            remedy.least(
                "method.position_bits",
                math.ceil(error).bit_length() + 1,
                "lower limits.speed or method.scale, or check the units of friction, motor and screw",
            ),
        )


def _command(spec: FilteredServoSpec) -> Iterator[Contradiction]:
    """The command grows, the drive word moves the slide, and a move can end."""
    # The generator's rate grows by whole units from tick to tick.
    method, least = spec.method, RATE_UNIT / TICK
    if 0 < method.command_acceleration < least * spec.pulse * (1 - BARELY):
        yield wrong(
            "method.command_acceleration encoder.cycles_per_revolution mechanics.travel_per_revolution",
            f"0 m/s^2, or at least {least:.3g} pulses/s^2, {text(least * spec.pulse, 'm/s^2')}: a command "
            "that grows more slowly does not grow at all",
            remedy.least("method.command_acceleration", least * spec.pulse),
        )
    if spec.drive.whole_words and spec.limits.effort < spec.force_per_count:
        keys = "limits.effort drive.whole_words drive.current_per_count drive.supply"
        allowed = f"at least one count of the drive word, {text(spec.force_per_count, 'N')}, where it is whole"
        yield wrong(keys, allowed, remedy.least("limits.effort", spec.force_per_count))
    yield from common.end_of_move(remedy, method.timeout, method.in_position_time, TICK)
    yield from common.inside_travel({"mechanics.start_position": spec.mechanics.start_position}, spec.limits.travel)
    yield from common.home(remedy, spec.home, (0.0, spec.limits.travel), spec.limits.speed)


def _gain(spec: FilteredServoSpec) -> Iterator[Contradiction]:
    """A count of drive does not throw the slide away."""
    window = spec.method.sample_period
    moved = spec.gain * window * min(window, spec.motor_time_constant)
    key, value = "drive.current_per_count", spec.drive.current_per_count
    if spec.drive.amplifier == "voltage":
        key, value = "drive.supply", spec.drive.supply
    if moved > LARGEST_MOVE:
        yield wrong(
            f"{key} method.sample_period encoder.cycles_per_revolution mechanics.moving_mass",
            f"such that a count of the drive word moves the slide by up to {LARGEST_MOVE:g} pulses in a sample, here "
            f"{moved:.3g}: no servo tolerates that",
            remedy.most(key, value * LARGEST_MOVE / moved),
        )


def _machine(spec: FilteredServoSpec) -> Iterator[Contradiction]:
    """Motor, friction and disturbances can be simulated."""
    motor, friction = spec.motor, spec.mechanics.friction
    resistance = motor.resistance + spec.drive.bridge_resistance
    coupling = motor.torque_constant * motor.back_emf_constant / spec.mechanics.radius**2 / spec.mass
    rate = max(friction.right.viscous, friction.left.viscous) / spec.mass
    if motor.inductance > 0:
        yield from common.time_constants(
            common.Plant(resistance, motor.inductance, coupling, spec.mass), friction, FASTEST
        )
    elif rate + coupling / resistance > FASTEST:
        keys = "motor.resistance mechanics.moving_mass mechanics.friction.right.viscous"
        allowed = f"such that speed decays in {text(1 / FASTEST, 's')} or more"
        yield wrong(keys, allowed, "check the units of motor, screw and mass")
    yield from common.static_friction(common.sides(friction))
    yield from common.burst(spec.disturbance.lines.burst, TICK)


# Contradictions are reported in this order.
RULES = (_arithmetic, _clocks, _counters, _command, _gain, _machine)


# ---- cautions


def find_cautions(spec: FilteredServoSpec) -> Iterator[Caution]:
    """Look a filtered-servo axis over."""
    machine = FilteredFigures(spec)
    for look in (_loop, _resolution, _ramp, _drive, _acceleration, _amplifier):
        yield from look(machine)


def _loop(m: FilteredFigures) -> Iterator[Caution]:
    """The loop settles, and a stop does not ring."""
    margin, damping = m.gain_margin, damping_of(m.loop)
    product = m.coefficient * m.spec.method.scale / m.spec.method.position_gain
    drive = "drive.supply" if m.spec.drive.amplifier == "voltage" else "drive.current_per_count"
    if margin < LEAST_GAIN_MARGIN:
        yield Caution(
            "stability of the loop",
            f"gain margin {margin:.3g}, spectral radius {m.loop.spectral_radius():.4f}",
            f"a margin of at least {LEAST_GAIN_MARGIN:g}: below 1, and a radius of 1 or more, the loop is unstable",
            "the following error oscillates with growing amplitude until the drive word saturates"
            if margin < 1
            else "with slightly more gain, less load or a longer sample period the following error oscillates with "
            "growing amplitude",
            f"lower {drive}, shorten method.sample_period, or raise mechanics.moving_mass",
        )
    lagging = m.coefficient < 1 and product < 4
    if margin >= 1 and damping < LEAST_DAMPING:
        yield Caution(
            "damping of the loop",
            f"{damping:.3g}" + (f", with A B / K1 = {product:.3g}" if lagging else ""),
            f"at least {LEAST_DAMPING:g}" + (", A B / K1 at least 4" if lagging else ""),
            "the filter lag equals that of the loop itself, and stops ring (trap 1)"
            if lagging
            else "the speed feedback is too weak for this gain, and stops ring",
            f"raise method.{'coefficient or method.' if lagging else ''}scale, or lower {drive}",
        )


def _resolution(m: FilteredFigures) -> Iterator[Caution]:
    """A sample counts enough pulses, and one pulse more or less does little."""
    method, counted = m.spec.method, m.rate * m.spec.method.sample_period
    jump, lost = m.coefficient * method.scale, 1 / method.coefficient - 1
    if counted < WELL_COUNTED:
        micros = math.ceil(WELL_COUNTED / m.rate * 1e6 * (1 - BARELY))
        value = f"{counted:.3g} pulses in a sample"
        consequence = f"each count is uncertain by one, {100 / counted:.3g} % of the largest speed"
        advice = remedy.exactly("method.sample_period", micros * 1e-6, "use a finer encoder")
        yield Caution("count at limits.speed", value, f"at least {WELL_COUNTED}", consequence, advice)
    if jump > LARGEST_JUMP:
        allowed, consequence = f"up to {LARGEST_JUMP:g} counts", "quantization of the count makes the force uneven"
        advice = remedy.most("method.scale", LARGEST_JUMP / m.coefficient)
        yield Caution("jump of the drive word for one pulse", f"{jump:.4g} counts, A x B", allowed, consequence, advice)
    if method.filter == "fixed" and lost > SMALL_ERROR * 2**method.fraction_bits:
        value = f"sticks up to {lost / 2**method.fraction_bits:.3g} pulses below its input"
        consequence = "the speed word is wrong in one direction, and with it the following error"
        advice = remedy.least("method.fraction_bits", math.log2(lost / SMALL_ERROR), "raise method.coefficient")
        yield Caution("fixed-point filter", value, f"up to {SMALL_ERROR:g} pulses", consequence, advice)


def _ramp(m: FilteredFigures) -> Iterator[Caution]:
    """The command's ramp is smooth, and the loop reaches limits.speed on it without a fault."""
    spec, method = m.spec, m.spec.method
    least, most = RATE_UNIT / TICK * spec.pulse, (1 << (method.position_bits - 1)) - 1
    if 0 < method.command_acceleration < FINE_RAMP * least * (1 - BARELY):
        value = f"{method.command_acceleration / least:.3g} millionths of a pulse per second in each tick"
        consequence = "they are rounded down, and the command accelerates more slowly than stated"
        advice = remedy.least("method.command_acceleration", FINE_RAMP * least)
        yield Caution("method.command_acceleration", value, f"at least {FINE_RAMP} of them", consequence, advice)
    if method.command_acceleration == 0 or m.gain_margin < 1:
        return
    if m.largest_count > spec.most_counted >= spec.counted(spec.limits.speed):
        value = f"{m.largest_count} pulses in a sample"
        consequence = "the slide overshoots its speed, and a speed counter about to wrap is a fault"
        advice = remedy.least("method.counter_bits", (m.largest_count + 1).bit_length() + 1, "lower limits.speed")
        yield Caution("count on reaching limits.speed", value, f"up to {spec.most_counted}", consequence, advice)
    if m.largest_error > most:
        bits = math.ceil(m.largest_error).bit_length() + 1
        value, allowed = f"{m.largest_error:.4g} pulses", f"up to {most}, the range of the position counter"
        consequence = "the following error leaves its range, which is a fault"
        advice = remedy.least("method.position_bits", bits, "lower method.command_acceleration")
        yield Caution("following error on reaching limits.speed", value, allowed, consequence, advice)


def _drive(m: FilteredFigures) -> Iterator[Caution]:
    """The drive gives what the limits ask for."""
    spec, force, top = m.spec, m.spec.word_limit * m.spec.force_per_count, m.top_speed
    full = ((1 << (spec.drive.word_bits - 1)) - 1) * spec.force_per_count
    yield from common.idle_effort(remedy, spec.limits.effort, full, "N", "a full drive word gives")
    if m.static >= force:
        allowed = f"below the largest force, {text(force, 'N')}"
        advice = "raise limits.effort or the drive, or lower mechanics.friction"
        yield Caution("static friction", text(m.static, "N"), allowed, "the slide never breaks away", advice)
    elif top < spec.limits.speed:
        yield Caution(
            "drive at limits.speed",
            f"{spec.holding_word(spec.limits.speed):.4g} counts",
            f"up to {spec.word_limit:.4g} counts",
            f"the largest force holds {text(max(0.0, top), 'm/s')}, and the following error grows without bound "
            "above it",
            remedy.most("limits.speed", top, "raise drive.supply"),
        )


def _acceleration(m: FilteredFigures) -> Iterator[Caution]:
    """At limits.speed there is force left to accelerate, and friction does not hold the slide outside its window."""
    spec = m.spec
    left = (spec.word_limit - spec.holding_word(spec.limits.speed)) * spec.force_per_count / spec.mass
    if spec.method.command_acceleration > left > 0:
        value = text(spec.method.command_acceleration, "m/s^2")
        allowed = f"up to {text(left, 'm/s^2')}, what the drive gives at limits.speed"
        consequence = "the drive saturates and the following error grows while the command accelerates"
        advice = remedy.most("method.command_acceleration", left)
        yield Caution("force for method.command_acceleration", value, allowed, consequence, advice)
    error, window = m.resting_error, m.spec.method.in_position
    if error > window:
        allowed = f"up to method.in_position, {window}"
        consequence = "the slide rests off its target, and moves end by method.timeout"
        advice = remedy.least("method.in_position", error, "raise method.position_gain or the drive")
        yield Caution("following error that friction holds", f"up to {error} pulses", allowed, consequence, advice)


def _amplifier(m: FilteredFigures) -> Iterator[Caution]:
    """PWM and current follow the drive word within a sample, and the motor stands the current."""
    spec, drive, window = m.spec, m.spec.drive, m.spec.method.sample_period
    resistance = spec.motor.resistance + drive.bridge_resistance
    lag, per_count = spec.motor.inductance / resistance, drive.current_per_count
    if drive.amplifier == "voltage":
        per_count = drive.supply / (1 << (drive.word_bits - 1)) / resistance
    if 10 / drive.pwm_frequency > window * (1 + BARELY):
        ticks = max(1, math.floor(window / 10 / TICK * (1 + BARELY)))
        value = text(1 / drive.pwm_frequency, "s")
        allowed = f"up to a tenth of the sample period, {text(window / 10, 's')}"
        consequence = "the drive word waits for the PWM, a delay that the loop figures neglect"
        yield Caution("PWM period", value, allowed, consequence, remedy.exactly("drive.pwm_frequency", 1e5 / ticks))
    if drive.amplifier == "voltage" and lag > window / 5:
        allowed = f"up to a fifth of the sample period, {text(window / 5, 's')}"
        consequence = "the current lags behind the drive word, which the loop figures neglect"
        advice = remedy.most("motor.inductance", resistance * window / 5)
        yield Caution("electrical time constant", text(lag, "s"), allowed, consequence, advice)
    most = spec.motor.max_current
    lower = remedy.most("limits.effort", (most or 0.0) / per_count * spec.force_per_count, "choose a larger motor")
    yield from common.overheating("current of the largest drive word", spec.word_limit * per_count, most, lower)
