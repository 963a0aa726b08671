"""Modbus TCP: registers that a PLC reads and writes; 32-bit values have their high word first.

A command is a hand-shake. The PLC raises the heartbeat register at least every second; it writes target, speed and
command, then a new sequence number; what the axis did with it stands in the acknowledged sequence and its result.
"""

import asyncio
import contextlib
import logging
import time
from typing import Any, NamedTuple

from pymodbus.constants import ExcCodes
from pymodbus.pdu.device import ModbusDeviceIdentification
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from detent.errors import DetentError
from detent.faces.service import AxisService, Desk, NotDoneError, address_of

PORT = 502
SILENCE = 0.7  # without a new heartbeat for so long, what was commanded here is stopped [s]
LOOK = 0.05  # how often that is looked at [s]
COMMANDS = (
    "",
    "enable",
    "disable",
    "stop",
    "reset",
    "confirm",
    "home",
    "move_to",
    "move_by",
    "jog",
    "keep",
    "take",
    "leave",
)
"""By their numbers in the command register."""
STATES = (
    "not ready to switch on", "switch on disabled", "ready to switch on", "switched on", "operation enabled",
    "quick stop active", "fault reaction active", "fault",
)  # fmt: skip
TRUSTS = ("unknown", "restored", "referenced")
IDLE, BUSY, DONE, ABORTED, REFUSED, FAILED = range(6)
RESULTS = {"done": DONE, "aborted": ABORTED, "refused": REFUSED, "failed": FAILED}
NO_HEARTBEAT = 121


class Register(NamedTuple):
    """Where a value stands, how many words it has, and what it is."""

    address: int
    words: int
    about: str
    writable: bool = False


# fmt: off
REGISTERS = (
    Register(0, 1, "identification, 0x4454"), Register(1, 1, "version of this list, 1"),
    Register(2, 2, "nanometres, or microdegrees, in a count"), Register(4, 2, "lower limit [count]"),
    Register(6, 2, "upper limit [count]"), Register(8, 2, "largest speed [count/s]"),
    Register(10, 2, "number of the period of all that follows, up to 25"), Register(12, 1, "status bits, see below"),
    Register(13, 1, "state, 0 to 7 as CiA 402 numbers it"),
    Register(14, 1, "trust: 0 unknown, 1 restored, 2 referenced"),
    Register(15, 1, "fault, 0 none"), Register(16, 2, "position [count]"), Register(18, 2, "velocity [count/s]"),
    Register(20, 2, "commanded position [count]"), Register(22, 1, "effort [0.1 %]"),
    Register(23, 1, "sequence number that was acknowledged"),
    Register(24, 1, "its result: 0 none, 1 under way, 2 done, 3 aborted, 4 refused, 5 failed"),
    Register(25, 1, "its reason, as the table of faults and refusals numbers it"),
    Register(40, 1, "heartbeat: another number at least every 0.7 s", writable=True),
    Register(41, 1, "command, see below", writable=True), Register(42, 2, "target or way [count]", writable=True),
    Register(44, 2, "speed or velocity [count/s], 0 the largest", writable=True),
    Register(46, 1, "sequence number: a new one lets the command be done", writable=True),
)
STATUS_BITS = (
    "ready", "enabled", "fault", "moving", "in window", "position known", "at lower limit", "at upper limit",
    "first motion confirmed", "heartbeat seen", "commanded from here", "somebody else commands",
    "selector on local",
)
# fmt: on
FIRST_WRITABLE, SEQUENCE, HEARTBEAT, SIZE = 40, 46, 40, 47
READS, WRITES = (3, 4), (6, 16)
ADDRESSES = {at: one for one in REGISTERS for at in range(one.address, one.address + one.words)}


def words_of(value: int) -> list[int]:
    """A value of 32 bits, its high word first; beyond them the nearest.

    >>> words_of(-2), words_of(65536)
    ([65535, 65534], [1, 0])
    """
    held = min(max(value, -(1 << 31)), (1 << 32) - 1) & 0xFFFFFFFF
    return [held >> 16, held & 0xFFFF]


def signed(words: list[int]) -> int:
    """The value of two words.

    >>> signed([65535, 65534])
    -2
    """
    value = words[0] << 16 | words[1]
    return value - (1 << 32) if value >> 31 else value


