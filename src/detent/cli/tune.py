"""`detent tune` and `detent hunt`: gains with margins, and whether the axis hunts at standstill."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from detent.cli.app import NOT_DONE, File, Force, Job, Json, Set, app, option
from detent.cli.terminal import print_json, print_table, progress_bar, say, split_names

if TYPE_CHECKING:
    from detent.tune.searched import Searched
    from detent.tune.tuned import Tuned

MS = "Largest sensitivity peak, 1.2 to 2.5; the usual 1.7 leaves a gain margin of 2.4 and 34 degrees of phase."
OVERSHOOT = "Largest peak of the reference to the position without feedforward, at least 1; usually 1.1."
GOAL = (
    "stiff: the most integral stiffness; quiet: the least noise at the stiffness of the file; quick: of both, what "
    "settles first with the job."
)
HOLD = "Leave this key as it is, as in method.velocity_gain; repeat for more."
REPORT = "Write the report, one self-contained HTML file."
WRITE = "Write the axis file with the gains; its text otherwise stays. It may be the file itself."
STARTS = "How many starts: 24, at least 12, a third each small, wide and hard; of a method without these 8 moves."
SEED = "What the starts are drawn from."
ON_COUNTS = "Targets lie on counts of the encoder."
BAND = "Find the least dead band of the integral that stops it."
MAP = "Try dead bands and integrals beside one another, for the report."
WRITE_BAND = "Write the axis file with the dead band; its text otherwise stays. It may be the file itself."


@app.command()
def tune(
    file: File,
    overrides: Set = None,
    sensitivity: Annotated[float | None, option("--ms", "NUMBER", MS)] = None,
    overshoot: Annotated[float | None, option("--overshoot", "NUMBER", OVERSHOOT)] = None,
    goal: Annotated[str, option("--for", "GOAL", GOAL)] = "",
    hold: Annotated[list[str] | None, option("--hold", "KEY", HOLD)] = None,
    job: Job = None,
    write: Annotated[Path | None, option("--write", "FILE", WRITE)] = None,
    report: Annotated[Path | None, option("--report", "FILE", REPORT)] = None,
    *,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Choose gains with margins, for all that [tolerance] allows, and try them on the simulated axis.

    Where no linear model gives them, candidates are simulated: --ms, --overshoot and --for are not for these.

    Exit status: 0 chosen for all plants, 1 refused or chosen for the axis of the file only, 2 wrong input.
    """
    from detent.axis import load
    from detent.files.text import check_target

    axis = load(file, overrides or [])
    if write is not None:
        is_own = write.exists() and file.exists() and write.samefile(file)
        check_target(write, (".toml",), "an axis", force=force or is_own)
    if report is not None:
        check_target(report, (".html",), "a report", force=force)
    with progress_bar(quiet=as_json) as progress:
        found = axis.tune(
            ms=sensitivity, overshoot=overshoot, goal=goal, hold=split_names(hold), job=job, progress=progress
        )
        written = [found.save(write, force=force)] if write is not None and found.values else []
        if report is not None:
            progress(0.97, "writing the report")
            written.append(found.report(report, force=force))
    if as_json:
        changes = [one._asdict() for one in found.changes]
        print_json(found.to_dict() | {"changes": changes, "files": [str(path) for path in written]})
    else:
        _say_tuned(found, written, write)
    if not found.done:
        raise typer.Exit(NOT_DONE)


def _say_tuned(found: "Tuned | Searched", written: Sequence[Path], write: Path | None) -> None:
    """What was chosen, for people."""
    say(found.sentence, "bold green" if found.done else "bold yellow")
    for one in found.refusals:
        say(f"  {one}", "yellow", wrong=True)
    print_table("", ("", "before", "after"), found.rows)
    for told in found.why:
        say(f"  {told}")
    if found.table.rows:
        print_table(*found.table)
    for path in written:
        say(f"written: {path}")
        if path == write:
            for change in found.changes:
                say(f"  {change}")
    if found.changes and write is None:
        say("--write FILE puts the new gains into an axis file")


@app.command()
def hunt(
    file: File,
    overrides: Set = None,
    starts: Annotated[int | None, option("--starts", "N", STARTS)] = None,
    seed: Annotated[int, option("--seed", "N", SEED, min=0)] = 1,
    on_counts: Annotated[bool, option("--on-counts", "", ON_COUNTS)] = False,
    dead_band: Annotated[bool, option("--dead-band", "", BAND)] = False,
    map_it: Annotated[bool, option("--map", "", MAP)] = False,
    write: Annotated[Path | None, option("--write", "FILE", WRITE_BAND)] = None,
    report: Annotated[Path | None, option("--report", "FILE", REPORT)] = None,
    *,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Watch the axis at standstill: whether it hunts, how far and how often, and what stops it.

    Exit status: 0 rests from every start, 1 hunts, 2 wrong input.
    """
    from detent.axis import load
    from detent.files.text import check_target

    axis = load(file, overrides or [])
    if write is not None:
        is_own = write.exists() and file.exists() and write.samefile(file)
        check_target(write, (".toml",), "an axis", force=force or is_own)
    if report is not None:
        check_target(report, (".html",), "a report", force=force)
    with progress_bar(quiet=as_json) as progress:
        found = axis.hunt(
            starts=starts, seed=seed, on_counts=on_counts, dead_band=dead_band or write is not None, map_it=map_it,
            progress=progress,
        )  # fmt: skip
        written = [found.save(write, force=force)] if write is not None and found.changes else []
        if report is not None:
            progress(0.97, "writing the report")
            written.append(found.report(report, force=force))
    if as_json:
        changes = [one._asdict() for one in found.changes]
        print_json(found.to_dict() | {"changes": changes, "files": [str(path) for path in written]})
    else:
        say(found.sentence, "bold green" if found.done else "bold yellow")
        for one in found.told:
            say(f"  {one}")
        if found.rows:
            print_table("", found.heads, found.rows)
        if found.assumed:
            print_table(*found.table)
        for path in written:
            say(f"written: {path}")
        for change in found.changes:
            say(f"  {change}" + ("" if write is not None else "; --write FILE puts it into an axis file"))
    if not found.done:
        raise typer.Exit(NOT_DONE)
