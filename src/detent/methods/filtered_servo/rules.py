"""What must hold between keys of the filtered-servo method.

As in the print head's rules, a rule is reported at the first of its keys that the file states, and a remedy names the
nearest value that would do. Sections are those of the filtered-servo specification.
"""

import math
from collections.abc import Callable, Iterator

from detent.axisfile.common_rules import Plant, burst, inside_travel, static_friction, time_constants
from detent.files.findings import Contradiction
from detent.files.nearest import BARELY, at_least, at_most, either, offer, put
from detent.methods.filtered_servo.schema import FilteredServoSpec
from detent.units import format_quantity

TICK = 1e-5
"""Base tick [s] (`systems.filtered_servo`)."""

CLOCK = 1e-6
"""Clock of the decoder [s] (7)."""

RATE_UNIT = 1e-6
"""Rates of the command are whole multiples of this [pulses/s] (`control.pulse_generator`)."""

FASTEST = 1e9
"""Largest sum of the machine's rates [1/s]: a tick then takes 40 000 steps of the power series to prepare."""

LARGEST_MOVE = 1e3
"""Pulses by which one count of drive may move the slide within a sample: a thousand times what any loop stands."""

WIDEST_WORD = 2**31 - 1
"""Largest magnitude of the filter's accumulator (32 bits)."""


def _power_of_two(spec: FilteredServoSpec) -> Iterator[Contradiction]:
    coefficient = spec.method.coefficient
    shift = round(-math.log2(coefficient))
    if spec.method.filter == "fixed" and coefficient != 2.0**-shift:
        yield Contradiction(
            ("method.coefficient", "method.filter"),
            "a power of two from 2^-12 to 1 where the filter is fixed-point: it shifts (3.4)",
            either(offer(FilteredServoSpec, "method.coefficient", 2.0**-shift), put("method.filter", '"float"')),
        )


