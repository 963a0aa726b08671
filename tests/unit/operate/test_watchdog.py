"""The watchdog: by itself with a clock of our own, and over a loop that is really stopped or killed."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from mmap import mmap
from pathlib import Path
from typing import Any

import pytest
from tests.acceptance.test_golden_bits import EXAMPLES
from tests.live_bench import Bench

import detent
from detent.control import operation as ops
from detent.errors import LOOP_DEAD
from detent.operate import watchdog
from detent.operate.host import Ending
from detent.operate.loop import Board
from detent.operate.start import shared_memory
from detent.operate.watchdog import LEAST, LOOK, PLACES, Watch, Watchdog

MS = 1_000_000


def watched() -> tuple[Any, Watch]:
    """A board, and what watches it."""
    _, memory = shared_memory()
    board: Any = Board.from_buffer(memory)
    kind = type(board.loop)
    board.loop.patience, board.loop.alive = 100 * MS, 1000 * MS
    return board, Watch(memory, [Board.loop.offset + getattr(kind, name).offset for name in PLACES])  # type: ignore[attr-defined]


def test_it_pulls_its_line_once_for_each_death():
    board, watch = watched()
    assert not watch.look(1100 * MS)
    assert watch.look(1100 * MS + 1)
    assert (board.loop.found_dead, board.loop.found_at) == (1, 1100 * MS + 1)
    assert not watch.look(1300 * MS)
    board.loop.alive = 1400 * MS
    assert not watch.look(1450 * MS)
    assert watch.look(1600 * MS)
    assert board.loop.found_dead == 2


def test_a_process_that_is_gone_is_not_waited_for():
    board, watch = watched()
    assert watch.look(1001 * MS, gone=True)
    assert board.loop.found_at == 1001 * MS


@pytest.mark.parametrize("register", ["alive", "patience"])
def test_what_has_not_begun_or_is_not_watched_is_not_found_dead(register):
    board, watch = watched()
    setattr(board.loop, register, 0)
    assert not watch.look(10_000 * MS, gone=True)


@pytest.mark.parametrize("stood", ["found by the watchdog", "found by itself", "not for too long"])
def test_a_loop_that_comes_back_has_no_torque(stood):
    bench = Bench("cascade").enable()
    c, loop = bench.host.axis.state.controller, bench.loop  # type: ignore[attr-defined]
    loop.patience = 100 * MS
    move = bench.host.ask(ops.MOVE_BY, 0.1)
    bench.pass_time(0.1)
    assert c.on == 1
    if stood == "found by the watchdog":
        loop.found_dead += 1
    else:
        loop.delay_at, loop.delay = loop.periods + 1, 101 * MS if stood == "found by itself" else 4 * MS
    bench.host.run(1)
    if stood == "not for too long":
        assert (c.on, bench.operation.fault, loop.died) == (1, 0, 0)
        return
    assert (c.on, bench.host.axis.state.lines.enable, bench.operation.fault) == (0, 0, LOOP_DEAD)  # type: ignore[attr-defined]
    assert bench.host.ending(move) == Ending(move, ops.FAILED, LOOP_DEAD, 0)
    bench.pass_time(0.5)
    assert (c.on, bench.host.state, loop.died) == (0, "fault", 1)
    assert bench.do(ops.ENABLE).why == ops.IN_FAULT
    bench.do(ops.RESET)
    assert c.on == 0
    bench.pass_time(1.0)
    bench.do(ops.ENABLE)
    assert (c.on, bench.operation.fault) == (1, 0)


def test_an_axis_without_torque_has_none_to_lose():
    bench = Bench("cascade")
    bench.pass_time(0.1)
    bench.loop.found_dead += 1
    bench.host.run(1)
    assert (bench.host.state, bench.operation.fault, bench.loop.died) == ("switch on disabled", 0, 1)


def test_it_looks_until_whoever_asked_is_gone(monkeypatch):
    file, memory = shared_memory()
    board: Any = Board.from_buffer(memory)
    board.loop.patience, board.loop.alive = 1, 1  # long ago
    answers = iter([[], [sys.stdin]])
    monkeypatch.setattr(watchdog.select, "select", lambda *_: (next(answers), [], []))
    monkeypatch.setattr(os, "sched_setscheduler", lambda *_: None, raising=False)
    kind = type(board.loop)
    watchdog.main(file, [Board.loop.offset + getattr(kind, name).offset for name in PLACES])  # type: ignore[attr-defined]
    os.close(file)
    assert board.loop.found_dead == 1


def test_one_that_has_died_has_a_successor():
    file, memory = shared_memory()
    board: Any = Board.from_buffer(memory)
    board.loop.period = 10 * MS
    made = Watchdog(board, file)
    assert board.loop.patience == LEAST * 1e9
    first = made.id
    assert not made.keep()
    made._process.kill()
    made._process.communicate()
    assert made.keep()
    assert made.id != first
    made.close()
    os.close(file)
    assert not is_there(made.id)


# ---- a real one


def until(met: Callable[[], bool]) -> None:
    """Wait for something that another process does."""
    end = time.monotonic() + 60.0
    while not met():
        assert time.monotonic() < end
        time.sleep(0.005)


@contextmanager
def running(folder: Path) -> Iterator[tuple["subprocess.Popen[str]", dict[str, Any], Any, Path]]:
    """`detent live` as a process: what it has said, its board, its file."""
    file = Path(shutil.copy(EXAMPLES / "cascade.toml", folder))
    words = [sys.executable, "-m", "detent", "live", str(file), "--headless", "--json", "--period", "10 ms"]
    env = os.environ | {"XDG_RUNTIME_DIR": str(folder)}
    process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=env)
    try:
        assert process.stdout is not None
        said = json.loads(process.stdout.readline())
        opened = [path for path in Path(f"/proc/{process.pid}/fd").iterdir() if "detent board" in str(path.readlink())]
        descriptor = os.open(opened[0], os.O_RDWR)
        board = Board.from_buffer(mmap(descriptor, 0))
        os.close(descriptor)
        yield process, said, board, Path(said["channel"])
    finally:
        process.kill()
        process.wait()
        if process.stdout is not None:
            process.stdout.close()


def is_there(process: int) -> bool:
    """True while a process of this number runs."""
    try:
        return Path(f"/proc/{process}/stat").read_text().split()[2] != "Z"
    except OSError:
        return False


@pytest.mark.wide
@pytest.mark.process
@pytest.mark.skipif(not hasattr(os, "memfd_create"), reason="the board is found by its name under /proc")
def test_a_stopped_loop_is_found_in_time_and_does_not_go_on(tmp_path):
    with running(tmp_path) as (process, _, board, channel), detent.connect(channel) as axis:
        axis.enable()
        axis.confirm()
        axis.move_by("200 mm", wait=False)
        until(lambda: board.operation.answer.velocity > 0.1)
        os.kill(process.pid, signal.SIGSTOP)
        until(lambda: board.loop.found_dead == 1)
        found_after = board.loop.found_at - board.loop.alive
        assert LEAST * 1e9 < found_after < (LEAST + 4 * LOOK) * 1e9 + 30 * MS  # a machine that others use, too
        os.kill(process.pid, signal.SIGCONT)
        until(lambda: board.operation.fault == LOOP_DEAD)
        until(lambda: axis.state == "fault" and abs(axis.status["velocity"]) < 1e-4)  # it has coasted to rest
        place = axis.position
        with pytest.raises(detent.operate.words.CommandRefusedError):
            axis.enable()
        assert axis.status["fault"]["code"] == LOOP_DEAD
        axis.reset()
        axis.enable()
        assert abs(axis.position - place) < 1e-3
        assert board.loop.found_dead == 1


@pytest.mark.wide
@pytest.mark.process
@pytest.mark.skipif(not hasattr(os, "memfd_create"), reason="the board is found by its name under /proc")
def test_a_killed_loop_is_found_in_time_and_its_watchdog_ends(tmp_path):
    with running(tmp_path) as (process, said, board, channel), detent.connect(channel) as axis:
        axis.enable()
        assert is_there(said["watchdog"])
        process.kill()
        until(lambda: board.loop.found_dead == 1)
        assert board.loop.found_at - board.loop.alive < (LEAST + 4 * LOOK) * 1e9 + 30 * MS
        until(lambda: not is_there(said["watchdog"]))


@pytest.mark.wide
@pytest.mark.process
@pytest.mark.skipif(not hasattr(os, "memfd_create"), reason="the board is found by its name under /proc")
def test_a_watchdog_that_has_died_has_a_successor_and_none_stays(tmp_path):
    with running(tmp_path) as (process, said, board, _):
        first = said["watchdog"]
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
        os.kill(first, signal.SIGKILL)
        until(lambda: (now := children.read_text().split()) != [] and now != [str(first)])
        (second,) = children.read_text().split()
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=60) == 0
        assert not is_there(int(second))
        assert (board.loop.left, board.loop.found_dead) == (1, 0)
