import json

from detent.page.chart import Bar, Lane, lane_chart

LANES = [
    Lane("go to", "right", [Bar(0.0, 2.0, "1", "step 1"), Bar(3.0, 20.0, "2", "step 2")]),
    Lane("in feed", "drive", [Bar(1.23456, 2.5, "on", "feed is on"), Bar(4.0, 4.0, "", "nothing")]),
]


def test_each_bar_stands_in_its_lane_with_its_texts() -> None:
    chart = lane_chart("line", LANES, (0.0, 10.0), "time [s]")
    assert chart["lanes"] == [
        {"label": "go to", "colour": "right", "bars": [[0.0, 2.0, "1", "step 1"], [3.0, 20.0, "2", "step 2"]]},
        {"label": "in feed", "colour": "drive", "bars": [[1.2346, 2.5, "on", "feed is on"]]},
    ]
    assert (chart["id"], chart["xLabel"], chart["yRange"], chart["series"]) == ("line", "time [s]", [0, 2], [])
    assert json.loads(json.dumps(chart, allow_nan=False)) == chart


def test_the_cursor_finds_every_bar_however_short() -> None:
    short = Lane("out", "good", [Bar(5.0001, 5.0003, "on", "blink")])
    chart = lane_chart("line", [short], (0.0, 1000.0), "time [s]")
    assert any(5.0001 <= x < 5.0003 for x in chart["x"])
    assert chart["x"] == sorted(set(chart["x"]))
    assert (chart["x"][0], chart["x"][-1]) == (0.0, 1000.0)


def test_what_is_outside_is_left_out_and_the_lane_stays() -> None:
    chart = lane_chart("line", LANES, (5.0, 10.0), "time [s]")
    assert [len(lane["bars"]) for lane in chart["lanes"]] == [1, 0]
    assert (chart["x"][0], chart["x"][-1]) == (5.0, 10.0)


def test_a_chart_above_others_shares_their_cursor_and_names_no_axis() -> None:
    above = lane_chart("line", LANES, (0.0, 10.0), "time [s]", sync="run")
    alone = lane_chart("line", LANES, (0.0, 10.0), "time [s]")
    assert (above["sync"], above["foot"]) == ("run", False)
    assert "sync" not in alone
    assert "foot" not in alone
    assert above["height"] < alone["height"]
    assert lane_chart("line", LANES * 2, (0.0, 10.0), "time [s]")["height"] > alone["height"]
