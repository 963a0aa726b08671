"""A small SQLite file of sealed rows: one opener, each change durable or not made at all, no damage unnoticed.

All SQL of detent stands here. A kind of row is a frozen dataclass of int, float and str, whose first field is its key,
and a table of that name. Each row carries a seal, a hash of its kind and its values; the sum of all seals is kept in a
row of its own. A bit that the disk changed, a row that is missing and a row of another time all break that sum: SQLite
itself looks at its pages, but not at what stands in them.

The journal of a change is truncated (`journal_mode=TRUNCATE`, `synchronous=FULL`): when a change is told to be made,
it survives a power cut. A write-ahead log would be faster, but what is changed in it by a bit ends it there without a
word, and what was told to be kept after it is gone.
"""

import json
import os
import sqlite3
import struct
import sys
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import contextmanager, suppress
from dataclasses import fields
from hashlib import blake2b
from operator import index
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast
from weakref import WeakValueDictionary

from detent.errors import DetentError, DiskError
from detent.files.text import sync_folder

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Connect = Callable[[Path], sqlite3.Connection]
RowT = TypeVar("RowT", bound="DataclassInstance")

APPLICATION = 0x44_54_4E_54  # "DTNT", in the head of the file
HEAD = b"SQLite format 3\0" + struct.pack(">H6B", 4096, 1, 1, 0, 64, 32, 32)  # first bytes of each such file
_TYPES = {int: "INTEGER", float: "REAL", str: "TEXT"}
# Errors that say nothing about the file: locked, no memory, read-only, the disk fails, full, not to be opened.
_OF_THE_DISK = {3, 5, 6, 7, 8, 9, 10, 13, 14, 23}
_BUSY = {5, 6}
_LOCKS = 0x40000000  # where SQLite locks a file [byte]
_OPEN: "WeakValueDictionary[tuple[int, int], SealedFile]" = WeakValueDictionary()  # here, by disk and number


class StoreHeldError(DetentError):
    """Another process has the store of an axis; `holder` says which."""

    def __init__(self, path: Path, holder: str) -> None:
        self.path, self.holder = path, holder
        super().__init__(
            f"{path}: got a second opener; expected: one process for each axis, and {holder} has it; try: end that "
            "process, or command the axis through it"
        )


class DamagedError(Exception):
    """The file is not what was written; never seen outside this room."""


class ForeignError(DamagedError):
    """The file is of another kind, or of a later detent: what its rows mean is not known."""


def connect(path: Path) -> sqlite3.Connection:
    """Open a file of SQLite's, which waits for nobody; threads that use it take turns (`keeper.Keeper`)."""
    return sqlite3.connect(path, timeout=0.0, isolation_level=None, check_same_thread=False)


