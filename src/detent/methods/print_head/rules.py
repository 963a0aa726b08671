"""What must hold between keys: rules of the print-head method that no single key can show.

Each rule names the keys it looks at. A rule is reported at the first of them that the file states, and not at all when
one of them is wrong already: a consequence of an error is not another error.
"""

import math
from collections.abc import Callable, Iterator

from detent.axisfile.common_checks import Plant, sides, static_friction, time_constants
from detent.files.findings import Contradiction
from detent.files.quantities import INCH
from detent.methods.print_head.derive import Machine
from detent.methods.print_head.schema import EMITTER, PrintHeadSpec
from detent.units import format_quantity

MAX_EMITTERS = 65535
"""Largest position the axis computer can hold (16 bits, 3.1)."""

MIN_TRAVEL = 1200 * EMITTER
"""Shortest way in which the calibration passes at 40 in/s can start, be measured and stop [m] (3.3)."""

FASTEST = 1e9
"""Largest sum of the machine's rates [1/s]: a PWM period then takes 160 000 steps of the power series to prepare."""

PULLEY_TOLERANCE = 1e-3
"""How far one encoder cycle may be from 1/300 in, relative."""


def _effort_within_supply(spec: PrintHeadSpec) -> Iterator[Contradiction]:
    if spec.limits.effort > spec.drive.supply:
        yield Contradiction(
            ("limits.effort", "drive.supply"),
            f"up to drive.supply, {format_quantity(spec.drive.supply, 'V')}",
            "lower limits.effort or raise drive.supply",
        )


def _emitter_pitch(spec: PrintHeadSpec) -> Iterator[Contradiction]:
    circumference, cycles = spec.mechanics.pulley_circumference, spec.encoder.cycles_per_revolution
    if abs(circumference / cycles / EMITTER - 1) > PULLEY_TOLERANCE:
        fitting_pulley = format_quantity(cycles * EMITTER, "m", digits=6)
        fitting_cycles = max(1, round(circumference / EMITTER))
        yield Contradiction(
            ("encoder.cycles_per_revolution", "mechanics.pulley_circumference"),
            "1/300 in of head travel per encoder cycle, within 0.1 %: the method's equations assume it "
            f"(here {format_quantity(circumference / cycles, 'm')} instead of {format_quantity(EMITTER, 'm')})",
            f"use {fitting_cycles} cycles with this pulley, or a circumference of {fitting_pulley} with this encoder",
        )


def _travel(spec: PrintHeadSpec) -> Iterator[Contradiction]:
    travel = spec.limits.travel
    if not MIN_TRAVEL <= travel <= MAX_EMITTERS * EMITTER:
        yield Contradiction(
            ("limits.travel",),
            f"a length from {format_quantity(MIN_TRAVEL, 'm')} (calibration passes at 40 in/s need it) "
            f"to {format_quantity(MAX_EMITTERS * EMITTER, 'm')} (positions have 16 bits)",
            "correct limits.travel; this method suits carriages of that range",
        )


def _speeds_within_limit(spec: PrintHeadSpec) -> Iterator[Contradiction]:
    limit = spec.limits.speed
    speeds = {"method.max_print_speed": spec.method.max_print_speed, "homing.speed": spec.homing.speed}
    for key, speed in speeds.items():
        if speed > limit:
            yield Contradiction(
                (key, "limits.speed"),
                f"up to limits.speed, {format_quantity(limit, 'm/s')} ({limit / INCH:.4g} in/s)",
                f"lower {key} or raise limits.speed",
            )


def _positions_inside_travel(spec: PrintHeadSpec) -> Iterator[Contradiction]:
    positions = {
        "mechanics.start_position": spec.mechanics.start_position,
        "print.left_margin": spec.printing.left_margin,
        "homing.width_tolerance": spec.homing.width_tolerance,
    }
    if spec.disturbance.obstacle is not None:
        positions["disturbance.obstacle.position"] = spec.disturbance.obstacle.position
    travel = spec.limits.travel
    for key, position in positions.items():
        if position >= travel:
            yield Contradiction(
                (key, "limits.travel"),
                f"below limits.travel, {format_quantity(travel, 'm')} ({travel / INCH:.4g} in)",
                f"lower {key} or correct limits.travel",
            )


