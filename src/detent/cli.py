"""The command line: the only place that parses arguments or prints."""

import json
import math
import os
import shlex
import sys
from collections.abc import Callable, Generator, Iterable
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Annotated, Any, NoReturn, cast

import typer
from typer.core import TyperGroup

from detent import __version__, example, examples
from detent.errors import DetentError

DONE, NOT_DONE = 0, 1
TRACE_KINDS = ("h5", "csv", "parquet")


class Commands(TyperGroup):
    """The verbs. Errors that detent raises on purpose become one message and an exit status, never a traceback."""

    def invoke(self, ctx: Any) -> Any:
        """Run the verb."""
        status = DONE
        try:
            super().invoke(ctx)
        except DetentError as error:
            sys.stderr.write(f"{error}\n")
            status = error.exit_status
        except typer.Exit as left:
            status = left.exit_code
        except BrokenPipeError:
            _discard_output()
        try:
            sys.stdout.flush()
        except BrokenPipeError:
            _discard_output()
        raise typer.Exit(status)


def _discard_output() -> None:
    """The reader has seen enough (`detent registers | head`): that is no error, and nothing more is written."""
    with suppress(OSError, ValueError):  # a stream without a file, as in tests
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


app = typer.Typer(
    name="detent",
    cls=Commands,
    help="Positioning control as software: describe an axis in one file, check it, run a job on it.",
    epilog="Exit status: 0 done, 1 the axis did not do it (the reason is shown), 2 wrong input.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

File = Annotated[Path, typer.Argument(help="Axis file (TOML).", show_default=False)]
Set = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Replace or add a value of the file; repeat for more."),
]
Json = Annotated[bool, typer.Option("--json", help="Print machine-readable JSON instead of text.")]
Signals = Annotated[
    list[str] | None,
    typer.Option("--signals", metavar="NAMES", help="Registers, comma-separated; patterns such as 'head.*' too."),
]


def main() -> NoReturn:
    """Entry point."""
    for stream in (sys.stdout, sys.stderr):
        # A file name may hold bytes, and a letter signs, that the terminal's encoding does not know.
        with suppress(AttributeError):
            cast("Any", stream).reconfigure(errors="backslashreplace")
    app()
    raise SystemExit(DONE)


def _version(wanted: bool) -> None:
    if wanted:
        print(f"detent {__version__}")
        raise typer.Exit


@app.callback()
def common(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_version, is_eager=True)
    ] = False,
) -> None:
    """Options before the verb."""


def _print_json(data: Any) -> None:
    print(json.dumps(_finite(data), indent=2, allow_nan=False))


def _finite(data: Any) -> Any:
    """JSON knows neither NaN nor infinity: what was not measured is null."""
    if isinstance(data, dict):
        return {str(key): _finite(value) for key, value in cast("dict[Any, Any]", data).items()}
    if isinstance(data, list | tuple):
        return [_finite(value) for value in cast("list[Any]", data)]
    return None if isinstance(data, float) and not math.isfinite(data) else data


def _console(*, stderr: bool = False) -> Any:
    """A terminal that takes every text as it is, and a pipe that closes early as no error."""
    from rich.console import Console

    class Plain(Console):
        def on_broken_pipe(self) -> None:
            self.quiet = True
            _discard_output()

    console = Plain(stderr=stderr, markup=False, highlight=False, emoji=False)
    if not console.is_terminal and "COLUMNS" not in os.environ:
        console.width = 200  # a file or a pipe has no edge to fold tables at
    return console


def _print_table(title: str, heads: Iterable[str], rows: Iterable[tuple[Any, ...]], *, right: bool = False) -> None:
    """A table whose cells are taken as they are; `right` aligns all but the first column to the right."""
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(title), title_justify="left", box=None, pad_edge=False)
    for number, head in enumerate(heads):
        table.add_column(Text(head), overflow="fold", justify="right" if right and number else "left")
    for row in rows:
        table.add_row(*(Text(str(cell)) for cell in row))
    console = _console()
    console.print(table)
    console.print()


@app.command("examples")
def examples_command(
    copy: Annotated[
        Path | None, typer.Option("--copy", metavar="FOLDER", help="Copy all examples into this folder.")
    ] = None,
    *,
    as_json: Json = False,
) -> None:
    """List the packaged example files, or copy them to start from."""
    found = examples() if copy is None else _copy_examples(examples(), copy)
    if as_json:
        _print_json([{"name": path.name, "path": str(path), "about": _about(path)} for path in found])
        return
    for path in found:
        print(f"{path.name:<20} {_about(path)}")
    if copy is None:
        print("\nCopy them with: detent examples --copy FOLDER")
    else:
        axis, job = (shlex.quote(str(copy / name)) for name in ("print_head.toml", "letter.txt"))
        print(f"\nCopied to {copy}. Try: detent run {axis} --job {job}")


