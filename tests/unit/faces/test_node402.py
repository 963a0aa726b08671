"""Objects of the drive: what they show of the axis, what may be written, and the status word of each state."""

import asyncio
from collections.abc import Awaitable, Callable

import pytest
from tests.fake_axis import FakeLine, service

pytest.importorskip("canopen")
import canopen

from detent.control.axis_states import STATE_NAMES
from detent.faces.node402 import Node, objects_of, word
from detent.operate.drivers.cia402 import state_of


def noded(work: Callable[[Node, FakeLine], Awaitable[None]], *, commands: bool = True, **about: object) -> None:
    """A node on no bus."""

    async def whole() -> None:
        axis, line = service(commands=commands, **about)
        await work(Node(axis, 5), line)

    asyncio.run(whole())


def value_of(node: Node, index: int, part: int = 0, *, signed: bool = False) -> int:
    """Value of an object."""
    return int.from_bytes(node.node.get_data(index, part), "little", signed=signed)


@pytest.mark.parametrize("state", range(len(STATE_NAMES)))
def test_the_status_word_tells_the_state(state: int) -> None:
    async def work(node: Node, line: FakeLine) -> None:
        line.status["state"] = STATE_NAMES[state]
        await node.axis.refresh()
        assert state_of(value_of(node, 0x6041)) == state

    noded(work)


@pytest.mark.parametrize(
    ("status", "commands", "remote"),
    [
        ({}, True, 1),
        ({}, False, 0),
        ({"client": 2}, True, 0),
        ({"selector": "local"}, True, 0),
        ({"selector": "remote"}, True, 1),
    ],
)
def test_bit_9_is_whether_control_words_are_followed(status: dict[str, object], commands: bool, remote: int) -> None:
    async def work(node: Node, line: FakeLine) -> None:
        line.status |= status
        await node.axis.refresh()
        assert value_of(node, 0x6041) >> 9 & 1 == remote

    noded(work, commands=commands)


def test_what_is_shown_is_the_axis() -> None:
    async def work(node: Node, line: FakeLine) -> None:
        sent: list[tuple[int, int]] = []
        node.node.emcy.send = lambda code, register: sent.append((code, register))
        line.status |= {"position": 0.0300014, "velocity": -0.0125, "effort": 0.25, "error": 2e-6}
        line.status["commanded"] = 0.030003
        line.status["fault"] = {"code": 10, "text": "it does not follow"}
        await node.axis.refresh()
        shown = {index: value_of(node, index, signed=True) for index in (0x6064, 0x606C, 0x6077, 0x60F4, 0x6062)}
        assert shown == {0x6064: 30_001, 0x606C: -12_500, 0x6077: 250, 0x60F4: 2, 0x6062: 30_003}
        assert (value_of(node, 0x603F), value_of(node, 0x1001)) == (0x8611, 1)
        assert sent == [(0x8611, 1)]
        assert [value_of(node, 0x2000, part) for part in (1, 2, 3, 4)] == [100, 30_001, 2, 10]

    noded(work)


@pytest.mark.parametrize(
    ("index", "part", "value", "size", "code"),
    [
        (0x6060, 0, 100, 1, 0x06090030), (0x6081, 0, 500_001, 4, 0x06090031), (0x6081, 0, 0, 4, 0x06090030),
        (0x607D, 2, 500_001, 4, 0x06090031), (0x607D, 1, -1, 4, 0x06090032), (0x6007, 0, 4, 2, 0x06090030),
    ],
)  # fmt: skip
def test_what_no_axis_could_do_is_aborted(index: int, part: int, value: int, size: int, code: int) -> None:
    async def work(node: Node, _line: FakeLine) -> None:
        with pytest.raises(canopen.SdoAbortedError) as aborted:
            node.node.set_data(index, part, value.to_bytes(size, "little", signed=value < 0))
        assert aborted.value.code == code

    noded(work)


@pytest.mark.parametrize(("count", "shown"), [(0, 0), ((1 << 31) - 1, (1 << 31) - 1), (1 << 31, -(1 << 31)), (-1, -1)])
def test_counts_wrap_at_32_bits(count: int, shown: int) -> None:
    assert word(count) == shown


def test_defaults_are_those_of_the_axis() -> None:
    async def work(node: Node, _line: FakeLine) -> None:
        defaults = {one.place: one.default for one in objects_of(node.axis)}
        assert (defaults[0x6081], defaults[0x607F], defaults[0x6083]) == (500_000, 500_000, 5_000_000)
        dictionary = node.node.object_dictionary
        assert [dictionary[0x607D][part].default for part in (1, 2)] == [-50_000, 450_000]

    noded(work, limits=[-0.05, 0.45])
