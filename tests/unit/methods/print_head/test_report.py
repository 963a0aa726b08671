import math
from dataclasses import replace

import numpy as np
import pytest
from tests.page_reader import charts_of, paper_of
from tests.print_head_rig import EXAMPLE, TICK

import detent
from detent.files.quantities import INCH
from detent.methods.load import load_spec
from detent.methods.print_head.comparison import DriveComparison, DriveConstants, DriveStart
from detent.methods.print_head.page import make_print_page
from detent.methods.print_head.page_data import ReportData
from detent.methods.print_head.print_job import load_job, parse_diablo, parse_text
from detent.methods.print_head.report import NEEDED, comparison_figure, drift_text, print_report
from detent.methods.print_head.run import PrintRun, default_signals, print_job
from detent.methods.print_head.schema import PrintHeadSpec
from detent.methods.print_head.system import PrintHead
from detent.page.page import render_page
from detent.record.recorder import Recorder
from detent.record.trace import Trace

pytestmark = pytest.mark.compiled

Played = tuple[PrintHeadSpec, PrintRun, Trace]


def play(*overrides: str, text: str | None = None, every: int = 10) -> Played:
    spec = load_spec(EXAMPLE, overrides)
    job = load_job(detent.example("letter.txt")) if text is None else parse_text(text)
    recorder = Recorder(PrintHead, default_signals(), every=every, period=TICK)
    run = print_job(spec, job, recorder=recorder)
    return spec, run, recorder.trace()


@pytest.fixture(scope="module")
def letter() -> Played:
    return play()


@pytest.fixture(scope="module")
def data(letter: Played) -> ReportData:
    return print_report(*letter, settings={"seed": "1"})


def test_what_is_drawn_is_what_is_recorded() -> None:
    assert set(NEEDED) <= set(default_signals())


def test_the_head_of_the_report_is_the_run(letter: Played, data: ReportData) -> None:
    spec, run, _ = letter
    assert (data.axis_name, data.job_name, data.printed) == (spec.axis.name, "letter.txt", True)
    assert data.duration == run.print_time
    assert (data.line_count, data.page_count, data.character_count) == (11, 1, run.characters)
    assert data.settings == {"seed": "1"}
    for line, result in zip(run.lines, data.lines, strict=True):
        assert (result.number, result.direction, result.turn_around) == (line.number, line.direction, line.turn_around)
        assert result.speed == pytest.approx(40 * INCH)
        assert (result.start, result.stop) == (line.start, line.stop)
        assert (result.worst_error, result.rms_error) == (line.worst_error, line.rms_error)


def test_the_column_errors_are_those_of_the_run(letter: Played, data: ReportData) -> None:
    _, run, _ = letter
    assert data.errors
    assert data.errors.total == run.columns
    assert (data.errors.worst, data.errors.rms) == (run.worst_error, run.rms_error)
    assert data.errors.beyond(run.worst_error + data.errors.bin_width) == 0
    assert data.errors.beyond(run.worst_error - data.errors.bin_width) >= 1


def test_each_character_is_a_mark_where_it_landed(letter: Played, data: ReportData) -> None:
    _, run, _ = letter
    assert "".join(data.marks.characters) == "".join(s.character.char for s in run.strikes)
    np.testing.assert_allclose(data.marks.offset, [s.offset for s in run.strikes], atol=1e-12)
    first = run.job.lines[0]
    here = data.marks.line == first.number
    np.testing.assert_allclose(data.marks.column[here], [c.column * INCH / 120 for c in first.characters])
    assert set(data.marks.page.tolist()) == {1}
    assert set(data.marks.direction[here].tolist()) == {run.lines[0].direction}


def test_the_second_page_begins_at_its_top() -> None:
    data = print_report(*play(text="one\n\ftwo\n"))
    assert data.marks.page.tolist() == [1, 1, 1, 2, 2, 2]
    np.testing.assert_allclose(data.marks.baseline, 0.0, atol=1e-12)


def test_forms_of_another_length_begin_at_their_top_too() -> None:
    # ESC FF sets the length of a form in lines of 1/6 in; the second form begins 3 in down, not 11 in.
    job = parse_diablo(b"\x1b\x0c\x12one\r\n\x0ctwo\r\n")
    run = print_job(load_spec(EXAMPLE), job)
    assert [line.page for line in job.lines] == [1, 2]
    baselines = print_report(load_spec(EXAMPLE), run, None).marks.baseline
    np.testing.assert_allclose(baselines, [baselines[0]] * 6, atol=1e-12)


