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
        Path,
        typer.Option(
            "--figure",
            help="A page (.html) of all comparisons, or a picture: PNG, SVG or PDF; the picture of a second comparison "
            "gets a 2 in its name.",
        ),
    ] = Path("comparison.html"),
    *,
    as_json: Json = False,
) -> None:
    """Hold the axis's method against the ways it was made to better: drives, pulse noise, speed feedback."""
    from detent.axis import load
    from detent.page.draw import draw_figures
    from detent.page.frame import comparison_page
    from detent.page.plots import SUFFIXES, check_figure_path
    from detent.page.render import write_page

    check_figure_path(figure, (".html", *SUFFIXES))
    axis = load(file, overrides or [])
    say_if_cold()
    with progress_bar(quiet=as_json) as progress:
        progress(0.1, "running the axis in several ways")
        found = axis.compare(progress)
        progress(0.9, "drawing")
        if figure.suffix.lower() == ".html":
            files = [figure]
            write_page(figure, comparison_page(axis.name, found, {"axis file": axis.file.file}))
        else:
            files = [figure if k == 1 else figure.with_stem(f"{figure.stem}-{k}") for k in range(1, len(found) + 1)]
            for one, path in zip(found, files, strict=True):
                draw_figures(one.figures(), path)
    if as_json:
        data = [{"title": one.table.title} | one.to_dict() for one in found]
        print_json({"comparisons": data, "files": [str(path) for path in files]})
        return
    for one in found:
        print_table(*one.table, right=True)
    for path in files:
        print(f"{'page' if path.suffix.lower() == '.html' else 'figure'}: {path}")
