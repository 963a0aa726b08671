"""Recordings made by arithmetic, for the methods of identification."""

import numpy as np

from detent.logs.log import Log
from detent.logs.mapping import Choice, ColumnMapping, parse_options
from detent.logs.read_log import read_log
from tests.places import DATA

EMPS = DATA / "emps/DATA_EMPS.mat"
"""A ball-screw axis, recorded for 25 s (A. Janot, M. Gautier, M. Brunot, 2019)."""

UNITS = {
    "position": "m", "reference": "m", "velocity": "m/s", "force": "N", "torque": "N*m", "current": "A",
    "voltage": "V", "command": "",
}  # fmt: skip


def make_log(t, units=None, **signals) -> Log:
    """A log of signals in SI units, of an axis that moves straight where no unit is stated."""
    known = {"time": "s"} | {role: UNITS[role] for role in signals} | (units or {})
    values = {role: np.asarray(series, float) for role, series in signals.items()}
    return Log("made.csv", np.asarray(t, float), values, known, {}, np.arange(1, len(t) + 1))


def coloured(rng, count: int, size: float, phi: float = 0.8):
    """Noise of first order: standard deviation `size`, correlation `phi` of neighbours, shape (count,)."""
    from scipy.signal import lfilter

    white = rng.standard_normal(count + 500)
    return size * np.sqrt(1 - phi**2) * lfilter([1.0], [1.0, -phi], white)[500:]


def quantised(values, step: float):
    """The values in whole steps, as an encoder or a converter reads them."""
    return step * np.rint(np.asarray(values) / step)


def assert_covers(hits: list[bool], least: float = 0.91, most: float = 0.99) -> None:
    """As many intervals hold the true value as 95 % intervals should, within what chance allows."""
    share = float(np.mean(hits))
    assert least <= share <= most, f"{share:.3f} of {len(hits)} intervals hold the true value"


GTAU = ColumnMapping({"force": Choice(column="vir", unit="N", factor="gtau")})


def read_emps() -> Log:
    """That recording, with its force in newtons."""
    return read_log(EMPS, parse_options(["time=t [s]", "position=qm [m]"]).overridden(GTAU))
