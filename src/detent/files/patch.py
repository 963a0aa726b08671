"""Values put into a file that somebody wrote: all else of it stays, to the byte.

tomlkit puts a value in the place of another. A key that the file does not have yet becomes a line of its own, behind
the last key of its table: tomlkit would put it behind the comments above the next one.
"""

import re
import tomllib
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple, cast

from detent.errors import InputError
from detent.files.locate import Path, Place, locate_keys
from detent.files.overrides import put_value
from detent.files.problems import dotted
from detent.files.text import lines_of
from detent.units import format_quantity, in_unit_of

DIGITS = 6  # of a value
TOLERANCE = "tolerance"  # the table whose keys name those of other tables
_NOTE = re.compile(r"(?:^#|;) (?:identified|tuned)(, .*? before)?: .*$")  # what an earlier time said of a value


class NewValue(NamedTuple):
    """A number for a key of a file."""

    key: str  # dotted
    value: float  # in `unit`; a pure number where that is empty
    unit: str  # SI unit
    note: str  # what is said of it in a comment
    by: str = "identified"  # or "tuned": where it comes from
    text: str = ""  # as it is written, where it is no number
    exact: bool = False  # in the SI unit, with all digits: what is read again has the same bits

    def path(self, tables: Mapping[str, Any]) -> Path:
        """The key as a file has it: a key of the table of tolerances stands in quotes, unless in tables of its own."""
        whole = tuple(self.key.split("."))
        inside: Any = tables
        for part in whole:
            inside = cast("dict[str, Any]", inside).get(part) if isinstance(inside, dict) else None
        return whole if whole[0] != TOLERANCE or inside is not None else (TOLERANCE, ".".join(whole[1:]))


class Change(NamedTuple):
    """What became of a key.

    Attributes
    ----------
    key : str
        Dotted key.
    before : str
        The value as it was written; empty where the file did not have it.
    after : str
        As it is written now.
    """

    key: str
    before: str
    after: str

    def __str__(self) -> str:
        """Give it as one line."""
        return f"{self.key}: {self.before or 'not stated'} -> {self.after}"


def patch(text: str, values: Iterable[NewValue], file: str) -> tuple[str, list[Change]]:
    """Put values into a text, in the units it has there, and say what changed.

    What is said of a value goes behind it, behind the comment that stands there already. Inside of a table in one line
    there is no room for it.
    """
    from tomlkit.exceptions import TOMLKitError

    order = "\ufeff" if text.startswith("\ufeff") else ""
    text = text.removeprefix(order)
    made, changes, fits = "", list[Change](), False
    try:
        wanted = tomllib.loads(text)
        placed = [(value.path(wanted), value) for value in values]
        made, changes = _put_all(text, placed)
        for (path, _), change in zip(placed, changes, strict=True):
            put_value(wanted, path, tomllib.loads(f"value = {change.after}")["value"])
        fits = tomllib.loads(made) == wanted
    except (TOMLKitError, ValueError):
        pass
    if not fits:
        raise InputError.of_file(
            file, "an order of tables that no values can be put into", "each table before those inside it",
            "put [a] before [a.b], and each table in one place; or name a new file, which gets an order of its own",
        )  # fmt: skip
    return order + made, [change for change in changes if change.before != change.after]


def _put_all(text: str, values: Iterable[tuple[Path, NewValue]]) -> tuple[str, list[Change]]:
    """A text with values, and what became of each key; ValueError where tomlkit would change more than these."""
    import tomlkit

    document, changes, lines = tomlkit.parse(text), list[Change](), list[tuple[Path, str]]()
    if document.as_string() != text:
        raise ValueError(text)
    for path, value in values:
        change, line = _put(document, path, value)
        changes.append(change)
        lines += [(path, line)] if line else []
    text = document.as_string()
    for path, line in lines:
        text = _add(text, path, line)
    return text, changes


