"""A CiA 402 drive on a CANopen bus, in cyclic synchronous torque: the loops are detent's, current and counts its own.

In each exchange it gets controlword and torque, then a SYNC, and answers with statusword, position and error code. What
was told it in one exchange acts with the SYNC of it; what it answers was latched there.
"""

import math
import struct
import threading
import time
from operator import attrgetter
from typing import Any
from urllib.parse import parse_qsl

import can
import canopen
import canopen.sdo.exceptions

from detent.control.axis_states import (
    ENABLED,
    FAULT,
    FAULT_REACTION,
    QUICK_STOP,
    READY,
    SWITCH_ON_DISABLED,
    SWITCHED_ON,
)
from detent.errors import AxisError, DetentError
from detent.methods.method import Wiring
from detent.operate.drivers import cia402 as c
from detent.operate.drivers.driver import Fact, put

HEARTBEAT = 0.01  # of the drive, and ours; one sample where that is longer [s]
SILENT = 3  # of these without a word are a fault
LOOK = 0.02  # how often the thread of the bus sees whether it is to end [s]
SPAN = 1 << 32  # counts of a position word
ABORTS = {0: "does nothing", 1: "goes to its fault", 2: "takes the torque away", 3: "stops quickly"}
REACTIONS = {0: "takes the torque away", 1: "slows down", 2: "stops quickly", 3: "stops at its current limit"}
EXAMPLE = "canopen:socketcan:can0@5"
NO_ANSWER = (can.CanError, OSError, canopen.sdo.exceptions.SdoError, RuntimeError)


def read_address(address: str) -> tuple[dict[str, Any], int]:
    """What python-can connects with, and the number of the node.

    >>> read_address("slcan:/dev/ttyACM0@5?bitrate=500000")
    ({'interface': 'slcan', 'channel': '/dev/ttyACM0', 'bitrate': 500000}, 5)
    """
    place, _, more = address.partition("?")
    bus, _, node = place.rpartition("@")
    interface, _, channel = bus.partition(":")
    options = dict(parse_qsl(more, keep_blank_values=True))
    rate = options.pop("bitrate", "1000000")
    if not (interface and channel and node.isdecimal() and 1 <= int(node) < c.MASTER and rate.isdecimal()) or options:
        raise DetentError(
            f"--drive canopen:{address}: got no such address; expected: INTERFACE:CHANNEL@NODE, the node from 1 to "
            f"{c.MASTER - 1}, and perhaps ?bitrate=500000; try: {EXAMPLE}"
        )
    return {"interface": interface, "channel": channel, "bitrate": int(rate)}, int(node)


