"""Recordings in HDF5: detent's own traces, MATLAB 7.3, and what other programs write."""

import importlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from detent.errors import InputError
from detent.files.text import check_file
from detent.logs.csv_layout import FileOptions
from detent.logs.log_units import split_heading
from detent.logs.raw_table import MAX_CELLS, MAX_COLUMNS, MAX_CONSTANTS, Item, RawTable, no_table, table_of, tell, whole

MAX_BYTES = 2_000_000_000  # largest file read; what counts is how many numbers are taken from it
ALLOWED = "an HDF5 file with vectors of equal length"

_UNIT_NAMES = ("unit", "units", "Unit", "Units")
_DEEPEST = 6


def read_hdf5(path: Path, options: FileOptions) -> RawTable:
    """Read the datasets of an HDF5 file; links out of the file are not followed.

    Of a file with several groups that hold vectors, the one with the most is read unless ``table`` names another.
    Units stand in an attribute ``unit`` or ``units`` of a dataset.
    """
    import h5py

    check_file(path, MAX_BYTES, ALLOWED)
    with whole(path, "HDF5", ALLOWED), h5py.File(path, "r") as file:
        items, notes = _read_file(str(path), file, options.table.strip("/"))
    table = table_of(str(path), items, ALLOWED)
    table.notes += notes
    return table


def _read_file(path: str, file: Any, wanted: str) -> tuple[list[Item], list[str]]:
    """Datasets of the chosen group with their names inside it, and what had to be chosen."""
    h5py: Any = importlib.import_module("h5py")
    found = list(_datasets(file, 0, {int(h5py.h5o.get_info(file.id).addr)}))
    groups: dict[str, list[Any]] = {}
    for dataset in found:
        groups.setdefault(dataset.name.strip("/").rpartition("/")[0], []).append(dataset)
    chosen, notes = wanted, list[str]()
    if not wanted and groups:
        # The columns of a run stand side by side; single values may stand anywhere.
        chosen = max(groups, key=lambda name: sum(_is_vector(dataset) for dataset in groups[name]))
        others = [name or "/" for name, sets in groups.items() if name != chosen and any(map(_is_vector, sets))]
        notes = [f"group {chosen or '/'} read, not {tell(others)}"] if others else []
    below = [dataset for dataset in found if f"{dataset.name.strip('/')}/".startswith(f"{chosen}/" if chosen else "")]
    if wanted and not below:
        raise no_table(path, wanted, (name or "/" for name in groups), "none: it holds no datasets")
    taken = below if wanted else groups.get(chosen, [])
    singles = [dataset for dataset in found if dataset.size == 1 and dataset not in taken][:MAX_CONSTANTS]
    cells = sum(int(dataset.size) for dataset in taken)
    if cells > MAX_CELLS or len(taken) > MAX_COLUMNS:
        came = f"{len(taken)} datasets of {cells} numbers"
        remedy = "state one group as table=, or cut the recording into pieces"
        raise InputError.of_file(path, came, f"up to {MAX_COLUMNS} datasets, {MAX_CELLS} numbers", remedy)
    attributes = [Item(str(name), value) for name, value in file.attrs.items()]
    return [*_in_order(file, chosen, taken), *map(_item, singles), *attributes], notes


def _datasets(group: Any, depth: int, seen: set[int]) -> Iterator[Any]:
    """All datasets below a group that hold something, each once, along hard links only."""
    h5py: Any = importlib.import_module("h5py")
    for name in group if depth < _DEEPEST else ():
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            continue  # a link may lead into any other file of the machine
        member: Any = group[name]
        address = int(h5py.h5o.get_info(member.id).addr)
        if address in seen or str(name).startswith("#"):  # where MATLAB keeps what cells refer to
            continue
        seen.add(address)
        if isinstance(member, h5py.Group):
            yield from _datasets(member, depth + 1, seen)
        elif isinstance(member, h5py.Dataset) and member.shape is not None:
            yield member


def _is_vector(dataset: Any) -> bool:
    """True for a dataset that could be columns."""
    return int(dataset.size) > 1 and (dataset.dtype.names is not None or dataset.dtype.kind in "biuf")


def _in_order(file: Any, group: str, datasets: list[Any]) -> list[Item]:
    """Items of datasets, in the order of the group's attribute ``columns``, as in detent's traces, if there is one."""
    prefix = f"{group}/" if group else ""
    items = {dataset.name.strip("/").removeprefix(prefix): dataset for dataset in datasets}
    parent = file.get(group) if group else file
    stated: Any = parent.attrs.get("columns", ()) if parent is not None else ()
    names: list[Any] = np.ravel(stated).tolist()
    order = [str(name) for name in names if str(name) in items]
    return [_item(items[name])._replace(name=name) for name in dict.fromkeys([*order, *items])]


def _item(dataset: Any) -> Item:
    """A dataset with its unit."""
    name = dataset.name.strip("/")
    units = (dataset.attrs.get(key) for key in _UNIT_NAMES)
    unit = next((value for value in units if value is not None), "")
    if isinstance(unit, bytes):
        unit = unit.decode("utf-8", "replace")
    value = dataset[()] if dataset.dtype.kind in "biufVSO" else None
    return Item(name, value, str(unit) if isinstance(unit, str) else split_heading(name)[1])
