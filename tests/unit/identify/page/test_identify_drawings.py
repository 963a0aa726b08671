"""Intervals, bars and the heat map."""

import re

import numpy as np
from tests.unit.identify.page.samples import number

from detent.identify.page.identify_drawings import heat_map, interval_bar, long_bar, reach_of, signed


def width_of(svg: str) -> float:
    return float(re.findall(r'<rect x="[\d.]+" width="([\d.]+)"', svg)[0])


def test_the_scale_is_as_wide_as_the_widest_interval_needs() -> None:
    assert reach_of([number(10.0, 0.3), number(10.0, 0.04)]) == 0.05
    assert reach_of([number(10.0, 0.3), number(1.0, 0.9, "s", "delay"), number(1.0, 0.9, "m/s", "stribeck")]) == 0.05
    assert reach_of([number(1.0, 7.0)]) == 1.0
    assert reach_of([]) == 1.0


def test_an_interval_is_as_long_as_it_is_wide() -> None:
    wide, narrow = (interval_bar(number(10.0, half), 0.1, trusted=True) for half in (0.8, 0.4))
    assert width_of(wide) == 2 * width_of(narrow)
    assert "plus or minus 8.0 percent" in wide
    assert "<path" not in wide


def test_an_interval_beyond_the_scale_ends_in_arrows() -> None:
    bar = interval_bar(number(10.0, 3.0), 0.1, trusted=False)
    assert bar.count("<path") == 2
    assert "var(--bad)" in bar
    assert width_of(bar) == width_of(interval_bar(number(10.0, 1.0), 0.1, trusted=True))


def test_an_unknown_constant_has_no_bar() -> None:
    assert "from nothing to anything" in interval_bar(number(1.0, 1e9), 0.1, trusted=False)


def test_bars_are_relative_and_bounded() -> None:
    assert "width:110px" in long_bar(0.5, "a<b", chosen=False)
    assert "width:220px" in long_bar(3.0, "", chosen=True)
    assert "width:1px" in long_bar(0.0, "", chosen=False)
    assert "a&lt;b" in long_bar(0.5, "a<b", chosen=False)


def test_strong_correlations_are_framed() -> None:
    r = np.array([[1.0, -0.95, 0.2], [-0.95, 1.0, 0.0], [0.2, 0.0, 1.0]])
    html = heat_map(["a", "b<", "c"], r, limit=0.9)
    assert html.count("outline:") == 2
    assert html.count("var(--left) 66%") == 2
    assert html.count("var(--right) 14%") == 2
    assert "2 b&lt;" in html
    assert html.count("<tr>") == 4


def test_correlations_have_signs() -> None:
    assert [signed(r) for r in (1.0, -0.917, 0.004, -0.004)] == ["+1.00", "\u22120.92", "0.00", "0.00"]
