"""`detent run`: a job on the simulated axis, or a recording replayed on it."""

import shlex
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import typer

from detent import __version__
from detent.cli.app import LOGS, NOT_DONE, Columns, Force, Job, Json, ListsMethods, Mapping, Set, app, option
from detent.cli.terminal import folder_for, print_json, progress_bar, say, split_names
from detent.errors import DetentError, InputError

STYLES = {"good": "bold green", "warn": "bold yellow", "bad": "bold red"}  # of a verdict
TRACE_KINDS = ("h5", "csv", "parquet")

REPLAY = (
    f"Instead of a job: a recording of the machine {LOGS}, for methods that can follow an arbitrary reference. The "
    "axis follows the recorded reference, or is driven by the recorded effort; simulation and recording are compared."
)
OUTPUT = "Folder for report and trace; replaces those of an earlier run. Default: runs/FILE-JOB"
SIGNALS = (
    "Additional registers to record, comma-separated; patterns such as 'head.*' or 'all' are allowed. `detent "
    "registers` lists them."
)
EVERY = "Record every n-th base tick; 0 records nothing. Tick and default of each method: below."
TRACE = "Trace files: h5, csv, parquet, comma-separated. Default: h5, and csv up to 20 MB."
MOST_UNASKED = 20_000_000  # bytes of a CSV trace that nobody asked for
COMPARE = "Include the comparison with other methods in the report, if the method has one."


AGAIN = "Repeat the run stored in a report (.html) or HDF5 trace, and report whether the result is byte-identical."


