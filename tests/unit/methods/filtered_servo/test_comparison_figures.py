"""What the comparison of the filtered servo shows: its figures, and its table for the terminal."""

import math
from dataclasses import replace

import numpy as np
from tests.unit.methods.filtered_servo.samples import feedback_comparison

from detent.methods.filtered_servo.comparison import FeedbackComparison
from detent.page.table import Cell


def curves_of(chart: dict) -> dict:
    return {series["label"]: series["y"] for series in chart["series"]}


def rows_of(found: FeedbackComparison) -> dict[str, list[Cell]]:
    table = found.figures()[-1].table
    assert table is not None
    rows = [[cell for cell, _ in table.cells(row)] for row in table.rows]
    return {row[0].text: row[1:] for row in rows}


def test_filtered_and_unfiltered_words_share_the_charts() -> None:
    figure, _ = feedback_comparison().figures()
    speed, drive = figure.charts
    assert list(curves_of(speed)) == ["without the filter", "with the filter"]
    assert speed["x"][0] == 0.0
    assert set(map(abs, curves_of(drive)["with the filter"])) <= {0.0, 0.6}
    assert max(curves_of(drive)["without the filter"]) == 1.8
    assert max(curves_of(speed)["with the filter"]) == 20.6
    assert "3 times quieter" in figure.caption


def test_every_case_is_a_row_and_the_unstable_one_stands_out() -> None:
    rows = rows_of(feedback_comparison())
    texts = {name: [cell.text for cell in row] for name, row in rows.items()}
    conventional = texts["<conventional>"]
    assert conventional == ["5", "4", "–", "50", "1.80", "1.80", "−1.8 … 3.6", "3.60", "2", "× 4"]
    filtered = texts["with filter"]
    assert filtered == ["5", "4", "0.250", "50", "0.600", "0.600", "−0.60 … 1.2", "1.20", "2", "× 2.50"]
    long = rows["long window"]
    assert [cell.text for cell in long[:4]] == ["20", "1", "–", "–"]
    assert [cell.over for cell in long] == [False] * 8 + [True] * 2
    assert sum(cell.over for row in rows.values() for cell in row) == 2
    assert texts["small multiplier"][3] == "200"


def test_a_case_that_failed_or_has_no_limit_is_told_and_not_drawn() -> None:
    found = feedback_comparison()
    without, with_filter, *others = found.cases
    gone = replace(with_filter, t=np.empty(0), std_error=math.nan, std_speed=math.nan, stable=False)
    endless = replace(without, gain_limit=math.inf, gain_margin=math.inf)
    changed = replace(found, cases=(endless, gone, *others))
    rows = rows_of(changed)
    assert rows["<conventional>"][-1].text == "any"
    assert [cell.text for cell in rows["with filter"][4:6]] == ["–", "–"]
    assert not changed.figures()[0]


def test_the_terminal_has_a_row_for_each_case() -> None:
    _, heads, rows = feedback_comparison().table
    assert {len(row) for row in rows} == {len(heads)}
    assert [row[0] for row in rows] == ["<conventional>", "with filter", "long window", "small multiplier"]
    assert rows[2][-2:] == ["never at rest", "× 0.685: unstable"]
