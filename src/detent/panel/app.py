"""The panel as an application: its routes, each with its rule, and what they answer."""

import csv
import io
from base64 import b64decode
from collections.abc import AsyncGenerator, Iterable, Sequence
from contextlib import asynccontextmanager
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, select_autoescape
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import BaseRoute, Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket

from detent.errors import DetentError
from detent.methods.registry import METHODS
from detent.operate.line import Line
from detent.panel.gate import Gate, Here, Rule, Strangers, person, place_of
from detent.panel.keys import COOKIE, LIFETIMES, LINK, TICKET, Keys
from detent.panel.sockets import Budget, Sockets

HERE = Path(__file__).parent

RULES = {
    "/": Rule("viewer"),
    "/enter": Rule(""),
    "/stop": Rule("viewer", stops=True),
    "/static/method.js": Rule("viewer"),
    "/static": Rule("viewer"),
    "/ws": Rule("viewer"),
    "/api/ticket": Rule("viewer", changes=True),
    "/api/describe": Rule("viewer"),
    "/api/axis": Rule("viewer"),
    "/api/faults": Rule("viewer"),
    "/api/log": Rule("operator"),
    "/api/positions.csv": Rule("viewer"),
    "/api/scope.csv": Rule("viewer"),
}
"""What each route asks of whoever calls it; a route without a rule lets nobody in."""


class Panel:
    """What the routes share."""

    def __init__(self, channel: Path, keys: Keys, here: Here, *, plain: bool = False) -> None:
        self.channel, self.keys, self.here, self.plain = channel, keys, here, plain
        self.sockets = Sockets(channel, keys)
        self.line: Line | None = None
        self.strangers = Strangers()
        self._wrong_links = Budget(10, 60.0)  # that the log tells
        self.about: dict[str, Any] = {}
        loader = PackageLoader("detent.panel", "template")
        self._pages = Environment(loader=loader, autoescape=select_autoescape(default=True))

    def app(self) -> Starlette:
        """The application behind its gate."""
        routes: Sequence[BaseRoute] = [
            Route("/", self.page),
            Route("/enter", self.enter),
            Route("/stop", self.stop, methods=["POST"]),
            Route("/static/method.js", self.method_view),
            Mount("/static", StaticFiles(directory=HERE / "static", packages=[("detent.page", "vendor")])),
            WebSocketRoute("/ws", self.attend),
            Route("/api/ticket", self.ticket, methods=["POST"]),
            *(Route(f"/api/{name}", self.answer) for name in ("describe", "axis", "faults", "log")),
            Route("/api/positions.csv", self.positions),
            Route("/api/scope.csv", self.scope),
        ]
        gate = Middleware(Gate, routes=routes, rules=RULES, keys=self.keys, here=self.here, strangers=self.strangers)
        return Starlette(
            routes=routes, middleware=[gate], lifespan=self._attached, exception_handlers={DetentError: _told}
        )

    @asynccontextmanager
    async def _attached(self, _app: Starlette) -> AsyncGenerator[None]:
        self.line = self.sockets.line = await Line.open(self.channel, "panel")
        self.about = await self._ask(do="describe")
        self.sockets.looks |= set(self.about["questions"])
        yield
        self.line.close()

    async def _ask(self, **message: Any) -> Any:
        if self.about and message["do"] not in self.about["questions"]:
            raise HTTPException(404, f"this axis tells nothing of {message['do']}")
        return (await self._tell(**message))[message["do"]]

    async def _tell(self, **message: Any) -> dict[str, Any]:
        assert self.line is not None  # noqa: S101 - the server takes no request before
        return await self.line.ask(message)

    # ---- routes

    async def page(self, request: Request) -> Response:
        """The page; without scripts it shows the state, and stops."""
        who = request.scope["pass"]
        told = {
            "about": self.about, "status": await self._ask(do="status"), "role": who.role,
            "form_mark": self.keys.form_mark(who), "plain": self.plain,
        }  # fmt: skip
        return HTMLResponse(self._pages.get_template("page.html.j2").render(told))

    async def enter(self, request: Request) -> Response:
        """A one-time link becomes a cookie."""
        who = self.keys.read(request.query_params.get("ticket", ""), LINK)
        if who is None:
            if self._wrong_links.take():
                await self._tell(do="note", who=place_of(request), what="shows a link that was used or has run out")
            return PlainTextResponse(
                "This link was used or has run out.\nGet one with: detent connect FILE link\n", 401
            )
        await self._tell(do="note", who=f"{who.role} {place_of(request)}", what="enters")
        answer = RedirectResponse("/", 303)
        answer.set_cookie(
            self.here.cookie, self.keys.sign(who.role, COOKIE), max_age=int(LIFETIMES[COOKIE]), httponly=True,
            samesite="strict", secure=self.here.scheme == "https",
        )  # fmt: skip
        return answer

    async def stop(self, request: Request) -> Response:
        """Stop; a page without scripts comes back to itself."""
        told = await self._tell(do="stop", who=person(request))
        if "text/html" in request.headers.get("accept", ""):
            return RedirectResponse("/", 303)
        return JSONResponse({"id": told["id"]})

    async def attend(self, socket: WebSocket) -> None:
        """The socket of a page."""
        await self.sockets.attend(socket)

    async def ticket(self, request: Request) -> Response:
        """A ticket for one socket, within ten seconds."""
        return JSONResponse({"ticket": self.keys.sign(request.scope["pass"].role, TICKET)})

    async def answer(self, request: Request) -> Response:
        """What the axis answers to a question."""
        return JSONResponse(await self._ask(do=request.url.path.rpartition("/")[2]))

    async def positions(self, _request: Request) -> Response:
        """The position table."""
        found: list[dict[str, Any]] = await self._ask(do="positions")
        names = list(dict.fromkeys(name for row in found for name in row))
        return _table(names, ([row.get(name, "") for name in names] for row in found))

    async def method_view(self, _request: Request) -> Response:
        """What the method's package brings for its own view."""
        package = type(METHODS[self.about["method"]]).__module__.rpartition(".")[0]
        script = files(package).joinpath("panel.js")
        if not script.is_file():
            return PlainTextResponse(f"{package} brings no view of its own\n", 404)
        return Response(script.read_bytes(), media_type="text/javascript")

    async def scope(self, request: Request) -> Response:
        """Rows of the ring as a table: ?channels=position,velocity&first=0."""
        names = [name for name in request.query_params.get("channels", "periods,position").split(",") if name]
        first = request.query_params.get("first", "0")
        if not (first.isascii() and first.isdigit() and len(first) < 19):
            raise DetentError(f"first={first:.40}: expected the number of a row")
        found = await self._ask(do="scope", channels=names, first=int(first))
        table = np.frombuffer(b64decode(found["data"]), "<f8").reshape(len(names), found["rows"]).T
        return _table(["row", *names], ([found["first"] + k, *row] for k, row in enumerate(table.tolist())))


def _table(names: Sequence[str], rows: Iterable[Sequence[Any]]) -> Response:
    """A table as a file; a cell that a spreadsheet would take for a formula gets a quotation mark."""
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(names)
    writer.writerows(
        [f"'{c}" if isinstance(c, str) and c.startswith(tuple("=+-@\t")) else c for c in row] for row in rows
    )
    return Response(text.getvalue(), media_type="text/csv")


async def _told(_request: Request, error: Exception) -> Response:
    """What was wrong with a request."""
    gone = getattr(error, "exit_status", 2) == 1
    return JSONResponse({"error": str(error)}, 503 if gone else 400)
