"""ASCOM Alpaca over HTTP: a linear axis as a focuser, a rotary one as a rotator, found by Alpaca's discovery.

A focuser counts steps, which are counts of the sensor from the lower end of the travel; a rotator has degrees.
"""

import asyncio
import json
import socket
from collections.abc import Awaitable, Callable
from importlib.metadata import version
from itertools import count
from typing import Any
from urllib.parse import parse_qsl

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route

from detent.errors import DetentError
from detent.faces.service import BEYOND, AxisService, Desk, NotDoneError, address_of

PORT, DISCOVERY = 11111, 32227
NOT_IMPLEMENTED, INVALID_VALUE, NOT_CONNECTED, INVALID_OPERATION, ACTION, DRIVER = (
    0x400, 0x401, 0x407, 0x40B, 0x40C, 0x500,
)  # fmt: skip
COMMON = (
    "connected", "connecting", "description", "driverinfo", "driverversion", "interfaceversion", "name",
    "supportedactions", "devicestate",
)  # fmt: skip


class AscomError(Exception):
    """A request that is answered by an error of ASCOM."""

    def __init__(self, number: int, told: str) -> None:
        self.number = number
        super().__init__(told)


class BadRequestError(Exception):
    """A request that is none: HTTP status 400."""


Get = Callable[[], object]
Put = Callable[[dict[str, str]], Awaitable[object]]


class Device:
    """What both kinds have in common."""

    kind, interface = "", 0

    def __init__(self, axis: AxisService) -> None:
        self.axis, self.connected = axis, False
        self._moves: set[asyncio.Future[None]] = set()
        self._failed = ""
        self.gets: dict[str, Get] = {
            "connected": lambda: self.connected, "connecting": lambda: False,
            "description": lambda: f"{axis.about['name']}, a detent axis ({axis.about['method']})",
            "driverinfo": lambda: "detent", "driverversion": lambda: version("detent"),
            "interfaceversion": lambda: self.interface, "name": lambda: axis.about["name"],
            "supportedactions": lambda: ["sample", "enable", "disable", "reset", "home"],
            "ismoving": lambda: self.moving, "devicestate": self.state,
        }  # fmt: skip
        self.puts: dict[str, Put] = {
            "connected": self._connect, "connect": lambda _: self._connect({"Connected": "true"}),
            "disconnect": lambda _: self._connect({"Connected": "false"}), "halt": self._halt, "action": self._action,
        }  # fmt: skip

    def state(self) -> list[dict[str, object]]:
        """All that changes, at once."""
        return [
            {"Name": "IsMoving", "Value": self.moving}, {"Name": "Position", "Value": self.gets["position"]()},
        ]  # fmt: skip

    @property
    def moving(self) -> bool:
        """Until the move is done, or has failed: that is told to who asks next."""
        if self._failed:
            told, self._failed = self._failed, ""
            raise AscomError(DRIVER, told)
        return self.axis.moving or bool(self._moves)

    async def _connect(self, said: dict[str, str]) -> None:
        self.connected = flag_of(said, "Connected")
        if not self.connected:
            await self.axis.give_back()

    async def _halt(self, _said: dict[str, str]) -> None:
        await self.axis.stop()

    async def _action(self, said: dict[str, str]) -> object:
        name = text_of(said, "Action").lower()
        if name == "sample":
            return str(self.axis.sample)
        if name == "enable":
            return str(await self.axis.enable())
        if name in ("disable", "reset", "home"):
            return str(await self.axis.do(name))
        raise AscomError(ACTION, f"no action {name!r}; there are sample, enable, disable, reset, home")

    async def move(self, position: float) -> None:
        """Begin a move; Alpaca waits for none."""
        low, high = self.axis.limits or (-1e12, 1e12)
        slack = abs(self.axis.count)
        if not low - slack <= position <= high + slack:
            raise AscomError(INVALID_VALUE, f"beyond the limits, {low:g} to {high:g} {self.axis.unit}")
        await self.axis.enable()  # Alpaca has no word for it
        ending = await self.axis.begin_move(min(max(position, low), high))
        task = asyncio.ensure_future(self._end(ending))
        self._moves.add(task)
        task.add_done_callback(self._moves.discard)

    async def _end(self, ending: "asyncio.Future[dict[str, Any]]") -> None:
        try:
            await self.axis.ended("move_to", ending)
        except NotDoneError as error:
            self._failed = "" if error.how == "aborted" else str(error)


