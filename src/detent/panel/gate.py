"""The gate before every route: who may enter, from which page, under which name; what it does not know it refuses."""

import ipaddress
from collections.abc import Awaitable, Callable, Iterable, Sequence
from http.cookies import CookieError, SimpleCookie
from typing import Any, NamedTuple, Protocol

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import HTMLResponse, PlainTextResponse
from starlette.routing import BaseRoute, Match

from detent.panel.keys import COOKIE, Keys, Pass

MOST_BODY = 1 << 20  # bytes of a request
MOST_STRANGERS = 32  # connections that have shown no link yet
FORM_HEADER = "x-csrf-token"

Scope = dict[str, Any]
Receive = Callable[[], Awaitable[dict[str, Any]]]
Send = Callable[[dict[str, Any]], Awaitable[None]]

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; font-src 'self'; "
    "connect-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
)
HEADERS = {
    "content-security-policy": POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=()",
}


class Rule(NamedTuple):
    """What a route asks of whoever calls it."""

    role: str  # the least one; "" for anybody
    changes: bool = False  # it changes something: its page must show itself
    stops: bool = False  # it stops: a form does, too, whose browser hides where it stands


class Refusal(Exception):  # noqa: N818 - it is an answer
    """A request that is not let in."""

    def __init__(self, status: int, told: str) -> None:
        self.status, self.told = status, told
        super().__init__(told)


class Here(NamedTuple):
    """The names under which the panel may be called."""

    scheme: str
    names: frozenset[tuple[str, int]]

    @property
    def cookie(self) -> str:
        """Name of the cookie: browsers do not tell ports apart."""
        return f"detent_{min(port for _, port in self.names)}"

    def knows(self, host: str) -> bool:
        """Whether a Host header names this panel; an address is read, not compared as text."""
        return (name_of(host, 443 if self.scheme == "https" else 80)) in self.names

    def is_origin(self, origin: str) -> bool:
        """Whether a page comes from here."""
        scheme, _, host = origin.partition("://")
        return scheme == self.scheme and self.knows(host)


def name_of(host: str, port: int) -> tuple[str, int] | None:
    """Read a Host header: name or address, and port; None where it is neither."""
    name, colon, digits = host.rpartition(":") if not host.endswith("]") else (host, "", "")
    if not colon:
        name, digits = host, str(port)
    if not (digits.isascii() and digits.isdigit() and len(digits) <= 5):
        return None
    if name.startswith("[") and name.endswith("]"):
        name = name[1:-1]
    elif ":" in name:
        return None
    try:
        return str(ipaddress.ip_address(name)), int(digits)
    except ValueError:
        return name.lower(), int(digits)


class Closing(Protocol):
    """What of a transport is needed to end its connection."""

    def abort(self) -> None:
        """End it now."""


class Strangers:
    """Connections that have not shown yet that a link was followed; of more than so many the oldest is ended."""

    def __init__(self, most: int = MOST_STRANGERS) -> None:
        self._most, self._held = most, dict[tuple[str, int], Closing]()

    def come(self, peer: tuple[str, int] | None, transport: Closing) -> None:
        """Somebody has connected, who has said nothing yet."""
        if peer is None:
            return
        self._held[peer] = transport
        if len(self._held) > self._most:
            self._held.pop(next(iter(self._held))).abort()

    def let_in(self, peer: tuple[str, int] | None) -> None:
        """Who is there is known now, or has left."""
        if peer is not None:
            self._held.pop(peer, None)


