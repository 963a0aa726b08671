import math
from dataclasses import replace

import numpy as np
import pytest
from tests.page_reader import Reader
from tests.unit.methods.moves.samples import noise_comparison, record, run_of

import detent
from detent.methods.filtered_servo import system as filtered_servo
from detent.methods.filtered_servo.host import FilteredHost
from detent.methods.filtered_servo.method import SIGNALS as FILTERED_SIGNALS
from detent.methods.filtered_servo.system import FilteredServo
from detent.methods.load import load_spec
from detent.methods.moves.job import Move, MoveJob, text_job
from detent.methods.moves.move_file import load_moves
from detent.methods.moves.page import make_servo_page
from detent.methods.moves.page_data import FilteredMove, PhaseMove, ServoReportData
from detent.methods.moves.report import NEEDED_FILTERED, NEEDED_PATH, NEEDED_PHASE, servo_report
from detent.methods.moves.run import MoveRun, run_moves
from detent.methods.moves.summary import ServoSpec
from detent.methods.phase_servo.host import PhaseHost
from detent.methods.phase_servo.method import SIGNALS as PHASE_SIGNALS
from detent.methods.phase_servo.system import PhaseServo
from detent.page.page import render_page
from detent.page.parts import INCH
from detent.record.recorder import Recorder
from detent.record.trace import Trace

pytestmark = pytest.mark.compiled

Played = tuple[ServoSpec, MoveRun, Trace]
PITCH = INCH / 60


def phase(job: MoveJob, *overrides: str) -> Played:
    spec = load_spec(detent.example("phase_servo.toml"), overrides)
    recorder = Recorder(PhaseServo, PHASE_SIGNALS, every=256, period=spec.tick)
    return spec, run_moves(PhaseHost(spec, recorder), job), recorder.trace()


def filtered(job: MoveJob, *overrides: str) -> Played:
    spec = load_spec(detent.example("filtered_servo.toml"), overrides)
    recorder = Recorder(FilteredServo, FILTERED_SIGNALS, every=10, period=filtered_servo.TICK)
    return spec, run_moves(FilteredHost(spec, recorder), job), recorder.trace()


def steps(*ways: float, **common: float) -> MoveJob:
    return MoveJob("steps", "moves", tuple(Move(n, n, by=way, **common) for n, way in enumerate(ways, 1)))


@pytest.fixture(scope="module")
def moves() -> Played:
    return phase(load_moves(detent.example("moves.csv")))


@pytest.fixture(scope="module")
def slide() -> Played:
    return filtered(steps(1e-3, 2e-3, -5e-3, speed=20e-3, dwell=0.05))


@pytest.fixture(scope="module")
def pushed_off() -> Played:
    return phase(
        load_moves(detent.example("moves.csv")), "disturbance.lines.burst.kind=+", "disturbance.lines.burst.at=30 ms",
        "disturbance.lines.burst.count=30",
    )  # fmt: skip


def test_what_is_drawn_is_what_is_recorded() -> None:
    assert set(NEEDED_PATH) <= set(NEEDED_PHASE) & set(NEEDED_FILTERED)
    assert set(NEEDED_PHASE) <= set(PHASE_SIGNALS)
    assert set(NEEDED_FILTERED) <= set(FILTERED_SIGNALS)


def test_the_head_of_the_report_is_the_run(moves: Played) -> None:
    spec, run, trace = moves
    noise = noise_comparison()
    data = servo_report(spec, run, trace, noise=noise, hold=None, settings={"seed": "1"})
    assert (data.axis_name, data.job_name, data.kind, data.done) == ("phase servo", "moves.csv", "moves", True)
    assert (data.tolerance, data.max_speed, data.unit.size) == (run.tolerance, 0.35, spec.step)
    assert data.noise is noise
    assert (data.hold, data.feedback, data.notes, data.settings) == (None, None, [], {"seed": "1"})
    assert len(data.marks) == 0
    for move, shown in zip(run.moves, data.moves, strict=True):
        assert (shown.number, shown.start, shown.target) == (move.number, move.start, move.target)
        assert shown.offset == -move.error
        assert shown.ready == move.ready - move.begin
        assert shown.settled == move.move_time
    assert data.moves[0].begin == 0.0


def test_the_path_begins_when_the_axis_is_ready_and_follows_its_targets(moves: Played) -> None:
    spec, run, trace = moves
    path = servo_report(spec, run, trace).path
    assert path
    assert 0 < path.t[0] < 1e-3
    assert path.t[-1] == pytest.approx(run.time_end - run.time_ready, abs=1e-3)
    for move in run.moves:
        row = int(np.searchsorted(path.t, move.end - run.time_ready)) - 1
        assert path.target[row] == move.target
        assert abs(path.position[row] - move.target) < run.tolerance


