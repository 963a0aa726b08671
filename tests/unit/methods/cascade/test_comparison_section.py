"""A move in four ways: on the page, as a figure, in the terminal."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
from tests.page_reader import Reader
from tests.unit.methods.cascade.samples import comparison, rigid_comparison

from detent.errors import DetentError
from detent.methods.cascade.comparison_section import (
    comparison_charts,
    comparison_section,
    plot_profiles,
    profiles_table,
)


def test_without_a_comparison_there_is_no_section() -> None:
    assert comparison_section(None) == ""
    assert comparison_charts(None) == []


def test_the_section_says_what_was_compared_and_what_to_look_for() -> None:
    text = Reader(comparison_section(comparison())).text
    assert (
        "A move of 250 mm at 500 mm/s in four ways: as a trapezoid of the speed and with the jerk of the axis" in text
    )
    assert "load swings at 225 Hz" in text
    assert "trapezoid, no feed-forward600" in text
    assert "limited jerk, feed-forward625" in text
    rigid = Reader(comparison_section(rigid_comparison())).text
    assert "a jerk chosen for it, as the axis file states none" in rigid
    assert "swinging" not in rigid


def test_the_charts_have_four_curves_and_the_twist_begins_at_the_end_of_each_reference() -> None:
    speed, following, twist = comparison_charts(comparison())
    assert [curve["label"] for curve in speed["series"]] == ["trapezoid", "limited jerk"]
    assert len(following["series"]) == len(twist["series"]) == 4
    assert following["yLabel"] == "following error [mm]"
    assert twist["yLabel"] == "twist [µm]"
    assert twist["x"][0] == 0.0
    # 3 um cos(900 t), from 0.6 s on.
    assert twist["series"][0]["y"][0] == pytest.approx(3 * math.cos(900 * 0.6), abs=0.02)
    assert twist["x"][-1] == pytest.approx(1e3 * 10 / 225, rel=1e-3)


def test_the_table_has_a_row_for_each_way() -> None:
    title, heads, rows = profiles_table(comparison())
    assert title == "A move of 250 mm at 500 mm/s, in four ways"
    assert len(heads) == 6
    assert rows[0] == ("trapezoid, no feed-forward", "600 ms", "12.5 mm", "120 ms", "4.4 µm", "2.40 V")
    assert [row[0] for row in rows][3] == "limited jerk, feed-forward"
    first = rigid_comparison().cases[0]
    never = replace(rigid_comparison(), cases=(replace(first, settling=math.nan), *rigid_comparison().cases[1:]))
    assert profiles_table(never)[2][0][3:5] == ("not", "rigid")


@pytest.mark.parametrize("found", [comparison(), rigid_comparison(), comparison(rotary=True)])
def test_the_figure_is_drawn(found: object, tmp_path: Path) -> None:
    target = tmp_path / "profiles.svg"
    plot_profiles(found, target)  # pyright: ignore[reportArgumentType]
    text = target.read_text(encoding="utf-8")
    assert text.startswith("<?xml")
    assert len(text) > 20_000
    with pytest.raises(DetentError, match=r"cannot be saved as '\.txt'"):
        plot_profiles(found, tmp_path / "profiles.txt")  # pyright: ignore[reportArgumentType]
