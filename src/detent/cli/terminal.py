"""What the commands share: tables, JSON, progress, words about a first run."""

import json
import math
import os
import sys
from collections.abc import Callable, Generator, Iterable
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, cast

from detent.files.text import end_of_links, shown, write_errors


def discard_output() -> None:
    """The reader has seen enough (`detent registers | head`): that is no error, and nothing more is written."""
    with suppress(OSError, ValueError):  # a stream without a file, as in tests
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def print_json(data: Any) -> None:
    """Machine-readable output."""
    print(json.dumps(_finite(data), indent=2, allow_nan=False))


def _finite(data: Any) -> Any:
    """JSON knows neither NaN nor infinity: what was not measured is null."""
    if isinstance(data, dict):
        return {str(key): _finite(value) for key, value in cast("dict[Any, Any]", data).items()}
    if isinstance(data, list | tuple):
        return [_finite(value) for value in cast("list[Any]", data)]
    return None if isinstance(data, float) and not math.isfinite(data) else data


def tell(line: str = "") -> None:
    """A line of text, with nothing in it that steers the terminal."""
    print(shown(line))


def make_console(*, stderr: bool = False) -> Any:
    """A terminal that takes every text as it is, and a pipe that closes early as no error."""
    from rich.console import Console

    class Plain(Console):
        def on_broken_pipe(self) -> None:
            self.quiet = True
            discard_output()

    console = Plain(stderr=stderr, markup=False, highlight=False, emoji=False)
    if not console.is_terminal and "COLUMNS" not in os.environ:
        console.width = 200  # a file or a pipe has no edge to fold tables at
    return console


def say(text: str, style: str | None = None) -> None:
    """A line of any length, taken as it is."""
    make_console().print(shown(text), style=style, soft_wrap=True)


def print_table(title: str, heads: Iterable[str], rows: Iterable[Iterable[Any]], *, right: bool = False) -> None:
    """A table whose cells are taken as they are; `right` aligns all but the first column to the right."""
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(shown(title)), title_justify="left", box=None, pad_edge=False)
    for number, head in enumerate(heads):
        table.add_column(Text(shown(head)), overflow="fold", justify="right" if right and number else "left")
    for row in rows:
        table.add_row(*(Text(shown(str(cell))) for cell in row))
    console = make_console()
    console.print(table)
    console.print()


@contextmanager
def folder_for(option: str, folder: Path) -> Generator[None]:
    """Make a folder and let files be put into it; what keeps them out becomes an error that says what to do."""
    with write_errors(f"{option} {folder}"):
        end_of_links(folder).mkdir(parents=True, exist_ok=True)
        yield


@contextmanager
def progress_bar(*, quiet: bool) -> Generator[Callable[[float, str], None]]:
    """A bar on the terminal's error channel; silent for --json and where nobody looks."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    console = make_console(stderr=True)
    if quiet or not console.is_terminal:
        yield lambda _share, _text: None
        return
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("starting", total=1.0)
        yield lambda share, text: bar.update(task, completed=share, description=shown(text))


def say_compiling(why_unkept: str) -> None:
    """Say why the first run of an axis takes longer."""
    later = f"it cannot be kept ({why_unkept})" if why_unkept else "later runs start at once"
    sys.stderr.write(f"First run: compiling the axis, up to 15 s; {later}.\n")
    sys.stderr.flush()


def split_names(texts: list[str] | None) -> list[str]:
    """Names of a repeated option, each of which may hold several."""
    return [name.strip() for text in texts or [] for name in text.split(",") if name.strip()]
