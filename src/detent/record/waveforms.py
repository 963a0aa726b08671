"""Waveforms: the registers of clocked logic as levels over time, the form that logic viewers and timing diagrams show.

A recorded row says what each register holds after a tick. Inside the tick, which is where a timing diagram looks, a
register takes its new value at a moment of its own - at a clock edge - or shows it only for a while, as a strobe does:
that moment is its `Phase`. Time is a whole number of picoseconds since power-on, so that edges which coincide do.

VCD files (IEEE 1364-2005, clause 18), which GTKWave, Surfer and every logic analyser's program open, hold them so:

| signal | kind in the file |
|---|---|
| flag | ``wire`` of 1 bit |
| unsigned word | ``reg`` of its width |
| signed word | ``integer`` of its width, two's complement: viewers show it in decimal with its sign |
| float | ``real``: 16 significant digits, as the standard has it |

Blocks become nested scopes below one that carries the title. The file holds neither a date nor anything else that
differs between two runs of the same axis. VCD has no place for units and descriptions.
"""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vcd.common import Timescale, TimescaleUnit, VarType
from vcd.writer import VCDWriter

from detent.errors import DetentError
from detent.files.marks import WROTE
from detent.files.screen import OnScreen
from detent.files.text import writing
from detent.kernel.registers import Leaf

Times = NDArray[np.int64]  # moments since power-on [ps]
Values = NDArray[Any]  # one value per moment: integers, or floats
PICOSECONDS = 1e12  # picoseconds in a second


@dataclass(frozen=True, slots=True)
class Phase:
    """When inside a tick a register takes its new value."""

    changes_at: float = 0.0  # fraction of the tick, 0 <= changes_at < 1
    # fractions of the tick, 0 <= from < to <= 1: the value is shown between the two only, and 0 in the rest of the
    # tick. Replaces `changes_at`
    pulse: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.changes_at < 1:
            raise DetentError(
                f"phase: changes_at is {self.changes_at!r}; expected: 0 <= fraction < 1; give one of these"
            )
        first, last = self.pulse or (0.0, 1.0)
        if not 0 <= first < last <= 1:
            raise DetentError(
                f"phase: pulse is {self.pulse!r}; expected: 0 <= from < to <= 1; give fractions of a tick"
            )
        if self.pulse and self.changes_at:
            raise DetentError(f"phase: changes_at {self.changes_at!r} and pulse {self.pulse!r} are given; give one")


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Waveform(OnScreen):
    """One signal over time: each value holds from its moment to the next.

    Parameters
    ----------
    name : str
        Dotted path of the register, such as ``tracker.reference``; printable ASCII without spaces.
    bits : int
        1 for a flag, else the width of the register, at most 64; 64 for a float.
    signed : bool
        Whether an integer may be negative; True for a float.
    is_float : bool
        Whether the values are floats.
    unit : str
        Unit of the values; "" for a number without unit or a flag.
    doc : str
        What the signal is, in a few words.
    times : ndarray of int64
        Moments since power-on [ps], rising, shape (n,), n >= 1; the first is where the signal begins.
    values : ndarray
        Value from each moment on, shape (n,); booleans, integers or floats.
    """

    name: str
    bits: int
    signed: bool
    is_float: bool
    unit: str
    doc: str
    times: Times
    values: Values

    @property
    def block(self) -> str:
        """Path of the block that the signal belongs to; "" at the top."""
        return self.name.rpartition(".")[0]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Waveforms(OnScreen):
    """Signals over one stretch of time.

    Parameters
    ----------
    begin, end : int
        The stretch [ps] since power-on; begin >= 0, `end` itself is outside.
    signals : tuple of Waveform
        Each begins at `begin`, changes before `end`, and has a name of its own.
    title : str
        What the whole shows, such as the axis; "" for nothing.
    """

    begin: int
    end: int
    signals: tuple[Waveform, ...]
    title: str = ""

    def __getitem__(self, name: str) -> Waveform:
        """Give one signal by its name; without it a `DetentError` lists those that exist."""
        found = next((signal for signal in self.signals if signal.name == name), None)
        if found is not None:
            return found
        held = ", ".join(signal.name for signal in self.signals) or "none"
        raise DetentError(f"waveforms: no signal {name!r}; expected: {held}; name one of these")

    def window(self, begin: int, end: int) -> "Waveforms":
        """Cut out a stretch of time [ps] since power-on; what lies outside of these waveforms is left out.

        Each signal begins with the value that holds at the new begin. A `DetentError` says so where the stretch holds
        nothing of these waveforms.
        """
        first, last = max(begin, self.begin), min(end, self.end)
        if first >= last:
            held = f"{self.begin} ps to {self.end} ps"
            raise DetentError(
                f"waveforms: nothing from {begin} ps to {end} ps; expected: within {held}; choose it there"
            )
        return Waveforms(first, last, tuple(_cut(signal, first, last) for signal in self.signals), self.title)


