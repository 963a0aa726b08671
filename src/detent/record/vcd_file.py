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
from pathlib import Path
from typing import Any

import numpy as np
from vcd.common import Timescale, TimescaleUnit, VarType
from vcd.writer import VCDWriter

from detent.errors import DetentError
from detent.files.text import writing
from detent.record.waveforms import Waveform, Waveforms

_UNITS = ((10**6, TimescaleUnit.microsecond), (10**3, TimescaleUnit.nanosecond), (1, TimescaleUnit.picosecond))
# Timescales that a file counts in, coarsest first, with their length [ps].
SCALES = [(number * length, Timescale(number, unit)) for length, unit in _UNITS for number in (100, 10, 1)]
DEFAULT_TITLE = "detent"  # name of the outermost scope of waveforms without title


def save_vcd(waveforms: Waveforms, path: str | Path) -> None:
    """Write waveforms as a VCD file.

    The same waveforms give the same bytes. Time is counted in the coarsest of 1, 10, 100 ps, ns or µs that hits every
    change.
    """
    path = Path(path)
    if not waveforms.signals:
        raise DetentError(f"{path}: there are no signals; allowed: one or more; name registers to record")
    with writing(path) as part, part.open("w", encoding="ascii", newline="\n") as stream:
        _write(waveforms, stream)


def _write(waveforms: Waveforms, stream: Any) -> None:
    scale, timescale = _coarsest(waveforms)
    # An empty date is left out; the default would be the time of day.
    writer = VCDWriter(stream, timescale, date="", init_timestamp=waveforms.begin // scale)
    top = _scope_name(waveforms.title)
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


def _coarsest(waveforms: Waveforms) -> tuple[int, Timescale]:
    """Coarsest timescale that divides every moment, with its length [ps]."""
    common = math.gcd(waveforms.begin, waveforms.end, *(int(np.gcd.reduce(s.times)) for s in waveforms.signals))
    return next((length, scale) for length, scale in SCALES if common % length == 0)


def _scope_name(title: str) -> str:
    """Turn a title into a name that every viewer takes: letters, digits and underscores."""
    name = re.sub(r"[^A-Za-z0-9_]+", "_", title).strip("_") or DEFAULT_TITLE
    return "_" + name if name[0].isdigit() else name
