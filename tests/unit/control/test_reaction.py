"""One table of what follows from a fault."""

import pytest

from detent.control.reaction import (
    LETS_GO,
    LOSES,
    RAMP_HOLD,
    RAMP_OFF,
    RULES,
    SOFT,
    TORQUE_OFF,
    is_among,
    rule_of,
)

NUMBERS = {*range(1, 8), *range(10, 15), 20, 21, *range(30, 36), 40, 41, 43, 44, *range(50, 53), 54, 55, *range(60, 68)}


def test_every_fault_of_the_table_has_a_rule():
    assert set(RULES) == NUMBERS | {51}
    assert rule_of(240).reaction == TORQUE_OFF


@pytest.mark.parametrize("code", RULES)
def test_what_the_loop_asks_is_what_the_table_says(code):
    rule, axis = RULES[code], code < 60
    assert is_among(code, LOSES) == (axis and rule.recovery == "H")
    assert is_among(code, LETS_GO) == (axis and rule.reaction == RAMP_OFF)
    assert is_among(code, SOFT) == (axis and rule.reaction in {RAMP_OFF, RAMP_HOLD})


@pytest.mark.parametrize("code", [0, 60, 101, 221, 250, 65535])
def test_numbers_outside_it_are_among_none(code):
    assert not any(is_among(code, codes) for codes in (LOSES, LETS_GO, SOFT))


@pytest.mark.parametrize("code", [1, 2, 3, 4])
def test_a_ramp_never_follows_a_doubtful_sensor(code):
    assert not is_among(code, SOFT)
