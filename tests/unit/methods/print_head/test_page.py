import dataclasses
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tests.page_reader import Reader, charts_of, paper_of

import detent
from detent.methods.print_head.page import make_print_page
from detent.methods.print_head.page_data import ColumnErrors, Marks, ReportData
from detent.page.page import render_page, write_page
from detent.page.parts import Note


def test_the_first_lines_say_what_happened(report: ReportData) -> None:
    text = Reader(render_page(make_print_page(report))).text
    assert "✔ Printed LETTER.TXT" in text
    assert "2 lines and 4 characters on 2 pages in 0.800 s." in text
    assert "Every column of dots landed within 60 µm of its place." in text
    assert "Simulated run of the axis daisy & wheel" in text


def test_the_cards_carry_the_figures(report: ReportData) -> None:
    text = Reader(render_page(make_print_page(report))).text
    assert "Lines printed2 of 24 characters" in text
    assert "Throughput5 characters/sin 0.800 s" in text
    assert "Worst column error60 µmrms 11 µm, allowed 100 µm" in text
    assert "Top print speed40 in/s1.02 m/s, in 1 of 2 lines" in text
    assert "Turn-arounds1 of 1" in text


def test_a_run_that_stopped_says_where_why_and_what_to_do(report: ReportData) -> None:
    stopped = dataclasses.replace(
        report, printed=False, failure="Obstruction <7 in>; clear the way.", lines=report.lines[:1]
    )
    text = Reader(render_page(make_print_page(stopped))).text
    assert "✘ Not printed LETTER.TXT" in text
    assert "Stopped after 1 of 2 lines, 0.800 s into the job. Obstruction <7 in>; clear the way." in text
    assert "✔" not in text


def test_columns_off_their_place_spoil_the_headline(report: ReportData) -> None:
    html = render_page(make_print_page(dataclasses.replace(report, column_limit=50e-6)))
    text = Reader(html).text
    assert "! Printed, but off its columns" in text
    assert "✔" not in text
    assert "1 column landed more than 50 µm from its place." in text
    assert html.count('<td class="n over">') == 1
    assert html.count('<div class="card bad">') == 1


def test_several_columns_off_their_place_are_counted_in_both_directions(report: ReportData) -> None:
    text = Reader(render_page(make_print_page(dataclasses.replace(report, column_limit=1.5e-6)))).text
    assert "9 columns landed more than 1.5 µm from their place." in text


def test_a_run_without_columns_shows_no_column_error(report: ReportData, errors: ColumnErrors) -> None:
    nothing = dataclasses.replace(errors, right=errors.right * 0, left=errors.left * 0, worst=0.0, rms=0.0)
    html = render_page(make_print_page(dataclasses.replace(report, errors=nothing)))
    assert "olumn error" not in Reader(html).text
    assert "histogram" not in {chart["id"] for chart in charts_of(html)}
    assert "landed" not in Reader(html).text.partition("What came out")[0]


def test_errors_come_before_warnings_and_notes(report: ReportData) -> None:
    noted = dataclasses.replace(report, notes=[*report.notes, Note("error", "stalled")])
    text = Reader(render_page(make_print_page(noted))).text
    assert text.index("Errorstalled") < text.index("Warningheadroom <3 %") < text.index("NoteESC A accepted")


def test_a_long_job_says_that_its_path_is_cut(report: ReportData) -> None:
    assert "The whole job" in Reader(render_page(make_print_page(report))).text
    assert report.path
    long = dataclasses.replace(report, path=dataclasses.replace(report.path, t=report.path.t * 40), duration=80.0)
    text = Reader(render_page(make_print_page(long))).text
    assert "The first 30 seconds of 80 s" in text
    assert "The whole job" not in text


def test_tables_compare_lines_and_constants(report: ReportData) -> None:
    html = render_page(make_print_page(report))
    rows = re.findall(r"<tr>(.*?)</tr>", html, flags=re.DOTALL)
    cells = [[Reader(cell).text for cell in re.findall(r"<td.*?</td>", row, flags=re.DOTALL)] for row in rows]
    assert ["1", "→ right", "40", "standing start", "0.000", "0.300", "2", "2", "1.6"] in cells
    assert ["2", "← left", "20", "turn-around", "0.300", "0.500", "2", "60", "42"] in cells
    assert ["slope K, rightback-EMF", "171", "170", "+1 (+0.6 %)", "1/256 count per speed value"] in cells
    assert ["tau", "–", "40.16", "–", "ms"] in cells
    assert ["1", "0.0", "start", "132"] in cells
    assert ["2", "66.8", "zero speed", ""] in cells


