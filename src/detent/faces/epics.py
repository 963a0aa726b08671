"""The motor record over Channel Access, by caproto: all of its fields, of which those of `motor` live."""

import asyncio
import logging
import os
from collections.abc import Mapping
from typing import Any

# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
# caproto has no types for its properties.
from caproto import AccessRights, AlarmSeverity, AlarmStatus, ChannelDouble
from caproto.asyncio.server import Context
from caproto.server import PVGroup, pvproperty

from detent.errors import DetentError
from detent.faces.motor import Motor, name_of
from detent.faces.service import AxisService, Desk
from detent.faces.signals import Signals

PORT = 5064
SHOWN = 0.02  # until what has changed is at its clients: a put is complete behind that [s]


class Record(PVGroup):
    """A motor record and, behind its name and a colon, what else is known of the axis."""

    motor = pvproperty(value=0.0, name="", record="motor", precision=4)
    trust = pvproperty(value="", name=":trust", max_length=16, read_only=True)
    selector = pvproperty(value="", name=":selector", max_length=16, read_only=True)
    state = pvproperty(value="", name=":state", max_length=40, read_only=True)
    fault = pvproperty(value=0, name=":fault", read_only=True)
    fault_text = pvproperty(value="", name=":fault_text", max_length=240, read_only=True)
    sample = pvproperty(value="", name=":sample", max_length=240, read_only=True)
    effort = pvproperty(value=0.0, name=":effort", read_only=True)


class Signal(ChannelDouble):
    """A channel of the scope; it is asked for while somebody monitors it, or reads it."""

    def __init__(self, signals: Signals, channel: str) -> None:
        super().__init__(value=0.0, units=signals.units[channel], precision=9)
        self._signals, self._channel = signals, channel

    async def subscribe(self, queue: Any, sub_spec: Any, sub: Any) -> None:
        """Somebody monitors it."""
        self._signals.look(self._channel, (id(queue), sub_spec))
        await self.show(*await self._signals.once(self._channel))
        await super().subscribe(queue, sub_spec, sub)

    async def unsubscribe(self, queue: Any, sub_spec: Any) -> None:
        """No more."""
        self._signals.leave(self._channel, (id(queue), sub_spec))
        await super().unsubscribe(queue, sub_spec)

    async def read(self, data_type: Any) -> Any:
        """Somebody reads it: what it is now."""
        await self.show(*await self._signals.once(self._channel))
        return await super().read(data_type)

    async def show(self, value: float, wrong: str) -> None:
        """Tell clients, where it is new."""
        severity, status = (
            (AlarmSeverity.INVALID_ALARM, AlarmStatus.READ) if wrong else (AlarmSeverity.NO_ALARM, AlarmStatus.NO_ALARM)
        )
        alarm: Any = self.alarm
        if value != self.value or severity != alarm.severity:
            await self.write(self.value if wrong else value, verify_value=False, severity=severity, status=status)

    def check_access(self, hostname: str, username: str) -> AccessRights:
        """Nobody puts to what is measured."""
        del hostname, username
        return AccessRights.READ


