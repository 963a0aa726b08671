"""`detent compare`: the method beside its alternatives."""

from pathlib import Path
from typing import Annotated

import typer

from detent.cli.app import File, Json, Set, app
from detent.cli.terminal import print_json, print_table, progress_bar, say_if_cold


@app.command()
def compare(
    file: File,
    overrides: Set = None,
    figure: Annotated[
        Path, typer.Option("--figure", help="PNG, SVG or PDF; a second comparison gets a 2 in its name.")
    ] = Path("comparison.png"),
    *,
    as_json: Json = False,
) -> None:
    """Hold the axis's method against the ways it was made to better: drives, pulse noise, speed feedback."""
    from detent.axis import load
    from detent.page.plots import check_figure_path

    check_figure_path(figure)
    axis = load(file, overrides or [])
    say_if_cold()
    files: list[Path] = []
    with progress_bar(quiet=as_json) as progress:
        progress(0.1, "running the axis in several ways")
        comparisons = axis.compare(progress)
        for number, found in enumerate(comparisons, 1):
            files.append(figure if number == 1 else figure.with_stem(f"{figure.stem}-{number}"))
            progress(0.9, "drawing")
            axis.method.plot(axis.spec, found, files[-1])
    tables = [axis.method.table(axis.spec, found) for found in comparisons]
    if as_json:
        data = [{"title": title} | found.to_dict() for (title, _, _), found in zip(tables, comparisons, strict=True)]
        print_json({"comparisons": data, "files": [str(path) for path in files]})
        return
    for title, heads, rows in tables:
        print_table(title, heads, rows, right=True)
    for path in files:
        print(f"figure: {path}")
