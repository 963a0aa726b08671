"""Characters and lines: ink widths, overstrikes, what a reader sees."""

import pytest

from detent.methods.print_head.printed_page import ByteAccount, PrintedCharacter, PrintLine, Sheet


@pytest.mark.parametrize(
    ("spacing", "ink"), [(0, 12), (1, 12), (5, 12), (6, 6), (10, 10), (12, 12), (13, 12), (48, 12)]
)
def test_ink_is_as_wide_as_a_pitch_and_never_as_wide_as_a_gap(spacing, ink):
    assert PrintedCharacter("a", 0, spacing).ink_columns == ink


def test_a_sheet_sorts_numbers_and_gathers():
    sheet = Sheet()
    sheet.strike(2, 600, PrintedCharacter("z", 5, 12))
    sheet.strike(1, 16, PrintedCharacter("b", 24, 12))
    sheet.strike(1, 16, PrintedCharacter("a", 12, 0))
    sheet.strike(1, 16, PrintedCharacter("a", 12, 11, underline=True))
    sheet.strike(1, 16, PrintedCharacter("a", 12, 12, red=True))
    first, second = sheet.lines()
    assert first == PrintLine(
        1,
        16,
        (
            PrintedCharacter("a", 12, 11, strike=2, underline=True),
            PrintedCharacter("a", 12, 12, red=True),
            PrintedCharacter("b", 24, 12),
        ),
        page=1,
    )
    assert (first.first_column, first.last_column) == (12, 36)
    assert (second.number, second.page, second.baseline) == (2, 2, 600)


def test_the_widest_ink_ends_the_line_even_if_it_is_not_the_last_character():
    line = PrintLine(1, 0, (PrintedCharacter("W", 0, 12), PrintedCharacter("i", 4, 6)))
    assert line.last_column == 12


def test_text_shows_one_letter_per_place_and_gaps_as_blanks():
    columns = [("_", 0), ("a", 0), ("a", 1), ("b", 12), ("c", 24 + 12), ("d", 48 + 24)]
    line = PrintLine(1, 0, tuple(PrintedCharacter(char, column, 12) for char, column in columns))
    assert line.text == "ab c  d"


def test_the_account_adds_up():
    assert ByteAccount(printed=1, interpreted=2, accepted=3, noted=4).total == 10
