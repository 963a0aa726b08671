"""A control unit alone, told what the vectors of a job say: the steps of Python, without the rest of the axis."""

import ctypes
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np

from detent.export.unit import LARGE, ControlUnit, arguments, signal_widths
from detent.export.vectors import CALL, CHECK, END, EXCHANGE, FORMATS, SIGNAL, TICKS, WRITE
from detent.kernel.image import add_bytes, begin_hash
from detent.kernel.registers import Leaf, Registers


class Alone:
    """Controller and lines, and whoever calls the steps in the place of machine and host."""

    def __init__(self, unit: ControlUnit, params: Registers) -> None:
        self.unit, self.files = unit, {"p": params.copy(), "c": unit.controller(), "l": unit.lines()}
        self.roots = {unit.params: "p", unit.controller: "c", unit.lines: "l"}
        (_, self.tick), *actions = unit.entries.items()
        self.actions = [step for _, step in actions]
        self.widths = list(signal_widths(self.tick))
        self.signals: list[Any] = [(width.ctype * 0)() for width in self.widths]
        self.h, self.ticks, self.first = begin_hash(), 0, 0  # the first tick behind which the hash was another
        small = {root: [leaf for leaf in unit.leaves if leaf.path[0] == root and leaf.length <= LARGE] for root in "cl"}
        self.picks = {root: np.concatenate([np.arange(one.offset, one.offset + size(one)) for one in leaves])
                      for root, leaves in small.items()}  # fmt: skip

    def bytes_of(self, leaf: Leaf) -> bytes:
        """A register."""
        return bytes(self.files[leaf.path[0]])[leaf.offset : leaf.offset + size(leaf)]

    def put(self, root: str, offset: int, data: bytes) -> None:
        """Write into the memory of one of the files."""
        ctypes.memmove(ctypes.addressof(self.files[root]) + offset, data, len(data))

    def run(self, step: Any, numbers: Iterator[Any]) -> None:
        """Call a step on these files, with these numbers."""
        signals = iter(self.signals)
        codes = arguments(step, self.roots)
        step(*(self.files[c] if c in self.files else next(signals) if c == "signal" else next(numbers) for c in codes))

    def pass_ticks(self, low: bytes) -> None:
        """Ticks, and the low byte of the hash that is wanted behind each."""
        for wanted in low:
            self.run(self.tick, iter(()))
            self.ticks += 1
            for root in "cl":
                memory = np.frombuffer(bytes(self.files[root]), np.uint8)
                add_bytes(self.h, memory[self.picks[root]].tobytes())
            if self.h.value & 0xFF != wanted and not self.first:
                self.first = self.ticks


def size(leaf: Leaf) -> int:
    """Bytes of a register."""
    return leaf.width.size * max(leaf.length, 1)


def replayed(unit: ControlUnit, params: Registers, data: bytes) -> Iterator[tuple[Alone, list[str]]]:
    """The unit alone at each check of the vectors, and its registers that are other than they say."""
    one, at, calls = Alone(unit, params), 9, list(unit.calls.values())
    while data[at] != END:
        kind, at = data[at], at + 1
        if kind == WRITE:
            number, element = struct.unpack_from("<HH", data, at)
            leaf = unit.leaves[number]
            width = leaf.width.size
            one.put(leaf.path[0], leaf.offset + element * width, data[at + 4 : at + 4 + width])
            at += 12
        elif kind == TICKS:
            (n,) = struct.unpack_from("<H", data, at)
            one.pass_ticks(data[at + 2 : at + 2 + n])
            at += 2 + n
        elif kind == CHECK:
            (wanted,), at = struct.unpack_from("<Q", data, at), at + 8
            add_bytes(one.h, b"".join(one.bytes_of(leaf) for leaf in unit.leaves if leaf.length > LARGE))
            wrong = [] if one.h.number == wanted and not one.first else [f"hash from tick {one.first}"]
            for leaf in unit.leaves:
                wrong += [leaf.path] if one.bytes_of(leaf) != data[at : at + size(leaf)] else []
                at += size(leaf)
            yield one, wrong
        elif kind == SIGNAL:
            number, length = struct.unpack_from("<BI", data, at)
            width = one.widths[number]
            one.signals[number] = (width.ctype * length).from_buffer_copy(data[at + 5 : at + 5 + length * width.size])
            at += 5 + length * width.size
        elif kind == CALL:
            widths = [code for code in calls[data[at]] if code in FORMATS]
            numbers = struct.unpack_from("<" + "".join(FORMATS[code] for code in widths), data, at + 1)
            one.run(one.actions[data[at]], iter(numbers))
            at += 1 + sum(int(code[1:]) for code in widths)
        else:
            assert kind == EXCHANGE
            (n,) = struct.unpack_from("<H", data, at)
            leaves = list(unit.params.leaves())
            for k in range(n):
                number, element = struct.unpack_from("<HH", data, at + 2 + 12 * k)
                leaf, place = leaves[number], at + 6 + 12 * k
                one.put("p", leaf.offset + element * leaf.width.size, data[place : place + leaf.width.size])
            at += 2 + 12 * n
