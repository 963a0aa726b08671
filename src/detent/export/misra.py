"""Rules of MISRA C:2012 that an export does not keep: a few advisory ones, each for a reason, counted by cppcheck."""

import re
import shutil
import subprocess
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from detent.errors import DetentError

TOOL, PACKAGE = "cppcheck", "cppcheck"
DEVIATIONS = {
    "2.5": "version and hashes in the header are for the application, which need not use them",
    "8.7": "an entry is there for the application, and may be called by another entry",
    "8.9": "the parameters of the axis file are a constant of a file of its own: an application may have others",
    "15.5": "a step has several returns; its function in C has the same",
    "17.8": "a step may assign to its parameter; its function in C does the same",
}
"""Advisory rules that an export may break, and why."""
STATED = "-DUINT32_C(x)=x##U", "-DUINT64_C(x)=x##ULL"  # of stdint.h, which it does not read
UNREADABLE = (": syntaxError", ": internalError", ": preprocessorErrorDirective")
FOUND = re.compile(r"^(.*?):(\d+): misra-c2012-(\S+)$")


@dataclass(frozen=True)
class Finding:
    """A place that breaks a rule."""

    file: str
    line: int
    rule: str  # such as 15.5

    @property
    def is_deviation(self) -> bool:
        """True for a rule of the list."""
        return self.rule in DEVIATIONS


def missing() -> str:
    """What is not installed; empty where it is there."""
    return "" if shutil.which(TOOL) else f"{TOOL} (Debian: apt install {PACKAGE})"


def findings(folder: str | Path, name: str) -> list[Finding]:
    """Places of an export that break a rule of MISRA C:2012, as far as cppcheck knows these rules, by file and line.

    The sources that become firmware are looked at, with the hash of the registers and the self-test, for a processor of
    32 bits, in every configuration that they have; the programs that prove them are not. `folder` is what
    `export_firmware` wrote, `name` the prefix of all names in C. A DetentError says that there is no cppcheck, or what
    it could not read.
    """
    place = Path(folder)
    if missing():
        raise DetentError(f"got no {TOOL}; expected: it on the path; try: apt install {PACKAGE}")
    names = (f"{name}{part}.c" for part in ("", "_params", "_tables", "_image", "_selftest"))
    files = [file for file in names if (place / file).is_file()]
    command = [
        TOOL, "--addon=misra", "--std=c99", "--platform=unix32", "--force", "--quiet", "--error-exitcode=0",
        "--suppress=missingIncludeSystem", "--template={file}:{line}: {id}", *STATED, *files,
    ]  # fmt: skip
    done = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False)  # noqa: S603 - found on the path
    lines = (done.stdout + done.stderr).splitlines()
    refused = [line for line in lines if line.endswith(UNREADABLE)]
    if done.returncode or refused:
        raise DetentError(f"{TOOL}: got {(refused or lines or ['no word'])[-1]}; expected: sources that it can read")
    found = {Finding(one[1], int(one[2]), one[3]) for line in lines if (one := FOUND.match(line))}
    return sorted(found, key=lambda one: (one.file, one.line, one.rule))


def tallied(found: Iterable[Finding]) -> dict[str, int]:
    """How many places break each rule."""
    return dict(sorted(Counter(one.rule for one in found).items(), key=lambda one: [*map(int, one[0].split("."))]))
