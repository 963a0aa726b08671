"""What the commands share: tables, JSON, progress, words about a first run."""

import json
import math
import os
import signal
import sys
from collections.abc import Callable, Collection, Generator, Iterable
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, cast

from detent.files.text import abandon, end_of_links, placing, shown, write_errors


def discard_output() -> None:
    """The reader has seen enough (`detent registers | head`): that is no error, and nothing more is written."""
    with suppress(OSError, ValueError):  # a stream without a file, as in tests
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def heed_signals() -> None:
    """Let Ctrl-C, `kill` and a terminal that is closed end the command in a sentence, and leave no half-made file."""
    for number in (signal.SIGINT, signal.SIGTERM, *([signal.SIGHUP] if sys.platform != "win32" else [])):
        if signal.getsignal(number) is not signal.SIG_IGN:  # as `nohup` has it
            signal.signal(number, _leave)


def _leave(number: int, _frame: object) -> None:
    """Say what was kept, and go at once: an exception would be raised anywhere, in HDF5 and in imports too."""
    for other in (signal.SIGINT, signal.SIGTERM):
        signal.signal(other, signal.SIG_IGN)
    kept = ", ".join(shown(str(path)) for path in abandon())
    told = f"Interrupted; written completely: {kept}.\n" if kept else "Interrupted; no file was written or changed.\n"
    with suppress(OSError):
        # A progress bar hides the cursor.
        os.write(2, ("\r\x1b[2K\x1b[?25h" if os.isatty(2) else "").encode() + told.encode(errors="backslashreplace"))
    os._exit(128 + number)


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


_QUIET = [False]  # whether only what is wrong is told


def be_quiet(wanted: bool) -> None:
    """Tell only what is wrong from now on, or all again."""
    _QUIET[0] = wanted


def tell(line: str = "") -> None:
    """A line of text, with nothing in it that steers the terminal."""
    if not _QUIET[0]:
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


def say(text: str, style: str | None = None, *, wrong: bool = False) -> None:
    """A line of any length, taken as it is; one that tells what is `wrong` is told to the quiet too."""
    if _QUIET[0] and not wrong:
        return
    make_console().print(shown(text), style=style, soft_wrap=True)


def print_table(title: str, heads: Iterable[str], rows: Iterable[Iterable[Any]], *, right: bool = False) -> None:
    """A table whose cells are taken as they are; `right` aligns all but the first column to the right."""
    if _QUIET[0]:
        return
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
def folder_for(option: str, folder: Path, others: Collection[str] = (), *, force: bool = False) -> Generator[Path]:
    """Make a folder, and give the place to make its files in, as of `placing`; what keeps them out becomes an error."""
    with write_errors(f"{option} {folder}"):
        end_of_links(folder).mkdir(parents=True, exist_ok=True)
        with placing(folder, others, force=force) as made:
            yield made


@contextmanager
def progress_bar(*, quiet: bool) -> Generator[Callable[[float, str], None]]:
    """A bar on the terminal's error channel; silent for --json and where nobody looks."""
    if quiet or _QUIET[0] or not (console := make_console(stderr=True)).is_terminal:
        yield lambda _share, _text: None
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("starting", total=1.0)
        yield lambda share, text: bar.update(task, completed=share, description=shown(text))


def say_compiling(why_unkept: str) -> None:
    """Say why the first run of an axis takes longer."""
    if _QUIET[0]:
        return
    later = f"it cannot be cached ({why_unkept})" if why_unkept else "later runs start immediately"
    sys.stderr.write(f"First run: compiling the axis, 10 to 60 s; {shown(later)}.\n")
    sys.stderr.flush()


@contextmanager
def compiling_counted(*, quiet: bool) -> Generator[None]:
    """Seconds that pass, on a terminal, once the compiler has begun."""
    if quiet or _QUIET[0] or not (console := make_console(stderr=True)).is_terminal:
        yield
        return
    from rich.progress import Progress, TextColumn, TimeElapsedColumn

    from detent.kernel.cache import AT_FIRST_COMPILING

    with Progress(TextColumn("compiling the loop"), TimeElapsedColumn(), console=console, transient=True) as bar:

        def begin(_why: str) -> None:
            bar.add_task("")

        AT_FIRST_COMPILING.insert(0, begin)  # told last, below the line that says why
        try:
            yield
        finally:
            AT_FIRST_COMPILING[:] = [one for one in AT_FIRST_COMPILING if one is not begin]


def split_names(texts: list[str] | None) -> list[str]:
    """Names of a repeated option, each of which may hold several."""
    return [name.strip() for text in texts or [] for name in text.split(",") if name.strip()]