def test_characters_that_were_not_fired_leave_no_mark(letter: Played) -> None:
    spec, run, trace = letter
    strikes = [replace(run.strikes[0], offset=math.nan), *run.strikes[1:]]
    shortened = replace(run, strikes=strikes)
    assert len(print_report(spec, shortened, trace).marks) == len(run.strikes) - 1


def test_the_path_is_printed_where_columns_are_fired(letter: Played, data: ReportData) -> None:
    spec, run, _ = letter
    path = data.path
    assert path
    assert (path.travel, path.column0) == (spec.limits.travel, spec.printing.left_margin)
    assert path.printing.any()
    assert not path.printing[path.t < run.time_ready].any()
    inked = path.position[path.printing]
    right_end = spec.printing.left_margin + max(line.last_column for line in run.job.lines) * INCH / 120
    row = 10 * TICK * 40 * INCH  # way of the head between two rows
    assert inked.min() == pytest.approx(spec.printing.left_margin, abs=4 * row)
    assert inked.max() == pytest.approx(right_end, abs=4 * row)
    starts = np.flatnonzero(np.diff(path.printing.astype(int)) == 1)
    assert len(starts) == len(run.lines)


def test_the_profile_is_the_widest_of_the_fastest_lines(letter: Played, data: ReportData) -> None:
    _, run, _ = letter
    profile = data.profile
    assert profile
    chosen = next(line for line in run.lines if line.number == profile.line)
    assert chosen.columns == max(line.columns for line in run.lines)
    assert profile.t[0] >= 0
    assert profile.t[-1] == pytest.approx(chosen.stop - chosen.start, abs=1e-3)
    assert profile.print_span
    begin, end = profile.print_span
    inside = (profile.t > begin) & (profile.t < end)
    assert np.abs(profile.velocity[inside]).min() > 39 * INCH
    assert np.nanmax(np.abs(profile.velocity_ref)) == pytest.approx(40 * INCH)
    assert np.sign(profile.velocity[inside]).tolist() == [profile.direction] * int(inside.sum())
    assert profile.transition.any()
    assert [event.text[:10] for event in profile.events][-1] == "zero speed"
    assert any(event.text.startswith("stop begins") for event in profile.events)


def test_the_turn_around_reverses_at_the_highest_speed(letter: Played, data: ReportData) -> None:
    turn = data.turn_around
    assert turn
    assert turn.line_to == turn.line_from + 1
    assert turn.t[0] == pytest.approx(-0.01, abs=1e-3)
    assert turn.velocity[0] * turn.velocity[-1] < 0
    assert np.abs(turn.velocity[[0, -1]]).min() > 39 * INCH
    texts = [event.text for event in turn.events]
    assert [text.partition(":")[0] for text in texts] == [
        "stop begins", "drive value passes zero", "zero speed", "top of the ramp",
    ]  # fmt: skip
    assert turn.events[0].t == pytest.approx(0.0, abs=1e-9)
    assert letter[1].lines[turn.line_to - 1].turn_around


def test_identified_lines_and_constants_stand_beside_the_truth(letter: Played, data: ReportData) -> None:
    _, run, _ = letter
    assert [line.direction for line in data.identified] == [1, -1]
    for line, side in zip(data.identified, ("right", "left"), strict=True):
        found = run.identified[side]
        assert (line.slope, line.friction) == (found.slope, found.friction)
        # Equation (9) with the identified constants leads through both measured points, within a count and a half.
        for speed, drive in line.points:
            assert line.slope * speed / 256 + line.friction == pytest.approx(drive, abs=1.5)
    names = [row.name for row in data.constants]
    assert names == [
        "slope K, right", "friction Vf, right", "slope K, left", "friction Vf, left", "width between the frames",
    ]  # fmt: skip
    assert data.constants[-1].identified == pytest.approx(368.3, abs=0.2)


def test_an_axis_that_failed_has_a_report_all_the_same() -> None:
    spec, run, trace = play("disturbance.obstacle.position=7 in")
    data = print_report(spec, run, trace)
    assert not data.printed
    assert data.failure == run.failure
    assert (data.profile, data.turn_around) == (None, None)
    assert data.path
    assert not data.path.printing.any()
    assert [line.points for line in data.identified] == [(), ()]
    assert "Not printed" in render_page(make_print_page(data))