def _accumulator(spec: FilteredServoSpec) -> Iterator[Contradiction]:
    method = spec.method
    largest = method.scale << (method.counter_bits - 1)
    if method.filter == "fixed" and largest << method.fraction_bits > WIDEST_WORD:
        yield Contradiction(
            ("method.fraction_bits", "method.scale", "method.counter_bits"),
            f"few enough for scale x count, up to {largest}, in an accumulator of 32 bits",
            offer(FilteredServoSpec, "method.fraction_bits", (WIDEST_WORD // largest).bit_length() - 1),
        )


def _sample_period(spec: FilteredServoSpec) -> Iterator[Contradiction]:
    clocks = spec.method.sample_period / CLOCK
    if abs(clocks - round(clocks)) > 1e-6:
        nearest = f'"{format_quantity(round(clocks) * CLOCK, "s", digits=9)}"'
        yield Contradiction(
            ("method.sample_period",),
            "a whole number of microseconds, the clocks of the decoder",
            offer(FilteredServoSpec, "method.sample_period", nearest),
        )


def _pwm_frequency(spec: FilteredServoSpec) -> Iterator[Contradiction]:
    ticks = 1 / (spec.drive.pwm_frequency * TICK)
    whole = max(1, round(ticks))
    if abs(ticks / whole - 1) > 1e-6:
        nearest = f'"{format_quantity(1 / (whole * TICK), "Hz", digits=9)}"'
        yield Contradiction(
            ("drive.pwm_frequency",),
            "100 kHz divided by a whole number: a PWM period is a whole number of 10 us",
            offer(FilteredServoSpec, "drive.pwm_frequency", nearest),
        )


def _speed_counted(spec: FilteredServoSpec) -> Iterator[Contradiction]:
    method, speed, most = spec.method, spec.limits.speed, spec.most_counted
    counted = spec.counted(speed)
    if counted > most:
        bits = (counted + 1).bit_length() + 1
        clocks = math.floor(most * spec.pulse / speed / CLOCK)
        slower = at_most(most * spec.pulse / method.sample_period * (1 - BARELY), "m/s")
        yield Contradiction(
            ("method.sample_period", "limits.speed", "method.counter_bits"),
            f"such that a sample at limits.speed counts up to {most} pulses, here {counted}: a counter of "
            f"{method.counter_bits} bits that is about to wrap is a fault (4)",
            either(
                offer(FilteredServoSpec, "method.sample_period", f'"{clocks} us"'),
                offer(FilteredServoSpec, "limits.speed", slower),
                offer(FilteredServoSpec, "method.counter_bits", bits),
            ),
        )


def _pulse_rate(spec: FilteredServoSpec) -> Iterator[Contradiction]:
    fastest = 0.5 / CLOCK * spec.pulse
    if spec.limits.speed > fastest:
        yield Contradiction(
            ("limits.speed", "encoder.cycles_per_revolution", "mechanics.travel_per_revolution"),
            f"up to {format_quantity(fastest, 'm/s')}: the edges keep below half the decoder's clock of 1 MHz (3.1)",
            either(offer(FilteredServoSpec, "limits.speed", at_most(fastest, "m/s")), "use a coarser encoder"),
        )


def _following_error(spec: FilteredServoSpec) -> Iterator[Contradiction]:
    method, speed = spec.method, spec.limits.speed
    error, most = spec.following_error(speed), (1 << (method.position_bits - 1)) - 1
    if error > most:
        bits = math.ceil(error).bit_length() + 1
        at_rest = spec.following_error(0.0)
        slower = speed * (most - at_rest) / (error - at_rest) * (1 - BARELY)
        left = most * method.position_gain - spec.holding_word(speed)
        scale = math.floor(left / (speed / spec.pulse * method.sample_period))
        yield Contradiction(
            ("method.position_bits", "limits.speed", "method.scale", "method.sample_period", "method.position_gain"),
            f"wide enough for the following error at limits.speed, {error:.4g} pulses: {method.position_bits} bits "
            f"hold {most}",
            either(
                offer(FilteredServoSpec, "method.position_bits", bits),
                offer(FilteredServoSpec, "limits.speed", at_most(slower, "m/s")),
                offer(FilteredServoSpec, "method.scale", scale),
            )
            or _larger_gain(spec, most),
        )


def _larger_gain(spec: FilteredServoSpec, most: int) -> str:
    gain = spec.following_error(spec.limits.speed) * spec.method.position_gain / most * (1 + BARELY)
    if gain > 100:
        return "check the units of friction, motor and screw"
    return offer(FilteredServoSpec, "method.position_gain", at_least(gain, "").strip('"'))


def _command(spec: FilteredServoSpec) -> Iterator[Contradiction]:
    # The generator's rate grows by whole units from tick to tick.
    least = RATE_UNIT / TICK
    if 0 < spec.method.command_acceleration < least * spec.pulse * (1 - BARELY):
        yield Contradiction(
            ("method.command_acceleration", "encoder.cycles_per_revolution", "mechanics.travel_per_revolution"),
            f"0 m/s^2, or at least {least:.3g} pulses/s^2, {format_quantity(least * spec.pulse, 'm/s^2')}: a command "
            "that grows more slowly does not grow at all",
            offer(FilteredServoSpec, "method.command_acceleration", at_least(least * spec.pulse, "m/s^2")),
        )


def _whole_word(spec: FilteredServoSpec) -> Iterator[Contradiction]:
    if spec.drive.whole_words and spec.limits.effort < spec.force_per_count:
        yield Contradiction(
            ("limits.effort", "drive.whole_words", "drive.current_per_count", "drive.supply"),
            f"at least one count of the drive word, {format_quantity(spec.force_per_count, 'N')}, where it is whole",
            either(
                offer(FilteredServoSpec, "limits.effort", at_least(spec.force_per_count, "N")),
                put("drive.whole_words", "false"),
            ),
        )


def _timeout(spec: FilteredServoSpec) -> Iterator[Contradiction]:
    method = spec.method
    if method.timeout < method.in_position_time + TICK:
        yield Contradiction(
            ("method.timeout", "method.in_position_time"),
            f"longer than method.in_position_time, {format_quantity(method.in_position_time, 's')}: no move could end",
            offer(FilteredServoSpec, "method.timeout", at_least(method.in_position_time + TICK, "s")),
        )


def _start(spec: FilteredServoSpec) -> Iterator[Contradiction]:
    yield from inside_travel({"mechanics.start_position": spec.mechanics.start_position}, spec.limits.travel)


def _gain(spec: FilteredServoSpec) -> Iterator[Contradiction]:
    window = spec.method.sample_period
    moved = spec.gain * window * min(window, spec.motor_time_constant)
    if moved > LARGEST_MOVE:
        key, value, unit, least = "drive.current_per_count", spec.drive.current_per_count, "A", 1e-9
        if spec.drive.amplifier == "voltage":
            key, value, unit, least = "drive.supply", spec.drive.supply, "V", 0.1
        lower = value * LARGEST_MOVE / moved
        yield Contradiction(
            (key, "method.sample_period", "encoder.cycles_per_revolution", "mechanics.moving_mass"),
            f"such that a count of the drive word moves the slide by up to {LARGEST_MOVE:g} pulses in a sample, here "
            f"{moved:.3g}: no servo stands that",
            either(
                put(key, at_most(lower, unit)) if lower > least else "", "check the units of motor, screw and encoder"
            ),
        )


def _machine(spec: FilteredServoSpec) -> Iterator[Contradiction]:
    motor, friction = spec.motor, spec.mechanics.friction
    resistance = motor.resistance + spec.drive.bridge_resistance
    coupling = motor.torque_constant * motor.back_emf_constant / spec.radius**2 / spec.mass
    if motor.inductance == 0.0:
        rate = max(friction.right.viscous, friction.left.viscous) / spec.mass
        if rate + coupling / resistance > FASTEST:
            yield Contradiction(
                ("motor.resistance", "mechanics.moving_mass", "mechanics.friction.right.viscous"),
                f"such that speed decays in {format_quantity(1 / FASTEST, 's')} or more",
                "check the units of motor, screw and mass",
            )
        return
    yield from time_constants(Plant(resistance, motor.inductance, coupling, spec.mass), friction, FASTEST)


def _friction(spec: FilteredServoSpec) -> Iterator[Contradiction]:
    yield from static_friction(spec.mechanics.friction)


def _burst(spec: FilteredServoSpec) -> Iterator[Contradiction]:
    yield from burst(spec.disturbance.lines.burst, TICK)


RULES: tuple[Callable[[FilteredServoSpec], Iterator[Contradiction]], ...] = (
    _power_of_two,
    _accumulator,
    _sample_period,
    _pwm_frequency,
    _speed_counted,
    _pulse_rate,
    _following_error,
    _command,
    _whole_word,
    _timeout,
    _start,
    _gain,
    _machine,
    _friction,
    _burst,
)
"""The rules, in the order in which their contradictions are told."""
