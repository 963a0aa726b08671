import importlib
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from detent import __version__
from detent.errors import DetentError, InputError
from detent.record import trace_files
from detent.record.trace import Trace
from detent.record.trace_files import TraceWriter, convert_trace, load_trace, need_parquet, save_trace

ROW = np.dtype([("t", "f8"), ("motor.current", "f8"), ("head.drive_cmd", "i2")])


def make_trace() -> Trace:
    return Trace(
        columns={
            "t": np.array([0.0, 0.1, 0.2]),
            "motor.current": np.array([0.1 + 0.2, -1e-300, np.nan]),
            "head.drive_cmd": np.array([0, -300, 300], dtype=np.int16),
            "head.transition": np.array([False, True, False]),
            "carriage.position": np.array([1, 2, 2**62 + 1], dtype=np.int64),
        },
        units={
            "t": "s", "motor.current": "A", "head.drive_cmd": "count", "head.transition": "",
            "carriage.position": "",
        },
        docs={
            "t": "time", "motor.current": "winding current", "head.drive_cmd": "", "head.transition": "",
            "carriage.position": "",
        },
        attributes={"axis": "demo", "job": "LETTER.TXT", "seed": 7, "supply": 38.0},
    )  # fmt: skip


def assert_same_columns(left: Trace, right: Trace, *, dtypes: bool) -> None:
    assert list(left) == list(right)
    for name in left:
        np.testing.assert_array_equal(left[name], right[name])
        if dtypes:
            assert left[name].dtype == right[name].dtype


@pytest.mark.parametrize("suffix", [".h5", ".hdf5", ".parquet"])
def test_hdf5_and_parquet_give_back_everything(tmp_path: Path, suffix: str) -> None:
    trace = make_trace()
    save_trace(trace, tmp_path / f"run{suffix}")
    loaded = load_trace(tmp_path / f"run{suffix}")
    assert_same_columns(trace, loaded, dtypes=True)
    assert loaded.units == trace.units
    assert loaded.docs == trace.docs
    assert trace.attributes.items() <= loaded.attributes.items()
    assert type(loaded.attributes["seed"]) is int
    assert list(tmp_path.iterdir()) == [tmp_path / f"run{suffix}"]


def test_hdf5_layout_is_the_documented_one(tmp_path: Path) -> None:
    save_trace(make_trace(), tmp_path / "run.h5")
    file: Any
    with h5py.File(tmp_path / "run.h5") as file:
        assert file.attrs["detent_version"] == __version__
        assert file.attrs["format"] == "detent trace 1"
        assert file.attrs["complete"] == 1
        current = file["trace"]["motor.current"]
        assert current.attrs["unit"] == "A"
        assert current.attrs["doc"] == "winding current"
        assert (current.compression, current.compression_opts, current.shuffle) == ("gzip", 1, True)


def test_csv_text_is_exact_and_plain(tmp_path: Path) -> None:
    save_trace(make_trace(), tmp_path / "run.csv")
    assert (tmp_path / "run.csv").read_text(encoding="utf-8") == (
        "t [s],motor.current [A],head.drive_cmd [count],head.transition,carriage.position\n"
        "0.0,0.30000000000000004,0,0,1\n"
        "0.1,-1e-300,-300,1,2\n"
        "0.2,nan,300,0,4611686018427387905\n"
    )


def test_csv_gives_back_bits_and_units(tmp_path: Path) -> None:
    trace = make_trace()
    save_trace(trace, tmp_path / "run.csv")
    loaded = load_trace(tmp_path / "run.csv")
    assert_same_columns(trace, loaded, dtypes=False)
    assert loaded["carriage.position"].dtype == np.int64
    assert loaded.units == trace.units


@given(st.lists(st.floats(width=64), min_size=1, max_size=20), st.integers(-(2**63), 2**63 - 1))
def test_csv_keeps_every_float_and_integer(
    tmp_path_factory: pytest.TempPathFactory, values: list[float], n: int
) -> None:
    path = tmp_path_factory.mktemp("csv") / "run.csv"
    columns = {"t": np.arange(len(values)) * 0.1, "x": np.array(values), "n": np.full(len(values), n, dtype=np.int64)}
    save_trace(Trace(columns=columns), path)
    loaded = load_trace(path)
    finite = ~np.isnan(columns["x"])
    assert loaded["x"][finite].tobytes() == columns["x"][finite].tobytes()
    assert np.isnan(loaded["x"][~finite]).all()
    assert loaded["n"].tolist() == [n] * len(values)