def test_the_page_is_well_formed_and_every_chart_has_its_place(report: ReportData) -> None:
    html = render_page(make_print_page(report))
    page = Reader(html)
    assert page.open == []
    assert len(page.ids) == len(set(page.ids))
    charts = {chart["id"] for chart in charts_of(html)}
    assert charts == {
        "histogram", "path", "profile-speed", "profile-drive", "turn-current", "turn-speed", "identified-right",
        "identified-left",
    }  # fmt: skip
    assert charts <= set(page.ids)
    assert html.count('class="chart"') == len(charts)


def test_the_page_fetches_nothing_and_forbids_it(report: ReportData) -> None:
    html = render_page(make_print_page(report))
    assert Reader(html).fetched == []
    assert "Content-Security-Policy\" content=\"default-src 'none'" in html
    assert not re.search(r"@import|url\(|\bfetch\(|XMLHttpRequest", html)


def test_what_the_job_printed_cannot_break_the_page(report: ReportData, marks: Marks) -> None:
    text = list("</script><script>alert(1)//\u2028$body${x}")
    n = len(text)
    evil = Marks(
        characters=text, page=np.ones(n), line=np.ones(n), baseline=np.ones(n), column=np.arange(n) * 1e-3,
        landed=np.arange(n) * 1e-3, width=np.full(n, 2e-3), direction=np.ones(n), strikes=np.ones(n),
    )  # fmt: skip
    html = render_page(
        make_print_page(dataclasses.replace(report, marks=evil, job_name="<b>$data</b>", axis_name="</title>"))
    )
    assert "<script>alert" not in html
    paper = paper_of(html)
    assert paper
    assert paper["pages"][0]["lines"][0]["text"] == "".join(text)
    page = Reader(html)
    assert page.open == []
    assert "<b>$data</b>" in page.text
    assert len(marks) == 4


def test_parts_that_are_absent_leave_no_trace() -> None:
    bare = ReportData(
        axis_name="a", job_name="j", printed=False, duration=0.0, line_count=3, page_count=1, character_count=9,
        failure="Not calibrated.",
    )  # fmt: skip
    html = render_page(make_print_page(bare))
    page = Reader(html)
    assert charts_of(html) == []
    assert paper_of(html) is None
    assert "drawPaper" not in html
    assert 'class="chart"' not in html
    assert "<h2>" not in html
    assert "Stopped after 0 of 3 lines, 0 s into the job. Not calibrated." in page.text
    assert "nan" not in page.text.lower()


def test_lines_without_marks_are_counted_and_have_no_error(report: ReportData) -> None:
    lines = [dataclasses.replace(line, worst_error=float("nan"), rms_error=float("nan")) for line in report.lines]
    html = render_page(make_print_page(dataclasses.replace(report, marks=Marks(), errors=None, lines=lines)))
    page = Reader(html)
    assert "Throughput5 characters/s" in page.text
    assert "column error" not in page.text
    assert "What came out" not in page.text
    assert html.count('<td class="n">–</td>') >= 4
    assert "nan" not in page.text.lower()


def test_pages_that_are_not_drawn_are_counted(report: ReportData, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "not drawn" not in Reader(render_page(make_print_page(report))).text
    monkeypatch.setattr("detent.page.paper.MARKS", 3)
    assert "1 further page is not drawn." in Reader(render_page(make_print_page(report))).text


def test_lines_that_are_not_listed_are_counted(report: ReportData, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "further line" not in Reader(render_page(make_print_page(report))).text
    monkeypatch.setattr("detent.methods.print_head.page.MOST_LINES", 1)
    assert "1 further line is in the JSON summary only." in Reader(render_page(make_print_page(report))).text


def test_a_report_does_not_change_from_one_writing_to_the_next(report: ReportData, tmp_path: Path) -> None:
    write_page(tmp_path / "a.html", make_print_page(report))
    write_page(tmp_path / "b.html", make_print_page(report))
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.html", "b.html"]


def test_a_file_name_that_is_no_text_still_gives_a_page(report: ReportData, tmp_path: Path) -> None:
    write_page(tmp_path / "a.html", make_print_page(dataclasses.replace(report, job_name="letter\udcff.txt")))
    assert "letter?.txt" in (tmp_path / "a.html").read_text(encoding="utf-8")


def test_writing_a_report_loads_no_plotting_library() -> None:
    code = (
        "import sys, detent.methods.print_head.page, detent.page.plots; "
        "print([name for name in ('matplotlib', 'h5py', 'numba', 'pint', 'pydantic') if name in sys.modules])"
    )
    source = Path(detent.__file__).parents[1]
    done = subprocess.run(
        [sys.executable, "-c", code], env={"PYTHONPATH": str(source)}, capture_output=True, check=True
    )
    assert done.stdout.strip() == b"[]"
