"""`detent examples` and `detent registers`: what there is to start from, and what can be recorded."""

import shlex
from pathlib import Path
from typing import Annotated, Any

import typer

from detent import examples
from detent.cli.app import Json, app
from detent.cli.terminal import folder_for, print_json
from detent.errors import DetentError


@app.command("examples")
def examples_command(
    copy: Annotated[
        Path | None, typer.Option("--copy", metavar="FOLDER", help="Copy all examples into this folder.")
    ] = None,
    *,
    as_json: Json = False,
) -> None:
    """List the packaged example files, or copy them to start from."""
    found = examples() if copy is None else _copy_examples(examples(), copy)
    if as_json:
        print_json([{"name": path.name, "path": str(path), "about": _about(path)} for path in found])
        return
    for path in found:
        print(f"{path.name:<20} {_about(path)}")
    if copy is None:
        print("\nCopy them with: detent examples --copy FOLDER")
    else:
        axis, job = (shlex.quote(str(copy / name)) for name in ("print_head.toml", "letter.txt"))
        print(f"\nCopied to {copy}. Try: detent run {axis} --job {job}")


def _copy_examples(found: list[Path], folder: Path) -> list[Path]:
    import shutil

    with folder_for("--copy", folder):
        existing = [path.name for path in found if (folder / path.name).exists()]
        if existing:
            told = f"it holds {', '.join(existing)} already; nothing was copied; choose another folder"
            raise DetentError(f"--copy {folder}: {told}")
        return [Path(shutil.copyfile(path, folder / path.name)) for path in found]


def _about(path: Path) -> str:
    """First comment line of an axis file or a list of moves; what kind of job the others are."""
    if path.suffix in {".toml", ".csv"}:
        return path.read_text(encoding="utf-8").splitlines()[0].lstrip("# ")
    return "print job, Diablo 630 stream" if path.suffix == ".prn" else "print job, plain text"


@app.command("registers")
def registers_command(
    method: Annotated[
        str, typer.Argument(help="Control method, or an axis file of it.", show_default=True)
    ] = "print_head",
    *,
    as_json: Json = False,
) -> None:
    """List every register of an axis: what --signals can record."""
    rows = [
        {"name": leaf.path, "width": leaf.width.code, "unit": leaf.unit, "doc": leaf.doc, "by": leaf.by}
        for leaf in _registers_of(method).leaves()
        if not leaf.length
    ]
    if as_json:
        print_json(rows)
        return
    for row in rows:
        writer = f" (written by the {row['by']})" if row["by"] else ""
        print(f"{row['name']:<36} {row['width']:<3} {row['unit']:<14} {row['doc']}{writer}")


def _registers_of(method: str) -> Any:
    """Class of the state of a method, named itself or by an axis file."""
    from detent.methods.registry import METHODS

    if method in METHODS:
        return METHODS[method].registers()
    if not Path(method).exists():
        allowed = ", ".join(METHODS)
        raise DetentError(f"registers: came {method!r}; allowed: {allowed}, or an axis file; name one of these")
    from detent.axis import load

    return load(method).simulated.registers
