"""Characters, lines and paper: ink widths, overstrikes, what a reader sees; pages on continuous forms, margins."""

import pytest

from detent.methods.print_head.printed_page import LINE, PAGE, Paper, PrintedCharacter, PrintLine


@pytest.mark.parametrize(
    ("spacing", "ink"), [(0, 12), (1, 12), (5, 12), (6, 6), (10, 10), (12, 12), (13, 12), (48, 12)]
)
def test_ink_is_as_wide_as_a_pitch_and_never_as_wide_as_a_gap(spacing, ink):
    assert PrintedCharacter("a", 0, spacing).ink_columns == ink


def test_paper_sorts_numbers_and_gathers_ink():
    paper = Paper()
    paper.feed(1200)
    paper.strike(PrintedCharacter("z", 5, 12))
    paper.feed(-1168)
    paper.strike(PrintedCharacter("b", 24, 12))
    paper.strike(PrintedCharacter("a", 12, 0))
    paper.strike(PrintedCharacter("a", 12, 11, underline=True))
    paper.strike(PrintedCharacter("a", 12, 12, red=True))
    first, second = paper.lines()
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


# -- paper ---------------------------------------------------------------------------------------------------


def test_feeds_and_pages():
    paper = Paper()
    assert (paper.page, paper.baseline, paper.from_top) == (1, 0, 0)
    assert paper.feed(PAGE - LINE)
    assert (paper.page, paper.from_top) == (1, PAGE - LINE)
    assert paper.feed(LINE)
    assert (paper.page, paper.from_top, paper.baseline) == (2, 0, 528)


def test_a_feed_over_several_pages_reaches_the_last():
    paper = Paper()
    paper.feed(3 * PAGE + 5)
    assert (paper.page, paper.from_top) == (4, 5)


def test_pulling_back_returns_to_the_page_before():
    paper = Paper()
    paper.form_feed()
    assert paper.feed(-LINE)
    assert (paper.page, paper.from_top) == (1, PAGE - LINE)
    paper.form_feed()
    assert (paper.page, paper.place, len(paper.tops)) == (2, PAGE, 2)


def test_the_paper_is_not_pulled_back_beyond_its_top():
    paper = Paper(place=3)
    assert not paper.feed(-4)
    assert paper.place == 0


def test_a_place_below_the_page_is_refused():
    paper = Paper()
    paper.form_feed()
    assert paper.move_to(PAGE - 1)
    assert not paper.move_to(PAGE)
    assert paper.place == 2 * PAGE - 1


def test_a_form_begins_where_it_is_set():
    paper = Paper(place=40, top_margin=5, bottom_margin=50)
    paper.set_form(100)
    assert (paper.page, paper.from_top, paper.top_margin, paper.bottom_margin) == (2, 0, None, None)
    paper.feed(100)
    assert (paper.page, paper.place) == (3, 140)


def test_a_bottom_margin_sends_the_next_line_to_the_next_page():
    paper = Paper(top_margin=10, bottom_margin=100)
    paper.feed(100)
    assert paper.page == 1
    paper.feed(1)
    assert (paper.page, paper.from_top) == (2, 10)
