import json
import math
import re
from dataclasses import replace
from importlib import resources

import numpy as np
import pytest
from tests.unit.methods.rotary_table.samples import (
    COUNT,
    angle_comparison,
    axis,
    record,
    run_of,
    shop_run,
    shop_trace,
)

from detent.methods.rotary_table import page as table_pages
from detent.methods.rotary_table.page import NEEDED, table_page
from detent.methods.rotary_table.run import SEQUENCE_SIGNALS, SequenceRun
from detent.page.frame import Page
from detent.page.table import Cell
from detent.record.trace import Trace


def page_of(run: SequenceRun, trace: Trace | None = None) -> Page:
    return table_page(axis(), run, trace)


def lead_of(run: SequenceRun) -> str:
    return page_of(run).headline.lead.replace("\u202f", " ")


def ids_of(page: Page) -> list[str]:
    return [chart["id"] for chart in page.charts]


def chart_of(page: Page, name: str) -> dict:
    return next(chart for chart in page.charts if chart["id"] == name)


def curves_of(chart: dict) -> dict:
    return {series["label"]: series["y"] for series in chart["series"]}


def lanes_of(page: Page) -> dict:
    return {lane["label"]: lane["bars"] for lane in chart_of(page, "line-steps")["lanes"]}


def cells_of(page: Page) -> list[list[Cell]]:
    table = page.sections[-1].shown[0].table
    assert table is not None
    return [[cell for cell, _ in table.cells(row)] for row in table.rows]


def rows_of(page: Page) -> list[list[str]]:
    return [[cell.text for cell in row] for row in cells_of(page)]


# ---- in one glance


def test_the_first_lines_say_what_happened() -> None:
    page = page_of(shop_run())
    assert (page.headline.level, page.headline.verdict, page.headline.name) == ("good", "Done", "shop.toml")
    assert axis().axis.name in page.headline.kicker
    lead = lead_of(shop_run())
    for told in ("5 steps in 10 s", "1.25 turns", " once", "1.8 arcsec (0.50 counts)"):
        assert told in lead
    assert "crossed" not in lead_of(run_of(record(1)))


def test_the_cards_carry_the_figures() -> None:
    page = page_of(shop_run())
    assert [(card.title, card.value, card.unit) for card in page.cards] == [
        ("Steps", "5", "of 5"), ("Time", "10", "s"), ("Worst error at rest", "0.50", "counts"),
        ("Turned", "1.25", "turns"), ("Largest lag", "2.17", "deg"), ("Peak speed", "61.2", "deg/s"),
    ]  # fmt: skip
    below = {card.title: card.below.replace("\u202f", " ") for card in page.cards}
    assert below["Steps"] == "1 positioning, 1 jog"
    assert "step 1; window 2 counts" in below["Worst error at rest"]
    assert below["Turned"].endswith("once, 1 rollover")
    assert below["Largest lag"].endswith("step 5")
    assert below["Peak speed"].startswith("step 5, ")
    assert below["Peak speed"].endswith(" 60")
    assert not any(card.bad for card in page.cards)
    assert page_of(run_of(record(1))).cards[3].below == "within the turn"


def test_a_sequence_that_moves_nothing_says_nothing_about_the_table() -> None:
    run = run_of(record(1, "wait", 0, 0))
    assert lead_of(run) == "1 step in 2 s."
    assert [card.title for card in page_of(run).cards] == ["Steps", "Time"]


def test_a_run_that_failed_says_where_why_and_what_to_do() -> None:
    failure = "step 2 of 5, <jog>: the table has run away"
    failed = run_of(record(1), record(2, "jog", 90, 540, crossings=1), asked=5, failure=failure)
    page = page_of(failed)
    assert (page.headline.level, page.headline.verdict) == ("bad", "Not done")
    assert page.headline.lead.endswith(" Step 2 of 5, <jog>: the table has run away.")
    assert "1 of 5 steps" in page.headline.lead
    assert page.title.endswith("not done")
    assert [card.title for card in page.cards if card.bad] == ["Steps"]
    # A jog that broke off is held on no place of its own.
    assert [row[7] for row in rows_of(page)] == ["−0.50", "–"]


def test_a_table_that_stands_beside_its_targets_gets_no_praise() -> None:
    page = page_of(run_of(record(1, error=20 * COUNT), warnings=["in step 1 it stood 20 counts off; look"]))
    assert (page.headline.level, page.headline.verdict) == ("warn", "Done, but off target")
    assert page.headline.lead.startswith("In step 1 it stood 20 counts off. ")
    assert [card.title for card in page.cards if card.bad] == ["Worst error at rest"]
    # The window and one count of the detector are allowed.
    assert page_of(run_of(record(1, error=2.99 * COUNT))).headline.level == "good"


