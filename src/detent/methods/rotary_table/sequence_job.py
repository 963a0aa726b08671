"""Jobs of a rotary table: the steps of its sequence controller, and the input signals that come while it runs.

A sequence controller sends the table to the positions of its table, holds the manual-feed buttons down, waits and
switches other machinery. Job files are read in `sequence_file`; what is wrong with steps among one
another is found in `sequence_faults`. Here everything is in SI units.
"""

from __future__ import annotations

import math
import re
from bisect import bisect_right
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from detent.errors import DetentError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

MOST_STEPS = 100_000
"""Steps of a job at most, repeats counted."""

LONGEST_TIME = 1e5
"""Longest wait, longest jog and latest input of a job [s]: more than a day."""

LAST_NUMBER = 127
"""Position numbers go from 0 to this."""

SIGNAL_NAME = re.compile(r"[^\W_][\w.:-]{0,39}")
"""Names of signals and labels: a letter or digit, then up to 39 letters, digits and ``_ . : -``."""

WHAT_A_NAME_IS = "a letter or digit, then up to 39 letters, digits and _ . : -"


@dataclass(frozen=True, slots=True)
class Go:
    """Send the table to an entry of its position table; the step ends when it is in position.

    Attributes
    ----------
    number : int
        Position number, 0..127.
    row : int
        Line of the file, from 1; 0 for a job that comes from elsewhere.
    label : str
        Name by which a `Repeat` refers to the step; empty for none.

    Raises
    ------
    DetentError
        A value is outside what is said above.
    """

    number: int
    row: int = 0
    label: str = ""

    def __post_init__(self) -> None:
        """Refuse numbers that no position table has."""
        if not 0 <= self.number <= LAST_NUMBER:
            came, allowed = f"position number {self.number}", f"a whole number from 0 to {LAST_NUMBER}"
            raise _bad_step(self.row, came, allowed, "name an entry of the axis's position table")
        _check_name(self.row, "label", self.label, empty=True)


@dataclass(frozen=True, slots=True)
class Jog:
    """Hold a manual-feed button down: for a time, or while an input signal is on.

    A step with a signal that is off when the step begins waits for it to come on. The step ends when the button has
    been released and the table is at rest.

    Attributes
    ----------
    direction : int
        1 to larger angles, -1 to smaller.
    speed : float or None
        Of the dial [rad/s], above 0; None for the axis's largest.
    signal : str or None
        Input that holds the button down.
    duration : float or None
        How long the button is held down [s], above 0. Exactly one of `signal` and `duration` is given.
    row, label
        As in `Go`.

    Raises
    ------
    DetentError
        A value is outside what is said above.
    """

    direction: int
    speed: float | None = None
    signal: str | None = None
    duration: float | None = None
    row: int = 0
    label: str = ""

    def __post_init__(self) -> None:
        """Refuse what no panel could do."""
        if self.direction not in (1, -1):
            raise _bad_step(self.row, f"a jog in direction {self.direction}", "1 or -1", "correct the direction")
        if self.speed is not None and not 0 < self.speed < math.inf:
            remedy = "correct the speed, or leave it out for the axis's largest"
            raise _bad_step(self.row, f"a jog at {self.speed} rad/s", "more than 0 rad/s", remedy)
        _check_one(self.row, "a jog", self.signal, self.duration)
        if self.duration is not None and not 0 < self.duration <= LONGEST_TIME:
            allowed = f"more than 0 s, up to {LONGEST_TIME:g} s"
            raise _bad_step(self.row, f"a jog for {self.duration} s", allowed, "correct the time")
        _check_name(self.row, "label", self.label, empty=True)


@dataclass(frozen=True, slots=True)
class Wait:
    """Let time pass, or wait for an input signal.

    Attributes
    ----------
    duration : float or None
        How long [s], 0 or more.
    signal : str or None
        Input to wait for. Exactly one of `duration` and `signal` is given.
    level : bool
        Level of the signal that ends the wait: True for on.
    row, label
        As in `Go`.

    Raises
    ------
    DetentError
        A value is outside what is said above.
    """

    duration: float | None = None
    signal: str | None = None
    level: bool = True
    row: int = 0
    label: str = ""

    def __post_init__(self) -> None:
        """Refuse waits without a meaning."""
        _check_one(self.row, "a wait", self.signal, self.duration)
        if self.duration is not None and not 0 <= self.duration <= LONGEST_TIME:
            raise _bad_step(
                self.row, f"a wait of {self.duration} s", f"0 s up to {LONGEST_TIME:g} s", "correct the time"
            )
        _check_name(self.row, "label", self.label, empty=True)


