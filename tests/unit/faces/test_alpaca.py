"""Alpaca: what is no request is HTTP 400, what the device cannot do is an error of ASCOM, by its number."""

import asyncio
import json
from typing import Any
from urllib.parse import urlencode

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.fake_axis import service

from detent.faces.alpaca import Alpaca, Device, Focuser, Rotator

TURN = {"unit": "rad", "limits": None, "count": 1e-6}


async def asked(app: Any, method: str, path: str, **said: object) -> tuple[int, Any]:
    """Status and answer of a request, without a server."""
    text = urlencode(said).encode()
    scope = {
        "type": "http", "http_version": "1.1", "method": method, "path": path, "raw_path": path.encode(),
        "query_string": text if method == "GET" else b"", "root_path": "", "scheme": "http",
        "headers": [(b"content-type", b"application/x-www-form-urlencoded")], "client": ("127.0.0.1", 1),
        "server": ("127.0.0.1", 2),
    }  # fmt: skip
    sent: list[dict[str, Any]] = []

    async def receive() -> dict[str, Any]:
        return {"type": "http.request", "body": text if method == "PUT" else b"", "more_body": False}

    async def send(message: dict[str, Any]) -> None:
        sent.append(message)

    await app(scope, receive, send)
    body = b"".join(one.get("body", b"") for one in sent)
    status = sent[0]["status"]
    return status, json.loads(body) if status == 200 else body.decode()


def answers(
    *requests: tuple[str, str, dict[str, object]], device: type[Device] = Focuser, refuse: int = 0
) -> list[Any]:
    """Of each request its HTTP status, or the number of its error and its value."""

    async def whole() -> list[Any]:
        axis, line = service(**(TURN if device is Rotator else {}))
        line.refuse = refuse
        app, found = Alpaca([device(axis)]).app(), list[Any]()
        for method, name, said in requests:
            status, answer = await asked(app, method, f"/api/v1/{device.kind}/0/{name}", **said)
            found.append((answer["ErrorNumber"], answer.get("Value")) if status == 200 else status)
        return found

    return asyncio.run(whole())


ON = ("PUT", "connected", {"Connected": "true"})


@pytest.mark.parametrize(
    ("request_", "told"),
    [
        (("GET", "position", {}), (0, 20_000)), (("GET", "temperature", {}), (0x400, None)),
        (("PUT", "move", {"Position": "30000"}), (0, None)), (("PUT", "move", {}), 400),
        (("PUT", "move", {"position": "5"}), 400), (("PUT", "move", {"Position": "inf"}), 400),
        (("PUT", "tempcomp", {"TempComp": "true"}), (0x400, None)), (("PUT", "tempcomp", {"TempComp": "2"}), 400),
        (("PUT", "action", {"Action": "fly", "Parameters": ""}), (0x40C, None)), (("GET", "colour", {}), 400),
        (("GET", "name", {"ClientTransactionID": "-1"}), 400), (("GET", "maxstep", {}), (0, 500_000)),
    ],
)  # fmt: skip
def test_a_focuser(request_: Any, told: Any) -> None:
    assert answers(ON, request_)[1] == told


@pytest.mark.parametrize(
    ("request_", "told"),
    [
        (("PUT", "moveabsolute", {"Position": "400"}), (0x401, None)),
        (("PUT", "move", {"Position": "360"}), (0x401, None)),
        (("PUT", "moveabsolute", {"Position": "90"}), (0, None)),
        (("PUT", "reverse", {"Reverse": "true"}), (0x400, None)),
    ],
)  # fmt: skip
def test_a_rotator(request_: Any, told: Any) -> None:
    assert answers(ON, request_, device=Rotator)[1] == told


def test_who_is_not_connected_is_told_so() -> None:
    assert answers(("GET", "position", {}), ("GET", "name", {})) == [(0x407, None), (0, "fake axis")]


@pytest.mark.parametrize("why", [43, 115, 120])
def test_who_may_not_command_is_told_so_and_may_halt(why: int) -> None:
    assert answers(ON, ("PUT", "move", {"Position": "5"}), ("PUT", "halt", {}), refuse=why)[1:] == [
        (0x40B, None),
        (0, None),
    ]


def test_another_device_is_none() -> None:
    async def whole() -> list[int]:
        axis, _ = service()
        app = Alpaca([Focuser(axis)]).app()
        paths = "/api/v1/rotator/0/name", "/api/v1/focuser/1/name", "/management/nothing"
        return [(await asked(app, "GET", path))[0] for path in paths]

    assert asyncio.run(whole()) == [400, 400, 404]


@settings(max_examples=80, deadline=None)
@given(
    st.sampled_from(["GET", "PUT"]), st.sampled_from(["move", "position", "action", "connected", "tempcomp", "halt"]),
    st.dictionaries(
        st.sampled_from(["Position", "Connected", "Action", "TempComp", "ClientTransactionID", "ClientID"]),
        st.text(max_size=8),
    ),
)  # fmt: skip
def test_whatever_is_asked_is_answered_or_is_no_request(method: str, name: str, said: dict[str, object]) -> None:
    (_, told) = answers(ON, (method, name, said))
    assert told in (400, 405) or told[0] in (0, 0x400, 0x401, 0x407, 0x40B, 0x40C, 0x500)


def test_transactions_come_back() -> None:
    async def whole() -> list[tuple[int, int]]:
        axis, _ = service()
        app = Alpaca([Focuser(axis)]).app()
        found = [(await asked(app, "GET", "/api/v1/focuser/0/name", ClientTransactionID=mark))[1] for mark in (7, 9)]
        return [(one["ClientTransactionID"], one["ServerTransactionID"]) for one in found]

    assert asyncio.run(whole()) == [(7, 1), (9, 2)]