def test_csv_of_several_blocks_is_one_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    save_trace(make_trace(), tmp_path / "whole.csv")
    monkeypatch.setattr(trace_files, "CSV_ROWS", 2)
    save_trace(make_trace(), tmp_path / "blocks.csv")
    assert (tmp_path / "blocks.csv").read_bytes() == (tmp_path / "whole.csv").read_bytes()


def test_csv_of_other_tools_is_read(tmp_path: Path) -> None:
    # A byte-order mark, Windows line ends, spaces, and 0 where 0.0 is meant.
    (tmp_path / "scope.csv").write_bytes(b"\xef\xbb\xbft [s], motor.current [A]\r\n0, 0\r\n0.5, 1e-3\r\n")
    trace = load_trace(tmp_path / "scope.csv")
    assert trace.time.tolist() == [0.0, 0.5]
    assert trace["motor.current"].tolist() == [0.0, 0.001]
    assert trace.units == {"t": "s", "motor.current": "A"}


@pytest.mark.parametrize("suffix", [".h5", ".csv", ".parquet"])
def test_an_empty_trace_survives(tmp_path: Path, suffix: str) -> None:
    save_trace(Trace(columns={"t": np.empty(0), "x": np.empty(0)}, units={"t": "s"}), tmp_path / f"run{suffix}")
    loaded = load_trace(tmp_path / f"run{suffix}")
    assert list(loaded) == ["t", "x"]
    assert len(loaded) == 0


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("absent.h5", None, "no such file"),
        ("run.txt", b"", r"suffix '.txt'; expected: .h5, .hdf5, .csv, .parquet"),
        ("run.h5", b"not HDF5", "file signature not found|Unable to"),
        ("run.parquet", b"not Parquet at all", "[Pp]arquet"),
        ("empty.csv", b"", "an empty file"),
        ("order.csv", b"x,t [s]\n1,2\n", "the first column must be 't' .*got 'x'"),
        ("twice.csv", b"t [s],x,x [A]\n1,2,3\n", "two columns 'x'"),
        ("ragged.csv", b"t [s],x\n1,2\n3\n", "columns"),
        ("short.csv", b"t [s],x\n1\n2\n", "zip|columns"),
        ("words.csv", b"t [s],x\n1,high\n", "could not convert|high"),
        ("latin.csv", b"t [s],x [\xb0C]\n1,2\n", "utf-8"),
        ("back.csv", b"t [s],x\n1,2\n0,3\n", "time runs backwards"),
    ],
)
def test_a_file_that_is_no_trace_is_an_input_error(tmp_path: Path, name: str, content: bytes | None, says: str) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=says) as caught:
        load_trace(tmp_path / name)
    assert str(caught.value).startswith(str(tmp_path / name))


def test_a_csv_file_longer_than_any_trace_is_an_input_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.csv").write_text("t [s],x\n" + "0,1\n" * 100)
    assert load_trace(tmp_path / "a.csv").columns["x"].tolist() == [1] * 100
    monkeypatch.setattr("detent.record.trace_files.MAX_CSV", 300)
    with pytest.raises(InputError, match=r"a\.csv.*more than"):
        load_trace(tmp_path / "a.csv")


