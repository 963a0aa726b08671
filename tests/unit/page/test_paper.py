from dataclasses import replace

import numpy as np
import pytest

from detent.page import paper
from detent.page.paper import Marks, paper_figure
from detent.page.parts import INCH


@pytest.fixture
def marks() -> Marks:
    """Two lines of two pages, right then left; the third mark is 60 µm right of its column, bold."""
    column = np.array([0.0, 0.1, 0.3, 0.2]) * INCH
    return Marks(
        characters=["H", "i", "<", "&"],
        page=np.array([1, 1, 2, 2]),
        line=np.array([1, 1, 2, 2]),
        baseline=np.array([0.5, 0.5, 1.0, 1.0]) * INCH,
        column=column,
        landed=column + np.array([1e-6, -2e-6, 60e-6, 0.0]),
        width=np.full(4, 0.1 * INCH),
        direction=np.array([1, 1, -1, -1]),
        strikes=np.array([1, 1, 2, 1]),
    )


def test_offset_is_positive_to_the_right_of_the_column(marks: Marks) -> None:
    np.testing.assert_allclose(marks.offset, [1e-6, -2e-6, 60e-6, 0.0], atol=1e-12)


def test_nothing_on_paper_is_no_figure(marks: Marks) -> None:
    none = Marks(characters=[], **{name: np.empty(0) for name in Marks.__slots__[1:]})
    assert not paper_figure("The page", "", none, 50e-6)
    assert paper_figure("The page", "", marks, 50e-6)


def test_the_page_keeps_text_place_and_offset(marks: Marks) -> None:
    data = paper_figure("The page", "", marks, 50e-6).paper
    assert data is not None
    assert data["leftOut"] == 0
    assert data["limit"] == 50.0
    assert data["columns"] == 48.0
    first, second = data["pages"]
    assert first == {
        "number": 1,
        "lines": [
            {"n": 1, "d": 1, "y": 24.0, "text": "Hi", "x": [0.0, 12.0], "off": [1.0, -2.0], "w": 12.0, "bold": []}
        ],
    }
    # Printed from right to left, read from left to right.
    assert second["lines"][0]["text"] == "&<"
    assert second["lines"][0]["bold"] == [1]
    assert second["lines"][0]["off"] == [0.0, 60.0]


def test_too_many_marks_leave_whole_pages_out(marks: Marks, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(paper, "MARKS", 3)
    data = paper_figure("The page", "", marks, 50e-6).paper
    assert data is not None
    assert [page["number"] for page in data["pages"]] == [1]
    assert data["leftOut"] == 1


@pytest.mark.parametrize(
    ("worst", "factor"),
    [(0.0, 1), (10.0, 1), (1.9e-6, 1000), (60e-6, 20), (0.1 * INCH / 50 * 0.999, 50), (0.1 * INCH / 50 * 1.01, 20)],
)
def test_errors_are_magnified_to_at_most_a_character(marks: Marks, worst: float, factor: int) -> None:
    landed = marks.column + np.array([worst, 0.0, 0.0, 0.0])
    made = paper_figure("", "", replace(marks, landed=landed), 1e-3).paper
    assert made is not None
    assert made["magnify"] == factor
