"""Registers: 32-bit values, what is read, what may be written, and a command by its sequence number."""

import asyncio
from collections.abc import Awaitable, Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.fake_axis import FakeLine, service

pytest.importorskip("pymodbus")
from detent.faces.modbus import (
    ADDRESSES,
    FIRST_WRITABLE,
    HEARTBEAT,
    REGISTERS,
    SIZE,
    STATUS_BITS,
    Slave,
    signed,
    words_of,
)


@given(st.integers(-(1 << 31), (1 << 31) - 1))
def test_two_words_come_back(value: int) -> None:
    high, low = words_of(value)
    assert signed([high, low]) == value
    assert (high << 16 | low) & 0xFFFFFFFF == value & 0xFFFFFFFF


@given(st.integers())
def test_beyond_two_words_is_the_nearest(value: int) -> None:
    high, low = words_of(value)
    assert high << 16 | low == min(max(value, -(1 << 31)), (1 << 32) - 1) & 0xFFFFFFFF


def test_registers_do_not_overlap() -> None:
    places = [at for one in REGISTERS for at in range(one.address, one.address + one.words)]
    assert len(places) == len(set(places)) == len(ADDRESSES)
    assert max(places) == SIZE - 1
    assert all(one.writable == (one.address >= FIRST_WRITABLE) for one in REGISTERS)


def slaved(work: Callable[[Slave, FakeLine], Awaitable[None]], *, commands: bool = True) -> None:
    """Registers of an axis that is none."""

    async def whole() -> None:
        axis, line = service(commands=commands)
        await work(Slave(axis), line)

    asyncio.run(whole())


def test_what_is_read_is_the_axis() -> None:
    async def work(slave: Slave, line: FakeLine) -> None:
        line.status |= {"position": -0.070001, "client": 7, "selector": "local"}
        await slave.axis.refresh()
        shown = slave.show()
        assert len(shown) == SIZE
        assert signed(shown[16:18]) == -70_001
        assert [signed(shown[at : at + 2]) for at in (4, 6, 8)] == [0, 500_000, 500_000]
        assert all(0 <= one < 65536 for one in shown)
        bits = {name for k, name in enumerate(STATUS_BITS) if shown[12] >> k & 1}
        assert bits == {
            "ready", "in window", "position known", "first motion confirmed", "somebody else commands",
            "selector on local",
        }  # fmt: skip

    slaved(work)


@pytest.mark.parametrize(
    ("function", "address", "values", "code"),
    [
        (3, 0, None, None), (4, 26, None, None), (3, 47, None, 2), (3, 46, None, None), (1, 0, None, 1),
        (5, 0, [1], 1), (6, 40, [7], None), (6, 16, [7], 2), (16, 39, [1, 2], 2), (6, 41, [99], 3), (6, 26, [0], 2),
    ],
)  # fmt: skip
def test_exceptions(function: int, address: int, values: list[int] | None, code: int | None) -> None:
    async def work(slave: Slave, _line: FakeLine) -> None:
        found = await slave.access(function, 0, address, len(values or [0]), [0] * SIZE, values)
        assert (None if found is None else int(found)) == code

    slaved(work)


def test_who_only_reads_writes_nothing() -> None:
    async def work(slave: Slave, _line: FakeLine) -> None:
        found = await slave.access(6, 0, HEARTBEAT, 1, [0] * SIZE, [7])
        assert found is not None
        assert int(found) == 2

    slaved(work, commands=False)


@pytest.mark.parametrize(
    ("refuse", "beat", "command", "result"),
    [(0, 1, 1, [2, 0]), (0, 0, 1, [4, 121]), (43, 1, 7, [4, 43]), (115, 1, 7, [4, 115]), (0, 0, 3, [2, 0])],
)
def test_a_command_ends_under_its_number(refuse: int, beat: int, command: int, result: list[int]) -> None:
    async def work(slave: Slave, line: FakeLine) -> None:
        line.refuse, line.status["state"] = refuse, "operation enabled" if command == 7 else "switch on disabled"
        await slave.axis.refresh()
        held = [0] * SIZE
        if beat:
            await slave.access(6, 0, HEARTBEAT, 1, held, [beat])
        await slave.access(16, 0, 41, 6, held, [command, *words_of(30_000), *words_of(0), 9])
        assert slave.show()[23:25] == [9, 1]
        running = slave._running
        assert running is not None
        await running
        assert slave.show()[23:26] == [9, *result]

    slaved(work)
