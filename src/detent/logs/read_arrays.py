"""Recordings as files of arrays: HDF5, MATLAB, NumPy's NPZ, and Parquet, where pyarrow is installed."""

import importlib
import warnings
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from detent.errors import InputError
from detent.files.text import check_file
from detent.logs import raw_table
from detent.logs.differences import scipy
from detent.logs.headings import split_heading
from detent.record.trace import BROKEN_OFF, broke_off
from detent.record.trace_files import trace_attributes

if TYPE_CHECKING:
    from detent.logs.mapping import FileOptions

MAX_COLUMNAR = 2_000_000_000  # largest HDF5 or Parquet file read; what counts is how many numbers are taken from it
MAX_BYTES = 500_000_000  # largest file of arrays read, HDF5 and Parquet aside
ALLOWED_MAT = "a MATLAB file with vectors of equal length"
ALLOWED_NPZ = "an NPZ or NPY file with vectors of equal length"
ALLOWED_HDF5 = "an HDF5 file with vectors of equal length"
ALLOWED_PARQUET = "a Parquet file with columns of numbers"
_DEEPEST = 4
_DEEPEST_GROUP = 6
_UNIT_NAMES = ("unit", "units", "Unit", "Units")


def read_mat(path: Path, options: "FileOptions") -> raw_table.RawTable:
    """Read a MATLAB file, of version 7.3 as HDF5; names in structures, or in that of ``table``, joined by points.

    Tables and timetables are objects, which mat-io reads, where it is installed.
    """
    check_file(path, MAX_BYTES, ALLOWED_MAT)
    with raw_table.whole(path, "MATLAB", ALLOWED_MAT, "save it again with save -v7, or as CSV"):
        try:
            cells = sum(int(np.prod(shape, dtype=object)) for _, shape, _ in scipy("io").whosmat(path))
            if cells > raw_table.MAX_CELLS:
                most = f"{ALLOWED_MAT}, up to {raw_table.MAX_CELLS} numbers"
                raise InputError.of_file(str(path), f"{cells} numbers", most, "split the recording")
            found: dict[str, Any] = scipy("io").loadmat(path, squeeze_me=True, struct_as_record=True)
        except TypeError:  # an object has no shape
            return _read_objects(path, options)
        except NotImplementedError:
            return _read_objects(path, options) if _holds_objects(path) else read_hdf5(path, options)
    items = [item for name, value in found.items() if not name.startswith("__") for item in _fields(name, value, 0)]
    return raw_table.table_of(str(path), _inside(str(path), items, options.table), ALLOWED_MAT)


def _holds_objects(path: Path) -> bool:
    """True for a file of version 7.3 with tables or other objects of MATLAB."""
    h5py: Any = importlib.import_module("h5py")
    with h5py.File(path) as file:
        return any("MATLAB_object_decode" in file[name].attrs for name in file if not name.startswith("#"))


