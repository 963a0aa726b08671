import math
import re
from dataclasses import replace
from pathlib import Path

import pytest
from tests.page_reader import Reader, charts_of
from tests.unit.methods.stepper_envelope.samples import (
    MM,
    detail,
    figures,
    motion,
    motor_runs,
    stage_data,
    stage_path,
    tile,
    tiles_data,
)

from detent.methods.stepper_envelope import page as stage_page
from detent.methods.stepper_envelope.page import make_stage_page
from detent.methods.stepper_envelope.page_data import StageReportData
from detent.methods.stepper_envelope.stage_results import StageMoveResult, WorstMotion
from detent.page.page import render_page, write_page


def read(report: StageReportData) -> str:
    return Reader(render_page(make_stage_page(report))).text


def cells_of(html: str) -> list[list[str]]:
    rows = re.findall(r"<tr>(.*?)</tr>", html, flags=re.DOTALL)
    return [[Reader(cell).text for cell in re.findall(r"<td.*?</td>", row, flags=re.DOTALL)] for row in rows]


def test_the_first_lines_say_what_happened() -> None:
    text = read(stage_data())
    assert "Simulated run of the axis micro & scope" in text
    assert "✔ Done list.csv" in text
    assert (
        "2 moves in 0.400 s, 300 moves per minute; no step was lost. "
        "At the constant start frequency the motors would run 5 times as long."
    ) in text
    assert "2 tiles in 0.400 s, 300 tiles per minute" in read(tiles_data())


def test_the_cards_carry_the_figures() -> None:
    text = read(stage_data())
    assert "Moves in place2 of 2every rotor on its step" in text
    assert "Time0.400 s300 moves per minute" in text
    assert "Lost steps0 of 600 made" in text
    assert "Worst rotor lag1.04 stepsmove 1, x; out of step from 2" in text
    assert "Least torque margin× 2.50 move 2, x; falls behind below 1" in text
    assert "Time saved0.800 s5 times as fast as at the start frequency (1 s)" in text
    assert 'class="card bad"' not in render_page(make_stage_page(stage_data()))


def test_tiles_go_by_their_names() -> None:
    text = read(tiles_data())
    assert "Worst rotor lag1.04 stepstile 11, x" in text
    assert "Tiles in place2 of 2" in text


def test_lost_steps_are_the_headline() -> None:
    lost = figures(
        placed=1, lost={"x": -12, "y": 4}, first_lost=WorstMotion(-16.0, 2, "x"), lag=WorstMotion(17.0, 2, "x"),
        margin=WorstMotion(0.87, 2, "x"),
    )  # fmt: skip
    html = render_page(
        make_stage_page(stage_data(done=False, failure="move 2: motor x lost 16 steps; lower it", figures=lost))
    )
    text = Reader(html).text
    assert "✘ Not done list.csv" in text
    assert "1 of 2 moves in place. Move 2: motor x lost 16 steps; lower it." in text
    assert "Moves in place1 of 21 not" in text
    assert "Lost steps16 in the end; move 2, x lost 16 first" in text
    assert html.count('class="card bad"') == 4
    assert "Time saved" not in text
    assert "✔" not in text


def test_a_run_that_broke_off_says_how_far_it_came() -> None:
    broken = figures(asked=5, made=2, placed=2)
    text = read(stage_data(done=False, failure="move 3: motor x: fault.", figures=broken))
    assert "Stopped after 2 of 5 moves, 0.400 s into the job. Move 3: motor x: fault. " in text
    assert "Moves in place2 of 53 not" in text
    assert "Time0.400 sfor the whole job" in text


def test_the_move_is_told_with_its_motor_and_why_it_is_shown() -> None:
    html = render_page(make_stage_page(stage_data()))
    text = Reader(html).text
    assert "Move 2 “zoom & in”, step by step" in text
    assert "Shown is the motion with the least torque margin: motor x, 1 mm up. " in text
    assert "the least margin, × 2.50, and where it is" in text
    assert ["1", "0.0", "start <signal>"] in cells_of(html)
    back = detail(motion=motion(start=3 * MM, stop=1 * MM), runs=motor_runs())
    assert "motor x, 2 mm down, with 1 turn on the way. " in read(stage_data(detail=back))
    assert "Tile zoom & in, step by step" in read(tiles_data())


