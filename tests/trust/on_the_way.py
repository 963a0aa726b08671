"""Faults by what logs go through on their way: sensors, wires, clocks, memory, programs, people.

All were written down before any was judged, and parted by lot: rules were chosen with one half (12 of 100 logs were
accepted and wrong, 6 without two kinds that make logs of other axes), and the other was judged once (12 of 100) before
rules were chosen with that too.
"""

from itertools import pairwise

import numpy as np
from scipy.signal import detrend, filtfilt, hilbert, resample

from tests.trust.faults import Fault, Spoil, Table, corner, low_passed, mapped, period, renumbered, size, smooth, with_
from tests.trust.harder_faults import second_order
from tests.trust.more_faults import course

# -- sensors and what is behind them


def knee(values: np.ndarray) -> np.ndarray:
    """A motor whose iron saturates: the current grows by more than the force, by a third at its largest."""
    return values * (1.0 + 0.35 * (values / np.abs(values).max()) ** 2)


def dead_zone(table: Table, _: np.random.Generator) -> Table:
    """A command to an amplifier with a dead zone: a tenth of its size does nothing."""
    return with_(table, effort=table["effort"] + 0.1 * size(table, "effort") * np.sign(table["effort"]))


def commutation(table: Table, _: np.random.Generator) -> Table:
    """A gain of the effort that goes up and down by 8 %, 30 times over the travel, as windings follow one another."""
    place = (table["position"] - table["position"].min()) / size(table, "position")
    return with_(table, effort=table["effort"] * (1.0 + 0.08 * np.sin(60.0 * np.pi * place)))


def thermal(table: Table, _: np.random.Generator) -> Table:
    """A scale that grows by 2 % as a screw warms up, most of it in the first quarter."""
    return with_(table, position=table["position"] * (1.02 - 0.02 * np.exp(-2.0 * (course(table) + 1.0))))


def interpolator(table: Table, _: np.random.Generator) -> Table:
    """Sine and cosine of unlike size: an error of 0.1 % of the travel, 25 times over it."""
    turn = 50.0 * np.pi * (table["position"] - table["position"].min()) / size(table, "position")
    return with_(table, position=table["position"] + 1e-3 * size(table, "position") * np.sin(2.0 * turn))


def leaky(table: Table, _: np.random.Generator) -> Table:
    """A position that was integrated from a velocity with noise and an offset."""
    rng, step = np.random.default_rng(5), period(table)
    speed = np.gradient(table["position"], step)
    top = float(np.quantile(np.abs(speed), 0.98))
    speed = speed + 0.002 * top + 0.05 * top * rng.standard_normal(len(speed))
    return with_(table, position=table["position"][0] + step * np.cumsum(speed))


def leaned_on(table: Table, _: np.random.Generator) -> Table:
    """A load cell that feels a tenth of the effort for each half of the travel, as a cable pulls at it."""
    place = (table["position"] - table["position"].mean()) / size(table, "position")
    return with_(table, effort=table["effort"] + 0.2 * size(table, "effort") * place)


def aliased(table: Table, _: np.random.Generator) -> Table:
    """A current sampled beside the beat of its switching: a swing of 15 % of itself, every 0.7 s."""
    return with_(table, effort=table["effort"] * (1.0 + 0.15 * np.sin(9.0 * table["time"])))


def rms_held(table: Table, _: np.random.Generator) -> Table:
    """A meter that gives the rms of the last 25 rows, with the sign of the last."""
    squares = np.convolve(np.pad(table["effort"], (24, 0), mode="edge") ** 2, np.ones(25) / 25.0, mode="valid")
    return with_(table, effort=np.sign(table["effort"]) * np.sqrt(squares))


def late_by_size(table: Table, _: np.random.Generator) -> Table:
    """An effort that is the later the larger it is, by up to a fifth of a move."""
    rows, most = np.arange(len(table["time"])), max(round(2.0 * corner(table) / period(table)), 5)
    late = np.rint(most * np.abs(table["effort"]) / np.abs(table["effort"]).max()).astype(int)
    return with_(table, effort=table["effort"][np.maximum(rows - late, 0)])


# -- memory and wires


