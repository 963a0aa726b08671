"""`detent new` and `detent keys`: an axis file to start from, and what an axis file may say."""

import shlex
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from detent.cli.app import Force, Json, Set, app, option, unknown_method
from detent.cli.terminal import print_json, print_table, tell
from detent.errors import DetentError

if TYPE_CHECKING:
    from detent.files.keys import KeyRow

NAME = typer.Argument(help="Control method; `detent keys` lists them.", show_default=False)
NEW = "The file to create. Default: METHOD.toml"
SEARCH = "Only keys whose name, unit, range, default or meaning contains this word."
ABOUT = "Control method, or an axis file that uses it (a rotary axis has its own units). Default: every method."


@app.command()
def new(
    method: Annotated[str, NAME],
    file: Annotated[Path | None, typer.Argument(help=NEW, show_default=False)] = None,
    overrides: Set = None,
    *,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Write an axis file to start from: every key with its unit, range, default and meaning; it is valid and runs."""
    from detent.files.text import check_target, write_text
    from detent.methods.registry import METHODS
    from detent.methods.start import starting_axis

    if method not in METHODS:
        raise unknown_method("new", method)
    target = check_target(file or Path(f"{method}.toml"), (".toml",), "an axis file", force=force)
    if target.exists() and not force:  # one that detent wrote, such as what was identified, is no place to begin at
        raise DetentError(f"{target}: it is there already; nothing was written; choose another name, or add --force")
    write_text(target, starting_axis(METHODS[method], target, overrides or []), force=force)
    if as_json:
        print_json({"method": method, "files": [str(target)]})
        return
    name = shlex.quote(str(target))
    tell(f"Wrote {target}. Next: detent check {name}, then detent run {name} --job JOB.")
    tell(f"Its jobs: {METHODS[method].jobs}; `detent examples` lists some.")


@app.command()
def keys(
    method: Annotated[str, typer.Argument(help=ABOUT)] = "",
    search: Annotated[str, option("--search", "WORD", SEARCH)] = "",
    *,
    as_json: Json = False,
) -> None:
    """List what an axis file may say: every key with its unit, range, default and meaning."""
    found = _keys(method)
    known = {row.key.rpartition(".")[2] for rows in found.values() for row in rows}
    found = {title: [row for row in rows if row.holds(search)] for title, rows in found.items()}
    if not any(found.values()):
        from detent.files.text import did_you_mean

        remedy = did_you_mean(search, known, "use a shorter word, or omit --search to list all keys")
        raise DetentError(f"--search: got {search!r}, which matches no key; {remedy}")
    if as_json:
        print_json([{"method": name} | asdict(row) for name, rows in found.items() for row in rows])
        return
    for title, rows in found.items():
        heads = ("key", "SI unit", "default", "allowed values", "meaning")
        cells = [(r.key, r.unit, "needed" if r.required else r.default or "none", r.allowed, r.doc) for r in rows]
        if cells:
            print_table(title, heads, cells)


def _keys(word: str) -> "dict[str, tuple[KeyRow, ...]]":
    """Keys of the files to tell of, by the name of the method; those that only an axis that turns has at the end."""
    from detent.files.keys import key_rows, own_rows
    from detent.methods.registry import METHODS

    if not word or word in METHODS:
        methods = [METHODS[word]] if word else METHODS.usable()
        return {one.name: key_rows(one.spec) + own_rows(one.rotary or one.spec, one.spec) for one in methods}
    if not Path(word).exists():
        raise unknown_method("keys", word, "an axis file")
    from detent.methods.load import load_spec

    spec = load_spec(word)
    return {spec.axis.method: key_rows(type(spec))}