def test_the_move_in_detail_is_the_one_of_middle_length(moves: Played) -> None:
    spec, run, trace = moves
    detail = servo_report(spec, run, trace).detail
    assert isinstance(detail, PhaseMove)
    path = detail.path
    ways = [abs(move.target - move.start) for move in run.moves]
    went = [way for way in ways if way > run.tolerance]
    assert (path.number, path.why) == (3, "the move of middle length")
    assert sum(way < ways[2] for way in went) == sum(way > ways[2] for way in went) == 3
    assert path.t[0] == pytest.approx(0.0, abs=1e-4)
    assert path.t[-1] == pytest.approx(run.moves[2].end - run.moves[2].begin, abs=1e-4)
    assert abs(path.position[-1] - path.target) < spec.step
    assert path.velocity.max() == pytest.approx(run.moves[2].peak_speed, rel=1e-3)


def test_the_modes_of_the_phase_servo_divide_the_move(moves: Played) -> None:
    spec, run, trace = moves
    detail = servo_report(spec, run, trace).detail
    assert isinstance(detail, PhaseMove)
    path, move = detail.path, run.moves[2]
    ((switch, end),) = detail.position_mode
    assert switch == pytest.approx(move.switched - move.begin, abs=1e-4)
    assert end == path.t[-1]
    assert np.isnan(path.velocity_ref[path.t >= switch]).all()
    assert np.isnan(detail.error_word[path.t < switch]).all()
    assert np.nanmax(path.velocity_ref) == pytest.approx(27 * spec.step / spec.sample_period)
    assert np.abs(detail.counted_speed - path.velocity).max() < 4 * spec.step / spec.sample_period
    texts = [event.text.partition(":")[0] for event in path.events]
    assert texts == ["set strobe", "8 steps to go", "within ±2 steps of the target for good", "ready", "stop"]
    times = [event.t for event in path.events]
    assert times[4] - times[1] == pytest.approx(spec.method.stop_time, abs=1e-4)
    assert times[3] - times[1] == pytest.approx(spec.method.ready_time, abs=1e-6)
    assert path.approach
    begin, last = path.approach
    assert times[0] < begin < times[1]
    assert times[4] < last <= path.t[-1]


def test_the_filtered_servo_follows_its_command_at_a_distance(slide: Played) -> None:
    spec, run, trace = slide
    detail = servo_report(spec, run, trace).detail
    assert isinstance(detail, FilteredMove)
    path = detail.path
    assert path.number == 2
    # A trapezoid: 20 mm/s, reached with 1 m/s^2, for 2 mm; its mean over a window of 5 ms.
    middle = (path.t > 0.025) & (path.t < 0.095)
    np.testing.assert_allclose(path.velocity_ref[middle], 20e-3, rtol=0.03)
    assert path.velocity_ref[np.searchsorted(path.t, 0.01)] == pytest.approx(10e-3, rel=0.05)
    texts = [event.text for event in path.events]
    assert texts == [
        "the host asks for the move", "last command pulse", "within ±3 pulses of the target for good",
        "in position: within ±2 pulses for 50 ms",
    ]  # fmt: skip
    assert path.events[1].t == pytest.approx(2e-3 / 20e-3 + 20e-3, abs=1e-3)
    assert set((detail.counted_speed % spec.method.scale).tolist()) == {0}
    # The error is what the command is ahead; speed times K2 = B TS of it, once it is steady.
    assert detail.deviation.max() > 20e-3 / spec.pulse * 0.02
    assert abs(detail.deviation[-1]) <= spec.method.in_position
    np.testing.assert_allclose(path.drive, np.clip(detail.deviation - detail.filtered_speed, -128, 127), atol=1e-9)


def test_the_move_that_failed_is_shown(pushed_off: Played) -> None:
    data = servo_report(*pushed_off)
    assert not data.done
    assert data.failure == pushed_off[1].failure
    assert data.detail
    path = data.detail.path
    assert (path.number, path.why) == (2, "the move that failed")
    assert [event.text for event in path.events][-1] == "the run ends here"
    assert math.isnan(path.settled)
    assert path.approach  # it stands still, one pitch off
    assert math.isnan(data.moves[1].settled)
    assert data.moves[1].offset == pytest.approx(-PITCH, rel=0.01)
    assert [note.text for note in data.notes] == ["interference on the pulse lines: 30 pulses put in"]
    text = Reader(render_page(make_servo_page(data))).text
    assert "Stopped after 1 of 10 moves" in text
    assert "on the positioning point 1 pitch off" in text


def test_an_axis_that_has_given_up_comes_to_no_rest() -> None:
    pushed = ("force=-1000 N", "at=20 ms", "duration=2 s")
    data = servo_report(*filtered(steps(0.1), *(f"disturbance.push.{key}" for key in pushed)))
    assert data.detail
    assert data.detail.path.approach is None
    assert [event.text for event in data.detail.path.events] == ["the host asks for the move", "the run ends here"]
    assert math.isnan(data.detail.path.velocity_ref[-1])
    assert math.isnan(data.moves[0].ready)


