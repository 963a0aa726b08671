"""Do the limits hold, and are bad logs refused? Simulated logs whose truth is known, from the file to the verdict.

The full set has 350 good and 150 bad logs; `DETENT_TRUST_LOGS` runs another number, three in ten of them bad, from the
case `DETENT_FIRST_CASE` on. `python -m tests.trust` writes its figures into docs/explanation/trust-table.md.
"""

import os

import pytest
from scipy.stats import binom

from tests.trust.judge import FIRST_BAD, judge_all, judge_number, numbers_of
from tests.trust.plants import BAD, make_case
from tests.trust.table import CONSTANTS, coverage_table, figures_of, page, sections

GOOD_LOGS, BAD_LOGS = 350, 150

LEAST, MOST = 0.93, 0.975
"""Share of the trusted intervals of a constant that hold the truth."""

MOST_ACCEPTED, MOST_REFUSED = 0.02, 0.05
"""Share of the bad logs that may be accepted, and of the good ones that may be refused."""

DOUBT = 0.005
"""How often chance alone may fail the reduced set, in each of its assertions."""


def asked_numbers():
    """The cases that the environment asks for."""
    count = int(os.environ.get("DETENT_TRUST_LOGS", GOOD_LOGS + BAD_LOGS))
    bad = round(0.3 * count)
    return numbers_of(count - bad, bad, int(os.environ.get("DETENT_FIRST_CASE", "0")))


@pytest.fixture(scope="module")
def reduced():
    # In this process, which has loaded all that the identification needs: its neighbour runs other tests meanwhile.
    return figures_of(judge_all(numbers_of(40, 3 * len(BAD)), workers=1))


@pytest.mark.early
@pytest.mark.wide
def test_limits_hold_in_a_few_logs(reduced):
    """At 0.95, 35 intervals leave chance 29 to 35 hits: so few logs find gross errors only."""
    for c in reduced.coverage:
        assert c.accepted >= 30, c
        assert c.inside >= binom.ppf(DOUBT, c.accepted, 0.95), coverage_table(reduced)
    hits, trusted = (sum(getattr(c, what) for c in reduced.coverage) for what in ("inside", "accepted"))
    # The constants of one log err together, as if it held half as many.
    assert hits / trusted >= binom.ppf(DOUBT, trusted // 2, 0.95) / (trusted // 2)
    assert hits < trusted  # intervals that always hold the truth are too wide


@pytest.mark.wide
def test_bad_logs_are_refused_in_a_few_logs(reduced):
    assert {j.bad for j in reduced.bad} == set(BAD)
    assert len(reduced.accepted_bad) <= binom.ppf(1 - DOUBT, len(reduced.bad), MOST_ACCEPTED), reduced.accepted_bad


@pytest.mark.wide
def test_good_logs_are_accepted_in_a_few_logs(reduced):
    assert len(reduced.refused_good) <= binom.ppf(1 - DOUBT, len(reduced.good), MOST_REFUSED), reduced.refused_good


@pytest.mark.wide
def test_intervals_are_narrow_enough_to_be_of_use(reduced):
    for c in reduced.coverage:
        assert c.width < {"mass": 0.02, "delay": 2.0}.get(c.name, 0.06), c


@pytest.mark.wide
def test_the_page_holds_all_figures(reduced):
    text = page(reduced, reduced, 0)
    assert text.count(coverage_table(reduced)) == 2
    assert "40 good and 21 bad logs" in text
    assert all(f"`{name}`" in text and kind in text for name in CONSTANTS for kind in BAD)


def test_a_number_is_always_the_same_case():
    ours, theirs = make_case(7), make_case(7)
    assert ours.truth == theirs.truth
    assert all((ours.columns[name] == theirs.columns[name]).all() for name in ours.columns)
    assert make_case(8).truth != ours.truth
    assert judge_number(FIRST_BAD).bad == BAD[0]


@pytest.fixture(scope="module")
def full():
    return figures_of(judge_all(asked_numbers()))


@pytest.mark.long
@pytest.mark.parametrize("name", CONSTANTS)
def test_limits_hold(full, name):
    c = next(c for c in full.coverage if c.name == name)
    assert LEAST <= c.share <= MOST, coverage_table(full)


@pytest.mark.long
def test_bad_logs_are_refused(full):
    assert len(full.accepted_bad) <= MOST_ACCEPTED * len(full.bad), sections(full)


@pytest.mark.long
def test_good_logs_are_accepted(full):
    assert len(full.refused_good) <= MOST_REFUSED * len(full.good), sections(full)
