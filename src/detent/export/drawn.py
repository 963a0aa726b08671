"""Random vectors: each function on random register files, and a controller that is told whatever comes.

Both sides draw from the same stream (`kernel.draws`), so that the file holds hashes alone. It is little endian: "DTNR",
version (1 byte), layout hash (4); then records, a byte that says which:

| record | follows | meaning |
|---|---|---|
| 1 function | number (2), calls (4) | registers at 0, the stream begins anew |
| 2 misuse | ticks (4) | the same, and power-on |
| 3 stretch | n (2), n bytes, hash (8) | of each call or tick the low byte of the hash after it; the hash after all n |
| 0 end | hash of all bytes up to here (8) | |

Of a call the hash takes its result, and the image of all registers; of a tick the image, and the larger arrays at the
end of each stretch. Integers of 64 bits stay below 2^30: numba takes for granted that none of 64 bits overflows, so
that only plain steps and C agree about what does. Floats are whole parts of 1/4096 up to 8192: the double sums of
gcc's library for Cortex-M4 without a double FPU are 1 ulp off for some operands more than 2^32 apart (measured: 2^40
less 162.31168675422668), where those of M0, M7, RV32 and this computer are right.
"""

import ctypes
import math
import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.export.unit import LARGE, ControlUnit
from detent.kernel.compiled import bits_of
from detent.kernel.draws import Draws, Ends, Places, add_image, draw, draw_into, draw_real, draw_whole, misuse
from detent.kernel.image import WHOLE, add_bytes, begin_hash
from detent.kernel.loop import HostArray
from detent.kernel.registers import PLANT, Registers, Width
from detent.kernel.single import Single
from detent.translate.program import Function, Program
from detent.translate.values import Shape, Value, interval_of

MAGIC, VERSION = b"DTNR", 1
END, FUNCTION, MISUSE, STRETCH = range(4)
CALLS, TICKS = 100, 200  # in a stretch
FILES, ROUNDS = 1000, 1_000_000  # register files of each function, and ticks of misuse, unless told otherwise
PLACES = 16  # entries of a signal at most
FAR = float(1 << 13)  # magnitude of the largest float without a range
WIDE = 1 << 30  # magnitude of the largest integer of 64 bits
NO_NUMBERS = {"f8": 0x7FF8 << 48, "f4": 0x7FC0 << 16}  # bits of what is none, whatever a processor makes of it
SEED = 1
ROOTS = ("p", "c", "l")
AS_DECLARED = Shape()  # lengths and ranges are those of the declarations


@dataclass(frozen=True)
class Row:
    """A register as it is drawn."""

    root: str
    path: str
    offset: int
    width: Width
    length: int
    lo: int
    hi: int
    low: float
    high: float
    given: float

    @property
    def span(self) -> int:
        """How many integers it may be."""
        return self.hi - self.lo + 1


def rows_of(  # noqa: PLR0913 - it calls itself for blocks
    registers: Registers,
    root: str,
    options: Any,
    shape: Shape = AS_DECLARED,
    prefix: str = "",
    offset: int = 0,
    by: str = "",
) -> Iterator[tuple[Row, str]]:
    """Every register that is in the structure in C, with who writes it."""
    for declared in type(registers).__fields__.values():
        field = shape.seen(type(registers), declared)
        path, place, writer = prefix + field.name, offset + field.offset, field.by or by
        value = getattr(registers, field.name)
        if field.block is not None:
            yield from rows_of(value, root, options, shape, f"{path}.", place, writer)
        elif field.width is not None and (type(registers), field.name) not in options:
            lo, hi = (0, 0) if field.width.is_float else drawn_from(*interval_of(field.width))
            low, high = field.range or (-FAR, FAR)
            if field.range is not None and not field.width.is_float:
                lo, hi = max(lo, int(low)), min(hi, int(high))
            given = 0.0 if field.length or not field.width.is_float else float(value)
            row = Row(root, path, place, field.width, field.length, lo, hi, float(low), float(high), given)
            yield row, writer


def drawn_from(lo: int, hi: int) -> tuple[int, int]:
    """An interval, without what would go beyond 64 bits."""
    return (max(lo, -WIDE), min(hi, WIDE)) if hi - lo >= 1 << 32 else (lo, hi)


def arrays(rows: Sequence[Row]) -> tuple[Places, Ends]:
    """Rows as the steps take them."""
    places = [(r.offset, r.width.size, r.length, int(r.width.is_float), r.lo, r.hi, r.span) for r in rows]
    ends = [(r.low, r.high, r.given) for r in rows]
    return np.array(places, np.int64).reshape(-1, 7), np.array(ends, np.float64).reshape(-1, 3)


