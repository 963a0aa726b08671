"""Text files: read as far as their kind allows, or refused with the reason; and texts as they fit into a message."""

from collections.abc import Collection
from os import PathLike
from pathlib import Path

from detent.errors import FileProblem, InputError

MAX_SHOWN = 60  # characters of a value shown in a message

MAX_BYTES = {".csv": 8_000_000, ".txt": 8_000_000, ".toml": 1_000_000}
"""Largest file read, by the ending of its name: room for the most moves that a job can have. TOML is parsed more slowly
than it is written by hand; a list so long comes from a program, which can write CSV."""

_REMEDY = "check the name after --job"


def short(text: str) -> str:
    """Text as it fits into a message."""
    shown = "".join(char if char.isprintable() else "\N{REPLACEMENT CHARACTER}" for char in text[: MAX_SHOWN + 1])
    return shown if len(shown) <= MAX_SHOWN else f"{shown[:MAX_SHOWN]}..."


def read_text(path: str | PathLike[str], kinds: Collection[str], allowed: str) -> str:
    """Read a job file of UTF-8 text."""
    return decode_utf8(Path(path), read_data(Path(path), kinds, allowed))


def read_data(file: Path, kinds: Collection[str], allowed: str) -> bytes:
    """Bytes of a job file, for a kind of text that may be encoded otherwise; arguments and errors as of `read_text`."""
    limit = MAX_BYTES[file.suffix.lower()] if file.suffix.lower() in kinds else 0
    try:
        with file.open("rb") as stream:
            data = stream.read(limit + 1)
    except FileNotFoundError:
        raise InputError.of_file(str(file), "no such file", allowed, _REMEDY) from None
    except OSError as error:
        came = f"a file that cannot be read ({(error.strerror or str(error)).lower()})"
        raise InputError.of_file(str(file), came, allowed, _REMEDY) from None
    except ValueError:
        raise InputError.of_file(repr(str(file)), "a name no file can have", allowed, _REMEDY) from None
    if not limit:
        came = f'a name that ends in "{file.suffix}"' if file.suffix else "a name without an ending"
        remedy = "name a file of one of these kinds, or give it the ending of its kind"
        raise InputError.of_file(str(file), came, allowed, remedy)
    if len(data) > limit:
        remedy = "divide the job among several files, or use repeat"
        remedy += "; a CSV file may be longer" if file.suffix.lower() == ".toml" and ".csv" in kinds else ""
        raise InputError.of_file(str(file), f"more than {limit // 1000} kB", f"up to {limit // 1000} kB", remedy)
    if not data.strip():
        raise InputError.of_file(str(file), "an empty file", allowed, _REMEDY)
    if b"\0" in data:
        remedy = "save the file as UTF-8 text, or name another"
        raise InputError.of_file(str(file), "NUL bytes, as in a binary file or UTF-16", allowed, remedy)
    return data


def decode_utf8(file: Path, data: bytes) -> str:
    """Text of a file in UTF-8, without a byte order mark."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line_start = data.rfind(b"\n", 0, error.start) + 1
        line = data.count(b"\n", 0, error.start) + 1
        column = len(data[line_start : error.start].decode("utf-8", errors="replace")) + 1
        came = f"the byte 0x{data[error.start]:02X}"
        problem = FileProblem(str(file), line, column, "", came, "UTF-8 text", "save the file as UTF-8")
        raise InputError([problem]) from None
