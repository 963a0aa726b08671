import re
from importlib import resources
from pathlib import Path

import pytest
from tests.page_reader import Reader, charts_of, paper_of

import detent
from detent.errors import DetentError
from detent.page import page
from detent.page.page import Card, Page
from detent.page.parts import Event, Note

CHART = {"id": "a", "x": [0], "xLabel": "t </script> \u2028 [s]", "series": []}


@pytest.fixture
def parts() -> Page:
    return {"title": "run <1> of $title", "body": ["<p>first</p>", "", "<p>$data</p>"], "charts": [CHART]}


def test_a_page_is_one_document_with_its_parts_in_order(parts: Page) -> None:
    html = page.render_page(parts)
    reader = Reader(html)
    assert reader.open == []
    assert "<title>run &lt;1&gt; of $title</title>" in html
    assert "<p>first</p>\n<p>$data</p>\n<footer>" in html
    assert "This file is complete: it loads nothing." in reader.text


def test_the_page_carries_the_charts_whatever_they_say(parts: Page) -> None:
    html = page.render_page(parts)
    assert charts_of(html) == [CHART]
    assert Reader(html).open == []
    assert "\u2028" not in html


def test_paper_and_what_draws_it_are_there_only_for_what_was_printed(parts: Page) -> None:
    without = page.render_page(parts)
    assert paper_of(without) is None
    assert "drawPaper" not in without
    with_paper = page.render_page(parts | {"paper": {"pages": ["</script>"]}})
    assert paper_of(with_paper) == {"pages": ["</script>"]}
    assert "drawPaper" in with_paper
    assert page.render_page(parts | {"paper": None}) == without


def test_the_page_names_the_version_that_wrote_it(parts: Page) -> None:
    assert f"Written by detent {detent.__version__}." in page.render_page(parts)
    other = page.render_page(parts | {"version": "9.<9>"})
    assert 'content="detent 9.&lt;9&gt;"' in other
    assert "Written by detent 9.&lt;9&gt;." in other


def test_the_page_fetches_nothing_and_forbids_it(parts: Page) -> None:
    html = page.render_page(parts | {"paper": {"pages": []}})
    assert Reader(html).fetched == []
    assert "Content-Security-Policy\" content=\"default-src 'none'" in html
    assert not re.search(r"@import|url\(|\bfetch\(|XMLHttpRequest", html)


def test_the_vendored_library_carries_its_licence(parts: Page) -> None:
    vendor = resources.files("detent.page").joinpath("vendor")
    assert "MIT License" in vendor.joinpath("uPlot-LICENSE").read_text(encoding="utf-8")
    assert "uPlot (v1.6.32)" in page.render_page(parts)


def test_a_page_replaces_the_one_before_and_leaves_nothing_beside_it(parts: Page, tmp_path: Path) -> None:
    target = tmp_path / "a.html"
    target.write_text("before", encoding="utf-8")
    page.write_page(target, parts)
    assert target.read_text(encoding="utf-8") == page.render_page(parts)
    assert list(tmp_path.iterdir()) == [target]


def test_a_folder_that_is_not_there_is_said(parts: Page, tmp_path: Path) -> None:
    with pytest.raises(DetentError, match=r"nowhere.*cannot be written \(No such file or directory\); choose another"):
        page.write_page(tmp_path / "nowhere" / "a.html", parts)


@pytest.mark.parametrize(("level", "sign"), [("good", "✔"), ("warn", "!"), ("bad", "✘")])
def test_the_headline_has_a_badge_and_takes_text(level: str, sign: str) -> None:
    html = page.headline(level, "Moved & held", "<b>", kicker="axis <a>", lead="1 < 2")
    assert f'<span class="badge {level}">' in html
    assert Reader(html).text == f"axis <a> {sign} Moved & held <b> 1 < 2"


def test_cards_stand_in_order_and_a_bad_one_shows() -> None:
    html = page.cards([Card("Moves", "12", "of 12", "1 < 2"), Card("Worst", "9", "µm", "allowed 6 µm", bad=True)])
    assert Reader(html).text == "Moves12 of 121 < 2Worst9 µmallowed 6 µm"
    assert html.index('class="card"') < html.index('class="card bad"')


def test_errors_come_before_warnings_and_notes() -> None:
    told = [Note("note", "n"), Note("warning", "w <1>"), Note("error", "e")]
    assert Reader(page.notes(told)).text == "Errore Warningw <1> Noten"
    assert page.notes([]) == ""


def test_a_section_is_its_figures_or_nothing() -> None:
    inside = page.figure("a < b", "see <b>here</b>", page.chart_slot("x", "a < b"), page.ZOOM_HINT)
    html = page.section("Moves & stops", "", inside)
    reader = Reader(html)
    assert reader.open == []
    assert reader.ids == ["x"]
    assert html.startswith("<h2>Moves &amp; stops</h2>\n<figure>")
    assert "a < bsee here" in reader.text
    assert page.section("nothing", "", "") == page.section("nothing") == ""


def test_charts_stand_side_by_side_with_their_titles() -> None:
    html = page.side_by_side({"a < b": page.chart_slot("l", "left"), "c": page.chart_slot("r", "right")})
    assert Reader(html).text == "a < bc"
    assert Reader(html).ids == ["l", "r"]


def cells_of(html: str) -> list[list[str]]:
    rows = re.findall(r"<tr>(.*?)</tr>", html, flags=re.DOTALL)
    return [[Reader(cell).text for cell in re.findall(r"<t[hd].*?</t[hd]>", row, flags=re.DOTALL)] for row in rows]


def test_events_are_numbered_and_timed_as_in_their_figure() -> None:
    events = [Event(0.0123, "stop <begins>", -12), Event(1.5, "at rest")]
    assert cells_of(page.event_table(events)) == [
        ["", "time [ms]", "what happens", "drive after [count]"],
        ["1", "12.3", "stop <begins>", "−12"],
        ["2", "1500.0", "at rest", ""],
    ]
    assert page.event_table([]) == ""


def test_events_without_a_drive_have_no_column_for_it() -> None:
    assert cells_of(page.event_table([Event(0.0123, "at rest")], "s")) == [
        ["", "time [s]", "what happens"],
        ["1", "0.012", "at rest"],
    ]


def test_the_small_print_is_text_or_nothing() -> None:
    html = page.small_print({"axis file": "<a>.toml", "seed": "7"})
    assert Reader(html).text == "How this run was made axis file<a>.tomlseed7"
    assert page.small_print({}) == ""
