"""From a checked specification to the parameters of the phase servo: SI values to counts, masks and phases."""

import math

from detent.axisfile.blocks import fill_drive_train, fill_guard, fill_interference, fill_marks, fill_push
from detent.control.phase_law import LawParams
from detent.control.phase_sequencer import NEVER, TABLE, SequencerParams
from detent.kernel.turn_table import TURN
from detent.methods.phase_servo.schema import PhaseServoSpec
from detent.methods.phase_servo.system import PhaseServoParams
from detent.sensing.phase_detector import DetectorParams, fill_errors

SUBSTEP = 1e-5
"""Longest substep of the power series that makes the whole-period matrices [s]; a tick is shorter than this."""


def build_phase_servo(spec: PhaseServoSpec) -> PhaseServoParams:
    """Parameters of the phase servo."""
    p = PhaseServoParams()
    c, plant = p.controller, p.plant
    c.clocks.integrate_mask = (1 << spec.clock.integrate_tap) - 1
    c.clocks.sample_mask = (1 << spec.clock.sample_tap) - 1
    k, bits = c.converters, spec.detector.counts.bit_length() - 1
    k.carrier.mask = k.tracking.mask = k.absolute.mask = spec.detector.counts - 1
    k.tracking.top = k.absolute.top = bits - 1
    k.carrier.shift, k.tracking.leave_antiphase = bits - 3, spec.method.leave_antiphase
    _fill_sequencer(c.sequencer, spec)
    _fill_law(c.law, spec)
    c.speed.half = 1 << (spec.method.speed_bits - 1)
    fill_guard(c.guard, spec.protection, sample=spec.sample_period, speed=spec.limits.speed / spec.step)
    c.breaking = round(spec.protection.stuck_effort * (c.law.word_limit - 1))
    c.pwm.half = 1 << (spec.drive.pwm_bits - 1)
    _fill_detector(plant.detector, spec)
    plant.bridge.supply, plant.bridge.limit = spec.drive.supply, spec.limits.effort
    radius, mechanics = spec.mechanics.pulley_circumference / (2 * math.pi), spec.mechanics
    fill_drive_train(
        plant.train, spec.motor, mechanics.friction, radius=radius, travel=spec.limits.travel, period=spec.tick,
        mass=mechanics.carriage_mass + (spec.motor.rotor_inertia + mechanics.pulley_inertia) / radius**2,
        bridge_resistance=spec.drive.bridge_resistance, substep=SUBSTEP,
    )  # fmt: skip
    fill_interference(plant.interference, spec.disturbance.lines, spec.tick)
    fill_push(plant.push, spec.disturbance.push, spec.tick)
    if spec.home is not None:
        fill_marks(plant.home, spec.home, 0.0)  # a switch; the positioning points are the detector's
    return p


def velocity_table(spec: PhaseServoSpec) -> list[int]:
    """Reference velocity against distance [pulses per sample], up to the entry that all larger distances take (7).

    See `PhaseServoSpec.table_velocity`.
    """
    table: list[int] = []
    while not table or (table[-1] < spec.peak_count and len(table) < TABLE):
        table.append(spec.table_velocity(len(table)))
    return table


def _fill_detector(d: DetectorParams, spec: PhaseServoSpec) -> None:
    table, carrier = spec.detector, 1 / (spec.tick * spec.detector.counts)
    d.turns_per_metre = TURN / spec.pitch
    d.offset = -table.lag_counts * TURN // table.counts % TURN
    d.carrier_shift = 32 - (table.counts.bit_length() - 1)
    d.jitter = spec.edge_jitter * carrier * TURN
    fill_errors(d, table.gain_error, table.quadrature_error, table.offset_error / table.amplitude)


def _fill_sequencer(s: SequencerParams, spec: PhaseServoSpec) -> None:
    method = spec.method
    table = velocity_table(spec)
    s.threshold, s.last = method.threshold, len(table) - 1
    for n, velocity in enumerate(table):
        s.table[n] = velocity
    s.ready_ticks = round(method.ready_time / spec.tick)
    s.stop_ticks = NEVER // 2 if method.stop_always_off else round(method.stop_time / spec.tick)
    # Silence for more than half a turn of the reference counter against the carrier, and a step to spare (4).
    s.quiet_ticks = spec.detector.counts // 2 * spec.detector.counts
    s.incremental = method.final == "incremental"


def _fill_law(law: LawParams, spec: PhaseServoSpec) -> None:
    method = spec.method
    law.speed_k1, law.speed_k2, law.speed_k3 = method.speed_gains
    law.position_k1, law.position_k2, law.position_k3 = method.position_gains
    law.dead_band, law.integral_limit = method.dead_band, method.integral_limit
    law.corrector, law.integrator = method.corrector, method.integrator
    law.word_limit = 1 << (spec.drive.pwm_bits - 1)
