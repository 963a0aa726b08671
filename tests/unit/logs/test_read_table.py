"""Recordings as JSON, MATLAB files, NPZ, HDF5 and Parquet: the same columns, and every damaged file refused."""

import gzip
import importlib
import json
import zipfile

import h5py
import numpy as np
import pytest
import scipy.io

from detent.errors import DetentError, InputError
from detent.logs.mapping import FileOptions
from detent.logs.read_log import READERS, read_table
from detent.record.trace import Trace
from detent.record.trace_files import save_trace

T = np.arange(5) * 0.5
X = np.array([0.0, 1.5, -2.25, 3.0, 4.0])


def columns(table):
    return {name: values.tolist() for name, values in table.columns.items()}


EXPECTED = {"t": T.tolist(), "x": X.tolist()}


def refusal(path, **options):
    with pytest.raises(InputError) as caught:
        read_table(path, FileOptions(**options))
    (problem,) = caught.value.problems
    assert problem.file == str(path)
    assert all((problem.got, problem.allowed, problem.remedy))
    return problem


def parquet():
    pytest.importorskip("pyarrow.parquet")
    return importlib.import_module("pyarrow"), importlib.import_module("pyarrow.parquet")


# -- any kind -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["run.xlsx", "run", "run.h5.gz", "run.gz"])
def test_kinds_that_are_not_read(tmp_path, name):
    (tmp_path / name).write_bytes(b"1")
    assert refusal(tmp_path / name).allowed.startswith(", ".join(READERS))


@pytest.mark.parametrize("kind", sorted(READERS))
@pytest.mark.parametrize(
    "data", [b"", b"\x00\x01\x02", b"PK\x03\x04 no archive", b"{[", b"\x89HDF\r\n\x1a\n", b"PAR1PAR1"]
)
def test_damaged_files_are_refused(tmp_path, kind, data):
    if kind == ".parquet":
        parquet()
    path = tmp_path / f"run{kind}"
    path.write_bytes(data)
    assert refusal(path).line <= 1


@pytest.mark.parametrize("kind", sorted(READERS))
def test_absent_files_are_refused(tmp_path, kind):
    assert refusal(tmp_path / f"run{kind}").got == "no such file"


# -- JSON ---------------------------------------------------------------------------------------------------


@pytest.fixture
def dump(tmp_path):
    def write(value, name="run.json"):
        path = tmp_path / name
        path.write_text(value if isinstance(value, str) else json.dumps(value), encoding="utf-8")
        return path

    return write


RECORDS = [{"t": t, "x": x} for t, x in zip(T, X, strict=True)]


@pytest.mark.parametrize(
    ("value", "options"),
    [
        (RECORDS, {}),
        ({"t": T.tolist(), "x": X.tolist()}, {}),
        ({"mass": 2, "entries": RECORDS, "motor": "M1"}, {}),
        ({"mass": 2, "run": {"entries": RECORDS}, "short": RECORDS[:2]}, {}),
        ({"a": RECORDS * 2, "b": {"c": RECORDS}}, {"table": "b.c"}),
        ({"a": RECORDS * 2, "b": {"t": T.tolist(), "x": X.tolist()}}, {"table": "b"}),
        ([["t", "x"], *zip(T.tolist(), X.tolist(), strict=True)], {}),
        ("\n".join(map(json.dumps, RECORDS)), {}),
    ],
)
def test_json(dump, value, options):
    table = read_table(dump(value), FileOptions(**options))
    assert columns(table) == EXPECTED
    assert table.rows.tolist() == [1, 2, 3, 4, 5]


def test_json_tells_constants_and_what_it_chose(dump):
    table = read_table(dump({"mass": 2, "big": 10**400, "entries": RECORDS, "motor": "M1", "short": RECORDS[:2]}))
    assert table.constants == {"mass": 2.0, "motor": "M1"}
    assert table.notes == ["list entries read, not short"]


def test_json_packed(tmp_path):
    path = tmp_path / "run.json.gz"
    path.write_bytes(gzip.compress(json.dumps(RECORDS).encode()))
    assert columns(read_table(path)) == EXPECTED


def test_json_lines_with_holes_and_slips(dump):
    lines = [
        *map(json.dumps, RECORDS),
        '{"t": 2.5, "x"',
        '{"t": 3.0}',
        '{"t": 3.5, "x": "?"}',
        '{"t": 4.0, "x": "oops"}',
    ]
    table = read_table(dump("\n".join(lines), "run.jsonl"))
    assert table.columns["t"].tolist() == [*T, 3.0, 3.5]
    assert np.isnan(table.columns["x"]).tolist() == [False] * 5 + [True, True]
    assert table.rows.tolist() == [1, 2, 3, 4, 5, 7, 8]
    assert [(row.row, row.reason) for row in table.broken] == [(6, "no record"), (9, '"oops" is no number')]


