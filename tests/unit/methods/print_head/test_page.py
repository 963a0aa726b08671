import json
import math
import re
import subprocess
import sys
from dataclasses import replace
from importlib import resources
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.page_reader import Reader, charts_of, paper_of
from tests.print_head_rig import EXAMPLE, TICK

import detent
from detent.files.quantities import INCH
from detent.files.text import shown
from detent.methods.load import load_spec
from detent.methods.print_head.detail import SIGNALS
from detent.methods.print_head.diablo630 import parse_diablo
from detent.methods.print_head.page import error_chart, marks_of, print_page, summary_rows
from detent.methods.print_head.print_job import load_job, parse_text
from detent.methods.print_head.run import (
    COLUMN_LIMIT,
    ERROR_BIN,
    ERROR_BINS,
    LineRecord,
    PrintRun,
    count_errors,
    print_job,
)
from detent.methods.print_head.run import (
    SIGNALS as RECORDED,
)
from detent.methods.print_head.schema import COLUMN, PrintHeadSpec
from detent.methods.print_head.system import PrintHead
from detent.page.figure import Figure
from detent.page.frame import Page
from detent.page.render import render_page
from detent.page.table import Cell
from detent.page.words import GAP
from detent.record.recorder import Recorder
from detent.record.trace import Trace

pytestmark = pytest.mark.compiled

Played = tuple[PrintHeadSpec, PrintRun, Trace]

OVER_TIME = ["path", "profile-speed", "profile-drive", "turn-current", "turn-speed"]
IDENTIFIED = ["identified-right", "identified-left"]


def play(*overrides: str, text: str | None = None, every: int = 10) -> Played:
    spec = load_spec(EXAMPLE, overrides)
    assert isinstance(spec, PrintHeadSpec)
    job = load_job(detent.example("letter.txt")) if text is None else parse_text(text)
    recorder = Recorder(PrintHead, RECORDED, every=every, period=TICK)
    run = print_job(spec, job, recorder=recorder)
    return spec, run, recorder.trace()


@pytest.fixture(scope="module")
def letter() -> Played:
    return play()


@pytest.fixture(scope="module")
def page(letter: Played) -> Page:
    return print_page(*letter, (), {"seed": "1"})


def ids(page: Page) -> list[str]:
    return [chart["id"] for chart in page.charts]


def chart_of(page: Page, name: str) -> dict:
    return next(chart for chart in page.charts if chart["id"] == name)


def figure_of(page: Page, chart: str) -> Figure:
    return next(figure for figure in page.figures if any(one["id"] == chart for one in figure.charts))


def curve_of(page: Page, chart: str, label: str) -> np.ndarray:
    (found,) = [series["y"] for series in chart_of(page, chart)["series"] if series["label"] == label]
    return np.array([math.nan if value is None else value for value in found])


def table_of(page: Page, title: str) -> list[list[str]]:
    (table,) = [figure.table for figure in page.figures if figure.title == title]
    assert table
    cells = [[cell.text if isinstance(cell, Cell) else cell for cell in row] for row in table.rows]
    return [[Reader(text).text.replace(GAP, " ") for text in row] for row in cells]


def cards_of(page: Page) -> dict[str, tuple[str, bool]]:
    return {card.title: (f"{card.value} {card.unit}".strip(), card.bad) for card in page.cards}


def with_errors(run: PrintRun, *errors: float) -> PrintRun:
    """The run with other columns, all printed to the left [m]."""
    found = np.array(errors)
    return replace(
        run, columns=len(errors), worst_error=float(np.abs(found).max(initial=0.0)),
        errors_right=count_errors(found[:0]), errors_left=count_errors(found),
    )  # fmt: skip


# ---- what came out


def test_what_is_drawn_is_what_is_recorded() -> None:
    assert set(SIGNALS) <= set(RECORDED)


def test_every_figure_of_a_run_that_printed(letter: Played, page: Page) -> None:
    spec, run, _ = letter
    assert ids(page) == ["histogram", *OVER_TIME, *IDENTIFIED]
    assert len(page.sections) == 5
    assert (page.headline.level, page.headline.name, page.settings) == (
        "good",
        "letter.txt",
        {"fidelity": "averaged", "seed": "1"},
    )
    assert spec.axis.name in page.headline.kicker
    assert page.paper
    assert sum(len(line["text"]) for line in page.paper["pages"][0]["lines"]) == len(run.strikes)


