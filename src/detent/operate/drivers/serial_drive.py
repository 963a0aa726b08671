"""A board that runs the controller of the axis file as firmware, led over a serial line.

In each exchange it gets the mailbox of its controller, in a frame of `frames`, and tells once in a sample of its own
clock what its encoder shows. What is lost on the way it bridges; when nothing comes any more it brings the axis to rest
and lets go. The other end of this is the code that `detent export firmware` writes beside the controller.
"""

import hashlib
import struct
import time
from operator import attrgetter
from typing import Any
from urllib.parse import parse_qsl

import serial

from detent.errors import AxisError, DetentError
from detent.kernel.registers import CONTROLLER, PLANT
from detent.methods.method import Wiring
from detent.operate.drivers.driver import Fact, put
from detent.operate.drivers.frames import NUMBERS, Frame, Receiver, encode
from detent.operate.wires import struct_code, wire_hash

ASK, IDENTITY, MAILBOX, TELEMETRY = range(1, 5)  # kinds of frames
RESET = 1  # flag of a mailbox
HEAD = struct.Struct("<HHIII")  # of telemetry: mailbox taken, fault, and what its receiver has counted
SILENT = 0.03  # time without a word of the board that is a fault; three samples where these are longer [s]
PATIENCE = 3.0  # time that a board has to say who it is [s]
AGAIN = 0.05  # time after which it is asked again [s]
EXAMPLE = "serial:/dev/ttyACM0"


def read_address(address: str) -> tuple[str, int]:
    """The port, and its rate.

    >>> read_address("/dev/ttyUSB0?baud=921600")
    ('/dev/ttyUSB0', 921600)
    """
    port, _, more = address.partition("?")
    options = dict(parse_qsl(more, keep_blank_values=True))
    rate = options.pop("baud", "1000000")
    if not (port and rate.isdecimal() and int(rate)) or options:
        raise DetentError(
            f"--drive serial:{address}: got no such address; expected: PORT, and perhaps ?baud=921600; try: {EXAMPLE}"
        )
    return port, int(rate)


