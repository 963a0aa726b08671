"""One target for each reader of a file or a text that comes from outside."""

import gzip
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import h5py
import numpy as np
import scipy.io

from detent import example, load, load_trace
from detent.files.patch import NewValue, patch
from detent.identify.analyse.analyses import ANALYSES, analyse
from detent.identify.fit.identification import identify
from detent.logs.mapping import load_mapping, parse_options
from detent.logs.read_log import read_log
from detent.methods.check import check_spec
from detent.methods.load import read_axis
from detent.methods.registry import METHODS
from detent.operate.positions import load_positions
from detent.record.trace import Trace
from detent.record.trace_files import save_trace
from detent.units import parse_quantity


@dataclass(frozen=True)
class Target:
    """One reader: what it is given, and what good inputs it may be given."""

    name: str
    ending: str  # of the file
    read: Callable[[Path], object]
    seeds: Callable[[Path], Sequence[bytes]]  # good inputs; made in the folder
    text: bool = True  # words and lines are damaged, not bytes alone
    cases: int = 100  # damaged inputs of the short run

    @property
    def file_name(self) -> str:
        """Its name as that of files begins."""
        return self.name.replace(" ", "-")


def examples(*names: str) -> Callable[[Path], Sequence[bytes]]:
    return lambda _: [example(name).read_bytes() for name in names]


def given(*texts: str) -> Callable[[Path], Sequence[bytes]]:
    return lambda _: [text.encode() for text in texts]


def text_of(path: Path) -> str:
    return path.read_bytes().decode("utf-8", "replace")


# ---- axis files and what goes with them


def check(path: Path) -> object:
    return check_spec(read_axis(path)).to_dict()


def override(path: Path) -> object:
    return check_spec(read_axis(example("cascade.toml"), text_of(path).split("\n"))).to_dict()


def put(path: Path) -> object:
    read_axis(path)
    numbers = {"mechanics.motor_mass": "kg", "mechanics.friction.offset": "N", "drive.delay": "", "encoder.new": ""}
    return patch(path.read_bytes().decode(), [NewValue(key, 1.5, unit, "") for key, unit in numbers.items()], "axis")


@cache
def axis(name: str):
    return load(example(name))


def job_of(name: str) -> Callable[[Path], object]:
    return lambda path: axis(name).load_job(path)


def positions(path: Path) -> object:
    (sensor,) = METHODS["cascade"].sensors(axis("cascade.toml").spec).values()
    return load_positions(path, sensor)


def units(path: Path) -> object:
    text = text_of(path)
    return [attempt(text, unit) for unit in ("m", "s", "Hz", "kg", "K", "%", "rad/s")]


def attempt(text: str, unit: str) -> object:
    try:
        return parse_quantity(text, unit)
    except ValueError as error:
        return str(error)


OVERRIDES = ("mechanics.load_mass=40 kg", "drive.supply=34 V", "encoder.resolution=20 nm", "motor.catalogue=", "a.b=1")
MAPPING = """[log]
separator = "semicolon"
decimal = "comma"
header = 3
period = "1 ms"
[columns]
time = "t [ms]"
position = {column = "qm", unit = "0.3125 um", sign = -1, bits = 16, delay = "1 ms"}
force = {column = "vir", unit = "N", factor = "gtau", offset = 1.0}
velocity = ""
[constants]
gtau = 35.15
"""
OPTIONS = (
    "position=qm [m]",
    "force=-vir [35.15 N]",
    "velocity=",
    "decimal=comma",
    "header=3",
    "period=1 ms",
    "table=a",
)
QUANTITIES = ("12 mm", "-2.5 %", "3 in/s^2", "1e3 kg*m**2", "0.3125 µm", "20 °C", "3/4 in", "1 N·m/A", "5 1/s")
TEXT = "letter\twith tabs\n\x0cpage two, b\u0301, 12.5 mm\r\noverstruck\rline\n"
POSITIONS = "name,position [mm],counts,tolerance [um]\n1,12.5,12500,10\n2,0.75,,\nloading,,40000,5\n"
POSITIONS_TOML = '[[position]]\nname = "1"\nposition = "12.5 mm"\ncounts = 12500\ntolerance = "10 um"\n'
MOVES = '[[move]]\nto = "10 mm"\nspeed = "0.1 m/s"\nrepeat = 3\n[[move]]\nby = "-2 mm"\ndwell = "5 ms"\n'

