"""`detent live` in processes of its own, with people who watch, flood, and stay for long."""

import contextlib
import io
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
import pytest

import detent
from detent.cli import main
from tests.live_panel import Browser, Socket

STARTED: list[subprocess.Popen[str]] = []  # also by a test that fails


class Live:
    """`detent live` on a file."""

    def __init__(self, file: Path, *more: str) -> None:
        self.file = file
        command = [sys.executable, "-m", "detent", "live", str(file), *more]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        STARTED.append(self.process)
        assert self.process.stdout is not None
        self.out = self.process.stdout

    def panel_id(self) -> int:
        """Process of the panel."""
        found = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children").read_text(encoding="ascii").split()
        panels = [pid for pid in found if "detent.panel" in Path(f"/proc/{pid}/cmdline").read_text(encoding="utf-8")]
        return int(panels[0])

    def end(self, number: int = signal.SIGINT) -> str:
        """Interrupt it; what it says at its end."""
        self.process.send_signal(number)
        out, err = self.process.communicate(timeout=30)
        assert self.process.returncode == 0
        assert all(line.startswith("First run") for line in err.splitlines()), err
        return out


class Running(Live):
    """The same in words for programs."""

    def __init__(self, file: Path, *more: str) -> None:
        super().__init__(file, "--json", *more)
        self.started: dict[str, Any] = json.loads(self.out.readline())

    def ended(self, number: int = signal.SIGINT) -> dict[str, Any]:
        """Interrupt it; how it ended."""
        return json.loads(self.end(number))["ended"]


@contextmanager
def live_folder(folder: Path) -> Iterator[Path]:
    """A folder with an axis file, slide.toml, and for channels; nothing that was started there stays."""
    shutil.copy(detent.example("filtered_servo.toml"), folder / "slide.toml")
    folder.chmod(0o700)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_RUNTIME_DIR", str(folder))
        yield folder
    while STARTED:
        one = STARTED.pop()
        if one.poll() is None:
            one.kill()
            one.communicate()


def entered(link: str) -> Browser:
    """Follow a link."""
    base = link.partition("/enter")[0]
    browser = Browser(base, "", {})
    assert browser.http.get(link).status_code == 303
    return browser


class Stops(NamedTuple):
    """What 99 of 100 stops took, and what the loop missed meanwhile."""

    computed: float  # processor time of panel and axis from the request to its answer [s]
    waited: float  # the same by the clock on the wall [s]
    late: float  # share of periods skipped


def flooded(browser: Any, cookies: str, kind: str, socket: Socket, watcher: Any, pids: Sequence[int]) -> Stops:
    """Stops beside a flood."""
    flood = subprocess.Popen(
        [sys.executable, "-m", "tests.live_flood", browser.base, cookies, browser.form_mark(), kind],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    STARTED.append(flood)
    assert flood.stdout is not None
    assert flood.stdout.readline() == "floods\n"
    found = stops(socket, watcher, pids)
    told = json.loads(flood.communicate(timeout=60)[0])  # closes what it listens to
    assert told["sent"] >= (1000 if kind == "malformed" else 5_000)
    return found


def computed(pids: Sequence[int]) -> float:
    """Processor time that processes have used [s]."""
    return sum(time.clock_gettime(~pid << 3 | 2) for pid in pids)  # as clock_getcpuclockid(3) numbers their clocks


@contextmanager
def going_first() -> Iterator[None]:
    """The threads of this process before others: while it waits for its turn, the processes that it measures go on."""

    def nice(by: int) -> None:
        for thread in Path("/proc/self/task").iterdir():
            with suppress(OSError):
                os.setpriority(os.PRIO_PROCESS, int(thread.name), by)

    before = os.getpriority(os.PRIO_PROCESS, 0)
    nice(-15)
    try:
        yield
    finally:
        nice(before)


def stops(socket: Socket, watcher: Any, pids: Sequence[int]) -> Stops:
    """Stops, as many as 99 of 100 needs.

    From the request to its answer nothing sleeps: one of these processes computes, or waits for a processor. The time
    in which they compute is what a stop takes on a machine that has nothing else to do, however busy this one is.
    """
    taken: list[tuple[float, float]] = []
    before = watcher.status["loop"]
    with going_first():
        for _ in range(400):
            at, used = time.perf_counter(), computed(pids)
            assert "id" in socket.ask(do="stop")
            taken.append((computed(pids) - used, time.perf_counter() - at))
            threading.Event().wait(0.005)
    after = watcher.status["loop"]
    share = (after["skipped"] - before["skipped"]) / max(1, after["periods"] - before["periods"])
    return Stops(*(float(one) for one in np.quantile(taken, 0.99, axis=0)), share)


def resident(*processes: int) -> int:
    """Memory that processes hold [bytes]."""
    pages = [int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1]) for pid in processes]
    return sum(pages) * os.sysconf("SC_PAGE_SIZE")


def soak(folder: Path, warm: float, seconds: float) -> dict[str, float]:
    """Jogs, moves, a page with eight channels, and others that come and go; growth of memory after `warm` [1]."""
    live = Live(folder / "slide.toml", "--period", "10 ms", "--json")
    browser, left = entered(json.loads(live.out.readline())["panel"][0]), threading.Event()
    processes, held, rounds, begin = (live.process.pid, live.panel_id()), 0, 0, time.monotonic()
    with browser.socket() as socket, browser.socket() as page, detent.connect(live.file) as axis:
        names = [one["name"] for one in axis.about["channels"] if one["name"] != "periods"][:8]
        page.ask(do="watch", rate=25, channels=names)

        def read() -> None:
            while not left.is_set():
                page.until("status")

        reader = threading.Thread(target=read)
        reader.start()
        for word in ("take", "enable", "confirm"):
            socket.ask(do=word)
        while (passed := time.monotonic() - begin) < warm + seconds:
            socket.ask(do="jog", value="20 mm/s" if rounds % 2 else "-20 mm/s")
            for _ in range(10):
                left.wait(0.05)
                socket.ask(do="keep")
            socket.ask(do="stop")
            socket.ask(do="move_to", value="30 mm")
            # A connection of its own: the panel may end one that was idle just when it is used again.
            assert browser.http.get("/", headers={"connection": "close"}).status_code == 200
            with detent.connect(live.file) as other:
                assert other.status["fault"] is None
            rounds += 1
            held = held or (resident(*processes) if passed > warm else 0)
        grown = resident(*processes) / held - 1.0
        left.set()
        reader.join()
        status = axis.status
    browser.http.close()
    live.end()
    assert live.process.returncode == 0
    return {"grown": grown, "fault": status["fault"], "rounds": rounds, "skipped": status["loop"]["skipped"],
            "periods": status["loop"]["periods"]}  # fmt: skip


def run(*args: str) -> subprocess.CompletedProcess[str]:
    """A command in another process."""
    return subprocess.run([sys.executable, "-m", "detent", *args], capture_output=True, text=True, check=False)


def connect(*args: str) -> subprocess.CompletedProcess[str]:
    """`detent connect` in this process, where all that it imports is loaded: the axis runs in another anyway."""
    out, err, status = io.StringIO(), io.StringIO(), 0
    with (
        patch.object(sys, "argv", ["detent", "connect", *args]),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            main()
        except SystemExit as left:
            status = int(left.code or 0)
    return subprocess.CompletedProcess(args, status, out.getvalue(), err.getvalue())
