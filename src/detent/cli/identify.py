"""`detent identify`: from recordings to constants with limits, and a verdict. `detent analyse`: single analyses."""

import shlex
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from detent.cli.app import LOGS, NOT_DONE, Columns, Force, Json, Mapping, app, option
from detent.cli.terminal import print_json, print_table, progress_bar, say, tell
from detent.errors import DetentError

if TYPE_CHECKING:
    from detent.files.patch import Change
    from detent.identify.analysed import Analysed
    from detent.identify.fit.identification import Method
    from detent.identify.identified import Identified

# Words of --method: the identification's.
METHODS = {"auto": "auto", "regression": "regression", "output-error": "output error"}
COLOURS = {"trusted": "bold green", "partly trusted": "bold yellow", "refused": "bold red"}
MOST_LINES = 6  # logs, findings and refusals shown; --json and the report have them all

EFFORT = (
    "The signal that drives the axis: force, torque, current, voltage or command. Default: the first one in the log."
)
METHOD = (
    "regression: fits the equations of motion, takes a second; output-error: also fits the simulation to the "
    "recording; auto: regression, and says whether output-error would predict the motion better."
)
AXIS = (
    "Cascade axis file: its constants outside the confidence intervals are reported, --write updates it with the "
    "identified ones, --job respects its limits."
)
WRITE = (
    "Write an axis file (TOML): a new one, or that of --axis, changed. Into a file that somebody wrote only what was "
    "identified is put: comments, units and layout stay."
)
REPORT = "Write the report, one self-contained HTML file."
COMPARE = (
    "Identify each recording alone and say which constants changed between them, and where one more recording is "
    "expected."
)
JOB = "Write a list of moves (TOML) that would supply what the logs lack."
Effort = Annotated[str | None, option("--effort", "ROLE", EFFORT)]


