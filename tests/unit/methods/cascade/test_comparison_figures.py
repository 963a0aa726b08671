"""What the comparison of a move in four variants shows: its figures, and its table for the terminal."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
from tests.unit.methods.cascade.samples import comparison, rigid_comparison

from detent.page.draw import draw_figures


def test_the_charts_have_four_curves_and_the_twist_begins_at_the_end_of_each_reference() -> None:
    move, swinging, _ = comparison().figures()
    (speed, following), (twist,) = move.charts, swinging.charts
    assert [curve["label"] for curve in speed["series"]] == ["trapezoid", "jerk-limited"]
    assert len(following["series"]) == len(twist["series"]) == 4
    looks = [(curve["colour"], curve.get("dash")) for curve in twist["series"]]
    assert looks == [("left", [5, 4]), ("left", None), ("speed", [5, 4]), ("speed", None)]
    assert following["yLabel"] == "following error [mm]"
    assert twist["yLabel"] == "twist [µm]"
    assert twist["x"][0] == 0.0
    # 3 um cos(900 t), from 0.6 s on.
    assert twist["series"][0]["y"][0] == pytest.approx(3 * math.cos(900 * 0.6), abs=0.02)
    assert twist["x"][-1] == pytest.approx(1e3 * 10 / 225, rel=1e-3)
    assert "225\u202fHz" in swinging.caption


def test_a_rigid_axis_has_nothing_left_swinging() -> None:
    charts = [chart["id"] for figure in rigid_comparison().figures() for chart in figure.charts]
    assert charts == ["profile-speed", "profile-following"]
    # The axis states no jerk.
    assert rigid_comparison().figures()[0].caption != comparison().figures()[0].caption


def test_the_table_of_the_page_has_a_row_for_each_way() -> None:
    table = comparison().figures()[-1].table
    assert table is not None
    rows = [[cell.text for cell, _ in table.cells(row)] for row in table.rows]
    assert rows[0] == ["trapezoid, no feedforward", "600 ms", "12.5 mm", "120 ms", "4.4 µm", "2.40 V"]
    assert rows[3][:2] == ["jerk-limited, feedforward", "625 ms"]


def test_the_terminal_has_a_row_for_each_way() -> None:
    title, heads, rows = comparison().table
    assert title == "A move of 250 mm at 500 mm/s, in four variants"
    assert len(heads) == 6
    assert rows[0] == ("trapezoid, no feedforward", "600 ms", "12.5 mm", "120 ms", "4.4 µm", "2.40 V")
    assert [row[0] for row in rows][3] == "jerk-limited, feedforward"
    first = rigid_comparison().cases[0]
    never = replace(rigid_comparison(), cases=(replace(first, approach=math.nan), *rigid_comparison().cases[1:]))
    assert never.table.rows[0][3:5] == ("not", "rigid")
    assert comparison(rotary=True).table.title.startswith("A move of 14.3")


def test_it_is_drawn_into_a_file(tmp_path: Path) -> None:
    draw_figures(comparison(rotary=True).figures(), tmp_path / "profiles.svg")
    assert (tmp_path / "profiles.svg").stat().st_size > 20_000
