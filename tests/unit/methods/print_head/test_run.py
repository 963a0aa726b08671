import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from tests.places import DATA
from tests.print_head_rig import EXAMPLE

import detent
from detent.errors import InputError
from detent.files.quantities import INCH
from detent.methods.load import load_spec
from detent.methods.print_head.print_job import load_job, parse_text
from detent.methods.print_head.printed_page import PrintJob
from detent.methods.print_head.run import (
    ERROR_BIN,
    ERROR_BINS,
    SIGNALS,
    PrintRun,
    SimulatedPrinting,
    count_errors,
    print_job,
)
from detent.methods.print_head.schema import EMITTER
from detent.methods.print_head.system import TICK, PrintHead
from detent.record.recorder import Recorder
from detent.record.trace import Trace

pytestmark = pytest.mark.compiled

STREAM = DATA / "workloads/daisywheel_diablo630/wsprint.prn"
LETTER = load_job(detent.example("letter.txt"))
PUSH = ("disturbance.push.at=8 s", "disturbance.push.duration=60 ms")


def untold(_share: float, _text: str) -> None:
    """Progress that nobody wants to see."""


def play(job: PrintJob | str, *overrides: str) -> PrintRun:
    return print_job(load_spec(EXAMPLE, overrides), job if isinstance(job, PrintJob) else parse_text(job))


def play_recorded(job: PrintJob | str, *overrides: str, every: int = 5) -> tuple[PrintRun, Trace, bytes]:
    recorder = Recorder(PrintHead, SIGNALS, every=every, period=TICK)
    runner = SimulatedPrinting(
        load_spec(EXAMPLE, overrides), job if isinstance(job, PrintJob) else parse_text(job), recorder, untold
    )
    runner.prepare()
    runner.print_all()
    runner.machine.close()
    return runner.finish(), recorder.trace(), runner.state.snapshot()


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(detent.example("letter.txt"), id="letter"),
        pytest.param(detent.example("brochure.prn"), id="brochure"),
        pytest.param(
            STREAM,
            id="wsprint",
            marks=pytest.mark.skipif(not STREAM.is_file(), reason=f"no recorded stream at {STREAM}"),
        ),
    ],
)
def test_a_job_is_printed_whole(path: Path) -> None:
    job = load_job(path)
    run = play(job)
    assert run.done
    assert run.failure == ""
    assert run.missed == 0
    assert [line.number for line in run.lines] == [line.number for line in job.lines]
    assert run.characters == job.characters == sum(line.characters for line in run.lines)
    # Every character, on its own line, with ink that landed within a tenth of a dot of its place.
    assert [(s.line, s.character) for s in run.strikes] == [
        (line.number, c) for line in job.lines for c in line.characters
    ]
    assert max(abs(s.offset) for s in run.strikes) < 20e-6
    assert run.worst_error < 20e-6
    assert run.rms_error > 0.1e-6  # an axis without any error would be none
    for before, after in pairwise(run.lines):
        assert before.start < before.stop <= after.start
    assert run.lines[0].start >= run.time_ready
    assert run.lines[-1].stop == pytest.approx(run.time_end)


def test_every_line_has_the_ink_of_its_characters() -> None:
    run = play("il\nW_W\n" + "x" * 40 + "\n")
    # A character of twelve columns leaves one blank at each side: ten columns of ink.
    assert [line.columns for line in run.lines] == [20, 30, 400]
    assert [line.missed for line in run.lines] == [0, 0, 0]


def test_directions_alternate_and_the_head_turns_around() -> None:
    run = play(LETTER)
    assert {line.direction for line in run.lines} == {1, -1}
    assert all(a.direction == -b.direction for a, b in pairwise(run.lines))
    assert run.turn_arounds == sum(line.turn_around for line in run.lines) == len(run.lines) - 1
    assert run.repositions == 0
    assert not run.lines[0].turn_around
    assert run.peak_current > 0.5
    assert run.energy > 1


def test_printing_at_full_speed_is_worth_it() -> None:
    fast, slow = play(LETTER), play(LETTER, "method.max_print_speed=10 in/s")
    assert fast.speeds == {240: 11}
    assert slow.speeds == {60: 11}
    assert 1.5 < slow.print_time / fast.print_time < 4.5
    assert fast.characters_per_second == pytest.approx(fast.characters / fast.print_time)