def test_the_cards_carry_the_figures(letter: Played, page: Page) -> None:
    _, run, _ = letter
    cards = cards_of(page)
    assert cards["Lines printed"] == ("11 of 11", False)
    assert cards["Throughput"] == (f"{run.characters / run.print_time:.0f} characters/s", False)
    assert cards["Worst column error"] == (f"{run.worst_error * 1e6:.1f} µm", False)
    assert cards["Top print speed"] == ("40 in/s", False)
    assert cards["Turn-arounds"] == ("10 of 10", False)
    below = [card.below.replace(GAP, " ") for card in page.cards]
    assert below[0] == f"{run.characters} characters"
    assert below[2] == f"rms {run.rms_error * 1e6:.1f} µm, allowed 106 µm"
    assert below[3].endswith("in 11 of 11 lines")


def test_an_axis_that_failed_has_a_report_all_the_same() -> None:
    spec, run, trace = play("disturbance.obstacle.position=7 in")
    page = print_page(spec, run, trace)
    assert (page.headline.level, page.headline.verdict) == ("bad", "Not printed")
    assert run.failure in page.headline.lead
    assert cards_of(page) == {"Lines printed": ("0 of 11", True), "Time": (f"{run.time_end:.2f} s", False)}
    assert ids(page) == ["path", "end-speed", "end-drive", *IDENTIFIED]
    # What was never printed is in no legend.
    assert [series["label"] for series in chart_of(page, "path")["series"]] == ["moving"]
    for side in ("right", "left"):
        assert all(series["label"] != "measured" for series in chart_of(page, f"identified-{side}")["series"])
    assert page.paper is None
    assert render_page(page)


def test_a_run_that_came_to_nothing_leaves_no_trace_on_the_page(letter: Played) -> None:
    spec, run, _ = letter
    page = print_page(spec, PrintRun(run.job, failure="Not calibrated"), None)
    assert (page.figures, page.notes, page.paper) == ([], [], None)
    assert "nan" not in Reader(render_page(page)).text.lower()


def test_columns_off_their_place_spoil_the_headline(letter: Played) -> None:
    spec, run, trace = letter
    off = with_errors(run, 0.0, -COLUMN_LIMIT - 2e-7, 1e-6)
    line = replace(run.lines[0], worst_error=off.worst_error)
    page = print_page(
        spec, replace(off, lines=[line, *run.lines[1:]], warnings=["1 column landed beside its place; look"]), trace
    )
    assert page.headline.level == "warn"
    assert cards_of(page)["Worst column error"] == ("106 µm", True)
    assert "1 column " in page.headline.lead.replace(GAP, " ")
    (table,) = [figure.table for figure in page.figures if figure.title == "Every line"]
    assert table
    over = [[isinstance(cell, Cell) and cell.over for cell in row] for row in table.rows]
    assert (sum(map(sum, over)), over[0][7]) == (1, True)


@given(st.lists(st.floats(-250e-6, 250e-6), max_size=20))
def test_columns_beyond_the_limit_are_counted_on_both_sides(errors: list[float]) -> None:
    run = with_errors(PrintRun(parse_text("x")), *errors)
    bins = np.abs(np.round(np.array(errors) / ERROR_BIN)) * ERROR_BIN
    assert run.beyond == np.count_nonzero(bins > COLUMN_LIMIT)


def test_a_run_without_columns_shows_no_column_error(letter: Played) -> None:
    spec, run, trace = letter
    page = print_page(spec, with_errors(run), trace)
    assert "Worst column error" not in cards_of(page)
    assert "histogram" not in ids(page)
    assert page.headline.level == "good"


def test_lines_without_a_mark_have_no_error(letter: Played) -> None:
    spec, run, trace = letter
    lines = [replace(line, worst_error=0.0, rms_error=math.nan) for line in run.lines]
    page = print_page(spec, replace(run, lines=lines, strikes=[]), trace)
    assert page.paper is None
    assert "histogram" not in ids(page)
    assert [row[-1] for row in table_of(page, "Every line")] == ["–"] * 11
    assert "nan" not in Reader(render_page(page)).text.lower()