def test_an_axis_that_speaks_too_early_is_told() -> None:
    run = run_of(record(1, 0.0, 0.02), record(2, 0.02, 0.0, settled=0.6 + 0.0851))
    (note,) = servo_report(load_spec(detent.example("phase_servo.toml")), run, None).notes
    assert note.level == "warning"
    assert note.text.startswith("move 2: the axis said that it had arrived 2.10 ms before it was within the tolerance")
    run.warnings.append("headroom")
    run.moves.pop()
    (note,) = servo_report(load_spec(detent.example("phase_servo.toml")), run, None).notes
    assert (note.level, note.text) == ("warning", "headroom")


def test_the_move_that_was_ready_too_early_is_shown() -> None:
    moved = run_of(
        record(1, 0.0, 0.03),
        record(2, 0.03, 0.02),
        record(3, 0.02, 0.04, settled=0.7 + 0.084),
        record(4, 0.04, 0.0, settled=0.8 + 0.085),
    )
    t = np.arange(0.5, 0.91, 1e-3)
    still = Trace(columns={"t": t} | {name: np.zeros(len(t)) for name in NEEDED_PHASE})
    detail = servo_report(load_spec(detent.example("phase_servo.toml")), moved, still).detail
    assert detail
    assert (detail.path.number, detail.path.why) == (4, "the move that was ready too early")
    assert [event.text.partition(":")[0] for event in detail.path.events][2:] == [
        "ready", "within ±3.02 steps of the target for good",
    ]  # fmt: skip


@pytest.mark.parametrize("left_out", NEEDED_PHASE)
def test_a_trace_without_a_needed_signal_gives_a_report_without_its_figures(moves: Played, left_out: str) -> None:
    spec, run, trace = moves
    part = Trace(columns={name: trace[name] for name in trace if name != left_out})
    data = servo_report(spec, run, part)
    assert data.detail is None
    assert (data.path is None) == (left_out in NEEDED_PATH)
    assert data.moves


def test_without_a_trace_the_figures_over_time_are_left_out(slide: Played) -> None:
    data = servo_report(slide[0], slide[1], None)
    assert (data.path, data.detail) == (None, None)
    assert "Done" in Reader(render_page(make_servo_page(data))).text


def test_of_a_trace_that_ends_early_only_whole_moves_are_shown(moves: Played) -> None:
    spec, run, trace = moves
    data = servo_report(spec, run, trace.between(0.0, 0.1))
    assert data.detail
    assert data.detail.path.number == 2
    assert data.path
    assert data.path.t[-1] < 0.1
    assert servo_report(spec, run, trace.between(0.0, 0.02)).detail is None
    assert servo_report(spec, run, trace.between(0.0, 0.003)).path is None


def test_a_run_without_a_move_has_no_figures_over_time(moves: Played) -> None:
    spec, _, trace = moves
    data = servo_report(spec, run_of(asked=2, failure="never ready"), trace)
    assert (data.path, data.detail, data.moves) == (None, None, [])
    assert "Not done" in Reader(render_page(make_servo_page(data))).text


def text_report(text: str) -> tuple[MoveRun, ServoReportData]:
    spec = load_spec(detent.example("phase_servo.toml"))
    printing = spec.printing
    job = text_job(text, name="note.txt", pitch=printing.character_pitch, left_margin=printing.left_margin)
    moves = [
        record(move.number, 0.0, move.target or 0.0, error=1e-6 * move.number, label=move.label) for move in job.moves
    ]
    run = replace(run_of(*moves, kind="text"), job=job)
    return run, servo_report(spec, run, None)


def test_each_character_is_a_mark_where_the_carriage_stood() -> None:
    run, data = text_report("ab c\n\nd")
    marks = data.marks
    assert "".join(marks.characters) == "abcd"
    assert marks.line.tolist() == [1, 1, 1, 3]
    np.testing.assert_allclose(marks.column, np.array([0, 1, 3, 0]) * INCH / 10, atol=1e-12)
    np.testing.assert_allclose(marks.offset, [-move.error for move in run.moves], atol=1e-12)
    np.testing.assert_allclose(marks.baseline, np.array([1, 1, 1, 3]) * INCH / 6)
    assert [move.label for move in data.moves] == list("abcd")


def test_a_text_is_divided_into_pages() -> None:
    _, data = text_report("a\n" * 66 + "b")
    assert data.marks.page.tolist() == [1] * 66 + [2]
    assert data.marks.baseline[-1] == data.marks.baseline[0]


def test_a_letter_and_its_accents_are_one_mark() -> None:
    _, data = text_report("e\u0301q\u0301\u0302x")
    assert data.marks.characters == ["é", "q", "x"]