@dataclass(frozen=True, slots=True)
class Output:
    """Switch an output signal.

    Attributes
    ----------
    signal : str
        Its name.
    on : bool
        What it is switched to. All outputs are off at power-on.
    row, label
        As in `Go`.

    Raises
    ------
    DetentError
        A value is outside what is said above.
    """

    signal: str
    on: bool
    row: int = 0
    label: str = ""

    def __post_init__(self) -> None:
        """Refuse names that are none."""
        _check_name(self.row, "output", self.signal)
        _check_name(self.row, "label", self.label, empty=True)


@dataclass(frozen=True, slots=True)
class Repeat:
    """Do the steps from the labelled one up to here again.

    Attributes
    ----------
    label : str
        Label of the first step of the loop, which is an earlier one.
    times : int
        How often the loop is done altogether, 1 or more.
    row : int
        As in `Go`.

    Raises
    ------
    DetentError
        A value is outside what is said above.
    """

    label: str
    times: int
    row: int = 0

    def __post_init__(self) -> None:
        """Refuse loops that are done no time."""
        if not 1 <= self.times <= MOST_STEPS:
            allowed = f"a whole number from 1 to {MOST_STEPS}"
            raise _bad_step(self.row, f"a loop done {self.times} times", allowed, "correct the number")
        _check_name(self.row, "label", self.label)


Step = Go | Jog | Wait | Output | Repeat
"""A step as the job says it."""

Action = Go | Jog | Wait | Output
"""A step of a job whose loops are written out."""

Stretches = tuple[tuple[float, float], ...]
"""Times [s] in which a signal is on: from, to; in order, apart from one another."""


def _check_one(row: int, what: str, signal: str | None, duration: float | None) -> None:
    if (signal is None) == (duration is None):
        came = f"{what} with {'neither a time nor a signal' if signal is None else 'both a time and a signal'}"
        raise _bad_step(row, came, "exactly one of the two", "correct the step")
    if signal is not None:
        _check_name(row, "signal", signal)


def _check_name(row: int, what: str, name: str, *, empty: bool = False) -> None:
    if not (empty and not name) and not SIGNAL_NAME.fullmatch(name):
        raise _bad_step(row, f"the {what} {name!r}", WHAT_A_NAME_IS, "correct the name")


def _bad_step(row: int, came: str, allowed: str, remedy: str) -> DetentError:
    where = f"step of line {row}" if row else "step"
    return DetentError(f"{where}: came {came}; allowed: {allowed}; do: {remedy}")


@dataclass(frozen=True, slots=True)
class SequenceJob:
    """A program of the sequence controller; `sequence_faults` tells whether it can be run at all.

    Attributes
    ----------
    name : str
        Name of the file, without its folders.
    steps : tuple of Step
        As the file says them, at least one.
    inputs : dict
        Per input signal the stretches in which it is on [s since the start of the sequence], see `join_stretches`.
    """

    name: str
    steps: tuple[Step, ...]
    inputs: dict[str, Stretches] = field(default_factory=dict[str, Stretches])

    @property
    def count(self) -> int:
        """Number of steps done, repeats counted."""
        return count_actions(self.steps)

    def actions(self) -> Iterator[tuple[int, Action]]:
        """Steps in the order in which they are done, repeats written out: (index in `steps`, step)."""
        return write_out(self.steps)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the output signals, in the order of their first use."""
        return tuple(dict.fromkeys(step.signal for step in self.steps if isinstance(step, Output)))


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


# ------------------------------------------------------------------------------------------------------------ loops


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


def count_actions(steps: Sequence[Step]) -> int:
    """Number of steps done, repeats counted.

    >>> count_actions([Go(1, label="again"), Wait(1.0), Repeat("again", 3), Go(2)])
    7
    """
    loops = find_loops(steps)
    before = [0]  # steps done before each step, inner loops counted
    for index, step in enumerate(steps):
        done = before[index]
        if isinstance(step, Repeat):
            begin = before[loops[index]] if index in loops else done
            before.append(begin + (done - begin) * step.times)
        else:
            before.append(done + 1)
    return before[-1]


def write_out(steps: Sequence[Step]) -> Iterator[tuple[int, Action]]:
    """Steps in the order in which they are done: (index, step).

    >>> [index for index, _ in write_out([Go(1, label="a"), Wait(1.0), Repeat("a", 2), Go(2)])]
    [0, 1, 0, 1, 3]
    """
    loops = find_loops(steps)
    left: dict[int, int] = {}
    index = 0
    while index < len(steps):
        step = steps[index]
        if not isinstance(step, Repeat):
            yield index, step
        elif index in loops:
            left[index] = left.get(index, step.times) - 1
            if left[index] > 0:
                index = loops[index]
                continue
            del left[index]  # an outer loop that comes again does it anew
        index += 1
