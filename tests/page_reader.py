"""Reads a report's page as a browser and a person would."""

import json
import re
from html.parser import HTMLParser
from typing import Any

from detent.page.words import GAP

VOID = {"meta", "br", "link", "img", "input", "hr"}


class Reader(HTMLParser):
    """Collects text, ids and outside references, and checks that every element is closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.open: list[str] = []
        self.words: list[str] = []
        self.fetched: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name == "id":
                self.ids.append(value or "")
            if name in {"src", "href", "srcset", "data"}:
                self.fetched.append(value or "")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if not {"script", "style"} & set(self.open):
            self.words.append(data)

    @property
    def text(self) -> str:
        """What is read, with single plain spaces."""
        return re.sub(r"\s+", " ", "".join(self.words).replace(GAP, " "))


def charts_of(text: str) -> list[dict[str, Any]]:
    """The charts that the page draws."""
    return _embedded(text, "report-data")["charts"]


def paper_of(text: str) -> dict[str, Any] | None:
    """The printed page that the page draws."""
    return _embedded(text, "paper-data") if 'id="paper-data"' in text else None


def _embedded(text: str, name: str) -> dict[str, Any]:
    pattern = rf'<script type="application/json" id="{name}">(.*?)</script>'
    (found,) = re.findall(pattern, text, flags=re.DOTALL)
    return json.loads(found)
