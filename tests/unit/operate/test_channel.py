"""The channel's side of a message: whatever comes, an answer goes."""

import gc
import json
import math
import socket
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numba
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.live_bench import Bench

from detent.control import operation as ops
from detent.errors import AxisError, DetentError
from detent.operate import channel as module
from detent.operate.audit import Audit
from detent.operate.channel import QUESTIONS, Channel, Client
from detent.operate.session import Session
from detent.operate.words import WORDS

pytestmark = [pytest.mark.compiled, pytest.mark.skipif(numba.config.DISABLE_JIT, reason="a loop that is compiled")]


@pytest.fixture(scope="module")
def channel(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Channel]:
    """A channel that does not listen."""
    bench = Bench("cascade")
    bench.pass_time(0.7)
    made = Channel(Session(bench.host, {"name": "axis"}), tmp_path_factory.mktemp("channel") / "axis.sock")
    yield made
    made._loop.close()


@pytest.fixture(scope="module")
def client() -> Client:
    """Somebody."""
    return Client(7, SimpleNamespace(), "somebody")  # type: ignore[arg-type]


NUMBERS = st.one_of(st.integers(), st.floats(), st.sampled_from([10**400, -(10**400), 1e308, math.nan]))
VALUES = st.recursive(
    st.one_of(st.none(), st.booleans(), NUMBERS, st.text(max_size=20), st.sampled_from(["5 mm", "-1e400 mm"])),
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(st.text(max_size=5), inner, max_size=3)),
    max_leaves=5,
)  # fmt: skip
SAID = st.sampled_from([*WORDS, *QUESTIONS, "log", "note", "name", "dance"])
KEYS = st.sampled_from(["value", "speed", "as", "channels", "first", "rows", "who", "what", "client", "self"])


@settings(max_examples=300, deadline=None)
@given(do=st.one_of(SAID, VALUES), more=st.dictionaries(KEYS, VALUES, max_size=4))
def test_whatever_is_said_is_answered(channel: Channel, client: Client, do: Any, more: dict[str, Any]) -> None:
    answer = channel._answer(json.dumps({"do": do} | more).encode(), client)
    assert answer.keys() - {"as"} <= {"id", "error", *QUESTIONS, "log", "note", "name"}
    assert len(answer.keys() - {"as"}) == 1
    channel.session.host.run(1)


@pytest.mark.parametrize("value", [10**400, -(10**400), 1e308, math.nan])
def test_a_place_that_no_float_holds_is_refused(channel: Channel, client: Client, value: float) -> None:
    asked = channel._answer(json.dumps({"do": "move_to", "value": value}).encode(), client)
    assert channel.session.host.until_ended(asked["id"]).how == ops.REFUSED


@pytest.mark.parametrize("line", [b"", b"{", b"\xff\xfe", b"[" * 9000, b"[]", b'"stop"', b"7"])
def test_what_is_no_message_is_an_error(channel: Channel, client: Client, line: bytes) -> None:
    assert list(channel._answer(line, client)) == ["error"]


@pytest.mark.parametrize(
    ("stands", "remote", "word", "value", "why"),
    [
        ("both", True, "enable", None, 0), ("both", False, "enable", None, 0),
        ("local", True, "enable", None, 115), ("local", False, "enable", None, 0),
        ("remote", True, "enable", None, 0), ("remote", False, "enable", None, 116),
        ("local", True, "stop", None, 0), ("local", True, "disable", None, 0), ("local", True, "leave", None, 0),
        ("remote", False, "stop", None, 0), ("remote", False, "selector", "both", 0),
        ("remote", True, "selector", "both", 0), ("both", True, "selector", "remote", 0),
        ("both", True, "selector", "local", 115), ("local", True, "selector", "both", 115),
    ],
)  # fmt: skip
def test_the_selector_refuses_who_may_not_command(
    channel: Channel, stands: str, remote: bool, word: str, value: str | None, why: int
) -> None:
    session, somebody = channel.session, Client(8, SimpleNamespace(), "somebody", remote)  # type: ignore[arg-type]
    session.wait(session.ask("leave", client=int(session.host.board.operation.client) or 1))
    session.selector = stands
    answer = channel._answer(json.dumps({"do": word} | ({"value": value} if value else {})).encode(), somebody)
    ended = session.wait(answer["id"])
    assert ended.code == why
    assert (session.selector != stands) == (word == "selector" and not why)
    session.selector = "both"


