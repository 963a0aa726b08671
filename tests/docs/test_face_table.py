"""The page of the clients of the faces: it is what its figures make of it, and belongs to the tests that there are."""

import copy
import json

from tests import face_table_page as of
from tests import foreign

FOUND = json.loads(of.KEPT.read_text(encoding="utf-8"))
AGAIN = "run python -m tests.face_table again"


def test_the_page_is_made_of_what_is_kept():
    assert of.page(FOUND) == of.PAGE.read_text(encoding="utf-8"), AGAIN


def test_it_belongs_to_the_present_tests_and_clients():
    assert of.kept_tests(FOUND) == of.present_tests(), AGAIN
    assert set(of.CLIENTS) <= set(FOUND["tests"]), AGAIN
    pinned = of.names_of(foreign)
    assert all(pinned.get(name, version) == version for name, version in FOUND["versions"].items()), AGAIN


def test_all_passed():
    assert {one["outcome"] for one in FOUND["tests"].values()} <= set(of.PASSED)


def test_what_failed_or_was_not_run_is_said():
    found = copy.deepcopy(FOUND)
    test = "test_20_pymodbus"
    found["tests"][test]["outcome"] = "failed"
    assert any("pymodbus" in row and "| failed |" in row for row in of.client_rows(found))
    assert any(f"`{test}` failed" in row for row in of.rows_by_number(found))
    del found["tests"][test]
    assert any("pymodbus" in row and "| not run |" in row for row in of.client_rows(found))
