"""Traces in HDF5, the store: columns in their exact width, units, descriptions and attributes.

Every writer fills a ``.part`` file beside the target and renames it at the end: a file with the right name is whole.
"""

import importlib
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from detent.errors import DetentError, InputError
from detent.record.trace import TIME, Attribute, Column, Trace, check_columns

CHUNK_ROWS = 16384  # rows of one HDF5 chunk: 128 KiB of float64, inside h5py's chunk cache of 1 MiB per column
GROUP = "trace"
FORMAT = "detent trace 1"


def save_hdf5(trace: Trace, path: str | Path) -> None:
    """Write a trace as HDF5: one dataset per column under ``/trace``, units in attributes."""
    dtype = np.dtype([(name, values.dtype) for name, values in trace.columns.items()])
    with TraceWriter(path, dtype, units=trace.units, docs=trace.docs, attributes=trace.attributes) as writer:
        writer.append_columns(trace.columns)


class TraceWriter:
    """Write a trace to HDF5 piece by piece, in constant memory, for runs of any length.

    The file appears under its name when the writer is closed; until then it is beside it as ``.part``. Leaving the
    ``with`` block by an exception closes it too - what was recorded up to a failure is what one wants to look at - with
    the attribute ``complete`` = 0.

    >>> import numpy as np, tempfile, pathlib
    >>> row = np.dtype([("t", "f8"), ("motor.current", "f8")])
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "run.h5"
    >>> with TraceWriter(path, row, units={"t": "s", "motor.current": "A"}) as writer:
    ...     writer.append(np.array([(0.0, 0.0), (0.001, 0.4)], dtype=row))
    >>> len(load_hdf5(path))
    2
    """

    def __init__(
        self,
        path: str | Path,
        dtype: np.dtype[Any],
        *,
        units: Mapping[str, str] | None = None,
        docs: Mapping[str, str] | None = None,
        attributes: Mapping[str, Attribute] | None = None,
    ) -> None:
        self._names = tuple(dtype.names or ())
        # An empty trace of these columns must be a trace: this checks the names and the kinds of number.
        empty = Trace(
            columns={name: np.empty(0, dtype[name]) for name in self._names},
            units=dict(units or {}),
            docs=dict(docs or {}),
            attributes=dict(attributes or {}),
        )
        self.path = Path(path)
        self.rows = 0
        self._last_time = -np.inf
        self._part = part_of(self.path)
        with writing(self.path):
            self._file: Any = _h5py().File(self._part, "w")
        self._write_head(empty)

    def _write_head(self, empty: Trace) -> None:
        from detent import __version__

        root = self._file.attrs
        for name, value in {"detent_version": __version__, **empty.attributes}.items():
            # A file name need not be valid UTF-8; HDF5 text must be.
            root[name] = value.encode("utf-8", "replace").decode() if isinstance(value, str) else value
        root["format"] = FORMAT
        # A copy of a trace that broke off stays one that broke off.
        self._whole = bool(empty.attributes.get("complete", 1))
        root["complete"] = 0
        group = self._file.create_group(GROUP)
        group.attrs["columns"] = list(self._names)  # HDF5 itself lists datasets by name, not in order
        self._sets: dict[str, Any] = {}
        kept: dict[str, Any] = {"maxshape": (None,), "chunks": (CHUNK_ROWS,), "shuffle": True}
        for name, column in empty.columns.items():
            dataset = group.create_dataset(name, (0,), column.dtype, compression="gzip", compression_opts=1, **kept)
            dataset.attrs["unit"] = empty.units.get(name, "")
            dataset.attrs["doc"] = empty.docs.get(name, "")
            self._sets[name] = dataset

    def append(self, block: NDArray[np.void]) -> None:
        """Add rows."""
        self.append_columns({name: block[name] for name in (block.dtype.names or ())})

    def append_columns(self, columns: Mapping[str, Column]) -> None:
        """Add rows given as columns."""
        if self._file is None:
            raise DetentError(f"{self.path}: the trace is closed; append rows before close()")
        if tuple(columns) != self._names:
            raise DetentError(f"{self.path}: got columns {list(columns)}, the file has {list(self._names)}; send these")
        check_columns(columns)
        time = columns[TIME]
        if not time.size:
            return
        if time[0] < self._last_time:
            raise DetentError(
                f"{self.path}: a block starts at {time[0]!s} s, before the last row at {self._last_time!s} s; "
                "append blocks in order of time"
            )
        end = self.rows + time.size
        with writing(self.path):
            for name, values in columns.items():
                self._sets[name].resize((end,))
                self._sets[name][self.rows : end] = values
        self.rows, self._last_time = end, time[-1]

    def close(self, *, complete: bool = True) -> None:
        """Finish the file and give it its name; a second call does nothing."""
        if self._file is None:
            return
        with writing(self.path):
            self._file.attrs["complete"] = int(complete and self._whole)
            self._file.close()
            self._file = None
            self._part.replace(self.path)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close(complete=kind is None)


def load_hdf5(path: Path) -> Trace:
    """Read a trace from its store, bit for bit."""
    with open_store(path) as file:
        group = file[GROUP]
        names = [str(name) for name in group.attrs["columns"]]
        return Trace(
            columns={name: group[name][()] for name in names},
            units={name: str(group[name].attrs["unit"]) for name in names},
            docs={name: str(group[name].attrs["doc"]) for name in names},
            attributes=attributes_of(file),
        )


@contextmanager
def open_store(path: Path) -> Generator[Any]:
    """An HDF5 file that holds a trace."""
    try:
        file: Any = _h5py().File(path, "r")
    except OSError as error:
        came = " ".join(str(error).split())
        raise InputError.of_file(str(path), came, "a trace in HDF5", "give a .h5 file that detent wrote") from error
    with file:
        if GROUP not in file or "columns" not in file[GROUP].attrs:
            raise InputError.of_file(
                str(path), f"HDF5 with {', '.join(file) or 'nothing'}", f"a group /{GROUP}", "give a trace of detent"
            )
        yield file


def attributes_of(file: Any) -> dict[str, Attribute]:
    """What the run said about itself; the format is the store's own."""
    held = {name: value for name, value in file.attrs.items() if name != "format"}
    return {name: value.item() if isinstance(value, np.generic) else value for name, value in held.items()}


def part_of(path: Path) -> Path:
    """Name under which a file is written until it is whole."""
    return path.with_name(path.name + ".part")


@contextmanager
def writing(path: Path) -> Generator[None]:
    """Turn the system's refusal to write into an error that says what to do."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise DetentError(f"{path}: cannot be written ({reason}); choose another place or make room") from error


def _h5py() -> Any:
    return importlib.import_module("h5py")
