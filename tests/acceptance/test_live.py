"""Live specification, section 8. The first ones are about the cut: what a controller is, and that it is whole."""

import json
import math
import mmap
import os
import random
import re
import shutil
import signal
import socket
import sqlite3
import ssl
import stat
import struct
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from random import Random
from typing import Any

import can
import httpx
import numba
import numpy as np
import pytest
from numpy.typing import NDArray
from tests import (
    live_board,
    live_course,
    live_drive,
    live_faults,
    live_frames,
    live_outside,
    live_panel,
    live_processes,
    live_requests,
    live_store,
)
from tests.acceptance.test_golden_bits import EXAMPLES, JOBS, Job
from tests.cascade_rig import BY_HAND
from tests.course_rig import excursions, follow, shortest_stop, turns
from tests.difference import diff
from tests.live_axes import PAGES, PLAIN, Head, Stepper, longest_stop, moves
from tests.live_bench import MOVED, OPERATED, Bench
from tests.live_browser import Script, panelled, run_script, until
from tests.live_course import COMPILED, COVERED, bound, hunted, under_way
from tests.live_home import HOMED, WAYS, Lost, zeros
from tests.live_machine import AxisMachine, PulseMachine, run_machine
from tests.live_panel import PanelRig
from tests.live_rig import SENSORS, memory_folder, open_store, read
from tests.places import ROOT
from tests.unit.planning import test_course
from websockets.exceptions import ConnectionClosed, InvalidStatus

import detent
from detent.control import homing
from detent.control import operation as ops
from detent.control.axis_states import ORDER_NAMES, STATE_NAMES, ordered
from detent.control.guard import FOLLOWING, STUCK
from detent.control.head_computer import IDLE
from detent.control.operation import ABORTED, DONE, REFUSED
from detent.control.reaction import REACTION_NAMES, RULES, rule_of
from detent.control.step_rule import INFEASIBLE
from detent.errors import DRIVE_LOST, LOOP_OVERRUN, ON_REMOTE, OTHER_HARDWARE, DetentError
from detent.faces.cia402 import drive_of
from detent.kernel.loop import advance, replay
from detent.kernel.registers import CONTROLLER, PLANT, Registers
from detent.methods.cascade.system import Cascade, along
from detent.methods.load import load_spec
from detent.methods.position import Sensed
from detent.methods.print_head.controller import PERIOD_US
from detent.methods.print_head.print_job import load_job
from detent.methods.print_head.run import SimulatedPrinting, print_job
from detent.methods.registry import METHODS
from detent.methods.stepper_envelope.host import StageHost
from detent.methods.stepper_envelope.stage_job import StageMove, StopChange
from detent.operate.drivers.canopen_drive import CanopenDrive
from detent.operate.faults import injection_of
from detent.operate.host import Ending, Host, Log, repeat
from detent.operate.opening import meanings, store_path
from detent.operate.session import Session
from detent.operate.start import make_host
from detent.operate.trust import Trust, Why
from detent.operate.words import CommandAbortedError, why_not_moving
from detent.panel import app as panel_app
from detent.panel.child import PanelPlace
from detent.panel.gate import MOST_STRANGERS, Rule
from detent.panel.keys import LINK, ROLES, keep_keys, link_of, make_keys, sign
from detent.planning import course
from detent.planning.course import advance as advance_course
from detent.plant.injection import BLOCKED


def in_wall_time(test: Callable[..., None]) -> Callable[..., None]:
    """A test of a loop that runs as compiled code, or of processes that hold one."""
    skipped = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="a loop in wall time")
    return pytest.mark.compiled(skipped(test))


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


# ---- the loop in wall time


def started(bench: Bench) -> Iterator[Bench]:
    """The bench with its loop in a thread, in wall time."""
    bench.host.start()
    try:
        yield bench
    finally:
        bench.host.close()


def test_06_late_periods_are_skipped_and_the_grid_is_kept():
    bench = Bench("cascade").enable()
    bench.host.ask(ops.MOVE_BY, 0.1)
    bench.pass_time(0.1)
    loop, before = bench.loop, bench.loop.deadline
    (here, speed), worst = bench.watch(0.001)[0], bench.spec.limits.speed
    ran, skipped = loop.periods, loop.skipped
    loop.delay_at, loop.delay = loop.periods + 1, round(3.5 * loop.period)
    ((there, _),) = bench.watch(0.001)
    assert (loop.periods - ran, loop.skipped - skipped, loop.overruns) == (1, 3, 1)
    # The period ran 3.5 periods late, and the deadline that it kept was the third after its own.
    assert loop.worst == round(3.5 * loop.period)
    bench.host.run(1)
    assert (loop.deadline - before) % loop.period == 0
    assert loop.deadline - before == (loop.periods - ran + 1 + 3) * loop.period
    assert (loop.periods - ran, loop.skipped - skipped) == (2, 3)
    # One period of time has passed on the axis, not four.
    assert 0.0 < there - here < 1.5 * worst * 1e-3
    assert there - here == pytest.approx(speed * 1e-3, rel=0.2)
    assert bench.host.state == "operation enabled"


@pytest.mark.parametrize("periods", [5.2, 40.0])
def test_07_a_long_overrun_is_a_fault_and_stops_in_a_ramp(periods):
    bench = Bench("cascade").enable()
    move = bench.host.ask(ops.MOVE_BY, 0.2)
    bench.pass_time(0.2)
    at, speed = bench.answer.commanded, bench.answer.commanded_velocity
    bench.loop.delay_at, bench.loop.delay = bench.loop.periods + 1, round(periods * bench.loop.period)
    ramp = bench.watch(0.5)
    assert bench.host.ending(move) == Ending(move, ops.FAILED, LOOP_OVERRUN, 0)
    assert (bench.operation.fault, bench.host.state) == (50, "fault")
    limits, places = bench.spec.limits, [at, *(place for place, _ in ramp)]
    assert all(0.0 <= b - a <= 1.001 * limits.speed * 1e-3 for a, b in pairwise(places))
    bound = speed**2 / (2 * limits.acceleration) + speed * limits.acceleration / (2 * limits.jerk)
    assert 0.0 < ramp[-1][0] - at <= bound + speed * 2e-3 + limits.acceleration**3 / limits.jerk**2
    assert ramp[-1][1] == 0.0
    assert bench.host.axis.state.controller.on  # type: ignore[attr-defined]  # it holds


def test_07_many_overruns_in_a_second_are_a_fault():
    bench = Bench("cascade").enable()
    for k in range(4):
        assert bench.operation.fault == 0
        bench.loop.delay_at, bench.loop.delay = bench.loop.periods + 1, bench.loop.period
        bench.pass_time(0.2)
        assert bench.loop.overruns == k + 1
    assert bench.operation.fault == LOOP_OVERRUN
    slower = Bench("cascade").enable()
    for _ in range(12):
        slower.loop.delay_at, slower.loop.delay = slower.loop.periods + 1, slower.loop.period
        slower.pass_time(0.4)
    assert (slower.operation.fault, slower.loop.overruns) == (0, 12)