def _read_objects(path: Path, options: "FileOptions") -> raw_table.RawTable:
    """Read tables and timetables of MATLAB; the times of the rows of a timetable are its time."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # it sets an option of pandas that pandas will drop
            matio: Any = importlib.import_module("matio")
    except ImportError:
        got = "a table or another object of MATLAB, which needs mat-io, which is not installed"
        remedy = (
            'pip install "detent[matlab]", or in MATLAB: s = table2struct(T, "ToScalar", true); save it with -struct'
        )
        raise InputError.of_file(str(path), got, ALLOWED_MAT, remedy) from None
    items: list[raw_table.Item] = []
    found = matio.load_from_mat(str(path), add_table_attrs=True)
    is_alone = len(found) == 1 and not options.table
    for name, value in found.items():
        if not hasattr(value, "columns"):
            items += _fields(name, value, 0)
            continue
        prefix = "" if is_alone else f"{name}."
        units = np.ravel(value.attrs.get("VariableUnits", ())).tolist() or [""] * value.shape[1]
        if value.index.dtype.kind in "mM":
            items.append(raw_table.Item(f"{prefix}time", value.index.to_numpy()))
        for column, unit in zip(value.columns, units, strict=False):
            stated = str(unit) or split_heading(str(column))[1]
            items.append(raw_table.Item(f"{prefix}{column}", value[column].to_numpy(), stated))
    return raw_table.table_of(str(path), _inside(str(path), items, options.table), ALLOWED_MAT)


def read_npz(path: Path, options: "FileOptions") -> raw_table.RawTable:
    """Read arrays saved by NumPy, as NPZ or as one structured or plain NPY; pickled objects are refused."""
    check_file(path, MAX_BYTES, ALLOWED_NPZ)
    items: list[raw_table.Item] = []
    with (
        raw_table.whole(path, "NPZ", ALLOWED_NPZ, "save it again with numpy.savez, or as CSV"),
        path.open("rb") as stream,
    ):
        if zipfile.is_zipfile(stream):
            with zipfile.ZipFile(path) as archive:
                size = sum(entry.file_size for entry in archive.infolist())
            if size > 8 * raw_table.MAX_CELLS:
                most = f"up to {8 * raw_table.MAX_CELLS // 1_000_000} MB unpacked"
                got = f"{size // 1_000_000} MB unpacked"
                raise InputError.of_file(str(path), got, most, "split the recording")
            with np.load(path, allow_pickle=False) as arrays:
                for name in arrays.files:
                    items += _fields(name, _load_member(arrays, name), 0)
        else:
            stream.seek(0)  # whether it is an archive was asked at its end
            array = np.load(stream, allow_pickle=False)
            items = list(_fields("" if array.dtype.names else "column", array, 0))
    return raw_table.table_of(str(path), _inside(str(path), items, options.table), ALLOWED_NPZ)


def read_parquet(path: Path, options: "FileOptions") -> raw_table.RawTable:
    """Read a Parquet file; the metadata ``unit`` of a field, as detent's traces have it, is its unit."""
    check_file(path, MAX_COLUMNAR, ALLOWED_PARQUET)
    try:
        parquet: Any = importlib.import_module("pyarrow.parquet")
    except ImportError:
        remedy = 'pip install "detent[parquet]", or save the recording as CSV or HDF5'
        got = "a file that needs pyarrow, which is not installed"
        raise InputError.of_file(str(path), got, ALLOWED_PARQUET, remedy) from None
    with raw_table.whole(path, "Parquet", ALLOWED_PARQUET), parquet.ParquetFile(path) as file:
        raw_table.check_size(str(path), file.metadata.num_rows, len(file.schema_arrow))
        notes = _broke_off(path, trace_attributes(file.schema_arrow.metadata), options)
        items = [_column(field, values) for field, values in zip(file.schema_arrow, file.read().columns, strict=True)]
    table = raw_table.table_of(str(path), items, ALLOWED_PARQUET)
    table.notes += notes
    return table


def _broke_off(path: Path, told: Mapping[str, Any], options: "FileOptions") -> list[str]:
    """What to note of a trace whose run broke off, where that was asked for; refuse it where not."""
    if not broke_off(told) or not str(told.get("format", "")).startswith("detent trace"):
        return []
    if not options.incomplete:
        raise InputError.of_file(str(path), *BROKEN_OFF, "record again, or state incomplete=yes with its columns")
    return ["the run was aborted: the trace is used as far as it goes"]


def _column(field: Any, column: Any) -> raw_table.Item:
    """A column of a Parquet file with its unit; one of anything but numbers and moments has no value."""
    metadata: dict[bytes, bytes] = field.metadata or {}
    unit = metadata.get(b"unit", b"").decode("utf-8", "replace") or split_heading(field.name)[1]
    values: Any = column.to_numpy()
    if values.dtype.kind == "O":
        try:  # truth values and decimals with gaps come as objects
            values = values.astype(np.float64)
        except (ValueError, TypeError):
            values = None
    return raw_table.Item(field.name, values, unit)