def _float_places(rows: Sequence[Row], code: str) -> NDArray[np.int64]:
    """Where floats of a width stand, counted in such floats."""
    of_width = [row for row in rows if row.width.code == code]
    found = [row.offset // row.width.size + k for row in of_width for k in range(max(row.length, 1))]
    return np.array(found, np.int64)


def blocks_in(registers: type[Registers], root: str, path: str = "") -> Iterator[tuple[type[Registers], str, str]]:
    """A register file and all blocks in it: class, root and path."""
    yield registers, root, path
    for field in registers.__fields__.values():
        if field.block is not None:
            yield from blocks_in(field.block, root, f"{path}.{field.name}" if path else field.name)


class Chance:
    """A unit of which everything is drawn; the C that `code.drawn_text` writes does the same in the same order."""

    def __init__(self, unit: ControlUnit, program: Program, params: Registers) -> None:
        self.unit, self.program, self.given = unit, program, params
        self.files: dict[str, Any] = {"p": params.copy(), "c": unit.controller(), "l": unit.lines()}
        elsewhere = program.options.keys() | program.shape.tables.keys()
        drawn = {root: list(rows_of(one, root, elsewhere, unit.shape)) for root, one in self.files.items()}
        self.rows = {root: [row for row, _ in found] for root, found in drawn.items()}
        self.wires = [row for row, by in drawn["l"] if by == PLANT and row.length <= LARGE]
        self._arrays = {root: arrays(rows) for root, rows in self.rows.items()}
        self.places: dict[type[Registers], list[tuple[str, str]]] = {}
        for cls, root in ((unit.params, "p"), (unit.controller, "c"), (unit.lines, "l")):
            for one, at, path in blocks_in(cls, root):
                self.places.setdefault(one, []).append((at, path))
        self.actions = [program.steps[_plain(one)] for one in list(unit.entries.values())[1:]]
        tick = program.steps[_plain(next(iter(unit.entries.values())))]
        self.tick = tick
        self.signals = [value for value in tick.names.values() if value is not None and value.kind == "signal"]
        self._picks = {(root, large): self._bytes_of(root, large) for root in ("c", "l") for large in (False, True)}
        self._floats = [
            (np.frombuffer(self.files[root], code, ctypes.sizeof(self.files[root]) // int(code[1])), places)
            for root, rows in self.rows.items()
            for code in NO_NUMBERS
            for places in [_float_places(rows, code)]
            if root != "p" and len(places)
        ]
        self.d, self.h = Draws(), begin_hash()
        self.told: list[Any] = []  # arguments of the last call

    def _bytes_of(self, root: str, large: bool) -> Any:  # noqa: FBT001 - as of `Golden`
        found = [leaf for leaf in self.unit.leaves if leaf.path[0] == root and (leaf.length > LARGE) == large]
        ranges = [np.arange(leaf.offset, leaf.offset + leaf.width.size * max(leaf.length, 1)) for leaf in found]
        return np.concatenate(ranges).astype(np.int64) if ranges else np.zeros(0, np.int64)

    def begin(self, number: int) -> None:
        """Registers at 0, parameters of the axis, the stream of this number."""
        for root, size in ((root, ctypes.sizeof(self.files[root])) for root in ("c", "l")):
            ctypes.memset(ctypes.addressof(self.files[root]), 0, size)
        self.files["p"].restore(bytes(self.given))
        seeded: Any = Draws()
        seeded.state = (SEED << 32) + number
        self.d, self.h = seeded, begin_hash()
        draw(self.d)

    def add(self, *, large: bool) -> None:
        """The images to the hash."""
        for root in ("c", "l"):
            add_image(self.h, self.files[root], self._picks[root, large])

    # ---- calls

    def _argument(self, value: Value) -> Any:
        """One argument, drawn."""
        if value.kind == "file" and value.registers is not None:
            places = self.places[value.registers]
            folded = self.program.is_folded(value.registers)  # no part of the C: nothing is drawn for it
            root, path = places[0 if folded else draw(self.d) % len(places)]
            return attrgetter(path)(self.files[root]) if path else self.files[root]
        if value.kind == "signal":
            return self.lay(value)
        if value.kind == "bool":
            return draw(self.d) & 1 == 1
        if value.kind == "float":
            drawn = draw_real(self.d, -FAR, FAR, 0.0)
            return Single(drawn) if value.is_single else drawn
        lo, hi = drawn_from(value.lo, value.hi)
        return draw_whole(self.d, lo, hi, hi - lo + 1)

    def lay(self, value: Value) -> HostArray:
        """A signal of some entries."""
        length = draw(self.d) % (PLACES + 1)
        width: Any = value.width
        lo, hi = (0, 0) if width.is_float else interval_of(width)
        laid = [
            draw_real(self.d, -1000.0, 1000.0, 0.0) if width.is_float else draw_whole(self.d, lo, hi, hi - lo + 1)
            for _ in range(length)
        ]
        return (width.ctype * length)(*laid)

    def call(self, f: Function) -> int:
        """Call a step with arguments that are drawn; the bits of its result."""
        self.told = [self._argument(f.names[name]) for name in f.parameters]  # pyright: ignore[reportArgumentType] - all known
        # A block cannot leave a compiled step; the plain one is the same, and calls compiled ones.
        step = f.py if f.result_kind == "file" else getattr(import_module(f.py.__module__), f.py.__name__)
        result = step(*self.told)
        if result is None or isinstance(result, Registers):
            return 0
        if isinstance(result, float):
            return NO_NUMBERS["f8"] if math.isnan(result) else bits_of(float(result))
        return int(result)

    def tidy(self) -> None:
        """Give every register that is no number the same bits: processors differ in those."""
        for floats, places in self._floats:
            if np.isnan(floats[places]).any():
                bits, those = floats.view(f"i{floats.itemsize}"), places[np.isnan(floats[places])]
                bits[those] = NO_NUMBERS[f"f{floats.itemsize}"]

    def calls(self, number: int, most: int) -> Iterator[int]:
        """Call a function again and again; after each call the hash."""
        self.begin(number)
        f = self.program.order[number]
        for _ in range(most):
            w = draw(self.d)
            self.files["p"].restore(bytes(self.given))
            if w & 3:
                draw_into(self.d, self.files["p"], *self._arrays["p"], (0, 0, 1, 7)[w & 3])
            draw_into(self.d, self.files["c"], *self._arrays["c"], w >> 2 & 3)
            draw_into(self.d, self.files["l"], *self._arrays["l"], w >> 4 & 3)
            add_bytes(self.h, struct.pack("<Q", self.call(f) & WHOLE))
            self.tidy()
            self.add(large=False)
            self.add(large=True)
            yield self.h.number

    # ---- misuse

    def ticks(self, most: int) -> Iterator[tuple[bytes, int]]:
        """Ticks of a controller that is told whatever comes: of each stretch the low bytes, and the hash."""
        self.begin(len(self.program.order))
        for begun in range(0, most, TICKS):
            w = draw(self.d)
            if begun == 0 or w >> 4 & 7 == 0:
                for root in ("c", "l"):
                    ctypes.memset(ctypes.addressof(self.files[root]), 0, ctypes.sizeof(self.files[root]))
                self.call(self.actions[0])
            for _ in range(w >> 8 & 3):
                self.call(self.actions[draw(self.d) % len(self.actions)])
            feed = [self.lay(value) for value in self.signals]
            low = np.zeros(min(TICKS, most - begun), np.uint8)
            misuse(
                self.d, self.files["p"], self.files["c"], self.files["l"], *arrays(self.wires),
                self._picks["c", False], self._picks["l", False], self.h, low, 1 if w & 3 else 0, *feed,
            )  # fmt: skip
            self.add(large=True)
            yield low.tobytes(), self.h.number

    # ---- a moment

    def run(self, number: int, at: int) -> None:
        """Go to what is after a call, or after a tick for the number behind that of the last function; from 1."""
        if number < len(self.program.order):
            for _ in self.calls(number, at):
                pass
        else:
            for _ in self.ticks(at):
                pass

    def bits(self, row: Row, k: int) -> int:
        """Of an element of a register, as an unsigned number."""
        at = row.offset + k * row.width.size
        return int.from_bytes(bytes(self.files[row.root])[at : at + row.width.size], "little")


def _plain(entry: Callable[..., Any]) -> Callable[..., Any]:
    return getattr(entry, "py_func", entry)


def drawn_vectors(chance: Chance, files: int, rounds: int) -> bytes:
    """The file: `files` register files for each function, `rounds` ticks of misuse."""
    parts = [MAGIC + struct.pack("<BI", VERSION, chance.unit.layout_hash)]
    for number in range(len(chance.program.order) if files else 0):
        parts.append(struct.pack("<BHI", FUNCTION, number, files))
        hashes = list(chance.calls(number, files))
        for k in range(0, files, CALLS):
            part = hashes[k : k + CALLS]
            low = bytes(one & 0xFF for one in part)
            parts.append(struct.pack("<BH", STRETCH, len(part)) + low + struct.pack("<Q", part[-1]))
    if rounds:
        parts.append(struct.pack("<BI", MISUSE, rounds))
        for low, value in chance.ticks(rounds):
            parts.append(struct.pack("<BH", STRETCH, len(low)) + low + struct.pack("<Q", value))
    data, over_all = b"".join([*parts, bytes([END])]), begin_hash()
    add_bytes(over_all, data)
    return data + struct.pack("<Q", over_all.number)
