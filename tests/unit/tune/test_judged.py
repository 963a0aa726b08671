"""Limits as a person writes them, yields, and why cases fail."""

import numpy as np
import pytest

from detent.errors import DetentError
from detent.tune.batch import Chunk, Limit, Quantity
from detent.tune.judged import ALL, Judged, Yield, limit_text, parse_limit

KNOWN = (
    Quantity("done", "", 1.0), Quantity("peak_following", "m", 4e-5), Quantity("move 1 settling", "s", 0.1),
    Quantity("moves", "", 2.0),
)  # fmt: skip


@pytest.mark.parametrize(
    ("text", "limit"),
    [
        ("peak_following <= 45 um", Limit("peak_following", 45e-6)),
        ("peak following<=45um", Limit("peak_following", 45e-6)),
        (" Peak_Following >= 1 nm ", Limit("peak_following", 1e-9, least=True)),
        ("move 1 settling <= 50 ms", Limit("move 1 settling", 0.05)),
        ("moves >= 2", Limit("moves", 2.0, least=True)),
    ],
)
def test_a_limit_is_read_as_it_is_written(text, limit):
    found = parse_limit(text, KNOWN)
    assert (found.quantity, found.least) == (limit.quantity, limit.least)
    assert found.value == pytest.approx(limit.value)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("peak_following < 45 um", '"peak_following <= 12 mm"'),
        ("peak_following", "QUANTITY <= VALUE"),
        ("peak_folowing <= 45 um", 'did you mean "peak_following"'),
        ("temperature <= 45 um", "name one of done, peak_following, moves"),
        ("peak_following <= 45", "bare number"),
        ("peak_following <= 45 ms", "a length"),
        ("moves >= 2 m", "it has no unit"),
    ],
)
def test_what_is_no_limit_is_told(text, told):
    with pytest.raises(DetentError) as refused:
        parse_limit(text, KNOWN)
    assert told in str(refused.value)


def test_a_limit_is_told_in_the_unit_of_people():
    units = {one.name: one.unit for one in KNOWN}
    assert limit_text(Limit("peak_following", 45e-6), units) == "peak_following <= 45 um"
    assert limit_text(Limit("done", 1.0, least=True), units) == "done"


@pytest.mark.parametrize(("good", "of"), [(965, 1000), (100, 100), (0, 50), (1, 2)])
def test_so_many_more_halve_the_interval(good, of):
    one = Yield("", good, of)
    low, high = one.interval
    after = Yield("", round(one.share * (of + one.more)), of + one.more).interval
    before = Yield("", round(one.share * (of + one.more - 1)), of + one.more - 1).interval
    assert after[1] - after[0] <= 0.5 * (high - low) < before[1] - before[0]


def judged() -> Judged:
    number = np.arange(10)
    following = np.where(number == 7, np.nan, number * 1e-5)
    reason = np.where(number == 7, "backlash without stiffness", "")
    done = (number != 7).astype(float)
    results = {"done": done, "peak_following": following, "move 1 settling": done, "moves": following * np.nan}
    cases = Chunk(0, {"mechanics.load_mass": number / 1.0}, results, reason)
    limits = (
        Limit("done", 1.0, least=True),
        Limit("peak_following", 5.5e-5),
        Limit("peak_following", 1e-5, least=True),
    )
    return Judged(cases, KNOWN, limits)


def test_yields_are_of_all_limits_and_of_each():
    found = {one.name: (one.good, one.of) for one in judged().yields}
    assert found == {
        ALL: (5, 10), "done": (9, 10), "peak_following <= 55 um": (6, 10), "peak_following >= 10 um": (8, 10)
    }  # fmt: skip


def test_why_cases_fail_with_the_first_of_them():
    assert [tuple(one) for one in judged().failures] == [
        ("not peak_following <= 55 um", 3, (6, 8, 9)),
        ("backlash without stiffness", 1, (7,)),
        ("not peak_following >= 10 um", 1, (0,)),
    ]


def test_how_a_quantity_spreads_is_of_the_cases_that_have_it():
    figure = judged().figures["peak_following"]
    assert (figure.nominal, figure.least, figure.most) == (4e-5, 0.0, 9e-5)
    assert figure.mean == pytest.approx(38e-5 / 9)
    assert figure.low == pytest.approx(0.4e-5)
    assert "moves" not in judged().figures


def test_a_row_is_worth_what_is_of_the_whole_job_or_limited():
    assert [one.name for one in judged().told] == ["done", "peak_following"]
