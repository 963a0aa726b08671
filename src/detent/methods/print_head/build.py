"""From a checked specification to the parameters of the axis: SI values to counts, emitters and microseconds."""

import math
from typing import TypeVar

from detent.axisfile.blocks import fill_drive_train, fill_encoder
from detent.files.fields import Table
from detent.methods.print_head.controller import PERIOD_US
from detent.methods.print_head.derive import HeadFigures
from detent.methods.print_head.plant import AVERAGED, SWITCH_LEVEL
from detent.methods.print_head.schema import COLUMN, EMITTER, FULL_DRIVE_COUNTS, SPEED_STEP, PrintHeadSpec, speed_value
from detent.methods.print_head.system import PrintHeadParams
from detent.plant.drive_train import DriveTrainParams
from detent.plant.switched_motor import fill_pulse_table

# Emitters between a frame and the stop target of an identification pass: the stop distance of 40 in/s again, so that a
# machine a third faster than its nameplate still stops before the frame.
CALIBRATION_MARGIN = 400

# Speed value of the slow identification pass, 10 in/s. A third of the way to the fast one must show in the measured
# speeds: 60 speed values at 40 in/s, as in the specification (3.3), less for an axis with a lower limit.
SLOW_PASS = 60

TableT = TypeVar("TableT", bound=Table)


def build_print_head(spec: PrintHeadSpec) -> PrintHeadParams:
    """Parameters of the print-head axis."""
    p = PrintHeadParams()
    plant = p.plant
    plant.fidelity = SWITCH_LEVEL if spec.axis.fidelity == "switch-level" else AVERAGED
    plant.supply = spec.disturbance.supply
    _fill_drive_train(plant.train, spec)
    fill_pulse_table(plant.train, plant.switched)
    pitch = spec.mechanics.pulley_circumference / (4 * spec.encoder.cycles_per_revolution)
    fill_encoder(plant.encoder, spec.encoder, pitch)
    # The left frame lies halfway between two emitters: on one, any error of its edge would move the zero by an emitter.
    plant.encoder.origin = -EMITTER / 2
    _fill_controller(p, spec)
    push = spec.disturbance.push
    if push is not None:
        plant.push.force = push.force
        plant.push.begin = round(push.at / (PERIOD_US * 1e-6))
        plant.push.end = round((push.at + push.duration) / (PERIOD_US * 1e-6))
    return p


def _fill_drive_train(t: DriveTrainParams, spec: PrintHeadSpec) -> None:
    mechanics, friction = spec.mechanics, spec.mechanics.friction
    machine, drift = HeadFigures(spec), 1 + spec.disturbance.motor_constant
    # The drift is that of the drive Vf = F R / k: with a drifted motor constant the force drifts by both.
    kinds = ("coulomb", "static", "viscous")
    right = _times(friction.right, kinds, 1 + spec.disturbance.friction_right, drift)
    left = _times(friction.left, kinds, 1 + spec.disturbance.friction_left, drift)
    start, end, obstacle = 0.0, spec.limits.travel, spec.disturbance.obstacle
    if obstacle is not None and mechanics.start_position < obstacle.position:
        end = obstacle.position
    elif obstacle is not None:
        start = obstacle.position
    fill_drive_train(
        t, _times(spec.motor, ("torque_constant", "back_emf_constant"), drift),
        friction.model_copy(update={"right": right, "left": left}), radius=machine.radius, mass=machine.mass,
        travel=end, start=start, period=PERIOD_US * 1e-6, bridge_resistance=spec.drive.bridge_resistance,
    )  # fmt: skip


def _times(table: TableT, keys: tuple[str, ...], *factors: float) -> TableT:
    """A table with some of its values multiplied."""
    return table.model_copy(update={key: math.prod((getattr(table, key), *factors)) for key in keys})


def _fill_controller(p: PrintHeadParams, spec: PrintHeadSpec) -> None:
    h, m = p.controller, spec.method
    h.span_steady = m.span == "steady"
    h.plausible.literal_intercept = m.intercept == "literal"
    h.plausible.slope_min, h.plausible.slope_max = m.slope_min, m.slope_max
    h.plausible.friction_max = m.friction_max_counts
    h.slope_default, h.friction_default, h.ir = m.default_slope, m.default_friction_counts, m.ir_counts
    for option in ("ack_last", "transition", "friction_jump", "trim", "overspeed_test", "memory"):
        setattr(h, option, getattr(m, option))
    share = spec.limits.effort / spec.drive.supply
    h.drive_limit = min(FULL_DRIVE_COUNTS, math.floor(share * FULL_DRIVE_COUNTS + 1e-9))
    h.zero_speed_us = round(m.zero_speed_timeout * 1e6)
    h.contact_us = round(spec.homing.contact_timeout * 1e6)
    h.homing_speed = speed_value(spec.homing.speed)
    h.homing_limit = min(spec.homing.drive_limit_counts, h.drive_limit)
    h.run_speed = speed_value(spec.limits.speed)
    h.print_speed = min(speed_value(m.max_print_speed), h.run_speed)
    h.expected_width = round(spec.limits.travel / EMITTER)
    h.width_tolerance = round(spec.homing.width_tolerance / EMITTER)
    h.calibration_margin = CALIBRATION_MARGIN
    h.plausible.rise_min = (h.run_speed - SLOW_PASS) // 3
    c, paper = p.controller.columns, p.plant.paper
    c.column_zero = paper.column_zero = round(spec.printing.left_margin / EMITTER * 256)
    c.column_pitch = paper.column_pitch = round(COLUMN / EMITTER * 256)
    paper.flight_time = spec.printing.flight_time
    c.lead_per_speed = round(SPEED_STEP * paper.flight_time / EMITTER * 65536)
    paper.metres_per_unit = EMITTER / 256