def test_08_histogram_and_counters_sum_to_the_periods_run():
    bench = Bench("filtered_servo")
    delays = [0, 1, 999, 1000, 1001, 500_000, 999_999, 1_000_000, 3_500_000]
    for delay in delays:
        bench.loop.delay_at, bench.loop.delay = bench.loop.periods + 1, delay
        bench.host.run(7)
    late = list(bench.loop.late)
    assert sum(late) == bench.loop.periods == 7 * len(delays)
    assert bench.loop.deadline == (bench.loop.periods + bench.loop.skipped) * bench.loop.period
    bins = Counter((delay // 1000).bit_length() for delay in delays) + Counter({0: 6 * len(delays)})
    assert {k: n for k, n in enumerate(late) if n} == bins
    assert (bench.loop.skipped, bench.loop.overruns) == (4, 2)


WRITER = """
import sys
from detent.operate.host import write_request
from detent.operate.loop import INBOX, Board
import mmap
with open(sys.argv[1], "r+b") as file:
    board = Board.from_buffer(mmap.mmap(file.fileno(), 0))
box, operation = board.inbox, board.operation
for number in range(1, int(sys.argv[2]) + 1):
    while number - operation.taken > INBOX:
        pass
    write_request(box, number, 10, number, 0, 1, number * 0.5, 1.0)
"""


@pytest.mark.wide
@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="a million requests")
def test_09_no_request_is_lost_doubled_or_torn(tmp_path):
    """A million, written by another process into the memory that both map."""
    bench, requests = Bench("filtered_servo"), 1_000_000
    memory = tmp_path / "board"
    memory.write_bytes(bytes(bench.host.board))
    with memory.open("r+b") as file:
        board = bench.host.board = type(bench.host.board).from_buffer(mmap.mmap(file.fileno(), 0))
    writer = subprocess.Popen([sys.executable, "-c", WRITER, str(memory), str(requests)])
    read, sums = 0, 0
    while read < requests:
        assert writer.poll() in {None, 0}
        before = board.operation.taken
        bench.host.run(1)
        ends = board.operation.endings
        for k in range(read, ends.count):
            assert ends.id[k % 256] == k + 1
            sums += ends.id[k % 256]
        read = ends.count
        assert read == board.operation.taken <= before + 64
    assert writer.wait() == 0
    assert sums == requests * (requests + 1) // 2


def test_09_a_torn_request_is_not_taken():
    """Each byte of a record spoilt, one after the other: it is left until it is whole, and then taken once."""
    bench = Bench("filtered_servo")
    box = bench.host.board.inbox
    for field in ("number", "kind", "id", "epoch", "client", "value", "speed", "check"):
        bench.host.ask(ops.KEEP)
        k = bench.operation.taken % 1024
        column, whole = getattr(box, field), getattr(box, field)[k]
        column[k] = whole + 1
        taken, torn = bench.operation.taken, bench.operation.torn
        bench.host.run(3)
        assert (bench.operation.taken, bench.operation.torn) == (taken, torn + 3)
        column[k] = whole
        bench.host.run(1)
        assert bench.operation.taken == taken + 1


def check_rows(rows: Any, first: int) -> int:
    """No row is torn, none is out of its place; gives the number of the next."""
    assert np.array_equal(rows["loop.periods"], np.arange(first + 1, first + 1 + len(rows)))
    answer = {name: rows[f"operation.answer.{name}"] for name in ("position", "commanded", "error")}
    assert np.array_equal(answer["commanded"] - answer["position"], answer["error"])
    assert np.array_equal(rows["controller.reference.position"], answer["commanded"])
    return first + len(rows)


def test_10_a_reader_that_was_stopped_sees_no_torn_row():
    """It reads while the loop runs as fast as it can, is stopped for longer than the ring holds, and reads on."""
    channels = ("controller.reference.position", "lines.motor.count", "controller.on", "controller.law.command")
    bench = Bench("cascade", channels=channels).enable()
    scope = bench.host.scope
    bench.host.ask(ops.MOVE_BY, 0.2)
    following = int(bench.loop.rows)
    bench.pass_time(0.5)
    rows, following, missed = scope.rows(following)
    assert (len(rows), missed) == (500, 0)
    check_rows(rows, following - 500)
    assert set(rows["controller.on"]) == {1}
    assert np.ptp(rows["lines.motor.count"]) > 100_000
    bench.pass_time(20.0)  # the reader is stopped
    rows, following, missed = scope.rows(following)
    assert len(rows) + missed == 20_000
    assert 8000 < len(rows) < 8192
    check_rows(rows, following - len(rows))
    bench.host.ask(ops.MOVE_BY, -0.2)
    runner = threading.Thread(target=bench.host.run, args=(600_000,))
    end = following + 600_000
    runner.start()
    seen = 0
    while following < end:
        rows, following, missed = scope.rows(following)
        check_rows(rows, following - len(rows))
        seen += len(rows)
    runner.join()
    assert seen > 8000
    assert (bench.loop.overruns, bench.operation.fault) == (0, 0)


def test_10_channels_change_under_way():
    bench = Bench("cascade").enable()
    bench.host.scope.show(["controller.law.command", "controller.law.limited"])
    first = int(bench.loop.rows)
    bench.host.ask(ops.MOVE_BY, 0.05)
    bench.pass_time(0.2)
    rows, following, _ = bench.host.scope.rows(0)
    assert len(rows) == following - first - 1 == 199  # the one that the loop might be writing is left out
    assert rows["controller.law.command"][-1] == bench.host.axis.state.controller.law.command  # type: ignore[attr-defined]
    assert np.ptp(rows["controller.law.command"]) > 1.0
    with pytest.raises(DetentError, match="8 or fewer"):
        bench.host.scope.show([leaf.path for leaf in type(bench.host.axis.state).leaves() if not leaf.length][:9])
    with pytest.raises(DetentError, match="did you mean"):
        bench.host.scope.show(["controller.law.comand"])


# ---- states and commands

# CiA 402 part 2, figure of the state machine: order by order, from each state that knows it.
DOCUMENTED = {
    ("shutdown", "switch on disabled"): "ready to switch on", ("shutdown", "switched on"): "ready to switch on",
    ("shutdown", "operation enabled"): "ready to switch on", ("switch on", "ready to switch on"): "switched on",
    ("enable operation", "switched on"): "operation enabled",
    ("enable operation", "quick stop active"): "operation enabled",
    ("disable operation", "operation enabled"): "switched on",
    ("disable voltage", "ready to switch on"): "switch on disabled",
    ("disable voltage", "switched on"): "switch on disabled",
    ("disable voltage", "operation enabled"): "switch on disabled",
    ("disable voltage", "quick stop active"): "switch on disabled",
    ("quick stop", "ready to switch on"): "switch on disabled", ("quick stop", "switched on"): "switch on disabled",
    ("quick stop", "operation enabled"): "quick stop active", ("fault reset", "fault"): "switch on disabled",
}  # fmt: skip


@pytest.mark.parametrize("order", range(7))
@pytest.mark.parametrize("state", range(8))
def test_11_every_order_leads_where_cia_402_says(state, order):
    name = STATE_NAMES[state]
    expected = DOCUMENTED.get((ORDER_NAMES[order], name), name)
    assert STATE_NAMES[ordered(state, order)] == expected


def test_11_the_axis_obeys_the_orders():
    bench = Bench("cascade")
    bench.pass_time(0.01)
    for order, state in ((0, "ready to switch on"), (1, "switched on"), (2, "operation enabled"), (3, "switched on"),
                         (2, "operation enabled"), (5, "quick stop active"), (2, "operation enabled"),
                         (4, "switch on disabled")):  # fmt: skip
        assert bench.do(ops.ORDER, order).how == ops.DONE
        assert bench.host.state == state


@pytest.mark.parametrize("name", MOVED)
def test_13_each_command_ends_exactly_once(name):
    bench = Bench(name).enable()
    first = bench.host.ask(ops.MOVE_BY, 0.005)
    bench.pass_time(0.003)
    second = bench.host.ask(ops.MOVE_BY, 0.0)
    bench.pass_time(2.0)
    ends = [bench.host.ending(command) for command in (first, second)]
    if bench.host.axis.live.operation.one_at_a_time:  # type: ignore[attr-defined]
        assert ends == [Ending(first, ops.DONE, 0, 0), Ending(second, ops.REFUSED, ops.BUSY, 0)]
    else:
        assert ends == [Ending(first, ops.ABORTED, 0, second), Ending(second, ops.DONE, 0, 0)]
    assert bench.operation.endings.count == bench.operation.taken == len({a.fields[2] for a in bench.host.log.asked})


@pytest.mark.parametrize("name", MOVED)
def test_13_a_null_move_is_done_after_the_window_time(name):
    bench = Bench(name).enable()
    command, before = bench.host.ask(ops.MOVE_BY, 0.0), bench.operation.looks
    bench.host.run(1)
    assert bench.host.ending(command) is None
    assert bench.host.until_ended(command).how == ops.DONE
    assert bench.operation.looks - before >= bench.host.axis.live.operation.window_looks  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", OPERATED)
def test_13_a_command_of_an_old_epoch_is_dropped_and_told_so(name):
    bench = Bench(name).enable()
    epoch = bench.operation.epoch
    bench.host.stop()
    stale = bench.host.ask(ops.GO if name == "rotary_table" else ops.MOVE_BY, 1.0, epoch=epoch)
    at = bench.answer.commanded
    bench.pass_time(0.2)
    assert bench.host.ending(stale) == Ending(stale, ops.REFUSED, ops.STALE, 0)
    assert bench.answer.commanded == pytest.approx(at, abs=1e-4)


def stop_bound(bench: Bench, speed: float, acceleration: float) -> float:
    """Largest way of a stop.

    Specification, test 14: v^2 / 2a + v a / 2j + v T. That is of an axis that speeds up no more. While it does, with b,
    the stop first takes b away: it makes v b/j + b^3 / 3j^2 in that, and gains b^2 / 2j of speed.
    """
    spec, name = bench.spec, bench.spec.axis.method
    most = spec.method.command_acceleration if name == "filtered_servo" else spec.limits.acceleration
    # A table hears of it at a look, then with its next task and interrupt, and goes on to a whole count.
    late = bench.loop.period * 1e-9
    if name == "rotary_table":
        late += spec.method.task_period + 2 * spec.method.strobe_period
    if name == "cascade":
        jerk, more = spec.limits.jerk, max(acceleration * math.copysign(1.0, speed), 0.0)
        first, speed = abs(speed) * more / jerk + more**3 / (3 * jerk**2), abs(speed) + more**2 / (2 * jerk)
        return first + speed**2 / (2 * most) + speed * most / (2 * jerk) + speed * late
    speed = min(abs(speed) + most * late, spec.limits.speed) if most else abs(speed)  # it may speed up until it hears
    return (speed**2 / (2 * most) if most else 0.0) + speed * late + 2.0 * bench.grain


def stops_from_random_states(name: str, times: int, seed: int) -> None:
    """Jogs and moves, stopped at any moment of any phase: rest within the bound, no reversal, nothing steps."""
    rng, bench = Random(seed), Bench(name).enable()
    bench.host.axis.live.operation.lease_looks = 1 << 40  # type: ignore[attr-defined]
    top, rows_of = bench.spec.limits.speed, bench.host.scope.rows
    for _ in range(times):
        if name == "rotary_table" or rng.random() < 0.5:
            bench.host.ask(ops.JOG, rng.choice((-1.0, 1.0)) * rng.uniform(0.02, 1.0) * top)
        else:
            bench.host.ask(ops.MOVE_TO, rng.uniform(0.0, bench.spec.limits.travel), rng.uniform(0.05, 1.0))
        bench.host.run(rng.choice((1, 3, rng.randrange(1, 60), rng.randrange(1, 700))))
        # Turned round under way; a table then takes its angle over, which is a step of its lag.
        if name != "rotary_table" and rng.random() < 0.3:
            bench.host.ask(ops.JOG, rng.uniform(-1.0, 1.0) * top)
            bench.host.run(rng.randrange(1, 200))
        row = int(bench.loop.rows)
        at, speed = bench.answer.commanded, bench.answer.commanded_velocity
        now = bench.host.axis.memory.course.acceleration if name == "cascade" else 0.0  # type: ignore[attr-defined]
        # While it still speeds up, the speed that counts is the one that is left when the acceleration is taken away.
        counts = speed + (now * abs(now) / (2 * bench.spec.limits.jerk) if now else 0.0)
        bench.host.stop()
        bench.host.run(1200)
        rows, _, _ = rows_of(row)
        places = rows["operation.answer.commanded"]
        assert bench.answer.rests
        assert bench.operation.fault == 0
        if speed * counts >= 0.0:  # it is not about to turn round
            way, heading = np.max(np.abs(places - at)), math.copysign(1.0, counts) if counts else 0.0
            assert way <= stop_bound(bench, speed, now), (speed, now)
            assert np.all(np.diff(places) * heading >= -1.5 * bench.grain)
        if name == "cascade":
            assert np.max(np.abs(np.diff(places, prepend=at))) <= top * 1e-3 * (1 + 1e-6) + 1e-12
            assert np.all((places >= -1e-9) & (places <= bench.spec.limits.travel + 1e-9))


@pytest.mark.parametrize("name", ["cascade", "rotary_table", "filtered_servo"])
def test_14_a_stop_comes_to_rest_within_its_bound(name):
    stops_from_random_states(name, 60, 14)


@pytest.mark.wide
@pytest.mark.parametrize("name", ["cascade", "rotary_table", "filtered_servo"])
def test_14_twenty_thousand_stops(name):
    stops_from_random_states(name, 6_700, 15)


@pytest.mark.parametrize("name", OPERATED)
def test_16_off_takes_the_torque_in_the_same_period(name):
    """At rest, in a move or jog, while a stop runs out, in a quick stop and in a fault."""
    for phase in range(5):
        bench = Bench(name).enable()
        if phase:
            bench.host.ask(ops.GO, 1.0) if name == "rotary_table" else bench.host.ask(ops.MOVE_BY, 0.02)
            bench.pass_time(0.06)
        if phase == 2:
            bench.host.stop()
        if phase == 3:
            bench.host.ask(ops.ORDER, 5.0)
        if phase == 4:
            bench.loop.delay_at, bench.loop.delay = bench.loop.periods + 1, 6 * bench.loop.period
        bench.host.run(2)
        bench.host.off()
        bench.host.run(1)
        lines = bench.host.axis.state.lines  # type: ignore[attr-defined]
        assert not getattr(lines, "run" if name == "filtered_servo" else "enable")
        assert bench.host.state == ("fault" if phase == 4 else "switch on disabled")


def test_16_off_leaves_no_pulse_commanded():
    """A filtered servo that is switched off under way generates no more of them."""
    bench = Bench("filtered_servo").enable()
    bench.host.ask(ops.MOVE_BY, 0.1)
    bench.pass_time(0.2)
    bench.host.off()
    bench.host.run(20)
    assert len({place for place, _ in bench.watch(0.05)}) == 1
    assert bench.answer.commanded_velocity == 0.0


def test_17_enabling_takes_the_position_over():
    """The load is moved by hand while the axis is off."""
    bench = Bench("cascade").enable()
    bench.host.off()
    bench.pass_time(0.05)
    machine = bench.host.axis.state.plant.machine  # type: ignore[attr-defined]
    for mass in (machine.motor, machine.load):
        mass.position += 0.037
    bench.host.axis.state.lines.motor.count += 37_000  # type: ignore[attr-defined]
    bench.pass_time(0.05)
    assert bench.do(ops.ENABLE).how == ops.DONE
    efforts = []
    for _ in range(20):
        bench.host.run(1)
        efforts.append(abs(bench.answer.effort))
    assert bench.answer.commanded == pytest.approx(0.057, abs=2e-6)
    assert bench.answer.position == pytest.approx(bench.answer.commanded, abs=2e-6)
    assert max(efforts) < 0.01


@pytest.mark.parametrize("name", ["cascade", "rotary_table", "filtered_servo"])
def test_18_a_jog_that_nobody_keeps_stops_within_its_lease(name):
    bench = Bench(name).enable()
    jog = bench.host.ask(ops.JOG, 0.02)
    for _ in range(10):
        bench.pass_time(0.1)
        bench.host.ask(ops.KEEP)
        assert bench.host.ending(jog) is None
    bench.host.run(1)
    speeds = [speed for _, speed in bench.watch(0.7)]
    period = bench.loop.period * 1e-9
    full = speeds[0]
    slower = next(k for k, speed in enumerate(speeds) if abs(speed) < 0.999 * abs(full))
    look = bench.host.axis.live.look_ticks * bench.host.axis.tick  # type: ignore[attr-defined]
    assert 0.15 < (slower + 1) * period <= 0.2 + period + look + 0.02 * (name == "rotary_table")
    assert bench.host.ending(jog) == Ending(jog, ops.FAILED, ops.LEASE_LOST, 0)
    assert bench.answer.rests


BAD = {
    "nan": (ops.MOVE_TO, math.nan, 1.0, {}, ops.NOT_FINITE),
    "infinite": (ops.MOVE_TO, math.inf, 1.0, {}, ops.NOT_FINITE),
    "huge": (ops.MOVE_TO, 1e300, 1.0, {}, ops.NOT_FINITE), "share": (ops.MOVE_TO, 0.03, 0.0, {}, ops.NOT_FINITE),
    "more than all": (ops.MOVE_TO, 0.03, 1.5, {}, ops.NOT_FINITE), "unknown": (99, 0.0, 1.0, {}, ops.UNKNOWN),
    "zero": (0, 0.0, 1.0, {}, ops.UNKNOWN), "stale": (ops.MOVE_TO, 0.03, 1.0, {"epoch": -1}, ops.STALE),
    "from the future": (ops.MOVE_TO, 0.03, 1.0, {"epoch": 77}, ops.STALE),
    "second commander": (ops.MOVE_TO, 0.03, 1.0, {"client": 2}, ops.SECOND),
}  # fmt: skip


@pytest.mark.parametrize("what", BAD)
@pytest.mark.parametrize("name", MOVED)
def test_19_what_makes_no_sense_is_refused_and_changes_nothing(name, what):
    bench = Bench(name).enable()
    kind, value, speed, more, why = BAD[what]
    before, at = bench.host.state, bench.answer.commanded
    bad = bench.do(kind, value, speed, **more)
    assert (bad.how, bad.why) == (ops.REFUSED, why)
    bench.pass_time(0.05)
    assert (bench.host.state, bench.answer.commanded, bench.operation.running) == (before, at, 0)


def test_19_a_doubled_request_is_done_once():
    bench = Bench("cascade").enable()
    move = bench.host.ask(ops.MOVE_BY, 0.01)
    bench.host.until_ended(move)
    box, taken = bench.host.board.inbox, bench.operation.taken
    k = (taken - 1) % 1024
    write = [box.kind[k], box.id[k], box.epoch[k], box.client[k], box.value[k], box.speed[k]]
    at = bench.answer.commanded
    for column, old in zip(("number", "kind", "id", "epoch", "client", "value", "speed", "check"),
                           (taken, *write, box.check[k]), strict=True):  # fmt: skip
        getattr(box, column)[(k + 1) % 1024] = old
    box.written += 1
    bench.pass_time(0.1)
    assert (bench.operation.taken, bench.answer.commanded) == (taken, at)


@pytest.mark.parametrize("name", MOVED)
def test_20_soft_limits_hold(name):
    bench = Bench(name).enable()
    travel = bench.spec.limits.travel
    for kind, value in (
        (ops.MOVE_TO, travel + 1e-3),
        (ops.MOVE_TO, -1e-3),
        (ops.MOVE_BY, travel),
        (ops.MOVE_BY, -travel),
    ):
        refused = bench.do(kind, value)
        assert (refused.how, refused.why) == (ops.REFUSED, ops.BEYOND)
    if name == "phase_servo":  # it takes moves only
        return
    for side, end in ((1.0, travel), (-1.0, 0.0)):
        jog = bench.host.ask(ops.JOG, side * bench.spec.limits.speed)
        for _ in range(2000):
            bench.pass_time(0.05)
            bench.host.ask(ops.KEEP)
            if bench.answer.rests:
                break
        assert bench.answer.rests
        bench.pass_time(0.15)
        assert abs(bench.answer.position - end) <= 2e-4
        assert bench.operation.fault == 0
        bench.host.stop()
        bench.pass_time(0.05)
        assert bench.host.ending(jog).how in {ops.ABORTED, ops.FAILED}
        assert bench.do(ops.MOVE_BY, -side * 1e-2).how == ops.DONE  # back inside is always allowed


@pytest.mark.parametrize("creep", [0.1, 0.04])
@pytest.mark.parametrize("name", ["cascade", "filtered_servo"])
def test_21_an_axis_without_a_reference_creeps(name, creep):
    bench = Bench(name) if creep == 0.1 else Bench(name, f"axis.creep={creep * 100:g} %")
    bench.operation.trust = ops.NOT_KNOWN
    bench.enable()
    refused = bench.do(ops.MOVE_TO, 0.03)
    assert (refused.how, refused.why) == (ops.REFUSED, ops.UNREFERENCED)
    bench.host.ask(ops.MOVE_BY, -0.015)
    speeds = [abs(speed) for _, speed in bench.watch(0.2)]
    assert max(speeds) == pytest.approx(creep * bench.spec.limits.speed, rel=1e-3)
    bench.host.stop()
    bench.pass_time(0.3)
    bench.host.off()
    bench.host.run(1)
    assert bench.do(ops.TRUST, ops.REFERENCED).how == ops.DONE
    bench.enable()
    assert bench.do(ops.MOVE_TO, 0.03).how == ops.DONE


# ---- methods live


@pytest.mark.wide
def test_24_the_table_jogs_for_ever_and_then_goes_to_a_number():
    bench = Bench("rotary_table").enable()
    turns = 10_000
    bench.host.axis.live.operation.lease_looks = 1 << 40  # type: ignore[attr-defined]
    bench.host.ask(ops.JOG, bench.spec.limits.speed)
    bench.pass_time(turns * 2 * math.pi / bench.spec.limits.speed)
    bench.host.stop()
    bench.pass_time(5.0)
    assert bench.answer.rests
    assert bench.answer.position / (2 * math.pi) > turns - 2
    positioner = bench.host.axis.state.controller.positioner  # type: ignore[attr-defined]
    expected = Bench("rotary_table").enable()
    assert bench.do(ops.GO, 3).how == expected.do(ops.GO, 3).how == ops.DONE
    other = expected.host.axis.state.controller.positioner  # type: ignore[attr-defined]
    period = bench.host.axis.params.controller.positioner.angle.period  # type: ignore[attr-defined]
    assert positioner.angle.aar % period == other.angle.aar % period
    assert (positioner.s4, positioner.state, positioner.oar) == (other.s4, other.state, other.oar)


@pytest.mark.parametrize("name", OPERATED)
def test_28_a_session_is_repeated_from_its_requests(name):
    """Requests of every kind at random moments, pulls of both lines; the controller's bytes are the same."""
    rng = Random(28)
    first = Bench(name).enable()
    kinds = (ops.MOVE_BY, ops.MOVE_TO, ops.JOG, ops.GO, ops.KEEP, ops.STOP, ops.ENABLE, ops.CONFIRM, ops.RESET, ops.OFF)
    for _ in range(60):
        kind = rng.choices(kinds, weights=(9, 5, 5, 9, 9, 3, 5, 5, 2, 1))[0]
        first.host.ask(
            kind, rng.choice((1, 2, 3)) if kind == ops.GO else rng.uniform(-0.02, 0.04), rng.uniform(0.2, 1.0)
        )
        if rng.random() < 0.1:
            rng.choice((first.host.stop, first.host.off))()
        first.host.run(rng.randrange(1, 150))
    second = Bench(name)
    repeat(second.host, first.host.log, first.loop.periods)
    assert second.loop.periods == first.loop.periods
    for part in ("controller", "lines", "plant"):
        ones, others = getattr(first.host.axis.state, part), getattr(second.host.axis.state, part)
        assert diff(ones, others) == {}
    assert diff(first.operation, second.operation) == {}


def test_03_a_blocked_load_is_the_same_fault_in_the_same_sample():
    """Live and in a simulation by the host of `detent run`: the load is held from the same sample on."""
    from detent.methods.cascade.host import CascadeHost

    live = Bench("cascade", period=0.25e-3).enable()  # a sample
    axis: Any = live.host.axis
    live.host.ask(ops.MOVE_BY, 0.3)
    live.pass_time(0.25)
    run = CascadeHost(live.spec)
    # The simulation begins where the live axis stands, and is led by the course that it would have followed.
    run.state.restore(axis.state.snapshot())
    course, limits = axis.memory.course.copy(), axis.memory.limits
    path: list[tuple[float, float, float]] = []
    for _ in range(4000):
        advance_course(limits, course, run.period)
        path.append((course.position, course.velocity, course.acceleration))
    run.feed, run.controller.entry = along(*(np.array(column) for column in zip(*path, strict=True))), 0

    def held(machine: Any) -> None:
        machine.load.velocity = machine.motor.velocity = 0.0

    faults = []
    for state, once in ((axis.state, lambda: live.host.run(1)), (run.state, lambda: run.pass_samples(1))):
        for _ in range(2000):
            held(state.plant.machine)
            once()
            if state.controller.guard.code:
                break
        faults.append((state.controller.guard.code, state.controller.samples))
    assert faults[0] == faults[1]
    assert faults[0][0] in {FOLLOWING, STUCK}
    live.host.run(1)
    assert live.operation.fault == faults[0][0]
    assert live.host.state in {"fault reaction active", "fault"}


@pytest.mark.parametrize("machine", [AxisMachine, PulseMachine])
def test_12_invariants_hold_whatever_is_asked(machine):
    run_machine(machine, 12, 8, 60)


def test_12_a_slide_that_a_fault_has_taken_the_torque_from_is_commanded_nothing_any_more():
    """It had a goal left: it never said that it rests, and showed a speed of its command for ever."""
    bench = Bench("filtered_servo").enable()
    bench.host.ask(ops.MOVE_BY, 0.1)
    bench.pass_time(0.1)
    bench.host.ask(*injection_of(bench.host.axis.places, "encoder stuck"))
    while bench.host.state != "fault":
        bench.host.run(1)
    bench.pass_time(0.1)
    assert (bench.answer.rests, bench.answer.commanded_velocity) == (1, 0.0)


THOUSAND = [*enumerate([60] * 10 + [100] * 7 + [200] * 3)]  # parts of 50 sequences, and how many rules each has
FIRST = {0, 10, 17}  # that every change meets


@pytest.mark.parametrize(("part", "steps"), [
    pytest.param(*one, marks=pytest.mark.wide if one[0] in FIRST else pytest.mark.long) for one in THOUSAND
])  # fmt: skip
def test_12_invariants_hold_in_a_thousand_sequences(part, steps):
    """Sequences of 60 to 200 rules, of which each is a command or more, or a fault; 1,000 of 50 commands or more."""
    run_machine(AxisMachine, part, 50, steps)


@pytest.mark.parametrize(
    "part", [pytest.param(part, marks=pytest.mark.wide if part < 2 else pytest.mark.long) for part in range(4)]
)
def test_12_no_pulse_is_lost_whatever_is_asked(part):
    run_machine(PulseMachine, part, 50, 100)


# ---- methods live, against `detent run`


def at_rest(c: Any) -> list[float]:
    """What a controller of a move servo holds when its move is over."""
    if hasattr(c, "deviation"):
        return [c.deviation.position, c.deviation.deviation, c.generator.command, c.generator.goal, c.speed.word,
                round(c.deviation.error, 3), round(c.filter.output, 3)]  # fmt: skip
    q = c.sequencer
    return [q.position, q.distance, q.remaining, q.state, q.mode, q.direction, c.speed.word, c.law.integral, c.law.word,
            c.converters.tracking.reference, c.converters.absolute.word]  # fmt: skip


@pytest.mark.parametrize("name", ["phase_servo", "filtered_servo"])
def test_26_moves_live_are_those_of_a_run(name):
    """Fifty moves: at rest, position, command and error of the controller are those that the host of a run leaves."""
    rng = Random(26)
    live = Bench(name, "detector.jitter=0 s") if name == "phase_servo" else Bench(name)
    live.enable()
    from detent.methods.moves.job import Move
    from detent.methods.registry import METHODS

    method = METHODS[live.spec.axis.method]
    run: Any = method.brought(method.commands)(live.spec)  # type: ignore[attr-defined]
    run.start()
    ones, others = live.host.axis.state.controller, run.controller  # type: ignore[attr-defined]
    axis: Any = live.host.axis.state

    def bring(tick: int) -> None:
        """Let the run's time pass up to that of the live axis, answering what its controller tells its host."""
        while run.machine.state.tick < tick:
            run.machine.pass_ticks(tick - run.machine.state.tick)
            getattr(others, "sequencer", others).event = 0

    for _ in range(50):
        target = run.home + round(rng.uniform(0.05, 0.95) * live.spec.limits.travel / run.grid) * run.grid
        target = min(max(target, 0.0), live.spec.limits.travel)
        bring(axis.tick)
        run.command(run.place(Move(number=1, row=0, target=target), target))
        assert live.do(ops.MOVE_TO, target).how == ops.DONE
        live.pass_time(0.3)
        bring(axis.tick)
        assert at_rest(ones) == at_rest(others)
        assert live.answer.position == pytest.approx(target, abs=2.5 * run.count)


def test_27_fifty_moves_live_end_in_the_window_and_are_repeated():
    rng = Random(27)
    live = Bench("cascade", speed=10.0).enable()
    for _ in range(50):
        target = rng.uniform(0.0, live.spec.limits.travel)
        assert live.do(ops.MOVE_TO, target, rng.uniform(0.1, 1.0)).how == ops.DONE
        assert abs(live.answer.position - target) <= live.spec.method.in_position
    again = Bench("cascade", speed=10.0)
    repeat(again.host, live.host.log, live.loop.periods)
    assert diff(live.host.axis.state, again.host.axis.state) == {}


@in_wall_time
@pytest.mark.parametrize(("turns", "seconds"), [(6, 0.7), pytest.param(2, 20.0, marks=pytest.mark.long)])
def test_05_a_busy_thread_of_python_does_not_delay_the_loop(turns, seconds):
    """A thread that computes without yielding, beside the loop and beside one written in Python, in the same run.

    With and without it by turns; of each the best turn counts, for whatever else the machine does comes and goes.
    Without real-time priority the thread takes a processor away, too; then it is compared with the loop in Python only.
    """
    period, busy, left = 1e-3, threading.Event(), threading.Event()
    bench = Bench("filtered_servo", wall=True)

    def compute() -> None:
        while not left.is_set():
            if busy.is_set():
                sum(range(1000))
            else:
                busy.wait(0.01)

    def misses(seconds: float) -> float:
        ran, skipped = int(bench.loop.periods), int(bench.loop.skipped)
        while bench.loop.periods - ran < seconds / period:
            time.sleep(0.05)
        ran, skipped = bench.loop.periods - ran, bench.loop.skipped - skipped
        return skipped / (ran + skipped)

    hog = threading.Thread(target=compute, daemon=True)
    hog.start()
    missing = bench.host.start()
    alone, beside, late = [1.0], [1.0], [1.0]
    for _ in range(turns):
        alone.append(misses(seconds))
        busy.set()
        beside.append(misses(seconds))
        late.append(python_loop(200, period))
        busy.clear()
    bench.host.close()
    left.set()
    hog.join()
    assert min(late) > 0.2
    assert min(beside) <= (0.1 * min(late) if missing else 1.5 * min(alone) + 0.002)


def python_loop(periods: int, period: float) -> float:
    """Share of periods that a loop in plain Python comes to a whole period late."""
    late, deadline = 0, time.monotonic()
    for _ in range(periods):
        deadline += period
        time.sleep(max(0.0, deadline - time.monotonic()))
        if time.monotonic() - deadline >= period:
            late += 1
            deadline = time.monotonic()
    return late / periods


STOPS = 20_000


SHARE = 0.9  # of the mutants, that the module's own tests must kill


EVERY = 60  # mutants of which the ordinary tests take one


@pytest.mark.parametrize(
    "stops", [2000, pytest.param(STOPS, marks=pytest.mark.wide), pytest.param(1_000_000, marks=pytest.mark.long)]
)
def test_14_a_stop_is_short_without_reversal_inside_the_limits_and_continuous(stops):
    """The rig checks each sample: finite, |v|, |a|, |j| within their limits, no step of the command."""
    rng, phases = random.Random(14), Counter[str]()
    for _ in range(stops):
        p, c = under_way(rng)
        x, v, a = c.position, c.velocity, c.acceleration
        most, jerk, level = p.acceleration, p.jerk, course.level_speed(p.jerk, v, a)
        low, high = excursions(COMPILED, c)
        course.come_to_rest(p, c)
        assert c.end - x == pytest.approx(shortest_stop(v, a, most, jerk), rel=1e-9, abs=1e-12)
        period = rng.uniform(0.05, 0.3) * (p.speed / most + most / jerk)
        states = follow(COMPILED, p, c, min(period, 1.0))
        assert all(p.lowest <= one[0] <= p.highest for one in states)
        assert all(low - 1e-12 <= one[0] <= high + 1e-12 for one in states)
        if v * level >= 0.0:
            assert abs(c.position - x) <= bound(v, a, most, jerk, period) + 1e-12
            assert turns(states) == 0
        else:  # an acceleration against the speed, too large to be taken away before the speed is gone: one turn
            ahead, back = (high - x, high - c.position) if v > 0.0 else (x - low, c.position - low)
            assert ahead <= bound(v, 0.0, most, jerk, period) + 1e-12
            assert back <= bound(level, 0.0, most, jerk, abs(a) / jerk) + 1e-12
            assert turns(states) <= 1
        phases["at rest" if v == a == 0.0 else "turning" if v * level < 0.0 else "speeding up" if v * a > 0.0 else
               "slowing down" if v * a < 0.0 else "steady"] += 1  # fmt: skip
    assert min(phases[name] for name in ("turning", "speeding up", "slowing down", "steady")) > stops / 50, phases


def test_14_the_bound_of_the_specification_is_too_short_while_the_axis_speeds_up():
    """v^2 / 2 a + v a / 2 j + v T, to the letter: no stop within the jerk can be that short. In exact fractions.

    At v = 0.5 m/s and a = 5 m/s^2, with limits of 5 m/s^2 and 100 m/s^3: taking the acceleration away lasts 50 ms and
    carries the axis 29.2 mm; then it goes at 0.625 m/s, and needs 54.7 mm more.
    """
    v, a, most, jerk, latency = Fraction(1, 2), Fraction(5), Fraction(5), Fraction(100), Fraction(1, 1000)
    t = a / jerk
    carried = v * t + a * t**2 / 2 - jerk * t**3 / 6
    level = v + a**2 / (2 * jerk)
    rest = level**2 / (2 * most) + level * most / (2 * jerk)
    assert (carried, level, rest) == (Fraction(7, 240), Fraction(5, 8), Fraction(7, 128))
    to_the_letter = v**2 / (2 * most) + v * most / (2 * jerk) + v * latency
    assert float(carried + rest) == pytest.approx(0.0838542, rel=1e-6)
    assert float(to_the_letter) == 0.038
    # Not by the speed that counts alone, either; with the time that the acceleration takes, it is.
    assert carried + rest > rest + level * latency
    assert carried + rest <= rest + level * (latency + t)
    assert shortest_stop(0.5, 5.0, 5.0, 100.0) == pytest.approx(float(carried + rest), rel=1e-15)


def test_15_every_branch_is_taken_by_its_own_tests():
    files = [str(path) for path in test_course.SOURCES]
    done = subprocess.run(
        [sys.executable, "-c", COVERED, *files],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": os.pathsep.join([str(ROOT / "src"), str(ROOT)])},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    found = json.loads(done.stdout)["files"].values()
    assert [(one["missing_lines"], one["missing_branches"]) for one in found] == [([], [])] * len(files)
    assert sum(one["summary"]["num_branches"] for one in found) > 60


def test_15_its_own_tests_kill_some_of_its_mutants():
    hunt = hunted(EVERY)
    assert hunt.count >= 10
    assert len(hunt.alive) <= 0.3 * hunt.count, hunt.alive  # of so few, many may happen to change nothing


@pytest.mark.wide
def test_15_its_own_tests_kill_its_mutants(record_property):
    hunt = hunted(1)
    record_property("mutants", [hunt.count, *hunt.alive])
    assert hunt.count > 500
    assert len(hunt.alive) <= (1 - SHARE) * hunt.count, "\n".join(hunt.alive)


def test_15_a_test_that_looks_at_nothing_kills_nothing(monkeypatch):
    """The hunt itself can fail."""
    monkeypatch.setattr(live_course, "own_tests", lambda: [lambda _: None])
    hunt = hunted(4 * EVERY)
    assert len(hunt.alive) > 0.5 * hunt.count


STATES = 200  # random ones that an axis is stopped from


@pytest.mark.compiled
def test_25_an_end_position_moved_during_a_run_shortens_the_ramp():
    """As specification stepper-envelope 3.6 and its tests 18 and 19; step by step as the simulation of that change."""
    for new, stop in ((6000, 6000), (3300, 3300)):
        axis = Stepper(*PLAIN)
        move = axis.host.ask(ops.MOVE_TO, 0.04)
        axis.until(3000)
        at = int(axis.rule.position)
        end = axis.host.ask(ops.UPPER, axis.table.position_of(new))
        axis.host.run(1)
        ending = axis.host.ending(move)
        assert ending is not None
        assert (ending.how, ending.by) == (ABORTED, end)
        peak = 0
        while axis.rule.position < new - 230 and not axis.answer.rests:
            peak = max(peak, int(axis.rule.index))
            axis.host.run(1)
        assert new < 4000 or peak == 227  # at full speed up to the new ramp
        axis.until_rest()
        assert axis.rule.position == stop
        simulated = StageHost(axis.spec)
        change = StopChange(axis.table.position_of(at), axis.table.position_of(new))
        task = StageMove(1, 0, targets={"group_a": 0.04}, change=change)
        assert not simulated.run(task)[1]
        motor = simulated.stage.motors["group_a"]
        assert motor.controller.timer.pulses == axis.state.controller.timer.pulses == stop
        assert axis.lost() == 0
        simulated.stage.pass_time(0.2)
        assert motor.r.plant.rotor.angle == axis.state.plant.rotor.angle
        assert motor.r.plant.rotor.peak_lag == axis.state.plant.rotor.peak_lag


@pytest.mark.compiled
def test_25_an_end_nearer_than_the_motor_can_stop_is_overrun_without_a_lost_step():
    axis = Stepper(*PLAIN)
    axis.host.ask(ops.MOVE_TO, 0.04)
    axis.until(3000)
    at, k = int(axis.rule.position), int(axis.rule.index)
    axis.host.ask(ops.UPPER, axis.table.position_of(3100))
    places = axis.until_rest()
    assert k == 227
    assert axis.rule.position == at + k
    assert places == sorted(places)
    assert axis.host.axis.memory.overruns == 1
    assert axis.lost() == 0
    outward = axis.host.until_ended(axis.host.ask(ops.MOVE_BY, 0.001))
    assert (outward.how, outward.why) == (REFUSED, ops.BEYOND)
    assert axis.host.until_ended(axis.host.ask(ops.MOVE_TO, axis.table.position_of(3100))).how == DONE
    assert axis.rule.position == 3100


@pytest.mark.compiled
def test_25_an_end_moved_outwards_lets_a_jog_rise_again():
    axis = Stepper(*PLAIN)
    axis.host.ask(ops.UPPER, axis.table.position_of(6000))
    jog = axis.host.ask(ops.JOG, 0.02)
    slowest = 0
    for _ in range(4000):
        axis.host.ask(ops.KEEP)
        axis.host.run(1)
        if axis.rule.position >= 5900 and not slowest:
            slowest = int(axis.rule.index)
            axis.host.ask(ops.UPPER, axis.table.position_of(8000))
        if axis.rule.position >= 6050:
            break
    assert 0 < slowest < 120
    assert axis.rule.index > slowest
    for _ in range(700):
        axis.host.ask(ops.KEEP)
        axis.host.run(1)
    assert axis.rule.position == 8000
    assert axis.host.ending(jog) is None
    axis.host.ask(ops.JOG, 0.0, id=jog)
    assert axis.host.until_ended(jog).how == DONE
    assert axis.lost() == 0


@pytest.mark.compiled
def test_14_a_stepper_stops_from_every_state_by_its_ramp():
    axis, chance = Stepper(), random.Random(14)
    host, seen = axis.host, set[int]()
    todo = moves(chance, 0.0, 0.04, 0.02)
    for _ in range(STATES):
        for _ in range(chance.choice((1, 1, 2))):  # the second may find the first under way, and turn it round
            kind, value, share = next(todo)
            host.ask(kind, value, share)
            host.run(chance.randrange(1, 150))
        at, k, direction = int(axis.rule.position), int(axis.rule.index), int(axis.rule.direction)
        seen.add(int(axis.rule.state))
        host.stop()
        places = axis.until_rest()
        steps = [b - a for a, b in pairwise(places)]
        assert all(one * direction >= 0 for one in steps)  # no reversal
        assert abs(places[-1] - at) == max(k, 0)  # by its ramp: an index a step
        assert 0 <= places[-1] <= 8000
        assert host.board.operation.last_stop <= (k + 6) * axis.table.step  # seen from the look before
    assert len(seen) >= 3
    assert axis.rule.cause != INFEASIBLE
    assert axis.lost() == 0


@pytest.mark.compiled
def test_28_a_session_with_moving_ends_repeats_itself():
    """The tables are edited by the loop, and so they are part of what a log repeats."""
    axis, chance = Stepper(), random.Random(28)
    host, todo = axis.host, moves(chance, 0.0, 0.04, 0.02)
    for _ in range(60):
        kind, value, share = next(todo)
        host.ask(kind, value, share)
        host.run(chance.randrange(1, 200))
        host.ask(chance.choice((ops.LOWER, ops.UPPER)), chance.uniform(0.0, 0.04))
        host.run(chance.randrange(1, 100))
        if chance.random() < 0.1:
            host.stop()
    axis.until_rest()
    assert axis.host.axis.memory.overruns > 0
    assert axis.lost() == 0
    again = Host(METHODS["stepper_envelope"], axis.spec, motor="group_a", wall=False)
    repeat(again, host.log, host.board.loop.periods)
    state: Any = again.axis.state
    assert bytes(state) == bytes(axis.state)
    assert [bytes(one) for one in again.axis.feed] == [bytes(one) for one in host.axis.feed]


@pytest.mark.compiled
@pytest.mark.parametrize("name", PAGES)
def test_23_the_print_head_prints_a_stream_live_as_a_run_does(name):
    """In the loop the head begins its first line when the host is ready, a while after it has come to rest."""
    if not PAGES[name].exists():
        pytest.skip("the recorded workloads (../shared/data) are not here")
    job, axis = load_job(PAGES[name]), Head(speed=10.0)
    measured = axis.memory.answered_us
    assert axis.host.until_ended(axis.host.work(job)).how == DONE
    live = axis.printed()
    fed = next(one.period for one in axis.host.log.asked if one.fields[1] == ops.FEED)
    begun = math.floor((fed - 1) * axis.host.board.loop.ticks)  # the tick in which that period begins
    waited = begun - (round(measured / PERIOD_US) + 1)

    simulated = SimulatedPrinting(axis.spec, job, None, lambda _share, _text: None)
    simulated.prepare()
    simulated.machine.pass_ticks(waited)
    simulated.print_all()
    same = simulated.finish()
    assert same.done
    assert live.done
    assert live.strikes == same.strikes
    assert (live.errors_right == same.errors_right).all()
    assert (live.errors_left == same.errors_left).all()
    assert (live.worst_error, live.rms_error) == (same.worst_error, same.rms_error)
    assert [one.speed_value for one in live.lines] == [one.speed_value for one in same.lines]

    run = print_job(axis.spec, job)  # its first line begins at once, before the last current has died away
    assert (live.characters, live.columns, live.missed) == (run.characters, run.columns, 0)
    assert [one.direction for one in live.lines] == [one.direction for one in run.lines]
    assert live.worst_error == pytest.approx(run.worst_error, abs=2e-6)
    assert live.print_time == pytest.approx(run.print_time, rel=0.05)


@pytest.mark.compiled
def test_14_a_print_head_stops_from_every_state_as_short_as_its_speed():
    axis, chance = Head(), random.Random(14)
    host, seen, fastest = axis.host, set[int](), 0.0
    todo = moves(chance, 0.0, 0.36, 1.0)
    for _ in range(STATES):
        for _ in range(chance.choice((1, 1, 2))):
            kind, value, share = next(todo)
            host.ask(kind, value, share)
            host.run(chance.randrange(1, 150))
        at, speed, heading = int(axis.head.emitter), axis.speed, math.copysign(1, axis.state.plant.train.velocity)
        seen.add(int(axis.head.state))
        fastest = max(fastest, speed)
        host.stop()
        places = axis.until_rest()
        assert host.state == "operation enabled"
        assert abs(places[-1] - at) <= longest_stop(speed)
        assert all((b - a) * heading >= -1 for a, b in pairwise(places))  # a stop swings back by an emitter at most
        assert 0 <= places[-1] <= axis.head.width
        assert (axis.head.drive_cmd, axis.head.state) == (0, IDLE)
    assert len(seen) >= 6
    assert fastest > 39.0


@pytest.mark.compiled
def test_14_a_print_head_stops_while_it_looks_for_its_frames_and_measures_itself():
    seen: set[int] = set()
    for moment in (5, 60, 400, 2000, *range(3300, 7500, 73)):
        axis = Head(enable=False)
        axis.host.ask(ops.ENABLE)
        axis.host.run(moment)
        at, speed = int(axis.head.emitter), axis.speed
        seen.add(int(axis.head.state))
        assert axis.memory.measuring
        axis.host.stop()
        places = axis.until_rest()
        assert abs(places[-1] - at) <= longest_stop(speed)
        assert axis.memory.identified == 0
    assert len(seen) >= 5
    host = axis.host
    assert host.until_ended(host.ask(ops.HOME)).how == DONE  # once more, and whole
    assert axis.memory.identified == 1
    assert host.until_ended(host.ask(ops.MOVE_TO, 0.1)).how == DONE


# ---- the store of a live axis


def copied(folder: Path, name: str) -> Path:
    """An axis file of one's own, beside which a store may lie."""
    return Path(shutil.copy(EXAMPLES / f"{name}.toml", folder / "axis.toml"))


def killed(axis: Any) -> None:
    """What a kill leaves: nothing is stopped, nothing is parked, and the store is let go as it is."""
    axis.link.host.keeper.close()


def test_33_an_axis_is_found_where_it_was_parked(tmp_path):
    file = copied(tmp_path, "rotary_table")
    with detent.live(file, wall=False) as axis:
        assert axis.status["trust"] == "referenced"
        axis.enable()
        axis.go_to(3)
        at = axis.position % (2 * math.pi)
    with detent.live(file, wall=False) as axis:
        assert axis.status["trust"] == "restored"
        assert axis.position == pytest.approx(at, abs=5e-5)
        counters = axis.link.host.keeper.store.counters
        assert (counters["starts"], counters["moves"]) == (2.0, 1.0)
        assert 0.0 < counters["enabled"] < 60.0


def test_33_what_was_killed_while_it_could_move_is_judged_by_its_sensor(tmp_path):
    """The table has an absolute sensor; the slide counts from where it is switched on."""
    for name, trust, why in (("rotary_table", "restored", "in motion"), ("filtered_servo", "unknown", "in motion")):
        file = copied(tmp_path, name)
        axis = detent.live(file, wall=False)
        axis.enable()
        killed(axis)
        with detent.live(file, wall=False) as axis:
            status = axis.status
            assert status["trust"] == trust
            assert why in status["store"]["position"]
        (tmp_path / "axis.toml.state").unlink()


def test_33_an_axis_that_was_off_and_still_is_parked_at_once(tmp_path):
    axis = detent.live(copied(tmp_path, "filtered_servo"), wall=False)
    host: Any = axis.link.host
    store = host.keeper.store
    assert store.saved.moving is False
    axis.enable()
    assert store.saved.moving is True
    axis.disable()
    host.run(90)  # not yet still for long enough
    assert store.saved.moving is True
    host.run(60)
    assert (store.saved.moving, store.saved.trust) == (False, "referenced")
    axis.enable()
    axis.disable()
    host.board.operation.trust = ops.NOT_KNOWN  # its controller has lost the count
    host.run(150)
    assert (store.saved.moving, store.saved.trust) == (False, "unknown")
    killed(axis)


def test_33_without_a_store_nothing_is_written(tmp_path):
    file = copied(tmp_path, "filtered_servo")
    for _ in range(2):
        with detent.live(file, wall=False, store=None) as axis:
            assert (axis.status["trust"], axis.status["store"]) == ("referenced", None)
    with detent.live(detent.example("filtered_servo.toml"), wall=False) as axis:
        assert axis.status["store"] is None
    assert [one.name for one in tmp_path.iterdir()] == ["axis.toml"]
    with detent.live(file, wall=False, store=tmp_path / "elsewhere.state"):
        pass
    assert sorted(one.name for one in tmp_path.iterdir()) == ["axis.toml", "elsewhere.state"]


@pytest.mark.parametrize(
    ("edit", "name"),
    [("limits.travel=0.4 m", "travel"), ("mechanics.travel_per_revolution=4 mm", "scale"),
     ("encoder.cycles_per_revolution=240", "scale")],
)  # fmt: skip
def test_35_a_live_axis_keeps_the_store_of_another_file_aside(tmp_path, edit, name):
    file = copied(tmp_path, "filtered_servo")
    with detent.live(file, wall=False):
        pass
    with detent.live(file, [edit], wall=False) as axis:
        status = axis.status
        assert status["trust"] == "unknown"
        assert f"{name}:" in status["store"]["aside"]
        assert "in the axis file" in status["store"]["aside"]
        assert (
            ("the position is not known: it creeps, and goes to no position", status["find"])
        ) in axis.why_not_moving
    assert len(list(tmp_path.glob("*.aside-*"))) == 1


def test_36_a_live_axis_that_was_moved_while_off_is_not_restored(tmp_path):
    file = copied(tmp_path, "rotary_table")
    with detent.live(file, wall=False):
        pass
    with detent.live(file, ["mechanics.start_angle=17 deg"], wall=False) as axis:
        status = axis.status
        assert status["trust"] == "unknown"
        assert "7 deg from where it was left" in status["store"]["position"]
        axis.enable()
        with pytest.raises(detent.DetentError, match="35"):
            axis.go_to(3)
        axis.disable()
        axis.do("trust", 1)  # a person confirms what the sensor shows
    with detent.live(file, wall=False) as axis:
        assert axis.status["trust"] == "restored"
        assert math.degrees(axis.position) == pytest.approx(17.0, abs=0.01)


class FailingDisk(sqlite3.Connection):
    """A disk that is full as long as it is told to be."""

    full = False

    def execute(self, sql, *arguments):
        if FailingDisk.full and sql.startswith("BEGIN"):
            error = sqlite3.OperationalError("database or disk is full")
            error.sqlite_errorcode = sqlite3.SQLITE_FULL
            raise error
        return super().execute(sql, *arguments)


def test_f55_no_motion_begins_that_could_not_be_marked(tmp_path):
    from detent.operate.session import Session
    from detent.operate.store import Store

    spec = Bench("filtered_servo").spec
    made = METHODS["filtered_servo"].sensors(spec)[""]
    store = Store(tmp_path / "axis.state", made, connect=lambda path: sqlite3.connect(
        path, timeout=0.0, isolation_level=None, check_same_thread=False, factory=FailingDisk))  # fmt: skip
    bench = Bench("filtered_servo", store=store)
    bench.host.run_until_ready()
    session = Session(bench.host, {})
    assert session.wait(session.ask("enable")).how == "done"
    FailingDisk.full = True
    try:
        assert session.wait(session.ask("move_by", 0.01)).how == "done"  # what may move already goes on
        assert session.wait(session.ask("disable")).how == "done"
        bench.pass_time(0.3)
        assert "full" in session.status()["store"]["trouble"]  # where it stands could not be kept
        assert session.wait(session.ask("enable")).how == "done"  # and the mark of the last motion stands
        session.wait(session.ask("disable"))
        FailingDisk.full = False
        bench.pass_time(0.3)
        assert session.status()["store"]["trouble"] == ""
        FailingDisk.full = True
        taken = bench.operation.taken
        refused = session.wait(session.ask("enable"))
        assert (refused.how, refused.code) == ("refused", 55)
        assert "axis.state" in refused.reason
        assert "full" in refused.reason
        assert (bench.operation.taken, bench.host.state) == (taken, "switch on disabled")
    finally:
        FailingDisk.full = False
    assert session.wait(session.ask("enable")).how == "done"
    bench.host.close()


# ---- positions


def test_46_positions_are_taught_gone_to_edited_undone_and_exported(tmp_path):
    with detent.live(copied(tmp_path, "filtered_servo"), wall=False) as axis:
        assert axis.positions == []
        axis.teach(3)
        axis.enable()
        axis.confirm()
        axis.move_to("40 mm")
        axis.teach("load")
        axis.go_to(3)
        assert axis.position == pytest.approx(0.02, abs=2.1e-5)
        axis.go_to("load")
        assert axis.position == pytest.approx(0.04, abs=2.1e-5)
        third, load = axis.positions
        assert (third["number"], third["name"], third["counts"]) == (3, "3", 4000)
        assert (load["number"], load["name"]) == (None, "load")
        assert load["used"] >= load["taught"]
        axis.do("edit", ["load", "0.2 in"])
        assert axis.positions[1]["position"] == pytest.approx(0.00508)
        axis.go_to("load")
        assert axis.position == pytest.approx(0.00508, abs=2.1e-5)
        axis.do("undo")
        assert axis.positions[1]["counts"] == load["counts"]
        axis.do("redo")
        assert axis.positions[1]["position"] == pytest.approx(0.00508)
        axis.do("rename", ["load", "unload"])
        axis.do("export", str(tmp_path / "places.csv"))
        axis.do("forget", "unload")
        axis.do("forget", "3")
        assert axis.positions == []
        axis.do("import", str(tmp_path / "places.csv"))
        assert [row["name"] for row in axis.positions] == ["3", "unload"]
    assert "0.00508" in (tmp_path / "places.csv").read_text()


@pytest.mark.parametrize(
    ("word", "value", "told"),
    [("go_to", "nowhere", "unknown position"), ("teach", "", "such as"), ("teach", None, "such as"),
     ("edit", ["3", "5 V"], "such as"), ("edit", "3", "such as"), ("edit", ["3", "9 m"], "within the travel"),
     ("edit", ["3", None], "such as"), ("rename", ["3", "load"], "a new one"), ("forget", "x", "unknown position"),
     ("import", "no.csv", "no.csv"), ("export", "places.txt", "places.txt"), ("teach", "a\nb", "characters")],
)  # fmt: skip
def test_46_what_no_position_can_be_is_told_and_changes_nothing(tmp_path, word, value, told):
    with detent.live(copied(tmp_path, "filtered_servo"), wall=False) as axis:
        axis.teach("3")
        axis.teach("load")
        before = axis.positions
        with pytest.raises(detent.DetentError, match=told):
            axis.do(word, value)
        assert axis.positions == before


def test_46_what_cannot_be_taught_now_is_refused(tmp_path):
    file = copied(tmp_path, "filtered_servo")
    with detent.live(file, wall=False) as axis:
        axis.enable()
        moves = axis.move_by("10 mm", wait=False)
        axis.link.host.run(100)
        with pytest.raises(detent.DetentError, match="111"):
            axis.teach("3")
        with pytest.raises(detent.DetentError, match="112"):
            axis.do("undo")
        session: Any = axis.link
        assert session.wait(session.ask("forget", "3", client=7)).code == ops.SECOND
        moves.wait()
        axis.disable()
        axis.do("trust", 0)
    with detent.live(file, wall=False, store=None) as axis, pytest.raises(detent.DetentError, match="keeps nothing"):
        axis.teach("3")
    with detent.live(file, wall=False) as axis:
        with pytest.raises(detent.DetentError, match="35"):
            axis.teach("3")
        axis.do("trust", 2)
        axis.teach("3")


def test_46_a_table_goes_to_its_own_numbers_and_to_those_that_were_taught(tmp_path):
    with detent.live(copied(tmp_path, "rotary_table"), wall=False) as axis:
        axis.teach("3")  # the table has a 3 of its own, which stays what it is
        axis.teach("77")
        axis.do("edit", ["camera", "200 deg"])
        axis.enable()
        axis.confirm()
        axis.go_to(3)
        assert math.degrees(axis.position) % 360 == pytest.approx(350.0, abs=0.01)
        axis.go_to("camera")
        assert math.degrees(axis.position) % 360 == pytest.approx(200.0, abs=0.01)
        axis.go_to(77)
        assert math.degrees(axis.position) % 360 == pytest.approx(10.0, abs=0.01)
        with pytest.raises(detent.DetentError, match="202"):
            axis.go_to(55)


# ---- faults


@pytest.mark.parametrize("name", ["cascade", "filtered_servo", "rotary_table"])
def test_37_a_tick_with_nothing_wrong_is_the_tick(name):
    """The tick that an injection needs, with a push of no force: the same bytes as the one without."""
    ones, others = Bench(name).enable(), Bench(name).enable()
    place = next(place for place, one in others.host.axis.places.items() if BLOCKED in one.kinds)
    others.host.ask(
        *injection_of(others.host.axis.places, f"{place} push 0 {others.host.axis.places[place].push_unit}")
    )
    ones.host.ask(ops.KEEP)
    for bench in (ones, others):
        bench.host.ask(*((ops.JOG, 0.5) if name == "rotary_table" else (ops.MOVE_BY, 5e-3)))
        bench.pass_time(0.4)
    assert others.host.board.injection.place
    assert diff(ones.host.axis.state, others.host.axis.state) == {}


def test_37_a_session_with_faults_is_repeated_to_the_same_bytes():
    first = Bench("cascade").enable()
    for text in (
        "encoder garbage",
        "nothing",
        "encoder intermittent",
        "nothing",
        "drive delayed 3 ms",
        "load push 50 N",
    ):
        first.host.ask(*injection_of(first.host.axis.places, text))
        for kind, value in ((ops.RESET, 0.0), (ops.ENABLE, 0.0), (ops.CONFIRM, 0.0), (ops.MOVE_BY, 0.01)):
            first.host.ask(kind, value)
            first.host.run(13)
        first.pass_time(0.2)
    assert first.host.board.faults.count > 1
    second = Bench("cascade")
    repeat(second.host, first.host.log, first.loop.periods)
    assert diff(first.host.axis.state, second.host.axis.state) == {}
    assert diff(first.operation, second.operation) == {}
    assert bytes(first.host.board.injection) == bytes(second.host.board.injection)


SAMPLE = [  # of the matrix: place, kind, state; what is found, after how long at most, whether the position is known
    ("cascade", "encoder", "stuck", "move", "F02", 0.052, False),
    ("cascade", "encoder", "intermittent", "rest", "F03", 0.022, False),
    ("cascade", "encoder", "off", "move", "F10", 0.025, True),
    ("cascade", "drive", "wrong", "power-up", "F04", 0.6, False),
    ("cascade", "drive", "stuck", "move", "F12", 0.07, False),
    ("cascade", "load", "blocked", "stop", "F02", 0.06, False),
    ("cascade", "load", "blocked", "rest", "nothing", 0.0, True),
    ("equipped", "encoder link", "intermittent", "move", "F01", 0.002, False),
    ("equipped", "load encoder", "stuck", "move", "F05", 0.1, False),
    ("equipped", "upper switch", "off", "move", "F30", 0.002, True),
    ("equipped", "both switches", "off", "rest", "F33", 0.002, True),
    ("filtered_servo", "encoder", "wrong", "move", "F04", 0.03, False),
    ("filtered_servo", "slide", "blocked", "move", "F02", 0.06, False),
    ("phase_servo", "carriage", "blocked", "move", "F02", 0.06, False),
    ("rotary_table", "fine resolver", "garbage", "rest", "F12", 0.05, False),
    ("rotary_table", "table", "blocked", "move", "F02", 0.1, False),
]


@pytest.mark.parametrize(("name", "place", "kind", "state", "found", "within", "known"), SAMPLE)
def test_37_a_fault_is_found_in_time_and_followed_as_its_rule_says(name, place, kind, state, found, within, known):
    check_cell(cell := live_faults.rig(name).cell(place, kind, state))
    assert (cell.found, cell.known) == (found, known)
    assert cell.seconds <= within


def check_cell(cell: live_faults.Cell) -> None:
    """Reaction, trust and recovery are those of its rule; a ramp may end in torque off, where it makes things worse."""
    if cell.code == 0:
        return
    rule = rule_of(cell.code)
    assert cell.code in RULES
    assert cell.reaction in {REACTION_NAMES[rule.reaction], "torque off"}
    assert rule.recovery != "H" or not cell.known
    assert not (cell.known and cell.wrong)
    assert cell.recovered.startswith("reset enable")
    assert cell.known or "reference" in cell.recovered or cell.name == "print_head"


@pytest.mark.wide
@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="minutes of six axes")
def test_37_every_fault_in_every_state_and_the_page_of_it():
    found = [one for name in live_faults.FILES for one in live_faults.run(name)]
    beside = [one for name in live_outside.EXAMPLES for one in live_outside.run(name)]
    assert len(found) >= 500
    for cell in found:
        check_cell(cell)
    check_beside(beside)
    assert live_faults.page(found, live_outside.page(beside)) == live_faults.PAGE.read_text("utf-8")


WITHIN = {31: 1e-3, 35: 1e-3, 43: 1e-3, 44: 1e-3, 50: 0.042, 51: 1e-3, 52: 0.008, 40: 0.033, 41: 0.201, 54: 1e-3}
"""Time in which each fault that is not of the machine must be told [s]."""


def check_beside(found: list[live_outside.Told]) -> None:
    """What was meant was told, in its time, and followed as its rule says; what is asked in vain is refused."""
    meant = {one.text: one.code for one in live_outside.TROUBLES}
    for one in found:
        assert one.code == meant[one.what], one
        assert one.seconds <= WITHIN[one.code] + 1e-9, one
        rule = REACTION_NAMES[rule_of(one.code).reaction]
        assert one.reaction in ({"refused"} if one.what.endswith("asked") else {rule, "torque off"}), one
        assert one.reaction == rule or one.code in (52, 54), one  # at rest a ramp has come to its end at once


def test_37_what_goes_wrong_beside_the_machine_is_told_in_every_state():
    check_beside(list(live_outside.run("cascade")))


def test_38_the_first_cause_is_kept_with_all_that_is_known_of_it():
    bench = Bench("cascade").enable()
    session = Session(bench.host, {"name": "x"})
    session.ask("inject", "encoder off")
    bench.host.ask(ops.MOVE_BY, 0.2)
    bench.pass_time(2.0)  # what follows from it comes, too: the axis rolls on under a dead encoder
    session.ask("inject", "nothing")
    bench.pass_time(0.5)
    (fault,) = session.faults()
    assert (fault["number"], fault["code"], bench.operation.fault) == (1, "F02", 2)
    assert (fault["position"], fault["reaction"], fault["unit"]) == ("lost", "torque off", "%")
    assert fault["limit"] == bench.spec.protection.stuck_effort < abs(fault["value"]) <= 1.0
    assert "sensor did not move" in fault["text"]
    assert fault["causes"]
    assert fault["steps"]
    assert fault["allowed"][:3] == ["reset", "enable", "home"]
    assert fault["time"] == pytest.approx(fault["period"] * 1e-3)
    assert session.status()["trust"] == "unknown"


@pytest.mark.parametrize("period", [1e-3, 0.25e-3])
def test_38_the_ring_is_kept_from_two_seconds_before_to_two_after(period):
    bench = Bench("cascade", period=period, channels=["lines.motor.count"]).enable()
    bench.pass_time(2.0)
    bench.host.ask(ops.MOVE_BY, 0.2)
    bench.pass_time(0.1)
    bench.host.ask(*injection_of(bench.host.axis.places, "encoder stuck"))
    bench.pass_time(20.0)  # the ring has come round since
    trace = bench.host.faults.trace(1)
    assert trace["time"][0] == pytest.approx(-2.0, abs=1e-9)
    assert trace["time"][-1] == pytest.approx(2.0, abs=1e-9)
    assert np.diff(trace["time"]) == pytest.approx(period)
    at = trace["time"].index(0.0)
    assert (trace["operation.fault"][at - 1], trace["operation.fault"][at]) == (0, 2)
    assert len(set(trace["lines.motor.count"][: at - round(0.06 / period)])) > 50
    assert len(set(trace["lines.motor.count"][at - round(0.04 / period) : at])) == 1
    with pytest.raises(DetentError, match="one of the last"):
        bench.host.faults.trace(2)


@pytest.mark.parametrize("name", ["cascade", "filtered_servo", "rotary_table"])
def test_39_a_few_seconds_without_a_fault(name):
    faults, motions = live_faults.false_alarms(name, 5.0)
    assert (faults, motions > 2) == (0, True)


@pytest.mark.wide
@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="minutes of six axes")
@pytest.mark.parametrize("name", live_faults.RUNS)
def test_39_minutes_without_a_fault(name):
    assert live_faults.false_alarms(name, 120.0)[0] == 0


