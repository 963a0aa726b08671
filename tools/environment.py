"""Make the environment that the Makefile's commands run in, or leave it alone when it is already right.

    python3 tools/environment.py [--chosen] FOLDER [EXTRA]

FOLDER gets a virtual environment with detent (editable) and the dependencies of EXTRA (`test` or `dev`, see
pyproject.toml). A note inside it says for which pyproject.toml, which interpreter and which place it was made; while
that is unchanged nothing is asked of pip, so the commands also work without a network. An environment that could not
be finished is removed. One that was there before, made by a person, is used and never removed.

`--chosen` says that the person named the interpreter: an environment of another Python version is then made anew.
"""

from __future__ import annotations  # the Pythons that this script refuses must be able to read it

import contextlib
import fcntl
import hashlib
import json
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TextIO

OLDEST_PYTHON = (3, 11)
NOTE = "detent-environment.json"
# What the larger set of dependencies holds besides itself.
INCLUDES = {"": {""}, "test": {"", "test"}, "dev": {"", "test", "dev"}}


def main(arguments: list[str]) -> int:
    """Bring the environment to what was asked; return the exit status."""
    chosen = "--chosen" in arguments
    places = [a for a in arguments if not a.startswith("--")]
    if not 1 <= len(places) <= 2 or places[1:] not in ([], ["test"], ["dev"]):
        print(__doc__, file=sys.stderr)
        return 2
    trouble = missing_parts()
    if trouble:
        print(trouble, file=sys.stderr)
        return 2
    folder, extra = Path(places[0]), (places[1:] or [""])[0]
    with alone(folder) as record:
        if record.read():  # an earlier run was killed while it made the environment
            discard(folder, record, fresh=True)
        remove_unusable(folder, chosen=chosen)
        return 0 if extra in installed(folder) or finished(folder, record, extra) else 2


def finished(folder: Path, record: TextIO, extra: str) -> bool:
    """Make the environment; remove what this run began and could not finish. Tell whether it is there."""
    fresh = not folder.exists()
    try:
        done = make(folder, record, extra, fresh=fresh)
    except BaseException:  # an interrupt leaves a half-made environment behind just as a failure does
        discard(folder, record, fresh=fresh)
        raise
    if not done:
        discard(folder, record, fresh=fresh)
    return done


@contextlib.contextmanager
def alone(folder: Path) -> Iterator[TextIO]:
    """Wait until no other run works on the environment; yield the record of what is unfinished (empty: nothing)."""
    with folder.with_name(folder.name + ".lock").open("a+", encoding="utf-8") as record:
        try:
            fcntl.flock(record, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            print(f"Another command prepares {folder}; waiting for it ...", flush=True)
            fcntl.flock(record, fcntl.LOCK_EX)
        record.seek(0)
        yield record


def missing_parts() -> str:
    """Say what this interpreter lacks and where to get it; empty when nothing is missing."""
    have = "%d.%d.%d" % sys.version_info[:3]  # noqa: UP031 - this line must run on the Pythons that it refuses
    if sys.version_info[:2] < OLDEST_PYTHON:
        return (
            "detent needs Python 3.11 or newer; " + sys.executable + " is " + have + ". "
            "Name a newer one: make demo PYTHON=python3.12"
        )
    for module in ("venv", "ensurepip"):
        try:
            __import__(module)
        except ImportError:
            return (
                "this Python (" + sys.executable + ", " + have + ") came without the module `" + module + "`, "
                "which makes virtual environments. Debian and Ubuntu: apt install python3-venv. "
                "Elsewhere: install Python from python.org or name another one: make demo PYTHON=python3.12"
            )
    return ""


def interpreter(folder: Path) -> Path:
    """Return the environment's own Python."""
    return folder / "bin" / "python"


def version_inside(folder: Path) -> tuple[int, ...] | None:
    """Return the version (3, 11) of the environment's Python; None where it does not start."""
    question = "import sys; print(*sys.version_info[:2])"
    try:
        answer = subprocess.run(
            [str(interpreter(folder)), "-c", question], capture_output=True, text=True, check=True
        ).stdout
    except (OSError, subprocess.CalledProcessError):
        return None
    return tuple(int(n) for n in answer.split())


def note_of(folder: Path) -> dict[str, Any]:
    """Return what an earlier run noted about the environment; empty where none finished there."""
    try:
        return json.loads((folder / NOTE).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}


def remove_unusable(folder: Path, *, chosen: bool) -> None:
    """Remove an environment of ours that cannot serve any more."""
    note = note_of(folder)
    if not note.get("ours"):
        return
    inside = version_inside(folder)
    # Scripts inside an environment hold its absolute path, so it does not survive a move of the project.
    moved = note["place"] != str(folder.resolve())
    if inside is None or moved or (chosen and inside != sys.version_info[:2]):
        print(f"{folder} was made for another place or another Python: making it anew.")
        shutil.rmtree(folder)


def wanted() -> str:
    """Return a key of everything in pyproject.toml that pip acts upon."""
    import tomllib  # absent from the Pythons that `missing_parts` refuses

    settings = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))
    acted_upon = [settings["build-system"], settings["project"], settings["tool"].get("hatch")]
    return hashlib.sha256(json.dumps(acted_upon, sort_keys=True).encode()).hexdigest()


def installed(folder: Path) -> set[str]:
    """Return the sets of dependencies that the environment holds for the present pyproject.toml."""
    note = note_of(folder)
    same = note.get("wanted") == wanted() and note.get("place") == str(folder.resolve())
    return INCLUDES[note["extra"]] if same else set()


def make(folder: Path, record: TextIO, extra: str, *, fresh: bool) -> bool:
    """Create the environment if need be and install; tell whether all went well."""
    started = time.monotonic()
    before = note_of(folder)
    # What was installed for an older pyproject.toml is still there: keep its further dependencies up to date as well.
    extra = max(extra, before.get("extra", ""), key=lambda name: len(INCLUDES[name]))
    if before:
        (folder / NOTE).write_text(json.dumps({**before, "wanted": "not yet installed"}), encoding="utf-8")
    if fresh:
        record.write("unfinished")
        record.flush()
        if subprocess.run([sys.executable, "-m", "venv", str(folder)], check=False).returncode:
            print(f"{sys.executable} could not make the environment {folder}; see above.", file=sys.stderr)
            return False
    elif version_inside(folder) is None:
        print(f"{folder} holds no Python that starts, and was not made here: remove it and try again.", file=sys.stderr)
        return False
    target = f".[{extra}]" if extra else "."
    print(f"Installing detent and what it needs into {folder} (at first 0.5 GB, a minute or two) ...", flush=True)
    pip = [str(interpreter(folder)), "-m", "pip", "--disable-pip-version-check", "--no-input"]
    if subprocess.run([*pip, "install", "--quiet", "--editable", target], check=False).returncode:
        print(
            "pip could not install detent; its reasons stand above. Installing needs the package index (or a mirror "
            "that pip is set up for) once; after that the commands work without a network.",
            file=sys.stderr,
        )
        return False
    note = {
        "wanted": wanted(),
        "extra": extra,
        "place": str(folder.resolve()),
        "ours": fresh or before.get("ours", False),
    }
    (folder / NOTE).write_text(json.dumps(note), encoding="utf-8")
    record.truncate(0)
    print(f"{folder} is ready ({time.monotonic() - started:.0f} s).")
    return True


def discard(folder: Path, record: TextIO, *, fresh: bool) -> None:
    """Remove an environment that was begun here; one that existed before stays."""
    if fresh:
        shutil.rmtree(folder, ignore_errors=True)
        record.truncate(0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
