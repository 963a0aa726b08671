import math
import re
from dataclasses import replace
from pathlib import Path

import pytest
from tests.page_reader import Reader, charts_of, paper_of
from tests.unit.methods.rotary_table.samples import COUNT, deg, result, table_report, turn_detail

from detent.methods.rotary_table import charts as table_charts
from detent.methods.rotary_table import page as table_page
from detent.methods.rotary_table.page import make_table_page
from detent.methods.rotary_table.page_data import Signal, TableReportData, WorstStep
from detent.page.page import render_page, write_page
from detent.page.parts import Note


def read(report: TableReportData) -> str:
    return Reader(render_page(make_table_page(report))).text


def cells_of(html: str) -> list[list[str]]:
    rows = re.findall(r"<tr>(.*?)</tr>", html, flags=re.DOTALL)
    return [[Reader(cell).text for cell in re.findall(r"<td.*?</td>", row, flags=re.DOTALL)] for row in rows]


def figures(**changes: object) -> TableReportData:
    report = table_report()
    return replace(report, figures=replace(report.figures, **changes))


def test_the_first_lines_say_what_happened() -> None:
    text = read(table_report())
    assert "Simulated run of the axis index & mill" in text
    assert "✔ Done shop.toml" in text
    assert (
        "5 steps in 10 s. The table turned 1.25 turns and crossed the end of its turn once. In every positioning it "
        "came to within 1.8 arcsec (0.50 counts) of its target." in text
    )
    assert "The table turned 0.25 turns. In every" in read(figures(travel=deg(90), crossings=0))


def test_the_cards_carry_the_figures() -> None:
    html = render_page(make_table_page(table_report()))
    text = Reader(html).text
    assert "Steps5 of 51 positioning, 1 jog" in text
    assert "Time10 sfor the sequence" in text
    assert "Worst error at rest0.50 counts1.8 arcsec, step 1; window 2 counts" in text
    assert "Turned1.25 turnsend of the turn crossed once, 1 rollover" in text
    assert "Largest lag2.17 degdeviation dR, step 5" in text
    assert "Peak speed61.2 deg/sstep 5, command limited to 60" in text
    assert 'class="card bad"' not in html
    assert "Turned1.25 turnswithin the turn" in read(figures(crossings=0, rollovers=0))


def test_a_sequence_that_moves_nothing_says_nothing_about_the_table() -> None:
    text = read(figures(positionings=0, jogs=0, error=None, deviation=None, peak_speed=None))
    assert "5 steps in 10 s. Steps5 of 5" in text
    for word in ("Turned", "Largest lag", "Peak speed", "Worst error"):
        assert word not in text


def test_a_run_that_failed_says_where_why_and_what_to_do() -> None:
    failed = replace(figures(made=1, error=None), done=False, failure="step 2 of 5, <jog>: the table has run away")
    html = render_page(make_table_page(failed))
    text = Reader(html).text
    assert "✘ Not done shop.toml" in text
    assert "Stopped after 1 of 5 steps, 10 s in. Step 2 of 5, <jog>: the table has run away." in text
    assert "Time10 suntil it stopped" in text
    assert "✔" not in text
    assert html.count('class="card bad"') == 1
    assert "Look for: the true angle" not in text


def test_a_table_that_stands_beside_its_targets_gets_no_praise() -> None:
    off = figures(error=WorstStep(20 * COUNT, 1))
    html = render_page(make_table_page(off))
    text = Reader(html).text
    assert "! Done, but beside its targets shop.toml" in text
    assert "But in step 1 it stood 72 arcsec (20 counts) beside its target while the axis said" in text
    assert "✔" not in text
    assert html.count('class="card bad"') == 1
    # The window and one count of the detector are allowed.
    assert "✔" in read(figures(error=WorstStep(2.99 * COUNT, 1)))


def test_the_time_line_is_told_as_far_as_it_goes() -> None:
    text = read(table_report())
    assert "Time line What" not in text  # title and caption stand apart
    assert "A jog that waits for its signal begins before the table moves." in text
    assert "Look for: the true angle, which runs on without a step where D jumps." in text
    assert "A jog that waits" not in read(table_report(inputs=()))
    part = figures(seconds=500.0)
    assert "The first 9.99 s of 8 min 20 s" in read(part)
    many = table_report(outputs=[Signal(f"o{n}", []) for n in range(table_charts.MOST_SIGNALS)])
    assert "1 further signal is not drawn." in read(many)


def test_without_a_trace_the_time_line_shows_steps_and_signals() -> None:
    html = render_page(make_table_page(table_report(path=None, detail=None, comparison=None)))
    assert [chart["id"] for chart in charts_of(html)] == ["line-steps"]
    assert "D is what the detector says" not in html


def test_the_step_is_told_with_its_events_and_why_it_is_shown() -> None:
    html = render_page(make_table_page(table_report()))
    text = Reader(html).text
    assert "How the table goes on beyond a turn" in text
    assert "Step 5: jog + at <60> deg/s" in text
    assert "Shown is the jog that crosses the end of the turn most often." in text
    assert ["1", "0.000", "+ <button>"] in cells_of(html)
    assert ["3", "6.000", "rollover"] in cells_of(html)
    assert "R = D + n turns. Shaded: R is not D." in text
    assert "Look for: a deviation that knows nothing of all this" in text


