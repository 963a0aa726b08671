"""Every key of the axis file does something: no option that is read and then forgotten.

For each key a value is given that the axis must notice. "Notice" means more than another parameter: the axis prints a
line from power-on twice, without and with the value, and its registers must come out different.
"""

import math
from functools import cache

import numpy as np
import pytest
from tests.face_rig import FACE_KEYS
from tests.live_bench import Bench
from tests.print_head_rig import EXAMPLE, TICK
from tests.reference import reference_rows

from detent.files.fields import leaf_fields, options_of
from detent.files.problems import dotted
from detent.methods.check import check_spec
from detent.methods.load import load_spec, read_axis
from detent.methods.print_head.build import build_print_head
from detent.methods.print_head.print_job import parse_text
from detent.methods.print_head.run import print_job
from detent.methods.print_head.schema import EMITTER, PrintHeadSpec
from detent.methods.print_head.system import PrintHead
from detent.record.recorder import Recorder

pytestmark = pytest.mark.compiled

JOB = parse_text("The quick brown fox jumps\n     over the lazy dog, and\nback.\n", "fox")

PUSH = ("disturbance.push.force=1 N", "disturbance.push.at=1 s", "disturbance.push.duration=1 s")

# What identification finds is called implausible, so the defaults drive a head that needs far less to the left.
TOO_FAST = ("method.slope_min=151", "disturbance.motor_constant=-15 %", "disturbance.friction_left=-60 %")

# Key: the value, and what must hold for it to matter.
CHANGES: dict[str, tuple[str, tuple[str, ...]]] = {
    "axis.fidelity": ("switch-level", ()),
    "limits.travel": ("14 in", ()),
    "limits.speed": ("30 in/s", ()),
    "limits.effort": ("20 V", ()),
    "motor.catalogue": ("maxon RE 40 148877", ()),
    "motor.torque_constant": ("0.25 N*m/A", ()),
    "motor.back_emf_constant": ("0.25 V*s/rad", ()),
    "motor.resistance": ("13 ohm", ()),
    "motor.inductance": ("10 mH", ()),
    "motor.rotor_inertia": ("300 g*cm^2", ()),
    "drive.supply": ("40 V", ()),
    "drive.bridge_resistance": ("1 ohm", ()),
    "mechanics.pulley_circumference": ("3.002 in", ()),
    "mechanics.carriage_mass": ("1.2 kg", ()),
    "mechanics.belt_mass": ("60 g", ()),
    "mechanics.start_position": ("3 in", ()),
    "mechanics.friction.right.coulomb": ("8 N", ()),
    "mechanics.friction.right.viscous": ("1 N*s/m", ()),
    "mechanics.friction.right.static": ("14 N", ()),
    "mechanics.friction.left.coulomb": ("6.5 N", ()),
    "mechanics.friction.left.viscous": ("1 N*s/m", ()),
    "mechanics.friction.left.static": ("13 N", ()),
    "encoder.cycles_per_revolution": ("901", ("mechanics.pulley_circumference=3.002 in",)),
    "encoder.jitter": ("5 deg", ()),
    "encoder.missing_edges": ("0.001", ()),
    "encoder.seed": ("2", ("encoder.jitter=5 deg",)),
    "method.span": ("steady", ()),
    "method.intercept": ("literal", ("disturbance.motor_constant=10 %",)),
    "method.ack_last": ("true", ()),
    "method.transition": ("false", ()),
    "method.friction_jump": ("false", ()),
    "method.trim": ("false", ("disturbance.motor_constant=3 %", "disturbance.friction_right=15 %")),
    "method.overspeed_test": ("false", ("method.max_print_speed=5 in/s", *TOO_FAST)),
    "method.memory": ("false", ("disturbance.friction_right=7 %", "disturbance.friction_left=7 %")),
    "method.default_slope": ("160", ()),
    "method.default_friction_counts": ("36", ()),
    "method.ir_counts": ("90", ()),
    "method.slope_min": ("180", ("method.default_slope=190",)),
    "method.slope_max": ("160", ()),
    "method.friction_max_counts": ("33", ()),
    "method.zero_speed_timeout": ("7 ms", ()),
    "method.max_print_speed": ("30 in/s", ()),
    "homing.speed": ("4 in/s", ()),
    "homing.drive_limit_counts": ("80", ()),
    "homing.contact_timeout": ("60 ms", ()),
    "homing.width_tolerance": ("2 in", ("disturbance.obstacle.position=13.5 in",)),
    "print.left_margin": ("2 in", ()),
    "print.flight_time": ("300 us", ()),
    "disturbance.motor_constant": ("5 %", ()),
    "disturbance.friction_right": ("10 %", ()),
    "disturbance.friction_left": ("10 %", ()),
    "disturbance.supply": ("36 V", ()),
    "disturbance.obstacle.position": ("10 in", ("disturbance.obstacle.position=11 in",)),
    "disturbance.push.force": ("2 N", PUSH),
    "disturbance.push.at": ("1.5 s", PUSH),
    "disturbance.push.duration": ("2 s", PUSH),
}  # fmt: skip

# Keys that are no matter of the machine, each with the test that holds them.
ELSEWHERE = {
    "axis.name": "test_the_name_is_on_everything",
    "axis.creep": "test_whoever_operates_it_is_told_how_fast_it_creeps",
    "axis.method": "test_there_is_one_method",
    "motor.max_current": "test_the_largest_current_is_warned_about",
}


def test_each_key_of_the_schema_is_tried() -> None:
    assert set(CHANGES) | set(ELSEWHERE) | FACE_KEYS == {row.key for row in reference_rows("print_head")}
    assert all(name in globals() for name in ELSEWHERE.values())


