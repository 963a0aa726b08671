"""The page about a list of moves: verdict first, every chart in its place, nothing that names can break."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
from tests.page_reader import Reader, charts_of
from tests.unit.methods.cascade.samples import (
    ROTARY,
    cascade_data,
    cascade_run,
    comparison,
    detail,
    failed_run,
    move,
    rigid_comparison,
)

from detent.methods.cascade import page as cascade_page
from detent.methods.cascade.page import make_cascade_page
from detent.methods.cascade.page_data import CascadeReportData
from detent.page.page import render_page, write_page

JOB = ["job-position", "job-following", "job-command"]
MOVE = ["move-position", "move-speed", "move-following", "move-command", "move-rest"]
PROFILES = ["profile-speed", "profile-following", "profile-twist"]


def read(data: CascadeReportData) -> str:
    return Reader(render_page(make_cascade_page(data))).text


def test_the_first_lines_say_whether_it_was_done_and_how_well() -> None:
    html = render_page(make_cascade_page(cascade_data()))
    text = Reader(html).text
    assert "Simulated run of the axis slide <1> ✔ Every move in position shuttle.csv" in text
    assert "2 moves in 3 s. On the way the axis was never more than 80 µm from where it should be" in text
    assert "at the end of each move the load stood within 8.0 µm of its target." in text
    assert "Moves in position2 of 2" in text
    assert "Longest settling40 msafter the reference's end, within 50 µm; move 1" in text
    assert "Largest following error80 µmmove 2; the drive goes off at 50 mm" in text
    assert "Worst error at rest8.0 µmof the load, move 2" in text
    assert "Peak command2.50 Vof 10 V, move 1" in text
    assert 'class="card bad"' not in html


def test_a_run_that_failed_says_where_why_and_what_to_do() -> None:
    html = render_page(make_cascade_page(cascade_data(run=failed_run())))
    text = Reader(html).text
    assert "✘ Not done shuttle.csv" in text
    assert "Stopped after 1 of 2 moves, 2.00 s in. Move 2 to <200 mm>: the drive is off." in text
    assert "10 V, move 2; at its limit for 200 ms" in text
    assert "✘ no" in text
    assert "Worst error at rest8.0 µmof the load, move 1" in text
    assert html.count('class="card bad"') == 2
    assert "Look for: how soon" not in text


def test_a_load_that_stands_beside_its_target_gets_no_praise() -> None:
    html = render_page(make_cascade_page(cascade_data(run=cascade_run(move(1), move(2, position=0.2 + 70e-6)))))
    text = Reader(html).text
    assert "! Done, but beside its targets" in text
    assert "the load stood up to 70.0 µm beside its target while the loop was in position." in text
    assert html.count('class="card bad"') == 1
    assert html.count('class="n over"') == 1


def test_a_run_without_a_move_in_position_has_no_figures_of_rest() -> None:
    failed = replace(failed_run().moves[1], number=1)
    text = read(cascade_data(run=cascade_run(failed, done=False, failure="move 1: off")))
    assert "Worst error at rest" not in text
    assert "Longest settling" not in text
    assert "nan" not in text.lower()


def test_a_run_that_made_no_move_shows_no_table() -> None:
    run = cascade_run(done=False, failure="after power-on: not in position")
    run.moves.clear()
    text = read(cascade_data(run=run, path=None, detail=None, comparison=None))
    assert "Stopped after 0 of 2 moves" in text
    assert "Move by move" not in text


def test_a_rotary_axis_is_told_in_degrees() -> None:
    run = cascade_run(move(1, start=0.0, target=math.pi / 2, position=math.pi / 2, peak_following=0.05), tolerance=1e-3)
    html = render_page(make_cascade_page(cascade_data(units=ROTARY, run=run, comparison=comparison(rotary=True))))
    text = Reader(html).text
    assert "never more than 2.86 deg from" in text
    assert "within 206 arcsec" in text
    labels = {chart["id"]: chart["yLabel"] for chart in charts_of(html)}
    assert labels["job-position"] == "position [deg]"
    assert labels["move-speed"] == "velocity [deg/s]"
    assert labels["job-following"] == "following error [arcsec]"
    assert "90.000" in html


def test_every_move_stands_in_the_table_and_a_long_one_is_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    html = render_page(make_cascade_page(cascade_data()))
    assert "−8" in Reader(html).text
    assert html.count("✔") == 3
    monkeypatch.setattr(cascade_page, "MOST_MOVES", 1)
    text = read(cascade_data())
    assert "1 further move is in the JSON summary only." in text


@pytest.mark.parametrize(
    ("changes", "ids"),
    [
        ({}, JOB + MOVE + PROFILES),
        ({"path": None}, MOVE + PROFILES),
        ({"detail": detail(rest=None)}, JOB + MOVE[:-1] + PROFILES),
        ({"detail": detail(rest=(0.7, 0.701))}, JOB + MOVE[:-1] + PROFILES),
        ({"detail": None, "comparison": rigid_comparison()}, JOB + PROFILES[:-1]),
        ({"path": None, "detail": None, "comparison": None}, []),
    ],
)
def test_every_chart_has_its_place(changes: dict[str, object], ids: list[str]) -> None:
    html = render_page(make_cascade_page(cascade_data(**changes)))
    page = Reader(html)
    assert [chart["id"] for chart in charts_of(html)] == ids
    assert html.count('class="chart"') == len(ids)
    assert set(ids) <= set(page.ids)
    assert len(page.ids) == len(set(page.ids))
    assert page.open == []
    assert page.fetched == []


def test_what_names_and_texts_say_cannot_break_the_page() -> None:
    evil = "</script><b>$data</b>"
    data = cascade_data(
        axis_name=evil, settings={"a": evil}, detail=None, run=cascade_run(done=False, failure=evil), notes=(),
    )  # fmt: skip
    page = Reader(render_page(make_cascade_page(data)))
    assert page.open == []
    # Title of the window, kicker, lead, small print.
    assert page.text.count(evil) == 4


def test_the_report_is_written_as_it_is_rendered(tmp_path: Path) -> None:
    target = tmp_path / "cascade.html"
    write_page(target, make_cascade_page(cascade_data(version="9.9")))
    assert target.read_text(encoding="utf-8") == render_page(make_cascade_page(cascade_data(version="9.9")))
    assert "Written by detent 9.9." in target.read_text(encoding="utf-8")
