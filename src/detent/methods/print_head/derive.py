"""What follows from a specification: the figures an engineer looks at before the first run.

All figures are those of the true machine, drifts of ``[disturbance]`` included: what the axis will meet. Symbols: ``r``
pulley radius, ``R`` resistance of motor and bridge, ``m`` moving mass, ``s`` speed value (1/6 in/s), ``D`` stop
distance, ``V`` drive counts; sections are those of the print-head specification.
"""

import math
from collections.abc import Iterator

from detent.files.findings import Derived, count_figure, quantity_figure
from detent.files.quantities import INCH
from detent.methods.position import PositionSensor, Sensed
from detent.methods.print_head.schema import EMITTER, FULL_DRIVE_COUNTS, SPEED_STEP, PrintHeadSpec, speed_value
from detent.units import format_quantity

DIRECTIONS = ("right", "left")

TURN_AROUND_TIME = 0.133  # turn-around at 40 in/s the ramp is made for [s] (3.10)
RUN_UP_RESERVE = 1.05  # run-up before a print line, in stop distances (3.4)
FRAME_RESERVE = 12  # emitters a turning point keeps away from a frame


def position_sensors(spec: PrintHeadSpec) -> dict[str, PositionSensor]:
    """The emitters of the encoder, counted from the left frame."""
    ends, sensor = (0.0, spec.limits.travel), "incremental encoder on the motor shaft"
    return {"": PositionSensor(sensor=sensor, kind=Sensed.INCREMENTAL, scale=EMITTER, ends=ends)}


class HeadFigures:
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
        changes = {"right": drift.friction_right, "left": drift.friction_left}
        tables = {d: (getattr(friction, d), (1 + change) * gain - 1) for d, change in changes.items()}
        volts_per_newton = self.resistance / self.force_per_ampere
        counts_per_newton = volts_per_newton * self.counts_per_volt
        self.coulomb_counts = {d: (1 + change) * t.coulomb * counts_per_newton for d, (t, change) in tables.items()}
        self.static_counts = {d: (1 + change) * t.static * counts_per_newton for d, (t, change) in tables.items()}
        per_volt = 256 * SPEED_STEP * self.counts_per_volt
        self.slope = {
            d: per_volt * (self.volts_per_speed + (1 + change) * t.viscous * volts_per_newton)
            for d, (t, change) in tables.items()
        }
        # Acceleration that the IR counts give [m/s^2]; way from top speed to standstill [emitter] (eq. 7).
        self.acceleration = self.current(spec.method.ir_counts) * self.force_per_ampere / self.mass
        self.stop_distance = self.top_speed**2 / 144
        self.electrical_time_constant = motor.inductance / self.resistance  # [s]
        # Of the speed after a step of voltage [s].
        self.mechanical_time_constant = self.mass * self.resistance / (self.force_per_ampere * self.volts_per_speed)

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
    def ramp_interval(self) -> float:
        """Interval per count of the ramp at top speed [s] (eq. 10), after a perfect identification."""
        spans = [math.floor(self.slope[d] * self.top_speed / 256) for d in DIRECTIONS]
        if self.spec.method.span == "steady":
            spans = [span + round(self.coulomb_counts[d]) for span, d in zip(spans, DIRECTIONS, strict=True)]
        return TURN_AROUND_TIME * self.top_speed / 240 / max(1, sum(spans))


def derive(spec: PrintHeadSpec) -> tuple[Derived, ...]:
    """Compute all derived figures, in the order they are read."""
    machine = HeadFigures(spec)
    return (*_line(machine), *_dynamics(machine), *_limits(machine))


def _line(m: HeadFigures) -> Iterator[Derived]:
    """Units the axis computer thinks in, and the voltage/speed line that identification should find."""
    yield count_figure("drive counts per volt", m.counts_per_volt, "300 / supply", "count/V")
    text = f"{m.top_speed} ({m.top_speed / 6:.4g} in/s)"
    yield Derived("top speed value", m.top_speed, "1/6 in/s", text, "limits.speed in 1/6 in/s, rounded down")
    for direction, slope in m.slope.items():
        formula = "256 x (Ke/r + viscous x R x r/Kt) x 1/6 in/s x counts per volt"
        yield Derived(f"slope K, {direction}", slope, "1/256 count per 1/6 in/s", f"{slope:.4g}/256", formula)
        formula = "coulomb x r/Kt x R x counts per volt"
        yield count_figure(f"friction, {direction}", m.coulomb_counts[direction], formula)
    ir_counts, text = m.spec.method.ir_counts, f"{m.acceleration:.4g} m/s^2 ({m.acceleration / INCH:.4g} in/s^2)"
    formula = f"{ir_counts} counts / R = {format_quantity(m.current(ir_counts), 'A')}, x Kt/(r m)"
    yield Derived("acceleration from the IR counts", m.acceleration, "m/s^2", text, formula)


def _dynamics(m: HeadFigures) -> Iterator[Derived]:
    """How fast things happen."""
    yield quantity_figure("moving mass", m.mass, "kg", "carriage + belt + rotor inertia / r^2")
    yield quantity_figure("electrical time constant", m.electrical_time_constant, "s", "L / R")
    yield quantity_figure("mechanical time constant", m.mechanical_time_constant, "s", "m R / (Kt/r x Ke/r)")
    formula = f"0.133 s x s/240 / (VC right + VC left), span = {m.spec.method.span}"
    yield quantity_figure("ramp interval at top speed", m.ramp_interval, "s", formula)
    distance = m.stop_distance
    text = f"{distance:.4g} emitters ({format_quantity(distance * EMITTER, 'm')})"
    yield Derived("stop distance at top speed", distance, "emitter", text, "s^2 / 144")
    emitters = m.spec.limits.travel / EMITTER - 2 * (RUN_UP_RESERVE * distance + FRAME_RESERVE)
    formula = "travel - 2 x (1.05 D + 12 emitters)"
    yield quantity_figure("print line at top speed", emitters * EMITTER, "m", formula)


def _limits(m: HeadFigures) -> Iterator[Derived]:
    """How far the axis is from what it cannot do."""
    ir_counts, top = m.spec.method.ir_counts, m.top_speed
    for direction in DIRECTIONS:
        steady = m.steady_counts(top, direction)
        left_over = m.max_counts - steady - ir_counts
        text = f"{left_over:.4g} of {m.max_counts:.4g} counts ({steady:.4g} + {ir_counts} used)"
        formula = "drive at limits.effort - (K s/256 + friction) - IR counts"
        yield Derived(f"headroom at top speed, {direction}", left_over, "count", text, formula)
    for direction in DIRECTIONS:
        peak = m.open_loop_speed(m.max_counts, direction) * SPEED_STEP
        text = f"{format_quantity(peak, 'm/s')} ({peak / INCH:.4g} in/s)"
        yield Derived(f"peak speed, {direction}", peak, "m/s", text, "(drive at limits.effort - friction) / K")
    yield quantity_figure("stall current", m.current(m.max_counts), "A", "limits.effort / R")
    homing = m.current(m.spec.homing.drive_limit_counts)
    yield quantity_figure("stall current while homing", homing, "A", "homing.drive_limit_counts / counts per volt / R")