class SerialDrive:
    """One board; `wait` is how long an exchange waits for telemetry [s], 0: half of its period."""

    mode = "position"

    def __init__(self, address: str, wait: float = 0.0) -> None:
        self.address, self.hardware, self.silence = address, "", 0.0
        self.ready, self.fault = False, 0
        self._place = read_address(address)
        self._wait, self._sent, self._taken = wait, 0, 0
        self._receiver, self._there = Receiver(), (0, 0, 0)
        self._port: Any = None

    # ---- beginning

    def open(self, wiring: Wiring) -> list[Fact]:
        """Ask the board who it is, and see that its firmware is that of the axis file; nothing moves by that."""
        self._wiring = wiring
        self._wait = self._wait or 0.5 * wiring.sample
        self.silence = max(SILENT, 3.0 * wiring.sample)
        leaves = [*wiring.lines.leaves()]
        self._told = [(leaf.path, "<" + struct_code(leaf)) for leaf in leaves if leaf.by == CONTROLLER]
        heard = [leaf for leaf in leaves if leaf.by == PLANT]
        self._heard, self._telemetry = (
            [leaf.path for leaf in heard],
            struct.Struct("<" + "".join(map(struct_code, heard))),
        )
        port, rate = self._place
        try:
            self._port = serial.Serial(port, rate, timeout=0, write_timeout=1.0, exclusive=True)
            said = self._ask()
        except (OSError, ValueError) as error:  # those of pyserial are of these
            self._leave()
            raise AxisError(
                f"serial:{self.address}: got no answer of a board ({error}); expected: one that runs the firmware of "
                "the axis file; try: look at cable, port and rate, and export and flash it"
            ) from error
        try:
            return self._fit(said)
        except DetentError:
            self._leave()
            raise

    def _ask(self) -> bytes:
        """What the board says of itself."""
        end = time.monotonic() + PATIENCE
        asked = 0.0
        while (now := time.monotonic()) < end:
            if now - asked > AGAIN:
                asked = now
                self._send(ASK, b"")
            for frame in self._receive(AGAIN):
                if frame.kind == IDENTITY and len(frame.payload) >= 12:
                    return frame.payload
        raise OSError(f"{self._receiver.good} frames, none with a name, {self._receiver.spoilt} spoilt")

    def _fit(self, said: bytes) -> list[Fact]:
        """Refused where it runs another controller than that of the file."""
        w = self._wiring
        firmware, lines = struct.unpack_from("<QI", said)
        mine = int(hashlib.sha256(w.firmware).hexdigest()[:16], 16)  # as the export has it
        self.hardware = "serial " + said[12:].decode("ascii", "replace")
        if lines != wire_hash(w.lines) or firmware != mine:
            what = f"parameters {firmware:016X}" if firmware != mine else f"lines {lines:08X} to and fro"
            wanted = f"{mine:016X}" if firmware != mine else f"{wire_hash(w.lines):08X}"
            raise DetentError(
                f"serial:{self.address}: F66: got a firmware with the {what}; expected: {wanted}, as the axis file "
                "gives it; try: detent export firmware, and flash the board anew"
            )
        return [
            Fact("measures", f"the position of its motor, {w.turn:g} counts in a turn, {w.count:g} m or rad"),
            Fact("takes", f"a position with velocity and acceleration, every {w.sample * 1e3:g} ms"),
            Fact("firmware", f"{firmware:016X}, as the axis file gives it; it closes the loops and guards them"),
            Fact("line lost", f"after {self.silence * 1e3:g} ms the board comes to rest by itself, then lets go"),
        ]

    def counted(self) -> list[Fact]:
        """How the line has been since."""
        mine, there = self._receiver, self._there
        return [
            Fact("from the board", f"{mine.good} frames, {mine.missing} missing, {mine.spoilt} spoilt"),
            Fact("to the board", f"{there[0]} frames, {there[2]} missing, {there[1]} spoilt"),
        ]

    # ---- exchange

    def _send(self, kind: int, payload: bytes) -> None:
        self._port.write(encode(kind, self._sent, payload))
        self._sent = (self._sent + 1) % NUMBERS

    def _receive(self, wait: float) -> list[Frame]:
        """What has come; waits for the end of a frame."""
        end, found = time.monotonic() + wait, list[Frame]()
        while not found:
            left = end - time.monotonic()
            self._port.timeout = max(left, 0.0)
            found = self._receiver.feed(self._port.read(max(self._port.in_waiting, 1)))
            if left <= 0.0:
                break
        return found

    def write(self, lines: Any, *, reset: bool) -> None:
        """The mailbox of the next sample."""
        words = (struct.pack(code, attrgetter(path)(lines)) for path, code in self._told)
        try:
            self._send(MAILBOX, bytes([RESET if reset else 0]) + b"".join(words))
        except OSError:
            self.ready = False  # nothing will be heard either, and that is a fault

    def read(self, lines: Any) -> bool:
        """The last telemetry that has come."""
        try:
            told = [frame for frame in self._receive(self._wait) if frame.kind == TELEMETRY]
        except OSError:
            return False
        told = [frame.payload for frame in told if len(frame.payload) == HEAD.size + self._telemetry.size]
        if not told:
            return False
        self._taken, self.fault, *there = HEAD.unpack_from(told[-1])
        self._there = (there[0], there[1], there[2])
        for path, value in zip(self._heard, self._telemetry.unpack_from(told[-1], HEAD.size), strict=True):
            put(lines, path, value)
        self.ready = self.fault == 0
        return True

    def _leave(self) -> None:
        if self._port is not None:
            self._port.close()

    def close(self) -> None:
        """No torque: told more than once, for one may be lost."""
        lines = self._wiring.lines()
        for _ in range(3):
            self.write(lines, reset=False)
        self._leave()