# ---- recordings

T = np.arange(300) * 1e-3


def signals() -> dict[str, np.ndarray]:
    x = 0.01 * np.sin(30 * T) * (1 + T)
    force = 2.0 * np.gradient(np.gradient(x, T), T) + 3.0 * np.gradient(x, T) + 0.5 * np.sign(np.gradient(x, T))
    return {"t": T, "position": np.round(x, 7), "force": np.round(force, 4), "counts": (T * 1e6).astype(int) % 4096}


HEADINGS = ("t [s]", "position [mm]", "force [N]", "counts")


def csv_logs(_: Path) -> list[bytes]:
    found = signals()
    rows = list(zip(*(values.tolist() for values in found.values()), strict=True))
    plain = "\n".join([",".join(HEADINGS), *(",".join(map(str, row)) for row in rows)])
    german = "\n".join([";".join(HEADINGS), *(";".join(map(str, row)).replace(".", ",") for row in rows[:99])])
    dated = "\n".join(["time,x", *(f"2024-01-01T00:00:{k / 10:06.3f},{k}" for k in range(80))])
    words = "remark: made by hand\n\n# t  x  state\n" + "\n".join(f"{k} {k * k} on" for k in range(60))
    return [text.encode() for text in (plain, german, dated, words, '"t [s]","x"\n"0.1","2"\n"0.2","3"\n')]


def gz_logs(folder: Path) -> list[bytes]:
    return [gzip.compress(data, mtime=0) for data in csv_logs(folder)]


def json_logs(_: Path) -> list[bytes]:
    found = {name: values[:60].tolist() for name, values in signals().items()}
    records = [dict(zip(found, row, strict=True)) for row in zip(*found.values(), strict=True)]
    nested = {"name": "run 1", "gain": 2.5, "log": {"rows": records[:20]}, "other": [[1, 2], [3, 4]]}
    listed = [[*found], *map(list, zip(*found.values(), strict=True))]
    return [json.dumps(value).encode() for value in (found, records, nested, listed)]


def json_lines(_: Path) -> list[bytes]:
    records = json.loads(json_logs(Path())[1])
    return ["\n".join(json.dumps({**one, "at": "2024-01-01T00:00:01", "x": [1]}) for one in records).encode()]


def npz_logs(folder: Path) -> list[bytes]:
    np.savez(folder / "a.npz", **signals(), gain=2.5)
    np.savez_compressed(folder / "b.npz", **signals(), name="run")
    return [(folder / name).read_bytes() for name in ("a.npz", "b.npz")]


def npy_logs(folder: Path) -> list[bytes]:
    found = signals()
    np.save(folder / "a.npy", np.rec.fromarrays([*found.values()], names=[*found]))
    np.save(folder / "b.npy", np.column_stack([*found.values()]))
    return [(folder / name).read_bytes() for name in ("a.npy", "b.npy")]


def mat_logs(folder: Path) -> list[bytes]:
    run = {"run": signals() | {"name": "one", "cells": np.array([1, "a"], dtype=object)}}
    scipy.io.savemat(folder / "a.mat", signals())
    scipy.io.savemat(folder / "b.mat", run, do_compression=True)
    scipy.io.savemat(folder / "c.mat", signals(), format="4")
    return [(folder / name).read_bytes() for name in ("a.mat", "b.mat", "c.mat")]


def hdf5_logs(folder: Path) -> list[bytes]:
    for name, more in (("a.h5", {}), ("b.h5", {"compression": "gzip", "chunks": (50,), "shuffle": True})):
        with h5py.File(folder / name, "w", libver="latest" if more else "earliest") as file:
            for column, values in signals().items():
                file.create_dataset(f"run/{column}", data=values, **more).attrs["unit"] = "m"
            file["name"], file["gain"] = "one", 2.5
            file["table"] = np.rec.fromarrays([T, T], names=["t", "x"])
            file["again"] = h5py.SoftLink("/run")
    return [(folder / name).read_bytes() for name in ("a.h5", "b.h5")]


