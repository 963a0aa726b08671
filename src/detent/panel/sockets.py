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

from detent.panel.keys import TICKET, Keys, Pass
from detent.panel.line import LONGEST

MOST_SOCKETS = 16
LONGEST_FRAME = 1 << 16  # bytes, as in the channel
FIRST_WORD = 2.0  # until the ticket must be there [s]
A_SECOND = 50  # commands of a client
FLOOD = 1000  # refused ones in a second, until it is put out
RATE = 25  # of status [Hz]

FREE = {"stop", "disable"}  # from everybody, and never counted
ENGINEERS = {"trust", "order", "inject"}
TAKEN = ("do", "value", "speed", "as")  # of a command


class Budget:
    """Commands that a client may send; they come back with time."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._at, self._left = clock, clock(), float(A_SECOND)
        self.refused = 0.0

    def take(self) -> bool:
        """Spend one, if there is one."""
        now = self._clock()
        passed, self._at = now - self._at, now
        self._left = min(A_SECOND, self._left + A_SECOND * passed)
        self.refused = max(0.0, self.refused - FLOOD * passed)
        if self._left < 1.0:
            self.refused += 1
            return False
        self._left -= 1.0
        return True


class Sockets:
    """All sockets of the panel."""

    def __init__(self, channel: Path, keys: Keys) -> None:
        self._channel, self._keys = channel, keys
        self._open = 0
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
        with suppress(TimeoutError, WebSocketDisconnect, ValueError, KeyError, TypeError, AttributeError):
            first = json.loads(await asyncio.wait_for(socket.receive_text(), FIRST_WORD))
            who = self._keys.read(str(first["ticket"]), TICKET)
            held: Pass = socket.scope["pass"]
            return who and who._replace(name=held.name) if who and who.role == held.role else None
        return None

    async def _relay(self, socket: WebSocket, who: Pass) -> None:
        try:
            reader, writer = await asyncio.open_unix_connection(self._channel, limit=LONGEST)
        except OSError:
            await socket.close(1011, "the live axis has gone")
            return
        place = socket.client.host if socket.client else "?"
        for first in ({"do": "name", "who": f"{who.role} {who.name[:6]} from {place}"}, {"do": "watch", "rate": RATE}):
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
        budget = Budget()
        while True:
            told = await socket.receive()
            if told["type"] == "websocket.disconnect":
                return
            message, wrong = self._message(told.get("text"))
            word = message.get("do", "")
            if not wrong and word not in FREE and not budget.take():
                wrong = f"more than {A_SECOND} commands a second; send fewer (a stop is always taken)"
            if not wrong and not who.may(needed := self.role_for(word)):
                wrong = f"a {who.role} may not {word}; it needs {needed}"
            if wrong:
                if budget.refused > FLOOD:
                    await socket.close(1008, "too many commands")
                    return
                mark = {"as": message["as"]} if "as" in message else {}
                await socket.send_text(json.dumps(mark | {"error": wrong}))
                continue
            writer.write(json.dumps(message).encode() + b"\n")
            await writer.drain()

    def _message(self, text: str | None) -> tuple[dict[str, Any], str]:
        """What a page says, as far as it is passed on; and what is wrong with it."""
        try:
            read: Any = json.loads(text or "")
        except (ValueError, RecursionError):
            return {}, "that is no JSON"
        said = cast("dict[str, Any]", read) if isinstance(read, dict) else {}
        mark = said.get("as", 0)
        if isinstance(mark, bool) or not isinstance(mark, int | str) or len(str(mark)) > 40:
            return {}, '"as" is a number or a short text'
        word = said.get("do")
        if not isinstance(word, str) or len(word) > 40:
            return {name: said[name] for name in ("as",) if name in said}, 'a message is an object with "do", a command'
        return (said if word in self.looks else {name: said[name] for name in TAKEN if name in said}), ""

    def role_for(self, word: str) -> str:
        """Least role that may say a word."""
        if word in FREE or word in self.looks:
            return "viewer"
        return "engineer" if word in ENGINEERS else "operator"


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
