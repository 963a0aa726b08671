"""What a live axis does in wall time on one machine: ``python -m tests.live_figures``, about seven minutes.

It measures every part of `SHORT`, keeps each as soon as it is there in docs/live_figures.json, from which
``make figures`` draws, and writes docs/explanation/live-figures.md. Parts named as arguments are measured alone; those
of `LONG` only so. How busy the machine was is kept with each part: an idle one gives other figures.
"""

import json
import os
import platform
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from detent.control import operation as ops
from detent.errors import LOOP_OVERRUN
from detent.operate.channel import Channel
from detent.operate.drivers.canopen_drive import CanopenDrive
from detent.operate.loop import BINS, PULLS
from detent.operate.session import Session
from detent.panel.child import Child, PanelPlace
from tests import live_drive, live_kills, live_store
from tests.live_bench import Bench
from tests.live_browser import run_script
from tests.live_faults import RUNS, false_alarms
from tests.live_figures_page import KEPT, PAGE, page
from tests.live_panel import Socket
from tests.live_processes import entered, live_folder, soak
from tests.live_rig import memory_folder

PERIOD = 1e-3  # of the loop [s]
SECONDS = 20.0  # of each condition
STOPS = 200  # of each condition
SPEED = 0.1  # of the jog that they end [m/s]
BUSY = (sys.executable, "-c", "while True: pass")
ON_A_BUS = ("method.sample_period=1 ms", live_drive.HARDWARE)

Found = dict[str, Any]


def surroundings() -> Found:
    """The machine, and how many processes wanted a processor in the minute before."""
    text = Path("/proc/cpuinfo").read_text("utf-8")
    name = next((line.partition(":")[2].strip() for line in text.splitlines() if line.startswith("model name")), "")
    return {
        "processor": name or platform.machine(), "processors": os.cpu_count(), "system": platform.release(),
        "load": round(os.getloadavg()[0], 1), "day": f"{datetime.now(UTC):%Y-%m-%d}",
    }  # fmt: skip


@contextmanager
def busy_processes() -> Iterator[None]:
    """As many processes that compute as there are processors."""
    started = [subprocess.Popen(BUSY) for _ in range(os.cpu_count() or 1)]
    try:
        yield
    finally:
        for one in started:
            one.kill()
            one.wait()


@contextmanager
def busy_thread() -> Iterator[None]:
    """A thread of Python in this process that never yields."""
    left = threading.Event()

    def compute() -> None:
        while not left.is_set():
            sum(range(1000))

    thread = threading.Thread(target=compute)
    thread.start()
    try:
        yield
    finally:
        left.set()
        thread.join()


# ---- how late periods come


def late_in(loop: Any, seconds: float, wait: Callable[[float], object] = time.sleep) -> Found:
    """Periods by their lateness while something goes on, and how many were skipped."""
    before = np.array(loop.late), int(loop.periods), int(loop.skipped)
    wait(seconds)
    late = (np.array(loop.late) - before[0]).tolist()
    return {"late": late, "skipped": int(loop.skipped) - before[2], "worst": 2 ** int(max(np.flatnonzero(late))) / 1e3}


def late_in_python(seconds: float) -> Found:
    """The same of a loop in plain Python."""
    late, skipped, deadline = [0] * BINS, 0, time.monotonic()
    for _ in range(round(seconds / PERIOD)):
        deadline += PERIOD
        time.sleep(max(0.0, deadline - time.monotonic()))
        by = max(0.0, time.monotonic() - deadline)
        late[min(int(by * 1e6).bit_length(), BINS - 1)] += 1
        skipped += int(by / PERIOD)
        deadline += int(by / PERIOD) * PERIOD
    return {"late": late, "skipped": skipped, "worst": 2 ** int(max(np.flatnonzero(late))) / 1e3}


