"""More faults of recordings, the last that rules were chosen with; each was judged once before.

They are of stretches of a log and of amplifiers, and make of it a log that no axis makes.
"""

import numpy as np

from tests.trust.faults import (
    Fault,
    Spoil,
    Table,
    corner,
    even,
    low_passed,
    mapped,
    moving,
    period,
    renumbered,
    size,
    with_,
)
from tests.trust.more_faults import course, velocity


def turned_stretch(name: str) -> Spoil:
    """A stretch, a tenth of the log, in which a signal has the other sign."""
    inside = 0.05
    return lambda table, _: with_(
        table, **{name: np.where(np.abs(course(table) - 0.6) < inside, -table[name], table[name])}
    )


def bridged(name: str) -> Spoil:
    """A tenth of the log in which a signal is a straight line."""

    def spoil(table: Table, _: np.random.Generator) -> Table:
        inside = np.abs(course(table) - 0.3) < 0.05
        rows = np.arange(len(inside))
        return with_(table, **{name: np.interp(rows, rows[~inside], table[name][~inside])})

    return spoil


def brown_outs(table: Table, rng: np.random.Generator) -> Table:
    """An amplifier that gives half for a twentieth of the log, three times."""
    values, n = table["effort"].copy(), len(table["time"])
    for at in rng.integers(0, 19 * n // 20, 3).tolist():
        values[at : at + n // 20] *= 0.5
    return with_(table, effort=values)


def mixed_rows(table: Table, rng: np.random.Generator) -> Table:
    """Rows, one in 50, from anywhere else in the run."""
    rows = np.arange(len(table["time"]))
    other = rng.random(len(rows)) < 0.02
    rows[other] = rng.integers(0, len(rows), int(other.sum()))
    return renumbered(table, rows)


def ever_later(table: Table, _: np.random.Generator) -> Table:
    """An effort that comes ever later, by a fifth of a move at the end."""
    late = np.round(course(table) * max(2.0 * corner(table) / period(table), 10.0)).astype(int)
    return with_(table, effort=table["effort"][np.maximum(np.arange(len(late)) - late, 0)])


def in_bursts(table: Table, _: np.random.Generator) -> Table:
    """A position that is updated in each row for 15 rows, and then in none for 15."""
    rows = np.arange(len(table["time"]))
    return with_(table, position=table["position"][np.where(rows % 30 < 15, rows, rows // 30 * 30 + 14)])


def other_unit_first(table: Table, _: np.random.Generator) -> Table:
    """A position whose first tenth is in inches for centimetres."""
    ways = np.diff(table["position"], prepend=table["position"][0])
    return with_(table, position=table["position"][0] + np.cumsum(np.where(course(table) < 0.1, ways / 2.54, ways)))


def noisy_at_speed(table: Table, rng: np.random.Generator) -> Table:
    """A position with noise that grows with the speed, to 0.2 % of the range."""
    v = np.abs(velocity(table))
    noise = 0.002 * size(table, "position") * rng.standard_normal(len(v)) * v / v.max()
    return with_(table, position=table["position"] + noise)


def filtered_later(table: Table, _: np.random.Generator) -> Table:
    """A filter of the effort that was switched on in the middle of the log."""
    slow = low_passed(table["effort"], corner(table), period(table))
    return with_(table, effort=np.where(course(table) > 0.5, slow, table["effort"]))


def ways_overflown(table: Table, _: np.random.Generator) -> Table:
    """A counter that is read too seldom: ways beyond four fifths of the largest go the other way round."""
    ways = np.diff(table["position"], prepend=table["position"][0])
    most = 0.8 * float(np.abs(ways).max())
    return with_(table, position=table["position"][0] + np.cumsum(np.mod(ways + most, 2.0 * most) - most))


def block_again(table: Table, rng: np.random.Generator) -> Table:
    """A twentieth of the log that was written twice, the time counted on."""
    n = len(table["time"])
    at, rows = int(rng.integers(n // 4, n // 2)), np.arange(n)
    return renumbered(even(table), np.r_[rows[: at + n // 20], rows[at:]])


def soft(values: np.ndarray) -> np.ndarray:
    """An amplifier that gives way: a third less at its largest."""
    most = float(np.abs(values).max())
    return most * np.tanh(values / most)


def alternate(table: Table, _: np.random.Generator) -> Table:
    """Rows in turn whose effort is a tenth larger and a tenth smaller: two channels of a converter."""
    turn = np.where(np.arange(len(table["time"])) % 2, 1.1, 0.9)
    return with_(table, effort=table["effort"] * turn)


def held_by_zero(table: Table, rng: np.random.Generator) -> Table:
    """Messages that were lost: all columns but the time keep their values, for one to nine rows, 40 times."""
    rows = np.arange(len(table["time"]))
    for at in rng.choice(moving(table)[:-10], 40, replace=False).tolist():
        rows[at : at + int(rng.integers(2, 11))] = at
    return {k: v if k == "time" else v[rows] for k, v in table.items()}


LATEST = (
    Fault("position with the other sign in a tenth of the log", turned_stretch("position")),
    Fault("effort with the other sign in a tenth of the log", turned_stretch("effort")),
    Fault("effort a straight line in a tenth of the log", bridged("effort")),
    Fault("position a straight line in a tenth of the log", bridged("position")),
    Fault("half of the effort for a while, 3 times", brown_outs),
    Fault("one row in 50 from anywhere else in the run", mixed_rows),
    Fault("effort ever later", ever_later),
    Fault("position in bursts of 15 rows", in_bursts),
    Fault("position in another unit in the first tenth", other_unit_first),
    Fault("position with noise that grows with the speed", noisy_at_speed),
    Fault("a filter of the effort from the middle on", filtered_later),
    Fault("ways of the position that overflow at 80 %", ways_overflown),
    Fault("a twentieth of the log written twice", block_again),
    Fault("an amplifier that gives way", mapped("effort", soft)),
    Fault("effort a tenth more and less in turn", alternate),
    Fault("messages lost, all signals kept, 40 times", held_by_zero),
)
