"""Faults that no rule was chosen with: written down, judged once, and then left alone.

Each spoils the columns of a clean log as those of `faults` do, and makes of it a log that no axis makes.
"""

from collections.abc import Callable

import numpy as np

from tests.trust.faults import (
    Fault,
    Spoil,
    Table,
    corner,
    even,
    mapped,
    moving,
    period,
    renumbered,
    size,
    smooth,
    with_,
)
from tests.trust.harder_faults import second_order
from tests.trust.more_faults import course, velocity


def dropouts(name: str, share: float, *, to_zero: bool) -> Spoil:
    """Single rows without a value: 0 stands there, or what stood before."""

    def spoil(table: Table, rng: np.random.Generator) -> Table:
        gone, values = rng.random(len(table["time"])) < share, table[name]
        gone[0] = False
        return with_(table, **{name: np.where(gone, 0.0 if to_zero else np.roll(values, 1), values)})

    return spoil


def warming_up(table: Table, _: np.random.Generator) -> Table:
    """A sensor of the effort that is half its size off at first."""
    return with_(table, effort=table["effort"] + 0.5 * size(table, "effort") * np.exp(-6.0 * course(table)))


def bursts(name: str, share: float, count: int, rows: int) -> Spoil:
    """Stretches with noise."""

    def spoil(table: Table, rng: np.random.Generator) -> Table:
        values = table[name].copy()
        for at in rng.choice(moving(table)[:-rows], count, replace=False).tolist():
            values[at : at + rows] += share * size(table, name) * rng.standard_normal(len(values[at : at + rows]))
        return with_(table, **{name: values})

    return spoil


def pauses_lost(table: Table, rng: np.random.Generator) -> Table:
    """Three pauses of the recorder, of a tenth to three tenths of a second, without trace."""
    keep = np.ones(len(table["time"]), dtype=bool)
    for at in rng.choice(moving(table), 3, replace=False).tolist():
        keep[at : at + max(round(rng.uniform(0.1, 0.3) / period(table)), 1)] = False
    return renumbered(table, np.flatnonzero(keep))


def noisy_fifth(table: Table, rng: np.random.Generator) -> Table:
    noise = size(table, "effort") * rng.standard_normal(len(table["time"]))
    return with_(table, effort=table["effort"] + noise * (np.abs(course(table) - 0.4) < 0.1))


def obstacles(table: Table, rng: np.random.Generator) -> Table:
    """Two obstacles that take three times the size of the effort for 50 rows."""
    values = table["effort"].copy()
    for at in rng.choice(moving(table), 2, replace=False).tolist():
        values[at : at + 50] += 3.0 * size(table, "effort") * np.sign(velocity(table)[at])
    return with_(table, effort=values)


def overflown(values: np.ndarray) -> np.ndarray:
    """Numbers that start anew beyond 60 % of the largest, as those of too few bits do."""
    most = 0.6 * float(np.abs(values).max())
    return np.mod(values + most, 2.0 * most) - most


def means_of(**rows: int) -> Spoil:
    """Signals as centred means over different numbers of rows."""
    return lambda table, _: with_(table, **{name: smooth(table[name], count) for name, count in rows.items()})


def thinned_tenth(table: Table, _: np.random.Generator) -> Table:
    """A tenth of the log in which every other row is lost without trace."""
    inside = np.abs(course(table) - 0.6) < 0.05
    return renumbered(table, np.flatnonzero(~inside | (np.arange(len(inside)) % 2 == 0)))


def block_twice(table: Table, rng: np.random.Generator) -> Table:
    at, rows = int(rng.choice(moving(table)[:-100])), np.arange(len(table["time"]))
    return renumbered(even(table), np.r_[rows[: at + 100], rows[at:]])


def two_gains(values: np.ndarray) -> np.ndarray:
    return np.where(values < 0.0, 0.85 * values - 0.1 * np.std(values), values)


