"""`detent tolerance`: how many of many machines are good."""

from pathlib import Path
from typing import Annotated

import typer

from detent.cli.app import NOT_DONE, File, Force, Job, Json, Set, app, option
from detent.cli.terminal import print_json, print_table, progress_bar, say

CASES = "How many machines; case 0 is that of the file."
SEED = "Which machines: another seed draws others."
LIMIT = (
    "What passes, as in 'peak_following <= 45 um'; repeat for more. Default: what the file says, in method.in_position "
    "and method.following_error. That the job is done is always asked for."
)
MARGINS = "Measure the margins of the loops, too."
STORE = "Folder that keeps each chunk of cases: broken off or with more --cases, the same question is continued there."
HUNT = "Watch each machine at standstill, too, from eight starts; of at most 1000 cases."
TOTAL = (
    "Total index of each key from a scheme of its own: N points, a power of 2, make N times the number of keys and two "
    "runs."
)
WORST = "Folder for axis files of the worst machine found of each quantity. Default: worst in the folder of --store."
SAVE = "Write a row for each case: HDF5, CSV or Parquet, by the suffix."
WORKERS = "Threads, or processes where the method runs each machine for itself. Default: all processors."
DASK = "Let the workers of a Dask scheduler compute, as in tcp://host:8786, or local:2 for two of its own."
YES = "Compute even where that takes more than an hour."
REPORT = "Write the report, one self-contained HTML file. Default: report.html in the folder of --store."


@app.command()
def tolerance(
    file: File,
    overrides: Set = None,
    job: Job = None,
    cases: Annotated[int, option("--cases", "N", CASES)] = 1000,
    seed: Annotated[int, option("--seed", "N", SEED)] = 1,
    limits: Annotated[list[str] | None, option("--limit", "TEXT", LIMIT)] = None,
    store: Annotated[Path | None, option("--store", "DIR", STORE)] = None,
    workers: Annotated[int, option("--workers", "N", WORKERS, show_default=False)] = 0,
    dask: Annotated[str, option("--dask", "ADDRESS", DASK)] = "",
    worst: Annotated[Path | None, option("--worst", "DIR", WORST)] = None,
    total: Annotated[int, option("--total", "N", TOTAL, show_default=False)] = 0,
    save: Annotated[Path | None, option("--save", "FILE", SAVE)] = None,
    report: Annotated[Path | None, option("--report", "FILE", REPORT)] = None,
    *,
    margins: Annotated[bool, option("--margins", "", MARGINS)] = False,
    hunt: Annotated[bool, option("--hunt", "", HUNT)] = False,
    yes: Annotated[bool, option("--yes", "", YES)] = False,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Make a job on many machines that differ as [tolerance] allows: how many are good, and what makes others bad.

    Exit status: 0 all cases pass, 1 some do not, 2 wrong input.
    """
    from detent.axis import load
    from detent.files.text import check_target

    axis = load(file, overrides or [])
    if report is not None:
        check_target(report, (".html",), "a report", force=force)
    if save is not None:
        check_target(save, (".h5", ".hdf5", ".csv", ".parquet"), "cases", force=force)
    with progress_bar(quiet=as_json) as progress:
        found = axis.tolerance(
            job, cases=cases, seed=seed, limits=limits or (), margins=margins, hunt=hunt, total=total, store=store,
            worst=worst, workers=workers, dask=dask, yes=yes, force=force, progress=progress,
        )  # fmt: skip
        progress(0.99, "what makes them differ")
        told, written = found.to_dict(), [one.file for one in found.worst if one.file]
        places = [place for place in (report, store and store / "report.html") if place is not None]
        written += [found.report(place, force=force) for place in places]
        if save is not None:
            written.append(found.save(save, force=force))
    if as_json:
        print_json(told | {"files": [str(path) for path in written]})
    else:
        say(found.sentence, "bold green" if found.done else "bold yellow")
        for block in found.blocks:
            print_table(block.title, block.heads, block.rows)
        say(f"{told['more']} cases more would halve the interval of the yield")
        for path in written:
            say(f"written: {path}")
    if not found.done:
        raise typer.Exit(NOT_DONE)
