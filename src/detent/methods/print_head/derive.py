"""What follows from a specification: the figures an engineer looks at before the first run.

All figures are those of the true machine, drifts of ``[disturbance]`` included: what the axis will meet. Symbols: ``r``
pulley radius, ``R`` resistance of motor and bridge, ``m`` moving mass, ``s`` speed value (1/6 in/s), ``D`` stop
distance, ``V`` drive counts; sections are those of the print-head specification.
"""

import math
from collections.abc import Iterator

from detent.files.findings import Derived, count_figure, quantity_figure
from detent.files.quantities import INCH
from detent.methods.print_head.schema import EMITTER, FULL_DRIVE_COUNTS, SPEED_STEP, PrintHeadSpec, speed_value
from detent.units import format_quantity

DIRECTIONS = ("right", "left")

TURN_AROUND_TIME = 0.133
"""Turn-around at 40 in/s the ramp is made for [s] (3.10)."""

RUN_UP_RESERVE = 1.05
"""Run-up before a print line, in stop distances (3.4)."""

FRAME_RESERVE = 12
"""Emitters a turning point keeps away from a frame."""


class Machine:
    """The true machine behind a specification, in the units its axis computer thinks in."""

    def __init__(self, spec: PrintHeadSpec) -> None:
        drift = spec.disturbance
        motor, mechanics, friction = spec.motor, spec.mechanics, spec.mechanics.friction
        gain = 1 + drift.motor_constant
        self.spec = spec
        self.radius = mechanics.pulley_circumference / (2 * math.pi)
        self.resistance = motor.resistance + spec.drive.bridge_resistance
        self.mass = mechanics.carriage_mass + mechanics.belt_mass + motor.rotor_inertia / self.radius**2
        self.force_per_ampere = gain * motor.torque_constant / self.radius
        self.volts_per_speed = gain * motor.back_emf_constant / self.radius
        self.counts_per_volt = FULL_DRIVE_COUNTS / drift.supply
        # The bridge cannot give more than the supply, the axis must not give more than the stated effort.
        self.max_counts = FULL_DRIVE_COUNTS * min(1.0, spec.limits.effort / spec.drive.supply)
        self.top_speed = speed_value(spec.limits.speed)
        # Friction drifts as the drive that overcomes it, so its force drifts with the motor constant as well.
        tables = {
            "right": (friction.right, (1 + drift.friction_right) * gain - 1),
            "left": (friction.left, (1 + drift.friction_left) * gain - 1),
        }
        volts_per_newton = self.resistance / self.force_per_ampere
        counts_per_newton = volts_per_newton * self.counts_per_volt
        self.coulomb_counts = {d: (1 + change) * t.coulomb * counts_per_newton for d, (t, change) in tables.items()}
        self.static_counts = {d: (1 + change) * t.static * counts_per_newton for d, (t, change) in tables.items()}
        self.slope = {
            d: 256
            * SPEED_STEP
            * self.counts_per_volt
            * (self.volts_per_speed + (1 + change) * t.viscous * volts_per_newton)
            for d, (t, change) in tables.items()
        }

    def steady_counts(self, speed: int, direction: str) -> float:
        """Drive that holds a speed value (eq. 9 with the true constants)."""
        return self.slope[direction] * speed / 256 + self.coulomb_counts[direction]

    def open_loop_speed(self, counts: float, direction: str) -> float:
        """Speed value a constant drive leads to; 0 when friction holds the head."""
        return max(0.0, (counts - self.coulomb_counts[direction]) * 256 / self.slope[direction])

    def current(self, counts: float) -> float:
        """Current [A] of a drive at standstill."""
        return counts / self.counts_per_volt / self.resistance

    @property
    def acceleration(self) -> float:
        """Acceleration [m/s^2] that the IR counts give."""
        return self.current(self.spec.method.ir_counts) * self.force_per_ampere / self.mass

    @property
    def electrical_time_constant(self) -> float:
        """L / R [s]."""
        return self.spec.motor.inductance / self.resistance

    @property
    def mechanical_time_constant(self) -> float:
        """Time constant of speed after a step of voltage [s]."""
        return self.mass * self.resistance / (self.force_per_ampere * self.volts_per_speed)

    @property
    def ramp_interval(self) -> float:
        """Interval per count of the ramp at top speed [s] (eq. 10), after a perfect identification."""
        spans = [math.floor(self.slope[d] * self.top_speed / 256) for d in DIRECTIONS]
        if self.spec.method.span == "steady":
            spans = [span + round(self.coulomb_counts[d]) for span, d in zip(spans, DIRECTIONS, strict=True)]
        return TURN_AROUND_TIME * self.top_speed / 240 / max(1, sum(spans))

    @property
    def stop_distance(self) -> float:
        """Emitters from top speed to standstill (eq. 7)."""
        return self.top_speed**2 / 144

    @property
    def line_length(self) -> float:
        """Longest line [m] printed at top speed in both directions."""
        emitters = self.spec.limits.travel / EMITTER - 2 * (RUN_UP_RESERVE * self.stop_distance + FRAME_RESERVE)
        return emitters * EMITTER


