"""Traces in files: HDF5 is the store, CSV and Parquet are for other people's tools.

| file | keeps | needs |
|---|---|---|
| ``.h5`` / ``.hdf5`` | columns in their exact width, units, descriptions, attributes | - |
| ``.csv`` | columns (every digit) and units; no descriptions or attributes | - |
| ``.parquet`` | everything | the extra ``parquet`` |
"""

import csv
import importlib
import io
import json
import os
import re
import warnings
from collections.abc import Callable, Generator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self, cast

import numpy as np
from numpy.typing import NDArray

from detent.errors import DetentError, InputError
from detent.files.apart import read_apart
from detent.files.text import check_file, write_errors, writing
from detent.record.trace import BROKEN_OFF, Attribute, Column, Trace, broke_off, check_columns

CHUNK_ROWS = 16384  # rows of one HDF5 chunk: 128 KiB of float64, inside h5py's chunk cache of 1 MiB per column
CSV_ROWS = 8192  # rows of text made at once: bounds the memory of a CSV file of any length
MAX_CSV = 2_000_000_000  # longest CSV file read [byte]
PARQUET_ROWS = 1 << 20  # rows of one Parquet row group
STORES = (".h5", ".hdf5")  # endings of the store's own files
GROUP = "trace"
FORMAT = "detent trace 1"
_HEADER = re.compile(r"(?P<name>.*?)(?: \[(?P<unit>[^\[\]]*)\])?")


# ---- the store


class _Disk(io.RawIOBase):
    """A file that takes every write: what the disk refuses stays in memory, and its error is raised by `check`.

    HDF5 cannot leave a file that it cannot write: the process crashed at its end.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("w+b", buffering=0)
        self._at = self._end = 0
        self._refused: OSError | None = None
        self._kept: list[tuple[int, bytes]] = []  # where each refused piece belongs

    def write(self, data: Any) -> int:
        """Take all of it, whatever the disk says."""
        piece, done = bytes(data), 0
        try:
            while done < len(piece) and self._refused is None:
                self._file.seek(self._at + done)
                done += self._file.write(piece[done:])
        except OSError as error:
            self._refused = error
        if done < len(piece):
            self._kept.append((self._at, piece))
        self._at += len(piece)
        self._end = max(self._end, self._at)
        return len(piece)

    def readinto(self, buffer: Any) -> int:
        """Read what was written, to the disk or not."""
        found = bytearray(len(buffer))
        self._file.seek(self._at)
        self._file.readinto(memoryview(found))
        for begin, piece in self._kept:
            first, last = max(begin, self._at), min(begin + len(piece), self._at + len(found))
            if first < last:
                found[first - self._at : last - self._at] = piece[first - begin : last - begin]
        buffer[:] = found
        self._at += len(found)
        return len(found)

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Go to a place."""
        self._at = offset + {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: self._end}[whence]
        return self._at

    def tell(self) -> int:
        """The place."""
        return self._at

    def truncate(self, size: int | None = None) -> int:
        """End the file here or there."""
        self._end = self._at if size is None else size
        try:
            self._file.truncate(self._end)
        except OSError as error:
            self._refused = self._refused or error
        return self._end

    def check(self) -> None:
        """Raise what the disk said."""
        if self._refused:
            raise self._refused

    def close(self) -> None:
        """Let go of the file."""
        self._file.close()
        super().close()


class Table(NamedTuple):
    """A trace, in memory or in an open HDF5 file, or rows of another kind, whose first column does not fall either."""

    columns: Mapping[str, Column]
    units: Mapping[str, str]
    docs: Mapping[str, str]
    attributes: Mapping[str, Attribute]