def test_warnings_and_notes_of_the_job_are_told() -> None:
    spec = load_spec(EXAMPLE, ["method.slope_max=160"])
    assert isinstance(spec, PrintHeadSpec)
    run = print_job(spec, parse_diablo(b"text\x1bq\r\n" + b"\x1bq" * 30))
    notes = print_page(spec, run, None).notes
    assert [note.level for note in notes] == ["warning"] + ["note"] * 21
    assert notes[0].text.startswith("CALCULATE PARAMETERS: the measured slope")
    assert notes[1].text == f"byte 4, {run.job.notes[0].code}: {run.job.notes[0].text}"
    assert len(run.job.notes) == 31
    assert notes[-1].text.startswith("11")


# ---- where each character landed


def test_each_character_is_a_mark_where_it_landed(letter: Played) -> None:
    _, run, _ = letter
    marks = marks_of(run)
    assert "".join(marks.characters) == "".join(s.character.char for s in run.strikes)
    np.testing.assert_allclose(marks.offset, [s.offset for s in run.strikes], atol=1e-12)
    first = run.job.lines[0]
    here = marks.line == first.number
    np.testing.assert_allclose(marks.column[here], [c.column * INCH / 120 for c in first.characters])
    assert set(marks.page.tolist()) == {1}
    assert set(marks.direction[here].tolist()) == {run.lines[0].direction}


def test_the_second_page_begins_at_its_top() -> None:
    marks = marks_of(play(text="one\n\ftwo\n")[1])
    assert marks.page.tolist() == [1, 1, 1, 2, 2, 2]
    np.testing.assert_allclose(marks.baseline, 0.0, atol=1e-12)


def test_forms_of_another_length_begin_at_their_top_too() -> None:
    # ESC FF sets the length of a form in lines of 1/6 in; the second form begins 3 in down, not 11 in.
    spec = load_spec(EXAMPLE)
    assert isinstance(spec, PrintHeadSpec)
    run = print_job(spec, parse_diablo(b"\x1b\x0c\x12one\r\n\x0ctwo\r\n"))
    assert [line.page for line in run.job.lines] == [1, 2]
    baselines = marks_of(run).baseline
    np.testing.assert_allclose(baselines, [baselines[0]] * 6, atol=1e-12)


def test_characters_that_were_not_fired_leave_no_mark(letter: Played) -> None:
    _, run, _ = letter
    shortened = replace(run, strikes=[replace(run.strikes[0], offset=math.nan), *run.strikes[1:]])
    assert len(marks_of(shortened)) == len(run.strikes) - 1


counts_per_bin = st.dictionaries(st.integers(0, ERROR_BINS - 1), st.integers(1, 10_000), max_size=20)


@given(counts_per_bin, counts_per_bin)
def test_every_column_is_in_the_histogram_once(to_the_right: dict[int, int], to_the_left: dict[int, int]) -> None:
    run = PrintRun(parse_text("x"))
    for counts, found in ((run.errors_right, to_the_right), (run.errors_left, to_the_left)):
        counts[list(found)] = list(found.values())
    chart = error_chart(run, 50e-6)
    for series, found in zip(chart["series"], (to_the_right, to_the_left), strict=True):
        assert sum(series["y"]) == sum(found.values())
        # No column is drawn farther from its place than the width of a bar says.
        drawn = sum(abs(x) * y for x, y in zip(chart["x"], series["y"], strict=True))
        true = sum(abs(place - 3000) * 0.1 * number for place, number in found.items())
        bar = chart["x"][1] - chart["x"][0]
        assert abs(drawn - true) <= bar / 2 * sum(found.values()) * (1 + 1e-9)


def test_a_bar_stands_where_its_columns_landed_and_limits_show_where_they_are_near() -> None:
    run = with_errors(PrintRun(parse_text("x")), *[0.0] * 15, 60e-6)
    near = error_chart(run, 50e-6)
    right, left = (dict(zip(near["x"], series["y"], strict=True)) for series in near["series"])
    assert not any(right.values())
    assert {x: y for x, y in left.items() if y} == {0.0: 15, 60.0: 1}
    assert [mark["x"] for mark in near["marks"]] == [-50.0, 50.0]
    assert near["x"] == [-value for value in reversed(near["x"])]
    assert {round(b - a, 6) for a, b in pairwise(near["x"])} == {5.0}
    assert error_chart(run, 1e-3)["marks"] == []


