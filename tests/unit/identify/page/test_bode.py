"""Plots over the logarithm of the frequency."""

import re

import numpy as np
import pytest
from tests.page_reader import Reader

from detent.identify.page.response import FOOT, FULL, LEFT, RIGHT, TOP, Line, Plot, frequency_plots

F = np.array([1.0, 10.0, 100.0])


def points(html: str, colour: str) -> list[tuple[float, float]]:
    """Points of the first curve of a colour that is not in the legend."""
    path = next(d for d, style in re.findall(r'<path d="([^"]*)" style="([^"]*)"', html) if f"--{colour}" in style)
    return [(float(x), float(y)) for x, y in re.findall(r"[ML]([\d.-]+) ([\d.-]+)", path)]


def test_decades_are_as_long_as_one_another() -> None:
    html = frequency_plots([Plot(label="size", lines=[Line(label="m", colour="speed", x=F, y=F)], span=(0.0, 200.0))])
    (a, low), (b, _), (c, high) = points(html, "speed")
    assert (a, c) == (LEFT, FULL - RIGHT)
    assert b == pytest.approx((a + c) / 2)
    inner = 200 - TOP - FOOT
    assert (low, high) == pytest.approx((TOP + inner * (1 - 1 / 200), TOP + inner / 2), abs=0.1)


def test_magnitudes_are_logarithmic_too() -> None:
    line = Line(label="", colour="speed", x=F, y=np.array([1e-6, 1e-4, 1e-2]))
    html = frequency_plots([Plot(label="size", lines=[line], logarithmic=True)])
    (_, low), (_, middle), (_, high) = points(html, "speed")
    assert middle == pytest.approx((low + high) / 2, abs=0.1)
    assert "10<tspan" in html
    assert "\u22124</tspan>" in html


def test_a_missing_value_breaks_the_line() -> None:
    line = Line(label="", colour="speed", x=np.array([1.0, 2.0, 3.0, 4.0]), y=np.array([1.0, 2.0, np.nan, 4.0]))
    html = frequency_plots([Plot(label="size", lines=[line])])
    assert len(re.findall(r"M[\d.]+ [\d.]+L[\d.]+ [\d.]+M[\d.]+ [\d.]+\"", html)) == 1


def test_only_the_last_plot_names_the_frequency_and_named_lines_the_legend() -> None:
    lines = [Line(label="fit <1>", colour="left", x=F, y=F, dash="6 4"), Line(label="", colour="drive", x=F, y=F)]
    html = frequency_plots([Plot(label="a", lines=lines), Plot(label="b", lines=lines[1:], levels=[50.0])])
    assert html.count("frequency [Hz]") == 1
    assert "fit &lt;1&gt;" in html
    assert html.count("stroke-dasharray:6 4") == 2
    assert "stroke-dasharray:3 3" in html
    assert Reader(html).open == []


def test_angles_have_ticks_at_quarters_of_a_turn() -> None:
    line = Line(label="", colour="speed", x=F, y=np.array([-180.0, -90.0, -360.0]))
    html = frequency_plots([Plot(label="phase", lines=[line])])
    assert re.findall(r'text-anchor="end">([^<]*)<', html) == ["\u2212360", "\u2212270", "\u2212180", "\u221290"]