class TraceWriter:
    """Write a trace to HDF5 piece by piece, in constant memory, for runs of any length.

    Names and types of the columns, units, descriptions and attributes are those of `head`, its rows are not written.
    The file appears under its name when the writer is closed. Leaving the ``with`` block by an exception closes it
    too - what was recorded up to a failure is what one wants to look at - with the attribute ``complete`` = 0.

    >>> import numpy as np, tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "run.h5"
    >>> trace = Trace(columns={"t": np.array([0.0, 0.001]), "motor.current": np.array([0.0, 0.4])}, units={"t": "s"})
    >>> with TraceWriter(path, trace) as writer:
    ...     writer.append(trace.columns)
    >>> len(load_trace(path))
    2
    """

    def __init__(self, path: str | Path, head: Trace | Table, *, force: bool = False) -> None:
        self.path = Path(path)
        self.rows = 0
        self._last_time = -np.inf
        # A copy of a trace that broke off stays one that broke off.
        self._whole = not broke_off(head.attributes)
        with ExitStack() as stack:
            self._disk = _Disk(stack.enter_context(writing(self.path, force=force)))
            self._file: Any = _h5py().File(self._disk, "w")
            self._sets = self._write_head(head)
            self._naming = stack.pop_all()

    def _write_head(self, head: Trace | Table) -> dict[str, Any]:
        from detent import __version__

        root = self._file.attrs
        for name, value in {"detent_version": __version__, **head.attributes}.items():
            # A file name need not be valid UTF-8; HDF5 text must be.
            root[name] = value.encode("utf-8", "replace").decode() if isinstance(value, str) else value
        root["format"] = FORMAT
        root["complete"] = 0
        group = self._file.create_group(GROUP)
        group.attrs["columns"] = list(head.columns)  # HDF5 itself lists datasets by name, not in order
        kept: dict[str, Any] = {"maxshape": (None,), "chunks": (CHUNK_ROWS,), "shuffle": True}
        for name, column in head.columns.items():
            dataset = group.create_dataset(name, (0,), column.dtype, compression="gzip", compression_opts=1, **kept)
            dataset.attrs["unit"] = head.units.get(name, "")
            dataset.attrs["doc"] = head.docs.get(name, "")
        return {name: group[name] for name in head.columns}

    def append(self, rows: NDArray[np.void] | Mapping[str, Column]) -> None:
        """Add rows, given as such or as columns."""
        columns = rows if isinstance(rows, Mapping) else {name: rows[name] for name in (rows.dtype.names or ())}
        if self._file is None:
            raise DetentError(f"{self.path}: the trace is closed; append rows before close()")
        if list(columns) != list(self._sets):
            raise DetentError(f"{self.path}: got columns {list(columns)}, the file has {list(self._sets)}; send these")
        first = next(iter(columns))
        check_columns(columns, first)
        time = columns[first]
        if not time.size:
            return
        if time[0] < self._last_time:
            raise DetentError(
                f"{self.path}: a block starts at {time[0]!s} s, before the last row at {self._last_time!s} s; "
                "append blocks in order of time"
            )
        end = self.rows + time.size
        with write_errors(self.path):
            for name, values in columns.items():
                self._sets[name].resize((end,))
                self._sets[name][self.rows : end] = values
            self._disk.check()
        self.rows, self._last_time = end, time[-1]

    def note(self, name: str, text: str) -> None:
        """Put a text beside the columns; `read_note` reads it."""
        self._file[name] = text

    def close(self, *, complete: bool = True) -> None:
        """Finish the file and give it its name; a second call does nothing."""
        if self._file is None:
            return
        with self._naming:
            file, self._file = self._file, None
            file.attrs["complete"] = int(complete and self._whole)
            file.close()
            self._disk.close()
            self._disk.check()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close(complete=kind is None)


SAMPLES, SAMPLE_ROWS = 5, 100  # stretches of a trace, and rows of each, that tell how long its rows are as text


def save_table(table: Table, path: str | Path, *, force: bool = False) -> None:
    """Write columns in the format its suffix names; in place of a file that detent did not write by `force` only."""
    suffix = Path(path).suffix.lower()
    if suffix in STORES:
        with TraceWriter(path, table, force=force) as writer:
            writer.append(table.columns)
    elif suffix in _WRITERS:
        _WRITERS[suffix](table, Path(path), force=force)
    else:
        allowed = ", ".join([*STORES, *_WRITERS])
        raise DetentError(f"{path}: a trace cannot be saved as {suffix!r}; use one of {allowed}")


@contextmanager
def _open_store(path: Path) -> Generator[Table]:
    """The trace in an HDF5 file; the file's format is its own affair."""
    try:
        file: Any = _h5py().File(path, "r")
    except OSError as error:
        got = " ".join(str(error).split())
        raise InputError.of_file(str(path), got, "a trace in HDF5", "give a .h5 file that detent wrote") from error
    with file:
        if GROUP not in file or "columns" not in file[GROUP].attrs:
            raise InputError.of_file(
                str(path), f"HDF5 with {', '.join(file) or 'nothing'}", f"a group /{GROUP}", "give a trace of detent"
            )
        columns = {str(name): file[GROUP][name] for name in file[GROUP].attrs["columns"]}
        units, docs = ({name: str(one.attrs[key]) for name, one in columns.items()} for key in ("unit", "doc"))
        told = {name: value for name, value in file.attrs.items() if name != "format"}
        yield Table(columns, units, docs, {name: _plain(value) for name, value in told.items()})


def read_note(path: Path, name: str) -> str:
    """A text that stands beside the columns of an HDF5 trace; empty where there is none."""
    with _open_store(path), _h5py().File(path, "r") as file:
        return file[name].asstr()[()] if name in file else ""


