"""The motor record over PV Access, by p4p: the fields of `motor` as scalars, enums where the record has menus."""

import asyncio
import time
from collections.abc import Mapping
from typing import Any

# pyright: reportUnknownMemberType=false, reportArgumentType=false
# p4p has no types.
from p4p.nt import NTEnum, NTScalar
from p4p.server import Server, StaticProvider
from p4p.server.asyncio import SharedPV

from detent.errors import DetentError
from detent.faces.motor import Motor, name_of
from detent.faces.service import Desk
from detent.faces.signals import Signals

PORT = 5075
MENUS = {
    "SPMG": ["Stop", "Pause", "Move", "Go"], "DIR": ["Pos", "Neg"], "SET": ["Use", "Set"],
    "CNEN": ["Disable", "Enable"],
    "FOFF": ["Variable", "Frozen"], "LSPG": ["Stop", "Pause", "Move", "Go"],
}  # fmt: skip
TYPES = {int: "i", float: "d", str: "s"}
LIMITED = ("VAL", "DVAL", "RBV", "DRBV")


class Put:
    """Takes puts to one field; the put is complete when what it has begun is done."""

    def __init__(self, motor: Motor, name: str) -> None:
        self._motor, self._name = motor, name

    async def put(self, pv: Any, op: Any) -> None:
        """A client's put."""
        value: Any = op.value()
        asked = value.value if hasattr(value, "value") else value
        if self._name in MENUS:
            asked = asked["index"] if hasattr(asked, "__getitem__") else int(value)
        try:
            await self._motor.put(self._name, asked)
        except (DetentError, ValueError) as error:
            op.done(error=str(error)[:200])
        else:
            op.done()
        del pv


class Signal:
    """A channel of the scope: its PV has a value, and costs something, while somebody is connected to it."""

    def __init__(self, signals: Signals, channel: str) -> None:
        self._signals, self._channel, self._shown = signals, channel, (0.0, "")
        self._is_looked_at = False
        self.pv = SharedPV(handler=self, nt=NTScalar("d", display=True))

    async def onFirstConnect(self, pv: Any) -> None:  # noqa: N802 - as p4p calls it
        """Somebody has come, and may have gone before there is a value."""
        self._is_looked_at = True
        self._signals.look(self._channel, self)
        shown = await self._signals.once(self._channel)
        if self._is_looked_at and not pv.isOpen():
            self._shown = shown
            pv.open(self._whole())

    async def onLastDisconnect(self, pv: Any) -> None:  # noqa: N802 - as p4p calls it
        """Nobody is left."""
        self._is_looked_at = False
        self._signals.leave(self._channel, self)
        if pv.isOpen():
            pv.close()

    async def show(self, value: float, wrong: str) -> None:
        """Tell clients, where it is new."""
        shown = (self._shown[0] if wrong else value), wrong
        if shown != self._shown and self.pv.isOpen():
            self._shown = shown
            self.pv.post(self._whole())

    def _whole(self) -> dict[str, Any]:
        value, wrong = self._shown
        unit, about = self._signals.units[self._channel], self._signals.about[self._channel]
        severity = {"severity": 3, "status": 3} if wrong else {"severity": 0, "status": 0}  # invalid, of the record
        return {
            "value": value, "timeStamp": stamp(), "alarm": {**severity, "message": wrong[:200]},
            "display": {"units": unit, "description": about},
        }  # fmt: skip


def stamp() -> dict[str, int]:
    """The time of day."""
    now = time.time()
    return {"secondsPastEpoch": int(now), "nanoseconds": int(now % 1 * 1e9)}