def test_json_of_nested_records_words_truth_values_and_moments(dump):
    records = [
        {"at": f"2024-01-01T00:00:0{k}.5", "motor": {"x": k, "state": "run"}, "on": k > 1, "tags": [1]}
        for k in range(4)
    ]
    table = read_table(dump(records))
    assert list(table.columns) == ["at", "motor.x", "on"]
    assert table.units["at"] == "ns"
    assert table.columns["on"].tolist() == [0, 0, 1, 1]
    assert (np.diff(table.columns["at"]) == 1e9).all()
    assert table.notes[-1] == "skipped: motor.state, tags"


def test_json_lists_without_names(dump):
    assert list(read_table(dump([[1, 2], [2, 3]])).columns) == ["column 1", "column 2"]


@pytest.mark.parametrize(
    ("value", "got"),
    [
        ("[1, 2", "[1, 2"),
        ("[" * 100_000, "brackets nested too deeply"),
        ('{"a": ' + "1" * 5000 + "}", "a number of thousands of digits"),
        ("{}", "no columns of numbers"),
        ("[]", "no records of numbers"),
        ('[{"x": "word"}]', "no records of numbers"),
        ("3", "no columns of numbers"),
        ('[{"t": 1}, 2, 3, 4]', "3 invalid records of 4"),
    ],
)
def test_json_that_holds_no_recording(dump, value, got):
    assert refusal(dump(value)).got == got


def test_json_list_that_is_not_there(dump):
    assert refusal(dump({"a": RECORDS, "n": 1}), table="b").allowed == "one of a"


# -- MATLAB -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("version", ["4", "5"])
@pytest.mark.parametrize("shape", [(5, 1), (1, 5)])
def test_matlab(tmp_path, version, shape):
    path = tmp_path / "run.mat"
    content = {"t": T.reshape(shape), "x": X.reshape(shape), "gain": 2.5, "other": np.arange(3.0)}
    scipy.io.savemat(path, content, format=version)
    table = read_table(path)
    assert columns(table) == EXPECTED
    assert table.constants == {"gain": 2.5}
    assert table.notes == ["skipped: other (3 rows)"]


def test_matlab_structures_matrices_and_whole_numbers(tmp_path):
    path = tmp_path / "run.mat"
    content = {"run": {"t": T, "enc": {"mm": X, "raw": np.array([1, 2, 3, 4, 65535], dtype=np.uint16)}}, "name": "M1"}
    scipy.io.savemat(
        path, {**content, "both": np.column_stack([T, X]), "z": X * 1j, "cells": np.array([1, "a"], object)}
    )
    table = read_table(path)
    assert list(table.columns) == ["run.t", "run.enc.mm", "run.enc.raw", "both.1", "both.2"]
    assert table.columns["run.enc.raw"][-1] == 65535
    assert table.constants == {"name": "M1"}
    assert list(read_table(path, FileOptions(table="run.enc")).columns) == ["mm", "raw"]
    assert refusal(path, table="other").allowed == "one of both, cells, name, run, z"


def test_matlab_of_version_7_3_is_hdf5(tmp_path):
    path = tmp_path / "run.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["t"], file["x"] = T.reshape(1, 5), X.reshape(1, 5)
        file.create_group("#refs#")["a"] = np.arange(500.0)
    with path.open("r+b") as stream:
        head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + bytes(8) + b"\x00\x02IM"
        stream.write(head)
    assert columns(read_table(path)) == EXPECTED


def test_matlab_that_would_fill_the_memory(tmp_path, monkeypatch):
    path = tmp_path / "run.mat"
    scipy.io.savemat(path, {"t": np.arange(1000.0)})
    monkeypatch.setattr("detent.logs.raw_table.MAX_CELLS", 999)
    assert refusal(path).got == "1000 numbers"


# -- NumPy --------------------------------------------------------------------------------------------------


def test_npz(tmp_path):
    path = tmp_path / "run.npz"
    np.savez(path, t=T, x=X, rate=np.float32(2.0), note=np.array("hello"), objects=np.array([None, 1], dtype=object))
    table = read_table(path)
    assert columns(table) == EXPECTED
    assert table.constants == {"rate": 2.0, "note": "hello"}
    assert table.notes == ["skipped: objects"]


def test_npy_of_a_table_and_of_a_matrix(tmp_path):
    path = tmp_path / "run.npy"
    np.save(path, np.array(list(zip(T, X, strict=True)), dtype=[("t", "f8"), ("x", "f4")]))
    assert columns(read_table(path)) == EXPECTED
    np.save(path, np.column_stack([T, X]))
    assert columns(read_table(path)) == {"column.1": T.tolist(), "column.2": X.tolist()}


def test_npz_of_moments(tmp_path):
    path = tmp_path / "run.npz"
    stamps = np.array(["2024-01-01T00:00:00", "NaT", "2024-01-01T00:00:02"], dtype="datetime64[ms]")
    np.savez(path, stamp=stamps, x=[1, 2, 3])
    table = read_table(path)
    assert table.units["stamp"] == "ns"
    assert table.columns["stamp"][[0, 2]].tolist() == [0.0, 2e9]
    assert np.isnan(table.columns["stamp"][1])