def test_white_space_is_skipped() -> None:
    far = "\n" * 5 + " " * 60 + "far\n" + "\n" * 40 + " " * 60 + "away\n"
    run, trace, _ = play_recorded(far)
    assert [line.number for line in run.lines] == [1, 2]
    assert [line.characters for line in run.lines] == [3, 4]
    second = trace.between(run.lines[1].start, run.lines[1].stop)["plant.train.position"]
    # Column 0 is 1.5 in from the frame and the words stand 6 in to the right of it; a ramp to 40 in/s takes 1.33 in.
    assert second.min() > (7.5 - 2) * INCH
    assert second.max() < (7.5 + 0.4 + 3) * INCH
    short = play("far\naway\n")
    assert run.print_time < short.print_time + 0.4


def test_a_narrow_line_leaves_room_for_full_speed_and_a_wide_one_does_not() -> None:
    speeds = [play("x" * width).lines[0].speed_value for width in (10, 60, 110, 118, 122, 126, 129)]
    assert speeds[:3] == [240, 240, 240]
    assert all(a > b for a, b in pairwise(speeds[2:]))
    assert speeds[-1] >= 18


def test_a_word_at_the_right_edge_is_printed_slower_than_the_same_in_the_middle() -> None:
    run = play(" " * 50 + "word\n" + " " * 120 + "word\n")
    middle, edge = run.lines
    assert middle.speed_value == 240
    assert 18 <= edge.speed_value < 220
    assert run.done
    assert edge.worst_error < 20e-6


def test_a_line_that_fits_at_no_speed_is_refused_before_anything_moves_on_paper() -> None:
    with pytest.raises(InputError, match=r"printed line 2: got ink from 0\.00 in to 13\.20 in; expected: ink"):
        play("fits\n" + "x" * 132)


@pytest.mark.parametrize(
    ("overrides", "slope", "friction_right", "friction_left"),
    [
        ((), 170, 36, 28),
        (("disturbance.motor_constant=10 %",), 187, 36, 28),
        (("disturbance.motor_constant=-10 %",), 153, 36, 28),
        (("disturbance.friction_right=30 %",), 170, 46.8, 28),
        (("disturbance.friction_left=-30 %",), 170, 36, 19.6),
        (("disturbance.supply=34 V",), 190, 40.2, 31.3),
        (("encoder.jitter=5 deg",), 170, 36, 28),
    ],
)
def test_a_machine_that_is_not_as_described_is_identified_and_prints(
    overrides: tuple[str, ...], slope: float, friction_right: float, friction_left: float
) -> None:
    run = play(LETTER, *overrides)
    assert run.done
    assert run.warnings == []
    assert run.identified["right"].true_slope == pytest.approx(slope, rel=2e-3)
    assert run.identified["right"].true_friction == pytest.approx(friction_right, rel=2e-2)
    assert run.identified["left"].true_friction == pytest.approx(friction_left, rel=2e-2)
    for line in run.identified.values():
        assert line.slope == pytest.approx(line.true_slope, abs=3)
        assert line.friction == pytest.approx(line.true_friction, abs=2.5)
        assert line.speed_fast > line.speed_slow > 0


