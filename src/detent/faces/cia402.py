"""A drive as CiA 402 has it, before the amplifier and mechanics of an axis file: what a master drives cyclically.

A SYNC is a sample: what the master has sent before it acts, the encoder latches, the answer goes out, and the time of a
sample passes in the mechanics. Without a SYNC their time stands. When nothing is heard of the master for longer than
it has asked to be watched (1016), the drive does what its abort connection option code says (6007). It has one mode, of
torques, velocities or positions; in the latter two it closes the loops of the axis file by itself.
"""

import struct
import threading
import time
from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import Any

import canopen

from detent.control.axis_states import (
    DISABLE_VOLTAGE,
    ENABLED,
    FAULT,
    HALT_QUICKLY,
    NOT_READY,
    QUICK_STOP,
    RESET_FAULT,
    SWITCH_ON_DISABLED,
    ordered,
)
from detent.methods.load import read_axis
from detent.methods.method import Plant, Wiring
from detent.methods.registry import METHODS
from detent.operate.drivers import cia402 as c
from detent.operate.drivers.canopen_drive import read_address
from detent.operate.drivers.driver import put

RESET, NO_MASTER = 0x80, 0x8130  # controlword bit; error code: heartbeat lost
VOLTAGE, REMOTE = 0x10, 0x200  # bits of the statusword
LOOK = 2e-3  # how often a served drive looks after its master [s]


