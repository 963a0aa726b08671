import json
import math
from dataclasses import replace

import numpy as np
import pytest
from tests.unit.methods.moves.samples import STEP, TOLERANCE, View, record, run_of, six_moves, trace_of
from tests.unit.page.samples import plain_chart

from detent.methods.moves.page import POSITION, TARGET, VELOCITY, moves_page
from detent.methods.moves.run import MoveRun
from detent.page.figure import Figure
from detent.page.frame import Page
from detent.page.table import Cell, TextTable
from detent.page.words import GAP
from detent.record.trace import Trace


def page_of(run: MoveRun, trace: Trace | None = None) -> Page:
    return moves_page(View(), run, trace)


def ids_of(page: Page) -> list[str]:
    return [chart["id"] for chart in page.charts]


def chart_of(page: Page, name: str) -> dict:
    return next(chart for chart in page.charts if chart["id"] == name)


def curves_of(chart: dict) -> dict:
    return {series["label"]: series["y"] for series in chart["series"]}


def card_of(page: Page, title: str) -> tuple[str, str, bool]:
    (found,) = [one for one in page.cards if one.title == title]
    return found.value, found.unit, found.bad


def rows_of(page: Page) -> list[list[str]]:
    table = page.sections[-1].shown[0].table
    assert table is not None
    return [[cell.text if isinstance(cell, Cell) else cell for cell in row] for row in table.rows]


def test_a_page_shows_the_job_the_rests_a_move_and_every_move() -> None:
    page = page_of(six_moves(), trace_of(six_moves()))
    assert (page.headline.level, page.headline.verdict) == ("good", "Done")
    assert [section.title for section in page.sections if section.shown] == [
        "Results", "How the axis performed", "Moves",
    ]  # fmt: skip
    assert ids_of(page) == ["job", "rest", "move-speed", "approach-place", "approach-words"]
    assert all(figure.caption for figure in page.figures)
    assert json.loads(json.dumps(page.charts, allow_nan=False)) == page.charts


def test_the_cards_carry_the_figures() -> None:
    run = run_of(*(replace(one, overshoot=1e-6 * one.number, peak_speed=0.1 * one.number) for one in six_moves().moves))
    page = page_of(run)
    assert card_of(page, "Moves") == ("6", "of 6", False)
    assert card_of(page, "Time") == ("0.600", "s", False)
    assert card_of(page, "Settled after") == ("82.0", "ms", False)
    assert card_of(page, "Worst overshoot") == ("6", "µm", False)
    assert card_of(page, "Worst error at rest") == ("2", "µm", False)
    assert card_of(page, "Peak speed") == ("600", "mm/s", False)
    assert "move 6" in next(one.below for one in page.cards if one.title == "Peak speed")


def test_a_run_that_failed_says_where_why_and_what_to_do() -> None:
    run = run_of(record(1, 0.0, 0.02), record(2, 0.02, 0.0, error=422e-6), asked=6, failure="move 2: did not arrive.")
    page = page_of(run)
    assert (page.headline.level, page.headline.verdict) == ("bad", "Not done")
    assert page.headline.lead.endswith("Move 2: did not arrive.")
    assert "1 of 6" in page.headline.lead
    assert [one.title for one in page.cards if one.bad] == ["Moves", "Worst error at rest"]
    assert page.title.endswith("not done")


def test_an_axis_that_speaks_too_early_gets_no_praise() -> None:
    run = run_of(record(1, 0.0, 0.02), record(2, 0.02, 0.0, settled=0.6 + 0.0851), warnings=["it spoke early; wait"])
    page = page_of(run)
    assert (page.headline.level, page.headline.verdict) == ("warn", "Done, but ready too early")
    assert page.headline.lead.startswith("It spoke early. ")
    assert [note.text for note in page.notes] == ["it spoke early; wait"]


def test_interference_is_noted() -> None:
    faults = {"inserted": 30, "removed": 0, "lost samples": 0, "corrupted": 0}
    (note,) = page_of(run_of(record(1, 0.0, 0.02), faults=faults)).notes
    assert note.level == "note"
    assert "30 pulses inserted" in note.text


def test_the_job_is_position_over_target_since_it_was_ready() -> None:
    chart = chart_of(page_of(six_moves(), trace_of(six_moves())), "job")
    at = chart["x"].index(0.09)
    drawn = curves_of(chart)
    assert (drawn["target"][at], drawn["true position"][at]) == (10.0, 9.998)
    assert chart["x"][0] == 0.0


def test_a_job_that_is_drawn_in_part_says_so() -> None:
    run = six_moves()
    title = page_of(run, trace_of(run)).sections[0].shown[0].title
    assert page_of(run, trace_of(run, until=1.0)).sections[0].shown[0].title != title
    t = np.linspace(0.5, 100.5, 200_000)
    long = replace(run, time_end=100.5)
    chart = chart_of(page_of(long, Trace(columns={"t": t, POSITION: np.sin(t), TARGET: np.sin(t)})), "job")
    assert 29.99 < chart["x"][-1] <= 30.01