def _cut(signal: Waveform, begin: int, end: int) -> Waveform:
    start = max(int(np.searchsorted(signal.times, begin, side="right")) - 1, 0)
    stop = int(np.searchsorted(signal.times, end, side="left"))
    times = signal.times[start:stop].copy()
    times[0] = begin
    return replace(signal, times=times, values=signal.values[start:stop])


def waveforms_from_rows(
    rows: NDArray[np.void],
    leaves: Sequence[Leaf],
    *,
    period: float,  # period T of a tick [s], at least 1 ps
    phases: Mapping[str, Phase] | None = None,
    title: str = "",
) -> Waveforms:
    """Turn rows recorded at consecutive ticks into waveforms.

    The row with ``tick`` = n was recorded after tick n - 1, which spans [(n - 1)·T, n·T). Before the first change of a
    register inside the first tick nothing is known of it: the first value is carried back. Where that matters, record
    one tick more and cut it off with `Waveforms.window`.

    >>> import numpy as np
    >>> from detent.kernel.registers import Registers, register, u1
    >>> class Divider(Registers):
    ...     msb: u1 = register("top bit")
    >>> rows = np.array([(1, 0), (2, 1), (3, 1), (4, 0)], dtype=[("tick", "i8"), ("msb", "u1")])
    >>> shown = waveforms_from_rows(rows, list(Divider.leaves()), period=250e-9, phases={"msb": Phase(0.25)})
    >>> shown["msb"].times.tolist(), shown["msb"].values.tolist(), shown.end
    ([0, 312500, 812500], [0, 1, 0], 1000000)
    """
    period_ps = _checked_period(period)
    ticks = np.asarray(rows["tick"], dtype=np.int64) - 1
    signals = tuple(
        _signal(leaf, ticks, np.asarray(rows[leaf.path]), period_ps, _phase_of(leaf.path, phases or {}))
        for leaf in leaves
    )
    edges = _picoseconds(np.array([ticks[0], ticks[-1] + 1]), 0.0, period_ps)
    return Waveforms(int(edges[0]), int(edges[1]), signals, title)


def clock_waveform(name: str, period: float, ticks: range, *, high: tuple[float, float], doc: str = "") -> Waveform:
    """Make the waveform of a clock, which is no register: high in the same part of every tick."""
    period_ps = _checked_period(period)
    numbers = np.arange(ticks.start, ticks.stop, dtype=np.int64)
    times, values = _changes(*_pulses(numbers, np.ones(len(numbers), np.uint8), period_ps, Phase(pulse=high)))
    return Waveform(name=name, bits=1, signed=False, is_float=False, unit="", doc=doc, times=times, values=values)


def _checked_period(period: float) -> float:
    """Period of a tick [ps]; whole where the period is meant to be, so that its multiples are exact for ever."""
    period_ps = period * PICOSECONDS
    if not (math.isfinite(period_ps) and period_ps >= 1):
        raise DetentError(f"waveforms: the period of a tick is {period!r} s; expected: 1e-12 s or more; give it in s")
    whole = round(period_ps)
    # 250e-9 s is not a double, and a product with 1e12 rounds once more: two roundings, 2.3e-16 at most.
    return float(whole) if math.isclose(period_ps, whole, rel_tol=1e-15) else period_ps


def _phase_of(path: str, phases: Mapping[str, Phase]) -> Phase:
    """Phase of the longest path that is the register or a block around it."""
    fitting = [key for key in phases if path == key or path.startswith(key + ".")]
    return phases[max(fitting, key=len)] if fitting else Phase()


def _signal(leaf: Leaf, ticks: Times, column: Values, period_ps: float, phase: Phase) -> Waveform:
    if phase.pulse is None:
        times, values = _picoseconds(ticks, phase.changes_at, period_ps), column
        times[0] = _picoseconds(ticks[:1], 0.0, period_ps)[0]
    else:
        times, values = _pulses(ticks, column, period_ps, phase)
    width = leaf.width
    # A count or a code of one byte stays a word, whatever values the window happens to show.
    bits = 1 if width.code == "u1" and not leaf.unit and int(column.max()) <= 1 else 8 * width.size
    changes = _changes(times, values)
    return Waveform(leaf.path, bits, width.is_signed, width.is_float, leaf.unit, leaf.doc, *changes)


