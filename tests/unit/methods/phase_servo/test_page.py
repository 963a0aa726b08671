import math
from dataclasses import replace

import numpy as np
import pytest
from tests.unit.methods.moves.samples import record, run_of

import detent
from detent.methods.load import load_spec
from detent.methods.moves.job import MoveJob, load_moves, text_job
from detent.methods.moves.page import POSITION, TARGET, VELOCITY, moves_page
from detent.methods.moves.run import MoveRun, run_moves
from detent.methods.moves.summary import move_summary
from detent.methods.phase_servo.host import PhaseHost
from detent.methods.phase_servo.method import SIGNALS
from detent.methods.phase_servo.page import PhaseView, marks_of
from detent.methods.phase_servo.schema import PhaseServoSpec
from detent.methods.phase_servo.system import PhaseServo
from detent.page.frame import Page
from detent.page.paper import Marks
from detent.page.parts import INCH
from detent.record.recorder import Recorder
from detent.record.trace import Trace

pytestmark = pytest.mark.compiled

Played = tuple[PhaseServoSpec, MoveRun, Trace]
PITCH = INCH / 60


def play(job: MoveJob, *overrides: str) -> Played:
    spec = load_spec(detent.example("phase_servo.toml"), overrides)
    assert isinstance(spec, PhaseServoSpec)
    recorder = Recorder(PhaseServo, SIGNALS, every=256, period=spec.tick)
    return spec, run_moves(PhaseHost(spec, recorder), job), recorder.trace()


@pytest.fixture(scope="module")
def moves() -> Played:
    return play(load_moves(detent.example("moves.csv")))


def chart_of(page: Page, name: str) -> dict:
    return next(chart for chart in page.charts if chart["id"] == name)


def curve_of(page: Page, chart: str, label: str) -> np.ndarray:
    (found,) = [series["y"] for series in chart_of(page, chart)["series"] if series["label"] == label]
    return np.array([math.nan if value is None else value for value in found])


def test_what_is_drawn_is_what_is_recorded() -> None:
    assert {POSITION, VELOCITY, TARGET, *PhaseView.signals} <= set(SIGNALS)


def test_the_figures_of_a_whole_run(moves: Played) -> None:
    page = moves_page(PhaseView(moves[0]), *moves[1:], (), {"seed": "1"})
    assert [chart["id"] for chart in page.charts] == [
        "job", "rest", "move-speed", "move-to-go", "move-drive", "approach-place", "approach-words",
        "longest-speed", "longest-to-go", "longest-drive",
    ]  # fmt: skip
    assert (page.headline.level, page.settings, page.paper, list(page.notes)) == ("good", {"seed": "1"}, None, [])
    unit = PhaseView(moves[0]).unit
    assert dict(move_summary(moves[1], unit))["moves"] == "10 of 10"
    assert (unit.size, unit.words) == (moves[0].step, "steps")


def test_the_job_follows_its_targets(moves: Played) -> None:
    spec, run, trace = moves
    page = moves_page(PhaseView(spec), run, trace)
    t = np.array(chart_of(page, "job")["x"])
    place, target = (curve_of(page, "job", name) * 1e-3 for name in ("true position", "target"))
    for move in run.moves:
        row = int(np.searchsorted(t, move.end - run.time_ready)) - 1
        assert target[row] == pytest.approx(move.target, abs=1e-7)
        assert abs(place[row] - move.target) < run.tolerance


