import math

import pytest
from tests.unit.methods.moves.samples import record, run_of

import detent
from detent.methods.load import load_spec
from detent.methods.moves.job import Move, MoveJob
from detent.methods.moves.run import MoveRecord, run_moves
from detent.methods.moves.summary import FAULT_WORDS, MoveFigures, move_summary
from detent.methods.phase_servo.host import PhaseHost
from detent.page.run_page import Worst
from detent.page.words import CountUnit

pytestmark = pytest.mark.compiled

STEPS = CountUnit(0.0508 / 120 / 64, "step")


def moved(*records: MoveRecord, **changes: object) -> dict[str, str]:
    return dict(move_summary(run_of(*records, **changes), STEPS))


def test_a_list_of_moves_shows_every_figure_with_its_unit_and_whose_it_is() -> None:
    rows = moved(
        record(1, 0.0, 0.02),
        record(2, 0.02, 0.0, settled=0.6 + 0.0825, overshoot=8e-6, peak_speed=0.346),
        record(3, 0.0, 0.01, settled=0.7 + 0.0816, error=-4e-6),
    )
    assert rows == {
        "moves": "3 of 3",
        "time": "0.300 s, 10.0 moves per second",
        "settling": "median 82.0 ms, worst 82.5 ms (move 2), from the command until within 20 µm for good",
        "final approach": "median 2.00 ms, worst 2.50 ms (move 2), from the mode switch until within 20 µm for good",
        "overshoot": "worst 8 µm, 1.2 steps (move 2)",
        "error at rest": "worst 4 µm, 0.60 steps (move 3)",
        "peak speed": "346 mm/s (move 2)",
        "motor": "peak current 5.99 A, energy 7.3 J",
    }


def test_a_text_counts_its_characters() -> None:
    rows = moved(record(1, 0.0, 0.02), record(2, 0.02, 0.03), kind="text")
    assert rows["characters"] == "2 of 2"
    assert rows["time"] == "0.200 s, 10.0 characters per second"
    assert "moves" not in rows


def test_an_axis_of_one_mode_has_no_final_approach() -> None:
    rows = dict(move_summary(run_of(record(1, 0.0, 0.02, switched=math.nan)), CountUnit(5e-6, "pulse")))
    assert "final approach" not in rows
    assert rows["overshoot"] == "worst 5 µm, 1 pulse (move 1)"


def test_a_move_that_did_not_arrive_counts_in_its_error_but_not_in_the_settling() -> None:
    rows = moved(record(1, 0.0, 0.02), record(2, 0.02, 0.0, error=422e-6, settled=0.7), asked=5)
    assert rows["moves"] == "1 of 5"
    assert rows["time"] == "0.200 s"  # the rate of a job that broke off says nothing
    assert rows["settling"].startswith("median 82.0 ms, worst 82.0 ms (move 1)")
    assert rows["error at rest"] == "worst 422 µm, 64 steps (move 2)"


def test_an_axis_that_never_said_that_it_was_there_has_not_arrived() -> None:
    figures = MoveFigures(run_of(record(1, 0.0, 0.02, ready=math.nan)))
    assert (figures.there, figures.longest, figures.earliest) == ([], None, None)


def test_a_move_of_no_way_does_not_shorten_the_median() -> None:
    far = record(1, 0.0, 0.02)
    figures = MoveFigures(run_of(far, *(record(n, 0.02, 0.02, settled=0.0) for n in range(2, 6))))
    assert len(figures.there) == 5
    assert figures.went == [far]
    assert figures.longest == Worst(far.settling, far)


def test_ready_before_there_for_good_is_told() -> None:
    late = record(2, 0.02, 0.0, settled=0.6 + 0.0851)
    rows = moved(record(1, 0.0, 0.02), late, record(3, 0.0, 0.02, settled=0.7 + 0.0840))
    assert rows["ready too early"] == "2 moves, by up to 2.10 ms (move 2)"
    assert "ready too early" not in moved(record(1, 0.0, 0.02))


def test_of_a_job_that_began_with_a_fault_only_what_happened_is_shown() -> None:
    assert list(moved(asked=3)) == ["moves", "motor"]
    assert moved(asked=3)["moves"] == "0 of 3"


def test_interference_is_counted_in_words() -> None:
    faults = {"inserted": 30, "removed": 1, "lost samples": 2, "corrupted": 0}
    assert moved(record(1, 0.0, 0.02), faults=faults)["interference"] == (
        "30 pulses inserted, 1 pulse removed, 2 speed samples lost"
    )
    assert "interference" not in moved(record(1, 0.0, 0.02), faults=dict.fromkeys(faults, 0))


def test_every_kind_of_interference_has_its_words() -> None:
    run = run_moves(
        PhaseHost(load_spec(detent.example("phase_servo.toml"))), MoveJob("one", "moves", (Move(1, 1, by=0.0),))
    )
    assert set(run.faults) == set(FAULT_WORDS)