class Drive:
    """One node; `rated` is its rated torque [N*m]."""

    def __init__(  # noqa: PLR0913 - a machine, and what a drive says of itself
        self, plant: Plant, wiring: Wiring, node: int, *, identity: Sequence[int] = (0, 0, 0, 0), rated: float = 1.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:  # fmt: skip
        self.plant, self.wiring, self.state, self.error = plant, wiring, NOT_READY, 0
        self._clock, self._lock = clock, threading.Lock()
        self._heard = self._limit = 0.0
        self._word = self._demand = 0
        self._mode = c.CYCLIC[wiring.mode]
        self._code = f"<H{self._mode.code}"
        self._told = bytes(struct.calcsize(self._code))
        self._effort_unit = rated * 1e-3 / wiring.torque if wiring.torque else 1.0
        self._unit = self._effort_unit if wiring.mode == "torque" else wiring.count
        self.node: Any = canopen.LocalNode(node, c.dictionary(node))
        for part, value in enumerate(identity, 1):
            self._keep(c.IDENTITY, part, value)
        self._keep(c.RESOLUTION, 1, round(wiring.turn * 1000))
        self._keep(c.RESOLUTION, 2, 1000)
        self._keep(c.RATED_TORQUE, 0, round(rated * 1e3))
        self._keep(c.MODES, 0, self._mode.bit)
        self._keep(c.RX_MAP, 2, self._mode.target << 16 | 8 * struct.calcsize(self._mode.code))
        self.node.add_read_callback(self._read)
        self.node.add_write_callback(self._written)

    def _keep(self, index: int, part: int, value: int) -> None:
        thing = self.node.object_dictionary[index]
        variable = thing[part] if part else thing
        self.node.data_store.setdefault(index, {})[part] = variable.encode_raw(value)

    # ---- the bus

    def join(self, network: Any) -> None:
        """Be a node of a network."""
        network[self.node.id] = self.node
        network.subscribe(c.SYNC, self._sync)
        network.subscribe(0x700 + c.MASTER, self._beat)
        network.subscribe(0x200 + self.node.id, self._take)
        self.state = SWITCH_ON_DISABLED
        self.node.nmt.send_command(0)
        self.node.nmt.send_command(128)

    def _take(self, _id: int, data: bytearray, _moment: float) -> None:
        self._told = bytes(data)

    def _beat(self, _id: int, _data: bytearray, _moment: float) -> None:
        self._heard = self._clock()

    def _read(self, *, index: int, **_: Any) -> int | None:
        """Objects that show how the drive is."""
        shown = {
            c.STATUS: c.WORDS[self.state] | VOLTAGE | REMOTE, c.POSITION: self.position, c.ERROR_CODE: self.error,
            c.MODE_SHOWN: self._mode.number, c.TORQUE_SHOWN: self.torque, 0x1001: 1 if self.error else 0,
        }  # fmt: skip
        return shown.get(index)

    def _written(self, *, index: int, subindex: int, data: bytes, **_: Any) -> None:
        """Objects that act when they are written."""
        if index == c.CONSUMER:
            self._limit, self._heard = (int.from_bytes(data, "little") & 0xFFFF) * 1e-3, self._clock()
        elif index in (c.RX, c.TX, c.TX_2, c.RX_MAP, c.TX_MAP, c.TX_2_MAP):
            raise canopen.SdoAbortedError(0x06040041)  # what goes to and fro is as it is
        elif index == c.MODE and data[0] != self._mode.number:
            raise canopen.SdoAbortedError(0x06090030)  # it has no other
        elif index == c.CYCLE and subindex == 2:
            told = int.from_bytes(self.node.get_data(c.CYCLE, 1), "little"), int.from_bytes(data, "little", signed=True)
            if told != c.cycle_of(self.wiring.sample):
                raise canopen.SdoAbortedError(0x06090030)  # nor another sample
        elif index == c.CONTROL:
            self._obey(int.from_bytes(data, "little"))

    def _sync(self, _id: int, _data: bytearray, _moment: float) -> None:
        """A sample."""
        if self.node.nmt.state != "OPERATIONAL":
            return
        with self._lock:
            word, demand = struct.unpack(self._code, self._told)
            self._obey(word)
            self._demand = demand if self.state == ENABLED else 0
            lines = self.plant.state.lines
            put(lines, self.wiring.enable, int(self.state == ENABLED))
            put(lines, self.wiring.demand, self._place(demand) if self.wiring.zero else self._demand * self._unit)
            self.plant.sample()
        if self.wiring.effort:
            self.node.network.send_message(0x280 + self.node.id, struct.pack("<h", self.torque))
        answer = struct.pack("<HiH", c.WORDS[self.state] | VOLTAGE | REMOTE, self.position, self.error)
        self.node.network.send_message(0x180 + self.node.id, answer)

    # ---- the drive

    def _place(self, demand: int) -> float:
        """Position that a word means: the nearest to where it is."""
        here = int(attrgetter(self.wiring.position)(self.plant.state.lines))
        return (here + (demand - here + (1 << 31)) % (1 << 32) - (1 << 31)) * self._unit

    @property
    def position(self) -> int:
        """Counts, as the word of 32 bits that they are."""
        count = int(attrgetter(self.wiring.position)(self.plant.state.lines))
        return (count + (1 << 31)) % (1 << 32) - (1 << 31)

    @property
    def torque(self) -> int:
        """What it gives now, in thousandths of its rated torque; 0 where that is not known."""
        if self.wiring.mode == "torque":
            return self._demand
        effort = attrgetter(self.wiring.effort)(self.plant.state.lines) if self.wiring.effort else 0.0
        return min(max(round(effort / self._effort_unit), -32768), 32767) if self.state == ENABLED else 0

    def _obey(self, word: int) -> None:
        """A controlword; a fault is left by the edge of its bit."""
        if word & RESET and not self._word & RESET:
            self.state = ordered(self.state, RESET_FAULT)
            self.error = 0 if self.state != FAULT else self.error
        elif not word & RESET:
            for order in c.orders_of(word, self.state):
                self.state = ordered(self.state, order)
        self._word = word

    def fail(self, code: int) -> None:
        """A fault: no torque, until the edge that resets it."""
        with self._lock:
            self.state, self.error, self._demand = FAULT, code, 0
            put(self.plant.state.lines, self.wiring.enable, 0)

    def watch(self) -> None:
        """Look after the master: gone for too long, it is as 6007 says."""
        if not 0.0 < self._limit < self._clock() - self._heard or self.state == FAULT:
            return
        option = int.from_bytes(self.node.get_data(c.ABORT, 0), "little", signed=True)
        if option == 1:
            self.fail(NO_MASTER)
        elif option in (2, 3):  # its quick stop takes the torque away, too (605A)
            with self._lock:
                before = self.state
                self.state = ordered(self.state, HALT_QUICKLY if option == 3 else DISABLE_VOLTAGE)
                self.state = ordered(self.state, DISABLE_VOLTAGE) if self.state == QUICK_STOP else self.state
                self._demand = 0 if self.state != before else self._demand
                put(self.plant.state.lines, self.wiring.enable, int(self.state == ENABLED))


def drive_of(file: Any, node: int, overrides: Sequence[str] = (), mode: str = "torque", **more: Any) -> Drive:
    """The drive of an axis file, with the amplifier and the mechanics that it describes, and its loops if need be."""
    spec = read_axis(file, overrides).spec
    plant, wiring = METHODS[spec.axis.method].machine(spec, mode=mode)
    return Drive(plant, wiring, node, **more)


def serve(file: Any, address: str, left: threading.Event, overrides: Sequence[str] = (), **more: Any) -> Drive:
    """Be the drive of an axis file at an address, ``slcan:/dev/pts/3@5?mode=velocity``, until `left` is set."""
    bus, node, mode = read_address(address)
    network: Any = canopen.Network()
    drive = drive_of(file, node, overrides, mode, **more)
    network.connect(**bus)
    try:
        drive.join(network)
        while not left.wait(LOOK):
            drive.watch()
    finally:
        network.disconnect()
    return drive
