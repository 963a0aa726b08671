"""What register files hold, and where two of them differ."""

from typing import Any

from detent.kernel.registers import Registers


def values_of(registers: Registers) -> dict[str, Any]:
    """Value per dotted path; arrays as lists."""
    state, found = bytes(registers), dict[str, Any]()
    for leaf in type(registers).leaves():
        raw = (leaf.width.ctype * max(leaf.length, 1)).from_buffer_copy(state, leaf.offset)
        found[leaf.path] = list(raw) if leaf.length else raw[0]
    return found


def diff(one: Registers, other: Registers | bytes) -> dict[str, tuple[Any, Any]]:
    """Paths whose value differs, with (own, other's) value; `other` may be a snapshot."""
    theirs = type(one).from_buffer_copy(other) if isinstance(other, bytes) else other
    mine, them = values_of(one), values_of(theirs)
    return {path: (value, them[path]) for path, value in mine.items() if value != them[path]}
