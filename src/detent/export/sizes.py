"""What a build takes of a processor, from its objects and its machine code: flash, memory, stack, library."""

import re
import subprocess
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

HEAD = re.compile(r"^([0-9a-f]+) <([^>]+)>:$")
LINE = re.compile(r"^\s*([0-9a-f]+):\t[0-9a-f ]+\t(\S+)\s*(.*)$")
PUSHED = re.compile(r"\{([^}]*)\}")
LOWERED = (
    (("sub", "sub.w", "subw"), re.compile(r"^sp, (?:sp, )?#(\d+)")),
    (("str.w", "str", "strd"), re.compile(r"\[sp, #-(\d+)\]!")),
    (("addi", "add"), re.compile(r"^sp,sp,-(\d+)")),  # RISC-V
)
LITERAL = re.compile(r"^\s*([0-9a-f]+):\t[0-9a-f ]+\t\.word\s+0x([0-9a-f]+)", re.MULTILINE)
LOADED = (
    ("ldr", re.compile(r"^(\w+), \[pc, #\d+\]\s*[;@] \(([0-9a-f]+)")),  # from among the literals
    ("lui", re.compile(r"^(\w+),0x([0-9a-f]+)")),  # RISC-V: the upper 20 bits
)
BY_REGISTER = re.compile(r"^sp,(?: ?sp,)? ?([a-z]\w+)$")
OF_AVR = re.compile(r"^(r\d+), (0x[0-9A-Fa-f]+|r1)")
FILLING = ("nop", "unimp")
LEAVES = ("b", "b.n", "b.w", "bx", "j", "jr", "jmp", "rjmp", "ret", "reti", "mret", "udf", "tail")


@dataclass(frozen=True)
class Sizes:
    """Of one build, in bytes."""

    code: int = 0  # of the unit, without the compiler's library
    constants: int = 0
    written: int = 0  # .data and .bss of it: 0
    parameters: int = 0  # without tables
    tables: int = 0  # arrays among the parameters
    memory: int = 0  # of one instance: controller and lines
    stack: Mapping[str, int] = field(default_factory=dict[str, int])
    """Of each entry with all that it calls, the compiler's library too."""
    library: Mapping[str, int] = field(default_factory=dict[str, int])
    """Code of each routine that it needs of the compiler's library, or of libm."""

    @property
    def flash(self) -> int:
        """Code and constants of the unit alone."""
        return self.code + self.constants


@dataclass
class Routine:
    """A symbol of a program: what it takes of the stack at most, what it calls or goes on in."""

    begin: int
    end: int = 0
    frame: int = 0
    calls: set[str] = field(default_factory=set[str])


class _Frame:
    """What the instructions of one routine take of the stack, in their order; `back` is what a call leaves there."""

    def __init__(self, literals: Mapping[int, int], back: int) -> None:
        self._literals, self._back = literals, back
        self._held: dict[str, int] = {}  # numbers that registers hold
        self._laid = self._area = 0  # arguments on the stack of an AVR: now, and at most

    def taken(self, word: str, rest: str) -> int:
        """Bytes by which an instruction lowers the stack pointer."""
        if self._back:
            return self._taken_by_avr(word, rest)
        by = BY_REGISTER.match(rest) if word == "add" else None
        if by and by[1] in self._held:
            number = self._held[by[1]]
            return (1 << 32) - number if number >> 31 else 0
        self._held.pop(rest.partition(",")[0], None)
        for loads, pattern in LOADED:
            told = pattern.match(rest) if word == loads else None
            if told:
                number = int(told[2], 16)
                self._held[told[1]] = self._literals.get(number, 0) if word == "ldr" else number << 12
        return _taken(word, rest)

    def _taken_by_avr(self, word: str, rest: str) -> int:
        """Of an AVR: what is pushed, and what a copy of the pointer loses; in r28 and r29 that is the frame."""
        if word == "push":
            return 1
        if word == "rcall" and rest.startswith(".+0"):
            return self._back
        told = OF_AVR.match(rest)
        if word == "in" and told and told[2].lower() == "0x3d":
            self._held = {told[1]: 0}  # a copy of the stack pointer: what it has lost so far
        elif word == "out":
            return self._put_back(rest)
        elif told and told[1] in self._held and word in ("subi", "sbiw", "adiw"):
            self._held[told[1]] = int(told[2], 16) * (-1 if word == "adiw" else 1)
        elif told and word == "sbci":
            low = f"r{int(told[1][1:]) - 1}"
            if low in self._held:
                lost = int(told[2], 16) << 8 | self._held[low]
                self._held[low] = lost - (1 << 16) if lost >> 15 else lost
        return 0

    def _put_back(self, rest: str) -> int:
        """A copy of an AVR's stack pointer becomes the pointer again: the frame, or arguments that get no register.

        Those of several calls are taken away together; they count as many as are there at once.
        """
        told = re.match(r"0x3d, (r\d+)", rest, re.IGNORECASE)
        low = told[1] if told else ""
        if low not in self._held:
            return 0
        lost = self._held.pop(low)
        if low == "r28":
            return max(0, lost)
        self._laid = max(0, self._laid + lost)
        more, self._area = max(0, self._laid - self._area), max(self._area, self._laid)
        return more


