"""The wires of an axis that a driver holds: what it has heard of a drive goes in, what the controller says goes out.

The loop and the driver share two records of bytes, each in two halves: the writer fills the half that was not read
last, with a sum over it, and then counts it up. Neither waits for the other. What is no whole record is left alone, and
the loop goes by what it knows; a drive that it has heard nothing of for too long is a fault.
"""

import ctypes
import zlib
from typing import Any

from detent.control.operation import Operation, fail, lose_torque
from detent.errors import DRIVE_LOST
from detent.kernel.compiled import byte_at, put_byte
from detent.kernel.registers import CONTROLLER, PLANT, Leaf, Registers, i2_array, i8, register, u1, u1_array, u2
from detent.kernel.step import step
from detent.record.recorder import byte_places

MOST = 256  # bytes of lines in one direction


class Wires(Registers):
    """Both records; `written` and all that comes with it are the driver's, the rest is the loop's."""

    driven: u1 = register("1: a driver is at the other end of the lines; 0: the plant of the file")
    silence: i8 = register("time without a word of the drive until that is a fault", unit="ns")
    ins: i8 = register("bytes of lines that the drive writes", unit="count")
    outs: i8 = register("bytes of lines that the controller writes", unit="count")
    in_at: i2_array = register("their places in the lines", unit="code", length=MOST)
    out_at: i2_array = register("their places in the lines", unit="code", length=MOST)
    written: i8 = register("records by the driver", unit="count")
    check: i8 = register("sum over the last one", unit="code")
    barred: u2 = register("why the drive may not be enabled, 0 it may", unit="code")
    fault: u2 = register("fault of the drive, 0 none", unit="code")
    input: u1_array = register("lines that the drive writes, two records", unit="code", length=2 * MOST)
    taken: i8 = register("records of the driver that the loop has taken", unit="count")
    torn: i8 = register("records of the driver whose sum was wrong", unit="count")
    heard: i8 = register("when the last one was taken", unit="ns")
    lost: i8 = register("times that the drive was silent for too long", unit="count")
    told: u2 = register("fault of the drive that the loop has acted on", unit="code")
    state: u1 = register("state of the axis, as it was when the controller last said something", unit="code")
    given: i8 = register("records by the loop", unit="count")
    sum: i8 = register("sum over the last one", unit="code")
    output: u1_array = register("lines that the controller writes, two records", unit="code", length=2 * MOST)


@step
def sum_up(number: int, rest: int, half: Any, first: int, count: int) -> int:
    """Sum over a record, in which each place has a factor of its own."""
    total = number * 3 + rest * 5
    for k in range(count):
        total += (2 * k + 7) * half[first + k]
    return total


@step
def take_lines(w: Wires, o: Operation, lines: Any, now: int) -> None:
    """What the drive has written since; a drive that was silent for too long, or tells a fault, has lost its torque."""
    number, first = w.written, (w.written & 1) * MOST
    if number != w.taken:
        if sum_up(number, w.barred + (w.fault << 16), w.input, first, w.ins) == w.check:
            for k in range(w.ins):
                put_byte(lines, w.in_at[k], w.input[first + k])
            w.taken, w.heard = number, now
        else:
            w.torn += 1
    if w.heard == 0:
        w.heard = now
    before = o.barred
    o.barred = w.barred if w.taken else DRIVE_LOST
    if w.fault:
        o.barred = w.fault
        if w.fault != w.told:
            fail(o, w.fault)
    w.told = w.fault
    if now - w.heard > w.silence:
        w.lost += 1 if before != DRIVE_LOST else 0
        o.barred = DRIVE_LOST
        lose_torque(o, DRIVE_LOST)


@step
def give_lines(w: Wires, o: Operation, lines: Any) -> None:
    """What the controller says now."""
    w.state = o.state
    number = w.given + 1
    first = (number & 1) * MOST
    for k in range(w.outs):
        w.output[first + k] = byte_at(lines, w.out_at[k])
    w.sum = sum_up(number, 0, w.output, first, w.outs)
    w.given = number


def struct_code(leaf: Leaf) -> str:
    """A register as `struct` packs it.

    >>> [struct_code(leaf) for leaf in Wires.leaves()][:3]
    ['B', 'q', 'q']
    """
    code = {"i1": "b", "i2": "h", "i4": "i", "i8": "q", "f4": "f", "f8": "d"}.get(leaf.width.code)
    return code or {"u1": "B", "u2": "H", "u4": "I"}[leaf.width.code]


def wire_hash(lines: type[Registers]) -> int:
    """Of names, widths and writers of lines that go over a wire: both ends must have the same."""
    return zlib.crc32("\n".join(f"{leaf.path} {leaf.width.code} {leaf.by}" for leaf in lines.leaves()).encode())


_sum: Any = getattr(sum_up, "py_func", sum_up)  # a driver compiles nothing


class Ends:
    """The driver's end of the wires."""

    def __init__(self, wires: Any, lines: type[Registers], silence: float) -> None:
        self._wires: Any = wires
        self.lines: Any = lines()
        places = {by: byte_places([leaf for leaf in lines.leaves() if leaf.by == by]) for by in (PLANT, CONTROLLER)}
        if max(map(len, places.values())) > MOST:
            raise ValueError(f"{lines.__name__}: {max(map(len, places.values()))} bytes in one direction, most {MOST}")
        self._in: list[int] = places[PLANT].tolist()
        self._out: list[int] = places[CONTROLLER].tolist()
        for k, place in enumerate(self._in):
            wires.in_at[k] = place
        for k, place in enumerate(self._out):
            wires.out_at[k] = place
        wires.ins, wires.outs = len(self._in), len(self._out)
        wires.silence, wires.driven = round(silence * 1e9), 1

    def hear(self) -> bool:
        """Take over what the controller says; False where it has said nothing yet, or is at it."""
        w = self._wires
        number = int(w.given)
        first = (number & 1) * MOST
        said = bytes(w.output[first : first + len(self._out)])
        if number == 0 or _sum(number, 0, said, 0, len(said)) != w.sum:
            return False
        for place, value in zip(self._out, said, strict=True):
            put_byte(self.lines, place, value)
        return True

    def say(self, barred: int, fault: int) -> None:
        """Hand over the lines as the drive has written them, why it may not be enabled, and its fault."""
        w, number = self._wires, int(self._wires.written) + 1
        first, raw = (number & 1) * MOST, bytes(self.lines)
        said = bytes(raw[place] for place in self._in)
        ctypes.memmove(ctypes.addressof(w.input) + first, said, len(said))
        w.barred, w.fault = barred, fault
        w.check = _sum(number, barred + (fault << 16), said, 0, len(said))
        w.written = number
