import math
from dataclasses import replace

import numpy as np
import pytest
from tests.print_head_rig import make_spec

from detent.errors import AxisError, DetentError
from detent.methods.print_head.comparison import (
    DriveComparison,
    DriveConstants,
    DriveStart,
    MeasuringBench,
    compare_drives,
    default_constants,
    drift_text,
    identified_constants,
    nominal_constants,
)

pytestmark = pytest.mark.compiled

INCH = 0.0254
DRIFTED = ["disturbance.motor_constant=10 %", "disturbance.friction_right=20 %", "disturbance.friction_left=20 %"]
TRUE = DriveConstants(170, 170, 36, 28)


def test_constants_of_the_three_methods():
    spec = make_spec(overrides=DRIFTED)
    assert default_constants(spec) == DriveConstants(152, 152, 32, 32)
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
    weak = DriveConstants(100, 100, 0, 0)
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
    assert start.time_to_band < 0.08


def test_speeds_above_the_limit_are_left_out():
    found = compare_drives(make_spec(overrides=["limits.speed=30 in/s"]))
    assert [round(v / INCH) for v in found.speeds] == [20, 10]
    assert found.errors.shape == (3, 2, 2)
    assert found.target == pytest.approx(30 * INCH)
    assert len(found.starts) == len(found.methods) == len(found.constants) == 3


@pytest.mark.parametrize("speeds", [(9 * INCH,), (1.2,), ()])
def test_speeds_that_cannot_be_compared_are_refused(speeds):
    with pytest.raises(DetentError, match=r"comparison of drives: got .*; expected: 10 in/s to 40 in/s"):
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


METHODS = ("power-on default", "nominal table", "identified")


@pytest.fixture
def found():
    """Three drives; the second gave up on its start, the first never comes within 1 %."""
    t = np.linspace(0, 1, 1001)
    starts = [
        DriveStart(t=t[:rows], velocity=40 * INCH * np.minimum(t[:rows] / end, stop), mean_error=0.01,
                   time_to_band=0.0)
        for end, stop, rows in ((0.5, 0.9, 1001), (0.4, 1.0, 201), (0.07, 1.0, 1001))
    ]  # fmt: skip
    errors = [[[-0.457, -0.238], [-0.254, -0.199]], [[-0.274, -0.238], [-0.134, -0.125]], [[0.004, -0.003]] * 2]
    return DriveComparison(
        methods=METHODS,
        constants=(TRUE,) * 3,
        speeds=(10 * INCH, 40 * INCH),
        errors=np.array(errors),
        starts=tuple(starts),
        target=40 * INCH,
        machine="K +10 %",
    )


def test_the_table_says_every_error(found):
    title, heads, rows = found.table
    assert "K +10 %" in title
    assert heads == ("speed", *METHODS)
    assert rows == [
        ("10 in/s", "-45.7% / -23.8%", "-27.4% / -23.8%", "+0.4% / -0.3%"),
        ("40 in/s", "-25.4% / -19.9%", "-13.4% / -12.5%", "+0.4% / -0.3%"),
    ]


def test_errors_stand_over_the_commanded_speed_left_negative(found):
    figure = found.figures()[0]
    (chart,) = figure.charts
    drawn = {series["label"]: dict(zip(chart["x"], series["y"], strict=True)) for series in chart["series"]}
    assert list(drawn) == list(METHODS)
    assert drawn["power-on default"] == {-44: None, -40: -19.9, -10: -23.8, 10: -45.7, 40: -25.4, 44: None}
    assert drawn["identified"][40] == 0.4
    low, high = chart["yRange"]
    assert low < -45.7
    assert high > 0.4
    assert figure.table.rows == found.table.rows


def test_speeds_may_come_in_any_order(found):
    turned = replace(found, speeds=found.speeds[::-1], errors=found.errors[:, ::-1])
    assert turned.figures()[0].charts == found.figures()[0].charts


def test_starts_are_drawn_whole_and_magnified_around_the_target(found):
    figure = found.figures()[1]
    whole, near = figure.charts
    for chart in (whole, near):
        assert [series["label"] for series in chart["series"]] == list(METHODS)
        x, default, gave_up = chart["x"], *(series["y"] for series in chart["series"][:2])
        assert max(default) == pytest.approx(36.0)
        assert all((y is None) == (t > 0.2005) for t, y in zip(x, gave_up, strict=True))
    assert near["yRange"] == pytest.approx([38.0, 41.2])
    assert [level["y"] for level in near["levels"]] == pytest.approx([40.4, 39.6])
    assert [row[3] for row in figure.table.rows] == ["not reached", "not reached", "0.07"]
    assert [row[1] for row in figure.table.rows] == ["170 / 170"] * 3


@pytest.mark.parametrize(
    ("velocity", "settled"),
    [((1.0, 1.0, 1.0, 1.0), 0.0), ((0.0, 1.0, 0.0, 1.0), 3.0), ((0.0, 1.0, 1.0, 0.0), math.inf),
     ((0.0, math.nan, 1.0, 1.0), 2.0), ((0.0, 0.995, 1.009, 1.0), 1.0)],
)  # fmt: skip
def test_settling_counts_from_the_last_time_outside(velocity, settled):
    start = DriveStart(t=np.arange(4.0), velocity=np.array(velocity), mean_error=0.0, time_to_band=0.0)
    assert start.settled(1.0) == settled


@pytest.mark.parametrize(
    ("overrides", "text"),
    [
        ([], "machine as in its file"),
        (["disturbance.friction_left=-5 %", "disturbance.motor_constant=2.5 %"], "K +2.5 %, friction left -5 %"),
        (["disturbance.supply=34 V"], "supply 34 V instead of 38 V"),
    ],
)
def test_drift_is_told_in_a_few_words(overrides, text):
    assert drift_text(make_spec(overrides=overrides)) == text
