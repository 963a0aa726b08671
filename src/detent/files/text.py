"""Files read as far as their kind allows, written whole or not at all, or refused with the reason; short texts."""

import errno
import filecmp
import gzip
import os
import re
import shutil
import zlib
from collections.abc import Collection, Generator, Iterable, Sequence
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path
from typing import NamedTuple

from detent.errors import DetentError, DiskError, FileProblem, InputError
from detent.files.marks import is_ours, refuse_others

MAX_SHOWN = 60  # characters of a value shown in a message

MAX_BYTES = {".csv": 8_000_000, ".txt": 8_000_000, ".toml": 1_000_000}
"""Largest job read, by the ending of its name: room for the most moves that a job can have. TOML is parsed more slowly
than it is written by hand; a list so long comes from a program, which can write CSV."""

# What is wrong with a place, where nothing is wrong with the disk.
_NO_PLACE = {
    errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.EEXIST, errno.ENAMETOOLONG, errno.EINVAL, errno.ELOOP,
}  # fmt: skip
FIGURES = (".png", ".svg", ".pdf")  # endings of pictures
PACKED = ".gz"  # ending of a packed text file, after that of its kind: ``run.csv.gz``
_CHECK_JOB = "check the name after --job"
_CHECK_LOG = "check the name of the recording"


