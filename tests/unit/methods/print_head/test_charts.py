import json
import re
from importlib import resources
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from detent.methods.print_head import charts
from detent.methods.print_head.page import _all_charts
from detent.methods.print_head.page_data import (
    ColumnErrors,
    HeadPath,
    IdentifiedLine,
    ReportData,
    SpeedProfile,
    TurnAround,
)
from detent.page.chart import POINTS


def test_the_profile_is_speed_over_drive_in_the_units_of_the_trade(profile: SpeedProfile) -> None:
    speed, drive = charts.profile_charts(profile)
    assert [speed["yLabel"], drive["yLabel"]] == ["speed [in/s]", "drive [count]"]
    assert speed["x"] == drive["x"]
    assert speed["sync"] == drive["sync"]
    demanded, true = speed["series"]
    at = speed["x"].index(150.0)
    assert true["y"][at] == pytest.approx(40.0)
    assert demanded["y"][at] == pytest.approx(40.0)
    assert demanded["y"][-1] is None  # no demand there: a gap, not a zero
    assert drive["series"][0]["y"][at] == 195
    assert max(drive["series"][0]["y"]) == 291
    assert speed["events"] == [0.0, 200.0]


def test_the_profile_marks_printing_and_transition(profile: SpeedProfile) -> None:
    bands = charts.profile_charts(profile)[0]["bands"]
    assert bands[0] == {"spans": [[110.0, 190.0]], "colour": "good", "label": "printing"}
    assert bands[1]["label"] == "transition (TR)"
    ((start, stop),) = bands[1]["spans"]
    assert start == pytest.approx(200.0, abs=0.2)
    assert stop == pytest.approx(250.0, abs=0.2)


def test_the_turn_around_shows_current_over_speed(turn: TurnAround) -> None:
    current, speed = charts.turn_charts(turn)
    zero = min(range(len(speed["x"])), key=lambda index: abs(speed["x"][index] - 66.5))
    assert speed["series"][0]["y"][zero] == pytest.approx(0.0, abs=0.2)
    assert current["series"][0]["y"][zero] == -0.638
    assert current["events"] == [0.0, 66.8]


def test_the_path_colours_printing_by_direction(path: HeadPath) -> None:
    chart = charts.path_chart(path)
    moving, right, left = (series["y"] for series in chart["series"])
    assert chart["yRange"] == [0.0, 14.5]
    assert None not in moving
    for position, to_right, to_left in zip(moving, right, left, strict=True):
        inside = abs(position - 5) < 2.99
        assert (to_right is not None) + (to_left is not None) == inside or abs(abs(position - 5) - 3) < 0.02
    rising = [time for time, value in zip(chart["x"], right, strict=True) if value is not None]
    assert min(rising) > 0.2
    assert max(rising) < 0.8


def test_a_long_path_shows_its_first_stretch_and_keeps_where_lines_begin(path: HeadPath) -> None:
    t = np.linspace(0, 100, 1_000_000)
    long = HeadPath(
        t=t, position=np.abs((t % 2) - 1) * 0.2 + 0.05, printing=(t % 1 > 0.2) & (t % 1 < 0.8), travel=path.travel,
        column0=path.column0,
    )  # fmt: skip
    chart = charts.path_chart(long)
    assert 29.99 < chart["x"][-1] <= 30.0
    assert 120 < len(chart["x"]) <= POINTS + 2 + 120
    changes = np.flatnonzero(np.diff(long.printing.astype(int)))
    assert {round(float(t[row]), 4) for row in changes if t[row] < 30} <= set(chart["x"])


counts_per_bin = st.dictionaries(st.integers(0, 6000), st.integers(1, 10_000), max_size=20)


