"""What follows from a stepper-envelope specification: steps, torque, ramp, times and memory of each motor.

Symbols: ``J`` total inertia, ``T_po`` pull-out torque, ``SF`` drive.torque_safety, ``a`` acceleration; sections are
those of the stepper-envelope specification.
"""

import math
from collections.abc import Callable, Iterator
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from detent.files.findings import Derived
from detent.methods.position import PositionSensor, Sensed
from detent.methods.stepper_envelope.build import make_step_ramp, start_hz, stepper_motor, zone_maps
from detent.methods.stepper_envelope.rules import Motor
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec
from detent.planning.step_envelope import StepEnvelope, envelope_memory
from detent.units import format_quantity

HIGHEST_HZ = 1e6  # frequency up to which the end of the torque is looked for [Hz]
PLACES = 1000  # places of that range at which a curve is looked at first, evenly on a logarithmic scale
Row = tuple[str, float | None, str, str, str]  # name, value or none, unit, text unless it is the quantity, formula

PULL_OUT_FORMULA = {
    "winding": "from winding, current and supply",
    "first order": "T_po0 / sqrt(1 + (f / f_c)^2)",
    "points": "between the points of the curve",
}


def position_sensors(spec: StepperEnvelopeSpec) -> dict[str, PositionSensor]:
    """No sensor: the pulses of each motor, counted from the lower end of its travel."""
    return {
        name: PositionSensor(
            sensor="none; pulses are counted", kind=Sensed.INCREMENTAL, scale=table.step,
            origin=table.mechanics.lower_end, ends=(table.mechanics.lower_end, table.upper_end),
        )
        for name, table in spec.stepper.items()
    }  # fmt: skip


class MotorFigures(Motor):
    """Figures of one motor."""

    def __init__(self, spec: StepperEnvelopeSpec, name: str) -> None:
        super().__init__(spec, name)
        self.motor = stepper_motor(self.table)
        self.inertia, self.natural_hz = self.motor.inertia, self.motor.natural_hz
        self.start_hz, self.max_hz = start_hz(self.table), self.table.max_hz
        self.ramp = make_step_ramp(self.table)
        self.shortest_way = 2 * len(self.ramp) - 1  # of a move that reaches the largest frequency [step]
        self.linear = self.table.limits.acceleration / self.table.step  # limit a_lin of the ramp [step/s^2]

    def torque_left(self, hz: float) -> float:
        """Torque that is left to accelerate with at a frequency [N m]."""
        return self.motor.pull_out(hz) / self.table.drive.torque_safety - self.motor.friction_torque

    def acceleration_torque(self, acceleration: float) -> float:
        """Torque that an acceleration [step/s^2] takes [N m]."""
        return self.inertia * self.motor.step_angle * acceleration

    @property
    def linear_end(self) -> float | None:
        """Frequency from which the torque limits the ramp [Hz]; None where it never does."""
        needed = self.acceleration_torque(self.linear)
        return first_crossing(lambda hz: self.torque_left(hz) - needed, self.start_hz)

    @property
    def torque_end(self) -> float | None:
        """Frequency at which no torque is left to accelerate with [Hz]; None where there always is."""
        return first_crossing(self.torque_left, self.start_hz)

    def torque_there(self, hz: NDArray[np.float64]) -> NDArray[np.float64]:
        """Largest torque of rotor and field at some frequencies: it falls as the pull-out torque does (7.2) [N m]."""
        pull_out = np.array([self.motor.pull_out(f) for f in hz.tolist()])
        return pull_out * (self.motor.holding_torque / self.motor.pull_out(0.0))

    @cached_property
    def torque_used(self) -> tuple[float, float]:
        """Largest share of that torque which a step of the ramp takes, and its frequency [Hz].

        Friction and twice the torque that accelerates: where the limit of a zone lies between two entries of the ramp,
        the step to the entry above it is almost as large as two.
        """
        hz = self.ramp.hz
        twice = self.acceleration_torque(1.0) * np.diff(hz**2, append=hz[-1] ** 2)
        following = np.append(hz[1:], hz[-1])
        share = (self.motor.friction_torque + twice) / self.torque_there(following)
        worst = int(np.argmax(share))
        return float(share[worst]), float(following[worst])

    @cached_property
    def travel_time(self) -> float:
        """Time from end to end, upwards, zones included [s]."""
        return float(np.sum(1 / StepEnvelope(self.ramp, zone_maps(self.table)[0]).permissible_hz()))

    def rounding(self, clock: float, words: str) -> float:
        """Largest relative error of the ramp's frequencies, stored as `words` and made by a timer's clock [Hz]."""
        period = np.rint(clock / self.ramp.hz) if words == "reload" else np.ceil(clock / np.rint(self.ramp.hz))
        made = clock / period
        return float(np.max(np.abs(made / self.ramp.hz - 1)))


