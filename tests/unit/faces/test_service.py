"""Where a face listens, what its record is called, and what a client of an axis is told."""

import asyncio
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.fake_axis import service

from detent.errors import DetentError
from detent.faces.motor import name_of
from detent.faces.service import NotDoneError, address_of


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("", ("127.0.0.1", 502)), (":1502", ("127.0.0.1", 1502)), ("1502", ("127.0.0.1", 1502)),
        ("10.0.0.7:1", ("10.0.0.7", 1)), ("[::1]:80", ("::1", 80)), ("host:", ("host", 502)),
    ],
)  # fmt: skip
def test_a_place(text: str, found: tuple[str, int]) -> None:
    assert address_of("modbus", text, 502) == found


@pytest.mark.parametrize("text", ["x", ":x", ":65536", ":-1", "host:1.5", ":\u0661", "a:b:c"])
def test_what_is_no_place(text: str) -> None:
    with pytest.raises(DetentError, match=r"expected: \[HOST\]:PORT such as :502; choose a port up to 65535"):
        address_of("modbus", text, 502)


@given(st.text(max_size=60))
def test_a_name_of_a_record_is_one_or_refused(text: str) -> None:
    name = text.partition("@")[0]
    with suppress(DetentError):
        assert name_of("epics", text, 5064)[0] == name
        assert name.isascii()
        assert 0 < len(name) <= 50
        assert not set(name) & set(" .,/*?\"'\n")


def test_a_face_that_reads_commands_nothing_but_stops() -> None:
    async def work() -> None:
        axis, line = service(commands=False)
        with pytest.raises(NotDoneError) as refused:
            await axis.do("enable")
        assert (refused.value.code, refused.value.how) == (120, "refused")
        await axis.stop()
        await axis.do("disable")
        assert line.asked == ["stop", "disable"]

    asyncio.run(work())


@pytest.mark.parametrize(
    ("status", "commands", "may"),
    [({}, True, True), ({}, False, False), ({"client": 2}, True, False), ({"client": 1}, True, True),
     ({"selector": "local"}, True, False), ({"selector": "remote"}, True, True)],
)  # fmt: skip
def test_who_may_command(status: dict[str, object], commands: bool, may: bool) -> None:
    async def work() -> None:
        axis, line = service(commands=commands)
        line.status |= status
        await axis.refresh()
        assert axis.may_command == may

    asyncio.run(work())


@given(st.integers(-(1 << 40), 1 << 40))
def test_counts_and_positions_are_one(count: int) -> None:
    async def work() -> None:
        axis, _ = service(origin=0.0125)
        assert axis.to_counts(axis.from_counts(count)) == count

    asyncio.run(work())