def test_a_motion_that_needs_no_torque_has_any_margin() -> None:
    free = detail(motion=motion(margin=math.inf))
    assert "the least margin, × any, and where it is" in read(stage_data(detail=free))


def test_every_motion_stands_in_the_table() -> None:
    html = render_page(make_stage_page(stage_data()))
    cells = cells_of(html)
    assert ["1", "zoom in", "0.000", "x", "0.000", "1.000", "↑ up 1", "100", "2 000", "1.04", "2.50", "0"] in cells
    assert ["", "", "", "y", "0.000", "1.000", "↑ up 1", "100", "2 000", "1.04", "any", "0"] in cells
    assert ["2", "wide", "0.200", "x", "1.000", "0.000", "↓ down 1", "100", "2 000", "1.04", "2.50", "0"] in cells
    heads = [Reader(one).text for one in re.findall(r"<th .*?</th>", html)]
    assert heads[-12:] == [
        "move", "name", "start [s]", "motor", "from [mm]", "to [mm]", "way [mm]", "time [ms]", "peak [Hz]",
        "lag [step]", "margin", "lost [step]",
    ]  # fmt: skip


def test_what_is_wrong_is_marked_in_the_table_and_where_the_rotor_stands_after_it() -> None:
    moves = [
        StageMoveResult(number=1, label="", begin=0.0, seconds=0.1, motions=[
            motion(lag=5.0, margin=0.9, lost=-4, off=-4, start=-1e-17, target=-2 * MM, stop=-2 * MM),
        ]),
        StageMoveResult(number=2, label="", begin=0.2, seconds=0.1, motions=[motion(off=-4)]),
        StageMoveResult(number=3, label="", begin=0.4, seconds=0.0, motions=[]),
    ]  # fmt: skip
    html = render_page(make_stage_page(stage_data(moves=moves)))
    cells = cells_of(html)
    assert ["1", "0.000", "x", "0.000", "−2.000", "↓ down 2", "100", "2 000", "5", "0.900", "−4", "−4"] in cells
    assert ["2", "0.200", "x", "0.000", "1.000", "↑ up 1", "100", "2 000", "1.04", "2.50", "0", "−4"] in cells
    assert ["3", "0.400", "none: stays", *[""] * 9] in cells
    table = html[html.index("Every move") :]
    assert table.count('class="n over"') == 5
    assert "Off: how far the rotor stood beside its place" in Reader(html).text


def test_a_long_table_is_cut_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stage_page, "MOST_MOTIONS", 2)
    html = render_page(make_stage_page(stage_data()))
    assert "1 further row is in the JSON summary only." in Reader(html).text
    assert sum(len(row) == 12 for row in cells_of(html)) == 2


def test_the_envelope_is_explained_once_and_zones_are_named() -> None:
    text = read(stage_data())
    assert text.count("motion up above zero, motion down below it") == 1
    assert text.count("1 000 Hz is 5 mm/s.") == 2
    assert "The shaded zones have a limit of their own: near (10 to 13 mm)." in text
    assert "drawn is what was used" not in text
    zone = motor_runs().zones[0]
    many = [replace(zone, name=f"z{n}") for n in range(6)]
    text = read(stage_data(runs=[motor_runs(zones=many, left_out=3)]))
    assert "z3 (10 to 13 mm) and 2 more." in text
    assert "3 further moves are not drawn." in text


def test_a_crop_of_the_travel_is_told() -> None:
    (runs,) = [motor_runs(travel=(-200 * MM, 200 * MM))]
    assert "The travel goes from −200 to 200 mm; drawn is what was used." in read(stage_data(runs=[runs]))