def test_each_rest_is_counted_on_its_side_once_right_of_the_target_being_right() -> None:
    errors = (-3e-6, -3e-6, 6e-6, 0.0, 0.0)
    right = (True, True, False, True, False)
    moves = [
        record(n, 0.0 if side else 0.1, 0.1 if side else 0.0, error=error)
        for n, (error, side) in enumerate(zip(errors, right, strict=True), 1)
    ]
    run = run_of(*moves, tolerance=5e-6)
    chart = chart_of(page_of(run), "rest")
    drawn = {name: dict(zip(chart["x"], y, strict=True)) for name, y in curves_of(chart).items()}
    assert {x: y for x, y in drawn["moved to the right"].items() if y} == {3.0: 2, 0.0: 1}
    assert {x: y for x, y in drawn["moved to the left"].items() if y} == {-6.0: 1, 0.0: 1}
    assert [mark["x"] for mark in chart["marks"]] == [-5.0, 5.0]


def test_few_moves_make_no_histogram() -> None:
    few = run_of(*(record(n, 0.0, 0.02) for n in range(1, 5)))
    assert "rest" not in ids_of(page_of(few))
    assert "rest" in ids_of(page_of(six_moves()))


def shown(page: Page) -> Figure:
    (section,) = [section for section in page.sections if section.title == "How the axis performed"]
    return section.shown[0]


def test_the_move_of_middle_length_is_shown_with_what_happened_in_order() -> None:
    run = run_of(record(1, 0.0, 0.03), record(2, 0.03, 0.02), record(3, 0.02, 0.04), record(4, 0.04, 0.04))
    figure = shown(page_of(run, trace_of(run)))
    assert figure.title.startswith("Move 3, ")
    assert [event.text for event in figure.events] == ["set <strobe>", "mode switch", "ready"]
    assert figure.charts[0]["events"] == [0.0, 80.0, 83.0]
    assert figure.charts[0]["bands"][0]["spans"] == [[80.0, 99.0]]


def test_the_command_is_marked_though_it_comes_before_the_first_row() -> None:
    run = six_moves()
    trace = trace_of(run)
    late = Trace(columns=trace.columns | {"t": trace.time + 6e-5})
    figure = shown(page_of(run, late))
    assert figure.charts[0]["events"][0] == figure.charts[0]["x"][0] == 0.06
    assert figure.events[0].t == 0.0


def test_the_move_that_failed_is_shown_first_of_all() -> None:
    run = run_of(record(1, 0.0, 0.02), record(2, 0.02, 0.0, error=422e-6), asked=3)
    figure = shown(page_of(run, trace_of(run)))
    assert figure.title.startswith("Move 2, ")
    assert figure.events[-1].text == "the run ends here"


def test_the_move_that_was_ready_too_early_comes_before_the_middle_one() -> None:
    late = record(3, 0.02, 0.04, settled=0.7 + 0.084), record(4, 0.04, 0.0, settled=0.8 + 0.085)
    run = run_of(record(1, 0.0, 0.03), record(2, 0.03, 0.02), *late)
    assert shown(page_of(run, trace_of(run))).title.startswith("Move 4, ")


def test_the_longest_move_is_drawn_beside_the_one_of_middle_length() -> None:
    """It never was: what limits an axis is seen in no shorter one."""
    run = run_of(record(1, 0.0, 0.02), record(2, 0.02, 0.025), record(3, 0.025, 0.02), record(4, 0.02, 0.01))
    page = page_of(run, trace_of(run))
    assert ids_of(page)[-1] == "longest-speed"
    titles = [figure.title for section in page.sections for figure in section.shown if figure.title.startswith("Move ")]
    assert [title.replace(GAP, " ") for title in titles] == [
        "Move 3, 5.00 mm to the left", "Move 1, 20 mm to the right",
    ]  # fmt: skip
    # Moves of one length have one picture.
    alike = run_of(record(1, 0.0, 0.02), record(2, 0.02, 0.0))
    assert "longest-speed" not in ids_of(page_of(alike, trace_of(alike)))


