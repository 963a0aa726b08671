"""Programs of other people, each in an environment of its own: made once, kept under the repository, asked by tests."""

import fcntl
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from tests.places import ROOT

PLACE = ROOT / ".venv-clients"
PACKAGES = {
    "alpaca": ("alpyca==3.1.3",),
    "can": ("canopen==2.4.1", "python-can==4.6.1", "pyserial==3.5", "msgpack==1.1.2"),
    "epics": (
        "ophyd==1.11.2", "pyepics==3.5.10", "caproto==1.3.0", "bluesky==1.15.1", "ophyd-async==0.21.3", "aioca==2.1",
        "p4p==4.3.0",
    ),
    "grbl": ("grbl-streamer==2.0.2",),
    "modbus": ("pymodbus==3.16.1",),
    "pi": ("pipython==2.11.0.6",),
    "visa": ("pyvisa==1.16.2", "pyvisa-py==0.8.1", "pyserial==3.5"),
    "zaber": ("zaber-motion==10.2.0",),
}  # fmt: skip
"""What is in each environment: their pins fight, and some of them with those of detent."""
NPM = "modbus-serial@8.0.25"


MEASURED: dict[str, Any] = {}
"""What the test that runs has measured, for tests.face_table: times of a question and its answer, loads."""


def missing(why: str) -> None:
    """Skip where a program is not to be had; in CI that is a failure."""
    if os.environ.get("CI"):
        pytest.fail(why)
    pytest.skip(why)


def environment(name: str) -> Path:
    """The interpreter of an environment, which is made where it is not there, or not what it should be."""
    folder, wanted = PLACE / name, "\n".join(PACKAGES[name])
    note, python = folder / "packages.txt", folder / "bin" / "python"
    PLACE.mkdir(exist_ok=True)
    with (PLACE / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if note.exists() and note.read_text(encoding="utf-8") == wanted:
            return python
        shutil.rmtree(folder, ignore_errors=True)
        uv = shutil.which("uv") or shutil.which("uv", path=str(Path(sys.executable).parent))
        make, install = [sys.executable, "-m", "venv", str(folder)], [str(python), "-m", "pip", "install", "--quiet"]
        if uv:
            make = [uv, "venv", "--quiet", "--python", sys.executable, str(folder)]
            install = [uv, "pip", "install", "--quiet", "--python", str(python)]
        for command in (make, [*install, *PACKAGES[name]]):
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode:
                missing(f"{', '.join(PACKAGES[name])} cannot be installed: {done.stderr.strip()[-300:]}")
        note.write_text(wanted, encoding="utf-8")
    return python


def start(name: str, script: str, *words: str, **environ: str) -> "subprocess.Popen[str]":
    """Run a script of tests/clients in an environment."""
    keep = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "COVERAGE", "EPICS"))}
    return subprocess.Popen(
        [str(environment(name)), "-P", "-W", "ignore", str(ROOT / "tests" / "clients" / f"{script}.py"), *words],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=keep | environ,
    )  # fmt: skip


def told(name: str, script: str, *words: str, timeout: float = 60.0, **environ: str) -> str:
    """What a script prints."""
    process = start(name, script, *words, **environ)
    try:
        out, err = process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        process.kill()
        out, err = process.communicate()
        pytest.fail(f"{script} {' '.join(words)} has not ended within {timeout:g} s\n{out[-2000:]}\n{err[-3000:]}")
    assert process.returncode == 0, f"{script} {' '.join(words)}: {process.returncode}\n{out[-2000:]}\n{err[-3000:]}"
    return out


def run(name: str, script: str, *words: str, timeout: float = 60.0, **environ: str) -> dict[str, Any]:
    """What a script has found: the last line that it prints, as data."""
    out = told(name, script, *words, timeout=timeout, **environ)
    found: dict[str, Any] = json.loads(out.strip().splitlines()[-1])
    return measured(found)


def measured(found: dict[str, Any]) -> dict[str, Any]:
    """Keep the times of questions and their answers among what a script has found [s]: median, and 99 of 100 [ms]."""
    if "round_trips" in found:
        times = sorted(1e3 * time for time in found["round_trips"])
        MEASURED["round_trips"] = {"p50": times[len(times) // 2], "p99": times[len(times) * 99 // 100]}
    return found


def program(name: str, package: str) -> str:
    """A program of the system, by its Debian package."""
    found = shutil.which(name)
    if not found:
        missing(f"{name} is not installed; on Debian: apt install {package}")
    return str(found)


def npm(package: str, *words: Sequence[str]) -> Path:
    """Folder of a package of npm, in an environment of its own."""
    del words
    name, _, _version = package.partition("@")
    folder = PLACE / f"npm-{name}"
    npm_ = program("npm", "npm")
    with (PLACE / f"npm-{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / "node_modules" / name).exists():
            folder.mkdir(parents=True, exist_ok=True)
            done = subprocess.run(
                [npm_, "install", "--silent", "--no-audit", "--no-fund", "--prefix", str(folder), package],
                capture_output=True, text=True, check=False,
            )  # fmt: skip
            if done.returncode:
                missing(f"{package} cannot be installed: {done.stderr.strip()[-300:]}")
    return folder
