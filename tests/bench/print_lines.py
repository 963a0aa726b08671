"""The stretch that the tick benchmarks run: four lines at 40 in/s with a turn-around before each, on any engine."""

import ctypes
import shutil
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from tests.print_head_rig import Rig

from detent.control.head_computer import PRINT
from detent.systems.print_head import PrintHead, PrintHeadParams

SOURCE = Path(__file__).with_name("print_head_tick.c")
COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
C_FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off", "-shared", "-fPIC"]

Engine = Callable[[PrintHeadParams, PrintHead, int], int]
"""Runs up to that many ticks, stops at a status byte, returns the ticks run."""

LINES = ((3550, 950), (1000, 3600), (3550, 950), (1000, 3600))
"""First and last printed emitter. Each start leaves the run-up from where the line before it stops: no run back."""


class Stretch:
    """An axis that prints every column of its lines, in the steady phase of the first line when the stretch begins."""

    def __init__(self, *overrides: str) -> None:
        rig = Rig(overrides=overrides).pretend_identified(emitter=300)
        rig.r.buffer.ink[:] = [1] * len(rig.r.buffer.ink)
        rig.set_speed(240)
        rig.send_print(1000, 3600)
        rig.run(3000)
        self.p, self.r = rig.p, rig.r
        self.begin = self.r.snapshot()

    def run(self, engine: Engine) -> int:
        """From the beginning through the four lines; returns the ticks."""
        self.r.restore(self.begin)
        head, ticks = self.r.head, 0
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
        queue = self.r.head.queue
        k = (queue.first + queue.waiting) % len(queue.operation)
        queue.operation[k], queue.start[k], queue.end[k] = PRINT, start * 256, end
        queue.waiting += 1
        queue.motions += 1


def compile_c(folder: Path, *flags: str) -> Engine:
    """The tick in C, compiled against the register files' own declarations."""
    (folder / "print_head_registers.h").write_text(PrintHeadParams.c_struct() + PrintHead.c_struct())
    library = folder / f"tick{''.join(flags)}.so"
    words = [str(COMPILER), *C_FLAGS, *flags, f"-I{folder}", str(SOURCE), "-o", str(library)]
    done = subprocess.run(words, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    function: Any = ctypes.CDLL(str(library)).advance
    function.argtypes, function.restype = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64], ctypes.c_int64
    return lambda p, r, ticks: function(ctypes.addressof(p), ctypes.addressof(r), ticks)


def compiler_version() -> str:
    """First line of what the C compiler says of itself."""
    done = subprocess.run([str(COMPILER), "--version"], check=True, capture_output=True, text=True)
    return done.stdout.splitlines()[0]


class Race:
    """Alternatives that run in turn, so that whatever else the machine does meets all of them alike."""

    def __init__(self, runs: Mapping[str, tuple[Stretch, Engine]]) -> None:
        self.runs = runs
        self.times: dict[str, list[float]] = {name: [] for name in runs}
        for stretch, engine in runs.values():
            stretch.run(engine)  # compiles, or loads what is compiled

    def round(self) -> None:
        """Every alternative once."""
        for name, (stretch, engine) in self.runs.items():
            begin = time.perf_counter_ns()
            ticks = stretch.run(engine)
            self.times[name].append((time.perf_counter_ns() - begin) / ticks)

    def nanoseconds(self) -> dict[str, float]:
        """Median time per tick of each."""
        return {name: median(times) for name, times in self.times.items()}

    def ratio(self, name: str, others: Sequence[str]) -> float:
        """Median time of one over that of the fastest of the others."""
        found = self.nanoseconds()
        return found[name] / min(found[other] for other in others)
