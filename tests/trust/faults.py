"""Faults of recordings, as they come from the wild: each takes the columns of a clean log and spoils them.

A table has the columns ``time``, ``reference``, ``position`` and ``effort``, of which a recording may lack the
reference. Sizes are shares of what the log itself shows: the range of its position, the rms of its effort, its period.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

Table = dict[str, np.ndarray]
Spoil = Callable[[Table, np.random.Generator], Table]


@dataclass(frozen=True)
class Fault:
    """A kind of fault.

    Attributes
    ----------
    name : str
        What is wrong, for people.
    spoil : callable
        Makes a spoilt table of a clean one.
    needs : str
        Column that a log must have; empty for one that all have.
    is_another : bool
        True where what comes of it is the log of another axis, which no log can show.
    """

    name: str
    spoil: Spoil
    needs: str = ""
    is_another: bool = False


def period(table: Table) -> float:
    return float(np.median(np.diff(table["time"])))


def size(table: Table, name: str) -> float:
    """What a fault of a column is large or small against."""
    return float(np.std(table[name])) if name == "effort" else float(np.ptp(table[name]))


def with_(table: Table, **columns: np.ndarray) -> Table:
    return table | columns


def renumbered(table: Table, rows: np.ndarray) -> Table:
    """Some rows, with the time of an even clock: nothing in it shows that others are missing."""
    return {k: v[: len(rows)] if k == "time" else v[rows] for k, v in table.items()}


def even(table: Table) -> Table:
    """The same with enough rows of an even time for `renumbered` rows that are more than there were."""
    return table | {"time": table["time"][0] + np.arange(2 * len(table["time"])) * period(table)}


def moving(table: Table) -> np.ndarray:
    """Samples in which the axis moves faster than a tenth of its top speed."""
    speed = np.abs(np.gradient(smooth(table["position"], 9)))
    return np.flatnonzero(speed > 0.1 * speed.max())


def smooth(values: np.ndarray, rows: int) -> np.ndarray:
    padded = np.pad(values, rows // 2, mode="edge")
    return np.convolve(padded, np.ones(rows) / rows, mode="valid")[: len(values)]


def low_passed(values: np.ndarray, seconds: float, step: float) -> np.ndarray:
    """First-order filter of a time constant, as an amplifier or a driver has it."""
    keep = np.exp(-step / seconds)
    found, _ = lfilter([1.0 - keep], [1.0, -keep], values, zi=[keep * values[0]])
    return found


def corner(table: Table) -> float:
    """Time constant below the motion: a tenth of the time in which the axis covers its range at its top speed."""
    top = float(np.quantile(np.abs(np.gradient(smooth(table["position"], 9), period(table))), 0.98))
    return 0.1 * size(table, "position") / top


def spikes(name: str, count: int, share: float) -> Spoil:
    """Single samples that are off by a share."""

    def spoil(table: Table, rng: np.random.Generator) -> Table:
        values = table[name].copy()
        at = rng.choice(moving(table)[5:-5], count, replace=False)
        values[at] += share * size(table, name) * rng.choice([-1.0, 1.0], count) * rng.uniform(0.7, 1.3, count)
        return with_(table, **{name: values})

    return spoil


def steps(name: str, share: float, count: int = 1, *, back: bool = False) -> Spoil:
    """The signal jumps by a share, for good or for a part of the log."""

    def spoil(table: Table, rng: np.random.Generator) -> Table:
        values = table[name].copy()
        for at in rng.choice(moving(table), count, replace=False).tolist():
            end = at + len(values) // 10 if back else len(values)
            values[at:end] += share * size(table, name) * rng.choice([-1.0, 1.0])
        return with_(table, **{name: values})

    return spoil


def levels(name: str, count: int) -> Spoil:
    """Values in so many steps over their range."""

    def spoil(table: Table, _: np.random.Generator) -> Table:
        step = float(np.ptp(table[name])) / count
        return with_(table, **{name: step * np.round(table[name] / step)})

    return spoil


def digits(name: str, count: int) -> Spoil:
    """Values to so many significant digits, as a spreadsheet shows them."""
    return lambda table, _: with_(table, **{name: np.array([float(f"{v:.{count}g}") for v in table[name].tolist()])})


def filtered(*names: str, factor: float = 1.0) -> Spoil:
    """Signals behind a filter that is slower than the motion."""
    return lambda table, _: with_(
        table, **{name: low_passed(table[name], factor * corner(table), period(table)) for name in names}
    )


def averaged(*names: str) -> Spoil:
    """Signals as means over some of the last rows."""

    def spoil(table: Table, _: np.random.Generator) -> Table:
        rows = max(2 * round(corner(table) / period(table)), 3)
        return with_(table, **{name: lfilter(np.ones(rows) / rows, [1.0], table[name]) for name in names})

    return spoil


def drift(offset: float = 0.0, gain: float = 0.0, *, step: bool = False) -> Spoil:
    """An effort whose offset, in shares of its size, or gain changes along the log."""

    def spoil(table: Table, rng: np.random.Generator) -> Table:
        t, sign = np.linspace(0.0, 1.0, len(table["time"])), rng.choice([-1.0, 1.0])
        course = (t > rng.uniform(0.3, 0.7)).astype(float) if step else t
        effort = table["effort"] * (1.0 + gain * sign * course) + offset * sign * size(table, "effort") * course
        return with_(table, effort=effort)

    return spoil


def late(name: str, share: float) -> Spoil:
    """A signal that was recorded later than the others, by a share of the time that a move takes."""

    def spoil(table: Table, _: np.random.Generator) -> Table:
        rows = max(round(share * 10.0 * corner(table) / period(table)), 2)
        return with_(table, **{name: np.r_[np.full(rows, table[name][0]), table[name][:-rows]]})

    return spoil


def held(name: str, rows: int) -> Spoil:
    """A signal that is updated in every so many rows only."""
    return lambda table, _: with_(table, **{name: table[name][np.arange(len(table[name])) // rows * rows]})


def jitter(share: float) -> Spoil:
    """Stamps that are off by a share of a period, of samples that were taken evenly."""

    def spoil(table: Table, rng: np.random.Generator) -> Table:
        off = rng.uniform(-share, share, len(table["time"])) * period(table)
        return with_(table, time=table["time"] + off)

    return spoil


def rounded_time(rows: float) -> Spoil:
    """Stamps in steps of some periods."""

    def spoil(table: Table, _: np.random.Generator) -> Table:
        grid = rows * period(table)
        return with_(table, time=np.floor(table["time"] / grid) * grid)

    return spoil


def warped(share: float) -> Spoil:
    """A clock that gets faster by a share until the end."""

    def spoil(table: Table, _: np.random.Generator) -> Table:
        t = table["time"] - table["time"][0]
        return with_(table, time=t * (1.0 + 0.5 * share * t / t[-1]))

    return spoil


def lost(share: float = 0.0, seconds: float = 0.0, *, traced: bool = False) -> Spoil:
    """Rows that are missing, singly or in one piece, which the time shows or not."""

    def spoil(table: Table, rng: np.random.Generator) -> Table:
        keep = rng.random(len(table["time"])) >= share
        if seconds:
            at = int(rng.choice(moving(table)))
            keep[at : at + round(seconds / period(table))] = False
        rows = np.flatnonzero(keep)
        return {k: v[rows] for k, v in table.items()} if traced else renumbered(table, rows)

    return spoil


def twice(share: float) -> Spoil:
    """Rows that were written twice, the time counted on."""

    def spoil(table: Table, rng: np.random.Generator) -> Table:
        again = 1 + (rng.random(len(table["time"])) < share)
        return renumbered(even(table), np.repeat(np.arange(len(table["time"])), again))

    return spoil


def zeros(name: str, count: int, rows: int) -> Spoil:
    """A signal that drops to 0 for some rows."""
    return holes(name, count, rows, 0.0)


def holes(name: str, count: int, rows: int, value: float = np.nan, *, first: bool = False) -> Spoil:
    """Stretches of a signal with another value, by default none; or its first rows."""

    def spoil(table: Table, rng: np.random.Generator) -> Table:
        values = table[name].copy()
        for at in [0] if first else rng.choice(moving(table), count, replace=False).tolist():
            values[at : at + rows] = value
        return with_(table, **{name: values})

    return spoil


def slip(share: float, count: int) -> Spoil:
    """A coupling that slips when the effort is large: what the sensor sees falls back by a share in 30 rows."""

    def spoil(table: Table, rng: np.random.Generator) -> Table:
        hard = np.flatnonzero(np.abs(table["effort"]) > np.quantile(np.abs(table["effort"]), 0.9))
        off = np.zeros(len(table["time"]))
        for at in rng.choice(hard, count, replace=False).tolist():
            way = -np.sign(table["effort"][at]) * share * size(table, "position")
            off[at:] += way * np.minimum(np.arange(len(off) - at) / 30.0, 1.0)
        return with_(table, position=table["position"] + off)

    return spoil


def play(share: float) -> Spoil:
    """Backlash between axis and sensor."""

    def spoil(table: Table, _: np.random.Generator) -> Table:
        half, place = 0.5 * share * size(table, "position"), float(table["position"][0])
        found = np.empty(len(table["position"]))
        for k, q in enumerate(table["position"].tolist()):
            place = min(max(place, q - half), q + half)
            found[k] = place
        return with_(table, position=found)

    return spoil


def wavy(share: float) -> Spoil:
    """A sensor with an error of a share of the range, twelve times over the range."""

    def spoil(table: Table, _: np.random.Generator) -> Table:
        q, way = table["position"], size(table, "position")
        return with_(table, position=q + share * way * np.sin(12 * 2 * np.pi * q / way))

    return spoil


def other_half(factor: float, *, both: bool = True) -> Spoil:
    """A second half of an axis that is larger by a factor, in its effort and, for both, in its way."""

    def spoil(table: Table, _: np.random.Generator) -> Table:
        n = len(table["time"])
        second = np.arange(n) >= n // 2
        names = ["effort", *(["position", "reference"] if both else [])]
        grown = {k: np.where(second, table[k] * (factor if k == "effort" else 1 / factor), table[k]) for k in names
                 if k in table}  # fmt: skip
        return table | grown

    return spoil


def load_added(share: float) -> Spoil:
    """A load that is put on in the middle of the log: more inertia, by a share of the effort that accelerates."""

    def spoil(table: Table, _: np.random.Generator) -> Table:
        step, n = period(table), len(table["time"])
        rows = 2 * max(round(0.02 / step), 2) + 1
        a = smooth(np.gradient(np.gradient(smooth(table["position"], rows), step), step), rows)
        weights = np.column_stack([a, np.gradient(smooth(table["position"], rows), step), np.sign(a), np.ones(n)])
        mass = float(np.linalg.lstsq(weights, table["effort"], rcond=None)[0][0])
        return with_(table, effort=table["effort"] + np.where(np.arange(n) > n // 2, share * mass * a, 0.0))

    return spoil


def copied(name: str, source: str, *, counts: bool = False) -> Spoil:
    """A column that is another one, or that one as an encoder would count it."""

    def spoil(table: Table, _: np.random.Generator) -> Table:
        values = table.get(source, table["position"])
        ways = np.abs(np.diff(table["position"]))
        count = float(np.min(ways[ways > 1e-12], initial=np.ptp(values)))
        return with_(table, **{name: count * np.round(values / count) if counts else values})

    return spoil


def foreign_velocity(table: Table, rng: np.random.Generator) -> Table:
    """A velocity column of another motion."""
    v = np.gradient(smooth(table["position"], 9), period(table))
    return with_(table, velocity=np.roll(v[::-1], int(rng.integers(len(v) // 4, len(v) // 2))))


def scaled_velocity(table: Table, _: np.random.Generator) -> Table:
    return with_(table, velocity=1.7 * np.gradient(smooth(table["position"], 9), period(table)))


def foreign(name: str) -> Spoil:
    """A signal of another part of the run."""
    return lambda table, _: with_(table, **{name: np.roll(table[name], len(table[name]) // 3)})


def mapped(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Spoil:
    """A signal changed sample by sample."""
    return lambda table, _: with_(table, **{name: change(table[name])})


def half_turned(table: Table, _: np.random.Generator) -> Table:
    half = np.arange(len(table["time"])) < len(table["time"]) // 2
    return with_(table, effort=np.where(half, table["effort"], -table["effort"]))


def wrapped(table: Table, _: np.random.Generator) -> Table:
    """A position that starts anew after two thirds of its range, which is no power of two."""
    q, way = table["position"], 0.667 * size(table, "position")
    return with_(table, position=q.min() + np.mod(q - q.min(), way))


def clipped(name: str, share: float) -> Spoil:
    def clip(values: np.ndarray) -> np.ndarray:
        most = share * float(np.abs(values - np.median(values)).max())
        return np.clip(values, np.median(values) - most, np.median(values) + most)

    return mapped(name, clip)


def one_way_gain(values: np.ndarray) -> np.ndarray:
    return np.where(values > 0.0, 1.2 * values, values)


def deadband(values: np.ndarray) -> np.ndarray:
    return np.where(np.abs(values) < 0.3 * np.std(values), 0.0, values)


FAULTS = (
    Fault("one spike of the position, 5 % of its range", spikes("position", 1, 0.05)),
    Fault("one spike of the position, 0.5 %", spikes("position", 1, 0.005)),
    Fault("20 spikes of the position, 2 %", spikes("position", 20, 0.02)),
    Fault("5 spikes of the position, 0.2 %", spikes("position", 5, 0.002)),
    Fault("one spike of the effort, 20 times its size", spikes("effort", 1, 20.0)),
    Fault("20 spikes of the effort, 5 times", spikes("effort", 20, 5.0)),
    Fault("a step of the position, 3 %", steps("position", 0.03)),
    Fault("5 steps of the position, 0.5 %", steps("position", 0.005, 5)),
    Fault("a tenth of the log 10 % off in position", steps("position", 0.1, back=True)),
    Fault("a tenth of the log off in effort, by half its size", steps("effort", 0.5, back=True)),
    Fault("effort in 12 steps", levels("effort", 12)),
    Fault("effort in 25 steps", levels("effort", 25)),
    Fault("effort in 6 steps", levels("effort", 6)),
    Fault("position in 200 steps", levels("position", 200)),
    Fault("effort behind a slow filter", filtered("effort")),
    Fault("effort behind a filter, half as slow", filtered("effort", factor=0.5)),
    Fault("position behind a slow filter", filtered("position")),
    Fault("position behind a filter, half as slow", filtered("position", factor=0.5)),
    Fault("effort as a moving mean", averaged("effort")),
    Fault("position as a moving mean", averaged("position")),
    Fault("effort with a drifting offset", drift(offset=0.4)),
    Fault("effort with a drifting gain, 25 %", drift(gain=0.25)),
    Fault("effort with a step in its offset", drift(offset=0.3, step=True)),
    Fault("effort with a step in its gain, 25 %", drift(gain=0.25, step=True)),
    Fault("stamps with jitter, 40 % of a period", jitter(0.4)),
    Fault("stamps with jitter, a period", jitter(1.0)),
    Fault("stamps in steps of 5 periods", rounded_time(5.0)),
    Fault("stamps in steps of 1.5 periods", rounded_time(1.5)),
    Fault("a clock that drifts by 5 %", warped(0.05)),
    Fault("a clock that drifts by 15 %", warped(0.15)),
    Fault("one row in 50 lost without trace", lost(share=0.02)),
    Fault("one row in 10 lost without trace", lost(share=0.1)),
    Fault("0.3 s lost without trace", lost(seconds=0.3)),
    Fault("one row in 10 lost, the time shows it", lost(share=0.1, traced=True)),
    Fault("one row in 50 written twice", twice(0.02)),
    Fault("the reference in the place of the position", copied("position", "reference"), "reference"),
    Fault(
        "the reference, in counts, in the place of the position",
        copied("position", "reference", counts=True),
        "reference",
    ),
    Fault("the position in the place of the reference", copied("reference", "position"), "reference"),
    Fault("a second half of another axis", other_half(1.6)),
    Fault("a second half with another gain of the effort", other_half(1.3, both=False)),
    Fault("a load put on in the middle", load_added(0.4)),
    Fault("a coupling that slips 10 times, 0.5 %", slip(0.005, 10)),
    Fault("a coupling that slips 3 times, 3 %", slip(0.03, 3)),
    Fault("backlash before the sensor, 1 %", play(0.01)),
    Fault("a wavy sensor, 0.3 %", wavy(0.003)),
    Fault("position to 3 digits", digits("position", 3)),
    Fault("effort to 1 digit", digits("effort", 1)),
    Fault("time to 4 digits", digits("time", 4)),
    Fault("no position in the first 40 rows", holes("position", 1, 40, first=True)),
    Fault("no position in 6 stretches of 20 rows", holes("position", 6, 20)),
    Fault("no effort in 6 stretches of 20 rows", holes("effort", 6, 20)),
    Fault("position 0 in 3 stretches of 5 rows", zeros("position", 3, 5)),
    Fault("effort 0 in 20 stretches of 5 rows", zeros("effort", 20, 5)),
    Fault("a velocity of another motion", foreign_velocity),
    Fault("a velocity 1.7 times as large", scaled_velocity),
    Fault("effort recorded late", late("effort", 0.03)),
    Fault("position recorded late", late("position", 0.03)),
    Fault("effort of another part of the run", foreign("effort")),
    Fault("position of another part of the run", foreign("position")),
    Fault("effort clipped at half its range", clipped("effort", 0.5)),
    Fault("effort with its sign turned in the second half", half_turned),
    Fault("effort with another gain one way", mapped("effort", one_way_gain)),
    Fault("effort without its small values", mapped("effort", deadband)),
    Fault("position updated in every 10th row", held("position", 10)),
    Fault("effort updated in every 10th row", held("effort", 10)),
    Fault("position that wraps at any place", wrapped),
)
"""Kinds that were looked at when rules were chosen; `unseen` holds those that were not."""