def _load_member(arrays: Any, name: str) -> Any:
    """One array of an NPZ file; None for one of pickled objects."""
    try:
        return arrays[name]
    except ValueError as error:
        if "pickle" in str(error):
            return None
        raise


def _fields(name: str, value: Any, depth: int) -> Iterator[raw_table.Item]:
    """What a value of a MATLAB file holds: fields of a structure under names joined by points."""
    kind: np.dtype[Any] | None = getattr(value, "dtype", None)
    if kind is not None and kind.names:
        if kind.hasobject and depth >= _DEEPEST:
            return
        if kind.hasobject and (labels := _labelled(kind.names)):
            for number, element in enumerate(value.reshape(-1), start=1):
                label = str(element[labels[0]] if np.size(element[labels[0]]) else "") or f"{name}.{number}"
                yield raw_table.Item(label, element[labels[1]], split_heading(label)[1])
            return
        if kind.hasobject and value.size != 1:
            return
        record: Any = value.reshape(-1)[0] if kind.hasobject else value
        if name.rpartition(".")[2] == "X" and kind.names == ("Data",):  # the axis of what a recorder took
            yield raw_table.Item("time", record["Data"])
            return
        for field in kind.names:
            yield from _fields(f"{name}.{field}" if name else field, record[field], depth + 1)
    else:
        yield raw_table.Item(name, value, split_heading(name)[1])


def _labelled(names: Sequence[str]) -> tuple[str, str] | None:
    """Fields with the name and the samples of structures of which each is a signal, as recorders write them."""
    for pair in (("Name", "Data"), ("label", "values"), ("name", "data"), ("Name", "Values")):
        if set(pair) <= set(names):
            return pair
    return None


def _inside(file: str, items: list[raw_table.Item], table: str) -> list[raw_table.Item]:
    """Items of one structure, or all."""
    if not table:
        return items
    found = [item for item in items if item.name == table or item.name.startswith(f"{table}.")]
    if not found:
        raise raw_table.no_table(file, table, sorted({item.name.partition(".")[0] for item in items}))
    return [item._replace(name=item.name.removeprefix(f"{table}.")) for item in found]


# ---- HDF5: detent's own traces, MATLAB 7.3, and what other programs write


def read_hdf5(path: Path, options: "FileOptions") -> raw_table.RawTable:
    """Read the datasets of an HDF5 file; links out of the file are not followed.

    Of a file with several groups that hold vectors, the one with the most is read unless ``table`` names another.
    Units stand in an attribute ``unit`` or ``units`` of a dataset.
    """
    import h5py

    check_file(path, MAX_COLUMNAR, ALLOWED_HDF5)
    with raw_table.whole(path, "HDF5", ALLOWED_HDF5), h5py.File(path, "r") as file:
        broke = _broke_off(path, file.attrs, options)
        items, notes = _read_file(str(path), file, options.table.strip("/"))
    table = raw_table.table_of(str(path), items, ALLOWED_HDF5)
    table.notes += notes + broke
    return table