def _copy_examples(found: list[Path], folder: Path) -> list[Path]:
    import shutil

    try:
        existing = [path.name for path in found if (folder / path.name).exists()]
        if existing:
            raise DetentError(
                f"--copy {folder}: it holds {', '.join(existing)} already; nothing was copied; choose another folder"
            )
        folder.mkdir(parents=True, exist_ok=True)
        return [Path(shutil.copyfile(path, folder / path.name)) for path in found]
    except OSError as error:
        raise DetentError(f"--copy {folder}: cannot be written ({error.strerror}); choose another folder") from error


def _about(path: Path) -> str:
    """First comment line of an axis file; what kind of job the others are."""
    if path.suffix == ".toml":
        return path.read_text(encoding="utf-8").splitlines()[0].lstrip("# ")
    return "print job, Diablo 630 stream" if path.suffix == ".prn" else "print job, plain text"


@app.command()
def check(file: File, overrides: Set = None, *, as_json: Json = False) -> None:
    """Check an axis file: every value in effect and its origin, what follows from it, what looks wrong."""
    from detent.axisfile.check import check_spec
    from detent.axisfile.load import read_axis

    report = check_spec(read_axis(file, overrides or []))
    if as_json:
        _print_json(report.to_dict())
        return
    rows = [(row.key, row.value, row.origin) for row in report.rows]
    _print_table(f"{report.name}: every value in effect", ("key", "value", "origin"), rows)
    figures = [(figure.name, figure.text, figure.formula) for figure in report.derived]
    _print_table("What follows from them", ("figure", "value", "from"), figures)
    console = _console()
    for caution in report.warnings:
        console.print(f"warning: {caution}", style="yellow", soft_wrap=True)
    number = len(report.warnings)
    console.print(f"{number} warning{'s' if number > 1 else ''}" if number else "no warnings")


@contextmanager
def _progress(*, quiet: bool) -> Generator[Callable[[float, str], None]]:
    """A bar on the terminal's error channel; silent for --json and where nobody looks."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    console = _console(stderr=True)
    if quiet or not console.is_terminal:
        yield lambda _share, _text: None
        return
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("starting", total=1.0)
        yield lambda share, text: bar.update(task, completed=share, description=text)


def _say_if_cold() -> None:
    from detent.kernel.cache import compiled_folder, is_warm

    if is_warm():
        return
    later = "later runs start at once"
    try:
        compiled_folder()
    except OSError as error:
        later = f"it cannot be kept ({error.filename}: {error.strerror}); set DETENT_CACHE_DIR to a folder of yours"
    sys.stderr.write(f"First run with this version: compiling the axis, about 15 s; {later}.\n")
    sys.stderr.flush()


@app.command()
def run(
    file: File,
    job: Annotated[Path, typer.Option("--job", help="Print job: plain text or a Diablo 630 stream.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FOLDER",
            help="Where report and trace go, in place of those of an earlier run. Default: runs/FILE-JOB",
        ),
    ] = None,
    overrides: Set = None,
    signals: Annotated[
        list[str] | None,
        typer.Option(
            "--signals",
            metavar="NAMES",
            help="Registers to record beside the usual, comma-separated; "
            "patterns such as 'head.*' or 'all' too. `detent registers` lists them.",
        ),
    ] = None,
    every: Annotated[
        int, typer.Option("--every", min=0, max=25_000, help="Record every n-th tick of 40 us; 0 records nothing.")
    ] = 10,
    formats: Annotated[
        str, typer.Option("--trace", metavar="KINDS", help="Trace files: h5, csv, parquet, comma-separated.")
    ] = "h5,csv",
    *,
    as_json: Json = False,
) -> None:
    """Print a job on the simulated axis, from power-on: home, identify, print line by line."""
    from detent.axis import load
    from detent.planning.print_job import load_job
    from detent.simulation.print_run import default_signals

    kinds = _trace_kinds(formats) if every else []
    axis, loaded = load(file, overrides or []), load_job(job)
    folder = output or Path("runs") / f"{file.stem}-{job.stem}"
    wanted = [*default_signals(), *_names(signals)]
    axis.check_signals(wanted)
    _make_folder(folder)
    _say_if_cold()
    with _progress(quiet=as_json) as progress:
        store = folder / "trace.h5" if kinds else None
        done = axis.run(loaded, signals=wanted, every=every, trace_file=store, progress=progress)
        done.settings["command"] = shlex.join(["detent", *sys.argv[1:]])
        progress(1.0, "writing the report")
        written = [done.report(folder / "report.html"), *_convert_trace(folder, kinds)]
    if as_json:
        _print_json(done.to_dict() | {"files": [str(path) for path in written]})
    else:
        _print_run(done, written)
    if not done.printed:
        raise typer.Exit(NOT_DONE)


def _names(texts: list[str] | None) -> list[str]:
    """Names of a repeated option, each of which may hold several."""
    return [name.strip() for text in texts or [] for name in text.split(",") if name.strip()]


def _trace_kinds(formats: str) -> list[str]:
    kinds = _names([formats])
    for kind in kinds:
        if kind not in TRACE_KINDS:
            raise DetentError(f"--trace: came {kind!r}; allowed: h5, csv, parquet, comma-separated; choose of these")
    if "parquet" in kinds:
        from detent.simulation.trace_files import need_parquet

        need_parquet()
    return list(dict.fromkeys(kinds))


def _make_folder(folder: Path) -> None:
    """An output folder without the files of an earlier run: a report must not stand beside another run's trace."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name in ("report.html", *(f"trace.{kind}" for kind in TRACE_KINDS)):
            (folder / name).unlink(missing_ok=True)
    except OSError as error:
        raise DetentError(f"--output {folder}: cannot be written ({error.strerror}); choose another folder") from error


