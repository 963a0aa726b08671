import numpy as np
import pytest

from detent.errors import DetentError
from detent.report.data import COLUMN, INCH, SPEED_STEP, Marks


def test_the_units_of_the_specification() -> None:
    top_speed = 240 * SPEED_STEP
    assert top_speed == pytest.approx(40 * INCH)
    assert round(COLUMN * 1e6, 2) == 211.67


def test_offset_is_positive_to_the_right_of_the_column(marks: Marks) -> None:
    np.testing.assert_allclose(marks.offset, [1e-6, -2e-6, 60e-6, 0.0], atol=1e-12)


def test_marks_of_unequal_length_are_refused() -> None:
    with pytest.raises(DetentError, match="report: 2 characters but 0 values of 'page'; give one per character"):
        Marks(characters="ab")


def test_no_marks_at_all_is_a_page_without_ink() -> None:
    assert len(Marks()) == 0
    assert Marks().offset.size == 0