def half_precision(name: str) -> Spoil:
    """Numbers of 16 bits."""
    return lambda table, _: with_(
        table, **{name: (table[name] / np.ptp(table[name])).astype(np.float16).astype(float) * np.ptp(table[name])}
    )


def companded(values: np.ndarray) -> np.ndarray:
    """Steps that are fine for small values and coarse for large ones, 6 bits (G.711)."""
    most = float(np.abs(values).max())
    coded = np.round(31.0 * np.log1p(255.0 * np.abs(values) / most) / np.log(256.0)) / 31.0
    return np.sign(values) * most * np.expm1(coded * np.log(256.0)) / 255.0


def swinging_door(name: str, share: float) -> Spoil:
    """An archive that keeps as few rows as straight lines between them stay within a share of the size (Bristol)."""

    def spoil(table: Table, _: np.random.Generator) -> Table:
        t, values, band = table["time"], table[name], share * size(table, name)
        kept, low, high = [0], -np.inf, np.inf
        for k in range(1, len(values)):
            way, time = values[k] - values[kept[-1]], max(float(t[k] - t[kept[-1]]), 1e-12)
            if not low <= way / time <= high:
                kept.append(k - 1)
                low, high = -np.inf, np.inf
                way, time = values[k] - values[k - 1], max(float(t[k] - t[k - 1]), 1e-12)
            low, high = max(low, (way - band) / time), min(high, (way + band) / time)
        kept.append(len(values) - 1)
        return with_(table, **{name: np.interp(t, t[kept], values[kept])})

    return spoil


def zeros_for_lost(table: Table, rng: np.random.Generator) -> Table:
    """Messages that were lost: all columns but the time are 0 in 30 places of one to four rows."""
    gone = np.zeros(len(table["time"]), dtype=bool)
    for at in rng.choice(len(gone) - 5, 30, replace=False).tolist():
        gone[at : at + int(rng.integers(1, 5))] = True
    return {k: v if k == "time" else np.where(gone, 0.0, v) for k, v in table.items()}


def means_for_lost(table: Table, rng: np.random.Generator) -> Table:
    """An effort that is its mean in one row of 20, as a program fills gaps."""
    gone = rng.random(len(table["time"])) < 0.05
    return with_(table, effort=np.where(gone, table["effort"].mean(), table["effort"]))


def extrapolated(table: Table, rng: np.random.Generator) -> Table:
    """A position that goes on at its last speed where messages were lost: 25 times, 12 rows."""
    values = table["position"].copy()
    for at in rng.choice(np.arange(20, len(values) - 40), 25, replace=False).tolist():
        values[at : at + 12] = values[at - 1] + (values[at - 1] - values[at - 4]) / 3.0 * np.arange(1, 13)
    return with_(table, position=values)


def minus_lost(table: Table, rng: np.random.Generator) -> Table:
    """One row of 30 without its minus."""
    lost = rng.random(len(table["time"])) < 1.0 / 30.0
    return with_(table, effort=np.where(lost, np.abs(table["effort"]), table["effort"]))


def overlapping(table: Table, _: np.random.Generator) -> Table:
    """Buffers that overlap: 12 rows are written again at each of six seams, the time is an even one."""
    count = len(table["time"])
    seams = [round(count * k / 7.0) for k in range(8)]
    rows = np.concatenate([np.arange(max(a - 12, 0), b) for a, b in pairwise(seams)])
    time = table["time"][0] + np.arange(len(rows)) * period(table)
    return {k: v[rows] for k, v in table.items()} | {"time": time}


def two_loggers(table: Table, _: np.random.Generator) -> Table:
    """Every other row comes from a logger whose clock is 2.5 rows behind."""
    rows = np.arange(len(table["time"]))
    other = np.where(rows % 2, np.maximum(rows - 2, 0), rows)
    return {k: v if k == "time" else v[other] for k, v in table.items()}


def mixed_rates(table: Table, _: np.random.Generator) -> Table:
    """A middle third by every second row, with the time of the others."""
    rows, third = np.arange(len(table["time"])), len(table["time"]) // 3
    return renumbered(table, rows[(rows < third) | (rows >= 2 * third) | (rows % 2 == 0)])


# -- clocks


