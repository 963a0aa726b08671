"""Kinds of faults that nobody chose: put together by lot of what happens, to what, and where in a log.

Rules were chosen with `SEEN`, and none with `UNSEEN`: which of these are accepted and wrong was looked at when they had
been counted, and no rule came of it. Whoever chooses one by them draws others.
"""

from collections.abc import Callable
from itertools import product

import numpy as np

from tests.trust.drawn import Lots
from tests.trust.faults import Fault, Table, corner, low_passed, period, renumbered, size, with_
from tests.trust.more_faults import course, velocity

Where = Callable[[Table, Lots, np.random.Generator], np.ndarray]
What = Callable[[np.ndarray, np.ndarray, Table, str, Lots, np.random.Generator], np.ndarray]


def place(table: Table) -> np.ndarray:
    """Place in the travel, from 0 to 1."""
    return (table["position"] - table["position"].min()) / size(table, "position")


def share(values: np.ndarray) -> np.ndarray:
    """Sizes in parts of the largest."""
    return np.abs(values) / np.abs(values).max()


def stretch(table: Table, lot: Lots, rng: np.random.Generator) -> np.ndarray:
    half = lot.size(0.05, 0.2)
    return (np.abs(course(table) - rng.uniform(0.15, 0.85)) < half).astype(float)


WHERE: dict[str, Where] = {
    "ever more": lambda table, _, __: course(table),
    "from somewhere on": lambda table, _, rng: (course(table) > rng.uniform(0.2, 0.8)).astype(float),
    "in a stretch": stretch,
    "here and there": lambda table, lot, rng: (rng.random(len(course(table))) < lot.size(0.01, 0.2)).astype(float),
    "up and down": lambda table, lot, _: 0.5 * (1.0 + np.sin(np.pi * lot.count(2, 20) * course(table))),
    "with the place": lambda table, _, __: place(table),
    "with the speed": lambda table, _, __: share(velocity(table)),
    "where it is slow": lambda table, _, __: 1.0 - share(velocity(table)),
    "one way": lambda table, _, __: (velocity(table) > 0.0).astype(float),
    "with the effort": lambda table, _, __: share(table["effort"]),
}
"""How much of a fault is where, from 0 to 1."""


def gain(values: np.ndarray, much: np.ndarray, _: Table, __: str, lot: Lots, rng: np.random.Generator) -> np.ndarray:
    return values * (1.0 + rng.choice([-1.0, 1.0]) * lot.size(0.02, 0.4) * much)


def zero(values: np.ndarray, much: np.ndarray, t: Table, name: str, lot: Lots, rng: np.random.Generator) -> np.ndarray:
    most = lot.size(0.05, 0.8) if name == "effort" else lot.size(2e-3, 0.05)
    return values + rng.choice([-1.0, 1.0]) * most * size(t, name) * much


def delayed(values: np.ndarray, much: np.ndarray, table: Table, _: str, lot: Lots, __: object) -> np.ndarray:
    rows, late = np.arange(len(values)), max(lot.size(0.2, 3.0) * corner(table) / period(table), 2.0)
    return values[np.maximum(rows - np.rint(late * much).astype(int), 0)]


def noise(values: np.ndarray, much: np.ndarray, t: Table, name: str, lot: Lots, rng: np.random.Generator) -> np.ndarray:
    most = lot.size(0.05, 1.0) if name == "effort" else lot.size(2e-4, 5e-3)
    return values + most * size(t, name) * much * rng.standard_normal(len(values))


def filtered(values: np.ndarray, much: np.ndarray, table: Table, _: str, lot: Lots, __: object) -> np.ndarray:
    slow = low_passed(values, lot.size(0.25, 2.0) * corner(table), period(table))
    return values + much * (slow - values)


def held(values: np.ndarray, much: np.ndarray, _: Table, __: str, lot: Lots, rng: np.random.Generator) -> np.ndarray:
    rows = lot.count(2, 20)
    places = np.arange(len(values))
    return values[np.where(rng.random(len(values) // rows + 1)[places // rows] < much, places // rows * rows, places)]


def stepped(values: np.ndarray, much: np.ndarray, t: Table, name: str, lot: Lots, _: object) -> np.ndarray:
    step = size(t, name) / (lot.size(1.0, 10.0) if name == "effort" else lot.size(100.0, 2000.0))
    return values + much * (step * np.round(values / step) - values)


WHAT: dict[str, What] = {
    "another gain": gain,
    "another zero": zero,
    "late": delayed,
    "noisy": noise,
    "behind a filter": filtered,
    "held": held,
    "in steps": stepped,
}
"""What happens to a signal."""


def spoilt(name: str, what: What, where: Where) -> Callable[[Table, np.random.Generator], Table]:
    def spoil(table: Table, rng: np.random.Generator) -> Table:
        lot = Lots(rng)
        return with_(table, **{name: what(table[name], where(table, lot, rng), table, name, lot, rng)})

    return spoil


def missing(where: Where) -> Callable[[Table, np.random.Generator], Table]:
    """Rows lost without trace."""

    def spoil(table: Table, rng: np.random.Generator) -> Table:
        lot, count = Lots(rng), len(table["time"])
        gone = rng.random(count) < lot.size(0.02, 0.5) * where(table, lot, rng)
        return renumbered(table, np.flatnonzero(~gone))

    return spoil


def hurried(where: Where) -> Callable[[Table, np.random.Generator], Table]:
    """A clock that is too fast or too slow."""

    def spoil(table: Table, rng: np.random.Generator) -> Table:
        lot = Lots(rng)
        pace = 1.0 + rng.choice([-1.0, 1.0]) * lot.size(0.01, 0.3) * where(table, lot, rng)
        return with_(table, time=table["time"][0] + np.cumsum(pace * np.diff(table["time"], prepend=table["time"][0])))

    return spoil


OF_THE_MODEL = ("with the speed", "where it is slow", "one way")
"""Courses of a zero of the effort that friction of another axis, its directions apart, makes exactly."""

_ALL = [
    *(
        Fault(
            f"{name} {what}, {where} (drawn)",
            spoilt(name, WHAT[what], WHERE[where]),
            is_another=(name, what) == ("effort", "another zero") and where in OF_THE_MODEL,
        )
        for name, what, where in product(("effort", "position"), WHAT, WHERE)
    ),
    *(Fault(f"rows lost, {where} (drawn)", missing(WHERE[where])) for where in WHERE),
    *(Fault(f"a clock too fast or slow, {where} (drawn)", hurried(WHERE[where])) for where in WHERE),
]
_LOTS = np.random.default_rng(20261128).permutation(len(_ALL)).tolist()
_LATER = tuple(_ALL[k] for k in sorted(_LOTS[80:]))
_BY_SPEED = tuple(
    f for f in _LATER if f.name.startswith("effort another gain, w") and ("speed" in f.name or "slow" in f.name)
)
SEEN = (*(_ALL[k] for k in sorted(_LOTS[:80])), *_BY_SPEED)
UNSEEN = tuple(fault for fault in _LATER if fault not in _BY_SPEED)
"""Eighty kinds that rules were chosen with when they had been judged once, and eighty that they were not.

Of the latter all but those of which a rule came when they had been counted, of a gain that changes with the speed.
"""
