"""Coordinates of the motor record: user, dial and raw, direction, offset, and what a put to them does."""

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.fake_axis import FakeLine, service

from detent.faces.motor import Motor
from detent.faces.service import NotDoneError

PLACES = st.floats(-500.0, 500.0)


def record(work: Callable[[Motor, FakeLine, list[dict[str, Any]]], Awaitable[None]], **about: Any) -> None:
    """A record on an axis that is none, with what it shows."""

    async def whole() -> None:
        axis, line = service(**about)
        shown: list[dict[str, Any]] = []

        async def show(fields: Mapping[str, Any]) -> None:
            shown.append(dict(fields))

        await work(Motor(axis, show), line, shown)

    asyncio.run(whole())


@settings(max_examples=60, deadline=None)
@given(st.sampled_from([0, 1]), PLACES, PLACES)
def test_user_and_dial_are_turned_into_each_other(direction: int, offset: float, place: float) -> None:
    async def work(motor: Motor, _line: FakeLine, _shown: object) -> None:
        await motor.put("DIR", direction)
        await motor.put("OFF", offset)
        f = motor.fields
        assert motor.dial(motor.user(place)) == pytest.approx(place, abs=1e-9)
        assert motor.user(place) == pytest.approx((-1 if direction else 1) * place + offset, abs=1e-12)
        assert f["LLM"] <= f["HLM"]
        assert sorted((motor.dial(f["LLM"]), motor.dial(f["HLM"]))) == pytest.approx([0.0, 500.0], abs=1e-9)
        assert f["RBV"] == pytest.approx(motor.user(20.0), abs=1e-9)
        assert (f["DRBV"], f["RRBV"]) == (pytest.approx(20.0), 20_000)
        assert f["DVAL"] == pytest.approx(motor.dial(f["VAL"]), abs=1e-9)

    record(work)


@pytest.mark.parametrize(
    ("field", "value", "dial"), [("VAL", 45.0, 45.0), ("DVAL", 45.0, 45.0), ("RVAL", 45_000, 45.0), ("RLV", 5.0, 25.0)]
)
@pytest.mark.parametrize("direction", [0, 1])
def test_each_set_point_goes_to_its_place(field: str, value: float, dial: float, direction: int) -> None:
    async def work(motor: Motor, line: FakeLine, shown: list[dict[str, Any]]) -> None:
        await motor.put("DIR", direction)
        if field == "VAL":
            await motor.put("VAL", -value if direction else value)
        else:
            await motor.put(field, value)
        wanted = 15.0 if field == "RLV" and direction else dial
        assert line.status["position"] == pytest.approx(wanted * 1e-3)
        assert motor.fields["DVAL"] == pytest.approx(wanted)
        assert motor.fields["RVAL"] == pytest.approx(wanted * 1e3)
        pulses = [one["DMOV"] for one in shown if "DMOV" in one]
        assert pulses == [0, 1]

    record(work)


def test_in_set_mode_a_set_point_is_another_name_for_where_it_is() -> None:
    async def work(motor: Motor, line: FakeLine, _shown: object) -> None:
        await motor.put("SET", 1)
        await motor.put("VAL", 100.0)
        assert line.asked == []
        assert motor.fields["OFF"] == pytest.approx(80.0)
        assert motor.fields["RBV"] == pytest.approx(100.0)
        await motor.put("SUSE", 1)
        await motor.put("VAL", 110.0)
        assert line.status["position"] == pytest.approx(0.03)

    record(work)


@pytest.mark.parametrize(("at", "direction", "seen"), [
    ("upper", 0, (1, 0)), ("upper", 1, (0, 1)), ("lower", 0, (0, 1)), ("lower", 1, (1, 0)), ("", 1, (0, 0)),
])  # fmt: skip
def test_limit_switches_are_those_of_the_user(at: str, direction: int, seen: tuple[int, int]) -> None:
    async def work(motor: Motor, line: FakeLine, _shown: object) -> None:
        await motor.put("DIR", direction)
        line.status["at_end"] = at
        await motor.axis.refresh()
        await motor.show_sample()
        assert (motor.fields["HLS"], motor.fields["LLS"]) == seen

    record(work)


@pytest.mark.parametrize(
    ("puts", "low", "high"),
    [
        ([("HLM", 300.0)], 0.0, 300.0),
        ([("DHLM", 900.0)], 0.0, 500.0),
        ([("DIR", 1), ("HLM", -100.0)], 100.0, 500.0),
        ([("LLM", -5.0)], 0.0, 500.0),
    ],
)
def test_limits_are_narrowed_not_widened(puts: list[tuple[str, float]], low: float, high: float) -> None:
    async def work(motor: Motor, _line: FakeLine, _shown: object) -> None:
        for field, value in puts:
            await motor.put(field, value)
        assert (motor.fields["DLLM"], motor.fields["DHLM"]) == (pytest.approx(low), pytest.approx(high))

    record(work)


def test_beyond_a_limit_it_says_so_and_stays() -> None:
    async def work(motor: Motor, line: FakeLine, _shown: object) -> None:
        with pytest.raises(NotDoneError, match="beyond the limits, 0 to 500 mm"):
            await motor.put("VAL", 900.0)
        assert (motor.fields["LVIO"], motor.fields["VAL"], line.asked) == (1, pytest.approx(20.0), [])

    record(work)


@pytest.mark.parametrize("why", [43, 115])
def test_who_may_not_command_has_its_set_point_back(why: int) -> None:
    async def work(motor: Motor, line: FakeLine, _shown: object) -> None:
        line.refuse = why
        with pytest.raises(NotDoneError, match=rf"\({why}\)"):
            await motor.put("VAL", 60.0)
        assert motor.fields["VAL"] == pytest.approx(20.0)
        assert motor.fields["DMOV"] == 1
        await motor.put("STOP", 1)
        assert line.asked[-1] == "stop"
        assert motor.fields["STOP"] == 0

    record(work)