class SealedFile:
    """Rows that survive; `kinds` are the dataclasses of its tables, `version` of their meaning.

    A file that is absent or empty is made; `is_new` then. `DamagedError` where it is not whole.
    """

    def __init__(self, path: Path, kinds: Sequence[type], version: int, connect: Connect = connect) -> None:
        self.path, self.is_new = path, False
        self._kinds, self._version = kinds, version
        _refuse_second(path)
        if _has_head(path) and not _is_hot(path):
            _check_head(path, version)
        with self._told("cannot be opened"):
            self._connection = connect(path)
        try:
            self._open()
        except BaseException:
            self._connection.close()
            raise
        self.place, self.process = identity(path), os.getpid()
        _OPEN[self.place] = self

    def close(self) -> None:
        """Let others open it; the empty journal goes while it is still locked."""
        _OPEN.pop(self.place, None)
        with suppress(sqlite3.Error):
            self._connection.execute("PRAGMA journal_mode=DELETE")
        self._connection.close()

    # ------------------------------------------------------------------------------------------------------- rows

    def all(self, kind: type[RowT]) -> list[RowT]:
        """Every row of a kind, by key."""
        names = _columns(kind)
        rows = self._run(f"SELECT {', '.join(names)} FROM {_table(kind)} ORDER BY {names[0]}")  # noqa: S608
        return [kind(*row) for row in rows]

    def get(self, kind: type[RowT], key: str | int) -> RowT | None:
        """Row of a kind with this key; None where there is none."""
        names = _columns(kind)
        rows = self._run(f"SELECT {', '.join(names)} FROM {_table(kind)} WHERE {names[0]} = ?", (key,))  # noqa: S608
        return next((kind(*row) for row in rows), None)

    @contextmanager
    def change(self) -> Generator["Change"]:
        """What is done inside is durable when this ends, or nothing of it is: then with a `DiskError`."""
        with self._told("cannot be written"):
            if identity(self.path) != self.place:
                raise DiskError(
                    f"{self.path}: cannot be written (it was removed or replaced while it was open); "
                    "stop the axis and start it again"
                )
            self._connection.execute("BEGIN IMMEDIATE")
            try:
                made = Change(self._connection)
                yield made
                made.seal()
                self._connection.execute("COMMIT")
            except BaseException:
                with suppress(sqlite3.Error):
                    if self._connection.in_transaction:
                        self._connection.execute("ROLLBACK")
                raise

    def _run(self, sql: str, values: Sequence[Any] = ()) -> list[tuple[Any, ...]]:
        with self._told("cannot be read"):
            return self._connection.execute(sql, values).fetchall()

    # ---------------------------------------------------------------------------------------------------- opening

    def _open(self) -> None:
        try:
            for pragma in (
                "locking_mode=EXCLUSIVE",
                "synchronous=FULL",
                "fullfsync=ON",
                "page_size=4096",
                "journal_mode=TRUNCATE",
            ):
                self._connection.execute(f"PRAGMA {pragma}")
            self._connection.execute("BEGIN EXCLUSIVE")
            if self.path.stat().st_size == 0:  # what was broken off has been taken back by now
                self.is_new = True
                self._make()
            else:
                self._check()
            self._connection.execute("COMMIT")
        except (TypeError, ValueError) as error:  # a flipped bit makes a text of a number, or of a text what is none
            raise DamagedError("a value is not of its kind") from error
        except OSError as error:
            raise _disk_error(self.path, "cannot be opened", error) from error
        except sqlite3.Error as error:
            code = _code(error)
            if code in _BUSY:
                raise StoreHeldError(self.path, holder_of(self.path)) from None
            if code in _OF_THE_DISK or self.is_new:
                raise _disk_error(self.path, "cannot be opened", error) from error
            raise DamagedError(f"SQLite says: {error}") from error

    def _value(self, sql: str) -> Any:
        return self._connection.execute(sql).fetchone()[0]

    def _make(self) -> None:
        for pragma in (f"application_id={APPLICATION}", f"user_version={self._version}"):
            self._connection.execute(f"PRAGMA {pragma}")
        for sql in _schema(self._kinds):
            self._connection.execute(sql)
        self._connection.execute("INSERT INTO seal VALUES (1, 0, 0)")
        Change(self._connection).seal()

    def _check(self) -> None:
        """Refuse a file that is not, to the bit, what was written; no value of it is used before."""
        _check_mark(self._value("PRAGMA application_id"), self._value("PRAGMA user_version"), self._version)
        found = self._value("PRAGMA integrity_check(1)")
        if found != "ok":
            raise DamagedError(f"SQLite says: {found}")
        tables = [sql for (sql,) in self._connection.execute("SELECT sql FROM sqlite_master WHERE sql IS NOT NULL")]
        if sorted(tables) != sorted(_schema(self._kinds)):
            raise DamagedError("its tables are not those of a store")
        total = 0
        for kind in self._kinds:
            for *values, seal in self._connection.execute(f"SELECT * FROM {_table(kind)}"):  # noqa: S608
                if seal != seal_of(kind, values):
                    raise DamagedError(f"a row of {_table(kind)} is not the one of its seal")
                total += seal
        kept = self._connection.execute("SELECT revision, total FROM seal").fetchall()
        if len(kept) != 1 or kept[0][1] != _signed(total + _of_revision(kept[0][0])):
            raise DamagedError("rows are missing, or of another time")

    @contextmanager
    def _told(self, what: str) -> Generator[None]:
        """Turn an error of SQLite's into one that says what to do."""
        try:
            yield
        except sqlite3.Error as error:
            raise _disk_error(self.path, what, error) from error


