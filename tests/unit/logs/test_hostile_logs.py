"""Recordings that are damaged, or made to harm: each is refused in one sentence, within limits of time and memory."""

import bz2
import gzip
import io
import json
import lzma
import struct
import zipfile

import h5py
import numpy as np
import pytest
import scipy.io

from detent.errors import InputError
from detent.files import apart
from detent.logs.read_log import read_log

T = np.arange(400) * 1e-3
COLUMNS = {"t": T, "position": np.sin(7 * T), "current": np.cos(9 * T)}


def refusal(path):
    with pytest.raises(InputError) as caught:
        read_log(path)
    (problem,) = caught.value.problems
    assert problem.file == str(path)
    assert all((problem.got, problem.allowed, problem.remedy))
    return problem


def npy(header, data=bytes(80)):
    told = header.encode().ljust(118) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(told)) + told + data


def npz(**columns):
    stream = io.BytesIO()
    np.savez(stream, **columns)
    return bytearray(stream.getvalue())


def everywhere(data, signature, at, value):
    """The archive with a field of every local or central header changed."""
    place = data.find(signature)
    while place >= 0:
        struct.pack_into("<H", data, place + at, value)
        place = data.find(signature, place + 4)


@pytest.mark.parametrize(
    "header",
    [
        "{'descr': '<f8', 'fortran_order': False, 'shape': (10,)",  # TokenError
        "{'descr': '<f8', 'fortran_order': False, 'shape': (10,), } $ ?",
        "((((((((((",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (-10,), }",
        "{'descr': '|O', 'fortran_order': False, 'shape': (10,), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999,), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (3000000000000000000,), }",
        "{'descr': 7, 'fortran_order': 8, 'shape': 9, }",
        "'''",
        "\\",
    ],
)
def test_npy_with_a_header_of_rubbish(tmp_path, header):
    (tmp_path / "log.npy").write_bytes(npy(header))
    refusal(tmp_path / "log.npy")


@pytest.mark.parametrize(("field", "value"), [("flags", 1), ("method", 99), ("method", 7), ("flags", 0xFFFF)])
def test_npz_with_a_password_or_an_unknown_compression(tmp_path, field, value):
    data = npz(**COLUMNS)
    everywhere(data, b"PK\x03\x04", 6 if field == "flags" else 8, value)
    everywhere(data, b"PK\x01\x02", 8 if field == "flags" else 10, value)
    (tmp_path / "log.npz").write_bytes(data)
    refusal(tmp_path / "log.npz")


