"""The live axis as a CiA 402 drive on a CAN bus: profile position and velocity, homing, and what follows a master.

Its states are those of the axis; positions are counts of the sensor, velocities counts per second. The bus is served by
a thread of python-can; what it writes is done in the order in which it came, in the loop of the face.
"""

import asyncio
import time
from functools import partial
from typing import Any

import can
import canopen
from canopen.objectdictionary.datatypes import INTEGER8, INTEGER16, INTEGER32, UNSIGNED8, UNSIGNED16, UNSIGNED32

from detent.control.axis_states import ENABLED, FAULT, HALT_QUICKLY, QUICK_STOP, STATE_NAMES, ordered
from detent.errors import DetentError
from detent.faces.cyclic import MODES, Cyclic, cycle, supported
from detent.faces.guarding import GUARD_TIME, LIFE_TIME_FACTOR, Guarding
from detent.faces.service import LEASE_LOST, AxisService, Desk, NotDoneError
from detent.faces.set_points import HALT, SetPoints
from detent.operate.drivers import cia402 as c
from detent.operate.drivers.canopen_drive import read_address

RESET, NEW = 0x80, 0x10
VOLTAGE, REMOTE, REACHED, LIMIT, MODE_BIT, MODE_ERROR = 0x10, 0x200, 0x400, 0x800, 0x1000, 0x2000
POSITION, VELOCITY, HOMING = 1, 3, 6
SUPPORTED = 1 << 0 | 1 << 2 | 1 << 5
NO_MASTER = 0x8130
RESETS = 0x81, 0x82  # commands of the network master: of the node, of its communication
HEARTBEAT, GENERIC, COMMUNICATION = 0x700, 0x01, 0x10  # identifier; bits of the error register
TOO_LARGE, OTHER_VALUE = 0x06090031, 0x06090030
ERRORS = {1: 0x7305, 10: 0x8611, 11: 0x8400, 12: 0x7121, 20: 0x2310, 21: 0x2350, 30: 0x8612, 40: 0x7500, 50: 0x6100}
"""Error codes (603F) of the table of faults; others are the manufacturer's, 0xFF00 and the number of the fault."""
SAMPLE = 0x2000  # object: number of the period of what is shown, trust, fault
EVENT = 20  # between two process data that no SYNC asks for [ms]
LOOK = 0.01  # how often the master is looked after [s]


def objects_of(axis: AxisService) -> tuple[c.Entry, ...]:
    """Objects without parts, with what the axis says for defaults."""
    e, speed = c.Entry, round(axis.speed / axis.count)
    rate = axis.about["acceleration"]
    ramp = round(rate * axis.scale / axis.count) if rate else 0
    # fmt: off
    return (
        e(0x1000, "Device type", UNSIGNED32, "ro", 0x00020192), e(0x1001, "Error register", UNSIGNED8, "ro"),
        e(GUARD_TIME, "Guard time", UNSIGNED16), e(LIFE_TIME_FACTOR, "Life time factor", UNSIGNED8),
        e(0x1017, "Producer heartbeat time", UNSIGNED16),
        e(c.ABORT, "Abort connection option code", INTEGER16, "rw", 3),
        e(c.ERROR_CODE, "Error code", UNSIGNED16, "ro"), e(c.CONTROL, "Controlword", UNSIGNED16),
        e(c.STATUS, "Statusword", UNSIGNED16, "ro"),
        e(c.QUICK_STOP_OPTION, "Quick stop option code", INTEGER16, "ro", 6),
        e(c.FAULT_REACTION_OPTION, "Fault reaction option code", INTEGER16, "ro", 2),
        e(c.MODE, "Modes of operation", INTEGER8, "rw", POSITION),
        e(c.MODE_SHOWN, "Modes of operation display", INTEGER8, "ro", POSITION),
        e(0x6062, "Position demand value", INTEGER32, "ro"), e(c.POSITION, "Position actual value", INTEGER32, "ro"),
        e(c.FOLLOWING, "Following error window", UNSIGNED32, "ro", c.OFF),
        e(0x6066, "Following error time out", UNSIGNED16, "ro"), e(0x6067, "Position window", UNSIGNED32, "ro", c.OFF),
        e(0x6068, "Position window time", UNSIGNED16, "ro"), e(0x606C, "Velocity actual value", INTEGER32, "ro"),
        e(c.TORQUE_SHOWN, "Torque actual value", INTEGER16, "ro"), e(c.PLACE, "Target position", INTEGER32),
        e(0x607F, "Max profile velocity", UNSIGNED32, "ro", speed),
        e(0x6081, "Profile velocity", UNSIGNED32, "rw", speed),
        e(0x6083, "Profile acceleration", UNSIGNED32, "ro", ramp),
        e(0x6084, "Profile deceleration", UNSIGNED32, "ro", ramp),
        e(0x6085, "Quick stop deceleration", UNSIGNED32, "ro", ramp),
        e(0x6098, "Homing method", INTEGER8, "ro", -1), e(0x60F4, "Following error actual value", INTEGER32, "ro"),
        e(c.TORQUE, "Target torque", INTEGER16), e(c.VELOCITY, "Target velocity", INTEGER32),
        e(c.MODES, "Supported drive modes", UNSIGNED32, "ro", SUPPORTED | supported(axis)),
    )
    # fmt: on


