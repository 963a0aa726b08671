"""Plots over the logarithm of the frequency."""

import re
from typing import Any

import numpy as np
import pytest
from tests.page_reader import Reader

from detent.identify.page.response import FOOT, FULL, LEFT, RIGHT, TOP, frequency_plots
from detent.page.chart import Curve, Panel

F = np.array([1.0, 10.0, 100.0])


def panel(*lines: Curve, label: str = "size", **more: Any) -> Panel:
    return Panel(name="", label=label, curves=lines, **more)


def points(html: str, colour: str) -> list[tuple[float, float]]:
    """Points of the first curve of a colour that is not in the legend."""
    path = next(d for d, style in re.findall(r'<path d="([^"]*)" style="([^"]*)"', html) if f"--{colour}" in style)
    return [(float(x), float(y)) for x, y in re.findall(r"[ML]([\d.-]+) ([\d.-]+)", path)]


def test_decades_are_as_long_as_one_another() -> None:
    html = frequency_plots(F, [panel(Curve(label="m", colour="speed", y=F), span=(0.0, 200.0), height=200)])
    (a, low), (b, _), (c, high) = points(html, "speed")
    assert (a, c) == (LEFT, FULL - RIGHT)
    assert b == pytest.approx((a + c) / 2)
    inner = 200 - TOP - FOOT
    assert (low, high) == pytest.approx((TOP + inner * (1 - 1 / 200), TOP + inner / 2), abs=0.1)


def test_magnitudes_are_logarithmic_too() -> None:
    line = Curve(label="", colour="speed", y=np.array([1e-6, 1e-4, 1e-2]))
    html = frequency_plots(F, [panel(line)], logarithmic=1)
    (_, low), (_, middle), (_, high) = points(html, "speed")
    assert middle == pytest.approx((low + high) / 2, abs=0.1)
    assert "10<tspan" in html
    assert "\u22124</tspan>" in html


def test_a_missing_value_breaks_the_line() -> None:
    line = Curve(label="", colour="speed", y=np.array([1.0, 2.0, np.nan, 4.0]))
    html = frequency_plots(np.array([1.0, 2.0, 3.0, 4.0]), [panel(line)])
    assert len(re.findall(r"M[\d.]+ [\d.]+L[\d.]+ [\d.]+M[\d.]+ [\d.]+\"", html)) == 1


def test_only_the_last_plot_names_the_frequency_and_named_lines_the_legend() -> None:
    lines = [Curve(label="fit <1>", colour="left", y=F, dash=(6, 4)), Curve(label="", colour="drive", y=F)]
    html = frequency_plots(F, [panel(*lines, label="a"), panel(lines[1], label="b", levels=[(50.0, "")])])
    assert html.count("frequency [Hz]") == 1
    assert "fit &lt;1&gt;" in html
    assert html.count("stroke-dasharray:6 4") == 2
    assert "stroke-dasharray:3 3" in html
    assert Reader(html).open == []


def test_angles_have_ticks_at_quarters_of_a_turn() -> None:
    line = Curve(label="", colour="speed", y=np.array([-180.0, -90.0, -360.0]))
    html = frequency_plots(F, [panel(line, label="phase")])
    assert re.findall(r'text-anchor="end">([^<]*)<', html) == ["\u2212360", "\u2212270", "\u2212180", "\u221290"]
