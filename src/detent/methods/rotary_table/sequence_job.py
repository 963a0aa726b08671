"""Jobs of a rotary table: the steps of its sequence controller, and the input signals that come while it runs.

A sequence controller sends the table to the positions of its table, holds the manual-feed buttons down, waits and
switches other machinery. Job files are read in `sequence_file`; here everything is in SI units.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from pydantic import StringConstraints, ValidationInfo, field_validator
from pydantic_core import PydanticCustomError

from detent.errors import FileProblem
from detent.files.fields import optional, required
from detent.files.quantities import AngularVelocity, Time
from detent.files.read import Row, check_values
from detent.files.screen import OnScreen
from detent.methods.changes import ParameterChange

MOST_STEPS = 100_000  # steps of a job at most, repeats counted
LONGEST_TIME = 1e5  # longest wait, longest jog and latest input of a job [s]: more than a day
LAST_NUMBER = 127  # position numbers go from 0 to this

NAME = r"[^\W_][\w.:-]{0,39}"  # names of signals and labels
WHAT_A_NAME_IS = "a letter or digit, then up to 39 letters, digits and _ . : -"
ACTIONS: dict[str, tuple[str, ...]] = {
    "go": ("label",),
    "jog": ("speed", "while", "for", "label"),
    "wait": ("label",),
    "wait_for": ("level", "label"),
    "set": ("label",),
    "clear": ("label",),
    "repeat": ("times",),
}
"""What a step can be, and the keys that it may have beside."""


Name = Annotated[str, StringConstraints(pattern=f"^{NAME}$")]


def name_key(doc: str, alias: str | None = None) -> Any:
    """Declare a key that may hold a name."""
    what = "the label of an earlier step" if "label" in doc else "a name"
    return optional(doc, None, alias=alias, allowed=f"{what}: {WHAT_A_NAME_IS}")


class InputRow(Row, frozen=True):
    """A stretch of time in which an input signal is on; a signal may have several."""

    name: Name = required("the signal", '"feed"', allowed=f"a name: {WHAT_A_NAME_IS}")
    begin: Time = required("when it comes", '"1 s"', alias="from", ge=0, le=LONGEST_TIME)
    end: Time = required("when it goes", '"4 s"', alias="to", ge=0, le=LONGEST_TIME)

    @field_validator("end")
    @classmethod
    def is_later(cls, end: float, info: ValidationInfo) -> float:
        """Refuse a stretch that ends before it begins."""
        begin = info.data.get("begin", -1.0)
        if begin < end:
            return end
        allowed = f"a time after from, {begin:g} s"
        raise PydanticCustomError("refused", "too early", {"allowed": allowed, "remedy": "correct one of the two"})


class StepRow(Row, frozen=True):
    """A step as a file says it: one of `ACTIONS`, and what belongs to it."""

    go: int | None = optional(
        "position number", None, allowed=f"a position number from 0 to {LAST_NUMBER}", ge=0, le=LAST_NUMBER
    )
    jog: Literal["+", "-"] | None = optional("direction of a jog", None, allowed='"+" (to larger angles) or "-"')
    wait: Time | None = optional("how long to wait", None, ge=0, le=LONGEST_TIME)
    wait_for: Name | None = name_key("an input to wait for")
    set_on: Name | None = name_key("an output to switch on", alias="set")
    clear: Name | None = name_key("an output to switch off")
    repeat: Name | None = name_key("the label of an earlier step")
    speed: AngularVelocity | None = optional("speed of a jog", None, derived="the axis's largest", gt=0)
    signal: Name | None = name_key("an input that holds the button down", alias="while")
    duration: Time | None = optional("how long the button is held down", None, alias="for", gt=0, le=LONGEST_TIME)
    level: bool = optional("level of the input that ends the wait", default=True, allowed="true (on) or false (off)")
    times: int | None = optional("how often the loop is done altogether", None, ge=1, le=MOST_STEPS)
    label: Annotated[str, StringConstraints(pattern=f"^({NAME})?$")] = optional(
        "name of the step, for a repeat", "", allowed=f"a name: {WHAT_A_NAME_IS}"
    )

    @classmethod
    def faults(cls, stated: Mapping[str, Any], *, is_whole: bool) -> Iterator[FileProblem]:
        """Keys that do not go together, or that the step lacks."""
        actions = [key for key in stated if key in ACTIONS]
        one = f"exactly one of {', '.join(ACTIONS)}"
        if len(actions) > 1:
            yield FileProblem.of_key(actions[1], " and ".join(actions), one, "write a [[step]] for each")
        elif actions:
            (action,) = actions
            for key in stated:
                if key in cls.known() and key not in (action, *ACTIONS[action]):
                    owners = " or ".join(name for name, keys in ACTIONS.items() if key in keys)
                    allowed = f"beside {action}: {', '.join(ACTIONS[action])} ({key} belongs to {owners})"
                    remedy = REMEDIES.get((action, key), "remove it")
                    yield FileProblem.of_key(key, f"{key} beside {action}", allowed, remedy)
            if is_whole:
                yield from _lacking(action, stated)
        elif is_whole:
            yield FileProblem.of_key("", "a step that does nothing", one, "add go = 1, or another of these")


REMEDIES = {
    ("go", "speed"): "remove it; the speed to a position stands in the axis file, in [position.NUMBER]",
    ("repeat", "label"): "remove it; put the label on a step that does something",
}


def _lacking(action: str, stated: Mapping[str, Any]) -> Iterator[FileProblem]:
    """Keys that the action needs."""
    if action == "repeat" and "times" not in stated:
        allowed = "a whole number of times, the first counted"
        yield FileProblem.of_key("repeat", "repeat without times", allowed, "add times = 2")
    held = [key for key in ("while", "for") if key in stated]
    if action == "jog" and len(held) != 1:
        got = "jog with while and for" if held else "jog without an end"
        remedy = "remove one of the two" if held else 'add for = "2 s", or while with the name of an input'
        yield FileProblem.of_key("jog", got, "exactly one of while (a signal) and for (a time)", remedy)


@dataclass(frozen=True, slots=True, kw_only=True)
class SequenceStep:
    """What every step of a sequence has. A value that no job file could have is a `DetentError`."""

    row: int = 0  #: line of the file, from 1; 0 for a job that comes from elsewhere

    def __post_init__(self) -> None:
        """Refuse what no job file could say."""
        check_values(StepRow, f"step of line {self.row}" if self.row else "step", stated_keys(self))


@dataclass(frozen=True, slots=True)
class Go(SequenceStep):
    """Send the table to an entry of its position table; the step ends when it is in position."""

    number: int  #: position number, 0..127
    label: str = ""  #: name by which a `Repeat` refers to the step; empty for none


@dataclass(frozen=True, slots=True)
class Jog(SequenceStep):
    """Hold a manual-feed button down: for a time, or while an input signal is on.

    A step with a signal that is off when the step begins waits for it to come on. The step ends when the button has
    been released and the table is at rest.
    """

    direction: int  #: 1 to larger angles, -1 to smaller
    speed: float | None = None  #: of the dial [rad/s], above 0; None for the axis's largest
    signal: str | None = None  #: input that holds the button down
    duration: float | None = None  #: how long it is held down [s], above 0; either this or `signal` is given
    label: str = ""  #: as in `Go`


@dataclass(frozen=True, slots=True)
class Wait(SequenceStep):
    """Let time pass, or wait for an input signal."""

    duration: float | None = None  #: how long [s], 0 or more
    signal: str | None = None  #: input to wait for; either this or `duration` is given
    level: bool = True  #: level of the signal that ends the wait: True for on
    label: str = ""  #: as in `Go`


@dataclass(frozen=True, slots=True)
class Output(SequenceStep):
    """Switch an output signal. All outputs are off at power-on."""

    signal: str  #: its name
    on: bool  #: what it is switched to
    label: str = ""  #: as in `Go`


@dataclass(frozen=True, slots=True)
class Repeat(SequenceStep):
    """Do the steps from the labelled one up to here again."""

    label: str  #: label of the first step of the loop, which is an earlier one
    times: int  #: how often the loop is done altogether, 1 or more


def stated_keys(step: SequenceStep) -> dict[str, object]:
    """What a step says, by the keys of a job file; what is None or empty is left out there."""
    if isinstance(step, Go):
        return {"go": step.number, "label": step.label}
    if isinstance(step, Jog):
        jog = {1: "+", -1: "-"}.get(step.direction, step.direction)
        return {"jog": jog, "speed": step.speed, "while": step.signal, "for": step.duration, "label": step.label}
    if isinstance(step, Wait):
        level = None if step.signal is None else step.level
        return {"wait": step.duration, "wait_for": step.signal, "level": level, "label": step.label}
    if isinstance(step, Output):
        return {"set" if step.on else "clear": step.signal, "label": step.label}
    return {"repeat": step.label, "times": step.times} if isinstance(step, Repeat) else {}


Step = Go | Jog | Wait | Output | Repeat  # a step as the job says it
Action = Go | Jog | Wait | Output  # a step of a job whose loops are written out
Stretches = tuple[tuple[float, float], ...]  # times [s] in which a signal is on: from, to; in order, apart


@dataclass(frozen=True, slots=True, repr=False)
class SequenceJob(OnScreen):
    """A program of the sequence controller; `sequence_file.find_faults` tells whether it can be run at all."""

    name: str  #: name of the file, without its folders
    steps: tuple[Step, ...]  #: as the file says them, at least one
    #: per input signal the stretches in which it is on [s since the start of the sequence], see `join_stretches`
    inputs: dict[str, Stretches] = field(default_factory=dict[str, Stretches])
    kind: str = "sequence"
    changes: tuple[ParameterChange, ...] = ()  #: parameters of the controller that change on the way

    @property
    def count(self) -> int:
        """Number of steps done, repeats counted.

        >>> SequenceJob("tour", (Go(1, label="again"), Wait(1.0), Repeat("again", 3), Go(2))).count
        7
        """
        loops = find_loops(self.steps)
        before = [0]  # steps done before each step, inner loops counted
        for index, step in enumerate(self.steps):
            done = before[index]
            if isinstance(step, Repeat):
                begin = before[loops[index]] if index in loops else done
                before.append(begin + (done - begin) * step.times)
            else:
                before.append(done + 1)
        return before[-1]

    def actions(self) -> Iterator[tuple[int, Action]]:
        """Steps in the order in which they are done, repeats written out: (index in `steps`, step).

        >>> [index for index, _ in SequenceJob("tour", (Go(1, label="a"), Wait(1.0), Repeat("a", 2), Go(2))).actions()]
        [0, 1, 0, 1, 3]
        """
        loops = find_loops(self.steps)
        left: dict[int, int] = {}
        index = 0
        while index < len(self.steps):
            step = self.steps[index]
            if not isinstance(step, Repeat):
                yield index, step
            elif index in loops:
                left[index] = left.get(index, step.times) - 1
                if left[index] > 0:
                    index = loops[index]
                    continue
                del left[index]  # an outer loop that comes again does it anew
            index += 1


def join_stretches(stretches: Iterable[tuple[float, float]]) -> Stretches:
    """Stretches in order; those that overlap or touch become one.

    >>> join_stretches([(5.0, 6.0), (1.0, 2.0), (2.0, 3.0)])
    ((1.0, 3.0), (5.0, 6.0))
    """
    joined: list[tuple[float, float]] = []
    for begin, end in sorted(stretches):
        if joined and begin <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(end, joined[-1][1]))
        else:
            joined.append((begin, end))
    return tuple(joined)


def next_on(stretches: Stretches, time: float) -> tuple[float, float] | None:
    """Stretch that a signal is in at a time [s], or the next one; None when none is left.

    >>> next_on(((1.0, 2.0), (5.0, 6.0)), 2.0)
    (5.0, 6.0)
    """
    place = bisect_right(stretches, time, key=lambda stretch: stretch[1])
    return stretches[place] if place < len(stretches) else None


def find_loops(steps: Sequence[Step]) -> dict[int, int]:
    """First step of each loop, by the index of its `Repeat`; loops whose label does not come before are left out."""
    labels: dict[str, int] = {}
    loops: dict[int, int] = {}
    for index, step in enumerate(steps):
        if not isinstance(step, Repeat):
            labels.setdefault(step.label, index)
        elif step.label in labels:
            loops[index] = labels[step.label]
    return loops
