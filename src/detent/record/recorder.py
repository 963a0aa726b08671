"""Records registers while an axis advances, into memory or into a file of any length."""

import hashlib
from collections.abc import Callable, Iterable, Sequence
from fnmatch import fnmatchcase
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.errors import DetentError
from detent.files.text import nearest
from detent.kernel.registers import Leaf, Registers
from detent.record.trace import Trace

ROWS = 16384  # rows between two flushes


def choose_leaves(registers: type[Registers], names: Iterable[str]) -> list[Leaf]:
    """Leaves of the named registers, each once, in the order asked."""
    leaves = {leaf.path: leaf for leaf in registers.leaves()}
    single = [leaf for leaf in leaves.values() if not leaf.length]
    chosen: dict[str, Leaf] = {}
    for name in names:
        pattern = "*" if name == "all" else name
        found = [leaf for leaf in single if fnmatchcase(leaf.path, pattern)]
        if not found and name in leaves:
            raise DetentError(
                f"signal {name!r}: got an array of {leaves[name].length} values; expected: a register of one value; "
                "leave it out"
            )
        if not found:
            near = nearest(name, [leaf.path for leaf in single])
            hint = f"did you mean {near!r}? " if near else ""
            raise DetentError(
                f"signal {name!r}: no such register of {registers.__name__}; {hint}`detent registers` lists them all, "
                "'all' records every one"
            )
        chosen.update((leaf.path, leaf) for leaf in found)
    return list(chosen.values())


def byte_places(leaves: Iterable[Leaf]) -> NDArray[np.int64]:
    """Where the bytes of some registers stand in the memory of all, one after the other."""
    return np.concatenate([np.arange(leaf.offset, leaf.offset + leaf.width.size) for leaf in leaves]).astype(np.int64)


class Recorder:
    """Rows of chosen registers at every n-th tick."""

    def __init__(self, registers: type[Registers], names: Sequence[str], *, every: int, period: float) -> None:
        if every < 1:
            raise DetentError(f"recording: got every {every} ticks; expected: 1 or more; choose how often to record")
        picked = choose_leaves(registers, ["tick", *names])
        self.leaves, self.picks = picked[1:], byte_places(picked)
        self.every, self.period = every, period
        self.dtype: Any = np.dtype([("t", "<f8"), *((leaf.path, "<" + leaf.width.code) for leaf in self.leaves)])
        self._raw: Any = np.dtype([(leaf.path, "<" + leaf.width.code) for leaf in picked])
        self.rows = np.zeros((ROWS, len(self.picks)), np.uint8)
        self._blocks: list[NDArray[np.void]] = []
        self._hashes = {str(name): hashlib.sha256() for name in self.dtype.names}
        self._sink: Callable[[NDArray[np.void]], object] | None = None
        self._most = 0  # rows kept beside the sink
        self._next_row = 1

    def room(self, tick: int) -> int:
        """Ticks that may still pass from `tick` before `flush` must be called."""
        return (self._next_row + ROWS - 1) * self.every - tick

    def flush(self, tick: int) -> None:
        """Take the rows complete by `tick`."""
        last = tick // self.every
        if last < self._next_row:
            return
        index = np.arange(self._next_row, last + 1) % ROWS
        raw: Any = self.rows[index].view(self._raw)[:, 0]
        block: Any = np.empty(len(raw), self.dtype)
        block["t"] = raw["tick"] * self.period
        for leaf in self.leaves:
            block[leaf.path] = raw[leaf.path]
        for name, column in self._hashes.items():
            column.update(np.ascontiguousarray(block[name]).data)
        if self._sink is not None:
            self._sink(block)
            block = block[: max(self._most - sum(map(len, self._blocks)), 0)]
        self._blocks.append(block)
        self._next_row = last + 1

    @property
    def hashes(self) -> dict[str, str]:
        """Hash of each column, of all rows so far."""
        return {name: column.hexdigest() for name, column in self._hashes.items()}

    def pass_on(self, sink: Callable[[NDArray[np.void]], object], most: int) -> None:
        """Hand rows to a sink too, and keep no more than the first so many in memory."""
        self._sink, self._most = sink, most

    def trace(self, **attributes: str | float) -> Trace:
        """What is in memory, as a trace."""
        whole: Any = np.concatenate(self._blocks) if self._blocks else np.empty(0, self.dtype)
        return Trace(
            columns={str(name): np.ascontiguousarray(whole[name]) for name in self.dtype.names},
            units={"t": "s"} | {leaf.path: leaf.unit for leaf in self.leaves},
            docs={"t": "simulated time since power-on"} | {leaf.path: leaf.doc for leaf in self.leaves},
            attributes={**attributes},
        )