@cache
def registers_after(overrides: tuple[str, ...]) -> tuple[bytes, ...]:
    """Registers at the end of a job on the axis of `overrides`, and on the way."""
    spec = load_spec(EXAMPLE, overrides)
    recorder = Recorder(PrintHead, ["all"], every=250, period=TICK)
    print_job(spec, JOB, recorder=recorder)
    trace = recorder.trace()
    return tuple(trace[name].tobytes() for name in trace)


@pytest.mark.parametrize("key", CHANGES)
def test_a_key_changes_what_the_axis_does(key: str) -> None:
    value, context = CHANGES[key]
    assert registers_after((*context, f"{key}={value}")) != registers_after(context)


def test_the_name_is_on_everything() -> None:
    assert read_axis(EXAMPLE, ["axis.name=left head"]).spec.axis.name == "left head"


def test_whoever_operates_it_is_told_how_fast_it_creeps() -> None:
    told = [Bench("print_head", *given).host.axis.live.operation.creep for given in ((), ("axis.creep=5 %",))]
    assert told == [0.1, 0.05]


def test_there_is_one_method() -> None:
    (field,) = [field for path, field in leaf_fields(PrintHeadSpec) if dotted(path) == "axis.method"]
    assert options_of(field) == ("print_head",)


def test_the_largest_current_is_warned_about() -> None:
    stated, lower = (check_spec(read_axis(EXAMPLE, [f"motor.max_current={text}"])) for text in ("9 A", "0.2 A"))
    assert {str(w) for w in lower.warnings} > {str(w) for w in stated.warnings}


def test_the_parameters_of_the_default_axis_are_those_of_the_specification() -> None:
    p = build_print_head(load_spec(EXAMPLE))
    assert (p.controller.ir, p.controller.slope_default, p.controller.friction_default, p.controller.drive_limit) == (
        96,
        152,
        32,
        300,
    )
    assert (p.controller.run_speed, p.controller.print_speed, p.controller.homing_speed, p.controller.homing_limit) == (
        240,
        240,
        30,
        110,
    )
    assert (p.controller.expected_width, p.controller.width_tolerance) == (4350, 15)
    assert (p.controller.columns.column_zero, p.controller.columns.column_pitch) == (450 * 256, 640)
    assert p.plant.encoder.edge_pitch == pytest.approx(EMITTER / 4, rel=1e-12)
    # A wire at 40 in/s is fired 350 us x 40 in/s = 4.2 emitters early.
    assert p.controller.columns.lead_per_speed * 240 / 65536 == pytest.approx(4.2, rel=1e-3)


@pytest.mark.parametrize(
    ("effort", "counts"), [("38 V", 300), ("19 V", 150), ("18.99 V", 149), ("3.8 V", 30)]
)  # fmt: skip
def test_the_effort_limits_the_drive_and_is_never_passed(effort: str, counts: int) -> None:
    p = build_print_head(load_spec(EXAMPLE, [f"limits.effort={effort}"]))
    assert p.controller.drive_limit == counts
    assert p.controller.homing_limit == min(110, counts)


def test_drift_is_known_to_the_machine_and_not_to_the_computer() -> None:
    stated = build_print_head(load_spec(EXAMPLE))
    drifted = build_print_head(
        load_spec(
            EXAMPLE, ["disturbance.motor_constant=10 %", "disturbance.friction_right=20 %", "disturbance.supply=34 V"]
        )
    )
    assert bytes(drifted.controller) == bytes(stated.controller)
    assert drifted.plant.supply == 34.0
    assert drifted.plant.train.force_constant == pytest.approx(1.1 * stated.plant.train.force_constant)
    assert drifted.plant.train.emf_constant == pytest.approx(1.1 * stated.plant.train.emf_constant)
    # The drift is that of the drive that overcomes friction, F R / k: the force drifts by both.
    assert drifted.plant.train.friction.coulomb_right == pytest.approx(
        1.1 * 1.2 * stated.plant.train.friction.coulomb_right
    )
    assert drifted.plant.train.friction.coulomb_left == pytest.approx(1.1 * stated.plant.train.friction.coulomb_left)


@pytest.mark.parametrize(("place", "left", "right"), [("7 in", 0.0, 7.0), ("2 in", 2.0, 14.5)])
def test_an_obstacle_bounds_the_side_the_head_does_not_stand_on(place: str, left: float, right: float) -> None:
    p = build_print_head(load_spec(EXAMPLE, [f"disturbance.obstacle.position={place}"]))
    assert p.plant.train.left_end == pytest.approx(left * 0.0254)
    assert p.plant.train.right_end == pytest.approx(right * 0.0254)
    assert p.controller.expected_width == 4350


def test_a_push_begins_and_ends_with_its_ticks() -> None:
    texts = ["disturbance.push.force=-3 N", "disturbance.push.at=2 s", "disturbance.push.duration=60 ms"]
    push = build_print_head(load_spec(EXAMPLE, texts)).plant.push
    assert (push.force, push.begin, push.end) == (-3.0, 50_000, 51_500)
    none = build_print_head(load_spec(EXAMPLE)).plant.push
    assert (none.force, none.begin, none.end) == (0.0, 0, 0)


def test_jitter_is_counted_in_quarter_cycles() -> None:
    p = build_print_head(load_spec(EXAMPLE, ["encoder.jitter=9 deg"]))
    assert p.plant.encoder.jitter == pytest.approx(math.radians(9) / (math.pi / 2)) == pytest.approx(0.1)


def test_a_substep_is_short_against_the_fastest_time_constant() -> None:
    for inductance in ("12 mH", "0.05 mH"):
        t = build_print_head(load_spec(EXAMPLE, [f"motor.inductance={inductance}"])).plant.train
        assert t.substep <= 0.25 * t.inductance / t.resistance
        assert np.isfinite(t.substep)
        assert t.substep > 0