class Change:
    """What is changed together."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection
        self._revision, self._sum = cast("tuple[int, int]", self._first("SELECT revision, total FROM seal"))
        self._sum -= _of_revision(self._revision) if self._revision else 0

    def put(self, row: "DataclassInstance") -> None:
        """Keep a row, in the place of one with the same key."""
        kind = type(row)
        values = [_plain(cast("type", field.type), getattr(row, field.name)) for field in fields(row)]
        self.drop(kind, values[0])
        seal = seal_of(kind, values)
        marks = ", ".join("?" * (len(values) + 1))
        self._connection.execute(f"INSERT INTO {_table(kind)} VALUES ({marks})", (*values, seal))  # noqa: S608
        self._sum += seal

    def drop(self, kind: type, key: str | int) -> None:
        """Take a row out, where it is in."""
        where = f"FROM {_table(kind)} WHERE {_columns(kind)[0]} = ?"
        if found := self._first(f"SELECT seal {where}", (key,)):
            self._connection.execute(f"DELETE {where}", (key,))
            self._sum -= found[0]

    def seal(self) -> None:
        """Count the change, and keep the sum."""
        revision = self._revision + 1
        total = _signed(self._sum + _of_revision(revision))
        self._connection.execute("UPDATE seal SET revision = ?, total = ?", (revision, total))

    def _first(self, sql: str, values: Sequence[Any] = ()) -> tuple[Any, ...] | None:
        return self._connection.execute(sql, values).fetchone()


# ---- rows


def _plain(kind: type, value: Any) -> Any:
    """A value as SQLite gives it back: a word of an enumeration as text, a zero without a sign."""
    if kind is not int:
        return float(value) + 0.0 if kind is float else kind(value)
    number = index(value)
    if not -(1 << 63) <= number < 1 << 63:
        raise DetentError(f"{number} to keep; expected: whole numbers of 64 bits; look for a sensor that counts wrong")
    return number


def _table(kind: type) -> str:
    return kind.__name__.lower()


def _columns(kind: type) -> list[str]:
    return [field.name for field in fields(kind)]


def _schema(kinds: Iterable[type]) -> list[str]:
    tables = ["CREATE TABLE seal (one INTEGER PRIMARY KEY, revision INTEGER NOT NULL, total INTEGER NOT NULL)"]
    for kind in kinds:
        key, *others = (f"{field.name} {_TYPES[cast('type', field.type)]}" for field in fields(kind))
        columns = [f"{key} PRIMARY KEY NOT NULL", *(f"{other} NOT NULL" for other in others), "seal INTEGER NOT NULL"]
        tables.append(f"CREATE TABLE {_table(kind)} ({', '.join(columns)}) WITHOUT ROWID")
    return tables


def seal_of(kind: type, values: Iterable[Any]) -> int:
    """Hash of a row."""
    return _hash([_table(kind), *values])


def _of_revision(revision: int) -> int:
    return _hash(["revision", revision])


def _hash(values: list[Any]) -> int:
    text = json.dumps(values)  # numbers in full, texts escaped: no two rows have the same
    return int.from_bytes(blake2b(text.encode(), digest_size=8).digest(), "big", signed=True)


def _signed(number: int) -> int:
    """A number within 64 bits, as SQLite keeps it."""
    return (number + (1 << 63)) % (1 << 64) - (1 << 63)


# ---- the file


def salvage(path: Path, kind: type[RowT]) -> list[RowT]:
    """Rows of a file that is not open, damaged or not, that are those of their seals."""
    found: list[RowT] = []
    with suppress(sqlite3.Error, TypeError, ValueError):
        reader = sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True, timeout=0.0)
        try:
            for *values, seal in reader.execute(f"SELECT * FROM {_table(kind)}"):  # noqa: S608
                if seal == seal_of(kind, values):
                    found.append(kind(*values))
        finally:
            reader.close()
    return found


def set_aside(path: Path, stamp: str) -> Path:
    """Rename a file that nobody has open, with its journal, and bring that to the disk."""
    kept = path.with_name(f"{path.name}.aside-{stamp}")
    for number in range(2, 1000):
        if not kept.exists():
            break
        kept = path.with_name(f"{path.name}.aside-{stamp}-{number}")
    try:
        if _is_hot(path):
            _journal(path).rename(_journal(kept))
        path.rename(kept)
        sync_folder(path.parent)
    except OSError as error:
        raise DiskError(
            f"{path}: cannot be kept aside ({error.strerror or error}); make its folder writable, or rename it yourself"
        ) from error
    return kept


def _journal(path: Path) -> Path:
    return path.with_name(f"{path.name}-journal")


def _is_hot(path: Path) -> bool:
    """True where a change was broken off, which SQLite takes back when it opens the file."""
    with suppress(FileNotFoundError):
        return _journal(path).stat().st_size > 0
    return False


def _has_head(path: Path) -> bool:
    try:
        return path.stat().st_size > 0
    except OSError:
        return False


def _check_head(path: Path, version: int) -> None:
    """Refuse a file of another kind before SQLite sees it."""
    try:
        with path.open("rb") as stream:
            head = stream.read(100)
    except OSError as error:
        raise _disk_error(path, "cannot be read", error) from error
    if head[: len(HEAD)] != HEAD or len(head) < 100:
        raise ForeignError("its first bytes are not those of a store")
    found, application = struct.unpack(">i4xi", head[60:72])
    _check_mark(application, found, version)


def _check_mark(application: int, version: int, known: int) -> None:
    if application != APPLICATION:
        raise ForeignError(f"it is of another application (0x{application & 0xFFFFFFFF:08X})")
    if version != known:
        raise ForeignError(f"it is of version {version}; this detent knows version {known}")


def identity(path: Path) -> tuple[int, int]:
    """Disk and number of a file; zeros where there is none."""
    try:
        found = path.stat()
    except OSError:
        return 0, 0
    return found.st_dev, found.st_ino


def _refuse_second(path: Path) -> None:
    """Refuse a file that is open here: to open and close it once more would give its locks away."""
    known = _OPEN.get(identity(path))
    if known is not None and known.process == os.getpid():  # not of the process that this one was forked from
        raise StoreHeldError(path, f"this process ({os.getpid()})")


def holder_of(path: Path) -> str:
    """The process that has a file locked, as far as the system tells."""
    if sys.platform != "linux":
        return "another process"
    import fcntl

    with suppress(OSError):
        opened = os.open(path, os.O_RDWR)
        try:
            asked = struct.pack("hhqqi4x", fcntl.F_WRLCK, os.SEEK_SET, _LOCKS, 512, 0)
            pid = struct.unpack("hhqqi4x", fcntl.fcntl(opened, fcntl.F_GETLK, asked))[4]
        finally:
            os.close(opened)
        if pid > 0:
            with suppress(OSError):
                command = Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
                return f"process {pid} ({command.strip()})"
            return f"process {pid}"
    return "another process"


def _code(error: Exception) -> int:
    return getattr(error, "sqlite_errorcode", 1) & 0xFF


def _disk_error(path: Path, what: str, error: Exception) -> DiskError:
    return DiskError(
        f"{path}: {what} ({str(error) or type(error).__name__}); make room on the disk, make the folder writable, or "
        "choose another place for the store"
    )
