"""The tables of the reference, as `detent docs` prints them, and of what was tried: written at every build.

The pages in docs/reference and docs/explanation include them from docs/_build/generated.
"""

import tomllib
from functools import partial
from pathlib import Path

from detent.cli.docs import PAGES, code, table

GENERATED = Path(__file__).resolve().parent / "_build" / "generated"

ATTACKS = {
    "kill": "Killed, interrupted, two at once",
    "disk": "Full disks",
    "cache": "Damaged caches",
    "text": "Hostile text",
    "reader": "Fuzzed inputs",
    "bound": "Boundaries and long idle",
    "store": "The store of a live axis",
}
"""Kinds of `docs/tried.toml`, in the order of the page."""


def tried(*kinds: str) -> str:
    """What was tried against detent: a table of each kind that was, or of these."""
    attacks = tomllib.loads((Path(__file__).parent / "tried.toml").read_text(encoding="utf-8"))["attack"]
    parts: list[str] = []
    for kind, title in ATTACKS.items():
        if kinds and kind not in kinds:
            continue
        rows = [(a["what"], f"{a['times']:,}", a["outcome"], code(a["test"])) for a in attacks if a["kind"] == kind]
        if rows:
            parts.append(f"### {title}\n\n{table(('attacked', 'times', 'every time', 'test'), rows)}")
    return "\n".join(parts)


def write_all(folder: Path = GENERATED) -> None:
    """Write every page whose text has changed."""
    folder.mkdir(parents=True, exist_ok=True)
    pages = {**PAGES, "what-was-tried": tried, "what-survives": partial(tried, "store")}
    for name, make in pages.items():
        target, text = folder / f"{name}.md", make()
        if not target.exists() or target.read_text(encoding="utf-8") != text:
            target.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    write_all()
