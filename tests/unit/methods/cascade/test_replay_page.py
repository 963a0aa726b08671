"""The page about a replayed recording: how far apart, where most, and from what it was driven."""

from pathlib import Path

import numpy as np
import pytest
from tests.page_reader import Reader, charts_of
from tests.unit.methods.cascade.samples import ROTARY, compared, replay_data, replay_run

from detent.methods.cascade.charts import magnified, replay_charts
from detent.methods.cascade.page_data import ReplayReportData
from detent.methods.cascade.replay_page import make_replay_page
from detent.page.page import render_page, write_page

WHOLE = ["whole-0", "whole-0-off", "whole-1", "whole-2"]
NEAR = [name.replace("whole", "near") for name in WHOLE]


def read(data: ReplayReportData) -> str:
    return Reader(render_page(make_replay_page(data))).text


def test_the_first_lines_say_how_far_apart_they_are() -> None:
    text = read(replay_data())
    assert "A recording beside the simulated axis slide <1> ✔ Replayed log <1>.csv" in text
    assert "For 20 s the simulated axis follows the recorded reference and is 5.0 µm from the recorded position" in text
    assert "on average (rms), 20.0 µm at most. Its force differs from the recorded one by 3.57 %" in text
    assert "Position, rms difference5.0 µmlargest 20.0 µm; 0.0071 % of the recording" in text
    assert "Velocity, rms difference0.501 mm/s" in text
    assert "Acceleration, rms difference" not in text
    assert "Noteguessed: <much>" in text


def test_an_open_loop_says_what_drove_the_axis() -> None:
    run = replay_run(open_loop="force", compared=replay_run().compared[:2])
    text = read(replay_data(run=run))
    assert "the simulated axis gets the recorded force, its loops open, and is 5.0 µm" in text
    assert "differs from" not in text


def test_a_simulation_that_ran_away_is_no_replay() -> None:
    html = render_page(
        make_replay_page(replay_data(run=replay_run(done=False, failure="the axis ran away", compared=[])))
    )
    assert "✘ Not replayed log <1>.csv The axis ran away." in Reader(html).text
    assert charts_of(html) == []
    assert "In figures" not in html


def test_it_is_shown_whole_and_where_it_differs_most() -> None:
    html = render_page(make_replay_page(replay_data()))
    charts = {chart["id"]: chart for chart in charts_of(html)}
    assert list(charts) == WHOLE + NEAR
    begin, end = magnified(replay_run())
    assert begin < 12.0 < end
    assert end - begin == pytest.approx(0.8)
    assert charts["near-0"]["x"][0] == pytest.approx(begin, abs=0.011)
    assert charts["whole-0"]["x"][-1] == 20.0
    assert charts["whole-0-off"]["yLabel"] == "difference [µm]"
    assert f"from {begin:.1f} s to {end:.1f} s, where the positions differ most" in Reader(html).text


def test_a_short_recording_is_shown_once() -> None:
    run = replay_run()
    run.job.t[:] = np.linspace(0.0, 0.3, 2001)
    assert [chart["id"] for chart in replay_charts(run, ROTARY)] == WHOLE


def test_a_rotary_recording_is_in_degrees() -> None:
    run = replay_run(compared=[compared("position", "rad", 1.0, 0.1), compared("torque", "N*m", 1.0, 0.01)])
    html = render_page(make_replay_page(replay_data(run=run, units=ROTARY)))
    labels = {chart["id"]: chart["yLabel"] for chart in charts_of(html)}
    assert labels["whole-0"] == "position [deg]"
    assert labels["whole-1"] == "torque [N m]"
    assert "5.73 deg at most. Its torque differs" in Reader(html).text


def test_the_table_has_every_signal_and_a_recording_of_zeros_a_dash() -> None:
    still = compared("command", "V", 0.0, 0.0)
    text = read(replay_data(run=replay_run(compared=[*replay_run().compared, still])))
    assert "Over 2 001 samples." in text
    assert "acceleration0.0250 m/s²0.100 m/s²" in text
    assert "command0 V0 V–" in text


def test_the_page_is_well_formed_whatever_names_say(tmp_path: Path) -> None:
    data = replay_data(version="9.9")
    page = Reader(render_page(make_replay_page(data)))
    assert page.open == []
    assert page.fetched == []
    assert len(page.ids) == len(set(page.ids))
    write_page(tmp_path / "r.html", make_replay_page(data))
    assert (tmp_path / "r.html").read_text(encoding="utf-8") == render_page(make_replay_page(data))
