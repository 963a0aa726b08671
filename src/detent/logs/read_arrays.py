"""Recordings as files of arrays: MATLAB up to version 7, NumPy's NPZ, and Parquet, where pyarrow is installed."""

import importlib
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from detent.errors import InputError
from detent.files.text import check_file
from detent.logs.csv_layout import FileOptions
from detent.logs.log_units import split_heading
from detent.logs.raw_table import MAX_CELLS, Item, RawTable, check_size, no_table, table_of, whole
from detent.logs.read_hdf5 import MAX_BYTES as MAX_COLUMNAR
from detent.logs.read_hdf5 import read_hdf5
from detent.logs.windows import scipy

MAX_BYTES = 500_000_000  # largest file of arrays read, Parquet aside
ALLOWED_MAT = "a MATLAB file with vectors of equal length"
ALLOWED_NPZ = "an NPZ or NPY file with vectors of equal length"
ALLOWED_PARQUET = "a Parquet file with columns of numbers"

_DEEPEST = 4


def read_mat(path: Path, options: FileOptions) -> RawTable:
    """Read a MATLAB file: version 4 to 7 with SciPy, version 7.3, which is HDF5, as such.

    Fields of structures give names joined by points; ``table`` names the structure to read.
    """
    check_file(path, MAX_BYTES, ALLOWED_MAT)
    with whole(path, "MATLAB", ALLOWED_MAT, "save it again with save -v7, or as CSV"):
        try:
            cells = sum(int(np.prod(shape, dtype=object)) for _, shape, _ in scipy("io").whosmat(path))
            if cells > MAX_CELLS:
                raise _too_much(path, f"{cells} numbers", f"{ALLOWED_MAT}, up to {MAX_CELLS} numbers")
            found: dict[str, Any] = scipy("io").loadmat(path, squeeze_me=True, struct_as_record=True)
        except NotImplementedError:
            return read_hdf5(path, options)
    items = [item for name, value in found.items() if not name.startswith("__") for item in _fields(name, value, 0)]
    return table_of(str(path), _inside(str(path), items, options.table), ALLOWED_MAT)


def read_npz(path: Path, options: FileOptions) -> RawTable:
    """Read arrays saved by NumPy, as NPZ or as one structured or plain NPY; pickled objects are refused."""
    check_file(path, MAX_BYTES, ALLOWED_NPZ)
    items: list[Item] = []
    with whole(path, "NPZ", ALLOWED_NPZ, "save it again with numpy.savez, or as CSV"), path.open("rb") as stream:
        if zipfile.is_zipfile(stream):
            with zipfile.ZipFile(path) as archive:
                size = sum(entry.file_size for entry in archive.infolist())
            if size > 8 * MAX_CELLS:
                most = f"up to {8 * MAX_CELLS // 1_000_000} MB unpacked"
                raise _too_much(path, f"{size // 1_000_000} MB unpacked", most)
            with np.load(path, allow_pickle=False) as arrays:
                for name in arrays.files:
                    items += _fields(name, _load_member(arrays, name), 0)
        else:
            stream.seek(0)  # whether it is an archive was asked at its end
            array = np.load(stream, allow_pickle=False)
            items = list(_fields("" if array.dtype.names else "column", array, 0))
    return table_of(str(path), _inside(str(path), items, options.table), ALLOWED_NPZ)


def read_parquet(path: Path, options: FileOptions) -> RawTable:
    """Read a Parquet file; the metadata ``unit`` of a field, as detent's traces have it, is its unit."""
    del options
    check_file(path, MAX_COLUMNAR, ALLOWED_PARQUET)
    try:
        parquet: Any = importlib.import_module("pyarrow.parquet")
    except ImportError:
        remedy = 'pip install "detent[parquet]", or save the recording as CSV or HDF5'
        came = "a file that needs pyarrow, which is not installed"
        raise InputError.of_file(str(path), came, ALLOWED_PARQUET, remedy) from None
    with whole(path, "Parquet", ALLOWED_PARQUET), parquet.ParquetFile(path) as file:
        check_size(str(path), file.metadata.num_rows, len(file.schema_arrow))
        items = [_column(field, values) for field, values in zip(file.schema_arrow, file.read().columns, strict=True)]
    return table_of(str(path), items, ALLOWED_PARQUET)


def _column(field: Any, column: Any) -> Item:
    """A column of a Parquet file with its unit; one of anything but numbers and moments has no value."""
    metadata: dict[bytes, bytes] = field.metadata or {}
    unit = metadata.get(b"unit", b"").decode("utf-8", "replace") or split_heading(field.name)[1]
    values: Any = column.to_numpy()
    if values.dtype.kind == "O":
        try:  # truth values and decimals with gaps come as objects
            values = values.astype(np.float64)
        except (ValueError, TypeError):
            values = None
    return Item(field.name, values, unit)


def _load_member(arrays: Any, name: str) -> Any:
    """One array of an NPZ file; None for one of pickled objects."""
    try:
        return arrays[name]
    except ValueError as error:
        if "pickle" in str(error):
            return None
        raise


def _too_much(path: Path, came: str, allowed: str) -> InputError:
    """What would fill the memory, before it is read."""
    return InputError.of_file(str(path), came, allowed, "cut the recording into pieces")


def _fields(name: str, value: Any, depth: int) -> Iterator[Item]:
    """What a value of a MATLAB file holds: fields of a structure under names joined by points."""
    kind: np.dtype[Any] | None = getattr(value, "dtype", None)
    if kind is not None and kind.names:
        if kind.hasobject and (value.size != 1 or depth >= _DEEPEST):
            return
        record: Any = value.reshape(-1)[0] if kind.hasobject else value
        for field in kind.names:
            yield from _fields(f"{name}.{field}" if name else field, record[field], depth + 1)
    else:
        yield Item(name, value, split_heading(name)[1])


def _inside(file: str, items: list[Item], table: str) -> list[Item]:
    """Items of one structure, or all."""
    if not table:
        return items
    found = [item for item in items if item.name == table or item.name.startswith(f"{table}.")]
    if not found:
        raise no_table(file, table, sorted({item.name.partition(".")[0] for item in items}))
    return [item._replace(name=item.name.removeprefix(f"{table}.")) for item in found]