def _plain(value: Any) -> Any:
    """A number of numpy's as one of Python's."""
    return getattr(value, "item", lambda: value)()


def _load_hdf5(path: Path) -> Trace:
    with _open_store(path) as held:
        columns: Any = {name: values[()] for name, values in held.columns.items()}
        return Trace(columns=columns, units={**held.units}, docs={**held.docs}, attributes={**held.attributes})


def _h5py() -> Any:
    return importlib.import_module("h5py")


# ---- for other tools


def write_csv(path: Path, columns: Mapping[str, Column], *, force: bool = False) -> None:
    """Write columns as CSV, piece by piece: a row of their headings, then a row per moment.

    Floats carry every digit needed to read the same bits back (17 at most), integers stay integers, booleans
    become 0 and 1.
    """
    with writing(path, force=force) as part, part.open("w", encoding="utf-8", newline="") as stream:
        csv.writer(stream, lineterminator="\n").writerow(columns)
        for first in range(0, len(next(iter(columns.values()))), CSV_ROWS):
            texts = [_texts(values[first : first + CSV_ROWS]) for values in columns.values()]
            # No cell needs quotes, so joining strings does what csv.writer does in half the time.
            stream.write("\n".join(map(",".join, zip(*texts, strict=True))) + "\n")


def _texts(values: Column) -> list[str]:
    """Give the shortest text of each value that reads back as the same bits."""
    if values.dtype.kind == "b":
        values = values.view(np.uint8)
    return list(map(repr, values.tolist()))


def _write_parquet(table: Table, path: Path, *, force: bool) -> None:
    """Write columns as Parquet, group by group; units and descriptions are their metadata, attributes the schema's."""
    arrow, parquet = need_parquet()
    kinds = {name: arrow.from_numpy_dtype(values.dtype) for name, values in table.columns.items()}
    told = {name: {"unit": table.units.get(name, ""), "doc": table.docs.get(name, "")} for name in kinds}
    fields = [arrow.field(name, kind, metadata=told[name]) for name, kind in kinds.items()]
    schema = arrow.schema(fields, metadata={"detent": json.dumps({"format": FORMAT, **table.attributes})})
    with writing(path, force=force) as part, parquet.ParquetWriter(part, schema) as writer:
        for first in range(0, len(next(iter(table.columns.values()))), PARQUET_ROWS):
            block = [arrow.array(values[first : first + PARQUET_ROWS]) for values in table.columns.values()]
            writer.write_table(arrow.table(block, schema=schema))


def _write_table_csv(table: Table, path: Path, *, force: bool) -> None:
    """A header row such as ``t [s],motor.current [A]``; descriptions and attributes are not in the file.

    Nor can it say that the run broke off: such a trace would pass for a whole one.
    """
    if broke_off(table.attributes):
        raise DetentError(
            f"{path}: got {BROKEN_OFF[0]}, which CSV cannot say; expected: {BROKEN_OFF[1]}; save it as .h5 or "
            '.parquet, or mark it as complete: attributes["complete"] = 1'
        )
    units = table.units
    labels = {name: f"{name} [{units[name]}]" if units.get(name) else name for name in table.columns}
    write_csv(path, {labels[name]: values for name, values in table.columns.items()}, force=force)


_WRITERS: dict[str, Callable[..., None]] = {".csv": _write_table_csv, ".parquet": _write_parquet}


def convert_trace(store: str | Path, path: str | Path, *, force: bool = False) -> None:
    """Write an HDF5 trace again as CSV or Parquet, in constant memory however long it is."""
    suffix = Path(path).suffix.lower()
    if suffix not in _WRITERS:
        raise DetentError(f"{path}: a trace cannot be converted to {suffix!r}; use {' or '.join(_WRITERS)}")
    with _open_store(Path(store)) as table:
        _WRITERS[suffix](table, Path(path), force=force)


