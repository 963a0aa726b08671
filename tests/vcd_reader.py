"""A VCD file back as waveforms, token by token of pyvcd, for tests of what detent writes."""

from pathlib import Path

import numpy as np
from vcd.common import TimescaleUnit, VarType
from vcd.reader import TokenKind, VarDecl, tokenize

from detent.record.waveforms import DEFAULT_TITLE, Waveform, Waveforms

UNIT_PS = {TimescaleUnit.picosecond: 1, TimescaleUnit.nanosecond: 10**3, TimescaleUnit.microsecond: 10**6}


def load_vcd(path: Path) -> Waveforms:
    """Every variable of a file whose scopes lie in one that carries the title."""
    unit, scopes, now, moments = 0, [], 0, []
    declared: dict[str, tuple[str, VarDecl]] = {}
    changes: dict[str, list[tuple[int, int | float]]] = {}
    with path.open("rb") as stream:
        for token in tokenize(stream):
            if token.kind is TokenKind.TIMESCALE:
                unit = token.timescale.magnitude * UNIT_PS[token.timescale.unit]
            elif token.kind is TokenKind.SCOPE:
                scopes.append(token.scope.ident)
                title = scopes[0]
            elif token.kind is TokenKind.UPSCOPE:
                scopes.pop()
            elif token.kind is TokenKind.VAR:
                declared[token.var.id_code] = ".".join((*scopes[1:], token.var.reference)), token.var
                changes[token.var.id_code] = []
            elif token.kind is TokenKind.CHANGE_TIME:
                now = token.time_change * unit
                moments.append(now)
            elif isinstance(token.data, tuple) and hasattr(token.data, "id_code"):
                changes[token.data.id_code].append((now, token.data.value))
    signals = tuple(_waveform(*declared[code], changes[code]) for code in declared)
    return Waveforms(moments[0], moments[-1], signals, "" if title == DEFAULT_TITLE else title)


def _waveform(name: str, var: VarDecl, changes: list[tuple[int, int | float]]) -> Waveform:
    is_float, signed = var.type_ is VarType.real, var.type_ is VarType.integer
    values = [value if is_float else int(value) for _, value in changes]
    if signed:
        values = [value - (1 << var.size) if value >> (var.size - 1) else value for value in values]
    return Waveform(
        name=name,
        bits=64 if is_float else var.size,
        signed=is_float or signed,
        is_float=is_float,
        unit="",
        doc="",
        times=np.array([time for time, _ in changes], dtype=np.int64),
        values=np.array(values, dtype=np.float64 if is_float else np.int64),
    )