def parquet_logs(folder: Path) -> list[bytes]:
    save_trace(trace(), folder / "a.parquet")
    return [(folder / "a.parquet").read_bytes()]


def trace() -> Trace:
    columns = {"t": T, "motor.current": np.sin(T), "state": (T * 50).astype(np.int8)}
    return Trace(columns=columns, units={"t": "s"}, docs={"state": "what"}, attributes={"seed": 3, "axis": "x"})


def traces(ending: str) -> Callable[[Path], Sequence[bytes]]:
    def made(folder: Path) -> Sequence[bytes]:
        save_trace(trace(), folder / f"trace{ending}")
        return [(folder / f"trace{ending}").read_bytes()]

    return made


def ask(path: Path) -> object:
    log = read_log(path)
    return log.to_dict(), [analyse(log, name).to_dict() for name in ANALYSES]


def find(path: Path) -> object:
    return identify([read_log(path)]).to_dict()


def replay(path: Path) -> object:
    return axis("cascade.toml").load_recording(path)


AXES = ("print_head", "phase_servo", "filtered_servo", "rotary_table", "cascade")
BINARY = {"text": False, "cases": 40}

TARGETS = {
    target.name: target
    for target in (
        *(Target(f"axis {name}", ".toml", check, examples(f"{name}.toml"), cases=15) for name in AXES),
        Target("axis stepper_envelope", ".toml", check, examples("zoom.toml", "stage.toml"), cases=15),
        Target("axis patched", ".toml", put, examples("cascade.toml"), cases=15),
        Target("--set", ".txt", override, given(*OVERRIDES, "\n".join(OVERRIDES)), cases=15),
        Target("units", ".txt", units, given(*QUANTITIES), cases=300),
        Target("job text", ".txt", job_of("print_head.toml"), examples("letter.txt")),
        Target("job stream", ".prn", job_of("print_head.toml"), examples("brochure.prn"), text=False),
        Target("job moves", ".csv", job_of("cascade.toml"), examples("moves.csv", "turn_moves.csv")),
        Target("job moves toml", ".toml", job_of("filtered_servo.toml"), given(MOVES), cases=50),
        Target("job turns", ".csv", job_of("turntable.toml"), examples("turn_moves.csv")),
        Target("job typed", ".txt", job_of("phase_servo.toml"), given(TEXT)),
        Target("job sequence", ".toml", job_of("rotary_table.toml"), examples("index_sequence.toml"), cases=50),
        Target("job tiles", ".csv", job_of("stage.toml"), examples("tiles.csv")),
        Target("job zoom", ".toml", job_of("zoom.toml"), examples("zoom_sequence.toml"), cases=50),
        Target("positions", ".csv", positions, given(POSITIONS)),
        Target("positions toml", ".toml", positions, given(POSITIONS_TOML), cases=50),
        Target("mapping", ".toml", load_mapping, given(MAPPING), cases=50),
        Target("--column", ".txt", lambda path: parse_options(text_of(path).split("\n")), given(*OPTIONS)),
        Target("log csv", ".csv", read_log, csv_logs, cases=25),
        Target("log gz", ".csv.gz", read_log, gz_logs, **BINARY),
        Target("log json", ".json", read_log, json_logs, cases=30),
        Target("log jsonl", ".jsonl", read_log, json_lines, cases=25),
        Target("log npz", ".npz", read_log, npz_logs, **BINARY),
        Target("log npy", ".npy", read_log, npy_logs, **BINARY),
        Target("log mat", ".mat", read_log, mat_logs, **BINARY),
        Target("log hdf5", ".h5", read_log, hdf5_logs, **BINARY),
        Target("log parquet", ".parquet", read_log, parquet_logs, **BINARY),
        Target("trace hdf5", ".h5", load_trace, traces(".h5"), **BINARY),
        Target("trace csv", ".csv", load_trace, traces(".csv"), cases=50),
        Target("trace parquet", ".parquet", load_trace, traces(".parquet"), **BINARY),
        Target("analyse", ".csv", ask, csv_logs, cases=10),
        Target("identify", ".csv", find, csv_logs, cases=4),
        Target("replay", ".csv", replay, csv_logs, cases=20),
    )
}