def size_as_csv(store: str | Path) -> int:
    """Bytes that an HDF5 trace would take as CSV, about: some of its rows tell."""
    with _open_store(Path(store)) as table:
        rows = len(next(iter(table.columns.values()), ()))
        begins = sorted({rows * part // SAMPLES for part in range(SAMPLES)})
        taken = [values[k : k + SAMPLE_ROWS].tolist() for values in table.columns.values() for k in begins]
        looked_at = sum(min(SAMPLE_ROWS, rows - k) for k in begins)
        return sum(len(str(value)) + 1 for values in taken for value in values) * rows // max(looked_at, 1)


def save_trace(trace: Trace, path: str | Path, *, force: bool = False) -> None:
    """Write a trace in the format its suffix names; in place of a file that detent did not write by `force` only."""
    save_table(Table(trace.columns, trace.units, trace.docs, trace.attributes), path, force=force)


def load_trace(path: str | Path) -> Trace:
    """Read a trace written by detent, or a CSV file of the same form.

    Parameters
    ----------
    path : str or Path
        A file ending in ``.h5``, ``.hdf5``, ``.csv`` or ``.parquet``.

    Returns
    -------
    Trace
        From HDF5 and Parquet the same columns, bit for bit; from CSV integers come back as int64, floats as float64.

    Raises
    ------
    InputError
        The file is absent, is not a trace, or has a suffix detent does not read.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in _LOADERS:
        raise InputError.of_file(str(path), f"suffix {suffix!r}", ", ".join(_LOADERS), "give a trace in one of these")
    if not path.is_file():
        raise InputError.of_file(str(path), "no such file", "a trace file", "check the name and the folder")
    return _load(path) if suffix == ".csv" else read_apart(_load, path, "a trace")


def _load(path: Path) -> Trace:
    try:
        return _LOADERS[path.suffix.lower()](path)
    except (InputError, MemoryError):
        raise
    except Exception as error:
        if isinstance(error, DetentError) and not str(error).startswith("trace:"):
            raise
        got = " ".join(str(error).split()) or type(error).__name__
        remedy = "save it again with detent, or give another file"
        raise InputError.of_file(str(path), got, "a trace", remedy) from error


def _load_parquet(path: Path) -> Trace:
    _, parquet = need_parquet()
    table = parquet.read_table(path)
    attributes: dict[str, Attribute] = trace_attributes(table.schema.metadata)
    attributes.pop("format", None)
    told: dict[str, dict[bytes, bytes]] = {field.name: field.metadata or {} for field in table.schema}
    columns: dict[str, Column] = {name: table.column(name).to_numpy() for name in told}
    units, docs = ({name: held.get(key, b"").decode() for name, held in told.items()} for key in (b"unit", b"doc"))
    return Trace(columns=columns, units=units, docs=docs, attributes=attributes)


def trace_attributes(metadata: Mapping[bytes, bytes] | None) -> dict[str, Any]:
    """Attributes of a trace, with its ``format``, in the metadata of a Parquet file; none in a file of others."""
    found: Any = json.loads((metadata or {}).get(b"detent", b"{}"))
    return cast("dict[str, Any]", found) if isinstance(found, dict) else {}


def _load_csv(path: Path) -> Trace:
    check_file(path, MAX_CSV, "a trace")
    with path.open(encoding="utf-8-sig", newline="") as stream:
        rows = csv.reader(stream)
        empty: list[str] = []
        header, first = next(rows, empty), next(rows, empty)
    names: list[str] = []
    units: dict[str, str] = {}
    for cell in header:
        match = _HEADER.fullmatch(cell.strip())
        name, unit = (match["name"], match["unit"] or "") if match else (cell, "")
        if name in units:
            raise InputError.of_file(str(path), f"two columns {name!r}", "one of each", "rename one of them")
        names.append(name)
        units[name] = unit
    if not first:
        return Trace(columns={name: np.empty(0) for name in names}, units=units)
    return Trace(columns=dict(zip(names, _read_columns(path, first), strict=True)), units=units)


def _read_columns(path: Path, first: list[str]) -> list[Column]:
    """Read all rows; a column whose first cell has no point, exponent or word is one of integers."""
    kinds = ["i8" if re.fullmatch(r"\s*[+-]?\d+\s*", cell) else "f8" for cell in first]
    options: dict[str, Any] = {"delimiter": ",", "skiprows": 1, "ndmin": 1, "encoding": "utf-8-sig", "comments": None}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # older NumPy cuts 0.5 down to 0 as well, with a warning
            table = np.loadtxt(path, dtype=[(f"c{index}", kind) for index, kind in enumerate(kinds)], **options)
    except (ValueError, DeprecationWarning):
        # Other people's tools write 0 for 0.0: then the first row misleads and every number is read as a float.
        table = np.loadtxt(path, dtype=[(f"c{index}", "f8") for index in range(len(kinds))], **options)
    return [np.ascontiguousarray(table[f"c{index}"]) for index in range(len(kinds))]


_LOADERS: dict[str, Callable[[Path], Trace]] = {
    ".h5": _load_hdf5, ".hdf5": _load_hdf5, ".csv": _load_csv, ".parquet": _load_parquet,
}  # fmt: skip


def need_parquet() -> tuple[Any, Any]:
    """The modules for Parquet; asked for before any work, so that nothing fails at its end."""
    try:
        return importlib.import_module("pyarrow"), importlib.import_module("pyarrow.parquet")
    except ImportError as error:
        raise DetentError(
            'Parquet needs pyarrow, which is not installed; try: pip install "detent[parquet]", or save as .h5 or .csv'
        ) from error
