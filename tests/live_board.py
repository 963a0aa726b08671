"""A cascade axis on a board that is none: the exported controller as a program of this computer, behind a terminal."""

import shutil
import subprocess
import time
from collections.abc import Generator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from random import Random
from tempfile import mkdtemp
from typing import Any

import pytest

from detent.axis import load
from detent.control import operation as ops
from detent.export.code import FLAGS, WARNINGS
from detent.export.write import export_firmware
from detent.faces.board import SimulatedBoard
from detent.operate.drivers.frames import NUMBERS, Frame
from detent.operate.drivers.serial_drive import SerialDrive
from tests.acceptance.test_golden_bits import EXAMPLES
from tests.live_bench import Bench

CC = shutil.which("cc")
needs_cc = pytest.mark.skipif(CC is None, reason="compiles C")
FILE = EXAMPLES / "cascade.toml"
NAME = "slide 7"
HARDWARE = f'hardware.id="serial {NAME}"'
SAMPLE = 0.25e-3  # of the example [s]


SINGLE = 'controller.arithmetic="single"'


@cache
def program(*overrides: str) -> Path:
    """The board of the example, compiled without a warning."""
    folder = Path(mkdtemp()) / "firmware"
    made = export_firmware(load(FILE, overrides), folder, prefix="slide", ticks=10)
    sources = ["slide.c", "slide_params.c", "slide_selftest.c", "slide_serial.c", "posix.c"]
    assert made.name == "slide"
    told = [*f"{CC} {FLAGS} {WARNINGS} -Werror -O2".split(), *sources, "-lm", "-o", "board"]
    subprocess.run(told, cwd=folder, check=True)
    return folder / "board"


class Stepped(SerialDrive):
    """A driver whose board makes a sample when it has been told something; its line may be a bad one."""

    def __init__(self, board: SimulatedBoard, bad: float = 0.0, seed: int = 1) -> None:
        super().__init__(board.line, 1.0)
        self.board, self.bad, self.cut, self.broken = board, bad, "", 0
        self._random = Random(seed)
        self.lost = {"to": 0, "from": 0}  # frames that the line has eaten or spoilt
        self.written, self.places = 0, set[int]()  # frames to the board; counts that its encoder has shown

    def write(self, lines: Any, *, reset: bool) -> None:
        """A terminal hands on what is written when the system comes to that: a board that lags is given time."""
        behind = (self._sent - 1 - self._taken) % NUMBERS
        if 4 < behind < 1000 and not self.cut:
            time.sleep(1e-3 * behind)
        super().write(lines, reset=reset)

    def _send(self, kind: int, payload: bytes) -> None:
        port = self._port

        class Line:
            """What stands in for the port while something is sent."""

            def write(_, data: bytes) -> None:  # noqa: N805 - this one is `self`
                if self.cut not in ("to", "both"):
                    port.write(self._worn(data, "to"))

        self._port = Line()
        try:
            super()._send(kind, payload)
        finally:
            self._port = port
        self.written += 1
        self.board.sample()
        self.places.add(int(self.board.plant.state.lines.motor.count))  # the board may have told of it already

    def _worn(self, data: bytes, way: str) -> bytes:
        """The same after a bad line: one in a hundred lost, one in a hundred with turned bits."""
        luck, made = self._random.random(), bytearray(data)
        if luck >= 2 * self.bad or not self.ready:
            return data
        self.lost[way] += 1
        if luck < self.bad:
            return b""
        for _ in range(self._random.randint(1, 8)):
            made[self._random.randrange(len(made))] ^= 1 << self._random.randrange(8)
        return bytes(made)

    def _receive(self, wait: float) -> list[Frame]:
        if self.cut in ("from", "both"):
            self._port.read(self._port.in_waiting)
            return []
        if not self.bad or not self.ready:
            return super()._receive(wait)
        self._port.timeout = wait  # a terminal hands on what is written when it comes to that
        data = self._port.read(1)
        data += self._port.read(self._port.in_waiting)
        *pieces, rest = data.split(b"\0")
        return self._receiver.feed(b"\0".join([*(piece and self._worn(piece, "from") for piece in pieces), rest]))


def lead_on_bad_line(exchanges: int) -> None:
    """Moves over a line that loses one frame in a hundred and spoils another, each way: no wrong value, no gap lost."""
    with on_board(bad=0.01) as (bench, drive):
        chance, done = Random(31), 0
        ready_on(bench)
        while bench.loop.periods < exchanges:
            target = chance.uniform(0.01, 0.05)
            assert bench.do(ops.MOVE_TO, target).how == ops.DONE
            assert abs(drive.board.plant.state.lines.motor.count * 1e-6 - target) <= bench.spec.method.in_position
            assert int(bench.host.axis.state.lines.motor.count) in drive.places
            done += 1
        assert (bench.operation.fault, bench.loop.periods >= exchanges, done > 1) == (0, True, True)
        drive.bad = 0.0
        bench.pass_time(0.02)
        receiver, (good, spoilt, missing) = drive._receiver, drive._there
        assert min(drive.lost.values()) > 0.01 * exchanges
        assert good + missing == drive.written
        assert missing >= drive.lost["to"] > 0.8 * missing
        assert spoilt > 0.3 * drive.lost["to"]
        assert receiver.missing >= drive.lost["from"] > 0.8 * receiver.missing
        assert [fact.name for fact in drive.counted()] == ["from the board", "to the board"]


def ready_on(bench: Bench) -> None:
    """Enabled, the position trusted, the first motion confirmed."""
    bench.pass_time(0.02)
    for kind, value in ((ops.TRUST, ops.REFERENCED), (ops.ENABLE, 0.0), (ops.CONFIRM, 0.0)):
        assert bench.do(kind, float(value)).how == ops.DONE
    bench.pass_time(0.02)
    assert bench.host.state == "operation enabled"


@contextmanager
def on_board(*overrides: str, **more: Any) -> Generator[tuple[Bench, Stepped]]:
    """The example led on its board, sample by sample."""
    precision = [SINGLE] if SINGLE in overrides else []
    board = SimulatedBoard(program(*precision), FILE, NAME, precision)
    drive = Stepped(board, **more)
    try:
        bench = Bench("cascade", *(overrides or [HARDWARE]), driver=drive, period=SAMPLE)
        yield bench, drive
        bench.host.close()
    finally:
        assert board.close() == 0
