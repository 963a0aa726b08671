"""Traces in files: HDF5 is the store, CSV and Parquet are for other people's tools.

| file | keeps | needs |
|---|---|---|
| ``.h5`` / ``.hdf5`` | columns in their exact width, units, descriptions, attributes | - |
| ``.csv`` | columns (every digit) and units; no descriptions or attributes | - |
| ``.parquet`` | everything | the extra ``parquet`` |

Every writer fills a ``.part`` file beside the target and renames it at the end: a file with the right name is whole.
"""

import csv
import importlib
import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from detent.errors import DetentError, InputError
from detent.record.trace import TIME, Attribute, Column, Trace
from detent.record.trace_store import FORMAT, GROUP, attributes_of, load_hdf5, open_store, part_of, save_hdf5, writing

CSV_ROWS = 8192  # rows of text made at once: bounds the memory of a CSV file of any length
STORES = (".h5", ".hdf5")  # endings of the store's own files
PARQUET_ROWS = 1 << 20  # rows of one Parquet row group
_HEADER = re.compile(r"(?P<name>.*?)(?: \[(?P<unit>[^\[\]]*)\])?")


def _write_csv(table: "_Table", path: Path) -> None:
    """Write columns as CSV, piece by piece: a header row such as ``t [s],motor.current [A]``, then a row per moment.

    Floats carry every digit needed to read the same bits back (17 at most), integers stay integers, booleans
    become 0 and 1. Descriptions and attributes are not in the file.
    """
    part, columns, units = part_of(path), table.columns, table.units
    with writing(path):
        with part.open("w", encoding="utf-8", newline="") as stream:
            labels = [f"{name} [{units[name]}]" if units.get(name) else name for name in columns]
            csv.writer(stream, lineterminator="\n").writerow(labels)
            for first in range(0, len(columns[TIME]), CSV_ROWS):
                texts = [_texts(values[first : first + CSV_ROWS]) for values in columns.values()]
                # No cell needs quotes, so joining strings does what csv.writer does in half the time.
                stream.write("\n".join(map(",".join, zip(*texts, strict=True))) + "\n")
        part.replace(path)


def _texts(values: Column) -> list[str]:
    """Give the shortest text of each value that reads back as the same bits."""
    if values.dtype.kind == "b":
        values = values.view(np.uint8)
    return list(map(repr, values.tolist()))


def _write_parquet(table: "_Table", path: Path) -> None:
    """Write columns as Parquet, group by group; units and descriptions are their metadata, attributes the schema's."""
    arrow, parquet = need_parquet()
    kinds = {name: arrow.from_numpy_dtype(values.dtype) for name, values in table.columns.items()}
    told = {name: {"unit": table.units.get(name, ""), "doc": table.docs.get(name, "")} for name in kinds}
    fields = [arrow.field(name, kind, metadata=told[name]) for name, kind in kinds.items()]
    schema = arrow.schema(fields, metadata={"detent": json.dumps({"format": FORMAT, **table.attributes})})
    part = part_of(path)
    with writing(path):
        with parquet.ParquetWriter(part, schema) as writer:
            for first in range(0, len(table.columns[TIME]), PARQUET_ROWS):
                block = [arrow.array(values[first : first + PARQUET_ROWS]) for values in table.columns.values()]
                writer.write_table(arrow.table(block, schema=schema))
        part.replace(path)


class _Table(NamedTuple):
    """What a writer takes of a trace, in memory or in an open HDF5 file."""

    columns: Mapping[str, Column]
    units: Mapping[str, str]
    docs: Mapping[str, str]
    attributes: Mapping[str, Attribute]


_WRITERS: dict[str, Callable[[_Table, Path], None]] = {".csv": _write_csv, ".parquet": _write_parquet}


def convert_trace(store: str | Path, path: str | Path) -> None:
    """Write an HDF5 trace again as CSV or Parquet, in constant memory however long it is."""
    suffix = Path(path).suffix.lower()
    if suffix not in _WRITERS:
        raise DetentError(f"{path}: a trace cannot be converted to {suffix!r}; use {' or '.join(_WRITERS)}")
    with open_store(Path(store)) as file:
        columns = {str(name): file[GROUP][name] for name in file[GROUP].attrs["columns"]}
        units, docs = ({name: str(one.attrs[key]) for name, one in columns.items()} for key in ("unit", "doc"))
        _WRITERS[suffix](_Table(columns, units, docs, attributes_of(file)), Path(path))


def save_trace(trace: Trace, path: str | Path) -> None:
    """Write a trace in the format its suffix names."""
    suffix = Path(path).suffix.lower()
    if suffix in STORES:
        save_hdf5(trace, path)
    elif suffix in _WRITERS:
        _WRITERS[suffix](_Table(trace.columns, trace.units, trace.docs, trace.attributes), Path(path))
    else:
        allowed = ", ".join([*STORES, *_WRITERS])
        raise DetentError(f"{path}: a trace cannot be saved as {suffix!r}; use one of {allowed}")


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
    readers: dict[str, Callable[[Path], Trace]] = {
        ".h5": load_hdf5, ".hdf5": load_hdf5, ".csv": _load_csv, ".parquet": _load_parquet,
    }  # fmt: skip
    suffix = path.suffix.lower()
    if suffix not in readers:
        raise InputError.of_file(str(path), f"suffix {suffix!r}", ", ".join(readers), "give a trace in one of these")
    if not path.is_file():
        raise InputError.of_file(str(path), "no such file", "a trace file", "check the name and the folder")
    try:
        return readers[suffix](path)
    except InputError:
        raise
    except (OSError, ValueError, KeyError, TypeError, DetentError) as error:
        if isinstance(error, DetentError) and not str(error).startswith("trace:"):
            raise
        came = " ".join(str(error).split()) or type(error).__name__
        remedy = "save it again with detent, or give another file"
        raise InputError.of_file(str(path), came, "a trace", remedy) from error


def _load_parquet(path: Path) -> Trace:
    _, parquet = need_parquet()
    table = parquet.read_table(path)
    head: dict[bytes, bytes] = table.schema.metadata or {}
    attributes: dict[str, Attribute] = json.loads(head.get(b"detent", b"{}"))
    attributes.pop("format", None)
    told: dict[str, dict[bytes, bytes]] = {field.name: field.metadata or {} for field in table.schema}
    columns: dict[str, Column] = {name: table.column(name).to_numpy() for name in told}
    units, docs = ({name: held.get(key, b"").decode() for name, held in told.items()} for key in (b"unit", b"doc"))
    return Trace(columns=columns, units=units, docs=docs, attributes=attributes)


def _load_csv(path: Path) -> Trace:
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
        table = np.loadtxt(path, dtype=[(f"c{index}", kind) for index, kind in enumerate(kinds)], **options)
    except ValueError:
        # Other people's tools write 0 for 0.0: then the first row misleads and every number is read as a float.
        table = np.loadtxt(path, dtype=[(f"c{index}", "f8") for index in range(len(kinds))], **options)
    return [np.ascontiguousarray(table[f"c{index}"]) for index in range(len(kinds))]


def need_parquet() -> tuple[Any, Any]:
    """The modules for Parquet; asked for before any work, so that nothing fails at its end."""
    try:
        return importlib.import_module("pyarrow"), importlib.import_module("pyarrow.parquet")
    except ImportError as error:
        raise DetentError(
            'Parquet needs pyarrow, which is not installed; do: pip install "detent[parquet]", or save as .h5 or .csv'
        ) from error
