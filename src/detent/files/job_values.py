"""Values in job files: what all kinds of them have in common."""

from detent.units import QuantityError, describe_kind, parse_quantity

MAX_SHOWN = 60
"""Characters of a value shown in a message."""


class RefusedValueError(Exception):
    """A value will not do; whoever reads the file adds its place."""

    def __init__(self, came: str, allowed: str, remedy: str) -> None:
        super().__init__(came, allowed, remedy)
        self.came = came  # what is wrong with it; empty where the value as written says it
        self.allowed = allowed  # and remedy: what would be accepted, and what to do
        self.remedy = remedy


def short(text: str) -> str:
    """Text as it fits into a message."""
    shown = "".join(char if char.isprintable() else "\N{REPLACEMENT CHARACTER}" for char in text[: MAX_SHOWN + 1])
    return shown if len(shown) <= MAX_SHOWN else f"{shown[:MAX_SHOWN]}..."


def read_text_quantity(key: str, value: object, unit: str, example: str = "") -> float:
    """Read the value of a key of a TOML file: a text with a number and its unit."""
    if isinstance(value, str):
        try:
            return parse_quantity(value, unit)
        except QuantityError as error:
            raise RefusedValueError(error.reason, error.allowed, error.remedy) from None
    kind, usual = describe_kind(unit)
    quoted = f'"{example or usual}"'
    raise RefusedValueError("", f"{kind} such as {quoted}", f"write it in quotes with its unit: {key} = {quoted}")


def read_whole_number(key: str, value: object) -> int:
    """Read the value of a key of a TOML file: a whole number."""
    if isinstance(value, int) and not isinstance(value, bool):
        return value
    raise RefusedValueError("", "a whole number", f"write a whole number without quotes, as in {key} = 3")
