"""Effort and residuals: the rows of the regression, true to gaps."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.identify.page.samples import identified, windows

from detent.identify.fit.identification import prepare_all
from detent.identify.page.compared import (
    Windows,
    autocorrelation,
    effort_charts,
    effort_figures,
    memory_chart,
    residual_chart,
    windows_of,
)

pytestmark = pytest.mark.compiled


def rows_of(residual: list[float], place: list[int]) -> Windows:
    values = np.array(residual)
    return Windows(np.array(place) * 0.01, values, values * 0.0, values, values, np.array(place), 0.01, 0.04)


def test_windows_are_the_rows_of_the_regression() -> None:
    (one,) = windows_of(identified())
    fit = identified().fit
    assert fit is not None
    assert one.effort == pytest.approx(one.fitted + one.residual)
    assert np.array_equal(one.residual, fit.residual)
    assert len(one.t) == len(one.velocity) == len(fit.effort)
    assert one.place[0] == 0
    assert one.t == pytest.approx(one.t[0] + one.place * one.hop)
    half = prepare_all(identified().runs, fit.instruments)[0].motion.kernel.half
    assert one.width == pytest.approx((2 * half + 1) * identified().runs[0].step)


def test_two_logs_share_the_rows_in_their_order() -> None:
    found = identified()
    fit = found.fit
    assert fit is not None
    twice = replace(
        found,
        runs=found.runs * 2,
        fit=replace(fit, residual=np.tile(fit.residual, 2), effort=np.tile(fit.effort, 2)),
    )
    first, second = windows_of(twice)
    assert np.array_equal(first.residual, second.residual)


def test_autocorrelation_of_alternating_residuals() -> None:
    found, pairs = autocorrelation([rows_of([1.0, -1.0] * 4, list(range(8)))])
    assert found[:3] == pytest.approx([1.0, -1.0, 1.0])
    assert pairs[:3].tolist() == [8.0, 7.0, 6.0]


def test_autocorrelation_does_not_reach_over_gaps_and_logs() -> None:
    parts = [rows_of([1.0, 1.0, -1.0], [0, 1, 5]), rows_of([2.0, 2.0], [0, 1])]
    found, pairs = autocorrelation(parts)
    assert pairs[:3].tolist() == [5.0, 2.0, 0.0]
    assert found[1] == pytest.approx((1.0 + 4.0) / 2 / ((1 + 1 + 1 + 4 + 4) / 5))
    assert np.isnan(found[2])


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


def test_all_residuals_are_counted_the_far_ones_at_the_end() -> None:
    one = windows()
    far = replace(one, residual=np.where(np.arange(400) == 7, 1e6, one.residual))
    chart = residual_chart([far], "N")
    assert sum(chart["series"][0]["y"]) == 400
    assert chart["xLabel"] == "recorded minus model [N]"
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


def test_no_windows_no_effort() -> None:
    assert effort_figures(identified(), [windows(count=0)], 0) == []
