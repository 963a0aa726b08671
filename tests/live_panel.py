"""A live axis with its panel for tests, in this process: a browser without a screen."""

import asyncio
import json
import re
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from http.client import HTTPConnection
from pathlib import Path
from typing import Any, Self

import httpx
from starlette.routing import Mount, Route, WebSocketRoute
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from detent.operate.audit import Audit
from detent.operate.channel import Channel
from detent.operate.session import Session
from detent.panel.__main__ import make_server
from detent.panel.child import LOOPBACK
from detent.panel.keys import COOKIE, LINK, make_keys, sign
from tests.live_bench import Bench


class Browser:
    """One person's cookie jar."""

    def __init__(self, base: str, role: str, keys: dict[str, str]) -> None:
        self.base = base
        self.http = httpx.Client(base_url=base, timeout=20.0)
        if role:
            entered = self.http.get("/enter", params={"ticket": sign(keys[role], role, LINK, time.time())})
            assert (entered.status_code, entered.headers["location"]) == (303, "/")

    def form_mark(self) -> str:
        """What the page was given to say back."""
        found = re.search(r'name="csrf-token" content="(\w+)"', self.http.get("/").text)
        assert found is not None
        return found[1]

    def ticket(self) -> str:
        """A ticket for a socket."""
        answer = self.http.post("/api/ticket", headers={"x-csrf-token": self.form_mark(), "origin": self.base})
        return answer.json()["ticket"]

    def dial(self, **more: Any) -> ClientConnection:
        """A socket, without a first word."""
        cookie = "; ".join(f"{name}={value}" for name, value in self.http.cookies.items())
        more = {"origin": self.base, "additional_headers": {"Cookie": cookie} if cookie else {}} | more
        return connect(self.base.replace("http", "ws", 1) + "/ws", max_size=None, max_queue=None, **more)

    @contextmanager
    def socket(self) -> Iterator["Socket"]:
        """A socket that is let in."""
        with self.dial() as dialled:
            dialled.send(json.dumps({"ticket": self.ticket()}))
            yield Socket(dialled)


class Socket:
    """A page's socket."""

    def __init__(self, dialled: ClientConnection) -> None:
        self.dialled, self._marks = dialled, 0

    def until(self, name: str, mark: object = None) -> dict[str, Any]:
        """The next message that has a key, and perhaps a mark."""
        while True:
            said = self.dialled.recv(timeout=10.0)
            message = json.loads(said) if isinstance(said, str) else {"binary": said}
            if name in message and (mark is None or message.get("as") == mark):
                return message

    def ask(self, **message: Any) -> dict[str, Any]:
        """Say something, and hear the answer."""
        self._marks += 1
        self.dialled.send(json.dumps(message | {"as": self._marks}))
        return self.until("as", self._marks)


class PanelRig:
    """An axis, its channel, and the panel."""

    def __init__(self, folder: Path, *, running: bool = False, **told: Any) -> None:
        self._closing = ExitStack()
        self.bench = Bench("cascade", wall=running, period=1e-2 if running else 1e-3)
        if running:
            self.bench.host.start()
        else:
            self.bench.pass_time(0.7)
        self.audit = Audit(folder / "axis.audit")
        file = {"file": "axis.toml", "text": "[axis]\n", "effective": []}
        self.session = Session(self.bench.host, {"name": "<b>axis</b>", "simulated": True}, file)
        self.channel = Channel(self.session, folder / "axis.sock", self.audit)
        self.channel.start()
        self.keys = make_keys()
        self.server, sockets, self.panel = make_server(
            {"channel": str(self.channel.path), "keys": self.keys, "port": 0, "names": ["axis.example"],
             "addresses": LOOPBACK[:1], "plain": False, "certificate": "", "key_file": ""} | told
        )  # fmt: skip
        self.port = sockets[0].getsockname()[1]
        self.base = f"http://127.0.0.1:{self.port}"
        self._thread = threading.Thread(target=lambda: asyncio.run(self.server.serve(sockets=sockets)), daemon=True)
        self._thread.start()

    def browser(self, role: str = "engineer") -> Browser:
        """Somebody with a role, or without."""
        made = Browser(self.base, role, self.keys)
        self._closing.callback(made.http.close)
        return made

    def cookie(self, role: str, now: float | None = None) -> dict[str, str]:
        """A cookie that was made at a time."""
        return {self.panel.here.cookie: sign(self.keys[role], role, COOKIE, time.time() if now is None else now)}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._closing.close()
        self.server.should_exit = True
        self._thread.join()
        self.channel.close()
        self.audit.close()
        if self.bench.host.is_running:
            self.bench.host.close()


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


def flood(socket: Socket) -> None:
    """Ask without end."""
    while True:
        socket.dialled.send('{"do": "confirm"}')