class Focuser(Device):
    """A linear axis."""

    kind, interface = "focuser", 4

    def __init__(self, axis: AxisService) -> None:
        super().__init__(axis)
        low, high = axis.limits or (axis.origin, axis.origin + 1e6 * axis.count)
        self.zero, self.most = axis.to_counts(low), axis.to_counts(high) - axis.to_counts(low)
        self.gets |= {
            "absolute": lambda: True, "maxincrement": lambda: self.most, "maxstep": lambda: self.most,
            "position": lambda: axis.counts - self.zero, "stepsize": lambda: axis.count * 1e3,  # um
            "tempcomp": lambda: False, "tempcompavailable": lambda: False, "temperature": not_implemented,
        }  # fmt: skip
        self.puts |= {"move": self._move, "tempcomp": self._compensate}

    async def _compensate(self, said: dict[str, str]) -> None:
        flag_of(said, "TempComp")
        not_implemented()

    async def _move(self, said: dict[str, str]) -> None:
        steps = min(max(int(number_of(said, "Position")), 0), self.most)  # as the interface has it: moves to the end
        await self.move(self.axis.from_counts(steps + self.zero))


class Rotator(Device):
    """A rotary axis; its mechanical angle is that of the axis, its sky angle has an offset."""

    kind, interface = "rotator", 4

    def __init__(self, axis: AxisService) -> None:
        super().__init__(axis)
        self._offset, self._target = 0.0, axis.position
        self.gets |= {
            "canreverse": lambda: False, "reverse": lambda: False, "stepsize": lambda: axis.count,
            "mechanicalposition": lambda: axis.position % 360.0,
            "position": lambda: (axis.position + self._offset) % 360.0,
            "targetposition": lambda: (self._target + self._offset) % 360.0,
        }  # fmt: skip
        self.puts |= {
            "move": self._by, "moveabsolute": self._to, "movemechanical": self._to_mechanical, "sync": self._sync,
            "reverse": self._reverse,
        }  # fmt: skip

    async def _reverse(self, said: dict[str, str]) -> None:
        flag_of(said, "Reverse")
        not_implemented()

    async def _go(self, target: float) -> None:
        await self.move(target)
        self._target = target

    async def _by(self, said: dict[str, str]) -> None:
        way = number_of(said, "Position")
        if not -360.0 < way < 360.0:
            raise AscomError(INVALID_VALUE, "a way is above -360 and below 360 deg")
        await self._go(self.axis.commanded + way)

    async def _to(self, said: dict[str, str]) -> None:
        await self._go(angle_of(said) - self._offset)

    async def _to_mechanical(self, said: dict[str, str]) -> None:
        await self._go(angle_of(said))

    async def _sync(self, said: dict[str, str]) -> None:
        self._offset = angle_of(said) - self.axis.position


def not_implemented() -> object:
    """What this device has not."""
    raise AscomError(NOT_IMPLEMENTED, "this device has none")


def text_of(said: dict[str, str], name: str) -> str:
    """A parameter; its name is case-sensitive in what a client puts."""
    if name not in said:
        raise BadRequestError(f"{name} is missing")
    return said[name]


def number_of(said: dict[str, str], name: str) -> float:
    """A parameter that is a number."""
    text = text_of(said, name)
    try:
        value = float(text)
    except ValueError:
        raise BadRequestError(f"{name}: got {text!r:.40}; expected a number") from None
    if not abs(value) < 1e12:
        raise BadRequestError(f"{name}: got {text!r:.40}; expected a finite number")
    return value


def angle_of(said: dict[str, str]) -> float:
    """A parameter that is a place of a circle [deg]."""
    angle = number_of(said, "Position")
    if not 0.0 <= angle < 360.0:
        raise AscomError(INVALID_VALUE, "an angle is 0 to below 360 deg")
    return angle


def flag_of(said: dict[str, str], name: str) -> bool:
    """A parameter that is true or false."""
    text = text_of(said, name).lower()
    if text not in ("true", "false"):
        raise BadRequestError(f"{name}: got {text!r:.40}; expected true or false")
    return text == "true"


