"""A browser's socket: its words go to the axis, as far as its role lets them, and what the axis tells comes back.

Each socket is a client of the channel of its own: when it closes, or this process dies, the axis stops what it had
under way. Rows of the scope go as binary frames: number of the first row (i8), rows and channels (u4), then column by
column 4-byte floats, little-endian.
"""

import asyncio
import base64
import json
import struct
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, cast

from starlette.websockets import WebSocket, WebSocketDisconnect

from detent.errors import DetentError
from detent.operate.line import LONGEST, Line
from detent.panel.gate import person
from detent.panel.keys import TICKET, Keys, Pass

MOST_SOCKETS = 16
LONGEST_FRAME = 1 << 16  # bytes, as in the channel
MOST_WAITING = 1 << 16  # bytes that a page has asked, and the axis has not read
FIRST_WORD = 2.0  # until the ticket must be there [s]
A_SECOND = 50.0  # messages of a client
FLOOD = 500.0  # refused ones in a second, until it is put out
RATE = 25  # of status [Hz]

FREE = {"stop", "disable"}  # from everybody, and never counted
ENGINEERS = {"trust", "order", "inject"}
FILES = {"export", "import"}  # on the machine of the axis: a page has no business there
TAKEN = ("do", "value", "speed", "as")  # of a command


class Budget:
    """So many in a time, and no more; they come back as it passes."""

    def __init__(self, most: float, seconds: float = 1.0, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._at, self._most, self._rate, self._left = clock, clock(), most, most / seconds, most

    def take(self) -> bool:
        """Spend one, if there is one."""
        now = self._clock()
        self._left = min(self._most, self._left + self._rate * (now - self._at))
        self._at = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


class Sockets:
    """All sockets of the panel."""

    def __init__(self, channel: Path, keys: Keys) -> None:
        self._channel, self._keys = channel, keys
        self._open = 0
        self.line: Line | None = None  # of the panel itself
        self.looks = {"watch"}  # what changes nothing; the axis names the rest

    async def attend(self, socket: WebSocket) -> None:
        """One socket, until it closes."""
        await socket.accept()
        who = await self._first_word(socket)
        if who is None:
            await socket.close(1008, "no ticket, or an old one")
            return
        if self._open >= MOST_SOCKETS:
            await socket.close(1013, f"{MOST_SOCKETS} pages are open already; close one of them")
            return
        self._open += 1
        try:
            await self._relay(socket, who)
        finally:
            self._open -= 1

    async def _first_word(self, socket: WebSocket) -> Pass | None:
        """The ticket, which belongs to the same pass as the cookie."""
        with suppress(TimeoutError):
            first = _read(await asyncio.wait_for(socket.receive(), FIRST_WORD))
            who, held = self._keys.read(str(first.get("ticket")), TICKET), cast("Pass", socket.scope["pass"])
            return held if who and who.role == held.role else None
        return None

    async def _relay(self, socket: WebSocket, who: Pass) -> None:
        try:
            reader, writer = await asyncio.open_unix_connection(self._channel, limit=LONGEST)
        except OSError:
            await socket.close(1011, "the live axis has gone")
            return
        for first in ({"do": "name", "who": person(socket)}, {"do": "watch", "rate": RATE}):
            writer.write(json.dumps(first).encode() + b"\n")
        tasks = {
            asyncio.ensure_future(self._to_axis(socket, writer, who)),
            asyncio.ensure_future(_to_page(socket, reader)),
        }
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            writer.close()  # the axis stops what this page had under way
            await asyncio.gather(*tasks, return_exceptions=True)
            with suppress(RuntimeError, WebSocketDisconnect):
                await socket.close()

    async def _to_axis(self, socket: WebSocket, writer: asyncio.StreamWriter, who: Pass) -> None:
        commands, refusals = Budget(A_SECOND), Budget(FLOOD)
        while True:
            told = await socket.receive()
            if told["type"] == "websocket.disconnect":
                return
            message, wrong = self._message(told)
            word = message.get("do", "")
            if not wrong and word not in FREE and writer.transport.get_write_buffer_size() > MOST_WAITING:
                wrong = "the axis is busy with what was asked before (a stop is always taken)"
            if not wrong and not who.may(needed := self.role_for(word)):
                wrong = f"a {who.role} may not {word}; it needs {needed}"
            if not wrong and (word in FILES or (word == "job" and not isinstance(message.get("value"), dict))):
                wrong = f"a page opens no file of that computer, so that {word} of one is for: detent connect"
            if word not in FREE and not commands.take():
                wrong = f"more than {A_SECOND:g} messages a second; send fewer (a stop is always taken)"
            if wrong and not refusals.take():
                await socket.close(1008, "too many messages")
                return
            if wrong:
                mark = {"as": message["as"]} if "as" in message else {}
                await socket.send_text(json.dumps(mark | {"error": wrong}))
                await asyncio.sleep(0)  # a thousand of them may wait to be read; others have their turn between
                continue
            if word in FREE:
                await self._stop(socket, message)
            else:
                writer.write(json.dumps(message).encode() + b"\n")

    async def _stop(self, socket: WebSocket, message: dict[str, Any]) -> None:
        """Ask on the panel's own line: what this page has asked before may keep the axis waiting, for a disk say."""
        assert self.line is not None  # noqa: S101 - the server takes no socket before
        mark = {"as": message["as"]} if "as" in message else {}
        said = {"do": message["do"], "who": person(socket)}
        try:
            told = await self.line.ask(said, lambda ended: asyncio.ensure_future(_tell(socket, ended)))
        except DetentError as error:
            told = {"error": str(error)}
        await _tell(socket, told | mark)

    def _message(self, told: Any) -> tuple[dict[str, Any], str]:
        """What a page says, as far as it is passed on; and what is wrong with it."""
        said = _read(told)
        mark, word = said.get("as", 0), said.get("do")
        if isinstance(mark, bool) or not isinstance(mark, int | str) or len(str(mark)) > 40:
            return {}, '"as" is a number or a short text'
        if not isinstance(word, str) or len(word) > 40:
            passed = {"as": mark} if "as" in said else {}
            return passed, 'a message is JSON, an object with "do", a command'
        return (said if word in self.looks else {name: said[name] for name in TAKEN if name in said}), ""

    def role_for(self, word: str) -> str:
        """Least role that may say a word."""
        if word in FREE or word in self.looks:
            return "viewer"
        return "engineer" if word in ENGINEERS else "operator"


async def _tell(socket: WebSocket, message: dict[str, Any]) -> None:
    with suppress(RuntimeError, WebSocketDisconnect):  # it has closed
        await socket.send_text(json.dumps(message))


def _read(told: Any) -> dict[str, Any]:
    """An object that came as text; an empty one where something else did."""
    try:
        read: Any = json.loads(told.get("text") or "")
    except (ValueError, RecursionError):
        return {}
    return cast("dict[str, Any]", read) if isinstance(read, dict) else {}


async def _to_page(socket: WebSocket, reader: asyncio.StreamReader) -> None:
    while line := await reader.readline():
        if line.startswith(b'{"rows"'):
            rows = json.loads(line)["rows"]
            data = base64.b64decode(rows["data"])
            channels = len(data) // 4 // rows["n"] if rows["n"] else 0
            if channels:
                await socket.send_bytes(struct.pack("<qII", rows["first"], rows["n"], channels) + data)
        else:
            await socket.send_text(line.decode().rstrip())