def slewed_clock(table: Table, _: np.random.Generator) -> Table:
    """A clock that is set right by going 6 % faster, for a fifth of the log."""
    fast = np.abs(course(table)) < 0.2
    time = np.cumsum(np.where(fast, 0.94, 1.0) * np.diff(table["time"], prepend=table["time"][0]))
    return with_(table, time=table["time"][0] + time)


def short_timer(table: Table, _: np.random.Generator) -> Table:
    """A timer that overflows four times."""
    return with_(table, time=np.mod(table["time"] - table["time"][0], np.ptp(table["time"]) / 4.3))


def jitter_of_effort(table: Table, rng: np.random.Generator) -> Table:
    """An effort that was sampled up to four rows beside the position."""
    rows = np.arange(len(table["time"])) + rng.integers(-4, 5, len(table["time"]))
    return with_(table, effort=table["effort"][np.clip(rows, 0, len(table["time"]) - 1)])


# -- programs and people


def without_phase(name: str) -> Spoil:
    """A filter forth and back, as slow as the motion."""

    def spoil(table: Table, _: np.random.Generator) -> Table:
        keep = float(np.exp(-period(table) / corner(table)))
        return with_(table, **{name: filtfilt([1.0 - keep], [1.0, -keep], table[name])})

    return spoil


def tapered(table: Table, _: np.random.Generator) -> Table:
    """An effort that was faded in and out over a fifth of the log, for a spectrum."""
    window = np.minimum(1.0, (1.0 - np.abs(course(table))) / 0.2)
    return with_(table, effort=table["effort"] * np.sin(0.5 * np.pi * window) ** 2)


