"""Constants with their intervals, the model, the heat map of correlations."""

import re

import numpy as np
from tests.unit.identify.page.samples import number

from detent.identify.page.constants import heat_map, interval_bar, reach_of, signed


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
    assert "undetermined" in interval_bar(number(1.0, 1e9), 0.1, trusted=False)


def test_correlations_have_signs() -> None:
    assert [signed(r) for r in (1.0, -0.917, 0.004, -0.004)] == ["+1.00", "\u22120.92", "0.00", "0.00"]


def test_strong_correlations_are_framed_and_shaded_by_their_sign() -> None:
    r = np.array([[1.0, -0.95, 0.2], [-0.95, 1.0, 0.0], [0.2, 0.0, 1.0]])
    table = heat_map(["a", "b<", "c"], r, limit=0.9)
    framed = {(i, j) for i, row in enumerate(table.rows) for j, cell in enumerate(row[1:]) if "outline:" in cell}
    assert framed == {(0, 1), (1, 0)}
    assert "var(--left) 66%" in table.rows[0][2]
    assert "var(--right) 14%" in table.rows[0][3]
    assert table.rows[1][0] == "2 b<"