class Gate:
    """ASGI middleware; `rules` by the path of each route."""

    def __init__(  # noqa: PLR0913 - a door, and all that it looks at
        self, app: Any, routes: Sequence[BaseRoute], rules: dict[str, Rule], keys: Keys, here: Here,
        strangers: Strangers,
    ) -> None:  # fmt: skip
        self.app, self.routes, self.rules, self.keys, self.here = app, routes, rules, keys, here
        self.strangers = strangers

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let in, or refuse."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        try:
            scope["pass"] = self._judge(scope, headers)
            if scope["pass"] is not None:
                self.strangers.let_in(scope["client"])
            await self.app(scope, receive, _with_headers(send))
        except Refusal as refused:
            await _refuse(scope, refused)(scope, receive, _with_headers(send))

    def _judge(self, scope: Scope, headers: Headers) -> Pass | None:
        if len(headers.getlist("host")) != 1 or not self.here.knows(headers["host"]):
            raise Refusal(421, "this panel is not called so; open the address that detent live has printed")
        rule = self._rule(scope)
        origin = headers.get("origin", "")
        hidden = origin in {"", "null"} and headers.get("sec-fetch-site", "same-origin") == "same-origin"
        asks_more = scope["type"] == "websocket" or rule.changes
        if not self.here.is_origin(origin) and not (hidden if rule.stops else origin == "" and not asks_more):
            raise Refusal(403, "another page asks; use the panel's own")
        length = headers.get("content-length", "0")
        if "transfer-encoding" in headers or not (length.isascii() and length.isdigit()):
            raise Refusal(411, "a request says how long it is")
        if int(length[:12]) > MOST_BODY:
            raise Refusal(413, f"a request has {MOST_BODY} bytes at most")
        who = self._who(headers)
        if rule.role and who is None:
            raise Refusal(401, "no link was followed here, or it has run out; get one with: detent connect FILE link")
        if rule.role and who is not None and not who.may(rule.role):
            raise Refusal(403, f"a {who.role} may not do that; it needs {rule.role}")
        if rule.changes and (who is None or headers.get(FORM_HEADER, "") != self.keys.form_mark(who)):
            raise Refusal(403, f"the header {FORM_HEADER} does not repeat what the page was given; load it again")
        return who

    def _rule(self, scope: Scope) -> Rule:
        for route in self.routes:
            match, _ = route.matches(scope)
            if match is not Match.NONE:
                rule = self.rules.get(getattr(route, "path", ""))
                if rule is None:
                    raise Refusal(403, "this route has no rule")
                return rule
        raise Refusal(404, "no such page")

    def _who(self, headers: Headers) -> Pass | None:
        cookies: SimpleCookie = SimpleCookie()
        try:
            cookies.load(headers.get("cookie", "")[:4096])
        except CookieError:
            return None
        return self.keys.read(cookies[self.here.cookie].value, COOKIE) if self.here.cookie in cookies else None


def _with_headers(send: Send) -> Send:
    async def with_headers(message: dict[str, Any]) -> None:
        """Send a message; where an answer begins, with the headers that protect a page."""
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in HEADERS.items():
                headers[name] = value
            headers.setdefault("cache-control", "no-store")
        await send(message)

    return with_headers


def _refuse(scope: Scope, refused: Refusal) -> Any:
    if scope["type"] == "websocket":
        return _close
    if refused.status == 401 and "text/html" in Headers(scope=scope).get("accept", ""):
        # A page of another site led here: the cookie comes with the next click only.
        return HTMLResponse(f'<p>{refused.told}</p><p><a href="/">Try again</a></p>', 401)
    return PlainTextResponse(f"{refused.told}\n", refused.status)


async def _close(_scope: Scope, receive: Receive, send: Send) -> None:
    await receive()
    await send({"type": "websocket.close", "code": 1008})


def place_of(connection: HTTPConnection) -> str:
    """From where it comes."""
    return f"from {connection.client.host if connection.client else '?'}"


def person(connection: HTTPConnection) -> str:
    """Who asks, for the log: role, the beginning of a random name, and from where."""
    who: Pass = connection.scope["pass"]
    return f"{who.role} {who.name[:6]} {place_of(connection)}"


def local_names(addresses: Iterable[str], port: int, more: Iterable[str] = ()) -> frozenset[tuple[str, int]]:
    """Names of a panel that listens at addresses."""
    found = {(str(ipaddress.ip_address(a)), port) for a in addresses} | {(name.lower(), port) for name in more}
    if any(ipaddress.ip_address(name).is_loopback for name, _ in found if name[0].isdigit() or ":" in name):
        found.add(("localhost", port))
    return frozenset(found)
