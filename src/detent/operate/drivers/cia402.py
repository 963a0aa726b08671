"""CiA 402 on a bus: the objects of a drive that is driven cyclically, and its states as words.

The same list serves who drives one (`canopen_drive`) and who is one (`faces.cia402`).
"""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from canopen import ObjectDictionary
from canopen.objectdictionary import ODArray, ODRecord, ODVariable
from canopen.objectdictionary.datatypes import INTEGER8, INTEGER16, INTEGER32, UNSIGNED8, UNSIGNED16, UNSIGNED32

from detent.control.axis_states import (
    DISABLE_OPERATION,
    DISABLE_VOLTAGE,
    ENABLE_OPERATION,
    ENABLED,
    FAULT,
    FAULT_REACTION,
    HALT_QUICKLY,
    NOT_READY,
    QUICK_STOP,
    READY,
    SHUTDOWN,
    SWITCH_ON,
    SWITCH_ON_DISABLED,
    SWITCHED_ON,
)
from detent.errors import DRIVE_FAULT, MOTOR_LOAD, OVER_CURRENT, SENSOR_LOST

CONTROL, STATUS, ERROR_CODE = 0x6040, 0x6041, 0x603F
MODE, MODE_SHOWN, MODES = 0x6060, 0x6061, 0x6502
POSITION, RATED_TORQUE, TORQUE_SHOWN = 0x6064, 0x6076, 0x6077
TORQUE, VELOCITY, PLACE = 0x6071, 0x60FF, 0x607A  # targets
VELOCITY_UNIT, CYCLE = 0x60A9, 0x60C2
ABORT, QUICK_STOP_OPTION, FAULT_REACTION_OPTION, FOLLOWING = 0x6007, 0x605A, 0x605E, 0x6065
IDENTITY, CONSUMER, PRODUCER, RESOLUTION = 0x1018, 0x1016, 0x1017, 0x608F
RX, RX_MAP, TX, TX_MAP, TX_2, TX_2_MAP = 0x1400, 0x1600, 0x1800, 0x1A00, 0x1801, 0x1A01
MASTER = 127  # node number under which the master's heartbeat is sent
SYNC = 0x80
OFF = 0xFFFFFFFF  # following error window that watches nothing


class Cyclic(NamedTuple):
    """A cyclic synchronous mode: its number, the object that takes the demand, and that as `struct` packs it."""

    number: int
    target: int
    code: str

    @property
    def bit(self) -> int:
        """Of the supported modes (6502)."""
        return 1 << (self.number - 1)


CYCLIC = {"torque": Cyclic(10, TORQUE, "h"), "velocity": Cyclic(9, VELOCITY, "i"), "position": Cyclic(8, PLACE, "i")}


class Entry(NamedTuple):
    """An object, or a part of one."""

    place: int
    name: str
    kind: int
    access: str = "rw"
    default: int = 0


