"""A live axis with its panel, and a browser before it: what the acceptance tests 40 to 48 look at."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

import pytest

import detent
from detent.operate.client import LiveAxis
from detent.operate.opening import channel_of
from detent.operate.start import connect
from detent.panel.keys import keys_of, link_of

SCRIPTS = Path(__file__).parent / "browser"
PATIENCE = 180.0  # of a script [s]
NODE = 20  # oldest release that the driver takes


def chromium() -> str:
    """The browser; without it, or what drives it, a test skips and says what is missing."""
    found = os.environ.get("CHROMIUM") or shutil.which("chromium")
    if found is None:
        pytest.skip("no chromium here; a browser test needs Debian's package chromium, or CHROMIUM=path")
    node = shutil.which("node")
    version = subprocess.run([node, "--version"], capture_output=True, text=True, check=True).stdout if node else "v0"
    if int(version[1:].partition(".")[0]) < NODE or not (SCRIPTS / "node_modules" / "playwright-core").is_dir():
        pytest.skip(f"no playwright-core here; a browser test needs node {NODE} and: npm ci --prefix tests/browser")
    return found


def command(name: str, *arguments: str) -> list[str]:
    """How a program of tests/browser is started."""
    return [shutil.which("node") or "node", str(SCRIPTS / f"{name}.mjs"), *arguments]


class Panelled:
    """A process that runs an axis live with its panel."""

    def __init__(self, file: Path, *options: str) -> None:
        self.file = file
        self.process = subprocess.Popen(
            [sys.executable, "-m", "detent", "live", str(file), "--json", *options], stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert self.process.stdout
        line = self.process.stdout.readline()
        if not line:
            assert self.process.stderr
            raise AssertionError(self.process.stderr.read())
        self.started: dict[str, Any] = json.loads(line)

    def link(self, role: str = "engineer") -> str:
        """A one-time link to the panel."""
        return link_of(keys_of(channel_of(self.file)), role, time.time())

    def connect(self) -> LiveAxis:
        """The axis over its channel."""
        return connect(self.file)

    def kill_panel(self) -> None:
        """End the panel's process at once."""
        children = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children").read_text(encoding="ascii")
        for pid in children.split():
            os.kill(int(pid), signal.SIGKILL)

    def close(self) -> int:
        """Ctrl-C; gives the exit status."""
        self.process.send_signal(signal.SIGINT)
        self.process.communicate(timeout=30)
        return self.process.returncode


@contextmanager
def panelled(folder: Path, example: str = "cascade.toml", *options: str) -> Generator[Panelled]:
    """An example, live with its panel; it must end well."""
    chromium()
    file = folder / example
    shutil.copy(detent.example(example), file)
    made = Panelled(file, *options)
    try:
        yield made
    except BaseException:
        made.process.kill()
        made.process.communicate()
        raise
    assert made.close() == 0


def until(axis: LiveAxis, met: Callable[[dict[str, Any]], bool], seconds: float = 10.0) -> dict[str, Any]:
    """The status in which something holds."""
    end = time.monotonic() + seconds
    while not met(now := axis.status):
        assert time.monotonic() < end, now
        time.sleep(0.01)
    return now


class Script:
    """A program of tests/browser that is told lines and answers in JSON."""

    def __init__(self, name: str, *arguments: str) -> None:
        self._process = subprocess.Popen(
            command(name, *arguments), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            env=os.environ | {"CHROMIUM": chromium()},
        )  # fmt: skip

    def tell(self, *words: str) -> dict[str, Any]:
        """Tell a line; gives the answer."""
        assert self._process.stdin
        assert self._process.stdout
        self._process.stdin.write(";".join(words) + "\n")
        self._process.stdin.flush()
        line = self._process.stdout.readline()
        assert line, f"{words}: the browser's script has ended with {self._process.wait(10)}"
        return json.loads(line)

    def __enter__(self) -> Self:
        """Use it in a ``with`` block."""
        return self

    def __exit__(self, *_: object) -> None:
        """End it."""
        self._process.kill()
        self._process.communicate()


def run_script(name: str, *arguments: str) -> Any:
    """What a program of tests/browser finds."""
    done = subprocess.run(
        command(name, *arguments), capture_output=True, text=True, timeout=PATIENCE,
        env=os.environ | {"CHROMIUM": chromium()}, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads(done.stdout)