class CanopenDrive:
    """One drive; `wait` is how long an exchange waits for its answer [s], 0: half of its period."""

    mode = "torque"

    def __init__(self, address: str, wait: float = 0.0) -> None:
        self.address, self.hardware, self.silence = address, "", 0.0
        self.ready, self.fault = False, 0
        self._bus, self._number = read_address(address)
        self._wait = wait
        self._network: Any = canopen.Network()
        self._network.NOTIFIER_CYCLE = LOOK
        self._answer, self._data = threading.Event(), b""
        self._state = self._count = self._exchanges = self._error = 0
        self._enabled, self._beat = False, 0.0

    # ---- beginning

    def open(self, wiring: Wiring) -> list[Fact]:
        """Connect, see that it is a drive that fits, and set it up; it does not move by that."""
        self._wiring = wiring
        self._wait = self._wait or 0.5 * wiring.sample
        self.silence = SILENT * max(HEARTBEAT, wiring.sample)
        try:
            self._network.connect(**self._bus)
            self._node = self._network.add_node(self._number, c.dictionary(self._number))
            facts = self._fit(self._node.sdo)
            self._set_up(self._node)
        except NO_ANSWER as error:
            self._network.disconnect()
            raise AxisError(
                f"canopen:{self.address}: got no answer of the drive ({error}); expected: a CiA 402 drive of this "
                "number that is switched on; try: look at cable, bit rate, termination and node number"
            ) from error
        except DetentError:
            self._network.disconnect()
            raise
        return facts

    def _fit(self, sdo: Any) -> list[Fact]:
        """What it says of itself; refused where it cannot be what the axis file describes."""
        w = self._wiring
        self.hardware = c.identity_text([sdo[c.IDENTITY][part].raw for part in (1, 2, 3, 4)])
        turn = sdo[c.RESOLUTION][1].raw / sdo[c.RESOLUTION][2].raw
        if abs(turn - w.turn) > 1e-6 * turn:
            raise DetentError(
                f"canopen:{self.address}: got {turn:g} counts in a turn of the motor (608F); expected: {w.turn:g}, as "
                "the axis file has it; correct its encoder.resolution or mechanics.travel_per_revolution"
            )
        if not sdo[c.MODES].raw >> (c.CYCLIC_TORQUE - 1) & 1:
            raise DetentError(
                f"canopen:{self.address}: got a drive without cyclic synchronous torque (6502); expected: that mode; "
                "take another drive"
            )
        rated = sdo[c.RATED_TORQUE].raw * 1e-3
        self._per_mille = 1000.0 * w.torque / rated
        if abs(w.largest * self._per_mille) > 32767:
            raise DetentError(
                f"canopen:{self.address}: got a rated torque of {rated:g} N*m (6076), of which the largest command is "
                f"{w.largest * w.torque / rated:.3g}-fold; expected: up to 32.7-fold; correct [motor], or "
                "drive.command_limit"
            )
        abort, reaction, window = (sdo[index].raw for index in (c.ABORT, c.FAULT_REACTION_OPTION, c.FOLLOWING))
        idle = "the axis runs on when the cable is cut: set it to 1, 2 or 3" if abort == 0 else ""
        return [
            Fact("measures", f"the position of its motor (6064), {w.turn:g} counts in a turn, {w.count:g} m or rad"),
            Fact("takes", f"a torque (6071), of {rated:g} N*m rated"),
            Fact("connection lost (6007)", f"{abort}: {ABORTS.get(abort, 'does what its maker says')}", idle),
            Fact("fault (605E)", f"{reaction}: {REACTIONS.get(reaction, 'does what its maker says')}"),
            Fact("following error (6065)", "off; the guard of the controller watches it" if window in (0, c.OFF)
                 else f"{window} counts"),
        ]  # fmt: skip

    def _set_up(self, node: Any) -> None:
        """Cyclic torque, and what goes to and fro; heartbeats both ways."""
        node.nmt.state = "PRE-OPERATIONAL"
        for made, words in (
            (node.rpdo[1], (c.CONTROL, c.TORQUE)),
            (node.tpdo[1], (c.STATUS, c.POSITION, c.ERROR_CODE)),
        ):
            made.read()
            if made.enabled and made.trans_type == 1 and tuple(word.index for word in made) == words:
                continue
            made.clear()
            for word in words:
                made.add_variable(word)
            made.trans_type, made.enabled = 1, True
            made.save()
        self._network.subscribe(node.tpdo[1].cob_id, self._take)
        node.sdo[c.MODE].raw = c.CYCLIC_TORQUE
        node.sdo[c.PRODUCER].raw = math.ceil(self.silence / SILENT * 1e3)
        self._to = node.rpdo[1].cob_id

    def _begin(self) -> None:
        """From now on the drive is told something in each sample, and looks after us."""
        self._node.sdo[c.CONSUMER][1].raw = c.MASTER << 16 | math.ceil(self.silence * 1e3)
        self._node.nmt.state = "OPERATIONAL"

    def counted(self) -> list[Fact]:
        """Nobody counts on a bus, whose controllers send again what was spoilt."""
        return []

    # ---- exchange

    def _take(self, _id: int, data: bytearray, _moment: float) -> None:
        """An answer, in the thread of the bus."""
        self._data = bytes(data)
        self._answer.set()

    def read(self, lines: Any) -> bool:
        """Position and state, as they were latched at the last SYNC."""
        if not self._answer.wait(self._wait):
            return False
        self._answer.clear()
        word, count, self._error = struct.unpack("<HiH", self._data)
        self._state = c.state_of(word)
        self._count += (count - self._count + SPAN // 2) % SPAN - SPAN // 2
        put(lines, self._wiring.position, self._count)
        self._judge(enable=bool(attrgetter(self._wiring.enable)(lines)))
        return True

    def _judge(self, *, enable: bool) -> None:
        """Is it ready, and has it left its operation by itself."""
        self.ready = self._state in (READY, SWITCHED_ON, ENABLED)
        self._enabled = enable and (self._enabled or self._state == ENABLED)
        left = self._enabled and self._state != ENABLED
        self.fault = c.fault_of(self._error) if left or self._state in (FAULT, FAULT_REACTION) else 0

    def write(self, lines: Any, *, reset: bool) -> None:
        """Controlword and torque, then the SYNC."""
        enable = bool(attrgetter(self._wiring.enable)(lines)) and not self.fault
        torque = attrgetter(self._wiring.demand)(lines) if enable and self._state == ENABLED else 0.0
        data = struct.pack("<Hh", self._control(enable=enable, reset=reset), round(torque * self._per_mille))
        self._exchanges += 1
        try:
            if self._exchanges == 1:
                self._begin()
            if time.monotonic() - self._beat >= self.silence / SILENT:
                self._beat = time.monotonic()
                self._network.send_message(0x700 + c.MASTER, b"\5")
            self._network.send_message(self._to, data)
            self._network.send_message(c.SYNC, b"")
        except NO_ANSWER:  # nothing will be heard either, and that is a fault
            self._answer.clear()

    def _control(self, *, enable: bool, reset: bool) -> int:
        """The word that leads on from the present state."""
        if self._state == FAULT:
            return 0x80 if reset and self._exchanges & 1 else 0x00
        if self._state in (SWITCH_ON_DISABLED, READY) and not enable:
            return 0x06
        if enable and self._state != QUICK_STOP:
            return {SWITCH_ON_DISABLED: 0x06, READY: 0x07}.get(self._state, 0x0F)
        return 0x00

    def close(self) -> None:
        """No voltage, no cycle, no heartbeat to wait for."""
        try:
            self._network.send_message(self._to, struct.pack("<Hh", 0, 0))
            self._network.send_message(c.SYNC, b"")
            self._node.sdo[c.CONSUMER][1].raw = 0
            self._node.nmt.state = "PRE-OPERATIONAL"
        except NO_ANSWER:
            pass  # it has seen by itself that nobody is there
        finally:
            self._network.disconnect()
