import math

import pytest
from tests.print_head_rig import EXAMPLE
from tests.unit.methods.moves.samples import record, run_of

import detent
from detent.methods.load import load_spec
from detent.methods.moves.job import Move, MoveJob
from detent.methods.moves.page_data import CountUnit, Worst
from detent.methods.moves.run import MoveRecord, run_moves
from detent.methods.moves.summary import FAULT_WORDS, count_unit, move_figures, move_summary_rows, summary_rows
from detent.methods.phase_servo.host import PhaseHost
from detent.methods.print_head.print_job import parse_text
from detent.methods.print_head.run import PrintRun, print_job

pytestmark = pytest.mark.compiled


def rows_of(text: str, *overrides: str) -> tuple[PrintRun, dict[str, str]]:
    run = print_job(load_spec(EXAMPLE, overrides), parse_text(text))
    return run, dict(summary_rows(run))


def test_a_printed_job_shows_every_figure_with_its_unit() -> None:
    run, rows = rows_of("word\n" + " " * 120 + "edge\n")
    assert list(rows) == [
        "lines", "characters", "time", "speeds", "turn-arounds", "column error", "identified, right",
        "identified, left", "motor",
    ]  # fmt: skip
    assert rows["lines"] == "2 of 2, on 1 page"
    assert rows["characters"] == f"8, {8 / run.print_time:.0f} per second"
    assert rows["time"] == f"{run.print_time:.2f} s, after {run.time_ready:.2f} s of homing and identification"
    slower = min(run.speeds)
    assert rows["speeds"] == f"40 in/s (1 line), {slower / 6:.4g} in/s (1 line)"
    assert rows["column error"] == f"worst {run.worst_error * 1e6:.1f} µm, rms {run.rms_error * 1e6:.1f} µm"
    assert rows["identified, left"].startswith(
        f"slope K {run.identified['left'].slope} (true 170.0), friction 28 counts"
    )
    assert rows["motor"] == f"peak current {run.peak_current:.2f} A, energy {run.energy:.1f} J"


def test_thousands_are_grouped_with_plain_spaces() -> None:
    _, rows = rows_of(("x" * 70 + "\n") * 20)
    assert rows["characters"].startswith("1 400, ")


@pytest.mark.parametrize("place", ["7 in", "2 in"])
def test_of_a_run_that_came_to_nothing_only_what_happened_is_shown(place: str) -> None:
    _, rows = rows_of("word\n", f"disturbance.obstacle.position={place}")
    assert list(rows) == ["lines", "motor"]
    assert rows["lines"] == "0 of 1, on 1 page"


# ---- runs of moves


def moved(*records: MoveRecord, **changes: object) -> dict[str, str]:
    return dict(move_summary_rows(load_spec(detent.example("phase_servo.toml")), run_of(*records, **changes)))


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


def test_an_axis_of_one_mode_has_no_final_approach_and_counts_pulses() -> None:
    spec = load_spec(detent.example("filtered_servo.toml"))
    rows = dict(move_summary_rows(spec, run_of(record(1, 0.0, 0.02, switched=math.nan))))
    assert "final approach" not in rows
    assert rows["overshoot"] == "worst 5 µm, 1 pulse (move 1)"


def test_a_move_that_did_not_arrive_counts_in_its_error_but_not_in_the_settling() -> None:
    rows = moved(record(1, 0.0, 0.02), record(2, 0.02, 0.0, error=422e-6, settled=0.7), asked=5)
    assert rows["moves"] == "1 of 5"
    assert rows["time"] == "0.200 s"  # the rate of a job that broke off says nothing
    assert rows["settling"].startswith("median 82.0 ms, worst 82.0 ms (move 1)")
    assert rows["error at rest"] == "worst 422 µm, 64 steps (move 2)"


def test_an_axis_that_never_said_that_it_was_there_has_not_arrived() -> None:
    figures = move_figures(run_of(record(1, 0.0, 0.02, ready=math.nan)))
    assert (figures.arrived, figures.worst_time, figures.early) == (0, None, None)
    assert math.isnan(figures.median_time)
    assert math.isnan(figures.median_approach)


def test_a_move_of_no_way_does_not_shorten_the_median() -> None:
    far = record(1, 0.0, 0.02)
    figures = move_figures(run_of(far, *(record(n, 0.02, 0.02, settled=0.0) for n in range(2, 6))))
    assert figures.arrived == 5
    assert figures.median_time == pytest.approx(0.082)
    assert figures.worst_time == Worst(far.move_time, 1)


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
        "30 pulses put in, 1 pulse taken away, 2 speed samples lost"
    )
    assert "interference" not in moved(record(1, 0.0, 0.02), faults=dict.fromkeys(faults, 0))


def test_every_kind_of_interference_has_its_words() -> None:
    run = run_moves(
        PhaseHost(load_spec(detent.example("phase_servo.toml"))), MoveJob("one", "moves", (Move(1, 1, by=0.0),))
    )
    assert set(run.faults) == set(FAULT_WORDS)


def test_the_unit_of_an_axis_is_its_step_or_its_pulse() -> None:
    assert count_unit(load_spec(detent.example("phase_servo.toml"))) == CountUnit(0.0508 / 120 / 64, "step")
    assert count_unit(load_spec(detent.example("filtered_servo.toml"))) == CountUnit(5e-6, "pulse")
    assert CountUnit(1.0, "pulse").words == "pulses"
