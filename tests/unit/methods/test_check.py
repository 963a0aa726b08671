"""What `detent check` has to show: values in effect, with what the method derives and warns about."""

import json

import pytest

from detent.methods.check import check_spec
from detent.methods.registry import METHODS


@pytest.fixture(scope="module")
def report(load_text, good_text):
    return check_spec(load_text(good_text, "method.span=emf"))


def test_figures_and_warnings_are_those_of_the_method(load_text, good_text):
    axis = load_text(good_text, "disturbance.motor_constant=+10 %")
    report, method = check_spec(axis), METHODS["print_head"]
    assert report.derived == method.derive(axis.spec) != ()
    assert report.warnings == tuple(method.cautions(axis.spec)) != ()


def test_rows_hold_every_value_with_its_origin(report):
    rows = {row.key: row for row in report.rows}
    assert rows["limits.travel"].value == "368.3 mm"
    assert rows["limits.travel"].written == "14.5 in"
    assert rows["limits.travel"].origin == "axis.toml line 7"
    assert rows["motor.resistance"].origin == "catalogue JDH-2250-DF-1C (inferred)"
    assert rows["method.span"].origin == "--set"
    assert rows["method.trim"].origin == "default"
    assert rows["mechanics.start_position"].value == "92.08 mm"
    assert "disturbance.obstacle.position" not in rows


def test_an_optional_table_that_is_given_is_shown(load_text, good_text):
    rows = {row.key: row for row in check_spec(load_text(good_text, "disturbance.obstacle.position=7 in")).rows}
    assert rows["disturbance.obstacle.position"].value == "177.8 mm"


def test_the_report_is_plain_data_for_json(report):
    data = json.loads(json.dumps(report.to_dict()))
    assert data["name"] == "print head"
    assert data["method"] == "print_head"
    assert data["rows"][0]["key"] == "axis.name"
    assert data["warnings"] == []
