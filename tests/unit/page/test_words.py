import doctest

import pytest

from detent.page import words
from detent.page.words import (
    GAP,
    arrow,
    count,
    duration,
    further,
    inches_per_second,
    number,
)


def plain(text: str) -> str:
    return text.replace(GAP, " ")


def test_the_examples_in_the_docstrings_hold() -> None:
    assert doctest.testmod(words).failed == 0


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (0.0, 3, "0"), (40.0, 3, "40"), (-60.0, 3, "−60"), (0.6382, 3, "0.638"), (9.996, 3, "10.0"),
        (1e-9, 2, "0.0000000010"), (212.6, 2, "213"), (-0.5, 2, "−0.50"), (None, 3, "–"), (float("nan"), 3, "–"),
    ],
)  # fmt: skip
def test_numbers_have_so_many_digits_and_no_exponent(value: float | None, digits: int, text: str) -> None:
    assert number(value, digits) == text


@pytest.mark.parametrize(
    ("value", "text"), [(0, "0 lines"), (1, "1 line"), (999, "999 lines"), (1234567, "1 234 567 lines")]
)
def test_counts_take_the_plural(value: int, text: str) -> None:
    assert plain(count(value, "line")) == text


def test_an_irregular_plural_can_be_given() -> None:
    assert plain(count(2, "pass", "passes")) == "2 passes"


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.0, "0 s"), (99.94, "99.9 s"), (99.95, "1 min 40 s"), (3599.4, "59 min 59 s"), (3599.5, "1 h 00 min")],
)
def test_durations_change_their_unit_without_a_gap(seconds: float, text: str) -> None:
    assert plain(duration(seconds)) == text


def test_lengths_and_speeds_come_in_the_units_of_the_trade() -> None:
    assert inches_per_second(-1.016) == "40"
    assert inches_per_second(80 / 6 * 0.0254) == "13.3"


def test_directions_have_their_arrow() -> None:
    assert arrow(1) == '<span class="arrow right">→ right</span>'
    assert arrow(-1) == '<span class="arrow left">← left</span>'


def test_what_is_left_out_is_counted() -> None:
    assert plain(further(1, "line")) == "1 further line is"
    assert plain(further(1200, "move")) == "1 200 further moves are"
