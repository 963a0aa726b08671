"""Read the Markdown pages: their code blocks with the marks that precede them, their links, their headings."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from markdown_it import MarkdownIt
from markdown_it.token import Token

ROOT = Path(__file__).resolve().parents[2]
MARK = re.compile(r"<!--\s*([a-z-]+)(?::\s*(.*?))?\s*-->")
HTML_LINK = re.compile(r"""<(?:a|img)\b[^>]*?\b(?:href|src)=["']([^"']+)["']""")


@dataclass(frozen=True)
class Block:
    """A fenced block of a page.

    `language` is the word after the fence; `marks` are the comments `<!-- name: value -->` directly before it.
    """

    page: Path
    line: int
    language: str
    text: str
    marks: dict[str, str] = field(default_factory=dict)

    @property
    def where(self) -> str:
        """Page and line, as an editor opens it."""
        return f"{self.page.relative_to(ROOT)}:{self.line}"


def all_pages() -> list[Path]:
    """README.md and every page below docs/, in a fixed order."""
    pages = [p for p in sorted((ROOT / "docs").rglob("*.md")) if "_build" not in p.parts]
    readme = ROOT / "README.md"
    return [readme, *pages] if readme.exists() else pages


def page_name(page: Path) -> str:
    """The page's path inside the project: the id of its tests."""
    return page.relative_to(ROOT).as_posix()


def blocks_of(page: Path) -> list[Block]:
    """Every fenced block of the page in the order of the text, those inside MyST directives included."""
    return list(_blocks(page, page.read_text(encoding="utf-8"), 0))


def _blocks(page: Path, text: str, first_line: int) -> Iterator[Block]:
    marks: dict[str, str] = {}
    for token in MarkdownIt("commonmark").parse(text):
        if token.type == "html_block":
            marks = {name: value or "" for name, value in MARK.findall(token.content)}
            continue
        if token.type == "fence":
            line = first_line + (token.map or [0])[0] + 1
            language = token.info.strip()
            yield Block(page, line, language, token.content, marks)
            if language.startswith("{"):
                yield from _blocks(page, token.content, line)
        marks = {}


def links_of(page: Path) -> list[tuple[int, str]]:
    """Every link and picture of the page, as (line, target)."""
    found: list[tuple[int, str]] = []
    for token in _walk(MarkdownIt("commonmark").parse(page.read_text(encoding="utf-8"))):
        target = token.attrs.get("href") or token.attrs.get("src")
        if target:
            found.append((token.meta["line"], str(target)))
        if token.type in ("html_block", "html_inline"):
            found += [(token.meta["line"], target) for target in HTML_LINK.findall(token.content)]
    return found


def _walk(tokens: list[Token], line: int = 0) -> Iterator[Token]:
    for token in tokens:
        here = token.map[0] + 1 if token.map else line
        token.meta["line"] = here
        yield token
        yield from _walk(token.children or [], here)


def anchors_of(page: Path) -> set[str]:
    """The anchors that the page's headings and explicit targets `(name)=` make."""
    text = page.read_text(encoding="utf-8")
    tokens = MarkdownIt("commonmark").parse(text)
    headings = [tokens[i + 1].content for i, token in enumerate(tokens) if token.type == "heading_open"]
    anchors: set[str] = set()
    for heading in headings:
        slug = re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")
        repeats = sum(1 for a in anchors if re.fullmatch(re.escape(slug) + r"(-\d+)?", a))
        anchors.add(f"{slug}-{repeats}" if repeats else slug)
    return anchors | set(re.findall(r"^\(([\w-]+)\)=$", text, flags=re.MULTILINE))


def inline_code_of(page: Path) -> list[tuple[int, str]]:
    """Every piece of `code` inside the running text, as (line, text)."""
    tokens = _walk(MarkdownIt("commonmark").parse(page.read_text(encoding="utf-8")))
    return [(token.meta["line"], token.content) for token in tokens if token.type == "code_inline"]