def test_warnings_comparisons_and_small_print_stand_on_the_page() -> None:
    run = shop_run(warnings=["signal <late>"])
    page = table_page(axis(), run, shop_trace(), [angle_comparison()], {"seed": "7"})
    assert [(note.level, note.text) for note in page.notes] == [("warning", "signal <late>")]
    assert page.settings == {"seed": "7"}
    assert [section.title for section in page.sections if section.shown] == [
        "Results", "Comparison with the alternatives on this axis", "Steps",
    ]  # fmt: skip
    assert ids_of(page)[4:] == ["cross-way", "cross-deviation", "cross-speed"]
    assert all(figure.caption for figure in page.figures)


def test_a_run_without_a_step_has_no_figures() -> None:
    page = page_of(run_of(asked=2, failure="Never ready."), shop_trace())
    assert page.figures == []
    assert page.headline.level == "bad"
    assert not any("nan" in card.value for card in page.cards)


# ---- timeline


def test_the_time_line_has_a_lane_per_kind_of_step_and_per_signal() -> None:
    page = page_of(shop_run())
    assert lanes_of(page) == {
        "go to": [[0.0, 2.0, "1", "step 1: go to position 1 (90 deg, <shortest>)"]],
        "jog": [[6.0, 10.0, '+ at 60 deg/s while "feed"', 'step 5: jog + at 60 deg/s while "feed"']],
        "wait": [[2.0, 6.0, "4 s", "step 3: wait 4 s"]],
        "out clamp": [[2.0, 6.0, "on", "output clamp is on"]],
        "in feed": [[8.0, 9.5, "on", "input feed is on"]],
    }
    colours = [lane["colour"] for lane in chart_of(page, "line-steps")["lanes"]]
    assert colours == ["right", "left", "muted", "good", "drive"]


def test_kinds_of_steps_that_do_not_occur_have_no_lane() -> None:
    assert list(lanes_of(page_of(run_of(record(1))))) == ["go to"]


def test_a_signal_that_stays_on_is_on_up_to_the_end() -> None:
    changes = [(0.6, "a", False), (0.7, "a", True), (0.9, "b", True), (1.0, "b", False), (1.1, "a", True),
               (1.5, "b", True)]  # fmt: skip
    lanes = lanes_of(page_of(run_of(record(1), outputs=changes)))
    assert {name: [bar[:2] for bar in lanes[name]] for name in ("out a", "out b")} == {
        "out a": [[0.2, 2.0]], "out b": [[0.4, 0.5], [1.0, 2.0]],
    }  # fmt: skip


def test_of_many_signals_the_first_are_drawn_and_the_others_counted() -> None:
    outputs = [(1.0, f"o{n}", True) for n in range(10)]
    page = page_of(run_of(record(1), outputs=outputs, inputs=[(1.0, f"i{n}", True) for n in range(5)]))
    assert sum(name.startswith(("in ", "out ")) for name in lanes_of(page)) == table_pages.MOST_SIGNALS
    assert "3\u202ffurther" in page.figures[0].caption or "3 further" in page.figures[0].caption
    assert "further" not in page_of(shop_run()).figures[0].caption


def test_angle_and_speed_stand_below_over_the_same_time() -> None:
    page = page_of(shop_run(), shop_trace())
    assert ids_of(page) == ["line-steps", "line-turns", "line-detected", "line-speed"]
    steps, turns, detected, speed = page.charts
    assert {chart["sync"] for chart in page.charts} == {"line"}
    assert (steps["x"][0], steps["x"][-1]) == (turns["x"][0], turns["x"][-1]) == (0.0, 9.99)
    at = turns["x"].index(1.0)
    assert curves_of(turns)["true angle"][at] == 0.125
    assert curves_of(turns)["target of a positioning"][at] == pytest.approx(0.25, abs=1e-3)
    assert curves_of(turns)["target of a positioning"][-1] is None
    assert curves_of(turns)["true angle"][-1] == pytest.approx(1.245)
    assert curves_of(detected)["detected angle D"][-1] == pytest.approx(88.2)
    assert curves_of(speed)["true speed"][at] == 45.0
    assert curves_of(speed)["commanded"][at] == 45.0
    assert [chart.get("foot", True) for chart in page.charts] == [False, False, False, True]
    assert page.figures[0].title == "Timeline"


def test_without_a_trace_the_lanes_stand_alone() -> None:
    (steps,) = page_of(shop_run()).charts
    assert (steps["x"][0], steps["x"][-1]) == (0.0, 10.0)
    assert "foot" not in steps


