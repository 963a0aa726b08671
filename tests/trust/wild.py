"""What is made of logs with faults: clean logs, simulated and recorded, and each spoilt in each way."""

import csv
import math
import multiprocessing
import os
import zlib
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.stats import norm

from detent.errors import InputError
from detent.identify.fit.identification import Identification, identify
from detent.logs.read_log import read_log
from tests.places import DATA
from tests.trust.drawn import DRAWN
from tests.trust.faults import FAULTS, Table
from tests.trust.harder_faults import HARDER
from tests.trust.hidden import CLEAR, standard_errors
from tests.trust.later_faults import LATER
from tests.trust.latest_faults import LATEST
from tests.trust.more_faults import MORE
from tests.trust.on_the_way import ON_THE_WAY
from tests.trust.plants import make_case
from tests.trust.table import table
from tests.trust.unseen import SEEN, UNSEEN

CHOSEN = (*FAULTS, *MORE, *HARDER, *LATEST, *LATER, *ON_THE_WAY, *SEEN)
KINDS = (*CHOSEN, *DRAWN, *UNSEEN)
"""Every kind, by its number."""

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
    disjoint, outside, beyond : tuple of str
        Trusted constants whose interval shares nothing with that of the clean log; whose value lies outside of it; and
        of these, those whose own interval does not hold the value of the clean log either.
    """

    log: str
    fault: str
    verdict: str
    said: tuple[str, ...] = ()
    disjoint: tuple[str, ...] = ()
    outside: tuple[str, ...] = ()
    beyond: tuple[str, ...] = ()
    hidden: bool = False
    by_chance: float = 0.0

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


def _sources(
    numbers: Sequence[int], recordings: dict[str, tuple[str, Sequence[str]]]
) -> dict[str, Callable[[], Clean]]:
    found: dict[str, Callable[[], Clean]] = {f"simulated {number}": partial(simulated, number) for number in numbers}
    if DATA.exists():
        found |= {name: partial(recorded, *where) for name, where in recordings.items()}
    return found


_SCREW = ("position=qm [m]", "reference=qg [m]", "force=vir [35.15 N]")
_MOTOR = ("command=-inputSignal",)
_MOTORS, _SERVOS = "arduino_dc_motor/expdata_20201120_21", "servo_pendulum_bam/xl330/2026-01-15_10h"

TRIED = _sources(
    (7001, 7002, 7003, 7005),
    {
        "ball screw": ("emps/DATA_EMPS.mat", _SCREW),
        "small motor": ("arduino_dc_motor/exp1.csv", _MOTOR),
        "servo 2": (f"{_SERVOS}29m04.json.gz", SERVO[1:4]),
    },
)
"""Logs that rules were chosen with."""

OTHERS = _sources(
    (7101, 7102, 7103, 7104, 7201, 7202, 7203, 7204, 7205, 7206),
    {
        "motor 2": (f"{_MOTORS}4756.csv", _MOTOR),
        "motor 3": (f"{_MOTORS}5727.csv", _MOTOR),
        "motor 4": ("arduino_dc_motor/expdata_20201120_220230.csv", _MOTOR),
        "servo 3": (f"{_SERVOS}28m32.json.gz", SERVO[1:4]),
    },
)
"""Logs that they were not chosen with."""

SOURCES = TRIED | OTHERS


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
        writer.writerows([["" if math.isnan(v) else v for v in row] for row in rows])


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


def left_outside(wider: float) -> float:
    """How often a right value lies outside an interval when its own is some times as wide, and holds that of the other.

    Two normal errors, the smaller of which is a part of the larger: what comes on top has the variance
    ``wider^2 - 1``, in that of the smaller, of which 1.96 standard deviations are the interval.
    """
    return float(2.0 * norm.sf(norm.ppf(0.975) / math.sqrt(wider**2 - 1.0)))


def judge_fault(asked: tuple[str, int]) -> Outcome:
    """Identify a log with a fault, and compare its trusted constants with those of the clean log."""
    log, number = asked
    fault, made = KINDS[number], clean(log)
    rng = np.random.default_rng(zlib.crc32(f"{log} {fault.name}".encode()))
    found = found_in(made, fault.spoil({k: v.copy() for k, v in made.table.items()}, rng))
    if isinstance(found, str):
        return Outcome(log, fault.name, "unreadable", (found[:160],))
    known = {e.name: e for e in truth(log).trusted}
    both = [(e, known[e.name]) for e in found.trusted if e.name in known]
    said = [str(r)[:160] for r in found.refusals] + [str(f)[:160] for log in found.logs for f in log.findings]
    outside = [(e, c) for e, c in both if not c.holds(e.value)]
    return Outcome(
        log,
        fault.name,
        found.verdict,
        tuple(said),
        tuple(e.name for e, c in both if e.low > c.high or e.high < c.low),
        tuple(e.name for e, _ in outside),
        tuple(e.name for e, c in outside if not e.holds(c.value)),
        bool(outside) and standard_errors(found, truth(log)) < CLEAR,
        # Constants of one log err together: at least as likely as for that whose interval has grown most.
        max((left_outside(e.half / c.half) for e, c in both if 0.0 < c.half < e.half), default=0.0),
    )


def judge_faults(numbers: Sequence[int], logs: Sequence[str] = (), workers: int | None = None) -> list[Outcome]:
    """Judge every log with every one of some faults."""
    asked = [(log, k) for log in logs or SOURCES for k in numbers if (KINDS[k].needs or "time") in clean(log).table]
    if workers == 1:
        return [judge_fault(one) for one in asked]
    os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"
    with ProcessPoolExecutor(workers or os.cpu_count(), multiprocessing.get_context("spawn")) as pool:
        return list(pool.map(judge_fault, asked, chunksize=max(len(numbers) // 2, 1)))


# ---- the page


HEAD = """# Faults of recordings: what is made of each kind

