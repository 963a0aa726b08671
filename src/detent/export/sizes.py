"""What an export takes of a processor: flash, memory, stack, and what the compiler must bring with its library."""

import re
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

NODE = re.compile(r'node: \{ title: "(?:[^"]*:)?([^":]+)" label: "[^"]*?(?:\\n(\d+) bytes \((\w+)\))?"')
EDGE = re.compile(r'edge: \{ sourcename: "(?:[^"]*:)?([^":]+)" targetname: "(?:[^"]*:)?([^":]+)"')


@dataclass(frozen=True)
class Sizes:
    """Of one build, in bytes."""

    flash: int = 0  # code and constants of the unit, without parameters and the compiler's library
    written: int = 0  # .data and .bss of it: 0
    parameters: int = 0
    memory: int = 0  # of one instance: controller and lines
    stack: Mapping[str, int] = field(default_factory=dict[str, int])
    """Of each entry with all that it calls, without the compiler's library; empty where the compiler does not tell."""
    library: tuple[str, ...] = ()  # routines of the compiler's library, and of libm


def stacks(graph: str, entries: Sequence[str]) -> dict[str, int]:
    """Deepest stack of each entry [byte], from the call graph that gcc writes with ``-fcallgraph-info=su``.

    A routine of the library counts 0: the graph knows only its name. There is no recursion (FW06).
    """
    own = {name: int(size or 0) for name, size, _ in NODE.findall(graph)}
    calls: dict[str, set[str]] = {}
    for caller, callee in EDGE.findall(graph):
        calls.setdefault(caller, set()).add(callee)

    def deepest(name: str) -> int:
        """Of a function and what it calls."""
        return own.get(name, 0) + max((deepest(one) for one in sorted(calls.get(name, ()))), default=0)

    return {name: deepest(name) for name in entries if name in own}


def sizes_of(tools: str, work: Path, entries: Sequence[str]) -> Sizes:
    """Of the objects in a folder, by the binutils whose names begin with `tools`."""
    said = _told([f"{tools}size", "unit.o"], work).splitlines()
    if len(said) < 2:
        return Sizes()
    text, data, bss = (int(word) for word in said[1].split()[:3])
    symbols = {
        words[3]: int(words[1], 16)
        for part in ("params.o", "replay.o")
        for words in (line.split() for line in _told([f"{tools}nm", "-S", part], work).splitlines())
        if len(words) == 4
    }
    needed = [line.split()[-1] for line in _told([f"{tools}nm", "-u", "unit.o"], work).splitlines()]
    graph = work / "unit.ci"
    return Sizes(
        text, data + bss,
        next((size for name, size in symbols.items() if name.endswith("_defaults")), 0),
        symbols.get("c_", 0) + symbols.get("l_", 0),
        stacks(graph.read_text(encoding="utf-8"), entries) if graph.is_file() else {},
        tuple(sorted(needed)),
    )  # fmt: skip


def _told(command: list[str], work: Path) -> str:
    return subprocess.run(command, cwd=work, capture_output=True, text=True, check=False).stdout  # noqa: S603 - binutils