def trend_out(table: Table, _: np.random.Generator) -> Table:
    """A position without its straight line, in fifths."""
    cuts = [len(table["time"]) * k // 5 for k in range(1, 5)]
    return with_(table, position=detrend(table["position"], bp=cuts))


def levelled(table: Table, _: np.random.Generator) -> Table:
    """An effort that a program brings to one loudness: over its mean size within half a second, by the half of it."""
    loud = smooth(np.abs(table["effort"]), 2 * round(0.25 / period(table)) + 1)
    return with_(table, effort=table["effort"] * np.sqrt(loud.mean() / np.maximum(loud, 0.05 * loud.mean())))


def by_fourier(table: Table, _: np.random.Generator) -> Table:
    """An effort by a tenth of the rows, and back, by Fourier's transform: it rings at its steps."""
    few = resample(table["effort"], len(table["effort"]) // 10)
    return with_(table, effort=resample(few, len(table["effort"])))


def outliers_out(table: Table, _: np.random.Generator) -> Table:
    """An effort with straight lines where it was beyond 1.8 times its size."""
    rows = np.arange(len(table["time"]))
    kept = np.abs(table["effort"] - table["effort"].mean()) < 1.8 * size(table, "effort")
    return with_(table, effort=np.interp(rows, rows[kept], table["effort"][kept]))


def winsorised(values: np.ndarray) -> np.ndarray:
    """Values within the quantiles of 5 and 95 %."""
    return np.clip(values, *np.quantile(values, (0.05, 0.95)))


def envelope(table: Table, _: np.random.Generator) -> Table:
    """The envelope of the effort, with the sign of its mean over 41 rows."""
    return with_(table, effort=np.abs(hilbert(table["effort"])) * np.sign(smooth(table["effort"], 41)))


def turned_over(table: Table, _: np.random.Generator) -> Table:
    """A position of the run backwards in time, laid behind the other: a symmetric log that nobody drove."""
    half = len(table["time"]) // 2
    return with_(table, position=np.r_[table["position"][:half], table["position"][: len(table["time"]) - half][::-1]])


def powers_of_ten(table: Table, _: np.random.Generator) -> Table:
    """Numbers below a fiftieth of the largest that lost their exponent: ten times as large."""
    small = np.abs(table["effort"]) < 0.02 * np.abs(table["effort"]).max()
    return with_(table, effort=np.where(small, 10.0, 1.0) * table["effort"])


def shifted_column(table: Table, _: np.random.Generator) -> Table:
    """Cells of the effort moved up by one row at each of 40 places where a cell was deleted."""
    rows = np.arange(len(table["time"]))
    moved = np.searchsorted(np.linspace(0, len(rows), 41)[1:], rows, side="right")
    return with_(table, effort=table["effort"][np.minimum(rows + moved, len(rows) - 1)])


def filled_down(table: Table, rng: np.random.Generator) -> Table:
    """A number of the effort drawn down over 60 rows by hand, eight times."""
    values = table["effort"].copy()
    for at in rng.choice(len(values) - 60, 8, replace=False).tolist():
        values[at : at + 60] = values[at]
    return with_(table, effort=values)


def sum_of_both(table: Table, _: np.random.Generator) -> Table:
    """An effort to which a program has added its own mean over 15 rows."""
    return with_(table, effort=table["effort"] + smooth(table["effort"], 15) * 0.5)


def rectified_noise(table: Table, rng: np.random.Generator) -> Table:
    """A noise that only adds: half of the size of the effort, away from 0."""
    noise = 0.5 * size(table, "effort") * np.abs(rng.standard_normal(len(table["time"])))
    return with_(table, effort=table["effort"] + np.sign(table["effort"]) * noise)


def lagging_zero(table: Table, _: np.random.Generator) -> Table:
    """A zero that creeps after the effort by a tenth of it, over a second, as a strain gauge does."""
    return with_(table, effort=table["effort"] - 0.1 * low_passed(table["effort"], 1.0, period(table)))


ON_THE_WAY = (
    Fault("current of a motor whose iron saturates", mapped("effort", knee)),
    Fault("command to an amplifier with a dead zone", dead_zone, is_another=True),
    Fault("a gain of the effort that waves with the commutation, 8 %", commutation),
    Fault("a scale that grows by 2 % as a screw warms up", thermal),
    Fault("an interpolator of unlike sine and cosine", interpolator),
    Fault("position integrated from a velocity", leaky),
    Fault("a load cell that a cable pulls at", leaned_on),
    Fault("current sampled beside the beat of its switching", aliased),
    Fault("rms of the effort over 25 rows, with its sign", rms_held),
    Fault("effort the later the larger it is", late_by_size),
    Fault("position in numbers of 16 bits", half_precision("position")),
    Fault("effort in numbers of 16 bits", half_precision("effort")),
    Fault("effort in steps that grow with it", mapped("effort", companded)),
    Fault("position from an archive, lines within 0.1 %", swinging_door("position", 0.001)),
    Fault("effort from an archive, lines within a fifth", swinging_door("effort", 0.2)),
    Fault("zeros for lost messages, 30 times", zeros_for_lost),
    Fault("the mean for one effort of 20", means_for_lost),
    Fault("position extrapolated for 12 rows, 25 times", extrapolated),
    Fault("one effort of 30 without its minus", minus_lost),
    Fault("12 rows again at six seams", overlapping),
    Fault("rows in turn from two loggers, 2 rows apart", two_loggers),
    Fault("a middle third by every second row, without trace", mixed_rates),
    Fault("a clock 6 % fast in a fifth of the log", slewed_clock),
    Fault("a timer that overflows four times", short_timer),
    Fault("effort sampled up to 4 rows beside the position", jitter_of_effort),
    Fault("position filtered forth and back", without_phase("position")),
    Fault("effort filtered forth and back", without_phase("effort")),
    Fault("effort faded in and out", tapered),
    Fault("position without its straight lines, in fifths", trend_out),
    Fault("effort brought to one loudness", levelled),
    Fault("effort by a tenth of its rows, by Fourier", by_fourier),
    Fault("straight lines for large efforts", outliers_out),
    Fault("effort within its quantiles of 5 and 95 %", mapped("effort", winsorised)),
    Fault("envelope of the effort with its sign", envelope),
    Fault("a second half that is the first one backwards, in position", turned_over),
    Fault("small efforts ten times as large", powers_of_ten),
    Fault("effort moved up by a row at 40 places", shifted_column),
    Fault("effort drawn down over 60 rows, 8 times", filled_down),
    Fault("effort with half of its own mean added", sum_of_both, is_another=True),
    Fault("effort with noise that only adds", rectified_noise),
    Fault("effort whose zero creeps after it", lagging_zero),
    Fault("effort behind a filter that rings", second_order("effort", 0.15, 0.5)),
)
