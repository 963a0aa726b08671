"""Recordings in Parquet, where pyarrow is installed."""

import importlib
from pathlib import Path
from typing import Any

import numpy as np

from detent.errors import InputError
from detent.files.text import check_file
from detent.logs.csv_layout import FileOptions
from detent.logs.log_units import split_heading
from detent.logs.raw_table import Item, RawTable, check_size, table_of, whole

MAX_BYTES = 2_000_000_000  # largest file read; what counts is how many numbers it holds
ALLOWED = "a Parquet file with columns of numbers"


def read_parquet(path: Path, options: FileOptions) -> RawTable:
    """Read a Parquet file; the metadata ``unit`` of a field, as detent's traces have it, is its unit."""
    del options
    check_file(path, MAX_BYTES, ALLOWED)
    try:
        parquet: Any = importlib.import_module("pyarrow.parquet")
    except ImportError:
        remedy = 'pip install "detent[parquet]", or save the recording as CSV or HDF5'
        came = "a file that needs pyarrow, which is not installed"
        raise InputError.of_file(str(path), came, ALLOWED, remedy) from None
    with whole(path, "Parquet", ALLOWED), parquet.ParquetFile(path) as file:
        check_size(str(path), file.metadata.num_rows, len(file.schema_arrow))
        items = [_item(field, column) for field, column in zip(file.schema_arrow, file.read().columns, strict=True)]
    return table_of(str(path), items, ALLOWED)


def _item(field: Any, column: Any) -> Item:
    """A column with its unit; one of anything but numbers and moments has no value."""
    metadata: dict[bytes, bytes] = field.metadata or {}
    unit = metadata.get(b"unit", b"").decode("utf-8", "replace") or split_heading(field.name)[1]
    values: Any = column.to_numpy()
    if values.dtype.kind == "O":
        try:  # truth values and decimals with gaps come as objects
            values = values.astype(np.float64)
        except (ValueError, TypeError):
            values = None
    return Item(field.name, values, unit)