@given(counts_per_bin, counts_per_bin)
def test_every_column_is_in_the_histogram_once(to_the_right: dict[int, int], to_the_left: dict[int, int]) -> None:
    counted = [np.zeros(6001, dtype=np.int64), np.zeros(6001, dtype=np.int64)]
    for counts, found in zip(counted, (to_the_right, to_the_left), strict=True):
        counts[list(found)] = list(found.values())
    made = ColumnErrors(bin_width=1e-7, right=counted[0], left=counted[1], worst=1e-6, rms=1e-6)
    chart = charts.column_chart(made, 50e-6)
    for series, found in zip(chart["series"], (to_the_right, to_the_left), strict=True):
        assert sum(series["y"]) == sum(found.values())
        # No column is drawn farther from its place than the width of a bar says.
        drawn = sum(abs(x) * y for x, y in zip(chart["x"], series["y"], strict=True))
        true = sum(abs(place - 3000) * 0.1 * number for place, number in found.items())
        bar = chart["x"][1] - chart["x"][0]
        assert abs(drawn - true) <= bar / 2 * sum(found.values()) * (1 + 1e-9)


def test_a_bar_stands_where_its_columns_landed(errors: ColumnErrors) -> None:
    chart = charts.column_chart(errors, 50e-6)
    right, left = (dict(zip(chart["x"], series["y"], strict=True)) for series in chart["series"])
    assert {x: y for x, y in right.items() if y} == {0.0: 16}
    assert {x: y for x, y in left.items() if y} == {0.0: 15, 60.0: 1}


def test_errors_without_spread_are_one_bar() -> None:
    right = np.zeros(6001, dtype=np.int64)
    right[3000] = 7
    chart = charts.column_chart(ColumnErrors(bin_width=1e-7, right=right, left=right * 0, worst=0.0, rms=0.0), 1e-4)
    assert {x: y for x, y in zip(chart["x"], chart["series"][0]["y"], strict=True) if y} == {0.0: 7}
    assert len(chart["x"]) >= 3


def test_the_histogram_is_centred_and_shows_limits_that_are_near(errors: ColumnErrors) -> None:
    near = charts.column_chart(errors, 50e-6)
    assert [mark["x"] for mark in near["marks"]] == [-50.0, 50.0]
    assert near["x"] == [-value for value in reversed(near["x"])]
    assert 0.0 in near["x"]
    steps = {round(b - a, 6) for a, b in pairwise(near["x"])}
    assert steps == {5.0}
    assert charts.column_chart(errors, 1e-3)["marks"] == []


def test_identified_lines_go_through_friction_and_top_speed(identified: tuple[IdentifiedLine, ...]) -> None:
    chart = charts.identified_chart(identified[0])
    by_name = {series["label"]: series["y"] for series in chart["series"]}
    assert chart["x"][0] == 0
    assert chart["x"][-1] == 40
    assert by_name["identified"][0] == 36
    assert by_name["identified"][-1] == pytest.approx(36 + 170 * 240 / 256, abs=0.01)
    assert by_name["true machine"] == by_name["identified"]
    assert by_name["power-on default"][0] == 32
    assert [value for value in by_name["measured"] if value is not None] == [67, 174]
    assert [series["label"] for series in charts.identified_chart(identified[1])["series"]] == ["identified"]


def test_every_colour_is_in_the_style_light_and_dark(report: ReportData) -> None:
    style = resources.files("detent.page").joinpath("template/report.css").read_text(encoding="utf-8")
    light, dark = re.findall(r":root[^{]*\{(.*?)\}", style, flags=re.DOTALL)[:2]
    drawn = _all_charts(report)
    used = {series["colour"] for chart in drawn for series in chart["series"]}
    used |= {"band-" + band["colour"] for chart in drawn for band in chart.get("bands", ())}
    assert used >= {"right", "left", "speed", "drive", "current", "muted", "ink", "band-brake", "band-good"}
    for name in used:
        assert f"--{name}:" in light
        assert f"--{name}:" in dark


def test_charts_are_plain_json(report: ReportData) -> None:
    drawn = _all_charts(report)
    assert json.loads(json.dumps(drawn, allow_nan=False)) == drawn
    for chart in drawn:
        for series in chart["series"]:
            assert len(series["y"]) == len(chart["x"])
