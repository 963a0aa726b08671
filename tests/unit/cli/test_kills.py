"""Commands that write files, ended at any moment: what stands under a final name is whole, and of one time."""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import NamedTuple

import pytest
from tests.identify_files import AXIS, write_log

import detent
from detent.files.text import placing

pytestmark = [pytest.mark.early, pytest.mark.wide, pytest.mark.compiled]

KILLS, SOON = 15, 3  # of each command; of these in `make test-wide`
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
HEAD, LETTER, ZOOM = (str(detent.example(name)) for name in ("print_head.toml", "letter.txt", "zoom.toml"))
# The date of a run is part of its evidence: the same for all.
ENV = {**os.environ, "PYTHONPATH": str(Path(detent.__file__).parents[1]), "SOURCE_DATE_EPOCH": "0"}
TRACED = ("plot", "../trace.h5", "--signals", "plant.train.velocity", "--output", "plot.svg")

# The command, ended by a signal before the call of a number that changes something below the folder it is in.
AT_CALL = """
import os, sys
calls, last, number = 0, int(sys.argv[1]), int(sys.argv[2])
del sys.argv[1:3]
def at(event, args):
    global calls
    if event in {"os.mkdir", "os.rename", "os.remove", "os.rmdir"} or event == "open" and args[2] & os.O_CREAT:
        if "cache" not in str(args[0]):
            calls += 1
            if calls == last:
                os.kill(os.getpid(), number)
from detent.__main__ import main
sys.addaudithook(at)
try:
    main()
finally:
    sys.stderr.write(str(calls))
"""


class Command(NamedTuple):
    """What is ended."""

    words: tuple[str, ...]
    earlier: tuple[str, ...]  # makes other files of the same names
    files: tuple[str, ...]
    together: bool = False  # the files belong together
    cleared: bool = False  # what a killed one left is cleared up by the next into the folder


REPORT = ("report.html", "trace.h5", "trace.csv")
COMMANDS = {
    "run": Command(
        ("run", HEAD, "--job", LETTER, "--output", "."),
        ("run", HEAD, "--job", LETTER, "--output", ".", "--every", "50"), REPORT, together=True, cleared=True,
    ),
    "run without a trace": Command(
        ("run", HEAD, "--job", LETTER, "--output", ".", "--every", "0"),
        ("run", HEAD, "--job", LETTER, "--output", ".", "--every", "50"), REPORT, together=True, cleared=True,
    ),
    "envelope": Command(
        ("envelope", ZOOM, "--output", "."), ("envelope", ZOOM, "--output", ".", "--set", "controller.timer=2 MHz",
         "--set", "axis.name=earlier"),
        tuple(f"{motor}.{kind}" for motor in ("group_a", "group_b") for kind in ("csv", "h", "png")), together=True,
        cleared=True,
    ),
    "plot": Command(TRACED, (*TRACED, "--to", "1"), ("plot.svg",)),
    "timing": Command(
        ("timing", HEAD, "--at", "20 ms"), ("timing", HEAD, "--at", "30 ms"), ("timing.png", "timing.vcd"),
        together=True,
    ),
    "compare": Command(
        ("compare", HEAD), ("compare", HEAD, "--set", "axis.name=earlier"), ("comparison.html",),
    ),
    "identify": Command(
        ("identify", "../log.csv", "--write", "axis.toml", "--job", "job.toml", "--report", "found.html"),
        ("identify", "../log.csv", "--axis", "../axis.toml", "--write", "axis.toml", "--job", "job.toml", "--report",
         "found.html", "--method", "output-error"),
        ("axis.toml", "job.toml", "found.html"),
    ),
}  # fmt: skip


def program(*words: str, cwd: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, *words], cwd=cwd, env=ENV, text=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    )


def run(*words: str, cwd: Path) -> None:
    process = program("-m", "detent", *words, cwd=cwd)
    _, told = process.communicate()
    assert process.returncode == 0, told


def held(folder: Path) -> dict[str, bytes]:
    """Files under their final names."""
    return {file.name: file.read_bytes() for file in folder.iterdir() if file.is_file() and file.suffix != ".part"}


