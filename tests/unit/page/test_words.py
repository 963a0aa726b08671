import doctest

import pytest

from detent.page import words
from detent.page.words import (
    GAP,
    arrow,
    bar_cell,
    count,
    duration,
    further,
    inches_per_second,
    micrometres,
    number,
    offset_cell,
    table,
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
    assert plain(micrometres(9.61e-6)) == "9.6 µm"
    assert inches_per_second(-1.016) == "40"
    assert inches_per_second(80 / 6 * 0.0254) == "13.3"


def test_a_table_aligns_numbers_and_escapes_its_titles() -> None:
    html = table([("a < b", False), ("n", True)], [("x", "1"), ("<td>own</td>", "2")])
    assert '<th scope="col">a &lt; b</th><th scope="col" class="n">n</th>' in html
    assert '<tr><td>x</td><td class="n">1</td></tr>' in html
    assert '<tr><td>own</td><td class="n">2</td></tr>' in html


def test_a_row_of_the_wrong_length_is_refused() -> None:
    with pytest.raises(ValueError, match="zip"):
        table([("a", False)], [("x", "y")])


def test_directions_have_their_arrow() -> None:
    assert arrow(1) == '<span class="arrow right">→ right</span>'
    assert arrow(-1) == '<span class="arrow left">← left</span>'


def test_what_is_left_out_is_counted() -> None:
    assert plain(further(1, "line")) == "1 further line is"
    assert plain(further(1200, "move")) == "1 200 further moves are"


def test_a_bar_is_as_long_as_its_number_is_large() -> None:
    assert bar_cell(3.0, 6.0) == '<td class="n"><span class="bar" style="width:24px"></span>3</td>'
    assert bar_cell(6.0, 6.0, over=True) == '<td class="n over"><span class="bar" style="width:48px"></span>6</td>'
    assert bar_cell(float("nan"), 6.0) == '<td class="n">–</td>'


def test_an_offset_has_a_bar_for_its_magnitude_and_a_sign() -> None:
    assert plain(offset_cell(3.0, 6.0)) == '<td class="n"><span class="bar" style="width:24px"></span>+3</td>'
    over = '<td class="n over"><span class="bar" style="width:48px"></span>−6</td>'
    assert offset_cell(-6.0, 6.0, over=True) == over
    assert offset_cell(0.0, 6.0) == '<td class="n"><span class="bar" style="width:0px"></span>0</td>'
    assert offset_cell(float("nan"), 6.0) == '<td class="n">–</td>'
