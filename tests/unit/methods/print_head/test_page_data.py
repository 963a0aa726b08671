import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from detent.methods.print_head.page_data import COLUMN, SPEED_STEP, ColumnErrors
from detent.page.parts import INCH


def test_the_units_of_the_specification() -> None:
    top_speed = 240 * SPEED_STEP
    assert top_speed == pytest.approx(40 * INCH)
    assert round(COLUMN * 1e6, 2) == 211.67


def test_bins_lie_about_zero_and_hold_all_columns(errors: ColumnErrors) -> None:
    assert errors.total == 32
    assert errors.offsets[3000] == 0.0
    assert errors.offsets[0] == pytest.approx(-300e-6)
    assert errors.offsets[-1] == pytest.approx(300e-6)
    assert errors.offsets[3010] == pytest.approx(1e-6)


@pytest.mark.parametrize(("limit", "beyond"), [(0.0, 17), (0.9e-6, 17), (1.5e-6, 9), (59e-6, 1), (61e-6, 0), (1.0, 0)])
def test_columns_beyond_a_limit_are_counted_on_both_sides(errors: ColumnErrors, limit: float, beyond: int) -> None:
    assert errors.beyond(limit) == beyond


@given(st.lists(st.integers(0, 40), min_size=11, max_size=11), st.floats(0, 1e-6))
def test_within_and_beyond_are_all(counts: list[int], limit: float) -> None:
    made = ColumnErrors(bin_width=1e-7, right=np.array(counts), left=np.array(counts[::-1]), worst=0.0, rms=0.0)
    within = np.abs(made.offsets) <= limit
    assert made.beyond(limit) + int(made.right[within].sum() + made.left[within].sum()) == made.total == 2 * sum(counts)
