"""The command line: the only place that parses arguments or prints."""

import json
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer

from detent import __version__, example, examples
from detent.errors import DetentError

app = typer.Typer(
    name="detent",
    help="Positioning control as software: describe an axis in one file, check it, run a job on it.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

File = Annotated[Path, typer.Argument(help="Axis file (TOML).", show_default=False)]
Set = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Replace or add a value of the file, checked like the file."),
]
Json = Annotated[bool, typer.Option("--json", help="Print machine-readable JSON instead of text.")]

DONE, NOT_DONE, WRONG_INPUT = 0, 1, 2


def main() -> NoReturn:
    """Entry point: errors that detent raises on purpose become one message and an exit status."""
    try:
        app(standalone_mode=True)
    except DetentError as error:
        sys.stderr.write(f"{error}\n")
        sys.exit(error.exit_status)
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(DONE)
    sys.exit(DONE)


def _version(wanted: bool) -> None:  # noqa: FBT001 - typer calls it so
    if wanted:
        print(f"detent {__version__}")
        raise typer.Exit


@app.callback()
def common(
    version: Annotated[  # noqa: ARG001 - handled by its callback
        bool, typer.Option("--version", help="Print the version.", callback=_version, is_eager=True)
    ] = False,
) -> None:
    """Exit status: 0 done, 1 the axis did not do it, 2 wrong input."""


def _print_json(data: Any) -> None:
    print(json.dumps(_without_nan(data), indent=2, ensure_ascii=False, allow_nan=False))


def _without_nan(data: Any) -> Any:
    """JSON knows no NaN: what was not measured is null."""
    if isinstance(data, dict):
        return {str(key): _without_nan(value) for key, value in data.items()}  # pyright: ignore[reportUnknownVariableType, reportUnknownArgumentType] - plain data of any shape
    if isinstance(data, list | tuple):
        return [_without_nan(value) for value in data]  # pyright: ignore[reportUnknownVariableType] - as above
    return None if isinstance(data, float) and data != data else data


@app.command("examples")
def examples_command(
    copy: Annotated[Path | None, typer.Option("--copy", help="Copy all examples into this folder.")] = None,
    *,
    as_json: Json = False,
) -> None:
    """List the packaged example files, or copy them to start from."""
    found = examples()
    if copy is not None:
        _copy_examples(found, copy)
    if as_json:
        _print_json([{"name": path.name, "path": str(path)} for path in found])
        return
    for path in found:
        print(f"{path.name:<20} {_about(path)}")
    if copy is None:
        print("\nCopy them with: detent examples --copy FOLDER")
    else:
        print(f"\nCopied to {copy}")


def _copy_examples(found: list[Path], folder: Path) -> None:
    import shutil

    existing = [path.name for path in found if (folder / path.name).exists()]
    if existing:
        raise DetentError(f"{folder}: {', '.join(existing)} exist already; choose an empty folder, nothing was copied")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for path in found:
            shutil.copyfile(path, folder / path.name)
    except OSError as error:
        raise DetentError(f"{folder}: cannot be written ({error.strerror}); choose another folder") from error


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
    _print_check(report)


def _print_check(report: Any) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console()
    rows = Table(title=f"{report.name}: every value in effect", title_justify="left", box=None, pad_edge=False)
    for head in ("key", "value", "origin"):
        rows.add_column(head, overflow="fold")
    for row in report.rows:
        rows.add_row(row.key, row.value, row.origin, style="dim" if row.origin == "default" else None)
    console.print(rows)
    figures = Table(title="What follows", title_justify="left", box=None, pad_edge=False)
    for head in ("figure", "value", "from"):
        figures.add_column(head, overflow="fold")
    for figure in report.derived:
        figures.add_row(figure.name, figure.text, figure.formula)
    console.print()
    console.print(figures)
    console.print()
    for caution in report.warnings:
        console.print(f"warning: {caution}", style="yellow", markup=False, highlight=False)
    console.print(f"{len(report.warnings)} warnings" if report.warnings else "no warnings", highlight=False)