def _convert_trace(folder: Path, kinds: list[str]) -> list[Path]:
    """The HDF5 trace is there; make the others from it and drop it if it was not asked for."""
    from detent.simulation.trace_files import convert_trace

    store = folder / "trace.h5"
    for kind in kinds:
        if kind != "h5":
            convert_trace(store, folder / f"trace.{kind}")
    if kinds and "h5" not in kinds:
        store.unlink()
    return [folder / f"trace.{kind}" for kind in kinds]


def _print_run(done: Any, written: list[Path]) -> None:
    from detent.report.summary import summary_rows

    console = _console()
    result = done.result
    if result.printed:
        console.print(f"Printed {result.job.name} on {done.axis.name}.", style="bold green", soft_wrap=True)
    else:
        console.print(f"Not printed: {result.failure}", style="bold red", soft_wrap=True)
    for name, text in summary_rows(result):
        console.print(f"  {name:<20} {text}", soft_wrap=True)
    for text in result.warnings:
        console.print(f"  warning: {text}", style="yellow", soft_wrap=True)
    for note in result.job.notes[:5]:
        console.print(f"  note: byte {note.offset}, {note.code}: {note.text}", soft_wrap=True)
    if len(result.job.notes) > 5:
        console.print(f"  {len(result.job.notes) - 5} more notes; --json shows them all")
    for path in written:
        console.print(f"  {path.stem if path.stem == 'report' else 'trace':<20} {path}", soft_wrap=True)


@app.command()
def compare(
    file: File,
    overrides: Set = None,
    figure: Annotated[Path, typer.Option("--figure", help="PNG, SVG or PDF.")] = Path("comparison.png"),
    *,
    as_json: Json = False,
) -> None:
    """Compare power-on default, nominal table and identified drive on this axis as its disturbance table has it."""
    from detent.axis import load
    from detent.report.figures import check_figure_path, plot_comparison
    from detent.report.print_report import comparison_figure, drift_text

    check_figure_path(figure)
    axis = load(file, overrides or [])
    _say_if_cold()
    with _progress(quiet=as_json) as progress:
        progress(0.1, "driving the axis three ways")
        found = axis.compare()
        progress(0.8, "drawing")
        plot_comparison(comparison_figure(found, axis.spec), figure)
    machine = drift_text(axis.spec)
    if as_json:
        _print_json(found.to_dict() | {"machine": machine, "files": [str(figure)]})
        return
    rows = [
        (f"{speed / 0.0254:.4g} in/s", *(f"{right:+.1%} / {left:+.1%}" for right, left in found.errors[:, k, :]))
        for k, speed in enumerate(found.speeds)
    ]
    _print_table(f"Steady speed error, right / left ({machine})", ("speed", *found.methods), rows, right=True)
    print(f"figure: {figure}")


@app.command()
def plot(
    trace: Annotated[Path, typer.Argument(help="Trace: .h5, .csv or .parquet.", show_default=False)],
    signals: Signals = None,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="PNG, SVG or PDF.")] = Path("plot.png"),
    start: Annotated[float | None, typer.Option("--from", metavar="SECONDS", help="First moment.")] = None,
    stop: Annotated[float | None, typer.Option("--to", metavar="SECONDS", help="Last moment.")] = None,
    *,
    as_json: Json = False,
) -> None:
    """Draw any recorded registers against time; without --signals, list them."""
    from detent.simulation.trace_files import load_trace

    loaded = load_trace(trace)
    names = _names(signals)
    if not names:
        rows = [{"name": n, "unit": loaded.units.get(n, ""), "doc": loaded.docs.get(n, "")} for n in loaded.signals]
        if as_json:
            _print_json(rows)
            return
        for row in rows:
            print(f"{row['name']:<28} {row['unit']:<10} {row['doc']}".rstrip())
        return
    from detent.report.figures import plot_signals

    begin, end = -math.inf if start is None else start, math.inf if stop is None else stop
    plot_signals(loaded, names, output, None if start is None and stop is None else (begin, end))
    if as_json:
        _print_json({"files": [str(output)]})
    else:
        print(f"figure: {output}")


@app.command("registers")
def registers_command(*, as_json: Json = False) -> None:
    """List every register of the print-head axis: what --signals can record."""
    from detent.systems.print_head import PrintHead

    rows = [
        {"name": leaf.path, "width": leaf.width.code, "unit": leaf.unit, "doc": leaf.doc}
        for leaf in PrintHead.leaves()
        if not leaf.length
    ]
    if as_json:
        _print_json(rows)
        return
    for row in rows:
        print(f"{row['name']:<32} {row['width']:<3} {row['unit']:<12} {row['doc']}")


__all__ = ["app", "example", "main"]
