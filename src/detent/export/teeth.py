"""What the vectors of an export do not reach, and what they would not have noticed: branches not taken, and mutants."""

import gzip
import json
import random
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from detent.export.code import FLAGS
from detent.export.write import read_manifest

SEED = 7  # of the choice of mutants
TIMEOUT = 30.0  # of one of them [s]: a loop that does not end is found
HOST = f"{FLAGS} -w -DON_HOST -I."
CHANGES = (
    (r" < ", " <= "), (r" > ", " >= "), (r" <= ", " < "), (r" >= ", " > "), (r" == ", " != "), (r" != ", " == "),
    (r" \+ ", " - "), (r" - ", " + "), (r" \* ", " + "), (r" && ", " || "), (r" \|\| ", " && "),
    (r"(?<=_wrap_)add(?=_)", "sub"), (r"(?<=_wrap_)sub(?=_)", "add"), (r"(?<=_wrap_)mul(?=_)", "add"),
    (r"(?<=[ (])(\d+)(?=U?[;)])", None),
)  # fmt: skip
"""Relations, signs, and/or, constants by one (None)."""


@dataclass(frozen=True)
class Outcome:
    """A branch of a line that was never taken."""

    line: int
    text: str
    way: int  # of the ways that the line goes on


@dataclass(frozen=True)
class Reach:
    """What all vectors together reach of the steps of a unit."""

    outcomes: int
    missed: tuple[Outcome, ...]
    lines: int
    missed_lines: tuple[int, ...]

    @property
    def share(self) -> float:
        """Branch outcomes taken [%]."""
        return 100.0 * (1.0 - len(self.missed) / self.outcomes) if self.outcomes else 100.0


@dataclass(frozen=True)
class Mutant:
    """One small change of the C."""

    line: int
    text: str
    becomes: str
    found: str  # by which vectors; empty where they were equal all the same


def step_lines(folder: Path, name: str) -> list[tuple[int, int]]:
    """First and last line of every function that is a step, in NAME.c."""
    code = (folder / f"{name}.c").read_text(encoding="utf-8").splitlines()
    rows = (folder / "trace.csv").read_text(encoding="utf-8").splitlines()[1:]
    found: list[tuple[int, int]] = []
    for row in rows:
        first = int(row.split(",")[1])
        found.append((first, next(k for k in range(first, len(code)) if code[k] == "}") + 1))
    return sorted(found)


def _programs(folder: Path, name: str) -> dict[str, str]:
    """Sources of the two programs by the vectors that they replay."""
    tables = f"{name}_tables.c" if (folder / f"{name}_tables.c").is_file() else ""
    rest = f"{name}_params.c {tables} {name}_image.c board.c"
    return {"drawn": f"{name}_drawn.c {rest}", "job": f"{name}.c {name}_replay.c {name}_selftest.c {rest}"}


def _copy(folder: Path, made: str) -> Path:
    place = Path(made) / "unit"
    shutil.copytree(folder, place)
    return place


def _run(command: str, place: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(  # noqa: S603 - our own words, on a copy of the export
        command.split(), cwd=place, capture_output=True, text=True, errors="replace", check=False, timeout=TIMEOUT
    )


def reach(folder: Path) -> Reach:
    """Branch outcomes and lines of the steps that the vectors reach, by gcc and gcov (Debian: apt install gcc)."""
    name = str((read_manifest(folder) or {})["name"])
    ranges = step_lines(folder, name)
    taken: dict[tuple[int, int], int] = {}
    lines: dict[int, int] = {}
    for vectors, sources in _programs(folder, name).items():
        with tempfile.TemporaryDirectory() as made:
            place = _copy(folder, made)
            subprocess.run(  # noqa: S603 - as above; nothing is optimised away
                ["gcc", *HOST.split(), "-O0", "--coverage", *sources.split(), "-o", "unit", "-lm"],  # noqa: S607
                cwd=place, check=True, capture_output=True,
            )  # fmt: skip
            subprocess.run([place / "unit", f"vectors/{vectors}.vec"], cwd=place, check=True, capture_output=True)  # noqa: S603
            subprocess.run(["gcov", "-b", "-c", "-j", *sorted(one.name for one in place.glob("*.gcda"))],  # noqa: S603, S607
                           cwd=place, check=True, capture_output=True)  # fmt: skip
            for line in _lines_of(place, f"{name}.c"):
                number = int(line["line_number"])
                if any(first <= number <= last for first, last in ranges):
                    lines[number] = lines.get(number, 0) + int(line["count"])
                    for way, one in enumerate(line["branches"]):
                        taken[number, way] = taken.get((number, way), 0) + int(one["count"])
    code = (folder / f"{name}.c").read_text(encoding="utf-8").splitlines()
    missed = tuple(Outcome(n, code[n - 1].strip(), way) for (n, way), count in sorted(taken.items()) if count == 0)
    return Reach(len(taken), missed, len(lines), tuple(n for n, count in sorted(lines.items()) if count == 0))


def _lines_of(place: Path, name: str) -> Iterator[dict[str, Any]]:
    for file in sorted(place.glob("*.gcov.json.gz")):
        for one in json.loads(gzip.decompress(file.read_bytes()))["files"]:
            if Path(one["file"]).name == name:
                yield from one["lines"]


def sites(folder: Path, name: str) -> list[tuple[int, int, str]]:
    """Every place of NAME.c where one thing can be changed: begin, end, and what stands there then."""
    text = (folder / f"{name}.c").read_text(encoding="utf-8")
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    found: list[tuple[int, int, str]] = []
    for first, last in step_lines(folder, name):
        begin, end = starts[first], starts[last]
        for pattern, other in CHANGES:
            matches = re.compile(pattern).finditer(text, begin, end)
            found.extend((one.start(), one.end(), other or str(int(one[0]) + 1)) for one in matches)
    return sorted(found)


def mutants(
    folder: Path, most: int, progress: Callable[[float, str], None] = lambda _share, _text: None
) -> list[Mutant]:
    """Change one thing of the C at a time, at `most` places, and see by which vectors that is found."""
    name = str((read_manifest(folder) or {})["name"])
    text = (folder / f"{name}.c").read_text(encoding="utf-8")
    places = sites(folder, name)
    chosen = sorted(random.Random(SEED).sample(places, min(most, len(places))))  # noqa: S311 - a choice, no secret
    found: list[Mutant] = []
    with tempfile.TemporaryDirectory() as made:
        place = _copy(folder, made)
        for k, (begin, end, other) in enumerate(chosen):
            progress(k / len(chosen), f"mutant {k + 1} of {len(chosen)}")
            (place / f"{name}.c").write_text(text[:begin] + other + text[end:], encoding="utf-8")
            line = text.count("\n", 0, begin) + 1
            whole = text.splitlines()[line - 1].strip()
            found.append(Mutant(line, whole, other.strip(), _found_by(place, name)))
    return found


def _found_by(place: Path, name: str) -> str:
    """The vectors that a changed unit differs in; empty for none."""
    for vectors, sources in _programs(place, name).items():
        if _run(f"gcc {HOST} -O1 {sources} -o unit -lm", place).returncode:
            return "compiler"
        try:
            if _run(f"./unit vectors/{vectors}.vec", place).returncode:
                return vectors
        except subprocess.TimeoutExpired:
            return vectors
    return ""
