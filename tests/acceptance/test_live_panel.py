"""Live specification, section 8: the panel's security (49 to 53) and who sees what."""

import json
import shutil
import ssl
import stat
import struct
import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack
from http.client import HTTPConnection
from typing import Any

import httpx
import numba
import numpy as np
import pytest
from starlette.routing import Mount, Route, WebSocketRoute
from tests.live_panel import PanelRig
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection

from detent.errors import DetentError
from detent.panel import app as panel_app
from detent.panel.child import PanelPlace
from detent.panel.gate import Rule
from detent.panel.keys import COOKIE, LINK, ROLES, keep_keys, link_of, make_keys, sign

pytestmark = [pytest.mark.compiled, pytest.mark.skipif(numba.config.DISABLE_JIT, reason="a loop that is compiled")]


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PanelRig]:
    """A panel whose axis stands still, but takes what is asked."""
    with PanelRig(tmp_path_factory.mktemp("panel")) as made:
        yield made


OPENSSL = shutil.which("openssl")


def routes_of(rig: PanelRig) -> list[tuple[str, str]]:
    """Every route with each of its methods, from the application itself."""
    found: list[tuple[str, str]] = []
    for route in rig.panel.app().routes:
        if isinstance(route, Route):
            found += [(method, route.path) for method in sorted(route.methods or ())]
        elif isinstance(route, Mount):
            found.append(("GET", f"{route.path}/panel.css"))
        else:
            assert isinstance(route, WebSocketRoute)
    return found


FREE = {"/enter"}  # shows its own ticket


def status(rig: PanelRig, method: str, path: str, role: str = "engineer", **headers: str) -> int:
    """What a request is answered, by somebody of a role, from the panel's own page unless told otherwise."""
    said = {"host": f"127.0.0.1:{rig.port}"} | ({"origin": rig.base} if method == "POST" else {})
    if role:
        name, value = next(iter(rig.cookie(role).items()))
        who = rig.panel.keys.read(value, COOKIE)
        assert who is not None
        said |= {"cookie": f"{name}={value}", "x-csrf-token": rig.panel.keys.form_mark(who)}
    asked = HTTPConnection("127.0.0.1", rig.port, timeout=10.0)
    asked.putrequest(method, path, skip_host=True)
    for name, value in (said | {name.replace("_", "-"): value for name, value in headers.items()}).items():
        asked.putheader(name, value)
    asked.endheaders()
    answered = asked.getresponse().status
    asked.close()
    return answered


def code(dialled: ClientConnection, first: str) -> int:
    """With which code a socket is closed after its first word; 0 where it is let in."""
    with dialled:
        dialled.send(first)
        try:
            dialled.recv(timeout=10.0)
        except ConnectionClosed as closed:
            return closed.rcvd.code if closed.rcvd else -1
        return 0


def test_49_every_route_refuses_whom_its_rule_does_not_name(rig: PanelRig) -> None:
    assert len(routes_of(rig)) >= 12
    for method, path in routes_of(rig):
        rule = panel_app.RULES["/static" if path.startswith("/static") else path]
        assert status(rig, method, path, origin="http://evil.example") == 403
        assert status(rig, method, path, origin="null") == (200 if rule.stops else 403)
        assert status(rig, method, path, host="evil.example") == 421
        assert status(rig, method, path, host=f"127.0.0.1.evil.example:{rig.port}") == 421
        assert status(rig, method, path, host="127.0.0.1:1") == 421
        assert status(rig, method, path, content_length=str((1 << 20) + 1)) == 413
        assert status(rig, method, path, transfer_encoding="chunked") == 411
        if path in FREE:
            continue
        assert status(rig, method, path, role="") == 401
        for role in ROLES:
            permitted = ROLES.index(role) >= ROLES.index(rule.role)
            assert (status(rig, method, path, role) in {200, 303, 400, 404}) == permitted
            assert permitted or status(rig, method, path, role) == 403
        if rule.changes:
            assert status(rig, method, path, x_csrf_token="0" * 64) == 403
            assert status(rig, method, path, origin="") == 403


def test_49_a_route_without_a_rule_lets_nobody_in(rig: PanelRig, monkeypatch: pytest.MonkeyPatch) -> None:
    assert status(rig, "GET", "/api/describe") == 200
    monkeypatch.delitem(panel_app.RULES, "/api/describe")
    assert status(rig, "GET", "/api/describe") == 403
    assert set(panel_app.RULES) | {"/api/describe"} == {route.path for route in rig.panel.app().routes}  # type: ignore[attr-defined]
    monkeypatch.setitem(panel_app.RULES, "/api/describe", Rule("engineer"))
    assert [status(rig, "GET", "/api/describe", role) for role in ROLES] == [403, 403, 200]