class Slave:
    """Registers of one axis."""

    def __init__(self, axis: AxisService) -> None:
        self.axis = axis
        self._heard, self._beats = -SILENCE, False
        self._sequence = self._result = self._reason = 0
        self._commands = False  # something was begun here
        self._running: asyncio.Future[None] | None = None
        self.shown = [0] * SIZE

    def show(self) -> list[int]:
        """All that can be read."""
        axis, s = self.axis, self.axis.status
        low, high = axis.limits or (axis.from_counts(-(1 << 31)), axis.from_counts((1 << 31) - 1))
        self.shown[:FIRST_WRITABLE] = [
            0x4454, 1, *words_of(round(axis.count * 1e6)), *words_of(axis.to_counts(low)),
            *words_of(axis.to_counts(high)), *words_of(round(axis.speed / axis.count)),
            *words_of(s["loop"]["periods"] & 0xFFFFFFFF), self.status_bits(),
            STATES.index(s["state"]), TRUSTS.index(s["trust"]), axis.fault, *words_of(axis.counts),
            *words_of(round(axis.velocity / axis.count)), *words_of(axis.to_counts(axis.commanded)),
            round(min(max(s["effort"] or 0.0, -10.0), 10.0) * 1000) & 0xFFFF, self._sequence, self._result,
            self._reason,
            *[0] * (FIRST_WRITABLE - 26),
        ]  # fmt: skip
        return self.shown

    def status_bits(self) -> int:
        """As `STATUS_BITS` has them, the first one in bit 0."""
        axis, s = self.axis, self.axis.status
        mine = self._commands
        bits = (
            s["ready"], axis.enabled, axis.fault != 0, axis.moving, s["in_window"], axis.homed, axis.at_end == "lower",
            axis.at_end == "upper", s["confirmed"], self._is_heard(), mine, s["client"] != 0 and not mine,
            s["selector"] == "local",
        )  # fmt: skip
        return sum(bool(is_set) << bit for bit, is_set in enumerate(bits))

    def _is_heard(self) -> bool:
        return time.monotonic() - self._heard < SILENCE

    async def access(  # noqa: PLR0913 - as pymodbus calls it
        self, function: int, first: int, address: int, number: int, registers: list[int], values: Any
    ) -> ExcCodes | None:
        """A request: answer with what is shown now, or take what is written."""
        if function not in READS + WRITES:
            return ExcCodes.ILLEGAL_FUNCTION
        wanted = range(address, address + number)
        if any(at not in ADDRESSES and not 26 <= at < FIRST_WRITABLE for at in wanted):
            return ExcCodes.ILLEGAL_ADDRESS
        if values is None:  # to read, or what a function 6 has written is read back for its answer
            registers[: SIZE - first] = self.show()
            return None
        if any(at not in ADDRESSES or not ADDRESSES[at].writable for at in wanted) or not self.axis.commands:
            return ExcCodes.ILLEGAL_ADDRESS
        return self._written(address, [int(value) for value in values])

    def _written(self, address: int, values: list[int]) -> ExcCodes | None:
        new = self.shown.copy()
        new[address : address + len(values)] = values
        if new[41] >= len(COMMANDS):
            return ExcCodes.ILLEGAL_VALUE
        if HEARTBEAT in range(address, address + len(values)) and new[HEARTBEAT] != self.shown[HEARTBEAT]:
            self._heard = time.monotonic()
        begins = SEQUENCE in range(address, address + len(values)) and new[SEQUENCE] != self._sequence
        self.shown[:] = new
        if begins:
            self._sequence, self._result, self._reason = new[SEQUENCE], BUSY, 0
            self._running = asyncio.ensure_future(self._do(new[SEQUENCE], COMMANDS[new[41]], new))
        return None

    async def _do(self, sequence: int, word: str, words: list[int]) -> None:
        """What was asked for, to its end; its result is that of its sequence number."""
        result, reason = DONE, 0
        try:
            if word not in ("stop", "disable", "") and not self._is_heard():
                raise NotDoneError(word, "refused", NO_HEARTBEAT)  # noqa: TRY301 - told below
            await self._command(word, signed(words[42:44]), signed(words[44:46]))
        except NotDoneError as error:
            result, reason = RESULTS[error.how], error.code
        except DetentError:
            result, reason = REFUSED, 52
        if sequence == self._sequence:
            self._result, self._reason = result, reason

    async def _command(self, word: str, target: int, speed: int) -> None:
        axis = self.axis
        if word in ("stop", "disable", ""):
            await (axis.do(word) if word else asyncio.sleep(0))
            return
        self._commands = word != "leave"
        if word == "enable":
            await axis.enable()
        elif word == "move_to":
            await axis.move_to(axis.from_counts(target), speed * axis.count)
        elif word == "move_by":
            await axis.do("move_by", axis.in_si(target * axis.count), axis.share(speed * axis.count))
        elif word == "jog":
            await axis.do("jog", axis.in_si(speed * axis.count))
        else:
            await axis.do(word)

    async def watch(self) -> None:
        """Stop what was commanded here once the heartbeat is silent; until then its jog is kept."""
        while True:
            await asyncio.sleep(LOOK)
            running = self.axis.status["running"]
            with contextlib.suppress(DetentError):
                if self._commands and not self._is_heard():
                    self._commands = False
                    await self.axis.do("leave")  # stops what is under way, and lets others command
                elif self._commands and running and running["command"] == "jog":
                    await self.axis.hold()


def device_of(slave: Slave, unit: int) -> SimDevice:
    """The registers as pymodbus serves them, as a unit; 0: whatever a client asks for."""
    identity = ModbusDeviceIdentification(info_name={
        "VendorName": "detent", "ProductCode": "axis", "MajorMinorRevision": "1",
        "ProductName": slave.axis.about["name"], "ModelName": slave.axis.about["method"],
    })  # fmt: skip
    data = [SimData(0, values=[0] * SIZE, datatype=DataType.REGISTERS)]
    return SimDevice(id=unit, simdata=data, action=slave.access, identity=identity)


async def serve(desk: Desk, address: str) -> list[str]:
    """Serve; gives what a client needs."""
    logging.getLogger("pymodbus").setLevel(logging.CRITICAL + 1)  # it tells of every frame that is none
    host, number = address_of(desk.face, address, PORT)
    slaves = [Slave(axis) for axis in await desk.open()]
    devices = [device_of(slave, k if slaves[1:] else 0) for k, slave in enumerate(slaves, 1)]
    server = ModbusTcpServer(devices, address=(host, number), identity=devices[0].identity)
    await server.serve_forever(background=True)
    for slave in slaves:
        desk.keep(asyncio.ensure_future(slave.watch()))
    port = server.transport.sockets[0].getsockname()[1]  # type: ignore[union-attr]
    units = [f"unit {k}" + (f" = {slave.axis.motor}" if slave.axis.motor else "") for k, slave in enumerate(slaves, 1)]
    return [f"{host}:{port}", *units]
