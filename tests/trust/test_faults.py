"""Faults that nobody planned for: what of a spoilt log is trusted agrees with the clean log, or is refused.

`python -m tests.trust.wild` judges all kinds and writes docs/explanation/fault-table.md.
"""

import numpy as np
import pytest

from tests.trust.unseen import UNSEEN
from tests.trust.wild import CHOSEN, KINDS, Outcome, clean, judge_faults, left_outside, page

LOGS = ("simulated 7005",)
FEW = tuple(range(0, len(KINDS), 8))


def test_there_are_kinds_enough_and_each_spoils_the_log():
    """A fault that changes nothing would count as accepted and right."""
    assert len(CHOSEN) >= 40
    assert len(UNSEEN) >= 15
    assert len({fault.name for fault in KINDS}) == len(KINDS)
    table = clean(LOGS[0]).table
    for fault in KINDS:
        made = fault.spoil({k: v.copy() for k, v in table.items()}, np.random.default_rng(1))
        assert len({len(v) for v in made.values()}) == 1, fault.name
        same = made.keys() == table.keys() and all(np.array_equal(made[k], table[k]) for k in table)
        assert not same, fault.name


@pytest.mark.wide
def test_few_spoilt_logs_are_accepted_and_wrong():
    found = judge_faults(FEW, LOGS, workers=1)
    wrong = [o for o in found if o.disjoint]
    assert len(wrong) <= 1, wrong
    assert any(not o.is_refused for o in found)


def test_the_page_counts_each_log_once():
    outcomes = [
        Outcome("a", CHOSEN[0].name, "trusted", disjoint=("mass",), outside=("mass",), beyond=("mass",)),
        Outcome("b", CHOSEN[0].name, "refused"),
        Outcome("a", UNSEEN[0].name, "partly trusted"),
    ]
    text = page(outcomes)
    assert f"| {CHOSEN[0].name} | 2 | 0 | 1 | 1 | 1 | 1 |" in text
    assert f"| {UNSEEN[0].name} | 1 | 1 | 0 | 0 | 0 | 0 |" in text


@pytest.mark.parametrize("wider", [1.5, 3.0, 10.0])
def test_what_a_wider_interval_leaves_outside_by_chance(wider):
    """The clean value is right within its interval; what noise adds to it has the variance that is on top."""
    rng = np.random.default_rng(4)
    added = np.sqrt(wider**2 - 1.0) * rng.normal(size=200_000)
    assert left_outside(wider) == pytest.approx(float(np.mean(np.abs(added) > 1.96)), abs=0.004)
