"""Paper: places in 1/96 inch, pages on continuous forms, margins."""

from detent.methods.print_head.paper import LINE, PAGE, Paper


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
