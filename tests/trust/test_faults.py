"""Faults that nobody planned for: what of a spoilt log is trusted agrees with the clean log, or is refused.

`python -m tests.trust.wild` judges all kinds and writes docs/explanation/fault-table.md.
"""

import numpy as np
import pytest

from tests.places import DATA
from tests.trust.drawn import DRAWN
from tests.trust.hidden import CLEAR, standard_errors
from tests.trust.unseen import UNSEEN
from tests.trust.wild import (
    CHOSEN,
    KINDS,
    Outcome,
    clean,
    found_in,
    judge_faults,
    left_outside,
    page,
    truth,
)

LOGS = ("simulated 7005",)
FEW = tuple(k for k in range(0, len(KINDS), 8) if not KINDS[k].is_another)


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


@pytest.mark.long
@pytest.mark.skipif(not DATA.exists(), reason="the recordings are not at hand")
def test_usual_dirt_in_sizes_by_lot_is_refused_or_right():
    """Two of a hundred logs wrong at most, and five with a value outside the interval of the clean log.

    The widths of the intervals of right values alone put about as many there (`left_outside`).
    """
    found = judge_faults([number for number, fault in enumerate(KINDS) if fault in DRAWN])
    assert len(found) > 100
    assert sum(bool(o.disjoint) for o in found) <= 0.02 * len(found), [o for o in found if o.disjoint]
    assert sum(bool(o.outside) for o in found) <= 0.05 * len(found), [o for o in found if o.outside]
    assert sum(o.by_chance for o in found) > 0.04 * len(found)


@pytest.mark.long
@pytest.mark.skipif(not DATA.exists(), reason="the recordings are not at hand")
def test_kinds_that_no_rule_was_chosen_with_are_refused_or_right():
    """Two of a hundred logs wrong at most, of kinds put together by lot.

    Five with a value outside cannot be asked for: right values whose intervals are wider make more than that alone.
    """
    found = judge_faults([k for k, fault in enumerate(KINDS) if fault in UNSEEN and not fault.is_another])
    assert len(found) > 1000
    assert sum(bool(o.disjoint) for o in found) <= 0.02 * len(found)
    outside, by_chance = sum(bool(o.outside) for o in found), sum(o.by_chance for o in found)
    assert by_chance > 0.1 * len(found)
    assert outside < 1.2 * by_chance


def test_the_page_counts_each_log_once():
    a, b = "simulated 7001", "simulated 7101"
    wrong = {"disjoint": ("mass",), "outside": ("mass",), "beyond": ("mass",), "hidden": True, "by_chance": 0.3}
    outcomes = [
        Outcome(a, CHOSEN[0].name, "trusted", **wrong),
        Outcome(b, CHOSEN[0].name, "refused"),
        Outcome(b, UNSEEN[0].name, "partly trusted"),
    ]
    text = page(outcomes)
    assert f"| {CHOSEN[0].name} | 2 | 0 | 1 | 1 | 1 | 0.3 | 1 | 1 |" in text
    assert f"| {UNSEEN[0].name} | 1 | 1 | 0 | 0 | 0 | 0.0 | 0 | 0 |" in text
    assert "| of logs chosen with | 1 | 0.0 % | 100.0 % | 0.0 % | 100.0 % | 30.0 % | 100.0 % | 100.0 % |" in text
    assert "| of other logs | 1 | 0.0 % | 0.0 % | 100.0 % | 0.0 % | 0.0 % | 0.0 % | 0.0 % |" in text


@pytest.mark.parametrize(("gain", "hidden"), [(1.0002, True), (1.5, False)])
def test_a_fault_is_hidden_where_the_best_test_for_it_does_not_see_it(gain, hidden):
    """Another gain of the effort one way: a little of it is less than the noise."""
    made = clean(LOGS[0])
    effort = made.table["effort"]
    spoilt = found_in(made, made.table | {"effort": np.where(effort > 0.0, gain * effort, effort)})
    assert not isinstance(spoilt, str)
    assert (standard_errors(spoilt, truth(LOGS[0])) < CLEAR) == hidden


def test_the_constants_of_another_axis_explain_an_effort_of_another_gain():
    """All constants are larger by it; of a third more the log shows nothing."""
    made = clean(LOGS[0])
    spoilt = found_in(made, made.table | {"effort": 1.3 * made.table["effort"]})
    assert not isinstance(spoilt, str)
    assert standard_errors(spoilt, truth(LOGS[0])) < CLEAR


@pytest.mark.parametrize("wider", [1.5, 3.0, 10.0])
def test_what_a_wider_interval_leaves_outside_by_chance(wider):
    """The clean value is right within its interval; what noise adds to it has the variance that is on top."""
    rng = np.random.default_rng(4)
    added = np.sqrt(wider**2 - 1.0) * rng.normal(size=200_000)
    assert left_outside(wider) == pytest.approx(float(np.mean(np.abs(added) > 1.96)), abs=0.004)