def test_npz_whose_sizes_lie(tmp_path):
    with zipfile.ZipFile(tmp_path / "log.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("t.npy", npy("{'descr': '<f8', 'fortran_order': False, 'shape': (9999999999,), }"))
    refusal(tmp_path / "log.npz")


def test_hdf5_of_few_bytes_that_would_fill_the_memory(tmp_path):
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        wide = np.dtype([("t", "f8"), ("position", "f8"), ("label", "S1000")])
        for name in "abc":
            file.create_dataset(name, (30_000_000,), wide, chunks=(1000,), compression="gzip")
    assert path.stat().st_size < 20_000
    assert "3 datasets of" in refusal(path).got  # 30 GB


def test_hdf5_with_texts_that_would_fill_the_memory(tmp_path):
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        for name, values in COLUMNS.items():
            file[name] = values
        file.create_dataset("labels", (400,), "S100000000", chunks=(1,))  # 40 GB of nothing, and no column
    assert len(read_log(path)) == 400


def test_hdf5_whose_list_of_names_never_ends(tmp_path, monkeypatch, tried):
    """Of 2 kB: in the tree of a group's names the node to the right of the only one is that node."""
    path = tmp_path / "log.h5"
    with h5py.File(path, "w", libver="earliest") as file:
        file["t [s]"], file["x [m]"] = T, T
    whole = bytearray(path.read_bytes())
    tree = whole.index(b"TREE")
    assert struct.unpack_from("<Q", whole, tree + 16) == (2**64 - 1,)  # no neighbour to the right
    struct.pack_into("<Q", whole, tree + 16, tree)
    path.write_bytes(whole)
    monkeypatch.setattr(apart, "SECONDS", 1.0)
    assert refusal(path).got == "a file that took longer to read than 1 s"
    tried("reader", "an HDF5 file whose list of names leads back to its begin", "ended by the limit, with a sentence")


def test_hdf5_whose_groups_go_in_circles(tmp_path):
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        group = file
        for depth in range(12):
            group = group.create_group(f"g{depth}")
            group["up"], group["soft"], group["out"] = file, h5py.SoftLink("/g0"), h5py.ExternalLink("log.h5", "/")
    assert refusal(path).got == "no columns of numbers"


@pytest.mark.parametrize("shape", ["one long text", "nested texts", "texts of records"])
def test_json_of_few_bytes_that_would_fill_the_memory(tmp_path, monkeypatch, shape):
    monkeypatch.setattr(apart, "MEMORY", 300_000_000)
    texts = ["a" * 44_000, *[""] * 14_000]  # as an array of texts: 2.5 GB
    found = {"one long text": texts, "nested texts": [[one] for one in texts], "texts of records": texts}[shape]
    value = {**{name: values.tolist() for name, values in COLUMNS.items()}, "notes": found}
    if shape == "texts of records":
        columns = [{name: values[k].item() for name, values in COLUMNS.items()} for k in range(400)]
        value = [{**row, "note": text} for row, text in zip(columns, texts, strict=False)]
    (tmp_path / "log.json").write_text(json.dumps(value), encoding="utf-8")
    if shape == "nested texts":
        refusal(tmp_path / "log.json")  # a list of lists is taken for the records
    else:
        assert len(read_log(tmp_path / "log.json")) >= 399


@pytest.mark.parametrize(
    "text",
    [
        "[" * 100_000,
        '{"a":' * 50_000,
        "[" + "9" * 10_000 + "]",
        '{"t": [' + "1e999," * 5 + "1]}",
        '[{"t": 1}, {"t": {"t": {"t": []}}}]',
        "[NaN, -Infinity, null]",
        '{"t": [1, 2, [3]], "x": [true, {}, ""]}',
        '[["t", "x"], [1, 2], [[], {}], ["", null]]',
        '{"\\ud800": [1, 2, 3]}',
    ],
)
def test_json_of_other_things(tmp_path, text):
    (tmp_path / "log.json").write_text(text, encoding="utf-8")
    refusal(tmp_path / "log.json")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A log of every kind."""
    folder = tmp_path_factory.mktemp("whole")
    np.savez(folder / "log.npz", **COLUMNS)
    np.save(folder / "log.npy", np.rec.fromarrays([*COLUMNS.values()], names=[*COLUMNS]))
    scipy.io.savemat(folder / "log.mat", COLUMNS, do_compression=True)
    with h5py.File(folder / "log.h5", "w") as file:
        for name, values in COLUMNS.items():
            file[name] = values
    rows = [{name: values[k].item() for name, values in COLUMNS.items()} for k in range(400)]
    (folder / "log.json").write_text(json.dumps(rows), encoding="utf-8")
    lines = ["t,position,current", *(",".join(map(str, row.values())) for row in rows)]
    with gzip.open(folder / "log.csv.gz", "wt", encoding="utf-8") as stream:
        stream.write("\n".join(lines))
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    parquet.write_table(arrow.table(COLUMNS), folder / "log.parquet")
    return folder


KINDS = ["npz", "npy", "mat", "h5", "json", "csv.gz", "parquet"]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("share", [0.0, 0.02, 0.5, 0.98])
def test_a_file_cut_off(tmp_path, whole, kind, share):
    data = (whole / f"log.{kind}").read_bytes()
    assert len(read_log(whole / f"log.{kind}")) == 400
    (tmp_path / f"log.{kind}").write_bytes(data[: int(share * len(data))])
    refusal(tmp_path / f"log.{kind}")


@pytest.mark.parametrize("kind", ["npz", "h5", "mat", "json", "npy", "parquet"])
@pytest.mark.parametrize("pack", [gzip.compress, bz2.compress, lzma.compress])
def test_a_file_packed_under_another_name(tmp_path, whole, kind, pack):
    (tmp_path / f"log.{kind}").write_bytes(pack((whole / f"log.{kind}").read_bytes()))
    refusal(tmp_path / f"log.{kind}")


def test_text_that_unpacks_without_end(tmp_path, monkeypatch):
    monkeypatch.setattr("detent.logs.read_csv.MAX_BYTES", 1_000_000)
    with gzip.open(tmp_path / "log.csv.gz", "wb") as stream:
        stream.write(b"1,2\n" * 1_000_000)
    assert refusal(tmp_path / "log.csv.gz").got == "more than 1 MB"


def test_foreign_files_are_read_apart_and_text_tables_are_not(whole, monkeypatch):
    asked = []

    def read_apart(reader, path, *args):
        asked.append(path.suffix)
        return reader(path, *args[1:])

    monkeypatch.setattr("detent.logs.read_log.read_apart", read_apart)
    for kind in KINDS:
        read_log(whole / f"log.{kind}")
    assert asked == [f".{kind}" for kind in KINDS if kind != "csv.gz"]