def _picoseconds(ticks: Times, fraction: float, period_ps: float) -> Times:
    """Moments `fraction` into the ticks [ps]: multiples of the period, never sums."""
    if period_ps.is_integer():
        return ticks * int(period_ps) + round(fraction * period_ps)
    return np.rint((ticks + fraction) * period_ps).astype(np.int64)


def _pulses(ticks: Times, column: Values, period_ps: float, phase: Phase) -> tuple[Times, Values]:
    """Value between the two moments of each tick, 0 outside."""
    first, last = phase.pulse or (0.0, 1.0)
    up, down = _picoseconds(ticks, first, period_ps), _picoseconds(ticks, last, period_ps)
    if np.any(up >= down):
        got = f"a pulse from {first!r} to {last!r} of a tick of {period_ps:g} ps is shorter than 1 ps"
        raise DetentError(f"waveforms: {got}; expected: 1 ps or more; give a wider pulse")
    times = np.concatenate((_picoseconds(ticks[:1], 0.0, period_ps), np.column_stack((up, down)).ravel()))
    values = np.concatenate((np.zeros(1, column.dtype), np.column_stack((column, np.zeros_like(column))).ravel()))
    # The last fall may lie on the end of the window, outside of it.
    inside = times < _picoseconds(ticks[-1:] + 1, 0.0, period_ps)[0]
    return times[inside], values[inside]


def _changes(times: Times, values: Values) -> tuple[Times, Values]:
    """Only the moments at which the value changes; of several at one moment the last holds."""
    last = np.concatenate((times[1:] != times[:-1], [True]))
    times, values = times[last], values[last]
    same = values[1:] == values[:-1]
    if values.dtype.kind == "f":
        same |= np.isnan(values[1:]) & np.isnan(values[:-1])
    kept = np.concatenate(([True], ~same))
    return times[kept], np.ascontiguousarray(values[kept])


# ---- as files

_UNITS = ((10**6, TimescaleUnit.microsecond), (10**3, TimescaleUnit.nanosecond), (1, TimescaleUnit.picosecond))
# Timescales that a file counts in, coarsest first, with their length [ps].
SCALES = [(number * length, Timescale(number, unit)) for length, unit in _UNITS for number in (100, 10, 1)]
DEFAULT_TITLE = "detent"  # name of the outermost scope of waveforms without title


def save_vcd(waveforms: Waveforms, path: str | Path, *, force: bool = False) -> None:
    """Write waveforms as a VCD file.

    The same waveforms give the same bytes. Time is counted in the coarsest of 1, 10, 100 ps, ns or µs that hits every
    change.
    """
    path = Path(path)
    if not waveforms.signals:
        raise DetentError(f"{path}: there are no signals; expected: one or more; name registers to record")
    with writing(path, force=force) as part, part.open("w", encoding="ascii", newline="\n") as stream:
        _write(waveforms, stream)


def _write(waveforms: Waveforms, stream: Any) -> None:
    common = math.gcd(waveforms.begin, waveforms.end, *(int(np.gcd.reduce(s.times)) for s in waveforms.signals))
    scale, timescale = next((length, scale) for length, scale in SCALES if common % length == 0)
    # An empty date is left out; the default would be the time of day.
    writer = VCDWriter(stream, timescale, date="", version=WROTE, init_timestamp=waveforms.begin // scale)
    # A name that every viewer takes: letters, digits and underscores, no digit first.
    name = re.sub(r"[^A-Za-z0-9_]+", "_", waveforms.title).strip("_") or DEFAULT_TITLE
    top = "_" + name if name[0].isdigit() else name
    variables: list[Any] = []
    for signal in waveforms.signals:
        *blocks, name = signal.name.split(".")
        word = VarType.wire if signal.bits == 1 else VarType.integer if signal.signed else VarType.reg
        kind = VarType.real if signal.is_float else word
        first = signal.values[0].item()
        variables.append(writer.register_var((top, *blocks), name, kind, size=signal.bits, init=first))
    for time, index, value in _merged(waveforms.signals):
        writer.change(variables[index], time // scale, value)
    writer.close(waveforms.end // scale)


def _merged(signals: tuple[Waveform, ...]) -> Iterable[tuple[int, int, int | float]]:
    """Changes after the first of all signals in order of time: moment [ps], number of the signal, value."""
    times = np.concatenate([signal.times[1:] for signal in signals])
    owner = np.repeat(np.arange(len(signals)), [len(signal.times) - 1 for signal in signals])
    # Lists, not one array of all values: that would turn the integers into floats.
    values = [value for signal in signals for value in signal.values[1:].tolist()]
    for row in np.argsort(times, kind="stable").tolist():
        yield int(times[row]), int(owner[row]), values[row]
