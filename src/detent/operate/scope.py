"""What the ring of the loop shows: a row a period, fixed columns of the operation and eight channels of any registers.

The loop writes a row and then counts it; it never waits for a reader. A reader copies rows, then looks at the count
again: what the loop may have overwritten meanwhile is dropped, and how much was missed is said.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

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


class Scope:
    """Columns of a ring, and what is read of it."""

    def __init__(self, board: Any, registers: type[Registers], channels: Sequence[str] = ()) -> None:
        self._board, self._registers = board, registers
        self.of_board = byte_places(_FIXED)
        self.of_axis = np.zeros(8 * CHANNELS, np.int64)
        self.size = max(ROWS, math.ceil(HELD * 1e9 / board.loop.period))
        self.ring = np.zeros((self.size, len(self.of_board) + len(self.of_axis)), np.uint8)
        self.channels: list[Leaf] = []
        self.show(channels)

    def show(self, channels: Sequence[str]) -> None:
        """Choose up to eight channels, registers by their paths; the rows from now on hold them."""
        if len(channels) > CHANNELS:
            raise ValueError(f"{len(channels)} channels, must be {CHANNELS} or fewer")
        leaves = [choose_leaves(self._registers, (path,))[0] for path in channels]
        for k, leaf in enumerate(leaves):
            places = leaf.offset + np.arange(8)
            self.of_axis[8 * k : 8 * k + 8] = np.where(np.arange(8) < leaf.width.size, places, leaf.offset)
        self.channels, self.since = leaves, int(self._board.loop.rows)

    @property
    def row(self) -> Any:
        """Layout of a row."""
        leaves = [*_FIXED, *self.channels]
        offsets = np.cumsum([0, *(leaf.width.size for leaf in _FIXED)]).tolist()  # the last one is the first channel's
        offsets += [offsets[-1] + 8 * k for k in range(1, len(self.channels))]
        return np.dtype({
            "names": [leaf.path for leaf in leaves], "formats": ["<" + leaf.width.code for leaf in leaves],
            "offsets": offsets[: len(leaves)], "itemsize": self.ring.shape[1],
        })  # fmt: skip

    def rows(self, after: int) -> tuple[NDArray[Any], int, int]:
        """Rows from number `after` on: these, the number of the next one, and how many were missed."""
        written = int(self._board.loop.rows)
        first = max(after, written - self.size + SPARE, self.since)
        copied = self.ring[np.arange(first, written) % self.size]
        lowest = int(self._board.loop.rows) - self.size + 1  # the loop may be writing this one by now
        kept = copied[max(0, lowest - first) :]
        return kept.view(self.row)[:, 0], written, max(first, lowest) - after
