"""`NAME.a2l`: what of a controller calibration tools can read and change while it runs (ASAP2 1.7).

It is made of the rows of params.csv and registers.csv, so that tables and description cannot disagree.
"""

import sys
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from detent.export.code import template

Row = Mapping[str, Any]
BYTE_ORDERS = {True: "MSB_LAST", False: "MSB_FIRST"}  # by whether the least byte comes first
LARGEST_SINGLE = float.fromhex("0x1.fffffep127")
_TYPES = {
    "u1": "UBYTE", "u2": "UWORD", "u4": "ULONG", "i1": "SBYTE", "i2": "SWORD", "i4": "SLONG", "i8": "A_INT64",
    "f4": "FLOAT32_IEEE", "f8": "FLOAT64_IEEE",
}  # fmt: skip


def variables_of(name: str) -> dict[str, str]:
    """Variables of an application as its README calls them: parameters, controller, lines."""
    return {root: f"{name}_{root}" for root in "pcl"}


def a2l_text(  # noqa: PLR0913 - what the tables hold, and what a linked program adds
    name: str,
    about: str,
    version: str,
    parameters: Iterable[Row],
    registers: Iterable[Row],
    *,
    variables: Mapping[str, str] | None = None,
    address: Callable[[str, Row], int] = lambda _symbol, _row: 0,
    little_endian: bool = True,
) -> str:
    """The description of an export, from the rows of params.csv and registers.csv.

    `variables` are as of `variables_of`; `address` takes a symbol of the application, such as ``axis_c.law.command``,
    and its row, and gives 0 for one that is not known. A parameter without an expression is no part of the structure.
    """
    roots = variables or variables_of(name)

    def told(row: Row, prefix: str) -> dict[str, Any]:
        """A row as the description tells it."""
        root, _, path = str(row["expression"]).partition("->")
        symbol = f"{roots[root]}.{path}"
        lower, upper = str(row["range"]).split(" to ") if row["range"] else _ends(str(row["width"]))
        return {
            "name": f"{name}.{prefix}{row['name']}", "symbol": symbol, "address": f"0x{address(symbol, row):08X}",
            "type": _TYPES[row["width"]], "length": int(row["length"]), "unit": row["unit"], "lower": lower,
            "upper": upper, "meaning": row["meaning"],
        }  # fmt: skip

    tuned = [told(row, "params.") for row in parameters if row["expression"]]
    return template(
        "axis.a2l.in", name=name, about=about, version=version, byte_order=BYTE_ORDERS[little_endian],
        layouts=sorted({one["type"] for one in tuned}), parameters=tuned,
        registers=[told(row, "") for row in registers],
    )  # fmt: skip


def _ends(width: str) -> tuple[str, str]:
    """What a width can hold."""
    if width == "f4":
        return repr(-LARGEST_SINGLE), repr(LARGEST_SINGLE)
    if width == "f8":
        return repr(-sys.float_info.max), repr(sys.float_info.max)
    bits = 8 * int(width[1:])
    return ("0", str((1 << bits) - 1)) if width[0] == "u" else (str(-(1 << bits - 1)), str((1 << bits - 1) - 1))