def lateness() -> Found:
    """Idle, under load, beside a thread that never yields (with a loop in Python), with page and fieldbus."""
    bench = Bench("cascade", wall=True, period=PERIOD)
    missing = bench.host.start()
    found: Found = {"missing": [one.partition(";")[0] for one in missing]}
    found["idle"] = late_in(bench.loop, SECONDS)
    with busy_processes():
        found["load"] = late_in(bench.loop, SECONDS)
    with busy_thread():
        found["thread"] = late_in(bench.loop, SECONDS)
        found["python"] = late_in_python(SECONDS / 2)
    bench.host.close()
    with live_drive.wire() as (near, far), live_drive.served(f"slcan:{far}@5"):
        live_drive.open_late(f"slcan:{near}@5")
        driver = CanopenDrive(f"slcan:{near}@5", 5.0)
        bench = Bench("cascade", *ON_A_BUS, wall=True, period=PERIOD, driver=driver)
        with paneled(bench) as child:
            seen: Found = {}
            taken = int(bench.host.board.wires.taken)
            link = child.link("engineer")
            one = late_in(bench.loop, SECONDS, lambda time: seen.update(run_script("speed", link, f"{time:g}")))
            one |= {"screens": round(seen["screens"], 1), "rows": round(seen["rows"])}
            found["page"] = one | {"answers": int(bench.host.board.wires.taken) - taken}
    return found


@contextmanager
def paneled(bench: Bench) -> Iterator[Child]:
    """The axis in wall time, with its channel and the panel in a process of its own."""
    bench.host.start()
    session = Session(bench.host, {"name": "axis", "simulated": True})
    with tempfile.TemporaryDirectory() as folder:
        channel = Channel(session, Path(folder) / "axis.sock")
        channel.start()
        child = Child(channel.path, PanelPlace())
        try:
            yield child
        finally:
            child.close()
            channel.close()
            session.close()


# ---- stops from the panel


def stops() -> Found:
    """From the moment in which a page sends its stop until the loop takes it, and until its command stands still."""
    bench = Bench("cascade", "mechanics.start_position=0.25 m", wall=True, period=PERIOD)  # room on both sides
    with paneled(bench) as child:
        browser = entered(child.link("engineer"))
        with browser.socket() as socket:
            end(socket, "take")
            found: Found = {"idle": stop_often(bench, socket)}
            with busy_processes():
                found["load"] = stop_often(bench, socket)
        browser.http.close()
    return found | {"ramp": ramp()}


def end(socket: Socket, *words: str) -> None:
    """Ask, and wait until it has ended."""
    for word in words:
        asked = socket.ask(do=word)["id"]
        while socket.until("ended")["ended"]["id"] != asked:
            pass


def stop_often(bench: Bench, socket: Socket) -> Found:
    """Jogs there and back, each ended by a stop under way [ms]; a loop that is too late has stopped by itself."""
    random, found, overruns = Random(1), {"taken": [], "answered": [], "zero": []}, 0
    end(socket, "enable", "confirm")
    while len(found["zero"]) < STOPS:
        socket.ask(do="jog", value=f"{(-1) ** len(found['zero']) * SPEED:g} m/s")
        time.sleep(random.uniform(0.08, 0.12))
        row, sent = int(bench.loop.rows), time.monotonic_ns()
        socket.ask(do="stop")
        answered = time.monotonic_ns() - sent
        while not (bench.answer.rests and bench.answer.commanded_velocity == 0.0):
            time.sleep(PERIOD)
        time.sleep(5 * PERIOD)
        if bench.operation.fault:
            assert bench.operation.fault == LOOP_OVERRUN
            overruns += 1
            end(socket, "reset", "enable", "confirm")
            continue
        ends, rows = clock_of(bench.loop), bench.host.scope.rows(row)[0]
        places = rows["operation.answer.commanded"]
        moved = np.flatnonzero(places != places[-1])
        if not moved.size:  # nobody had the time to send it while the jog lived
            continue
        still = int(moved[-1]) + 1
        found["answered"].append(answered)
        found["zero"].append(ends(int(rows["loop.periods"][still])) - sent)
        found["taken"].append(ends(abs(int(bench.loop.pulled[(bench.loop.pulls - 1) % PULLS]))) - sent)
    sorted_ms = {name: sorted(round(max(t, 0) / 1e6, 2) for t in times) for name, times in found.items()}
    return {"overruns": overruns, **sorted_ms}