@pytest.mark.parametrize(
    ("changes", "told", "not_told"),
    [
        ({"kind": "go"}, "a deviation that knows nothing of the end of the turn", "rollover)"),
        ({"failed": True}, "Look for: where the lag leaves its course.", "knows nothing"),
        ({"form": "flag"}, "notes the jump in FLG", "R = D + n turns"),
        ({"form": "raw"}, "R is D.", "Shaded"),
        ({"crossings": 0}, "One step in detail", "How the table goes on"),
    ],
)
def test_the_caption_tells_what_is_shown(changes: dict[str, object], told: str, not_told: str) -> None:
    text = read(table_report(detail=turn_detail(**changes), comparison=None))
    assert told in text
    assert not_told not in text


def test_every_step_stands_in_the_table() -> None:
    cells = cells_of(render_page(make_table_page(table_report())))
    nothing = [""] * 8
    assert ["1", "go to position 1 (90 deg, <shortest>)", "0.000", "2.000", "0.000", "90.000", "+90.000", "+0.50", "1",
            "", ""] in cells  # fmt: skip
    assert ["2", 'set "clamp"', "2.000", *nothing] in cells
    assert ["3", "wait 4 s", "2.000", "4.000", "90.000", "90.000", *[""] * 5] in cells
    assert ["5", 'jog + at 60 deg/s while "feed"', "6.000", "4.000", "90.000", "90.000", "+360.000", "−1.2", "2.17",
            "1", "1"] in cells  # fmt: skip


def test_angles_of_the_table_stay_within_the_turn() -> None:
    steps = [result(1, start=-0.0004, stop=-90.0), result(2, start=719.9998, stop=0.0, offset=5 * COUNT)]
    html = render_page(make_table_page(table_report(steps=steps)))
    cells = cells_of(html)
    assert cells[-2][4:7] == ["0.000", "270.000", "−90.000"]
    assert cells[-1][4:7] == ["0.000", "0.000", "−720.000"]
    # Beyond window and resolution.
    table = html.partition("Step by step")[2]
    assert table.count('class="n over"') == 1


def test_a_step_without_a_target_has_a_dash() -> None:
    cells = cells_of(render_page(make_table_page(table_report(steps=[result(1, "jog", offset=math.nan)]))))
    assert cells[-1][7] == "–"


def test_a_long_table_is_cut_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table_page, "MOST_STEPS", 3)
    html = render_page(make_table_page(table_report()))
    assert "2 further steps are in the JSON summary only." in Reader(html).text
    assert sum(len(row) == 11 for row in cells_of(html)) == 3


def test_the_page_is_well_formed_and_every_chart_has_its_place() -> None:
    html = render_page(make_table_page(table_report()))
    page = Reader(html)
    ids = {
        "line-steps", "line-turns", "line-detected", "line-speed", "turn-angles", "turn-count", "turn-deviation",
        "turn-speed", "cross-way", "cross-deviation", "cross-speed",
    }  # fmt: skip
    assert page.open == []
    assert len(page.ids) == len(set(page.ids))
    assert {chart["id"] for chart in charts_of(html)} == ids
    assert ids <= set(page.ids)
    assert html.count('class="chart"') == len(ids)
    assert page.fetched == []
    assert paper_of(html) is None
    assert "Warningsignal <late>" in page.text


def test_parts_that_are_absent_leave_no_trace() -> None:
    report = table_report()
    nothing = replace(
        report.figures, made=0, positionings=0, jogs=0, seconds=0.0, travel=0.0, crossings=0, rollovers=0, error=None,
        deviation=None, peak_speed=None,
    )  # fmt: skip
    bare = replace(
        report, done=False, failure="Not ready.", figures=nothing, steps=(), outputs=(), inputs=(), path=None,
        detail=None, comparison=None, notes=(), settings={},
    )  # fmt: skip
    html = render_page(make_table_page(bare))
    assert charts_of(html) == []
    assert "<h2>" not in html
    assert "Stopped after 0 of 5 steps, 0 s in. Not ready. " in Reader(html).text
    assert "nan" not in Reader(html).text.lower()


def test_what_names_and_texts_say_cannot_break_the_page() -> None:
    evil = "</script><b>$data</b>"
    report = table_report(
        axis_name=evil, job_name=evil, steps=[result(1, text=evil)], outputs=[Signal(evil, [(0.0, 1.0)])],
        detail=turn_detail(text=evil, why=evil), notes=[Note("note", evil)], settings={"a": evil},
    )  # fmt: skip
    page = Reader(render_page(make_table_page(report)))
    assert page.open == []
    # Twice in the title of the window; axis, job, title and reason of the detail, step, note and small print.
    assert page.text.count(evil) == 9


def test_the_report_is_written_as_it_is_rendered(tmp_path: Path) -> None:
    target = tmp_path / "table.html"
    write_page(target, make_table_page(table_report(version="9.9")))
    assert target.read_text(encoding="utf-8") == render_page(make_table_page(table_report(version="9.9")))
    assert "Written by detent 9.9." in target.read_text(encoding="utf-8")