# fmt: off
OBJECTS = (
    Entry(0x1000, "Device type", UNSIGNED32, "ro", 0x00020192),
    Entry(0x1001, "Error register", UNSIGNED8, "ro"),
    Entry(PRODUCER, "Producer heartbeat time", UNSIGNED16),
    Entry(ABORT, "Abort connection option code", INTEGER16, "rw", 1),
    Entry(ERROR_CODE, "Error code", UNSIGNED16, "ro"),
    Entry(CONTROL, "Controlword", UNSIGNED16),
    Entry(STATUS, "Statusword", UNSIGNED16, "ro"),
    Entry(QUICK_STOP_OPTION, "Quick stop option code", INTEGER16, "ro", 0),
    Entry(FAULT_REACTION_OPTION, "Fault reaction option code", INTEGER16, "ro", 0),
    Entry(MODE, "Modes of operation", INTEGER8),
    Entry(MODE_SHOWN, "Modes of operation display", INTEGER8, "ro"),
    Entry(POSITION, "Position actual value", INTEGER32, "ro"),
    Entry(FOLLOWING, "Following error window", UNSIGNED32, "rw", OFF),
    Entry(TORQUE, "Target torque", INTEGER16),
    Entry(PLACE, "Target position", INTEGER32),
    Entry(VELOCITY, "Target velocity", INTEGER32),
    Entry(VELOCITY_UNIT, "SI unit velocity", UNSIGNED32, "ro", 0x00B50300),
    Entry(RATED_TORQUE, "Motor rated torque", UNSIGNED32, "rw", 1000),
    Entry(TORQUE_SHOWN, "Torque actual value", INTEGER16, "ro"),
    Entry(MODES, "Supported drive modes", UNSIGNED32, "ro", CYCLIC["torque"].bit),
)
RECORDS: dict[tuple[int, str], tuple[Entry, ...]] = {
    (IDENTITY, "Identity object"): (
        Entry(1, "Vendor-ID", UNSIGNED32, "ro"), Entry(2, "Product code", UNSIGNED32, "ro"),
        Entry(3, "Revision number", UNSIGNED32, "ro"), Entry(4, "Serial number", UNSIGNED32, "ro"),
    ),
    (CONSUMER, "Consumer heartbeat time"): (Entry(1, "Master", UNSIGNED32),),
    (RESOLUTION, "Position encoder resolution"): (
        Entry(1, "Encoder increments", UNSIGNED32, "ro", 1), Entry(2, "Motor revolutions", UNSIGNED32, "ro", 1),
    ),
    (CYCLE, "Interpolation time period"): (
        Entry(1, "Value", UNSIGNED8, "rw", 1), Entry(2, "Power of ten", INTEGER8, "rw", -3),
    ),
    (RX, "RPDO communication parameter"): (
        Entry(1, "RPDO COB-ID", UNSIGNED32), Entry(2, "RPDO transmission type", UNSIGNED8, "rw", 1),
    ),
    (TX, "TPDO communication parameter"): (
        Entry(1, "TPDO COB-ID", UNSIGNED32), Entry(2, "TPDO transmission type", UNSIGNED8, "rw", 1),
    ),
    (TX_2, "TPDO communication parameter 2"): (
        Entry(1, "TPDO 2 COB-ID", UNSIGNED32), Entry(2, "TPDO 2 transmission type", UNSIGNED8, "rw", 1),
    ),
    (TX_2_MAP, "TPDO mapping parameter 2"): (Entry(1, "TPDO 2 map 1", UNSIGNED32, "rw", TORQUE_SHOWN << 16 | 16),),
    (RX_MAP, "RPDO mapping parameter"): (
        Entry(1, "RPDO map 1", UNSIGNED32, "rw", CONTROL << 16 | 16),
        Entry(2, "RPDO map 2", UNSIGNED32, "rw", TORQUE << 16 | 16),
    ),
    (TX_MAP, "TPDO mapping parameter"): (
        Entry(1, "TPDO map 1", UNSIGNED32, "rw", STATUS << 16 | 16),
        Entry(2, "TPDO map 2", UNSIGNED32, "rw", POSITION << 16 | 32),
        Entry(3, "TPDO map 3", UNSIGNED32, "rw", ERROR_CODE << 16 | 16),
    ),
}
# fmt: on


def _variable(entry: Entry, index: int, part: int = 0) -> ODVariable:
    made: Any = ODVariable(entry.name, index, part)
    made.data_type, made.access_type, made.default = entry.kind, entry.access, entry.default
    if entry.default < 0:  # canopen would write 0x-1 into the data sheet, which no reader takes, its own neither
        made.default_raw = str(entry.default)
    return made


def dictionary(node: int) -> ObjectDictionary:
    """The objects of a drive with this number."""
    made = dictionary_of(node, OBJECTS, RECORDS)
    words: Any = made
    words[RX][1].default, words[TX][1].default, words[TX_2][1].default = 0x200 + node, 0x180 + node, 0x280 + node
    return made


def dictionary_of(
    node: int, objects: Iterable[Entry], records: Mapping[tuple[int, str], tuple[Entry, ...]]
) -> ObjectDictionary:
    """A dictionary of these objects, and of objects that have parts."""
    made = ObjectDictionary()
    made.node_id = node
    for entry in objects:
        made.add_object(_variable(entry, entry.place))
    for (index, name), parts in records.items():
        is_map = index & ~0xFF in (0x1600, 0x1A00)
        record: Any = (ODArray if index == CONSUMER or is_map else ODRecord)(name, index)
        access = "rw" if is_map else "ro"
        record.add_member(_variable(Entry(0, "Number of entries", UNSIGNED8, access, parts[-1].place), index))
        for entry in parts:
            record.add_member(_variable(entry, index, entry.place))
        made.add_object(record)
    return made


