"""Golden vectors: all that a control unit is told in a simulated job, and the hash of its registers after every tick.

A file is little endian: "DTNV", version (1 byte), layout hash (4); then records, a byte that says which:

| record | follows | meaning |
|---|---|---|
| 1 write | register (2), element (2), value (8: its bits) | what the plant has written on a wire |
| 2 ticks | n (2), n bytes | n ticks; of each the low byte of the hash after it |
| 3 check | hash (8), image of all registers | every 1000th tick, and after the last one |
| 4 signal | number (1), length (4), values in their width | what the host has laid ready |
| 5 call | number (1), arguments in their widths | what the host did: `ControlUnit.calls` by number |
| 6 exchange | n (2); of n parameters number (2), element (2), value (8) | another set of parameters, by its pointer |
| 0 end | ticks (8), hash of all bytes up to here (8) | |

The state begins with all bits zero, and nothing but these calls and the wires of the plant touches it. An image is
every register in the order of declaration, controller before lines, without padding; arrays of more than 64 elements
are part of it, but enter the hash of a check only.
"""

import ctypes
import struct
from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.errors import DetentError
from detent.export.unit import LARGE, ControlUnit, outside_ranges, signal_widths
from detent.kernel.image import add_bytes, add_rows, begin_hash
from detent.kernel.loop import Bytes
from detent.kernel.registers import PLANT, Leaf, Registers
from detent.methods.changes import ParameterChange, changes_of
from detent.translate.values import RefusedError

MAGIC, VERSION = b"DTNV", 2
END, WRITE, TICKS, CHECK, SIGNAL, CALL, EXCHANGE = range(7)
FORMATS = {
    "u1": "B", "u2": "H", "u4": "I", "i1": "b", "i2": "h", "i4": "i", "i8": "q", "f4": "f", "f8": "d",
}  # fmt: skip
"""Formats of `struct` for the widths of arguments."""
STRETCH = 1000  # ticks from check to check


class EnoughError(Exception):
    """As many ticks have been recorded as were asked for; the run need not go on."""


