"""What is wrong with the steps of a sequence among one another, whatever axis they are for.

Loops that cross, signals nobody gives, and steps that would wait for ever: a job file is refused for them with the
place, and a job made by a program before it runs.
"""

from collections.abc import Iterator, Mapping, Sequence

from detent.errors import FileProblem
from detent.methods.rotary_table.sequence_job import (
    MOST_STEPS,
    Action,
    Go,
    Jog,
    Output,
    Repeat,
    Step,
    Stretches,
    Wait,
    count_actions,
    find_loops,
    next_on,
    write_out,
)

LONGEST_JOB = 1e6
"""Longest time that the steps of a job may take by what they say, repeats counted [s]."""


Fault = tuple[int, FileProblem]
"""Number of a step in the job, from 0, and what is wrong with it among the others."""


def find_faults(steps: Sequence[Step], inputs: Mapping[str, Stretches]) -> list[Fault]:
    """What is wrong with the steps among one another, whatever axis they are for.

    Labels and loops; signals that are not among the inputs; a signal that cannot come on any more when its step begins,
    by the times that the steps before it take at least, so that the step would wait for ever.
    """
    faults = [*_label_faults(steps), *_signal_faults(steps, inputs)]
    count = count_actions(steps)
    if count > MOST_STEPS:
        came, remedy = f"{count} steps, repeats counted", "lower the repeats"
        faults.append((_last_repeat(steps), FileProblem.of_key("times", came, f"up to {MOST_STEPS} steps", remedy)))
    return faults or list(_time_faults(steps, inputs))


def _last_repeat(steps: Sequence[Step]) -> int:
    """Index of the last loop; of the last step in a job without loops."""
    return max((index for index, step in enumerate(steps) if isinstance(step, Repeat)), default=len(steps) - 1)


def _label_faults(steps: Sequence[Step]) -> Iterator[Fault]:
    """Labels given twice, loops without a beginning, loops of which neither lies inside the other."""
    labels: dict[str, int] = {}
    for index, step in enumerate(steps):
        if isinstance(step, Repeat):
            if step.label not in labels:
                yield _no_such_label(index, step.label, labels)
        elif step.label in labels:
            allowed, remedy = "each label once", "give one of the steps another label"
            yield (index, FileProblem.of_key("label", f'the label "{step.label}" again', allowed, remedy))
        elif step.label:
            labels[step.label] = index
    loops = find_loops(steps)
    for end, begin in loops.items():
        if any(other < begin <= last < end for last, other in loops.items()):
            came = "a loop that begins inside an earlier loop and ends outside it"
            remedy = "begin it where the earlier loop begins, or before that, or after the earlier loop"
            yield (end, FileProblem.of_key("repeat", came, "loops inside one another or apart", remedy))


def _no_such_label(index: int, label: str, labels: Mapping[str, int]) -> Fault:
    known = ", ".join(f'"{name}"' for name in labels) or "none of them has one"
    remedy = f'write label = "{label}" in the first step of the loop, or correct the name'
    came = f'the label "{label}", which no step before has'
    return (index, FileProblem.of_key("repeat", came, f"the label of an earlier step: {known}", remedy))


def _signal_faults(steps: Sequence[Step], inputs: Mapping[str, Stretches]) -> Iterator[Fault]:
    """Steps that ask for a signal nobody gives, or set one that comes from outside."""
    known = ", ".join(f'"{name}"' for name in inputs) or "the job has none"
    for index, step in enumerate(steps):
        signal, key = _signal_of(step)
        if isinstance(step, Output):
            if signal in inputs:
                remedy = "give the output another name"
                yield (index, FileProblem.of_key(key, f'the input "{signal}"', "a name that no input has", remedy))
        elif signal is not None and not inputs.get(signal):
            came, remedy = f'the unknown input "{signal}"', f'add [[input]] with name = "{signal}", or correct the name'
            yield (index, FileProblem.of_key(key, came, f"an input of this job: {known}", remedy))


def _signal_of(step: Step) -> tuple[str | None, str]:
    """Signal of a step, None for a step without one, and its key in a job file."""
    if isinstance(step, Jog):
        return step.signal, "while"
    if isinstance(step, Wait):
        return step.signal, "wait_for"
    if isinstance(step, Output):
        return step.signal, "set" if step.on else "clear"
    return None, ""


def _time_faults(steps: Sequence[Step], inputs: Mapping[str, Stretches]) -> Iterator[Fault]:
    """The first step that would wait for ever, or that begins later than any job may last."""
    time = 0.0
    for index, step in write_out(steps):
        later = _earliest_end(step, inputs, time)
        if later is None:
            signal, key = _signal_of(step)
            last = inputs[signal or ""][-1][1]
            came = f'"{signal}", which is off for good from {last:g} s on; the step begins at {time:g} s or later'
            allowed, remedy = (
                "a signal that comes on after the step begins",
                f'let "{signal}" be on later, or repeat less',
            )
            yield (index, FileProblem.of_key(key, came, allowed, remedy))
            return
        time = later
        if time > LONGEST_JOB:
            came, allowed = f"a sequence of more than {LONGEST_JOB:g} s", f"up to {LONGEST_JOB:g} s"
            yield (index, FileProblem.of_key("", came, allowed, "shorten the waits, or repeat less"))
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
