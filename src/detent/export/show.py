"""A file of vectors as text, by the names of its unit: `detent verify --print`."""

import csv
import struct
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from detent.errors import InputError
from detent.export import drawn, vectors
from detent.export.vectors import FORMATS
from detent.export.write import MANIFEST, manifest_of

SHOWN = 4  # values of a signal that are told


def shown(file: str | Path) -> Iterator[str]:
    """The lines of a file of vectors that stands in its export; refused where it is none, cut off, or without one."""
    place = Path(file)
    manifest = manifest_of(place.absolute().parents[1])
    try:
        data = place.read_bytes()
    except OSError as error:
        got = error.strerror or str(error)
        raise InputError.of_file(str(place), got, "a file of vectors", "name vectors/job.vec of an export") from error
    kinds = {vectors.MAGIC: _job, drawn.MAGIC: _drawn}
    reader = kinds.get(data[:4])
    if reader is None:
        got = "other content"
        raise InputError.of_file(str(place), got, "a file of vectors", "name vectors/job.vec of an export")
    try:
        yield f"{data[:4].decode()} {data[4]}, layout {struct.unpack_from('<I', data, 5)[0]:08X}"
        yield from reader(data, manifest, place.absolute().parents[1])
    except (struct.error, IndexError) as error:
        got = "a file that ends in the middle of a record, or that no export wrote"
        raise InputError.of_file(str(place), got, f"vectors as {MANIFEST} names them", "export again") from error


def _named(folder: Path, table: str) -> list[tuple[str, str]]:
    """Names and widths of the rows of a table."""
    with (folder / table).open(newline="", encoding="utf-8") as stream:
        return [(row["name"], row["width"]) for row in csv.DictReader(stream)]


def _value(width: str, bits: bytes) -> Any:
    return struct.unpack_from("<" + FORMATS[width], bits)[0]


def _place(names: Sequence[tuple[str, str]], data: bytes, at: int) -> str:
    """A register or a parameter with its value: number (2), element (2), value (8)."""
    number, element = struct.unpack_from("<HH", data, at)
    name, width = names[number]
    return f"{name}{f'[{element}]' if element else ''} = {_value(width, data[at + 4 : at + 12])}"


def _job(data: bytes, manifest: Mapping[str, Any], folder: Path) -> Iterator[str]:
    registers, parameters = _named(folder, "registers.csv"), _named(folder, "params.csv")
    image, ticks, at = int(manifest["image"]), 0, 9
    while True:
        kind, at = data[at], at + 1
        if kind == vectors.WRITE:
            yield f"write {_place(registers, data, at)}"
            at += 12
        elif kind == vectors.TICKS:
            (n,) = struct.unpack_from("<H", data, at)
            yield f"tick {ticks + 1}" + (f" to {ticks + n}" if n > 1 else "")
            ticks, at = ticks + n, at + 2 + n
        elif kind == vectors.CHECK:
            yield f"check {struct.unpack_from('<Q', data, at)[0]:016x}"
            at += 8 + image
        elif kind == vectors.SIGNAL:
            number, length = struct.unpack_from("<BI", data, at)
            width = manifest["signals"][number]
            size = struct.calcsize("<" + FORMATS[width])
            few = [_value(width, data[at + 5 + k * size :]) for k in range(min(length, SHOWN))]
            more = ", ..." if length > SHOWN else ""
            yield f"signal {number}: {length} values{': ' if few else ''}{', '.join(map(repr, few))}{more}"
            at += 5 + length * size
        elif kind == vectors.CALL:
            name, widths = manifest["calls"][data[at]]
            taken = struct.unpack_from("<" + "".join(FORMATS[one] for one in widths), data, at + 1)
            yield f"call {name}({', '.join(map(repr, taken))})"
            at += 1 + sum(struct.calcsize("<" + FORMATS[one]) for one in widths)
        elif kind == vectors.EXCHANGE:
            (n,) = struct.unpack_from("<H", data, at)
            yield f"parameters exchanged: {', '.join(_place(parameters, data, at + 2 + 12 * k) for k in range(n))}"
            at += 2 + 12 * n
        elif kind == vectors.END:
            ended, over_all = struct.unpack_from("<QQ", data, at)
            yield f"end after {ended} ticks; hash of the file {over_all:016x}"
            return
        else:
            raise IndexError(kind)


def _drawn(data: bytes, manifest: Mapping[str, Any], folder: Path) -> Iterator[str]:
    functions, at, done = [row[0] for row in _rows(folder)], 9, 0
    while True:
        kind, at = data[at], at + 1
        if kind == drawn.FUNCTION:
            number, calls = struct.unpack_from("<HI", data, at)
            yield f"function {functions[number]}: {calls} calls"
            at, done = at + 6, 0
        elif kind == drawn.MISUSE:
            yield f"misuse of {manifest['name']}_control: {struct.unpack_from('<I', data, at)[0]} ticks"
            at, done = at + 4, 0
        elif kind == drawn.STRETCH:
            (n,) = struct.unpack_from("<H", data, at)
            done += n
            yield f"  up to {done}: hash {struct.unpack_from('<Q', data, at + 2 + n)[0]:016x}"
            at += 10 + n
        elif kind == drawn.END:
            yield f"end; hash of the file {struct.unpack_from('<Q', data, at)[0]:016x}"
            return
        else:
            raise IndexError(kind)


def _rows(folder: Path) -> list[list[str]]:
    return [row.split(",") for row in (folder / "trace.csv").read_text(encoding="utf-8").splitlines()[1:]]