def test_the_modes_divide_the_move(moves: Played) -> None:
    spec, run, trace = moves
    page, move = moves_page(PhaseView(spec), run, trace), run.moves[2]
    speed = chart_of(page, "move-speed")
    t, ((switch, end),) = np.array(speed["x"]) * 1e-3, np.array(speed["bands"][0]["spans"]) * 1e-3
    assert switch == pytest.approx(move.switched - move.begin, abs=1e-4)
    assert end == pytest.approx(t[-1], abs=2e-6)
    demanded, counted, true = (
        curve_of(page, "move-speed", name) for name in ("demanded by the table", "speed word", "true speed")
    )
    assert np.isnan(demanded[t >= switch]).all()
    per_sample = spec.step / spec.sample_period * 1e3
    assert np.nanmax(demanded) == pytest.approx(27 * per_sample, abs=1e-3)
    assert np.abs(counted - true).max() < 4 * per_sample
    assert true.max() == pytest.approx(move.peak_speed * 1e3, rel=1e-3)
    to_go = curve_of(page, "move-to-go", "distance to go")
    assert to_go[0] == pytest.approx((move.target - move.start) * 1e3, abs=0.01)
    assert abs(to_go[-1]) < spec.step * 1e3
    error = curve_of(page, "approach-words", "absolute error word")
    approach = np.array(chart_of(page, "approach-words")["x"]) * 1e-3
    assert np.isnan(error[approach < switch - 1e-6]).all()
    assert np.isfinite(error[approach >= switch + 1e-6]).all()


def test_what_happens_in_a_move_is_told_with_its_times(moves: Played) -> None:
    spec, run, trace = moves
    figure = next(figure for figure in moves_page(PhaseView(spec), run, trace).figures if figure.events)
    texts = [event.text.partition(":")[0] for event in figure.events]
    assert texts == ["set strobe", "8 steps to go", "within ±2 steps of the target for good", "ready", "stop"]
    times = [event.t for event in figure.events]
    assert times[4] - times[1] == pytest.approx(spec.method.stop_time, abs=1e-4)
    assert times[3] - times[1] == pytest.approx(spec.method.ready_time, abs=1e-6)


def test_the_move_that_stopped_a_pitch_off_is_shown() -> None:
    spec, run, trace = play(
        load_moves(detent.example("moves.csv")), "disturbance.lines.burst.kind=+", "disturbance.lines.burst.at=30 ms",
        "disturbance.lines.burst.count=30",
    )  # fmt: skip
    page = moves_page(PhaseView(spec), run, trace)
    assert page.headline.level == "bad"
    figure = next(figure for figure in page.figures if figure.events)
    assert figure.title.startswith("Move 2, ")
    assert figure.events[-1].text == "the run ends here"
    # It stands still there, so that there is an approach: one pitch left of its target.
    place = curve_of(page, "approach-place", "true position")
    assert place[-1] * spec.step == pytest.approx(-PITCH, rel=0.01)
    table = page.sections[-1].shown[0].table
    assert table is not None
    assert table.rows[1][-1].text == "+422"
    assert [note.level for note in page.notes] == ["note"]


# ---- a text


def marks(text: str) -> tuple[MoveRun, Marks]:
    spec = load_spec(detent.example("phase_servo.toml"))
    assert isinstance(spec, PhaseServoSpec)
    printing = spec.printing
    job = text_job(text, name="note.txt", pitch=printing.character_pitch, left_margin=printing.left_margin)
    records = [
        record(move.number, 0.0, move.target or 0.0, error=1e-6 * move.number, label=move.label) for move in job.moves
    ]
    run = replace(run_of(*records, kind="text"), job=job)
    return run, marks_of(spec, run)


def test_each_character_is_a_mark_where_the_carriage_stood() -> None:
    run, found = marks("ab c\n\nd")
    assert "".join(found.characters) == "abcd"
    assert found.line.tolist() == [1, 1, 1, 3]
    np.testing.assert_allclose(found.column, np.array([0, 1, 3, 0]) * INCH / 10, atol=1e-12)
    np.testing.assert_allclose(found.offset, [-move.error for move in run.moves], atol=1e-12)
    np.testing.assert_allclose(found.baseline, np.array([1, 1, 1, 3]) * INCH / 6)
    page = moves_page(PhaseView(load_spec(detent.example("phase_servo.toml"))), run, None)
    assert page.paper is not None
    assert [line["text"] for line in page.paper["pages"][0]["lines"]] == ["abc", "d"]


def test_a_text_is_divided_into_pages() -> None:
    _, found = marks("a\n" * 66 + "b")
    assert found.page.tolist() == [1] * 66 + [2]
    assert found.baseline[-1] == found.baseline[0]


def test_a_letter_and_its_accents_are_one_mark() -> None:
    _, found = marks("e\u0301q\u0301\u0302x")
    assert found.characters == ["é", "q", "x"]
