"""`detent plot` and `detent timing`: signals as pictures."""

import math
from pathlib import Path
from typing import Annotated

import typer

from detent.cli.app import File, Job, Json, ListsMethods, Set, Signals, app
from detent.cli.terminal import print_json, progress_bar, say_if_cold, split_names
from detent.errors import DetentError


@app.command(cls=ListsMethods)
def timing(
    file: File,
    at: Annotated[str, typer.Option("--at", metavar="TIME", help="Where to look, since power-on, such as '21.5 ms'.")],
    duration: Annotated[
        str | None, typer.Option("--for", metavar="TIME", help="How long. Default: 80 base ticks.")
    ] = None,
    job: Job = None,
    signals: Annotated[
        list[str] | None,
        typer.Option("--signals", metavar="NAMES", help="Registers in place of the usual ones, comma-separated."),
    ] = None,
    overrides: Set = None,
    figure: Annotated[Path, typer.Option("--figure", help="PNG, SVG or PDF.")] = Path("timing.png"),
    vcd: Annotated[Path, typer.Option("--vcd", help="VCD file for GTKWave or Surfer.")] = Path("timing.vcd"),
    *,
    as_json: Json = False,
) -> None:
    """Draw the clocked signals of the axis, every clock of a short stretch, and write them as a VCD file."""
    from detent.axis import load
    from detent.page.plots import check_figure_path

    check_figure_path(figure)
    axis = load(file, overrides or [])
    begin = _time("--at", at)
    length = _time("--for", duration) if duration is not None else 80 * axis.simulated.tick
    names = split_names(signals) or list(axis.simulated.timing)
    axis.check_signals(names)
    loaded = axis.load_job(job) if job is not None else None
    say_if_cold()
    with progress_bar(quiet=as_json) as progress:
        found = axis.timing(begin, length, job=loaded, signals=names, progress=progress)
        progress(1.0, "drawing")
        # The VCD file first: it takes any number of signals, a picture does not.
        saved = found.save(vcd)
        files = [found.plot(figure), saved]
    if as_json:
        print_json({"signals": [s.name for s in found.waveforms.signals], "files": [str(path) for path in files]})
        return
    for path in files:
        print(f"{'figure' if path == figure else 'VCD'}: {path}")


def _time(option: str, text: str) -> float:
    """A time given as an option."""
    from detent.units import QuantityError, parse_quantity

    try:
        return parse_quantity(text, "s")
    except QuantityError as error:
        raise DetentError(f"{option}: came {text!r}; allowed: {error.allowed}; do: {error.remedy}") from error


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
    from detent.record.trace_files import load_trace

    loaded = load_trace(trace)
    names = split_names(signals)
    if not names:
        rows = [{"name": n, "unit": loaded.units.get(n, ""), "doc": loaded.docs.get(n, "")} for n in loaded.signals]
        if as_json:
            print_json(rows)
            return
        for row in rows:
            print(f"{row['name']:<28} {row['unit']:<10} {row['doc']}".rstrip())
        return
    from detent.page.plots import plot_signals

    begin, end = -math.inf if start is None else start, math.inf if stop is None else stop
    plot_signals(loaded, names, output, None if start is None and stop is None else (begin, end))
    if as_json:
        print_json({"files": [str(output)]})
    else:
        print(f"figure: {output}")
