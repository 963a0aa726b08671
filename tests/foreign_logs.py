"""One motion of a rigid axis as the programs of others write it: a file of each kind, with the statement it needs.

The layouts follow what the programs document or export; the numbers are ours. ``position`` is in mm, ``current`` in A,
``velocity`` in mm/s; of an axis of 2 A s^2/m, 6 A s/m and 1.5 A of Coulomb friction.
"""

import json
import warnings
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
import pandas as pd
from scipy.io import savemat

TRUTH = {"mass": 2.0, "viscous": 6.0, "coulomb": 1.5}  # in A s^2/m, A s/m, A


class Motion(NamedTuple):
    """What was recorded, shape (n,) each."""

    t: np.ndarray  # s
    position: np.ndarray  # m
    velocity: np.ndarray  # m/s
    current: np.ndarray  # A
    reference: np.ndarray  # m


def motion(n: int = 8000, dt: float = 0.001, coulomb: float = TRUTH["coulomb"], seed: int = 5) -> Motion:
    """A motion with reversals and many accelerations, a current that drives it, noise in what is measured."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) * dt
    velocity, acceleration, position = np.zeros(n), np.zeros(n), np.zeros(n)
    for frequency, amplitude in ((0.25, 0.06), (0.7, 0.02), (1.9, 0.004), (3.1, 0.0015)):
        w, phase = 2 * np.pi * frequency, rng.uniform(0, 6.28)
        position += amplitude * (np.sin(w * t + phase) - np.sin(phase))
        velocity += amplitude * w * np.cos(w * t + phase)
        acceleration -= amplitude * w**2 * np.sin(w * t + phase)
    current = TRUTH["mass"] * acceleration + TRUTH["viscous"] * velocity + coulomb * np.sign(velocity)
    noise = rng.normal(0, 0.02, n)
    reference = np.interp(t + 0.004, t, position)
    return Motion(t, np.round(position / 1e-7) * 1e-7, velocity, np.round((current + noise) / 1e-4) * 1e-4, reference)


def rows(*columns: np.ndarray, separator: str = ",", decimal: str = ".", end: str = "") -> str:
    """Lines of numbers."""
    lines = (separator.join(f"{value:.9g}" for value in row) + end for row in zip(*columns, strict=True))
    return "\n".join(lines).replace(".", decimal) + "\n"


class Kind(NamedTuple):
    """One way of writing a recording."""

    name: str
    suffix: str
    write: Callable[[Path, Motion], Any]
    options: tuple[str, ...] = ()  # the one statement it needs, if any


def _text(make: Callable[[Motion], str], encoding: str = "utf-8") -> Callable[[Path, Motion], Any]:
    return lambda path, m: path.write_text(make(m), encoding=encoding)


def _structs(pairs: Iterable[tuple[str, np.ndarray]], key: str = "Name") -> np.ndarray:
    """A struct array with Name and Data, as a dSPACE recorder writes its signals."""
    pairs = list(pairs)
    array = np.zeros((1, len(pairs)), dtype=[(key, "O"), ("Data", "O"), ("Unit", "O")])
    for place, (name, data) in enumerate(pairs):
        array[0, place] = (name, data.reshape(1, -1), "")
    return array


def dspace(path: Path, m: Motion) -> None:
    """A recorder's capture: X with the time, Y with the signals, paths of a model as their names."""
    signals = [("Model Root/enc1/pos_mm", m.position * 1e3), ("Model Root/amp/current_A", m.current)]
    x = np.zeros((1, 1), dtype=[("Data", "O")])
    x[0, 0] = (m.t.reshape(1, -1),)
    capture = {"X": x, "Y": _structs(signals), "Description": "ControlDesk"}
    savemat(path, {"run_1": capture})


def simulink(path: Path, m: Motion) -> None:
    """A structure with time: time, signals(i).values, signals(i).label."""
    signals = np.zeros((1, 2), dtype=[("values", "O"), ("dimensions", "O"), ("label", "O")])
    signals[0, 0] = (m.position.reshape(-1, 1), 1, "position [m]")
    signals[0, 1] = (m.current.reshape(-1, 1), 1, "current [A]")
    savemat(path, {"ScopeData": {"time": m.t.reshape(-1, 1), "signals": signals, "blockName": "model/Scope"}})


