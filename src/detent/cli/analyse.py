"""`detent analyse`: single questions to a recording, each answered by its own method."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from detent.cli.app import NOT_DONE, Columns, Json, Mapping, app
from detent.cli.identify import Effort
from detent.cli.terminal import make_console, print_json, print_table, progress_bar, say_if_cold

if TYPE_CHECKING:
    from detent.identify.analyse.analyses import Analysis

What = Annotated[
    list[str] | None,
    typer.Option(
        "--what",
        metavar="WORD",
        help="two-speeds, friction-map, winding, frequency, steps or sensors; repeat for more. Default: all.",
    ),
]
Mass = Annotated[
    float,
    typer.Option(
        "--mass", metavar="NUMBER", help="Effort per acceleration in SI units, for the friction map.", min=0.0
    ),
]


@app.command()
def analyse(
    log: Annotated[
        Path,
        typer.Argument(metavar="LOG", help="Recording (.csv, .h5, .parquet, .mat, .npz, .jsonl).", show_default=False),
    ],
    what: What = None,
    mapping: Mapping = None,
    columns: Columns = None,
    effort: Effort = None,
    mass: Mass = 0.0,
    *,
    as_json: Json = False,
) -> None:
    """Ask a recording single questions: friction, winding, resonances, steps, encoder; each answer has its limits.

    Exit status: 0 every question asked for has an answer, 1 some have none (the output says what is missing), 2 the
    input cannot be read.
    """
    from detent.identify.analyse.analyses import ANALYSES, analyse, check_names
    from detent.logs.read_log import read_log

    names = list(dict.fromkeys(what or ANALYSES))
    check_names(names)
    say_if_cold()
    found: list[Analysis] = []
    with progress_bar(quiet=as_json) as progress:
        read = read_log(log, mapping, columns or [])
        for k, name in enumerate(names):
            progress(k / len(names), name)
            found.append(analyse(read, name, effort or "", mass))
    if as_json:
        print_json({"log": read.to_dict(), "analyses": [one.to_dict() for one in found]})
    else:
        _print(found, [str(finding) for finding in read.findings])
    asked = found if what else [one for one in found if one.estimates]
    if not asked or any(one.reason for one in asked):
        raise typer.Exit(NOT_DONE)


def _print(found: "list[Analysis]", findings: list[str]) -> None:
    """Answers first, then what has none and why."""
    console = make_console()
    for finding in findings:
        console.print(f"  {finding}", style="yellow", soft_wrap=True)
    for one in (one for one in found if one.estimates):
        rows = [(e.name, f"{e.value:.5g}", f"{e.low:.5g} to {e.high:.5g}", e.unit) for e in one.estimates]
        print_table(f"{one.title[0].upper()}{one.title[1:]} ({one.name})", ("", "value", "95 % interval", "unit"), rows)
        for note in dict.fromkeys(one.notes):
            console.print(f"  {note}", style="dim", soft_wrap=True)
        if one.reason:
            console.print(f"  not trusted: {one.reason}", style="bold yellow", soft_wrap=True)
        console.print()
    for one in (one for one in found if not one.estimates):
        console.print(f"{one.name}: no answer: {one.reason}", soft_wrap=True)