def test_more_motors_than_have_room_are_counted() -> None:
    path = stage_path()
    many = stage_data(runs=[motor_runs()] * 8, path=replace(path, motors=[path.motors[0]] * 8))
    text = read(many)
    assert text.count("2 further motors are not drawn.") == 2
    assert {"runs-5", "path-5"} <= set(Reader(render_page(make_stage_page(many))).ids)
    assert "runs-6" not in Reader(render_page(make_stage_page(many))).ids


def test_a_job_that_is_drawn_in_part_says_so() -> None:
    assert "Where the motors were" in read(stage_data())
    long = stage_data(path=stage_path(80.0), figures=figures(seconds=80.0))
    assert "The first 30 s of 80 s" in read(long)


def test_tiles_are_drawn_from_above(monkeypatch: pytest.MonkeyPatch) -> None:
    text = read(tiles_data())
    assert "The tiles from above" in text
    assert "The stage came from x 0, y 0 mm." in text
    assert "further tile" not in text
    monkeypatch.setattr(stage_page, "MOST_TILES", 3)
    assert "1 further tile is not drawn." in read(tiles_data())


def test_the_page_is_well_formed_and_every_chart_has_its_place() -> None:
    ids = {
        "path-0", "path-1", "runs-0", "runs-1", "detail-runs", "detail-torque", "detail-margin", "detail-speed",
        "detail-lag", "rest-lag", "jerk-whole", "jerk-begin", "jerk-end",
    }  # fmt: skip
    for report in (stage_data(), tiles_data()):
        html = render_page(make_stage_page(report))
        page = Reader(html)
        assert page.open == []
        assert len(page.ids) == len(set(page.ids))
        assert {chart["id"] for chart in charts_of(html)} == ids
        assert html.count('class="chart"') == len(ids)
        assert ids <= set(page.ids)
        assert page.fetched == []


def test_parts_that_are_absent_leave_no_trace() -> None:
    nothing = figures(
        made=0, placed=0, seconds=0.0, rate=0.0, moving=0.0, naive=0.0, steps=0, lag=None, rest=None, margin=None,
        peak_hz=None, peak_speed=None,
    )  # fmt: skip
    bare = stage_data(
        done=False, failure="Not ready.", figures=nothing, moves=(), path=None, runs=(), detail=None, steps=(),
        jerk=None, notes=(), settings={},
    )  # fmt: skip
    html = render_page(make_stage_page(bare))
    assert charts_of(html) == []
    assert "<h2>" not in html
    assert "Stopped after 0 of 2 moves, 0 s into the job. Not ready. " in Reader(html).text
    assert "nan" not in Reader(html).text.lower()
    html = render_page(make_stage_page(stage_data(detail=detail(torques=None, rotor=None))))
    text = Reader(html).text
    assert "Margin of torque at every step" not in text
    assert "How the rotor followed" not in text
    assert "Coming to rest" not in text
    assert html.count('class="chart"') == len(charts_of(html)) == 8


def test_what_names_and_labels_say_cannot_break_the_page() -> None:
    evil = "</script><b>$data</b>"
    moves = [StageMoveResult(number=1, label=evil, begin=0.0, seconds=0.1, motions=[motion(evil)])]
    plan = replace(tiles_data().plan, tiles=[tile(1, 0.0, 0.0, label=evil)])
    report = tiles_data(
        axis_name=evil, job_name=evil, moves=moves, plan=plan, settings={"a": evil},
        detail=detail(label=evil, motion=motion(evil)), runs=[motor_runs(evil)],
    )  # fmt: skip
    page = Reader(render_page(make_stage_page(report)))
    assert page.open == []
    assert page.text.count(evil) >= 8


def test_the_report_is_written_as_it_is_rendered(tmp_path: Path) -> None:
    target = tmp_path / "stage.html"
    write_page(target, make_stage_page(stage_data(version="9.9")))
    assert target.read_text(encoding="utf-8") == render_page(make_stage_page(stage_data(version="9.9")))
    assert "Written by detent 9.9." in target.read_text(encoding="utf-8")