This page is written by `python -m tests.trust.wild`, run from the root of the project; do not edit it.

{kinds} kinds of faults ([tests/trust/faults.py](../../tests/trust/faults.py) and its neighbours) are put into {logs}.
Each spoilt log goes the way of a user's log, and what is trusted of it is compared with what the clean log gives.

- *Right*: something was trusted, and every trusted interval meets that of the clean log. *Wrong*: one does not.
- *Outside*: a trusted value lies outside the interval of the clean log. A fault that takes away some of what the log
  says, as noise does, makes the interval wider, and leaves a right value outside the clean one: {often:.0%} of the time
  where it is three times as wide. *By chance*: how many are outside so by the widths of their intervals alone.
- *Beyond*: a value is outside, and its own interval does not hold that of the clean log either.
- *Hidden*: a value is outside, and the log does not show the fault: what the constants of another axis leave of it is
  less than {clear:.1f} standard errors of the best test, that knows its form exactly, and the noise of the clean log.

Rules were chosen with the kinds of the second table, and with {tried}. They were not chosen with the sizes of the
first, nor with the kinds of the third, which are put together by lot of what happens, to what, and where; nor with
{others}.

Kinds of the last table make logs of other axes, which may exist, so that no log shows them: an effort that stands early
is a delay, one that lacks what is added for friction is of an axis with less, one that is what a mass would need of an
axis with none; one that is larger throughout is of a larger axis, and one that a dead zone is added to is of an axis
with more friction, as is a zero that is another one way or with the speed. So is, where friction is nearly all of the
effort, another gain of it one way.
"""


def page(outcomes: Sequence[Outcome]) -> str:
    """The page of the documentation."""
    logs, tried, others = (
        f"{', '.join(names[:-1])} and {names[-1]}"
        for names in ([n for n in part if n in {o.log for o in outcomes}] for part in (SOURCES, TRIED, OTHERS))
    )
    kinds, often = len({o.fault for o in outcomes}), left_outside(3.0)
    text = HEAD.format(kinds=kinds, often=often, clear=CLEAR, logs=logs, tried=tried, others=others)
    parts = {
        "The dirt of logs, in sizes drawn by lot": DRAWN,
        "Kinds that rules were chosen with": [fault for fault in CHOSEN if not fault.is_another],
        "Kinds that nobody chose": [fault for fault in UNSEEN if not fault.is_another],
        "What is the log of another axis": [fault for fault in KINDS if fault.is_another],
    }
    for title, part in parts.items():
        names = [fault.name for fault in part]
        text += f"\n## {title}\n\n{fault_table([o for o in outcomes if o.fault in names])}"
    return text


def fault_table(outcomes: Sequence[Outcome]) -> str:
    """A row per kind, and one for all; their shares, and those of logs that rules were chosen with, and of others."""
    rows = [
        [name, *_counts([o for o in outcomes if o.fault == name])] for name in dict.fromkeys(o.fault for o in outcomes)
    ]
    shares = [
        [name, *_shares([o for o in outcomes if o.log in part])]
        for name, part in {"share": SOURCES, "of logs chosen with": TRIED, "of other logs": OTHERS}.items()
    ]
    heads = ("fault", "logs", "right", "wrong", "refused", "outside", "by chance", "beyond", "hidden")
    return table(heads, [*rows, ["all", *_counts(outcomes)], *shares])


def _numbers(outcomes: Sequence[Outcome]) -> tuple[float, ...]:
    wrong, refused = sum(bool(o.disjoint) for o in outcomes), sum(o.is_refused for o in outcomes)
    outside, beyond = sum(bool(o.outside) for o in outcomes), sum(bool(o.beyond) for o in outcomes)
    chance, hidden = round(sum(o.by_chance for o in outcomes), 1), sum(o.hidden for o in outcomes)
    return len(outcomes) - wrong - refused, wrong, refused, outside, chance, beyond, hidden


def _counts(outcomes: Sequence[Outcome]) -> list[str]:
    return [str(len(outcomes)), *map(str, _numbers(outcomes))]


def _shares(outcomes: Sequence[Outcome]) -> list[str]:
    return [str(len(outcomes)), *(f"{100 * number / max(len(outcomes), 1):.1f} %" for number in _numbers(outcomes))]


PAGE = Path(__file__).parents[2] / "docs" / "explanation" / "fault-table.md"


def main() -> None:
    """Judge all logs with all faults, and write the page."""
    PAGE.write_text(page(judge_faults(range(len(KINDS)))), encoding="utf-8")


if __name__ == "__main__":
    main()