def test_errors_without_spread_are_one_bar() -> None:
    chart = error_chart(with_errors(PrintRun(parse_text("x")), *[0.0] * 7), COLUMN_LIMIT)
    assert {x: y for x, y in zip(chart["x"], chart["series"][1]["y"], strict=True) if y} == {0.0: 7}
    assert len(chart["x"]) >= 3


# ---- over time


def test_the_path_is_thick_where_columns_are_fired(letter: Played, page: Page) -> None:
    spec, run, _ = letter
    chart = chart_of(page, "path")
    assert chart["yRange"] == pytest.approx([0.0, spec.limits.travel / INCH])
    assert chart["levels"][0]["y"] == pytest.approx(spec.printing.left_margin / INCH)
    t, moving = np.array(chart["x"]), curve_of(page, "path", "moving")
    assert np.isfinite(moving).all()
    row = 10 * TICK * 40  # way of the head between two rows [in]
    sides = {side: curve_of(page, "path", f"printing to the {side}") for side in ("right", "left")}
    for line in run.job.lines:
        record = run.lines[line.number - 1]
        here = (t > record.start) & (t < record.stop)
        side, other = ("right", "left") if record.direction > 0 else ("left", "right")
        thick = sides[side][here]
        margin = spec.printing.left_margin / INCH
        # The first and the last character stand where they belong, however few points are drawn.
        assert np.nanmin(thick) == pytest.approx(margin + line.first_column / 120, abs=4 * row)
        assert np.nanmax(thick) == pytest.approx(margin + line.last_column / 120, abs=4 * row)
        assert np.isnan(sides[other][here]).all()
        assert np.isnan(thick).any()
    assert np.isnan(sides["right"][t < run.time_ready]).all()


def test_a_long_job_shows_its_beginning_and_says_so(letter: Played, page: Page) -> None:
    spec, run, trace = letter
    slow = Trace(columns={name: trace[name] * (5.0 if name == "t" else 1) for name in ("t", *trace)})
    long = print_page(spec, replace(run, time_end=5 * run.time_end, lines=[], strikes=[]), slow)
    assert 29.9 < chart_of(long, "path")["x"][-1] <= 30.0
    assert figure_of(long, "path").title != figure_of(page, "path").title


def test_the_line_in_detail_is_the_widest_of_the_fastest(letter: Played, page: Page) -> None:
    _, run, _ = letter
    speed, drive = chart_of(page, "profile-speed"), chart_of(page, "profile-drive")
    assert (speed["x"], speed["sync"]) == (drive["x"], drive["sync"])
    number = int(figure_of(page, "profile-speed").title.split()[1].rstrip(","))
    line = next(line for line in run.lines if line.number == number)
    assert line.columns == max(line.columns for line in run.lines)
    t = np.array(speed["x"]) * 1e-3
    assert t[0] >= 0
    assert t[-1] == pytest.approx(line.stop - line.start, abs=1e-3)
    bands = {band["label"]: band["spans"] for band in speed["bands"]}
    ((begin, end),) = np.array(bands["printing"]) * 1e-3
    inside = (t > begin) & (t < end)
    true, demanded = (curve_of(page, "profile-speed", name) for name in ("true speed", "demanded"))
    assert np.abs(true[inside]).min() > 39
    assert (np.sign(true[inside]) == line.direction).all()
    assert demanded[inside] == pytest.approx(40.0 * line.direction)
    assert np.isnan(demanded[-1])  # no demand there: a gap, not a zero
    ((transition, over),) = bands["transition (TR)"]
    events = figure_of(page, "profile-speed").events
    texts = {event.text.partition(":")[0]: event.t * 1e3 for event in events}
    assert list(texts) == ["top of the ramp", "stop begins", "drive value passes zero", "zero speed"]
    assert transition == pytest.approx(texts["stop begins"], abs=0.01)
    assert over == pytest.approx(texts["drive value passes zero"], abs=0.01)
    assert speed["events"] == pytest.approx(list(texts.values()), abs=1e-3)


def test_each_event_tells_the_drive_after_it(page: Page) -> None:
    figure = figure_of(page, "profile-drive")
    t, drive = chart_of(page, "profile-drive")["x"], curve_of(page, "profile-drive", "drive value")
    for event in figure.events:
        row = int(np.argmin(np.abs(np.array(t) - event.t * 1e3)))
        assert event.drive is not None
        assert drive[row : row + 2].tolist().count(event.drive) >= 1


