import math

import pytest

from detent.methods.cascade.units import milliseconds
from detent.page.words import GAP, percent


@pytest.mark.parametrize(
    ("share", "text"), [(0.0, "0 %"), (1.556e-5, "0.0016 %"), (0.0574, "5.74 %"), (2.5, "250 %"), (math.nan, "–")]
)
def test_shares_are_written_in_percent(share: float, text: str) -> None:
    assert percent(share).replace(GAP, " ") == text


def test_round_milliseconds_stay_round() -> None:
    assert milliseconds(1.1 - 1.08).replace(GAP, " ") == "20 ms"
    assert milliseconds(0.12345).replace(GAP, " ") == "123 ms"