def test_a_selector_that_is_turned_stops_who_may_not_command_any_more(channel: Channel) -> None:
    session, face = channel.session, Client(9, SimpleNamespace(), "a face", remote=True)  # type: ignore[arg-type]
    channel._clients[9] = face
    o = session.host.board.operation
    session.wait(session.ask("leave", client=int(o.client) or 1))
    for word in ("enable", "confirm"):
        session.wait(session.ask(word, client=9))
    moving = session.ask("move_by", "20 mm", client=9)
    session.host.run(5)
    assert (o.client, o.running) == (9, moving)
    channel._answer(b'{"do": "selector", "value": "local"}', Client(8, SimpleNamespace(), "me"))  # type: ignore[arg-type]
    assert session.wait(moving).how == "aborted"
    assert o.client == 0
    assert channel.audit.recent()["records"][-2]["note"] == "the selector stands on local"
    session.selector = "both"
    del channel._clients[9]


def test_a_refusal_says_who_commands(channel: Channel) -> None:
    channel._clients[9] = Client(9, SimpleNamespace(), "modbus face", remote=True)  # type: ignore[arg-type]
    o = channel.session.host.board.operation
    channel.session.wait(channel.session.ask("leave", client=int(o.client) or 1))
    channel.session.wait(channel.session.ask("take", client=9))
    refused = channel.session.wait(channel.session.ask("enable", client=8))
    assert (refused.code, refused.reason) == (ops.SECOND, "somebody else commands")
    assert channel._named(refused).reason == "somebody else commands (modbus face)"
    assert channel._named(refused).remedy == refused.remedy
    channel.session.wait(channel.session.ask("leave", client=9))
    assert channel._named(refused) == refused
    del channel._clients[9]


@pytest.mark.parametrize("value", [None, "", "LOCAL", 1, ["local"]])
def test_a_selector_has_three_places(channel: Channel, client: Client, value: object) -> None:
    assert (
        "expected one of both, local, remote"
        in channel._answer(json.dumps({"do": "selector", "value": value}).encode(), client)["error"]
    )


def test_what_is_no_number_is_told_as_null() -> None:
    sent: list[bytes] = []
    transport = SimpleNamespace(get_write_buffer_size=lambda: 0)
    writer: Any = SimpleNamespace(is_closing=lambda: False, transport=transport, write=sent.append)
    assert module._send(writer, {"status": {"position": math.nan, "late": [1.0, math.inf], "state": "fault"}})
    assert json.loads(sent[0]) == {"status": {"position": None, "late": [1.0, None], "state": "fault"}}


def test_a_client_that_does_not_read_is_dropped() -> None:
    dropped: list[bool] = []
    transport = SimpleNamespace(get_write_buffer_size=lambda: (1 << 20) + 1, abort=lambda: dropped.append(True))
    writer: Any = SimpleNamespace(is_closing=lambda: False, transport=transport)
    assert not module._send(writer, {"status": {}})
    assert dropped == [True]


def test_killed_clients_left_a_traceback_on_the_terminal(
    channel: Channel, tmp_path: Any, caplog: pytest.LogCaptureFixture
) -> None:
    """Who is killed with answers unread resets the connection; asyncio told of it when the axis ended."""
    listening = Channel(channel.session, tmp_path / "axis.sock")
    listening.start()
    for _ in range(3):
        with socket.socket(socket.AF_UNIX) as client:
            client.connect(str(listening.path))
            client.sendall(b'{"do": "status"}\n')
            assert client.recv(1)  # the rest of the answer stays unread
    stays = socket.socket(socket.AF_UNIX)
    stays.connect(str(listening.path))
    stays.sendall(b'{"do": "describe"}\n' * 100)  # and reads nothing at all
    assert stays.recv(1)
    listening.close()
    stays.close()
    gc.collect()
    assert [record.getMessage() for record in caplog.records] == []


