"""The host of a rotary table: its sequence controller with the panel. It sees what the positioner says, no more.

To the positioner go position number and start, the buttons + and - and the speed dial; the positioner says that the
table has come to rest, that a start was refused, and how far from its target it sees the table.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import groupby
from typing import Any

from detent.axisfile.blocks import describe_fault
from detent.control.guard import NO_ARRIVAL
from detent.control.table_positioner import HOLD, POWER_ON
from detent.errors import MOST_PROBLEMS, TABLE_REFUSAL_TEXT, FileProblem, InputError
from detent.files.nearest import BARELY, at_least, at_most
from detent.methods.rotary_table import controller
from detent.methods.rotary_table.build import build_rotary_table, start_turns, ticks
from detent.methods.rotary_table.schema import RotaryTableSpec
from detent.methods.rotary_table.sequence_file import find_faults
from detent.methods.rotary_table.sequence_job import Go, Jog, SequenceJob, Step
from detent.methods.rotary_table.system import TICK, RotaryTable, switch_on
from detent.record.machine import AnyRecorder, Machine
from detent.record.run import Evidence
from detent.units import format_quantity

MARGIN = 0.5  # what a step may take longer than twice the time of its way [s]
SETTLING = 10.0  # time that the position loop is given to settle, in units of 1 / Kp


class TableHost:
    """Panel of a rotary table, and the passing of time."""

    def __init__(self, spec: RotaryTableSpec, recorder: AnyRecorder | None = None) -> None:
        self.spec, p, r = spec, build_rotary_table(spec), RotaryTable()
        self.machine = Machine(p, r, TICK, recorder)  # the simulated axis, at power-on
        switch_on(p, r, start_turns(spec), ticks(spec.method.task_phase), spec.detector.seed, self.machine.act)
        # ctypes gives every register its type at run time only.
        self._controller: Any = self.machine.state.controller
        self.positioner: Any = self._controller.positioner
        self._refused_before = 0

    def _act(self, action: Callable[..., Any], *args: Any) -> None:
        self.machine.act(action, self._controller, *args)

    @property
    def tick(self) -> int:
        """Base ticks since power-on."""
        return self.machine.state.tick

    def start(self) -> None:
        """Wait for the first interrupt, which takes the angle over and holds the table there."""
        while self.positioner.state == POWER_ON:
            self.machine.pass_ticks(1)

    @property
    def evidence(self) -> Evidence:
        """What the guard has seen, to be judged by an observer; its window is that of the axis and a count."""
        look = self.machine.params.controller.look_interrupts * self.spec.method.strobe_period
        window = (self.spec.method.in_position + 1) * self.spec.count
        forget = partial(self._act, controller.forget_conduct)
        return Evidence(self._controller.guard, look, self.spec.count, window, "rad", forget)

    # ------------------------------------------------------------------------------------------------------ panel

    @property
    def at_rest(self) -> bool:
        """The table has come to rest: the host has to acknowledge it."""
        return bool(self.positioner.event) and not self._controller.guard.code

    @property
    def failure(self) -> str:
        """Why the guard has switched off, and what to do; empty while it has not."""
        guard, spec = self._controller.guard, self.spec
        if guard.code in {0, NO_ARRIVAL}:
            return ""
        following = f"{format_quantity(spec.protection.following_error, 'rad')}, protection.following_error"
        speed = format_quantity(spec.limits.speed + spec.breaking_speed, "rad/s")
        return describe_fault(guard, spec.protection, speed, following=following)

    def acknowledge(self) -> None:
        """The host has seen that the table is at rest."""
        self._act(controller.acknowledge)

    def arrive_within(self, seconds: float) -> None:
        """The table must come to rest within a time [s]; 0 lifts it."""
        strobes = seconds / self.spec.method.strobe_period
        self._act(controller.arrive_within, max(1, math.floor(strobes)) if seconds else 0)

    @property
    def is_moving(self) -> bool:
        """A jog, a stop or a positioning is under way."""
        return self.positioner.state != HOLD

    @property
    def in_position(self) -> bool:
        """The table is within its window about the target."""
        return abs(self.positioner.oar - self.positioner.angle.aar) <= self.spec.method.in_position

    def press(self, direction: int, speed: float) -> None:
        """Set the dial to a table speed [rad/s] and hold a button down: 1 for +, -1 for -."""
        self._act(controller.dial, dial_of(self.spec, speed))
        self._act(controller.press, direction)

    def release(self) -> None:
        """No button."""
        self._act(controller.release)

    def begin(self, number: int) -> None:
        """Set the position number and start; the positioner takes it in its next task."""
        self._refused_before = self.positioner.refused
        self._act(controller.position, number)

    @property
    def refusal(self) -> str:
        """Why the last start was refused, and what to do; empty if it was not."""
        refused = self.positioner.refused != self._refused_before
        return TABLE_REFUSAL_TEXT[self.positioner.reason] if refused else ""

    @property
    def way(self) -> float:
        """Distance of the table from its target [rad], not signed."""
        return abs(self.positioner.oar - self.positioner.angle.aar) * self.spec.count

    # ------------------------------------------------------------------------------------------------------ times

    def stop_time(self, speed: float) -> float:
        """Time after which a released jog is at rest at the latest, with a margin [s].

        The target is a whole count: up to a count more than the braking path is made at the speed of the jog, or at
        that of an interrupt's acceleration where it is the larger.
        """
        spec, method = self.spec, self.spec.method
        count = spec.count / max(speed, spec.limits.acceleration * method.strobe_period)
        return MARGIN + 2 * (method.task_period + speed / spec.limits.acceleration + count)

    def move_time(self, way: float, speed: float) -> float:
        """Time after which a positioning has ended at the latest, with a margin [s]."""
        method = self.spec.method
        ramps = 2 * math.sqrt(way / self.spec.limits.acceleration)
        return MARGIN + self.settling_time + method.in_position_time + 2 * (way / speed + ramps)

    @property
    def settling_time(self) -> float:
        """Time in which the position loop settles, with a margin [s]."""
        return SETTLING / self.spec.method.position_gain


def dial_of(spec: RotaryTableSpec, speed: float) -> int:
    """Register of the dial for a speed of the table [rad/s]."""
    return round(spec.per_interrupt(speed))


def dial_speed(spec: RotaryTableSpec, speed: float | None) -> float:
    """Speed of a jog [rad/s], as the steps of the dial give it; None asks for the axis's largest."""
    return dial_of(spec, speed or spec.limits.speed) / spec.per_interrupt(1.0)


