"""Where two register files differ."""

from typing import Any

from detent.kernel.registers import Registers


def diff(one: Registers, other: Registers | bytes) -> dict[str, tuple[Any, Any]]:
    """Paths whose value differs, with (own, other's) value; `other` may be a snapshot."""
    theirs = type(one).from_buffer_copy(other) if isinstance(other, bytes) else other
    mine, them = one.values(), theirs.values()
    return {path: (value, them[path]) for path, value in mine.items() if value != them[path]}