def first_crossing(function: Callable[[float], float], low: float) -> float | None:
    """Find where a function of frequency first falls to 0."""
    places = np.geomspace(low, HIGHEST_HZ, PLACES).tolist()
    below = next((k for k, hz in enumerate(places) if function(hz) <= 0), None)
    if not below:
        return None if below is None else low
    above, under = places[below - 1], places[below]
    for _ in range(40):
        middle = (above + under) / 2
        above, under = (middle, under) if function(middle) > 0 else (above, middle)
    return under


def derive(spec: StepperEnvelopeSpec) -> tuple[Derived, ...]:
    """Compute all derived figures, motor by motor, in the order they are read."""
    return tuple(
        Derived(f"{m.name}: {figure}", value, unit, text or format_quantity(value, unit), formula)
        for m in (MotorFigures(spec, name) for name in spec.stepper)
        for part in (_steps, _rotor, _torque, _ramp, _words)
        for figure, value, unit, text, formula in part(m)
        if value is not None
    )


def _steps(m: MotorFigures) -> Iterator[Row]:
    """What a step is, and how many there are."""
    table = m.table
    whole = table.steps * table.step
    rest = f", {m.table.text(whole, 'm', 7)}" if table.limits.travel - whole > 1e-6 * table.step else ""
    per_turn, finer = m.motor.steps_per_turn * m.motor.microsteps, " / microsteps" if m.motor.microsteps > 1 else ""
    hz = f"{format_quantity(m.max_hz, 'Hz')}, {m.max_hz / per_turn * 60:.4g} rpm"
    yield "step", table.step, table.unit("m"), "", f"{table.mechanics.way_formula} / steps per turn{finer}"
    yield "step angle", m.motor.step_angle, "rad", "", f"1 turn / steps per turn{finer}"
    yield "travel", table.steps, "count", f"{table.steps} steps{rest}", "limits.travel / step, rounded down"
    yield "largest frequency f_max", m.max_hz, "Hz", hz, "limits.speed / step"


def _rotor(m: MotorFigures) -> Iterator[Row]:
    """How the rotor with its load swings and starts."""
    text = f"{format_quantity(m.inertia, 'kg*m^2')}, load {m.motor.load_inertia / m.motor.rotor_inertia:.3g} x rotor"
    yield "inertia J", m.inertia, "kg*m^2", text, m.table.mechanics.inertia_formula
    yield "natural frequency", m.natural_hz, "Hz", "", "sqrt(steps per turn / 4 x holding torque / J) / 2 pi"
    speed, relative = m.table.text(m.start_hz * m.table.step, "m/s"), m.start_hz / m.motor.swinging_hz
    text = f"{format_quantity(m.start_hz, 'Hz')} ({speed}), {relative:.3g} x natural"
    formula = "bare start frequency / sqrt(1 + J_load / J_rotor) / start_safety, at most f_max"
    yield "start frequency", m.start_hz, "Hz", text, formula
    # The distance from its step at which friction can hold a resting rotor.
    error = math.asin(min(m.motor.friction_torque / m.motor.holding_torque, 1.0)) * 2 / math.pi
    kind, way = "full steps" if m.motor.microsteps > 1 else "steps", error * m.table.step * m.motor.microsteps
    text = f"{error:.3g} {kind}, {m.table.text(way, 'm')}"
    if m.motor.microsteps > 1:
        formula = "holding torque x sin(90 deg / microsteps)"
        yield "incremental torque of a microstep", m.motor.incremental_torque, "N*m", "", formula
    yield "error at rest", error, "count", text, "asin(friction / holding torque) / 90 deg, at most"


