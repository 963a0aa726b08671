import math

import pytest
from tests.unit.methods.stepper_envelope.samples import motor_move, record, run_of

import detent
from detent.methods.load import load_spec
from detent.methods.stepper_envelope.run import StageMoveRecord
from detent.methods.stepper_envelope.summary import StageFigures, stage_summary_rows


@pytest.fixture(scope="module")
def spec():
    return load_spec(detent.example("zoom.toml"))


def rows_of(spec, *records: StageMoveRecord, **changes: object) -> dict[str, str]:
    return dict(stage_summary_rows(spec, run_of(*records, **changes)))


def test_every_figure_has_its_row(spec) -> None:
    rows = rows_of(
        spec,
        record(1, group_a=motor_move(), group_b=motor_move(arrived=0.05, steps=100, naive=0.25, peak_lag=1.04)),
        record(2, group_a=motor_move(start=1e-3, target=0.0, margin=2.0, rest_lag=-0.06, peak_hz=4000.0, steps=400)),
    )
    assert rows == {
        "moves": "2 of 2",
        "time": "0.400 s, 300 moves per minute",
        "moving": "0.200 s; at the constant start frequency 1 s, 5.00 times as long",
        "lost steps": "0 of 700",
        "rotor lag": "up to 1.04 steps (move 1, group_b); falls out of step at 2",
        "at rest": "within 0.060 steps of its place (move 2, group_a)",
        "torque margin": "at least 2 (move 2, group_a); falls behind below 1",
        "peak": "4 000 Hz (move 2, group_a), 20 mm/s",
    }


def test_tiles_go_by_their_names(spec) -> None:
    rows = rows_of(spec, record(1, "B7", group_a=motor_move()), kind="tiles")
    assert rows["tiles"] == "1 of 1"
    assert rows["time"] == "0.200 s, 300 tiles per minute"
    assert rows["rotor lag"].startswith("up to 1 step (tile B7, group_a)")
    assert "moves" not in rows


def test_lost_steps_are_told_by_motor_and_from_where_on(spec) -> None:
    rows = rows_of(
        spec,
        record(1, group_a=motor_move()),
        record(2, group_a=motor_move(lost=12), group_b=motor_move()),
        record(3, group_a=motor_move(lost=-4)),
        record(4, group_b=motor_move()),
    )
    assert rows["lost steps"] == "group_a 8 (from move 2 on), of 1 000"
    # Where a rotor stands 8 steps off, moves of the other motor are not in place either.
    assert rows["in their places"] == "1 move"


def test_steps_lost_both_ways_are_lost_though_they_cancel(spec) -> None:
    rows = rows_of(spec, record(1, group_a=motor_move(lost=4)), record(2, group_a=motor_move(lost=-4)))
    assert rows["lost steps"] == "0 in the end (from move 1 on), of 400"
    assert rows["in their places"] == "1 move"


@pytest.mark.parametrize("changes", [{"missed": 3}, {"rest_lag": 0.6}, {"rest_lag": -0.6}, {"lost": 4}])
def test_a_motor_beside_its_place_is_not_in_place(spec, changes) -> None:
    found = StageFigures(spec, run_of(record(1, group_a=motor_move(**changes))))
    assert found.placed == 0
    assert StageFigures(spec, run_of(record(1, group_a=motor_move(rest_lag=0.5)))).placed == 1


def test_time_in_motion_is_that_of_the_motor_that_ran_longest(spec) -> None:
    found = StageFigures(
        spec, run_of(record(1, group_a=motor_move(arrived=0.03, naive=0.7), group_b=motor_move(naive=0.2)))
    )
    assert (found.moving, found.naive) == (pytest.approx(0.1), 0.7)
    assert found.faster == pytest.approx(7.0)


def test_of_equal_figures_the_first_is_named(spec) -> None:
    records = [record(n, group_a=motor_move(peak_lag=1.0 + n * 1e-6, margin=2.0 - n * 1e-6)) for n in (1, 2, 3)]
    found = StageFigures(spec, run_of(*records))
    assert (found.lag.value, found.lag.of.move.number) == (1.000001, 1)
    assert (found.margin.value, found.margin.of.move.number) == (1.999999, 1)


def test_a_motor_that_needs_no_torque_has_no_margin(spec) -> None:
    found = StageFigures(spec, run_of(record(1, group_a=motor_move(margin=math.inf), group_b=motor_move(margin=7.0))))
    assert (found.margin.value, found.margin.of.name) == (7.0, "group_b")
    rows = rows_of(spec, record(1, group_a=motor_move(margin=math.inf)))
    assert "torque margin" not in rows


def test_of_a_job_in_which_nothing_moved_only_what_happened_is_told(spec) -> None:
    assert rows_of(spec, record(1)) == {"moves": "1 of 1", "time": "0.200 s, 300 moves per minute"}
    assert rows_of(spec, asked=3) == {"moves": "0 of 3"}
    assert math.isnan(StageFigures(spec, run_of(record(1))).faster)


def test_steps_of_all_motors_are_counted_as_lost(spec) -> None:
    found = StageFigures(spec, run_of(record(1, group_a=motor_move(lost=4), group_b=motor_move(lost=-8))))
    assert found.all_lost == 12
    assert (found.first_lost.motor.lost, found.first_lost.name) == (4, "group_a")


def test_steps_lost_before_are_added_to_those_missed(spec) -> None:
    found = StageFigures(
        spec, run_of(record(1, group_a=motor_move(lost=4)), record(2), record(3, group_a=motor_move(missed=1, lost=-8)))
    )
    assert [[motion.off for motion in motions] for motions in found.by_move] == [[4], [], [-3]]
    assert found.moved == ["group_a"]