def test_another_hdf5_file_is_an_input_error(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["pictures"] = [1, 2]
    with pytest.raises(InputError, match="got HDF5 with pictures; expected: a group /trace"):
        load_trace(tmp_path / "other.h5")


def test_an_unknown_suffix_cannot_be_saved(tmp_path: Path) -> None:
    with pytest.raises(DetentError, match=r"cannot be saved as '\.xlsx'; use one of \.h5, \.hdf5, \.csv, \.parquet"):
        save_trace(make_trace(), tmp_path / "run.xlsx")


@pytest.mark.parametrize("suffix", [".h5", ".csv", ".parquet"])
def test_a_folder_that_is_not_there_is_said(tmp_path: Path, suffix: str) -> None:
    with pytest.raises(DetentError, match="cannot be written"):
        save_trace(make_trace(), tmp_path / "nowhere" / f"run{suffix}")


def test_parquet_without_pyarrow_names_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(DetentError, match=r'pip install "detent\[parquet\]"'):
        save_trace(make_trace(), tmp_path / "run.parquet")
    (tmp_path / "old.parquet").write_bytes(b"")
    with pytest.raises(DetentError, match=r'pip install "detent\[parquet\]"'):
        trace_files._load(tmp_path / "old.parquet")


def make_head(**attributes: str) -> Trace:
    columns = {name: np.empty(0, ROW[name]) for name in ROW.names or ()}
    return Trace(columns=columns, units={"t": "s"}, attributes={**attributes})


def make_block(first: int, last: int) -> np.ndarray:
    block = np.zeros(last - first, dtype=ROW)
    block["t"] = np.arange(first, last) * 1e-3
    block["motor.current"] = np.sin(block["t"])
    block["head.drive_cmd"] = np.arange(first, last) % 300
    return block


def test_a_streamed_trace_is_the_whole_one(tmp_path: Path) -> None:
    with TraceWriter(tmp_path / "run.h5", make_head(job="long")) as writer:
        for first in range(0, 40_000, 7_000):  # blocks that do not fit the chunks of 16384 rows
            writer.append(make_block(first, min(first + 7_000, 40_000)))
        writer.append(make_block(0, 0))
        assert writer.rows == 40_000
        assert not (tmp_path / "run.h5").exists()
    trace = load_trace(tmp_path / "run.h5")
    whole = make_block(0, 40_000)
    for name in ROW.names or ():
        np.testing.assert_array_equal(trace[name], whole[name])
    assert trace.attributes["job"] == "long"
    assert trace.attributes["complete"] == 1


def test_a_run_that_breaks_off_leaves_what_it_recorded(tmp_path: Path) -> None:
    def run() -> None:
        with TraceWriter(tmp_path / "run.h5", make_head()) as writer:
            writer.append(make_block(0, 10))
            raise RuntimeError("stall")

    with pytest.raises(RuntimeError, match="stall"):
        run()
    trace = load_trace(tmp_path / "run.h5")
    assert len(trace) == 10
    assert trace.attributes["complete"] == 0
    convert_trace(tmp_path / "run.h5", tmp_path / "again.parquet")
    for name in ("copy.h5", "copy.parquet"):
        save_trace(trace, tmp_path / name)
        assert load_trace(tmp_path / name).attributes["complete"] == 0
    assert load_trace(tmp_path / "again.parquet").attributes["complete"] == 0


def test_csv_cannot_say_that_a_run_broke_off(tmp_path: Path) -> None:
    trace = Trace(columns=make_trace().columns, attributes={"complete": 0})
    save_trace(trace, tmp_path / "run.h5")
    told = r"run\.csv: got the trace of an aborted run, which CSV cannot say; .*; save it as \.h5 or \.parquet"
    with pytest.raises(DetentError, match=told):
        save_trace(trace, tmp_path / "run.csv")
    with pytest.raises(DetentError, match=told):
        convert_trace(tmp_path / "run.h5", tmp_path / "run.csv")
    assert not (tmp_path / "run.csv").exists()
    trace.attributes["complete"] = 1
    save_trace(trace, tmp_path / "run.csv")
    assert len(load_trace(tmp_path / "run.csv")) == len(trace)


def test_the_writer_refuses_what_does_not_follow(tmp_path: Path) -> None:
    with TraceWriter(tmp_path / "run.h5", make_head()) as writer:
        writer.append(make_block(5, 10))
        with pytest.raises(DetentError, match=r"a block starts at 0\.0 s, before the last row at 0\.009"):
            writer.append(make_block(0, 5))
        with pytest.raises(DetentError, match=r"got columns \['t'\]"):
            writer.append(np.zeros(1, dtype=[("t", "f8")]))
    writer.close()
    with pytest.raises(DetentError, match="the trace is closed"):
        writer.append(make_block(10, 12))
    assert len(load_trace(tmp_path / "run.h5")) == 5


@pytest.mark.process
def test_importing_the_module_loads_neither_h5py_nor_pyarrow() -> None:
    import subprocess

    code = (
        "import sys, detent.record.trace_files; "
        "print([name for name in ('h5py', 'pyarrow', 'matplotlib') if name in sys.modules])"
    )
    path = Path(importlib.import_module("detent").__file__ or "").parents[1]
    done = subprocess.run([sys.executable, "-c", code], env={"PYTHONPATH": str(path)}, capture_output=True, check=True)
    assert done.stdout.strip() == b"[]"


@pytest.mark.parametrize("rows", [None, 2])
def test_a_converted_csv_is_the_one_saved_directly(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rows: int | None
) -> None:
    save_trace(make_trace(), tmp_path / "run.h5")
    save_trace(make_trace(), tmp_path / "direct.csv")
    if rows:
        monkeypatch.setattr(trace_files, "CSV_ROWS", rows)
    convert_trace(tmp_path / "run.h5", tmp_path / "converted.csv")
    assert (tmp_path / "converted.csv").read_bytes() == (tmp_path / "direct.csv").read_bytes()


@pytest.mark.parametrize("rows", [None, 2])
def test_a_converted_parquet_holds_what_the_one_saved_directly_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rows: int | None
) -> None:
    save_trace(make_trace(), tmp_path / "run.h5")
    save_trace(make_trace(), tmp_path / "direct.parquet")
    if rows:
        monkeypatch.setattr(trace_files, "PARQUET_ROWS", rows)
    convert_trace(tmp_path / "run.h5", tmp_path / "converted.parquet")
    direct, converted = load_trace(tmp_path / "direct.parquet"), load_trace(tmp_path / "converted.parquet")
    assert_same_columns(direct, converted, dtypes=True)
    assert (converted.units, converted.docs) == (direct.units, direct.docs)
    assert converted.attributes == {**direct.attributes, "detent_version": __version__, "complete": 1}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["converted.parquet", "direct.parquet", "run.h5"]


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_an_empty_trace_is_converted(tmp_path: Path, suffix: str) -> None:
    save_trace(Trace(columns={"t": np.empty(0), "x": np.empty(0)}, units={"t": "s"}), tmp_path / "run.h5")
    convert_trace(tmp_path / "run.h5", tmp_path / f"run{suffix}")
    assert list(load_trace(tmp_path / f"run{suffix}")) == ["t", "x"]


