"""The part of an export by which a board is led over a serial line: frames, mailbox and telemetry, and a host of it."""

from importlib import resources
from typing import Any

from detent.export.code import place_of, seconds, template
from detent.export.unit import ControlUnit
from detent.kernel.registers import CONTROLLER, PLANT, Leaf
from detent.methods.method import Board
from detent.operate.wires import wire_hash


def serial_texts(axis: Any, unit: ControlUnit, about: str) -> dict[str, str]:
    """Files of the export by their names; none of a method whose firmware is not led so."""
    method = axis.method
    if not method.boards:
        return {}
    board: Board = method.brought(method.boards)
    given: dict[str, Any] = {"name": unit.name, "NAME": unit.name.upper(), "about": about, **board.values(axis.spec)}
    given["real"] = "float" if unit.arithmetic == "single" else "double"
    told = [leaf for leaf in board.lines.leaves() if leaf.by == CONTROLLER]
    given |= {
        "mailbox": [_get(leaf, board.places[leaf.path]) for leaf in told],
        "mailbox_bytes": 1 + sum(leaf.width.size for leaf in told),
        "telemetry": [_put(leaf, _place(leaf, board)) for leaf in board.lines.leaves() if leaf.by == PLANT],
        "wire_hash": wire_hash(board.lines), "sample": seconds(given["period"]),
    }  # fmt: skip
    for way, shown, by in (("sense", "sensed", PLANT), ("actuate", "actuated", CONTROLLER)):
        leaves = [leaf for leaf in unit.lines.leaves() if leaf.by == by]
        given[way] = [place_of(f"l.{leaf.path}", "", "") for leaf in leaves]
        given[shown] = [f"{leaf.path} {leaf.width.code}" for leaf in leaves]
    package = method.brought(method.boards.partition(":")[0] + ":__package__")
    frames = resources.files("detent.operate.drivers").joinpath("frames.h").read_text(encoding="ascii")
    return {
        "frames.h": frames, f"{unit.name}_serial.h": template("serial.h.in", **given),
        f"{unit.name}_serial.c": template(board.code, package, **given), "posix.c": template("posix.c.in", **given),
    }  # fmt: skip


def _place(leaf: Leaf, board: Board) -> str:
    """Where the board has what it tells."""
    return board.places.get(leaf.path) or place_of(f"l.{leaf.path}", "", "l->")


def _get(leaf: Leaf, place: str) -> str:
    if leaf.width.is_float:
        return f"{place} = get_double(&at);"
    return f"{place} = ({leaf.width.c_name})get(&at, {leaf.width.size});"


def _put(leaf: Leaf, place: str) -> str:
    return f"put_double(&at, {place});" if leaf.width.is_float else f"put(&at, (uint64_t){place}, {leaf.width.size});"
