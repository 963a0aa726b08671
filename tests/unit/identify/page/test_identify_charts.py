"""The curves of an identification: in people's units, thin enough, and true to gaps."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.identify.page.samples import constants, identified, trusted, unfitted

from detent.identify.page.identify_charts import (
    all_charts,
    effort_charts,
    friction_chart,
    held_charts,
    memory_chart,
    recorded_charts,
    residual_chart,
)
from detent.identify.page.identify_data import HeldOut, Windows, identify_report_data
from detent.identify.page.identify_words import Ways

pytestmark = pytest.mark.compiled


def windows(count: int = 400, gap: int = 0) -> Windows:
    place = np.arange(count)
    place[count // 2 :] += gap
    velocity = 0.2 * np.sin(place / 20)
    residual = np.cos(place * 1.7)
    return Windows(place * 0.01, 10 + residual, np.full(count, 10.0), residual, velocity, place, 0.01, 0.04)


def held(count: int = 1000, away: float = 0.0) -> HeldOut:
    t = np.arange(count) * 1e-3
    measured = 0.1 * np.sin(t)
    return HeldOut(0, 3.0 + t, measured, measured + 2e-6, measured + away * t, 0.5)


def test_the_page_has_every_chart_once() -> None:
    charts = all_charts(identify_report_data(trusted()))
    assert [chart["id"] for chart in charts] == [
        "recorded-position", "recorded-effort", "held-position", "held-restarted", "held-free", "effort-both",
        "effort-left", "residual-sizes", "residual-memory", "friction-map",
    ]  # fmt: skip


def test_without_constants_only_the_recording_is_drawn() -> None:
    charts = all_charts(identify_report_data(unfitted()))
    assert [chart["id"] for chart in charts] == ["recorded-position", "recorded-effort"]


def test_samples_that_are_not_used_are_shaded() -> None:
    run = identified().runs[0]
    usable = np.ones(len(run.t), dtype=bool)
    usable[1000:1501:2] = False
    place, effort = recorded_charts(replace(run, usable=usable))
    (band,) = place["bands"]
    assert band["label"] == "not used"
    (span,) = band["spans"]
    assert span == pytest.approx([1000 * run.step, 1501 * run.step])
    assert place["yLabel"] == "position [mm]"
    assert effort["yLabel"] == "force [N]"
    assert place["series"][0]["y"][0] == pytest.approx(run.position[0] * 1e3, abs=0.01)


def test_a_recording_without_reference_has_one_curve() -> None:
    place, _ = recorded_charts(replace(identified().runs[0], reference=None))
    assert [one["label"] for one in place["series"]] == ["position"]


def test_differences_are_recorded_less_simulated_in_their_unit() -> None:
    place, restarted, free = held_charts(held(away=0.01), Ways("m"))
    assert place["x"][0] == 3.0
    assert restarted["yLabel"] == "difference [µm]"
    assert restarted["series"][0]["y"][5] == pytest.approx(-2.0)
    assert free["yLabel"] == "difference [mm]"
    assert free["series"][0]["y"][-1] == pytest.approx(-9.99, abs=0.01)
    assert "again every 0.5 s" in place["series"][0]["label"]


def test_a_simulation_that_runs_away_does_not_squeeze_the_rest() -> None:
    assert "yRange" not in held_charts(held(away=0.01), Ways("m"))[0]
    low, high = held_charts(held(away=100.0), Ways("m"))[0]["yRange"]
    assert (low, high) == pytest.approx((-0.5 * 84.1, 1.5 * 84.1), rel=0.01)


def test_effort_breaks_where_windows_are_missing() -> None:
    both, left = effort_charts(windows(gap=30), identified().runs[0])
    assert (
        both["series"][0]["y"].count(None)
        == both["series"][1]["y"].count(None)
        == left["series"][0]["y"].count(None)
        == 1
    )
    hole = left["series"][0]["y"].index(None)
    assert left["x"][hole - 1] < left["x"][hole] < left["x"][hole + 1]
    assert left["x"][hole + 1] - left["x"][hole - 1] == pytest.approx(0.31)


def test_gaps_survive_thinning() -> None:
    both, _ = effort_charts(windows(count=40_000, gap=30), identified().runs[0])
    assert len(both["x"]) < 12_000
    assert both["series"][0]["y"].count(None) == 1


def test_no_windows_no_effort() -> None:
    assert effort_charts(windows(count=0), identified().runs[0]) == []


def test_all_residuals_are_counted_the_far_ones_at_the_end() -> None:
    one = windows()
    far = replace(one, residual=np.where(np.arange(400) == 7, 1e6, one.residual))
    chart = residual_chart([far], "N")
    assert sum(chart["series"][0]["y"]) == 400
    assert chart["xLabel"] == "recorded less model [N]"
    reach = 4 * np.sqrt(np.mean(far.residual**2))
    assert max(chart["x"]) < 1.2 * reach


def test_residuals_of_zero_are_counted_too() -> None:
    still = replace(windows(), residual=np.zeros(400))
    assert sum(residual_chart([still], "N")["series"][0]["y"]) == 400


def test_memory_has_the_bounds_of_white_noise_and_marks_the_overlap() -> None:
    chart = memory_chart([windows()])
    assert chart["levels"][0]["y"] == pytest.approx(1.96 / 20.0)
    assert chart["bands"][0]["spans"] == [[0.0, 40.0]]
    assert chart["x"][:2] == [0.0, 10.0]
    assert chart["series"][0]["y"][0] == 1.0
    assert chart["series"][0]["bars"] == 0
    assert chart["yRange"][0] < min(chart["series"][0]["y"])


def test_rings_of_the_friction_map_are_curve_plus_residual() -> None:
    data = identify_report_data(trusted())
    one = replace(windows(count=3), velocity=np.array([0.1, -0.1, 0.2]), residual=np.array([1.0, 2.0, -1.0]))
    chart = friction_chart(replace(data, windows=(one,)), constants())
    rings, line, above, below = (np.array(s["y"], dtype=float) for s in chart["series"])
    x = np.array(chart["x"])
    assert np.all(np.diff(x) > 0)
    at = [int(np.flatnonzero(np.isclose(x, mm))[0]) for mm in (100.0, -100.0, 200.0)]
    assert rings[at] == pytest.approx([10.5 + 1.0, -8.4 + 2.0, 11.0 - 1.0], abs=1e-3)
    assert line[at] == pytest.approx([10.5, -8.4, 11.0], abs=1e-3)
    assert np.count_nonzero(np.isfinite(rings)) == 3
    assert np.isnan(line[x == 0.0]).all()
    assert np.nanmin(above - line) > 0
    assert above[at] + below[at] == pytest.approx(2 * line[at], abs=1e-3)


def test_limits_that_say_nothing_are_not_drawn() -> None:
    data = identify_report_data(trusted())
    wild = replace(constants(), covariance=constants().covariance * 1e12)
    chart = friction_chart(data, wild)
    assert set(chart["series"][2]["y"]) == {None}
