"""Units in which places and efforts are drawn."""

import math

from detent.identify.page.words import Ways, digits_for, effort_scale, label_of
from detent.page.words import GAP


def test_labels_have_a_unit_if_there_is_one() -> None:
    assert label_of("velocity", "") == "velocity"
    assert label_of("velocity", "mm/s") == "velocity [mm/s]"


def test_places_have_the_unit_of_the_log() -> None:
    assert (Ways("m").place.name, Ways("rad").speed.name) == ("mm", "deg/s")
    assert (Ways("count").place.name, Ways("count").speed.name) == ("count", "count/s")
    assert Ways("m").error(5.69e-6).replace(GAP, " ") == "5.7 µm"
    assert Ways("count").error(12.5).replace(GAP, " ") == "12.5 count"
    assert Ways("count").small(1e-9).factor == 1.0


def test_small_efforts_are_in_thousandths() -> None:
    assert effort_scale("N*m", 0.05).name.replace(GAP, " ") == "mN m"
    assert effort_scale("N*m", 0.5).factor == 1.0
    assert effort_scale("", 0.05).factor == 1.0


def test_charts_keep_digits_by_the_peak() -> None:
    assert [digits_for(peak) for peak in (1e6, 150.0, 0.02, 0.0, math.nan)] == [0, 2, 6, 3, 3]
