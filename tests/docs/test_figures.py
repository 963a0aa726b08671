"""The figures of the documentation: committed, small, each on a page; only what looks different is replaced."""

import re

import pytest
from PIL import Image, ImageDraw, ImageFilter
from tests.docs.pages import ROOT, all_pages

FOLDER = ROOT / "docs" / "_static" / "figures"
MOST_BYTES = 1_200_000  # of all figures together


@pytest.fixture
def draw(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "docs")
    import draw

    return draw


def test_every_figure_is_there_and_on_a_page():
    pages = "".join(page.read_text(encoding="utf-8") for page in all_pages())
    shown = set(re.findall(r"_static/figures/([\w-]+\.png)", pages))
    assert shown == {kept.name for kept in FOLDER.glob("*.png")}
    assert len(shown) > 35


def test_all_figures_together_are_small():
    assert 100_000 < sum(kept.stat().st_size for kept in FOLDER.iterdir()) < MOST_BYTES


def test_no_page_shows_what_only_a_build_makes():
    pages = [page for page in all_pages() if re.search(r"\{figure\}.*_build", page.read_text(encoding="utf-8"))]
    assert pages == []


def picture(x: int = 300) -> Image.Image:
    """A line that begins at x."""
    drawn = Image.new("RGB", (1275, 400), "white")
    ImageDraw.Draw(drawn).line((x, 50, x + 400, 350), (0, 114, 178), 3)
    return drawn


def test_only_what_looks_different_is_replaced(draw, tmp_path):
    drawn, kept = tmp_path / "drawn", tmp_path / "kept"
    drawn.mkdir()
    kept.mkdir()
    for name in ("same", "soft", "moved"):
        picture().save(drawn / f"{name}.png")
    assert {path.stem for path in draw.keep(sorted(drawn.iterdir()), kept)} == {"same", "soft", "moved"}
    before = {path.stem: path.read_bytes() for path in kept.iterdir()}
    soft = picture().filter(ImageFilter.GaussianBlur(0.5))  # as another machine may smooth its lines
    soft.save(drawn / "soft.png")
    picture(x=308).save(drawn / "moved.png")
    assert [path.stem for path in draw.keep(sorted(drawn.iterdir()), kept)] == ["moved"]
    after = {path.stem: path.read_bytes() for path in kept.iterdir()}
    assert {name for name, found in after.items() if found != before[name]} == {"moved"}
    (drawn / "same.png").unlink()
    assert [path.stem for path in draw.keep(sorted(drawn.iterdir()), kept)] == ["same"]
    assert not (kept / "same.png").exists()