def routines(listing: str, back: int = 0) -> dict[str, Routine]:
    """Every routine of a program, from its machine code as ``objdump -d`` lists it.

    What a routine takes of the stack is the sum of all that it pushes or makes room for, wherever it does so: at least
    what any way through it takes. One that does not leave at its end goes on in the next. Where a call itself leaves
    something on the stack, `back` is how much [byte]; so far that is an AVR.
    """
    found: dict[str, Routine] = {}
    literals = {int(at, 16): int(value, 16) for at, value in LITERAL.findall(listing)}
    name, last, frame = "", "", _Frame(literals, back)
    for line in listing.splitlines():
        head = HEAD.match(line)
        if head:
            begin = int(head[1], 16)
            if name:
                found[name].end = begin
                if not _leaves(last):
                    found[name].calls.add(head[2])
            name, last, frame = head[2], "", _Frame(literals, back)
            found[name] = Routine(begin, frame=back)
            continue
        told = LINE.match(line)
        if not told or not name:
            continue
        word, rest, one = told[2], told[3], found[name]
        one.end = int(told[1], 16) + 2
        if word[0] == "." or word in FILLING:
            continue
        last = f"{word} {rest}"
        one.frame += frame.taken(word, rest)
        target = re.search(r"<([^>+]+)", rest)
        if target and word[0] in "bjctr" and target[1] != name:
            one.calls.add(target[1])
    return found


def _leaves(line: str) -> bool:
    word, _, rest = line.partition(" ")
    return not line or word in LEAVES or (word.startswith(("pop", "ldm")) and "pc}" in rest)


def _taken(word: str, rest: str) -> int:
    """Bytes by which an instruction lowers the stack pointer."""
    if word.startswith(("push", "vpush")) or (word.startswith("stmdb") and rest.startswith("sp!")):
        listed = PUSHED.search(rest)
        return sum(_pushed(one.strip()) for one in listed[1].split(",")) if listed else 0
    for words, pattern in LOWERED:
        lowered = pattern.search(rest) if word in words else None
        if lowered:
            return int(lowered[1])
    return 0


def _pushed(registers: str) -> int:
    """Bytes of a register, or of a range of them."""
    first, _, last = registers.partition("-")
    size = 8 if first[0] == "d" else 4
    return size * (int(last[1:]) - int(first[1:]) + 1) if last else size


def deepest(name: str, known: Mapping[str, Routine], path: tuple[str, ...] = ()) -> int:
    """Stack of a routine with all that it calls; there is no recursion (FW06), so what returns to `path` is a jump."""
    one = known.get(name)
    if one is None or name in path:
        return 0
    return one.frame + max((deepest(each, known, (*path, name)) for each in sorted(one.calls)), default=0)


def reached(names: Iterable[str], known: Mapping[str, Routine]) -> dict[str, int]:
    """Bytes of these routines, and of all that they call."""
    waiting, found = [one for one in names if one in known], dict[str, int]()
    for name in waiting:
        if name not in found:
            found[name] = known[name].end - known[name].begin
            waiting += [one for one in known[name].calls if one in known]
    return dict(sorted(found.items()))


def sizes_of(  # noqa: PLR0913 - by which tools, of what
    tools: str, work: Path, entries: Iterable[str], program: str = "", tables: int = 0, back: int = 0
) -> Sizes:
    """Of the objects in a folder and of the program with them, by the binutils whose names begin with `tools`."""
    sections = {
        words[0]: int(words[1])
        for words in (line.split() for line in _told([f"{tools}size", "-A", "unit.o"], work).splitlines())
        if len(words) == 3 and words[1].isdigit()
    }
    if not sections:
        return Sizes()
    symbols = _symbols(tools, "params.o", work) | _symbols(tools, "replay.o", work)
    apart = sum(_symbols(tools, "tables.o", work).values())
    needed = [line.split()[-1] for line in _told([f"{tools}nm", "-u", "unit.o"], work).splitlines()]
    told = _told([f"{tools}readelf", "-sW", program], work) if program else ""
    data = {words[7] for words in (line.split() for line in told.splitlines()) if words[3:4] == ["OBJECT"]}
    listing = _told([f"{tools}objdump", "-d", program], work) if program else ""
    known = {name: one for name, one in routines(listing, back).items() if name not in data}
    defaults = next((size for name, size in symbols.items() if name.endswith("_defaults")), 0)

    def whole(*kinds: str) -> int:
        return sum(size for name, size in sections.items() if name.startswith(kinds))

    return Sizes(
        whole(".text"), whole(".rodata", ".srodata"), whole(".data", ".bss", ".sdata", ".sbss"),
        defaults - tables if defaults else 0, tables + apart, symbols.get("c_", 0) + symbols.get("l_", 0),
        {one: deepest(one, known) for one in entries if one in known}, reached(needed, known),
    )  # fmt: skip


def _symbols(tools: str, part: str, work: Path) -> dict[str, int]:
    """Bytes of each symbol of an object; none where it is not there."""
    lines = _told([f"{tools}nm", "-S", part], work).splitlines() if (work / part).is_file() else []
    return {words[3]: int(words[1], 16) for words in map(str.split, lines) if len(words) == 4}


def _told(command: list[str], work: Path) -> str:
    return subprocess.run(command, cwd=work, capture_output=True, text=True, check=False).stdout  # noqa: S603 - binutils