def hdf_structs(path: Path, m: Motion) -> None:
    """The recorder's capture as MATLAB 7.3: fields of a struct array are references."""
    with h5py.File(path, "w", userblock_size=512) as file:
        refs = file.create_group("#refs#")
        run = file.create_group("run_1")

        def texts(name: str, text: str):
            data = refs.create_dataset(name, data=np.array([[ord(sign)] for sign in text], dtype=np.uint16))
            data.attrs["MATLAB_class"] = np.bytes_("char")
            return data.ref

        x, y = run.create_group("X"), run.create_group("Y")
        x.create_dataset("Data", data=m.t.reshape(-1, 1))
        named = {"a": ("pos_mm", m.position * 1e3), "b": ("current_A", m.current)}
        kind = h5py.ref_dtype
        names = [texts(f"n{key}", name) for key, (name, _) in named.items()]
        data = [refs.create_dataset(f"d{key}", data=values.reshape(-1, 1)).ref for key, (_, values) in named.items()]
        y.create_dataset("Name", data=np.array(names, dtype=kind).reshape(-1, 1), dtype=kind)
        y.create_dataset("Data", data=np.array(data, dtype=kind).reshape(-1, 1), dtype=kind)
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file".ljust(116) + bytes(8) + b"\x00\x02IM")


def matlab_table(path: Path, m: Motion, *, is_timed: bool, version: str) -> None:
    """A table, or a timetable with its times beside the rows."""
    columns = {"pos_mm": m.position * 1e3, "current_A": m.current}
    if is_timed:
        times = np.rint(m.t * 1e9).astype("timedelta64[ns]")
        frame = pd.DataFrame(columns, index=pd.TimedeltaIndex(times, name="Time"))
    else:
        frame = pd.DataFrame({"t_s": m.t} | columns)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it says which unit of time it chose
        from matio import save_to_mat

        save_to_mat(str(path), {"run": frame}, version=version)


def twincat(m: Motion) -> str:
    """A scope's export: a block of properties, then a pair of columns, time and value, for each channel."""
    names = ["Axis 1.ActPos", "Axis 1.ActCurrent"]
    head = ["Name\tScope Project", "File\tC:\\scope.tcscopex", "Starttime of export\t133456789012345678",
            "Endtime of export\t133456869012345678", ""]  # fmt: skip
    properties = [("Name", names), ("SymbolComment", ["", ""]), ("Data-Type", ["REAL64", "REAL64"]),
                  ("SampleTime[ms]", ["1", "1"]), ("VariableSize", ["8", "8"]), ("Unit", ["mm", "A"])]  # fmt: skip
    head += ["\t".join(f"{key}\t{value}" for value in values) for key, values in properties]
    return "\n".join(head) + "\n\n" + rows(m.t * 1e3, m.position * 1e3, m.t * 1e3, m.current, separator="\t")


def codesys(m: Motion) -> str:
    """A trace as CSV: seconds and variables by their paths, semicolons, decimal comma."""
    return "Zeit [µs];PLC_PRG.axis.fActPosition;PLC_PRG.axis.fActCurrent;\n" + rows(
        m.t * 1e6, m.position * 1e3, m.current, separator=";", decimal=",", end=";"
    )