@pytest.mark.long
@pytest.mark.parametrize("name", live_faults.RUNS)
def test_39_an_hour_without_a_fault(name):
    faults, motions = live_faults.false_alarms(name, 3600.0)
    assert (faults, motions > 300) == (0, True)


# ---- homing

REPEATS = {"contact": (2e-6, 6e-6, 2e-6), "switch": (-2e-6, 4e-6, 4e-6), "index": (-1e-6, 1e-6, 2e-6)}
"""Of each way: between what the zero lies [m], and within what it repeats [m]. A hard stop gives way under effort."""


def check_zeros(way: str, found: list[float]) -> None:
    """The same zero each time, and no better than a count and a sample let it."""
    lowest, highest, spread = REPEATS[way]
    assert lowest < min(found)
    assert max(found) < highest
    assert 0.0 < max(found) - min(found) < spread


@pytest.mark.parametrize("way", WAYS)
def test_22_homing_finds_the_same_zero(way):
    check_zeros(way, zeros(way, 3))


@pytest.mark.wide
@pytest.mark.parametrize("way", WAYS)
def test_22_homing_finds_the_same_zero_from_a_hundred_starts(way):
    check_zeros(way, zeros(way, 100))


def spoil(axis: Lost, what: str) -> None:
    """What goes wrong with switches and marks."""
    home = axis.axis.params.plant.home
    if what == "dead":
        home.present = 0
    elif what == "stuck on":
        home.edge = 10.0
    elif what == "no mark":
        home.pitch = 0.0
    elif what == "blocked":
        stop = axis.axis.params.plant.stop
        stop.side, stop.place = -1.0, axis.axis.state.plant.machine.load.position - 5e-4
        stop.stiffness, stop.damping = 1e8, 1e5


