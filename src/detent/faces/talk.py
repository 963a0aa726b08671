"""Line protocols: lines that come by TCP or a terminal, and the conversation that answers them.

A dialect is a class with `answer`, for a line; lines of one client are answered in their order, but one that stops the
axis overtakes those that wait. A client on TCP is a client of the axis of its own, so that what it has under way ends
with its connection.
"""

import asyncio
import os
import tty
from collections.abc import Callable
from contextlib import suppress

from detent.errors import DetentError
from detent.faces.service import AxisService, Desk, address_of

LONGEST = 4096  # characters of a line
MOST_LINES = 1024  # of one client that wait for their turn
MOST_CLIENTS = 8

Send = Callable[[bytes], object]


class Talk:
    """A conversation with one client."""

    end = b"\n"  # of what is answered
    waits = True  # a line waits until the one before it was answered

    def __init__(self, axes: tuple[AxisService, ...], send: Send) -> None:
        self.axes, self.axis, self._send = axes, axes[0], send

    def send(self, text: str) -> None:
        """Say something."""
        self._send(text.encode("latin-1", "replace") + self.end)

    def greet(self) -> None:
        """Somebody has come."""

    def leave(self) -> None:
        """It has gone."""

    def urgent(self, byte: int) -> bool:
        """Take a character that stands for itself, wherever it comes; False where it belongs to a line."""
        del byte
        return False

    def stops(self, line: str) -> bool:
        """Whether a line overtakes those that wait."""
        del line
        return False

    async def answer(self, line: str) -> None:
        """Answer a line."""
        raise NotImplementedError


class Reader:
    """Makes lines of what comes, and answers them one by one."""

    def __init__(self, talk: Talk) -> None:
        self._talk, self._held, self._too_long = talk, bytearray(), False
        self._lines: asyncio.Queue[str] = asyncio.Queue(MOST_LINES)
        self._now: set[asyncio.Future[None]] = set()
        self._working = asyncio.ensure_future(self._work())
        talk.greet()

    def take(self, data: bytes) -> None:
        """Take what has come."""
        for byte in data:
            if self._talk.urgent(byte):
                continue
            if byte in b"\r\n":
                self._end_line()
            elif len(self._held) < LONGEST:
                self._held.append(byte)
            else:
                self._too_long = True

    def _end_line(self) -> None:
        line = self._held.decode("ascii", "replace").strip()
        self._held.clear()
        if self._too_long:
            line, self._too_long = "\x00", False  # no command of any dialect
        if not line:
            return
        if self._talk.stops(line):
            task = asyncio.ensure_future(self._talk.answer(line))
            self._now.add(task)
            task.add_done_callback(self._now.discard)
            return
        with suppress(asyncio.QueueFull):  # who asks so much without reading is answered to the first ones
            self._lines.put_nowait(line)

    async def _work(self) -> None:
        while True:
            await self._talk.answer(await self._lines.get())

    def close(self) -> None:
        """Nothing more comes."""
        self._working.cancel()
        for task in self._now:
            task.cancel()
        self._talk.leave()


Dialect = Callable[[tuple[AxisService, ...], Send], Talk]


async def serve_lines(desk: Desk, address: str, dialect: Dialect, port: int) -> list[str]:
    """Listen on TCP, or where the address is "pty", on a terminal; gives how a client finds it."""
    if address == "pty":
        return [await _open_terminal(desk, dialect)]
    host, number = address_of(desk.face, address, port)
    clients = 0

    async def attend(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """A client on TCP, if there is room for one more."""
        nonlocal clients
        if clients >= MOST_CLIENTS:
            writer.close()
            return
        clients += 1
        peer = writer.get_extra_info("peername")
        try:
            await _talk(await desk.open(f"{peer[0]}:{peer[1]}"), dialect, reader, writer)
        except DetentError:  # the axis has gone, or has too many clients
            pass
        finally:
            clients -= 1
            writer.close()

    server = await asyncio.start_server(attend, host, number)
    return [f"{host}:{server.sockets[0].getsockname()[1]}"]


async def _talk(
    axes: tuple[AxisService, ...], dialect: Dialect, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
) -> None:
    """One client on TCP, until it leaves."""
    lines = Reader(dialect(axes, writer.write))
    try:
        with suppress(ConnectionError):
            while data := await reader.read(LONGEST):
                lines.take(data)
                await writer.drain()
    finally:
        lines.close()
        for axis in axes:
            axis.close()


async def _open_terminal(desk: Desk, dialect: Dialect) -> str:
    """A serial line that is none: a pair of terminals, of which a client opens the other end."""
    ours, theirs = os.openpty()  # their end stays open here: a client that closes it may come again
    tty.setraw(theirs)
    os.set_blocking(ours, False)
    lines = Reader(dialect(await desk.open("terminal"), lambda data: os.write(ours, data)))

    def read() -> None:
        with suppress(BlockingIOError, OSError):
            lines.take(os.read(ours, LONGEST))

    asyncio.get_running_loop().add_reader(ours, read)
    return os.ttyname(theirs)