def derive(spec: PrintHeadSpec) -> tuple[Derived, ...]:
    """Compute all derived figures, in the order they are read."""
    machine = Machine(spec)
    return (*_scales(machine), *_line(machine), *_dynamics(machine), *_limits(machine))


def _scales(machine: Machine) -> Iterator[Derived]:
    """Units the axis computer thinks in."""
    yield count_figure("drive counts per volt", machine.counts_per_volt, "300 / supply", "count/V")
    yield Derived(
        "top speed value",
        machine.top_speed,
        "1/6 in/s",
        f"{machine.top_speed} ({machine.top_speed / 6:.4g} in/s)",
        "limits.speed in 1/6 in/s, rounded down",
    )


def _line(machine: Machine) -> Iterator[Derived]:
    """The voltage/speed line that identification should find."""
    for direction in DIRECTIONS:
        formula = "256 x (Ke/r + viscous x R x r/Kt) x 1/6 in/s x counts per volt"
        slope = machine.slope[direction]
        yield Derived(f"slope K, {direction}", slope, "1/256 count per 1/6 in/s", f"{slope:.4g}/256", formula)
        yield count_figure(
            f"friction, {direction}", machine.coulomb_counts[direction], "coulomb x r/Kt x R x counts per volt"
        )
    ir_counts = machine.spec.method.ir_counts
    formula = f"{ir_counts} counts / R = {format_quantity(machine.current(ir_counts), 'A')}, x Kt/(r m)"
    acceleration = machine.acceleration
    yield Derived(
        "acceleration from the IR counts",
        acceleration,
        "m/s^2",
        f"{acceleration:.4g} m/s^2 ({acceleration / INCH:.4g} in/s^2)",
        formula,
    )


def _dynamics(machine: Machine) -> Iterator[Derived]:
    """How fast things happen."""
    yield quantity_figure("moving mass", machine.mass, "kg", "carriage + belt + rotor inertia / r^2")
    yield quantity_figure("electrical time constant", machine.electrical_time_constant, "s", "L / R")
    yield quantity_figure("mechanical time constant", machine.mechanical_time_constant, "s", "m R / (Kt/r x Ke/r)")
    formula = f"0.133 s x s/240 / (VC right + VC left), span = {machine.spec.method.span}"
    yield quantity_figure("ramp interval at top speed", machine.ramp_interval, "s", formula)
    distance = machine.stop_distance
    text = f"{distance:.4g} emitters ({format_quantity(distance * EMITTER, 'm')})"
    yield Derived("stop distance at top speed", distance, "emitter", text, "s^2 / 144")
    formula = "travel - 2 x (1.05 D + 12 emitters)"
    yield quantity_figure("print line at top speed", machine.line_length, "m", formula)


def _limits(machine: Machine) -> Iterator[Derived]:
    """How far the axis is from what it cannot do."""
    ir_counts, top = machine.spec.method.ir_counts, machine.top_speed
    for direction in DIRECTIONS:
        steady = machine.steady_counts(top, direction)
        left_over = machine.max_counts - steady - ir_counts
        text = f"{left_over:.4g} of {machine.max_counts:.4g} counts ({steady:.4g} + {ir_counts} used)"
        formula = "drive at limits.effort - (K s/256 + friction) - IR counts"
        yield Derived(f"headroom at top speed, {direction}", left_over, "count", text, formula)
    for direction in DIRECTIONS:
        peak = machine.open_loop_speed(machine.max_counts, direction) * SPEED_STEP
        text = f"{format_quantity(peak, 'm/s')} ({peak / INCH:.4g} in/s)"
        yield Derived(f"peak speed, {direction}", peak, "m/s", text, "(drive at limits.effort - friction) / K")
    yield quantity_figure("stall current", machine.current(machine.max_counts), "A", "limits.effort / R")
    homing = machine.current(machine.spec.homing.drive_limit_counts)
    yield quantity_figure("stall current while homing", homing, "A", "homing.drive_limit_counts / counts per volt / R")
