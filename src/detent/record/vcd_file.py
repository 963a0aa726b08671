"""Waveforms in VCD files, which GTKWave, Surfer and every logic analyser's program open (IEEE 1364-2005, clause 18).

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
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from vcd.common import Timescale, TimescaleUnit, VarType
from vcd.reader import Location, Token, TokenKind, VarDecl, VCDParseError, tokenize
from vcd.writer import VCDWriter

from detent.errors import DetentError, FileProblem, InputError
from detent.record.trace_store import part_of, writing
from detent.record.waveforms import MAX_BITS, Waveform, Waveforms

UNIT_PS: dict[TimescaleUnit, int] = {
    TimescaleUnit.picosecond: 1,
    TimescaleUnit.nanosecond: 10**3,
    TimescaleUnit.microsecond: 10**6,
    TimescaleUnit.millisecond: 10**9,
    TimescaleUnit.second: 10**12,
}
"""Picoseconds per unit of time that a file may count in; the first three are written."""

WRITTEN = [
    (magnitude, unit)
    for unit in (TimescaleUnit.microsecond, TimescaleUnit.nanosecond, TimescaleUnit.picosecond)
    for magnitude in (100, 10, 1)
]
"""Timescales written, coarsest first."""

SIGNED = {VarType.integer, VarType.byte, VarType.shortint, VarType.int, VarType.longint}
REALS = {VarType.real, VarType.realtime, VarType.shortreal, VarType.real_parameter}
UNREAD = {VarType.string, VarType.event}

DEFAULT_TITLE = "detent"
"""Name of the outermost scope of waveforms without title."""

_REMEDY = "give a VCD file such as detent writes"


def save_vcd(waveforms: Waveforms, path: str | Path) -> None:
    """Write waveforms as a VCD file.

    The same waveforms give the same bytes. Time is counted in the coarsest of 1, 10, 100 ps, ns or µs that hits every
    change.
    """
    path = Path(path)
    if not waveforms.signals:
        raise DetentError(f"{path}: there are no signals; allowed: one or more; name registers to record")
    part = part_of(path)
    with writing(path):
        with part.open("w", encoding="ascii", newline="\n") as stream:
            _write(waveforms, stream)
        part.replace(path)


def _write(waveforms: Waveforms, stream: Any) -> None:
    scale, timescale = _coarsest(waveforms)
    # An empty date is left out; the default would be the time of day.
    writer = VCDWriter(stream, timescale, date="", init_timestamp=waveforms.begin // scale)
    top = _scope_name(waveforms.title)
    variables: list[Any] = []
    for signal in waveforms.signals:
        *blocks, name = signal.name.split(".")
        kind = VarType.real if signal.is_float else _integer_kind(signal)
        first = signal.values[0].item()
        variables.append(writer.register_var((top, *blocks), name, kind, size=signal.bits, init=first))
    for time, index, value in _merged(waveforms.signals):
        writer.change(variables[index], time // scale, value)
    writer.close(waveforms.end // scale)


def _integer_kind(signal: Waveform) -> VarType:
    if signal.bits == 1:
        return VarType.wire
    return VarType.integer if signal.signed else VarType.reg


def _merged(signals: tuple[Waveform, ...]) -> Iterable[tuple[int, int, int | float]]:
    """Changes after the first of all signals in order of time: moment [ps], number of the signal, value."""
    times = np.concatenate([signal.times[1:] for signal in signals])
    owner = np.repeat(np.arange(len(signals)), [len(signal.times) - 1 for signal in signals])
    # Lists, not one array of all values: that would turn the integers into floats.
    values = [value for signal in signals for value in signal.values[1:].tolist()]
    for row in np.argsort(times, kind="stable").tolist():
        yield int(times[row]), int(owner[row]), values[row]


def _coarsest(waveforms: Waveforms) -> tuple[int, Timescale]:
    """Coarsest timescale that divides every moment, with its length [ps]."""
    common = math.gcd(waveforms.begin, waveforms.end, *(int(np.gcd.reduce(s.times)) for s in waveforms.signals))
    return next(
        (magnitude * UNIT_PS[unit], Timescale(magnitude, unit))
        for magnitude, unit in WRITTEN
        if common % (magnitude * UNIT_PS[unit]) == 0
    )


def _scope_name(title: str) -> str:
    """Turn a title into a name that every viewer takes: letters, digits and underscores."""
    name = re.sub(r"[^A-Za-z0-9_]+", "_", title).strip("_") or DEFAULT_TITLE
    return "_" + name if name[0].isdigit() else name


def load_vcd(path: str | Path) -> Waveforms:
    """Read a VCD file in which every signal has a defined value from the beginning, as detent writes it."""
    path = Path(path)
    if not path.is_file():
        raise InputError.of_file(str(path), "no such file", "a VCD file", "check the name and the folder")
    reading = _Reading(str(path))
    try:
        with path.open("rb") as stream:
            for token in tokenize(stream):
                reading.take(token)
        return reading.result()
    except InputError:
        raise
    except VCDParseError as error:
        came = str(error).partition(": ")[2]
        raise InputError([_problem(str(path), error.loc, came, "a VCD file")]) from error
    except (OSError, ValueError, OverflowError, DetentError) as error:
        raise InputError.of_file(str(path), " ".join(str(error).split()), "a VCD file", _REMEDY) from error


def _problem(path: str, place: Location, came: str, allowed: str) -> FileProblem:
    # pyvcd counts the line break as the first column of a line; only the first line has none before it.
    column = max(place.column - (place.line > 1), 1)
    return FileProblem(path, place.line, column, "", came, allowed, _REMEDY)


@dataclass
class _Changes:
    """What one identifier of the file did: moments in units of the timescale, values."""

    declared: VarDecl
    times: list[int] = field(default_factory=list[int])
    values: list[int | float] = field(default_factory=list[int | float])

    def add(self, time: int, value: float) -> None:
        """Note a change; of several at one moment the last holds."""
        if self.times and self.times[-1] == time:
            self.values[-1] = value
        elif not self.values or value != self.values[-1]:
            self.times.append(time)
            self.values.append(value)


class _Reading:
    """A file, token by token."""

    def __init__(self, path: str) -> None:
        self._path = path
        self._unit_ps = 0
        self._scopes: list[str] = []
        self._names: list[tuple[tuple[str, ...], str]] = []
        self._changes: dict[str, _Changes] = {}
        self._time = 0
        self._first: int | None = None
        self._declaring = True

    def take(self, token: Token) -> None:
        """Take the next token."""
        kind = token.kind
        if kind is TokenKind.CHANGE_TIME:
            self._advance(token)
        elif kind is TokenKind.CHANGE_SCALAR or kind is TokenKind.CHANGE_VECTOR or kind is TokenKind.CHANGE_REAL:
            self._change(token)
        elif kind is TokenKind.SCOPE:
            self._scopes.append(token.scope.ident)
        elif kind is TokenKind.UPSCOPE:
            del self._scopes[-1:]
        elif kind is TokenKind.VAR:
            self._declare(token)
        elif kind is TokenKind.TIMESCALE:
            self._unit_ps = token.timescale.magnitude * UNIT_PS.get(token.timescale.unit, 0)
            if not self._unit_ps:
                raise self._problem(token, f"a timescale of {token.timescale}", "1 ps or coarser")
        elif kind is TokenKind.ENDDEFINITIONS:
            self._declaring = False
        elif kind is TokenKind.CHANGE_STRING:
            raise self._problem(token, f"the string {token.string_change.value!r}", "levels, words and reals")

    def _problem(self, token: Token, came: str, allowed: str) -> InputError:
        return InputError([_problem(self._path, token.span.start, came, allowed)])

    def _declare(self, token: Token) -> None:
        var = token.var
        if var.type_ in UNREAD or not (1 <= var.size <= MAX_BITS or var.type_ in REALS):
            raise self._problem(
                token, f"a {var.type_} of {var.size} bits ({var.ref_str})", f"words of 1 to {MAX_BITS} bits, and reals"
            )
        self._names.append((tuple(filter(None, (*self._scopes, var.ref_str))), var.id_code))
        self._changes.setdefault(var.id_code, _Changes(var))

    def _advance(self, token: Token) -> None:
        if self._first is not None and token.time_change < self._time:
            raise self._problem(token, f"time {token.time_change} after {self._time}", "rising times")
        self._time = token.time_change
        if self._first is None:
            self._first = self._time

    def _change(self, token: Token) -> None:
        data: Any = token.data
        changes = self._changes.get(data.id_code)
        if changes is None:
            raise self._problem(token, f"a change of {data.id_code!r}", "signals that were declared before")
        value = data.value
        if token.kind is TokenKind.CHANGE_REAL:
            changes.add(self._time, value)
            return
        if token.kind is TokenKind.CHANGE_SCALAR and value in "01":
            value = int(value)
        if isinstance(value, str):
            raise self._problem(token, f"the level {value!r} of {changes.declared.ref_str}", "0 and 1")
        size = changes.declared.size
        if changes.declared.type_ in SIGNED and value >> (size - 1):
            value -= 1 << size
        changes.add(self._time, value)

    def result(self) -> Waveforms:
        """Everything that was read."""
        if self._declaring:
            raise InputError.of_file(self._path, "no $enddefinitions", "a VCD file", _REMEDY)
        if not self._unit_ps:
            raise InputError.of_file(self._path, "no $timescale", "a VCD file that states its unit of time", _REMEDY)
        tops = {path[0] for path, _ in self._names}
        top = tops.pop() if len(tops) == 1 and all(len(path) > 1 for path, _ in self._names) else ""
        signals = tuple(
            self._waveform(".".join(path[1:] if top else path), self._changes[code]) for path, code in self._names
        )
        # Other programs may end with a change: then it is shown for one unit of time.
        last = max((changes.times[-1] for changes in self._changes.values()), default=0)
        end = max(self._time, last + 1)
        return Waveforms(
            (self._first or 0) * self._unit_ps, end * self._unit_ps, signals, "" if top == DEFAULT_TITLE else top
        )

    def _waveform(self, name: str, changes: _Changes) -> Waveform:
        if not changes.times or changes.times[0] != self._first:
            raise InputError.of_file(
                self._path, f"no value of {name} at the beginning", "a value of every signal from the start", _REMEDY
            )
        is_float = changes.declared.type_ in REALS
        return Waveform(
            name=name,
            bits=MAX_BITS if is_float else changes.declared.size,
            signed=is_float or changes.declared.type_ in SIGNED,
            is_float=is_float,
            unit="",
            doc="",
            times=np.array([time * self._unit_ps for time in changes.times], dtype=np.int64),
            values=np.array(changes.values, dtype=np.float64 if is_float else np.int64),
        )