def sysid(path: Path, m: Motion) -> None:
    """A recording of a robot's characterisation: lists of rows by test, of time, voltage, position and velocity."""
    half = len(m.t) // 2

    def part(first: int, last: int) -> list[list[float]]:
        piece = slice(first, last)
        rows = np.column_stack([m.t[piece], m.current[piece], m.position[piece], m.velocity[piece]])
        return np.round(rows, 7).tolist()

    tests = {"fast-forward": part(half, half + half // 2), "fast-backward": part(half + half // 2, 2 * half),
             "slow-forward": part(0, half // 2), "slow-backward": part(half // 2, half)}  # fmt: skip
    path.write_text(json.dumps({"sysid": True, "test": "Elevator", "units": "Meters", "unitsPerRotation": 0.1} | tests))


def nested(path: Path, m: Motion) -> None:
    """A document: a list of samples deep inside, each with structures of its own."""
    samples = [
        {"ts": t, "axis": {"feedback": {"position_mm": x * 1e3, "current_A": i}}, "state": "run"}
        for t, x, i in zip(m.t.tolist(), m.position.tolist(), m.current.tolist(), strict=True)
    ]
    path.write_text(json.dumps({"meta": {"device": "x1", "rate": 1000}, "data": {"run": {"samples": samples}}}))


def archiver(m: Motion) -> str:
    """Process variables exported with a date for each row."""
    start = np.datetime64("2026-03-01T08:00:00", "us")
    stamps = start + (m.t * 1e6).astype("timedelta64[us]")
    lines = ["Timestamp,SLIDE:m1.RBV [mm],SLIDE:m1:current [A],Severity"]
    lines += [f"{str(stamp).replace('T', ' ')},{x:.9g},{i:.9g},NO_ALARM"
              for stamp, x, i in zip(stamps, m.position * 1e3, m.current, strict=True)]  # fmt: skip
    return "\n".join(lines) + "\n"


def quoted(m: Motion) -> str:
    """Each row in one pair of quotation marks, as a spreadsheet leaves them that took a row for a cell."""
    body = rows(m.t, m.position * 1e3, m.current).splitlines()
    return "\n".join(f'"{line}"' for line in ["time [s],position [mm],current [A]", *body]) + "\n"


def table(
    head: str,
    separator: str = ",",
    decimal: str = ".",
    end: str = "",
    encoding: str = "utf-8",
    scale: tuple[float, float, float] = (1.0, 1e3, 1.0),
) -> Callable[[Path, Motion], Any]:
    """A table of time, position and current below some lines, by default in s, mm and A."""

    def lines(m: Motion) -> str:
        columns = (values * factor for values, factor in zip((m.t, m.position, m.current), scale, strict=True))
        return f"{head}\n{rows(*columns, separator=separator, decimal=decimal, end=end)}"

    return _text(lines, encoding)


def by_velocity(m: Motion) -> str:
    """A table without a position."""
    return "time [s],velocity [mm/s],current [A]\n" + rows(m.t, m.velocity * 1e3, m.current)


def signals(path: Path, recorded: Motion) -> None:
    """A list of signals, each with its name, its unit and its numbers."""
    told = (("time", "s", recorded.t), ("position", "mm", recorded.position * 1e3), ("current", "A", recorded.current))
    held = [{"name": name, "unit": unit, "values": values.tolist()} for name, unit, values in told]
    path.write_text(json.dumps({"device": "drive 7", "signals": held}), encoding="utf-8")


def by_line(path: Path, m: Motion) -> None:
    """One record per line, with a structure in it."""
    samples = zip(m.t.tolist(), (m.position * 1e3).tolist(), m.current.tolist(), strict=True)
    records = ({"t": t, "axis": {"pos_mm": x}, "current_A": i} for t, x, i in samples)
    path.write_text("".join(json.dumps(record) + "\n" for record in records))


TABLES = {  # from a kind to its file: in semicolons and decimal commas where it stands in a language that has them
    "two_line_header": table("Time,Position,Current\ns,mm,A"),
    "three_line_header": table("Time,Position,Current\n[s],[mm],[A]\nclock,encoder 1,drive"),
    "comment_header": table("# recorded by hand\n# t [s]\tx [mm]\ti [A]", "\t"),
    "comment_units": table("% time position current\n% s mm A", " "),
    "trailing": table("t [s],position [mm],current [A],", end=","),
    "german": table("Zeit in s;Istposition in mm;Iststrom in A", ";", ","),
    "german_drive": table("Zeitstempel [s];Lageistwert [mm];Motorstrom [A]", ";", ","),
    "spanish": table("Tiempo (s);Posición (mm);Corriente (A)", ";", ","),
    "french": table("Temps (s);Position mesurée (mm);Courant moteur (A)", ";", ","),
    "french_latin": table("Temps (s);Position réelle (mm);Intensité (A)", ";", ",", encoding="cp1252"),
    "italian": table("Tempo (s);Posizione (mm);Corrente (A)", ";", ","),
    "chinese": table("时间 (s),位置 (mm),电流 (A)"),
    "chinese_wide": table("时间（s）,实际位置（mm）,电机电流（A）"),
    "japanese": table("時間[s],位置[mm],電流[A]"),
    "tab_utf16": table("time [s]\tposition [mm]\tcurrent [A]", "\t", encoding="utf-16"),
    "thousands": table("t_ms;pos_um;iq_mA", ";", ",", scale=(1e3, 1e6, 1e3)),
}
VERSIONS = [(is_timed, version) for is_timed in (False, True) for version in ("v7", "v7.3")]
KINDS = (
    Kind("dspace", ".mat", dspace),
    Kind("dspace_hdf5", ".mat", hdf_structs),
    Kind("simulink", ".mat", simulink),
    *(
        Kind(f"matlab_{'time' * is_timed}table_{version}", ".mat",
             partial(matlab_table, is_timed=is_timed, version=version))
        for is_timed, version in VERSIONS
    ),
    Kind("twincat", ".csv", _text(twincat)),
    Kind("codesys", ".csv", _text(codesys), ("position=PLC_PRG.axis.fActPosition [mm]",)),
    Kind("sysid", ".json", sysid),
    Kind("nested", ".json", nested),
    Kind("signals", ".json", signals),
    Kind("archiver", ".csv", _text(archiver)),
    Kind("quoted_rows", ".csv", _text(quoted)),
    *(Kind(name, ".csv", write) for name, write in TABLES.items()),
    Kind("per_cent", ".csv", table("time [s],position [mm],torque [%]", scale=(1, 1e3, 10)),
         ("torque=torque [% of 10 N*m]",)),
    Kind("per_mille", ".csv", table("time [s],position [mm],Motorstrom [‰]", scale=(1, 1e3, 100)),
         ("current=Motorstrom [‰ of 10 A]",)),
    Kind("velocity_only", ".csv", _text(by_velocity)),
    Kind("lines", ".jsonl", by_line),
)  # fmt: skip
"""Every kind of file."""
