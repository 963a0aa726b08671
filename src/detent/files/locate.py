"""Where each key of a TOML text stands: line and column, and the value as written.

The values themselves come from the standard library's parser; only the places come from the syntax tree, so a key this
module fails to find costs a column in a message, never a value.
"""

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tree_sitter import Node, Parser

Path = tuple[str, ...]

_TABLES = {"table", "table_array_element"}
_KEYS = {"bare_key", "quoted_key", "dotted_key"}


class Index(str):
    """Number of a table in a list of tables, as part of a path; messages leave it out, for they tell the line."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class Place:
    """Where a key stands."""

    line: int  # and column: of the key's first character, from 1; columns count characters
    column: int
    text: str  # the value as written, or the header of a table


def locate_keys(text: str) -> dict[Path, Place]:
    """Find every key and table header of a TOML text."""
    source = text.encode()
    places: dict[Path, Place] = {}
    for path, key, value in _walk(_parser().parse(source).root_node, ()):
        line_start = source.rfind(b"\n", 0, key.start_byte) + 1
        column = len(source[line_start : key.start_byte].decode(errors="replace"))  # in characters
        place = Place(key.start_point[0] + 1, column + 1, (value.text or b"").decode(errors="replace"))
        places.setdefault(path, place)
    return places


def find_place(places: dict[Path, Place], path: Path) -> Place:
    """Place of a key, or of what stands nearest to it: something inside it, then the tables around it."""
    if path in places:
        return places[path]
    for length in range(len(path), 0, -1):
        inside = [place for known, place in places.items() if known[:length] == path[:length]]
        if inside:
            return min(inside, key=lambda place: (place.line, place.column))
    return places.get((), Place(1, 1, ""))


@cache
def _parser() -> "Parser":
    """Make the parser once."""
    import tree_sitter_toml
    from tree_sitter import Language, Parser

    return Parser(Language(tree_sitter_toml.language()))


def _walk(node: "Node", prefix: Path) -> "Iterator[tuple[Path, Node, Node]]":
    """Walk all keys below a node: (path, node of the key, node of the value or of the header)."""
    last: dict[Path, int] = {}  # of each list of tables, the number of its last one
    for child in node.named_children:
        key = next((part for part in child.named_children if part.type in _KEYS), None)
        if child.type in _TABLES and key is not None:
            *around, name = _key_parts(key)
            path = (*_inside(tuple(around), last), name)
            if child.type == "table_array_element":
                yield path, child, key
                last[path] = last.get(path, -1) + 1
            path = _inside((name,), last, path[:-1])
            yield path, child, key
            yield from _walk(child, path)
        elif child.type == "pair" and key is not None:
            yield from _walk_pair(child, key, prefix)
        elif child.type == "ERROR":
            yield from _walk(child, prefix)


def _walk_pair(pair: "Node", key: "Node", prefix: Path) -> "Iterator[tuple[Path, Node, Node]]":
    """Walk one ``key = value`` and what an inline table holds."""
    path = (*prefix, *_key_parts(key))
    value = next((part for part in pair.named_children if part.type not in _KEYS), None)
    if value is None:
        return
    yield path, key, value
    if value.type == "inline_table":
        yield from _walk(value, path)
    elif value.type == "array":
        elements = [part for part in value.named_children if part.type != "comment"]
        for number, table in enumerate(elements):
            if table.type == "inline_table":
                yield (*path, Index(number)), table, table
                yield from _walk(table, (*path, Index(number)))


def _inside(path: Path, last: dict[Path, int], done: Path = ()) -> Path:
    """A path with the number of the last table of each list that it goes through."""
    for part in path:
        done = (*done, part)
        if done in last:
            done = (*done, Index(last[done]))
    return done


def _key_parts(key: "Node") -> Path:
    """Split a key into its parts, quotes removed."""
    if key.type == "dotted_key":
        return tuple(part for child in key.named_children for part in _key_parts(child))
    text = (key.text or b"").decode(errors="replace")
    if key.type == "quoted_key":
        try:
            return (str(tomllib.loads(f"key = {text}")["key"]),)
        except tomllib.TOMLDecodeError:
            return (text,)
    return (text,)
