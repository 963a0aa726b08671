"""A print-head axis on the bench: the default plant of specification 7.2, driven by bytes, recorded tick by tick."""

from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from detent.control.head_computer import FAULT, HIGH_STEADY, IDLE, POWER_ON
from detent.kernel.loop import advance
from detent.methods.load import load_spec
from detent.methods.print_head.build import build_print_head
from detent.methods.print_head.controller import PERIOD_US, read_status, write_command
from detent.methods.print_head.schema import EMITTER, PrintHeadSpec
from detent.methods.print_head.system import PrintHead, PrintHeadParams, switch_on

EXAMPLE = Path(str(files("detent") / "examples" / "print_head.toml"))
COUNT = 38.0 / 300
"""Volts per drive count."""
RADIUS = 3 * 0.0254 / (2 * np.pi)
TICK = PERIOD_US * 1e-6
NO_TRACE = (np.zeros((1, 1), np.uint8), np.zeros(0, np.int64), 0)


def force_constant(slope: float) -> float:
    """Kt/r [N/A] of a machine whose true slope is `slope` (1/256 count per speed value)."""
    return slope / 256 * COUNT * 6 / 0.0254


def make_spec(slope: float = 170, right: float = 36, left: float = 28, overrides: Sequence[str] = ()) -> PrintHeadSpec:
    """Default plant with a true slope [1/256 count per speed value] and friction [count] of both directions."""
    k = force_constant(slope)
    texts = [
        f"motor.torque_constant={k * RADIUS!r} N*m/A",
        f"mechanics.friction.right.coulomb={right * COUNT / 12 * k!r} N",
        f"mechanics.friction.left.coulomb={left * COUNT / 12 * k!r} N",
    ]
    return load_spec(EXAMPLE, [*texts, *overrides])


class Rig:
    """The axis with its latches within reach of a test."""

    def __init__(
        self,
        slope: float = 170,
        right: float = 36,
        left: float = 28,
        *,
        overrides: Sequence[str] = (),
        start: float = 0.0889,
    ) -> None:
        self.spec = make_spec(slope, right, left, overrides)
        self.p: PrintHeadParams = build_print_head(self.spec)
        self.r = PrintHead()
        switch_on(self.p, self.r, start, self.spec.encoder.seed)
        self.head = self.r.controller.head
        self.responses: list[int] = []
        """Every status byte read so far."""

    def pretend_identified(
        self, *, slope: int = 170, right: int = 36, left: int = 28, emitter: int = 1000, fraction: float = 0.5
    ) -> "Rig":
        """As after homing and identification, at rest at `emitter` (see `place`), without running them."""
        self.place(emitter, fraction)
        self.head.homed, self.head.width, self.head.state = 1, 4350, IDLE
        for line, friction in ((self.head.right, right), (self.head.left, left)):
            line.slope, line.friction, line.valid = slope, friction, 1
        return self

    def place(self, emitter: int, fraction: float = 0.5) -> None:
        """Put the head at rest at an emitter and a fraction of the way to the next; state as after power-on."""
        switch_on(self.p, self.r, (emitter + fraction) * EMITTER + self.p.plant.encoder.origin, self.spec.encoder.seed)
        self.head.emitter = emitter

    def run(self, ticks: int) -> int:
        """Advance up to `ticks`; stops at a status byte, which stays in the latch."""
        return advance(self.p, self.r, ticks, *NO_TRACE)

    def read_status(self) -> int:
        """Take the waiting status byte."""
        assert self.head.status.latch.flag, "no status byte waits"
        self.responses.append(read_status(self.r.controller))
        return self.responses[-1]

    def next_status(self, seconds: float = 20.0) -> int | None:
        """Advance until a status byte comes and take it; None after `seconds`."""
        left = round(seconds / TICK)
        while left > 0 and not self.head.status.latch.flag:
            left -= self.run(left)
        return self.read_status() if self.head.status.latch.flag else None

    def put_byte(self, byte: int) -> None:
        """Write the command latch, waiting for the computer to take the last byte (a tick at most)."""
        while self.head.command_latch.flag:
            self.run(1)
        write_command(self.r.controller, byte)
        self.run(1)

    def send(self, *command: int) -> list[int]:
        """Send a command; returns the acknowledge bytes of all but its last byte (and of it, with ack_last)."""
        found = []
        for k, byte in enumerate(command):
            self.put_byte(byte)
            if k < len(command) - 1 or (self.p.controller.ack_last and len(command) > 1):
                status = self.next_status(0.01)
                assert status == 0xFF, f"byte {k} of {[hex(b) for b in command]} answered {status}"
                found.append(status)
        return found

    def run_to(self, target: int, *, wait: bool = True) -> int | None:
        """RUN TILL target; returns SB1 when `wait`."""
        self.send(0x92, target >> 8, target & 0xFF)
        return self.next_status() if wait else None

    def controlled_run_to(self, target: int, *, wait: bool = True) -> int | None:
        """RUN TILL target, capped by the preselected speed; returns SB1 when `wait`."""
        self.send(0xA2, target >> 8, target & 0xFF)
        return self.next_status() if wait else None

    def set_speed(self, s: int) -> int | None:
        """SET SPEED."""
        self.send(0x99, s)
        return self.next_status()

    def send_print(self, start: float, end: int) -> None:
        """PRINT FROM start TO end, without waiting for its answer."""
        whole = int(start)
        self.send(0x8D, whole >> 8, whole & 0xFF, int((start - whole) * 256), end >> 8, end & 0xFF)

    def calculate(self) -> int | None:
        """CALCULATE PARAMETERS; returns SB1."""
        self.send(0x01)
        return self.next_status(60.0)

    def record(self, seconds: float, names: Sequence[str], *, stop_at_status: bool = True) -> dict[str, np.ndarray]:
        """Advance and record registers at every tick (values at the end of the tick), with `t` [s] from the beginning.

        Stops when a status byte comes, unless `stop_at_status` is False: then status bytes are read into `responses`.
        """
        leaves = {leaf.path: leaf for leaf in PrintHead.leaves()}
        chosen = [leaves[name] for name in names]
        picks = np.concatenate([np.arange(c.offset, c.offset + c.width.size) for c in chosen]).astype(np.int64)
        dtype: Any = np.dtype([(c.path, "<" + c.width.code) for c in chosen])
        ticks = round(seconds / TICK)
        rows = np.zeros((ticks + 1, dtype.itemsize), np.uint8)
        begin, done = self.r.tick, 0
        while done < ticks:
            done += advance(self.p, self.r, ticks - done, rows, picks, 1)
            if self.head.status.latch.flag:
                if stop_at_status:
                    break
                self.read_status()
        index = np.arange(begin + 1, begin + done + 1) % rows.shape[0]
        table = rows[index].view(dtype)[:, 0]
        found = {name: table[name].copy() for name in names}
        found["t"] = np.arange(1, done + 1) * TICK
        return found

    def in_state(self, *states: int, seconds: float = 5.0) -> bool:
        """Advance tick by tick until the computer is in one of `states`."""
        for _ in range(round(seconds / TICK)):
            if self.head.state in states:
                return True
            self.run(1)
            if self.head.status.latch.flag:
                self.read_status()
        return False

    @property
    def speed_value(self) -> float:
        """True speed in speed values, right positive."""
        return self.r.plant.train.velocity / 0.0254 * 6

    @property
    def at_rest(self) -> bool:
        """True when the computer holds the drive off."""
        return self.head.state in (IDLE, FAULT, POWER_ON)


__all__ = ["EMITTER", "HIGH_STEADY", "Rig", "make_spec"]