def test_the_turn_around_reverses_at_the_highest_speed(letter: Played, page: Page) -> None:
    _, run, _ = letter
    figure, chart = figure_of(page, "turn-current"), chart_of(page, "turn-speed")
    before, after = (int(word.rstrip(":")) for word in re.findall(r"\d+:?", figure.title))
    assert after == before + 1
    assert run.lines[after - 1].turn_around
    speed, current = curve_of(page, "turn-speed", "true speed"), curve_of(page, "turn-current", "motor current")
    assert chart["x"][0] == pytest.approx(-10, abs=1)
    assert speed[0] * speed[-1] < 0
    assert np.abs(speed[[0, -1]]).min() > 39
    assert np.sign(current[len(current) // 2]) == -np.sign(speed[0])
    assert [event.text.partition(":")[0] for event in figure.events] == [
        "stop begins", "drive value passes zero", "zero speed", "top of the ramp",
    ]  # fmt: skip
    assert figure.events[0].t == pytest.approx(0.0, abs=1e-9)
    # The computer sees zero speed by the absence of edges, a little later.
    assert np.interp(figure.events[2].t * 1e3, chart["x"], speed) == pytest.approx(0, abs=1.0)


@pytest.mark.parametrize("left_out", SIGNALS)
def test_a_trace_without_a_needed_signal_gives_a_report_without_its_figures(letter: Played, left_out: str) -> None:
    spec, run, trace = letter
    part = Trace(columns={name: trace[name] for name in trace if name != left_out})
    assert ids(print_page(spec, run, part)) == ["histogram", *IDENTIFIED]


def test_without_a_trace_the_figures_over_time_are_left_out(letter: Played) -> None:
    spec, run, _ = letter
    page = print_page(spec, run, None)
    assert ids(page) == ["histogram", *IDENTIFIED]
    assert len(table_of(page, "Every line")) == 11


@pytest.mark.parametrize("every", [100, 2_000, 25_000])
def test_a_sparse_trace_draws_what_it_can(every: int) -> None:
    drawn = ids(print_page(*play(every=every)))
    assert "path" in drawn
    assert ("profile-speed" in drawn) == (every == 100)


def test_of_a_trace_that_ends_early_the_recorded_lines_are_drawn(letter: Played) -> None:
    spec, run, trace = letter
    page = print_page(spec, run, trace.between(0, run.lines[2].stop))
    for name in ("profile-speed", "turn-speed"):
        numbers = [int(word) for word in re.findall(r"\d+", figure_of(page, name).title)]
        assert max(numbers) <= 3
    nothing = ids(print_page(spec, run, trace.between(0, run.time_ready / 2)))
    assert nothing == ["histogram", "path", *IDENTIFIED]


# ---- what the axis knows, and every line


def test_identified_lines_go_through_friction_and_top_speed(letter: Played, page: Page) -> None:
    _, run, _ = letter
    for side, found in run.identified.items():
        chart = chart_of(page, f"identified-{side}")
        assert (chart["x"][0], chart["x"][-1]) == (0, 40)
        line = curve_of(page, f"identified-{side}", "identified")
        assert line[[0, -1]] == pytest.approx([found.friction, found.friction + found.slope * 240 / 256], abs=0.01)
        true = curve_of(page, f"identified-{side}", "true machine")
        assert true[0] == pytest.approx(found.true_friction, abs=0.01)
        assert curve_of(page, f"identified-{side}", "power-on default")[0] == found.default_friction
        measured = curve_of(page, f"identified-{side}", "measured")
        points = measured[np.isfinite(measured)]
        assert points.tolist() == [found.drive_slow, found.drive_fast]
        # Equation (9) with the identified constants leads through both measured points, within a count and a half.
        assert line[np.isfinite(measured)] == pytest.approx(points, abs=1.5)


def test_constants_stand_beside_the_truth(letter: Played, page: Page) -> None:
    _, run, _ = letter
    rows = table_of(page, "Constants of the axis")
    names = ["slope K, right", "friction Vf, right", "slope K, left", "friction Vf, left", "width between the frames"]
    assert [row[0][: len(name)] for row, name in zip(rows, names, strict=True)] == names
    assert rows[0][1:3] == ["170", "170.0"]
    assert rows[4][1:] == [f"{run.width * 1e3:.1f}", "–", "–", "mm"]
    right = replace(run.identified["right"], slope=171, true_slope=170.0)
    page = print_page(letter[0], replace(run, identified={"right": right}), None)
    assert table_of(page, "Constants of the axis")[0][1:4] == ["171", "170", "+1 (+0.6 %)"]


def test_every_line_has_its_row(letter: Played, page: Page) -> None:
    _, run, _ = letter
    rows = table_of(page, "Every line")
    first, line = rows[0], run.lines[0]
    assert first == [
        "1", "← left", "40", "standing start", f"{line.start:.3f}", f"{line.stop - line.start:.3f}",
        str(line.characters), f"{line.worst_error * 1e6:.1f}", f"{line.rms_error * 1e6:.1f}",
    ]  # fmt: skip
    assert [row[0] for row in rows] == [str(line.number) for line in run.lines]
    assert {row[3] for row in rows[1:]} == {"turn-around"}


def test_a_line_is_timed_as_the_records_of_every_run() -> None:
    line = LineRecord(1, 1, 240, turn_around=False, start=7.5, stop=7.9, characters=2, columns=16, missed=0,
                      worst_error=0.0, rms_error=0.0)  # fmt: skip
    assert (line.begin, line.end) == (7.5, 7.9)


# ---- the page as a file


def test_the_page_is_well_formed_and_every_chart_has_its_place(page: Page) -> None:
    html = render_page(page)
    read = Reader(html)
    assert read.open == []
    assert len(read.ids) == len(set(read.ids))
    assert {chart["id"] for chart in charts_of(html)} == set(ids(page)) <= set(read.ids)
    assert render_page(page) == html


def test_what_the_job_says_cannot_break_the_page(letter: Played) -> None:
    spec, run, trace = letter
    evil = "</script><script>alert(1)//\u2028$body${x}"
    strikes = [
        replace(strike, character=replace(strike.character, char=char))
        for strike, char in zip(run.strikes, evil, strict=False)
    ]
    job = replace(run.job, name="<b>$data</b>")
    html = render_page(print_page(spec, replace(run, job=job, strikes=strikes), trace))
    assert "<script>alert" not in html
    paper = paper_of(html)
    assert paper
    printed = "".join(line["text"] for line in paper["pages"][0]["lines"])
    assert sorted(printed) == sorted(shown(evil))
    read = Reader(html)
    assert read.open == []
    assert "<b>$data</b>" in read.text


def test_every_colour_is_in_the_style_light_and_dark(page: Page) -> None:
    style = resources.files("detent.page").joinpath("template/report.css").read_text(encoding="utf-8")
    light, dark = re.findall(r":root[^{]*\{(.*?)\}", style, flags=re.DOTALL)[:2]
    used = {series["colour"] for chart in page.charts for series in chart["series"]}
    used |= {"band-" + band["colour"] for chart in page.charts for band in chart.get("bands", ())}
    assert used >= {"right", "left", "speed", "drive", "current", "muted", "ink", "band-brake", "band-good"}
    for name in used:
        assert f"--{name}:" in light
        assert f"--{name}:" in dark


def test_charts_are_plain_json(page: Page) -> None:
    assert json.loads(json.dumps(page.charts, allow_nan=False)) == page.charts
    for chart in page.charts:
        assert {len(series["y"]) for series in chart["series"]} == {len(chart["x"])}


def test_the_limit_is_half_the_finest_column() -> None:
    assert round(COLUMN * 1e6, 2) == 211.67
    assert 2 * COLUMN_LIMIT == COLUMN


@pytest.mark.process
def test_a_page_loads_no_plotting_library() -> None:
    code = (
        "import sys, detent.methods.print_head.page, detent.page.plots; "
        "print([name for name in ('matplotlib', 'h5py', 'pint') if name in sys.modules])"
    )
    source = Path(detent.__file__).parents[1]
    done = subprocess.run(
        [sys.executable, "-c", code], env={"PYTHONPATH": str(source)}, capture_output=True, check=True
    )
    assert done.stdout.strip() == b"[]"


# -- for the terminal ---------------------------------------------------------------------------------------


def rows_of(text: str, *overrides: str) -> tuple[PrintRun, dict[str, str]]:
    spec = load_spec(EXAMPLE, overrides)
    run = print_job(spec, parse_text(text))
    return run, dict(summary_rows(spec, run))


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
