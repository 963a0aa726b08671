"""What the identification makes of logs with faults: clean logs, simulated and recorded, and each spoilt in each way."""

import csv
import multiprocessing
import os
import zlib
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from detent.errors import InputError
from detent.identify.fit.identification import Identification, identify
from detent.logs.read_log import read_log
from tests.places import DATA
from tests.trust.faults import FAULTS, Table
from tests.trust.plants import make_case

SIMULATED = (7001, 7002, 7003, 7005, 7006, 7008)
"""Numbers of cases that faults are put into."""

SERVO = ("time=timestamp", "position=position [rad]", "reference=goal_position [rad]", "velocity=", "command=load")


@dataclass(frozen=True)
class Clean:
    """A log without faults: its table, its headings."""

    table: Table
    headings: dict[str, str]


@dataclass(frozen=True)
class Outcome:
    """What came of a spoilt log.

    Attributes
    ----------
    log, fault : str
    verdict : str
    said : tuple of str
        What was refused, or noted of the file.
    disjoint, outside : tuple of str
        Trusted constants whose interval shares nothing with that of the clean log; whose value lies outside of it.
    """

    log: str
    fault: str
    verdict: str
    said: tuple[str, ...] = ()
    disjoint: tuple[str, ...] = ()
    outside: tuple[str, ...] = ()

    @property
    def is_refused(self) -> bool:
        return self.verdict in {"refused", "unreadable"}


def simulated(number: int) -> Clean:
    found = make_case(number).columns
    table = dict(zip(("time", "reference", "position", "effort"), (v.copy() for v in found.values()), strict=True))
    return Clean(table, {"reference": "position ref [m]", "position": "position [m]", "effort": "force [N]"})


def recorded(path: str, columns: Sequence[str]) -> Clean:
    """The signals of a recording of a machine."""
    log = read_log(DATA / path, None, columns)
    effort = log.effort()
    unit = log.units["position"]
    table = {"time": log.t, "position": log.signals["position"], "effort": log.signals[effort]}
    headings = {"position": f"position [{unit}]", "effort": f"{effort} [{log.units[effort]}]"}
    if "reference" in log.signals:
        table["reference"] = log.signals["reference"]
        headings["reference"] = f"position ref [{unit}]"
    return Clean(table, {k: v.removesuffix(" []") for k, v in headings.items()})


def _sources() -> dict[str, Callable[[], Clean]]:
    def simulate(number: int) -> Callable[[], Clean]:
        return lambda: simulated(number)

    def record(path: str, columns: Sequence[str]) -> Callable[[], Clean]:
        return lambda: recorded(path, columns)

    found = {f"simulated {number}": simulate(number) for number in SIMULATED}
    if DATA.exists():
        screw = ("position=qm [m]", "reference=qg [m]", "force=vir [35.15 N]")
        motor = ("command=-inputSignal",)
        servos = "servo_pendulum_bam/xl330/2026-01-15_10h"
        found |= {
            "ball screw": record("emps/DATA_EMPS.mat", screw),
            "small motor": record("arduino_dc_motor/exp1.csv", motor),
            "small motor 2": record("arduino_dc_motor/expdata_20201120_214756.csv", motor),
            "servo": record(f"{servos}28m32.json.gz", SERVO[1:4]),
            "servo 2": record(f"{servos}29m04.json.gz", SERVO[1:4]),
        }
    return found


SOURCES = _sources()


@cache
def clean(name: str) -> Clean:
    return SOURCES[name]()


def write(made: Clean, table: Table, path: Path) -> None:
    """Write a table as a log."""
    unit = made.headings["position"].partition("[")[2].rstrip("]")
    headings = {"time": "t [s]", "velocity": f"velocity [{unit}/s]"} | made.headings
    names = [name for name in ("time", "reference", "position", "velocity", "effort") if name in table]
    rows = zip(*(np.round(table[name], 12).tolist() for name in names), strict=True)
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([headings[name] for name in names])
        writer.writerows([["" if v != v else v for v in row] for row in rows])


def found_in(made: Clean, table: Table) -> Identification | str:
    """The identification of a table by the way of its file, or why there is none."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        write(made, table, path)
        try:
            return identify([read_log(path)])
        except InputError as error:
            return str(error)


@cache
def truth(name: str) -> Identification:
    """What the clean log says."""
    made = clean(name)
    found = found_in(made, made.table)
    assert not isinstance(found, str), found
    return found


def judge_fault(asked: tuple[str, int]) -> Outcome:
    """Identify a log with a fault, and compare its trusted constants with those of the clean log."""
    log, number = asked
    fault, made = FAULTS[number], clean(log)
    rng = np.random.default_rng(zlib.crc32(f"{log} {fault.name}".encode()))
    found = found_in(made, fault.spoil({k: v.copy() for k, v in made.table.items()}, rng))
    if isinstance(found, str):
        return Outcome(log, fault.name, "unreadable", (found[:160],))
    known = {e.name: e for e in truth(log).trusted}
    both = [(e, known[e.name]) for e in found.trusted if e.name in known]
    said = [str(r)[:160] for r in found.refusals] + [str(f)[:160] for log in found.logs for f in log.findings]
    return Outcome(
        log,
        fault.name,
        found.verdict,
        tuple(said),
        tuple(e.name for e, c in both if e.low > c.high or e.high < c.low),
        tuple(e.name for e, c in both if not c.holds(e.value)),
    )


def judge_faults(numbers: Sequence[int], logs: Sequence[str] = (), workers: int | None = None) -> list[Outcome]:
    """Judge every log with every one of some faults."""
    asked = [(log, number) for log in logs or SOURCES for number in numbers]
    if workers == 1:
        return [judge_fault(one) for one in asked]
    os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"
    with ProcessPoolExecutor(workers or os.cpu_count(), multiprocessing.get_context("spawn")) as pool:
        return list(pool.map(judge_fault, asked, chunksize=max(len(numbers) // 2, 1)))