# ---------------------------------------------------------------------------------------------- before anything moves


def check_sequence(spec: RotaryTableSpec, job: SequenceJob) -> None:
    """Refuse a sequence that the axis cannot do, before anything moves."""
    if not job.steps:
        raise InputError.of_file(job.name, "no steps", "a sequence of at least one step", "add a step")
    faults = find_faults(job)
    faults += [(index, fault) for index, step in enumerate(job.steps) for fault in _step_faults(spec, step)]
    if faults:
        raise InputError([_problem(job, *fault) for fault in faults[:MOST_PROBLEMS]])


def _problem(job: SequenceJob, index: int, fault: FileProblem) -> FileProblem:
    """A fault of a step with its line; a job that comes from no file names the step by its number."""
    row = job.steps[index].row
    step = "step" if row else f"step[{index + 1}]"
    key = f"{step}.{fault.key}".rstrip(".")
    return replace(fault, file=job.name, line=row, column=1 if row else 0, key=key)


def _step_faults(spec: RotaryTableSpec, step: Step) -> Iterator[FileProblem]:
    """What this axis cannot do of a step: a number without an entry, a jog against dial and timer task."""
    if isinstance(step, Go) and str(step.number) not in spec.position:
        numbers = describe_numbers(sorted(int(number) for number in spec.position))
        remedy = f"name one of these, or add [position.{step.number}] to the axis file"
        yield FileProblem.of_key("go", f"position number {step.number}", numbers, remedy)
    if not isinstance(step, Jog):
        return
    top, least, task = spec.limits.speed, 1.0 / spec.per_interrupt(1.0), spec.method.task_period
    if step.speed is not None and step.speed > top * (1 + BARELY):
        allowed = f"up to limits.speed, {format_quantity(top, 'rad/s')}"
        remedy = f"write speed = {at_most(top, 'rad/s')}, or raise limits.speed"
        yield FileProblem.of_key("speed", format_quantity(step.speed, "rad/s"), allowed, remedy)
    if step.speed is not None and dial_of(spec, step.speed) < 1:
        allowed = f"a step of the dial, {format_quantity(least, 'rad/s')}, or more"
        remedy = f"write speed = {at_least(least, 'rad/s')}, or raise method.fraction_bits"
        yield FileProblem.of_key("speed", format_quantity(step.speed, "rad/s"), allowed, remedy)
    if step.duration is not None and step.duration < task * (1 - BARELY):
        allowed = f"method.task_period, {format_quantity(task, 's')}, or longer: the button is polled at this interval"
        remedy = f"write for = {at_least(task, 's')}, or shorten method.task_period"
        yield FileProblem.of_key("for", format_quantity(step.duration, "s"), allowed, remedy)


def describe_numbers(numbers: list[int]) -> str:
    """Position numbers for people, in order.

    >>> describe_numbers([0, 1, 2, 3, 7, 8])
    'the position numbers of the axis: 0 to 3, 7, 8'
    """
    if not numbers:
        return "no number: the axis has no positions"
    # Neighbours keep their distance from their places in the list.
    runs = [[n for _, n in run] for _, run in groupby(enumerate(numbers), lambda entry: entry[1] - entry[0])]
    texts = [f"{run[0]} to {run[-1]}" if len(run) > 2 else ", ".join(map(str, run)) for run in runs]
    return f"the position numbers of the axis: {', '.join(texts)}"
