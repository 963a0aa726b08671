"""A board that is none: an exported controller as a program of this computer, before the machine of an axis file.

The program is made of an export and its `posix.c`; it has a terminal for a serial line. Here is its machine: once in a
sample it takes what the board tells the amplifier, lets the time of a sample pass in the mechanics, and shows the board
what the encoder then latches.
"""

import struct
import subprocess
import threading
import time
from collections.abc import Sequence
from operator import attrgetter
from pathlib import Path
from typing import Any

from detent.kernel.registers import CONTROLLER, PLANT, Leaf
from detent.methods.load import read_axis
from detent.methods.registry import METHODS
from detent.operate.drivers.driver import put
from detent.operate.wires import struct_code

BEHIND = 20  # samples that it may be late before it begins its time anew


class SimulatedBoard:
    """The program `program`, whose board is called `name`, and its machine; `line` is its terminal."""

    def __init__(self, program: Path | str, file: Any, name: str = "1", overrides: Sequence[str] = ()) -> None:
        spec = read_axis(file, overrides).spec
        self.plant, self._wiring = METHODS[spec.axis.method].machine(spec)
        leaves: list[Leaf] = [*self._wiring.lines.leaves()]
        self._shows, self._takes = (
            [(leaf.path, "<" + struct_code(leaf)) for leaf in leaves if leaf.by == by] for by in (PLANT, CONTROLLER)
        )
        self._bytes = sum(struct.calcsize(code) for _, code in self._takes)
        state: Any = self.plant.state
        self._lines, pipe = state.lines, subprocess.PIPE
        self._process: Any = subprocess.Popen([str(program), name], stdin=pipe, stdout=pipe, stderr=pipe)  # noqa: S603 - chosen by who calls
        self._show()
        self.line: str = self._process.stderr.readline().decode().strip()

    def _show(self) -> None:
        lines, out = self._lines, self._process.stdin
        out.write(b"".join(struct.pack(code, attrgetter(path)(lines)) for path, code in self._shows))
        out.flush()

    def sample(self) -> None:
        """One sample of the board, and of its machine."""
        told, lines, at = self._process.stdout.read(self._bytes), self._lines, 0
        if len(told) < self._bytes:
            raise BrokenPipeError(f"the board has ended with {self._process.wait()}")
        for path, code in self._takes:
            (value,) = struct.unpack_from(code, told, at)
            at += struct.calcsize(code)
            put(lines, path, value)
        self.plant.sample()
        self._show()

    def run(self, left: threading.Event) -> None:
        """Samples in wall time, until `left` is set."""
        due = time.monotonic()
        while not left.is_set():
            self.sample()
            due += self._wiring.sample
            now = time.monotonic()
            due = now if now - due > BEHIND * self._wiring.sample else due
            time.sleep(max(due - now, 0.0))

    def close(self) -> int:
        """End the program; gives its exit status."""
        self._process.stdin.close()
        status = self._process.wait(timeout=10)
        self._process.stdout.close()
        self._process.stderr.close()
        return status
