"""Harder faults, which were written down and judged before any was looked at.

Of the first 25 kinds 8.6 % of the logs were accepted and wrong when they were first judged, of the 20 behind them
2.9 %. Three of them make logs of other axes, which may exist: an effort that lacks what is added for friction, one that
is what a mass would need, and one that stands three rows early, which is a delay.

Each spoils the columns of a clean log as those of `faults` do.
"""

import numpy as np
from scipy.signal import lfilter

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
from tests.trust.more_faults import course, velocity


def two_sensors(table: Table, _: np.random.Generator) -> Table:
    """Rows in turn from two sensors whose zeros are 0.1 % of the range apart."""
    odd = np.arange(len(table["time"])) % 2
    return with_(table, position=table["position"] + 0.001 * size(table, "position") * odd)


def early(rows: int) -> Spoil:
    """An effort that stands some rows too early."""
    return lambda table, _: with_(table, effort=np.r_[table["effort"][rows:], np.full(rows, table["effort"][-1])])


def reversed_blocks(table: Table, rng: np.random.Generator) -> Table:
    """Five blocks of 30 rows that a ring buffer gave back to front."""
    rows = np.arange(len(table["time"]))
    for at in rng.choice(moving(table)[:-30], 5, replace=False).tolist():
        rows[at : at + 30] = rows[at : at + 30][::-1]
    return renumbered(table, rows)


def other_unit(table: Table, _: np.random.Generator) -> Table:
    """An effort whose last third is in another unit: pounds of force for newtons."""
    return with_(table, effort=np.where(course(table) > 2 / 3, table["effort"] / 4.448, table["effort"]))


def turns_lost(table: Table, rng: np.random.Generator) -> Table:
    """A sensor that loses its index twice: a fifth of its range at once."""
    values = table["position"].copy()
    for at in rng.choice(moving(table), 2, replace=False).tolist():
        values[at:] += 0.2 * size(table, "position") * rng.choice([-1.0, 1.0])
    return with_(table, position=values)


def decimal_point(name: str) -> Spoil:
    """Ten values in which the decimal point is one place to the right."""

    def spoil(table: Table, rng: np.random.Generator) -> Table:
        values = table[name].copy()
        values[rng.choice(moving(table), 10, replace=False)] *= 10.0
        return with_(table, **{name: values})

    return spoil


def rippled(table: Table, _: np.random.Generator) -> Table:
    """An amplifier whose gain goes up and down by 15 %, twelve times along the log."""
    return with_(table, effort=table["effort"] * (1.0 + 0.15 * np.sin(24 * np.pi * course(table))))


def second_order(name: str, damping: float, factor: float) -> Spoil:
    """A signal behind a filter of second order."""

    def spoil(table: Table, _: np.random.Generator) -> Table:
        w = min(period(table) / (factor * corner(table)), 0.5)
        b, a = [w * w], [1.0 + 2 * damping * w + w * w, -2.0 - 2 * damping * w, 1.0]
        start = table[name][0]
        return with_(table, **{name: start + lfilter(b, a, table[name] - start)})

    return spoil


def by_hand(table: Table, _: np.random.Generator) -> Table:
    """A tenth of the log in which the drive is off and somebody moves the axis."""
    return with_(table, effort=np.where(np.abs(course(table) - 0.5) < 0.05, 0.0, table["effort"]))


def compensated(table: Table, _: np.random.Generator) -> Table:
    """A command to which a share for friction has been added after it was recorded: it is missing."""
    share = 0.2 * size(table, "effort")
    return with_(table, effort=table["effort"] - share * np.sign(table["effort"]))


def hysteresis(table: Table, _: np.random.Generator) -> Table:
    """An effort that stays behind by a tenth of its size, as iron does."""
    half, place = 0.1 * size(table, "effort"), float(table["effort"][0])
    found = np.empty(len(table["effort"]))
    for k, value in enumerate(table["effort"].tolist()):
        place = min(max(place, value - half), value + half)
        found[k] = place
    return with_(table, effort=found)


def breathing(table: Table, _: np.random.Generator) -> Table:
    """A sensor whose scale goes up and down by 2 % along the log."""
    ways = np.diff(table["position"], prepend=table["position"][0])
    return with_(
        table, position=table["position"][0] + np.cumsum(ways * (1.0 + 0.02 * np.sin(6 * np.pi * course(table))))
    )


def truncated(table: Table, _: np.random.Generator) -> Table:
    """An effort cut to 40 levels, towards 0."""
    step = float(np.ptp(table["effort"])) / 40
    return with_(table, effort=step * np.trunc(table["effort"] / step))


