"""Pages of real runs of the example stages, and of made-up ones."""

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.unit.methods.stepper_envelope.players import MM, Played, chart_of, curve_of, moves, play
from tests.unit.methods.stepper_envelope.samples import motor_move, record, run_of, step_comparison

import detent
from detent.methods.load import load_spec
from detent.methods.stepper_envelope import page as stage_module
from detent.methods.stepper_envelope import stage_plan, stage_trace
from detent.methods.stepper_envelope.comparison import compare_jerk
from detent.methods.stepper_envelope.page import stage_page, target_of
from detent.methods.stepper_envelope.run import MOTOR_SIGNALS
from detent.methods.stepper_envelope.stage_job import StageJob, StageMove, StopChange, load_stage_job
from detent.methods.stepper_envelope.stage_plan import tile_plan
from detent.methods.stepper_envelope.stage_trace import NEEDED_STEPS, motor_runs, recorded_steps
from detent.methods.stepper_envelope.summary import StageFigures
from detent.page.draw import plain
from detent.page.figure import Figure
from detent.page.frame import Page
from detent.page.render import render_page
from detent.record.trace import Trace

pytestmark = pytest.mark.compiled


@pytest.fixture(scope="module")
def tiles() -> Played:
    return play("stage.toml", load_stage_job(detent.example("tiles.csv"), ("x", "y")))


@pytest.fixture(scope="module")
def torn() -> Played:
    """Too fast for the motor: the first move loses steps, the second starts from there."""
    fast = (
        "stepper.x.limits.acceleration=8 m/s^2",
        "stepper.x.limits.speed=60 mm/s",
        "stepper.x.drive.torque_safety=1",
    )
    job = StageJob("t.csv", "tiles", (
        StageMove(1, 1, targets={"x": 20 * MM, "y": 1 * MM}, label="A"),
        StageMove(2, 2, targets={"y": 2 * MM}, label="B"),
    ), ("x", "y"))  # fmt: skip
    return play("stage.toml", job, *fast)


@pytest.fixture(scope="module")
def spec():
    return load_spec(detent.example("zoom.toml"))


def card_of(page: Page, title: str):
    return next(card for card in page.cards if card.title == title)


def table_of(page: Page, title: str = "Every move") -> Figure:
    return next(figure for figure in page.figures if figure.title == title)


def cells_of(figure: Figure) -> list[list[str]]:
    assert figure.table is not None
    return [[plain(cell.text) for cell, _ in figure.table.cells(row)] for row in figure.table.rows]


def marked(figure: Figure) -> list[str]:
    assert figure.table is not None
    return [plain(cell.text) for row in figure.table.rows for cell, _ in figure.table.cells(row) if cell.over]


# ---- the whole page


def test_what_is_drawn_is_what_is_recorded() -> None:
    assert {
        "controller.rule.position",
        *NEEDED_STEPS,
        "controller.rule.index",
        "controller.rule.state",
        "plant.rotor.lag",
    } <= set(MOTOR_SIGNALS)


def test_the_figures_of_a_whole_run(zoom: Played) -> None:
    spec, run, trace = zoom
    page = stage_page(spec, run, trace, (step_comparison(), compare_jerk(spec)), {"file": "zoom.toml"})
    assert [chart["id"] for chart in page.charts] == [
        "path-0", "path-1", "runs-0", "runs-1", "detail-runs", "detail-torque", "detail-margin", "detail-speed",
        "detail-lag", "rest-lag", "jerk-whole", "jerk-begin", "jerk-end",
    ]  # fmt: skip
    assert (page.headline.level, page.headline.name, page.settings) == ("good", "moves.toml", {"file": "zoom.toml"})
    assert (page.cards[0].value, page.cards[0].unit) == ("4", "of 4")
    assert not any(card.bad for card in page.cards)
    assert [(note.level, note.text) for note in page.notes] == [("note", "how moves.toml was read: read so")]
    assert table_of(page, "Motor x: time of a way, and steps lost").table
    assert "nan" not in render_page(page).partition("<script")[0]


def test_the_cards_carry_the_figures(spec) -> None:
    page = stage_page(spec, run_of(
        record(1, group_a=motor_move(peak_lag=1.04), group_b=motor_move(steps=100)),
        record(2, group_a=motor_move(margin=2.5)),
    ), None)  # fmt: skip
    assert [(card.title, card.value, card.unit, plain(card.below), card.bad) for card in page.cards] == [
        ("Moves in place", "2", "of 2", "every rotor on its step", False),
        ("Time", "0.400", "s", "300 moves per minute", False),
        ("Lost steps", "0", "", "of 500 made", False),
        ("Worst rotor lag", "1.04", "steps", "move 1, group_a; out of step from 2", False),
        ("Least torque margin", "× 2.50", "", "move 2, group_a; falls behind below 1", False),
        ("Time saved", "0.800", "s", "5.00 times as fast as at the start frequency (1 s)", False),
    ]
    assert "5.00 times as long" in page.headline.lead


