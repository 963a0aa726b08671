"""A disk whose power goes: every write of SQLite is taken down, and what a cut leaves of them is made from that.

The SQLite that Python has is asked for its own file system (VFS), of which a copy is registered that notes each write,
truncation and sync before they are done. What was synced is on the disk. Of what was written since, a cut leaves any
part: writes are lost one by one, and torn at the sectors of the disk.
"""

import _sqlite3
import ctypes
import itertools
import sqlite3
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random

SECTOR = 512  # what a disk writes whole

_Open = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int, ctypes.c_void_p)
_Write = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int, ctypes.c_int64)
_Truncate = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_int64)
_Sync = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_int)
_NUMBER = itertools.count()


class _Vfs(ctypes.Structure):
    """The head of ``sqlite3_vfs``, and room for the functions behind `open`."""

    _fields_ = (
        ("version", ctypes.c_int), ("file_size", ctypes.c_int), ("longest_path", ctypes.c_int),
        ("next", ctypes.c_void_p), ("name", ctypes.c_char_p), ("data", ctypes.c_void_p),
        ("open", ctypes.c_void_p), ("others", ctypes.c_void_p * 15),
    )  # fmt: skip


class _Methods(ctypes.Structure):
    """``sqlite3_io_methods``."""

    _fields_ = (
        ("version", ctypes.c_int), ("close", ctypes.c_void_p), ("read", ctypes.c_void_p), ("write", ctypes.c_void_p),
        ("truncate", ctypes.c_void_p), ("sync", ctypes.c_void_p), ("others", ctypes.c_void_p * 13),
    )  # fmt: skip


@dataclass(frozen=True)
class Event:
    """What was done to a file: bytes at a place, a size to cut it to, or (neither) a sync."""

    file: str
    place: int = 0
    data: bytes | None = None
    size: int | None = None


class RecordingDisk:
    """Connections whose writes are noted in `events`, with the syncs that `synchronous` asks for."""

    def __init__(self, synchronous: str = "FULL") -> None:
        self._synchronous = synchronous
        self.events: list[Event] = []
        self._files: dict[int, str] = {}
        self._kept: list[object] = []  # what SQLite points at
        self._methods: dict[int, _Methods] = {}
        library = ctypes.CDLL(_sqlite3.__file__)
        library.sqlite3_vfs_find.restype = ctypes.c_void_p
        self._base = library.sqlite3_vfs_find(None)
        made = _Vfs.from_buffer_copy(ctypes.string_at(self._base, ctypes.sizeof(_Vfs)))
        self.name = f"recording{next(_NUMBER)}"
        self._base_open = ctypes.cast(made.open, _Open)
        opener = _Open(self._open)
        made.name, made.open = self.name.encode(), ctypes.cast(opener, ctypes.c_void_p)
        self._kept += [made, opener, library]
        assert library.sqlite3_vfs_register(ctypes.byref(made), 0) == 0

    def connect(self, path: Path) -> sqlite3.Connection:
        name = f"{path.absolute().as_uri()}?vfs={self.name}"
        synchronous = self._synchronous

        class Connection(sqlite3.Connection):
            def execute(self, sql, *values):
                return super().execute(sql.replace("synchronous=FULL", f"synchronous={synchronous}"), *values)

        return sqlite3.connect(name, uri=True, timeout=0.0, isolation_level=None, factory=Connection)

    def _open(self, vfs, name, file, flags, told):
        result = self._base_open(self._base, name, file, flags, told)
        pointer = ctypes.cast(file, ctypes.POINTER(ctypes.c_void_p))
        if result == 0 and name:
            self._files[file] = Path(ctypes.string_at(name).decode()).name
            pointer[0] = ctypes.addressof(self._noting(pointer[0]))
        return result

    def _noting(self, address: int) -> _Methods:
        """A copy of a file's methods that notes what is done."""
        if address in self._methods:
            return self._methods[address]
        base = _Methods.from_address(address)
        made = _Methods.from_buffer_copy(ctypes.string_at(address, ctypes.sizeof(_Methods)))
        write, truncate = ctypes.cast(base.write, _Write), ctypes.cast(base.truncate, _Truncate)
        sync = ctypes.cast(base.sync, _Sync)

        def noting_write(file, data, count, place):
            self.events.append(Event(self._files[file], place, data=ctypes.string_at(data, count)))
            return write(file, data, count, place)

        def noting_truncate(file, size):
            self.events.append(Event(self._files[file], size=size))
            return truncate(file, size)

        def noting_sync(file, flags):
            result = sync(file, flags)
            self.events.append(Event(self._files[file]))
            return result

        calls = _Write(noting_write), _Truncate(noting_truncate), _Sync(noting_sync)
        made.write, made.truncate, made.sync = (ctypes.cast(call, ctypes.c_void_p) for call in calls)
        self._kept += [made, *calls]
        self._methods[address] = made
        return made


# ---- what a cut leaves

Image = dict[str, bytes]


def _apply(content: bytes, event: Event, sectors: Random | None = None) -> bytes:
    """A file after a write or a truncation; of a torn write some sectors only."""
    if event.size is not None:
        return content[: event.size].ljust(event.size, b"\0")
    assert event.data is not None
    made = bytearray(content.ljust(event.place + len(event.data), b"\0"))
    begin = event.place
    while begin < event.place + len(event.data):
        end = min((begin // SECTOR + 1) * SECTOR, event.place + len(event.data))
        if sectors is None or sectors.random() < 0.5:
            made[begin:end] = event.data[begin - event.place : end - event.place]
        begin = end
    return bytes(made)


def images(events: list[Event], cut: int, tears: int = 0) -> Iterator[Image]:
    """What the disk can hold when the power goes before the event of this number.

    All that was written and nothing beyond the syncs; with `tears`, so many mixtures beside each write alone lost.
    """
    durable: Image = {}
    pending: list[Event] = []
    for event in events[:cut]:
        if event.data is None and event.size is None:
            for one in (one for one in pending if one.file == event.file):
                durable[one.file] = _apply(durable.get(one.file, b""), one)
            pending = [one for one in pending if one.file != event.file]
            durable.setdefault(event.file, b"")
        else:
            pending.append(event)
    yield dict(durable)
    yield _mixed(durable, pending, [True] * len(pending))
    if tears and pending:
        for lost in range(len(pending)):
            yield _mixed(durable, pending, [k != lost for k in range(len(pending))])
        for seed in range(tears):
            random = Random(f"{cut} {seed}")
            yield _mixed(durable, pending, [random.random() < 0.6 for _ in pending], random)


def _mixed(durable: Image, pending: list[Event], held: list[bool], sectors: Random | None = None) -> Image:
    image = dict(durable)
    for event, is_held in zip(pending, held, strict=True):
        if is_held:
            image[event.file] = _apply(image.get(event.file, b""), event, sectors)
    return image
