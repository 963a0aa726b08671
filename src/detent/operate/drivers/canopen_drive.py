"""A CiA 402 drive on a CANopen bus, told a torque, a velocity or a position in each sample (cyclic synchronous modes).

Told a torque, position and velocity loop are detent's; told a velocity, the velocity loop is the drive's; told a
position, both are. In each exchange it gets controlword and demand, then a SYNC, and answers with statusword, position
and error code. What was told it in one exchange acts with the SYNC of it; what it answers was latched there.
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
LOOKS = 100  # at the mode of operation, until it is the one that was set
ABORTS = {0: "does nothing", 1: "goes to its fault", 2: "takes the torque away", 3: "stops quickly"}
REACTIONS = {0: "takes the torque away", 1: "slows down", 2: "stops quickly", 3: "stops at its current limit"}
EXAMPLE = "canopen:socketcan:can0@5"
NO_ANSWER = (can.CanError, OSError, canopen.sdo.exceptions.SdoError, RuntimeError)


def read_address(address: str) -> tuple[dict[str, Any], int, str]:
    """What python-can connects with, the number of the node, and what it is told.

    >>> read_address("slcan:/dev/ttyACM0@5?bitrate=500000&mode=velocity")
    ({'interface': 'slcan', 'channel': '/dev/ttyACM0', 'bitrate': 500000}, 5, 'velocity')
    """
    place, _, more = address.partition("?")
    bus, _, node = place.rpartition("@")
    interface, _, channel = bus.partition(":")
    options = dict(parse_qsl(more, keep_blank_values=True))
    rate, mode = options.pop("bitrate", "1000000"), options.pop("mode", "torque")
    whole = interface and channel and node.isdecimal() and 1 <= int(node) < c.MASTER
    if not (whole and rate.isdecimal() and mode in c.CYCLIC) or options:
        raise DetentError(
            f"--drive canopen:{address}: got no such address; expected: INTERFACE:CHANNEL@NODE, the node from 1 to "
            f"{c.MASTER - 1}, and perhaps ?bitrate=500000&mode=velocity, the mode one of {', '.join(c.CYCLIC)}; "
            f"try: {EXAMPLE}"
        )
    return {"interface": interface, "channel": channel, "bitrate": int(rate)}, int(node), mode


class CanopenDrive:
    """One drive; `wait` is how long an exchange waits for its answer [s], 0: half of its period."""

    def __init__(self, address: str, wait: float = 0.0) -> None:
        self.address, self.hardware, self.silence = address, "", 0.0
        self.ready, self.fault = False, 0
        self._bus, self._number, self.mode = read_address(address)
        self._cyclic = c.CYCLIC[self.mode]
        self._wait = wait
        self._network: Any = canopen.Network()
        self._network.NOTIFIER_CYCLE = LOOK
        self._answer, self._data = threading.Event(), b""
        self._state = self._count = self._exchanges = self._error = self._heard = self._effort = 0
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
                f"the axis file has it; correct its {w.turn_key}, or set the drive"
            )
        modes = sdo[c.MODES].raw
        if not modes & self._cyclic.bit:
            others = [mode for mode, one in c.CYCLIC.items() if modes & one.bit]
            raise DetentError(
                f"canopen:{self.address}: got a drive without cyclic synchronous {self.mode} (6502: {modes:#x}); "
                f"expected: that mode; {f'try: ?mode={others[0]}' if others else 'take another drive'}"
            )
        rated = sdo[c.RATED_TORQUE].raw * 1e-3
        self._effort_unit = 1e-3 * rated / w.torque if w.effort else 0.0
        takes = {"torque": self._fit_torque, "velocity": self._fit_velocity, "position": self._fit_position}[self.mode]
        found = takes(sdo)
        abort, reaction, window = (sdo[index].raw for index in (c.ABORT, c.FAULT_REACTION_OPTION, c.FOLLOWING))
        idle = "the axis runs on when the cable is cut: set it to 1, 2 or 3" if abort == 0 else ""
        return [
            Fact("measures", f"the position of its motor (6064), {w.turn:g} counts in a turn, {w.count:g} m or rad"),
            *found,
            *([Fact("tells", f"its torque (6077), of {rated:g} N*m rated, for the guard")] if w.effort else []),
            Fact("connection lost (6007)", f"{abort}: {ABORTS.get(abort, 'does what its maker says')}", idle),
            Fact("fault (605E)", f"{reaction}: {REACTIONS.get(reaction, 'does what its maker says')}"),
            Fact("following error (6065)", "off; the guard of the controller watches it" if window in (0, c.OFF)
                 else f"{window} counts"),
        ]  # fmt: skip

    def _fit_torque(self, sdo: Any) -> list[Fact]:
        """Torques are in thousandths of the rated one."""
        w, rated = self._wiring, sdo[c.RATED_TORQUE].raw * 1e-3
        self._scale = 1000.0 * w.torque / rated
        if abs(w.largest * self._scale) > 32767:
            raise DetentError(
                f"canopen:{self.address}: got a rated torque of {rated:g} N*m (6076), of which the largest command is "
                f"{w.largest * w.torque / rated:.3g}-fold; expected: up to 32.7-fold; correct [motor], or "
                "drive.command_limit"
            )
        return [Fact("takes", f"a torque (6071), of {rated:g} N*m rated")]

    def _fit_velocity(self, sdo: Any) -> list[Fact]:
        """Velocities are in the drive's own unit."""
        w, word = self._wiring, sdo[c.VELOCITY_UNIT].raw
        unit = c.velocity_unit(word, w.turn) * w.count
        if unit == 0.0 or w.largest > unit * 0x7FFFFFFF:
            raise DetentError(
                f"canopen:{self.address}: got the unit {word:#010x} of a velocity (60A9); expected: increments or "
                f"revolutions, per second or minute, in which {w.largest:g} m/s or rad/s is a word of 32 bits; try: "
                "set it to 0x00b50300, increments per second"
            )
        self._scale = 1.0 / unit
        coarse = f"coarse: the largest is {w.largest / unit:.0f} of them" if w.largest < 1000.0 * unit else ""
        step = f"in steps of {unit:.3g} m/s or rad/s"
        return [Fact("takes", f"a velocity (60FF), {step}; its velocity loop is its own", coarse), self._pace(sdo)]

    def _fit_position(self, sdo: Any) -> list[Fact]:
        """Positions are in the counts of its encoder."""
        self._scale = 1.0 / self._wiring.count
        return [
            Fact("takes", "a position (607A), in the counts of its encoder; its loops are its own"),
            self._pace(sdo),
        ]

    def _pace(self, sdo: Any) -> Fact:
        """Tell it the time between two demands, between which it interpolates."""
        sample = self._wiring.sample
        value, power = c.cycle_of(sample)
        if value == 0:
            raise DetentError(
                f"canopen:{self.address}: got method.sample_period = {sample * 1e3:g} ms, which the drive cannot be "
                "told (60C2); expected: 1 to 255 times a power of ten; try: 1 ms"
            )
        try:
            sdo[c.CYCLE][1].raw, sdo[c.CYCLE][2].raw = value, power
        except canopen.sdo.exceptions.SdoAbortedError as error:
            raise DetentError(
                f"canopen:{self.address}: got a drive that takes no demand every {sample * 1e3:g} ms (60C2: {error}); "
                "expected: one that does; try: another method.sample_period"
            ) from error
        return Fact("interpolates (60C2)", f"over {sample * 1e3:g} ms")

    def _set_up(self, node: Any) -> None:
        """Its mode, and what goes to and fro; heartbeats both ways."""
        node.nmt.state = "PRE-OPERATIONAL"
        effort = [(node.tpdo[2], (c.TORQUE_SHOWN,))] if self._wiring.effort else []
        for made, words in (
            (node.rpdo[1], (c.CONTROL, self._cyclic.target)),
            (node.tpdo[1], (c.STATUS, c.POSITION, c.ERROR_CODE)),
            *effort,
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
        for made, _ in effort:
            self._network.subscribe(made.cob_id, self._take_effort)
        self._choose_mode(node.sdo)
        node.sdo[c.PRODUCER].raw = math.ceil(self.silence / SILENT * 1e3)
        self._to = node.rpdo[1].cob_id

    def _choose_mode(self, sdo: Any) -> None:
        """Set the mode of operation, and see that it is in it."""
        sdo[c.MODE].raw = wanted = self._cyclic.number
        shown = next((wanted for _ in range(LOOKS) if sdo[c.MODE_SHOWN].raw == wanted), sdo[c.MODE_SHOWN].raw)
        if shown != wanted:
            raise DetentError(
                f"canopen:{self.address}: got the mode of operation {shown} (6061) after {wanted} was set (6060); "
                f"expected: {wanted}, cyclic synchronous {self.mode}; try: switch the drive off and on"
            )

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

    def _take_effort(self, _id: int, data: bytearray, _moment: float) -> None:
        """What it gives, in the thread of the bus; it counts when the next answer is read."""
        (self._effort,) = struct.unpack("<h", data)

    def read(self, lines: Any) -> bool:
        """Position and state, as they were latched at the last SYNC."""
        if not self._answer.wait(self._wait):
            return False
        self._answer.clear()
        word, count, self._error = struct.unpack("<HiH", self._data)
        self._state = c.state_of(word)
        self._count += (count - self._count + SPAN // 2) % SPAN - SPAN // 2
        put(lines, self._wiring.position, self._count)
        if self._wiring.effort:
            put(lines, self._wiring.effort, self._effort * self._effort_unit)
        if self._wiring.samples:
            self._heard += 1
            put(lines, self._wiring.samples, self._heard)
        self._judge(enable=bool(attrgetter(self._wiring.enable)(lines)))
        return True

    def _judge(self, *, enable: bool) -> None:
        """Is it ready, and has it left its operation by itself."""
        self.ready = self._state in (READY, SWITCHED_ON, ENABLED)
        self._enabled = enable and (self._enabled or self._state == ENABLED)
        left = self._enabled and self._state != ENABLED
        self.fault = c.fault_of(self._error) if left or self._state in (FAULT, FAULT_REACTION) else 0

    def write(self, lines: Any, *, reset: bool) -> None:
        """Controlword and demand, then the SYNC."""
        enable = bool(attrgetter(self._wiring.enable)(lines)) and not self.fault
        demand = self._demand(lines) if enable and self._state == ENABLED else self._nothing
        data = self._packed(self._control(enable=enable, reset=reset), demand)
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

    @property
    def _nothing(self) -> int:
        """The demand that moves nothing: no torque, no velocity, or where it is."""
        return self._count if self.mode == "position" else 0

    def _demand(self, lines: Any) -> int:
        """What the controller says, in the unit of the drive."""
        demand = attrgetter(self._wiring.demand)(lines)
        if self._wiring.zero:
            demand -= attrgetter(self._wiring.zero)(lines)
        return round(demand * self._scale)

    def _packed(self, control: int, demand: int) -> bytes:
        """As they go to the drive; a position is a word of 32 bits that wraps."""
        word = (demand + SPAN // 2) % SPAN - SPAN // 2
        return struct.pack(f"<H{self._cyclic.code}", control, word)

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
            self._network.send_message(self._to, self._packed(0, self._nothing))
            self._network.send_message(c.SYNC, b"")
            self._node.sdo[c.CONSUMER][1].raw = 0
            self._node.nmt.state = "PRE-OPERATIONAL"
        except NO_ANSWER:
            pass  # it has seen by itself that nobody is there
        finally:
            self._network.disconnect()
