"""`detent envelope`: the tables of a stepper, for firmware and for people."""

from pathlib import Path
from typing import Annotated, Any

import typer

from detent.cli.app import File, Json, Set, app
from detent.cli.terminal import folder_for, print_json, print_table
from detent.errors import DetentError

KINDS = ("csv", "h", "png")


@app.command()
def envelope(
    file: File,
    overrides: Set = None,
    motor: Annotated[
        str, typer.Option("--motor", metavar="NAME", help="Only this motor of the file. Default: every one.")
    ] = "",
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FOLDER", help="Where the files go. Default: envelope/FILE")
    ] = None,
    *,
    as_json: Json = False,
) -> None:
    """Write a stepper's tables: CSV, a C header with the step rule in C99, and a figure, for each motor of the file."""
    from detent.axis import load

    axis = load(file, overrides or [])
    found = axis.envelopes()
    if motor and motor not in found:
        raise DetentError(f"--motor: came {motor!r}; allowed: {', '.join(found)}; name a motor of the file")
    chosen = {motor: found[motor]} if motor else found
    folder = output or Path("envelope") / file.stem
    with folder_for("--output", folder):
        written = {name: [tables.save(folder / f"{name}.{kind}") for kind in KINDS] for name, tables in chosen.items()}
    if as_json:
        print_json({name: chosen[name].to_dict() | {"files": [str(f) for f in written[name]]} for name in chosen})
        return
    print_table(axis.name, ("motor", "travel", "ramp", "run-up", "memory"), [_row(e) for e in chosen.values()])
    for path in (path for paths in written.values() for path in paths):
        print(f"{'figure' if path.suffix == '.png' else path.suffix[1:]:<6} {path}")


def _row(found: Any) -> tuple[str, ...]:
    about = found.to_dict()
    return (
        about["motor"],
        f"{about['steps']} steps",
        f"{about['ramp']} entries, {about['start_hz']:.4g} to {about['top_hz']:.4g} Hz",
        f"{about['run_up'] * 1e3:.4g} ms",
        f"{about['bytes']} bytes",
    )
