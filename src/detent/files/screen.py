"""What an object says of itself at a prompt, in one screen, and in a notebook: a sentence and tables."""

import dataclasses
from collections.abc import Sequence
from html import escape
from textwrap import wrap
from typing import Any, NamedTuple, cast

from detent.files.text import shown

LINES = 36  # of a screen, at most
WIDTH = 110  # of a line, at most [characters]
MOST_IN_NOTEBOOK = 500  # rows of a table there, which scrolls
_WHOLE = 48  # characters of a value up to which it is shown as it is


class Block(NamedTuple):
    """A table: its title, heads of its columns (none: no line of heads), rows; `most` of these fit the screen."""

    title: str
    heads: Sequence[str]
    rows: Sequence[Sequence[str]]
    most: int = 16
    more: str = ""  # where the others are found


class Screen(NamedTuple):
    """A sentence, tables, and what to type next."""

    title: str
    blocks: Sequence[Block] = ()
    foot: str = ""

    @property
    def text(self) -> str:
        """Lines for a prompt."""
        lines = [part for line in self.title.split("\n") for part in wrap(shown(line), WIDTH, subsequent_indent="  ")]
        lines = lines[: LINES // 2]
        room = LINES - len(lines) - (2 if self.foot else 0)
        for block in self.blocks:
            made = _lines(block, room)
            lines += made
            room -= len(made)
        lines += ["", self.foot] if self.foot else []
        return "\n".join(line if len(line) <= WIDTH else f"{line[: WIDTH - 3]}..." for line in lines)

    @property
    def html(self) -> str:
        """Tables for a notebook."""
        title, *rest = self.title.split("\n")
        parts = [f"<p><b>{escape(shown(title))}</b></p>", *(f"<p>{escape(shown(line))}</p>" for line in rest)]
        parts += [_table(block) for block in self.blocks if block.rows]
        return "".join([*parts, f"<p><code>{escape(self.foot)}</code></p>" if self.foot else ""])


def _lines(block: Block, room: int) -> list[str]:
    """A table in so many lines at most."""
    heads = [list(block.heads)] if block.heads else []
    room = min(block.most, room - 2 - len(heads) - bool(block.title))  # an empty line, and what is left out
    if not block.rows or room < 1:
        return []
    rows = [[shown(cell) for cell in row] for row in block.rows[:room]]
    widths = [max(len(row[k]) for row in [*heads, *rows]) for k in range(len(rows[0]))]
    told = [
        "  " + "  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in heads + rows
    ]
    left = len(block.rows) - len(rows)
    told += [f"  ... {left} more{f': {block.more}' if block.more else ''}"] if left else []
    return ["", *([block.title] if block.title else []), *told]


def _table(block: Block) -> str:
    rows = "".join(_row(row, "td") for row in block.rows[:MOST_IN_NOTEBOOK])
    left = len(block.rows) - MOST_IN_NOTEBOOK
    more = f"<p>... {left} more{f': {block.more}' if block.more else ''}</p>" if left > 0 else ""
    heads = f"<thead>{_row(block.heads, 'th')}</thead>" if block.heads else ""
    table = f"<table>{heads}<tbody>{rows}</tbody></table>{more}"
    if block.most:
        return f"<p>{escape(shown(block.title))}</p>{table}"
    # What has no place on a screen is folded in a notebook.
    return f"<details><summary>{escape(shown(block.title))}</summary>{table}</details>"


def _row(cells: Sequence[str], kind: str) -> str:
    inside = "".join(f'<{kind} style="text-align: left">{escape(shown(cell))}</{kind}>' for cell in cells)
    return f"<tr>{inside}</tr>"


class OnScreen:
    """Shows itself as its `screen`; a dataclass of this kind is declared with ``repr=False``."""

    __slots__ = ()

    def screen(self) -> Screen:
        """Its fields, what is long by kind and number."""
        me: Any = self
        rows = [(field.name, brief(getattr(me, field.name))) for field in dataclasses.fields(me) if field.repr]
        return Screen(type(self).__name__, [Block("", (), rows, LINES)])

    def __repr__(self) -> str:
        return self.screen().text

    def _repr_html_(self) -> str:
        return self.screen().html


def brief(value: object) -> str:
    """A value in a few words.

    >>> brief(0.25), brief(list(range(100))), brief({})
    ('0.25', '100 int', '{}')
    """
    shape = getattr(value, "shape", None)
    if isinstance(shape, tuple):
        dtype: Any = getattr(value, "dtype", "")
        return f"{dtype} array, shape {shape}"
    if isinstance(value, str | int | float | None):
        return repr(value)
    if isinstance(value, OnScreen):
        return value.screen().title.partition("\n")[0]
    if isinstance(value, list | tuple | dict | set | frozenset):
        held = cast("Any", value)
        items: list[Any] = list(held.values() if isinstance(value, dict) else held)
        is_plain = all(isinstance(item, str | int | float | None) for item in items)
        text = repr(held) if is_plain else ""
        if not items or 0 < len(text) <= _WHOLE:
            return text
        kinds = sorted({type(item).__name__ for item in items})
        return f"{len(items)} {' or '.join(kinds)}"
    text = repr(value)
    return text if len(text) <= _WHOLE and "\n" not in text else type(value).__name__
