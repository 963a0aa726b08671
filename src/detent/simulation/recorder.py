"""Records registers while an axis advances, into memory or into a file of any length."""

from collections.abc import Callable, Iterable, Sequence
from difflib import get_close_matches
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.errors import DetentError
from detent.kernel.registers import Leaf, Registers
from detent.simulation.trace import Trace

ROWS = 16384
"""Rows between two flushes."""

Sink = Callable[[NDArray[np.void]], None]


def choose_leaves(registers: type[Registers], names: Iterable[str]) -> list[Leaf]:
    """Leaves of the named registers; a trailing ``.*`` takes a whole block, ``all`` everything but arrays.

    Raises
    ------
    DetentError
        A name is no register; the message names the nearest.
    """
    leaves = {leaf.path: leaf for leaf in registers.leaves() if not leaf.length}
    chosen: dict[str, Leaf] = {}
    for name in names:
        if name == "all":
            found = list(leaves.values())
        elif name.endswith(".*"):
            found = [leaf for path, leaf in leaves.items() if path.startswith(name[:-1])]
        else:
            found = [leaves[name]] if name in leaves else []
        if not found:
            near = get_close_matches(name, leaves, 1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise DetentError(f"signal {name!r}: no such register of {registers.__name__}{hint}; 'all' records every one")
        chosen.update((leaf.path, leaf) for leaf in found)
    return list(chosen.values())


class Recorder:
    """Rows of chosen registers at every n-th tick.

    Parameters
    ----------
    registers : type of Registers
        Class of the recorded state; its leaf ``tick`` gives the time.
    names : sequence of str
        Registers to record, see `choose_leaves`.
    every : int
        Ticks between two rows.
    period : float
        Time of one tick [s].
    sink : callable, optional
        Takes each block of rows (structured array with ``t`` [s] first); without it blocks stay in memory for `trace`.
    """

    def __init__(
        self, registers: type[Registers], names: Sequence[str], *, every: int, period: float, sink: Sink | None = None
    ) -> None:
        self.leaves = [leaf for leaf in choose_leaves(registers, names) if leaf.path != "tick"]
        tick = next(leaf for leaf in registers.leaves() if leaf.path == "tick")
        picked = [tick, *self.leaves]
        self.every, self.period = every, period
        self.picks = np.concatenate([np.arange(x.offset, x.offset + x.width.size) for x in picked]).astype(np.int64)
        self._raw: Any = np.dtype([(leaf.path, "<" + leaf.width.code) for leaf in picked])
        self.rows = np.zeros((ROWS, len(self.picks)), np.uint8)
        self._blocks: list[NDArray[np.void]] = []
        self._sink = sink or self._blocks.append
        self._next_row = 1

    @property
    def dtype(self) -> Any:
        """Structured type of the rows handed to the sink."""
        return np.dtype([("t", "<f8"), *((leaf.path, "<" + leaf.width.code) for leaf in self.leaves)])

    @property
    def units(self) -> dict[str, str]:
        """Unit per column."""
        return {"t": "s"} | {leaf.path: leaf.unit for leaf in self.leaves}

    @property
    def docs(self) -> dict[str, str]:
        """Meaning per column."""
        return {"t": "simulated time since power-on"} | {leaf.path: leaf.doc for leaf in self.leaves}

    def room(self, tick: int) -> int:
        """Ticks that may still pass from `tick` before `flush` must be called."""
        return (self._next_row + ROWS - 1) * self.every - tick

    def flush(self, tick: int) -> None:
        """Hand the rows complete by `tick` to the sink."""
        last = tick // self.every
        if last < self._next_row:
            return
        index = np.arange(self._next_row, last + 1) % ROWS
        raw: Any = self.rows[index].view(self._raw)[:, 0]
        block = np.empty(len(raw), self.dtype)
        block["t"] = raw["tick"] * self.period
        for leaf in self.leaves:
            block[leaf.path] = raw[leaf.path]
        self._sink(block)
        self._next_row = last + 1

    def trace(self, **attributes: str | float | int) -> Trace:
        """What is in memory, as a trace."""
        whole = np.concatenate(self._blocks) if self._blocks else np.empty(0, self.dtype)
        columns = {name: whole[name].copy() for name in whole.dtype.names or ()}
        return Trace(columns=columns, units=self.units, docs=self.docs, attributes=attributes)
