import re
from dataclasses import replace
from importlib import resources
from pathlib import Path

import pytest
from tests.page_reader import Reader, charts_of, paper_of
from tests.unit.page.samples import page, plain_chart

import detent
from detent.errors import DetentError
from detent.page.figure import Figure
from detent.page.frame import Page, Section
from detent.page.render import render_page, write_page

PAPER = {"pages": [{"lines": []}, {"text": "</script>"}], "magnify": 20, "leftOut": 2}


def of(*figures: Figure) -> Page:
    return replace(page(), sections=[Section("One", figures)])


def test_a_page_is_one_document_with_its_parts_in_order() -> None:
    html = render_page(page())
    reader = Reader(html)
    assert reader.open == []
    assert "<title>run &lt;1&gt; of $title</title>" in html
    order = ["axis <a>", "! Moved & held", "<b>", "1 < 2", "Moves", "Worst", "Errore", "Warningw <1>", "Noten"]
    order += ["Moves & stops", "Speed < drive", "Two", "Loops", "Cells", "Drawn", "axis file<a>.tomlseed7"]
    places = [reader.text.find(text) for text in order]
    assert -1 not in places
    assert places == sorted(places)


def test_what_shows_nothing_leaves_no_trace() -> None:
    text = Reader(render_page(page())).text
    assert "Nothing" not in text
    assert "Empty" not in text
    bare = render_page(replace(page(), cards=(), notes=(), sections=(), settings={}))
    assert not re.search(
        r'class="(card|note|settings|chart)\b|<h2', bare.partition("<main>")[2].partition("<footer>")[0]
    )


def test_every_chart_has_its_place_and_says_what_it_shows() -> None:
    html = render_page(page())
    ids = [chart["id"] for chart in charts_of(html)]
    assert ids == ["speed", "drive", "heaps", "lanes", "loops"]
    assert [name for name in Reader(html).ids if name in ids] == ids
    labels = re.findall(r'role="img" aria-label="([^"]*)"', html)
    assert labels[:3] == ["speed [mm/s] over time [ms]", "the drive &lt;word&gt;", "moves over off [µm]"]
    assert html.index('class="pair"') < html.index('id="heaps"')
    assert re.findall(r'class="chart-title">([^<]*)<', html) == ["below", "a &lt; b"]


def test_the_page_carries_the_charts_whatever_they_say() -> None:
    chart = plain_chart("a") | {"xLabel": "t </script> \u2028 [s]"}
    html = render_page(of(Figure(title="a", charts=[chart | {"about": "a"}])))
    assert charts_of(html) == [chart | {"xLabel": "t </script> \\u2028 [s]"}]
    assert Reader(html).open == []
    assert "\u2028" not in html


def test_cells_are_text_with_bars_marks_and_limits() -> None:
    html = render_page(page())
    rows = re.findall(r"<tr>(.*?)</tr>", html, flags=re.DOTALL)[-2:]
    assert [Reader(row).text for row in rows] == ["<a> & b7−3→ right 3 <mm>", "jog3+6bold"]
    assert '<td class="n over">7</td>' in rows[0]
    assert '<td class="n"><span class="bar" style="width:24px"></span>−3</td>' in rows[0]
    assert '<td><span class="bar" style="width:8px;background:var(--right)"></span>jog</td>' in rows[1]
    assert "<b>bold</b>" in rows[1]


def test_paper_and_what_draws_it_are_there_only_for_what_was_printed() -> None:
    without = render_page(page())
    assert paper_of(without) is None
    assert "drawPaper" not in without
    printed = render_page(of(Figure(title="The text", caption="each & every", paper=PAPER)))
    assert paper_of(printed) == PAPER
    assert "drawPaper" in printed
    assert {"paper", "true-size", "magnified", "page-back", "page-next", "page-label"} <= set(Reader(printed).ids)
    assert "2 further pages are not drawn" in Reader(printed).text
    single = render_page(of(Figure(title="The text", paper=PAPER | {"pages": [{"lines": []}], "leftOut": 0})))
    assert not {"page-back", "page-next"} & set(Reader(single).ids)


def test_the_page_names_the_version_that_wrote_it() -> None:
    html = render_page(page())
    assert f"Written by detent {detent.__version__}." in html
    assert f'content="detent {detent.__version__}"' in html


def test_the_page_fetches_nothing_and_forbids_it() -> None:
    html = render_page(of(Figure(title="The text", paper=PAPER)))
    assert Reader(html).fetched == []
    assert "Content-Security-Policy\" content=\"default-src 'none'" in html
    assert not re.search(r"@import|url\(|\bfetch\(|XMLHttpRequest", html)


def test_the_vendored_library_carries_its_licence() -> None:
    vendor = resources.files("detent.page").joinpath("vendor")
    assert "MIT License" in vendor.joinpath("uPlot-LICENSE").read_text(encoding="utf-8")
    assert "uPlot (v1.6.32)" in render_page(page())


def test_a_page_replaces_the_one_before_and_leaves_nothing_beside_it(tmp_path: Path) -> None:
    target = tmp_path / "a.html"
    write_page(target, replace(page(), title="before"))
    write_page(target, page())
    assert target.read_text(encoding="utf-8") == render_page(page())
    assert list(tmp_path.iterdir()) == [target]


def test_a_folder_that_is_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(DetentError, match=r"nowhere.*cannot be written \(No such file or directory\)"):
        write_page(tmp_path / "nowhere" / "a.html", page())


def test_nothing_on_a_page_steers_who_reads_it() -> None:
    """Escape, codes above 127 and marks that turn the order of reading came through raw from names in files."""
    name = "a\x1b[2J\x9b\u202eb"
    chart = plain_chart("a") | {"about": name}
    html = render_page(replace(of(Figure(title=name, charts=[chart])), title=name))
    assert not re.search("[\0-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]", html)
    assert "a\\x1b[2J\\x9b\\u202eb" in html
    charts_of(html)
