"""Alternatives that run in turn, and the C compiler that makes some of them."""

import ctypes
import platform
import shutil
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from statistics import median

import numba
import pytest

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
C_FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off", "-shared", "-fPIC"]
OPTIMISED = ("-O3", "-O3 -march=native")
ROUNDS = 150

needs_c = pytest.mark.skipif(COMPILER is None, reason="no C compiler here to measure against (Debian: apt install gcc)")

Runner = Callable[[], float]
"""Runs once; nanoseconds of processor time per tick."""


def compile_c(source: Path, folder: Path, *flags: str) -> ctypes.CDLL:
    """Compile `source` in `folder`, where the headers lie that it includes."""
    library = folder / f"{source.stem}{''.join(flags)}.so"
    words = [str(COMPILER), *C_FLAGS, *flags, f"-I{folder}", str(source), "-o", str(library)]
    done = subprocess.run(words, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return ctypes.CDLL(str(library))


def first_line(*words: str) -> str:
    """First line of what a program says of itself."""
    done = subprocess.run(words, check=True, capture_output=True, text=True)
    return done.stdout.splitlines()[0]


def timed(run: Callable[[], int]) -> Runner:
    """Time what returns the ticks it has run.

    The clock is that of the process: what else runs on the processor meanwhile takes no part of it.
    """

    def runner() -> float:
        begin = time.process_time_ns()
        ticks = run()
        return (time.process_time_ns() - begin) / ticks

    return runner


class Race:
    """Alternatives that run in turn, so that whatever else the machine does meets all of them alike."""

    def __init__(self, runs: Mapping[str, Runner]) -> None:
        self.runs = runs
        self.times: dict[str, list[float]] = {name: [] for name in runs}
        for run in runs.values():
            run()  # compiles, or loads what is compiled

    def round(self) -> None:
        """Every alternative once."""
        for name, run in self.runs.items():
            self.times[name].append(run())

    def hold(self, benchmark, name: str, rounds: int = ROUNDS) -> bool:
        """Round by round, its figures noted beside the benchmark's own of `name`; False in a run without measuring."""
        benchmark.pedantic(self.runs[name], setup=self.round, rounds=rounds)
        benchmark.extra_info.update({f"ns per tick, {key}": round(ns, 2) for key, ns in self.nanoseconds().items()})
        benchmark.extra_info.update(numba=numba.__version__, machine=platform.machine())
        return not benchmark.disabled

    def nanoseconds(self) -> dict[str, float]:
        """Median time per tick of each."""
        return {name: median(times) for name, times in self.times.items()}

    def ratio(self, name: str, others: Sequence[str]) -> float:
        """Median time of one over that of the fastest of the others."""
        found = self.nanoseconds()
        return found[name] / min(found[other] for other in others)