def test_lost_steps_are_the_headline(spec) -> None:
    run = run_of(
        record(1, group_a=motor_move()),
        record(2, group_a=motor_move(lost=-16, peak_lag=17.0, margin=0.87), group_b=motor_move(lost=4)),
        failure="move 2: motor group_a lost 16 steps; lower it",
    )
    page = stage_page(spec, run, None)
    assert (page.headline.level, page.headline.verdict) == ("bad", "Not done")
    assert plain(page.headline.lead).startswith("1 of 2 moves in place. Move 2: motor group_a lost 16 steps")
    lost = card_of(page, "Lost steps")
    assert (lost.value, lost.below) == ("20", "in the end; move 2, group_a lost 16 first")
    assert [card.title for card in page.cards if card.bad] == [
        "Moves in place", "Lost steps", "Worst rotor lag", "Least torque margin",
    ]  # fmt: skip
    assert not any(card.title == "Time saved" for card in page.cards)


def test_a_run_that_broke_off_says_how_far_it_came(spec) -> None:
    run = run_of(record(1, group_a=motor_move()), record(2, group_a=motor_move()), asked=5)
    page = stage_page(spec, replace(run, done=False, failure="move 3: motor x: fault."), None)
    assert page.headline.lead.startswith("Stopped after 2 of 5")
    assert (card_of(page, "Moves in place").below, card_of(page, "Time").value) == ("3 not", "0.400")


def test_without_moves_there_are_neither_sections_nor_figures(spec) -> None:
    page = stage_page(spec, replace(run_of(asked=2), done=False, failure="Not ready."), None)
    assert (page.figures, [card.title for card in page.cards]) == ([], ["Moves in place", "Time"])
    assert "<h2>" not in render_page(page)


def test_a_job_in_which_nothing_moves_has_a_page() -> None:
    page = stage_page(*play("zoom.toml", moves(StageMove(1, 1, targets={"group_a": 0.0}))))
    assert page.charts == []
    assert cells_of(table_of(page)) == [["1", "0.000", "none: stays", *[""] * 8]]


def test_what_names_and_labels_say_cannot_break_the_page(tiles: Played) -> None:
    evil = "</script><b>$data</b>"
    spec, run, trace = tiles
    labelled = replace(run, moves=[replace(move, label=evil) for move in run.moves])
    html = render_page(stage_page(spec, labelled, trace, (), {"a": evil}))
    assert evil not in html
    assert html.count("<script") == html.count("</script>")


# ---- places over time


def test_the_path_follows_its_targets_and_a_manual_run_has_none(zoom: Played) -> None:
    spec, run, trace = zoom
    page = stage_page(spec, run, trace)
    for k, name in enumerate(("group_a", "group_b")):
        t = np.array(chart_of(page, f"path-{k}")["x"])
        place, target = (curve_of(page, f"path-{k}", label) for label in ("true position", "target"))
        for move in run.moves:
            row = int(np.searchsorted(t, move.end)) - 1
            if name in move.motors:
                assert target[row] == pytest.approx(move.motors[name].stop * 1e3, abs=1e-3)
                assert place[row] == pytest.approx(target[row], abs=3e-3)  # within half a step
        manual = (t > run.moves[2].begin + 2e-3) & (t < run.moves[2].motors["group_b"].arrived - 2e-3)
        assert np.isnan(target[manual]).all() == (name == "group_b")
    assert np.isfinite(target_of(StageFigures(spec, run), "group_a", trace.time)).all()


def test_where_steps_were_lost_the_counted_position_is_drawn_too(torn: Played) -> None:
    page = stage_page(*torn)
    assert [[series["label"] for series in chart_of(page, name)["series"]] for name in ("path-0", "path-1")] == [
        ["target", "counted position", "true position"], ["target", "true position"],
    ]  # fmt: skip
    off = curve_of(page, "path-0", "counted position")[-1] - curve_of(page, "path-0", "true position")[-1]
    assert off == pytest.approx(torn[1].moves[0].motors["x"].lost * 5e-3, abs=5e-3)


