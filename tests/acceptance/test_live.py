"""Live specification, section 8. The first ones are about the cut: what a controller is, and that it is whole."""

import math
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
import pytest
from numpy.typing import NDArray
from tests.acceptance.test_golden_bits import EXAMPLES, JOBS, Job
from tests.difference import diff

from detent.kernel.loop import advance, replay
from detent.kernel.registers import CONTROLLER, PLANT, Registers
from detent.methods.cascade.system import Cascade, along
from detent.methods.registry import METHODS

SAMPLES = 50
"""Of the standard job, each of so many ticks as it takes from one to the next: both of its commands."""

MACHINE = ("detent.plant", "detent.drive", "detent.sensing.encoder", "detent.sensing.interference")
"""What no controller may know."""


@dataclass
class Stretch:
    """Ticks without a word of the host: what it had written before, and what then came along the lines."""

    written: dict[int, int]  # bytes of the controller that the host has written, by place
    rows: NDArray[np.uint8]  # a row per tick: bytes of the lines as the plant wrote them
    feed: tuple[Any, ...]  # what the host has laid ready
    controller: bytes  # as it was after the last tick
    out: bytes  # what it had written on the lines by then


def places(registers: type[Registers], by: str) -> NDArray[np.int64]:
    """Places of all bytes of lines that are written by one side."""
    leaves = [leaf for leaf in registers.leaves() if leaf.by == by]
    parts = [np.arange(leaf.offset, leaf.offset + leaf.width.size * max(leaf.length, 1)) for leaf in leaves]
    return np.concatenate(parts).astype(np.int64) if parts else np.zeros(0, np.int64)


def out_of(lines: Registers) -> bytes:
    """What the controller has written on the lines."""
    return np.frombuffer(bytes(lines), np.uint8)[places(type(lines), CONTROLLER)].tobytes()


def stretches(job: Job, name: str, ticks: int) -> Iterator[Stretch]:
    """Run the standard job of one motor with its plant, and take down what the host and the plant said."""
    p, r = job.params[name], job.state[name]
    axis: Any = r
    picks = places(type(axis.lines), PLANT) + type(r).__fields__["lines"].offset
    known = bytes(axis.controller)
    for command in job.commands:
        command()
        left, idle = ticks // len(job.commands), 0
        while left > 0:
            said, first = bytes(axis.controller), axis.tick
            rows, feed = np.zeros((left, len(picks)), np.uint8), job.feed(name)
            done = advance(p, r, left, rows, picks, 1, *feed)
            rows = rows[np.arange(first + 1, first + done + 1) % left]
            written = {k: new for k, (old, new) in enumerate(zip(known, said, strict=True)) if old != new}
            known = bytes(axis.controller)
            yield Stretch(written, rows, feed, known, out_of(axis.lines))
            left, idle = left - done, 0 if done else idle + 1
            assert idle < 3, "the axis waits for a host that does not answer"
            job.acknowledge()


@pytest.mark.compiled
@pytest.mark.parametrize("make", JOBS, ids=lambda make: make.__name__)
def test_01_a_controller_does_the_same_on_recorded_lines(make):
    job = make()
    ticks = SAMPLES * job.ticks
    for name, p in job.params.items():
        axis: Any = job.state[name]
        controller, lines = axis.controller.copy(), axis.lines.copy()
        picks, passed = places(type(lines), PLANT), 0
        for one in stretches(job, name, ticks):
            memory = bytearray(bytes(controller))
            for k, value in one.written.items():
                memory[k] = value
            controller.restore(bytes(memory))
            replay(p.controller, controller, lines, one.rows, picks, *one.feed)
            assert diff(controller, one.controller) == {}
            assert out_of(lines) == one.out
            passed += len(one.rows)
        assert passed >= ticks


@pytest.mark.parametrize("name", METHODS)
def test_02_a_controller_knows_no_machine(name):
    package = type(METHODS[name]).__module__.rpartition(".")[0]
    script = f"import sys, {package}.controller; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()
    assert [module for module in loaded if module.startswith(MACHINE)] == []


@pytest.mark.parametrize("name", METHODS)
def test_02_an_axis_is_controller_lines_and_plant(name):
    method = METHODS[name]
    assert list(method.registers().__fields__) == ["tick", "controller", "lines", "plant"]
    assert list(method.parameters().__fields__) == ["controller", "plant"]
    wires = [leaf for leaf in method.registers().leaves() if leaf.path.startswith("lines.")]
    assert wires
    assert [leaf.path for leaf in wires if leaf.by not in {PLANT, CONTROLLER}] == []
    told = [leaf.path for leaf in method.registers().leaves() if leaf.by and not leaf.path.startswith("lines.")]
    assert told == []


class Shuttle:
    """The cascade example to and fro for 10 s, with its guard or without."""

    def __init__(self, *, guarded: bool) -> None:
        from detent.methods.cascade.build import motion_limits
        from detent.methods.cascade.host import CascadeHost
        from detent.methods.load import load_spec
        from detent.planning.profile import plan_move

        spec = load_spec(EXAMPLES / "cascade.toml", ())
        self.host = CascadeHost(spec)
        self.host.controller.guarded = guarded
        start = spec.mechanics.start_position
        way = plan_move(start, start + 0.2, motion_limits(spec), self.host.period)
        self.samples = round(10.0 / self.host.period)
        times = -(-self.samples // (2 * way.count))
        both = [(way.position, way.position[::-1]), (way.velocity, -way.velocity[::-1]),
                (way.acceleration, way.acceleration[::-1])]  # fmt: skip
        self.host.feed = along(*(np.tile(np.concatenate(pair), times)[: self.samples] for pair in both))
        self.begin = self.host.state.snapshot()

    def seconds(self) -> float:
        """Processor time of the job."""
        self.host.state.restore(self.begin)
        begin = time.process_time()
        assert self.host.pass_samples(self.samples) == 0
        seconds = time.process_time() - begin
        assert self.host.controller.samples == self.samples
        assert self.host.state.tick == self.samples * self.host.sample_ticks
        return seconds


@pytest.mark.compiled
@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="the compiled loop is what is timed")
def test_04_the_guard_is_a_step_of_the_loop(monkeypatch):
    """No sample is simulated twice: nobody runs a copy of the axis."""

    def refuse(_self):
        pytest.fail("a copy of the axis is simulated")

    with_guard, without = Shuttle(guarded=True), Shuttle(guarded=False)
    monkeypatch.setattr(Cascade, "copy", refuse)
    best = [math.inf, math.inf]
    for _ in range(60):
        best = [min(before, axis.seconds()) for before, axis in zip(best, (with_guard, without), strict=True)]
    assert best[0] <= 1.15 * best[1]
