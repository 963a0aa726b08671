"""`detent check`: an axis file looked over."""

from detent.cli.app import File, Json, Set, app
from detent.cli.terminal import make_console, print_json, print_table


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