def test_a_long_job_is_drawn_in_part(zoom: Played, monkeypatch: pytest.MonkeyPatch) -> None:
    spec, run, trace = zoom
    monkeypatch.setattr(stage_module, "LONGEST", 0.5)
    page = stage_page(spec, run, trace)
    assert 0.45 < chart_of(page, "path-0")["x"][-1] <= 0.5
    assert "Where the motors were" not in [figure.title for figure in page.figures]


def test_more_motors_than_have_room_are_counted(zoom: Played, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stage_module, "MOST_MOTORS", 1)
    page = stage_page(*zoom)
    assert {"path-0", "runs-0"} <= {chart["id"] for chart in page.charts}
    assert not {"path-1", "runs-1"} & {chart["id"] for chart in page.charts}
    path, runs = page.sections[0].shown[0], page.sections[1].shown[-1]
    assert plain(path.caption).endswith("1 further motor is not drawn.")
    assert plain(runs.hint) == "1 further motor is not drawn."


def test_without_a_trace_or_its_signals_figures_are_left_out(zoom: Played) -> None:
    spec, run, trace = zoom
    only_lag = Trace(columns={name: trace.columns[name] for name in ("t", "group_a.plant.rotor.lag")})
    for given in (None, trace.between(0.0, 5e-4), only_lag):
        page = stage_page(spec, run, given)
        assert (page.charts, [section.title for section in page.sections if section.shown]) == ([], ["Move by move"])
    page = stage_page(spec, run, Trace(columns={n: values for n, values in trace.columns.items() if "rotor" not in n}))
    assert [series["label"] for series in chart_of(page, "path-0")["series"]] == ["target", "counted position"]
    assert [chart["id"] for chart in page.charts][-3:] == ["detail-runs", "detail-torque", "detail-margin"]


# ---- frequency against position


def test_every_run_lies_under_the_envelope(zoom: Played) -> None:
    spec, run, trace = zoom
    figures = StageFigures(spec, run)
    made = recorded_steps(figures, trace)
    a, b = (motor_runs(figures, name, steps) for name, steps in made.items())
    assert [arc.direction for arc in a.arcs] == [1, 1, -1]
    assert [arc.direction for arc in b.arcs] == [1, 1, 1]
    assert (a.name, a.travel, a.left_out) == ("group_a", (0.0, pytest.approx(0.04)), 0)
    for runs in (a, b):
        for arc in runs.arcs:
            half = runs.envelope.up if arc.direction > 0 else runs.envelope.down
            rows = np.searchsorted(runs.envelope.position, arc.position[1:-1], side="right") - 1
            assert (arc.hz[1:-1] <= half[rows] * 1.002 + 1e-9).all()  # periods are whole microseconds
    assert a.arcs[1].position[-1] == pytest.approx(14 * MM)
    assert max(arc.hz.max() for arc in a.arcs) == 4000.0


def test_moves_that_the_trace_does_not_reach_are_left_out(zoom: Played) -> None:
    spec, run, trace = zoom
    figures = StageFigures(spec, run)
    made = recorded_steps(figures, trace.between(0.0, run.moves[1].begin + 0.1))
    runs = [motor_runs(figures, name, steps) for name, steps in made.items()]
    assert [(len(one.arcs), one.left_out) for one in runs] == [(1, 1), (1, 2)]
    # A motor of which no run was recorded whole is not drawn.
    page = stage_page(spec, run, trace.between(0.0, 0.05))
    assert not any(chart["id"].startswith(("runs", "detail")) for chart in page.charts)


def test_of_very_many_moves_the_first_are_drawn(zoom: Played, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stage_trace, "MOST_MOVES", 1)
    figures = StageFigures(*zoom[:2])
    made = recorded_steps(figures, zoom[2])
    assert [motor_runs(figures, name, steps).left_out for name, steps in made.items()] == [1, 2]
    assert "1 further move is not drawn." in plain(stage_page(*zoom).sections[1].shown[0].caption)


def test_zones_and_a_crop_of_the_travel_are_told(zoom: Played, tiles: Played, monkeypatch: pytest.MonkeyPatch) -> None:
    caption = plain(stage_page(*zoom).sections[1].shown[0].caption)
    assert "near (10 to 13 mm)" in caption
    assert "1 000 Hz is 5 mm/s." in caption
    assert "−55 to 55 mm" in plain(stage_page(*tiles).sections[1].shown[0].caption)
    monkeypatch.setattr(stage_module, "MOST_ZONES", 1)
    assert "and 1 more" in plain(stage_page(*zoom).sections[1].shown[0].caption)


# ---- tiles


