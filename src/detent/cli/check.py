"""`detent check` and `detent compare`: an axis file looked over, and its method beside its alternatives."""

from pathlib import Path
from typing import Annotated

import typer

from detent.cli.app import File, Json, Set, app
from detent.cli.terminal import make_console, print_json, print_table, progress_bar, say_if_cold


@app.command()
def check(file: File, overrides: Set = None, *, as_json: Json = False) -> None:
    """Check an axis file: every value in effect and its origin, what follows from it, what looks wrong."""
    from detent.methods.check import check_spec
    from detent.methods.load import read_axis

    report = check_spec(read_axis(file, overrides or []))
    if as_json:
        print_json(report.to_dict())
        return
    rows = [(row.key, row.value, row.origin) for row in report.rows]
    print_table(f"{report.name}: every value in effect", ("key", "value", "origin"), rows)
    figures = [(figure.name, figure.text, figure.formula) for figure in report.derived]
    print_table("What follows from them", ("figure", "value", "from"), figures)
    console = make_console()
    for caution in report.warnings:
        console.print(f"warning: {caution}", style="yellow", soft_wrap=True)
    number = len(report.warnings)
    console.print(f"{number} warning{'s' if number > 1 else ''}" if number else "no warnings")


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