@pytest.mark.parametrize(
    ("way", "what", "code"),
    [("switch", "dead", 341), ("switch", "blocked", 341), ("index", "dead", 341), ("switch", "stuck on", 343),
     ("index", "no mark", 344)],
)  # fmt: skip
def test_22_homing_that_fails_says_why_and_knows_nothing(way, what, code):
    axis = Lost(way, Random(5), *BY_HAND)  # stiffer ones let the guard see the block, too, and switch off
    spoil(axis, what)
    axis.pass_time(0.002)
    failed = axis.do(ops.HOME)
    assert (failed.how, failed.why) == (ops.REFUSED, code)
    axis.pass_time(0.3)
    assert axis.answer.rests
    assert (axis.operation.trust, axis.operation.fault, axis.host.state) == (ops.NOT_KNOWN, 0, "operation enabled")
    assert axis.do(ops.MOVE_TO, 0.01).why == ops.UNREFERENCED
    assert axis.do(ops.MOVE_BY, 1e-4).how == ops.DONE


def test_22_a_switch_that_does_not_clear_fails_the_homing():
    axis = Lost("switch", Random(5))
    home = axis.host.ask(ops.HOME)
    while axis.axis.memory.homing.phase != homing.SEEN:
        axis.host.run(1)
    axis.axis.params.plant.home.edge = 10.0
    assert axis.host.until_ended(home).why == 342


@pytest.mark.parametrize("way", WAYS)
def test_22_a_stop_ends_a_homing_anywhere_and_the_position_stays_unknown(way):
    rng = Random(23)
    for _ in range(3):
        axis = Lost(way, rng)
        home = axis.host.ask(ops.HOME)
        axis.pass_time(rng.uniform(0.001, 0.4))
        assert axis.host.ending(home) is None
        speed = abs(axis.answer.commanded_velocity)
        at = axis.answer.commanded
        axis.host.stop()
        axis.pass_time(0.3)
        assert axis.host.ending(home) == Ending(home, ops.ABORTED, 0, 0)
        assert axis.answer.rests
        assert abs(axis.answer.commanded - at) <= stop_bound(axis, speed, 5.0)
        assert axis.operation.trust == ops.NOT_KNOWN
        assert axis.do(ops.HOME).how == ops.DONE  # and it can be begun again, from where that is
        assert axis.operation.trust == ops.REFERENCED


def test_22_a_homing_is_kept_and_found_in_the_store(tmp_path):
    file = copied(tmp_path, "cascade")
    with detent.live(file, ["limits.travel=20 mm", "mechanics.start_position=5 mm"], wall=False):
        pass
    with detent.live(file, ["limits.travel=20 mm"], wall=False) as axis:
        assert (axis.status["trust"], axis.status["find"]) == ("unknown", "home")
        axis.enable()
        axis.home()
        assert axis.status["trust"] == "referenced"
        reference = axis.link.host.keeper.store.reference
        assert (reference.number, reference.by) == (2, "homing")
        assert abs(axis.position - axis.link.host.axis.state.plant.machine.motor.position) < 4e-6
        axis.move_to("10 mm")


def test_22_a_table_homes_by_what_its_resolvers_show(tmp_path):
    file = copied(tmp_path, "rotary_table")
    with detent.live(file, wall=False):
        pass
    with detent.live(file, ["mechanics.start_angle=17 deg"], wall=False) as axis:
        assert axis.status["trust"] == "unknown"
        axis.enable()
        at = axis.position
        axis.home()
        assert (axis.status["trust"], axis.position) == ("referenced", at)
        axis.confirm()
        axis.go_to(3)


# ---- the panel, in a real browser

LEASE = 0.2  # of a jog [s]
WAYS = (
    "mouse up", "touch end", "key up", "blur", "hidden tab", "page closed", "context menu", "network cut",
    "a second of lag", "server killed",
)  # fmt: skip
# ---- drivers


def ready_on(bench: Bench) -> Bench:
    """Enabled on its drive, the position trusted, the first motion confirmed."""
    bench.pass_time(0.02)
    for kind, value in ((ops.TRUST, ops.REFERENCED), (ops.ENABLE, 0.0), (ops.CONFIRM, 0.0)):
        assert bench.do(kind, float(value)).how == ops.DONE
    bench.pass_time(0.02)
    assert bench.host.state == "operation enabled"
    return bench


def moved(bench: Bench) -> tuple[Ending, list[float]]:
    """A move of the example, and where it was at each exchange."""
    command, places = bench.host.ask(ops.MOVE_BY, 0.01), []
    while (ending := bench.host.ending(command)) is None:
        bench.host.run(1)
        places.append(bench.answer.position)
    return ending, places