@pytest.mark.parametrize("name", ["run.h5", "run.xlsx", "run"])
def test_a_trace_is_converted_to_csv_and_parquet_only(tmp_path: Path, name: str) -> None:
    save_trace(make_trace(), tmp_path / "store.h5")
    with pytest.raises(DetentError, match=r"cannot be converted to .*; use \.csv or \.parquet"):
        convert_trace(tmp_path / "store.h5", tmp_path / name)


@pytest.mark.parametrize("content", [None, b"", b"not HDF5"])
def test_a_store_that_is_none_is_an_input_error(tmp_path: Path, content: bytes | None) -> None:
    if content is not None:
        (tmp_path / "store.h5").write_bytes(content)
    with pytest.raises(InputError, match=r"store\.h5: got .*; expected: a trace in HDF5; try: give a \.h5 file"):
        convert_trace(tmp_path / "store.h5", tmp_path / "run.csv")
    assert not (tmp_path / "run.csv").exists()


def test_a_store_of_something_else_is_an_input_error(tmp_path: Path) -> None:
    file: Any
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["pictures"] = [1, 2]
        file.create_group("trace")
    with pytest.raises(InputError, match="got HDF5 with pictures, trace; expected: a group /trace"):
        convert_trace(tmp_path / "other.h5", tmp_path / "run.csv")
    with pytest.raises(InputError, match="expected: a group /trace"):
        load_trace(tmp_path / "other.h5")


def test_a_folder_that_is_not_there_is_said_when_converting(tmp_path: Path) -> None:
    save_trace(make_trace(), tmp_path / "run.h5")
    for suffix in (".csv", ".parquet"):
        with pytest.raises(DetentError, match=r"nowhere.*cannot be written"):
            convert_trace(tmp_path / "run.h5", tmp_path / "nowhere" / f"run{suffix}")


def test_parquet_can_be_asked_for_before_any_work(monkeypatch: pytest.MonkeyPatch) -> None:
    need_parquet()
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(DetentError, match=r'pip install "detent\[parquet\]"'):
        need_parquet()
