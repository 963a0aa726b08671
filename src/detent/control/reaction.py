"""What follows from a fault: how the axis reacts, whether its position is still believed, and how the fault is left.

One table for every method. A ramp steers by its feedback, and so comes only where that is still believed; everything
else takes the torque away at once.
"""

from typing import NamedTuple

from detent.kernel.step import hot_step

TORQUE_OFF, RAMP_OFF, RAMP_HOLD, REFUSE, WARN = range(5)
REACTION_NAMES = ("torque off", "ramp, then torque off", "ramp, then hold", "refused", "warning")


class Rule(NamedTuple):
    """Of a fault."""

    reaction: int
    # A reset; E mend, reset, enable; H as E, and find the reference anew; C correct the file; S start anew; "" none
    recovery: str


RULES = {
    1: Rule(TORQUE_OFF, "H"), 2: Rule(TORQUE_OFF, "H"), 3: Rule(TORQUE_OFF, "H"), 4: Rule(TORQUE_OFF, "H"),
    5: Rule(RAMP_OFF, "H"), 6: Rule(RAMP_OFF, "H"), 7: Rule(REFUSE, "H"),
    10: Rule(RAMP_OFF, "E"), 11: Rule(RAMP_OFF, "E"), 12: Rule(TORQUE_OFF, "H"), 13: Rule(RAMP_HOLD, "A"),
    14: Rule(RAMP_OFF, "E"),
    20: Rule(TORQUE_OFF, "E"), 21: Rule(RAMP_OFF, "A"),
    30: Rule(RAMP_HOLD, "A"), 31: Rule(REFUSE, ""), 32: Rule(RAMP_HOLD, "A"), 33: Rule(RAMP_OFF, "E"),
    34: Rule(RAMP_HOLD, "H"), 35: Rule(REFUSE, "H"),
    40: Rule(TORQUE_OFF, "E"), 41: Rule(RAMP_HOLD, ""), 43: Rule(REFUSE, ""), 44: Rule(REFUSE, ""),
    50: Rule(RAMP_HOLD, "A"), 51: Rule(TORQUE_OFF, "E"), 52: Rule(TORQUE_OFF, "E"), 54: Rule(RAMP_OFF, "S"),
    55: Rule(WARN, "A"),
    60: Rule(REFUSE, "C"), 61: Rule(REFUSE, ""), 62: Rule(REFUSE, "H"), 63: Rule(WARN, "A"), 64: Rule(REFUSE, "H"),
    65: Rule(REFUSE, "H"), 66: Rule(REFUSE, "C"), 67: Rule(REFUSE, "H"),
}  # fmt: skip
"""By the number of the fault. An encoder that was not heard (1) may have counted on unseen, and one that seems to count
the wrong way round, or too fast (4, 12), tells nobody where the axis is: its reference has to be found anew. A number
that is not here, of a method's own electronics, has taken the torque away."""

IN_MOTION = 60  # numbers below: faults of an axis; above: of files and tables
LOSES = sum(1 << code for code, rule in RULES.items() if code < IN_MOTION and rule.recovery == "H")
DOUBTS = 1 << 10 | 1 << 11
"""What a load does as well as a sensor that counts no more: where that one counts alone, the position is then lost."""
LETS_GO = sum(1 << code for code, rule in RULES.items() if code < IN_MOTION and rule.reaction == RAMP_OFF)
SOFT = sum(1 << code for code, rule in RULES.items() if code < IN_MOTION and rule.reaction in (RAMP_OFF, RAMP_HOLD))
"""Faults at which the drive goes on, so that the axis can be brought to rest: a bit per number."""


@hot_step
def is_among(code: int, codes: int) -> bool:
    """True for a fault among these: a bit per number."""
    return code < IN_MOTION and codes >> code & 1 != 0


def rule_of(code: int) -> Rule:
    """Rule of a fault; of one that the table does not know, the safest."""
    return RULES.get(code, Rule(TORQUE_OFF, "E"))
