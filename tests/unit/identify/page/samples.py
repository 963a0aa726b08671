"""Identifications for the tests of their report: a real one, and what its verdict could have been."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from tests.trust.judge import write_csv
from tests.trust.plants import make_case

from detent.identify.analyse.measure_response import FrequencyResponse
from detent.identify.fit.constants import Constants
from detent.identify.fit.estimate import Estimate, estimate
from detent.identify.fit.identification import Identification, identify
from detent.identify.fit.verdict import Refusal
from detent.identify.page.compared import Windows
from detent.logs.log import Action, Finding, Kind, Severity
from detent.logs.read_log import read_log

SHORT = Refusal("too short", "it moves for <0.3> s", "record 10 s")
SLOW = Refusal(
    "not determined by the data", "it is & stays unknown", "record slow moves", ("viscous.positive", "viscous.negative")
)
DROPPED = Finding(
    Kind.DROPPED_ROWS, "", ((17, 19), (40, 40)), "4 rows < 5 are gone", Action.LEFT, "record & save faster"
)
FLIPPED = Finding(Kind.WRONG_SIGN, "force", (), "opposes the motion", Action.TURNED, severity=Severity.ERROR)


@cache
def identified() -> Identification:
    """A log of 10 s with everything in it, identified."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run <1>.csv"
        write_csv(make_case(3), path)
        return identify([read_log(path)])


def trusted() -> Identification:
    """The same without a doubt."""
    return replace(identified(), refusals=())


def partly() -> Identification:
    """The same with a doubt about some constants."""
    return replace(identified(), refusals=(SLOW,))


def refused() -> Identification:
    """The same with a doubt about everything."""
    return replace(identified(), refusals=(SHORT, SLOW))


def unfitted() -> Identification:
    """Nothing came out, of a log with faults."""
    found = identified()
    log = replace(found.logs[0], findings=(DROPPED, FLIPPED))
    return Identification((log,), found.runs, None, (), (), None, (), (SHORT,))


def constants() -> Constants:
    """Plain ones of a model with low-speed friction, with standard errors of 1 %."""
    values = {
        "mass": 2.0, "coulomb.positive": 10.0, "coulomb.negative": 8.0, "viscous.positive": 5.0,
        "viscous.negative": 4.0, "static.positive": 13.0, "static.negative": 9.0, "delay": 1e-3, "stribeck": 0.01,
    }  # fmt: skip
    numbers = np.array(list(values.values()))
    return Constants(tuple(values), numbers, np.diag((0.01 * numbers) ** 2), np.full(len(numbers), 1000.0), "by hand")


def rigid(lines: int = 40, coherence: float = 1.0, rough: float = 0.0) -> FrequencyResponse:
    """Response of 2 kg from 1 to 40 Hz; rough ones have every other line so much smaller."""
    f = np.linspace(1.0, 40.0, lines)
    size = np.where(np.arange(lines) % 2 == 1, np.exp(-rough), 1.0)
    response = -size / (2.0 * (2 * np.pi * f) ** 2) + 0j
    return FrequencyResponse(
        f, response, np.full(lines, coherence), np.full(lines, 0.01), 5.0, 0.0, "mean of 5 <periods>", "N", "m"
    )


def number(value: float, half: float, unit: str = "N", name: str = "coulomb.positive") -> Estimate:
    """A constant with an interval."""
    return replace(estimate(name, value, unit, half / 1.96, "by hand"), low=value - half, high=value + half)


def windows(count: int = 400, gap: int = 0) -> Windows:
    """Rows of a regression, with some of them missing in the middle."""
    place = np.arange(count)
    place[count // 2 :] += gap
    velocity = 0.2 * np.sin(place / 20)
    residual = np.cos(place * 1.7)
    return Windows(place * 0.01, 10 + residual, np.full(count, 10.0), residual, velocity, place, 0.01, 0.04)
