"""Parameters of a controller that a job changes while it runs: another set at a tick, as firmware exchanges it.

Every job file that is a list of tables may have them, whatever the method: its model has `change_rows`, its job carries
`ParameterChange`s, and its run lays them with `lay_changes`. Of an axis with several motors a name begins with
that of the motor.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import TYPE_CHECKING, Any

from detent.errors import FileProblem, InputError
from detent.files.fields import Table, required, rows
from detent.files.quantities import Time
from detent.files.source import Source
from detent.kernel.registers import Field, Registers

if TYPE_CHECKING:
    from detent.record.machine import Machine  # loads the compiler


class ChangeRow(Table, frozen=True):
    """A change of a parameter as a file says it."""

    time: Time = required("time since power-on", "1 s", ge=0)
    name: str = required("parameter of the controller, as in params.csv of an export", "law.cascade.position_gain")
    value: float = required("its value from then on, in the unit of params.csv", "45.0")


def change_rows() -> Any:
    """Declare the key `parameter_change` of a job file, a ``list[ChangeRow]``."""
    return rows("a parameter of the controller that changes")


@dataclass(frozen=True, slots=True)
class ParameterChange:
    """A parameter of the controller that has another value from a time on."""

    row: int  #: line of the file, from 1
    time: float  #: since power-on [s], 0 or more
    #: as `detent export firmware` lists it in params.csv; of several motors with the name of the motor before it
    name: str
    value: float  #: in the unit of that list

    def store(self, params: Any) -> None:
        """Write it into the parameters of a controller."""
        block, _, last = self.name.rpartition(".")
        field = _field(params, self.name)
        value = self.value if field is None or field.width is None or field.width.is_float else int(self.value)
        setattr(attrgetter(block)(params) if block else params, last, value)


def read_changes(source: Source, found: Sequence[ChangeRow]) -> tuple[ParameterChange, ...]:
    """The changes of a job file."""
    return tuple(
        ParameterChange(source.line_of("parameter_change", number), **row.model_dump())
        for number, row in enumerate(found)
    )


def changes_of(job: Any, motor: str = "") -> tuple[ParameterChange, ...]:
    """Those of a job that are of one motor, in the order of time, by its own names."""
    told: Sequence[ParameterChange] = getattr(job, "changes", ())
    own = [replace(one, name=one.name.removeprefix(f"{motor}.")) for one in told
           if not motor or one.name.startswith(f"{motor}.")]  # fmt: skip
    return tuple(sorted(own, key=lambda one: one.time))


def lay_changes(machines: "Mapping[str, Machine[Any, Any]]", job: Any) -> None:
    """Have the motors of a simulated axis change parameters of their controllers; a single one has the name "".

    Refused, each with its line: a name that is none of a parameter, an option, a table, a value that does not fit.
    """
    told: Sequence[ParameterChange] = getattr(job, "changes", ())
    problems = [problem for one in told for problem in _problems(machines, one, job.name)]
    if problems:
        raise InputError(problems)
    for motor, machine in machines.items():
        machine.changes = [(round(one.time / machine.tick), _writer(one)) for one in changes_of(job, motor)]


def _writer(change: ParameterChange) -> Callable[[Any], None]:
    return lambda params: change.store(params.controller)


def _problems(machines: "Mapping[str, Machine[Any, Any]]", one: ParameterChange, file: str) -> list[FileProblem]:
    """What is wrong with a change."""
    motor, _, name = ("", "", one.name) if "" in machines else one.name.partition(".")
    allowed, remedy = "a tunable number of the controller", "take a name of params.csv of an export"
    if motor not in machines:
        return [FileProblem(file, one.row, 1, "name", f"{one.name}, of no motor", f"one of {', '.join(machines)} and a "
                            f"point before {allowed}", f"write {next(iter(machines))}.NAME")]  # fmt: skip
    field = _field(machines[motor].params.controller, name)
    if field is None or field.length or field.option:
        got = f"{one.name}, {'an option' if field and field.option else 'a table' if field else 'which is none'}"
        return [FileProblem(file, one.row, 1, "name", got, allowed, remedy)]
    if not _fits(field, one.value):
        return [
            FileProblem(file, one.row, 1, "value", f"{one.name} = {one.value:g}", _allowed(field), "change the value")
        ]
    return []


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