def _static_friction(spec: PrintHeadSpec) -> Iterator[Contradiction]:
    yield from static_friction(sides(spec.mechanics.friction))


def _slope_limits(spec: PrintHeadSpec) -> Iterator[Contradiction]:
    method = spec.method
    if method.slope_min >= method.slope_max:
        yield Contradiction(
            ("method.slope_min", "method.slope_max"),
            f"below method.slope_max, {method.slope_max}",
            "lower method.slope_min or raise method.slope_max",
        )
    elif not method.slope_min <= method.default_slope <= method.slope_max:
        yield Contradiction(
            ("method.default_slope", "method.slope_min", "method.slope_max"),
            f"from method.slope_min, {method.slope_min}, to method.slope_max, {method.slope_max}",
            "choose a default slope that the axis computer itself would take for plausible",
        )


def _friction_limits(spec: PrintHeadSpec) -> Iterator[Contradiction]:
    method = spec.method
    if method.default_friction_counts > method.friction_max_counts:
        yield Contradiction(
            ("method.default_friction_counts", "method.friction_max_counts"),
            f"up to method.friction_max_counts, {method.friction_max_counts}",
            "lower method.default_friction_counts or raise method.friction_max_counts",
        )


def _homing_drive(spec: PrintHeadSpec) -> Iterator[Contradiction]:
    # Contact is "no emitter while |V| >= Vf + 20" (3.2): below that limit the frame would never be noticed.
    lowest = spec.method.default_friction_counts + 20
    if spec.homing.drive_limit_counts < lowest:
        yield Contradiction(
            ("homing.drive_limit_counts", "method.default_friction_counts"),
            f"at least method.default_friction_counts + 20 = {lowest}: contact with a frame is seen above it",
            "raise homing.drive_limit_counts or lower method.default_friction_counts",
        )


def _timeouts(spec: PrintHeadSpec) -> Iterator[Contradiction]:
    zero_speed, contact = spec.method.zero_speed_timeout, spec.homing.contact_timeout
    if contact <= zero_speed:
        yield Contradiction(
            ("homing.contact_timeout", "method.zero_speed_timeout"),
            f"longer than method.zero_speed_timeout, {format_quantity(zero_speed, 's')}",
            "raise homing.contact_timeout: the head stands still before it can be said to be in contact",
        )


def _drifted_supply(spec: PrintHeadSpec) -> Iterator[Contradiction]:
    stated, true = spec.drive.supply, spec.disturbance.supply
    if not math.isclose(true, stated) and not 0.5 * stated <= true <= 2 * stated:
        yield Contradiction(
            ("disturbance.supply", "drive.supply"),
            f"half to twice drive.supply: {format_quantity(0.5 * stated, 'V')} to {format_quantity(2 * stated, 'V')}",
            "correct disturbance.supply: a drift, not another supply",
        )


def _time_constants(spec: PrintHeadSpec) -> Iterator[Contradiction]:
    machine, drifts = Machine(spec), spec.disturbance
    drift = (1 + drifts.motor_constant) * (1 + max(drifts.friction_right, drifts.friction_left))
    coupling = machine.force_per_ampere * machine.volts_per_speed / machine.mass
    plant = Plant(machine.resistance, spec.motor.inductance, coupling, machine.mass / max(1.0, drift))
    yield from time_constants(plant, spec.mechanics.friction, FASTEST)


RULES: tuple[Callable[[PrintHeadSpec], Iterator[Contradiction]], ...] = (
    _effort_within_supply,
    _emitter_pitch,
    _travel,
    _speeds_within_limit,
    _positions_inside_travel,
    _static_friction,
    _slope_limits,
    _friction_limits,
    _homing_drive,
    _timeouts,
    _drifted_supply,
    _time_constants,
)
"""The rules, in the order in which their contradictions are told."""