@pytest.mark.parametrize("left_out", NEEDED)
def test_a_trace_without_a_needed_signal_draws_the_lanes_alone(left_out: str) -> None:
    trace = shop_trace()
    part = Trace(columns={name: trace[name] for name in ("t", *trace.signals) if name != left_out})
    assert ids_of(page_of(shop_run(), part)) == ["line-steps"]


def test_a_long_sequence_shows_its_beginning() -> None:
    long = page_of(shop_run(time_end=5000.5))
    assert long.charts[0]["x"][-1] == table_pages.LINE_SECONDS
    assert long.figures[0].title != "Timeline"
    # What was not recorded cannot be drawn.
    part = page_of(shop_run(time_end=5000.5), shop_trace())
    assert part.charts[1]["x"][-1] == 9.99
    assert part.figures[0].title.startswith("The first 9.99\u202fs")


def test_a_long_recording_is_thinned_and_keeps_the_jumps() -> None:
    t, short = np.linspace(0, 99, 50_000), shop_trace()
    turn = t / 10 % 1.0
    columns = {name: np.zeros(len(t)) for name in NEEDED} | {
        table_pages.PHASE: turn * 2**32, table_pages.DETECTED: turn * axis().period,
    }  # fmt: skip
    page = page_of(shop_run(time_end=100.5), Trace(columns={"t": t + short.time[0]} | columns))
    assert len(chart_of(page, "line-turns")["x"]) <= 5 * (table_pages.POINTS + 2)
    drawn = np.array(curves_of(chart_of(page, "line-detected"))["detected angle D"])
    assert np.count_nonzero(np.diff(drawn) < -300) == 9  # nine of ten turns come to their end
    assert drawn.max() > 359.0
    assert curves_of(chart_of(page, "line-turns"))["true angle"][-1] == pytest.approx(9.9)


def test_charts_are_plain_json_in_colours_that_the_style_has() -> None:
    drawn = table_page(axis(), shop_run(), shop_trace(), [angle_comparison()]).charts
    assert json.loads(json.dumps(drawn, allow_nan=False)) == drawn
    style = resources.files("detent.page").joinpath("template/report.css").read_text(encoding="utf-8")
    light, dark = re.findall(r":root[^{]*\{(.*?)\}", style, flags=re.DOTALL)[:2]
    for chart in drawn:
        for coloured in [*chart["series"], *chart.get("lanes", [])]:
            assert f"--{coloured['colour']}:" in light
            assert f"--{coloured['colour']}:" in dark


def test_what_is_drawn_is_what_is_recorded() -> None:
    assert set(NEEDED) <= set(SEQUENCE_SIGNALS)


# ---- every step


def test_every_step_stands_in_the_table() -> None:
    nothing = [""] * 8
    assert rows_of(page_of(shop_run())) == [
        ["1", "go to position 1 (90 deg, <shortest>)", "0.000", "2.000", "0.000", "90.000", "+90.000", "−0.50", "1", "",
         ""],
        ["2", 'set "clamp"', "2.000", *nothing],
        ["3", "wait 4 s", "2.000", "4.000", "90.000", "90.000", *[""] * 5],
        ["4", 'clear "clamp"', "6.000", *nothing],
        ["5", 'jog + at 60 deg/s while "feed"', "6.000", "4.000", "90.000", "90.000", "+360.000", "+1.2", "2.17", "1",
         "1"],
    ]  # fmt: skip
    marks = [row[1].mark for row in cells_of(page_of(shop_run()))]
    assert marks == ["right", "good", "muted", "good", "left"]


def test_angles_of_the_table_stay_within_the_turn() -> None:
    steps = record(1, start=-0.0004, stop=-90.0), record(2, start=719.9998, stop=0.0, error=-5 * COUNT)
    cells = cells_of(page_of(run_of(*steps)))
    assert [cell.text for cell in cells[0][4:7]] == ["0.000", "270.000", "−90.000"]
    assert [cell.text for cell in cells[1][4:7]] == ["0.000", "0.000", "−720.000"]
    # Beyond window and resolution.
    assert [row[7].over for row in cells] == [False, True]


def test_a_step_without_a_target_has_a_dash() -> None:
    assert rows_of(page_of(run_of(record(1, "jog", error=math.nan))))[0][7] == "–"


def test_a_long_table_is_cut_and_says_so() -> None:
    waits = [replace(record(1, "wait"), number=n) for n in range(1, 503)]
    page = page_of(run_of(*waits))
    assert len(rows_of(page)) == 500
    assert "2 further steps" in page.sections[-1].shown[0].caption
