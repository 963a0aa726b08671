"""What the ring of the loop shows: a row a period, fixed columns of the operation and eight channels of any registers.

The loop writes a row and then counts it; it never waits for a reader. A reader copies rows, then looks at the count
again: what the loop may have overwritten meanwhile is dropped, and how much was missed is said.
"""

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from detent.errors import DetentError
from detent.kernel.registers import Leaf, Registers
from detent.operate.loop import Board
from detent.record.recorder import byte_places, choose_leaves

ROWS = 8192  # of the ring at least, 8 s at 1 kHz
HELD = 6.0  # time that the ring holds at least [s]
CHANNELS = 8
SPARE = 64  # rows behind the loop's that a reader leaves alone: it may be writing them
SHOWN = (
    "loop.periods", "operation.answer.position", "operation.answer.velocity", "operation.answer.commanded",
    "operation.answer.error", "operation.answer.effort", "operation.state", "operation.fault",
)  # fmt: skip
_FIXED: list[Leaf] = choose_leaves(Board, SHOWN)


class Rows(NamedTuple):
    """Columns of the ring, from row `first` on; `missed` rows before it are gone."""

    first: int
    missed: int
    columns: tuple[NDArray[Any], ...]


class Scope:
    """Columns of a ring, and what is read of it."""

    def __init__(self, board: Any, registers: type[Registers], channels: Sequence[str] = ()) -> None:
        self._board, self._registers = board, registers
        self.of_board = byte_places(_FIXED)
        self.of_axis = np.zeros(8 * CHANNELS, np.int64)
        self.size = max(ROWS, math.ceil(HELD * 1e9 / board.loop.period))
        self.ring = np.zeros((self.size, len(self.of_board) + len(self.of_axis)), np.uint8)
        self._places: list[Leaf | None] = [None] * CHANNELS
        self._since = [0] * CHANNELS  # first row that holds what stands in a place
        self._wanted: dict[int, list[Leaf]] = {}  # registers of the axis, by who watches them
        self.show(channels)

    def show(self, channels: Iterable[str], who: int = 0) -> None:
        """Choose what somebody watches: fixed columns, and registers of the axis by their paths, eight among all."""
        asked = dict.fromkeys(path for path in channels if path not in SHOWN)
        leaves = [choose_leaves(self._registers, (path,))[0] for path in asked]
        others = {leaf.path for w, held in self._wanted.items() if w != who for leaf in held}
        wanted = others | {leaf.path for leaf in leaves}
        if len(wanted) > CHANNELS:
            taken = f", of which others watch {', '.join(sorted(others))}" if others else ""
            raise DetentError(
                f"{len(wanted)} registers of the axis, must be {CHANNELS} or fewer{taken}; leave some out"
            )
        self._wanted[who] = leaves
        held = {leaf.path for leaf in self._places if leaf is not None}
        for k, leaf in enumerate(self._places):
            if leaf is not None and leaf.path not in wanted:
                self._places[k] = None
        for leaf in leaves:
            if leaf.path not in held:
                self._put(self._places.index(None), leaf)

    def leave(self, who: int) -> None:
        """Watch no longer."""
        self.show((), who)
        self._wanted.pop(who, None)

    def _put(self, k: int, leaf: Leaf) -> None:
        places = leaf.offset + np.arange(8)
        self.of_axis[8 * k : 8 * k + 8] = np.where(np.arange(8) < leaf.width.size, places, leaf.offset)
        self._places[k], self._since[k] = leaf, self._written + 1  # the row that is being written may be torn

    @property
    def _written(self) -> int:
        return int(self._board.loop.rows)

    @property
    def row(self) -> Any:
        """Layout of a row."""
        leaves, offset, held = [*_FIXED], 0, list[tuple[str, str, int]]()
        for leaf in leaves:
            held.append((leaf.path, "<" + leaf.width.code, offset))
            offset += leaf.width.size
        for k, leaf in enumerate(self._places):
            if leaf is not None:
                held.append((leaf.path, "<" + leaf.width.code, offset + 8 * k))
        names, formats, offsets = zip(*held, strict=True)
        return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": self.ring.shape[1]})

    def begin(self, channels: Iterable[str]) -> int:
        """First row that holds all of these."""
        paths = set(channels)
        places = zip(self._places, self._since, strict=True)
        return max((since for leaf, since in places if leaf is not None and leaf.path in paths), default=0)

    def rows(self, after: int, channels: Iterable[str] | None = None) -> tuple[NDArray[Any], int, int]:
        """Rows from number `after` on: these, the number of the next one, and how many were missed.

        They begin where the ring holds the channels asked for, or all that are watched.
        """
        row, written = self.row, self._written
        begin = self.begin(row.names if channels is None else channels)
        first = min(max(after, written - self.size + SPARE, begin), written)
        copied = self.ring[np.arange(first, written) % self.size]
        lowest = self._written - self.size + 1  # the loop may be writing this one by now
        kept = copied[max(0, lowest - first) :]
        return kept.view(row)[:, 0], written, max(first, lowest) - after

    def columns(self, after: int, channels: Sequence[str], most: int) -> Rows:
        """The oldest `most` rows from number `after` on, of some columns."""
        rows, following, missed = self.rows(after, channels)
        return Rows(following - len(rows), missed, tuple(rows[name][:most] for name in channels))
