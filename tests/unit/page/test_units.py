import math

import pytest

from detent.page.units import Scale, Units
from detent.page.words import GAP

LINEAR, ROTARY = Units(rotary=False), Units(rotary=True)


def test_errors_are_drawn_in_a_unit_of_their_size() -> None:
    assert LINEAR.small(0.9e-3) == Scale(1e6, "µm")
    assert LINEAR.small(-2e-3) == Scale(1e3, "mm")
    assert ROTARY.small(math.radians(0.05)).name == "arcsec"
    assert ROTARY.small(math.radians(0.05)).factor * math.radians(1) == pytest.approx(3600)
    assert ROTARY.small(math.radians(0.2)).name == "deg"


@pytest.mark.parametrize(
    ("units", "value", "text"),
    [(LINEAR, 5.69e-6, "5.7 µm"), (LINEAR, math.nan, "–"), (ROTARY, 1.704e-5, "3.5 arcsec"), (ROTARY, 0.1, "5.73 deg")],
)
def test_errors_are_written_with_their_unit(units: Units, value: float, text: str) -> None:
    assert units.error(value).replace(GAP, " ") == text


def test_positions_and_speeds_are_written_as_people_read_them() -> None:
    assert LINEAR.position(-0.0125) == "−12.500"
    assert LINEAR.position(-1e-9) in {"0.000", "−0.000"}
    assert ROTARY.position(math.pi) == "180.000"
    assert LINEAR.speed_text(0.5).replace(GAP, " ") == "500 mm/s"
    assert ROTARY.speed_text(math.pi).replace(GAP, " ") == "180 deg/s"


@pytest.mark.parametrize(
    ("unit", "value", "text"),
    [("m", 5.69e-6, "5.7 µm"), ("rad", 0.1, "5.73 deg"), ("m/s", 0.25, "250 mm/s"), ("rad/s^2", math.pi, "180 deg/s²"),
     ("m/s^2", 1.5, "1.50 m/s²"), ("N*m", 0.5, "0.500 N m")],
)  # fmt: skip
def test_differences_are_written_in_the_units_of_the_trade(unit: str, value: float, text: str) -> None:
    assert Units(rotary=unit.startswith("rad")).written(value, unit).replace(GAP, " ") == text


def test_signals_are_drawn_in_the_units_of_the_trade() -> None:
    assert LINEAR.of("m") == Scale(1e3, "mm")
    assert ROTARY.of("rad/s").name == "deg/s"
    assert LINEAR.of("m/s^2") == Scale(1.0, "m/s²")