def _put(document: Any, path: Path, value: NewValue) -> tuple[Change, str]:
    """Replace a value, or add it to a table in one line; else the line to be added for it."""
    from tomlkit import inline_table
    from tomlkit import value as item_of
    from tomlkit.items import InlineTable

    table: Any = document
    in_line = False
    for part in path[:-1]:
        if part not in table:
            if not in_line:
                return _new(value)
            table.append(part, inline_table())
        table = table[part]
        in_line = in_line or isinstance(table, InlineTable)
    old: Any = cast("Any", table).get(path[-1])
    if old is None and not in_line:
        return _new(value)
    before = "" if old is None else old.as_string()
    change = Change(value.key, before, _written(value, old))
    item = item_of(change.after)
    if old is not None and not in_line:
        item.trivia.comment_ws = old.trivia.comment_ws or "  "
        item.trivia.comment = _comment(old, change, value)
    table[path[-1]] = item
    return change, ""


def _comment(old: Any, change: Change, value: NewValue) -> str:
    """What stood behind a value, then what is said of the new one; not what was said of the old one."""
    noted = _NOTE.search(old.trivia.comment)
    kept = _NOTE.sub("", old.trivia.comment)
    was = f", {' '.join(str(old).split()) if isinstance(old, str) else change.before} before"
    if change.before == change.after:
        was = (noted and noted[1]) or ""
    return f"{kept}{';' if kept else '#'} {value.by}{was}: {value.note}"


def _new(value: NewValue) -> tuple[Change, str]:
    """A value that a file does not have, and what stands behind its key."""
    written = _written(value, None)
    return Change(value.key, "", written), f"{written}  # {value.by}: {value.note}"


def _written(value: NewValue, old: Any) -> str:
    """A value as it is written in a file: in the unit and the quotes of the old one."""
    if value.text:
        return value.text
    if value.exact:
        return f'"{value.value!r} {value.unit}"' if value.unit else repr(value.value)
    if not value.unit:
        return f"{value.value:.{DIGITS}g}"
    if not isinstance(old, str):
        return f'"{format_quantity(value.value, value.unit, DIGITS)}"'
    quote = "'" if old.as_string().startswith("'") else '"'  # type: ignore[attr-defined] - of tomlkit
    return f"{quote}{in_unit_of(value.value, value.unit, old, DIGITS)}{quote}"


# ---- lines


def _add(text: str, path: Path, line: str) -> str:
    """A text with a new key: below the others of its table, or with its table at the end."""
    newline = "\r\n" if "\r\n" in text else "\n"
    lines, places = text.split("\n"), locate_keys("\n".join(lines_of(text)))
    headers = {place.line: known for known, place in places.items() if lines[place.line - 1].lstrip().startswith("[")}
    around = next(path[:length] for length in range(len(path) - 1, -1, -1) if _has_header(path[:length], headers))
    begin = next((row for row, known in headers.items() if known == around), 0)
    end = min((row for row in headers if row > begin), default=len(lines) + 1)
    inside = {known: place for known, place in places.items() if begin < place.line < end}
    own = path[len(around) :]
    is_dotted = any(known[: len(around) + 1] == path[: len(around) + 1] for known in inside)
    if len(own) > 1 and not is_dotted:
        return f"{text.rstrip()}{newline}{newline}[{dotted(path[:-1])}]{newline}{dotted(path[-1:])} = {line}{newline}"
    head = next((row for row, one in enumerate(lines) if not one.startswith("#")), len(lines))
    row = max([begin or head, *(place.line + place.text.count("\n") for place in inside.values())])
    lines.insert(row, f"{_indent(lines, inside)}{dotted(own)} = {line}")
    ended = row if row < len(lines) - 1 else row - 1  # of both lines the one that gets an end
    lines[ended] += newline.removesuffix("\n")
    return "\n".join(lines)


def _has_header(path: Path, headers: dict[int, Path]) -> bool:
    return not path or path in headers.values()


def _indent(lines: list[str], inside: dict[Path, Place]) -> str:
    """What stands before the keys of a table."""
    first = min((place.line for place in inside.values()), default=0)
    return re.match(r"[ \t]*", lines[first - 1])[0] if first else ""  # type: ignore[index] - it always matches
