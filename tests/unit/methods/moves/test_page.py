import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.page_reader import Reader, charts_of, paper_of
from tests.unit.methods.moves.samples import filtered_report, phase_move, phase_report, result

from detent.methods.moves import page as servo_page
from detent.methods.moves.page import make_servo_page
from detent.methods.moves.page_data import JobPath, ServoReportData, Worst
from detent.methods.print_head.page_data import Marks
from detent.page.page import render_page, write_page
from detent.page.parts import INCH


def read(report: ServoReportData) -> str:
    return Reader(render_page(make_servo_page(report))).text


def cells_of(html: str) -> list[list[str]]:
    rows = re.findall(r"<tr>(.*?)</tr>", html, flags=re.DOTALL)
    return [[Reader(cell).text for cell in re.findall(r"<td.*?</td>", row, flags=re.DOTALL)] for row in rows]


def text_report(**changes: object) -> ServoReportData:
    struck = list("ab<c")
    column = np.arange(4) * 0.1 * INCH
    marks = Marks(
        characters=struck, page=np.array([1, 1, 1, 2]), line=np.array([1, 1, 2, 67]),
        baseline=np.full(4, INCH / 6), column=column, landed=column + 1e-6, width=np.full(4, 0.1 * INCH),
        direction=np.ones(4), strikes=np.ones(4),
    )  # fmt: skip
    moves = [result(n, 0.0, 0.01, label=char) for n, char in enumerate(struck, 1)]
    return replace(phase_report(kind="text", marks=marks, moves=moves), **changes)


def test_the_first_lines_say_what_happened() -> None:
    text = read(phase_report())
    assert "Simulated run of the axis wire & pulley" in text
    assert "✔ Done list.csv" in text
    assert (
        "6 moves in 0.600 s. At the end of every dwell the axis stood within 2 µm (0.20 steps) of its target." in text
    )
    assert "4 characters in" not in text


def test_the_cards_carry_the_figures() -> None:
    text = read(phase_report())
    assert "Moves6 of 6arrived and stayed" in text
    assert "Time0.600 s10 moves per second" in text
    assert "Settled after82 msmedian; worst 90 ms, move 4" in text
    assert "Worst overshoot5 µm0.50 steps, move 3" in text
    assert "Worst error at rest2 µm0.20 steps, move 5, allowed 20 µm" in text
    assert "Peak speed346 mm/smove 6, limit 350" in text
    assert 'class="card bad"' not in render_page(make_servo_page(phase_report()))


def test_a_run_that_failed_says_where_why_and_what_to_do() -> None:
    report = phase_report()
    figures = replace(report.figures, arrived=1, error=Worst(422e-6, 2), worst_time=None, median_time=math.nan)
    failed = replace(report, done=False, failure="move 2 to <5 mm>: did not arrive", figures=figures)
    text = read(failed)
    assert "✘ Not done list.csv" in text
    assert "Stopped after 1 of 6 moves, 0.600 s into the job. Move 2 to <5 mm>: did not arrive. " in text
    assert "Time0.600 suntil it stopped" in text
    assert "Settled after" not in text
    assert "✔" not in text
    assert render_page(make_servo_page(failed)).count('class="card bad"') == 2


def test_an_axis_that_speaks_too_early_gets_no_praise() -> None:
    report = phase_report()
    early = replace(report, figures=replace(report.figures, early=Worst(2e-3, 4), early_moves=2))
    text = read(early)
    assert "! Done, but ready too early list.csv" in text
    assert "But in 2 moves it said that it had arrived before it was there for good." in text
    assert "✔" not in text


def test_the_move_is_told_with_its_events_and_why_it_is_shown() -> None:
    html = render_page(make_servo_page(phase_report()))
    text = Reader(html).text
    assert "Move 2, 20 mm to the right" in text
    assert "Shown is the move of middle length." in text
    assert ["2", "80.0", "mode switch"] in cells_of(html)
    assert ["1", "0.0", "set <strobe>"] in cells_of(html)
    assert "in steps of 10 µm. Arrived means within ±2 steps" in text
    to_left = read(phase_report(detail=phase_move(start=0.03)))
    assert "Move 2, 10.0 mm to the left" in to_left


def test_an_axis_that_never_stood_still_has_no_figure_of_its_rest() -> None:
    html = render_page(make_servo_page(phase_report(detail=phase_move(approach=None))))
    assert "Coming to rest" not in html
    assert "approach-place" not in {chart["id"] for chart in charts_of(html)}


def test_every_move_stands_in_the_table() -> None:
    report = phase_report(moves=[
        result(1, 0.0, 0.02, offset=1.5e-6),
        result(2, 0.02, 0.02, ready=0.003, settled=0.0),
        result(3, 0.02, 0.0, settled=0.085),
        result(4, 0.0, 0.01, ready=math.nan, settled=math.nan, offset=-422e-6),
    ])  # fmt: skip
    html = render_page(make_servo_page(report))
    cells = cells_of(html)
    assert ["1", "0.000", "0.000", "20.000", "→ right 20", "83", "82", "5", "+1.5"] in cells
    assert ["2", "0.100", "20.000", "20.000", "stays", "3", "0", "5", "−2"] in cells
    assert ["3", "0.200", "20.000", "0.000", "← left 20", "83", "85", "5", "−2"] in cells
    assert ["4", "0.300", "0.000", "10.000", "→ right 10", "–", "–", "5", "−422"] in cells
    # Settled after ready, not settled, and beyond the tolerance.
    assert html.count('<td class="n over">') == 3


