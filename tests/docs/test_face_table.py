"""The page of the clients of the faces: it is what its figures make of it, and belongs to the tests that there are."""

import copy
import json

from tests import foreign
from tests.face_table_page import (
    CLIENTS,
    KEPT,
    PAGE,
    PASSED,
    client_rows,
    names_of,
    page,
    test_rows,
    tests_now,
    tests_of,
)

FOUND = json.loads(KEPT.read_text(encoding="utf-8"))
AGAIN = "run python -m tests.face_table again"


def test_the_page_is_made_of_what_is_kept():
    assert page(FOUND) == PAGE.read_text(encoding="utf-8"), AGAIN


def test_it_belongs_to_the_present_tests_and_clients():
    assert tests_of(FOUND) == tests_now(), AGAIN
    assert set(CLIENTS) <= set(FOUND["tests"]), AGAIN
    pinned = names_of(foreign)
    assert {name: FOUND["versions"][name] for name in FOUND["versions"].keys() & pinned} == {
        name: pinned[name] for name in FOUND["versions"].keys() & pinned
    }, AGAIN


def test_all_passed():
    assert {one["outcome"] for one in FOUND["tests"].values()} <= set(PASSED)


def test_what_failed_or_was_not_run_is_said():
    found = copy.deepcopy(FOUND)
    test = "test_20_pymodbus"
    found["tests"][test]["outcome"] = "failed"
    assert any("pymodbus" in row and "| failed |" in row for row in client_rows(found))
    assert any(f"`{test}` failed" in row for row in test_rows(found))
    del found["tests"][test]
    assert any("pymodbus" in row and "| not run |" in row for row in client_rows(found))
