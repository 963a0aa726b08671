"""Numbers put into the text of an axis file: its comments, its order and all else that it says stay as they are."""

from collections.abc import Iterable

from detent.errors import InputError
from detent.files.locate import Path, Place, locate_keys
from detent.identify.write.file_numbers import Number


def patch(text: str, numbers: Iterable[Number], file: str) -> str:
    """Put numbers into an axis file.

    A number that the file states is replaced where it stands, and what is said of it goes into a comment: behind it, or
    into a line of its own above where there is a comment already. A number that it does not state is added to its
    table.
    """
    newline = "\r\n" if "\r\n" in text else "\n"
    lines = text.split(newline)
    for number in numbers:
        path = tuple(number.key.split("."))
        # Every number moves the lines below it.
        places = locate_keys("\n".join(lines))
        if path in places:
            _replace(lines, places[path], number)
        else:
            _add(lines, places, path, number, file)
    return newline.join(lines)


def _replace(lines: list[str], place: Place, number: Number) -> None:
    """Put a number in the place of another."""
    row = place.line - 1
    line = lines[row]
    begin = line.index(place.text, line.index("=", place.column - 1))
    head, tail = line[:begin], line[begin + len(place.text) :]
    lines[row] = f"{head}{number.text}{tail}"
    if tail.strip():
        indent = line[: len(line) - len(line.lstrip())]
        was = "" if place.text == number.text else f"{place.text.strip(chr(34))} before; "
        lines.insert(row, f"{indent}# {was}{number.note}")
    else:
        lines[row] += f"  # {number.note}"


def _add(lines: list[str], places: dict[Path, Place], path: Path, number: Number, file: str) -> None:
    """Add a number to its table, or the table too."""
    table, said = path[:-1], f"{path[-1]} = {number.text}  # {number.note}"
    keys = [place.line for known, place in places.items() if known[:-1] == table]
    keys = [line for line in keys if not lines[line - 1].lstrip().startswith("[")]
    header = places.get(table)
    if header is not None and lines[header.line - 1].lstrip().startswith("["):
        lines.insert(max([header.line, *keys]), said)
        return
    if keys:
        raise InputError.of_file(
            file,
            f"{'.'.join(table)} without a table of its own",
            f"[{'.'.join(table)}], which {path[-1]} can be added to",
            "write its keys below such a line",
        )
    while lines and not lines[-1].strip():
        lines.pop()
    lines += ["", f"[{'.'.join(table)}]", said, ""]