def test_a_long_table_is_cut_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(servo_page, "MOST_MOVES", 4)
    html = render_page(make_servo_page(phase_report()))
    assert "2 further moves are in the JSON summary only." in Reader(html).text
    assert sum(len(row) == 9 for row in cells_of(html)) == 4


def test_few_moves_make_no_histogram() -> None:
    few = phase_report(moves=phase_report().moves[:4])
    assert "rest" not in {chart["id"] for chart in charts_of(render_page(make_servo_page(few)))}
    assert "Error at rest" not in read(few).partition("What came out")[2]
    assert "rest" in {chart["id"] for chart in charts_of(render_page(make_servo_page(phase_report())))}


def test_a_job_that_is_drawn_in_part_says_so() -> None:
    report = phase_report()
    assert "The whole job" in read(report)
    t = np.arange(0, 80, 0.1)
    long = JobPath(t=t, position=t, target=t)
    figures = replace(report.figures, seconds=80.0)
    assert "The first 30 s of 80 s" in read(replace(report, path=long, figures=figures))
    # The trace ends before the job does.
    assert "The first 0.599 s of 80 s" in read(replace(report, figures=figures))


def test_the_page_is_well_formed_and_every_chart_has_its_place() -> None:
    for report, ids in (
        (phase_report(), {"job", "rest", "move-speed", "move-to-go", "move-drive", "approach-place", "approach-words",
                          "noise", "still-0", "still-1", "still-2", "loaded-place", "loaded-integral"}),
        (filtered_report(), {"job", "rest", "move-speed", "move-counted", "move-deviation", "move-drive",
                             "approach-place", "approach-words", "feedback-speed", "feedback-drive"}),
    ):  # fmt: skip
        html = render_page(make_servo_page(report))
        page = Reader(html)
        assert page.open == []
        assert len(page.ids) == len(set(page.ids))
        assert {chart["id"] for chart in charts_of(html)} == ids
        assert ids <= set(page.ids)
        assert html.count('class="chart"') == len(ids)
        assert page.fetched == []


def test_parts_that_are_absent_leave_no_trace() -> None:
    report = phase_report()
    nothing = replace(
        report.figures, arrived=0, seconds=0.0, rate=0.0, median_time=math.nan, worst_time=None, overshoot=None,
        error=None, peak_speed=None,
    )  # fmt: skip
    bare = replace(
        report, done=False, failure="Not ready.", figures=nothing, moves=(), path=None, detail=None, noise=None,
        hold=None, notes=(), settings={},
    )  # fmt: skip
    html = render_page(make_servo_page(bare))
    assert charts_of(html) == []
    assert paper_of(html) is None
    assert "<h2>" not in html
    assert "Stopped after 0 of 6 moves, 0 s into the job. Not ready. " in Reader(html).text
    assert "nan" not in Reader(html).text.lower()


def test_a_text_stands_on_paper_and_its_characters_in_the_table() -> None:
    html = render_page(make_servo_page(text_report()))
    paper = paper_of(html)
    assert paper
    assert [line["text"] for page in paper["pages"] for line in page["lines"]] == ["ab", "<", "c"]
    assert (paper["limit"], paper["magnify"]) == (20.0, 2000)
    text = Reader(html).text
    assert "Errors × 2 000" in text
    assert {"true-size", "magnified", "page-back", "page-next"} <= set(Reader(html).ids)
    assert "6 characters in 0.600 s." in text
    assert "Time0.600 s10 characters per second" in text
    assert ["3", "<", "0.200", "0.000", "10.000", "→ right 10", "83", "82", "5", "−2"] in cells_of(html)


def test_pages_of_a_text_that_are_not_drawn_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("detent.methods.print_head.charts.MARKS", 3)
    html = render_page(make_servo_page(text_report()))
    assert "1 further page is not drawn." in Reader(html).text
    assert "page-next" not in Reader(html).ids


def test_what_names_and_labels_say_cannot_break_the_page() -> None:
    evil = "</script><b>$data</b>"
    report = text_report(axis_name=evil, job_name=evil, moves=[result(1, 0.0, 0.01, label=evil)], settings={"a": evil})
    page = Reader(render_page(make_servo_page(report)))
    assert page.open == []
    # Twice in the title of the window, then axis, job, character and small print.
    assert page.text.count(evil) == 6


def test_the_report_is_written_as_it_is_rendered(tmp_path: Path) -> None:
    target = tmp_path / "moves.html"
    write_page(target, make_servo_page(phase_report(version="9.9")))
    assert target.read_text(encoding="utf-8") == render_page(make_servo_page(phase_report(version="9.9")))
    assert "Written by detent 9.9." in target.read_text(encoding="utf-8")
