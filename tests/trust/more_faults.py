"""More faults, of sensors, clocks, amplifiers and axes, which were written down and judged before any was looked at.

Of these 45 kinds 6.4 % of the logs were accepted and wrong when they were first judged, 3.8 % by rules for which none
of them had been looked at. Each spoils the columns of a clean log as those of `faults` do.
"""

import numpy as np

from tests.trust.faults import (
    Fault,
    Spoil,
    Table,
    clipped,
    corner,
    digits,
    even,
    levels,
    low_passed,
    mapped,
    moving,
    period,
    play,
    renumbered,
    size,
    smooth,
    with_,
)


def velocity(table: Table) -> np.ndarray:
    return np.gradient(smooth(table["position"], 9), period(table))


def course(table: Table) -> np.ndarray:
    """From 0 at the begin of a log to 1 at its end."""
    return np.linspace(0.0, 1.0, len(table["time"]))


# ---- position


def swapped(table: Table, rng: np.random.Generator) -> Table:
    """Neighbouring positions that changed places."""
    values = table["position"].copy()
    for at in rng.choice(moving(table)[5:-5], 30, replace=False).tolist():
        values[[at, at + 1]] = values[[at + 1, at]]
    return with_(table, position=values)


def block_misplaced(table: Table, rng: np.random.Generator) -> Table:
    """A buffer of rows that was written before the one that it belongs behind."""
    rows, n = np.arange(len(table["time"])), len(table["time"])
    count = n // 20
    at = int(rng.integers(n // 4, n // 2))
    rows[at : at + 2 * count] = np.r_[rows[at + count : at + 2 * count], rows[at : at + count]]
    return renumbered(table, rows)


def counts_lost(share: float) -> Spoil:
    """An encoder that loses a share of its counts in one direction."""

    def spoil(table: Table, _: np.random.Generator) -> Table:
        ways = np.diff(table["position"], prepend=table["position"][0])
        return with_(table, position=table["position"][0] + np.cumsum(np.where(ways > 0.0, (1.0 - share) * ways, ways)))

    return spoil


def frozen(name: str, rows: int, count: int) -> Spoil:
    """A signal that keeps its value for some rows, some times."""

    def spoil(table: Table, rng: np.random.Generator) -> Table:
        values = table[name].copy()
        for at in rng.choice(moving(table), count, replace=False).tolist():
            values[at : at + rows] = values[at]
        return with_(table, **{name: values})

    return spoil


def hum(name: str, share: float) -> Spoil:
    """A signal with a sine of the mains."""
    return lambda table, _: with_(
        table, **{name: table[name] + share * size(table, name) * np.sin(2 * np.pi * 50.0 * table["time"])}
    )


def noisy(name: str, share: float) -> Spoil:
    return lambda table, rng: with_(
        table, **{name: table[name] + share * size(table, name) * rng.standard_normal(len(table[name]))}
    )


def creeping(table: Table, _: np.random.Generator) -> Table:
    """A position whose zero creeps away."""
    return with_(table, position=table["position"] + 0.05 * size(table, "position") * course(table))


def scaled(share: float, *, step: bool = False) -> Spoil:
    """A position whose scale grows along the log, or changes in its middle."""

    def spoil(table: Table, _: np.random.Generator) -> Table:
        ways = np.diff(table["position"], prepend=table["position"][0])
        grown = 1.0 + share * (course(table) > 0.5 if step else course(table))
        return with_(table, position=table["position"][0] + np.cumsum(grown * ways))

    return spoil


def joined_by_lines(table: Table, _: np.random.Generator) -> Table:
    """A position that came in every fifth row, with straight lines between."""
    rows = np.arange(len(table["time"]))
    return with_(table, position=np.interp(rows, rows[::5], table["position"][::5]))


def eccentric(table: Table, _: np.random.Generator) -> Table:
    """A sensor with an error of 1 % of the range, once over it."""
    q, way = table["position"], size(table, "position")
    return with_(table, position=q + 0.01 * way * np.sin(2 * np.pi * q / way))


# ---- effort


def high_passed(table: Table, _: np.random.Generator) -> Table:
    """An effort behind a capacitor."""
    return with_(table, effort=table["effort"] - low_passed(table["effort"], 20.0 * corner(table), period(table)))


def heated(table: Table, _: np.random.Generator) -> Table:
    """An effort whose gain falls by 20 % as a motor heats."""
    return with_(table, effort=table["effort"] * (1.0 - 0.2 * (1.0 - np.exp(-4.0 * course(table)))))


def wandering(table: Table, rng: np.random.Generator) -> Table:
    """An effort that comes 0 to 6 rows late, now more, now less."""
    late = np.interp(course(table), np.linspace(0.0, 1.0, 20), rng.uniform(0.0, 6.0, 20)).astype(int)
    return with_(table, effort=table["effort"][np.maximum(np.arange(len(late)) - late, 0)])


def pushed(table: Table, _: np.random.Generator) -> Table:
    """A force of something else in the middle third of the log."""
    middle = np.abs(course(table) - 0.5) < 1 / 6
    return with_(table, effort=table["effort"] + 0.4 * size(table, "effort") * middle)


def swayed(table: Table, _: np.random.Generator) -> Table:
    """A force of something else that comes and goes three times."""
    return with_(table, effort=table["effort"] + 0.3 * size(table, "effort") * np.sin(6 * np.pi * course(table)))


def means_held(table: Table, _: np.random.Generator) -> Table:
    """Means over 20 rows, each held for the next 20."""
    effort, n = table["effort"], len(table["effort"]) // 20 * 20
    means = np.repeat(effort[:n].reshape(-1, 20).mean(axis=1), 20)
    return with_(table, effort=np.r_[np.full(20, means[0]), means, np.full(20, means[-1])][: len(effort)])


def cogged(table: Table, _: np.random.Generator) -> Table:
    """A force that depends on the place, 20 times over the range."""
    q, way = table["position"], size(table, "position")
    return with_(table, effort=table["effort"] + 0.3 * size(table, "effort") * np.sin(40 * np.pi * q / way))


def glitches(table: Table, rng: np.random.Generator) -> Table:
    values = table["effort"].copy()
    values[rng.choice(moving(table), 10, replace=False)] = values.max()
    return with_(table, effort=values)


def upper_clipped(values: np.ndarray) -> np.ndarray:
    return np.minimum(values, np.median(values) + 0.6 * (values.max() - np.median(values)))


# ---- axis


def warmed(table: Table, _: np.random.Generator) -> Table:
    """Friction that falls by 0.3 of the size of the effort as it warms up."""
    way = np.tanh(20.0 * velocity(table) / np.abs(velocity(table)).max())
    fallen = 0.3 * size(table, "effort") * (1.0 - np.exp(-4.0 * course(table)))
    return with_(table, effort=table["effort"] - fallen * way)


def rough_half(table: Table, _: np.random.Generator) -> Table:
    """Friction that is larger in one half of the travel."""
    q = table["position"]
    way = np.tanh(20.0 * velocity(table) / np.abs(velocity(table)).max())
    return with_(table, effort=table["effort"] + 0.3 * size(table, "effort") * way * (q > 0.5 * (q.min() + q.max())))


def sprung(table: Table, _: np.random.Generator) -> Table:
    """A spring that pulls back, with half the size of the effort at the ends."""
    q = table["position"]
    return with_(table, effort=table["effort"] + size(table, "effort") * (q - 0.5 * (q.min() + q.max())) / np.ptp(q))


# ---- time


def set_clock(seconds: float) -> Spoil:
    """A clock that is set in the middle of the log."""
    return lambda table, _: with_(table, time=table["time"] + seconds * (course(table) > 0.5))


def one_stamp(table: Table, rng: np.random.Generator) -> Table:
    time = table["time"].copy()
    time[rng.choice(moving(table))] += 1.0
    return with_(table, time=time)


def half_rate(*, traced: bool) -> Spoil:
    """A second half with every other row only."""

    def spoil(table: Table, _: np.random.Generator) -> Table:
        n = len(table["time"])
        rows = np.r_[np.arange(n // 2), np.arange(n // 2, n, 2)]
        return {k: v[rows] for k, v in table.items()} if traced else renumbered(table, rows)

    return spoil


def cut_out(table: Table, rng: np.random.Generator) -> Table:
    """A tenth of the log that somebody cut out between two moments at which the axis was at one place."""
    n = len(table["time"])
    at = int(rng.choice(moving(table)[moving(table) < n // 2]))
    same = np.abs(table["position"][at + n // 10 : at + n // 5] - table["position"][at])
    return renumbered(table, np.r_[np.arange(at), np.arange(at + n // 10 + int(np.argmin(same)), n)])


def written_twice(table: Table, _: np.random.Generator) -> Table:
    return renumbered(even(table), np.tile(np.arange(len(table["time"])), 2))


def pasted(table: Table, rng: np.random.Generator) -> Table:
    """A tenth of the log that is another tenth of it."""
    n = len(table["time"])
    rows, at = np.arange(n), int(rng.integers(n // 2, 3 * n // 4))
    rows[at : at + n // 10] -= n // 3
    return renumbered(table, rows)


def arrivals(table: Table, rng: np.random.Generator) -> Table:
    """Stamps of the arrival of messages, in order, each late by chance."""
    late = rng.exponential(period(table), len(table["time"]))
    return with_(table, time=np.maximum.accumulate(table["time"] + late))


def corrected(table: Table, _: np.random.Generator) -> Table:
    """A clock that runs 3 % too fast and is set right ten times."""
    t = table["time"] - table["time"][0]
    return with_(table, time=table["time"] + 0.03 * np.mod(t, t[-1] / 10.0))


def switched_off(table: Table, _: np.random.Generator) -> Table:
    """An axis that stands still in its last fifth, while its effort is recorded on."""
    position, at = table["position"].copy(), 4 * len(table["time"]) // 5
    position[at:] = position[at]
    return with_(table, position=position)


def other_run(table: Table, _: np.random.Generator) -> Table:
    return with_(table, reference=np.roll(table["reference"], len(table["reference"]) // 3))


MORE = (
    Fault("30 positions in the place of their neighbours", swapped),
    Fault("a block of rows written before the one ahead of it", block_misplaced),
    Fault("an encoder that loses 2 % one way", counts_lost(0.02)),
    Fault("position kept for 50 rows, 4 times", frozen("position", 50, 4)),
    Fault("position with hum, 0.1 % of its range", hum("position", 0.001)),
    Fault("position with noise, 0.2 %", noisy("position", 0.002)),
    Fault("position whose zero creeps by 5 %", creeping),
    Fault("position whose scale grows by 10 %", scaled(0.1)),
    Fault("position whose scale is another by 10 % in the second half", scaled(0.1, step=True)),
    Fault("position in every 5th row, lines between", joined_by_lines),
    Fault("backlash before the sensor, 4 %", play(0.04)),
    Fault("position in 1000 steps", levels("position", 1000)),
    Fault("a wavy sensor, once over the range, 1 %", eccentric),
    Fault("position clipped at 80 % of its range", clipped("position", 0.8)),
    Fault("position to 4 digits", digits("position", 4)),
    Fault("effort with hum, a fifth of its size", hum("effort", 0.2)),
    Fault("effort with noise, half its size", noisy("effort", 0.5)),
    Fault("effort without its sign", mapped("effort", np.abs)),
    Fault("effort squared, with its sign", mapped("effort", lambda v: v * np.abs(v) / np.abs(v).max())),
    Fault("effort behind a capacitor", high_passed),
    Fault("effort whose gain falls by 20 % as a motor heats", heated),
    Fault("effort late by 0 to 6 rows, wandering", wandering),
    Fault("effort clipped one way, at 60 %", mapped("effort", upper_clipped)),
    Fault("effort in 60 steps", levels("effort", 60)),
    Fault("another force in the middle third", pushed),
    Fault("another force that comes and goes", swayed),
    Fault("effort as means over 20 rows, held", means_held),
    Fault("a force that depends on the place, 20 times over the range", cogged),
    Fault("effort kept for 100 rows, 5 times", frozen("effort", 100, 5)),
    Fault("effort at its largest value in 10 rows", glitches),
    Fault("friction that falls as it warms up", warmed),
    Fault("friction that is larger in one half of the travel", rough_half),
    Fault("a spring that pulls back", sprung),
    Fault("a clock set back by 0.2 s", set_clock(-0.2)),
    Fault("a clock set forward by 0.5 s", set_clock(0.5)),
    Fault("one stamp a second off", one_stamp),
    Fault("a second half with every other row, without trace", half_rate(traced=False)),
    Fault("a second half with every other row, the time shows it", half_rate(traced=True)),
    Fault("a tenth cut out without trace", cut_out),
    Fault("the log written twice, one after the other", written_twice),
    Fault("a tenth of the log in the place of another", pasted),
    Fault("stamps of arrival, late by a period", arrivals),
    Fault("a clock 3 % too fast, set right ten times", corrected),
    Fault("an axis that stands still in the last fifth", switched_off),
    Fault("the reference of another part of the run", other_run, "reference"),
)
"""All of them."""
