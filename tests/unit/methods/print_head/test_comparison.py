import math

import numpy as np
import pytest
from tests.print_head_rig import make_spec

from detent.errors import AxisError, DetentError
from detent.methods.print_head.comparison import (
    DriveConstants,
    MeasuringBench,
    compare_drives,
    default_constants,
    identified_constants,
    nominal_constants,
)

pytestmark = pytest.mark.compiled

INCH = 0.0254
DRIFTED = ["disturbance.motor_constant=10 %", "disturbance.friction_right=20 %", "disturbance.friction_left=20 %"]
TRUE = DriveConstants(slope_right=170, slope_left=170, friction_right=36, friction_left=28)


def test_constants_of_the_three_methods():
    spec = make_spec(overrides=DRIFTED)
    assert default_constants(spec) == DriveConstants(
        slope_right=152, slope_left=152, friction_right=32, friction_left=32
    )
    assert nominal_constants(spec) == TRUE  # the nameplate knows nothing of the drift
    found = identified_constants(spec)
    assert (found.slope_right, found.slope_left) == pytest.approx((187, 187), abs=2.5)
    assert (found.friction_right, found.friction_left) == pytest.approx((43.2, 33.6), abs=1.5)


def test_nominal_table_keeps_to_the_nameplate_supply():
    assert nominal_constants(make_spec(overrides=["disturbance.supply=34 V"])) == TRUE


def test_the_true_constants_drive_at_the_true_speed():
    bench = MeasuringBench(make_spec())
    for speed in (40, 20, 10):
        for direction in (1, -1):
            # Truncation of K s / 256 takes up to one count: 1 / (170/256 s) of the speed, and never adds one.
            error = bench.open_loop_error(TRUE, speed * INCH, direction)
            assert -256 / 170 / (6 * speed) - 1e-6 <= error <= 1e-6


def test_drive_below_friction_does_not_move_the_head():
    spec = make_spec(right=36, overrides=["disturbance.friction_right=500 %"])
    weak = DriveConstants(slope_right=100, slope_left=100, friction_right=0, friction_left=0)
    assert MeasuringBench(spec).open_loop_error(weak, 10 * INCH, 1) == -1.0
    start = MeasuringBench(spec).start(weak, 10 * INCH)
    assert start.mean_error == -1.0
    assert math.isinf(start.time_to_band)


def test_a_start_is_recorded_from_its_first_tick():
    start = MeasuringBench(make_spec()).start(TRUE, 40 * INCH)
    assert start.t[0] == pytest.approx(40e-6)
    assert np.diff(start.t) == pytest.approx(np.full(len(start.t) - 1, 40e-6))
    assert start.t[-1] == pytest.approx(1.2)
    assert start.velocity[0] == 0.0
    assert start.velocity[-1] == pytest.approx(40 * INCH, rel=0.015)
    assert start.steady_from == pytest.approx(66.5e-3, abs=1e-3)
    assert start.time_to_band < 0.08


def test_speeds_above_the_limit_are_left_out():
    found = compare_drives(make_spec(overrides=["limits.speed=30 in/s"]))
    assert [round(v / INCH) for v in found.speeds] == [20, 10]
    assert found.errors.shape == (3, 2, 2)
    assert found.target == pytest.approx(30 * INCH)
    assert len(found.starts) == len(found.methods) == len(found.constants) == 3


@pytest.mark.parametrize("speeds", [(9 * INCH,), (1.2,), ()])
def test_speeds_that_cannot_be_compared_are_refused(speeds):
    with pytest.raises(DetentError, match=r"comparison of drives: came .*; allowed: 10 in/s to 40 in/s"):
        compare_drives(make_spec(), speeds)


def test_a_failed_identification_is_the_axis_error():
    with pytest.raises(AxisError, match="CALCULATE PARAMETERS failed: "):
        compare_drives(make_spec(overrides=["disturbance.obstacle.position=7 in"]))


def test_an_obstacle_and_a_push_do_not_disturb_the_bench():
    plain = MeasuringBench(make_spec())
    disturbed = MeasuringBench(
        make_spec(
            overrides=[
                "disturbance.obstacle.position=7 in",
                "disturbance.push.force=9 N",
                "disturbance.push.at=0.1 s",
                "disturbance.push.duration=5 s",
            ]
        )
    )
    assert disturbed.open_loop_error(TRUE, 1.0, 1) == plain.open_loop_error(TRUE, 1.0, 1)
