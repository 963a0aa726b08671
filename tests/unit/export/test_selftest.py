"""The calls of a self-test: which they are, and what their hash is of."""

from tests.firmware_steps import Limits, State
from tests.unit.export.test_drawn import Wires, control, put_on

from detent.export.selftest import CALLS, ENTRIES, EVERY, self_test
from detent.export.unit import ControlUnit
from detent.kernel.image import add_bytes, begin_hash

UNIT = ControlUnit("t", Limits, State, Wires, {"t_control": control, "t_put_on": put_on})
PARAMS = Limits(form=1, shift=3, wide=5, gain=0.25)


def test_the_first_call_puts_it_on_and_ticks_come_between_actions():
    found = self_test(UNIT, PARAMS)
    assert len(found.calls) == CALLS == 64
    first, second, *_ = found.calls
    assert (first.name, len(first.numbers), first.numbers[0] >= 0) == ("t_put_on", 1, True)
    assert second.name == "t_control"  # it has no other action
    assert sum(bool(one.shown) for one in found.calls) > CALLS // 2
    assert {leaf.path for one in found.calls for leaf, _ in one.shown} == {"l.count"}
    assert found.laid == ()
    assert (ENTRIES, CALLS % EVERY) == (16, 0)


def test_the_hash_is_that_of_the_registers_behind_the_calls_made_one_by_one():
    found, state, lines = self_test(UNIT, PARAMS), State(), Wires()
    for one in found.calls:
        for leaf, value in one.shown:
            setattr(lines, leaf.path.removeprefix("l."), value)
        if one.name == "t_control":
            control(PARAMS, state, lines)
        else:
            put_on(state, lines, *one.numbers)
    wanted = begin_hash()
    for registers, root in ((state, "c."), (lines, "l.")):
        memory = bytes(registers)
        for leaf in type(registers).leaves(root):
            add_bytes(wanted, memory[leaf.offset : leaf.offset + leaf.width.size * max(leaf.length, 1)])
    assert found.hash == wanted.number


def test_it_is_the_same_every_time_and_another_for_other_parameters():
    assert self_test(UNIT, PARAMS) == self_test(UNIT, PARAMS)
    assert self_test(UNIT, Limits(form=1, shift=3, wide=5, gain=0.5)).hash != self_test(UNIT, PARAMS).hash


def test_the_parameters_stay_what_they_are():
    before = bytes(PARAMS)
    self_test(UNIT, PARAMS)
    assert bytes(PARAMS) == before
