"""`detent check`, `compare` and `envelope`: what an axis file says without a job."""

from pathlib import Path
from typing import Annotated

from detent.cli.app import File, Force, Json, Set, app, option
from detent.cli.terminal import folder_for, print_json, print_table, progress_bar, say, tell
from detent.errors import DetentError

KINDS = ("csv", "h", "png")  # of the files with the tables of a motor
FIGURE = (
    "A page (.html) of all comparisons, or a figure: PNG, SVG or PDF; a second comparison's figure gets a 2 in its "
    "name."
)


@app.command()
def check(file: File, overrides: Set = None, *, as_json: Json = False) -> None:
    """Check an axis file: every effective value and its origin, derived figures, and warnings."""
    from detent.methods.load import read_axis
    from detent.tune.checked import check_axis

    report = check_axis(read_axis(file, overrides or []))
    if as_json:
        print_json(report.to_dict())
        return
    rows = [(row.key, row.value, row.origin) for row in report.rows]
    print_table(f"{report.name}: effective values", ("key", "value", "origin"), rows)
    figures = [(figure.name, figure.text, figure.formula) for figure in report.derived]
    print_table("Derived figures", ("figure", "value", "from"), figures)
    for caution in report.warnings:
        say(f"warning: {caution}", "yellow", wrong=True)
    number = len(report.warnings)
    say(f"{number} warning{'s' if number > 1 else ''}" if number else "no warnings")


@app.command()
def compare(
    file: File,
    overrides: Set = None,
    figure: Annotated[Path, option("--figure", "", FIGURE)] = Path("comparison.html"),
    *,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Compare the control method with the alternatives that it improves on: drives, pulse noise, speed feedback."""
    from detent.axis import load
    from detent.files.marks import refuse_others
    from detent.files.text import FIGURES, check_target
    from detent.page.draw import draw_figures
    from detent.page.frame import comparison_page
    from detent.page.render import write_page

    check_target(figure, (".html", *FIGURES), force=force)
    axis = load(file, overrides or [])
    with progress_bar(quiet=as_json) as progress:
        progress(0.1, "running the comparison")
        found = axis.compare(progress)
        progress(0.9, "drawing")
        if figure.suffix.lower() == ".html":
            files = [figure]
            write_page(figure, comparison_page(axis.name, found, {"axis file": axis.file.file}), force=force)
        else:
            files = [figure if k == 1 else figure.with_stem(f"{figure.stem}-{k}") for k in range(1, len(found) + 1)]
            refuse_others(files, force=force)  # before the first of them is drawn
            for one, path in zip(found, files, strict=True):
                draw_figures(one.figures(), path, force=force)
    if as_json:
        data = [{"title": one.table.title} | one.to_dict() for one in found]
        print_json({"comparisons": data, "files": [str(path) for path in files]})
        return
    for one in found:
        print_table(*one.table, right=True)
    for path in files:
        tell(f"{'page' if path.suffix.lower() == '.html' else 'figure'}: {path}")


@app.command()
def envelope(
    file: File,
    overrides: Set = None,
    motor: Annotated[str, option("--motor", "NAME", "Only this motor of the file. Default: all.")] = "",
    output: Annotated[Path | None, option("--output -o", "FOLDER", "Output folder. Default: envelope/FILE")] = None,
    *,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Write a stepper's tables: CSV, a C header with the step rule in C99, and a figure, for each motor of the file."""
    from detent.axis import load

    axis = load(file, overrides or [])
    found = axis.envelopes()
    if motor and motor not in found:
        raise DetentError(f"--motor: got {motor!r}; expected: {', '.join(found)}; name a motor of the file")
    chosen = {motor: found[motor]} if motor else found
    folder = output or Path("envelope") / file.stem
    names = [f"{name}.{kind}" for name in chosen for kind in KINDS]
    with folder_for("--output", folder, names, force=force) as made:
        for name, tables in chosen.items():
            for kind in KINDS:
                tables.save(made / f"{name}.{kind}")
    written = {name: [folder / f"{name}.{kind}" for kind in KINDS] for name in chosen}
    if as_json:
        print_json({name: chosen[name].to_dict() | {"files": [str(f) for f in written[name]]} for name in chosen})
        return
    rows = [
        (
            told["motor"],
            f"{told['steps']} steps",
            f"{told['ramp']} entries, {told['start_hz']:.4g} to {told['top_hz']:.4g} Hz",
            f"{told['run_up'] * 1e3:.4g} ms",
            f"{told['bytes']} bytes",
        )
        for told in (one.to_dict() for one in chosen.values())
    ]
    print_table(axis.name, ("motor", "travel", "ramp", "run-up", "memory"), rows)
    for path in (path for paths in written.values() for path in paths):
        tell(f"{'figure' if path.suffix == '.png' else path.suffix[1:]:<6} {path}")
