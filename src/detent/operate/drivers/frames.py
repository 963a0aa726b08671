"""Frames on a serial line: what was sent comes out whole or not at all, and what is missing is counted.

A frame is its kind (1 byte), its sequence number (2 bytes, the low one first), up to 250 bytes of payload, and the
CRC-16 of all that (polynomial 0x1021, from 0xFFFF, the low byte first); the whole by COBS, so that no byte of it is 0,
and then a 0. A receiver that has lost its place finds the next frame behind the next 0. The same in portable C, for a
controller at the other end, is `frames.h` beside this file.
"""

from binascii import crc_hqx
from dataclasses import dataclass, field
from typing import NamedTuple

LONGEST = 250  # bytes of a payload: the whole frame is one block of COBS
HEAD, TAIL = 3, 2
NUMBERS = 1 << 16  # of the sequence
FROM = 0xFFFF


class Frame(NamedTuple):
    """A frame without its wrapping."""

    kind: int
    number: int
    payload: bytes


def stuffed(data: bytes) -> bytes:
    r"""Bytes without a 0, for up to 254 of any.

    >>> stuffed(b"\x11\x00\x00\x22").hex(" ")
    '02 11 01 02 22'
    """
    return b"".join(bytes([len(part) + 1]) + part for part in data.split(b"\0"))


def unstuffed(data: bytes) -> bytes | None:
    """What was stuffed; None where no such bytes can come of it."""
    parts: list[bytes] = []
    at = 0
    while at < len(data):
        end = at + data[at]
        if data[at] == 0 or end > len(data):
            return None
        parts.append(data[at + 1 : end])
        at = end
    return b"\0".join(parts)


def encode(kind: int, number: int, payload: bytes) -> bytes:
    """A frame as it goes to the line."""
    if not (0 <= kind < 256 and len(payload) < LONGEST + 1):
        raise ValueError(f"kind {kind}, {len(payload)} bytes; must be 0 to 255, and {LONGEST} or fewer")
    data = bytes([kind]) + (number % NUMBERS).to_bytes(2, "little") + payload
    return stuffed(data + crc_hqx(data, FROM).to_bytes(2, "little")) + b"\0"


def decode(data: bytes) -> Frame | None:
    """The frame that stood between two zeros; None where it is not as it was sent."""
    read = unstuffed(data)
    if read is None or not HEAD + TAIL <= len(read) <= HEAD + LONGEST + TAIL:
        return None
    if crc_hqx(read[:-TAIL], FROM) != int.from_bytes(read[-TAIL:], "little"):
        return None
    return Frame(read[0], int.from_bytes(read[1:HEAD], "little"), read[HEAD:-TAIL])


@dataclass
class Receiver:
    """One end of a line: takes bytes as they come, gives frames, counts the rest."""

    good: int = 0  #: frames
    spoilt: int = 0  #: pieces between two zeros that were none
    missing: int = 0  #: frames that were sent between good ones and have not come
    stale: int = 0  #: frames that had come before, or come too late to have a place; not given out
    _rest: bytearray = field(default_factory=bytearray)
    _next: int = -1

    def feed(self, data: bytes) -> list[Frame]:
        """Take bytes; gives the frames that they complete."""
        found: list[Frame] = []
        *pieces, rest = (bytes(self._rest) + data).split(b"\0")
        self._rest = bytearray(rest[: HEAD + LONGEST + TAIL + 2])  # longer is no frame, whatever follows
        for piece in filter(None, pieces):
            frame = decode(piece)
            if frame is None:
                self.spoilt += 1
            elif self._place(frame.number):
                found.append(frame)
        return found

    def _place(self, number: int) -> bool:
        """Where a frame stands in the sequence; False where it is none of those that are still to come."""
        skipped = (number - self._next) % NUMBERS if self._next >= 0 else 0
        if skipped >= NUMBERS // 2:
            self.stale += 1
            return False
        self.good, self.missing = self.good + 1, self.missing + skipped
        self._next = (number + 1) % NUMBERS
        return True
