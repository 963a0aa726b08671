"""How constants, units and numbers with limits are written."""

import math

import pytest
from tests.unit.identify.page.samples import number

from detent.identify.page.words import (
    constant_name,
    is_known,
    long_bar,
    meaning_of,
    relative_half,
    unit_text,
    written,
)
from detent.page.words import GAP


def text(value: float, half: float, unit: str = "N") -> str:
    return str(written(number(value, half, unit))).replace(GAP, " ")


@pytest.mark.parametrize(
    ("value", "half", "expected"),
    [
        (95.1359, 0.3828, "95.14 ± 0.38 N"),
        (-1.5, 0.25, "\u22121.50 ± 0.25 N"),
        (203.5, 11.4, "204 ± 11 N"),
        (1234.5, 250.0, "1234 ± 250 N"),
        (2.31e-6, 5.2e-8, "2.310 · 10⁻⁶ ± 0.052 · 10⁻⁶ N"),
        (3.21e7, 4e5, "32.10 · 10⁶ ± 0.40 · 10⁶ N"),
        (7.0, 0.0, "7 ± 0 N"),
    ],
)
def test_the_last_digit_is_the_second_of_the_uncertainty(value: float, half: float, expected: str) -> None:
    assert text(value, half) == expected


def test_a_delay_is_in_ms() -> None:
    assert text(-7e-4, 1.6e-4, "s") == "\u22120.70 ± 0.16 ms"


def test_a_pure_number_has_no_unit() -> None:
    assert text(0.5, 0.1, "1") == "0.50 ± 0.10"


def test_half_an_interval_absolute_and_relative() -> None:
    assert number(20.0, 3.0).half == pytest.approx(3.0)
    assert relative_half(number(-20.0, 3.0)) == pytest.approx(0.15)
    assert relative_half(number(0.0, 3.0)) == math.inf


def test_what_is_known_at_all() -> None:
    assert is_known(number(1.0, 9.9))
    assert not is_known(number(1.0, 10.1))
    assert not is_known(number(0.0, 1.0))
    assert is_known(number(0.0, 0.002, "s", "delay"))
    assert not is_known(number(0.01, 0.2, "s", "delay"))


def test_what_may_be_zero() -> None:
    assert number(1.0, 1.1).holds(0.0)
    assert not number(1.0, 0.9).holds(0.0)


def test_names_say_kind_and_direction() -> None:
    assert constant_name("coulomb.negative") == "Coulomb friction in negative direction"
    assert constant_name("mass", "kg") == "mass"
    assert constant_name("mass", "A*s^2/rad") == "inertia"
    assert constant_name("pendulum.across") == "weight, across"
    assert constant_name("loss") == "share lost in the transmission"
    assert constant_name("something.new") == "something new"


def test_meanings_are_those_of_the_kind() -> None:
    assert meaning_of("viscous.positive") == "grows with speed"
    assert meaning_of("pendulum") != meaning_of("pendulum.across")
    assert meaning_of("something") == ""


def test_units_are_printed_as_people_write_them() -> None:
    assert unit_text("N*m*s/rad").replace(GAP, " ") == "N m s/rad"


def test_bars_are_relative_and_bounded() -> None:
    assert "width:110px" in long_bar(0.5, "a<b", chosen=False)
    assert "width:220px" in long_bar(3.0, "", chosen=True)
    assert "width:1px" in long_bar(0.0, "", chosen=False)
    assert "width:1px" in long_bar(float("nan"), "\u2013", chosen=False)
    assert "a&lt;b" in long_bar(0.5, "a<b", chosen=False)