def coarse_stamps(table: Table, _: np.random.Generator) -> Table:
    grid = 20.0 * period(table)
    return with_(table, time=np.round(table["time"] / grid) * grid)


def two_runs(table: Table, _: np.random.Generator) -> Table:
    """Every tenth row from another part of the run."""
    rows = np.arange(len(table["time"]))
    rows[::10] = np.roll(rows, len(rows) // 3)[::10]
    return renumbered(table, rows)


def resampled(table: Table, _: np.random.Generator) -> Table:
    """Rows by straight lines between those of another rate."""
    t = table["time"]
    coarse = np.arange(t[0], t[-1], 1.37 * period(table))
    return table | {k: np.interp(t, coarse, np.interp(coarse, t, v)) for k, v in table.items() if k != "time"}


def slow_sensor(table: Table, _: np.random.Generator) -> Table:
    """A sensor that follows by at most seven tenths of the top speed, and catches up."""
    ways = np.abs(np.diff(table["position"]))
    most, place = 0.7 * float(np.quantile(ways, 0.98)), float(table["position"][0])
    found = np.empty(len(table["position"]))
    for k, value in enumerate(table["position"].tolist()):
        place += min(max(value - place, -most), most)
        found[k] = place
    return with_(table, position=found)


def late_half(table: Table, _: np.random.Generator) -> Table:
    """An effort whose second half was pasted 30 rows late."""
    n = len(table["time"])
    rows = np.arange(n)
    rows[n // 2 :] -= 30
    return with_(table, effort=table["effort"][rows])


def stuck_bit(table: Table, _: np.random.Generator) -> Table:
    """A sensor one of whose bits is stuck: a five hundredth of the range is missing here and there."""
    bit = size(table, "position") / 500.0
    k = np.floor(table["position"] / bit)
    return with_(table, position=table["position"] - bit * np.mod(k, 2.0))


def noisy_later(table: Table, rng: np.random.Generator) -> Table:
    """A position that gets noisy in its second half, by 0.3 % of its range."""
    noise = 0.003 * size(table, "position") * rng.standard_normal(len(table["time"]))
    return with_(table, position=table["position"] + noise * (course(table) > 0.5))


def gone_for_good(table: Table, _: np.random.Generator) -> Table:
    """An effort that is 0 from two thirds of the log on: its cable came off."""
    return with_(table, effort=np.where(course(table) > 2 / 3, 0.0, table["effort"]))


def of_the_command(table: Table, _: np.random.Generator) -> Table:
    """What a mass would need for the reference in the place of the effort."""
    needed = np.gradient(np.gradient(table["reference"]))
    return with_(table, effort=needed * size(table, "effort") / max(float(np.std(needed)), 1e-300))


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


def rounded_stamps(step: float) -> Spoil:
    """Stamps in steps of a part of the rows that is none of them."""
    return lambda table, _: with_(table, time=np.round(table["time"] / (step * period(table))) * step * period(table))


HARDER = (
    Fault("rows in turn from two sensors, 0.1 % apart", two_sensors),
    Fault("effort 3 rows early", early(3), is_another=True),
    Fault("5 blocks of 30 rows back to front", reversed_blocks),
    Fault("effort in another unit in the last third", other_unit),
    Fault("an index lost twice, a fifth of the range", turns_lost),
    Fault("10 values of the effort ten times as large", decimal_point("effort")),
    Fault("10 values of the position ten times as large", decimal_point("position")),
    Fault("effort without its negative values", mapped("effort", lambda v: np.maximum(v, 0.0))),
    Fault("an amplifier whose gain goes up and down by 15 %", rippled),
    Fault("position behind a coupling that swings", second_order("position", 0.05, 0.3)),
    Fault("effort behind a filter of second order", second_order("effort", 0.7, 0.5)),
    Fault("a tenth of the log moved by hand", by_hand),
    Fault("effort without what is added for friction", compensated, is_another=True),
    Fault("effort with hysteresis, a tenth of its size", hysteresis),
    Fault("position whose scale goes up and down by 2 %", breathing),
    Fault("effort cut to 40 levels", truncated),
    Fault("stamps in steps of 20 periods", coarse_stamps),
    Fault("every tenth row from another part of the run", two_runs),
    Fault("rows by straight lines from another rate", resampled),
    Fault("a sensor that follows at seven tenths of the top speed", slow_sensor),
    Fault("effort 30 rows late in the second half", late_half),
    Fault("a sensor one of whose bits is stuck", stuck_bit),
    Fault("position noisy in the second half, 0.3 %", noisy_later),
    Fault("effort 0 in the last third", gone_for_good),
    Fault("what the reference would need in the place of the effort", of_the_command, "reference", is_another=True),
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
"""All of them."""
