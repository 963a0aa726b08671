"""The page about a list of moves: verdict, cards, figures over time, one move, every move."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.unit.methods.cascade.samples import cascade_run, comparison, failed_run, move, rigid_comparison, trace_of

import detent
from detent.methods.cascade.host import cascade_registers
from detent.methods.cascade.page import FOLLOWING, NEEDED, cascade_page, cascade_summary
from detent.methods.cascade.run import CASCADE_SIGNALS, CascadeRun, run_cascade_moves
from detent.methods.cascade.schema import CascadeSpec
from detent.methods.load import load_spec
from detent.methods.moves.job import Move, MoveJob
from detent.page.frame import Card, Page
from detent.page.table import Cell, Table, bar_cell, offset_cell
from detent.page.words import GAP
from detent.record.recorder import Recorder
from detent.record.trace import Trace

Played = tuple[CascadeSpec, CascadeRun, Trace]

JOB = ["job-position", "job-following", "job-command"]
MOVE = ["move-position", "move-speed", "move-following", "move-command"]
PROFILES = ["profile-speed", "profile-following", "profile-twist"]
TWO = MoveJob("two.csv", "moves", (Move(number=1, row=1, target=0.12, dwell=0.1), Move(number=2, row=2, by=-0.1)))


def load(name: str = "cascade", *overrides: str) -> Any:
    return load_spec(detent.example(f"{name}.toml"), overrides)


def recorded(*overrides: str) -> Played:
    spec = load("cascade", *overrides)
    recorder = Recorder(cascade_registers(spec), CASCADE_SIGNALS, every=6, period=spec.method.sample_period / 3)
    return spec, run_cascade_moves(spec, TWO, recorder=recorder), recorder.trace()


@pytest.fixture(scope="module")
def linear() -> CascadeSpec:
    return load()


@pytest.fixture(scope="module")
def done() -> Played:
    return recorded()


@pytest.fixture(scope="module")
def failed() -> Played:
    return recorded("method.following_error=15 um", "method.in_position=5 um")


def ids(page: Page) -> list[str]:
    return [chart["id"] for chart in page.charts]


def chart_of(page: Page, name: str) -> dict[str, Any]:
    return next(chart for chart in page.charts if chart["id"] == name)


def curve_of(page: Page, chart: str, label: str) -> np.ndarray:
    (found,) = [series["y"] for series in chart_of(page, chart)["series"] if series["label"] == label]
    return np.array([math.nan if value is None else value for value in found])


def cards_of(page: Page) -> dict[str, Card]:
    return {card.title: card for card in page.cards}


def table_of(page: Page) -> Table:
    (table,) = [figure.table for figure in page.sections[-1].shown]
    assert table is not None
    return table


# ---- what came out, in one glance


def test_a_run_that_was_done_is_told_with_its_worst_figures(linear: CascadeSpec) -> None:
    page = cascade_page(linear, cascade_run(), None, (), {"seed": "1"})
    assert (page.headline.level, page.settings, list(page.notes)) == ("good", {"seed": "1"}, [])
    cards = cards_of(page)
    assert [card.title for card in page.cards if card.bad] == []
    assert [(card.value, card.unit) for card in cards.values()] == [
        ("2", "of 2"), ("3", "s"), ("40", "ms"), ("80", "µm"), ("8.0", "µm"), ("2.50", "V"),
    ]  # fmt: skip
    assert "move 2" in cards["Largest following error"].below
    assert "move 1" in cards["Peak command"].below


def test_a_run_that_failed_says_where_and_why(linear: CascadeSpec) -> None:
    spec = linear.model_copy(update={"method": linear.method.model_copy(update={"following_error": 0.05})})
    page = cascade_page(spec, failed_run(), None)
    assert page.headline.level == "bad"
    assert "move 2 to <200 mm>" in page.headline.lead.replace("Move", "move")
    assert [card.title for card in page.cards if card.bad] == ["Moves in position", "Largest following error"]
    assert "200\u202fms" in cards_of(page)["Peak command"].below
    assert "move 1" in cards_of(page)["Worst error at rest"].below
    error, last = (table_of(page).rows[1][column] for column in (9, -1))
    assert isinstance(last, Cell)
    assert last.over
    # No bar is longer than its column, wherever the axis stopped.
    assert isinstance(error, Cell)
    assert error.bar == 1.0


def test_a_load_that_stands_beside_its_target_gets_no_praise(linear: CascadeSpec) -> None:
    page = cascade_page(linear, cascade_run(move(1), move(2, position=0.2 + 70e-6), warnings=["look <here>"]), None)
    assert page.headline.level == "warn"
    assert [card.title for card in page.cards if card.bad] == ["Worst error at rest"]
    assert [(note.level, note.text) for note in page.notes] == [("warning", "look <here>")]
    errors = [row[9] for row in table_of(page).rows]
    assert [(cell.text, cell.over) for cell in errors if isinstance(cell, Cell)] == [("+8.0", False), ("−70", True)]


def test_a_run_without_a_move_in_position_has_no_figures_of_rest(linear: CascadeSpec) -> None:
    one = replace(failed_run().moves[1], number=1)
    page = cascade_page(linear, cascade_run(one, done=False, failure="move 1: off"), None)
    assert list(cards_of(page)) == ["Moves in position", "Time", "Largest following error", "Peak command"]
    assert not any("nan" in f"{card.value} {card.below}".lower() for card in page.cards)


def test_a_run_that_made_no_move_shows_no_table(linear: CascadeSpec) -> None:
    run = cascade_run(done=False, failure="after power-on: not in position")
    run.moves.clear()
    page = cascade_page(linear, run, trace_of(run))
    assert page.figures == []
    assert list(cards_of(page)) == ["Moves in position", "Time"]


def test_a_run_that_fails_in_a_dwell_is_not_all_in_position(linear: CascadeSpec) -> None:
    page = cascade_page(linear, cascade_run(done=False, failure="move 2 to 200 mm: the drive is off"), None)
    assert cards_of(page)["Moves in position"].bad


def test_a_rotary_axis_is_told_in_degrees() -> None:
    run = cascade_run(move(1, start=0.0, target=math.pi / 2, position=math.pi / 2, peak_following=0.05), tolerance=1e-3)
    page = cascade_page(load("turntable"), run, trace_of(run), [comparison(rotary=True)])
    assert cards_of(page)["Largest following error"].value == "2.86"
    labels = {chart["id"]: chart["yLabel"] for chart in page.charts}
    assert labels["job-position"] == "position [deg]"
    assert labels["move-speed"] == "velocity [deg/s]"
    assert labels["job-following"] == "following error [arcsec]"
    assert labels["profile-speed"] == "speed [deg/s]"
    assert table_of(page).rows[0][3] == "90.000"


def test_every_move_stands_in_the_table(linear: CascadeSpec) -> None:
    table = table_of(cascade_page(linear, cascade_run(), None))
    assert len(table.rows) == 2
    first = [cell.text for cell, _ in table.cells(table.rows[0])]
    assert first == ["1", "0.000", "0.000", "100.000", "1000", "1040", "40", "40", "2", "+8.0", "2.50", "✔"]


# ---- figures over time


def test_what_is_needed_is_recorded() -> None:
    assert set(NEEDED) <= set(CASCADE_SIGNALS)


def test_figures_stand_where_there_is_something_to_show(linear: CascadeSpec) -> None:
    run = cascade_run()
    trace = trace_of(run)
    assert ids(cascade_page(linear, run, trace, [comparison()])) == [*JOB, *MOVE, "move-rest", *PROFILES]
    assert ids(cascade_page(linear, run, trace.between(0.0, 0.3))) == JOB
    assert ids(cascade_page(linear, run, None, [rigid_comparison()])) == PROFILES[:-1]
    # Rows too far apart to show how it comes to rest, or to show anything.
    soon = [replace(one, settled=one.arrived, ready=one.arrived) for one in run.moves]
    assert ids(cascade_page(linear, cascade_run(*soon), trace_of(run, row=0.11))) == [*JOB, *MOVE]
    assert ids(cascade_page(linear, run, trace_of(run, row=0.5))) == []
    bare = Trace(columns={name: trace[name] for name in ("t", *NEEDED) if name != FOLLOWING})
    assert ids(cascade_page(linear, run, bare)) == []


def test_levels_are_drawn_where_the_curve_comes_near_them(linear: CascadeSpec) -> None:
    run = cascade_run()
    page = cascade_page(linear, run, trace_of(run))
    assert "levels" not in chart_of(page, "job-command")
    limited = cascade_page(linear, replace(run, max_command=3.0), trace_of(run))
    assert chart_of(limited, "job-command")["levels"] == [{"y": 3.0, "label": "limit"}, {"y": -3.0, "label": ""}]
    rest = chart_of(page, "move-rest")
    assert [level["y"] for level in rest["levels"]] == pytest.approx([50.0, -50.0])
    assert rest["yRange"] == pytest.approx([-250.0, 250.0])


def test_a_load_at_rest_is_right_where_it_has_gone_too_far(linear: CascadeSpec) -> None:
    run = cascade_run()
    page = cascade_page(linear, run, trace_of(run))
    assert curve_of(page, "move-rest", "load")[-1] == pytest.approx(4.0)
    assert curve_of(page, "move-rest", "reference")[-1] == pytest.approx(0.0, abs=1e-6)
    assert curve_of(page, "job-following", "reference minus measured position")[-1] == pytest.approx(-4e-3)


@pytest.mark.compiled
def test_the_whole_job_and_the_fastest_move_are_shown(done: Played) -> None:
    spec, run, trace = done
    page = cascade_page(spec, run, trace)
    assert page.headline.level == "good"
    t = chart_of(page, "job-position")["x"]
    assert t[0] == pytest.approx(0.0, abs=1e-3)
    assert t[-1] == pytest.approx(run.time_end - run.time_ready, abs=1e-3)
    assert curve_of(page, "job-position", "load")[-1] == pytest.approx(20.0, abs=0.1)
    fastest = max(run.moves, key=lambda one: one.peak_speed)
    shown, rest = page.sections[1].shown
    assert shown.title == f"Move {fastest.number}"
    assert np.abs(curve_of(page, "move-speed", "load")).max() == pytest.approx(fastest.peak_speed * 1e3, rel=1e-3)
    assert [event.t for event in shown.events] == pytest.approx(
        sorted(moment - fastest.begin for moment in (fastest.begin, fastest.arrived, fastest.settled, fastest.ready))
    )
    ends = chart_of(page, "move-rest")["x"]
    assert ends[0] < (fastest.arrived - fastest.begin) * 1e3 < ends[-1]
    assert [event.text for event in rest.events] == [event.text for event in shown.events][1:]


@pytest.mark.compiled
def test_a_drive_that_is_off_shows_no_reference_and_no_error(failed: Played) -> None:
    spec, run, trace = failed
    page = cascade_page(spec, run, trace)
    assert ids(page) == [*JOB, *MOVE]
    off = np.array(chart_of(page, "job-position")["x"]) > run.time_off - run.time_ready
    assert 0 < np.count_nonzero(off) < len(off)
    reference, following = (
        curve_of(page, *names)
        for names in (("job-position", "reference"), ("job-following", "reference minus measured position"))
    )
    assert np.isnan(reference[off]).all()
    assert np.isnan(following[off]).all()
    assert not np.isnan(following[~off]).any()
    assert curve_of(page, "job-command", "command")[-1] == 0.0
    (shown,) = page.sections[1].shown
    assert shown.title == f"Move {run.moves[-1].number}"
    assert shown.events[-1].t == pytest.approx(run.time_off - run.moves[-1].begin)


def test_cards_have_numbers_and_units_apart(linear: CascadeSpec) -> None:
    page = cascade_page(linear, cascade_run(), None)
    assert not any(GAP in card.value for card in page.cards)


def test_each_figure_is_named_with_whose_it_is(linear: CascadeSpec) -> None:
    assert dict(cascade_summary(linear, cascade_run(move(1), move(2, peak_speed=0.5)))) == {
        "moves": "2 of 2 in position",
        "time": "3 s",
        "settling": "worst 1040 ms (move 1), from the command until within 50 µm for good",
        "final approach": "worst 40 ms (move 1), from the end of the reference until within 50 µm for good",
        "following error": "worst 80 µm (move 2)",
        "overshoot": "worst 4 µm (move 2)",
        "error at rest": "worst 8.0 µm (move 2), of the load",
        "peak speed": "500 mm/s (move 2)",
        "peak command": "2.50 of 10 V (move 1)",
    }


def test_what_a_failed_run_did_not_come_to_is_left_out(linear: CascadeSpec) -> None:
    run = failed_run()
    run.moves = run.moves[1:]
    rows = dict(cascade_summary(linear, run))
    assert rows["moves"] == "0 of 2 in position"
    assert not {"settling", "final approach", "error at rest"} & set(rows)
    run.moves.clear()
    assert list(dict(cascade_summary(linear, run))) == ["moves"]


def test_a_terminal_gets_plain_spaces(linear: CascadeSpec) -> None:
    assert not any(GAP in text for _, text in cascade_summary(linear, cascade_run()))


def test_an_error_of_a_first_move_that_failed_is_written_in_a_unit_that_fits(linear: CascadeSpec) -> None:
    failed = cascade_run(move(1, position=0.4, in_position=False), done=False, failure="it stood")
    heads = [name for name, _ in table_of(cascade_page(linear, failed, None)).heads]
    assert "error [mm]" in heads


def test_no_bar_is_longer_than_its_column() -> None:
    assert bar_cell(3.0, 1.0).bar == 1.0
    assert bar_cell(0.5, 1.0).bar == 0.5
    assert offset_cell(-1e21, 1.0).bar == 1.0
    assert bar_cell(float("inf"), 1.0).width == "48"