# ---- states as words; the bits of the voltage (4) and the remote (9) are left out of what a state is

WORDS = {
    NOT_READY: 0x00, SWITCH_ON_DISABLED: 0x40, READY: 0x21, SWITCHED_ON: 0x23, ENABLED: 0x27, QUICK_STOP: 0x07,
    FAULT_REACTION: 0x0F, FAULT: 0x08,
}  # fmt: skip
_MASKS = {state: 0x6F if word & 0x20 or state == QUICK_STOP else 0x4F for state, word in WORDS.items()}


def state_of(word: int) -> int:
    """The state that a statusword tells.

    >>> state_of(0x0637), state_of(0x1208)
    (4, 7)
    """
    return next((state for state, mask in _MASKS.items() if word & mask == WORDS[state]), NOT_READY)


# Error codes (603F) by the ranges of IEC 61800-7-201, annex: the narrower before the wider.
_FAULTS = (
    (0x2350, 0x2351, MOTOR_LOAD), (0x2000, 0x23FF, OVER_CURRENT), (0x7300, 0x73FF, SENSOR_LOST),
)  # fmt: skip


def fault_of(error: int) -> int:
    """The number that the table of faults has for an error code of a drive; what it has none for is the drive's own.

    >>> fault_of(0x2320), fault_of(0x2350), fault_of(0x7305), fault_of(0x8130)
    (20, 21, 1, 24)
    """
    return next((fault for first, last, fault in _FAULTS if first <= error <= last), DRIVE_FAULT)


def orders_of(word: int, state: int) -> tuple[int, ...]:
    """The orders of a controlword in a state, without the fault reset, which is an edge."""
    if not word & 0x02:
        return (DISABLE_VOLTAGE,)
    if not word & 0x04:
        return (HALT_QUICKLY,)
    if not word & 0x01:
        return (SHUTDOWN,)
    if word & 0x08:
        return (SWITCH_ON, ENABLE_OPERATION) if state == READY else (ENABLE_OPERATION,)
    return (DISABLE_OPERATION,) if state == ENABLED else (SWITCH_ON,)


_LENGTHS, _TIMES = {0xB4: True, 0xB5: False}, {0x03: 1.0, 0x47: 60.0}  # revolutions, increments; second, minute


def velocity_unit(word: int, turn: float) -> float:
    """Counts per second that are 1 of a velocity, of a motor with so many counts in a turn; 0 where that is not known.

    The word (60A9) has a power of ten, what is counted, and in what time; the numbers are those of CiA 303-2.

    >>> velocity_unit(0x00B50300, 4000), velocity_unit(0xFDB44700, 6000)
    (1.0, 0.1)
    """
    what, time = word >> 16 & 0xFF, word >> 8 & 0xFF
    if what not in _LENGTHS or time not in _TIMES:
        return 0.0
    power = ((word >> 24) + 128) % 256 - 128
    counts = (turn if _LENGTHS[what] else 1.0) / _TIMES[time]
    return counts * 10.0**power if power >= 0 else counts / 10.0**-power


def cycle_of(time: float) -> tuple[int, int]:
    """A time [s] as 60C2 has it, value and power of ten; a value of 0 where it does not go into that.

    >>> cycle_of(0.25e-3), cycle_of(1e-3), cycle_of(1.0 / 3.0)
    ((25, -5), (1, -3), (0, 0))
    """
    for power in range(0, -8, -1):
        value = round(time * 10.0**-power)
        if 1 <= value <= 255 and abs(value - time * 10.0**-power) < 1e-6 * value:
            return value, power
    return 0, 0


def identity_text(parts: list[int]) -> str:
    """Vendor, product, revision and serial number as the axis file has them.

    >>> identity_text([42, 1, 3, 7])
    'canopen 0x2a.0x1.0x3.0x7'
    """
    return "canopen " + ".".join(map(hex, parts))
