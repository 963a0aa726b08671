from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure as Canvas
from tests.unit.page.samples import EVENTS, figures, heaps, lanes, loops, over_time, table

from detent.errors import DetentError
from detent.page import draw
from detent.page.chart import Curve, Panel, line_chart
from detent.page.draw import draw_chart, draw_figures
from detent.page.figure import Figure


def drawn(chart: dict[str, Any]) -> Any:
    area = Canvas().subplots()
    draw_chart(area, chart)
    return area


def test_curves_bands_levels_and_events_are_those_of_the_chart() -> None:
    chart = over_time()[0]
    area = drawn(chart)
    curves = {line.get_label(): line for line in area.lines}
    np.testing.assert_allclose(curves["smooth"].get_ydata(), chart["series"][0]["y"])
    np.testing.assert_allclose(curves["smooth"].get_xdata(), chart["x"])
    assert curves["stepped"].get_drawstyle() == "steps-post"
    assert curves["stepped"].is_dashed()
    upright = [line.get_xdata()[0] for line in area.lines if list(line.get_ydata()) == [0, 1]]
    assert upright == [event.t * 1e3 for event in EVENTS]
    texts = [text.get_text() for text in area.texts]
    assert {"good", "half", "1", "2", "3"} <= set(texts)
    assert area.get_ylabel() == "speed [mm/s]"
    assert area.get_xlabel() == ""


def test_only_the_lowest_chart_names_the_time_and_the_first_numbers_the_events() -> None:
    area = drawn(over_time()[1])
    assert area.get_xlabel() == "time [ms]"
    assert "1" not in [text.get_text() for text in area.texts]
    assert len(area.collections) == 1  # the tinted ground


def test_bars_of_two_heaps_stand_on_both_sides_of_their_place() -> None:
    chart = heaps()
    area = drawn(chart)
    right, left = area.containers
    assert [bar.get_height() for bar in right] == chart["series"][0]["y"]
    # As on the page: the group whose side is + stands right.
    assert right[0].get_x() == pytest.approx(chart["x"][0], abs=0.02)
    assert left[0].get_x() + left[0].get_width() == pytest.approx(chart["x"][0], abs=0.02)
    assert {line.get_xdata()[0] for line in area.lines if list(line.get_ydata()) == [0, 1]} == {-1.5, 1.5}


def test_lanes_have_a_bar_for_each_stretch_and_their_names() -> None:
    area = drawn(lanes())
    assert [label.get_text() for label in area.get_yticklabels()] == ["go", "wait"]
    assert len(area.collections) == 3


def test_loops_go_to_and_fro_and_rings_have_no_line() -> None:
    chart = loops()
    area = drawn(chart)
    rings, loop = area.lines[0], area.lines[-1]
    assert rings.get_linestyle() == "None"
    np.testing.assert_allclose(loop.get_xdata(), chart["loops"][0]["x"])


@pytest.fixture
def kept(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Pictures as they were drawn."""
    canvases: list[Any] = []

    @contextmanager
    def keep(_path: Path, width: float, height: float, **_options: Any) -> Any:
        canvases.append(Canvas(figsize=(width, height), layout="constrained"))
        yield canvases[-1]

    monkeypatch.setattr(draw, "new_figure", keep)
    return canvases


def test_a_picture_has_the_charts_and_tables_of_all_figures(kept: list[Any], tmp_path: Path) -> None:
    draw_figures(figures(), tmp_path / "a.png")
    (canvas,) = kept
    titles = [area.get_title(loc) for area in canvas.axes for loc in ("left", "center") if area.get_title(loc)]
    assert [title for title in titles if title in {f.title for f in figures()}] == [
        "Speed < drive", "Two", "Loops", "Cells", "Drawn",
    ]  # fmt: skip
    assert len([area for area in canvas.axes if area.get_ylabel()]) == 4
    cells = [area.tables[0].get_celld() for area in canvas.axes if area.tables]
    assert len(cells) == 2  # events and cells
    assert cells[1][1, 0].get_text().get_text() == "<a> & b"
    assert cells[1][2, 3].get_text().get_text() == "bold"
    assert len(cells[1]) == (1 + len(table().rows)) * len(table().heads)


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_the_suffix_chooses_the_kind_and_the_same_figures_give_the_same_file(suffix: str, tmp_path: Path) -> None:
    first, second = tmp_path / f"a{suffix}", tmp_path / f"b{suffix}"
    draw_figures(figures(), first)
    draw_figures(figures(), second)
    assert first.read_bytes() == second.read_bytes()
    assert first.read_bytes().startswith({".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}[suffix])


def test_other_suffixes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DetentError, match=r"cannot be saved as '.gif'"):
        draw_figures([Figure(title="a", table=table())], tmp_path / "a.gif")


def test_axes_are_logarithmic_where_the_chart_says_so() -> None:
    curve = Curve(label="c", colour="ink", y=np.array([1e-6, 1e-2]), digits=9)
    chart = line_chart(Panel(name="p", label="y", curves=[curve]), np.array([1.0, 100.0]), "f [Hz]", log="xy")
    area = drawn(chart)
    assert (area.get_xscale(), area.get_yscale()) == ("log", "log")
    np.testing.assert_allclose(area.lines[0].get_ydata(), [1e-6, 1e-2])
