"""Calls that a build makes at power-on, to see that it computes as the simulation does.

They are entries and host actions of the unit on the parameters of the axis file. The compiled steps make them at the
export, and the hash of all registers behind them stands in NAME_selftest.c.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from detent.export.unit import LARGE, WIDTHS, ControlUnit, arguments, signal_widths
from detent.kernel.draws import Draws, draw
from detent.kernel.image import add_bytes, begin_hash
from detent.kernel.registers import PLANT, Leaf, Registers, Width
from detent.translate.values import interval_of

CALLS = 64
FIRST, EVERY = 12, 16
"""Ticks right after power-on; later one call in so many is a tick: all six keep within 2 ms at 48 MHz."""
ENTRIES = 16  # of each signal
SEED = 5
NEAR = 3  # counts that a wire moves by, either way, between two ticks


@dataclass(frozen=True)
class Call:
    """One of them."""

    name: str  # in C
    shown: tuple[tuple[Leaf, float], ...]  # what the plant shows on its wires before it
    numbers: tuple[float, ...]  # its arguments that are no registers


@dataclass(frozen=True)
class Calls:
    """All of them."""

    laid: tuple[tuple[Width, tuple[float, ...]], ...]  # what the host has laid ready
    calls: tuple[Call, ...]
    hash: int  # of the registers behind them, but for large arrays


def self_test(unit: ControlUnit, params: Registers) -> Calls:
    """Make the calls with the compiled steps of a unit."""
    files: dict[str, Any] = {"params": params.copy(), "controller": unit.controller(), "lines": unit.lines()}
    roots = {unit.params: "params", unit.controller: "controller", unit.lines: "lines"}
    tick, begins, *actions = unit.entries.items()
    seeded: Any = Draws()
    seeded.state = SEED
    widths = list(signal_widths(tick[1]))
    laid = [tuple(_number(seeded, width) for _ in range(ENTRIES)) for width in widths]
    feed = [(width.ctype * ENTRIES)(*values) for width, values in zip(widths, laid, strict=True)]
    made: list[Call] = []
    for k in range(CALLS):
        is_tick = 0 < k <= FIRST or k % EVERY == EVERY - 1 or not actions
        name, step = begins if k == 0 else tick if is_tick else actions[draw(seeded) % len(actions)]
        shown = tuple(_shown(seeded, unit, files["lines"])) if is_tick or k == 0 else ()
        taken, numbers, signals = list[Any](), list[float](), iter(feed)
        for code in arguments(step, roots):
            if code in files:
                taken.append(files[code])
            elif code == "signal":
                taken.append(next(signals))
            else:
                value = _number(seeded, WIDTHS[code])
                numbers.append(abs(value) if k == 0 else value)  # it begins where a machine can be
                taken.append(numbers[-1])
        step(*taken)
        made.append(Call(name, shown, tuple(numbers)))
    found = begin_hash()
    memory = {"c": bytes(files["controller"]), "l": bytes(files["lines"])}
    for leaf in unit.leaves:
        if leaf.length <= LARGE:
            size = leaf.width.size * max(leaf.length, 1)
            add_bytes(found, memory[leaf.path[0]][leaf.offset : leaf.offset + size])
    return Calls(tuple(zip(widths, laid, strict=True)), tuple(made), found.number)


def _number(d: Draws, width: Width) -> float:
    """A small one: loops that it bounds are short, and what it commands is within reach."""
    if width.is_float:
        return ((draw(d) & 255) - 64) / 16.0
    lo, hi = interval_of(width)
    return min(max((draw(d) & 31) - 8, lo), hi)


def _shown(d: Draws, unit: ControlUnit, lines: Any) -> Iterator[tuple[Leaf, float]]:
    """What the plant shows next: counts go a little on, levels and codes change now and then."""
    for leaf in unit.leaves:
        if leaf.by != PLANT or leaf.length or leaf.width.is_float:
            continue
        block, last = _at(lines, leaf.path.split(".")[1:])
        lo, hi = (int(end) for end in leaf.range or interval_of(leaf.width))
        value = draw(d) & 1 if leaf.width.size == 1 else getattr(block, last) + draw(d) % (2 * NEAR + 1) - NEAR
        value = min(max(value, lo), hi)
        setattr(block, last, value)
        yield leaf, value


def _at(registers: Any, path: list[str]) -> tuple[Any, str]:
    """The block in which a register stands, and its name there."""
    *blocks, last = path
    for one in blocks:
        registers = getattr(registers, one)
    return registers, last