@app.command()
def identify(
    logs: Annotated[
        list[Path], typer.Argument(metavar="LOG...", help=f"Recordings of one axis {LOGS}.", show_default=False)
    ],
    mapping: Mapping = None,
    columns: Columns = None,
    effort: Effort = None,
    method: Annotated[str, option("--method", "WORD", METHOD)] = "auto",
    axis: Annotated[Path | None, option("--axis", "FILE", AXIS)] = None,
    write: Annotated[Path | None, option("--write", "FILE", WRITE)] = None,
    job: Annotated[Path | None, option("--job", "FILE", JOB)] = None,
    report: Annotated[Path | None, option("--report", "FILE", REPORT)] = None,
    *,
    compare: Annotated[bool, typer.Option("--compare", help=COMPARE, show_default=False)] = False,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Identify mass, friction and delay from recordings, with confidence limits; refuse what the data do not determine.

    Exit status: 0 all constants are trusted, 1 some or all are refused (the output says what to record), 2 wrong
    input. With --compare: 0 nothing changed, 1 something did, or nothing can be compared.
    """
    from detent.identify.identified import identify_axis

    if method not in METHODS:
        raise DetentError(f"--method: got {method!r}; expected: {' or '.join(METHODS)}; choose one of them")
    chosen = cast("Method", METHODS[method])
    if compare:
        named = [
            name for name, path in {"--axis": axis, "--write": write, "--job": job, "--report": report}.items() if path
        ]
        if named:
            raise DetentError(f"--compare: got {', '.join(named)} beside it; expected: recordings alone; leave it out")
        _compare(logs, mapping, columns or [], effort, chosen, as_json=as_json)
        return
    axis = _check_outputs(axis, write, job, report, force=force)
    # Options that read the logs in the same way once more.
    options = ["--map", str(mapping)] if mapping is not None else []
    options += [part for column in columns or [] for part in ("--column", column)]
    with progress_bar(quiet=as_json) as progress:
        done = identify_axis(
            logs, mapping=mapping, columns=columns or [], effort=effort, method=chosen, axis=axis, progress=progress,
            reading=shlex.join(options),
        )  # fmt: skip
        outside = done.contrasts()
        progress(0.97, "writing")
        changes = _changes(done, write, force=force)
        written, errors = _write(done, write, job, report, force=force)
    if as_json:
        names, reasons = [str(path) for path in written], [str(error) for error in errors]
        told = {"files": names, "not_written": reasons, "changes": [one._asdict() for one in changes]}
        print_json(done.to_dict() | told)
    else:
        _print(done, [str(one) for one in outside])
        for error in errors:
            say(f"not written: {error}", "bold red")
        for path in written:
            say(f"written: {path}")
            if path == write:
                for change in changes:
                    say(f"  {change}")
        if done.refusals and job is None:
            say("--job FILE writes moves that show what is missing")
    if done.verdict != "trusted" or errors:
        raise typer.Exit(max([NOT_DONE, *(error.exit_status for error in errors)]))


def _compare(
    logs: list[Path], mapping: Path | None, columns: list[str], effort: str | None, method: "Method", *, as_json: bool
) -> None:
    """Compare recordings, each identified alone."""
    from detent.identify.records import compare_records

    with progress_bar(quiet=as_json) as progress:
        done = compare_records(logs, mapping=mapping, columns=columns, effort=effort, method=method, progress=progress)
    if as_json:
        print_json(done.to_dict())
    else:
        say(done.sentence, "bold yellow" if done.changed or not done.constants else "bold green")
        for one in done.each:
            if one.verdict != "trusted":
                say(f"  {one.sentence}", "yellow")
        tell()
        if done.constants:
            print_table(*done.table)
        if done.alone:
            say(f"trusted in one recording only: {', '.join(done.alone)}", "dim")
    if done.changed or not done.constants:
        raise typer.Exit(NOT_DONE)


def _check_outputs(axis: Path | None, *targets: Path | None, force: bool) -> Path | None:
    """Refuse what could not be written, before the work is done; the axis file that the logs belong to.

    Where none is named, that is the one of --write, unless that is replaced as a whole.
    """
    from detent.files.marks import is_ours
    from detent.files.text import check_target

    write, job, _ = targets
    if axis is None and write is not None and not force and not is_ours(write):
        axis = write
    is_kept = axis is not None and write is not None and write.exists() and axis.exists() and write.samefile(axis)
    for path, ending, what in zip(targets, (".toml", ".toml", ".html"), ("an axis", "a job", "a report"), strict=True):
        if path is not None:
            check_target(path, (ending,), what, force=force or (path is write and is_kept))
    if job is not None and job in (write, axis):
        raise DetentError(
            f"--job {job}: got the name of the axis file; expected: a different file; choose another name"
        )
    return axis


def _write(
    done: "Identified", axis: Path | None, job: Path | None, report: Path | None, *, force: bool
) -> tuple[list[Path], list[DetentError]]:
    """Files that were written, and why others were not: what was found is shown all the same."""
    written: list[Path] = []
    errors: list[DetentError] = []
    for path, save in ((axis, done.save), (job, done.save_job), (report, done.report)):
        if path is None:
            continue
        try:
            written.append(save(path, force=force))
        except DetentError as error:
            errors.append(error)
    return written, errors


def _changes(done: "Identified", axis: Path | None, *, force: bool) -> "list[Change]":
    """What becomes of an axis file; nothing where it is not written, which the writing says."""
    with suppress(DetentError):
        return [] if axis is None else done.changes(axis, force=force)
    return []


# ---- what a person reads


def _print(done: "Identified", outside: list[str]) -> None:
    found = done.found
    say(done.sentence, COLOURS[done.verdict])
    _print_refusals(done)
    for text in outside:
        say(f"  differs from the axis file: {text}", "yellow")
    tell()
    _print_logs(found)
    if found.estimates:
        print_table(*done.table)
    for remark in done.remarks:
        say(f"  {remark}", "yellow")
    if done.remarks:
        tell()
    if found.climbs:
        _print_ladder(found)
    if found.horizons:
        _print_horizons(found)


def _print_refusals(done: "Identified") -> None:
    """What is wrong and what to do about it, the same advice once; what concerns everything comes first."""
    ordered = sorted(done.refusals, key=lambda refusal: bool(refusal.constants))
    if any(not refusal.constants for refusal in ordered):
        ordered = [refusal for refusal in ordered if not refusal.constants]
    advice: dict[str, list[str]] = {}
    for refusal in ordered:
        advice.setdefault(refusal.record, []).append(f"{refusal.subject}: {refusal.text}")
    for record, texts in list(advice.items())[:MOST_LINES]:
        for text in dict.fromkeys(texts):
            say(f"  {text}")
        say(f"    -> {record}", "bold")
    left = len(advice) - MOST_LINES
    if left > 0:
        say(f"  {left} more; --json shows them all")


def _print_logs(found: Any) -> None:
    """What each log holds, what was wrong with it, what was guessed."""
    from detent.page.words import count, duration, number

    for log, run in zip(found.logs[:MOST_LINES], found.runs, strict=False):
        held = f"{count(len(log), 'sample')}, {duration(float(log.t[-1] - log.t[0]))} at {number(1 / run.step, 3)} Hz"
        say(f"{log.name}: {held}; driven by its {run.effort_name} [{run.effort_unit}]")
        for finding in log.findings[:MOST_LINES]:
            style = None if finding.severity == "note" else "yellow"
            say(f"  {finding}", style)
        if len(log.findings) > MOST_LINES:
            say(f"  {len(log.findings) - MOST_LINES} more findings; --json shows them all")
        if log.guesses:
            say(f"  guessed: {'; '.join(log.guesses)}", "dim")
    if len(found.logs) > MOST_LINES:
        say(f"{len(found.logs) - MOST_LINES} more logs; --json shows them all")
    if found.notes:
        say(f"  {'; '.join(found.notes)}", "dim")
    tell()


def _print_ladder(found: Any) -> None:
    """One line a model."""
    rows: list[tuple[str, ...]] = []
    for climb in found.climbs:
        gain = "" if climb.gain != climb.gain else f"{climb.gain:+.1f}"
        why = "" if climb.possible else "; friction decreases towards standstill"
        taken = "model" if climb.rung is found.rung else "taken" if climb.taken else f"no{why}"
        rows.append((climb.rung.name, f"{climb.error:.2%}", gain, taken, climb.rung.text))
    heads = ("", "error", "gain", "", "")
    print_table("Models: error of the effort on held-out data, improvement in standard errors", heads, rows)


def _print_horizons(found: Any) -> None:
    """How far off the simulation is."""
    from detent.identify.page.words import Ways

    ways = Ways(found.runs[0].position_unit)
    rows: list[tuple[str, ...]] = []
    for one in found.horizons:
        texts = (ways.error(float(value)) for value in (one.rms, one.largest, one.moved))
        limits = "" if one.name != "free run" else ways.spread(one.spread)
        rows.append((one.name, *texts, f"{one.rms / one.moved:.2%}" if one.moved else "", limits))
    title = "Simulated: the last quarter, held out"
    heads = ("over", "rms error", "largest", "travel", "error/travel", "95 % by the limits")
    print_table(title, heads, rows, right=True)
    loop = found.closed_loop
    if loop is not None:
        told = f"rms error {ways.error(loop.rms)}, largest {ways.error(loop.largest)}; effort {loop.effort:.1%} off"
        say(f"The same with the control loops found in the log: {told}")


# ---- single analyses, each by its own method

WHAT = "two-speeds, friction-map, winding, frequency, steps or sensors; repeat for more. Default: all."
What = Annotated[list[str] | None, option("--what", "WORD", WHAT)]
Mass = Annotated[
    float,
    option(
        "--mass", "NUMBER", "Mass or inertia, as effort per acceleration in SI units, for the friction map.", min=0.0
    ),
]


@app.command()
def analyse(
    log: Annotated[Path, typer.Argument(metavar="LOG", help=f"Recording {LOGS}.", show_default=False)],
    what: What = None,
    mapping: Mapping = None,
    columns: Columns = None,
    effort: Effort = None,
    mass: Mass = 0.0,
    report: Annotated[Path | None, option("--report", "FILE", REPORT)] = None,
    *,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Analyse single aspects of a recording: friction, winding, resonances, step response, encoder.

    Exit status: 0 every analysis named by --what gives a trusted result (without --what, at least one does); 1
    otherwise (the output says what is missing); 2 wrong input.
    """
    from detent.files.text import check_target
    from detent.identify.analysed import analyse as ask

    if report is not None:
        check_target(report, (".html",), "a report", force=force)
    with progress_bar(quiet=as_json) as progress:
        found = ask(
            log, what or (), mapping=mapping, columns=columns or [], effort=effort or "", mass=mass, progress=progress
        )
        files = [] if report is None else [str(found.report(report, force=force))]
    if as_json:
        print_json(found.to_dict() | {"files": files})
    else:
        _print_answers(found)
        for path in files:
            say(f"written: {path}")
    if not found.done:
        raise typer.Exit(NOT_DONE)


def _print_answers(found: "Analysed") -> None:
    """What to do with each answer first, then the answers."""
    from detent.identify.analysed import table_of

    for finding in found.log.findings:
        say(f"  {finding}", "yellow")
    for name, text in found.recommendations.items():
        say(f"{name}: {text}", None if found[name].reason else "bold")
    for remark in found.remarks:
        say(f"  {remark}", "yellow")
    tell()
    for one in (one for one in found.answers if one.estimates):
        print_table(*table_of(one))
        for note in dict.fromkeys(one.notes):
            say(f"  {note}", "dim")
        if one.reason:
            say(f"  not trusted: {one.reason}", "bold yellow")
        tell()
