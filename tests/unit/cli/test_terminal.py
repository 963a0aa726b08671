"""How a command ends that is interrupted: one sentence, its status, and no file that is not whole."""

import io
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from rich.console import Console

import detent
from detent.cli import terminal
from detent.kernel import cache

pytestmark = pytest.mark.process

SOURCE = str(Path(detent.__file__).parents[1])
BY = [(signal.SIGINT, 130), (signal.SIGTERM, 143)]
NOTHING = "Interrupted; no file was written or changed.\n"

# Whoever begins the tests in the background ignores the key that interrupts, and what they begin inherits that.
IN_FRONT = "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"

# Interrupts the process when a module is asked for, as a person does in the first second.
AT_IMPORT = """
import os, sys
class Interrupted:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            os.kill(os.getpid(), {number})
sys.meta_path.insert(0, Interrupted())
sys.argv[1:] = {words}
from detent.__main__ import main
main()
"""

# Interrupts it while a file is written, beside one that is whole.
AT_WRITING = """
import os
from pathlib import Path
from detent.cli.terminal import heed_signals
from detent.files.text import placing, write_text, writing
heed_signals()
{before}
with {kind} as made:
    (made / "half" if made.is_dir() else made).write_text("half")
    os.kill(os.getpid(), {number})
"""


def python(code: str, cwd: Path) -> tuple[int, str]:
    done = subprocess.run(
        [sys.executable, "-c", IN_FRONT + code], capture_output=True, text=True, check=False, cwd=cwd,
        env={**os.environ, "PYTHONPATH": SOURCE},
    )  # fmt: skip
    return done.returncode, done.stdout + done.stderr


@pytest.mark.parametrize(("number", "status"), BY)
@pytest.mark.parametrize(("module", "words"), [("typer", ["examples"]), ("numpy", ["registers"])])
def test_in_the_first_second_it_is_a_sentence(
    number: int, status: int, module: str, words: list[str], tmp_path: Path, tried: Callable[..., None]
) -> None:
    assert python(AT_IMPORT.format(module=module, number=int(number), words=words), tmp_path) == (status, NOTHING)
    tried("kill", "Ctrl-C and `kill` while modules are imported", "one sentence, status 130 or 143")


@pytest.mark.parametrize(("number", "status"), BY)
@pytest.mark.parametrize("kind", ["writing(Path('told.txt'), force=True)", "placing(Path('.'))"])
def test_a_half_made_file_goes_and_the_earlier_one_stays(
    number: int, status: int, kind: str, tmp_path: Path, tried: Callable[..., None]
) -> None:
    (tmp_path / "told.txt").write_text("earlier")
    assert python(AT_WRITING.format(kind=kind, number=int(number), before=""), tmp_path) == (status, NOTHING)
    assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [("told.txt", "earlier")]
    tried("kill", "Ctrl-C and `kill` while a file is written", "one sentence, the earlier file, nothing beside it")


def test_what_is_whole_is_named(tmp_path: Path) -> None:
    code = AT_WRITING.format(
        kind="writing(Path('b'))", number=int(signal.SIGINT), before='write_text("a\\x1b", "whole")'
    )
    assert python(code, tmp_path) == (130, "Interrupted; written completely: a\\x1b.\n")
    assert [file.name for file in tmp_path.iterdir()] == ["a\x1b"]


def test_a_signal_that_is_ignored_stays_so(tmp_path: Path) -> None:
    code = "import signal\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n" + AT_WRITING.format(
        kind="writing(Path('told.txt'))", number=int(signal.SIGINT), before=""
    )
    assert python(code, tmp_path) == (0, "")
    assert (tmp_path / "told.txt").read_text() == "half"


@pytest.mark.parametrize("looks", [True, False])
def test_seconds_are_counted_while_it_compiles_and_only_where_somebody_looks(
    monkeypatch: pytest.MonkeyPatch, looks: bool
) -> None:
    seen = io.StringIO()
    console = Console(file=seen, force_terminal=looks, width=80)
    monkeypatch.setattr(terminal, "make_console", lambda **_more: console)
    monkeypatch.setattr(cache, "AT_FIRST_COMPILING", told := [terminal.say_compiling])
    with terminal.compiling_counted(quiet=False):
        assert len(told) == 1 + looks
        assert told[-1] is terminal.say_compiling  # the line that says why comes first
        cache.tell_compiling("")
    assert told == []
    assert ("compiling the loop 0:00:00" in plain(seen.getvalue())) is looks
    with terminal.compiling_counted(quiet=True):
        assert told == []
    told.append(terminal.say_compiling)
    with terminal.compiling_counted(quiet=False):
        pass  # all of it was compiled before
    assert told == [terminal.say_compiling]


def plain(text: str) -> str:
    """A text without the codes of a terminal."""
    return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", text)