class Done(NamedTuple):
    """What a command leaves when it is not ended, and how long it takes."""

    old: dict[str, bytes]
    new: dict[str, bytes]
    seconds: float
    calls: int


@cache
def base() -> Path:
    """A folder with what the commands read; each kill has a folder in it."""
    made = Path(mkdtemp())
    write_log(made / "log.csv")
    (made / "axis.toml").write_text(AXIS, encoding="utf-8")
    run("run", HEAD, "--job", LETTER, "-o", ".", cwd=made)
    return made


@cache
def done(name: str) -> Done:
    """The earlier files and the new ones; an uncounted first time compiles."""
    command, folder = COMMANDS[name], base() / f"{name} done"
    folder.mkdir()
    run(*command.earlier, cwd=folder)
    old = held(folder)
    for _ in range(2):
        begin = time.monotonic()
        run(*command.words, cwd=folder)
        seconds = time.monotonic() - begin
    new = held(folder)
    assert set(old) | set(new) == set(command.files)
    assert all(old[file] != new.get(file) for file in old), [file for file in old if old[file] == new.get(file)]
    _, told, _ = ended_at_call(name, 0, 0, folder)
    return Done(old, new, seconds, int(told.split()[-1]))


def ended_at_call(name: str, call: int, by: int, folder: Path) -> tuple[int, str, bool]:
    process = program("-c", AT_CALL, str(call), str(int(by)), *COMMANDS[name].words, cwd=folder)
    _, told = process.communicate()
    return process.returncode, told, by != signal.SIGKILL


def ended_at(name: str, seconds: float, by: int, folder: Path) -> tuple[int, str, bool]:
    process = program("-m", "detent", *COMMANDS[name].words, cwd=folder)
    heeded = False
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        heeded = _heeds(process.pid, by)
        process.send_signal(by)
    _, told = process.communicate()
    return process.returncode, told, heeded


def _heeds(process: int, by: int) -> bool:
    """Whether the process has begun to heed a signal: before, the interpreter itself is just starting."""
    status = Path(f"/proc/{process}/status")
    lines = status.read_text().splitlines() if status.exists() else []
    caught = next((int(line.split()[1], 16) for line in lines if line.startswith("SigCgt")), 0)
    return bool(caught >> (signal.SIGTERM - 1) & 1) and by != signal.SIGKILL


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="asks /proc which signals a process heeds")
@pytest.mark.parametrize(
    "number", [*range(SOON), *(pytest.param(number, marks=pytest.mark.long) for number in range(SOON, KILLS))]
)
@pytest.mark.parametrize("name", COMMANDS)
def test_ended_at_any_moment(name: str, number: int, tried: Callable[..., None]) -> None:
    chance = random.Random(f"{name} {number}")
    by, known = SIGNALS[number % len(SIGNALS)], done(name)
    folder = Path(mkdtemp(dir=base()))
    for file, data in known.old.items():
        (folder / file).write_bytes(data)
    if chance.random() < 0.5:
        status, told, heeded = ended_at(name, chance.random() * known.seconds, by, folder)
    else:
        status, told, heeded = ended_at_call(name, chance.randrange(known.calls) + 1, by, folder)
    found, left = held(folder), [file for file in folder.iterdir() if file.name not in COMMANDS[name].files]
    for file, data in found.items():
        assert data in {known.old.get(file), known.new.get(file)}, f"{file} is neither the earlier one nor the new one"
    if COMMANDS[name].together:
        assert found.items() <= known.old.items() or found.items() <= known.new.items()
    if heeded and status in {130, 143}:
        assert status == 128 + by
        assert told.startswith("Interrupted; ")
        assert told.count("\n") == 1
        assert left == []
        assert ("no file was written" in told) == (found == known.old)
    if COMMANDS[name].cleared:
        with pytest.raises(KeyError), placing(folder):  # the next command into the folder
            raise KeyError
        assert held(folder) in (known.old, known.new)
        assert not any(file.is_dir() for file in folder.iterdir())
    shutil.rmtree(folder)
    tried("kill", f"`detent {name}`", "the earlier files or the new ones, each whole")