def _torque(m: MotorFigures) -> Iterator[Row]:
    """Where the torque goes (3.1)."""
    way, (share, hz) = PULL_OUT_FORMULA[m.table.motor.pull_out], m.torque_used
    used = "(friction + 2 J x step angle x a) / holding torque at f: the zones may double a step of the ramp"
    yield "pull-out torque at standstill", m.motor.pull_out(0.0), "N*m", "", way
    yield "pull-out torque at f_max", m.motor.pull_out(m.max_hz), "N*m", "", way
    yield "torque left at f_max", m.torque_left(m.max_hz), "N*m", "", "T_po(f_max) / SF - friction"
    yield "end of the linear ramp", m.linear_end, "Hz", "", "T_po(f) / SF - friction = J x step angle x a_lin"
    yield "end of the torque", m.torque_end, "Hz", "", "T_po(f) / SF = friction"
    yield "torque used", share, "", f"{share:.2f} of it, at {format_quantity(hz, 'Hz')}", used


def _ramp(m: MotorFigures) -> Iterator[Row]:
    """The ramp list, the ways it needs, and the whole travel."""
    entries, way, fast = len(m.ramp), m.shortest_way, m.travel_time
    text = f"{entries} entries, {format_quantity(m.ramp.duration, 's')}"
    yield "ramp", entries, "count", text, "f^2 grows by 2 a(f) per step (3.1)"
    text = f"{entries - 1} steps, {m.table.text((entries - 1) * m.table.step, 'm')}"
    yield "braking distance from f_max", entries - 1, "count", text, "entries of the ramp - 1"
    text = f"{way} steps, {m.table.text(way * m.table.step, 'm')}"
    yield "shortest way that reaches f_max", way, "count", text, "2 x entries of the ramp - 1"
    times = m.table.steps / m.start_hz / fast
    text = f"{format_quantity(fast, 's')}, {times:.3g} x as fast as at the start frequency"
    yield "time for the whole travel", fast, "s", text, "sum of the periods of all steps, zones included"


def _words(m: MotorFigures) -> Iterator[Row]:
    """Memory, rounding, and the winding where it is known."""
    memory, controller, table = envelope_memory(m.ramp, zone_maps(m.table)[0]), m.spec.controller, m.table
    compact = f" (as 8-bit indices {2 * memory.compact})" if memory.compact else ""
    formula = f"2 bytes per step and direction; extremes and zones of the comparison methods take {memory.conventional}"
    yield "memory of the tables", memory.tables, "byte", f"{memory.tables} bytes{compact}", formula
    yield "memory of the ramp", memory.ramp, "byte", f"{memory.ramp} bytes", "2 bytes per entry"
    formula = f"of the ramp's frequencies, as {controller.words} words at controller.timer"
    yield "largest rounding error", m.rounding(controller.timer, controller.words), "%", "", formula
    own, inductance, current = table.motor.resistance, table.motor.inductance, table.drive.current
    if own is not None and inductance is not None:
        rise = inductance / (own + table.drive.bridge_resistance)
        yield "current rise time L / R", rise, "s", "", "inductance / (winding + bridge)"
    if own is not None and current is not None:
        heat = 2 * own * current**2
        yield "heat of the windings", heat, "W", f"{heat:.3g} W", "2 x resistance x current^2, both phases on"
