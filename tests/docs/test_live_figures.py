"""The page of what a live axis did in wall time: it is what its figures make of it, and says what is not reached."""

import copy
import json

import pytest
from tests.live_figures_page import KEPT, PAGE, kills_of, missed, page, quantile, soak_of, verdicts

FOUND = json.loads(KEPT.read_text(encoding="utf-8"))


def test_the_page_is_made_of_what_is_kept():
    assert page(FOUND) == PAGE.read_text(encoding="utf-8")


def told(found, words):
    """The verdict on an aim."""
    (row,) = [row for row in verdicts(found) if words in row]
    return row.split("|")[-2].strip()


@pytest.mark.parametrize(
    ("part", "value", "words"),
    [
        ("lateness.thread.skipped", (0, 100_000), "that never yields"),
        ("lateness.page.skipped", (0, 100_000), "drive on CANopen"),
        ("lateness.python.skipped", (100_000, 0), "plain Python misses"),
        ("stops.idle.taken", ([1.0, 49.0], [1.0, 51.0]), "nothing added"),
        ("stops.load.taken", ([1.0, 49.0], [1.0, 51.0]), "each processor"),
        ("kills.kills", (50_000, 49_999), "kills"),
        ("soak.grown", (0.009, 0.011), "memory"),
        ("hour cascade.faults", (0, 1), "false alarm"),
    ],
)
def test_what_is_not_reached_is_said_to_be_so(part, value, words):
    found = copy.deepcopy(FOUND)
    for name in ("cascade", "filtered_servo", "phase_servo", "rotary_table", "print_head", "zoom"):
        found[f"hour {name}"] = {"faults": 0, "motions": 1, "where": {}}
    found["soak"] |= {"seconds": 1800.0, "fault": None}
    found = {name: one for name, one in found.items() if name not in ("long kills", "long soak")}
    *blocks, name = part.split(".")
    for good, verdict in zip(value, ("reached", "**not reached**"), strict=True):
        one = found
        for block in blocks:
            one = one[block]
        one[name] = good
        assert told(found, words) == verdict


def test_a_soak_that_was_short_or_met_a_fault_is_not_reached():
    for more in ({"seconds": 60.0, "fault": None}, {"seconds": 1800.0, "fault": {"code": 50, "text": ""}}):
        assert told({**FOUND, "long soak": {**FOUND["soak"], "grown": 0.0, **more}}, "memory") == "**not reached**"


def test_the_longer_run_counts():
    longer = {**FOUND, "long kills": {"kills": 10**6}, "long soak": {"seconds": 1800.0}}
    assert (kills_of(longer)["kills"], soak_of(longer)["seconds"]) == (10**6, 1800.0)


def test_quantiles_and_shares():
    assert missed({"late": [5, 3], "skipped": 2}) == 0.2
    assert [quantile([1.0, 2.0, 3.0, 4.0], share) for share in (0.5, 0.51, 0.99, 1.0)] == [2.0, 3.0, 4.0, 4.0]
