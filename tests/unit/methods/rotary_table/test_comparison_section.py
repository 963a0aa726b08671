import re
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_hex
from tests.page_reader import Reader
from tests.unit.methods.rotary_table.samples import angle_comparison, crossing, deg

from detent.errors import DetentError
from detent.methods.rotary_table import comparison_section as table_comparisons
from detent.methods.rotary_table.comparison import AngleComparison, Feed
from detent.methods.rotary_table.comparison_section import (
    angle_table,
    comparison_charts,
    comparison_section,
    crossing_events,
    plot_angle,
)
from detent.page.plots import new_figure


def read(found: AngleComparison) -> str:
    return Reader(comparison_section(found)).text


def cells_of(html: str) -> list[list[str]]:
    rows = re.findall(r"<tr>(.*?)</tr>", html, flags=re.DOTALL)
    return [[Reader(cell).text for cell in re.findall(r"<td.*?</td>", row, flags=re.DOTALL)] for row in rows]


@pytest.fixture
def never() -> AngleComparison:
    """Neither came as far as the end of the turn."""
    nowhere = {"time": np.nan, "deviation_before": np.nan, "deviation_after": np.nan}
    return angle_comparison(crossings=(crossing("conventional", 2, **nowhere), crossing("endless", 2, **nowhere)))


# -- on the page ------------------------------------------------------------------------------------------------------
def test_without_a_comparison_there_is_no_section() -> None:
    assert comparison_section(None) == ""
    assert comparison_charts(None) == []


def test_both_crossings_share_the_charts() -> None:
    way, lag, signal = comparison_charts(angle_comparison())
    assert [chart["id"] for chart in (way, lag, signal)] == ["cross-way", "cross-deviation", "cross-speed"]
    curves = {series["label"]: series["y"] for series in lag["series"]}
    before, after = lag["x"].index(4.99), lag["x"].index(5.0)
    assert (curves["conventional"][before], curves["conventional"][after]) == (2.0, 362.0)
    assert set(curves["endless"]) == {2.0}
    assert way["series"][0]["y"][way["x"].index(5.0)] == pytest.approx(300.0)
    assert set(signal["series"][1]["y"]) == {60.0}
    assert way["events"] == [5.0]


def test_a_crossing_at_the_same_moment_is_one_event_and_tells_of_both() -> None:
    (event,) = crossing_events(angle_comparison())
    assert event.t == 5.0
    assert (
        "the conventional deviation goes from 2 to 362\u202fdeg; the endless deviation stays 2\u202fdeg" in event.text
    )
    apart = angle_comparison(crossings=(crossing("conventional", 362, time=6.0), crossing("endless", 2)))
    assert [event.t for event in crossing_events(apart)] == [5.0, 6.0]


def test_what_never_came_to_the_end_of_the_turn_has_no_event(never: AngleComparison) -> None:
    assert crossing_events(never) == []
    assert comparison_charts(never)[0]["events"] == []


def test_the_runaway_is_told_with_where_it_came_to() -> None:
    assert "after 9.99 s it has turned 1200 deg, and still runs at 127 deg/s." in read(angle_comparison())


def test_every_speed_of_the_feed_is_a_row_and_what_is_coarse_stands_out() -> None:
    html = comparison_section(angle_comparison())
    rows = cells_of(html)
    assert ["1", "+0.0010", "−7"] in rows
    assert ["60", "0", "−5"] in rows  # a billionth is nothing
    failed = angle_comparison(feeds=(Feed(speed=deg(1), closed=np.nan, opened=np.nan),))
    assert ["1", "–", "–"] in cells_of(comparison_section(failed))


def test_every_start_is_a_row_and_what_is_thrown_back_stands_out() -> None:
    html = comparison_section(angle_comparison())
    rows = cells_of(html)
    assert ["1.000", "0.50", "thrown back: −30", "830"] in rows
    assert ["100.000", "50.00", "830", "830"] in rows
    assert html.count('class="n over"') == 3  # two speeds without position control, one start
    assert "less than the lag, 2 deg, beyond 0" in Reader(html).text


def test_charts_come_in_the_order_of_the_page() -> None:
    drawn = [chart["id"] for chart in comparison_charts(angle_comparison())]
    assert drawn == Reader(comparison_section(angle_comparison())).ids


