"""The stretch that the tick benchmarks run: four lines at 40 in/s with a turn-around before each, on any engine."""

import ctypes
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.bench.race import compile_c
from tests.c_struct import c_struct
from tests.print_head_rig import Rig

from detent.control.head_computer import PRINT
from detent.methods.print_head.system import PrintHead, PrintHeadParams

SOURCE = Path(__file__).with_name("print_head_tick.c")

Engine = Callable[[PrintHeadParams, PrintHead, int], int]
"""Runs up to that many ticks, stops at a status byte, returns the ticks run."""

LINES = ((3550, 950), (1000, 3600), (3550, 950), (1000, 3600))
"""First and last printed emitter. Each start leaves the run-up from where the line before it stops: no run back."""


class Stretch:
    """An axis that prints every column of its lines, in the steady phase of the first line when the stretch begins."""

    def __init__(self, *overrides: str) -> None:
        rig = Rig(overrides=overrides).pretend_identified(emitter=300)
        rig.head.buffer.ink[:] = [1] * len(rig.head.buffer.ink)
        rig.set_speed(240)
        rig.send_print(1000, 3600)
        rig.run(3000)
        self.p, self.r = rig.p, rig.r
        self.begin = self.r.snapshot()

    def run(self, engine: Engine) -> int:
        """From the beginning through the four lines; returns the ticks."""
        self.r.restore(self.begin)
        head, ticks = self.r.controller.head, 0
        for start, end in LINES:
            self._queue_line(start, end)
            done = engine(self.p, self.r, 100_000)
            assert done > 0, "the C tick has met something it does not cover"
            assert head.status.latch.flag, "the line did not end"
            head.status.latch.flag = 0
            ticks += done
        return ticks

    def _queue_line(self, start: int, end: int) -> None:
        """What the bytes of a PRINT command leave behind; the supervisor's side is not what is measured."""
        queue = self.r.controller.head.queue
        k = (queue.first + queue.waiting) % len(queue.operation)
        queue.operation[k], queue.start[k], queue.end[k] = PRINT, start * 256, end
        queue.waiting += 1
        queue.motions += 1


def tick_in_c(folder: Path, *flags: str) -> Engine:
    """The tick in C, compiled against the register files' own declarations."""
    (folder / "print_head_registers.h").write_text(c_struct(PrintHeadParams, PrintHead))
    function: Any = compile_c(SOURCE, folder, *flags).advance
    function.argtypes, function.restype = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64], ctypes.c_int64
    return lambda p, r, ticks: function(ctypes.addressof(p), ctypes.addressof(r), ticks)
