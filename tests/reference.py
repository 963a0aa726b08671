"""Every key of an axis file, by method."""

from detent.files.keys import KeyRow, key_rows
from detent.methods.registry import METHODS


def reference_rows(method: str) -> tuple[KeyRow, ...]:
    """Every key of a method's axis file."""
    return key_rows(METHODS[method].spec)