@pytest.mark.parametrize("left_out", NEEDED)
def test_a_trace_without_a_needed_signal_gives_a_report_without_its_figures(letter: Played, left_out: str) -> None:
    spec, run, trace = letter
    part = Trace(columns={name: trace[name] for name in trace if name != left_out})
    data = print_report(spec, run, part)
    assert (data.path, data.profile, data.turn_around) == (None, None, None)
    assert data.errors


def test_without_a_trace_the_figures_over_time_are_left_out(letter: Played) -> None:
    data = print_report(letter[0], letter[1], None)
    assert (data.path, data.profile, data.turn_around) == (None, None, None)
    assert data.lines
    assert "histogram" in render_page(make_print_page(data))


@pytest.mark.parametrize("every", [100, 2_000, 25_000])
def test_a_sparse_trace_draws_what_it_can(every: int) -> None:
    data = print_report(*play(every=every))
    assert data.path
    assert (data.profile is not None) == (every == 100)
    assert render_page(make_print_page(data))


def test_of_a_trace_that_ends_early_the_recorded_lines_are_drawn(letter: Played) -> None:
    spec, run, trace = letter
    third = run.lines[2]
    data = print_report(spec, run, trace.between(0, third.stop))
    assert data.profile
    assert data.profile.line <= 3
    assert data.turn_around
    assert data.turn_around.line_to <= 3
    nothing = print_report(spec, run, trace.between(0, run.time_ready / 2))
    assert (nothing.profile, nothing.turn_around) == (None, None)


def test_warnings_and_notes_of_the_job_are_told() -> None:
    spec = load_spec(EXAMPLE, ["method.slope_max=160"])
    run = print_job(spec, parse_diablo(b"text\x1bq\r\n" + b"\x1bq" * 30))
    data = print_report(spec, run, None)
    assert data.notes[0].level == "warning"
    assert data.notes[0].text.startswith("CALCULATE PARAMETERS: the measured slope")
    assert data.notes[1].text == f"byte 4, {run.job.notes[0].code}: {run.job.notes[0].text}"
    assert len(run.job.notes) == 31
    assert data.notes[-1].text == "11 more notes about the job are in the JSON summary"
    assert len(data.notes) == 1 + 20 + 1


def test_every_report_can_be_drawn(letter: Played, data: ReportData) -> None:
    page = render_page(make_print_page(data))
    assert {chart["id"] for chart in charts_of(page)} == {
        "histogram", "path", "profile-speed", "profile-drive", "turn-current", "turn-speed", "identified-right",
        "identified-left",
    }  # fmt: skip
    paper = paper_of(page)
    assert paper
    assert sum(len(line["text"]) for line in paper["pages"][0]["lines"]) == len(letter[1].strikes)


def test_the_comparison_is_handed_on_as_it_is() -> None:
    constants = DriveConstants(slope_right=1, slope_left=2, friction_right=3, friction_left=4)
    t = np.arange(3.0)
    start = DriveStart(t=t, velocity=2 * t, steady_from=1.0, mean_error=0.0, time_to_band=1.0)
    found = DriveComparison(
        methods=("a", "b"), constants=(constants,) * 2, speeds=(1.0, 0.5), errors=np.zeros((2, 2, 2)),
        starts=(start, start), target=1.0,
    )  # fmt: skip
    figure = comparison_figure(found, load_spec(EXAMPLE, ["disturbance.motor_constant=10 %"]))
    assert figure.methods == ("a", "b")
    assert [curve.name for curve in figure.starts] == ["a", "b"]
    np.testing.assert_array_equal(figure.starts[1].velocity, 2 * t)
    assert figure.machine == "K +10 %"


@pytest.mark.parametrize(
    ("overrides", "text"),
    [
        ([], "machine as in its file"),
        (["disturbance.friction_left=-5 %", "disturbance.motor_constant=2.5 %"], "K +2.5 %, friction left -5 %"),
        (["disturbance.supply=34 V"], "supply 34 V instead of 38 V"),
    ],
)
def test_drift_is_told_in_a_few_words(overrides: list[str], text: str) -> None:
    assert drift_text(load_spec(EXAMPLE, overrides)) == text
