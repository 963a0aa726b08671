"""Sessions that pages show: `detent live` with faces, and scripts of tests/clients that speak to it, as a reader does.

A page marks its console blocks with ``<!-- session -->``. Their commands are run as they stand, but for the ports, each
of which becomes one that nobody has, and for what only the system gives: terminals and the place of a data sheet.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import detent
from tests import foreign
from tests.docs.pages import all_pages, blocks_of
from tests.docs.runner import Command, commands_of, matches
from tests.face_rig import PERIOD, free_port, repeater

SCRIPTS = {
    "first_scan": "epics", "first_pva": "epics", "first_drive": "can", "plc": "modbus", "first_scpi": "visa",
    "first_grbl": "grbl", "first_gcs": "pi", "first_zaber": "zaber", "first_focuser": "alpaca",
}  # fmt: skip
"""Environment of each script that a page shows."""
DEFAULTS = {"--epics": 5064, "--pva": 5075}  # ports that a page need not say; the next ones belong to them
GIVEN = r"/dev/pts/\d+", r"/\S+\.eds"  # what only the system gives
STARTS = 30.0  # time until a live axis has told all [s]


def sessions() -> dict[str, list[Command]]:
    """Commands of each page that shows a session, by its name."""
    found: dict[str, list[Command]] = {}
    for page in all_pages():
        marked = [block for block in blocks_of(page) if "session" in block.marks]
        if marked:
            found[page.stem] = [command for block in marked for command in commands_of(block)]
    return found


class Session:
    """What a page shows, with ports of this run."""

    def __init__(self, commands: list[Command]) -> None:
        self.others: dict[str, str] = {}  # ports and places, by what the page has for them
        live = commands[0].text
        for port in re.findall(r":(\d{4,5})\b", live):
            self.others[port] = str(free_port())
        for option, port in DEFAULTS.items():
            if option in live:
                ours = free_port()
                self.others |= {str(port): str(ours), str(port + 1): str(ours + 1)}
        self.live, self.commands = commands[0], commands[1:]

    def here(self, text: str) -> str:
        """A text of the page as it is in this run."""
        for theirs, ours in self.others.items():
            text = re.sub(rf"(?<![\w/]){re.escape(theirs)}(?!\d)", lambda _, ours=ours: ours, text)
        return text

    def words(self) -> list[str]:
        """Arguments of `detent`."""
        words = shlex.split(self.here(self.live.text))[1:]
        for option, port in DEFAULTS.items():
            if option in words:
                words[words.index(option) + 1] += f"@:{self.others[str(port)]}"
        return words

    def find(self, printed: str) -> None:
        """Take from what was printed what only the system gives."""
        for pattern in GIVEN:
            theirs, ours = (re.findall(pattern, text) for text in (self.live.shown, printed))
            self.others.update(zip(theirs, ours, strict=False))


@contextmanager
def living(session: Session, folder: Path) -> Iterator[None]:
    """The live axis of a page, which prints what the page shows."""
    shutil.copy(detent.example("cascade.toml"), folder)
    folder.chmod(0o700)
    command = [sys.executable, "-m", "detent", *session.words(), "--period", PERIOD, "--no-store", "--headless"]
    environ = os.environ | {"XDG_RUNTIME_DIR": str(folder), "COLUMNS": "1000"}
    process = subprocess.Popen(
        command, cwd=folder, env=environ, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    try:
        printed, begin = "", time.monotonic()
        while "Ctrl-C stops" not in printed:
            assert time.monotonic() - begin < STARTS
            line = process.stdout.readline()
            assert line, f"it has ended\n{printed}"
            printed += line
        session.find(printed)
        shown = session.here(session.live.shown)
        assert matches(shown, printed), f"the page shows\n{shown}\nbut it prints\n{printed}"
        yield
    finally:
        process.terminate()
        process.communicate(timeout=30)


def run(commands: list[Command], folder: Path) -> list[str]:
    """Do what a page shows, and compare what is printed; gives the scripts that were run."""
    session, environ, scripts = Session(commands), dict[str, str](), list[str]()
    with repeater(), living(session, folder):
        for command in session.commands:
            program, *words = shlex.split(session.here(command.text))
            if program == "export":
                environ |= dict(word.split("=", 1) for word in words)
                continue
            assert program == "python", command.text
            script = words[0].removesuffix(".py")
            printed, shown = foreign.told(SCRIPTS[script], script, *words[1:], **environ), session.here(command.shown)
            if not matches(shown, printed):
                pytest.fail(f"`{command.text}` shows\n{shown}\nbut it prints\n{printed}")
            scripts.append(script)
    return scripts
