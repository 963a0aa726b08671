"""Faults of recordings that were written down fifth, and judged once before rules were chosen with them.

They are of sensors, recorders and clocks, and make of a log one that no axis makes.
"""

import numpy as np
from scipy.signal import medfilt

from tests.trust.faults import Fault, Spoil, Table, corner, low_passed, mapped, period, renumbered, size, with_
from tests.trust.more_faults import course, velocity


def share_of_speed(table: Table) -> np.ndarray:
    """Speed in parts of its largest."""
    speed = np.abs(velocity(table))
    return speed / speed.max()


def crosstalk(table: Table, _: np.random.Generator) -> Table:
    """A fifth of the effort of another axis: here, of the same run backwards."""
    return with_(table, effort=table["effort"] + 0.2 * table["effort"][::-1])


def medians(table: Table, _: np.random.Generator) -> Table:
    """A position as medians over 61 rows."""
    return with_(table, position=medfilt(np.pad(table["position"], 30, mode="edge"), 61)[30:-30])


def slewed(table: Table, _: np.random.Generator) -> Table:
    """An effort that changes by no more than a twentieth of its size from row to row."""
    most, place, found = 0.05 * size(table, "effort"), float(table["effort"][0]), []
    for value in table["effort"].tolist():
        place += min(max(value - place, -most), most)
        found.append(place)
    return with_(table, effort=np.array(found))


def blind_band(table: Table, _: np.random.Generator) -> Table:
    """A sensor that gives one value over a twentieth of the travel."""
    low = float(table["position"].min()) + 0.4 * size(table, "position")
    inside = np.abs(table["position"] - low) < 0.025 * size(table, "position")
    return with_(table, position=np.where(inside, low, table["position"]))


def begun_anew(table: Table, _: np.random.Generator) -> Table:
    """A time that begins at 0 again, twice."""
    return with_(table, time=np.mod(table["time"] - table["time"][0], np.ptp(table["time"]) / 2.9))


def peaks_held(table: Table, _: np.random.Generator) -> Table:
    """An effort that keeps its largest size for 15 rows."""
    views = np.lib.stride_tricks.sliding_window_view(np.pad(table["effort"], (14, 0), mode="edge"), 15)
    at = np.argmax(np.abs(views), axis=1)
    return with_(table, effort=views[np.arange(len(views)), at])