class Served:
    """A record that is served."""

    def __init__(self, name: str) -> None:
        self.group = Record(prefix=name)
        self.value: Any = self.group.motor
        self.fields: dict[str, Any] = dict(self.value.fields)
        self.motor: Motor
        self._refused: list[Any] = []  # puts were, which caproto makes an alarm of theirs

    def attach(self, motor: Motor) -> None:
        """Puts go to the record."""
        self.motor = motor
        self.value.putter = self._putter("VAL")
        for name in motor.actions:
            if name != "VAL" and name in self.fields:
                self.fields[name].putter = self._putter(name)

    def _putter(self, name: str) -> Any:
        async def put(instance: Any, value: Any) -> Any:
            """Do it, and give the value that the field then has."""
            asked = value[0] if isinstance(value, list | tuple) and len(value) == 1 else value
            if isinstance(asked, str) and hasattr(instance, "enum_strings"):
                asked = list(instance.enum_strings).index(asked)
            if isinstance(asked, bytes | str):  # a name of a unit: it stays what it is
                asked = self.motor.fields[name]
            try:
                await self.motor.put(name, asked)
            except DetentError:
                self._refused.append(instance)
                raise
            await asyncio.sleep(SHOWN)
            return self.motor.fields.get(name, asked)

        return put

    async def show(self, fields: Mapping[str, Any]) -> None:
        """Tell clients what has changed."""
        if fields.keys() & {"HLM", "LLM"}:
            ends = {"upper_ctrl_limit": self.motor.fields["HLM"], "lower_ctrl_limit": self.motor.fields["LLM"]}
            await self.value.write_metadata(**ends)
        for name, value in fields.items():
            if name == "VAL":
                await self.value.write(value, verify_value=False)
            elif name in self.fields:
                await self.fields[name].write(value, verify_value=False)

    async def begin(self, motor: Motor) -> None:
        """What does not change, and all that there is now."""
        await self.value.write_metadata(units=motor.axis.unit, precision=motor.fields["PREC"])
        for field in self.fields.values():
            if hasattr(field, "precision"):
                await field.write_metadata(precision=motor.fields["PREC"])
            if hasattr(field, "units") and field.name.split(".")[-1] not in ("ACCL", "BACC", "DLY"):
                await field.write_metadata(units=motor.axis.unit)
        await self.show(motor.fields)

    async def follow(self, motor: Motor) -> None:
        """Show what is no field, as far as it has changed."""
        shown: dict[str, Any] = {}
        while not motor.axis.gone.is_set():
            for name, value in motor.extras().items():
                if shown.get(name) != value:
                    await getattr(self.group, name).write(value, verify_value=False)
                    shown[name] = value
            while self._refused:
                await self._refused.pop().alarm.write(severity=AlarmSeverity.NO_ALARM, status=AlarmStatus.NO_ALARM)
            if self.value.alarm.severity != motor.severity:
                await self.value.alarm.write(severity=AlarmSeverity(motor.severity), status=AlarmStatus(motor.status))
            await asyncio.sleep(SHOWN)


async def served_of(desk: Desk, name: str, axis: AxisService) -> dict[str, Any]:
    """PVs of an axis, by name, which are kept up to date."""
    served = Served(name)
    motor = Motor(axis, served.show)
    served.attach(motor)
    await served.begin(motor)
    shown: dict[str, Signal] = {}
    signals = Signals(axis, lambda channel, value, wrong: shown[channel].show(value, wrong))
    shown |= {channel: Signal(signals, channel) for channel in signals.units}
    for work in (motor.follow(), served.follow(motor), signals.follow()):
        desk.keep(asyncio.ensure_future(work))
    own = {name + signals.name_of(channel): one for channel, one in shown.items()}
    return own | served.group.pvdb  # of two of one name the record's own


async def serve(desk: Desk, address: str) -> list[str]:
    """Serve; gives what a client needs."""
    for logger in ("caproto", "caproto.circ", "caproto.ctx", "caproto.bcast", "caproto.ch"):
        logging.getLogger(logger).setLevel(logging.CRITICAL + 1)
    name, host, port = name_of("epics", address, PORT)
    # Beacons go where clients are told to listen, not to all networks.
    os.environ |= {
        "EPICS_CA_SERVER_PORT": str(port), "EPICS_CAS_SERVER_PORT": str(port), "EPICS_CAS_INTF_ADDR_LIST": host,
        "EPICS_CAS_AUTO_BEACON_ADDR_LIST": "NO", "EPICS_CAS_BEACON_ADDR_LIST": host,
    }  # fmt: skip
    names, pvs = list[str](), dict[str, Any]()
    for axis in await desk.open():
        names.append(f"{name}:{axis.motor}" if axis.motor else name)
        pvs |= await served_of(desk, names[-1], axis)
    context = Context(pvs, [host])
    desk.keep(asyncio.ensure_future(context.run()))
    while not context.port:  # noqa: ASYNC110 - caproto tells it nobody
        await asyncio.sleep(0.01)
    return [*names, f"EPICS_CA_ADDR_LIST={host} EPICS_CA_AUTO_ADDR_LIST=NO EPICS_CA_SERVER_PORT={port}"]
