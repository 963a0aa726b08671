"""Every link inside README.md and docs/ leads somewhere, and every file that the text names exists."""

import re
from urllib.parse import unquote

import pytest
from tests.docs.pages import ROOT, all_pages, anchors_of, inline_code_of, links_of, page_name

PAGES = all_pages()
ELSEWHERE = re.compile(r"(https?://|mailto:)")
# Inline code that names a file of the project, such as `src/detent/errors.py`.
PROJECT_PATH = re.compile(r"(?:src|tests|docs|tools|\.ci)/[\w./-]+")


def test_there_are_pages():
    assert ROOT / "docs" / "index.md" in PAGES


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_links_resolve(page):
    wrong = [f"{page_name(page)}:{line}: {target}" for line, target in links_of(page) if not resolves(page, target)]
    assert not wrong, "these lead nowhere:\n" + "\n".join(wrong)


def resolves(page, target):
    """Tell whether a link leads to a file, or a heading, of the project; links elsewhere only must not be local."""
    if ELSEWHERE.match(target):
        return not re.match(r"https?://(localhost|127\.|\[::1\])", target)
    path, _, anchor = unquote(target).partition("#")
    goal = (page.parent / path).resolve() if path else page
    if not goal.exists() or not goal.is_relative_to(ROOT):
        return False
    return not anchor or goal.suffix != ".md" or anchor in anchors_of(goal)


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_files_named_in_the_text_exist(page):
    named = [(line, text) for line, text in inline_code_of(page) if PROJECT_PATH.fullmatch(text)]
    wrong = [f"{page_name(page)}:{line}: {text}" for line, text in named if not (ROOT / text).exists()]
    # A decision speaks of the project as it was then.
    if "decisions" not in page.parts:
        assert not wrong, "these files do not exist:\n" + "\n".join(wrong)
