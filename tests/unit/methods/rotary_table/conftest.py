"""The rotary table's good axis file, and the axis that a file describes."""

import math
from importlib.resources import files

import pytest
from tests.rotary_table_rig import NO_TRACE

from detent.kernel.loop import advance
from detent.methods.load import load_spec
from detent.methods.rotary_table.build import build_rotary_table, start_turns, ticks
from detent.methods.rotary_table.system import RotaryTable, switch_on

EXAMPLE = files("detent").joinpath("examples/rotary_table.toml")


@pytest.fixture(scope="session")
def good_text():
    """Text of the packaged example, without its head comment (line 1 is ``[axis]``)."""
    text = EXAMPLE.read_text(encoding="utf-8")
    return text[text.index("[axis]") :]


class Bench:
    """The axis that a file describes."""

    def __init__(self, overrides: tuple[str, ...]) -> None:
        self.spec = load_spec(EXAMPLE, overrides)
        self.p, self.r = build_rotary_table(self.spec), RotaryTable()
        self.start = start_turns(self.spec)
        switch_on(self.p, self.r, self.start, ticks(self.spec.method.task_phase), self.spec.detector.seed)

    def run(self, seconds: float) -> "Bench":
        left = round(seconds * 1e4)
        while left > 0:
            left -= advance(self.p, self.r, left, *NO_TRACE)
            self.r.controller.positioner.event = 0
        return self

    def jog(self, sign: int) -> "Bench":
        positioner = self.r.controller.positioner
        positioner.dial = round(self.spec.per_interrupt(self.spec.limits.speed))
        positioner.plus, positioner.minus = sign > 0, sign < 0
        return self

    def go(self, number: int) -> "Bench":
        self.r.controller.positioner.number, self.r.controller.positioner.start = number, 1
        return self

    @property
    def travel(self) -> float:
        """True way since power-on, at the table [deg]."""
        motor = self.r.plant.train.motor
        return (motor.turns - self.start + motor.angle / (2 * math.pi)) * 360 / self.spec.ratio


@pytest.fixture(scope="session")
def bench_of():
    """Make the axis of the example with overrides."""
    return Bench
