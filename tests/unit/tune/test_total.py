"""Total indices from a scheme of runs."""

import numpy as np
import pytest

from detent.tune.cases import exchanged
from detent.tune.total import total_indices

KEYS = ("a", "b", "c")


def test_total_indices_of_ishigamis_function():
    """0.5576, 0.4424 and 0.2437: `c` does nothing alone, and a quarter of all together with `a`."""
    points = 4096
    x = {key: (2.0 * each - 1.0) * np.pi for key, each in exchanged(KEYS, points, 1, 0, 5 * points).items()}
    y = np.sin(x["a"]) + 7.0 * np.sin(x["b"]) ** 2 + 0.1 * x["c"] ** 4 * np.sin(x["a"])
    found = total_indices(list(KEYS), y.reshape(5, points))
    for key, share in (("a", 0.5576), ("b", 0.4424), ("c", 0.2437)):
        assert found[key].value == pytest.approx(share, abs=0.01)
        assert found[key].low < share < found[key].high


def test_a_case_of_the_scheme_is_a_function_of_its_number():
    whole = exchanged(KEYS, 64, 1, 0, 320)
    for first, count in ((0, 100), (100, 150), (250, 70)):
        for key, part in exchanged(KEYS, 64, 1, first, count).items():
            assert part.tolist() == whole[key][first : first + count].tolist()
    first, second, own, *_ = whole["a"].reshape(5, 64)
    assert own.tolist() == second.tolist() != first.tolist()
    assert whole["b"].reshape(5, 64)[2].tolist() == whole["b"].reshape(5, 64)[0].tolist()
    assert (whole["a"] > 0.0).all()