def test_jitter_spreads_the_columns_and_missing_edges_shift_them() -> None:
    clean, jitter, missing = (
        play(LETTER, *texts) for texts in ((), ("encoder.jitter=10 deg",), ("encoder.missing_edges=0.001",))
    )
    assert jitter.done
    assert missing.done
    places = (np.arange(ERROR_BINS) - ERROR_BINS // 2) * ERROR_BIN

    def spread(run: PrintRun) -> float:
        counts = run.errors_right + run.errors_left
        return float(np.sqrt(np.cov(places, fweights=counts)))

    # 10 degrees of a cycle of 1/300 in are 2.4 um; one missing edge moves all that follows by an emitter, 85 um.
    assert spread(clean) < spread(jitter) < 5 * spread(clean)
    assert spread(missing) > EMITTER / 2


def test_an_implausible_machine_prints_with_the_defaults_and_says_so() -> None:
    run = play(LETTER, "method.slope_max=160")
    assert len(run.warnings) == 1
    assert run.warnings[0].startswith("CALCULATE PARAMETERS: the measured slope or friction is implausible")
    assert [(line.slope, line.friction) for line in run.identified.values()] == [(152, 32), (152, 32)]


@pytest.mark.parametrize(("place", "found"), [("7 in", "177.8 mm = 7.00 in"), ("2 in", "= 12.50 in")])
def test_an_obstacle_before_homing_is_met_and_said(place: str, found: str) -> None:
    run = play(LETTER, f"disturbance.obstacle.position={place}")
    assert not run.done
    assert run.failure.startswith(
        "CALCULATE PARAMETERS: the head is obstructed or stalled, or moves against its drive, and the drive"
    )
    assert f"the measured width is {'' if found[0] == '=' else found}" in run.failure
    assert found in run.failure
    assert "limits.travel is 368.3 mm = 14.50 in" in run.failure
    assert run.lines == []
    assert run.time_end < 10


def test_an_obstacle_after_homing_stops_the_job_where_it_stands() -> None:
    runner = SimulatedPrinting(load_spec(EXAMPLE), LETTER, None, untold)
    runner.prepare()
    runner.machine.params.plant.train.left_end = 4 * INCH
    runner.print_all()
    run = runner.finish()
    assert not run.done
    assert "the head is obstructed or stalled" in run.failure
    assert f"(line {run.lines[-1].number + 1 if run.lines else 1})" in run.failure
    assert "= 4.00 in from the left frame" in run.failure
    assert len(run.lines) < len(LETTER.lines)
    assert runner.state.controller.head.drive_cmd == 0
    assert len(run.strikes) == run.characters == sum(line.characters for line in run.lines)


def test_a_push_disturbs_the_line_it_meets_and_no_other() -> None:
    clean, pushed = play(LETTER), play(LETTER, "disturbance.push.force=8 N", *PUSH)
    assert pushed.done
    met = [line.number for line in pushed.lines if line.start < 8.06 and line.stop > 8.0]
    worst = {line.number: line.worst_error for line in pushed.lines}
    usual = {line.number: line.worst_error for line in clean.lines}
    assert max(worst[number] for number in met) > 3 * clean.worst_error
    before = [number for number in worst if number < met[0]]
    assert before
    assert all(worst[number] == usual[number] for number in before)


def test_a_push_that_stops_the_head_is_an_obstruction() -> None:
    push = ("disturbance.push.at=8.05 s", "disturbance.push.duration=300 ms")
    run = play(LETTER, "disturbance.push.force=-60 N", *push)
    assert not run.done
    assert "(line 2): the head is obstructed or stalled" in run.failure
    assert len(run.lines) == 1


def test_every_switch_of_the_bridge_gives_the_same_lines() -> None:
    averaged, switched = play(LETTER), play(LETTER, "axis.fidelity=switch-level")
    assert switched.done
    for one, other in zip(averaged.lines, switched.lines, strict=True):
        assert (one.number, one.direction, one.speed_value, one.turn_around, one.columns) == (
            other.number, other.direction, other.speed_value, other.turn_around, other.columns,
        )  # fmt: skip
    assert switched.print_time == pytest.approx(averaged.print_time, rel=0.01)
    assert switched.print_time != averaged.print_time  # it is another model


def test_the_same_seed_gives_the_same_bytes_and_another_one_does_not() -> None:
    text = "noise on the encoder\nof the print head\n"
    texts = ("encoder.jitter=5 deg", "encoder.missing_edges=0.0005")
    (run, trace, registers), (again, trace_again, registers_again), (other, trace_other, registers_other) = (
        play_recorded(text, *texts, f"encoder.seed={seed}") for seed in (11, 11, 12)
    )
    assert registers == registers_again
    assert [trace[name].tobytes() for name in trace] == [trace_again[name].tobytes() for name in trace_again]
    assert run.to_dict() == again.to_dict()
    assert registers != registers_other
    assert trace["plant.train.position"].tobytes() != trace_other["plant.train.position"].tobytes()
    assert run.rms_error != other.rms_error


def test_without_noise_the_seed_changes_nothing_but_itself() -> None:
    run, other = (play("quiet\n", f"encoder.seed={seed}") for seed in (1, 2))
    assert run.to_dict() == other.to_dict()


def test_column_errors_agree_wherever_they_are_counted() -> None:
    runner = SimulatedPrinting(load_spec(EXAMPLE, ["disturbance.push.force=6 N", *PUSH]), LETTER, None, untold)
    runner.prepare()
    runner.print_all()
    run, columns = runner.finish(), runner.state.controller.head.columns
    # The run's figures, its lines, its bins, the axis computer's own count: one set of columns.
    assert run.columns == sum(line.columns for line in run.lines) == columns.fired
    assert run.errors_right.sum() + run.errors_left.sum() == run.columns
    for direction, counts in ((1, run.errors_right), (-1, run.errors_left)):
        assert counts.sum() == sum(line.columns for line in run.lines if line.direction == direction)
    assert run.worst_error == max(line.worst_error for line in run.lines)
    squares = sum(line.columns * line.rms_error**2 for line in run.lines)
    assert run.rms_error == pytest.approx(np.sqrt(squares / run.columns))
    places = (np.arange(ERROR_BINS) - ERROR_BINS // 2) * ERROR_BIN
    both = run.errors_right + run.errors_left
    assert np.sqrt(both @ places**2 / run.columns) == pytest.approx(run.rms_error, rel=1e-2)
    assert np.abs(places[both > 0]).max() == pytest.approx(run.worst_error, abs=ERROR_BIN)
    # Characters are the means of their columns: ten columns each.
    offsets = np.array([strike.offset for strike in run.strikes])
    assert np.abs(offsets).max() <= run.worst_error
    assert offsets.mean() == pytest.approx(both @ places / run.columns, abs=ERROR_BIN)


def test_errors_are_counted_in_the_nearest_bin_and_beyond_the_ends_in_the_last() -> None:
    middle = ERROR_BINS // 2
    counts = count_errors(np.array([0.0, 0.4e-7, -0.4e-7, 0.6e-7, -1e-7, 1.0, -1.0, 0.3e-3]))
    assert counts.sum() == 8
    places = (0, middle - 1, middle, middle + 1, ERROR_BINS - 1)
    assert [int(counts[place]) for place in places] == [1, 1, 3, 1, 2]
    assert count_errors(np.empty(0)).sum() == 0


def test_the_summary_is_plain_data_with_every_figure() -> None:
    run = play("ab\ncd\n")
    found = run.to_dict()
    assert json.loads(json.dumps(found)) == found
    assert found["done"] is True
    assert found["speeds"] == {"240": 2}
    assert found["print_time"] == pytest.approx(run.time_end - run.time_ready)
    assert found["identified"]["left"]["slope"] == run.identified["left"].slope
    assert [line["direction"] for line in found["lines"]] == [line.direction for line in run.lines]
    assert found["width"] == pytest.approx(14.5 * INCH, abs=2 * EMITTER)


def test_progress_rises_to_one_and_says_what_is_done() -> None:
    told: list[tuple[float, str]] = []
    print_job(load_spec(EXAMPLE), parse_text("a\nb\nc\n"), progress=lambda share, text: told.append((share, text)))
    assert told[0] == (0.0, "homing and identification")
    assert [share for share, _ in told] == sorted(share for share, _ in told)
    assert told[-1] == (1.0, "line 3 of 3")


def test_a_recording_is_closed_also_when_the_axis_failed() -> None:
    recorder = Recorder(PrintHead, ["controller.head.state"], every=1, period=TICK)
    run = print_job(load_spec(EXAMPLE, ["disturbance.obstacle.position=7 in"]), LETTER, recorder=recorder)
    trace = recorder.trace()
    assert trace.time[-1] == pytest.approx(run.time_end)
    assert len(trace) == round(run.time_end / TICK)


@pytest.mark.compiled
@pytest.mark.parametrize("limit", [8, 12])
def test_an_axis_too_slow_for_two_passes_makes_none_and_says_so(limit: int) -> None:
    overrides = (f"limits.speed={limit} in/s", f"method.max_print_speed={limit} in/s")
    run = print_job(load_spec(EXAMPLE, overrides), parse_text("a"))
    assert run.done
    assert run.level == "warn"
    assert "uses its defaults; limits.speed" in run.warnings[0]
    for found in run.identified.values():
        assert (found.valid, found.slope, found.friction) == (False, found.default_slope, found.default_friction)
        assert (found.speed_fast, found.speed_slow) == (0, 0)


@pytest.mark.compiled
def test_a_slow_pass_that_creeps_is_given_up() -> None:
    """One second in which the head goes by an emitter or two is no stall; the pass ends, and the defaults stay."""
    run = print_job(load_spec(EXAMPLE, ("disturbance.friction_right=85.3 %",)), parse_text("a"))
    assert run.done
    assert run.time_ready < 25.0
    assert not run.identified["right"].valid
    assert run.identified["left"].valid
    assert run.warnings[0].startswith("CALCULATE PARAMETERS: the measured slope or friction is implausible")
