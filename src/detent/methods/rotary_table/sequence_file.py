"""Jobs of a rotary table, read from TOML: the steps of its sequence controller, and when its input signals come.

And what is wrong with steps among one another: loops that cross, signals nobody gives, and steps that would wait for
ever. A job file is refused for them with the place, and a job made by a program before it runs.
"""

from collections.abc import Iterator, Mapping, Sequence
from os import PathLike
from pathlib import PurePath

from detent.errors import FileProblem, InputError
from detent.files.fields import Table, rows
from detent.files.locate import Index
from detent.files.problems import Reporter
from detent.files.read import read_tables, refuse
from detent.files.source import parse_source
from detent.files.text import read_text
from detent.methods.changes import ChangeRow, change_rows, read_changes
from detent.methods.rotary_table.sequence_job import (
    MOST_STEPS,
    Action,
    Go,
    InputRow,
    Jog,
    Output,
    Repeat,
    SequenceJob,
    Step,
    StepRow,
    Stretches,
    Wait,
    find_loops,
    join_stretches,
    next_on,
    stated_keys,
)

WHAT_A_JOB_IS = "a sequence of steps (.toml)"
LONGEST_JOB = 1e6  # longest time that the steps of a job may take by what they say, repeats counted [s]


class SequenceFile(Table, frozen=True):
    """A sequence: its steps, and the stretches of its input signals."""

    input: list[InputRow] = rows("a stretch of time in which an input signal is on")
    step: list[StepRow] = rows("a step")
    parameter_change: list[ChangeRow] = change_rows()


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
    job = SequenceJob(PurePath(file).name, tuple(steps), inputs, changes=read_changes(source, found.parameter_change))
    if faults := find_faults(job):
        reporter = Reporter(file, source.places, {}, SequenceFile)
        refuse(reporter.placed(("step", Index(number)), fault) for number, fault in faults)
    return job


def _make_step(row: StepRow, line: int) -> Step:
    """The step that a table says."""
    if row.go is not None:
        return Go(row.go, row=line, label=row.label)
    if row.jog is not None:
        return Jog(1 if row.jog == "+" else -1, row.speed, row.signal, row.duration, row=line, label=row.label)
    if row.repeat is not None:
        return Repeat(row.repeat, row.times or 1, row=line)
    if row.wait is not None or row.wait_for is not None:
        return Wait(row.wait, row.wait_for, row.level, row=line, label=row.label)
    return Output(row.set_on or row.clear or "", on=row.set_on is not None, row=line, label=row.label)


Fault = tuple[int, FileProblem]  # number of a step in the job, from 0, and what is wrong with it among the others


def find_faults(job: SequenceJob) -> list[Fault]:
    """What is wrong with the steps among one another, whatever axis they are for.

    Labels and loops; signals that are not among the inputs; a signal that cannot come on any more when its step begins,
    by the times that the steps before it take at least, so that the step would wait for ever.
    """
    faults = [*_label_faults(job.steps), *_signal_faults(job)]
    if job.count > MOST_STEPS:
        last = max((k for k, step in enumerate(job.steps) if isinstance(step, Repeat)), default=len(job.steps) - 1)
        got, allowed = f"{job.count} steps, repeats counted", f"up to {MOST_STEPS} steps"
        faults.append((last, FileProblem.of_key("times", got, allowed, "lower the repeats")))
    return faults or list(_time_faults(job))


def _label_faults(steps: Sequence[Step]) -> Iterator[Fault]:
    """Labels given twice, loops without a beginning, loops of which neither lies inside the other."""
    labels: dict[str, int] = {}
    for index, step in enumerate(steps):
        if isinstance(step, Repeat):
            if step.label not in labels:
                known = ", ".join(f'"{name}"' for name in labels) or "none of them has one"
                remedy = f'write label = "{step.label}" in the first step of the loop, or correct the name'
                got, allowed = f'the label "{step.label}", which no step before has', "the label of an earlier step"
                yield (index, FileProblem.of_key("repeat", got, f"{allowed}: {known}", remedy))
        elif step.label in labels:
            allowed, remedy = "each label once", "give one of the steps another label"
            yield (index, FileProblem.of_key("label", f'the label "{step.label}" again', allowed, remedy))
        elif step.label:
            labels[step.label] = index
    loops = find_loops(steps)
    for end, begin in loops.items():
        if any(other < begin <= last < end for last, other in loops.items()):
            got = "a loop that begins inside an earlier loop and ends outside it"
            remedy = "begin it where the earlier loop begins, or before that, or after the earlier loop"
            yield (end, FileProblem.of_key("repeat", got, "loops inside one another or apart", remedy))


def _signal_faults(job: SequenceJob) -> Iterator[Fault]:
    """Steps that ask for a signal nobody gives, or set one that comes from outside."""
    known = ", ".join(f'"{name}"' for name in job.inputs) or "the job has none"
    for index, step in enumerate(job.steps):
        signal, key = _signal_of(step)
        if isinstance(step, Output):
            if signal in job.inputs:
                remedy = "give the output another name"
                yield (index, FileProblem.of_key(key, f'the input "{signal}"', "a name that no input has", remedy))
        elif signal is not None and not job.inputs.get(signal):
            got, remedy = f'the unknown input "{signal}"', f'add [[input]] with name = "{signal}", or correct the name'
            yield (index, FileProblem.of_key(key, got, f"an input of this job: {known}", remedy))


def _signal_of(step: Step) -> tuple[str | None, str]:
    """Signal of a step, None for a step without one, and its key in a job file."""
    found = ((value, key) for key, value in stated_keys(step).items() if key in {"while", "wait_for", "set", "clear"})
    return next(((value, key) for value, key in found if isinstance(value, str)), (None, ""))


def _time_faults(job: SequenceJob) -> Iterator[Fault]:
    """The first step that would wait for ever, or that begins later than any job may last."""
    time = 0.0
    for index, step in job.actions():
        later = _earliest_end(step, job.inputs, time)
        if later is None:
            signal, key = _signal_of(step)
            last = job.inputs[signal or ""][-1][1]
            got = f'"{signal}", which is off for good from {last:g} s on; the step begins at {time:g} s or later'
            remedy = f'let "{signal}" be on later, or repeat less'
            yield (index, FileProblem.of_key(key, got, "a signal that comes on after the step begins", remedy))
            return
        time = later
        if time > LONGEST_JOB:
            got, allowed = f"a sequence of more than {LONGEST_JOB:g} s", f"up to {LONGEST_JOB:g} s"
            yield (index, FileProblem.of_key("", got, allowed, "shorten the waits, or repeat less"))
            return


def _earliest_end(step: Action, inputs: Mapping[str, Stretches], time: float) -> float | None:
    """Earliest end of a step that begins at `time` [s]; None if it cannot end."""
    if isinstance(step, Go | Output):
        return time
    if step.signal is None:
        return time + (step.duration or 0.0)
    stretch = next_on(inputs[step.signal], time)
    if isinstance(step, Wait) and not step.level:
        return time if stretch is None or stretch[0] > time else stretch[1]
    if stretch is None:
        return None
    return stretch[1] if isinstance(step, Jog) else max(time, stretch[0])
