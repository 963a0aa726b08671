"""The watchdog: a process of its own that takes the torque away when the loop's heartbeat is too old.

It loads nothing but what Python itself brings, so that it runs within milliseconds and shares no fault with the loop.
It pulls a line of the board that both processes map: a loop that comes back finds itself in a fault, its torque gone.
A drive has a watch of its own over the bus; this one is for the axis whose drive is the computer itself.
"""

import os
import select
import subprocess
import sys
import time
from contextlib import suppress
from mmap import mmap
from typing import Any

LOOK = 5e-3  # time between two looks [s]
LEAST = 0.1  # age of a heartbeat that is a fault, at least [s]
PERIODS = 6  # and in periods: one more than a late loop may be late by
PLACES: tuple[str, ...] = ("alive", "patience", "left", "found_dead", "found_at")
"""Registers of the loop that it knows, in this order; all have 8 bytes but `left`, which has one."""
PRIORITY = 81  # of SCHED_FIFO: above the loop


class Watch:
    """The board as the watchdog sees it."""

    def __init__(self, memory: mmap, places: list[int]) -> None:
        self._memory = memory
        self._places = dict(zip(PLACES, places, strict=True))

    def _read(self, name: str) -> int:
        place = self._places[name]
        return int.from_bytes(self._memory[place : place + 8], sys.byteorder, signed=True)

    def _write(self, name: str, value: int) -> None:
        place = self._places[name]
        self._memory[place : place + 8] = value.to_bytes(8, sys.byteorder, signed=True)

    @property
    def has_left(self) -> bool:
        """True where the loop has ended as it should."""
        return self._memory[self._places["left"]] != 0

    def look(self, now: int, *, gone: bool = False) -> bool:
        """One look; pulls the line, once for each death, and gives True where it has. `gone`: the process is."""
        alive, patience = self._read("alive"), self._read("patience")
        late = alive > 0 and patience > 0 and (gone or now - alive > patience)
        if not late or self._read("found_at") >= alive:
            return False
        self._write("found_at", now)
        self._write("found_dead", self._read("found_dead") + 1)
        return True


def main(file: int, places: list[int]) -> None:
    """Look until the process that asked for this is gone: its end of our input is closed then."""
    with suppress(OSError, AttributeError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    memory = mmap(file, 0)
    watch = Watch(memory, places)
    gone = False
    while not gone:
        gone = bool(select.select([sys.stdin], [], [], LOOK)[0])
        if not watch.has_left:
            watch.look(time.monotonic_ns(), gone=gone)


class Watchdog:
    """Keeps a watchdog over a board; `file` is what the board is mapped from."""

    def __init__(self, board: Any, file: int) -> None:
        offsets: dict[str, int] = {leaf.path: leaf.offset for leaf in board.leaves()}
        self._file, self._places = file, [offsets[f"loop.{name}"] for name in PLACES]
        board.loop.patience = round(max(LEAST * 1e9, PERIODS * board.loop.period))
        self._process = self._start()

    def _start(self) -> "subprocess.Popen[bytes]":
        # A group of its own: what is typed at the terminal is not meant for it.
        return subprocess.Popen(  # noqa: S603 - Python itself, with numbers
            [sys.executable, "-I", "-S", __file__, str(self._file), *map(str, self._places)],
            stdin=subprocess.PIPE, pass_fds=[self._file], process_group=0,
        )  # fmt: skip

    @property
    def id(self) -> int:
        """Its process."""
        return self._process.pid

    def keep(self) -> bool:
        """Start another one where it has ended; gives True where it had to."""
        if self._process.poll() is None:
            return False
        self._process = self._start()
        return True

    def close(self) -> None:
        """Watch no longer."""
        if self._process.stdin is not None:
            self._process.stdin.close()
        self._process.wait()


if __name__ == "__main__":
    main(int(sys.argv[1]), [int(word) for word in sys.argv[2:]])
