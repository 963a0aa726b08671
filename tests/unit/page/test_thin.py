import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from detent.page.chart import thin_indices


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=400), st.integers(2, 60))
def test_extremes_and_ends_stay_and_the_number_is_bounded(values: list[float], points: int) -> None:
    signal = np.array(values)
    kept = thin_indices(signal, points)
    assert kept[0] == 0
    assert kept[-1] == len(signal) - 1
    assert (np.diff(kept) > 0).all()
    assert len(kept) <= max(points, 2) + 2
    assert signal[kept].max() == signal.max()
    assert signal[kept].min() == signal.min()


def test_a_short_signal_is_kept_whole() -> None:
    assert thin_indices(np.array([3.0, 1.0, 2.0]), 3).tolist() == [0, 1, 2]
    assert thin_indices(np.empty(0), 10).tolist() == []


def test_gaps_do_not_hide_the_extremes() -> None:
    signal = np.full(1000, np.nan)
    signal[500:600] = np.linspace(0, 1, 100)
    kept = thin_indices(signal, 20)
    assert np.nanmax(signal[kept]) == 1.0
    assert np.nanmin(signal[kept]) == 0.0


def test_flags_can_be_thinned() -> None:
    flags = np.zeros(1000, dtype=bool)
    flags[400:410] = True
    assert flags[thin_indices(flags, 50)].any()