def test_tiles_lie_where_they_were_asked_for(tiles: Played) -> None:
    spec, run, trace = tiles
    plan = tile_plan(StageFigures(spec, run))
    assert plan
    assert (plan.motors, plan.start) == (("x", "y"), (0.0, 0.0))
    assert [tile.move.label for tile in plan.tiles] == [str(n) for n in range(1, 13)]
    assert plan.tiles[4].target == (pytest.approx(0.705 * MM), 0.0)  # only y moved: x is where it was
    assert all(tile.place == pytest.approx(tile.target) for tile in plan.tiles)
    assert not any(tile.off for tile in plan.tiles)
    page = stage_page(spec, run, trace)
    assert page.figures[0].drawing
    assert card_of(page, "Tiles in place").value == "12"
    assert plain(card_of(page, "Worst rotor lag").below).startswith("tile 3, x;")


def test_tiles_without_room_are_counted(tiles: Played, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "further" not in stage_page(*tiles).figures[0].caption
    monkeypatch.setattr(stage_plan, "MOST_TILES", 11)
    assert "1 further tile is not drawn." in plain(stage_page(*tiles).figures[0].caption)


def test_a_list_of_tiles_for_one_motor_has_no_plan(tiles: Played) -> None:
    spec, run, _ = tiles
    assert tile_plan(StageFigures(spec, replace(run, job=replace(run.job, motors=("x",))))) is None


def test_lost_steps_move_all_later_tiles(torn: Played) -> None:
    spec, run, trace = torn
    plan, lost = tile_plan(StageFigures(spec, run)), run.moves[0].motors["x"].lost
    assert lost
    assert plan
    assert [tile.off for tile in plan.tiles] == [True, True]
    assert plan.tiles[1].place[0] == pytest.approx(20 * MM - lost * 5e-6)
    page = stage_page(spec, run, trace)
    assert (page.headline.level, card_of(page, "Tiles in place").value) == ("bad", "0")
    assert plain(card_of(page, "Lost steps").below).startswith("in the end; tile A, x lost")


# ---- the table


def test_every_motion_stands_in_the_table(spec) -> None:
    run = run_of(
        record(1, "zoom in", group_a=motor_move(peak_lag=1.04), group_b=motor_move(margin=math.inf)),
        record(2, group_a=motor_move(start=1 * MM, target=0.0, stop=0.0)),
    )
    figure = table_of(stage_page(spec, run, None))
    assert [head for head, _ in figure.table.heads] == [
        "move", "name", "start [s]", "motor", "from [mm]", "to [mm]", "way [mm]", "time [ms]", "peak [Hz]",
        "lag [step]", "margin", "lost [step]",
    ]  # fmt: skip
    assert cells_of(figure) == [
        ["1", "zoom in", "0.000", "group_a", "0.000", "1.000", "↑ up 1", "100", "2 000", "1.04", "4", "0"],
        ["", "", "", "group_b", "0.000", "1.000", "↑ up 1", "100", "2 000", "1", "any", "0"],
        ["2", "", "0.200", "group_a", "1.000", "0.000", "↓ down 1", "100", "2 000", "1", "4", "0"],
    ]
    assert marked(figure) == []


def test_what_is_wrong_is_marked_in_the_table_and_where_the_rotor_stands_after_it(spec) -> None:
    run = run_of(
        record(1, group_a=motor_move(
            peak_lag=5.0, margin=0.9, lost=-4, start=-1e-17, target=-2 * MM, stop=-2 * MM,
        )),
        record(2, group_a=motor_move()),
        record(3),
    )  # fmt: skip
    figure = table_of(stage_page(spec, run, None))
    assert cells_of(figure) == [
        ["1", "0.000", "group_a", "0.000", "−2.000", "↓ down 2", "100", "2 000", "5", "0.900", "−4", "−4"],
        ["2", "0.200", "group_a", "0.000", "1.000", "↑ up 1", "100", "2 000", "1", "4", "0", "−4"],
        ["3", "0.400", "none: stays", *[""] * 9],
    ]
    assert marked(figure) == ["5", "0.900", "−4", "−4", "−4"]


def test_a_stop_that_was_passed_is_a_warning() -> None:
    late = StageMove(1, 1, targets={"group_a": 20 * MM}, change=StopChange(8 * MM, 8.2 * MM), label="late")
    page = stage_page(*play("zoom.toml", moves(late)))
    assert page.headline.level == "warn"
    assert plain(page.headline.lead).startswith("Move 1: the stop of group_a was changed")
    assert page.notes[0].level == "warning"
    assert plain(page.notes[0].text).startswith("move 1: the stop of group_a was changed to 8.2 mm when the motor was")