def in_pairs(table: Table, _: np.random.Generator) -> Table:
    """Rows that are written in pairs, with the time of the second."""
    rows = np.arange(len(table["time"]))
    return with_(table, time=table["time"][np.minimum(rows // 2 * 2 + 1, len(rows) - 1)])


def opened_by_speed(table: Table, _: np.random.Generator) -> Table:
    """A filter of the position that is slow where the axis is slow."""
    slow = low_passed(table["position"], corner(table), period(table))
    share = share_of_speed(table)
    return with_(table, position=share * table["position"] + (1.0 - share) * slow)


def after_turns(table: Table, _: np.random.Generator) -> Table:
    """A third of its size that is added to the effort for ten rows after its sign has changed."""
    sign, values = np.sign(table["effort"]), table["effort"].copy()
    for at in (np.flatnonzero(np.diff(sign)) + 1).tolist():
        values[at : at + 10] += 0.3 * size(table, "effort") * sign[at]
    return with_(table, effort=values)


def ripple(table: Table, _: np.random.Generator) -> Table:
    """A gain of the effort that goes up and down by 15 %, three times over the travel."""
    place = (table["position"] - table["position"].min()) / size(table, "position")
    return with_(table, effort=table["effort"] * (1.0 + 0.15 * np.sin(6.0 * np.pi * place)))


def late_one_way(table: Table, _: np.random.Generator) -> Table:
    """An effort that comes late where it pushes one way, by a fifth of a move."""
    rows = np.arange(len(table["time"]))
    late = table["effort"][np.maximum(rows - max(round(2.0 * corner(table) / period(table)), 5), 0)]
    return with_(table, effort=np.where(table["effort"] > 0.0, late, table["effort"]))


def overloaded(table: Table, _: np.random.Generator) -> Table:
    """Rows of a large effort that are lost; the time shows it."""
    kept = np.abs(table["effort"]) < 1.5 * size(table, "effort")
    return {k: v[kept] for k, v in table.items()}


def too_quick(table: Table, _: np.random.Generator) -> Table:
    """Every third row lost without trace where the axis is quick."""
    rows = np.arange(len(table["time"]))
    return renumbered(table, rows[(share_of_speed(table) < 0.5) | (rows % 3 > 0)])


def swinging_clock(table: Table, _: np.random.Generator) -> Table:
    """A clock that goes ahead and behind, by 0.4 % of the log, five times."""
    return with_(table, time=table["time"] + 0.004 * np.ptp(table["time"]) * np.sin(10.0 * np.pi * course(table)))


def rounded_ways(table: Table, _: np.random.Generator) -> Table:
    """A position that is added up from ways in 40 steps; what is lost of one is not in the next."""
    ways = np.diff(table["position"], prepend=table["position"][0])
    step = float(np.abs(ways).max()) / 20.0
    return with_(table, position=table["position"][0] + np.cumsum(step * np.trunc(ways / step)))


def exchanged(table: Table, rng: np.random.Generator) -> Table:
    """One row in 100 with effort and position in each other's column."""
    other = rng.random(len(table["time"])) < 0.01
    a, b = table["position"], table["effort"]
    return with_(table, position=np.where(other, b, a), effort=np.where(other, a, b))


def without_zeros(table: Table, _: np.random.Generator) -> Table:
    """An effort written with two decimals, without the zeros ahead of them: 1.05 as 1.5."""
    scaled = np.round(np.abs(table["effort"]) / size(table, "effort"), 2)
    decimals = np.round(100.0 * (scaled % 1.0))
    shown = np.floor(scaled) + decimals / np.where(decimals < 10.0, 10.0, 100.0)
    return with_(table, effort=np.sign(table["effort"]) * shown * size(table, "effort"))


def leaning(table: Table, _: np.random.Generator) -> Table:
    """The position of an observer that leans on its reference by a half."""
    return with_(table, position=0.5 * (table["position"] + table["reference"]))


def without_slow(table: Table, _: np.random.Generator) -> Table:
    """A position without what is slow, as an acceleration that was integrated twice has it."""
    slow = low_passed(table["position"], 30.0 * corner(table), period(table))
    return with_(table, position=table["position"] - slow)


def falling_slowly(table: Table, _: np.random.Generator) -> Table:
    """An effort behind a rectifier: what is measured of its size rises at once, and falls slowly."""
    keep, place, found = float(np.exp(-period(table) / corner(table))), 0.0, []
    for value in np.abs(table["effort"]).tolist():
        place = max(value, keep * place)
        found.append(place)
    return with_(table, effort=np.sign(table["effort"]) * np.array(found))


def noisy_by_size(table: Table, rng: np.random.Generator) -> Table:
    """An effort whose rows are off by 40 % of what they are."""
    return with_(table, effort=table["effort"] * (1.0 + 0.4 * rng.standard_normal(len(table["time"]))))


def late_sign(table: Table, _: np.random.Generator) -> Table:
    """The size of the effort, with the sign that it had 20 rows before."""
    rows = np.arange(len(table["time"]))
    return with_(table, effort=np.abs(table["effort"]) * np.sign(table["effort"][np.maximum(rows - 20, 0)]))


def stretch_of_mean(name: str) -> Spoil:
    """A tenth of the log in which a signal is its mean."""
    inside = 0.05
    return lambda table, _: with_(
        table, **{name: np.where(np.abs(course(table) - 0.7) < inside, table[name].mean(), table[name])}
    )


def folded(values: np.ndarray) -> np.ndarray:
    """A position without its sign, from its middle on."""
    return np.abs(values - 0.5 * (values.min() + values.max()))


LATER = (
    Fault("a fifth of the effort of another axis", crosstalk),
    Fault("position as medians over 61 rows", medians),
    Fault("effort that changes slowly", slewed),
    Fault("a sensor that is blind over a twentieth of the travel", blind_band),
    Fault("time from 0 again, twice", begun_anew),
    Fault("effort that keeps its peaks for 15 rows", peaks_held),
    Fault("stamps in pairs", in_pairs),
    Fault("position behind a filter that speed opens", opened_by_speed),
    Fault("pulses of the effort after its sign has changed", after_turns),
    Fault("a gain of the effort that waves over the travel, 15 %", ripple),
    Fault("effort late one way", late_one_way),
    Fault("rows of a large effort lost, the time shows it", overloaded),
    Fault("every third row lost without trace at speed", too_quick),
    Fault("a clock that swings, 5 times", swinging_clock),
    Fault("position added up from ways in 40 steps", rounded_ways),
    Fault("one row in 100 with its columns exchanged", exchanged),
    Fault("effort without the zeros of its decimals", without_zeros),
    Fault("position of an observer that leans on its reference", leaning, "reference"),
    Fault("position without what is slow", without_slow),
    Fault("effort that rises at once and falls slowly", falling_slowly),
    Fault("effort with noise of 40 % of itself", noisy_by_size),
    Fault("size of the effort, with the sign of 20 rows before", late_sign),
    Fault("effort at its mean in a tenth of the log", stretch_of_mean("effort")),
    Fault("position without its sign", mapped("position", folded)),
)