@pytest.mark.wide
def test_29_a_move_ends_in_its_window_on_a_drive_as_in_the_simulation():
    with live_drive.drive("test 29") as drive, live_drive.driven("virtual:test 29@5") as bench:
        facts = {fact.name: fact.value for fact in bench.host.link.facts}
        assert facts["connection lost (6007)"].startswith("1")
        assert facts["fault (605E)"].startswith("0")
        assert facts["following error (6065)"].startswith("off")
        driven, there = moved(ready_on(bench))
        assert abs(drive.position * 1e-6 - 0.03) <= bench.spec.method.in_position
        assert bench.host.board.wires.torn == 0
    simulated, here = moved(Bench("cascade", period=live_drive.SAMPLE).enable())
    assert (driven.how, simulated.how) == (ops.DONE, ops.DONE)
    # The bus takes the sample that the example's drive takes; what differs is the step of its torque.
    apart = [abs(one - other) for one, other in zip(here, there, strict=False)]
    assert abs(len(here) - len(there)) < 0.1 * len(here)
    assert 0.0 < max(apart) < 1e-4


@pytest.mark.wide
@pytest.mark.process
def test_40_page_is_quick_and_leaves_the_loop_alone(tmp_path: Path) -> None:
    """First values within 2 s, 20 screens a second with eight channels of 1 kHz; the loop misses no more by it."""
    with panelled(tmp_path) as live, live.connect() as axis:
        before = axis.status["loop"]
        time.sleep(5.0)
        alone = axis.status["loop"]
        found = run_script("speed", live.link(), "5")
    missed = (alone["skipped"] - before["skipped"]) / (alone["periods"] - before["periods"])
    assert found["first"] < 2.0
    assert 20.0 <= found["screens"] <= 30.0
    assert found["channels"] == 8
    assert found["rows"] == pytest.approx(1000.0, rel=0.05)
    assert found["skipped"] / found["periods"] <= 1.5 * missed + 0.005


@pytest.mark.wide
@pytest.mark.process
def test_41_a_jog_ends_however_it_is_let_go(tmp_path: Path) -> None:
    """At rest within lease and ramp in ten ways of ten, and it does not begin again; the page says over which way."""
    with panelled(tmp_path, "cascade.toml", "--period", "10 ms") as live, live.connect() as axis, Script("jog") as page:
        for way in WAYS:
            page.tell("hold", way, "plus" if axis.position < 0.25 else "minus", live.link())
            let_go = axis.status
            if way == "server killed":
                live.kill_panel()
            page.tell("release")
            rests = until(axis, lambda s: s["rests"] and s["running"] is None)
            speed, ramp = 0.1, rests["last_stop"]
            assert 0.0 < ramp < 0.01, way
            assert abs(rests["position"] - let_go["position"]) < speed * (LEASE + 0.5) + ramp, way
            time.sleep(0.5)
            assert axis.status["position"] == pytest.approx(rests["position"], abs=1e-4), way
            told = page.tell("look")
            is_told = way not in {"page closed", "network cut", "server killed"}  # it hears of no stop, or is gone
            assert told["told"].startswith("Stopped over") or not is_told, way
            assert not told["pressed"], way