class Served:
    """PVs of a record."""

    def __init__(self, name: str) -> None:
        self._name, self.provider = name, StaticProvider(name)
        self.pvs: dict[str, Any] = {}
        self.motor: Motor
        self.signals: Signals

    def open(self, motor: Motor) -> None:
        """Make a PV of every field."""
        self.motor = motor
        for name, value in motor.fields.items():
            self._add(f".{name}", name, value, Put(motor, name) if name in motor.actions else None)
        self.provider.add(self._name, self.pvs["VAL"])
        shown: dict[str, Signal] = {}
        self.signals = Signals(motor.axis, lambda channel, value, wrong: shown[channel].show(value, wrong))
        own = {f":{name}" for name in motor.extras()}  # of two of one name the record's own
        for channel in self.signals.units:
            if (behind := self.signals.name_of(channel)) not in own:
                shown[channel] = Signal(self.signals, channel)
                self.provider.add(self._name + behind, shown[channel].pv)
        for name, value in motor.extras().items():
            self._add(f":{name}", f":{name}", value, None)

    def _add(self, behind: str, name: str, value: Any, handler: Put | None) -> None:
        if name in MENUS:
            nt: Any = NTEnum()
            first: Any = {"index": value, "choices": MENUS[name]}
        else:
            nt = NTScalar(TYPES[type(value)], display=type(value) is not str, control=name in LIMITED)
            first = self._whole(name, value)
        self.pvs[name] = SharedPV(handler=handler, nt=nt, initial=first) if handler else SharedPV(nt=nt, initial=first)
        self.provider.add(self._name + behind, self.pvs[name])

    def _whole(self, name: str, value: Any) -> dict[str, Any]:
        """A value with its unit, limits, alarm and time."""
        found: dict[str, Any] = {
            "value": value, "timeStamp": stamp(),
            "alarm": {"severity": self.motor.severity, "status": self.motor.status and 2, "message": ""},
        }  # fmt: skip
        if type(value) is not str:
            found["display"] = {"units": self.motor.axis.unit if type(value) is float else "", "description": ""}
        if name in LIMITED and self.motor.axis.limits:
            ends = {"limitLow": self.motor.fields["LLM"], "limitHigh": self.motor.fields["HLM"]}
            found["display"] |= ends
            found["control"] = ends
        return found

    async def show(self, fields: Mapping[str, Any]) -> None:
        """Tell clients what has changed."""
        for name, value in fields.items():
            if name in self.pvs:
                self.pvs[name].post({"index": value} if name in MENUS else self._whole(name, value))
        if fields.keys() & {"HLM", "LLM"} and "VAL" not in fields:
            await self.show({"VAL": self.motor.fields["VAL"]})

    async def follow(self) -> None:
        """Show what is no field, as far as it has changed."""
        shown = self.motor.extras()
        while not self.motor.axis.gone.is_set():
            now = self.motor.extras()
            for name in (name for name, value in now.items() if value != shown[name]):
                self.pvs[f":{name}"].post(self._whole(f":{name}", now[name]))
            shown = now
            await asyncio.sleep(0.02)


async def serve(desk: Desk, address: str) -> list[str]:
    """Serve; gives what a client needs."""
    name, host, port = name_of("pva", address, PORT)
    names, providers = list[str](), list[Any]()
    for axis in await desk.open():
        names.append(f"{name}:{axis.motor}" if axis.motor else name)
        served = Served(names[-1])
        motor = Motor(axis, served.show)
        served.open(motor)
        providers.append(served.provider)
        for work in (motor.follow(), served.follow(), served.signals.follow()):
            desk.keep(asyncio.ensure_future(work))
    conf = {
        "EPICS_PVAS_INTF_ADDR_LIST": host, "EPICS_PVAS_SERVER_PORT": str(port),
        "EPICS_PVAS_BROADCAST_PORT": str(port + 1),
        "EPICS_PVAS_AUTO_BEACON_ADDR_LIST": "NO", "EPICS_PVAS_BEACON_ADDR_LIST": host,
    }  # fmt: skip
    desk.server = Server(providers=providers, conf=conf, useenv=False)
    told = f"EPICS_PVA_ADDR_LIST={host} EPICS_PVA_AUTO_ADDR_LIST=NO EPICS_PVA_BROADCAST_PORT={port + 1}"
    return [*(f"pva://{one}" for one in names), told]