def clock_of(loop: Any) -> Callable[[int], int]:
    """When a period began [ns]: never too early, for what was skipped since counts as skipped before it."""
    while True:
        begun, period = int(loop.alive), int(loop.periods)
        time.sleep(1e-4)
        if (begun, period) == (loop.alive, loop.periods):
            return lambda number: begun - (period - number) * int(loop.period)


def ramp() -> float:
    """The ramp of such a stop by itself, in simulated time [ms]."""
    bench = Bench("cascade", period=PERIOD).enable()
    bench.host.ask(ops.JOG, SPEED)
    bench.pass_time(0.1)
    bench.host.stop()
    return sum(velocity != 0.0 for _, velocity in bench.watch(0.2)) * PERIOD * 1e3


# ---- kills, cuts, long runs


def kills(number: int) -> Found:
    """Hosts killed while they move and write."""
    begin = time.monotonic()
    told = live_store.kill(number)
    live_store.check_kills(told)
    return dict(told) | {"seconds": round(time.monotonic() - begin), "machines": live_kills.MACHINES}


def cuts() -> Found:
    """The power cut at every event of the store's protocol, writes lost and torn."""
    told: Counter[str] = Counter()
    for name in ("incremental, held", "absolute", "band, held", "circle"):
        with memory_folder() as folder:
            told += live_store.cut_everywhere(name, 8, folder)
    return {str(name): number for name, number in told.items()}


def soaked(warm: float, seconds: float) -> Found:
    """Jogs, moves, a page and clients that come and go."""
    with tempfile.TemporaryDirectory() as folder, live_folder(Path(folder)) as place:
        return soak(place, warm, seconds) | {"seconds": seconds}


def hour(name: str) -> Found:
    """A fault-free hour of a method, simulated."""
    begin = time.monotonic()
    faults, motions = false_alarms(name, 3600.0)
    return {"faults": faults, "motions": motions, "took": round(time.monotonic() - begin)}


SHORT: dict[str, Callable[[], Found]] = {
    "lateness": lateness, "stops": stops, "kills": lambda: kills(2800), "cuts": cuts,
    "soak": lambda: soaked(60.0, 60.0),
}  # fmt: skip
LONG: dict[str, Callable[[], Found]] = {
    "long kills": lambda: kills(50_000), "long soak": lambda: soaked(60.0, 1800.0),
    **{f"hour {name}": partial(hour, name) for name in RUNS},
}  # fmt: skip


def keep(part: str, found: Found) -> None:
    """Put a part into what is kept, and write the page."""
    kept: Found = {}
    with suppress(FileNotFoundError):
        kept = json.loads(KEPT.read_text("utf-8"))
    kept[part] = found
    lines = [f"  {json.dumps(name)}: {json.dumps(kept[name])}" for name in (*SHORT, *LONG) if name in kept]
    KEPT.write_text("{\n" + ",\n".join(lines) + "\n}\n", "utf-8")
    if all(one in kept or f"long {one}" in kept for one in SHORT):
        PAGE.write_text(page(kept), "utf-8")


def main(parts: list[str]) -> int:
    """Measure these parts, or all short ones."""
    unknown = [part for part in parts if part not in SHORT | LONG]
    if unknown:
        sys.stderr.write(f"no part {unknown[0]!r}; there are {', '.join(SHORT | LONG)}\n")
        return 2
    for part in parts or SHORT:
        before, begin = surroundings(), time.monotonic()
        keep(part, {"where": before, **(SHORT | LONG)[part]()})
        sys.stdout.write(f"{part}: {time.monotonic() - begin:.0f} s\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
