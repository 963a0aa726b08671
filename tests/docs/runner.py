"""Run the blocks of one page as its reader would: one folder, commands and Python in the order of the text."""

import contextlib
import doctest
import io
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

from tests.docs.pages import Block

from detent.cli import main

TIMEOUT_S = 300
# A tail for each command: what it leaves behind (status, folder) is what the next one starts with.
KEEP_STATE = '\n__status=$?; pwd > "$DETENT_DOCS_FOLDER"; exit $__status'

# What a command sees of a terminal.
PLAIN = {"NO_COLOR": "1", "TERM": "dumb", "COLUMNS": "120", "LC_ALL": "C.UTF-8", "MPLBACKEND": "Agg"}
SHELL_SYNTAX = set("|&;<>()[]{}$`*?~#!\\\n")


class DocumentationError(AssertionError):
    """A block does not do what the page says."""


@dataclass(frozen=True)
class Command:
    """A `$ ` line with what the page shows below it."""

    text: str
    shown: str


def commands_of(block: Block) -> list[Command]:
    """Split a console block into commands and their output; a line that begins with `> ` continues a command."""
    commands: list[tuple[list[str], list[str]]] = []
    for line in block.text.splitlines():
        if line.startswith("$ "):
            commands.append(([line[2:]], []))
        elif not commands:
            message = f"{block.where}: a console block begins with a `$ ` line, not with {line!r}"
            raise DocumentationError(message)
        elif line.startswith("> ") and not commands[-1][1]:
            commands[-1][0].append(line[2:])
        else:
            commands[-1][1].append(line)
    return [Command("\n".join(text), "\n".join(shown)) for text, shown in commands]


def words_of(text: str) -> list[str] | None:
    """The words of a command that is `detent` and its arguments; None where a shell has more to do than to split it."""
    joined = text.replace("\\\n", " ")
    if not joined.startswith("detent ") or set(joined) & SHELL_SYNTAX:
        return None
    return shlex.split(joined)


FIRST_RUN = "First run: compiling the axis"


def matches(shown: str, got: str) -> bool:
    """Compare output with what a page shows: `...` stands for any text, spaces at line ends do not count."""

    def tidy(text: str) -> str:
        return "\n".join(line.rstrip() for line in text.strip().splitlines())

    # Whether a command compiles first depends on what ran before the page.
    got = "\n".join(line for line in got.splitlines() if not line.startswith(FIRST_RUN))
    parts = [re.escape(part) for part in tidy(shown).split("...")]
    return re.fullmatch(".*".join(parts), tidy(got), flags=re.DOTALL) is not None


class PageRunner:
    """Runs one page's blocks in `folder`.

    ```console   each `$ ` line is run by bash, `detent` without anything of the shell in this process, where all that
                 detent imports is loaded; a command must succeed, unless `$ echo $?` follows and shows the status
    ```python    executed; a page has one namespace; with `>>>` it is a doctest; a following ```output is compared
    ```toml      must parse, and so must ```json; any block after `<!-- file: NAME -->` is also saved under that name
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.shell_folder = folder
        self.status = 0
        self.namespace: dict[str, Any] = {"__name__": "__main__"}
        self.printed: str | None = None
        self.kinds: dict[str, Callable[[Block], None]] = {
            "console": self.run_console,
            "python": self.run_python,
            "output": self.compare_output,
            "toml": lambda block: self.parse(block, tomllib.loads),
            "json": lambda block: self.parse(block, json.loads),
        }

    def run(self, block: Block) -> None:
        """Run or check one block; raise DocumentationError where the page is wrong."""
        if "file" in block.marks:
            target = self.folder / block.marks["file"]
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(block.text, encoding="utf-8")
        if block.language in self.kinds:
            self.kinds[block.language](block)

    def run_console(self, block: Block) -> None:
        """Run the commands of a console block and compare status and output."""
        commands = commands_of(block)
        for command, following in zip(commands, [*commands[1:], None], strict=True):
            words = words_of(command.text)
            got = self.shell(command.text) if words is None else self.detent(words)
            if self.status and not (following and following.text == "echo $?"):
                message = f"{block.where}: `{command.text}` ended with status {self.status}:\n{got}"
                raise DocumentationError(message)
            if not matches(command.shown, got):
                message = f"{block.where}: `{command.text}` shows\n{command.shown}\nbut it prints\n{got}"
                raise DocumentationError(message)

    def shell(self, text: str) -> str:
        """Run one command where the last one left off; return what it printed."""
        kept = self.folder / ".shell-folder"
        path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
        bash = shutil.which("bash")
        if bash is None:
            message = "console blocks are run by bash, which is not installed"
            raise DocumentationError(message)
        done = subprocess.run(
            [bash, "-c", f"(exit {self.status})\n{text}{KEEP_STATE}"],
            cwd=self.shell_folder,
            env={**os.environ, **PLAIN, "PATH": path, "DETENT_DOCS_FOLDER": str(kept)},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            encoding="utf-8",
            timeout=TIMEOUT_S,
            check=False,
        )
        self.status = done.returncode
        if kept.exists():
            self.shell_folder = Path(kept.read_text(encoding="utf-8").strip())
            kept.unlink()
        return done.stdout

    def detent(self, words: list[str]) -> str:
        """Run `detent` where the last command left off; return what it printed."""
        said = io.StringIO()
        with (
            contextlib.chdir(self.shell_folder),
            mock.patch.dict(os.environ, PLAIN),
            mock.patch.object(sys, "argv", words),
            contextlib.redirect_stdout(said),
            contextlib.redirect_stderr(said),
        ):
            try:
                main()
            except SystemExit as left:
                self.status = left.code
        return said.getvalue()

    def run_python(self, block: Block) -> None:
        """Execute a Python block, or check it as a doctest where it shows prompts."""
        with contextlib.chdir(self.folder):
            if block.text.lstrip().startswith(">>>"):
                check_doctest(block, self.namespace)
                return
            printed = io.StringIO()
            # Blank lines in front make a traceback name the line of the page.
            code = compile("\n" * block.line + block.text, str(block.page), "exec")
            with contextlib.redirect_stdout(printed):
                exec(code, self.namespace)
            self.printed = printed.getvalue()

    def compare_output(self, block: Block) -> None:
        """Compare with what the Python block before printed."""
        if self.printed is None:
            message = f"{block.where}: an output block follows a Python block without prompts"
            raise DocumentationError(message)
        if not matches(block.text, self.printed):
            message = f"{block.where}: the page shows\n{block.text}\nbut the Python block above prints\n{self.printed}"
            raise DocumentationError(message)
        self.printed = None

    def parse(self, block: Block, parser: Callable[[str], object]) -> None:
        """Check that data shown on a page is well-formed."""
        try:
            parser(block.text)
        except ValueError as error:
            message = f"{block.where}: not valid {block.language}: {error}"
            raise DocumentationError(message) from error


def check_doctest(block: Block, namespace: dict[str, Any]) -> None:
    """Run a block with `>>>` prompts; `...` in its output stands for any text."""
    examples = doctest.DocTestParser().get_doctest(block.text, namespace, block.where, str(block.page), block.line)
    examples.globs = namespace  # not a copy: the page's blocks share it
    report = io.StringIO()
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    if runner.run(examples, out=report.write, clear_globs=False).failed:
        raise DocumentationError(report.getvalue())
