"""Parameters of a controller that a job changes while it runs: another set at a tick, as firmware exchanges it."""

from collections.abc import Callable, Sequence
from functools import partial
from operator import attrgetter
from typing import Any

from detent.errors import FileProblem, InputError
from detent.kernel.registers import Field, Registers
from detent.methods.moves.job import ParameterChange
from detent.record.machine import Machine


def lay_changes(machine: Machine[Any, Any], changes: Sequence[ParameterChange], file: str) -> None:
    """Have a simulated axis change parameters of its controller.

    Refused, each with its line: a name that is none of a parameter, an option, a table, a value that does not fit.
    """
    params, problems = machine.params.controller, list[FileProblem]()
    laid: list[tuple[int, Callable[[Any], None]]] = []
    for one in sorted(changes, key=lambda change: change.time):
        field, wrong = _field(params, one.name), ()
        if field is None or field.length or field.option:
            got = f"{one.name}, {'an option' if field and field.option else 'a table' if field else 'which is none'}"
            wrong = ("name", got, "a tunable number of the controller", "take a name of params.csv of an export")
        elif not _fits(field, one.value):
            wrong = ("value", f"{one.name} = {one.value:g}", _allowed(field), "change the value")
        if wrong:
            problems.append(FileProblem(file, one.row, 1, *wrong))
        elif field is not None:
            value = one.value if field.width and field.width.is_float else int(one.value)
            laid.append((round(one.time / machine.tick), partial(_store, name=one.name, value=value)))
    if problems:
        raise InputError(problems)
    machine.changes = laid


def _field(params: Registers, name: str) -> Field | None:
    """The declaration of a parameter; None where there is none."""
    registers: Any = type(params)
    *blocks, last = name.split(".")
    for one in blocks:
        found = registers.__fields__.get(one)
        if found is None or found.block is None:
            return None
        registers = found.block
    found = registers.__fields__.get(last)
    return found if found is not None and found.block is None else None


def _fits(field: Field, value: float) -> bool:
    lo, hi = field.range or (-float("inf"), float("inf"))
    width = field.width
    if width is None or not lo <= value <= hi:
        return False
    return width.is_float or (value == int(value) and width.ctype(int(value)).value == value)


def _allowed(field: Field) -> str:
    kind = "a number" if field.width and field.width.is_float else f"a whole number of {field.width.code}"  # pyright: ignore[reportOptionalMemberAccess] - no block
    return kind + (f" from {field.range[0]:g} to {field.range[1]:g}" if field.range else "")


def _store(params: Any, name: str, value: float) -> None:
    """Write one parameter."""
    block, _, last = name.rpartition(".")
    setattr(attrgetter(block)(params.controller) if block else params.controller, last, value)
