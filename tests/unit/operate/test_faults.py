"""What can be injected, as it is said; records as they are told."""

from typing import Any

import pytest

from detent.control.reaction import RULES
from detent.errors import DetentError
from detent.operate.faults import ALLOWED, LORE, describe_fault, injection_of, injections
from detent.operate.loop import INJECT
from detent.plant.injection import BLOCKED, PUSH, Place

PLACES = {
    "load": Place(1, (BLOCKED, PUSH), push=12.0),
    "load encoder": Place(2, refresh=1e-3, wrong=1e-3, unit="m", scale=1e-6, time=0.02),
    "drive": Place(3, refresh=1e-3, time=0.02),
}


@pytest.mark.parametrize(
    ("text", "place", "kind", "value"),
    [
        ("load blocked", 1, 8, 0.0),
        ("load push", 1, 9, 12.0),
        ("load push -3 N", 1, 9, -3.0),
        ("load encoder off", 2, 1, 1000.0),
        ("load encoder wrong 2 mm", 2, 4, 2000.0),
        ("load encoder delayed", 2, 6, 20.0),
        ("drive slow 50 ms", 3, 5, 50.0),
        ("drive intermittent 2 s", 3, 7, 2000.0),
        ("drive wrong", 3, 4, 0.0),
    ],
)
def test_what_is_said_becomes_place_kind_and_amount(text, place, kind, value):
    asked, amount = injection_of(PLACES, text)
    assert (asked - INJECT, amount) == (16 * place + kind, pytest.approx(value))


def test_nothing_ends_it():
    assert injection_of(PLACES, "nothing") == (INJECT, 0.0)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("x", "load blocked, push; load encoder off"),
        ("load", "load blocked, push"),
        ("load stuck", "load blocked, push"),
        ("encoder stuck", 'try: inject "load stuck"'),
        ("", "or nothing"),
        (None, "without a fault"),
        (5, "without a fault"),
        ("load blocked 5 N", "no amount"),
        ("load push 5 mm", "12 N"),
        ("load encoder wrong 0 mm", "other than 0"),
        ("load encoder delayed 1 s", "1 ms to 255 ms"),
        ("drive slow 1 us", "try: 20 ms"),
        ("drive slow soon", "try: 20 ms"),
    ],
)
def test_what_makes_no_sense_is_told_with_what_does(text, told):
    with pytest.raises(DetentError) as refused:
        injection_of(PLACES, text)
    assert told.replace('inject "load stuck"', "inject") in str(refused.value)


def test_an_axis_that_is_not_simulated_takes_none():
    with pytest.raises(DetentError, match="expected: a simulated axis"):
        injection_of({}, "encoder stuck")
    assert injections({}) == {}


def test_every_fault_of_an_axis_in_motion_has_causes_and_steps():
    for code, rule in RULES.items():
        assert rule.recovery in ALLOWED
        if rule.reaction <= 2 and code != 41:  # that one ends a jog, and is no fault of the axis
            assert LORE[code].causes
            assert LORE[code].steps


def test_a_record_for_a_terminal_says_value_limit_and_what_may_be_done():
    record: dict[str, Any] = {
        "number": 3, "code": "F10", "time": 1.5, "text": "the following error exceeded 1 mm", "value": -0.0012,
        "limit": 1e-3, "unit": "m", "position": "kept", "reaction": "ramp, then torque off",
        "causes": ["a", "b"], "steps": ["c"], "allowed": ["reset", "enable"],
    }  # fmt: skip
    text = describe_fault(record)
    for told in ("3. F10 at 1.500 s", "-1.2 mm, limit 1 mm", "position kept", "a; b", "reset, enable, stop, disable"):
        assert told in text
    assert "measured" not in describe_fault(record | {"value": None, "limit": None})