# -- in the terminal --------------------------------------------------------------------------------------------------
def test_the_table_holds_the_method_beside_what_it_betters() -> None:
    title, heads, rows = angle_table(angle_comparison())
    assert title == "Endless angle at 60 deg/s, beside its alternatives"
    assert heads == ("", "turn counter, position control", "raw angle; no position control; other forms")
    assert rows == [
        ("deviation across the end of the turn", "2 to 2 deg", "2 to 362 deg"),
        ("way after 9.99 s", "600 deg, at 60 deg/s", "1200 deg, at 127 deg/s"),
        ("mean speed of manual feed at 1 deg/s", "+0.0010 %", "−7 %"),
        ("mean speed of manual feed at 60 deg/s", "0 %", "−5 %"),
        ("jog from 1.000 deg", "830 deg", "flag −30 deg (thrown back)"),
        ("jog from 100.000 deg", "830 deg", "flag 830 deg"),
    ]


def test_what_is_not_known_is_a_dash(never: AngleComparison) -> None:
    _, _, rows = angle_table(replace(never, feeds=(Feed(speed=deg(1), closed=np.nan, opened=-0.07),)))
    assert rows[0][1:] == ("– to – deg", "– to – deg")
    assert rows[2][1:] == ("– %", "−7 %")


# -- as a file --------------------------------------------------------------------------------------------------------
@pytest.fixture
def drawn(monkeypatch):
    """The figures that are drawn, to look into them."""
    figures = []

    @contextmanager
    def keep(path, width, height):
        with new_figure(path, width, height) as figure:
            figures.append(figure)
            yield figure

    monkeypatch.setattr(table_comparisons, "new_figure", keep)
    return figures


def texts(path):
    found = re.findall(r"<text.*?</text>", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    return [re.sub(r"<[^>]+>", "", text).strip() for text in found]


@pytest.mark.parametrize(("suffix", "begin"), [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".pdf", b"%PDF")])
def test_the_figure_is_written_as_its_name_says_and_always_the_same(tmp_path, suffix, begin):
    for name in ("a", "b"):
        plot_angle(angle_comparison(), tmp_path / (name + suffix))
    first, second = (tmp_path / (name + suffix) for name in ("a", "b"))
    assert first.read_bytes().startswith(begin)
    assert first.read_bytes() == second.read_bytes()


def test_the_figure_says_what_is_drawn(tmp_path):
    plot_angle(angle_comparison(), tmp_path / "a.svg")
    found = texts(tmp_path / "a.svg")
    assert "Across the end of the turn at 60 deg/s" in found
    assert "conventional, angle as it is read: 1200 deg after 9.99 s" in found
    assert "endless, turns added: 600 deg after 9.99 s" in found
    assert "Deviation where the detected angle jumps back: conventional 2 to 362 deg; endless 2 to 2 deg" in found
    assert {"+0.0010", "−7", "0", "−5"} <= set(found)
    assert {"1 deg/s", "60 deg/s", "flag", "turn counter", "thrown back", "100"} <= set(found)


def test_the_figure_draws_what_was_found(tmp_path, drawn):
    plot_angle(angle_comparison(), tmp_path / "a.png")
    way, lag, feed, starts = drawn[0].axes
    assert [line.get_ydata().max() for line in lag.lines[:2]] == pytest.approx([362, 2])
    assert [line.get_ydata()[-1] for line in way.lines[:2]] == pytest.approx([599.4, 599.4])
    assert [line.get_xdata()[0] for line in way.lines[2:]] == [5.0]
    heights = [bar.get_height() for bar in feed.patches]
    assert heights == pytest.approx([0.001, 0, -7, -5], abs=1e-4)
    goes_on, thrown = starts.lines
    assert list(zip(thrown.get_xdata(), thrown.get_ydata(), strict=True)) == [(0, 0)]
    assert sorted(zip(goes_on.get_xdata(), goes_on.get_ydata(), strict=True)) == [(0, 1), (1, 0), (1, 1)]
    assert to_hex(thrown.get_color()) != to_hex(goes_on.get_color())


def test_the_figure_can_be_drawn_of_what_never_crossed(never, tmp_path, drawn):
    plot_angle(replace(never, feeds=(Feed(speed=deg(1), closed=np.nan, opened=np.nan),)), tmp_path / "a.png")
    way, _, feed, _ = drawn[0].axes
    assert len(way.lines) == 2  # no mark
    assert [bar.get_height() for bar in feed.patches] == [0, 0]


def test_a_target_that_takes_no_figure_is_refused(tmp_path):
    with pytest.raises(DetentError, match=r"use one of \.png, \.svg, \.pdf"):
        plot_angle(angle_comparison(), tmp_path / "a.txt")