def records_of(axis: AxisService, node: int) -> dict[tuple[int, str], tuple[c.Entry, ...]]:
    """Objects with parts: errors, heartbeat, identity, process data, limits."""
    e = c.Entry
    low, high = axis.limits or (axis.from_counts(-(1 << 31)), axis.from_counts((1 << 31) - 1))

    def process_data(kind: str, number: int, *mapped: int) -> dict[tuple[int, str], tuple[c.Entry, ...]]:
        """Objects of one process data object: how it is sent, and what is in it."""
        receive = kind == "RPDO"
        base = 0x200 if receive else 0x180
        place = (0x1400 if receive else 0x1800) + number - 1
        identifier = base + (number - 1) * 0x100 + node
        return {
            (place, f"{kind} {number} communication parameter"): (
                e(1, f"{kind} {number} COB-ID", UNSIGNED32, "rw", identifier),
                e(2, f"{kind} {number} transmission type", UNSIGNED8, "rw", 255),
                *(() if receive else (e(5, f"{kind} {number} event timer", UNSIGNED16, "ro", EVENT),)),
            ),
            (place + 0x200, f"{kind} {number} mapping parameter"): tuple(
                e(k, f"{kind} {number} map {k}", UNSIGNED32, "rw", word)
                for k, word in enumerate([*mapped, 0, 0, 0][:4], 1)
            ),
        }  # fmt: skip

    control, status, (value, power) = c.CONTROL << 16 | 16, c.STATUS << 16 | 16, cycle(axis)
    return {
        (c.CONSUMER, "Consumer heartbeat time"): (e(1, "Master", UNSIGNED32),),
        (c.IDENTITY, "Identity object"): (
            e(1, "Vendor-ID", UNSIGNED32, "ro"), e(2, "Product code", UNSIGNED32, "ro", 0x402),
            e(3, "Revision number", UNSIGNED32, "ro", 1), e(4, "Serial number", UNSIGNED32, "ro"),
        ),
        (SAMPLE, "Sample"): (
            e(1, "Number of the period", UNSIGNED32, "ro"), e(2, "Position", INTEGER32, "ro"),
            e(3, "Trust of position", UNSIGNED8, "ro"), e(4, "Fault", UNSIGNED16, "ro"),
        ),
        (0x607D, "Software position limit"): (
            e(1, "Min position limit", INTEGER32, "rw", axis.to_counts(low)),
            e(2, "Max position limit", INTEGER32, "rw", axis.to_counts(high)),
        ),
        (c.CYCLE, "Interpolation time period"): (
            e(1, "Interpolation period", UNSIGNED8, "rw", value), e(2, "Power of ten", INTEGER8, "rw", power),
        ),
        **process_data("RPDO", 1, control, c.PLACE << 16 | 32),
        **process_data("RPDO", 2, c.MODE << 16 | 8, c.VELOCITY << 16 | 32),
        **process_data("TPDO", 1, status, c.POSITION << 16 | 32),
        **process_data("TPDO", 2, c.MODE_SHOWN << 16 | 8, 0x606C << 16 | 32),
    }  # fmt: skip