class Alpaca:
    """Routes of devices, which are numbered by their kind."""

    def __init__(self, devices: list[Device]) -> None:
        kinds = [device.kind for device in devices]
        self.devices = {
            (kind, kinds[:k].count(kind)): one for k, (kind, one) in enumerate(zip(kinds, devices, strict=True))
        }
        self._numbers = count(1)

    async def ask(self, request: Request) -> Response:
        """A request about a device."""
        path = request.path_params
        name, device = path["name"], self.devices.get((path["kind"], path["number"]))
        if device is None:
            return PlainTextResponse("no such device", 400)
        text = request.url.query if request.method == "GET" else (await request.body()).decode("latin-1")
        said = dict(parse_qsl(text, keep_blank_values=True))
        known: Any = (device.gets if request.method == "GET" else device.puts).get(name)
        if known is None:
            return PlainTextResponse(f"{device.kind} has no {name!r:.40} to {request.method.lower()}", 400)
        numbers = {key.lower(): value for key, value in said.items()}
        mark = numbers.get("clienttransactionid", "0")
        if not (mark.isascii() and mark.isdigit()) or int(mark) >= 1 << 32:
            return PlainTextResponse("ClientTransactionID is no number of 32 bits", 400)
        number, told = 0, ""
        value: object = None
        try:
            if not device.connected and name not in (*COMMON, "connect", "disconnect"):
                raise AscomError(NOT_CONNECTED, "not connected; put Connected=true first")  # noqa: TRY301 - answered below
            await device.axis.refresh()
            value = known() if request.method == "GET" else await known(said)
        except AscomError as error:
            number, told = error.number, str(error)
        except BadRequestError as error:
            return PlainTextResponse(str(error), 400)
        except NotDoneError as error:
            number, told = (INVALID_VALUE if error.code == BEYOND else INVALID_OPERATION), str(error)
        except DetentError as error:
            number, told = DRIVER, str(error)
        return self._answer(int(mark), number, told, value)

    def _answer(self, mark: int, number: int = 0, told: str = "", value: object = None) -> Response:
        answer: dict[str, object] = {
            "ClientTransactionID": mark, "ServerTransactionID": next(self._numbers),
            "ErrorNumber": number, "ErrorMessage": told,
        }  # fmt: skip
        return JSONResponse(answer | ({} if value is None else {"Value": value}))

    async def manage(self, request: Request) -> Response:
        """The management API."""
        names = [device.axis.about["name"] for device in self.devices.values()]
        values: dict[str, object] = {
            "apiversions": [1],
            "v1/description": {
                "ServerName": f"detent: {', '.join(names)}", "Manufacturer": "detent",
                "ManufacturerVersion": version("detent"), "Location": "",
            },
            "v1/configureddevices": [
                {
                    "DeviceName": name, "DeviceType": kind.capitalize(), "DeviceNumber": number,
                    "UniqueID": f"detent-{kind}-{name}",
                }
                for (kind, number), name in zip(self.devices, names, strict=True)
            ],
        }  # fmt: skip
        value = values.get(request.path_params["what"])
        if value is None:
            return PlainTextResponse("no such page", 404)
        numbers = {key.lower(): text for key, text in request.query_params.items()}
        mark = numbers.get("clienttransactionid", "0")
        return self._answer(int(mark) if mark.isascii() and mark.isdigit() else 0, value=value)

    def app(self) -> Starlette:
        """As an application."""
        return Starlette(routes=[
            Route("/api/v1/{kind}/{number:int}/{name}", self.ask, methods=["GET", "PUT"]),
            Route("/management/{what:path}", self.manage, methods=["GET"]),
        ])  # fmt: skip


class Discovery(asyncio.DatagramProtocol):
    """Says to who asks by a datagram where the device is."""

    def __init__(self, port: int) -> None:
        self._port = port

    def connection_made(self, transport: Any) -> None:
        """Keep the way to answer."""
        self._transport = transport

    def datagram_received(self, data: bytes, addr: Any) -> None:
        """Answer version 1 of the question."""
        if data.startswith(b"alpacadiscovery1"):
            self._transport.sendto(json.dumps({"AlpacaPort": self._port}).encode(), addr)


async def serve(desk: Desk, address: str) -> list[str]:
    """Serve; gives what a client needs."""
    host, number = address_of(desk.face, address, PORT)
    alpaca = Alpaca([(Rotator if axis.about["unit"] == "rad" else Focuser)(axis) for axis in await desk.open()])
    config = uvicorn.Config(
        alpaca.app(), host=host, port=number, log_level="warning", access_log=False, server_header=False,
        lifespan="off", timeout_graceful_shutdown=1,
    )  # fmt: skip
    listening = config.bind_socket()
    # uvicorn sends head and body in two; without this the second waits 40 ms for the other side's acknowledgement.
    listening.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    port = listening.getsockname()[1]
    server = uvicorn.Server(config)
    server.install_signal_handlers = lambda: None  # type: ignore[attr-defined]
    desk.keep(asyncio.ensure_future(server.serve(sockets=[listening])))
    loop, told = (
        asyncio.get_running_loop(),
        [f"{host}:{port}", *(f"{kind} {number}" for kind, number in alpaca.devices)],
    )
    try:
        await loop.create_datagram_endpoint(lambda: Discovery(port), local_addr=(host, DISCOVERY), reuse_port=True)
    except OSError as error:
        told.append(f"not discovered: port {DISCOVERY} ({error.strerror})")
    return told
