"""What there is to look at: signals as pictures, what can be recorded, files to start from."""

import json
import math
import shlex
import shutil
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import Annotated, Any

import typer

from detent import examples
from detent.cli.app import File, Force, Job, Json, ListsMethods, Set, app, option, unknown_method
from detent.cli.terminal import folder_for, print_json, progress_bar, split_names, tell
from detent.errors import DetentError, InputError

TIMING = "Registers to show instead of the default ones, comma-separated."
SIGNALS = "Registers, comma-separated; patterns such as 'head.*' are allowed."


@app.command(cls=ListsMethods)
def timing(
    file: File,
    at: Annotated[str, option("--at", "TIME", "Start of the interval, from power-on, such as '21.5 ms'.")],
    duration: Annotated[str | None, option("--for", "TIME", "Length of the interval. Default: 80 base ticks.")] = None,
    job: Job = None,
    signals: Annotated[list[str] | None, option("--signals", "NAMES", TIMING)] = None,
    overrides: Set = None,
    figure: Annotated[Path, option("--figure", "", "Figure: PNG, SVG or PDF.")] = Path("timing.png"),
    vcd: Annotated[Path, option("--vcd", "", "VCD file for GTKWave or Surfer.")] = Path("timing.vcd"),
    *,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Plot the clocked signals of the axis, every clock of a short interval, and write them as a VCD file."""
    from detent.axis import load
    from detent.files.source import given_as
    from detent.files.text import check_target, together
    from detent.page.timing import MAX_SIGNALS

    check_target(figure, force=force)
    check_target(vcd, (vcd.suffix.lower(),), "a VCD file", force=force)
    axis = load(file, overrides or [])
    begin = _time("--at", at)
    length = _time("--for", duration) if duration is not None else 80 * axis.simulated.tick
    names = split_names(signals) or list(axis.simulated.timing)
    axis.check_signals(names)
    loaded = axis.load_job(job) if job is not None else None
    with progress_bar(quiet=as_json) as progress:
        with given_as(loaded.name if loaded is not None else "", job):
            found = axis.timing(begin, length, job=loaded, signals=names, progress=progress)
        progress(1.0, "drawing")
        # A picture that refuses so many signals takes none away from the VCD file.
        with together() if len(found.waveforms.signals) <= MAX_SIGNALS else nullcontext():
            saved = found.save(vcd, force=force)
            found.plot(figure, force=force)
        files = [figure, saved]
    if as_json:
        print_json({"signals": [s.name for s in found.waveforms.signals], "files": [str(path) for path in files]})
        return
    for path in files:
        tell(f"{'figure' if path == figure else 'VCD'}: {path}")


def _time(option: str, text: str) -> float:
    """A time given as an option."""
    from detent.units import QuantityError, parse_quantity

    try:
        return parse_quantity(text, "s")
    except QuantityError as error:
        raise DetentError(f"{option}: got {text!r}; expected: {error.allowed}; try: {error.remedy}") from error


def _moment(option: str, text: str) -> float:
    """The same of a trace, whose time is in seconds: a bare number is one of these."""
    with suppress(ValueError):
        return float(text)
    return _time(option, text)


@app.command()
def plot(
    trace: Annotated[Path, typer.Argument(help="Trace: .h5, .csv or .parquet.", show_default=False)],
    signals: Annotated[list[str] | None, option("--signals", "NAMES", SIGNALS)] = None,
    output: Annotated[Path, option("--output -o", "FILE", "Figure: PNG, SVG or PDF.")] = Path("plot.png"),
    start: Annotated[str, option("--from", "TIME", "Start time, such as '6 s'; a bare number is in seconds.")] = "",
    stop: Annotated[str, option("--to", "TIME", "End time, in the same form.")] = "",
    *,
    incomplete: Annotated[bool, option("--incomplete", "", "Accept the trace of an aborted run.")] = False,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Plot recorded registers against time; without --signals, list them."""
    from detent.files.text import check_target
    from detent.record.trace import BROKEN_OFF, broke_off
    from detent.record.trace_files import load_trace

    names = split_names(signals)
    if names:
        check_target(output, force=force)
    loaded = load_trace(trace)
    if broke_off(loaded.attributes) and not incomplete:
        raise InputError.of_file(str(trace), *BROKEN_OFF, "record it again, or plot it as it is with --incomplete")
    names = split_names(signals)
    if not names:
        rows = [{"name": n, "unit": loaded.units.get(n, ""), "doc": loaded.docs.get(n, "")} for n in loaded.signals]
        if as_json:
            print_json(rows)
            return
        for row in rows:
            tell(f"{row['name']:<28} {row['unit']:<10} {row['doc']}".rstrip())
        return
    from detent.page.plots import plot_signals

    begin = _moment("--from", start) if start else -math.inf
    end = _moment("--to", stop) if stop else math.inf
    plot_signals(loaded, names, output, (begin, end) if start or stop else None, force=force)
    if as_json:
        print_json({"files": [str(output)]})
    else:
        tell(f"figure: {output}")


@app.command("examples")
def examples_command(
    copy: Annotated[Path | None, option("--copy", "FOLDER", "Copy all examples into this folder.")] = None,
    *,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """List the packaged example files, or copy them to start from."""
    from detent.files.marks import refuse_others
    from detent.files.text import have_same_bytes

    found = examples()
    if copy is not None:
        with folder_for("--copy", copy, force=force) as made:
            # An example carries no mark: whoever copies it edits it.
            refuse_others(
                [copy / path.name for path in found if not have_same_bytes(path, copy / path.name)], force=force
            )
            for path in found:
                shutil.copyfile(path, made / path.name)
        found = [copy / path.name for path in found]
    if as_json:
        print_json([{"name": path.name, "path": str(path), "about": _about(path)} for path in found])
        return
    for path in found:
        tell(f"{path.name:<20} {_about(path)}")
    if copy is None:
        tell("\nCopy them with: detent examples --copy FOLDER")
    else:
        axis, job = (shlex.quote(str(copy / name)) for name in ("print_head.toml", "letter.txt"))
        tell(f"\nCopied to {copy}. Try: detent run {axis} --job {job}")


def _about(path: Path) -> str:
    """First comment line of an axis file or a list of moves, title of a notebook; what kind of job the others are."""
    from detent.files.text import lines_of

    if path.suffix in {".toml", ".csv"}:
        return lines_of(path.read_text(encoding="utf-8"))[0].lstrip("# ")
    if path.suffix == ".ipynb":
        return str(json.loads(path.read_text(encoding="utf-8"))["cells"][0]["source"][0]).strip("# \n")
    return "print job, Diablo 630 stream" if path.suffix == ".prn" else "print job, plain text"


@app.command("registers")
def registers_command(
    method: Annotated[str, typer.Argument(help="Control method, or an axis file that uses it.")] = "print_head",
    *,
    as_json: Json = False,
) -> None:
    """List every register of an axis: what --signals can record."""
    rows = [
        {"name": leaf.path, "width": leaf.width.code, "unit": leaf.unit, "doc": leaf.doc, "by": leaf.by}
        for leaf in _registers_of(method).leaves()
        if not leaf.length
    ]
    if as_json:
        print_json(rows)
        return
    for row in rows:
        writer = f" (written by the {row['by']})" if row["by"] else ""
        tell(f"{row['name']:<36} {row['width']:<3} {row['unit']:<14} {row['doc']}{writer}")


def _registers_of(method: str) -> Any:
    """Class of the state of a method, named itself or by an axis file."""
    from detent.methods.registry import METHODS

    if method in METHODS:
        return METHODS[method].registers()
    if not Path(method).exists():
        raise unknown_method("registers", method, "an axis file")
    from detent.axis import load

    return load(method).simulated.registers
