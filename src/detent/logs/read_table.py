"""The columns of a recording, whatever its kind of file."""

from collections.abc import Callable
from pathlib import Path

from detent.errors import InputError
from detent.files.file_bytes import kind_of
from detent.logs.csv_layout import FileOptions
from detent.logs.raw_table import RawTable
from detent.logs.read_arrays import read_mat, read_npz
from detent.logs.read_csv import read_csv
from detent.logs.read_hdf5 import read_hdf5
from detent.logs.read_json import read_json
from detent.logs.read_parquet import read_parquet

READERS: dict[str, Callable[[Path, FileOptions], RawTable]] = {
    ".csv": read_csv, ".tsv": read_csv, ".txt": read_csv, ".dat": read_csv, ".log": read_csv,
    ".json": read_json, ".jsonl": read_json, ".ndjson": read_json,
    ".h5": read_hdf5, ".hdf5": read_hdf5, ".mat": read_mat, ".npz": read_npz, ".npy": read_npz,
    ".parquet": read_parquet,
}  # fmt: skip
"""Reader of each kind of file, by the ending of its name."""

_TEXTS = frozenset(kind for kind, reader in READERS.items() if reader in {read_csv, read_json})


def read_table(path: str | Path, options: FileOptions | None = None) -> RawTable:
    """Read the columns of a recording."""
    path = Path(path)
    kind = kind_of(path)
    is_packed = path.suffix.lower() == ".gz"
    if kind not in READERS or (is_packed and kind not in _TEXTS):
        came = f'a name that ends in "{path.suffix}"' if path.suffix else "a name without an ending"
        remedy = "give the file the ending of its kind, or save it as one of these"
        raise InputError.of_file(str(path), came, f"{', '.join(READERS)}; text also with .gz", remedy)
    return READERS[kind](path, options or FileOptions())
