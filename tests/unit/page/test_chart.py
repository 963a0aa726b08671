import json
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from detent.page.chart import (
    POINTS,
    Band,
    Curve,
    Heap,
    Panel,
    Timeline,
    histogram_chart,
    line_chart,
    spans_of,
    spread_chart,
    time_charts,
)
from detent.page.parts import Event

LABELS = ("error [µm]", "moves")


def heap(at: list[float], counts: list[int] | None = None) -> Heap:
    return Heap(
        label="h",
        colour="speed",
        at=np.array(at, dtype=float),
        counts=np.array([1] * len(at) if counts is None else counts),
    )


@given(st.lists(st.booleans(), min_size=1, max_size=50))
def test_a_row_lies_in_a_span_exactly_if_it_holds(on: list[bool]) -> None:
    t = np.arange(len(on), dtype=float)
    found = spans_of(t, np.array(on))
    for row, holds in enumerate(on[:-1]):
        assert any(a <= row < b for a, b in found) == holds
    # The last row has no time after it: its span, if it begins one, is a moment.
    assert ((len(on) - 1.0, len(on) - 1.0) in found) == (on[-1] and on[-2:] != [True, True])
    assert all(b < c for (_, b), (c, _) in pairwise(found))


def test_a_line_chart_says_what_its_panel_says_and_no_more() -> None:
    curve = Curve(label="c", colour="ink", y=np.array([1.23456, np.nan, np.inf]), digits=2)
    chart = line_chart(Panel(name="p", label="y [m]", curves=[curve]), np.array([0.0, 0.12345, 1.0]), "x [s]", digits=3)
    assert chart == {
        "id": "p", "x": [0.0, 0.123, 1.0], "xLabel": "x [s]", "yLabel": "y [m]", "height": 220,
        "series": [{"label": "c", "colour": "ink", "y": [1.23, None, None]}],
    }  # fmt: skip


def test_a_curve_and_a_panel_hand_on_how_they_look() -> None:
    curve = Curve(label="c", colour="ink", y=np.zeros(1), width=2, dash=(6, 4), step=True, rings=9)
    panel = Panel(name="p", label="y", curves=[curve], height=99, zero=True, span=(0, 2), levels=[(1.0, "one")])
    chart = line_chart(panel, np.zeros(1), "x")
    assert chart["series"][0] == {
        "label": "c", "colour": "ink", "width": 2, "dash": [6, 4], "step": True, "points": 9, "y": [0.0],
    }  # fmt: skip
    assert (chart["height"], chart["zero"], chart["yRange"]) == (99, True, [0, 2])
    assert chart["levels"] == [{"y": 1.0, "label": "one"}]