@app.command(cls=ListsMethods)
def run(
    file: Annotated[Path | None, typer.Argument(help="Axis file (TOML).", show_default=False)] = None,
    job: Job = None,
    replay: Annotated[Path | None, option("--replay", "LOG", REPLAY)] = None,
    mapping: Mapping = None,
    columns: Columns = None,
    output: Annotated[Path | None, option("--output -o", "FOLDER", OUTPUT)] = None,
    overrides: Set = None,
    signals: Annotated[list[str] | None, option("--signals", "NAMES", SIGNALS)] = None,
    every: Annotated[int | None, option("--every", "", EVERY, min=0, max=10_000_000)] = None,
    formats: Annotated[str | None, option("--trace", "KINDS", TRACE)] = None,
    comparison: Annotated[bool, option("--compare/--no-compare", "", COMPARE)] = True,
    again: Annotated[Path | None, option("--again", "FILE", AGAIN)] = None,
    *,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Run a job on the simulated axis, from power-on: print a text, make moves, run a sequence, replay a recording."""
    from detent.axis import load
    from detent.files.marks import refuse_others
    from detent.files.source import given_as

    if again is not None:
        if file is not None or job is not None or replay is not None or overrides or columns or mapping is not None:
            raise DetentError(
                "run: got --again with an axis file, a job or --set; expected: --again alone, as the stored evidence "
                "includes them; leave them out"
            )
        _repeat(again, as_json=as_json)
        return
    if file is None:
        raise DetentError("run: got no axis file; expected: an axis file, or --again FILE; give one")
    kinds = _trace_kinds("h5,csv" if formats is None else formats) if every != 0 else []
    source = _source(job, replay, mapping, columns or [])
    folder = output or Path("runs") / f"{file.stem}-{source.stem}"
    # A report must not stand beside another run's trace.
    files = ("report.html", *(f"trace.{kind}" for kind in TRACE_KINDS))
    refuse_others([folder / name for name in files], force=force)
    axis = load(file, overrides or [])
    loaded = axis.load_job(source) if replay is None else axis.load_recording(source, mapping, columns or [])
    wanted = [*axis.simulated.signals, *split_names(signals)]
    axis.check_signals(wanted)
    with folder_for("--output", folder, files, force=force) as made, progress_bar(quiet=as_json) as progress:
        store = made / "trace.h5" if kinds else None
        with given_as(loaded.name, source):
            done = axis.run(loaded, signals=wanted, every=every, trace_file=store, job_file=job, progress=progress)
        done.settings["command"] = shlex.join(["detent", *sys.argv[1:]])
        if comparison and replay is None and axis.method.reports_comparisons:
            done.comparisons = axis.compare(progress)
        progress(1.0, "writing the report")
        done.report(made / "report.html")
        passed_over = _convert_trace(made, kinds, MOST_UNASKED if formats is None else None)
    written = [folder / name for name in ("report.html", *(f"trace.{kind}" for kind in kinds))]
    if as_json:
        print_json(done.to_dict() | {"files": [str(path) for path in written]})
    else:
        _print_run(done, written)
        if passed_over:
            say(f"  no trace.csv: it would be about {passed_over / 1e6:.0f} MB; --trace h5,csv writes it")
    if not done.done:
        raise typer.Exit(NOT_DONE)


def _repeat(path: Path, *, as_json: bool) -> None:
    """Make a run again from its evidence, and compare."""
    from detent.axis import load
    from detent.record.evidence import first_difference, read_evidence

    before = read_evidence(path)
    if before.job is None:
        raise InputError.of_file(
            str(path), "the evidence of a replay, or of a job that was not read from a file", "a run of a job file",
            "repeat it from its recording, or from Python",
        )  # fmt: skip
    with TemporaryDirectory(prefix="again-") as folder, progress_bar(quiet=as_json) as progress:
        axis, job = Path(folder) / "axis" / Path(before.axis.name).name, Path(folder) / Path(before.job.name).name
        axis.parent.mkdir()
        axis.write_bytes(before.axis.content)
        job.write_bytes(before.job.content)
        changes = dict(before.changes)
        repeated = load(axis, before.overrides).replace(changes) if before.axis.content else load(changes)
        made = repeated.run(job, signals=before.signals, every=before.every, progress=progress)
    after = made.evidence
    differs = first_difference(before, after) if after else "the evidence"
    same = not differs
    version = f"detent {before.version}" + ("" if before.version == __version__ else f", this is {__version__}")
    text = f"{path}: byte-identical, {len(before.figures)} figures and {len(before.trace)} columns"
    if not same:
        text = f"{path}: differs, first in {differs}"
    text += f"; the run of {before.date} was made by {version}"
    if as_json:
        told = {"before": before.to_dict(), "after": after and after.to_dict()}
        print_json({"same": same, "difference": differs} | told)
    else:
        say(text, STYLES["good" if same else "bad"])
    if not same:
        raise typer.Exit(NOT_DONE)


def _source(job: Path | None, replay: Path | None, mapping: Path | None, columns: list[str]) -> Path:
    """The file that says what the axis does: a job or a recording."""
    if job is not None and replay is not None:
        raise DetentError("run: got --job and --replay; expected: only one of them; leave one out")
    if replay is None and (mapping is not None or columns):
        raise DetentError(
            "run: got --map or --column without --replay; expected: together with --replay, whose columns they assign; "
            "leave them out, or add a recording"
        )
    found = job or replay
    if found is None:
        raise DetentError(
            "run: got neither --job nor --replay; expected: one of them; give a job, such as --job moves.csv"
        )
    return found


def _trace_kinds(formats: str) -> list[str]:
    kinds = split_names([formats])
    for kind in kinds:
        if kind not in TRACE_KINDS:
            raise DetentError(f"--trace: got {kind!r}; expected: h5, csv, parquet, comma-separated; choose from these")
    if "parquet" in kinds:
        from detent.record.trace_files import need_parquet

        need_parquet()
    return list(dict.fromkeys(kinds))


def _convert_trace(folder: Path, kinds: list[str], most_csv: int | None) -> int:
    """The HDF5 trace is there; make the others from it and drop it if it was not asked for.

    Returns the size of a CSV trace that was left out, and from the kinds, because it is above the most, 0 if none is.
    """
    from detent.record.trace_files import convert_trace, size_as_csv

    store, left_out = folder / "trace.h5", 0
    if most_csv is not None and "csv" in kinds and (size := size_as_csv(store)) > most_csv:
        left_out = size
        kinds.remove("csv")
    for kind in kinds:
        if kind != "h5":
            convert_trace(store, folder / f"trace.{kind}")
    if kinds and "h5" not in kinds:
        store.unlink()
    return left_out


def _print_run(done: Any, written: list[Path]) -> None:
    result = done.result
    say(done.verdict, STYLES[done.level], wrong=done.level != "good")
    for name, text in done.summary():
        say(f"  {name:<20} {text}")
    for text in result.warnings:
        say(f"  warning: {text}", "yellow", wrong=True)
    if number := len(done.cautions):
        told = f"{number} warning{'s' if number > 1 else ''}; `detent check` shows {'them' if number > 1 else 'it'}"
        say(f"  {'check':<20} {told}", "yellow", wrong=True)
    notes = getattr(result.job, "notes", ())
    for note in notes[:5]:
        say(f"  note: {note}")
    if len(notes) > 5:
        say(f"  {len(notes) - 5} more notes; --json shows them all")
    for path in written:
        say(f"  {path.stem if path.stem == 'report' else 'trace':<20} {path}")
