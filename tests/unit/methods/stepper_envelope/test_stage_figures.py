import re
from contextlib import contextmanager

import pytest
from matplotlib.colors import to_hex
from tests.unit.methods.stepper_envelope.samples import jerk_comparison, step_comparison

from detent.errors import DetentError
from detent.methods.stepper_envelope import stage_figures
from detent.methods.stepper_envelope.comparison import METHODS
from detent.methods.stepper_envelope.stage_figures import METHOD_COSTS, jerk_table, plot_jerk, plot_steps, steps_table
from detent.page.plots import new_figure


@pytest.fixture
def drawn(monkeypatch):
    """The figures that are drawn, to look into them."""
    figures = []

    @contextmanager
    def keep(path, width, height):
        with new_figure(path, width, height) as figure:
            figures.append(figure)
            yield figure

    monkeypatch.setattr(stage_figures, "new_figure", keep)
    return figures


def texts(path):
    found = re.findall(r"<text.*?</text>", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    return [re.sub(r"<[^>]+>", "", text).strip().replace("\u202f", " ") for text in found]


def test_every_method_that_is_compared_has_its_cost() -> None:
    assert set(METHOD_COSTS) == set(METHODS)


# ---- methods that decide step by step


def test_bars_are_multiples_of_the_time_of_the_envelope(tmp_path, drawn) -> None:
    plot_steps(step_comparison(), tmp_path / "a.svg")
    (area,) = drawn[0].axes
    widths = [[bar.get_width() for bar in bars] for bars in area.containers]
    assert widths[0] == [1.0, 1.0]
    assert widths[3] == pytest.approx([3.0, 9.0])
    assert widths[4] == pytest.approx([0.3125, 0.8333], rel=1e-3)
    assert len({to_hex(bars[0].get_facecolor()) for bars in area.containers}) == 5
    found = texts(tmp_path / "a.svg")
    assert "How long does a way take, and are steps lost? Motor x" in found
    assert {"240 ms", "5.4 s", "25 ms, 36 steps lost", "500 ms, 460 steps lost"} <= set(found)
    assert {"envelope (this method)", "constant start frequency", "B: speed per step"} <= set(found)
    assert "2 000 steps" in found
    assert "0.5 mm" in found


def test_texts_stand_outside_the_bars_and_the_line_at_one(tmp_path, drawn) -> None:
    plot_steps(step_comparison(), tmp_path / "a.png")
    (area,) = drawn[0].axes
    ends = [text.xy[0] for text in area.texts]
    assert min(ends) == 1.0
    assert max(ends) == pytest.approx(9.0)
    assert area.get_xlim() == (0, pytest.approx(1.22 * 9.0))
    lost = [text for text in area.texts if "lost" in text.get_text()]
    assert {text.get_color() for text in lost} == {stage_figures.RED}
    assert len(lost) == 2


def test_the_table_of_the_methods_says_the_same() -> None:
    title, heads, rows = steps_table(step_comparison(zones_lose=-8))
    assert title == "Motor x: time of a way, and steps lost (5 um a step)"
    assert heads == ("method", "100 steps", "2000 steps", "worked out per step")
    assert rows[0] == ("envelope (this method)", "80 ms", "600 ms", METHOD_COSTS["envelope"])
    assert rows[2][1:3] == ("80 ms", "550 ms, 8 lost")
    assert rows[4] == ("constant largest frequency", "25 ms, 36 lost", "500 ms, 460 lost", "nothing")
    assert all(len(row) == len(heads) for row in rows)


# ---- limited jerk


def test_both_profiles_are_drawn_with_their_ends_magnified(tmp_path, drawn) -> None:
    plot_jerk(jerk_comparison(), tmp_path / "a.svg")
    whole, begin, end = drawn[0].axes
    assert whole.get_xlim() == (0.0, pytest.approx(2.1))
    assert begin.get_xlim() == (0.0, pytest.approx(130.0))
    assert end.get_xlim() == (pytest.approx(1970.0), pytest.approx(2100.0))
    envelope, smooth = begin.lines
    assert (envelope.get_ydata()[0], smooth.get_ydata()[0]) == (2.0, 0.0)
    found = texts(tmp_path / "a.svg")
    assert "40 mm of motor x: the jerk-limited profile takes 0.96 % longer" in found
    assert "limits of the profile: 20 mm/s, 200 mm/s², 54.8 m/s³" in found
    assert {"envelope, step by step", "time-optimal with limited jerk (ruckig)"} <= set(found)


def test_the_table_of_the_profiles_says_how_much_longer() -> None:
    title, heads, rows = jerk_table(jerk_comparison())
    assert title == "Motor x: 40 mm without zones, limits 20 mm/s, 200 mm/s^2, 54.8 m/s^3"
    assert len(heads) == 4
    assert rows == [
        ("envelope", "2.08 s", "", "20 mm/s"),
        ("time-optimal, jerk limited (ruckig)", "2.1 s", "+20.0 ms, +1.0%", "20 mm/s"),
    ]


@pytest.mark.parametrize(
    "plot", [lambda path: plot_steps(step_comparison(), path), lambda path: plot_jerk(jerk_comparison(), path)]
)
def test_a_target_that_takes_no_figure_is_refused(plot, tmp_path) -> None:
    with pytest.raises(DetentError, match=r"cannot be saved as '\.gif'"):
        plot(tmp_path / "a.gif")
    for suffix in (".png", ".pdf"):
        plot(tmp_path / f"a{suffix}")
        assert (tmp_path / f"a{suffix}").stat().st_size > 5000