class Golden:
    """A witness of a run: makes the vectors of its control unit."""

    def __init__(
        self, unit: ControlUnit, state: type[Registers], most: int, changes: Sequence[ParameterChange] = ()
    ) -> None:
        self._changes = changes  # of parameters, that the job will make
        self.unit, self.motor, self.most, self.ticks = unit, unit.motor, most, 0
        self.params: Any = None  # at power-on
        self.changed: set[int] = set()  # numbers of the parameters that are exchanged later
        self.hash = begin_hash()
        self.signals: list[tuple[int, int]] = []  # of each signal: its largest length, and bytes of an element
        self.parts = list[bytes]()
        self._places = {name[0]: state.__fields__[name].offset for name in ("controller", "lines")}
        self._leaves: tuple[Leaf, ...] = ()
        self._known = bytes(ctypes.sizeof(unit.controller) + ctypes.sizeof(unit.lines))
        self._set = b""  # the parameters as they are
        self._feed: tuple[bytes, ...] = ()
        self._actions = list(unit.entries.items())[1:]
        self.state: Any = None  # of the axis, as it is

    def _meet(self, params: Any) -> None:
        """The axis is there: its arrays are as long as its parameters use them."""
        if self._leaves:
            return
        later = [params.controller.copy()]
        for one in self._changes:
            later.append(later[-1].copy())
            with suppress(AttributeError, TypeError):  # a name that is none is refused where the job is begun
                one.store(later[-1])
        self.unit = unit = self.unit.fitted(params.controller, later)
        self.parts.append(MAGIC + struct.pack("<BI", VERSION, unit.layout_hash))
        self._leaves, sizes = unit.leaves, ctypes.sizeof(unit.controller)
        # Places in the memory of controller and lines, one behind the other.
        self._offsets = [leaf.offset + (sizes if leaf.path.startswith("l.") else 0) for leaf in self._leaves]
        small = [k for k, leaf in enumerate(self._leaves) if leaf.length <= LARGE]
        self.picks: NDArray[np.int64] = (
            np.concatenate([self._bytes_of(k) for k in small]) if small else np.zeros(0, int)
        )
        self._wires = [k for k, leaf in enumerate(self._leaves) if leaf.by == PLANT]
        self._inside = [k for k, leaf in enumerate(self._leaves) if leaf.by != PLANT]
        self._inputs = [k for k in small if self._leaves[k].by == PLANT]
        where = np.cumsum([0, *(_size(self._leaves[k]) for k in small)])
        self._columns = {k: slice(int(where[n]), int(where[n + 1])) for n, k in enumerate(small)}
        self.rows: Bytes = np.zeros((STRETCH, len(self.picks)), np.uint8)

    def _bytes_of(self, k: int) -> NDArray[np.int64]:
        """Places of a register in the state of the axis."""
        leaf = self._leaves[k]
        first = leaf.offset + self._places[leaf.path[0]]
        return np.arange(first, first + _size(leaf), dtype=np.int64)

    # ---- what a run tells

    def room(self) -> int:
        """Ticks up to the next check, or to the end."""
        return min(STRETCH - self.ticks % STRETCH, self.most - self.ticks)

    def begin(self, params: Any, state: Any, feed: tuple[Any, ...]) -> None:
        """Note what the host has written since the last stretch."""
        self._meet(params)
        if self.params is None:
            self.params, self._set = params.controller.copy(), bytes(params.controller)
        elif self._set != bytes(params.controller):
            raise EnoughError  # nobody has exchanged them: what comes is another run
        laid = tuple(bytes(memoryview(one).cast("B")) for one in feed)
        for number, (new, one) in enumerate(zip(laid, feed, strict=True)):
            size = ctypes.sizeof(one._type_)
            if len(self.signals) <= number:
                self.signals.append((0, size))
            self.signals[number] = (max(self.signals[number][0], len(one)), size)
            if number >= len(self._feed) or new != self._feed[number]:
                self.parts.append(struct.pack("<BBI", SIGNAL, number, len(one)) + new)
        self._feed = laid
        self._look(state)

    def exchange(self, params: Any) -> None:
        """Note another set of parameters; refused where it does not fit into the arrays."""
        self._meet(params)
        for path, value, (lo, hi) in outside_ranges(params.controller, self.unit.shape):
            got, remedy = f"a job that sets {path} = {value}", "a value of an axis file decides how long its arrays are"
            raise RefusedError("FW12", None, got, f"{lo} to {hi}, for which this unit has room", remedy)
        new, found = bytes(params.controller), list[bytes]()
        for number, leaf in enumerate(params.controller.leaves()):
            width = leaf.width.size
            for k in range(max(leaf.length, 1)):
                at = slice(leaf.offset + k * width, leaf.offset + (k + 1) * width)
                if self.params is not None and new[at] != self._set[at]:
                    found.append(struct.pack("<HH", number, k) + new[at].ljust(8, b"\0"))
                    self.changed.add(number)
        self._set = new
        if found:
            self.parts.append(struct.pack("<BH", EXCHANGE, len(found)) + b"".join(found))

    def act(self, params: Any, state: Any, action: Callable[..., Any], args: tuple[Any, ...]) -> Any:
        """Let the host act, and note the call."""
        self._meet(params)  # an action that reads them is handed them
        self._look(state)
        number, name = next((k, name) for k, (name, one) in enumerate(self._actions) if one is action)
        numbers = [one for one in args if not isinstance(one, Registers)]
        widths = [FORMATS[code] for code in self.unit.calls[name] if code in FORMATS]
        try:
            self.parts.append(struct.pack("<BB" + "".join(widths), CALL, number, *numbers))
        except struct.error as error:
            raise DetentError(
                f"{name}: got {', '.join(map(str, numbers))}; expected: numbers in the widths that its step "
                f"declares ({error}); correct the host"
            ) from error
        given = action(*args)
        self._known = self._memory()
        return given

    def _look(self, state: Any) -> None:
        """Note what stands on the wires of the plant; refuse what a host has written without an action."""
        self.state = state
        now = self._memory()
        for k in self._inside:
            at = slice(self._offsets[k], self._offsets[k] + _size(self._leaves[k]))
            if self._known[at] != now[at]:
                got = f"a job in which {self.unit.name}: {self._leaves[k].path} is written by a host from outside"
                remedy = "a job without it; or a step that writes it, in `actions` of the method, called by `act`"
                raise RefusedError("FW15", None, got, "steps of the controller alone that write there", remedy)
        for k in self._wires:
            at = slice(self._offsets[k], self._offsets[k] + _size(self._leaves[k]))
            self._write(k, self._known[at], now[at])
        self._known = now

    def take(self, ticks: int) -> None:
        """Note the ticks of a stretch: what came along the lines, and the hash after each."""
        if ticks:
            begin, state = self._known, self._memory()
            rows = self.rows[np.arange(self.state.tick - ticks + 1, self.state.tick + 1) % STRETCH]
            low = np.zeros(ticks, np.uint8)
            add_rows(self.hash, rows, low)
            self._note_ticks(rows, low, begin)
            self._known, self.ticks = state, self.ticks + ticks
            if self.ticks % STRETCH == 0:
                self._check()
        if self.ticks >= self.most:
            raise EnoughError

    def _note_ticks(self, rows: Bytes, low: Bytes, begin: bytes) -> None:
        """Inputs where they change, and the ticks between."""
        old = {k: begin[self._offsets[k] : self._offsets[k] + _size(self._leaves[k])] for k in self._inputs}
        first = {k: np.frombuffer(value, np.uint8) for k, value in old.items()}
        changed = np.zeros(len(rows), bool)
        for k in self._inputs:
            seen = np.vstack([first[k][None, :], rows[:, self._columns[k]]])
            changed |= (seen[1:] != seen[:-1]).any(axis=1)
        edges = [0, *np.flatnonzero(changed).tolist(), len(rows)]
        for begin_at, end in pairwise(edges):
            if begin_at < len(rows) and changed[begin_at]:
                for k in self._inputs:
                    new = rows[begin_at, self._columns[k]].tobytes()
                    self._write(k, old[k], new)
                    old[k] = new
            if end > begin_at:
                self.parts.append(struct.pack("<BH", TICKS, end - begin_at) + low[begin_at:end].tobytes())

    # ---- records

    def _memory(self) -> bytes:
        return bytes(self.state.controller) + bytes(self.state.lines)

    def _write(self, k: int, old: bytes, new: bytes) -> None:
        if old == new:
            return
        width = self._leaves[k].width.size
        for element in range(len(new) // width):
            part = new[element * width : (element + 1) * width]
            if part != old[element * width : (element + 1) * width]:
                self.parts.append(struct.pack("<BHH", WRITE, k, element) + part.ljust(8, b"\0"))

    def _check(self) -> None:
        parts = [self._known[o : o + _size(leaf)] for o, leaf in zip(self._offsets, self._leaves, strict=True)]
        large = b"".join(part for part, leaf in zip(parts, self._leaves, strict=True) if leaf.length > LARGE)
        if large:
            add_bytes(self.hash, large)
        self.parts.append(struct.pack("<BQ", CHECK, self.hash.number) + b"".join(parts))

    def vectors(self) -> bytes:
        """The file, once the run is over."""
        if self.ticks % STRETCH:
            self._check()
        return _ended(b"".join(self.parts), self.ticks)


def cut(unit: ControlUnit, data: bytes, most: int) -> tuple[bytes, int, str]:
    """Vectors of the first ticks, up to the last check that is not behind `most`; these ticks, and the hash there."""
    image = sum(_size(leaf) for leaf in unit.leaves)
    signals = [width.size for width in signal_widths(next(iter(unit.entries.values())))]
    calls = [sum(int(code[1:]) for code in taken if code in FORMATS) for taken in unit.calls.values()]
    place, ticks, found = len(MAGIC) + 5, 0, (b"", 0, "")
    if data[: len(MAGIC) + 5] != MAGIC + struct.pack("<BI", VERSION, unit.layout_hash):
        raise DetentError("job.vec: got vectors of other registers; expected: those of this version; export it anew")
    while data[place] != END:
        kind = data[place]
        if kind == WRITE:
            place += 13
        elif kind == TICKS:
            count = int.from_bytes(data[place + 1 : place + 3], "little")
            place, ticks = place + 3 + count, ticks + count
        elif kind == SIGNAL:
            place += 6 + int.from_bytes(data[place + 2 : place + 6], "little") * signals[data[place + 1]]
        elif kind == CALL:
            place += 2 + calls[data[place + 1]]
        else:
            told = f"{int.from_bytes(data[place + 1 : place + 9], 'little'):016x}"
            place += 9 + image
            if ticks > most:
                break
            found = _ended(data[:place], ticks), ticks, told
    return found


def _ended(data: bytes, ticks: int) -> bytes:
    """The file, from all its records but the last one."""
    data += struct.pack("<BQ", END, ticks)
    over_all = begin_hash()
    add_bytes(over_all, data)
    return data + struct.pack("<Q", over_all.number)


def _size(leaf: Leaf) -> int:
    return leaf.width.size * max(leaf.length, 1)


def record(unit: ControlUnit, axis: Any, job: Any, most: int) -> Golden:
    """Do a job, and make its vectors, of `most` ticks at most."""
    golden = Golden(unit, unit.axis, most, changes_of(job, unit.motor))
    with suppress(EnoughError):
        axis.simulated.run(job, recorder=golden)
    return golden