@pytest.mark.parametrize("role", ROLES)
def test_49_stop_is_taken_from_every_role(rig: PanelRig, role: str) -> None:
    stops = rig.bench.loop.stops
    assert status(rig, "POST", "/stop", role) == 200
    assert status(rig, "POST", "/stop", role, origin="null", sec_fetch_site="same-origin") == 200
    assert status(rig, "POST", "/stop", role, origin="null", sec_fetch_site="cross-site") == 403
    assert rig.bench.loop.stops == stops + 2
    with rig.browser(role).socket() as socket:
        assert "id" in socket.ask(do="stop")
        assert "id" in socket.ask(do="disable")
    assert rig.bench.loop.stops == stops + 3


def test_49_a_form_without_scripts_stops_and_comes_back(rig: PanelRig) -> None:
    browser, stops = rig.browser("viewer"), rig.bench.loop.stops
    page = browser.http.get("/").text
    assert 'action="/stop" method="post"' in page
    assert "SIMULATION" in page
    assert "&lt;b&gt;axis&lt;/b&gt;" in page
    assert "<b>axis" not in page
    answer = browser.http.post("/stop", headers={"accept": "text/html", "origin": "null"})
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    assert rig.bench.loop.stops == stops + 1


def test_49_a_viewer_watches_and_moves_nothing(rig: PanelRig) -> None:
    written = int(rig.bench.host.board.inbox.written)
    words = set(rig.session.describe()["commands"]) - {"stop", "disable"}
    with rig.browser("viewer").socket() as socket:
        for word in sorted(words):
            assert "a viewer may not" in socket.ask(do=word, value="1 mm")["error"]
        assert "status" in socket.ask(do="status")
        assert "watch" in socket.ask(do="watch", channels=["position"])
        assert "may not note" in socket.ask(do="note", who="engineer", what="lies")["error"]
    assert int(rig.bench.host.board.inbox.written) - written <= 1  # it leaves


def test_49_an_operator_sets_no_trust(rig: PanelRig) -> None:
    with rig.browser("operator").socket() as socket:
        assert "needs engineer" in socket.ask(do="trust", value=2)["error"]
        assert "id" in socket.ask(do="enable")


@pytest.mark.parametrize(
    "first",
    ["", "no JSON", "[]", "7", '{"ticket": null}', '{"ticket": "a.b.c"}', '{"ticket": "viewer.0.9.x"}', "[" * 9000],
)
def test_49_a_socket_needs_a_ticket(rig: PanelRig, first: str) -> None:
    assert code(rig.browser().dial(), first) == 1008