class Node:
    """One node."""

    def __init__(self, axis: AxisService, node: int) -> None:
        self.axis, self._loop = axis, asyncio.get_running_loop()
        dictionary = c.dictionary_of(node, objects_of(axis), records_of(axis, node))
        maps: Any = dictionary
        for parts in (maps[place] for place in (0x1600, 0x1601, 0x1A00, 0x1A01)):
            parts[0].default = sum(1 for k in range(1, 5) if parts[k].default)
        self.node: Any = canopen.LocalNode(node, dictionary)
        self.set_points, self.cyclic, self._anew = SetPoints(axis.counts), Cyclic(axis, self.publish), False
        self._guarding = Guarding(self.node)
        self._asked = 0  # control word that was written last
        self._words: asyncio.Queue[int | None] = asyncio.Queue()
        self._word, self._mode, self._error, self._told_fault = 0, POSITION, 0, 0
        self._limited = self._homing = self._homed = self._home_failed = False
        self._heard, self._limit, self._master, self._velocity = 0.0, 0.0, 0, 0
        self._motion: asyncio.Future[None] | None = None
        self.node.add_read_callback(self._read)
        self.node.add_write_callback(self._written)
        axis.subscribe(self.publish)

    # ---- the bus

    def join(self, network: Any) -> None:
        """Be a node of a network."""
        network[self.node.id] = self.node
        self._listen()
        network.subscribe(c.SYNC, self._sync)
        network.notifier.add_listener(self._guarding)
        network.subscribe(0, self._command)
        self._boot()

    def _boot(self) -> None:
        self._guarding.begin_anew()
        self.node.nmt.send_command(0)
        self.node.nmt.send_command(128)

    def _command(self, _id: int, data: bytearray, _moment: float) -> None:
        """The library does the commands of the network master but for what follows a reset: the node boots."""
        if len(data) == 2 and data[0] in RESETS and data[1] in (0, self.node.id):
            self._boot()

    def _listen(self) -> None:
        """Take the process data as they are mapped now."""
        for one in (*self.node.rpdo.values(), *self.node.tpdo.values()):
            one.read()
        for one in self.node.rpdo.values():
            one.callbacks.clear()
            one.add_callback(self._take)

    def _take(self, received: Any) -> None:
        """Process data: the control word last, for it acts on the others."""
        if self.node.nmt.state != "OPERATIONAL":
            return
        for variable in sorted(received, key=lambda one: one.index == c.CONTROL):
            try:
                self.node.set_data(variable.index, variable.subindex, bytes(variable.data))
            except canopen.SdoAbortedError:
                continue  # what an SDO would be told is not told to process data

    def _sync(self, *_: object) -> None:
        if (point := self.cyclic.sync()) is not None:
            self._loop.call_soon_threadsafe(self.axis.set_point, *point)
        self._loop.call_soon_threadsafe(partial(self.publish, synchronised=True))

    def publish(self, *, synchronised: bool = False) -> None:
        """Send process data, and a fault that has come or gone; without a SYNC for every sample that is shown."""
        self._tell_fault()
        if self.node.nmt.state != "OPERATIONAL":
            return
        for one in self.node.tpdo.values():
            if not one.enabled or (one.trans_type < 254) != synchronised:
                continue
            for variable in one:
                variable.data = self.node.get_data(variable.index, variable.subindex)
            one.transmit()

    def _tell_fault(self) -> None:
        code = self.error
        if code != self._told_fault:
            self._told_fault = code
            if code:
                self.node.emcy.send(code, self._register())
            else:
                self.node.emcy.reset(0)

    # ---- objects

    @property
    def error(self) -> int:
        """Error code (603F)."""
        fault = self.axis.fault
        return self._error or (ERRORS.get(fault, 0xFF00 | fault & 0xFF) if fault else 0)

    def _register(self) -> int:
        return GENERIC | (COMMUNICATION if self.error == NO_MASTER else 0) if self.error else 0

    @property
    def state(self) -> int:
        """State of the axis; that of the drive is a fault where its master was lost."""
        return FAULT if self._error else STATE_NAMES.index(self.axis.status["state"])

    def status(self) -> int:
        """The status word."""
        axis = self.axis
        word = c.WORDS[self.state] | VOLTAGE | (REMOTE if axis.may_command else 0)
        word |= LIMIT if self._limited or axis.at_end else 0
        if self._mode == POSITION:
            idle = self.set_points.active is None
            word |= (REACHED if idle and not axis.moving else 0) | (MODE_BIT if self.set_points.acknowledged else 0)
        elif self._mode == VELOCITY:
            still = abs(axis.velocity) < 0.01 * axis.speed
            wanted = self._velocity * axis.count
            word |= (MODE_BIT if still else 0) | (REACHED if abs(axis.velocity - wanted) < 0.02 * axis.speed else 0)
        elif self._mode in MODES:
            word |= MODE_BIT if self.cyclic.follows else 0
        else:
            word |= (MODE_BIT if self._homed else 0) | (MODE_ERROR if self._home_failed else 0)
            word |= REACHED if not self._homing else 0
        return word

    def _signed(self, index: int, part: int = 0) -> int:
        return int.from_bytes(self.node.get_data(index, part), "little", signed=True)

    def _read(self, *, index: int, subindex: int, **_: Any) -> int | None:
        """Objects that show how the axis is."""
        axis = self.axis
        if index == SAMPLE and subindex:
            trust = ("unknown", "restored", "referenced").index(axis.status["trust"])
            return (axis.sample.number & 0xFFFFFFFF, word(axis.counts), trust, axis.fault)[subindex - 1]
        shown = {
            c.STATUS: self.status, c.POSITION: lambda: word(axis.counts), c.ERROR_CODE: lambda: self.error,
            c.MODE_SHOWN: lambda: self._mode, 0x1001: self._register,
            0x6062: lambda: word(axis.to_counts(axis.commanded)),
            0x606C: lambda: word(round(axis.velocity / axis.count)),
            0x60F4: lambda: word(round(axis.in_user_units(axis.status["error"]) / axis.count)),
            c.TORQUE_SHOWN: lambda: round(min(max(axis.status["effort"] or 0.0, -30.0), 30.0) * 1000),
        }.get(index)  # fmt: skip
        return None if shown is None else shown()

    def _refuse(self, index: int, part: int, value: int) -> None:
        """What the drive does not do."""
        if index == c.MODE and (value < 0 or (value and not (SUPPORTED | supported(self.axis)) >> (value - 1) & 1)):
            raise canopen.SdoAbortedError(OTHER_VALUE)
        if index == 0x6081 and not 0 < value <= round(self.axis.speed / self.axis.count):
            raise canopen.SdoAbortedError(TOO_LARGE if value else OTHER_VALUE)
        if index == 0x607D and self.axis.limits:
            low, high = map(self.axis.to_counts, self.axis.limits)
            if not low <= value <= high:
                raise canopen.SdoAbortedError(TOO_LARGE if value > high else 0x06090032)
        if (index == c.ABORT and value not in (0, 1, 2, 3)) or (index == c.CYCLE and part == 1 and not value):
            raise canopen.SdoAbortedError(OTHER_VALUE)

    def _written(self, *, index: int, subindex: int, data: bytes, **_: Any) -> None:
        """Objects that act when they are written; called in the thread of the bus."""
        value = int.from_bytes(data, "little", signed=index in (c.MODE, 0x607D, c.ABORT, c.TORQUE, c.PLACE))
        self._refuse(index, subindex, value)
        if index == c.MODE:
            self._loop.call_soon_threadsafe(self._choose, value)
        elif index == c.CONSUMER and subindex:
            self._limit, self._master, self._heard = (value & 0xFFFF) * 1e-3, value >> 16 & 0x7F, time.monotonic()
            self.node.network.subscribe(HEARTBEAT + self._master, self._beat)
        elif index & ~0x3FF in (0x1400, 0x1800) or index & ~0x1FF in (0x1600, 0x1A00):
            self._loop.call_soon_threadsafe(self._loop.call_later, LOOK, self._listen)  # once it is kept
        elif index in (c.PLACE, c.TORQUE):
            self.cyclic.write(index, value)
        elif index == c.VELOCITY:
            self._velocity = int.from_bytes(data, "little", signed=True)  # what is stored is not yet that
            self.cyclic.write(index, self._velocity)
            if not self.cyclic.follows:
                self._loop.call_soon_threadsafe(self._words.put_nowait, None)
        elif index == c.CONTROL:
            same, self._asked = value == self._asked, value
            if same and self.cyclic.follows:  # it comes with every target
                return
            if self._mode == HOMING and value & NEW and not self._word & NEW:
                self._homed = False  # at once: a master that looks now must not see the reference of before
            self._loop.call_soon_threadsafe(self._words.put_nowait, value)

    def _beat(self, *_: Any) -> None:
        self._heard = time.monotonic()

    def _choose(self, mode: int) -> None:
        if mode and mode != self._mode:
            if self._mode in MODES:  # a way counts from where that has led
                self.set_points.drop(self.axis.counts)
            self._mode, self._anew = mode, True
            if mode in MODES or self.cyclic.follows:
                self._words.put_nowait(None)
            self.publish()

    # ---- what the master wants

    async def obey(self) -> None:
        """Control words, one by one."""
        while True:
            new = await self._words.get()
            word_ = self._word if new is None else new  # None: as before, at another velocity or in another mode
            before, self._word = self._word, word_
            try:
                if new is not None:
                    await self._lead(word_, before)
                if self.state == ENABLED:
                    await self._move(word_, before)
                elif self.set_points.active is not None:
                    self.set_points.drop(self.axis.counts)
            except DetentError:
                pass  # the status word shows that nothing has changed
            self.publish()

    async def _lead(self, word_: int, before: int) -> None:
        """The states."""
        if word_ & RESET:
            if not before & RESET and self.state == FAULT:
                if self.axis.fault:
                    await self.axis.do("reset")
                self._error = 0
            return
        for order in () if self._error else c.orders_of(word_, self.state):
            if ordered(self.state, order) != self.state:
                await self._order(order)
                if self.state == ENABLED:
                    self.set_points.drop(self.axis.counts)
                    self._anew = True
                    await self.axis.enable()  # confirms the first motion, of a simulated axis

    async def _order(self, order: int) -> None:
        """One of the orders of a control word; a quick stop is taken from everybody."""
        if order == HALT_QUICKLY and not self.axis.may_command:
            await self.axis.stop()
        else:
            await self.axis.do("order", order)

    async def _move(self, word_: int, before: int) -> None:
        """What the mode makes of the bits."""
        anew, self._anew = self._anew or bool(before & HALT), False
        if self.cyclic.follows and (anew or self.cyclic.mode != self._mode):
            await self.axis.stop()
            self.set_points.drop(self.axis.counts)
        if word_ & HALT and not before & HALT:
            self.set_points.drop(self.axis.counts)
            await self.axis.stop()
        elif word_ & HALT:
            return
        elif self._mode in MODES:
            if anew and not self.cyclic.follows:
                await self._follow()
        elif self._mode == POSITION:
            target = self.set_points.control(word_, self._signed(c.PLACE))
            if target is not None:
                self._begin(self._reach(target))
        elif self._mode == HOMING and word_ & NEW and not before & NEW:
            self._homing, self._homed, self._home_failed = True, False, False
            self._begin(self._home())
        elif self._mode == HOMING and before & NEW and not word_ & NEW and self._homing:
            await self.axis.stop()
        elif self._mode == VELOCITY:
            await self._run()

    def _begin(self, motion: Any) -> None:
        if self._motion is not None:
            self._motion.cancel()
        self._motion = asyncio.ensure_future(motion)

    async def _reach(self, target: int) -> None:
        """A set-point, and those that wait behind it."""
        goal: int | None = target
        while goal is not None:
            low, high = self._signed(0x607D, 1), self._signed(0x607D, 2)
            speed = int.from_bytes(self.node.get_data(0x6081, 0), "little") * self.axis.count
            self._limited = bool(self.axis.limits) and not low <= goal <= high
            try:
                if not self._limited:
                    await self.axis.move_to(self.axis.from_counts(goal), speed)
            except NotDoneError as error:
                self._limited = error.code == 31
                if error.how == "aborted":
                    self.set_points.drop(self.axis.counts)
            goal = self.set_points.reached()
            self.publish()

    async def _follow(self) -> None:
        """A cyclic mode begins: the axis follows what is sent."""
        self.axis.let_go()
        value = int.from_bytes(self.node.get_data(c.CYCLE, 1), "little")
        self._begin(await self.cyclic.begin(self._mode, value * 10.0 ** self._signed(c.CYCLE, 2)))

    async def _home(self) -> None:
        try:
            await self.axis.do("home")
            self._homed = True
        except NotDoneError:
            self._home_failed = True
        self._homing = False
        self.publish()

    async def _run(self) -> None:
        """Profile velocity: a jog that is kept for as long as the drive is enabled."""
        velocity = self._velocity * self.axis.count
        velocity = min(max(velocity, -self.axis.speed), self.axis.speed)
        if velocity:
            ending = await self.axis.jog(velocity)
            self.axis.keep()
            self._begin(self._hold(velocity, ending))
        elif self.axis.moving:
            await self.axis.stop()

    async def _hold(self, velocity: float, ending: "asyncio.Future[dict[str, Any]]") -> None:
        """Go on where a busy processor has let the lease run out: the master still asks for it. A stop is a stop."""
        while True:
            try:
                await self.axis.ended("jog", ending)
            except NotDoneError as error:
                if error.code != LEASE_LOST or self.state != ENABLED or self._mode != VELOCITY:
                    return
                ending = await self.axis.jog(velocity)
                self.axis.keep()
            else:
                return

    async def watch(self) -> None:
        """Look after the master: gone for too long, it is as 6007 says."""
        while True:
            await asyncio.sleep(LOOK)
            silent = 0.0 < self._limit < time.monotonic() - self._heard
            if not (silent or self._guarding.is_lost()) or self._error:
                continue
            option, self._limit = self._signed(c.ABORT), 0.0  # until it asks to be watched again
            self.axis.let_go()  # a velocity ends with its lease, whatever the option
            if self._motion is not None and self._mode == VELOCITY:
                self._motion.cancel()
            self.set_points.drop(self.axis.counts)
            if option == 1:
                self._error = NO_MASTER
                await self.axis.stop()
                await self.axis.do("disable")
            elif option == 2:
                await self.axis.do("disable")
            elif option == 3 and self.state not in (QUICK_STOP, FAULT):
                await self._order(HALT_QUICKLY)
            self.publish()


