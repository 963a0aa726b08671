from dataclasses import dataclass, replace

import pytest
from tests.unit.page.samples import figures, over_time, page, plain_chart, table

from detent.page.figure import Figure
from detent.page.frame import Card, Section, card, comparison_page, comparison_section
from detent.page.parts import Event
from detent.page.table import MOST_ROWS, Cell, Table, TextTable, bar_cell, left_out, long_table, offset_cell
from detent.page.words import GAP


def test_two_charts_of_one_id_are_refused() -> None:
    twice = Section("One", [Figure(title="a", charts=[plain_chart("x")]), Figure(title="b", charts=[plain_chart("x")])])
    with pytest.raises(ValueError, match="share an id: x;"):
        replace(page(), sections=[twice])


def test_two_printed_pages_are_refused() -> None:
    printed = Figure(title="a", paper={"pages": [{}]})
    with pytest.raises(ValueError, match="two printed pages"):
        replace(page(), sections=[Section("One", [printed, printed])])


def test_a_page_knows_the_charts_of_its_figures_in_their_order() -> None:
    assert [chart["id"] for chart in page().charts] == ["speed", "drive", "heaps", "lanes", "loops"]
    assert page().paper is None
    assert [figure.title for figure in page().figures] == ["Speed < drive", "Two", "Loops", "Cells", "Drawn"]


def test_only_charts_over_time_and_loops_are_zoomed() -> None:
    assert [figure.zooms for figure in figures()] == [True, False, True, False, False, False]


def test_events_are_listed_in_the_unit_of_their_charts() -> None:
    events = [Event(0.0123, "stop", -12), Event(1.5, "at rest")]
    in_ms = Figure(title="a", charts=over_time(), events=events).event_table
    assert in_ms is not None
    assert [title for title, _ in in_ms.heads] == ["", "time [ms]", "what happens", "drive after [count]"]
    assert [row[1:] for row in in_ms.rows] == [["12.3", "stop", "−12"], ["1500.0", "at rest", ""]]
    in_s = Figure(title="a", charts=[plain_chart("x") | {"xLabel": "time [s]"}], events=events[1:]).event_table
    assert in_s is not None
    assert [title for title, _ in in_s.heads] == ["", "time [s]", "what happens"]
    assert in_s.rows[0][1] == "1.500"
    assert Figure(title="a", charts=over_time()).event_table is None


def test_a_row_has_a_cell_for_each_head() -> None:
    with pytest.raises(ValueError, match="row 2 has 1 cells, expected: 2"):
        Table(heads=[("a", False), ("b", True)], rows=[["1", "2"], ["1"]])


def test_bars_are_shares_of_the_longest() -> None:
    assert bar_cell(2.0, 8.0) == Cell(text="2", bar=0.25)
    assert offset_cell(-2.0, 8.0, over=True) == Cell(text="−2", bar=0.25, over=True)
    assert offset_cell(2.5, 5.0).text == "+2.5"
    assert bar_cell(float("nan"), 8.0) == Cell(text="–")
    assert bar_cell(4.0, 8.0).width == "24"


def test_a_long_table_is_cut_and_says_so() -> None:
    rows = [[str(k)] for k in range(MOST_ROWS + 3)]
    assert len(long_table([("n", True)], rows).rows) == MOST_ROWS
    assert "3" in left_out(len(rows), "move")
    assert left_out(MOST_ROWS, "move") == ""


def test_a_card_takes_a_quantity_apart() -> None:
    assert card("Time", f"2{GAP}min 05{GAP}s", "in all") == Card("Time", "2", f"min 05{GAP}s", "in all")
    assert card("Off", f"5.7{GAP}µm", "", bad=True) == Card("Off", "5.7", "µm", "", bad=True)


@dataclass(frozen=True)
class Found:
    table: TextTable
    drawn: tuple[Figure, ...]

    def figures(self) -> tuple[Figure, ...]:
        return self.drawn


def test_the_page_of_comparisons_has_every_figure_and_the_numbers_of_each() -> None:
    numbers = TextTable("Which is best", ("way", "error"), [("a", "1"), ("b", "2")])
    with_charts = Found(numbers, (Figure(title="a", charts=[plain_chart("a")]),))
    with_table = Found(numbers, (Figure(title="b", table=table()),))
    made = comparison_page("my axis", [with_charts, with_table])
    assert [section.title for section in made.sections] == ["Which is best", "Which is best"]
    first, second = (section.shown for section in made.sections)
    assert first[0].charts == [plain_chart("a")]
    assert first[1].table is not None
    assert first[1].table.heads == [("way", False), ("error", True)]
    assert first[1].table.rows == numbers.rows
    assert [figure.table for figure in second] == [table()]
    assert comparison_section([with_charts, with_table]).figures == [*with_charts.drawn, *with_table.drawn]
    assert comparison_section([]).shown == []