# Of a terminal, a browser or a picture: control codes beside tab and line feed, marks that turn the order of reading,
# and bytes of a file's name that are no text.
_STEERING = re.compile("[\0-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


def shown(text: str) -> str:
    r"""Text as it may be shown: what would steer the terminal or turn the order of reading is told by its escape.

    >>> shown("a\x1b[2J\u202eb")
    'a\\x1b[2J\\u202eb'
    """
    return _STEERING.sub(lambda code: code[0].encode("unicode_escape").decode(), text)


def lines_of(text: str) -> list[str]:
    r"""Lines of a text, which end in LF or CR LF, in TOML and in logs; other signs that end one for Python do not.

    >>> lines_of("a\u2028b\r\nc\n")
    ['a\u2028b', 'c']
    """
    if not text:
        return []
    lines = text.split("\n")
    if not lines[-1]:
        lines.pop()  # the last line ends, too
    return [line.removesuffix("\r") for line in lines] if "\r" in text else lines


def short(text: str) -> str:
    """Text as it fits into a message."""
    shown = "".join(char if char.isprintable() else "\N{REPLACEMENT CHARACTER}" for char in text[: MAX_SHOWN + 1])
    return shown if len(shown) <= MAX_SHOWN else f"{shown[:MAX_SHOWN]}..."


def nearest(name: str, known: Iterable[str], cutoff: float = 0.6) -> str:
    """The known word that another was probably meant to be; empty when none is near."""
    words = {word.lower(): word for word in known}
    return "".join(words[near] for near in get_close_matches(name.lower(), words, n=1, cutoff=cutoff))


def did_you_mean(name: str, known: Iterable[str], otherwise: str, cutoff: float = 0.6) -> str:
    """The remedy for a word that is not known."""
    near = nearest(name, known, cutoff)
    return f'did you mean "{near}"?' if near else otherwise


@contextmanager
def reading(file: Path, allowed: str, remedy: str) -> Generator[None]:
    """Turn whatever keeps a file from being read into an error that says what to do."""
    try:
        yield
    except FileNotFoundError:
        raise InputError.of_file(str(file), "no such file", allowed, remedy) from None
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        got = f"a damaged packed file ({error})"
        raise InputError.of_file(str(file), got, allowed, "unpack it with gunzip, or record again") from None
    except OSError as error:
        got = f"a file that cannot be read ({(error.strerror or str(error)).lower()})"
        raise InputError.of_file(str(file), got, allowed, remedy) from None
    except ValueError:
        raise InputError.of_file(repr(str(file)), "a name no file can have", allowed, remedy) from None


def read_head(file: Path, limit: int, allowed: str, remedy: str) -> bytes:
    """A file, or one byte more of it than the limit; refused where it holds nothing."""
    with reading(file, allowed, remedy), file.open("rb") as stream:
        data = stream.read(limit + 1)
    if limit and not data.strip():
        raise InputError.of_file(str(file), "an empty file", allowed, remedy)
    return data


def refuse_longer(file: Path, data: bytes, limit: int, remedy: str) -> None:
    """Raise for a file of which more was read than its kind allows."""
    if len(data) > limit:
        raise InputError.of_file(str(file), f"more than {limit // 1000} kB", f"up to {limit // 1000} kB", remedy)


# ---- jobs


def read_text(path: str | os.PathLike[str], kinds: Collection[str], allowed: str) -> str:
    """Read a job file of UTF-8 text."""
    return decode_utf8(Path(path), read_data(Path(path), kinds, allowed))


def read_data(file: Path, kinds: Collection[str], allowed: str) -> bytes:
    """Bytes of a job file, for a kind of text that may be encoded otherwise; arguments and errors as of `read_text`."""
    limit = MAX_BYTES[file.suffix.lower()] if file.suffix.lower() in kinds else 0
    data = read_head(file, limit, allowed, _CHECK_JOB)
    if not limit:
        got = f'a name that ends in "{file.suffix}"' if file.suffix else "a name without an ending"
        remedy = "name a file of one of these kinds, or give it the ending of its kind"
        raise InputError.of_file(str(file), got, allowed, remedy)
    remedy = "divide the job among several files, or use repeat"
    remedy += "; a CSV file may be longer" if file.suffix.lower() == ".toml" and ".csv" in kinds else ""
    refuse_longer(file, data, limit, remedy)
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
        got = f"the byte 0x{data[error.start]:02X}"
        problem = FileProblem(str(file), line, column, "", got, "UTF-8 text", "save the file as UTF-8")
        raise InputError([problem]) from None


# ---- recordings


def kind_of(path: Path) -> str:
    """Ending of a file's name in small letters, that of the packing left out.

    >>> kind_of(Path("run.CSV")), kind_of(Path("run.json.gz"))
    ('.csv', '.json')
    """
    suffix = path.suffix.lower()
    return path.with_suffix("").suffix.lower() if suffix == PACKED else suffix


def check_file(path: Path, limit: int, allowed: str) -> None:
    """Refuse a file that is absent, empty, too large, or no file."""
    with reading(path, allowed, _CHECK_LOG):
        size, is_folder = path.stat().st_size, path.is_dir()
    if is_folder:
        raise InputError.of_file(str(path), "a folder", allowed, "name a file in it")
    _check_size(path, size, limit, allowed)


def read_bytes(path: Path, limit: int, allowed: str) -> bytes:
    """Read a file, unpacked if its name ends in ``.gz``."""
    check_file(path, limit, allowed)
    is_packed = path.suffix.lower() == PACKED
    with reading(path, allowed, _CHECK_LOG), gzip.open(path, "rb") if is_packed else path.open("rb") as stream:
        data = stream.read(limit + 1)
    _check_size(path, len(data) if data.strip() else 0, limit, allowed)
    return data


def _check_size(path: Path, size: int, limit: int, allowed: str) -> None:
    """Refuse nothing, and what is beyond the limit."""
    if not size:
        raise InputError.of_file(str(path), "an empty file", allowed, _CHECK_LOG)
    if size > limit:
        most, remedy = f"{limit // 1_000_000} MB", "cut the recording into pieces, or save it as HDF5 or Parquet"
        raise InputError.of_file(str(path), f"more than {most}", f"up to {most}", remedy)


# ---- what is written

_PART = ".part"  # ending of a file that is not whole yet
_MADE, _WHOLE = ".detent-", ".whole"  # folder in which files are made that belong together; once all of them are there
_UNFINISHED: dict[Path, Path | None] = {}  # what is being made now; its name, once all is whole that belongs together
_WRITTEN: dict[Path, None] = {}  # what has been, in that order


def check_target(
    path: str | Path, suffixes: Collection[str] = FIGURES, what: str = "a figure", *, force: bool = False
) -> Path:
    """Refuse a place that cannot take a file, or has one that detent did not write, before any work is done."""
    path = Path(path)
    if path.suffix.lower() not in suffixes:
        raise DetentError(f"{path}: {what} cannot be saved as {path.suffix!r}; use one of {', '.join(suffixes)}")
    if not path.parent.is_dir() or path.is_dir():
        reason = "it is a folder" if path.is_dir() else f"no folder {path.parent}"
        raise DetentError(f"{path}: cannot be written ({reason}); make it, or choose another place")
    refuse_others([path], force=force)
    return path


@contextmanager
def write_errors(path: Path | str) -> Generator[None]:
    """Turn the system's refusal to write into an error that says what to do."""
    try:
        yield
    except OSError as error:
        reason, kind = error.strerror or str(error), DetentError if error.errno in _NO_PLACE else DiskError
        raise kind(f"{path}: cannot be written ({reason}); choose another place or make room") from error


def end_of_links(path: Path) -> Path:
    """Where a path leads, there or not yet; an `OSError` where it leads nowhere, as a loop of links."""
    with suppress(FileNotFoundError):
        path.stat()
    return Path(os.path.realpath(path))


@contextmanager
def writing(path: Path, *, force: bool = False) -> Generator[Path]:
    """Give the place to write a file to: at the end it gets its name, after a failure nothing is left of it.

    A link is written through, and stays one. A file that detent did not write is replaced by `force` only, or by the
    same bytes; it is looked at before the work, and once more at the end. Inside of `together` it gets its name when
    that ends.
    """
    with write_errors(path):
        end = end_of_links(path)
        if end.exists() and not end.is_file():
            kind = errno.EISDIR if end.is_dir() else errno.EINVAL
            raise OSError(kind, os.strerror(kind) if end.is_dir() else "it is no file but a device")
    refuse_others([path], force=force)
    part = end.with_name(f"{end.name}{_PART}")
    with ExitStack() as alone, write_errors(path):
        group = _GROUP.get()
        held = group.held if group else alone
        held.enter_context(alone_in(part, path))
        _UNFINISHED[part] = None
        held.callback(_drop, part)
        yield part
        with part.open("rb+") as whole:
            os.fsync(whole.fileno())
        file = _Whole(part, end, path, force)
        if group:
            group.files.append(file)
        else:
            _name([file])


class _Whole(NamedTuple):
    """A file that is all there, but for its name."""

    part: Path
    end: Path
    path: Path  # as it was given
    force: bool  # whether it may replace a file that detent did not write


@dataclass
class _Group:
    """Files that get their names at one time."""

    held: ExitStack
    files: list[_Whole] = field(default_factory=list[_Whole])


_GROUP: ContextVar[_Group | None] = ContextVar("_GROUP", default=None)


@contextmanager
def together() -> Generator[None]:
    """Give all files that are written inside their names at its end, wherever they are, or none of them.

    Only a process that is killed in the instant of naming leaves fewer: as of `placing`, earlier files go before the
    first comes, so that none stands beside one of another time.
    """
    with ExitStack() as held:
        group = _Group(held)
        token = _GROUP.set(group)
        try:
            yield
        finally:
            _GROUP.reset(token)
        _name(group.files)


def _name(files: Sequence[_Whole]) -> None:
    """Give files that belong together their names."""
    for file in files:
        _refuse_replacing([(file.part, file.path)], force=file.force)
    _UNFINISHED.update({file.part: file.end for file in files})
    for file in files[1:]:
        with write_errors(file.path):
            file.end.unlink(missing_ok=True)
    for file in files:
        with write_errors(file.path):
            file.part.replace(file.end)
        del _UNFINISHED[file.part]
        _WRITTEN[file.path] = None


def _drop(part: Path) -> None:
    """Remove a file that got no name."""
    if part in _UNFINISHED:
        with suppress(OSError):
            part.unlink()
        del _UNFINISHED[part]


@contextmanager
def placing(folder: Path, others: Collection[str] = (), *, force: bool = False) -> Generator[Path]:
    """Give a folder to make files in that belong together: at the end all get their names in `folder`, or none does.

    Those of an earlier time stay until then; of `others`, names that such files may have, what was not made anew goes
    with them. What detent did not write is replaced, or goes, by `force` only; all `others` are looked at before the
    work. One process at a time places files into a folder. What a killed one left there is removed, or given its names
    if all of it had been made.
    """
    for name in others:
        if (folder / name).is_dir():
            with write_errors(folder / name):
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    refuse_others([folder / name for name in others], force=force)
    with alone_in(folder, folder) as alone:
        made = folder / f"{_MADE}{os.getpid()}"
        for left in [*folder.glob(f"{_MADE}*")] if alone else [made]:
            _finish(left)
        _UNFINISHED[made] = None
        try:
            made.mkdir()
            yield made
            for name in others:
                (made / name).touch()  # empty: it only goes
            _refuse_replacing([(one, folder / one.name) for one in sorted(made.iterdir())], force=force)
            made.rename(made.with_suffix(_WHOLE))
        except DetentError as error:
            # Of the place that files are made in nobody need know.
            error.args = tuple(str(text).replace(str(made), str(folder)) for text in error.args)
            raise
        finally:
            _finish(made)
            del _UNFINISHED[made]


def have_same_bytes(path: Path, other: Path) -> bool:
    """True for files of which one may be had for the other."""
    return other.is_file() and filecmp.cmp(path, other, shallow=False)


def _refuse_replacing(made: Iterable[tuple[Path, Path]], *, force: bool) -> None:
    """Refuse to give files that were made the names of others' files, unless these hold the same."""
    refuse_others([name for one, name in made if not (is_ours(name) or have_same_bytes(one, name))], force=force)


def _finish(made: Path) -> None:
    """Give the files of a folder their names beside it if all are there, or remove it; may be broken off and repeated.

    Earlier files go before the first comes: none stands beside one of another time.
    """
    whole = made.with_suffix(_WHOLE)
    if whole.exists():
        files = sorted(whole.iterdir())
        for file in files:
            end_of_links(made.parent / file.name).unlink(missing_ok=True)
        for file in files:
            name = made.parent / file.name
            if file.stat().st_size and name.is_symlink():  # it may lead to another disk
                with writing(name, force=True) as part:
                    shutil.move(file, part)
            elif file.stat().st_size:
                _WRITTEN[file.replace(name)] = None
        shutil.rmtree(whole)
    shutil.rmtree(made, ignore_errors=True)


@contextmanager
def alone_in(place: Path, told: Path) -> Generator[bool]:
    """Have a folder, or a file being made, for this process alone until it ends; False where no such locks are."""
    try:
        import fcntl
    except ImportError:  # Windows
        yield False
        return
    with ExitStack() as stack:
        while True:
            held = os.open(place, os.O_RDONLY if place == told else os.O_RDONLY | os.O_CREAT, 0o666)
            stack.callback(os.close, held)
            try:
                fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                remedy = "wait until that has ended, or choose another place"
                raise DiskError(f"{told}: cannot be written (another process is writing there); {remedy}") from None
            except OSError:  # of a network's disk
                yield False
                return
            with suppress(FileNotFoundError):  # whoever had it gave it its name meanwhile
                if os.path.samestat(os.fstat(held), place.stat()):
                    break
        yield True


def sync_folder(folder: Path) -> None:
    """Let the names in a folder outlive a loss of power, as `fsync` does with what is in a file."""
    with suppress(PermissionError):  # Windows opens no folders
        opened = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(opened)
        finally:
            os.close(opened)


def abandon() -> list[Path]:
    """Remove what is not whole, for a process that ends at once; the files that it has written."""
    for made, name in list(_UNFINISHED.items()):
        try:
            if name:
                made.replace(name)
                _WRITTEN[name] = None
            elif made.suffix == _PART:
                made.unlink()
            else:
                _finish(made)
        except FileNotFoundError:  # it got its name just now
            _WRITTEN[made.with_suffix("")] = None
        except OSError:
            continue
    return [path for path in _WRITTEN if path.exists()]


def write_text(path: str | Path, text: str, *, force: bool = False) -> Path:
    """Write a file of text; a file name in it need not be valid UTF-8, the file must be."""
    path = Path(path)
    with writing(path, force=force) as part:
        part.write_text(text, encoding="utf-8", errors="replace", newline="\n")
    return path
