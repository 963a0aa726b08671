"""Zaber's ASCII protocol, the part of it that axes need, in native units: a microstep is a count of the sensor.

It is device 1, with an axis for each motor of the file. It does not say that it is one of Zaber's, and their libraries
can drive it without identifying it, in native units.
"""

import asyncio

from detent.errors import DetentError
from detent.faces.service import BEYOND, NOT_YOURS, UNREFERENCED, AxisService, Desk, NotDoneError
from detent.faces.talk import Send, Talk, serve_lines

PORT = 55550
SPEED_UNIT = 1.6384  # of a velocity in microsteps per second
REJECTIONS = {
    BEYOND: "BADDATA", UNREFERENCED: "BADAXIS", 105: "BADCOMMAND", **dict.fromkeys(NOT_YOURS, "REMOTE"),
}  # fmt: skip
SETTINGS = (
    "pos", "limit.max", "limit.min", "maxspeed", "deviceid", "version", "system.serial", "system.axiscount",
    "comm.address", "comm.protocol", "comm.alert", "comm.checksum", "comm.word.size.max", "comm.packet.size.max",
    "comm.command.packets.max", "encoder.pos", "resolution", "peripheralid", "peripheral.id", "device.id",
    "limit.home.triggered", "system.access", "accel",
)  # fmt: skip

OF_DEVICE = tuple(name for name in SETTINGS if name.startswith(("comm.", "system.", "device", "version")))


class RejectedError(Exception):
    """A command that is refused, by its word."""


def checksum(text: str) -> int:
    """Sum of all characters, negative, in a byte.

    >>> f"{checksum('01 tools echo'):02X}"
    '8F'
    """
    return -sum(text.encode("latin-1", "replace")) & 0xFF