def word(value: int) -> int:
    """A count, as the word of 32 bits that it is."""
    return (value + (1 << 31)) % (1 << 32) - (1 << 31)


async def serve(desk: Desk, address: str) -> list[str]:
    """Serve; gives what a client needs."""
    bus, number, _ = read_address(address if "@" in address else f"{address}@1")
    if bus["interface"] not in ("socketcan", "slcan", "pcan", "kvaser", "ixxat", "serial", "gs_usb"):
        del bus["bitrate"]
    axes = await desk.open()
    network: Any = canopen.Network()
    try:
        network.connect(**bus)
    except (can.CanError, OSError) as error:
        raise DetentError(
            f"{bus['interface']} {bus['channel']}: no such bus ({error}); name one of python-can"
        ) from error
    desk.server = network
    told: list[str] = []
    for one, axis in enumerate(axes, number):
        node = Node(axis, one)
        node.join(network)
        sheet = desk.channels[axis.motor].with_suffix(".eds")
        canopen.export_od(node.node.object_dictionary, str(sheet))
        for work in (node.obey(), node.watch()):
            desk.keep(asyncio.ensure_future(work))
        wanted = ", ".join(f"0x{base + one:X}" for base in (0x80, 0x180, 0x280, 0x580, 0x700))
        place = f"{bus['interface']} {bus['channel']}, node {one}" + (f" = {axis.motor}" if axis.motor else "")
        told += [place, f"can_filters {wanted}", f"EDS {sheet}"]
    return told
