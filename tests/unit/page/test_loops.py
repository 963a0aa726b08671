from importlib import resources

import numpy as np

from detent.page.chart import Curve, Loop, Panel, line_chart, loop_chart


def test_loops_lie_over_the_curves_and_have_a_line_each_in_the_legend() -> None:
    x = np.array([0.0, 1.0, 2.0])
    panel = Panel(name="a", label="f [Hz]", curves=[Curve(label="permitted", colour="muted", y=x)])
    there, back = np.array([0.0, 1.0]), np.array([1.0, 0.0])
    loops = [
        Loop(label="up", colour="right", x=there, y=there + 0.12345),
        Loop(label="up", colour="right", x=there + 1, y=there, width=3.0, digits=0),
        Loop(label="down", colour="left", x=back, y=-there),
    ]
    chart = loop_chart(panel, x, "place [mm]", loops, digits=1)
    assert (chart["id"], chart["xLabel"], chart["x"]) == ("a", "place [mm]", [0.0, 1.0, 2.0])
    assert [series["label"] for series in chart["series"]] == ["permitted", "up", "down"]
    assert all(series["y"] == [None, None, None] for series in chart["series"][1:])
    assert chart["loops"][0] == {"colour": "right", "width": 2.0, "x": [0.0, 1.0], "y": [0.123, 1.123]}
    assert chart["loops"][1] == {"colour": "right", "width": 3.0, "x": [1.0, 2.0], "y": [0.0, 1.0]}
    assert chart["loops"][2]["x"] == [1.0, 0.0]


def test_a_curve_is_filled_only_where_it_says_so() -> None:
    y = np.zeros(2)
    curves = [Curve(label="a", colour="muted", y=y, fill=True), Curve(label="b", colour="muted", y=y)]
    filled, plain = line_chart(Panel(name="a", label="", curves=curves), y, "x")["series"]
    assert filled["fill"] is True
    assert "fill" not in plain


def test_the_script_of_the_page_knows_loops_and_fills() -> None:
    script = resources.files("detent.page").joinpath("template/report.js").read_text(encoding="utf-8")
    for read in ("chart.loops", "loop.colour", "loop.width", "loop.x", "loop.y", "one.fill"):
        assert read in script