def panels(t: np.ndarray, thin: int = POINTS) -> list[Panel]:
    spike = np.zeros(len(t))
    spike[len(t) // 3] = 1.0
    return [
        Panel(name="above", label="a", curves=[Curve(label="a", colour="ink", y=t * 0, thin=thin)]),
        Panel(name="below", label="b", curves=[Curve(label="b", colour="ink", y=spike, thin=thin)]),
    ]


@pytest.mark.parametrize(("unit", "factor"), [("ms", 1e3), ("s", 1.0)])
def test_plot_areas_share_time_bands_and_events(unit: str, factor: float) -> None:
    t = np.array([0.0, 0.25, 0.5])
    band = Band(label="moving", colour="good", spans=[(0.0, 0.25)])
    timeline = Timeline(name="m", t=t, label="time", unit=unit, bands=[band], events=[Event(0.125, "go")])
    above, below = time_charts(timeline, panels(t))
    for chart in (above, below):
        assert chart["x"] == [0.0, 0.25 * factor, 0.5 * factor]
        assert chart["xLabel"] == f"time [{unit}]"
        assert chart["sync"] == "m"
        assert chart["bands"] == [{"spans": [[0.0, 0.25 * factor]], "colour": "good", "label": "moving"}]
        assert chart["events"] == [0.125 * factor]
    assert (above["id"], above["numbered"], above["foot"]) == ("above", True, False)
    assert (below["id"], "numbered" in below, "foot" in below) == ("below", False, False)
    assert json.loads(json.dumps([above, below], allow_nan=False)) == [above, below]


def test_a_long_recording_is_thinned_and_keeps_what_stands_out() -> None:
    t = np.arange(100_000) * 1e-3
    above, below = time_charts(Timeline(name="m", t=t, unit="s"), panels(t))
    assert len(above["x"]) <= 2 * (POINTS + 2)
    assert above["x"] == below["x"]
    assert len(above["series"][0]["y"]) == len(above["x"])
    assert max(below["series"][0]["y"]) == 1.0


def test_curves_that_ask_for_no_rows_of_their_own_are_thinned_evenly() -> None:
    t = np.arange(100_000) * 1e-3
    above, _ = time_charts(Timeline(name="m", t=t, unit="s"), panels(t, thin=0))
    assert len(above["x"]) <= POINTS + 2
    assert (above["x"][0], above["x"][-1]) == (0.0, 99.999)
    assert max(b - a for a, b in pairwise(above["x"])) < 2 * 100 / (POINTS / 2)


@given(st.lists(st.floats(-1e3, 1e3), max_size=60), st.lists(st.floats(-1e3, 1e3), max_size=60))
def test_every_value_of_every_heap_is_counted_once(left: list[float], right: list[float]) -> None:
    chart = histogram_chart("h", [heap(left), heap(right)], LABELS, finest=0.1)
    assert [sum(series["y"]) for series in chart["series"]] == [len(left), len(right)]
    assert [series["bars"] for series in chart["series"]] == [1, -1]
    assert chart["x"] == [-value for value in reversed(chart["x"])]


def test_one_heap_stands_in_the_middle_of_its_bins() -> None:
    chart = histogram_chart("h", [heap([-2.0, 0.04, 2.0, 2.0])], LABELS, finest=0.1)
    (series,) = chart["series"]
    assert series["bars"] == 0
    assert {x: y for x, y in zip(chart["x"], series["y"], strict=True) if y} == {-2.0: 1, 0.0: 1, 2.0: 2}


def test_places_that_never_occur_do_not_widen_the_figure() -> None:
    counted = histogram_chart("h", [heap([0.0, 1.0, 500.0], [3, 1, 0])], LABELS, finest=0.1)
    assert 1.0 <= counted["x"][-1] < 1.5


def test_bars_are_never_finer_than_asked() -> None:
    nothing = histogram_chart("h", [heap([])], LABELS, finest=5.0)
    assert nothing["x"] == [-5.0, 0.0, 5.0]


@pytest.mark.parametrize(("limit", "marks"), [(1.0, [-1.0, 1.0]), (2.0, [])])
def test_limits_are_marked_where_the_values_come_near(limit: float, marks: list[float]) -> None:
    chart = histogram_chart("h", [heap([1.0])], LABELS, finest=0.1, limit=limit)
    assert [mark["x"] for mark in chart["marks"]] == marks


@pytest.mark.parametrize(
    "values", [np.array([1.0, 2.0, 2.0, 4.0]), np.full(3, 5.0), np.zeros(2), np.array([1e-9, 3e-9])]
)
def test_a_spread_counts_every_value_and_reaches_to_its_marks(values):
    drawn = spread_chart("spread", values, ("error [um]", "cases"), [(6.0, "limit")])
    assert sum(drawn["series"][0]["y"]) == len(values)
    assert drawn["x"][0] <= values.min()
    assert drawn["x"][-1] >= 6.0 - 1e-6
    assert drawn["marks"] == [{"x": 6.0, "label": "limit"}]
    assert sum(spread_chart("spread", values, ("error", "cases"))["series"][0]["y"]) == len(values)