@pytest.fixture(scope="module")
def views(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Every view as a browser has found it on a screen of 360 px."""
    with panelled(tmp_path_factory.mktemp("views"), "cascade.toml", "--period", "10 ms") as live:
        found = run_script("views", live.link())
    assert len(found["views"]) >= 11
    return found


@pytest.mark.wide
@pytest.mark.process
def test_42_stop_is_on_every_screen(tmp_path: Path, views: dict[str, Any]) -> None:
    """By a form where there are no scripts, by Esc on each view, on 360 px without scrolling."""
    for name, seen in views["views"].items():
        stop = seen["stop"]
        assert 0 <= stop["top"] < stop["bottom"] <= stop["screen"], name
        assert (seen["escape"], stop["isOnTop"], stop["height"] >= 64) == (True, True, True), name
        assert stop["wide"] <= 360, f"{name} scrolls sideways"
    with panelled(tmp_path, "cascade.toml", "--period", "10 ms") as live, live.connect() as axis:
        epoch = axis.status["epoch"]
        plain = run_script("noscript", live.link("viewer"))
        assert axis.status["epoch"] > epoch
    assert plain["band"].startswith("SIMULATION")
    assert (plain["at"], plain["stop"]["bottom"] <= 640) == ("/", True)


@pytest.mark.wide
@pytest.mark.process
def test_43_every_view_is_sound(views: dict[str, Any]) -> None:
    """No error, no request to another host, nothing serious for axe-core; the keyboard reaches all that can be used."""
    assert (views["problems"], views["strangers"]) == ([], [])
    for name, seen in views["views"].items():
        assert (name, seen["serious"], seen["unreached"]) == (name, [], [])
    fault = views["fault"]
    assert (fault["offered"], fault["asked"]) == (["encoder stuck", "encoder off"], ["inject", "encoder stuck 1 mm"])
    for told in ("stands still", "position was lost", "1.200 mm", "1.000 mm", "cable", "home", "F02"):
        assert told in fault["text"], told


@pytest.mark.wide
@pytest.mark.process
def test_44_an_hour_of_telemetry_leaves_the_heap_as_it_is(tmp_path: Path) -> None:
    """An hour of status and of rows at 1 kHz, handed to the scope as fast as it takes them."""
    with panelled(tmp_path, "cascade.toml", "--period", "10 ms") as live:
        found = run_script("heap", live.link())
    assert found["problems"] == []
    assert found["rows"] > 3_600_000
    assert found["seconds"] < 3600 / 20
    assert found["after"] < 1.1 * found["before"]


@pytest.mark.wide
@pytest.mark.process
def test_45_two_browsers_see_who_commands_and_either_stops(tmp_path: Path) -> None:
    """The second is refused, a viewer stops, and taking over ends the jog of the first."""
    with panelled(tmp_path, "cascade.toml", "--period", "10 ms") as live:
        found = run_script("two", live.link(), live.link(), live.link("viewer"), str(tmp_path / "remote.png"))
    assert found["problems"] == []
    assert found["mine"].startswith("you command")
    assert "engineer" in found["theirs"]
    assert not found["theirs"].startswith("you")
    assert (found["refused"]["how"], found["refused"]["code"]) == ("refused", ops.SECOND)
    assert "operator" in found["viewerMoves"]
    assert found["stoppedByViewer"] is None
    assert found["afterTaking"]["theirs"].startswith("you command")
    assert not found["afterTaking"]["mine"].startswith("you")
    assert found["afterTaking"]["pressed"] == 0
    assert not found["viewerTurns"]
    assert [found["turned"][place]["code"] for place in ("local", "remote", "both")] == [0, ON_REMOTE, 0]
    assert "faces may not command" in found["turned"]["local"]["who"]
    assert "only faces may command" in found["turned"]["remote"]["who"]
    assert "turn the selector" in found["turned"]["remote"]["why"]
    assert "faces" not in found["turned"]["both"]["who"]


@pytest.mark.wide
@pytest.mark.process
def test_47_scope_shows_the_edge_at_its_trigger(tmp_path: Path) -> None:
    """Half of the record lies before the edge, which is there within a sample; the file holds what the ring does."""
    with panelled(tmp_path, "cascade.toml", "--period", "5 ms") as live:
        found = run_script("scope", live.link())
    assert found["problems"] == []
    rows, ring = np.array(found["rows"]), np.array(found["ring"])
    velocity, level = rows[:, 2 + found["channels"].index("velocity")], 5e-3
    trigger = int(np.flatnonzero(rows[:, 1] == 0.0)[0])
    assert trigger == len(rows) // 2
    assert velocity[trigger - 1] < level <= velocity[trigger]
    assert (velocity[:trigger] < level).all()
    np.testing.assert_array_equal(rows[:, 0], ring[:, 0])
    np.testing.assert_array_equal(rows[:, 2:].astype(np.float32), ring[:, 1:].astype(np.float32))
    assert "1/Δt" in found["cursors"]
    # The velocity over the position: a click at its lower right corner puts a cursor where the move has ended.
    assert found["xy"]["drawn"] == 1
    assert found["xy"]["label"] == found["channels"]
    places, (_, cursor) = rows[:, 2 + found["channels"].index("position")], found["xy"]["cursors"]
    at = round(cursor * (len(rows) - 1))
    assert places[at] > places[0] + 0.95 * (places[-1] - places[0])


@in_wall_time
def test_48_why_not_moving_names_what_is_not_met() -> None:
    """Fifteen situations, each made at the axis: its reason and its remedy, and those alone."""
    host = Bench("cascade").host
    session, o = Session(host, {}), host.board.operation

    def why(client: int = 1) -> list[tuple[str, str]]:
        return why_not_moving(session.status(), client)

    def ask(word: str, value: object = None) -> None:
        session.wait(session.ask(word, value))

    def is_told(what: str, remedy: str, *others: str, client: int = 1) -> None:
        told = why(client)
        assert any(what in one and remedy in do for one, do in told), told
        assert len(told) == 1 + len(others), told
        assert all(any(other in one for one, _ in told) for other in others), told

    is_told("not ready", "wait")
    host.run_until_ready()
    is_told("no torque: switch on disabled", "enable")
    ask("order", 0)
    is_told("no torque: ready to switch on", "enable")
    ask("order", 1)
    is_told("no torque: switched on", "enable")
    ask("enable")
    is_told("tenth of the speed", "confirm")
    ask("confirm")
    is_told("nothing has been asked", "jog")
    ask("move_to", "0 mm")
    is_told("lower limit", "other side")
    is_told("somebody else commands", "take", "lower limit", client=2)
    ask("move_to", "500 mm")
    is_told("upper limit", "other side")
    ask("move_to", "250 mm")
    o.answer.near = 0
    is_told("not in its window", "wait")
    o.answer.near, o.answer.limited = 1, 1
    is_told("at its limit", "holds")
    o.answer.limited = 0
    o.trust = ops.NOT_KNOWN
    is_told("not known", session.find_position())
    o.trust = ops.REFERENCED
    ask("order", 5)
    is_told("quick stop", "enable")
    ask("enable")
    o.state, o.fault = STATE_NAMES.index("fault reaction active"), FOLLOWING
    is_told(f"fault {FOLLOWING}", "come to rest")
    o.state = STATE_NAMES.index("fault")
    is_told(f"fault {FOLLOWING}", "reset")


@pytest.mark.wide
@pytest.mark.process
def test_46_positions_are_taught_typed_and_taken_back(tmp_path: Path) -> None:
    """Teach two, go to the first, type one in mm and in inches, undo, save; what is no place changes nothing."""
    with panelled(tmp_path, "cascade.toml", "--period", "10 ms") as live:
        found = run_script("positions", live.link())
    assert found["problems"] == []
    assert found["taught"] == "teach: done"
    assert found["right"] == pytest.approx(found["begin"] * 1e3 + 30.0, abs=0.1)
    assert found["edited"] == ["edit: done", pytest.approx(35.0, abs=1e-3)]
    assert found["inches"] == ["edit: done", pytest.approx(50.8, abs=1e-3)]
    assert "parsec" in found["wrong"][0]
    assert found["undone"] == pytest.approx(35.0, abs=1e-3)
    names = [line.split(",") for line in found["file"].splitlines()]
    assert {"left", "right"} < {cell for line in names for cell in line}
    assert found["job"] == "Job done: all of its moves."
    assert found["jobAt"] == pytest.approx(0.035, abs=1e-4)
    assert "move 2: got 9 m" in found["badJob"]


@pytest.mark.wide
@pytest.mark.process
@pytest.mark.parametrize("mode", ["torque", "velocity"])
def test_29_the_drive_may_be_another_process_on_a_serial_bus(monkeypatch, mode):
    # Two processes on a busy machine: how soon silence is a fault, test 30 sees.
    monkeypatch.setattr("detent.operate.drivers.canopen_drive.HEARTBEAT", 2.0)
    with live_drive.wire() as (near, far), live_drive.served(f"slcan:{far}@5?mode={mode}"):
        live_drive.open_late(f"slcan:{near}@5?mode={mode}")
        with live_drive.driven(f"slcan:{near}@5?mode={mode}") as bench:
            ending, places = moved(ready_on(bench))
            assert ending.how == ops.DONE
            assert abs(places[-1] - 0.03) <= bench.spec.method.in_position


@pytest.mark.wide
def test_30_a_cut_cable_takes_the_torque_on_both_sides_and_nothing_resumes():
    now = 0.0
    with live_drive.drive("test 30", clock=lambda: now) as drive, live_drive.driven("virtual:test 30@5") as bench:
        ready_on(bench)
        move = bench.host.ask(ops.MOVE_BY, 0.1)
        bench.pass_time(0.2)
        link, network = bench.host.link, drive.node.network
        assert drive.torque != 0
        bus, network.bus = network.bus, None  # it hears nothing more, and nothing of it is heard
        network.notifier.stop()
        link.driver._wait = 1e-4
        heard, before = bench.host.board.wires.heard, bench.loop.periods
        while bench.operation.fault == 0:
            bench.host.run(1)
        after = bench.loop.deadline - heard
        assert 3 * live_drive.HEARTBEAT < after * 1e-9 <= 3 * live_drive.HEARTBEAT + 1e-3
        assert bench.loop.periods - before <= 3 * live_drive.HEARTBEAT / live_drive.SAMPLE + 1
        lines = bench.host.axis.state.lines
        assert (bench.operation.fault, lines.enable, lines.command) == (DRIVE_LOST, 0, 0.0)
        assert bench.host.ending(move) == Ending(move, ops.FAILED, DRIVE_LOST, 0)
        bench.host.run(1)
        assert bench.host.state == "fault"
        now = 0.025
        drive.watch()
        assert drive.torque != 0  # as long as it may
        now = 0.035
        drive.watch()
        assert (STATE_NAMES[drive.state], drive.torque, drive.error) == ("fault", 0, 0x8130)
        assert drive.plant.state.lines.enable == 0
        # The cable is back: nothing moves until the fault is reset and the axis enabled.
        network.bus, network.notifier = bus, can.Notifier(bus, network.listeners, 1.0)
        link.driver._wait = 5.0
        bench.pass_time(0.05)
        assert (bench.host.state, drive.torque, STATE_NAMES[drive.state]) == ("fault", 0, "fault")
        assert bench.do(ops.RESET).how == ops.DONE
        bench.pass_time(0.05)
        assert (bench.host.state, STATE_NAMES[drive.state]) == ("switch on disabled", "ready to switch on")
        ready_on(bench)
        assert moved(bench)[0].how == ops.DONE


@pytest.mark.wide
@pytest.mark.parametrize("file", ["canopen 0x2a.0x1.0x3.0x8", ""])
def test_32_another_hardware_is_not_enabled(file):
    wanted = [f'hardware.id="{file}"'] if file else ["method.timeout=2 s"]
    with live_drive.drive("test 32") as drive, live_drive.driven("virtual:test 32@5", *wanted) as bench:
        session = Session(bench.host, {})
        bench.pass_time(0.02)
        bench.do(ops.TRUST, 2.0)
        ended = session.wait(session.ask("enable"))
        assert (ended.how, ended.code) == ("refused", OTHER_HARDWARE)
        assert "canopen 0x2a.0x1.0x3.0x7" in ended.reason
        assert file in ended.reason
        assert bench.do(ops.ORDER, 0.0).how == ops.DONE
        for order in (1.0, 2.0):
            bench.do(ops.ORDER, order)
        bench.pass_time(0.02)
        assert bench.host.state != "operation enabled"
        assert "ready" in STATE_NAMES[drive.state]
        assert ended.reason in session.status()["barred"]["text"]


@live_frames.needs_cc
@pytest.mark.wide
def test_31_no_wrong_value_comes_over_a_serial_line_and_every_gap_is_counted(tmp_path):
    """Of 100,000 frames one in a hundred is lost, and one in a hundred has one to eight of its bits turned."""
    live_frames.receive_all(live_frames.in_c(tmp_path), 100_000, 2)


@pytest.mark.wide
@pytest.mark.skipif(sys.platform == "win32", reason="processes are forked")
def test_33_no_wrong_position_and_no_lost_row_after_a_thousand_kills(tried):
    told = live_store.kill(1000)
    live_store.check_kills(told)
    tried("store", "host killed while it wrote and moved", "no wrong position taken, no change lost", told["kills"])


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="processes are forked")
def test_33_no_wrong_position_and_no_lost_row_after_fifty_thousand_kills():
    live_store.check_kills(live_store.kill(50_000))


@live_store.needs_library
def test_34_a_power_cut_at_every_sync_leaves_old_or_new():
    with memory_folder() as folder:
        told = live_store.cut_everywhere("incremental, held", 0, folder)
    assert told["cuts"] > 150
    assert min(told["old"], told["new"], told[Trust.UNKNOWN], told[Trust.RESTORED]) > 5


@live_store.needs_library
@pytest.mark.parametrize("synchronous", ["OFF", "NORMAL"])
def test_34_a_protocol_that_syncs_less_is_found_out(synchronous):
    with memory_folder() as folder, pytest.raises(AssertionError):
        live_store.cut_everywhere("incremental, held", 4, folder, synchronous)


@live_store.needs_library
@pytest.mark.wide
@pytest.mark.parametrize("name", ["incremental, held", "absolute", "band, held", "circle"])
def test_34_a_power_cut_with_writes_torn_and_lost_leaves_old_or_new(name, tried):
    with memory_folder() as folder:
        told = live_store.cut_everywhere(name, 8, folder)
    assert told["disks"] > 1000
    assert min(told["old"], told[Trust.UNKNOWN], told[Trust.RESTORED]) > 300
    # A change is new before it is told to be made only while its journal is being cut off.
    assert told["new"] > 5
    tried("store", "power cut, writes lost and torn", "old or new, never more trusted", told["disks"])


@pytest.mark.parametrize("edit", live_store.EDITS)
def test_35_a_store_of_another_axis_is_kept_aside_and_both_are_shown(tmp_path, edit):
    made, path = SENSORS["absolute"], tmp_path / "axis.toml.state"
    live_store.taught_store(path, made)
    before, other = path.read_bytes(), replace(made, **live_store.EDITS[edit])
    with open_store(path, other) as store:
        assert store.restore(4923) == store.standing
        assert store.standing.why is Why.NEW
        assert store.positions == {}
        aside = store.aside
        assert aside is not None
        assert aside.path.read_bytes() == before
        names = {name: pair for name, pair in aside.differs.items() if not (edit == "scale" and name == "travel")}
        expected = {"scale": "scale", "origin": "scale", "travel": "travel"}.get(edit, "sensor")
        assert names == {expected: (meanings(made)[expected], meanings(other)[expected])}
        assert all(text in str(aside) for pair in aside.differs.values() for text in pair)
        assert [one.counts for one in aside.positions] == [5000]
    # What was kept aside is still the store of the axis that it was made for.
    aside.path.rename(path)
    with open_store(path, made) as store:
        assert store.aside is None
        assert store.restore(4923).counts == 5000


def test_35_an_edit_of_gains_keeps_the_position(tmp_path):
    file = EXAMPLES / "cascade.toml"
    before = live_store.sensors_of(file)
    assert live_store.sensors_of(file, "method.position_gain=31", "limits.speed=0.1 m/s") == before
    other = {"encoder.resolution=3 um": "scale", "limits.travel=0.71 m": "travel"}
    for override, name in other.items():
        after = live_store.sensors_of(file, override)
        assert [key for key in before if before[key] != after[key]] == [name]
    assert store_path(tmp_path / file.name).name == "cascade.toml.state"


@pytest.mark.parametrize("name", [name for name, made in SENSORS.items() if made.kind is not Sensed.INCREMENTAL])
@pytest.mark.parametrize("moved", [6, -6, 700, -1500])
def test_36_an_axis_that_was_moved_while_off_is_not_restored_and_the_distance_is_shown(tmp_path, name, moved):
    made, path = SENSORS[name], tmp_path / "axis.state"
    live_store.taught_store(path, made)
    with open_store(path, made) as store:
        assert store.restore(read(made, 5000, 77)).trust is (Trust.UNKNOWN if name == "band" else Trust.RESTORED)
        assert store.restore(read(made, 5000 + made.window, 77)).distance == made.window
        judged = store.restore(read(made, 5000 + moved, 77))
        assert (judged.trust, judged.counts) == (Trust.UNKNOWN, None)
        assert (judged.shown, judged.distance) == (5000 + moved, moved)
        assert judged.why is (Why.AMBIGUOUS if name == "band" else Why.MOVED)
        assert f"{moved} um" in judged.describe(made) or f"{moved / 1000} mm" in judged.describe(made)
        if name != "band":
            assert store.confirm().counts == 5000 + moved
            assert store.trust is Trust.RESTORED


OPENSSL = shutil.which("openssl")


@pytest.fixture(scope="module")
def panel(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PanelRig]:
    """A panel whose axis stands still, but takes what is asked."""
    with PanelRig(tmp_path_factory.mktemp("panel")) as made:
        yield made


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    """An axis file, and a folder of its own for channels."""
    with live_processes.live_folder(tmp_path) as made:
        yield made


@pytest.fixture
def running(folder: Path) -> live_processes.Running:
    """The axis live."""
    # Other tests want the processors, too.
    return live_processes.Running(folder / "slide.toml", "--headless", "--no-store", "--period", "10 ms")


@in_wall_time
def test_49_every_route_refuses_whom_its_rule_does_not_name(panel: PanelRig) -> None:
    assert len(live_panel.routes_of(panel)) >= 12
    for method, path in live_panel.routes_of(panel):
        rule = panel_app.RULES["/static" if path.startswith("/static") else path]
        assert live_panel.status(panel, method, path, origin="http://evil.example") == 403
        assert live_panel.status(panel, method, path, origin="null") == (200 if rule.stops else 403)
        assert live_panel.status(panel, method, path, host="evil.example") == 421
        assert live_panel.status(panel, method, path, host=f"127.0.0.1.evil.example:{panel.port}") == 421
        assert live_panel.status(panel, method, path, host="127.0.0.1:1") == 421
        assert live_panel.status(panel, method, path, content_length=str((1 << 20) + 1)) == 413
        assert live_panel.status(panel, method, path, transfer_encoding="chunked") == 411
        if path == "/enter":  # shows its own ticket
            continue
        assert live_panel.status(panel, method, path, role="") == 401
        for role in ROLES:
            permitted = ROLES.index(role) >= ROLES.index(rule.role)
            assert (live_panel.status(panel, method, path, role) in {200, 303, 400, 404}) == permitted
            assert permitted or live_panel.status(panel, method, path, role) == 403
        if rule.changes:
            assert live_panel.status(panel, method, path, x_csrf_token="0" * 64) == 403
            assert live_panel.status(panel, method, path, origin="") == 403


@in_wall_time
def test_49_a_route_without_a_rule_lets_nobody_in(panel: PanelRig, monkeypatch: pytest.MonkeyPatch) -> None:
    assert live_panel.status(panel, "GET", "/api/describe") == 200
    monkeypatch.delitem(panel_app.RULES, "/api/describe")
    assert live_panel.status(panel, "GET", "/api/describe") == 403
    assert set(panel_app.RULES) | {"/api/describe"} == {route.path for route in panel.panel.app().routes}  # type: ignore[attr-defined]
    monkeypatch.setitem(panel_app.RULES, "/api/describe", Rule("engineer"))
    assert [live_panel.status(panel, "GET", "/api/describe", role) for role in ROLES] == [403, 403, 200]


@in_wall_time
@pytest.mark.parametrize("role", ROLES)
def test_49_stop_is_taken_from_every_role(panel: PanelRig, role: str) -> None:
    stops = panel.bench.loop.stops
    assert live_panel.status(panel, "POST", "/stop", role) == 200
    assert live_panel.status(panel, "POST", "/stop", role, origin="null", sec_fetch_site="same-origin") == 200
    assert live_panel.status(panel, "POST", "/stop", role, origin="null", sec_fetch_site="cross-site") == 403
    assert panel.bench.loop.stops == stops + 2
    with panel.browser(role).socket() as socket:
        assert "id" in socket.ask(do="stop")
        assert "id" in socket.ask(do="disable")
    assert panel.bench.loop.stops == stops + 3


@in_wall_time
def test_49_a_form_without_scripts_stops_and_comes_back(panel: PanelRig) -> None:
    browser, stops = panel.browser("viewer"), panel.bench.loop.stops
    page = browser.http.get("/").text
    assert 'action="/stop" method="post"' in page
    assert "SIMULATION" in page
    assert "&lt;b&gt;axis&lt;/b&gt;" in page
    assert "<b>axis" not in page
    answer = browser.http.post("/stop", headers={"accept": "text/html", "origin": "null"})
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    assert panel.bench.loop.stops == stops + 1


@in_wall_time
def test_49_a_viewer_watches_and_moves_nothing(panel: PanelRig) -> None:
    written = int(panel.bench.host.board.inbox.written)
    words = set(panel.session.describe()["commands"]) - {"stop", "disable"}
    with panel.browser("viewer").socket() as socket:
        for word in sorted(words):
            assert "a viewer may not" in socket.ask(do=word, value="1 mm")["error"]
        assert "status" in socket.ask(do="status")
        assert "watch" in socket.ask(do="watch", channels=["position"])
        assert "may not note" in socket.ask(do="note", who="engineer", what="lies")["error"]
    assert int(panel.bench.host.board.inbox.written) - written <= 1  # it leaves


@in_wall_time
def test_49_an_operator_sets_no_trust(panel: PanelRig) -> None:
    with panel.browser("operator").socket() as socket:
        assert "needs engineer" in socket.ask(do="trust", value=2)["error"]
        assert "id" in socket.ask(do="enable")


@in_wall_time
@pytest.mark.parametrize(
    "first",
    ["", "no JSON", "[]", "7", '{"ticket": null}', '{"ticket": "a.b.c"}', '{"ticket": "viewer.0.9.x"}', "[" * 9000],
)
def test_49_a_socket_needs_a_ticket(panel: PanelRig, first: str) -> None:
    assert live_panel.code(panel.browser().dial(), first) == 1008


@in_wall_time
def test_49_a_ticket_serves_once_for_its_own_role_and_not_for_long(
    panel: PanelRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    browser = panel.browser()
    ticket = browser.ticket()

    def shown(ticket: str) -> str:
        return json.dumps({"ticket": ticket})

    assert live_panel.code(browser.dial(), shown(ticket)) == 0
    assert live_panel.code(browser.dial(), shown(ticket)) == 1008
    assert live_panel.code(panel.browser("viewer").dial(), shown(browser.ticket())) == 1008
    late = browser.ticket()
    monkeypatch.setattr(panel.panel.keys, "_clock", lambda: time.time() + 11.0)
    assert live_panel.code(browser.dial(), shown(late)) == 1008


@in_wall_time
def test_49_a_socket_without_cookie_or_from_another_page_is_refused(panel: PanelRig) -> None:
    for browser, more in (
        (panel.browser(""), {}),
        (panel.browser(), {"origin": "http://evil.example"}),
        (panel.browser(), {"origin": None}),
        (panel.browser(), {"origin": "null"}),
        (panel.browser(), {"origin": f"http://127.0.0.1.evil.example:{panel.port}"}),
    ):
        with pytest.raises(InvalidStatus) as refused:
            browser.dial(**more)
        assert refused.value.response.status_code == 403


@in_wall_time
def test_49_oversized_and_malformed_frames_are_refused(panel: PanelRig) -> None:
    with panel.browser().socket() as socket:
        for sent, told in (
            ("no JSON", "is JSON"),
            ("[" * 60_000, "is JSON"),
            (b"\0\1", "is JSON"),
            ("[]", '"do"'),
            ('{"do": 7, "as": 1}', '"do"'),
            ('{"do": "stop", "as": {}}', '"as"'),
            ('{"do": "dance", "as": 2}', "no command 'dance'"),
            ('{"do": "move_to", "as": 3, "value": {"a": 1}}', "5 mm"),
            ('{"do": "move_to", "as": 4, "value": "1 mm", "speed": "fast"}', "speed"),
            ('{"do": "watch", "as": 5, "rate": 1000}', "rate"),
            ('{"do": "watch", "as": 6, "channels": ["nothing"]}', "channels"),
            ('{"do": "watch", "as": 7, "who": "x"}', "who"),
        ):
            socket.dialled.send(sent)
            assert told in socket.until("error")["error"]
        assert "status" in socket.ask(do="status")
        with pytest.raises(ConnectionClosed) as closed:
            socket.ask(do="status", value="x" * (1 << 16))
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1009


@in_wall_time
def test_49_there_are_sixteen_sockets(panel: PanelRig) -> None:
    browser = panel.browser("viewer")
    with ExitStack() as others:
        for _ in range(16):
            other = others.enter_context(browser.dial())
            other.send(json.dumps({"ticket": browser.ticket()}))
            assert other.recv(timeout=10.0)
        assert live_panel.code(browser.dial(), json.dumps({"ticket": browser.ticket()})) == 1013


@in_wall_time
def test_50_no_key_ticket_or_cookie_is_told_anywhere(panel: PanelRig) -> None:
    browser = panel.browser()
    ticket, link = browser.ticket(), sign(panel.keys["viewer"], "viewer", LINK, time.time())
    for signed in (link, link, "engineer.0.0.wrong"):
        browser.http.get("/enter", params={"ticket": signed})
    with browser.socket() as socket:
        told = [json.dumps(socket.ask(do=word)) for word in ("status", "describe", "log")]
    pages = [browser.http.get(path) for path in ("/", "/api/describe", "/api/log", "/api/axis")]
    everything = "".join([*told, *(page.text for page in pages), json.dumps(panel.audit.recent())])
    secrets = [ticket, link, *panel.keys.values(), *browser.http.cookies.values()]
    assert [secret for secret in secrets if secret.rpartition(".")[2] in everything] == []
    for page in pages:
        assert page.headers["referrer-policy"] == "no-referrer"
        assert page.headers["cache-control"] == "no-store"
        assert "default-src 'none'" in page.headers["content-security-policy"]
        assert "unsafe" not in page.headers["content-security-policy"]
        assert "access-control-allow-origin" not in page.headers


@in_wall_time
def test_50_a_link_works_once_and_leaves_a_cookie_that_no_script_reads(panel: PanelRig) -> None:
    link = {"ticket": sign(panel.keys["operator"], "operator", LINK, time.time())}
    with httpx.Client(base_url=panel.base) as client:
        first = client.get("/enter", params=link)
        cookie = first.headers["set-cookie"]
        assert "HttpOnly" in cookie
        assert "SameSite=strict" in cookie
        assert client.get("/enter", params=link).status_code == 401
        assert client.get("/").status_code == 200
    old = {"ticket": sign(panel.keys["operator"], "operator", LINK, time.time() - 601.0)}
    assert httpx.get(panel.base + "/enter", params=old).status_code == 401
    assert httpx.get(panel.base, cookies=panel.cookie("viewer", time.time() - 12 * 3600 - 1)).status_code == 401
    forged = {panel.panel.here.cookie: sign(panel.keys["viewer"], "engineer", "cookie", time.time())}
    assert httpx.get(panel.base, cookies=forged).status_code == 401


def test_50_only_this_user_reads_the_keys(tmp_path: Any) -> None:
    path, keys = tmp_path / "axis.keys", make_keys()
    path.write_text("left over", encoding="ascii")
    path.chmod(0o666)
    keep_keys(path, "http://127.0.0.1:1", keys)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert len(set(keys.values())) == len(ROLES)
    assert min(map(len, keys.values())) >= 43  # 256 bits
    assert keys["viewer"] not in link_of(path, "viewer", time.time())
    with pytest.raises(DetentError, match="viewer, operator, engineer"):
        link_of(path, "root", time.time())


@in_wall_time
def test_50_51_who_did_what_is_appended(panel: PanelRig) -> None:
    with panel.browser("operator").socket() as socket:
        asked = socket.ask(do="enable")["id"]
        socket.ask(do="move_to", value="5 V")
    records = panel.audit.recent()["records"]
    mine = next(one for one in records if one.get("id") == asked)
    assert mine["do"] == "enable"
    assert mine["who"].startswith("operator ")
    assert mine["who"].endswith("from 127.0.0.1")
    assert any(one.get("do") == "move_to" and "error" in one for one in records)
    assert panel.audit.file is not None
    panel.audit.file.flush()
    assert [json.loads(line) for line in panel.audit.file.path.read_text(encoding="utf-8").splitlines()][
        -len(records) :
    ] == records
    assert stat.S_IMODE(panel.audit.file.path.stat().st_mode) == 0o600


@pytest.mark.parametrize("bind", ["192.168.1.20", "10.0.0.1", "2001:db8::1", "fe80::1"])
def test_51_a_network_is_refused_without_tls(bind: str, tmp_path: Any) -> None:
    with pytest.raises(DetentError, match="--i-accept-plain-http"):
        PanelPlace(bind).check()
    accepted = PanelPlace(bind, plain=True)
    accepted.check()
    assert accepted.on_network
    pem = tmp_path / "pem"
    pem.touch()
    encrypted = PanelPlace(bind, certificate=str(pem), key_file=str(pem))
    encrypted.check()
    assert not encrypted.on_network


@pytest.mark.parametrize(
    ("place", "told"),
    [
        (PanelPlace("0.0.0.0", plain=True), "every network"),  # noqa: S104 - it is refused
        (PanelPlace("::", plain=True), "every network"),
        (PanelPlace("axis.example", plain=True), "expected an address"),
        (PanelPlace("127.0.0.1", certificate="a.pem"), "both"),
        (PanelPlace("127.0.0.1", certificate="no.pem", key_file="no.pem"), "no such file"),
    ],
)
def test_51_what_cannot_work_is_refused(place: PanelPlace, told: str) -> None:
    with pytest.raises(DetentError, match=told):
        place.check()


@in_wall_time
@pytest.mark.process
@pytest.mark.skipif(OPENSSL is None, reason="makes the certificate")
def test_51_with_a_certificate_all_goes_encrypted(tmp_path: Any) -> None:
    certificate, key = str(tmp_path / "axis.pem"), str(tmp_path / "axis.key")
    subprocess.run(
        [str(OPENSSL), "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes",
         "-days", "2", "-subj", "/CN=axis", "-addext", "subjectAltName=IP:127.0.0.1", "-keyout", key,
         "-out", certificate],
        check=True, capture_output=True,
    )  # fmt: skip
    trusted = ssl.create_default_context(cafile=certificate)
    with PanelRig(tmp_path, certificate=certificate, key_file=key) as panel:
        base = f"https://127.0.0.1:{panel.port}"
        link = {"ticket": sign(panel.keys["operator"], "operator", LINK, time.time())}
        with httpx.Client(base_url=base, verify=trusted) as client:
            assert "Secure" in client.get("/enter", params=link).headers["set-cookie"]
            assert client.post("/stop", headers={"origin": base}).status_code == 200
            assert client.post("/stop", headers={"origin": panel.base}).status_code == 403
        with pytest.raises(httpx.TransportError):
            httpx.get(panel.base)


@in_wall_time
def test_51_the_banner_of_plain_http_stays(panel: PanelRig, monkeypatch: pytest.MonkeyPatch) -> None:
    browser = panel.browser()
    assert "without encryption" not in browser.http.get("/").text
    monkeypatch.setattr(panel.panel, "plain", True)
    assert "without encryption" in browser.http.get("/").text


@in_wall_time
def test_52_a_client_that_floods_is_put_out_and_others_are_served(panel: PanelRig) -> None:
    with panel.browser("operator").socket() as other, panel.browser("operator").socket() as flooding:
        stops = panel.bench.loop.stops
        for _ in range(200):  # stops are never counted
            flooding.dialled.send('{"do": "stop"}')
        with pytest.raises(ConnectionClosed) as closed:
            live_panel.flood(flooding)
        assert "status" in other.ask(do="status")
        assert "id" in other.ask(do="stop")
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1008
    assert panel.bench.loop.stops == stops + 201
    asked = [one for one in panel.audit.recent()["records"] if one.get("do") == "confirm"]
    assert 50 <= len(asked) < 150


@in_wall_time
def test_53_no_request_makes_the_panel_fail(panel: PanelRig) -> None:
    live_requests.anything(panel, 300)


@in_wall_time
@pytest.mark.wide
def test_53_no_request_of_thousands_makes_the_panel_fail(panel: PanelRig) -> None:
    live_requests.anything(panel, 500 * len(RULES))


@in_wall_time
@pytest.mark.process
def test_54_the_links_are_printed_and_ctrl_c_ends_both_processes(folder: Path) -> None:
    live = live_processes.Live(folder / "slide.toml", "--period", "10 ms", "--viewer-link")
    said: list[str] = []
    while not said or "Ctrl-C" not in said[-1]:
        said.append(live.out.readline())
    text = "".join(said)
    assert "SIMULATION; every 10 ms; switch on disabled." in text
    links = [word for line in said for word in line.split() if word.startswith("http://127.0.0.1:")]
    assert len(links) == 2
    pages = [live_processes.entered(link) for link in links]
    assert ['content="engineer"' in pages[0].http.get("/").text, 'content="viewer"' in pages[1].http.get("/").text] == [
        True, True,
    ]  # fmt: skip
    another = subprocess.run(
        [sys.executable, "-m", "detent", "connect", str(live.file), "link", "operator"],
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    third = live_processes.entered(another.strip())
    assert third.http.get("/api/describe").json()["name"]
    panel = live.panel_id()
    assert "torque off" in live.end()
    assert live.process.returncode == 0
    assert not Path(f"/proc/{panel}").exists()
    assert list(folder.glob("detent/*.keys")) == []
    records = [json.loads(line) for line in live.file.with_name("slide.toml.audit").read_text("utf-8").splitlines()]
    assert [record["note"] for record in records if "note" in record] == ["enters"] * 3
    for page in (*pages, third):
        page.http.close()


@in_wall_time
@pytest.mark.process
def test_41_a_killed_panel_stops_the_jog_and_comes_back(folder: Path) -> None:
    live = live_processes.Live(folder / "slide.toml", "--period", "10 ms", "--json")
    browser = live_processes.entered(json.loads(live.out.readline())["panel"][0])
    with detent.connect(live.file) as watcher, suppress(ConnectionClosed), browser.socket() as socket:
        for word in ("enable", "confirm"):
            asked = socket.ask(do=word)["id"]
            while socket.until("ended")["ended"]["id"] != asked:
                pass
        socket.ask(do="jog", value="20 mm/s")
        while watcher.status["rests"]:
            pass
        os.kill(live.panel_id(), signal.SIGKILL)
        begin = time.monotonic()
        while (status := watcher.status)["running"] or not status["rests"]:
            assert time.monotonic() - begin < 20.0
        assert status["client"] == 0
        assert status["fault"] is None
    for _ in range(500):  # it comes back at the same address, and the cookie still serves
        with suppress(httpx.TransportError):
            if browser.http.get("/").status_code == 200:
                break
        threading.Event().wait(0.02)
    assert browser.http.post("/stop", headers={"origin": "null"}).status_code == 200
    browser.http.close()
    live.end()
    assert live.process.returncode == 0


@in_wall_time
@pytest.mark.wide
@pytest.mark.process
def test_52_stop_is_quick_while_another_client_floods(folder: Path) -> None:
    """A thousand malformed frames, then ten thousand commands a second: beside each, stops of another page."""
    live = live_processes.Live(folder / "slide.toml", "--period", "10 ms", "--json")
    browser = live_processes.entered(json.loads(live.out.readline())["panel"][0])
    cookies = json.dumps(dict(browser.http.cookies))
    pids = live.process.pid, live.panel_id()
    with browser.socket() as socket, detent.connect(live.file) as watcher:
        # The reference: two processes that compute beside it, as the flood and the panel that reads it do.
        busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2)]
        alone = live_processes.stops(socket, watcher, pids)
        for one in busy:
            one.kill()
            one.wait()
        for kind in ("malformed", "commands"):
            beside = live_processes.flooded(browser, cookies, kind, socket, watcher, pids)
            assert beside.computed < 0.05, (alone, beside)
            assert beside.late <= 1.5 * alone.late + 0.02, (alone, beside)
            assert "status" in socket.ask(do="status")
    browser.http.close()
    live.end()
    assert live.process.returncode == 0


@in_wall_time
@pytest.mark.wide
@pytest.mark.process
def test_57_memory_does_not_grow(folder: Path) -> None:
    found = live_processes.soak(folder, 20.0, 20.0)
    assert found["grown"] < 0.02
    assert found["fault"] is None
    assert found["rounds"] > 20


@in_wall_time
@pytest.mark.long
@pytest.mark.process
def test_57_memory_does_not_grow_for_half_an_hour(folder: Path) -> None:
    found = live_processes.soak(folder, 60.0, 1800.0)
    assert found["grown"] < 0.01
    assert found["fault"] is None
    assert found["rounds"] > 1500


@in_wall_time
def test_54_56_an_axis_runs_until_it_is_interrupted_and_others_move_it(
    folder: Path, running: live_processes.Running
) -> None:
    file = str(folder / "slide.toml")
    assert running.started["simulated"] is True
    assert running.started["state"] == "switch on disabled"
    assert running.started["period"] == 1e-2
    with detent.connect(file) as axis:
        assert axis.about["name"]
        axis.enable()
        axis.confirm()
        at = axis.position
        axis.move_by("5 mm")
        assert axis.position == pytest.approx(at + 5e-3, abs=1e-4)
    told = live_processes.connect(file, "--json")
    assert told.returncode == 0
    status = json.loads(told.stdout)["status"]
    assert (status["state"], status["client"]) == ("operation enabled", 0)
    assert status["position"] == pytest.approx(at + 5e-3, abs=1e-4)
    refused = live_processes.connect(file, "move_to", "7 m")
    assert (refused.returncode, refused.stdout) == (1, "")
    assert "31" in refused.stderr
    assert live_processes.connect(file, "move_to", "7 V").returncode == 2
    with detent.connect(file) as axis:  # interrupted while it moves: at rest before it ends
        axis.do("jog", "50 mm/s", wait=False)
        ended = running.ended()
    assert ended["rests"] is True
    assert ended["state"] == "switch on disabled"
    assert live_processes.connect(file).returncode == 1


@in_wall_time
def test_55_a_second_one_on_the_same_axis_is_refused(folder: Path, running: live_processes.Running) -> None:
    second = live_processes.run("live", str(folder / "slide.toml"), "--headless", "--for", "0")
    assert (second.returncode, second.stdout) == (1, "")
    assert str(running.process.pid) in second.stderr
    running.end(signal.SIGTERM)


@in_wall_time
def test_18_a_jog_of_a_killed_program_stops_within_its_lease(folder: Path, running: live_processes.Running) -> None:
    """SIGSTOP: the connection stays, nobody keeps the jog."""
    script = (
        "import sys, time, detent\n"
        "axis = detent.connect(sys.argv[1])\n"
        "axis.enable(); axis.confirm()\n"
        "with axis.jog('20 mm/s'):\n"
        "    print('jogs', flush=True)\n"
        "    time.sleep(60)\n"
    )
    file = folder / "slide.toml"
    program = subprocess.Popen([sys.executable, "-c", script, str(file)], stdout=subprocess.PIPE, text=True)
    assert program.stdout is not None
    assert program.stdout.readline() == "jogs\n"
    with detent.connect(file) as watcher:
        while watcher.status["rests"]:
            pass
        os.kill(program.pid, signal.SIGSTOP)
        while watcher.status["running"]:
            pass
        status = watcher.status
        while not status["rests"]:
            status = watcher.status
        assert status["fault"] is None
        os.kill(program.pid, signal.SIGKILL)
        program.communicate()
        while watcher.status["client"]:  # its right to command ends with it
            pass
    running.end()


@in_wall_time
def test_28_a_recorded_session_is_done_again_at_a_desk(folder: Path) -> None:
    file, log = folder / "slide.toml", folder / "session.jsonl"
    one = live_processes.Running(file, "--headless", "--no-store", "--period", "10 ms", "--record", str(log))
    with detent.connect(file) as axis:
        axis.enable()
        axis.confirm()
        axis.move_by("5 mm")
        with axis.jog("-30 mm/s"):
            while axis.status["rests"]:
                pass
    ended = one.ended()
    again, _ = make_host(file, wall=False, period=1e-2)
    repeat(again, Log.read(log.read_text(encoding="ascii").splitlines()), ended["loop"]["periods"])
    status = Session(again, {}).status()
    assert {k: v for k, v in status.items() if k != "loop"} == {k: v for k, v in ended.items() if k != "loop"}
    assert len(again.log.pulled) == 3  # the jog's, and two at the end
    assert live_processes.run("live", str(file), "--headless", "--for", "0", "--record", str(log)).returncode == 1


@in_wall_time
def test_33_a_killed_process_leaves_a_position_that_is_not_known(folder: Path) -> None:
    file = folder / "kept.toml"
    shutil.copy(folder / "slide.toml", file)
    first = live_processes.Running(file, "--period", "10 ms")
    assert first.started["trust"] == "referenced"
    with detent.connect(file) as axis:
        axis.enable()
        axis.do("jog", "10 mm/s", wait=False)
    first.process.kill()
    first.process.communicate()
    second = live_processes.Running(file, "--period", "10 ms")
    assert second.started["trust"] == "unknown"
    assert "in motion when it was last seen" in second.started["store"]["position"]
    with detent.connect(file) as axis:
        axis.do("trust", 2)
    ended = second.ended()
    assert ended["trust"] == "referenced"
    assert ended["store"]["trouble"] == ""
    told = live_processes.run("live", str(file), "--for", "0")
    assert told.returncode == 0
    assert str(file) + ".state" in told.stdout
    assert f"detent connect {file}" in told.stdout.splitlines()[-4]


@in_wall_time
def test_46_the_position_table_from_a_second_terminal(folder: Path) -> None:
    file = folder / "places.toml"
    shutil.copy(folder / "slide.toml", file)
    live = live_processes.Running(file, "--period", "10 ms")
    assert "No positions yet" in live_processes.connect(str(file), "positions").stdout
    assert live_processes.connect(str(file), "teach", "3").stdout.startswith("3: 20 mm, 4000 counts")
    assert live_processes.connect(str(file), "edit", "load", "0.2 in").returncode == 0
    table = json.loads(live_processes.connect(str(file), "positions", "--json").stdout)["positions"]
    assert [(row["name"], row["number"], row["counts"]) for row in table] == [("3", 3, 4000), ("load", None, 1016)]
    assert live_processes.connect(str(file), "export", str(folder / "places.csv")).returncode == 0
    missing = live_processes.connect(str(file), "go_to", "lode")
    assert (missing.returncode, missing.stdout) == (2, "")
    assert "load" in missing.stderr
    live.end()


@in_wall_time
def test_47_a_page_sees_rows_of_its_own_channels(panel: PanelRig) -> None:
    """Two pages, each with channels of its own: columns as the ring holds them."""
    names = ["position", "controller.law.command"], ["controller.law.limited", "periods"]
    with panel.browser().socket() as one, panel.browser("viewer").socket() as other:
        first = [
            page.ask(do="watch", rate=50, channels=list(c))["watch"]["first"]
            for page, c in zip((one, other), names, strict=True)
        ]
        panel.bench.pass_time(0.2)
        table = []
        for page in (one, other):
            binary = page.until("binary")["binary"]
            at, n, channels = struct.unpack("<qII", binary[:16])
            table.append((at, np.frombuffer(binary[16:], "<f4").reshape(channels, n)))
        assert [at for at, _ in table] >= first
        at, columns = table[1]
        assert columns[1].tolist() == [row + 1 for row in range(at, at + columns.shape[1])]
        text = (
            panel.browser("viewer")
            .http.get("/api/scope.csv", params={"channels": "periods,position", "first": at})
            .text
        )
        rows = [line.split(",") for line in text.splitlines()]
        assert rows[0] == ["row", "periods", "position"]
        assert [int(row[0]) for row in rows[1:4]] == [at, at + 1, at + 2]
        ring = panel.bench.host.scope.rows(at)[0]
        assert [float(row[2]) for row in rows[1:]][: len(ring)] == ring["operation.answer.position"].tolist()
        assert "nobody watches" in one.ask(do="scope", channels=["lines.motor.count"])["error"]
        status = one.until("status")
        assert (status["clients"], status["holder"]) == (3, 0)


def test_37_a_limit_switch_is_left_away_from_it_only():
    """F30: onto it at full speed, rest, no further; the other way is free."""
    bench = Bench("cascade", "limit_switches.upper=80 mm", careful=False)
    bench.pass_time(0.05)
    bench.do(ops.ENABLE)
    bench.operation.trust = ops.NOT_KNOWN  # what a hard limit is for
    bench.host.axis.live.operation.creep = 1.0
    assert bench.do(ops.MOVE_BY, 0.3).how == ops.FAILED
    bench.pass_time(1.0)
    assert (bench.operation.fault, bench.host.state, bench.operation.demand.do) == (30, "fault", ops.HALT)
    passed = bench.host.axis.state.plant.machine.load.position - 0.08
    v, a, j = 0.5, 5.0, 200.0  # from its speed at the switch to rest
    assert 0.0 < passed < v * v / (2 * a) + v * a / (2 * j) + 2e-3
    bench.do(ops.RESET)
    assert bench.do(ops.ENABLE).how == ops.DONE
    here = bench.answer.commanded
    assert (bench.do(ops.MOVE_BY, 1e-3).why, bench.operation.fault) == (ops.BEYOND, 0)
    assert bench.answer.commanded == here
    assert bench.do(ops.MOVE_BY, -0.1).how == ops.DONE
    assert bench.do(ops.MOVE_BY, 1e-3).how == ops.DONE


def test_37_a_motor_that_has_more_than_it_bears_comes_to_rest_in_the_time_of_its_model():
    """F21: to and fro without a rest until the squared current, smoothed, has reached that of `motor.max_current`."""
    bench = Bench("cascade", "motor.max_current=0.4 A", "protection.thermal_time=2 s").enable()
    heat = bench.host.axis.state.controller.supervision
    drive, way, ending, squares, periods = bench.host.axis.state.lines, 0.1, None, 0.0, 0
    while periods < 10000 and not bench.operation.fault:
        if ending is None or bench.host.ending(ending) is not None:
            ending, way = bench.host.ask(ops.MOVE_BY, way), -way
        bench.host.run(1)
        periods += 1
        squares += (drive.command * 0.8 / 0.4) ** 2
    assert (bench.operation.fault, bench.operation.trust) == (21, ops.REFERENCED)
    mean = squares / periods  # 1 = mean (1 - exp(-t / T)), as far as the load is even
    assert mean > 1.0
    assert mean * -math.expm1(-periods * 1e-3 / 2.0) == pytest.approx(1.0, abs=0.25)
    assert 1.0 < heat.heat < 1.1
    bench.pass_time(1.0)
    assert (bench.host.state, bench.operation.demand.do) == ("fault", ops.REST_OFF)
    cooled = float(heat.heat)
    bench.pass_time(2.0)
    assert heat.heat == pytest.approx(cooled * math.exp(-1.0), rel=1e-3)
    bench.do(ops.RESET)
    assert bench.do(ops.ENABLE).how == ops.DONE


def test_37_a_loop_that_swings_comes_to_rest():
    """F14: a drive that is late by 10 ms makes the loop unstable; an overshoot after a move is none."""
    bench = Bench("cascade").enable()
    bench.do(ops.MOVE_BY, 0.05)
    bench.host.ask(*injection_of(bench.host.axis.places, "drive delayed 10 ms"))
    bench.host.ask(ops.MOVE_BY, 0.05)
    bench.pass_time(1.5)
    assert bench.operation.fault == 14
    assert bench.operation.trust == ops.REFERENCED
    assert "swings" in bench.host.axis.fault()


@in_wall_time
def test_52_connections_that_show_no_link_lock_nobody_out(panel: PanelRig) -> None:
    """They are held open and say nothing; of more than so many the oldest goes, and whoever shows a link stays."""
    known = panel.browser()
    assert known.http.get("/").status_code == 200
    with ExitStack() as held:
        strangers = [held.enter_context(socket.create_connection(("127.0.0.1", panel.port), 10.0)) for _ in range(60)]
        assert known.http.get("/").status_code == 200
        assert panel.browser("viewer").http.get("/").status_code == 200
        for one in strangers[: 60 - MOST_STRANGERS]:
            with suppress(ConnectionResetError):
                assert one.recv(1) == b""
        last = strangers[-1]
        last.sendall(b"GET / HTTP/1.1\r\n\r\n")
        assert last.recv(12) == b"HTTP/1.1 400"  # it is still listened to


# ---- jobs


def moved_job(*places: str, **more: Any) -> dict[str, Any]:
    """A job as a page or a program says it."""
    return {"moves": [*places], **more}


@pytest.mark.parametrize("name", MOVED)
def test_13_a_job_ends_once_and_its_moves_where_they_were_asked(name: str) -> None:
    bench = Bench(name).enable()
    session, ended = Session(bench.host, {}), bench.operation.endings
    job = session.ask("job", moved_job("30 mm", "34 mm", rounds=2, rest=0.02), 0.5)
    seen = list[float]()
    while bench.host.ending(job) is None:
        bench.host.keep_job()
        bench.host.run(1)
        seen.append(bench.answer.position)
    assert bench.host.ending(job) == Ending(job, DONE, 0, 0)
    assert [ended.id[k] for k in range(ended.count)].count(job) == 1
    assert max(seen) == pytest.approx(0.034, abs=3e-4)
    assert seen[-1] == pytest.approx(0.034, abs=2e-4)
    assert sum((b - 0.032) * (a - 0.032) < 0 for a, b in pairwise(seen)) == 3  # two rounds


@pytest.mark.parametrize("name", MOVED)
def test_13_a_pause_holds_a_job_and_a_stop_empties_its_queue(name: str) -> None:
    bench = Bench(name).enable()
    session, o = Session(bench.host, {}), bench.operation
    job = session.ask("job", moved_job(*["10 mm", "300 mm"] * 10), 0.5)
    bench.pass_time(0.01)
    while session.status()["job"]["done"] == 0 or bench.answer.position < 0.05:
        bench.host.keep_job()
        bench.host.run(1)  # on its way from 10 mm
    assert session.wait(session.ask("pause", client=7)).how == "done"
    bench.pass_time(0.5)
    held, done = bench.answer.position, session.status()["job"]["done"]
    assert bench.answer.rests
    assert 0.05 < held < 0.25
    bench.pass_time(1.0)
    assert bench.answer.position == pytest.approx(held, abs=2e-4)
    wanted = {"name": "20 moves", "done": done, "of": 20, "paused": True, "shown": {}}
    assert session.status()["job"] == wanted
    assert ("a pause holds its job", "resume, or stop") in why_not_moving(session.status())
    assert session.wait(session.ask("resume", client=7)).how == "done"
    while session.status()["job"]["done"] == done:
        bench.host.keep_job()
        bench.host.run(1)
    stopped = session.ask("stop")
    assert session.wait(stopped).how == "done"
    begun, place = int(bench.host.board.program.begun), bench.answer.position
    bench.pass_time(3.0)
    assert (int(o.running), int(bench.host.board.program.begun)) == (0, begun)
    assert bench.answer.position == pytest.approx(place, abs=2e-4)
    assert session.wait(job).how == "aborted"
    assert session.wait(session.ask("resume")).code == ops.NO_JOB
    second = session.ask("job", moved_job("12 mm"))
    assert session.wait(second).how == "done"


def test_18_a_job_that_nobody_keeps_stops_within_its_lease() -> None:
    bench = Bench("cascade").enable()
    job = Session(bench.host, {}).ask("job", moved_job(*["10 mm", "300 mm"] * 50), 0.2)
    begin = int(bench.loop.periods)
    while bench.host.ending(job) is None:
        bench.host.run(1)
    assert bench.host.ending(job) == Ending(job, ops.FAILED, ops.LEASE_LOST, 0)
    assert (bench.loop.periods - begin) * bench.loop.period * 1e-9 == pytest.approx(2.0, abs=0.003)
    bench.pass_time(1.0)
    assert (bench.host.state, bench.answer.rests) == ("operation enabled", 1)


def test_13_one_job_at_a_time_and_none_that_leaves_the_limits() -> None:
    bench = Bench("cascade").enable()
    session = Session(bench.host, {})
    job = session.ask("job", str(EXAMPLES / "slide_moves.toml"))
    second = session.ask("job", moved_job("12 mm"), client=2)
    assert session.wait(second).code == ops.BUSY
    bench.pass_time(0.01)
    assert session.status()["job"]["name"] == "slide_moves.toml"
    assert session.wait(job).how == "done"
    with pytest.raises(DetentError, match="move 2: got 9 m"):
        session.ask("job", moved_job("10 mm", "9 m"))
    session.wait(session.ask("disable"))
    assert session.wait(session.ask("job", moved_job("12 mm"))).code == ops.NOT_ENABLED


def test_28_a_session_with_a_job_repeats_itself() -> None:
    bench = Bench("filtered_servo").enable()
    session = Session(bench.host, {})
    job = session.ask("job", moved_job(*["10 mm", "12 mm"] * 50))  # more than the tray has places
    bench.pass_time(0.3)
    session.ask("pause")
    bench.pass_time(0.2)
    session.ask("resume")
    assert session.wait(job).how == "done"
    again = Bench("filtered_servo")
    repeat(again.host, bench.host.log, int(bench.loop.periods))
    assert bytes(again.host.axis.state) == bytes(bench.host.axis.state)


@pytest.mark.compiled
def test_24_the_table_does_a_job_of_numbers() -> None:
    bench = Bench("rotary_table").enable()
    session = Session(bench.host, {})
    assert session.wait(session.ask("job", moved_job("1", "0", "30 deg", "1"))).how == "done"
    assert bench.answer.position == pytest.approx(bench.spec.position["1"].angle, abs=2 * bench.grain)


@pytest.mark.compiled
def test_23_a_print_job_is_held_between_two_lines() -> None:
    axis = Head(speed=10.0)
    session = Session(axis.host, {})
    job = session.ask("job", {"text": "detent\nholds\nits\nhead"})
    axis.host.run(2)
    while session.status()["job"]["done"] < 1:
        axis.host.run(1)
    session.ask("pause")
    axis.host.run(100)  # a second of the axis: the line that had begun is printed
    done = session.status()["job"]["done"]
    assert 1 <= done <= 3
    axis.host.run(100)
    assert session.status()["job"]["done"] == done
    assert axis.speed < 0.01
    session.ask("resume")
    assert session.wait(job).how == "done"
    assert axis.printed().characters == 18


@in_wall_time
def test_18_a_job_of_a_stopped_program_ends_with_its_lease(folder: Path, running: live_processes.Running) -> None:
    """SIGSTOP: the connection stays, nobody keeps the job; a program that is killed leaves at once."""
    file = folder / "slide.toml"
    for number, longest in ((signal.SIGSTOP, 2.6), (signal.SIGKILL, 0.6)):
        with detent.connect(file) as axis:
            axis.enable()
            axis.confirm()
        (folder / "moves.csv").write_text("target [mm],speed [mm/s],repeat\n10,20,\n40,20,500\n", encoding="ascii")
        command = [sys.executable, "-m", "detent", "connect", str(file), "job", str(folder / "moves.csv")]
        program = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        with detent.connect(file) as watcher:
            until(watcher, lambda now: now["job"] is not None and not now["rests"])
            os.kill(program.pid, number)
            begin = watcher.status["loop"]["periods"]
            ended = until(watcher, lambda now: now["running"] is None)
            assert (ended["loop"]["periods"] - begin) * 1e-2 < longest
            assert until(watcher, lambda now: now["rests"])["fault"] is None
        os.kill(program.pid, signal.SIGKILL)
        program.communicate()
        with detent.connect(file) as axis:
            until(axis, lambda now: now["client"] == 0)
    running.end()


@in_wall_time
def test_56_a_job_is_led_held_and_stopped_from_terminals(folder: Path, running: live_processes.Running) -> None:
    file = str(folder / "slide.toml")
    (folder / "moves.csv").write_text("target [mm],dwell [ms]\n12,50\n40,\n10,\n", encoding="ascii")
    with detent.connect(file) as axis:
        axis.enable()
        axis.confirm()
    assert live_processes.connect(file, "pause").returncode == 1
    done = live_processes.connect(file, "job", str(folder / "moves.csv"), "--json")
    assert (done.returncode, json.loads(done.stdout)["ended"]["how"]) == (0, "done")
    with detent.connect(file) as axis:
        assert axis.position == pytest.approx(0.01, abs=1e-4)
        job = axis.run_job(["12 mm", "40 mm"] * 50, wait=False)
        assert live_processes.connect(file, "pause").returncode == 0
        assert axis.status["job"]["paused"] is True
        assert live_processes.connect(file, "resume").returncode == 0
        assert axis.status["job"]["paused"] is False
        assert live_processes.connect(file, "stop").returncode == 0
        with pytest.raises(CommandAbortedError):
            job.wait(5.0)
    assert live_processes.connect(file, "job", str(folder / "none.csv")).returncode == 2
    assert live_processes.connect(file, "job").returncode == 2
    running.end()


# ---- homing of the methods beside the cascade

ZEROS = {
    "filtered_servo contact": (-4e-6, 4e-6), "filtered_servo switch": (-3e-6, 9e-6),
    "filtered_servo index": (-9e-6, 3e-6), "phase_servo index": (-14e-6, 14e-6), "zoom switch": (-4e-6, 6e-6),
}  # fmt: skip
"""Between what the position lies less the true one after a homing and a move [m]: a pulse of 5 um and the sample of it,
the two steps within which a phase servo stops, a step of the motor."""


def check_homing(case: str, starts: int) -> list[float]:
    """The same zero from so many starts."""
    name, way = case.split()
    lowest, highest = ZEROS[case]
    found = zeros(way, starts, name)
    assert len(found) == starts
    assert lowest < min(found)
    assert max(found) < highest
    return found


@pytest.mark.wide
@pytest.mark.compiled
@pytest.mark.parametrize("case", HOMED)
def test_22_each_method_finds_the_same_zero(case: str) -> None:
    check_homing(case, 3)


@pytest.mark.long
@pytest.mark.compiled
@pytest.mark.parametrize("case", HOMED)
def test_22_each_method_finds_the_same_zero_from_a_hundred_starts(case: str) -> None:
    found = check_homing(case, 100)
    if case != "zoom switch":  # whose steps and rotor stand alike each time
        assert max(found) > min(found)


@pytest.mark.wide
@pytest.mark.compiled
@pytest.mark.parametrize("name", ["filtered_servo", "phase_servo", "zoom", "rotary_table", "print_head", "cascade"])
def test_22_home_is_a_command_of_all_six(name: str) -> None:
    bench = Bench(name, careful=False, **({"motor": "group_b"} if name == "zoom" else {}))
    bench.pass_time(0.7)
    assert bench.do(ops.ENABLE).how == ops.DONE
    bench.pass_time(0.5)
    while not bench.answer.rests:
        bench.pass_time(0.5)
    bench.operation.trust = ops.NOT_KNOWN
    assert bench.do(ops.HOME).how == ops.DONE
    assert bench.operation.trust == ops.REFERENCED


@pytest.mark.wide
@pytest.mark.process
def test_22_the_panel_homes_and_says_where_it_stands(tmp_path: Path) -> None:
    """On its view Home: which step is under way, what came of it, and a stop on the way leaves the position unknown."""
    options = ("--period", "10 ms", "--set", "home.back_off=1 mm", "--set", "home.position=18 mm")
    with panelled(tmp_path, "filtered_servo.toml", *options) as live:
        found = run_script("home", live.link())
    assert found["problems"] == []
    assert found["stopped"] == ["unknown", "Not homed (aborted)"]
    assert found["under way"] == "Look for the reference"
    assert found["trust"] == "referenced"
    assert found["told"].startswith("Homed: it stands at ")
    assert 0.018 < found["position"] < 0.025
    assert found["widest"] <= 360


@pytest.mark.wide
@pytest.mark.compiled
@pytest.mark.parametrize("name", ["rotary_table", "phase_servo", "zoom"])
def test_21_the_first_motion_is_held_to_a_tenth_of_the_speed(name: str) -> None:
    """By what each has moved in ten periods, for its sensor counts in steps, and some only every other period."""
    bench = Bench(name, **({"motor": "group_b"} if name == "zoom" else {}))
    bench.pass_time(0.7)
    assert bench.do(ops.ENABLE).how == ops.DONE
    bench.pass_time(0.7)
    table, top = name == "rotary_table", bench.host.axis.speed
    bench.host.ask(*((ops.GO, 3) if table else (ops.MOVE_BY, 4e-3)))
    seen: list[float] = []
    while not bench.answer.rests or len(seen) < 50:
        bench.host.run(1)
        seen.append(bench.answer.position)
    ways = np.abs(np.diff(seen))
    speeds = np.convolve(ways, np.ones(10), "valid") / (10 * bench.loop.period * 1e-9)
    assert 0.04 * top < max(speeds) <= 0.125 * top


@live_board.needs_cc
@pytest.mark.wide
@pytest.mark.process
@pytest.mark.parametrize("overrides", [(), (live_board.HARDWARE, live_board.SINGLE)], ids=["double", "single"])
def test_31_a_board_is_led_over_a_serial_line_as_a_drive_is(overrides):
    """Jog, stop and homing on the exported controller; what is commanded is where the machine goes."""
    with live_board.on_board(*overrides) as (bench, drive):
        facts = {fact.name: fact.value for fact in bench.host.link.facts}
        assert "as the axis file gives it" in facts["firmware"]
        bench.pass_time(0.02)
        assert bench.do(ops.ENABLE).how == ops.DONE
        assert bench.do(ops.CONFIRM).how == ops.DONE
        assert bench.do(ops.HOME).how == ops.DONE
        assert bench.operation.trust == ops.REFERENCED
        machine = drive.board.plant.state.plant.machine
        assert abs(machine.motor.position - bench.answer.position) < 5e-6
        jog = bench.host.ask(ops.JOG, 0.1)
        bench.pass_time(0.15)
        assert machine.motor.velocity == pytest.approx(0.1, rel=0.02)
        bench.pass_time(LEASE)  # nobody keeps it
        assert bench.host.ending(jog) == Ending(jog, ops.FAILED, ops.LEASE_LOST, 0)
        bench.host.ask(ops.MOVE_TO, 0.2)
        bench.pass_time(0.1)
        bench.host.stop()
        bench.pass_time(0.3)
        assert abs(machine.motor.velocity) < 1e-4
        assert bench.do(ops.MOVE_TO, 0.1).how == ops.DONE
        assert abs(machine.motor.position - 0.1) <= bench.spec.method.in_position
        bench.do(ops.OFF)
        bench.host.run(2)
        assert drive.board.plant.state.lines.enable == 0


@live_board.needs_cc
@pytest.mark.wide
@pytest.mark.process
def test_31_a_board_on_a_bad_line_is_led_as_on_a_good_one():
    live_board.lead_on_bad_line(6_000)


@live_board.needs_cc
@pytest.mark.long
@pytest.mark.process
def test_31_a_board_takes_a_hundred_thousand_frames_of_a_bad_line():
    live_board.lead_on_bad_line(50_000)


@live_board.needs_cc
@pytest.mark.wide
@pytest.mark.process
@pytest.mark.parametrize("cut", ["both", "to", "from"])
def test_30_a_cut_serial_line_brings_the_axis_to_rest_and_nothing_resumes(cut):
    """Led by nobody the board slows down by itself; told to let go, or at rest, it has no torque."""
    with live_board.on_board() as (bench, drive):
        live_board.ready_on(bench)
        move = bench.host.ask(ops.MOVE_BY, 0.2)
        bench.pass_time(0.2)
        machine, lines = drive.board.plant.state.plant.machine, drive.board.plant.state.lines
        assert machine.motor.velocity > 0.3
        drive.cut, drive._wait, begun = cut, 1e-4, bench.loop.periods
        while bench.operation.fault == 0:
            bench.host.run(1)
        assert (bench.loop.periods - begun) * live_board.SAMPLE <= drive.silence + 2e-3
        assert (bench.operation.fault, bench.host.axis.state.lines.enable) == (DRIVE_LOST, 0)
        assert bench.host.ending(move) == Ending(move, ops.FAILED, DRIVE_LOST, 0)
        speed, place = machine.motor.velocity, machine.motor.position
        bench.pass_time(0.15)
        assert lines.enable == 0
        if cut == "both":  # it hears nothing, and comes to rest by the acceleration of the file
            assert abs(machine.motor.velocity) < 1e-3
            way = machine.motor.position - place
            assert way == pytest.approx(speed**2 / (2 * bench.spec.limits.acceleration), rel=0.2)
        drive.cut, drive._wait = "", 1.0
        bench.pass_time(0.1)
        assert (bench.host.state, lines.enable) == ("fault", 0)
        assert bench.do(ops.RESET).how == ops.DONE
        bench.pass_time(0.02)
        assert lines.enable == 0
        live_board.ready_on(bench)
        assert moved(bench)[0].how == ops.DONE


@live_board.needs_cc
@pytest.mark.wide
@pytest.mark.process
def test_32_another_board_or_another_firmware_is_not_enabled():
    with live_board.on_board('hardware.id="serial slide 8"') as (bench, drive):
        session = Session(bench.host, {})
        bench.pass_time(0.02)
        ended = session.wait(session.ask("enable"))
        assert (ended.how, ended.code) == ("refused", OTHER_HARDWARE)
        assert {"serial slide 7", "serial slide 8"} <= {*re.findall(r"serial slide \d", ended.reason)}
        assert drive.board.plant.state.lines.enable == 0
    with (
        pytest.raises(DetentError, match=r"F66.*export firmware"),
        live_board.on_board(live_board.HARDWARE, "method.position_gain=30"),
    ):
        pass


@pytest.mark.wide
@pytest.mark.parametrize("mode", ["velocity", "position"])
def test_29_a_drive_that_is_told_velocities_or_positions_ends_a_move_in_its_window(mode):
    """Its loops are those of the example, without what they know of mass and friction; the guard here stays silent."""
    channel = f"test 29 {mode}"
    with (
        live_drive.drive(channel, mode=mode) as drive,
        live_drive.driven(f"virtual:{channel}@5?mode={mode}") as bench,
    ):
        facts = {fact.name: fact.value for fact in bench.host.link.facts}
        assert facts["takes"].startswith(f"a {mode}")
        assert facts["interpolates (60C2)"] == "over 0.25 ms"
        driven, there = moved(ready_on(bench))
        assert driven.how == ops.DONE
        assert abs(drive.position * 1e-6 - 0.03) <= bench.spec.method.in_position
        assert (bench.operation.fault, bench.host.board.wires.torn) == (0, 0)
        jog = bench.host.ask(ops.JOG, 0.1)
        bench.pass_time(0.15)
        ahead = drive.position * 1e-6 - bench.answer.position
        assert ahead == pytest.approx(0.1 * live_drive.SAMPLE, abs=2e-6)  # the answer was a sample ago
        assert bench.answer.velocity == pytest.approx(0.1, rel=0.05)
        bench.pass_time(LEASE + 0.3)  # nobody keeps it
        assert bench.host.ending(jog) == Ending(jog, ops.FAILED, ops.LEASE_LOST, 0)
        resting = drive.position
        bench.pass_time(0.2)
        assert abs(drive.position - resting) <= 3
    simulated, here = moved(Bench("cascade", period=live_drive.SAMPLE).enable())
    assert simulated.how == ops.DONE
    apart = [abs(one - other) for one, other in zip(here, there, strict=False)]
    # What nobody feeds forward the integral of the drive finds: 0.15 mm on the way, and 20 ms later in the window.
    assert 0.0 < (len(there) - len(here)) * live_drive.SAMPLE < 0.03
    assert 5e-5 < max(apart) < 3e-4


@pytest.mark.wide
@pytest.mark.parametrize("mode", ["velocity", "position"])
def test_30_a_cut_cable_leaves_no_demand_behind_in_the_other_modes(mode):
    now, channel = 0.0, f"test 30 {mode}"
    with (
        live_drive.drive(channel, mode=mode, clock=lambda: now) as drive,
        live_drive.driven(f"virtual:{channel}@5?mode={mode}") as bench,
    ):
        ready_on(bench)
        move = bench.host.ask(ops.MOVE_BY, 0.1)
        bench.pass_time(0.2)
        assert bench.answer.velocity > 0.2
        wires, network = drive.plant.state.lines, drive.node.network
        network.bus = None  # nothing of it is heard
        network.notifier.stop()
        bench.host.link.driver._wait, before = 1e-4, bench.loop.periods
        while bench.operation.fault == 0:
            bench.host.run(1)
        assert bench.loop.periods - before <= 3 * live_drive.HEARTBEAT / live_drive.SAMPLE + 1
        lines = bench.host.axis.state.lines
        assert (bench.operation.fault, lines.enable, lines.velocity if mode == "velocity" else 0.0) == (
            DRIVE_LOST,
            0,
            0,
        )
        assert bench.host.ending(move) == Ending(move, ops.FAILED, DRIVE_LOST, 0)
        assert wires.enable == 1  # so far as the drive knows
        now = 0.035
        drive.watch()
        assert (STATE_NAMES[drive.state], drive.error, wires.enable) == ("fault", 0x8130, 0)


@pytest.mark.wide
def test_29_an_axis_that_is_stuck_behind_the_loops_of_its_drive_is_seen_by_its_torque():
    """At a hard stop 5 mm ahead the integral of the drive pushes, and the guard here takes the torque away."""
    channel = "test 29 stuck"
    with (
        live_drive.drive(channel, mode="velocity") as drive,
        live_drive.driven(f"virtual:{channel}@5?mode=velocity") as bench,
    ):
        ready_on(bench)
        stop = drive.plant.params.plant.stop
        stop.side, stop.place, stop.stiffness, stop.damping = 1.0, 0.025, 1e8, 1e4
        ended = bench.do(ops.MOVE_BY, 0.01)
        assert (ended.how, ended.why) == (ops.FAILED, STUCK)
        assert bench.answer.position == pytest.approx(0.025, abs=1e-4)
        bench.host.run(2)
        assert (drive.plant.state.lines.enable, drive.torque) == (0, 0)


# ---- a rotary table on a drive


@contextmanager
def table_on_a_drive(channel: str) -> Iterator[tuple[Any, Bench]]:
    """The example before a drive that is told velocities, with the amplifier, motor and gears of its file."""
    made = drive_of(EXAMPLES / "rotary_table.toml", live_drive.NODE, (), "velocity", identity=live_drive.IDENTITY)
    with live_drive.joined(made, channel) as drive:
        driver = CanopenDrive(f"virtual:{channel}@{live_drive.NODE}?mode=velocity", 5.0)
        bench = Bench("rotary_table", live_drive.HARDWARE, driver=driver, period=2e-3)
        try:
            bench.pass_time(0.05)
            yield drive, bench
        finally:
            bench.host.close()


@pytest.mark.wide
def test_29_a_table_on_a_drive_goes_to_its_numbers_as_in_the_simulation():
    """Its sensor shows it the angle; a home makes that the reference. It is there as soon as in the simulation."""
    simulated, times = Bench("rotary_table").enable(), dict[int, float]()
    for number in (3, 1, 2, 4):
        begun = int(simulated.loop.periods)
        assert simulated.do(ops.GO, number).how == DONE
        times[number] = (simulated.loop.periods - begun) * 1e-3
    with table_on_a_drive("test 29 table") as (drive, bench):
        assert bench.answer.position == pytest.approx(math.radians(10.0), abs=bench.spec.count)
        assert bench.do(ops.ENABLE).how == DONE
        assert bench.do(ops.GO, 3).why == ops.UNREFERENCED
        assert [bench.do(kind).how for kind in (ops.HOME, ops.CONFIRM)] == [DONE, DONE]
        for number, simulated_time in times.items():
            begun = int(bench.loop.periods)
            assert bench.do(ops.GO, number).how == DONE
            assert (bench.loop.periods - begun) * 2e-3 == pytest.approx(simulated_time, abs=0.05)
            angle = drive.position * bench.spec.count % math.tau
            assert angle == pytest.approx(bench.spec.position[str(number)].angle, abs=2 * bench.spec.count)
        # For ever: three turns across the wrap of its angle, and back to a number.
        bench.host.axis.live.operation.lease_looks = 1 << 40  # type: ignore[attr-defined]
        bench.host.ask(ops.JOG, bench.spec.limits.speed)
        bench.pass_time(3 * math.tau / bench.spec.limits.speed)
        bench.host.stop()
        bench.pass_time(1.0)
        assert drive.position > 2.9 * bench.spec.period
        assert bench.do(ops.GO, 3).how == DONE
        assert bench.operation.fault == 0


@pytest.mark.wide
def test_30_a_table_whose_drive_is_silent_has_no_velocity_left():
    with table_on_a_drive("test 30 table") as (drive, bench):
        for kind in (ops.ENABLE, ops.HOME, ops.CONFIRM):
            assert bench.do(kind).how == DONE
        move = bench.host.ask(ops.GO, 2)
        bench.pass_time(0.3)
        assert bench.host.axis.state.lines.velocity != 0.0
        network = drive.node.network
        bus, network.bus = network.bus, None
        network.notifier.stop()
        bench.host.link.driver._wait = 1e-4
        heard = bench.host.board.wires.heard
        while bench.operation.fault == 0:
            bench.host.run(1)
        assert bench.loop.deadline - heard <= 3 * live_drive.HEARTBEAT * 1e9 + bench.loop.period
        assert bench.host.ending(move) == Ending(move, ops.FAILED, DRIVE_LOST, 0)
        bench.host.run(1)
        lines = bench.host.axis.state.lines
        assert (lines.enable, lines.velocity) == (0, 0.0)
        network.bus = bus


@pytest.mark.parametrize(
    ("override", "mode", "told"),
    [("axis.name='t'", "torque", "mode=velocity"), ("axis.name='t'", "position", "mode=velocity"),
     ("method.position_gain=400", "velocity", "method.position_gain = "),
     ("method.position_control=false", "velocity", "leave it out")],
)  # fmt: skip
def test_29_a_table_that_no_drive_can_turn_is_refused(override, mode, told):
    spec = load_spec(EXAMPLES / "rotary_table.toml", [override])
    with pytest.raises(DetentError, match=told):
        METHODS["rotary_table"].machine(spec, mode=mode)