def test_channels_of_several_clients_share_eight_places(channel: Channel) -> None:
    session, scope = channel.session, channel.session.host.scope
    names = [one["name"] for one in session.describe()["channels"] if "." in one["name"]]
    session.show(session.paths(names[:5]), 2)
    session.show(session.paths([*names[3:8], "position"]), 3)
    assert set(scope.row.names) >= set(names[:8])
    with pytest.raises(DetentError, match="others watch"):
        session.show(session.paths([names[8]]), 4)
    session.host.run(5)
    begun = scope.begin(names[:5])
    session.forget(3)
    session.show(session.paths([names[8]]), 4)
    assert scope.begin(names[:5]) == begun  # whose places have stayed
    assert set(names[5:8]).isdisjoint(scope.row.names)
    with pytest.raises(DetentError, match="nobody watches"):
        session.scope([names[6]])
    for who in (2, 4):
        session.forget(who)
    assert len(scope.row.names) == 8


def test_rows_that_a_slow_reader_missed_are_counted(channel: Channel) -> None:
    session = channel.session
    path = session.paths(["periods"])
    first = int(session.host.board.loop.rows)
    session.host.run(5000)
    rows = session.rows(first, path)
    assert (len(rows.columns[0]), rows.missed) == (2048, 5000 - 2048)
    assert rows.columns[0][-1] == session.host.board.loop.periods
    assert rows.columns[0][0] == rows.first + 1


def test_a_log_that_cannot_be_written_delays_nobody(tmp_path: Any) -> None:
    audit = Audit(tmp_path / "no folder" / "axis.audit")
    for k in range(3):
        audit.note("somebody", do="stop", id=k)
    assert audit.file is not None
    audit.file.flush()
    told = audit.recent()
    assert [one["id"] for one in told["records"]] == [0, 1, 2]
    assert told["lost"] == 3
    assert "No such file" in told["trouble"]
    audit.close()


def test_a_stop_overtakes_what_its_own_client_has_waiting_for_a_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench, begun, written = Bench("cascade"), threading.Event(), threading.Event()
    bench.pass_time(0.7)
    session = Session(bench.host, {"name": "axis"})
    asked = session.ask

    def slowly(word: str, *more: Any, **named: Any) -> int:
        if word == "enable":
            begun.set()
            written.wait(10.0)
        return asked(word, *more, **named)

    monkeypatch.setattr(session, "ask", slowly)
    channel = Channel(session, tmp_path / "axis.sock")
    channel.start()
    with socket.socket(socket.AF_UNIX) as one:
        one.settimeout(10.0)
        one.connect(str(channel.path))
        words = ["enable", *["confirm"] * module.MOST_BEHIND, "confirm", "stop"]
        lines = [json.dumps({"do": word, "as": k}).encode() + b"\n" for k, word in enumerate(words)]
        one.sendall(lines[0])
        assert begun.wait(10.0)
        one.sendall(b"".join(lines[1:]))
        heard = map(json.loads, one.makefile("rb"))
        first, second = next(heard), next(heard)
        assert (first["as"], "wait already" in first["error"]) == (len(words) - 2, True)
        assert (second["as"], "id" in second) == (len(words) - 1, True)  # while the first of them still waits
        bench.pass_time(0.01)  # the loop has seen it
        written.set()
        marks = {told["as"]: told["id"] for told in (next(heard) for _ in range(len(words) - 2)) if "as" in told}
        assert list(marks)[:3] == [0, 1, 2]  # the others in their order
        for _ in range(10):
            bench.host.run(1)
        ended = session.ending(marks[0])
        assert ended is not None
        assert (ended.how, ended.code) == ("refused", ops.STALE)
        assert bench.host.state == "switch on disabled"
    channel.close()


@pytest.mark.parametrize(("told", "match"), [(b'{"error": "32 clients"}\n', "32 clients"), (b"", "has gone")])
def test_a_client_reads_why_it_was_refused_though_its_message_meets_a_closed_door(
    tmp_path: Path, told: bytes, match: str
) -> None:
    """Who had been refused before it had asked was told of a broken pipe."""
    with socket.socket(socket.AF_UNIX) as door:
        door.bind(str(tmp_path / "door.sock"))
        door.listen()
        client = module.Connection(tmp_path / "door.sock")
        behind, _ = door.accept()
        behind.sendall(told)
        behind.close()
        with pytest.raises(AxisError, match=match):
            client.status()
        client.close()