def test_npz_that_would_fill_the_memory(tmp_path, monkeypatch):
    path = tmp_path / "run.npz"
    np.savez_compressed(path, t=np.zeros(100_000))
    monkeypatch.setattr("detent.logs.raw_table.MAX_CELLS", 50_000)
    assert refusal(path).got == "0 MB unpacked"


def test_npz_with_a_damaged_member(tmp_path):
    path = tmp_path / "run.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("t.npy", b"\x93NUMPY\x01\x00 nothing of the kind")
    assert refusal(path).got.startswith("a file that is no NPZ file")


def test_unsigned_64_bits_stay_exact(tmp_path):
    path = tmp_path / "run.npz"
    start = 2**64 - 10
    np.savez(path, t=np.array([start, start + 1, start + 3], dtype=np.uint64), x=[1.0, 2.0, 3.0])
    table = read_table(path)
    assert table.columns["t"].tolist() == [0.0, 1.0, 3.0]
    assert table.notes == [f"t: counted from its first value, {start}"]


# -- HDF5 ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [".h5", ".parquet"])
def test_traces_of_detent(tmp_path, kind):
    if kind == ".parquet":
        parquet()
    trace = Trace(columns={"t": T, "b": X, "a": X.astype(np.int16)}, units={"t": "s", "b": "m/s", "a": "count"})
    save_trace(trace, tmp_path / f"run{kind}")
    table = read_table(tmp_path / f"run{kind}")
    assert list(table.columns) == ["t", "b", "a"]
    assert table.units == {"t": "s", "b": "m/s", "a": "count"}
    if kind == ".h5":
        assert table.constants["format"] == "detent trace 1"


def test_hdf5_groups(tmp_path):
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        file["one/t"], file["one/x"], file["one/y"] = T, X, X
        file["two/t"], file["two/x"], file["two/gain"] = T, X, 3.0
        file["two/x"].attrs["units"] = np.bytes_(b"mm")
        file["two/sub/z"] = X
        file["empty"] = h5py.Empty("f8")
    table = read_table(path)
    assert list(table.columns) == ["t", "x", "y"]
    assert table.notes == ["group one read, not two, two/sub"]
    assert table.constants == {"two/gain": 3.0}
    table = read_table(path, FileOptions(table="/two/"))
    assert list(table.columns) == ["sub/z", "t", "x"]
    assert table.units["x"] == "mm"
    assert refusal(path, table="three").allowed == "one of one, two, two/sub"


def test_hdf5_tables(tmp_path):
    path = tmp_path / "run.hdf5"
    with h5py.File(path, "w") as file:
        file["rows"] = np.array(list(zip(T, X, strict=True)), dtype=[("t", "f8"), ("x", "f4")])
    assert columns(read_table(path)) == {"rows.t": T.tolist(), "rows.x": X.tolist()}


def test_hdf5_links_do_not_lead_out_of_the_file(tmp_path):
    other, path = tmp_path / "other.h5", tmp_path / "run.h5"
    with h5py.File(other, "w") as file:
        file["t"], file["secret"] = T, X
    with h5py.File(path, "w") as file:
        file["t"], file["x"] = T, X
        file["again"] = file["x"]
        file["loop"] = file["/"]
        file["away"] = h5py.ExternalLink(str(other), "secret")
        file["soft"] = h5py.SoftLink("/x")
    assert set(read_table(path).columns) == {"t", "again"}


def test_hdf5_that_would_fill_the_memory(tmp_path):
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("t", shape=(10**12,), dtype="f8", chunks=(1000,))
    assert refusal(path).got == "1 datasets of 1000000000000 numbers"


# -- Parquet ------------------------------------------------------------------------------------------------


def test_parquet(tmp_path):
    arrow, files = parquet()
    path = tmp_path / "run.parquet"
    stamps = np.array([0, 500, 1000, 1500, 2000], dtype="datetime64[ms]")
    content = {
        "stamp": stamps,
        "x [mm]": X,
        "on": [True, None, False, True, True],
        "word": list("abcde"),
        "n": np.arange(5),
    }
    files.write_table(arrow.table(content), path)
    table = read_table(path)
    assert table.columns["stamp"].tolist() == (T * 1e9).tolist()
    assert (table.units["stamp"], table.units["x [mm]"]) == ("ns", "mm")
    assert np.isnan(table.columns["on"]).tolist() == [False, True, False, False, False]
    assert table.columns["n"].tolist() == [0, 1, 2, 3, 4]
    assert table.notes == ["skipped: word"]


def test_parquet_too_large(tmp_path, monkeypatch):
    arrow, files = parquet()
    path = tmp_path / "run.parquet"
    files.write_table(arrow.table({"t": np.zeros(1000)}), path)
    monkeypatch.setattr("detent.logs.raw_table.MAX_CELLS", 500)
    assert refusal(path).got == "1 columns of 1000 rows"


def test_parquet_without_pyarrow(tmp_path, monkeypatch):
    (tmp_path / "run.parquet").write_bytes(b"PAR1")

    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr("detent.logs.read_arrays.importlib.import_module", missing)
    assert "detent[parquet]" in refusal(tmp_path / "run.parquet").remedy
    assert issubclass(InputError, DetentError)