def lighter(table: Table, _: np.random.Generator) -> Table:
    """A load that is taken off in the last third: less of what accelerates it, by 40 % of a mass that fits."""
    rows = 2 * max(round(0.02 / period(table)), 2) + 1
    v = np.gradient(smooth(table["position"], rows), period(table))
    a = smooth(np.gradient(v, period(table)), rows)
    mass = float(np.linalg.lstsq(np.column_stack([a, v, np.sign(v)]), table["effort"], rcond=None)[0][0])
    return with_(table, effort=table["effort"] - 0.4 * mass * a * (course(table) > 2 / 3))


def dragging(table: Table, _: np.random.Generator) -> Table:
    """A brake that drags in the last quarter."""
    way = np.tanh(20.0 * velocity(table) / np.abs(velocity(table)).max())
    return with_(table, effort=table["effort"] + 0.5 * size(table, "effort") * way * (course(table) > 0.75))


def gear_changed(table: Table, _: np.random.Generator) -> Table:
    """A position whose scale is a tenth smaller in the middle third."""
    ways = np.diff(table["position"], prepend=table["position"][0])
    scale = np.where(np.abs(course(table) - 0.5) < 1 / 6, 0.9, 1.0)
    return with_(table, position=table["position"][0] + np.cumsum(scale * ways))


def signed_by_motion(table: Table, _: np.random.Generator) -> Table:
    """The size of the effort, with the sign of the velocity."""
    return with_(table, effort=np.abs(table["effort"]) * np.sign(velocity(table)))


def exchanged(table: Table, _: np.random.Generator) -> Table:
    """Pairs of rows whose effort changed places."""
    rows = np.arange(len(table["time"]) // 2 * 2).reshape(-1, 2)[:, ::-1].ravel()
    return with_(table, effort=np.r_[table["effort"][rows], table["effort"][len(rows) :]])


def shifted_reference(table: Table, _: np.random.Generator) -> Table:
    rows = np.maximum(np.arange(len(table["time"])) - round(3 * corner(table) / period(table)), 0)
    return with_(table, reference=table["reference"][rows])


def rounded_stamps(step: float) -> Callable[[Table, np.random.Generator], Table]:
    """Stamps in steps of a part of the rows that is none of them."""
    return lambda table, _: with_(table, time=np.round(table["time"] / (step * period(table))) * step * period(table))


UNSEEN = (
    Fault("effort 0 in one row of 100", dropouts("effort", 0.01, to_zero=True)),
    Fault("position kept for one row more in one of 20", dropouts("position", 0.05, to_zero=False)),
    Fault("a sensor of the effort that warms up", warming_up),
    Fault("3 bursts of noise in the position, 1 %", bursts("position", 0.01, 3, 10)),
    Fault("3 pauses lost without trace", pauses_lost),
    Fault("effort noisy in a fifth of the log", noisy_fifth),
    Fault("two obstacles", obstacles),
    Fault("effort that overflows at 60 %", mapped("effort", overflown)),
    Fault("means over 3 rows of the position, 9 of the effort", means_of(position=3, effort=9)),
    Fault("every other row lost in a tenth of the log", thinned_tenth),
    Fault("100 rows written twice", block_twice),
    Fault("effort with another gain and another zero one way", mapped("effort", two_gains)),
    Fault("a load taken off in the last third", lighter),
    Fault("a brake that drags in the last quarter", dragging),
    Fault("a scale a tenth smaller in the middle third", gear_changed),
    Fault("the size of the effort, with the sign of the velocity", signed_by_motion),
    Fault("efforts of neighbouring rows exchanged", exchanged),
    Fault("the reference later than it was", shifted_reference, "reference"),
    Fault("position behind a slow filter of second order", second_order("position", 0.8, 0.5)),
    Fault("stamps in steps of 0.7 periods", rounded_stamps(0.7)),
)
"""Kinds that were written down before any was judged."""