class Zaber(Talk):
    """One client."""

    end = b"\r\n"

    def __init__(self, axes: tuple[AxisService, ...], send: Send) -> None:
        super().__init__(axes, send)
        self._checked = False
        self._speeds = {axis.motor: axis.speed for axis in axes}

    def stops(self, line: str) -> bool:
        """A stop overtakes."""
        words = line.partition(":")[0].lstrip("/").split()
        return bool(set(words) & {"stop", "estop"})

    async def answer(self, line: str) -> None:
        """A command: its device and axis are numbers before it, a third number marks the answer."""
        if not line.startswith("/"):
            return  # no command, or an answer of somebody else's
        body, colon, said = line[1:].partition(":")
        if colon:
            self._checked = True
            if said.upper() != f"{checksum(body):02X}":
                return  # what was garbled on its way has no answer
        words, numbers = body.split(), list[str]()
        while words and len(numbers) < 3 and (words[0].isdigit() or words[0] == "?"):
            numbers.append(words.pop(0))
        device, number, mark = [*numbers, *("0", "0", "")[len(numbers) :]]
        if device.isdigit() and int(device) > 1:
            return
        try:
            flag, data = "OK", await self._ask(number, words)
        except RejectedError as error:
            flag, data = "RJ", str(error)
        except NotDoneError as error:
            flag, data = "RJ", REJECTIONS.get(error.code, "BADDATA")
        except (DetentError, ValueError, OverflowError):  # of a number of hundreds of digits
            flag, data = "RJ", "BADDATA"
        asked = self._asked(number)
        status = "BUSY" if any(axis.moving for axis in asked) else "IDLE"
        warning = next(filter(lambda flag: flag != "--", map(self.warning, asked)), "--")
        marked = f" {mark}" if mark else ""
        self._tell(f"01 {number}{marked} {flag} {status} {warning} {data}")

    def _asked(self, number: str) -> tuple[AxisService, ...]:
        """Axes that a number means: 0, or one that there is not, all of them."""
        k = int(number) if number.isdigit() else 0
        return self.axes[k - 1 : k] or self.axes if k else self.axes

    async def _ask(self, number: str, words: list[str]) -> str:
        """Let each axis do it; an answer with several values has one of each, as the protocol has them."""
        if not number.isdigit() or int(number) > len(self.axes):
            raise RejectedError("BADAXIS")
        asked = self._asked(number)
        await asyncio.gather(*(axis.refresh() for axis in asked))
        told = await asyncio.gather(*(self._do(axis, words) for axis in asked))
        return " ".join(told) if words[:1] == ["get"] and words[1:2] and words[1] not in OF_DEVICE else told[0]

    def _tell(self, text: str) -> None:
        self.send(f"@{text}" + (f":{checksum(text):02X}" if self._checked else ""))

    def warning(self, axis: AxisService) -> str:
        """The flag of a fault: following error, stopped, no reference."""
        if axis.fault:
            return "FS" if axis.fault in (10, 11, 12, 13) else "FF"
        return "--" if axis.homed else "WR"

    async def _do(self, axis: AxisService, words: list[str]) -> str:
        word, *rest = words or [""]
        if word == "home":
            await axis.enable()
            if "home" in axis.about["commands"]:
                await axis.start("home")
            else:
                await axis.begin_move(axis.limits[0] if axis.limits else axis.origin)
        elif word == "move":
            await self._move(axis, rest)
        elif word in ("stop", "estop"):
            await axis.stop()
        elif word == "get":
            return self._get(axis, rest)
        elif word == "set":
            self._set(axis, rest)
        elif word == "warnings":
            return "00" if self.warning(axis) == "--" else f"01 {self.warning(axis)}"
        elif word == "tools" and rest[:1] == ["echo"]:
            return " ".join(rest[1:]) or "0"
        elif word == "driver" and rest in (["enable"], ["disable"]):
            await (axis.enable() if rest == ["enable"] else axis.do("disable"))
        elif word == "detent":  # a word of its own: what every face shows alike
            return str(axis.sample).replace(" ", "_")
        elif word:
            raise RejectedError("BADCOMMAND")
        return "0"

    async def _move(self, axis: AxisService, words: list[str]) -> None:
        low, high = axis.limits or (-1e9, 1e9)
        if words[:1] in (["min"], ["max"]) and axis.limits:
            await axis.enable()
            await axis.begin_move(low if words == ["min"] else high, self._speeds[axis.motor])
            return
        kind, number = words[0] if words else "", int(words[1]) if len(words) > 1 else 0
        if len(words) < 2 or kind not in ("abs", "rel", "vel"):
            raise RejectedError("BADCOMMAND")
        if kind == "vel":
            speed = number / SPEED_UNIT * axis.count
            if abs(speed) > axis.speed * (1 + 1e-9):
                raise RejectedError("BADDATA")
            await axis.enable()
            await axis.jog(speed)
            axis.keep()
            return
        target = axis.from_counts(number + (axis.to_counts(axis.commanded) if kind == "rel" else 0))
        if not low <= target <= high:
            raise RejectedError("BADDATA")
        await axis.enable()
        await axis.begin_move(target, self._speeds[axis.motor])

    def _get(self, axis: AxisService, words: list[str]) -> str:
        name, speed = words[0] if words else "", self._speeds[axis.motor]
        low, high = axis.limits or (-1e6, 1e6)
        values = {
            "pos": axis.counts, "encoder.pos": axis.counts, "limit.min": axis.to_counts(low),
            "limit.max": axis.to_counts(high), "maxspeed": round(speed / axis.count * SPEED_UNIT),
            "accel": round(axis.about["acceleration"] * axis.scale / axis.count * SPEED_UNIT / 1e4),
            "deviceid": 0, "device.id": 0, "peripheralid": 0, "peripheral.id": 0, "version": "7.38",
            "system.serial": 1, "system.axiscount": len(self.axes), "system.access": 1, "comm.address": 1,
            "comm.protocol": 2, "comm.alert": 0, "comm.checksum": int(self._checked), "comm.word.size.max": 50,
            "comm.packet.size.max": 80, "comm.command.packets.max": 1, "resolution": 1,
            "limit.home.triggered": int(axis.homed),
        }  # fmt: skip
        if name not in values:
            raise RejectedError("BADCOMMAND")
        return str(values[name])

    def _set(self, axis: AxisService, words: list[str]) -> None:
        if len(words) != 2 or words[0] not in ("maxspeed", "comm.alert", "comm.checksum", "system.access"):
            raise RejectedError("BADCOMMAND")
        value = int(words[1])
        if words[0] == "maxspeed":
            speed = value / SPEED_UNIT * axis.count
            if not 0.0 < speed <= axis.speed * (1 + 1e-9):
                raise RejectedError("BADDATA")
            self._speeds[axis.motor] = speed
        elif words[0] == "comm.checksum":
            self._checked = bool(value)


async def serve(desk: Desk, address: str) -> list[str]:
    """Serve; gives what a client needs."""
    return await serve_lines(desk, address, Zaber, PORT)