def test_the_approach_is_magnified_in_counts_and_keeps_the_numbers_of_the_events() -> None:
    run = run_of(record(1, 0.0, 0.02, error=-5e-6))
    page = page_of(run, trace_of(run))
    place, words = chart_of(page, "approach-place"), chart_of(page, "approach-words")
    # From 5 tolerances away, 100 µm; the last 1 % is made from 70 to 80 ms.
    assert place["x"][0] == 75.0
    drawn = curves_of(place)["true position"]
    assert drawn[-1] == pytest.approx(0.5)  # plus is right of the target, where the error is negative
    assert [level["y"] for level in place["levels"]] == [TOLERANCE / STEP, -TOLERANCE / STEP]
    assert place["events"] == [0.0, 80.0, 83.0]  # number 1 is out of sight, the others keep theirs
    assert place["bands"][0]["spans"] == [[82.0, 99.0]]
    assert place["yRange"][0] < min(drawn)
    assert place["yRange"][1] > 2.0
    assert words["x"] == place["x"]


def test_a_move_that_ended_outside_has_no_stretch_within_the_tolerance() -> None:
    run = run_of(record(1, 0.0, 0.02, settled=math.nan, error=30e-6), asked=2)
    assert chart_of(page_of(run, trace_of(run)), "approach-place")["bands"][0]["spans"] == []


def test_an_axis_that_has_given_up_comes_to_no_rest() -> None:
    run = run_of(record(1, 0.0, 0.02, ready=math.nan, error=5e-3), asked=2)
    assert ids_of(page_of(run, trace_of(run))) == ["job", "move-speed"]


def test_every_move_stands_in_the_table() -> None:
    run = run_of(
        record(1, 0.0, 0.02, error=-1.5e-6),
        record(2, 0.02, 0.02, ready=0.6 + 0.003, settled=0.5),
        record(3, 0.02, 0.0, settled=0.7 + 0.085),
        record(4, 0.0, 0.01, settled=math.nan, ready=math.nan, error=422e-6),
        asked=4,
    )
    rows = rows_of(page_of(run))
    assert [str(row[4]) for row in rows][1] == "stays"
    assert rows[0][:4] + rows[0][5:] == ["1", "0.000", "0.000", "20.000", "83.0", "82.0", "5", "−1.5"]
    assert rows[1][5:] == ["3.00", "0", "5", "+2"]
    assert rows[2][:4] + rows[2][5:] == ["3", "0.200", "20.000", "0.000", "83.0", "85.0", "5", "+2"]
    assert rows[3][5:] == ["–", "–", "5", "+422"]
    table = page_of(run).sections[-1].shown[0].table
    assert table is not None
    over = [(k, n) for k, row in enumerate(table.rows) for n, cell in enumerate(row) if getattr(cell, "over", False)]
    assert over == [(2, 6), (3, 6), (3, 8)]


def test_a_text_stands_on_paper_and_its_characters_in_the_table() -> None:
    run = six_moves(kind="text")
    run.moves = [replace(move, label=label) for move, label in zip(run.moves, "ab<cde", strict=True)]
    page = page_of(run)
    assert page.paper == {"pages": [{}], "of": list("ab<cde")}
    assert [row[1] for row in rows_of(page)] == list("ab<cde")
    assert page.cards[0].title == "Characters"
    assert page_of(six_moves()).paper is None


def test_parts_that_are_absent_leave_no_trace() -> None:
    page = page_of(run_of(asked=6, failure="Not ready."), trace_of(six_moves()))
    assert page.figures == []
    assert page.headline.level == "bad"
    assert not any("nan" in one.value for one in page.cards)


@pytest.mark.parametrize(("left_out", "drawn"), [
    ("word", ["job", "rest"]), (TARGET, ["rest"]), (POSITION, ["rest"]), (VELOCITY, ["job", "rest"]),
])  # fmt: skip
def test_a_trace_without_a_needed_signal_gives_a_page_without_its_figures(left_out: str, drawn: list[str]) -> None:
    trace = trace_of(six_moves())
    part = Trace(columns={name: trace[name] for name in trace if name != left_out})
    assert ids_of(page_of(six_moves(), part)) == drawn


def test_of_a_trace_that_ends_early_only_whole_moves_are_shown() -> None:
    run = run_of(record(1, 0.0, 0.01), record(2, 0.01, 0.03), record(3, 0.03, 0.06))
    assert shown(page_of(run, trace_of(run))).title.startswith("Move 2, ")
    assert shown(page_of(run, trace_of(run, until=0.65))).title.startswith("Move 1, ")
    assert ids_of(page_of(run, trace_of(run, until=0.55))) == ["job"]
    assert ids_of(page_of(run, trace_of(run, until=0.505))) == []


class Found:
    """A comparison with one figure."""

    table = TextTable("numbers", ("a",), [("1",)])

    def figures(self) -> tuple[Figure, ...]:
        return (Figure(title="beside", charts=[plain_chart("beside")]),)


def test_comparisons_and_small_print_stand_on_the_page() -> None:
    page = moves_page(View(), six_moves(), None, [Found()], {"seed": "7"})
    assert ids_of(page) == ["rest", "beside"]
    assert page.settings == {"seed": "7"}
