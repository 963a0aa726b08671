"""What an axis has along its way: a switch at one side, index marks of its encoder, limit switches at both ends."""

import math
from typing import Any

from detent.kernel.registers import Registers, block, f8, i8, register, u1
from detent.kernel.step import step
from detent.sensing.position_sensor import EncoderWord


class HomeWires(Registers):
    """The switch, and what the encoder has latched at its last index mark."""

    switch: u1 = register("1 on the home switch")
    marks: i8 = register("index marks passed", unit="count")
    mark: EncoderWord = block("encoder at the last one")


class HomeLevels(Registers):
    """The same two wires of an axis whose controller counts for itself: what it had counted at a mark is its own."""

    switch: u1 = register("1 on the home switch")
    marks: i8 = register("index marks passed", unit="count")


class EndWires(Registers):
    """The circuits of both limit switches: closed while nothing stands on them, so that a wire that breaks is seen."""

    lower: u1 = register("1 while the circuit of the lower limit switch is closed")
    upper: u1 = register("1 while that of the upper one is")


class EndSwitchParams(Registers):
    """Where the limit switches are."""

    present: u1 = register("1 where there are any")
    lower: f8 = register("where the lower one opens", unit="m")
    upper: f8 = register("where the upper one opens", unit="m")


class HomeMarksParams(Registers):
    """Where they are."""

    present: u1 = register("1 where there are any")
    side: f8 = register("side of its edge on which the switch is on, 1 or -1", unit="1")
    edge: f8 = register("edge of the switch", unit="m")
    mark: f8 = register("an index mark", unit="m")
    pitch: f8 = register("way from one to the next; 0: there are none", unit="m")


class HomeMarks(Registers):
    """Between which marks the axis is."""

    cell: i8 = register("number of the mark below it", unit="count")


@step
def latch(word: EncoderWord, travel: float, position: float) -> None:
    """The nearest count of a scale at `position` [m], `travel` [m] per count; without counts the position itself."""
    word.lost = 0
    if travel == 0.0:
        word.place = position
    else:
        word.count = math.floor(position / travel + 0.5)


@step
def sense_marks(p: HomeMarksParams, r: HomeMarks, wires: Any, position: float) -> None:
    """Switch and marks with the axis at `position` [m], on `HomeWires` or `HomeLevels`."""
    wires.switch = 1 if (position - p.edge) * p.side >= 0.0 else 0
    if p.pitch > 0.0:
        cell = math.floor((position - p.mark) / p.pitch)
        if cell != r.cell:
            wires.marks += 1
            r.cell = cell


@step
def sense_home(p: HomeMarksParams, r: HomeMarks, wires: HomeWires, position: float, travel: float) -> None:
    """The same, with what an encoder of `travel` [m] per count latches at a mark."""
    before = r.cell
    sense_marks(p, r, wires, position)
    if r.cell != before:
        latch(wires.mark, travel, p.mark + max(before, r.cell) * p.pitch)


@step
def sense_ends(p: EndSwitchParams, wires: EndWires, position: float) -> None:
    """Limit switches with the load at `position` [m]."""
    wires.lower = 1 if position > p.lower else 0
    wires.upper = 1 if position < p.upper else 0


def stand_home(p: HomeMarksParams, r: HomeMarks, wires: HomeWires | HomeLevels, position: float) -> None:
    """At power-on an axis has passed no mark."""
    wires.switch = int(bool(p.present) and (position - p.edge) * p.side >= 0.0)
    r.cell = math.floor((position - p.mark) / p.pitch) if p.pitch > 0.0 else 0
