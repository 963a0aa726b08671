"""The page about a replayed recording: how far apart, where most, and from what it was driven."""

import math
from typing import Any

import numpy as np
import pytest
from tests.unit.methods.cascade.samples import compared, replay_run

import detent
from detent.methods.cascade.replay_page import magnified, replay_page, replay_summary
from detent.methods.load import load_spec
from detent.page.frame import Page
from detent.page.words import GAP

WHOLE = ["whole-0", "whole-0-off", "whole-1", "whole-2"]
NEAR = [name.replace("whole", "near") for name in WHOLE]


@pytest.fixture(scope="module")
def linear() -> Any:
    return load_spec(detent.example("cascade.toml"))


def ids(page: Page) -> list[str]:
    return [chart["id"] for chart in page.charts]


def rows_of(page: Page) -> list[list[str]]:
    (figure,) = page.sections[1].shown
    assert figure.table is not None
    return [[cell.text.replace("\u202f", " ") for cell, _ in figure.table.cells(row)] for row in figure.table.rows]


def test_the_first_lines_say_how_far_apart_they_are(linear: Any) -> None:
    page = replay_page(linear, replay_run(warnings=["cut <off>"]), {"seed": "1"})
    assert (page.headline.level, page.settings) == ("good", {"seed": "1"})
    assert "reference" in page.headline.lead
    for figure in ("5.0\u202fµm", "20.0\u202fµm", "3.57\u202f%"):
        assert figure in page.headline.lead
    # The acceleration is noise.
    assert [(card.value, card.unit) for card in page.cards] == [("5.0", "µm"), ("0.501", "mm/s"), ("1.25", "N")]
    assert [(note.level, note.text) for note in page.notes] == [("warning", "cut <off>"), ("note", "guessed: <much>")]


def test_an_open_loop_says_what_drove_the_axis(linear: Any) -> None:
    lead = replay_page(linear, replay_run(open_loop="force", compared=replay_run().compared[:2])).headline.lead
    assert "force" in lead
    assert "reference" not in lead
    assert "%" not in lead


def test_a_simulation_that_ran_away_is_no_replay(linear: Any) -> None:
    page = replay_page(linear, replay_run(done=False, failure="the axis ran away", compared=[]))
    assert (page.headline.level, page.headline.lead) == ("bad", "The axis ran away.")
    assert page.figures == []
    assert list(page.cards) == []


def test_it_is_shown_whole_and_where_it_differs_most(linear: Any) -> None:
    page = replay_page(linear, replay_run())
    assert ids(page) == WHOLE + NEAR
    charts = {chart["id"]: chart for chart in page.charts}
    begin, end = magnified(replay_run())
    assert begin < 12.0 < end
    assert end - begin == pytest.approx(0.8)
    assert charts["near-0"]["x"][0] == pytest.approx(begin, abs=0.011)
    assert charts["near-0"]["x"][-1] == pytest.approx(end, abs=0.011)
    assert charts["whole-0"]["x"][-1] == 20.0
    assert charts["whole-0-off"]["yLabel"] == "difference [µm]"
    assert max(charts["near-0-off"]["series"][0]["y"]) == pytest.approx(20.0)


def test_a_short_recording_is_shown_once(linear: Any) -> None:
    run = replay_run()
    run.job.t[:] = np.linspace(0.0, 0.3, 2001)
    assert ids(replay_page(linear, run)) == WHOLE


def test_a_rotary_recording_is_in_degrees() -> None:
    run = replay_run(compared=[compared("position", "rad", 1.0, 0.1), compared("torque", "N*m", 1.0, 0.01)])
    page = replay_page(load_spec(detent.example("turntable.toml")), run)
    labels = {chart["id"]: chart["yLabel"] for chart in page.charts}
    assert labels["whole-0"] == "position [deg]"
    assert labels["whole-1"] == "torque [N m]"
    assert rows_of(page)[0][2] == "5.73 deg"


def test_two_positions_are_told_apart_by_those_who_cannot_see_them(linear: Any) -> None:
    run = replay_run(compared=[compared("position", "m", 0.1, 1e-5), compared("position of the load", "m", 0.1, 1e-5)])
    told = [chart["about"] for chart in replay_page(linear, run).charts]
    assert len(set(told[:4])) == 4


def test_the_table_has_every_signal_and_a_recording_of_zeros_a_dash(linear: Any) -> None:
    still = compared("command", "V", 0.0, 0.0)
    rows = rows_of(replay_page(linear, replay_run(compared=[*replay_run().compared, still])))
    assert [row[0] for row in rows] == ["position", "velocity", "acceleration", "force", "command"]
    assert rows[2][1:3] == ["0.0250 m/s²", "0.100 m/s²"]
    assert rows[4][1:] == ["0 V", "0 V", "–"]


def test_a_replay_is_told_signal_by_signal(linear: Any) -> None:
    rows = dict(replay_summary(linear, replay_run()))
    assert list(rows) == ["recording", "position", "velocity", "acceleration", "force", "following error"]
    assert rows["recording"] == "20 s, 2 001 samples, along the recorded reference"
    assert rows["position"] == "rms 5.0 µm, largest 20.0 µm, 0.0071 % of the recording"
    assert rows["following error"] == "up to 1 mm, simulated"
    open_loop = dict(replay_summary(linear, replay_run(open_loop="force", peak_following=math.nan)))
    assert open_loop["recording"].endswith("driven by the recorded force")
    assert "following error" not in open_loop
    assert not any(GAP in text for text in (*rows.values(), *open_loop.values()))
