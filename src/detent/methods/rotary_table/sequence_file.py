"""Jobs of a rotary table, read from TOML: the steps of its sequence controller, and when its input signals come."""

from os import PathLike
from pathlib import PurePath

from detent.errors import InputError
from detent.files.fields import Table, rows
from detent.files.locate import Index
from detent.files.problems import Reporter
from detent.files.read import read_tables, refuse
from detent.files.source import parse_source
from detent.files.text import read_text
from detent.methods.rotary_table.sequence_faults import find_faults
from detent.methods.rotary_table.sequence_job import (
    Go,
    InputRow,
    Jog,
    Output,
    Repeat,
    SequenceJob,
    Step,
    StepRow,
    Wait,
    join_stretches,
)

WHAT_A_JOB_IS = "a sequence of steps (.toml)"


class SequenceFile(Table, frozen=True):
    """A sequence: its steps, and the stretches of its input signals."""

    input: list[InputRow] = rows("a stretch of time in which an input signal is on")
    step: list[StepRow] = rows("a step")


def load_sequence(path: str | PathLike[str]) -> SequenceJob:
    """Read the job of a rotary table; whether the axis can do it is not checked here."""
    return parse_sequence(str(path), read_text(path, (".toml",), WHAT_A_JOB_IS))


def parse_sequence(file: str, text: str) -> SequenceJob:
    """Read a sequence of steps from TOML, or tell all that is wrong with it, each with line and column."""
    source = parse_source(file, text)
    found = read_tables(source, SequenceFile)
    if not found.step:
        remedy = "add a step, such as [[step]] with go = 1"
        raise InputError.of_file(file, "no steps", "a sequence of at least one step", remedy)
    steps = [_make_step(row, source.line_of("step", number)) for number, row in enumerate(found.step)]
    stretches: dict[str, list[tuple[float, float]]] = {}
    for row in found.input:
        stretches.setdefault(row.name, []).append((row.begin, row.end))
    inputs = {name: join_stretches(found) for name, found in stretches.items()}
    faults = find_faults(steps, inputs)
    if faults:
        reporter = Reporter(file, source.places, {}, SequenceFile)
        refuse(reporter.placed(("step", Index(number)), fault) for number, fault in faults)
    return SequenceJob(PurePath(file).name, tuple(steps), inputs)


def _make_step(row: StepRow, line: int) -> Step:
    """The step that a table says."""
    if row.go is not None:
        return Go(row.go, line, row.label)
    if row.jog is not None:
        return Jog(1 if row.jog == "+" else -1, row.speed, row.signal, row.duration, line, row.label)
    if row.repeat is not None:
        return Repeat(row.repeat, row.times or 1, line)
    if row.wait is not None or row.wait_for is not None:
        return Wait(row.wait, row.wait_for, row.level, line, row.label)
    return Output(row.set_on or row.clear or "", on=row.set_on is not None, row=line, label=row.label)
