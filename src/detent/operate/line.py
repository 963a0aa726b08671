"""A client's side of the channel to a live axis, for a program of many tasks: the panel, and every face."""

import asyncio
import json
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any, cast

from detent.errors import AxisError, DetentError

LONGEST = 4 << 20  # bytes of an answer: the axis file may have one million
MOST_EARLY = 64  # endings that are kept for who asks after them
PATIENCE = 5.0  # how long an answer is waited for [s]


Tell = Callable[[dict[str, Any]], object]


class Line:
    """Asks and hears."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader, self._writer, self._marks = reader, writer, count()
        self._asked: dict[str, asyncio.Future[dict[str, Any]]] = {}
        self._tell: dict[str | int, Tell] = {}  # who wants to hear of an ending: by mark, then by the command's id
        self._early: dict[int, dict[str, Any]] = {}  # endings of commands whose number has not come yet
        self.gone = asyncio.Event()
        self.watched: Tell | None = None  # takes the status that comes by itself once it was asked to `watch`
        self._hearing = asyncio.ensure_future(self._hear())

    @classmethod
    async def open(cls, path: Path, who: str, *, remote: bool = False) -> "Line":
        """Attach to an axis; `remote`: for somebody who is elsewhere, as the selector has it."""
        reader, writer = await asyncio.open_unix_connection(path, limit=LONGEST)
        line = cls(reader, writer)
        await line.ask({"do": "name", "who": who, "remote": remote})
        return line

    async def ask(self, message: dict[str, Any], tell: Tell | None = None) -> dict[str, Any]:
        """Ask, and wait for the answer; `tell` is called with the ending of a command."""
        mark = f"line {next(self._marks)}"
        if tell is not None:
            self._tell[mark] = tell
        self._asked[mark] = answer = asyncio.get_running_loop().create_future()
        try:
            self._writer.write(json.dumps(message | {"as": mark}).encode() + b"\n")
            told = await asyncio.wait_for(answer, PATIENCE)
        except (OSError, TimeoutError) as error:
            raise AxisError("the live axis does not answer; look at the process that runs it") from error
        finally:
            del self._asked[mark]
            self._tell.pop(mark, None)
        if "error" in told:
            raise DetentError(told["error"])
        return told

    def tell(self, message: dict[str, Any]) -> None:
        """Say what needs no answer."""
        self._writer.write(json.dumps(message).encode() + b"\n")

    async def _hear(self) -> None:
        try:
            while text := await self._reader.readline():
                message = cast("dict[str, Any]", json.loads(text))
                mark = message.get("as", "")
                if "id" in message and (tell := self._tell.pop(mark, None)):
                    if (early := self._early.pop(message["id"], None)) is not None:
                        tell(early)
                    else:
                        self._tell[message["id"]] = tell
                if "ended" in message:
                    self._end(message)
                if "status" in message and "as" not in message and self.watched is not None:
                    self.watched(message)
                waiting = self._asked.get(mark)
                if waiting is not None and not waiting.done():
                    waiting.set_result(message)
        except (OSError, ValueError):
            pass
        self.gone.set()

    def _end(self, message: dict[str, Any]) -> None:
        """An ending; one that a disk was asked for may come before the number of its command does."""
        if tell := self._tell.pop(message["ended"]["id"], None):
            tell(message)
            return
        self._early[message["ended"]["id"]] = message
        while len(self._early) > MOST_EARLY:
            del self._early[next(iter(self._early))]

    def close(self) -> None:
        """Leave."""
        self._hearing.cancel()
        self._writer.close()