def _read_file(path: str, file: Any, wanted: str) -> tuple[list[raw_table.Item], list[str]]:
    """Datasets of the chosen group with their names inside it, and what had to be chosen."""
    h5py: Any = importlib.import_module("h5py")
    found = list(_datasets(file, 0, {int(h5py.h5o.get_info(file.id).addr)}))
    if not wanted and (recorded := list(_recorded(file, found))):
        return recorded, []
    groups: dict[str, list[Any]] = {}
    for dataset in found:
        groups.setdefault(dataset.name.strip("/").rpartition("/")[0], []).append(dataset)
    chosen, notes = wanted, list[str]()
    if not wanted and groups:
        # The columns of a run stand side by side; single values may stand anywhere.
        chosen = max(groups, key=lambda name: sum(_is_vector(dataset) for dataset in groups[name]))
        others = [name or "/" for name, sets in groups.items() if name != chosen and any(map(_is_vector, sets))]
        notes = [f"group {chosen or '/'} read, not {raw_table.tell(others)}"] if others else []
    below = [dataset for dataset in found if f"{dataset.name.strip('/')}/".startswith(f"{chosen}/" if chosen else "")]
    if wanted and not below:
        raise raw_table.no_table(path, wanted, (name or "/" for name in groups), "none: it holds no datasets")
    taken = below if wanted else groups.get(chosen, [])
    singles = [dataset for dataset in found if dataset.size == 1 and dataset not in taken][: raw_table.MAX_CONSTANTS]
    # A cell may be a text or a table of any width: what counts is its memory, in numbers of eight bytes.
    cells = sum(int(dataset.size) * max(1, dataset.dtype.itemsize // 8) for dataset in taken if _is_vector(dataset))
    if cells > raw_table.MAX_CELLS or len(taken) > raw_table.MAX_COLUMNS:
        got = f"{len(taken)} datasets of {cells} numbers"
        remedy = "state one group as table=, or split the recording"
        raise InputError.of_file(
            path, got, f"up to {raw_table.MAX_COLUMNS} datasets, {raw_table.MAX_CELLS} numbers", remedy
        )
    attributes = [raw_table.Item(str(name), value) for name, value in file.attrs.items()]
    return [*_in_order(file, chosen, taken), *map(_item, singles), *attributes], notes


def _recorded(file: Any, found: list[Any]) -> Iterator[raw_table.Item]:
    """Signals of structures with Name and Data, which MATLAB keeps as references, and the time in the field X beside.

    Followed are only references, which lead nowhere but into the file itself.
    """
    h5py: Any = importlib.import_module("h5py")
    refers = {dataset.name: dataset for dataset in found if h5py.check_ref_dtype(dataset.dtype) is h5py.Reference}
    for path, data in refers.items():
        head, _, field = path.rpartition("/")
        names = refers.get(f"{head}/Name")
        if field != "Data" or names is None or names.size != data.size:
            continue
        times = file.get(f"{head.rpartition('/')[0]}/X/Data")
        if isinstance(times, h5py.Dataset) and _is_vector(times):
            yield raw_table.Item("time", times[()])
        pairs: list[tuple[Any, Any]] = list(zip(np.ravel(names[()]).tolist(), np.ravel(data[()]).tolist(), strict=True))
        for name, values in pairs:
            label = "".join(map(chr, np.ravel(file[name][()]).tolist())) if name else ""
            if values and _is_vector(file[values]):
                yield raw_table.Item(label, file[values][()], split_heading(label)[1])


def _datasets(group: Any, depth: int, seen: set[int]) -> Iterator[Any]:
    """All datasets below a group that hold something, each once, along hard links only."""
    h5py: Any = importlib.import_module("h5py")
    for name in group if depth < _DEEPEST_GROUP else ():
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


def _in_order(file: Any, group: str, datasets: list[Any]) -> list[raw_table.Item]:
    """Items of datasets, in the order of the group's attribute ``columns``, as in detent's traces, if there is one."""
    prefix = f"{group}/" if group else ""
    items = {dataset.name.strip("/").removeprefix(prefix): dataset for dataset in datasets}
    parent = file.get(group) if group else file
    stated: Any = parent.attrs.get("columns", ()) if parent is not None else ()
    names: list[Any] = np.ravel(stated).tolist()
    order = [str(name) for name in names if str(name) in items]
    return [_item(items[name])._replace(name=name) for name in dict.fromkeys([*order, *items])]


def _item(dataset: Any) -> raw_table.Item:
    """A dataset with its unit."""
    name = dataset.name.strip("/")
    units = (dataset.attrs.get(key) for key in _UNIT_NAMES)
    unit = next((value for value in units if value is not None), "")
    if isinstance(unit, bytes):
        unit = unit.decode("utf-8", "replace")
    is_single = dataset.size == 1 and dataset.dtype.kind in "biufSO"
    value = dataset[()] if is_single or _is_vector(dataset) else None
    return raw_table.Item(name, value, str(unit) if isinstance(unit, str) else split_heading(name)[1])
