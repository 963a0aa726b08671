"""What says that detent wrote a file: only such a file is replaced unasked.

| file | its mark |
|---|---|
| HTML, SVG, PNG, PDF, VCD | the program that made it, as these formats name it |
| HDF5, Parquet | the ``format`` of a trace, among the attributes or the metadata |
| TOML, C header, A2L | the first line, with a checksum of the others: a file that somebody has edited is theirs |
| CSV | its heading: every program that reads numbers would take a comment for a row of them |

A mark is looked for in the bytes. No library opens the file: it may be anybody's.
"""

import csv
import re
import zlib
from collections.abc import Callable, Iterable
from pathlib import Path

from detent import __version__
from detent.errors import FileProblem, InputError

WROTE = f"detent {__version__}"  # who made a file, for formats that have a place for that
_HEAD, _FOOT = 1 << 16, 1 << 24  # most bytes looked at from the begin of a file, and from its end
IN_TOML, IN_C = "# {}", "/* {} */"  # how a line is said that is no part of a text
_SIGNED = re.compile(r"(?:# |/\* )detent \S+ wrote this, checksum ([0-9A-F]{8}); edited, it is yours\.(?: \*/)?\r?\n")
_ORDER = "\ufeff"  # byte order mark
# Columns of a trace, of the tables of an envelope, and of the cases of a tolerance run; all others have a dotted name.
_BEGINS = ["t [s]"], ["step", "position [m]"], ["case"]
_REGISTER = re.compile(r"tick \[tick\]|\w+(?:\.\w+)+(?: \[[^\[\]]*\])?")


def signed(text: str, comment: str = IN_TOML) -> str:
    """A text that people may edit, with the line in front that says that nobody has."""
    plain, newline = text.removeprefix(_ORDER), "\r\n" if "\r\n" in text else "\n"
    found = _SIGNED.match(plain)
    bare = plain[found.end() :] if found else plain
    line = f"{WROTE} wrote this, checksum {_checksum(bare)}; edited, it is yours."
    order = _ORDER if text.startswith(_ORDER) else ""
    return f"{order}{comment.format(line)}{newline}{bare}"


def is_signed(text: str) -> bool:
    """True for a text that is as `signed` gave it, whatever its line ends have become since."""
    plain = text.removeprefix(_ORDER)
    found = _SIGNED.match(plain)
    return found is not None and _checksum(plain[found.end() :]) == found[1]


def _checksum(text: str) -> str:
    return f"{zlib.crc32(text.replace(chr(13), '').encode('utf-8', 'replace')):08X}"


def is_ours(path: Path) -> bool:
    """True for a file that may be replaced: detent wrote it and nobody has edited it since, or there is nothing in it.

    What cannot be read belongs to others; what is no file is not written to anyway.
    """
    try:
        if not path.is_file() or not path.stat().st_size:
            return True
    except OSError:
        return True  # the writing says why
    try:
        marked = _MARKED.get(path.suffix.lower())
        return marked(path) if marked else any(one(path) for one in _MARKED.values())
    except OSError:
        return False


def refuse_others(paths: Iterable[Path], *, force: bool = False) -> None:
    """Refuse to replace files that are not detent's; `force` says that it shall be."""
    if force:
        return
    got, allowed = (
        "a file that detent did not write, or that was edited since",
        "a new name, or a file of detent's own",
    )
    remedy = "choose another name, or replace it with --force (in Python: force=True)"
    problems = [FileProblem(str(path), 0, 0, "", got, allowed, remedy) for path in paths if not is_ours(path)]
    if problems:
        raise InputError(problems)


# ---- by the ending of the name


def _head(path: Path) -> bytes:
    with path.open("rb") as stream:
        return stream.read(_HEAD)


def _foot(path: Path) -> bytes:
    """The last bytes of a file: with Parquet all that its end says it has there."""
    with path.open("rb") as stream:
        size = stream.seek(0, 2)
        stream.seek(max(0, size - 8))
        told = int.from_bytes(stream.read(4), "little") if path.suffix.lower() == ".parquet" else _HEAD
        stream.seek(max(0, size - 8 - min(told, _FOOT)))
        return stream.read()


def _holds(part: Callable[[Path], bytes], mark: bytes, begin: bytes = b"") -> Callable[[Path], bool]:
    """A test for files that begin with some bytes, and hold a mark, before a number, in some part."""
    return lambda path: re.search(re.escape(mark) + rb"\d", part(path)) is not None and _head(path).startswith(begin)


def _is_signed_file(path: Path) -> bool:
    begin = _head(path).decode("utf-8-sig", "replace")
    return bool(_SIGNED.match(begin)) and is_signed(path.read_bytes().decode("utf-8", "replace"))


def _has_heading(path: Path) -> bool:
    """True for a table whose columns are those of a trace, or of an envelope."""
    line, newline, _ = _head(path).decode("utf-8", "replace").partition("\n")
    cells = next(csv.reader([line]), list[str]()) if newline and "\r" not in line else []
    others = next((cells[len(begin) :] for begin in _BEGINS if cells[: len(begin)] == begin), list[str]())
    return bool(others) and all(map(_REGISTER.fullmatch, others))


_MARKED: dict[str, Callable[[Path], bool]] = {
    ".html": _holds(_head, b'<meta name="generator" content="detent '),
    ".svg": _holds(_head, b"<dc:title>detent "),
    ".png": _holds(_head, b"tEXtSoftware\0detent ", b"\x89PNG"),
    ".pdf": _holds(_foot, b"/Creator (detent ", b"%PDF"),
    ".vcd": _holds(_head, b"$version detent "),
    ".h5": _holds(_head, b"detent trace ", b"\x89HDF"),
    ".hdf5": _holds(_head, b"detent trace ", b"\x89HDF"),
    ".parquet": _holds(_foot, b"detent trace ", b"PAR1"),
    ".csv": _has_heading,
    ".toml": _is_signed_file,
    ".h": _is_signed_file,
    ".a2l": _is_signed_file,
}
