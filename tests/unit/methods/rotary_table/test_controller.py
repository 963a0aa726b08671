"""The controller alone, on wires written by hand: its clocks, its entries, its mailbox."""

import pytest
from tests.rotary_table_rig import FINE, make_params

from detent.control.table_positioner import HOLD, JOG, POWER_ON
from detent.methods.rotary_table.controller import TableController, TableLines, control, power_on


class Bench:
    """A controller at power-on; its task has its first pass at tick 5, between interrupts."""

    def __init__(self):
        self.p, self.c, self.lines = make_params().controller, TableController(), TableLines()
        power_on(self.p, self.c, self.lines, 5)

    def run(self, ticks):
        """Let ticks pass; those in which the wire of the strobe, and that of the interrupt, was up."""
        strobes, interrupts = [], []
        for _ in range(ticks):
            if self.lines.strobe:
                strobes.append(self.c.tick)
            control(self.p, self.c, self.lines)
            if self.lines.interrupt:
                interrupts.append(self.c.tick - 1)
        return strobes, interrupts


def test_the_comparators_are_told_a_tick_ahead_and_the_interrupt_follows():
    bench = Bench()
    assert bench.run(100) == ([0, 20, 40, 60, 80], [2, 22, 42, 62, 82])
    assert bench.c.positioner.passes == 1


def test_the_words_are_taken_at_the_strobe_only():
    bench = Bench()
    bench.lines.fine, bench.lines.coarse = 100, 0
    bench.run(1)
    assert bench.c.absolute.theta == 100
    bench.lines.fine = 105
    bench.run(19)
    assert (bench.c.absolute.theta, bench.c.positioner.angle.dar) == (100, 100)
    bench.run(1)
    assert (bench.c.absolute.theta, bench.c.positioner.angle.dar) == (105, 100)
    bench.run(2)
    assert bench.c.positioner.angle.dar == 105


def test_register_5_holds_the_word_between_interrupts():
    bench = Bench()
    bench.run(3)
    assert (bench.c.positioner.state, bench.lines.word) == (HOLD, 0)
    bench.lines.fine = FINE - 7  # the table has moved back
    bench.run(20)
    assert bench.lines.word == bench.c.positioner.s4 > 0
    held = bench.lines.word
    bench.lines.fine = 0
    bench.run(19)
    assert bench.lines.word == held


@pytest.mark.parametrize(("direction", "buttons"), [(1, (1, 0)), (-1, (0, 1))])
def test_buttons_and_dial(direction, buttons):
    bench = Bench()
    c = bench.c
    assert c.positioner.state == POWER_ON
    c.positioner.dial, c.positioner.plus, c.positioner.minus = 1234, *buttons
    bench.run(6)
    assert (c.positioner.state, c.positioner.z) == (JOG, direction)


def test_a_number_waits_for_the_task():
    bench = Bench()
    bench.c.positioner.number, bench.c.positioner.start = 3, 1
    bench.run(5)
    assert (bench.c.positioner.start, bench.c.positioner.number) == (1, 3)
    bench.run(1)
    assert (bench.c.positioner.start, bench.c.positioner.refused) == (0, 1)  # the table has no positions