def test_49_a_ticket_serves_once_for_its_own_role_and_not_for_long(
    rig: PanelRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    browser = rig.browser()
    ticket = browser.ticket()

    def shown(ticket: str) -> str:
        return json.dumps({"ticket": ticket})

    assert code(browser.dial(), shown(ticket)) == 0
    assert code(browser.dial(), shown(ticket)) == 1008
    assert code(rig.browser("viewer").dial(), shown(browser.ticket())) == 1008
    late = browser.ticket()
    monkeypatch.setattr(rig.panel.keys, "_clock", lambda: time.time() + 11.0)
    assert code(browser.dial(), shown(late)) == 1008


def test_49_a_socket_without_cookie_or_from_another_page_is_refused(rig: PanelRig) -> None:
    for browser, more in (
        (rig.browser(""), {}),
        (rig.browser(), {"origin": "http://evil.example"}),
        (rig.browser(), {"origin": None}),
        (rig.browser(), {"origin": "null"}),
        (rig.browser(), {"origin": f"http://127.0.0.1.evil.example:{rig.port}"}),
    ):
        with pytest.raises(InvalidStatus) as refused:
            browser.dial(**more)
        assert refused.value.response.status_code == 403


def test_49_oversized_and_malformed_frames_are_refused(rig: PanelRig) -> None:
    with rig.browser().socket() as socket:
        for sent, told in (
            ("no JSON", "is JSON"),
            ("[" * 60_000, "is JSON"),
            (b"\0\1", "is JSON"),
            ("[]", '"do"'),
            ('{"do": 7, "as": 1}', '"do"'),
            ('{"do": "stop", "as": {}}', '"as"'),
            ('{"do": "dance", "as": 2}', "no command 'dance'"),
            ('{"do": "move_to", "as": 3, "value": {"a": 1}}', "5 mm"),
            ('{"do": "move_to", "as": 4, "value": "1 mm", "speed": "fast"}', "speed"),
            ('{"do": "watch", "as": 5, "rate": 1000}', "rate"),
            ('{"do": "watch", "as": 6, "channels": ["nothing"]}', "channels"),
            ('{"do": "watch", "as": 7, "who": "x"}', "who"),
        ):
            socket.dialled.send(sent)
            assert told in socket.until("error")["error"]
        assert "status" in socket.ask(do="status")
        with pytest.raises(ConnectionClosed) as closed:
            socket.ask(do="status", value="x" * (1 << 16))
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1009


def test_49_there_are_sixteen_sockets(rig: PanelRig) -> None:
    browser = rig.browser("viewer")
    with ExitStack() as others:
        for _ in range(16):
            other = others.enter_context(browser.dial())
            other.send(json.dumps({"ticket": browser.ticket()}))
            assert other.recv(timeout=10.0)
        assert code(browser.dial(), json.dumps({"ticket": browser.ticket()})) == 1013


def test_50_no_key_ticket_or_cookie_is_told_anywhere(rig: PanelRig) -> None:
    browser = rig.browser()
    ticket, link = browser.ticket(), sign(rig.keys["viewer"], "viewer", LINK, time.time())
    for signed in (link, link, "engineer.0.0.wrong"):
        browser.http.get("/enter", params={"ticket": signed})
    with browser.socket() as socket:
        told = [json.dumps(socket.ask(do=word)) for word in ("status", "describe", "log")]
    pages = [browser.http.get(path) for path in ("/", "/api/describe", "/api/log", "/api/axis")]
    everything = "".join([*told, *(page.text for page in pages), json.dumps(rig.audit.recent())])
    secrets = [ticket, link, *rig.keys.values(), *browser.http.cookies.values()]
    assert [secret for secret in secrets if secret.rpartition(".")[2] in everything] == []
    for page in pages:
        assert page.headers["referrer-policy"] == "no-referrer"
        assert page.headers["cache-control"] == "no-store"
        assert "default-src 'none'" in page.headers["content-security-policy"]
        assert "unsafe" not in page.headers["content-security-policy"]
        assert "access-control-allow-origin" not in page.headers


def test_50_a_link_works_once_and_leaves_a_cookie_that_no_script_reads(rig: PanelRig) -> None:
    link = {"ticket": sign(rig.keys["operator"], "operator", LINK, time.time())}
    with httpx.Client(base_url=rig.base) as client:
        first = client.get("/enter", params=link)
        cookie = first.headers["set-cookie"]
        assert "HttpOnly" in cookie
        assert "SameSite=strict" in cookie
        assert client.get("/enter", params=link).status_code == 401
        assert client.get("/").status_code == 200
    old = {"ticket": sign(rig.keys["operator"], "operator", LINK, time.time() - 601.0)}
    assert httpx.get(rig.base + "/enter", params=old).status_code == 401
    assert httpx.get(rig.base, cookies=rig.cookie("viewer", time.time() - 12 * 3600 - 1)).status_code == 401
    forged = {rig.panel.here.cookie: sign(rig.keys["viewer"], "engineer", "cookie", time.time())}
    assert httpx.get(rig.base, cookies=forged).status_code == 401


def test_50_only_this_user_reads_the_keys(tmp_path: Any) -> None:
    path, keys = tmp_path / "axis.keys", make_keys()
    path.write_text("left over", encoding="ascii")
    path.chmod(0o666)
    keep_keys(path, "http://127.0.0.1:1", keys)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert len(set(keys.values())) == len(ROLES)
    assert min(map(len, keys.values())) >= 43  # 256 bits
    assert keys["viewer"] not in link_of(path, "viewer", time.time())
    with pytest.raises(DetentError, match="viewer, operator, engineer"):
        link_of(path, "root", time.time())


def test_50_51_who_did_what_is_appended(rig: PanelRig) -> None:
    with rig.browser("operator").socket() as socket:
        asked = socket.ask(do="enable")["id"]
        socket.ask(do="move_to", value="5 V")
    records = rig.audit.recent()["records"]
    mine = next(one for one in records if one.get("id") == asked)
    assert mine["do"] == "enable"
    assert mine["who"].startswith("operator ")
    assert mine["who"].endswith("from 127.0.0.1")
    assert any(one.get("do") == "move_to" and "error" in one for one in records)
    assert rig.audit.file is not None
    rig.audit.file.flush()
    assert [json.loads(line) for line in rig.audit.file.path.read_text(encoding="utf-8").splitlines()][
        -len(records) :
    ] == records
    assert stat.S_IMODE(rig.audit.file.path.stat().st_mode) == 0o600


@pytest.mark.parametrize("bind", ["192.168.1.20", "10.0.0.1", "2001:db8::1", "fe80::1"])
def test_51_a_network_is_refused_without_tls(bind: str, tmp_path: Any) -> None:
    with pytest.raises(DetentError, match="--i-accept-plain-http"):
        PanelPlace(bind).check()
    accepted = PanelPlace(bind, plain=True)
    accepted.check()
    assert accepted.on_network
    pem = tmp_path / "pem"
    pem.touch()
    encrypted = PanelPlace(bind, certificate=str(pem), key_file=str(pem))
    encrypted.check()
    assert not encrypted.on_network


@pytest.mark.parametrize(
    ("place", "told"),
    [
        (PanelPlace("0.0.0.0", plain=True), "every network"),  # noqa: S104 - it is refused
        (PanelPlace("::", plain=True), "every network"),
        (PanelPlace("axis.example", plain=True), "expected an address"),
        (PanelPlace("127.0.0.1", certificate="a.pem"), "both"),
        (PanelPlace("127.0.0.1", certificate="no.pem", key_file="no.pem"), "no such file"),
    ],
)
def test_51_what_cannot_work_is_refused(place: PanelPlace, told: str) -> None:
    with pytest.raises(DetentError, match=told):
        place.check()


@pytest.mark.process
@pytest.mark.skipif(OPENSSL is None, reason="makes the certificate")
def test_51_with_a_certificate_all_goes_encrypted(tmp_path: Any) -> None:
    certificate, key = str(tmp_path / "axis.pem"), str(tmp_path / "axis.key")
    subprocess.run(
        [str(OPENSSL), "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes",
         "-days", "2", "-subj", "/CN=axis", "-addext", "subjectAltName=IP:127.0.0.1", "-keyout", key,
         "-out", certificate],
        check=True, capture_output=True,
    )  # fmt: skip
    trusted = ssl.create_default_context(cafile=certificate)
    with PanelRig(tmp_path, certificate=certificate, key_file=key) as rig:
        base = f"https://127.0.0.1:{rig.port}"
        link = {"ticket": sign(rig.keys["operator"], "operator", LINK, time.time())}
        with httpx.Client(base_url=base, verify=trusted) as client:
            assert "Secure" in client.get("/enter", params=link).headers["set-cookie"]
            assert client.post("/stop", headers={"origin": base}).status_code == 200
            assert client.post("/stop", headers={"origin": rig.base}).status_code == 403
        with pytest.raises(httpx.TransportError):
            httpx.get(rig.base)


def test_51_the_banner_of_plain_http_stays(rig: PanelRig, monkeypatch: pytest.MonkeyPatch) -> None:
    browser = rig.browser()
    assert "without encryption" not in browser.http.get("/").text
    monkeypatch.setattr(rig.panel, "plain", True)
    assert "without encryption" in browser.http.get("/").text


def test_a_page_sees_rows_of_its_own_channels(rig: PanelRig) -> None:
    """Two pages, each with channels of its own: columns as the ring holds them."""
    names = ["position", "controller.law.command"], ["controller.law.limited", "periods"]
    with rig.browser().socket() as one, rig.browser("viewer").socket() as other:
        first = [
            page.ask(do="watch", rate=50, channels=list(c))["watch"]["first"]
            for page, c in zip((one, other), names, strict=True)
        ]
        rig.bench.pass_time(0.2)
        table = []
        for page in (one, other):
            binary = page.until("binary")["binary"]
            at, n, channels = struct.unpack("<qII", binary[:16])
            table.append((at, np.frombuffer(binary[16:], "<f4").reshape(channels, n)))
        assert [at for at, _ in table] >= first
        at, columns = table[1]
        assert columns[1].tolist() == [row + 1 for row in range(at, at + columns.shape[1])]
        text = (
            rig.browser("viewer").http.get("/api/scope.csv", params={"channels": "periods,position", "first": at}).text
        )
        rows = [line.split(",") for line in text.splitlines()]
        assert rows[0] == ["row", "periods", "position"]
        assert [int(row[0]) for row in rows[1:4]] == [at, at + 1, at + 2]
        ring = rig.bench.host.scope.rows(at)[0]
        assert [float(row[2]) for row in rows[1:]][: len(ring)] == ring["operation.answer.position"].tolist()
        assert "nobody watches" in one.ask(do="scope", channels=["lines.motor.count"])["error"]
        status = one.until("status")
        assert (status["clients"], status["holder"]) == (3, 0)
