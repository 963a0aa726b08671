import socket
from types import SimpleNamespace

import pytest

from detent.panel.__main__ import listen
from detent.panel.gate import Here, Strangers, local_names, name_of
from detent.panel.sockets import Budget


@pytest.mark.parametrize(
    ("host", "read"),
    [
        ("127.0.0.1:80", ("127.0.0.1", 80)),
        ("127.0.0.1", ("127.0.0.1", 443)),
        ("[::1]:8080", ("::1", 8080)),
        ("[0:0:0:0:0:0:0:1]", ("::1", 443)),
        ("LocalHost:1", ("localhost", 1)),
        ("::1", None),
        ("[::1", None),
        ("127.0.0.1:", None),
        ("127.0.0.1:80a", None),
        ("127.0.0.1:٣", None),
        ("127.0.0.1:999999", None),
        ("", ("", 443)),
        ("127.0.0.1.evil.example:80", ("127.0.0.1.evil.example", 80)),
        ("0177.0.0.1:80", ("0177.0.0.1", 80)),
        ("2130706433:80", ("2130706433", 80)),
    ],
)
def test_a_host_is_read_not_compared(host: str, read: tuple[str, int] | None) -> None:
    assert name_of(host, 443) == read


def test_a_panel_knows_its_names_and_no_others() -> None:
    here = Here("http", local_names(["127.0.0.1", "::1"], 8080, ["Axis.Example"]))
    for host in ("127.0.0.1", "[::1]", "localhost", "axis.example", "AXIS.example", "[0:0::1]"):
        assert here.knows(f"{host}:8080")
        assert here.is_origin(f"http://{host}:8080")
        assert not here.is_origin(f"https://{host}:8080")
        assert not here.knows(f"{host}:8081")
        assert not here.knows(host)
    for host in ("127.0.0.2", "evil.example", "axis.example.", "127.1", "[::ffff:127.0.0.1]", "user@127.0.0.1"):
        assert not here.knows(f"{host}:8080")
    for origin in (
        "",
        "null",
        "http://",
        "127.0.0.1:8080",
        "http://127.0.0.1:8080/",
        "http://127.0.0.1:8080@evil.example",
    ):
        assert not here.is_origin(origin)
    assert not Here("http", local_names(["192.168.1.20"], 80)).knows("localhost")
    assert Here("https", local_names(["192.168.1.20"], 443)).is_origin("https://192.168.1.20")


def test_a_budget_comes_back_with_time() -> None:
    now = [0.0]
    budget = Budget(50.0, 1.0, lambda: now[0])
    assert [budget.take() for _ in range(60)] == [True] * 50 + [False] * 10
    now[0] = 0.1
    assert [budget.take() for _ in range(6)] == [True] * 5 + [False]
    now[0] = 100.0
    assert sum(budget.take() for _ in range(100)) == 50


def test_small_messages_do_not_wait_for_the_acknowledgement_of_others() -> None:
    for one in listen(["127.0.0.1"], 0):
        with one, socket.create_connection(one.getsockname()) as _, one.accept()[0] as accepted:
            assert accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY) != 0


def test_a_second_address_that_this_machine_has_not_is_left_out() -> None:
    found = listen(["127.0.0.1", "192.0.2.1"], 0)
    assert [one.getsockname()[0] for one in found] == ["127.0.0.1"]
    with pytest.raises(OSError, match="assign"):
        listen(["192.0.2.1", "127.0.0.1"], 0)
    for one in found:
        one.close()


def test_of_too_many_strangers_the_oldest_is_shown_out() -> None:
    out: list[int] = []
    strangers = Strangers(2)
    for k in (1, 2):
        strangers.come(("here", k), SimpleNamespace(abort=lambda k=k: out.append(k)))
    strangers.let_in(("here", 1))  # it has shown a link
    strangers.come(("here", 3), SimpleNamespace(abort=lambda: out.append(3)))
    strangers.come(None, SimpleNamespace(abort=lambda: out.append(0)))  # of a socket that has no peer
    strangers.let_in(None)
    assert out == []
    strangers.come(("here", 4), SimpleNamespace(abort=lambda: out.append(4)))
    assert out == [2]