@contextmanager
def _progress(*, quiet: bool) -> Generator[Callable[[float, str], None]]:
    """A bar on the terminal's error channel; silent for --json and where nobody looks."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    if quiet or not console.is_terminal:
        yield lambda _share, _text: None
        return
    with Progress(
        TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), console=console, transient=True
    ) as bar:
        task = bar.add_task("starting", total=1.0)
        yield lambda share, text: bar.update(task, completed=share, description=text)


def _say_if_cold() -> None:
    from detent.kernel.cache import is_warm

    if not is_warm():
        sys.stderr.write("First run with this version: compiling the axis, about 15 s; later runs start at once.\n")
        sys.stderr.flush()


@app.command()
def run(  # noqa: PLR0913 - one argument per option
    file: File,
    job: Annotated[Path, typer.Option("--job", help="Print job: plain text or a Diablo 630 stream.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder for report and trace.  [default: runs/FILE-JOB]")
    ] = None,
    overrides: Set = None,
    signals: Annotated[
        list[str] | None, typer.Option("--signals", help="Registers to record; 'all' or 'head.*' too.")
    ] = None,
    every: Annotated[int, typer.Option("--every", min=0, help="Record every n-th tick of 40 us; 0 nothing.")] = 10,
    formats: Annotated[str, typer.Option("--trace", help="Trace files: h5, csv, parquet, comma-separated.")] = "h5,csv",
    *,
    as_json: Json = False,
) -> None:
    """Print a job on the simulated axis, from power-on: home, identify, print line by line."""
    from detent.axis import load

    kinds = _trace_kinds(formats) if every else []
    axis = load(file, overrides or [])
    folder = output or Path("runs") / f"{file.stem}-{job.stem}"
    _make_folder(folder)
    _say_if_cold()
    with _progress(quiet=as_json) as progress:
        done = axis.run(
            job, signals=signals, every=every, trace_file=folder / "trace.h5" if every else None, progress=progress
        )
        done.settings["command"] = " ".join(["detent run", str(file), "--job", str(job), *_set_words(overrides)])
        progress(1.0, "writing the report")
        written = [done.report(folder / "report.html")]
        written += _convert_trace(folder, kinds)
    if as_json:
        _print_json(done.to_dict() | {"files": [str(path) for path in written]})
    else:
        _print_run(done, written)
    if not done.printed:
        raise typer.Exit(NOT_DONE)


def _set_words(overrides: list[str] | None) -> list[str]:
    return [f'--set "{text}"' for text in overrides or []]


def _trace_kinds(formats: str) -> list[str]:
    kinds = [kind.strip() for kind in formats.split(",") if kind.strip()]
    for kind in kinds:
        if kind not in ("h5", "csv", "parquet"):
            raise DetentError(f"--trace: came {kind!r}; allowed: h5, csv, parquet, comma-separated; choose of these")
    return kinds


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DetentError(f"--output {folder}: cannot be made ({error.strerror}); choose another folder") from error


def _convert_trace(folder: Path, kinds: list[str]) -> list[Path]:
    """The HDF5 trace is there; make the others from it and drop it if it was not asked for."""
    from detent.simulation.trace_files import convert_trace

    store = folder / "trace.h5"
    written: list[Path] = [store] if "h5" in kinds else []
    for kind in kinds:
        if kind != "h5":
            convert_trace(store, folder / f"trace.{kind}")
            written.append(folder / f"trace.{kind}")
    if kinds and "h5" not in kinds:
        store.unlink()
    return written


def _print_run(done: Any, written: list[Path]) -> None:
    from rich.console import Console

    console = Console(highlight=False, markup=False)
    result = done.result
    if result.printed:
        console.print(f"Printed {result.job.name} on {done.axis.name}.", style="bold green")
    else:
        console.print(f"Not printed: {result.failure}", style="bold red")
    for name, text in _summary(result):
        console.print(f"  {name:<22} {text}", soft_wrap=True)
    for text in result.warnings:
        console.print(f"  warning: {text}", style="yellow", soft_wrap=True)
    for note in result.job.notes[:5]:
        console.print(f"  note: byte {note.offset}, {note.code}: {note.text}", soft_wrap=True)
    if len(result.job.notes) > 5:
        console.print(f"  note: {len(result.job.notes) - 5} more; all of them with --json")
    for path in written:
        console.print(f"  {path}", soft_wrap=True)


def _summary(result: Any) -> list[tuple[str, str]]:
    """The figures a person wants first."""
    speeds = ", ".join(f"{s / 6:.4g} in/s ({n} lines)" for s, n in result.speeds.items()) or "none"
    rows = [
        ("lines", f"{len(result.lines)} of {len(result.job.lines)} on {result.job.pages} pages"),
        ("time", f"{result.print_time:.2f} s, after {result.time_ready:.2f} s of homing and identification"),
        ("characters", f"{result.characters}, {result.characters_per_second:.0f} per second"),
        ("speeds", speeds),
        ("turn-arounds", f"{result.turn_arounds}, runs back {result.repositions}"),
        ("column error", f"worst {result.worst_error * 1e6:.1f} um, rms {result.rms_error * 1e6:.1f} um"),
    ]
    for side, line in result.identified.items():
        text = f"K {line.slope} (true {line.true_slope:.1f}), friction {line.friction} (true {line.true_friction:.1f})"
        rows.append((f"identified, {side}", text + " counts"))
    rows.append(("peak current", f"{result.peak_current:.2f} A; energy {result.energy:.1f} J"))
    return rows


@app.command()
def compare(
    file: File,
    overrides: Set = None,
    figure: Annotated[Path, typer.Option("--figure", help="PNG, SVG or PDF.")] = Path("comparison.png"),
    *,
    as_json: Json = False,
) -> None:
    """Compare power-on default, nominal table and identified drive on this axis, drifted by [disturbance]."""
    from detent.axis import load
    from detent.report.figures import plot_comparison
    from detent.report.print_report import comparison_figure, drift_text

    axis = load(file, overrides or [])
    _say_if_cold()
    with _progress(quiet=as_json) as progress:
        progress(0.1, "driving the axis three ways")
        found = axis.compare()
        progress(0.8, "drawing")
        plot_comparison(comparison_figure(found, axis.spec), figure)
    if as_json:
        _print_json(found.to_dict() | {"machine": drift_text(axis.spec), "files": [str(figure)]})
        return
    _print_comparison(found, drift_text(axis.spec), figure)


def _print_comparison(found: Any, machine: str, figure: Path) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title=f"Steady speed error, right / left ({machine})", title_justify="left", box=None)
    table.add_column("speed")
    for method in found.methods:
        table.add_column(method, justify="right")
    for k, speed in enumerate(found.speeds):
        cells = [f"{found.errors[m, k, 0]:+.1%} / {found.errors[m, k, 1]:+.1%}" for m in range(len(found.methods))]
        table.add_row(f"{speed / 0.0254:.4g} in/s", *cells)
    console = Console(highlight=False)
    console.print(table)
    console.print(f"  {figure}", markup=False, soft_wrap=True)


@app.command()
def plot(
    trace: Annotated[Path, typer.Argument(help="Trace: .h5, .csv or .parquet.", show_default=False)],
    signals: Annotated[list[str] | None, typer.Option("--signals", help="Register; repeat; 'head.*' too.")] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="PNG, SVG or PDF.")] = Path("plot.png"),
    start: Annotated[float | None, typer.Option("--from", help="Start [s].")] = None,
    stop: Annotated[float | None, typer.Option("--to", help="End [s].")] = None,
    *,
    as_json: Json = False,
) -> None:
    """Draw any recorded registers against time; without --signals, list them."""
    from detent.simulation.trace_files import load_trace

    loaded = load_trace(trace)
    if not signals:
        rows = [{"name": n, "unit": loaded.units.get(n, ""), "doc": loaded.docs.get(n, "")} for n in loaded.signals]
        if as_json:
            _print_json(rows)
            return
        for row in rows:
            print(f"{row['name']:<28} {row['unit']:<10} {row['doc']}")
        return
    from detent.report.figures import plot_signals

    times = (start if start is not None else float(loaded.time[0]), stop if stop is not None else float(loaded.time[-1]))
    plot_signals(loaded, [name for text in signals for name in text.split(",")], output, times)
    if as_json:
        _print_json({"files": [str(output)]})
    else:
        print(output)


@app.command("registers")
def registers_command(*, as_json: Json = False) -> None:
    """List every register of the print-head axis: what --signals can record."""
    from detent.systems.print_head import PrintHead

    leaves = [leaf for leaf in PrintHead.leaves() if not leaf.length]
    if as_json:
        _print_json([{"name": leaf.path, "width": leaf.width.code, "unit": leaf.unit, "doc": leaf.doc} for leaf in leaves])
        return
    for leaf in leaves:
        print(f"{leaf.path:<32} {leaf.width.code:<3} {leaf.unit:<12} {leaf.doc}")


__all__ = ["app", "example", "main"]
